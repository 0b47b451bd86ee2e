// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/bore_entry.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/align/search/retreat.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/mechanism/compliance.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kFarIn = 2.0;  // depths of an entry: deeper than a peg that stands on the face
constexpr double kUnknownAxis = 0.05;  // sd of the axis of a hole known by its walls only [rad]
constexpr double kOnFace = 0.75;       // of the force of a peg lowered on the face by the depth

// the path down
constexpr double kClear = 3e-4;   // over the plane before the last descent [m]
constexpr double kTravel = 2e-3;  // over the plane while moving sideways [m]
constexpr double kRing = 0.9;     // from one ring to the next, in clearances
constexpr int kZeroBlocks = 4;    // of a zero over the hole

// walls
constexpr int kWallBlocks = 2;  // beside walls, to come to rest
// Of the clearance, a step to a wall. Half: 0.4 s longer; the middle's error, with this 2 um
// without model error, is then 1.3 um.
constexpr double kWallStep = 0.5;
constexpr double kWallSearch = 6.0;       // travel to a wall at most, in clearances
constexpr double kWallPush = 2.5;         // and as far as makes so much of a wall's deflection
constexpr double kWallForce = 1.0;        // of a wall that stops a peg at rest [N]
constexpr double kSofter = 7e3;           // stiffness sideways at the peg's bottom [N/m]
constexpr double kWallDeflection = 6e-5;  // of the peg against its carrier that is a wall [m]
constexpr double kGapSlack = 6e-5;        // of walls, beyond what the clearance may be [m]
constexpr double kGiveSd = 0.06;          // of the coupling's compliance: a tenth, uniform
constexpr double kFreeFraction = 0.5;     // of the clearance, free to all sides at the end
constexpr double kLag = 0.25;             // of such a step, lag of the peg that means a wall
constexpr double kFollows = 0.5;          // of such a step: less is a peg that a wall holds
constexpr double kOffWall = 0.5;          // of the clearance, a step off a wall at most
constexpr int kFreeTries = 8;             // to get off a wall
constexpr double kWallSd = 4e-6;          // of a middle between walls, per axis [m]
// A move of this length ends where none did before (docs/reference/mismatch.md): the middle of two
// walls that are measured after one each scatters by half of that; a tenth more is allowed for
// what touches don't show.
constexpr double kOwnEnd = 2e-4, kOfEnds = 0.6;
constexpr double kOutStep = 2e-3;    // on the path out of a hole of unknown depth [m]
constexpr double kOver = 6e-3;       // over the face, before the offset aside from the hole [m]
constexpr int kWallSwingBlocks = 5;  // until a swing is gone that looks like a wall

}  // namespace

bool BoreEntry::startsDeep() const { return s_.p.inserted > kFarIn * depth(); }

double BoreEntry::depth() const {
  return s_.p.insertion_depth + chamferDepth(s_.mechanism.hole) + chamferHeight(s_.mechanism.peg);
}

// Largest travel sideways to a wall: over the clearance, and until the wall has pushed enough to
// count as one. [m]
double BoreEntry::wallTravel(double expected) const {
  return std::max(kWallSearch * clearance_prior.mean,
                  2.0 * expected + kWallPush * kWallForce / kSofter * s_.scale.give);
}

void BoreEntry::requireStillIn() {
  insertion_.startInBore();
  s_.hole.normal_sd = kUnknownAxis;
  if (!centre(Mat3::Identity())) {
    throw AlignError(AlignFailure::kInContact,
                     text("the goal before has left the peg %.1f mm deep in the hole, and its "
                          "walls aren't where they were; take it out by the action retreat, or "
                          "reset the simulation",
                          s_.p.inserted * 1e3));
  }
  addLean();
}

// More than the swing of a peg from its own steps down; less than a soft coupling makes of the
// depth where the peg stands on the face.
double BoreEntry::maxForce() const {
  return std::min(s_.p.insertion_force * std::max(1.0, s_.scale.force),
                  kOnFace * s_.mechanism.coupling.stiffness.diagonal(0) * s_.p.insertion_depth);
}

// A wall within reach: on one side is enough, the travel is longer than the way across.
// at_rest: what pushes is measured again once the peg is still; a heavy one in a soft coupling
// swings from the move as hard as a wall pushes.
bool BoreEntry::hasWallBeside(bool at_rest) {
  const RestPose start = s_.carrier.target();
  const Vec3 bottom = s_.frame.pegPose(start, Vector6::Zero()).p;
  const double expected = s_.p.inserted > 0.0 ? clearance_prior.high() : clearance_prior.mean;
  const Vec3 beside = bottom + wallTravel(expected) * Vec3::UnitX();
  const auto is_pushed = [this] {
    return s_.carrier.force().head<2>().norm() > kWallForce * s_.scale.force;
  };
  s_.carrier.moveTo(s_.frame.restFor(beside, Mat3::Identity()));
  s_.carrier.wait(s_.scale.timed(kWallBlocks));
  const bool wall = is_pushed() && (!at_rest || (s_.carrier.settle(), is_pushed()));
  s_.carrier.moveTo(start);
  s_.carrier.wait(s_.scale.timed(kWallBlocks));
  return wall;
}

