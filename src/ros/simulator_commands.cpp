// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/conversions.h"
#include "assembly_cell/ros/simulator_node.h"

namespace assembly_cell::ros_bridge {

namespace {

std::string describe(const Eigen::Vector3d& p) {
  return "(" + std::to_string(p.x()) + ", " + std::to_string(p.y()) + ", " + std::to_string(p.z()) +
         ") m";
}

/// Answers a service with the text that `what` returns, or with that of what it throws.
template <class Response, class What>
bool answer(Response& response, const What& what) {
  try {
    response.message = what();
    response.success = true;
  } catch (const std::exception& error) {
    response.message = error.what();
  }
  return true;
}

}  // namespace

// ---- what comes in ----

std::optional<std::string> SimulatorNode::refusal(const geometry_msgs::PoseStamped& command) const {
  if (command.header.frame_id != kCarrierBaseFrame) {
    return "frame_id is \"" + command.header.frame_id + "\": give " + kCarrierBaseFrame;
  }
  Pose X;
  try {
    X = fromPose(command.pose, "pose");
  } catch (const InputError& error) {
    return error.what();
  }
  // far from the scenario's rest pose is a mistake of unit or frame
  const Pose start = inverse(cell_->carrier().base()) * poseFromRest(scenario_.rest);
  if ((X.p - start.p).norm() > max_offset_) {
    return "position " + describe(X.p) + " is more than " + std::to_string(max_offset_) +
           " m from the scenario's rest position " + describe(start.p) + ": see ~max_offset";
  }
  const double angle = Eigen::AngleAxisd(start.R.transpose() * X.R).angle();
  if (angle > max_rotation_) {
    return "orientation is " + std::to_string(angle) + " rad, more than " +
           std::to_string(max_rotation_) + " rad, from the scenario's rest: see ~max_rotation";
  }
  return std::nullopt;
}

void SimulatorNode::onCarrierCommand(
    const ros::MessageEvent<geometry_msgs::PoseStamped const>& event) {
  const geometry_msgs::PoseStamped& command = *event.getConstMessage();
  const auto why = refusal(command);
  if (why) {
    ++refused_;
    ROS_WARN("carrier_command of %s refused: %s", event.getPublisherName().c_str(), why->c_str());
  }
  std::lock_guard<std::mutex> lock(mutex_);
  const bool fresh =
      participants_.count(event.getPublisherName(), "carrier_command", command.header);
  if (fresh && !why) carrier_command_ = fromPose(command.pose, "pose");
  changed_.notify_all();
}

void SimulatorNode::onExciter(const ros::MessageEvent<Exciter const>& event) {
  const Exciter& exciter = *event.getConstMessage();
  const bool good = std::isfinite(exciter.amplitude) && exciter.amplitude >= 0.0 &&
                    std::isfinite(exciter.frequency) && exciter.frequency >= 0.0 &&
                    std::isfinite(exciter.phase) && std::abs(exciter.direction) == 1;
  if (!good) {
    ++refused_;
    ROS_WARN(
        "exciter of %s refused: amplitude %g, frequency %g, phase %g, direction %d: give finite "
        "numbers, amplitude and frequency not negative, direction 1 or -1",
        event.getPublisherName().c_str(), exciter.amplitude, exciter.frequency, exciter.phase,
        exciter.direction);
  }
  std::lock_guard<std::mutex> lock(mutex_);
  const bool fresh = participants_.count(event.getPublisherName(), "exciter", exciter.header);
  if (fresh && good) exciter_ = exciter;
  changed_.notify_all();
}

void SimulatorNode::onAck(const ros::MessageEvent<Ack const>& event) {
  const Ack& ack = *event.getConstMessage();
  std::lock_guard<std::mutex> lock(mutex_);
  if (!participants_.answer(ack, event.getPublisherName())) {
    ROS_WARN_ONCE("ack of %s, which is not in ~participants", ack.node.c_str());
    return;
  }
  changed_.notify_all();
}

// ---- services ----

void SimulatorNode::betweenBlocks(const std::function<void()>& task) {
  std::future<void> done;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    if (quit_) throw InputError("the simulator is shutting down");
    tasks_.emplace_back(task);
    done = tasks_.back().get_future();
  }
  changed_.notify_all();
  // bounded: the loop waits for participants at most ~ack_timeout, then drops its tasks
  done.get();
}

bool SimulatorNode::onPause(std_srvs::SetBool::Request& request,
                            std_srvs::SetBool::Response& response) {
  return answer(response, [&] {
    betweenBlocks([this, &request] {
      std::lock_guard<std::mutex> lock(mutex_);
      paused_ = request.data;
    });
    return std::string(request.data ? "paused" : "running") + " at " + std::to_string(now_) + " s";
  });
}

bool SimulatorNode::onStep(Step::Request& request, Step::Response& response) {
  return answer(response, [&] {
    std::unique_lock<std::mutex> lock(mutex_);
    if (!paused_) throw InputError("not paused: call ~pause with data: true first");
    if (request.blocks == 0) {
      throw InputError("blocks is 0: give the number of blocks to advance");
    }
    if (!stopped_.empty()) {
      throw InputError("the simulation has stopped (" + stopped_ + "): call ~reset first");
    }
    if (steps_ > 0) throw InputError("another ~step is under way");
    steps_ = request.blocks;
    changed_.notify_all();
    const auto done = [this] { return quit_ || steps_ == 0 || !stopped_.empty(); };
    while (ros::ok() && !done()) changed_.wait_for(lock, std::chrono::milliseconds(100), done);
    const std::string time = "at " + std::to_string(now_) + " s";
    const bool short_of_it = std::exchange(steps_, 0) > 0;
    if (!stopped_.empty()) throw InputError(time + ", stopped: " + stopped_);
    if (short_of_it) throw InputError(time);
    return time;
  });
}

bool SimulatorNode::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, [this] {
    betweenBlocks([this] { restart(scenario_); });
    return "at the scenario's start, the clock goes on at " + std::to_string(now_) + " s";
  });
}

bool SimulatorNode::onSetState(SetState::Request& request, SetState::Response& response) {
  return answer(response, [&] {
    // the scenario with another start, at rest
    Scenario scenario = scenario_;
    const Pose X_HP = fromPose(request.peg, "peg");
    scenario.rest = restFromPose(fromPose(request.carrier, "carrier"));
    scenario.initial = InitialState{};
    scenario.initial.position = X_HP.p + scenario.mechanism.peg.half_height * X_HP.R.col(2);
    scenario.initial.euler = eulerFromRotation(X_HP.R);
    scenario.initial.carrier_x = scenario.rest.x;
    scenario.initial.carrier_y = scenario.rest.y;
    scenario.initial.carrier_yaw = scenario.rest.yaw;
    betweenBlocks([this, &scenario] { restart(scenario); });
    return "state set at " + std::to_string(now_) + " s";
  });
}

}  // namespace assembly_cell::ros_bridge
