// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/emulated_arm_node.h"

#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <cmath>

#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/arm/arm_parameters.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/process/lockstep.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kJump = 0.02;         // of the simulator's carrier: it was put somewhere else [m]
constexpr double kTwistTimeout = 0.1;  // a twist holds no longer [s]

}  // namespace

EmulatedArmNode::EmulatedArmNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh), arm_nh_(nh, "arm"), clock_(true) {
  readParameters(pnh);
  name_in_lockstep_ = participantName(nh_.getNamespace(), pnh.getNamespace());
  // latched: who connects late must not miss the first one
  if (lockstep_) ack_pub_ = {nh_, "ack", kQueue};
  joints_pub_ = arm_nh_.advertise<sensor_msgs::JointState>("joint_states", kQueue, true);
  pose_pub_ = arm_nh_.advertise<geometry_msgs::PoseStamped>("current_pose", kQueue, true);
  motion_pub_ = nh_.advertise<CarrierMotion>("carrier_motion", kQueue, true);
  subscribe();
  unlock_srv_ = pnh.advertiseService<std_srvs::Trigger::Request, std_srvs::Trigger::Response>(
      "unlock", [this](std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
        const std::lock_guard<std::mutex> lock(mutex_);
        response.success = arm_ && arm_->stopped;
        response.message = response.success ? arm_->why : "the arm has not stopped by itself";
        if (response.success) unlock(*arm_);
        return true;
      });
  if (!lockstep_) thread_ = std::thread([this] { loop(); });
}

EmulatedArmNode::~EmulatedArmNode() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    quit_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void EmulatedArmNode::readParameters(ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  EmulatedArmParameters& arm = parameters_;
  lockstep_ = parameters.flag("lockstep", false);
  real_time_factor_ = parameters.number("real_time_factor", Range{1e-3, 1e3}, 1.0);
  interface_ = armInterface(parameters.choice("interface", {"pose", "twist", "joints"}, "joints"));
  readFields(parameters, fieldsOf(arm));
  arm.seed = static_cast<std::uint64_t>(parameters.integer("seed", 0, 2147483647, 1));
  place_ = loadCellPlace(parameters.text("place"));
  const std::string description = parameters.text("description", "arm_description");
  kinematics_ = std::make_unique<ArmKinematics>(Parameters(nh_).text(description), place_.flange,
                                                description);
  const auto n = static_cast<std::size_t>(kinematics_->joints());
  const std::vector<double> home = parameters.numbers("home", n, std::vector<double>(n, 0.0));
  home_ = JointVector::Map(home.data(), static_cast<Eigen::Index>(n));
  parameters.refuseUnknown();
  JointVector q = home_;
  const JointSolution solution = kinematics_->solve(place_.flangeOf(Pose()), q);
  if (solution.reached) return;
  throw InputError(
      text("parameter ~home: from there the arm doesn't reach the place of the "
           "carrier (%g m, %g rad off): give joints near it, see ~place",
           solution.distance, solution.turn));
}

void EmulatedArmNode::subscribe() {
  simulated_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
      arm_nh_, "simulated_pose", kQueue, [this](const auto& m) { onSimulated(*m); }, nullptr,
      lockstep_);
  wrench_sub_ = subscribeStream<WrenchSamples>(
      nh_, "sensor_b/wrench_samples", kQueue, [this](const auto& m) { onWrench(*m); }, nullptr,
      lockstep_);
  switch (interface_) {
    case ArmInterface::kPose:
      command_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
          arm_nh_, "target_frame", kQueue, [this](const auto& m) { onPose(*m); });
      break;
    case ArmInterface::kTwist:
      command_sub_ = subscribeStream<geometry_msgs::TwistStamped>(
          arm_nh_, "twist", kQueue, [this](const auto& m) { onTwist(*m); });
      break;
    case ArmInterface::kJoints:
      command_sub_ = subscribeStream<trajectory_msgs::JointTrajectory>(
          arm_nh_, "command", kQueue, [this](const auto& m) { onJoints(*m); });
      break;
  }
}

// ---- the simulator's side ----

void EmulatedArmNode::place(const Pose& carrier, double time) {
  JointVector q = arm_ ? arm_->q : home_;
  const JointSolution solution = kinematics_->solve(place_.flangeOf(carrier), q);
  if (!solution.reached) {
    ROS_ERROR("the carrier stands %g m, %g rad out of the arm's reach", solution.distance,
              solution.turn);
  }
  arm_ = emulatedArm(parameters_, place_, *kinematics_, q, time);
  wanted_ = q;
  twist_time_ = time;
  if (early_) feel(*early_);
  early_.reset();
}

void EmulatedArmNode::onSimulated(const geometry_msgs::PoseStamped& pose) {
  const Pose X = fromPose(pose.pose, "simulated_pose");
  const double stamp = pose.header.stamp.toSec();
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool anew = !told_ || stamp < *told_;  // or another life of the simulator
  if (anew) {
    epoch_ = pose.header.stamp;
    clock_ = CellClock(!lockstep_);
  }
  told_ = stamp;
  clock_.observe(wall(), stamp);
  const double time = (pose.header.stamp - epoch_).toSec();
  const bool jumped =
      arm_ && (carrier(*arm_, *kinematics_).at.p - X.p).norm() > kJump && arm_->queue.empty();
  if (!anew && !jumped) return;
  place(X, time);
  publish(time);
}

