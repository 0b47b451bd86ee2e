// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A Search in the hole: its walls, and the middle between them.
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/search/search.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kWallDeflection = 6e-5;  // of the peg against its carrier that is a wall [m]
constexpr double kGapShare = 0.5;         // of twice the clearance: walls may be nearer or farther
constexpr double kGapSlack = 6e-5;        // and by so much at least [m]
constexpr double kFreeShare = 0.5;        // of the clearance, free to all sides at the end
constexpr double kBehind = 0.25;          // of such a step, what doesn't follow: more is a wall
constexpr double kOffWall = 0.5;          // of the clearance, a step off a wall at most
constexpr int kFreeTries = 8;             // to get off a wall
constexpr double kWallSd = 4e-6;          // of a middle between walls, per axis [m]
// A move of this length ends where none did before (docs/reference/mismatch.md): the middle of two
// walls that are felt after one each scatters by half of that, and a tenth goes for what touches
// don't tell.
constexpr double kOwnEnd = 2e-4, kOfEnds = 0.6;
constexpr int kSwingBlocks = 5;  // until a swing is gone that looks like a wall

}  // namespace

// Sideways in small steps until the wall pushes back; `at` is the bottom's centre then. False when
// there is no wall where one must be. By the poses that were commanded: the reported ones scatter.
bool Search::findWall(const Vec3& direction, const Mat3& R, Vec3& at) {
  const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
  // by what a wall bends the coupling where that is more than the clearance
  const double bent = kWallDeflection * scale_.give;
  const double step = std::clamp(std::max(0.25 * clearance, 0.2 * bent), 5e-6, 1e-4);
  Eigen::Matrix<double, 1, 6> row;  // bottom centre along `direction` by the coupling's deflection
  const Vec3 travel = R.transpose() * direction;
  row << travel.transpose(), Vec3(0, 0, -length_).cross(travel).transpose();
  const Eigen::Matrix<double, 1, 6> by_wrench =
      row * couplingStiffness(mechanism_.coupling).inverse();
  const double felt =
      bent + 4.0 * std::sqrt((by_wrench * press_.rounding() * by_wrench.transpose()).value());
  Vec3 target = pegPose(press_.target(), Vector6::Zero()).p;
  const auto pushed = [&] {
    at = pegPose(press_.target(), deflection()).p - sag_;
    return (target - at).dot(direction) > felt;
  };
  for (double moved = 0.0; moved <= wallTravel(); moved += step) {
    // a peg that still swings from the step seems pushed, too, but not for long
    if (pushed()) {
      press_.wait(timed(kSwingBlocks));
      if (pushed()) return true;
    }
    target += step * direction;
    press_.nudge(restFor(target, R));
  }
  return false;
}

// The peg doesn't end against a wall: a carrier that comes to rest somewhere else each time may
// have put the middle there. Free is what follows the carrier to all four sides; else `target` goes
// by what didn't follow.
bool Search::clearOfWalls(Vec3& target, const Mat3& R) {
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(hole_.normal);
  const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
  const double step = kFreeShare * clearance;
  const auto place = [this, &R](const Vec3& at) {
    press_.nudge(restFor(at, R));
    Vec3 mean = Vec3::Zero();
    const int n = timed(kSwingBlocks - 1);
    press_.wait(timed(1));
    for (int i = 0; i < n; ++i) {
      press_.wait(1);
      mean += pegPose(press_.target(), deflection()).p / n;
    }
    return mean;
  };
  // a longer way ends here, where the peg will stay: the short ones that follow don't change that
  press_.moveTo(restFor(target + 0.5 * p_.insertion_depth * hole_.normal, R));
  press_.moveTo(restFor(target, R));
  for (int i = 0; i < kFreeTries; ++i) {
    const Vec3 here = place(target);
    bool free = press_.force().norm() < insertionForce();
    Vec2 back = Vec2::Zero();  // what walls take of the four ways, in all
    for (int side = 0; side < 4; ++side) {
      const Vec3 way = (side % 2 == 0 ? 1.0 : -1.0) * axes.col(side / 2);
      const Vec2 behind = axes.transpose() * (place(target + step * way) - here - step * way);
      free = free && behind.norm() < kBehind * step;
      back += behind;
    }
    if (free) {
      place(target);  // and until it no longer swings
      return true;
    }
    target += axes * back * std::min(1.0, kOffWall * clearance / back.norm());
  }
  report("centre", "a wall on every side");
  return false;
}

// To the middle between the walls along two axes, which is the hole's centre: walls twice the
// clearance apart on the second one, and no force in the middle, else it is something else.
bool Search::centre(const Mat3& R) {
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(hole_.normal);
  const double gap = 2.0 * (mechanism_.hole.radius - mechanism_.peg.radius);
  const bool stays = !p_.insert.wanted() && !isFarIn();
  for (int axis = 0; axis < 2; ++axis) {
    Vec3 ahead, behind;
    const Vec3 along = axes.col(axis);
    const auto asked = [this] { return pegPose(press_.target(), Vector6::Zero()).p; };
    Vec3 from_ahead;
    const auto feel = [&] {
      if (!findWall(along, R, ahead)) return false;
      from_ahead = asked();
      return findWall(-along, R, behind);
    };
    if (!feel()) {
      report("centre", "no wall: not in the hole");
      return false;
    }
    Vec3 target = asked();
    const bool own_ends = (from_ahead - target).norm() > kOwnEnd;
    target += along * along.dot(0.5 * (ahead + behind) - target);
    // the last middle is gone to by clearOfWalls(), where the peg stays
    if (axis == 0 || !stays) {
      press_.moveTo(restFor(target, R));
      press_.wait(timed(kWallBlocks));
    }
    if (axis == 0) continue;
    const double apart = along.dot(ahead - behind);
    report("centre", text("between walls %.3f mm apart", apart * 1e3));
    if (std::abs(apart - gap) > std::max(kGapShare * gap, kGapSlack * scale_.give)) return false;
    // no wall pushes any more: the peg itself is in the middle
    // (deep in the hole the walls lead, and the depth says where the peg is)
    if (stays && !clearOfWalls(target, R)) return false;
    const Vec3 center = target + sag_;
    hole_.center = center - hole_.normal * (hole_.normal.dot(center) - hole_.height);
    const double noise = press_.reportNoise().position;
    hole_.center_covariance =
        Eigen::Matrix2d::Identity() *
        (kWallSd * kWallSd + noise * noise + (own_ends ? kOfEnds : 1.0) * place_variance_);
    found_ = true;
  }
  return true;
}

}  // namespace assembly_cell
