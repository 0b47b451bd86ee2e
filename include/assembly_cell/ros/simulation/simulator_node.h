// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/transform_broadcaster.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/AccelerometerSamples.h"
#include "assembly_cell/Ack.h"
#include "assembly_cell/CarrierMotion.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/Lease.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/SetState.h"
#include "assembly_cell/Step.h"
#include "assembly_cell/StrainSamples.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/guard/plant_guard.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/static_frames.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/process/participants.h"
#include "assembly_cell/ros/process/shared_spinner.h"

namespace assembly_cell::ros_bridge {

class Parameters;

/// Node peg_hole_simulator: the simulated cell in time, paced by the wall clock or in lockstep with
/// its participants. A thread of its own steps block by block; services and commands take effect
/// between two blocks. See docs/reference/interfaces.md.
class SimulatorNode {
 public:
  /// Of commands and acks; services have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters, scenario or robot description.
  SimulatorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);
  ~SimulatorNode();

  /// 1 after a participant has failed to answer.
  int exitCode() const { return exit_code_; }

 private:
  ros::NodeHandle nh_;
  const std::string name_;

  /// From whom, and how old.
  template <class Message>
  Sender senderOf(const ros::MessageEvent<Message const>& event, const char* topic);

  void readParameters(ros::NodeHandle& pnh);
  /// From here on scenario and cell are the truth.
  void drawMismatch(const std::string& file);
  void pairParts();
  void advertise(ros::NodeHandle& pnh);

