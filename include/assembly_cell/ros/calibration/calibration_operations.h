// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/CalibrationResult.h>
#include <ros/ros.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/ros/calibration/calibration_drivers.h"
#include "assembly_cell/ros/calibration/calibration_server_settings.h"
#include "assembly_cell/ros/calibration/calibration_topics.h"
#include "assembly_cell/ros/calibration/strain_windows.h"

namespace assembly_cell::ros_bridge {

/// What the services and the action of calibration_server have in common: the session, its
/// journal, the strain windows, the drivers and the topics that report a change. Functions that
/// change observations or calibrations need the lock of acquire(); the others are safe from every
/// thread. All throw InputError for a request that is refused.
class CalibrationOperations {
 public:
  struct Stored {
    std::string id, message;
  };

  /// Opens the journal. `stop`: polled while a window fills; empty, or why to give up. Throws
  /// InputError for a damaged journal.
  CalibrationOperations(const ros::NodeHandle& nh, const ros::NodeHandle& pnh,
                        CalibrationServerSettings settings, std::function<std::string()> stop);

  const CalibrationServerSettings& settings() const { return settings_; }
  const CalibrationSession& session() const { return session_; }
  const CalibrationTopics& topics() const { return *topics_; }
  std::uint32_t observationCount() const;
  /// Steps of a named plan; seed 0 counts as 1.
  std::vector<LoadRequest> steps(const std::string& plan, std::uint32_t seed) const;

  /// The lock on observations and calibrations; not owned where another request has it.
  std::unique_lock<std::mutex> tryAcquire();
  /// Throws InputError where another request has it.
  std::unique_lock<std::mutex> acquire();
  bool inAction() const { return in_action_; }
  void setInAction(bool in_action);

  // ---- with the lock ----
  /// Averages a window as StrainWindows::read() and appends the observation to the journal; or why
  /// there is no window.
  CalibrationRefusal read(Observation& observation, const PerSide<bool>& wanted,
                          const ros::Time& from);
  Observation removeLast();
  void clear();
  CalibrationResult solve(const ForceSettings& force);
  /// Stores the solution under `id` (empty: date and time) and activates it.
  Stored save(const std::string& id);
  /// Activates stored calibrations, unless a driver refuses one; returns a message.
  std::string load(const std::string& id, const PerSide<bool>& wanted);

 private:
  void activate(const MaybePerSide<ActiveCalibration>& calibrations);

  const CalibrationServerSettings settings_;
  CalibrationSession session_;
  StrainWindows windows_;
  CalibrationDrivers drivers_;
  std::optional<CalibrationTopics> topics_;
  std::mutex busy_;  ///< one request at a time changes the session, others are refused
  std::atomic<bool> in_action_{false};
};

}  // namespace assembly_cell::ros_bridge
