// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/Ack.h"
#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/IdentifyLocusAction.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/plant.h"
#include "assembly_cell/guard/freshness.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/estimation/twin_force_client.h"
#include "assembly_cell/ros/process/shared_spinner.h"
#include "assembly_cell/ros/supervision/plant_link.h"

namespace assembly_cell::ros_bridge {

/// What makes a block, relative to the cell.
constexpr const char* kBlockTopics[] = {"sensor_a/wrench_samples", "sensor_b/wrench_samples",
                                        "sensor_b/displacement_samples", "carrier_pose"};

/// The cell through ROS, as a strategy's plant: commands go out on carrier_command and exciter,
/// blocks come in from both drivers and the carrier, readings from the action identify_locus.
/// In lockstep a block is acknowledged when the strategy asks for the next one, so its decisions
/// follow blocks and not the wall clock; without a strategy at once. The carrier's poses are in its
/// base frame, `carrier_base`.
///
/// Between begin() and end() it holds the plant (PlantLink). Without lockstep a block that is older
/// than kFreshAge is never handed out and never leads to a command. What the plant lost because a
/// lease lapsed is said again, and a reading begins anew; so it does once when the estimator could
/// not finish it or was started anew. The goal goes on.
class RosPlant : public Plant {
 public:
  struct Settings {
    std::string node;             ///< that holds the plant, its whole name
    bool lockstep = false;        ///< answer blocks on `ack`
    double timeout = 10.0;        ///< of every wait in lockstep, and of a goal's first [s wall]
    double data_timeout = 0.3;    ///< without a block the goal ends [s]
    double slow_factor = 1.0;     ///< of data_timeout, for a slow machine
    double goal_time = 900.0;     ///< a goal takes no longer [s]
    double converter_step = 0.0;  ///< of both sensors [V]
  };
  RosPlant(ros::NodeHandle& nh, const Settings& settings);

  /// A strategy takes over: waits for a block, whose end is time 0 of the plant clock.
  /// `cancelled` is asked while waiting; when it says true, next() throws.
  void begin(const std::function<bool()>& cancelled);

  /// The goal has failed: goes on in a session of its own, for `seconds` at most and whatever made
  /// the goal fail, so that the peg can be freed. Throws PlantError where there is no data.
  void recover(double seconds);

  /// Has the goal under way commanded anything?
  bool hasMoved() const;

  /// Do blocks come in? Without them nothing can be felt.
  bool hasData() const;

  /// The node ends: every wait is over, but those of recover().
  void stop() { stopping_ = true; }
  bool stopping() const { return stopping_; }

  /// From now on displacements are those of the coupling that is known instead of the driver's, and
  /// the exciter is asked for what makes its force come as commanded.
  /// Null: as drawn.
  void know(const KnownMechanism* known);

  /// A step, see nextStep().
  PlantBlock next(const PlantCommand& command) override;
  TwinForceSensing* twinForce() override { return &twin_force_; }

  /// The strategy is through: exciter off; hold: the carrier stays where it is.
  void end(bool hold);

  ros::Time stamp() const;               ///< end of the last block
  ros::Time stampOf(double time) const;  ///< of a time on the plant's clock [s]
  double time() const;                   ///< the same on the plant clock, 0 before its start [s]
  Pose carrierMotion() const;            ///< carrier in the carrier frame of begin(), last block
  RestPose startPose() const;            ///< of the carrier at begin(), in its base
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
    Pose X_BC;                                ///< of the carrier
    PlantBlock means;                         ///< all but time and carrier
    std::array<std::uint8_t, 2> saturated{};  ///< channels of sensor_a and sensor_b, a bit each
  };

  /// Of a sensor, over the blocks that were handed out last.
  struct Saturation {
    int blocks = 0;             ///< in a row with a channel at its limit
    std::uint8_t channels = 0;  ///< those that were, a bit each
    ros::Time since;            ///< end of the first of them
  };

  /// The window of a vibration: angles of the exciter, and 6 × n wrenches.
  struct Vibration {
    std::optional<LocusRequest> request;  ///< plant clock [s]
    std::vector<double> angles, wrenches;
  };

