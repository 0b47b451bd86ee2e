// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/light_touch.h"

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Touches that may vanish at rest, before lower() ends without a contact.
constexpr int kVanished = 4;
// Touches that may turn out to be the swing of a free peg.
constexpr int kSwings = 200;
// Blocks to come to rest, and blocks that are averaged then.
constexpr int kRestBlocks = 2;

}  // namespace

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
    ++(touch.isGone() ? swings : vanished);
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
