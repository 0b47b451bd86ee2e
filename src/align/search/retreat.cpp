// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/retreat.h"

#include <cmath>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Further attempts to free a peg that doesn't come up: upright, then moved to four sides.
constexpr int kMoreRetreats = 5;
// Lateral travel of a peg that stays wedged, which ends at half of the force limit. A peg held by
// two sides of a rim comes free when it is moved across the line between them. [m]
constexpr double kSway = 5e-4;
// Angle from one offset to the next: none is repeated [rad].
constexpr double kGolden = 2.4;
// Slope of a rim contact that is safe to press: 20 degrees.
constexpr double kUpright = 0.364;

}  // namespace

void Retreat::backOut(double travel) {
  for (int i = 0;; ++i) {
    const Pose peg = s_.peg();
    try {
      // unstrained; if that does not free it, turned back first: pulling may tighten a wedge
      const RestPose relaxed = s_.frame.restFor(peg.p, peg.R);
      RestPose turned = relaxed;
      if (i == 1) turned = s_.frame.restFor(peg.p, Eigen::Matrix3d::Identity());
      const double aside = (i % 2 == 0 ? 1.0 : -1.0) * kSway * s_.scale.travel;
      if (i > 1) (i < 4 ? turned.x : turned.y) += aside;
      retreatUp(s_.carrier, relaxed, turned, travel);
      return;
    } catch (const AlignError& error) {
      if (i == kMoreRetreats) throw;
      s_.report("recover", error.what());
    }
  }
}

void Retreat::avoidLowSide(const Eigen::Matrix3d& R) {
  const Eigen::Vector3d low(R.col(2).x(), R.col(2).y(), 0.0);
  if (low.norm() < 1e-6) return;
  aside_ = -low.normalized();
  offsets_ = 0;
}

Eigen::Vector3d Retreat::nextOffset(double tilt) {
  const Eigen::Matrix3d turn = rotationFromVector({Eigen::Vector3d(0, 0, kGolden * offsets_++)});
  const double travel = trapWidth(tilt);
  s_.report("aside", text("by %.1f mm", travel * 1e3));
  return travel * (rotationToAxis(s_.hole.normal) * turn * aside_);
}

double Retreat::trapWidth(double tilt) const {
  const double r = tipRadius(s_.mechanism.peg), R = mouthRadius(s_.mechanism.hole);
  return std::sqrt(R * R - r * r) + r * tilt / kUpright;
}

}  // namespace assembly_cell
