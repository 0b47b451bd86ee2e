// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/client/simple_action_client.h>
#include <ros/ros.h>

#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/Exciter.h"
#include "assembly_cell/IdentifyLocusAction.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/estimation/sample_window.h"
#include "assembly_cell/align/plant.h"

namespace assembly_cell::ros_bridge {

/// A locus measurement by the action identify_locus, one at a time. Thread-safe; `changed` is
/// called when an answer arrives.
class LocusRequests {
 public:
  LocusRequests(ros::NodeHandle& nh, std::function<void()> changed);

  bool isConnected() const { return client_.isServerConnected(); }
  /// Node that serves the action; empty: not known yet.
  std::string server() const;

  /// window: that of the goal, plant clock. The caller must hold no lock that callbacks take:
  /// actionlib has locks of its own.
  void send(const IdentifyLocusGoal& goal, const LocusRequest& window);
  void cancel();
  /// Sent, and neither taken nor cancelled.
  bool isPending() const;
  LocusRequest window() const;  ///< of the latest request, plant clock
  bool isAccepted() const;      ///< by the server, or already done
  bool isDone() const;

  /// The result of a request that is done, which is not pending any more.
  struct Outcome {
    std::optional<LocusReading> reading;
    std::string error;      ///< why there is none
    bool is_final = false;  ///< nor was there one the time before
  };
  Outcome take();

 private:
  void onDone(const actionlib::SimpleClientGoalState& state,
              const IdentifyLocusResult::ConstPtr& result);

  const std::function<void()> changed_;
  mutable std::mutex mutex_;
  std::string server_;
  LocusRequest window_;
  bool pending_ = false, accepted_ = false, done_ = false;
  Outcome outcome_;
  bool has_failed_ = false;  // the request before
  ros::Subscriber status_sub_;
  actionlib::SimpleActionClient<IdentifyLocusAction> client_;
};

/// Fits the vibration of sensor_b's wrench at the exciter's frequency over a window, which may
/// begin in the recent past. Not thread-safe.
class VibrationWindow {
 public:
  /// window: plant clock. exciter: commanded; origin: time 0 of the plant clock.
  void begin(const LocusRequest& window, const Exciter& exciter, const ros::Time& origin);
  void add(const WrenchSamples::ConstPtr& samples);
  void cancel() { window_.cancel(); }
  void clear();
  /// A window is under way.
  const std::optional<LocusRequest>& window() const { return window_.window(); }
  /// All samples of the window have been added by `time`, plant clock [s].
  bool endsBy(double time) const { return window_.endsBy(time); }
  /// Ends the window. Throws PlantError if it has too few samples.
  HarmonicFit take();

 private:
  void collect(const WrenchSamples& samples);

  std::deque<WrenchSamples::ConstPtr> recent_;
  SampleWindow window_;
  Exciter exciter_;
  ros::Time origin_;
};

/// Has the window ended by `time`, plant clock [s]? Stamps are rounded to 1 ns.
inline bool hasEnded(const LocusRequest& window, double time) {
  return time >= window.start + window.duration - 1e-6;
}

}  // namespace assembly_cell::ros_bridge
