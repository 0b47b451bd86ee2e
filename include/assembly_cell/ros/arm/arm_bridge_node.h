// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/Ack.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/Lease.h>
#include <assembly_cell/PlantState.h>
#include <assembly_cell/WrenchSamples.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/transform_broadcaster.h>

#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/guard/freshness.h"
#include "assembly_cell/ros/arm/arm_output.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/static_frames.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/process/participants.h"

namespace assembly_cell::ros_bridge {

class Parameters;

/// Node arm_bridge: stands between the supervisor and an arm as the plant does: takes
/// carrier_command, exciter and leases, sends the arm a point each period and tells where it is.
/// Limits and dead man are those of arm/arm_guard.h. Without lockstep one thread
/// handles the received messages and computes the points; in lockstep those of a block follow from
/// it, once all participants have answered it. See docs/how_to/arm.md.
class ArmBridgeNode {
 public:
  /// Of its callbacks: one keeps commands, blocks and states in order.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, file or robot description.
  ArmBridgeNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~ArmBridgeNode();

 private:
  /// The arm's own word.
  struct State {
    ros::Time stamp;
    Vector6 carrier = Vector6::Zero();  ///< coordinates, see coordinatesOf()
  };

  void readParameters(ros::NodeHandle& pnh);
  void readArm(Parameters& parameters);
  void advertise(ros::NodeHandle& pnh);
  void subscribe();
  void publishFrames();

  // what comes in
  template <class Message>
  Sender senderOf(const ros::MessageEvent<Message const>& event) const;  // lock
  bool isFromEarlierBoot(const Sender& sender) const;                    // lock
  void onCarrierCommand(const ros::MessageEvent<geometry_msgs::PoseStamped const>& event);
  void onExciter(const ros::MessageEvent<Exciter const>& event);
  void onLease(const ros::MessageEvent<Lease const>& event);
  void onAck(const ros::MessageEvent<Ack const>& event);
  void onWrench(std::size_t sensor, const WrenchSamples& samples);
  void onBias(std::size_t sensor, const geometry_msgs::WrenchStamped& bias);
  void onJoints(const sensor_msgs::JointState& joints);
  void onState(const Pose& X_base_flange, const ros::Time& stamp);  // lock
  void onStop(const std::string& who);
  bool onResume(std_srvs::Trigger::Response& response);

  // all with the lock
  void act(const std::function<void()>& task);  ///< now, or in lockstep at the block's end
  void take(const Sender& sender, const geometry_msgs::PoseStamped& command);
  void take(const Sender& sender, const Exciter& exciter);
  void renewFor(const Sender& sender, std::uint32_t session);
  void refuse(const std::string& what, const std::string& node, const GuardVerdict& why);
  void anotherLife(const ros::Time& stamp);
  Vector6 weightChange() const;          ///< of the payload since the zero was taken, sensor_b
  void showLife(const ros::Time& seen);  ///< of a block
  void tellPoses();                      ///< of the carrier at the ends of blocks
  void endBlock();
  void point(double now);
  void watchExciter();
  void publishState();
  void publishExciter(const Exciter& exciter);

  void runPoints();
  void beat();
  void keepConnections();
  void publishDiagnostics();
  double nodeTime(const ros::Time& stamp) const;
  ros::Time stampAt(double time) const;
  double now() const;  ///< node time [s]

  using Steady = std::chrono::steady_clock;
  // at the pace of the cell
  double wall() const {
    return real_time_factor_ *
           std::chrono::duration<double>(Steady::now().time_since_epoch()).count();
  }

  ros::CallbackQueue queue_;  // of the thread of the points
  ros::NodeHandle nh_, arm_nh_;
  const std::string name_;
  // parameters
  bool lockstep_ = false, joint_state_ = true, publish_frames_ = true;
  BridgeSettings settings_;
  double real_time_factor_ = 1.0;  // of a simulation: cell time a time of the wall clock
  double payload_mass_ = 0.0, gravity_ = 9.80665;
  Eigen::Vector3d payload_centre_ = Eigen::Vector3d::Zero();
  std::vector<std::string> participant_names_;
  ArmOutput::Settings output_settings_;
  std::unique_ptr<ArmKinematics> kinematics_;
  std::unique_ptr<ArmOutput> output_;

  std::mutex mutex_;
  ArmGuard arm_, new_arm_;  // and as it is at the beginning
  std::uint32_t life_ = 0;
  CellClock clock_;
  ros::Time epoch_;              // stamp of node time 0; zero: not known yet
  std::array<bool, 2> heard_{};  // either sensor
  Participants participants_;
  std::optional<JointVector> joints_seen_;  // of the last state
  Pose X_base_flange_;                      // there
  std::deque<State> states_;                // the latest second
  std::deque<ros::Time> poses_wanted_;      // ends of blocks
  std::array<Vector6, 2> zeros_{Vector6::Zero(), Vector6::Zero()};
  Eigen::Matrix3d zero_turn_ = Eigen::Matrix3d::Identity();  // of the carrier when it was taken
  std::vector<double> felt_;                                 // of a block, weight taken off
  // lockstep
  std::array<std::optional<std::uint32_t>, 2> sequence_;  // of the last block of either sensor
  std::optional<std::uint32_t> done_;                     // answered
  double block_end_ = 0.0, block_length_ = 0.0;           // node time [s]
  ros::Time pose_told_;
  std::vector<std::function<void()>> waiting_;  // for the block's end
  std::uint32_t drives_ = 0;                    // exciter messages sent
  std::uint32_t checked_ = 0, blocks_ = 0;

  bool driving_ = false;  // the exciter is on, by what was sent last
  std::uint32_t refused_ = 0;
  std::string refused_node_;
  GuardVerdict refusal_;
  PlantState told_;
  bool told_any_ = false;
  std::uint64_t points_ = 0;

  ros::Publisher carrier_pub_, plant_state_pub_, exciter_pub_, wrench_pub_, lease_pub_,
      diagnostics_pub_;
  LatestPublisher<Ack> ack_pub_;
  ros::Subscriber command_sub_, exciter_sub_, lease_sub_, ack_sub_, stop_sub_;
  StreamSubscriber state_sub_;
  std::array<StreamSubscriber, 2> wrench_subs_;
  std::array<ros::Subscriber, 2> bias_subs_;
  ros::ServiceServer resume_srv_, stop_srv_;
  ros::WallTimer diagnostics_timer_, connection_timer_;
  tf2_ros::TransformBroadcaster tf_;
  StaticFrames static_tf_;
  std::atomic<bool> stopping_{false};
  std::thread points_thread_;  // last: uses the other members
};

}  // namespace assembly_cell::ros_bridge
