// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <optional>

#include "assembly_cell/align/search/retreat.h"

namespace assembly_cell {

/// Contact of a peg that rests on it with a small force.
struct Touch {
  double force = 0.0;     ///< along the peg [N]
  double sideways = 0.0;  ///< [N]
  double reach = 0.0;     ///< distance of the line of action from the axis at the bottom, in radii
  Eigen::Vector2d point{0, 0};  ///< where the line of action crosses the bottom, peg axes [m]
  Eigen::Vector2d lean{0, 0};   ///< slope of that line: lateral over axial
  Pose X_SP;                    ///< the peg's pose, from the commanded rest pose

  double min_force = 0.5;               ///< least force of a contact [N]
  static constexpr double kGone = 0.2;  ///< share of it below which the peg is free

  /// Whether the contact is still there.
  bool isContact() const { return std::hypot(force, sideways) > min_force; }
  /// Whether no force is left: the peg hangs free, and the force was that of its swing.
  bool isGone() const { return std::hypot(force, sideways) < kGone * min_force; }
  /// Whether it is on two points of the edge, or on the wall: the line of action is nearer to the
  /// axis than one point of the edge can be.
  bool straddles() const { return reach < 0.8; }
  /// Whether the line of action is outside the edge, also for a sensor that is wrong by 4 mm: the
  /// hole's rim may be at the peg's side.
  bool isBeyondEdge() const { return reach > 1.2; }
  /// Whether the force is more lateral than friction allows on a contact that may be pressed. It is
  /// so where the hole's rim is nearly along the edge, at a wall, and for a wedged peg.
  bool isSteep() const { return sideways > 0.75 * force; }
};

/// Detects contacts at a force too small to wedge the peg. Needs a tare.
class LightTouch {
 public:
  LightTouch(SearchState& state, Retreat& retreat) : s_(state), retreat_(retreat) {}

  /// Lowers the peg to a contact that is still there at rest, as that of a swinging peg isn't.
  /// Takes the zero again where the peg hangs free and the tare is old. Returns nothing when the
  /// rest height `floor` [m] was reached without a contact; a touch that is not isContact() when
  /// each one vanished. `faster`: see PressController::approach().
  std::optional<Touch> lower(double floor, double faster = 1.0);
  /// Takes the zero of a peg that hangs free and nearly at rest.
  void tare();
  /// Whether the sensor may have drifted since the latest tare by a part of a contact's force.
  bool isTareOld() const;
  /// Measures the contact of the peg at rest where it is.
  Touch measure();
  /// Throws AlignError `wedged` for a contact that is steep or has vanished. R: the peg's axes in
  /// S.
  void refuseWedge(const Touch& touch, const Eigen::Matrix3d& R);

 private:
  SearchState& s_;
  Retreat& retreat_;
};

}  // namespace assembly_cell
