// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <optional>

#include "assembly_cell/align/search/retreat.h"

namespace assembly_cell {

/// Contact of a peg at rest before it is pressed.
struct Touch {
  double force = 0.0;     ///< along the peg [N]
  double sideways = 0.0;  ///< [N]
  double reach = 0.0;     ///< line of action's distance from the axis at the bottom over the radius
  Eigen::Vector2d point{0, 0};  ///< where the line of action crosses the bottom, peg axes [m]
  Eigen::Vector2d lean{0, 0};   ///< of that line, aside over up
  Pose X_SP;                    ///< of the peg then, by the commanded rest pose

  double min_force = 0.5;               ///< below it there is no contact any more [N]
  static constexpr double kGone = 0.2;  ///< of that: the peg is free

  /// The contact is still there.
  bool isContact() const { return std::hypot(force, sideways) > min_force; }
  /// No force left: the peg hangs free, and has swung.
  bool isGone() const { return std::hypot(force, sideways) < kGone * min_force; }
  /// Two points of the edge, or the wall: one point of the edge can't be so near the axis.
  bool straddles() const { return reach < 0.8; }
  /// Farther from the axis than the edge, even by a sensor that is wrong by 4 mm: perhaps the
  /// hole's rim at the peg's side.
  bool isBeyondEdge() const { return reach > 1.2; }
  /// Steeper than friction on any contact that may be pressed: the hole's rim nearly along the
  /// edge, a wall, a wedge.
  bool isSteep() const { return sideways > 0.75 * force; }
};

/// Detects contacts at a force too small to wedge the peg. Needs a tare.
class LightTouch {
 public:
  LightTouch(SearchState& state, Retreat& retreat) : s_(state), retreat_(retreat) {}

  /// Lowers to a contact that stays at rest; a swinging peg only seems to touch. Nothing when the
  /// rest height `floor` [m] was reached without one; not isContact() where each touch vanished.
  /// `faster`: see PressController::approach().
  std::optional<Touch> lower(double floor, double faster = 1.0);
  /// The contact of the peg where it is, at rest.
  Touch measure();
  /// Throws AlignError `wedged` for a peg tilted by R at a steep contact or one that vanished.
  void refuseWedge(const Touch& touch, const Eigen::Matrix3d& R);

 private:
  SearchState& s_;
  Retreat& retreat_;
};

}  // namespace assembly_cell
