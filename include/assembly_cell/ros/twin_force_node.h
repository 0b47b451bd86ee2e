// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/transform_broadcaster.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/AddContact.h"
#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/SolveTwinForce.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/twin_contacts.h"

namespace assembly_cell::ros_bridge {

/// Node twin_force_estimator: pose of the peg in the hole from contacts that both force sensors
/// feel. Keeps contacts and advises the next one; never moves anything. Idle but for the services;
/// once a pose is known it follows the carrier. To be spun by at least two threads. Interfaces:
/// docs/interfaces.md.
class TwinForceNode {
 public:
  /// Throws InputError for a bad parameter, file or robot description.
  TwinForceNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  /// A settled window and where the carrier was.
  struct Reading {
    ContactWindow window;
    Pose X_SC;  ///< S: carrier_base
    ros::Time middle;
    double time_difference = 0.0;  ///< largest, between the two wrenches [s]
  };

  void onWrenchA(const WrenchSamples::ConstPtr& message);
  void onWrenchB(const WrenchSamples::ConstPtr& message);
  void onDisplacement(const DisplacementSamples::ConstPtr& message);
  void onCarrier(const geometry_msgs::PoseStamped::ConstPtr& message);
  void acknowledge();

  bool onTare(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onAdd(AddContact::Request& request, AddContact::Response& response);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onSolve(SolveTwinForce::Request& request, SolveTwinForce::Response& response);

  /// The coming window of both sensors. Throws InputError with the reason of a refusal.
  Reading read(double duration);
  void publishPose();
  TwinForceState status() const;

  std::string name_;  ///< in the simulator's ~participants
  bool lockstep_ = false;
  double window_ = 0.2, time_limit_ = 1e-3, settled_force_ = 0.02;  // [s], [s], [N]
  double carrier_motion_ = 1e-5, data_timeout_ = 10.0;              // [m], wall clock [s]
  double converter_step_ = 0.0;                                     // [V]
  bool use_displacement_ = true;

  mutable std::mutex mutex_;  ///< of the data
  std::condition_variable arrived_;
  std::deque<WrenchSamples::ConstPtr> a_, b_;
  std::deque<DisplacementSamples::ConstPtr> d_;
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_;
  Matrix6 S_a_, S_b_;  ///< volts to wrench, for the rounding
  std::optional<std::uint32_t> last_a_, last_b_, last_d_, acknowledged_;

  mutable std::mutex services_;  ///< one at a time; taken before mutex_
  std::unique_ptr<TwinForceContacts> contacts_;
  std::vector<Reading> readings_;  ///< of the contacts
  std::string signs_ = "undecided";
  bool pose_known_ = false;
  ContactAdvice advice_;
  ReachableContact advised_;

  ros::Publisher pose_pub_, status_pub_, ack_pub_;
  ros::Subscriber a_sub_, b_sub_, d_sub_, carrier_sub_, calibration_a_sub_, calibration_b_sub_;
  ros::ServiceServer tare_srv_, add_srv_, reset_srv_, solve_srv_;
  tf2_ros::TransformBroadcaster tf_;
};

}  // namespace assembly_cell::ros_bridge
