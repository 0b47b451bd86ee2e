// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

// What the panel shows of a cell, and what a person requests. Plain structs between the threads of
// ROS, which fill them, and the thread of the screen, which draws them. SI units.
namespace assembly_cell::panel {

using Clock = std::chrono::steady_clock;  // of the wall
using Pair = std::array<double, 2>;       // x, y

enum Sensor { kSensorA, kSensorB };
constexpr std::array<const char*, 2> kSensorNames = {"sensor_a", "sensor_b"};

struct SensorView {
  bool there = false;              // its wrench is published
  std::array<double, 6> wrench{};  // force before torque, axes of the sensor [N] [N m]
  bool limit_known = false;        // a calibration from strain is active
  // load along or about each axis alone at which a channel leaves its converter's range
  std::array<double, 6> limit{};  // [N] [N m]
  std::string calibration;        // id of the active one
};

enum class Light { kNotThere, kGood, kWarning, kFault };

struct NodeView {
  std::string node;  // relative to the cell's namespace
  Light light = Light::kNotThere;
  std::string reason;
  bool silent = false;  // its diagnostics have stopped
};

/// The goal of the supervisor that runs, or ran last.
struct GoalView {
  bool there = false;      // a supervisor is running
  std::string goal;        // under way; empty: none
  bool requested = false;  // sent, without an answer yet
  bool in_contact = false, stuck = false;
  bool known = true;   // what the peg is: ros_bridge::isKnown()
  std::string reason;  // of contact
  std::string step;    // of the strategy
  std::string message;
  std::uint32_t contacts = 0;                   // read so far
  double time = 0.0;                            // cell time [s]
  double position_sd = 0.0, rotation_sd = 0.0;  // of both axes together; 0: not known [m] [rad]
  bool inserting = false;                       // the following values are those of an insertion
  double depth = 0.0, force = 0.0;              // [m] [N]
  int walls = 0;                                // bore-wall contacts
  enum class Outcome { kNone, kSuccess, kFailure, kCancelled } outcome = Outcome::kNone;
  std::string outcome_text;
};

/// Offset and tilt of the peg as it hung before its first move, of the last alignment.
struct EstimateView {
  bool known = false;
  Pair offset{}, tilt{};                        // [m] [rad]
  double position_sd = 0.0, rotation_sd = 0.0;  // of both axes together; 0: not known [m] [rad]
  bool truth_there = false;                     // the ground truth is published
  bool truth_known = false;
  Pair true_offset{}, true_tilt{};
};

struct SimulatorView {
  bool there = false, paused = false;
  std::string message;  // running, paused, held or stopped and why
  double time = 0.0;    // simulated [s]
  double real_time_factor = 0.0;
};

struct CalibrationStep {
  std::string text;
  std::string kind;   // of the test: unloaded, reacting, weight, indentation, displacement
  double mass = 0.0;  // of a weight [kg]
};

struct CalibrationView {
  bool there = false;
  std::string state;  // idle, or the running task
  std::uint32_t observations = 0;
  std::string last_id;
  std::array<std::string, 2> active;  // ids, by sensor
  std::vector<std::string> stored;    // ids of either sensor
  std::string plan;                   // of the steps
  std::vector<CalibrationStep> steps;
  bool plan_good = false;
  std::string plan_report;
  bool running = false;                    // the action
  std::uint32_t step = 0, step_count = 0;  // steps done
  std::string step_state, step_message;
  bool step_unknown = false;  // it runs, and its last feedback is older than this panel
  bool result_known = false, success = false;
  std::string result;
};

/// State of a part's curve.
enum class RecordState { kGrowing, kNotStored, kNoRules, kGood, kBad };

struct PartView {
  std::int64_t id = 0;  // in the store
  std::string serial;
  RecordState state = RecordState::kNoRules;
  std::string verdict;  // or why not stored
};

/// Records of parts, and the curve of the last descent.
struct RecordView {
  bool there = false;  // a recorder is running
  bool writable = false;
  std::string reason;           // why not
  std::string serial, program;  // of the next part
  RecordState state = RecordState::kGrowing;
  std::vector<Pair> curve;                  // depth [m], force up the peg's axis [N]
  std::vector<std::array<double, 3>> band;  // depth [m], lowest and highest force [N]
  std::vector<PartView> parts;              // newest first, since the panel was opened
};

/// State of a request.
struct Answer {
  enum class State { kWaiting, kGood, kBad } state = State::kWaiting;
  std::string text;
  Clock::time_point since;   // the request or the answer was sent
  std::uint64_t number = 0;  // counts up
};

struct CellView {
  std::array<SensorView, 2> sensors;
  double goal_force_limit = 0.0;  // beyond which a goal ends; 0: not known [N]
  GoalView goal;
  EstimateView estimate;
  std::string reading;  // of the locus or of the twin-force contacts, in words
  SimulatorView simulator;
  std::vector<NodeView> nodes;
  CalibrationView calibration;
  RecordView record;
  std::map<std::string, Answer> answers;  // by request
};

/// A goal to start.
struct GoalRequest {
  std::string strategy;  // empty: that of the supervisor
  bool insert = false;   // after the alignment
  bool floor = false;    // to the hole's floor, depth is ignored
  double depth = 0.0;    // [m]
};

/// A calibration to run.
struct CalibrationRequest {
  std::string plan;      // empty: that of the server
  bool restart = false;  // deletes all observations first
  std::string id;        // of what is stored; empty: date and time
};

/// What was applied in a step of a calibration.
struct Measured {
  bool changed = false;            // false: as planned
  double mass = 0.0;               // of a weight [kg]
  std::array<double, 6> gauges{};  // of a displacement [m]
};

}  // namespace assembly_cell::panel