bool BoreEntry::takeOut(Retreat& retreat) {
  const double step = kOutStep * s_.scale.length;
  const double length = 2.0 * s_.mechanism.peg.half_height;
  double up = 0.0;
  for (; hasWallBeside(true); up += step) {
    if (up > std::min(length, s_.mechanism.hole.depth) + step) {
      throw AlignError(AlignFailure::kStuck,
                       text("a wall beside the peg still after %.1f mm of travel up", up * 1e3));
    }
    RestPose higher = s_.carrier.target();
    higher.z += step;
    s_.carrier.moveTo(higher);
    s_.carrier.wait(s_.scale.timed(kWallBlocks));
  }
  if (up == 0.0) return false;
  s_.report("out", text("of the hole, the edge was at most %.1f mm deep", up * 1e3));
  RestPose away = s_.carrier.target();
  away.z += kOver * s_.scale.travel;
  s_.carrier.moveTo(away);
  const Vec3 aside = retreat.nextOffset(s_.p.contact_tilt);
  away.x += aside.x();
  away.y += aside.y();
  s_.carrier.moveTo(away);
  return true;
}

// If there is a wall on one side, there are on all, and nothing below: friction on a face, with the
// peg pressed, would look like walls.
bool BoreEntry::isIn() {
  const RestPose start = s_.carrier.target();
  const Vec3 bottom = s_.frame.pegPose(start, Vector6::Zero()).p;
  if (!hasWallBeside(false)) return false;
  s_.hole.normal = Vec3::UnitZ();
  s_.hole.height = bottom.z() + s_.p.inserted;
  s_.hole.normal_sd = kUnknownAxis;
  s_.setHanging(bottom);
  // a descent may end at a wall, as any other move does
  const auto stays_clear = [this] {
    Vec3 target = s_.target().p;
    return s_.p.insert.wanted() || clearOfWalls(target, Mat3::Identity());
  };
  if (centre(Mat3::Identity()) && lower(s_.target().p, Mat3::Identity()) && stays_clear()) {
    height_known = s_.p.inserted > 0.0;
    addLean();
    return true;
  }
  // no hole: a contact on one side only, or a face
  s_.found = false;
  s_.hole = HoleEstimate();
  s_.carrier.moveTo(start);
  return false;
}

// The axis isn't known: a peg that leans in the bore meets one wall with its edge and the other at
// the rim, and the middle between them is off by up to half the clearance.
void BoreEntry::addLean() {
  const double play = 0.5 * (std::max(0.0, s_.known.clearance.mean) + s_.known.clearance.sd);
  s_.hole.center_covariance.diagonal().array() += play * play / 3.0;
}

bool BoreEntry::enter(const Vec3& center, int rings) {
  const Mat3 R = rotationToAxis(s_.hole.normal);
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(s_.hole.normal);
  // up along the normal before sideways and straight
  Vec3 above = s_.target().p;
  const double travel = kTravel * s_.scale.travel;
  above += s_.hole.normal * std::max(0.0, travel - s_.hole.normal.dot(above) + s_.hole.height);
  s_.carrier.moveTo(s_.frame.restFor(above, s_.frame.carrierPose(s_.carrier.target()).R),
                    Move::kNearly);
  // the hanging peg sags differently in this pose
  Vec3 target = center + kClear * s_.scale.travel * s_.hole.normal;
  s_.carrier.moveTo(s_.frame.restFor(target + travel * s_.hole.normal, R), Move::kNearly);
  s_.carrier.tare(kZeroBlocks);
  s_.setHanging(s_.target().p);
  target -= s_.hanging.sag - s_.hole.normal * s_.hole.normal.dot(s_.hanging.sag);

  // centre, then rings a little closer than the clearance
  for (int ring = 0; ring < rings; ++ring) {
    const int places = ring == 0 ? 1 : 6 * ring;
    for (int i = 0; i < places; ++i) {
      const double a = 2 * M_PI * i / places;
      const Vec2 shift = kRing * s_.known.clearance.step() * ring * Vec2(std::cos(a), std::sin(a));
      if (lower(target + axes * shift, R) && (!needs_walls || centre(R))) return true;
    }
  }
  ++refused;
  s_.report("enter", "resistance everywhere, measuring again");
  s_.carrier.moveTo(s_.frame.restFor(target + travel * s_.hole.normal, R));
  return false;
}

