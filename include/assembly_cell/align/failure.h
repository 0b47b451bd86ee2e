// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <stdexcept>
#include <string>

namespace assembly_cell {

/// Outcome of an alignment. What each failure means and what to do: docs/reference/strategies.md,
/// "Failures".
enum class AlignFailure {
  kNone,  ///< aligned
  // moves and press
  kInContact,
  kForceLimit,
  kSensorSaturated,
  kNotStill,
  kNotArrived,
  kNoContact,
  kGaveWay,
  kPressNotHeld,
  kStuck,
  kTimeLimit,
  kZeroShifted,
  // contacts and hole
  kWedged,
  kEdgeInHole,
  kBothEdges,
  kNotFree,
  kTooUncertain,
  kNoReading,
  kNoPlaneReading,
  kNoHoleUnderEdge,
  kOneEdgeOnly,
  kNotDouble,
  kLostContact,
  kEdgeNotResolved,
  kNotSettled,
  kSensorSigns,
  kNoPose,
  kNotInserted,
  kTooTight,
  // insertion
  kJammed,
  // the plant and its evaluation
  kCancelled,
  kNoData,
  kStopped,
  kEdgeOutside,
  kNotSeated,
  kWrongMechanism,
  kCount  ///< number of outcomes
};

/// Its name: "aligned", "force_limit" and so on.
const char* toString(AlignFailure failure);

/// A move, a press or a strategy failed. what() is "name: message".
struct AlignError : std::runtime_error {
  AlignError(AlignFailure failed, const std::string& message)
      : std::runtime_error(std::string(toString(failed)) + ": " + message), failure(failed) {}
  AlignFailure failure;
};

}  // namespace assembly_cell
