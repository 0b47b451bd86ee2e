// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/CarrierMotion.h>
#include <assembly_cell/WrenchSamples.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "assembly_cell/Ack.h"
#include "assembly_cell/arm/emulated_arm.h"
#include "assembly_cell/guard/freshness.h"
#include "assembly_cell/ros/arm/arm_output.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"

namespace assembly_cell::ros_bridge {

class Parameters;

/// Node emulate_arm: an arm that isn't there, with its driver's topics. It carries the carrier of a
/// simulator with ~follow_motion. Without lockstep its controller keeps to the cell's time as the
/// simulator's messages tell it; in lockstep it answers each block of sensor_b whose load it has
/// taken, and each command takes it to the command's stamp. See docs/how_to/arm.md.
class EmulatedArmNode {
 public:
  /// Of its callbacks.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, file or robot description.
  EmulatedArmNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~EmulatedArmNode();

 private:
  void readParameters(ros::NodeHandle& pnh);
  void subscribe();
  void onSimulated(const geometry_msgs::PoseStamped& pose);
  void onWrench(const WrenchSamples& samples);
  void onJoints(const trajectory_msgs::JointTrajectory& trajectory);
  void onPose(const geometry_msgs::PoseStamped& pose);
  void onTwist(const geometry_msgs::TwistStamped& twist);
  // with the lock
  void feel(const WrenchSamples& samples);
  void place(const Pose& carrier, double time);
  void goTo(const JointVector& q, const ros::Time& stamp);
  void runUntil(double time);
  void publish(double time);
  void loop();
  double wall() const;  ///< at the pace of the cell [s]

  ros::NodeHandle nh_, arm_nh_;
  bool lockstep_ = false;
  double real_time_factor_ = 1.0;  // cell time a time of the wall clock
  ArmInterface interface_ = ArmInterface::kJoints;
  EmulatedArmParameters parameters_;
  CellPlace place_;
  JointVector home_;
  std::unique_ptr<ArmKinematics> kinematics_;

  std::mutex mutex_;
  std::condition_variable changed_;
  bool quit_ = false;
  std::optional<EmulatedArm> arm_;
  std::optional<WrenchSamples> early_;  // a block that came before the arm was placed
  JointVector wanted_;                  // by poses or twists, the last ones
  double twist_time_ = 0.0;             // of the last twist, cell time [s]
  double published_ = 0.0;              // up to there [s]
  std::optional<double> told_;          // stamp of the simulator's last pose [s]
  CellClock clock_;
  ros::Time epoch_;  // cell time is relative to it

  std::string name_in_lockstep_;
  ros::Publisher joints_pub_, pose_pub_, motion_pub_;
  LatestPublisher<Ack> ack_pub_;
  StreamSubscriber simulated_sub_, wrench_sub_, command_sub_;
  ros::ServiceServer unlock_srv_;
  std::thread thread_;
};

}  // namespace assembly_cell::ros_bridge
