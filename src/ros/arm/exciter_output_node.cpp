// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/exciter_output_node.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <std_msgs/Float64.h>

#include <algorithm>
#include <chrono>
#include <utility>

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
constexpr double kPlayed = 0.1;   // a device has played what is in its queue and a fade [s]

}  // namespace

ExciterOutputNode::ExciterOutputNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh), arm_nh_(nh, "arm") {
  readParameters(pnh);
  if (ros::Time::isSimTime()) {
    throw InputError(
        "parameter /use_sim_time is true: a shaker turns by the wall clock, start it "
        "without");
  }
  epoch_ = ros::Time::now();
  open(pnh);
  done_.header.frame_id = kPegFrame;
  done_.direction = 1;
  done_pub_ = arm_nh_.advertise<Exciter>("exciter_done", kQueue, true);
  if (shaker_->speed()) speed_pub_ = arm_nh_.advertise<std_msgs::Float64>("exciter_speed", 1, true);
  diagnostics_pub_ = nh_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  exciter_sub_ = subscribeChecked<Exciter>(
      arm_nh_, "exciter", kQueue,
      [this](const auto& m, const std::string& publisher) { onExciter(*m, publisher); });
  life_sub_ =
      subscribeStream<geometry_msgs::PoseStamped>(nh_, "carrier_pose", 1, [this](const auto&) {
        const std::lock_guard<std::mutex> lock(mutex_);
        alive_ = ros::Time::now();
      });
  index_sub_ = arm_nh_.subscribe<std_msgs::Header>(
      "exciter_index", kQueue, [this](const auto& m) { onIndex(*m); }, ros::VoidConstPtr(),
      ros::TransportHints().tcpNoDelay());
  publishDone();
  diagnostics_timer_ =
      nh_.createWallTimer(ros::WallDuration(0.5), [this](const auto&) { publishDiagnostics(); });
  thread_ = std::thread([this] { loop(); });
}

ExciterOutputNode::~ExciterOutputNode() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    quit_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void ExciterOutputNode::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    reason_ = "the node ends";
    if (asked_.amplitude > 0.0) drive({}, ros::Time::now());
  }
  ros::WallDuration(kPlayed).sleep();
}

void ExciterOutputNode::readParameters(ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  timeout_ = parameters.number("timeout", Range{0.04, 10.0}, timeout_);
  max_amplitude_ = parameters.number("max_amplitude", kNotNegative, max_amplitude_);
  max_frequency_ = parameters.number("max_frequency", kNotNegative, max_frequency_);
  parameters.tell("shaker");
  parameters.refuseUnknown();
}

void ExciterOutputNode::open(ros::NodeHandle& pnh) {
  const std::string name = "parameter " + pnh.resolveName("shaker");
  Parameters parameters(pnh);
  if (!parameters.isTree("shaker")) {
    throw InputError(name + " is no map: give {type: audio, ...}, see docs/how_to/arm.md");
  }
  const YAML::Node map = parameters.tree("shaker");
  type_ = Parameters(ros::NodeHandle(pnh, "shaker")).text("type");
  if (auto own = makeShaker(type_)) {
    shaker_ = std::move(own);
  } else {
    auto plug_in = loadPlugIn<Shaker>("Shaker", type_, name + "/type", shakerTypes());
    loader_ = std::move(plug_in.loader);
    shaker_ = std::move(plug_in.object);
  }
  try {
    shaker_->open(map, 0.0);
  } catch (const std::exception& error) {
    throw InputError(name + ": " + error.what());
  }
  ROS_INFO("shaker %s is open, off until a command comes on arm/exciter", type_.c_str());
}

// ---- commands ----

void ExciterOutputNode::refuse(const std::string& publisher, const std::string& why) {
  ++refused_;
  ROS_WARN_THROTTLE(1.0, "exciter of %s refused: %s", publisher.c_str(), why.c_str());
}

void ExciterOutputNode::onExciter(const Exciter& exciter, const std::string& publisher) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::Time now = ros::Time::now();
  if (!exciter.on || exciter.amplitude == 0.0) {
    reason_.clear();
    drive({}, now);
    return;
  }
  const ExciterCommand command{exciter.amplitude, exciter.frequency, exciter.phase,
                               exciter.direction};
  const double age = (now - exciter.header.stamp).toSec();
  std::string why;
  if (std::abs(age) > timeout_) {
    why = text("stale: it is %g s old: nothing begins by what was said before", age);
  } else if ((now - alive_).toSec() > timeout_) {
    why = text("no carrier_pose for %g s: a shaker without a bridge stays off", timeout_);
  } else if (!(command.amplitude <= max_amplitude_)) {
    why = text("amplitude is %g N: give at most %g (~max_amplitude)", command.amplitude,
               max_amplitude_);
  } else if (!(command.frequency > 0.0 && command.frequency <= max_frequency_)) {
    why = text("frequency is %g rad/s: give more than 0, at most %g (~max_frequency)",
               command.frequency, max_frequency_);
  } else {
    why = shaker_->cannot(command);
  }
  if (!why.empty()) {
    refuse(publisher, why);
    return;
  }
  reason_.clear();
  drive(command, exciter.header.stamp);
}

