// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/cell/carrier_arm.h"
#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/geometry/contact_geometry.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/simulation/simulator_node.h"

namespace assembly_cell::ros_bridge {

namespace {

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

constexpr double kFarthest = 0.5;  // of peg and carrier from the hole's mouth [m]
constexpr double kDeepest = 1e-4;  // of a peg in the block: a start that touches may be so [m]

void refuseFar(const char* field, const Pose& X) {
  const double away = X.p.norm();
  if (away <= kFarthest) return;
  throw InputError(text("set_state refused: %s is %.3g m from the hole's mouth: give at most %g m",
                        field, away, kFarthest));
}

// The plant itself looks no deeper than a tenth of the peg's radius.
void refuseDeep(const Scenario& scenario, const Pose& X_HP) {
  const EdgeCircle edge{toThesisAxes(X_HP.p), toThesisAxes(X_HP.R.col(0)),
                        toThesisAxes(X_HP.R.col(1)), tipRadius(scenario.mechanism.peg)};
  if (scenario.contact.law == ContactLaw::kNone) return;
  ContactSet set;
  const ContactSlotMask valid = findContacts(edge, shapesOf(scenario), kAllContactSlots, set);
  double gap = -kDeepest;
  std::string where;
  for (int slot = 0; slot < kContactSlots; ++slot) {
    const ContactPoint& point = set.slots[static_cast<std::size_t>(slot)];
    if ((valid >> slot & 1u) == 0 || point.gap >= gap) continue;
    gap = point.gap;
    const Eigen::Vector3d at = 1e3 * fromThesisAxes(point.p);
    where = text("%.3g mm deep in the block (%s), at x %.1f, y %.1f, z %.1f mm of the hole",
                 -1e3 * gap, toString(point.feature), at.x(), at.y(), at.z());
  }
  if (where.empty()) return;
  throw InputError("set_state refused: peg is " + where +
                   text(": give a pose that is in it by %g mm at most", 1e3 * kDeepest));
}

}  // namespace

// ---- what comes in ----

template <class Message>
Sender SimulatorNode::senderOf(const ros::MessageEvent<Message const>& event, const char* topic) {
  Sender sender;
  sender.node = event.getPublisherName();
  const ros::Time& stamp = event.getConstMessage()->header.stamp;
  sender.stamped = !stamp.isZero();
  sender.stamp = nodeTime(stamp);
  // the first message of who was there before
  sender.latched = earlier_publishers_.erase(topic + sender.node) > 0 &&
                   (*event.getConnectionHeaderPtr())["latching"] == "1";
  return sender;
}

void SimulatorNode::onCarrierCommand(
    const ros::MessageEvent<geometry_msgs::PoseStamped const>& event) {
  const geometry_msgs::PoseStamped& command = *event.getConstMessage();
  std::lock_guard<std::mutex> lock(mutex_);
  const Sender sender = senderOf(event, "carrier_command");
  // what is of an earlier life is not counted: its sender has begun to count anew
  if (!isFromEarlierBoot(guard_, sender, now_) &&
      !participants_.count(sender.node, "carrier_command", command.header)) {
    return;
  }
  tellLoop();
  if (command.header.frame_id != kCarrierBaseFrame) {
    refuse("carrier_command", sender.node,
           {GuardReason::kFrame, "frame_id is \"" + printable(command.header.frame_id) +
                                     "\": give " + kCarrierBaseFrame});
    return;
  }
  try {
    const Pose X = fromPose(command.pose, "pose");
    const GuardVerdict verdict = checkMove(guard_, sender, X, now_);
    if (verdict.good()) carrier_command_ = X;
    if (!verdict.good()) refuse("carrier_command", sender.node, verdict);
  } catch (const InputError& error) {
    refuse("carrier_command", sender.node, {GuardReason::kNotFinite, error.what()});
  }
}

void SimulatorNode::onExciter(const ros::MessageEvent<Exciter const>& event) {
  const Exciter& exciter = *event.getConstMessage();
  std::lock_guard<std::mutex> lock(mutex_);
  const Sender sender = senderOf(event, "exciter");
  if (!isFromEarlierBoot(guard_, sender, now_) &&
      !participants_.count(sender.node, "exciter", exciter.header)) {
    return;
  }
  tellLoop();
  ExciterCommand drive;
  drive.amplitude = exciter.amplitude;
  drive.frequency = exciter.frequency;
  drive.phase = exciter.phase;
  drive.direction = exciter.direction;
  // what is off may have any direction
  if (!exciter.on && std::isfinite(exciter.amplitude)) {
    drive.amplitude = 0.0;
    drive.direction = 1;
  }
  const GuardVerdict verdict = checkExciter(guard_, sender, drive, now_);
  if (verdict.good()) exciter_ = exciter;
  if (!verdict.good()) refuse("exciter", sender.node, verdict);
}

void SimulatorNode::onAck(const ros::MessageEvent<Ack const>& event) {
  const Ack& ack = *event.getConstMessage();
  std::lock_guard<std::mutex> lock(mutex_);
  // kept from an earlier life of this plant, which had come farther
  if (ack.sequence > awaited_) return;
  const std::string why = participants_.answer(ack, event.getPublisherName());
  if (!why.empty()) {
    IncomingLog::ofThisProcess().refuse("ack", event.getPublisherName(), why);
    return;
  }
  // in lockstep the answer is the holder's sign of life
  if (participants_.reportsSession(ack) && ack.sequence >= awaited_) {
    renew({event.getPublisherName(), now_, true, false}, ack.session);
  }
  tellLoop();
}

void SimulatorNode::onLease(const ros::MessageEvent<Lease const>& event) {
  std::lock_guard<std::mutex> lock(mutex_);
  renew(senderOf(event, "lease"), event.getConstMessage()->session);
}

// ---- somebody else's motion ----

void SimulatorNode::onCarrierMotion(const CarrierMotion& motion) {
  std::lock_guard<std::mutex> lock(mutex_);
  motion_ = motion;
  motion_time_ = nodeTime(motion.header.stamp);
  tellLoop();
}

double SimulatorNode::blockLength() const {
  return cell_parameters_.block_size * cell_parameters_.sample_period;
}

void SimulatorNode::followMotion(const std::optional<CarrierMotion>& motion) {
  SimulatorBackend& world = cell_->world();
  if (!motion) {
    if (!world.atRest()) world.stopRest();
    return;
  }
  const auto pose = [](const geometry_msgs::Pose& p) { return fromPose(p, "carrier_motion"); };
  const CarrierPoses poses{motion->step, pose(motion->before), pose(motion->at),
                           pose(motion->after)};
  world.followRest(restMotionOf(poses, cell_->carrier().base()), world.time() + blockLength());
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
      endSteps("~pause was called");
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
    steps_ended_.clear();
    changed_.notify_all();
    const auto done = [this] { return quit_ || steps_ == 0 || !stopped_.empty(); };
    while (ros::ok() && !done()) stepped_.wait_for(lock, std::chrono::milliseconds(100), done);
    const std::string time = "at " + std::to_string(now_) + " s";
    if (steps_ > 0) endSteps(stopped_.empty() ? "shutting down" : "stopped: " + stopped_);
    if (!steps_ended_.empty()) throw InputError(time + ", " + steps_ended_);
    return time;
  });
}

