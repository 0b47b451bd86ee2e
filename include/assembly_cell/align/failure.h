// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <stdexcept>
#include <string>

namespace assembly_cell {

/// Outcome of an alignment. What each failure means and what to do: docs/reference/strategies.md,
/// "Failures". Each has a row of the table in failure.cpp.
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

/// A row of that table: the name of an outcome, and what strategies do after it.
struct FailureTraits {
  AlignFailure failure;
  const char* name;  ///< "aligned", "force_limit" and so on
  /// Whether a strategy makes another attempt, from elsewhere; vibration: single_contact and
  /// double_contact.
  bool touch_again, twin_force_again, vibration_again;
  /// Whether a strategy follows the failed one, from the start: single_contact in `vibratory`,
  /// twin_force and vibratory in `auto`.
  bool single_contact_next, twin_force_next, vibratory_next;
};
const FailureTraits& traitsOf(AlignFailure failure);

const char* toString(AlignFailure failure);  ///< its name

/// A move, a press or a strategy failed. what() is "name: message".
struct AlignError : std::runtime_error {
  AlignError(AlignFailure failed, const std::string& message)
      : std::runtime_error(std::string(toString(failed)) + ": " + message), failure(failed) {}
  AlignFailure failure;
};

}  // namespace assembly_cell
