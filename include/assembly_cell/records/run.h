// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What is recorded of one assembly. Plain data: the store, verdicts, charts and the recorder node
// exchange it. docs/reference/records.md
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace assembly_cell {

/// Contact wrench over the path into the hole. All vectors are of the same length, in the order of
/// time; the depth may go back where the peg was pulled up. NaN: not measured (of a curve of
/// others).
struct Curve {
  std::vector<double> time;     ///< since the run's start [s]
  std::vector<double> depth;    ///< of the centre of the peg's edge below the hole's plane [m]
  std::vector<double> axial;    ///< force up the peg's axis [N]
  std::vector<double> lateral;  ///< force across it [N]
  std::vector<double> moment;   ///< about the edge's centre, across the axis [N·m]
  std::vector<double> tilt;     ///< of the peg's axis against the hole's estimated one [rad]

  std::size_t size() const { return time.size(); }
};

/// A quantity estimated in a run.
struct RunEstimate {
  std::string name;  ///< hole_x, hole_y [m]; tilt_x, tilt_y [rad]; clearance [m]; friction
  double value = 0.0;
  double sd = 0.0;  ///< standard deviation, same unit; 0: not stated
};

/// What one rule states of a run; independent of the run's result.
struct RunVerdict {
  std::string rule;      ///< its name
  std::string kind;      ///< box or band
  bool passed = true;    ///< within it
  double margin = 0.0;   ///< smallest distance from the limit, over the limit's width; < 0: outside
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
  std::string program;  ///< what was to be assembled: the scenario's name
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
