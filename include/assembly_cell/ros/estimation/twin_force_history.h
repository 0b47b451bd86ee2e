// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <ros/time.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/estimation/averaging_window.h"
#include "assembly_cell/calibration/observations/observation.h"

namespace assembly_cell::ros_bridge {

/// Which blocks are averaged.
struct BlockWindow {
  double duration = 0.0;     ///< of the coming blocks [s], or all blocks
  ros::Time first, last;     ///< that end from first to last, if last is not 0
  std::uint32_t blocks = 0;  ///< their number

  bool isNamed() const { return !last.isZero(); }
};

/// The last minute of both wrenches, the displacement of sensor_b and the carrier, and blocks of
/// them as a strategy's plant returns them. A block that can't be used is kept without its samples,
/// so that a window with it is refused. Not thread-safe.
class TwinForceHistory {
 public:
  using Wrench = WrenchSamples::ConstPtr;
  using Displacement = DisplacementSamples::ConstPtr;
  struct Settings {
    double time_limit = 1e-3;     ///< between the wrenches of both sensors [s]
    double converter_step = 0.0;  ///< of both sensors [V]
    bool use_displacement = true;
  };
  static constexpr double kLength = 60.0;  ///< of blocks that are kept [s]

  explicit TwinForceHistory(const Settings& settings) : settings_(settings) {}

  void add(Side side, const Wrench& wrench);
  void add(const Displacement& displacement);
  void add(const geometry_msgs::PoseStamped::ConstPtr& carrier);
  /// Throws InputError for a bad calibration.
  void add(Side side, const SensorCalibration& calibration);

  bool hasCalibrations() const { return matrices_.a && matrices_.b; }
  /// Covariances of the errors of the calibrations' matrices, see gainCovariance(); 0 × 0: unknown.
  const PerSide<Eigen::MatrixXd>& gainCovariances() const { return gains_; }
  /// Sequence number that all streams have reached together.
  std::optional<std::uint32_t> commonSequence() const;
  ros::Time lastWrench() const;  ///< stamp of the latest block of sensor_b; zero: none

  /// Blocks of sensor_b in the window, coming ones after a stamp. Empty until they have arrived.
  /// Throws InputError for a block that can't be used.
  std::vector<Wrench> select(const BlockWindow& window, const ros::Time& after) const;
  /// What is missing to use all blocks up to `last`; null: nothing.
  const char* missing(const Wrench& last) const;
  /// A block of sensor_b with what belongs to it. origin: of its time. time_difference: raised to
  /// that between the wrenches [s]. Throws InputError with the reason of a refusal.
  PlantBlock blockOf(const Wrench& b, const ros::Time& origin, double& time_difference) const;

  /// The carrier in the latest pose.
  struct Now {
    ros::Time stamp;
    RestPose carrier;
    Vector6 displacement = Vector6::Zero();
  };
  std::optional<Now> now() const;

 private:
  Vector6 displacementOf(const Wrench& b) const;

  const Settings settings_;
  PerSide<std::deque<Wrench>> wrenches_;
  std::deque<Displacement> displacements_;
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_;
  PerSide<std::optional<Matrix6>> matrices_;  // volts to wrench, for the rounding
  PerSide<Eigen::MatrixXd> gains_;
};

/// Stamp of a block's last sample.
ros::Time blockEnd(const WrenchSamples& block);

/// The message without its samples: a block that can't be used. Null: nor can its stamp.
template <class Message>
boost::shared_ptr<const Message> withoutSamples(const Message& message);

}  // namespace assembly_cell::ros_bridge
