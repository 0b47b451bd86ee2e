// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What is recorded of one assembly. Plain data: the store, verdicts, charts and the recorder node
// exchange it. docs/reference/records.md
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "assembly_cell/math/curve.h"

namespace assembly_cell {

/// A quantity estimated in a run.
struct RunEstimate {
  std::string name;  ///< hole_x, hole_y [m]; tilt_x, tilt_y [rad]; clearance [m]; friction
  double value = 0.0;
  double sd = 0.0;  ///< standard deviation, same unit; 0: not stated
};

/// What one rule states of a run; independent of the run's result.
struct RunVerdict {
  std::string rule;    ///< its name
  std::string kind;    ///< box or band
  bool passed = true;  ///< within it
  /// Smallest distance from the limit, over the limit's half width; < 0: outside; NaN: not
  /// evaluated.
  double margin = 0.0;
  double depth = 0.0;    ///< where that is [m]; NaN: nowhere, such as a curve that ends too early
  std::string quantity;  ///< axial, lateral, moment or tilt
  std::string text;      ///< one line for a person
};

/// Something that happened in a run.
struct RunEvent {
  double time = 0.0;  ///< since its start [s]
  std::string kind;   ///< fault, retry, hold, cancelled
  std::string text;
};

/// The record of one assembly.
struct Run {
  std::int64_t id = 0;  ///< by the store
  std::string serial;   ///< of the part; empty: the store gives a running number
  std::string program;  ///< name of the assembly program; default: the scenario's name
  std::string program_hash;
  std::string station;
  double start = 0.0;     ///< since 1970 [s]
  double duration = 0.0;  ///< in cell time [s]
  std::string strategy;
  std::string result;   ///< seated, aligned, failed; of imported curves what the user gives
  std::string failure;  ///< name of it; empty: none
  std::string text;     ///< the reason that was published
  std::map<std::string, std::string> versions;      ///< package, commit, messages
  std::map<std::string, std::string> calibrations;  ///< sensor or mechanism: id and hash
  std::map<std::string, std::string> settings;      ///< those that differ from the default
  std::map<std::string, std::string> simulation;    ///< seed, world, mismatch; empty: a real cell
  Curve curve;
  std::vector<RunEstimate> estimates;
  std::vector<RunVerdict> verdicts;
  std::vector<RunEvent> events;
};

}  // namespace assembly_cell
