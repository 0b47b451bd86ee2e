// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/arm_bridge_node.h"

#include <diagnostic_msgs/DiagnosticArray.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <thread>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/arm/arm_parameters.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/lockstep.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kConnectionCheck = 5.0;  // wall clock [s]
constexpr std::chrono::milliseconds kBehind(100);
constexpr int kCallbacks = 100;  // before a point: a flood doesn't keep it out

std::uint32_t randomLife() {
  std::random_device random;
  std::uint32_t life = 0;
  while (life == 0) life = random();
  return life;
}

}  // namespace

ArmBridgeNode::ArmBridgeNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh), arm_nh_(nh, "arm"), name_(pnh.getNamespace()), life_(randomLife()), clock_(true) {
  readParameters(pnh);
  // by the wall clock the thread of the points hears as well, see beat()
  if (!lockstep_) {
    for (ros::NodeHandle* handle : {&nh_, &arm_nh_, &pnh}) handle->setCallbackQueue(&queue_);
  }
  clock_ = CellClock(!lockstep_);
  if (lockstep_) {
    participants_ = Participants(participant_names_, nh_.getNamespace());
    // blocks are the drivers' word here: an answer may be faster than they
    participants_.expect(std::numeric_limits<std::uint32_t>::max());
  }
  arm_ = new_arm_;
  output_ = std::make_unique<ArmOutput>(arm_nh_, output_settings_, kinematics_.get());
  advertise(pnh);
  subscribe();
  if (publish_frames_) publishFrames();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    publishState();
  }
  ROS_INFO("%s: %.0f points a second, %s", pnh.getNamespace().c_str(), settings_.rate,
           lockstep_ ? "lockstep" : "by the wall clock");
  if (!lockstep_) points_thread_ = std::thread([this] { runPoints(); });
}

ArmBridgeNode::~ArmBridgeNode() {
  stopping_ = true;
  if (points_thread_.joinable()) points_thread_.join();
}

// ---- parameters ----

void ArmBridgeNode::readParameters(ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  const Mechanism mechanism = loadMechanism(
      parameters.text("scenario"), parameters.texts("overrides", std::vector<std::string>{}));
  lockstep_ = parameters.flag("lockstep", false);
  real_time_factor_ = parameters.number("real_time_factor", Range{1e-3, 1e3}, 1.0);
  participant_names_ = parameters.texts("participants", std::vector<std::string>{});
  readFields(parameters, fieldsOf(settings_));
  const std::string mode = parameters.choice("lease", {"auto", "required", "none"}, "auto");
  LeaseMode lease = LeaseMode::kAuto;
  if (mode == "required") lease = LeaseMode::kRequired;
  if (mode == "none") lease = LeaseMode::kNone;
  new_arm_ = bridgeGuard(settings_, mechanism, lease, lockstep_, "parameter ~");
  payload_mass_ = parameters.number("payload_mass", Range{0.0, 100.0}, 0.0);
  const std::vector<double> centre =
      parameters.numbers("payload_centre", 3, std::vector<double>{0.0, 0.0, 0.0});
  payload_centre_ = Eigen::Vector3d::Map(centre.data());
  gravity_ = mechanism.gravity;
  publish_frames_ = parameters.flag("publish_frames", true);
  readArm(parameters);
  parameters.refuseUnknown();
}

void ArmBridgeNode::readArm(Parameters& parameters) {
  ArmOutput::Settings& output = output_settings_;
  output.interface =
      armInterface(parameters.choice("interface", {"pose", "twist", "joints"}, "joints"));
  joint_state_ = parameters.choice("state", {"joints", "pose"}, "joints") == "joints";
  output.place = loadCellPlace(parameters.text("place"));
  output.twist_gain = parameters.number("twist_gain", Range{0.0, 100.0}, output.twist_gain);
  output.base_frame = parameters.text("base_frame", "");
  const std::string description = parameters.text("description", "arm_description");
  if (joint_state_ || output.interface == ArmInterface::kJoints) {
    kinematics_ = std::make_unique<ArmKinematics>(Parameters(nh_).text(description),
                                                  output.place.flange, description);
    if (output.base_frame.empty()) output.base_frame = kinematics_->base();
  }
  if (output.base_frame.empty()) {
    throw InputError("parameter ~base_frame is empty: give the frame of the arm's base");
  }
  if (!joint_state_ && output.interface == ArmInterface::kJoints) {
    throw InputError(
        "parameter ~state is pose while ~interface is joints: joints need joint_states");
  }
}