void ExciterOutputNode::onIndex(const std_msgs::Header& pulse) {
  guarded("exciter_index", [&] {
    const std::lock_guard<std::mutex> lock(mutex_);
    const double age = (ros::Time::now() - pulse.stamp).toSec();
    if (!(std::abs(age) < 1.0)) {
      throw InputError(
          text("stamp is %g s off: give the pulse's time on this computer's clock", age));
    }
    shaker_->index(since(pulse.stamp));
    publishDone();
  });
}

void ExciterOutputNode::drive(const ExciterCommand& command, const ros::Time& reference) {
  asked_ = command;
  shaker_->drive(command, since(reference), since(ros::Time::now()));
  publishDone();
}

// ---- the work ----

void ExciterOutputNode::watch() {
  if (!(asked_.amplitude > 0.0)) return;
  const double silence = (ros::Time::now() - alive_).toSec();
  if (silence <= timeout_ && silence >= -timeout_) return;
  reason_ = text("no carrier_pose for %g s", silence);
  ROS_WARN("exciter off: %s", reason_.c_str());
  drive({}, ros::Time::now());
}

// What the shaker really does, for who reads the locus.
void ExciterOutputNode::publishDone() {
  const ShakerState state = shaker_->state(since(ros::Time::now()));
  Exciter done = done_;
  done.on = state.on;
  done.amplitude = state.force.amplitude;
  done.frequency = state.force.frequency;
  done.phase = state.force.phase;
  done.direction = static_cast<std::int8_t>(state.force.direction);
  // a phase belongs to a moment
  const bool dated = state.on && state.reference != 0.0;
  done.header.stamp = dated ? later(epoch_, state.reference) : ros::Time::now();
  const bool same = told_ && done.on == done_.on && done.amplitude == done_.amplitude &&
                    done.frequency == done_.frequency && done.phase == done_.phase &&
                    done.direction == done_.direction &&
                    (!dated || done.header.stamp == done_.header.stamp);
  if (same) return;
  told_ = true;
  done_ = done;
  done_pub_.publish(done_);
}

void ExciterOutputNode::loop() {
  using Steady = std::chrono::steady_clock;
  const auto period =
      std::chrono::duration_cast<Steady::duration>(std::chrono::duration<double>(kPeriod));
  auto next = Steady::now();
  std::unique_lock<std::mutex> lock(mutex_);
  while (!quit_) {
    next = std::max(next + period, Steady::now());
    if (changed_.wait_until(lock, next, [this] { return quit_; })) return;
    guarded("shaker", [this] { work(); });
  }
}

void ExciterOutputNode::work() {
  watch();
  try {
    shaker_->work(since(ros::Time::now()));
  } catch (const std::exception& error) {
    reason_ = error.what();
    throw;
  }
  if (!shaker_->speed()) return;
  publishDone();
  std_msgs::Float64 speed;
  speed.data = *shaker_->speed();
  speed_pub_.publish(speed);
}

void ExciterOutputNode::publishDiagnostics() {
  diagnostic_msgs::DiagnosticStatus status;
  status.name = "exciter_output: shaker";
  status.hardware_id = type_;
  const std::lock_guard<std::mutex> lock(mutex_);
  const ShakerState state = shaker_->state(since(ros::Time::now()));
  status.level = reason_.empty() ? diagnostic_msgs::DiagnosticStatus::OK
                                 : diagnostic_msgs::DiagnosticStatus::WARN;
  status.message = !reason_.empty() ? "off: " + reason_ : state.on ? "on" : "off";
  publishStatus(diagnostics_pub_, status,
                {{"Force [N]", text("%.4g", state.force.amplitude)},
                 {"Frequency [Hz]", text("%.4g", state.force.frequency / (2.0 * M_PI))},
                 {"Phase is", state.measured ? "measured" : "as played"},
                 {"Latency of the last command [ms]", text("%.1f", 1e3 * state.latency)},
                 {"Gaps", text("%llu", static_cast<unsigned long long>(state.gaps))},
                 {"Commands refused", text("%llu", static_cast<unsigned long long>(refused_))}});
}

}  // namespace assembly_cell::ros_bridge
