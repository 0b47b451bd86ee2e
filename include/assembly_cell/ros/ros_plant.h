// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/IdentifyLocusAction.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/ros/twin_force_client.h"

namespace assembly_cell::ros_bridge {

/// The cell through ROS, as a strategy's plant: commands go out on carrier_command and exciter,
/// blocks come in from both drivers and the carrier, readings from the action identify_locus.
/// In lockstep a block is acknowledged when the strategy asks for the next one, so its decisions
/// follow blocks and not the wall clock; without a strategy at once. The carrier's poses are in its
/// base frame, `carrier_base`.
class RosPlant : public Plant {
 public:
  /// lockstep: answer blocks on `ack`. timeout: of every wait, wall time [s]. converter_step: of
  /// both sensors [V].
  RosPlant(ros::NodeHandle& nh, bool lockstep, double timeout, double converter_step);

  /// A strategy takes over: waits for a block, whose end is time 0 of the plant clock.
  /// `cancelled` is asked while waiting; when it says true, next() throws.
  void begin(const std::function<bool()>& cancelled);

  PlantBlock next(const PlantCommand& command) override;
  TwinForceSensing* twinForce() override { return &twin_force_; }

  /// The strategy is through: exciter off; hold: the carrier stays where it is.
  void end(bool hold);

  ros::Time stamp() const;               ///< end of the last block
  ros::Time stampOf(double time) const;  ///< of a time on the plant's clock [s]
  double time() const;                   ///< the same on the plant clock [s]
  Pose carrierMotion() const;            ///< carrier in the carrier frame of begin(), last block
  Pose carrierPose() const;              ///< in its base, at the last block's end

 private:
  /// A block as its parts come in.
  struct Parts {
    WrenchSamples::ConstPtr wrench_a, wrench_b;
    DisplacementSamples::ConstPtr displacement_b;
  };
  struct Block {
    std::uint32_t sequence = 0;
    ros::Time end;
    Pose X_BC;         ///< of the carrier
    PlantBlock means;  ///< all but time and carrier
  };

  void onWrenchA(const WrenchSamples::ConstPtr& message);
  void onWrenchB(const WrenchSamples::ConstPtr& message);
  void onDisplacementB(const DisplacementSamples::ConstPtr& message);
  void onCarrierPose(const geometry_msgs::PoseStamped::ConstPtr& message);
  void subscribe(const std::string& topic);
  void checkConnections();
  void assemble();
  void acknowledge();
  void waitFor(std::unique_lock<std::mutex>& lock, const std::string& what,
               const std::function<bool()>& ready);
  void publishCarrier(const Pose& X_BC);
  void publishExciter(const ExciterParameters& drive);
  void sendLocusGoal(std::unique_lock<std::mutex>& lock, const LocusRequest& request);
  PlantBlock plantBlock(const Block& block) const;

  using LocusClient = actionlib::SimpleActionClient<IdentifyLocusAction>;

  const bool lockstep_;
  const double timeout_;
  const double converter_step_;  ///< [V]
  ros::NodeHandle nh_;
  std::string name_;  ///< in the simulator's ~participants

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::map<std::uint32_t, Parts> parts_;                            // by sequence, not complete yet
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_poses_;  // not used yet
  ros::Time done_end_;                                              ///< of the last complete block
  bool incomplete_ = false;               ///< a block was, at the last check of the connections
  std::optional<std::uint32_t> checked_;  ///< last complete block then
  std::optional<Matrix6> rounding_a_, rounding_b_;
  std::optional<std::uint32_t> done_;         // last complete block
  std::optional<std::uint32_t> pending_ack_;  // not acknowledged yet
  std::optional<Block> fresh_;                // complete, not handed out yet
  Block last_;                                // handed out
  bool active_ = false;                       // a strategy is running
  ros::Time origin_;
  Pose start_;  // X_BC at begin()
  std::function<bool()> cancelled_;
  std::uint32_t commands_ = 0;  // published so far
  Exciter exciter_;             // last published
  bool locus_wanted_ = false;
  bool locus_active_ = false;
  bool locus_done_ = false;
  double locus_end_ = 0.0;  // plant clock [s]
  std::string locus_error_;
  IdentifyLocusResult::ConstPtr locus_result_;

  ros::Publisher command_pub_, exciter_pub_, ack_pub_;
  std::map<std::string, ros::Subscriber> subs_;  ///< of the blocks' parts, by topic
  ros::Subscriber calibration_a_sub_, calibration_b_sub_;
  ros::WallTimer connection_timer_;
  std::unique_ptr<LocusClient> locus_client_;
  TwinForceClient twin_force_;
};

}  // namespace assembly_cell::ros_bridge