void SimulatorNode::endSteps(const std::string& why) {
  if (steps_ == 0) return;
  steps_ended_ = std::to_string(steps_) + " blocks short: " + why;
  steps_ = 0;
  stepped_.notify_all();
}

// The arm stays where it is, and would take the carrier back there through whatever is between.
void SimulatorNode::refuseBesideAnArm(const char* what) const {
  if (!follows_) return;
  throw InputError(
      std::string(what) +
      " refused: an arm carries the carrier (~follow_motion) and goes on from where it "
      "is; take the peg out by the action retreat, or start the launch file anew");
}

bool SimulatorNode::onReset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer(response, [this] {
    refuseBesideAnArm("reset");
    betweenBlocks(
        [this] { restart(std::make_unique<SimulatedCell>(scenario_, cell_parameters_, X_HB_)); });
    return "at the scenario's start, the clock goes on at " + std::to_string(now_) + " s";
  });
}

bool SimulatorNode::onSetState(SetState::Request& request, SetState::Response& response) {
  return answer(response, [&] {
    refuseBesideAnArm("set_state");
    // the scenario with another start, at rest
    Scenario scenario = scenario_;
    const Pose X_HP = fromPose(request.peg, "peg");
    const Pose X_HC = fromPose(request.carrier, "carrier");
    refuseFar("peg.position", X_HP);
    refuseFar("carrier.position", X_HC);
    scenario.rest = restFromPose(X_HC);
    scenario.initial = InitialState{};
    scenario.initial.position = X_HP.p + scenario.mechanism.peg.half_height * X_HP.R.col(2);
    scenario.initial.euler = eulerFromRotation(X_HP.R);
    scenario.initial.carrier_x = scenario.rest.x;
    scenario.initial.carrier_y = scenario.rest.y;
    scenario.initial.carrier_yaw = scenario.rest.yaw;
    refuseDeep(scenario, X_HP);
    auto cell = std::make_unique<SimulatedCell>(scenario, cell_parameters_, X_HB_);
    betweenBlocks([this, &cell] { restart(std::move(cell)); });
    return "state set at " + std::to_string(now_) + " s";
  });
}

}  // namespace assembly_cell::ros_bridge
