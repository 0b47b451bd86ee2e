// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/light_touch.h"

#include <algorithm>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Touches that may vanish at rest, before lower() ends without a contact.
constexpr int kVanished = 4;
// Touches that may turn out to be the swing of a free peg.
constexpr int kSwings = 200;
// Blocks to come to rest, and blocks that are averaged then.
constexpr int kRestBlocks = 2;
// Rest required before a touch. The remaining swing shifts the zero by less than 0.01 mm of the
// peg's position, where a move ends within tens of um. With the default Rest a cycle takes 0.4 s
// longer, at level 2 1.2 s. A slow swing needs as many blocks more: two blocks agree by chance.
constexpr Rest kNearlyAtRest{0.1, 2};
// Blocks that are averaged for the zero of a touch.
constexpr int kZeroBlocks = 2;
// Age up to which a zero is used again, default cell [s]. Sensors that warm up drift by 0.2 N in
// this time, and the peg's weight turns with the carrier. With a new zero for each touch a cycle
// takes 0.5 s longer, at level 2 0.9 s. Smaller pegs are touched with less force, which the same
// drift hides: of 300 starts of 10 mm H7/g6 8 fail with this age, 1 with an age in proportion to
// the force.
constexpr double kZeroLasts = 2.0;

}  // namespace

void LightTouch::tare() {
  s_.carrier.tare(kZeroBlocks, {kNearlyAtRest.force, s_.scale.timed(kNearlyAtRest.blocks)});
}

bool LightTouch::isTareOld() const {
  const double age = s_.carrier.last().time - s_.carrier.sensor().tare().time;
  return age * s_.scale.time >= kZeroLasts * std::min(1.0, s_.scale.force);
}

Touch LightTouch::measure() {
  GuardedCarrier& carrier = s_.carrier;
  const int n = s_.scale.timed(kRestBlocks);
  carrier.wait(n);
  Vector6 w = Vector6::Zero(), d = Vector6::Zero();
  for (int i = 0; i < n; ++i) {
    carrier.wait(1);
    w += carrier.sensor().wrench() / n;
    d += s_.deflection() / n;
  }
  const Vector6 at = s_.frame.tipWrench(carrier.last().carrier, w, d);
  Touch touch;
  touch.min_force *= s_.scale.force;
  touch.X_SP = s_.frame.pegPose(carrier.target(), d);
  touch.force = at(2);
  touch.sideways = at.head<2>().norm();
  if (touch.force > 0.0) {
    touch.point = Eigen::Vector2d(-at(4), at(3)) / touch.force;
    touch.lean = at.head<2>() / touch.force;
    touch.reach = touch.point.norm() / tipRadius(s_.mechanism.peg);
  }
  return touch;
}

std::optional<Touch> LightTouch::lower(double floor, double faster) {
  Touch touch;
  for (int vanished = 0, swings = 0;
       vanished < kVanished && swings < kSwings && !touch.isContact();) {
    if (!s_.press.approach(floor, faster)) return {};
    touch = measure();
    if (!touch.isGone()) {
      ++vanished;
      continue;
    }
    ++swings;
    if (isTareOld()) tare();
  }
  return touch;
}

void LightTouch::refuseWedge(const Touch& touch, const Eigen::Matrix3d& R) {
  if (touch.isContact() && !touch.isSteep()) return;
  retreat_.avoidLowSide(R);
  if (!touch.isContact()) throw AlignError(AlignFailure::kWedged, "a light touch vanishes");
  throw AlignError(
      AlignFailure::kWedged,
      text("a light touch of %.1f N pushes sideways with %.1f N", touch.force, touch.sideways));
}

}  // namespace assembly_cell
