// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <stdexcept>
#include <string>

namespace assembly_cell {

/// How an alignment ended. What each failure means and what to do: docs/reference/strategies.md,
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
  // on the way down
  kJammed,
  // the plant and whoever looks on
  kCancelled,
  kNoData,
  kStopped,
  kEdgeOutside,
  kNotSeated,
  kWrongMechanism,
  kCount  ///< of these
};

/// Its name: "aligned", "force_limit" and so on.
const char* toString(AlignFailure failure);

/// A move, a press or a strategy was given up. what() is "name: message".
struct AlignError : std::runtime_error {
  AlignError(AlignFailure failed, const std::string& message)
      : std::runtime_error(std::string(toString(failed)) + ": " + message), failure(failed) {}
  AlignFailure failure;
};

}  // namespace assembly_cell