double BoreEntry::reach() const { return (kRing * (kRings - 1) + 1.0) * s_.known.clearance.step(); }

// Down from `from`, just over the plane; back up at the first resistance.
bool BoreEntry::lower(const Vec3& from, const Mat3& R) {
  s_.carrier.moveTo(s_.frame.restFor(from, R));
  const double travel = kClear * s_.scale.travel + depth() + 3.0 * s_.hole.height_sd;
  const double step = s_.p.approach_step * s_.scale.step * s_.carrier.delay.slowing();
  double down = 0.0;
  while (down < travel && s_.carrier.force().z() < maxForce()) {
    down = std::min(travel, down + step);
    PlantCommand command;
    command.rest = s_.frame.restFor(from - down * s_.hole.normal, R);
    s_.carrier.step(command);
  }
  if (down >= travel) {
    s_.carrier.moveTo(s_.frame.restFor(from - travel * s_.hole.normal, R));
    s_.carrier.wait(s_.blocks(s_.p.settle));
  }
  const double force = s_.carrier.force().z();
  const bool in = force < maxForce();
  s_.report("enter", text(in ? "in, contact force %.2f N" : "resistance of %.2f N", force));
  if (!in) goBack(from, R);
  return in;
}

// Moves back to `from` after a resistance. Throws `wedged` if the rim still holds the peg there,
// since the next move is fast: it pulled with 115 N on a peg larger than its hole.
void BoreEntry::goBack(const Vec3& from, const Mat3& R) {
  s_.carrier.moveTo(s_.frame.restFor(from, R));
  const auto is_held = [this] {
    return s_.carrier.force().norm() > s_.carrier.sensor().touchForce();
  };
  if (!is_held()) return;
  s_.carrier.wait(s_.scale.timed(kWallSwingBlocks));  // it may only swing
  if (!is_held()) return;
  ++refused;
  throw AlignError(AlignFailure::kWedged,
                   text("the hole's rim holds the peg with %.1f N", s_.carrier.force().norm()));
}

// Sideways in small steps until the wall pushes back; `at` is the bottom's centre then. False when
// there is no wall where one must be. Uses the commanded poses: the reported ones scatter.
bool BoreEntry::findWall(const Vec3& direction, const Mat3& R, Vec3& at) {
  // by what a wall bends the coupling where that is more than the clearance
  const double bent = kWallDeflection * s_.scale.give;
  const double step =
      std::clamp(std::max(kWallStep * s_.known.clearance.step(), 0.2 * bent), 5e-6, 1e-4) *
      s_.carrier.delay.slowing();
  Eigen::Matrix<double, 1, 6> row;  // bottom centre along `direction` by the coupling's deflection
  const Vec3 travel = R.transpose() * direction;
  row << travel.transpose(), Vec3(0, 0, -s_.frame.length()).cross(travel).transpose();
  const Eigen::Matrix<double, 1, 6> by_wrench =
      row * couplingStiffness(s_.mechanism.coupling).inverse();
  const double contact =
      bent +
      4.0 * std::sqrt((by_wrench * s_.carrier.last().rounding_b * by_wrench.transpose()).value());
  Vec3 target = s_.target().p;
  const auto pushed = [&] {
    at = s_.frame.pegPose(s_.carrier.target(), s_.deflection()).p - s_.hanging.sag;
    return (target - at).dot(direction) > contact;
  };
  for (double moved = 0.0;; moved += step) {
    // a carrier that answers late has its last steps before it
    const bool last = moved > wallTravel(clearance_prior.high());
    if (last && !awaitEffect(s_.carrier)) return false;
    // a peg that still swings from the step seems pushed, too, but not for long
    if (pushed()) {
      awaitEffect(s_.carrier);
      s_.carrier.wait(s_.scale.timed(kWallSwingBlocks));
      if (pushed()) return true;
    }
    if (last) return false;
    target += step * direction;
    s_.carrier.nudge(s_.frame.restFor(target, R));
  }
}

