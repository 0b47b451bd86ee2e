// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>

#include <atomic>
#include <functional>
#include <string>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/mechanism/sensors.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

/// Parameters of a node that owns the plant while a goal runs.
struct PlantSettings {
  std::string node;  ///< name of the node, resolved; no parameter
  Sensors sensors = Sensors::kBoth;
  bool lockstep = false;      ///< acknowledge blocks
  double timeout = 10.0;      ///< of every wait in lockstep, and of a goal's first wait [s wall]
  double data_timeout = 0.3;  ///< a goal ends without a block for this time [s]
  double slow_factor = 1.0;   ///< of data_timeout, for a slow machine
  double goal_time = 900.0;   ///< a goal ends after this time [s]
  double converter_step = 10.0 / 65536.0;  ///< of both sensors: 16 bit over ±5 V [V]
};
void fields(FieldList& f, PlantSettings& s);

/// Wall time without a block before the publishers are looked for [s].
inline constexpr double kProbe = 1.0;

/// The plant clock of a goal, and when the goal or one of its waits has to end. Times of the plant
/// clock count from the end of the goal's first block [s]. Not thread-safe, but for stop().
class GoalClock {
 public:
  explicit GoalClock(const PlantSettings& settings) : settings_(settings) {}

  /// A goal begins; its clock isn't set yet. `cancelled` is polled by check().
  void begin(std::function<bool()> cancelled);
  /// The goal has failed: from now on only recovery ends, and only by limitRecovery().
  void beginRecovery();
  void limitRecovery(const ros::Time& now, double seconds);
  void end();
  /// The node shuts down: check() throws, but not during a recovery. Thread-safe.
  void stop() { stopping_ = true; }
  bool isStopping() const { return stopping_; }
  bool isRecovering() const { return recovering_; }

  /// Time 0 is `origin`, with the carrier at X_BC in its base.
  void setOrigin(const ros::Time& origin, const Pose& X_BC);
  bool hasOrigin() const { return !origin_.isZero(); }
  double timeOf(const ros::Time& stamp) const;  ///< 0 without an origin
  ros::Time stampOf(double time) const { return origin_ + ros::Duration(time); }
  const Pose& start() const { return start_; }  ///< X_BC at time 0

  /// The goal was cancelled, or the node shuts down.
  bool isCancelled() const { return stopping_ || (cancelled_ && cancelled_()); }
  /// Throws PlantError when the goal has to end. now: end of the latest block; fault: of the plant,
  /// empty: none.
  void check(const ros::Time& now, const std::string& fault) const;
  const PlantSettings& settings() const { return settings_; }
  /// Longest wait for a block, while they come every `interval` [s wall].
  double patience(double interval) const;

 private:
  const PlantSettings settings_;
  std::function<bool()> cancelled_;
  ros::Time origin_;
  Pose start_;
  double time_limit_ = 0.0;     // plant clock [s]
  double recovery_time_ = 0.0;  // allowed for the recovery [s]
  bool recovering_ = false;
  std::atomic<bool> stopping_{false};
};

}  // namespace assembly_cell::ros_bridge
