// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/exciter_output_node.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Header.h>

#include <cmath>
#include <utility>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/plug_in.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kPeriod = 5e-3;  // of the work [s]
constexpr double kPlayed = 0.1;   // until a device has played its queue and a fade [s]

}  // namespace

ExciterOutputNode::ExciterOutputNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) : nh_(nh) {
  if (ros::Time::isSimTime()) {
    throw InputError(
        "parameter /use_sim_time is true: a shaker turns by the wall clock, start it without");
  }
  epoch_ = ros::Time::now();
  open(pnh);
  ros::NodeHandle arm_nh(nh_, "arm");
  done_pub_ = arm_nh.advertise<Exciter>("exciter_done", kQueue, true);
  if (shaker_->shaker().speed()) {
    speed_pub_ = arm_nh.advertise<std_msgs::Float64>("exciter_speed", 1, true);
  }
  diagnostics_pub_ = nh_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  subscribe(arm_nh);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    publishDone();
  }
  diagnostics_timer_ = nh_.createWallTimer(ros::WallDuration(0.5), [this](const auto&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    publishDiagnostics();
  });
  thread_.start(kPeriod, [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    work();
  });
}

void ExciterOutputNode::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    shaker_->switchOff("the node ends", now());
    publishDone();
  }
  ros::WallDuration(kPlayed).sleep();
}

void ExciterOutputNode::open(ros::NodeHandle& pnh) {
  const std::string name = "parameter " + pnh.resolveName("shaker");
  Parameters parameters(pnh);
  ShakerLimits limits;
  parameters.read(fieldsOf(limits));
  parameters.markKnown("shaker");
  parameters.refuseUnknown();
  if (!parameters.isTree("shaker")) {
    throw InputError(name + " is no map: give {type: audio, ...}, see docs/how_to/arm.md");
  }
  const YAML::Node map = parameters.tree("shaker");
  type_ = Parameters(ros::NodeHandle(pnh, "shaker")).text("type");
  std::shared_ptr<Shaker> shaker = makeShaker(type_);
  if (!shaker) {
    auto plug_in = loadPlugIn<Shaker>("Shaker", type_, name + "/type", shakerTypes());
    loader_ = std::move(plug_in.loader);
    shaker = std::move(plug_in.object);
  }
  try {
    shaker->open(map, 0.0);
  } catch (const std::exception& error) {
    throw InputError(name + ": " + error.what());
  }
  shaker_ = std::make_unique<GuardedShaker>(std::move(shaker), limits);
  ROS_INFO("shaker %s is open, off until a command on arm/exciter", type_.c_str());
}

void ExciterOutputNode::subscribe(ros::NodeHandle& arm_nh) {
  exciter_sub_ = subscribeChecked<
      Exciter>(arm_nh, "exciter", kQueue, [this](const auto& m, const std::string& publisher) {
    const ExciterCommand command{m->on ? m->amplitude : 0.0, m->frequency, m->phase, m->direction};
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string why = shaker_->drive(command, since(m->header.stamp), now());
    if (why.empty()) {
      publishDone();
    } else {
      ROS_WARN_THROTTLE(1.0, "exciter of %s refused: %s", publisher.c_str(), why.c_str());
    }
  });
  life_sub_ =
      subscribeStream<geometry_msgs::PoseStamped>(nh_, "carrier_pose", 1, [this](const auto&) {
        const std::lock_guard<std::mutex> lock(mutex_);
        shaker_->keepAlive(now());
      });
  index_sub_ = arm_nh.subscribe<std_msgs::Header>(
      "exciter_index", kQueue,
      [this](const auto& pulse) {
        guarded("exciter_index", [&] {
          const std::lock_guard<std::mutex> lock(mutex_);
          const double age = (ros::Time::now() - pulse->stamp).toSec();
          if (!(std::abs(age) < 1.0)) {
            throw InputError(
                text("stamp is %g s off: give the pulse's time on this computer's clock", age));
          }
          shaker_->shaker().index(since(pulse->stamp));
          publishDone();
        });
      },
      ros::VoidConstPtr(), ros::TransportHints().tcpNoDelay());
}

void ExciterOutputNode::work() {
  if (shaker_->work(now())) {
    ROS_WARN("exciter off: %s", shaker_->reason().c_str());
    publishDone();
  }
  if (!speed_pub_) return;
  publishDone();
  std_msgs::Float64 speed;
  speed.data = *shaker_->shaker().speed();
  speed_pub_.publish(speed);
}

// The actual state of the shaker, for the locus estimator.
void ExciterOutputNode::publishDone() {
  const ShakerState state = shaker_->shaker().state(now());
  Exciter done;
  done.header.frame_id = kPegFrame;
  done.on = state.on;
  done.amplitude = state.force.amplitude;
  done.frequency = state.force.frequency;
  done.phase = state.force.phase;
  done.direction = static_cast<std::int8_t>(state.force.direction);
  // a phase belongs to its reference
  const bool dated = state.on && state.reference != 0.0;
  done.header.stamp = dated ? later(epoch_, state.reference) : ros::Time::now();
  const bool same = !done_.header.stamp.isZero() && done.on == done_.on &&
                    done.amplitude == done_.amplitude && done.frequency == done_.frequency &&
                    done.phase == done_.phase && done.direction == done_.direction &&
                    (!dated || done.header.stamp == done_.header.stamp);
  if (same) return;
  done_ = done;
  done_pub_.publish(done_);
}

void ExciterOutputNode::publishDiagnostics() {
  diagnostic_msgs::DiagnosticStatus status;
  status.name = "exciter_output: shaker";
  status.hardware_id = type_;
  const ShakerState state = shaker_->shaker().state(now());
  const std::string& reason = shaker_->reason();
  status.level = reason.empty() ? diagnostic_msgs::DiagnosticStatus::OK
                                : diagnostic_msgs::DiagnosticStatus::WARN;
  status.message = !reason.empty() ? "off: " + reason : state.on ? "on" : "off";
  const auto count = [](std::uint64_t n) { return std::to_string(n); };
  publishStatus(diagnostics_pub_, status,
                {{"Force [N]", text("%.4g", state.force.amplitude)},
                 {"Frequency [Hz]", text("%.4g", state.force.frequency / (2.0 * M_PI))},
                 {"Phase is", state.measured ? "measured" : "as played"},
                 {"Latency of the last command [ms]", text("%.1f", 1e3 * state.latency)},
                 {"Gaps", count(state.gaps)},
                 {"Commands refused", count(shaker_->refused())}});
}

}  // namespace assembly_cell::ros_bridge