// Makes sure that the peg doesn't end against a wall, where a carrier that comes to rest somewhere
// else each time may have put it. A peg is free if it follows the carrier to all four sides; else
// `target` is moved by the lag. A peg that a wall holds, farther off than such a step, lags as much
// on all sides: then it is moved by the coupling's strain, which the drift since the last zero
// limits.
bool BoreEntry::clearOfWalls(Vec3& target, const Mat3& R) {
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(s_.hole.normal);
  const double step = kFreeFraction * s_.known.clearance.step();
  const auto place = [this, &R](const Vec3& at) {
    s_.carrier.nudge(s_.frame.restFor(at, R));
    awaitEffect(s_.carrier);
    Vec3 mean = Vec3::Zero();
    const int n = s_.scale.timed(kWallSwingBlocks - 1);
    s_.carrier.wait(s_.scale.timed(1));
    for (int i = 0; i < n; ++i) {
      s_.carrier.wait(1);
      mean += s_.frame.pegPose(s_.carrier.target(), s_.deflection()).p / n;
    }
    return mean;
  };
  // a longer move ends here, where the peg will stay: the short ones that follow don't change that
  s_.carrier.moveTo(s_.frame.restFor(target + 0.5 * s_.p.insertion_depth * s_.hole.normal, R));
  s_.carrier.moveTo(s_.frame.restFor(target, R));
  for (int i = 0; i < kFreeTries; ++i) {
    const Vec3 here = place(target);
    bool free = s_.carrier.force().norm() < maxForce();
    Vec2 back = Vec2::Zero();  // sum of the four lags
    double follows = 0.0;      // farthest, of the step
    for (int side = 0; side < 4; ++side) {
      const double sign = side % 2 == 0 ? 1.0 : -1.0;
      const Vec3 along = sign * axes.col(side / 2);
      const Vec2 lag = axes.transpose() * (place(target + step * along) - here - step * along);
      free = free && lag.norm() < kLag * step;
      follows = std::max(follows, 1.0 + sign * lag(side / 2) / step);
      back += lag;
    }
    if (free) {
      place(target);  // and until it no longer swings
      return true;
    }
    Vec2 away = back * std::min(1.0, kOffWall * s_.known.clearance.step() / back.norm());
    if (follows < kFollows) {
      const Vec2 strain = axes.transpose() * (here - s_.hanging.sag - target);
      away = strain * (1.0 + kOffWall * s_.known.clearance.step() / strain.norm());
    }
    target += axes * away;
  }
  s_.report("centre", "a wall on every side");
  return false;
}

// To the middle between the walls along two axes, which is the hole's centre: on the second axis
// the walls are twice the clearance apart, and the middle free of force.
bool BoreEntry::centre(const Mat3& R) {
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(s_.hole.normal);
  const bool stays = !s_.p.insert.wanted() && !startsDeep();
  for (int axis = 0; axis < 2; ++axis) {
    Vec3 ahead, behind;
    const Vec3 along = axes.col(axis);
    const auto commanded = [this] { return s_.target().p; };
    Vec3 from_ahead;
    const auto find_both = [&] {
      if (!findWall(along, R, ahead)) return false;
      from_ahead = commanded();
      return findWall(-along, R, behind);
    };
    if (!find_both()) {
      s_.report("centre", "no wall: not in the hole");
      return false;
    }
    Vec3 target = commanded();
    const bool own_ends = (from_ahead - target).norm() > kOwnEnd;
    target += along * along.dot(0.5 * (ahead + behind) - target);
    // where the peg stays, clearOfWalls() moves to the last middle
    if (axis == 0 || !stays) {
      s_.carrier.moveTo(s_.frame.restFor(target, R));
      s_.carrier.wait(s_.scale.timed(kWallBlocks));
    }
    if (axis == 0) continue;
    const double distance = along.dot(ahead - behind);
    s_.report("centre", text("between walls %.3f mm apart", distance * 1e3));
    const double slack = kGapSlack * s_.scale.give;
    if (distance < -slack || distance > 2.0 * clearance_prior.high() + slack) return false;
    // half of the difference of two ends, where each wall was met after a move of its own
    const double ends_sd = own_ends ? std::sqrt(0.5 * place_variance) : 0.0;
    const double give_sd = kGiveSd * kWallDeflection * s_.scale.give;
    const Clearance before = clearance_prior;
    clearance_prior.add(0.5 * distance, std::hypot(kWallSd, give_sd, ends_sd));
    s_.known.clearance = clearance_prior;
    // no wall pushes any more: the peg itself is in the middle
    // (deep in the hole the walls lead, and the depth says where the peg is)
    if (stays && !clearOfWalls(target, R)) {
      // a peg that wedges in the rim meets walls, too: they aren't those of the hole
      s_.known.clearance = clearance_prior = before;
      return false;
    }
    const Vec3 center = target + s_.hanging.sag;
    s_.hole.center = center - s_.hole.normal * (s_.hole.normal.dot(center) - s_.hole.height);
    const double noise = s_.carrier.reportNoise().position;
    s_.hole.center_covariance =
        Eigen::Matrix2d::Identity() *
        (kWallSd * kWallSd + noise * noise + (own_ends ? kOfEnds : 1.0) * place_variance);
    s_.found = true;
  }
  return true;
}

}  // namespace assembly_cell