  void onCarrierCommand(const ros::MessageEvent<geometry_msgs::PoseStamped const>& event);
  void onCarrierMotion(const CarrierMotion& motion);
  /// Where somebody else moves the carrier: with it, or to rest where nothing new is said.
  void followMotion(const std::optional<CarrierMotion>& motion);
  double blockLength() const;  ///< [s]
  void onExciter(const ros::MessageEvent<Exciter const>& event);
  void onAck(const ros::MessageEvent<Ack const>& event);
  void onLease(const ros::MessageEvent<Lease const>& event);
  bool onPause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response);
  bool onStep(Step::Request& request, Step::Response& response);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onSetState(SetState::Request& request, SetState::Response& response);
  void refuseBesideAnArm(const char* what) const;

  /// Lets the loop run `task` between two blocks and waits for it. Rethrows what it throws.
  void betweenBlocks(const std::function<void()>& task);
  void endSteps(const std::string& why);  // of ~step; with the lock
  bool isAnswered() const;                // the last block, by all; with the lock
  void tellLoop();                        // once it is; with the lock
  void loop();
  void runBlock();
  bool computeBlock();  // and publishes it; false: the simulation has stopped; with computing_
  void finishBlock();   // with computing_
  void goOn();
  void applyCommands();
  /// A new cell at the present node time.
  void restart(std::unique_ptr<SimulatedCell> cell);
  void publishBlock();
  void publishStaticFrames();
  void publishState();
  void publishClock(const ros::Time& stamp);
  void publishDiagnostics();
  void subscribeToAcks();
  void askAgain(std::uint32_t sequence);
  void waitForAcks();
  void pace();
  /// Stamp of a time of the present cell.
  ros::Time stampAt(double cell_time) const;
  /// Node time of a stamp, any stamp.
  double nodeTime(const ros::Time& stamp) const;

  // the guard (simulator_guard.cpp); those with a lock need mutex_
  void readGuard(Parameters& parameters);
  void beginLife();  ///< of the plant: a start, or a state that was set
  void findEarlierPublishers();
  void refuse(const std::string& what, const std::string& node, const GuardVerdict& why);  // lock
  void renew(const Sender& sender, std::uint32_t session);                                 // lock
  void watchPlant();
  /// At every sample: stops the plant when its load is too much.
  void feel(const Vector6& load);
  double speedOf(const Pose& target);
  void publishPlantState();

  // parameters
  std::string file_;
  Scenario scenario_;
  CellParameters cell_parameters_;
  CellDescription description_;
  Pose X_HB_;                     // carrier's base in the true hole, its encoders' axes apart
  double believed_height_ = 0.0;  // of the base over the hole, by the scenario's file [m]
  std::string mismatch_;          // what was drawn for the truth, YAML; empty: nothing
  bool lockstep_ = false;
  bool follows_ = false;  // somebody else moves the carrier
  bool publish_truth_ = false;
  double real_time_factor_ = 1.0;
  double ack_timeout_ = 10.0;                          // wall [s]
  double start_timeout_ = 60.0;                        // wall [s]
  double max_speed_ = 0.25, max_acceleration_ = 10.0;  // of the carrier [m/s], [m/s²]
  GuardLimits limits_;
  Braking braking_;
  Load felt_;  // of the coupling: below it no contact is felt
  LeaseMode lease_mode_ = LeaseMode::kAuto;

  // of who computes: the loop, or in lockstep who calls back the last answer (goOn())
  std::mutex computing_;  // before mutex_
  std::unique_ptr<SimulatedCell> cell_;
  StrainBlock block_;
  std::vector<geometry_msgs::TransformStamped> frames_;  // sent last
  double base_ = 0.0;                                    // node time of the cell's time 0 [s]
  std::uint32_t sequence_ = 0;                           // of the next block
  ros::Time epoch_;                                      // stamp of node time 0
  std::chrono::steady_clock::time_point pace_start_;
  double lost_ = 0.0;                // against the wall clock since the start [s]
  double pace_time_ = -1.0;          // node time at pace_start_ [s]; negative: not pacing yet
  Load allowed_;                     // of the coupling during this block
  bool watched_ = true;              // its load is
  std::optional<Vector6> too_much_;  // the load that stopped the plant in this block
  std::uint32_t life_ = 0;
  PlantState plant_state_;  // last published
  bool plant_state_known_ = false;

  // shared with the callbacks, under mutex_
  std::mutex mutex_;
  std::condition_variable changed_;  // what the loop waits for
  std::condition_variable stepped_;  // the last of the steps that ~step waits for
  bool paused_ = false;
  bool quit_ = false;
  std::uint32_t steps_ = 0;  // blocks still to do while paused
  std::string steps_ended_;  // why the last ~step came short
  std::string stopped_;      // why the simulation can't go on; empty while it can
  std::deque<std::packaged_task<void()>> tasks_;
  std::optional<Pose> carrier_command_;
  std::optional<Exciter> exciter_;
  std::optional<CarrierMotion> motion_;  // not used yet
  double motion_time_ = 0.0;             // of the last one, node time [s]
  Participants participants_;
  PlantGuard guard_;
  GuardAction stop_;             // before the commands
  std::string stopped_because_;  // of the last stop in this session
  std::string refused_node_;     // of the last refusal
  GuardVerdict refusal_;
  std::uint32_t awaited_ = 0;                 // block that acks are awaited for
  bool awaiting_ = false;                     // they are
  std::set<std::string> earlier_publishers_;  // topic and node, before this one came to life

  std::atomic<double> now_{0.0};  // node time [s]
  std::atomic<std::uint32_t> refused_{0};
  std::atomic<int> exit_code_{0};
  std::chrono::steady_clock::time_point figures_start_;
  double figures_time_ = 0.0;

  ros::Time clock_stamp_;  // as it was last published
  LatestPublisher<StrainSamples> bridge_a_pub_, bridge_b_pub_;
  LatestPublisher<geometry_msgs::PoseStamped> carrier_pub_;
  ros::Publisher accelerometers_pub_, clock_pub_, truth_pose_pub_, truth_contacts_pub_,
      truth_mismatch_pub_, diagnostics_pub_, plant_state_pub_;
  tf2_ros::TransformBroadcaster tf_;
  StaticFrames static_tf_;
  ros::Subscriber command_sub_, exciter_sub_, ack_sub_, lease_sub_;
  StreamSubscriber motion_sub_;
  const ros::CallbackInterfacePtr go_on_ = callbackOf([this] { goOn(); });
  ros::CallbackQueue service_queue_;
  ros::ServiceServer pause_srv_, step_srv_, reset_srv_, set_state_srv_;
  GuardedSpinner service_spinner_{3, &service_queue_};  // a pause ends a step that is under way
  ros::WallTimer diagnostics_timer_;
  std::thread thread_;
};

}  // namespace assembly_cell::ros_bridge
