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

/// What is to be found from the observations.
struct SolveSettings {
  ForceSettings force;
  bool wrench = true;          ///< strain to wrench of both sensors
  PerSide<bool> displacement;  ///< strain to displacement
};

/// Whatever a set has tests for.
SolveSettings solveSettings(const ObservationSet& set);

/// What was found.
struct CalibrationSolution {
  std::optional<ForceSolution> force;
  PerSide<std::optional<DisplacementSolution>> displacement;
  ObservationSet set;     ///< solved
  bool accepted = false;  ///< all of it
  std::string message;    ///< one line
};

/// A calibration in force.
struct CalibrationInForce {
  Calibration calibration;
  /// Id of the stored one that its displacement is of, where its own file has none.
  std::string displacement_of;
};
template <typename T>
using MaybePerSide = PerSide<std::optional<T>>;

/// The calibration of both sensors from the first observation to the file in the store, whose
/// layout is STORE/{sensor_a|sensor_b}/ID.yaml: observe (add), solve, save, load. What a
/// solution or a file doesn't determine stays as in the calibration in force: saved and loaded ones
/// are whole. One thread at a time changes a session, others may ask for its observations and
/// calibrations meanwhile. Requests that it refuses throw CalibrationError, bad files InputError.
class CalibrationSession {
 public:
  /// Takes from the store what is in force there; warnings() tells what could not be taken. An
  /// empty `store`: nothing is kept.
  CalibrationSession(std::string store, ObservationSet set);

  /// From now on observations are in STORE/observations.yaml, beginning with those that are there
  /// of a session with the same sensors. True when an unfinished line was cut off.
  bool openJournal();

  /// Checks, keeps, and (with a journal) returns when it is on disk.
  void add(const Observation& observation);
  Observation removeLast();
  void clear();  ///< the old journal is kept as observations.yaml.previous
  ObservationSet observations() const;

  const CalibrationSolution& solve(const SolveSettings& settings);

  /// Stores the last accepted solution under `id` (empty: date and time) for each sensor that it
  /// tells something of. `fallback`: what a sensor without a calibration in force, or without a
  /// displacement in it, had so far. Returns what was stored; stored ones are never overwritten.
  MaybePerSide<Calibration> save(const std::string& id, const PerSide<Calibration>& fallback = {});

  /// The stored calibrations of the sensors wanted: all of them whole, or an error. Where a file
  /// has no displacement it is that of the calibration in force, else of `fallback`.
  MaybePerSide<CalibrationInForce> load(const std::string& id, const PerSide<bool>& wanted,
                                        const PerSide<Calibration>& fallback = {}) const;

  /// Those given come in force, here and in STORE/in_force.yaml for the next session.
  void putInForce(const MaybePerSide<CalibrationInForce>& calibrations);
  MaybePerSide<CalibrationInForce> inForce() const;

  /// Ids in the store; also those that calibrate solve once put below the serial number.
  std::vector<std::string> stored(Side side) const;
  const std::string& store() const { return store_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  std::vector<std::string> folders(Side side) const;
  Calibration loadStored(Side side, const std::string& id) const;
  void readInForce();

  std::string store_;
  std::unique_ptr<ObservationLog> journal_;
  std::vector<std::string> warnings_;
  std::optional<CalibrationSolution> solution_;

  mutable std::mutex mutex_;  ///< guards what others may ask for
  ObservationSet set_;
  MaybePerSide<CalibrationInForce> in_force_;
};

}  // namespace assembly_cell