  void onWrenchA(const WrenchSamples::ConstPtr& message);
  void onWrenchB(const WrenchSamples::ConstPtr& message);
  void onDisplacementB(const DisplacementSamples::ConstPtr& message);
  void onCarrierPose(const geometry_msgs::PoseStamped::ConstPtr& message);
  void subscribe();
  geometry_msgs::PoseStamped::ConstPtr carrierAtEndOf(const WrenchSamples& block) const;
  std::vector<std::string> missingParts() const;
  Parts& partsOf(std::uint32_t sequence);
  void assemble();
  bool take(const Parts& parts, const geometry_msgs::PoseStamped& carrier);
  void acknowledge();
  void waitFor(std::unique_lock<std::mutex>& lock, const std::string& what,
               const std::function<bool()>& ready);
  void ask(std::unique_lock<std::mutex>& lock, const std::function<void()>& question);
  void waitForChange(std::unique_lock<std::mutex>& lock, const std::function<bool()>& ready);
  void waitForBlock(std::unique_lock<std::mutex>& lock);
  PlantBlock nextBlock(const PlantCommand& command, bool first);
  void takeNext(std::unique_lock<std::mutex>& lock);
  void checkSensors(std::unique_lock<std::mutex>& lock);
  double patience() const;
  double questionTime() const;
  std::string whoIsMissing(std::unique_lock<std::mutex>& lock, bool only_gone);
  void checkGoal() const;
  bool lastIsFresh() const;
  void freshen(std::unique_lock<std::mutex>& lock);
  void repeat(std::unique_lock<std::mutex>& lock);
  void endReading(std::unique_lock<std::mutex>& lock);
  void takeReading(std::unique_lock<std::mutex>& lock, PlantBlock& block);
  void beginVibration(const LocusRequest& request);
  void collect(const WrenchSamples& samples);
  void seen(std::size_t part) { arrived_[part] = Steady::now(); }
  void publishCarrier(const Pose& X_BC);
  void publishExciter(const ExciterParameters& drive);
  void sendLocusGoal(std::unique_lock<std::mutex>& lock, const LocusRequest& request);
  PlantBlock plantBlock(const Block& block) const;

  static constexpr double kProbe = 1.0;  ///< of silence, then the nodes are looked for [s wall]
  using LocusClient = actionlib::SimpleActionClient<IdentifyLocusAction>;

  using Steady = std::chrono::steady_clock;
  static double wallTime(Steady::time_point time) {
    return std::chrono::duration<double>(time.time_since_epoch()).count();
  }

  const Settings settings_;
  const bool lockstep_;
  ros::NodeHandle nh_;
  std::string name_;  ///< in the simulator's ~participants

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<SharedSpinner::Helper> helper_;        ///< of the strategy's thread, during a step
  std::deque<std::pair<std::uint32_t, Parts>> parts_;  // with sequence, not complete yet
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_poses_;  // not used yet
  ros::Time done_end_;                                              ///< of the last complete block
  std::optional<Matrix6> rounding_a_, rounding_b_;
  std::string serial_a_, serial_b_;           // of the sensors that the calibrations are of
  std::optional<std::uint32_t> done_;         // last complete block
  std::optional<std::uint32_t> pending_ack_;  // not acknowledged yet
  std::optional<Block> fresh_;                // complete, not handed out yet
  Block last_;                                // handed out
  std::array<Saturation, 2> saturation_;      // of sensor_a and sensor_b
  bool active_ = false;                       // a strategy is running
  bool moved_ = false;                        // it has commanded something
  bool recovering_ = false;                   // it has failed, the peg is being freed
  double most_time_ = 0.0;                    // of this goal or recovery, plant clock [s]
  double recovery_time_ = 0.0;                // that was given to it [s]
  std::atomic<bool> stopping_{false};
  CellClock clock_;
  Steady::time_point alive_;                           // the strategy's thread was seen
  std::array<Steady::time_point, 4> arrived_{};        // last message of each of kBlockTopics
  std::array<std::string, 4> publishers_;              // and who sent it
  double last_interval_ = 0.0, block_interval_ = 0.0;  // between blocks, wall clock [s]
  Steady::time_point block_arrived_;
  std::optional<Pose> commanded_;  // where the carrier was sent last, this goal
  ros::Time origin_;
  Pose start_;  // X_BC at begin()
  std::function<bool()> cancelled_;
  std::uint32_t commands_ = 0;  // published so far
  Exciter exciter_;             // last published
  bool locus_wanted_ = false;
  bool locus_active_ = false;
  bool locus_done_ = false;
  int locus_attempts_ = 0;  // that the estimator did not finish, of this request
  double locus_start_ = 0.0, locus_end_ = 0.0;  // of a reading of either kind, plant clock [s]
  double locus_duration_ = 0.0;                 // [s]
  std::string locus_node_;                      // who serves identify_locus, as heard last
  std::string locus_error_;
  IdentifyLocusResult::ConstPtr locus_result_;
  Vibration vibration_;
  std::deque<WrenchSamples::ConstPtr> recent_;  // of sensor_b: a window may begin in the past
  DriveErrors drive_;                           // made up for
  std::optional<Matrix6> compliance_;           // of the coupling, where it is known better

  ros::Publisher command_pub_, exciter_pub_;
  LatestPublisher<Ack> ack_pub_;
  std::array<StreamSubscriber, 4> block_subs_;  ///< of kBlockTopics
  ros::Subscriber calibration_a_sub_, calibration_b_sub_;
  ros::Subscriber locus_status_sub_;
  std::unique_ptr<LocusClient> locus_client_;
  PlantLink link_;
  TwinForceClient twin_force_;
};

class Parameters;
/// Parameters of a node that holds the plant: ~lockstep, ~converter_step, ~block_timeout,
/// ~data_timeout, ~slow_factor, ~goal_time. Throws InputError.
RosPlant::Settings plantSettings(Parameters& parameters, const std::string& node);

}  // namespace assembly_cell::ros_bridge