void EmulatedArmNode::onWrench(const WrenchSamples& samples) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (arm_) {
    feel(samples);
  } else {
    early_ = samples;
  }
}

// The bridge's next points, which come by another way, must find this load.
void EmulatedArmNode::feel(const WrenchSamples& samples) {
  const std::size_t count = samples.wrench.size() / 6;
  Vector6 mean = Vector6::Zero();
  for (std::size_t i = 0; i < count; ++i) mean += Vector6::Map(samples.wrench.data() + 6 * i);
  mean /= static_cast<double>(count);
  const bool before = arm_->stopped;
  load(*arm_, mean);
  if (arm_->stopped && !before) ROS_WARN("%s", arm_->why.c_str());
  if (!lockstep_) return;
  Ack ack;
  ack.node = name_in_lockstep_;
  ack.sequence = samples.sequence;
  ack_pub_.publish(ack);
}

void EmulatedArmNode::publish(double time) {
  const JointVector q = encoders(*arm_);
  const ros::Time stamp = epoch_ + ros::Duration(time);
  sensor_msgs::JointState joints;
  joints.header.stamp = stamp;
  joints.name = kinematics_->names();
  joints.position.assign(q.begin(), q.end());
  joints.velocity.assign(arm_->rate.begin(), arm_->rate.end());
  joints_pub_.publish(joints);
  if (pose_pub_.getNumSubscribers() > 0 || lockstep_) {
    pose_pub_.publish(poseStamped(kinematics_->base(), kinematics_->forward(q), stamp));
  }
  const CarrierPoses poses = carrier(*arm_, *kinematics_);
  CarrierMotion motion;
  motion.header.stamp = stamp;
  motion.header.frame_id = kCarrierBaseFrame;
  motion.step = poses.step;
  motion.before = toPose(poses.before);
  motion.at = toPose(poses.at);
  motion.after = toPose(poses.after);
  motion_pub_.publish(motion);
  published_ = time;
}

// ---- the controller's side ----

void EmulatedArmNode::runUntil(double time) {
  if (time <= arm_->time && !lockstep_) return;
  advance(*arm_, *kinematics_, time);
  publish(time);
}

void EmulatedArmNode::goTo(const JointVector& q, const ros::Time& stamp) {
  const double time = (stamp - epoch_).toSec();
  command(*arm_, q, time);
  if (lockstep_) runUntil(time);
}

void EmulatedArmNode::onJoints(const trajectory_msgs::JointTrajectory& trajectory) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!arm_) return;
  const std::vector<std::string>& names = kinematics_->names();
  JointVector q(kinematics_->joints());
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto found =
        std::find(trajectory.joint_names.begin(), trajectory.joint_names.end(), names[k]);
    if (found == trajectory.joint_names.end()) {
      throw InputError("joint_names lacks " + names[k] + ": give all joints of the arm");
    }
    const auto index = static_cast<std::size_t>(found - trajectory.joint_names.begin());
    q(static_cast<Eigen::Index>(k)) = trajectory.points[0].positions[index];
  }
  goTo(q, trajectory.header.stamp);
}

void EmulatedArmNode::onPose(const geometry_msgs::PoseStamped& pose) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!arm_) return;
  if (pose.header.frame_id != kinematics_->base()) {
    throw InputError("frame_id is \"" + printable(pose.header.frame_id) + "\": give " +
                     kinematics_->base());
  }
  kinematics_->solve(fromPose(pose.pose, "target_frame"), wanted_);
  goTo(wanted_, pose.header.stamp);
}

void EmulatedArmNode::onTwist(const geometry_msgs::TwistStamped& twist) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!arm_) return;
  const double time = (twist.header.stamp - epoch_).toSec();
  const double passed = std::clamp(time - twist_time_, 0.0, kTwistTimeout);
  twist_time_ = time;
  Vector6 v;
  v << twist.twist.linear.x, twist.twist.linear.y, twist.twist.linear.z, twist.twist.angular.x,
      twist.twist.angular.y, twist.twist.angular.z;
  wanted_ += passed * kinematics_->rates(wanted_, v);
  goTo(wanted_, twist.header.stamp);
}

double EmulatedArmNode::wall() const {
  return real_time_factor_ *
         std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void EmulatedArmNode::loop() {
  using Steady = std::chrono::steady_clock;
  const auto period = std::chrono::duration_cast<Steady::duration>(
      std::chrono::duration<double>(1.0 / (parameters_.rate * real_time_factor_)));
  auto next = Steady::now();
  std::unique_lock<std::mutex> lock(mutex_);
  while (!quit_) {
    next = std::max(next + period, Steady::now() - period);
    if (changed_.wait_until(lock, next, [this] { return quit_; })) return;
    if (arm_) runUntil(clock_.now(wall()) - epoch_.toSec());
  }
}

}  // namespace assembly_cell::ros_bridge