void ArmBridgeNode::advertise(ros::NodeHandle& pnh) {
  carrier_pub_ = nh_.advertise<geometry_msgs::PoseStamped>("carrier_pose", kQueue, true);
  plant_state_pub_ = nh_.advertise<PlantState>("plant_state", 10, true);
  exciter_pub_ = arm_nh_.advertise<Exciter>("exciter", kQueue, true);
  wrench_pub_ = pnh.advertise<geometry_msgs::WrenchStamped>("wrench", kQueue);
  diagnostics_pub_ = nh_.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  if (lockstep_) ack_pub_ = {arm_nh_, "ack", kQueue};
  if (!lockstep_) lease_pub_ = arm_nh_.advertise<Lease>("lease", kQueue);
  using Request = std_srvs::Trigger::Request;
  using Response = std_srvs::Trigger::Response;
  resume_srv_ = pnh.advertiseService<Request, Response>(
      "resume", [this](Request&, Response& response) { return onResume(response); });
  stop_srv_ = pnh.advertiseService<Request, Response>("stop", [this](Request&, Response& response) {
    onStop("the service stop was called");
    response.success = true;
    response.message = "stopped: start the bridge again to move, in lockstep the whole cell";
    return true;
  });
  using Event = ros::MessageEvent<std_msgs::Bool const>;
  const boost::function<void(const Event&)> on_stop = [this](const Event& event) {
    if (event.getConstMessage()->data) onStop(event.getPublisherName() + " published stop");
  };
  stop_sub_ = pnh.subscribe<std_msgs::Bool, const Event&>("stop", kQueue, on_stop);
  diagnostics_timer_ =
      nh_.createWallTimer(ros::WallDuration(0.5), [this](const auto&) { publishDiagnostics(); });
  if (lockstep_) {
    connection_timer_ = nh_.createWallTimer(ros::WallDuration(kConnectionCheck),
                                            [this](const auto&) { keepConnections(); });
  }
}

// Where a person believes base and hole to be.
void ArmBridgeNode::publishFrames() {
  const CellPlace& place = output_settings_.place;
  const ros::Time stamp = ros::Time::now();
  const Pose X_HB{Eigen::Matrix3d::Identity(), {0.0, 0.0, place.carrier_height}};
  static_tf_.send({transformStamped(kHoleFrame, kCarrierBaseFrame, X_HB, stamp),
                   transformStamped(kHoleFrame, output_settings_.base_frame,
                                    inverse(place.X_base_hole), stamp)});
}

// ---- the points ----

// Points at their rate. Late ones are made up for, by at most kBehind.
void ArmBridgeNode::runPoints() {
  using Clock = std::chrono::steady_clock;
  const auto period = std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(1.0 / (settings_.rate * real_time_factor_)));
  auto next = Clock::now() + period;
  while (!stopping_) {
    std::this_thread::sleep_until(next);
    beat();
    next += period;
    if (Clock::now() - next > kBehind) next = Clock::now();
  }
}

// One wakeup a point: what has come in since the last one is taken just before it; nothing of it
// could move the arm earlier.
void ArmBridgeNode::beat() {
  guarded("callback", [this] {
    const ros::WallDuration at_once(0.0);
    for (int i = 0; i < kCallbacks; ++i) {
      if (queue_.callOne(at_once) != ros::CallbackQueue::Called) return;
    }
  });
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!epoch_.isZero()) point(now());
}

void ArmBridgeNode::point(double time) {
  tick(arm_, time);
  ++points_;
  if (arm_.begun) {
    const std::string why = output_->send(arm_.motion, arm_.measured, stampAt(time));
    if (!why.empty()) hold(arm_, ArmReason::kUnreachable, why);
  }
  watchExciter();
  publishState();
}

// What ended by itself is told to the exciter.
void ArmBridgeNode::watchExciter() {
  if (!driving_ || arm_.guard.shaking) return;
  Exciter off;
  off.header.stamp = stampAt(now());
  off.header.frame_id = kPegFrame;
  off.direction = 1;
  publishExciter(off);
}

void ArmBridgeNode::publishExciter(const Exciter& exciter) {
  driving_ = exciter.on && exciter.amplitude > 0.0;
  ++drives_;
  exciter_pub_.publish(exciter);
}

