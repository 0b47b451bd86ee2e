// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/calibration/observations/observation_log.h"
#include "assembly_cell/calibration/two_sensor/displacement.h"
#include "assembly_cell/calibration/two_sensor/force.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

/// What to solve for.
struct SolveSettings {
  ForceSettings force;
  bool wrench = true;          ///< strain to wrench of both sensors
  PerSide<bool> displacement;  ///< strain to displacement
};

/// All that a set has tests for.
SolveSettings solveSettings(const ObservationSet& set);

/// Result of solve().
struct CalibrationSolution {
  std::optional<ForceSolution> force;
  PerSide<std::optional<DisplacementSolution>> displacement;
  ObservationSet set;     ///< solved
  bool accepted = false;  ///< all of it
  std::string message;    ///< one line
};

/// The calibration in use by a sensor.
struct ActiveCalibration {
  Calibration calibration;
  /// Id of the stored calibration that its displacement comes from, where its own file has none.
  std::string displacement_of;
};
template <typename T>
using MaybePerSide = PerSide<std::optional<T>>;

/// The calibration of both sensors from the first observation to the file in the store, whose
/// layout is STORE/{sensor_a|sensor_b}/ID.yaml: observe (add), solve, save, load. What a
/// solution or a file doesn't determine is taken from the active calibration: saved and loaded ones
/// are complete. One thread at a time may change a session; observations() and active() are safe
/// from others meanwhile. Refused requests throw CalibrationError, bad files InputError.
class CalibrationSession {
 public:
  /// Reads the active calibrations from the store; warnings() has those that can't be read. An
  /// empty `store`: nothing is stored.
  CalibrationSession(std::string store, ObservationSet set);

  /// Keeps observations in STORE/observations.yaml from now on, and reads those of an earlier
  /// session with the same sensors. True when an unfinished line was cut off.
  bool openJournal();

  /// Checks and appends; with a journal returns when the observation is on disk.
  void add(const Observation& observation);
  Observation removeLast();
  void clear();  ///< the old journal is kept as observations.yaml.previous
  ObservationSet observations() const;

  const CalibrationSolution& solve(const SolveSettings& settings);

  /// Stores the last accepted solution under `id` (empty: date and time) for each sensor that it
  /// determines something of. `fallback`: for a sensor without an active calibration, or without a
  /// displacement in it. Returns the stored calibrations; none is ever overwritten.
  MaybePerSide<Calibration> save(const std::string& id, const PerSide<Calibration>& fallback = {});

  /// The stored calibrations of the sensors wanted, all of them complete, or throws. Where a file
  /// has no displacement it is that of the active calibration, else of `fallback`.
  MaybePerSide<ActiveCalibration> load(const std::string& id, const PerSide<bool>& wanted,
                                       const PerSide<Calibration>& fallback = {}) const;

  /// Makes these the active ones, here and in STORE/in_force.yaml for the next session.
  void activate(const MaybePerSide<ActiveCalibration>& calibrations);
  MaybePerSide<ActiveCalibration> active() const;

  /// Ids in the store, in the sensor's folder and in that named by its serial number.
  std::vector<std::string> stored(Side side) const;
  const std::string& store() const { return store_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  std::vector<std::string> folders(Side side) const;
  Calibration loadStored(Side side, const std::string& id) const;
  void readActive();

  std::string store_;
  std::unique_ptr<ObservationLog> journal_;
  std::vector<std::string> warnings_;
  std::optional<CalibrationSolution> solution_;

  mutable std::mutex mutex_;  ///< guards set_ and active_
  ObservationSet set_;
  MaybePerSide<ActiveCalibration> active_;
};

}  // namespace assembly_cell
