// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/goal_clock.h"

#include <ros/init.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "assembly_cell/align/plant.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kIntervals = 15.0;    // missing blocks that end a goal on a slow machine
constexpr double kShutdownWait = 1.0;  // for data while the node shuts down [s wall]

}  // namespace

void fields(FieldList& f, PlantSettings& s) {
  f.choice("sensors", s.sensors, sensorChoices(),
           "Force sensors of the cell: both, or b (sensor_b alone, at the wrist).");
  f.number("converter_step", s.converter_step, notNegative("V"),
           "Step of the converters of both sensors; cell.launch sets it by bits.");
  f.flag("lockstep", s.lockstep, "Blocks are acknowledged; time waits for the node.");
  f.number("block_timeout", s.timeout, {0.1, 3600.0, "s"},
           "Longest wait for the first block of a goal, in lockstep for each, wall clock.");
  f.number("data_timeout", s.data_timeout, {0.05, 3600.0, "s"},
           "A goal ends without data for this time.");
  f.number("slow_factor", s.slow_factor, {1.0, 1000.0},
           "Multiplies data_timeout and the waits for the response of a node, on a slow machine.");
  f.number("goal_time", s.goal_time, {1.0, 1e6, "s"}, "A goal ends after this time, cell time.");
}

void GoalClock::begin(std::function<bool()> cancelled) {
  cancelled_ = std::move(cancelled);
  recovering_ = false;
  origin_ = ros::Time();
  start_ = Pose{};
  time_limit_ = settings_.goal_time;
}

void GoalClock::beginRecovery() {
  recovering_ = true;
  cancelled_ = nullptr;
  time_limit_ = std::numeric_limits<double>::infinity();
}

void GoalClock::limitRecovery(const ros::Time& now, double seconds) {
  recovery_time_ = seconds;
  time_limit_ = (now - origin_).toSec() + seconds;
}

void GoalClock::end() {
  recovering_ = false;
  cancelled_ = nullptr;
}

void GoalClock::setOrigin(const ros::Time& origin, const Pose& X_BC) {
  origin_ = origin;
  start_ = X_BC;
}

double GoalClock::timeOf(const ros::Time& stamp) const {
  return hasOrigin() ? (stamp - origin_).toSec() : 0.0;
}

void GoalClock::check(const ros::Time& now, const std::string& fault) const {
  if (!ros::ok()) throw PlantError(AlignFailure::kStopped, "the node is shutting down");
  if (timeOf(now) > time_limit_) {
    throw PlantError(AlignFailure::kStopped,
                     recovering_
                         ? text("not freed within %g s", recovery_time_)
                         : text("not done within %g s: see ~goal_time", settings_.goal_time));
  }
  if (recovering_) return;
  if (stopping_) throw PlantError(AlignFailure::kStopped, "the node is shutting down");
  if (isCancelled()) throw PlantError(AlignFailure::kCancelled, "cancelled");
  if (!fault.empty()) throw PlantError(AlignFailure::kStopped, fault);
}

double GoalClock::patience(double interval) const {
  const double timeout = settings_.timeout, slow = settings_.slow_factor;
  if (stopping_) return std::min(kShutdownWait * slow, timeout);
  // a goal that is cancelled while the plant is paused is answered soon
  if (recovering_ && settings_.lockstep) return std::min(kProbe * slow, timeout);
  if (settings_.lockstep || !hasOrigin()) return timeout;
  return std::max(settings_.data_timeout * slow, std::min(kIntervals * interval, timeout));
}

}  // namespace assembly_cell::ros_bridge