// All that belongs to the last block is here: its points.
void ArmBridgeNode::endBlock() {
  if (!lockstep_ || !sequence_[0] || sequence_[0] != sequence_[1] || sequence_[1] == done_) return;
  if (nodeTime(pose_told_) < block_end_ - 1e-6) return;
  if (!participants_.missing(*sequence_[1]).empty()) return;
  done_ = sequence_[1];
  ++blocks_;
  std::vector<std::function<void()>> tasks;
  tasks.swap(waiting_);
  for (const auto& task : tasks) task();
  const double period = 1.0 / settings_.rate;
  const auto count = static_cast<int>(std::ceil(block_length_ / period - 1e-6));
  for (int i = 1; i <= count; ++i) {
    point(block_end_ + std::min(i * period, block_length_));
  }
  Ack ack;
  ack.node = participantName(nh_.getNamespace(), name_);
  ack.sequence = *done_;
  ack.commands = drives_;
  ack.session = life_;
  ack_pub_.publish(ack);
}

// A connection that was never made, or got lost, isn't tried again by ROS; what is latched comes
// again.
void ArmBridgeNode::keepConnections() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const bool stuck = blocks_ == checked_ && sequence_[1] != done_;
    checked_ = blocks_;
    if (!stuck) return;
  }
  ROS_WARN("block incomplete: subscribing anew");
  subscribe();
}

double ArmBridgeNode::now() const {
  if (lockstep_) return block_end_;
  return clock_.now(wall()) - epoch_.toSec();
}

double ArmBridgeNode::nodeTime(const ros::Time& stamp) const {
  // differences of ros::Time throw where they are large
  return 1e-9 * static_cast<double>(static_cast<std::int64_t>(stamp.toNSec()) -
                                    static_cast<std::int64_t>(epoch_.toNSec()));
}

ros::Time ArmBridgeNode::stampAt(double time) const {
  ros::Time stamp;
  stamp.fromNSec(epoch_.toNSec() + static_cast<std::uint64_t>(std::max(0.0, time) * 1e9 + 0.5));
  return stamp;
}

// ---- what is told ----

// At each point and each word of the arm: what hasn't changed costs nothing.
void ArmBridgeNode::publishState() {
  const bool held = isHalted(arm_) || arm_.guard.expired;
  if (told_any_ && arm_.guard.session == told_.session && arm_.guard.owner == told_.holder &&
      held == told_.held && isHalted(arm_) == told_.overload && life_ == told_.life &&
      arm_.guard.shaking == told_.exciter && arm_.text == told_.reason &&
      refused_ == told_.refused) {
    return;
  }
  PlantState state;
  state.life = life_;
  state.session = arm_.guard.session;
  state.holder = arm_.guard.owner;
  state.held = held;
  state.overload = isHalted(arm_);
  state.exciter = arm_.guard.shaking;
  state.reason = arm_.text;
  state.refused = refused_;
  state.refused_node = refused_node_;
  state.refused_reason = refusal_.good() ? "" : toString(refusal_.reason);
  state.refusal = refusal_.text;
  if (state.held && !(told_any_ && told_.held)) {
    ROS_WARN("arm %s, exciter off: %s", toString(arm_.mode), arm_.text.c_str());
  }
  if (!epoch_.isZero()) state.header.stamp = stampAt(now());
  told_ = state;
  told_any_ = true;
  plant_state_pub_.publish(state);
}

void ArmBridgeNode::publishDiagnostics() {
  diagnostic_msgs::DiagnosticStatus status;
  status.name = name_.substr(1) + ": arm";
  status.hardware_id = output_settings_.place.flange;
  std::string holder, refusal, place;
  std::uint64_t points = 0;
  std::uint32_t refused = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status.level = isHalted(arm_) ? diagnostic_msgs::DiagnosticStatus::ERROR
                   : arm_.begun   ? diagnostic_msgs::DiagnosticStatus::OK
                                  : diagnostic_msgs::DiagnosticStatus::WARN;
    status.message = toString(arm_.mode);
    if (!arm_.text.empty()) status.message += ": " + arm_.text;
    if (!arm_.begun) {
      status.message += epoch_.isZero() ? ": no samples of sensor_b" : ": no state of the arm";
    }
    holder = arm_.guard.owner;
    refusal = refusal_.text;
    refused = refused_;
    points = points_;
    const Vector6& x = arm_.measured;
    place = text("%.6f %.6f %.6f m, %.5f %.5f %.5f rad", x(0), x(1), x(2), x(3), x(4), x(5));
  }
  publishStatus(diagnostics_pub_, status,
                {{"Reason", toString(arm_.reason)},
                 {"Held by", holder},
                 {"Carrier in its base", place},
                 {"Points sent", std::to_string(points)},
                 {"Commands refused", std::to_string(refused)},
                 {"Last refusal", refusal}});
}

}  // namespace assembly_cell::ros_bridge
