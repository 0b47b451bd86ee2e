// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/search.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "assembly_cell/align/estimation/contact_window.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kClear = 3e-4;   // over the plane before the last descent [m]
constexpr double kTravel = 2e-3;  // over the plane while moving sideways [m]
constexpr double kLeave = 8e-3;   // travel up after a failure [m]

constexpr double kWallSearch = 6.0;    // travel to a wall at most, in clearances
constexpr double kWallPush = 2.5;      // and as far as makes so much of a wall's deflection
constexpr double kWallForce = 1.0;     // of a wall that stops a peg at rest [N]
constexpr double kSofter = 7e3;        // stiffness sideways at the peg's bottom [N/m]
constexpr double kUnknownAxis = 0.05;  // sd of the axis of a hole that only walls tell [rad]
constexpr int kZeroBlocks = 4;         // of a zero over the hole
constexpr int kTouches = 4;            // that may give way, one after the other
constexpr int kSwings = 200;           // that seem to be touches, of a peg that hangs free
constexpr int kFeelBlocks = 2;      // a light touch: to come to rest, and then the mean of as many
constexpr int kBackOuts = 2;        // more, where the first didn't free the peg
constexpr double kGolden = 2.4;     // from one travel aside to the next, never the same twice [rad]
constexpr double kRing = 0.9;       // from one to the next, in clearances
constexpr double kOnFace = 0.75;    // of the force of a peg lowered on the face by the depth
constexpr double kUpright = 0.364;  // slope of a rim contact that is safe to press, 20 degrees

PressLimits limitsFor(const Mechanism& mechanism, const AlignParameters& p) {
  PressLimits limits = pressLimits(mechanism);
  limits.force = p.force_limit;
  limits.descent = p.descent_limit * limits.scale.room;
  limits.approach_step = p.approach_step * limits.scale.step;
  return limits;
}

}  // namespace

Mat3 tiltRotation(const Vec2& tilt) { return rotationFromVector({Vec3(tilt.x(), tilt.y(), 0.0)}); }

Mat3 rotationToAxis(const Vec3& n) {
  const Vec3 axis(-n.y(), n.x(), 0.0);
  const double sine = axis.norm();
  if (sine < 1e-15) return Mat3::Identity();
  return rotationFromVector({axis * (std::atan2(sine, n.z()) / sine)});
}

Vec2 axisTilt(const Vec3& axis) { return vectorFromRotation(rotationToAxis(axis)).value.head<2>(); }

std::string text(const char* format, double a, double b) {
  char buffer[240];
  std::snprintf(buffer, sizeof buffer, format, a, b);
  return buffer;
}

Search::Search(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
               const Progress& progress)
    : mechanism_(mechanism),
      scale_(scaleOf(mechanism)),
      p_(parameters),
      progress_(progress),
      press_(plant, limitsFor(mechanism, parameters)),
      length_(mechanism.peg.half_height + mechanism.peg.coupling_height) {
  start_time_ = press_.last().time;
  press_.wait(1);
  block_ = press_.last().time - start_time_;
}

AlignResult Search::run() {
  try {
    return findAndLeave();
  } catch (PlantError& error) {
    error.contacts += contacts_;
    throw;
  }
}

AlignResult Search::findAndLeave() {
  AlignResult result;
  try {
    find();
    if (p_.insert.wanted()) insert();
    result.success = true;
    result.reason = toString(result.failure);
    if (found_) {
      const Vec3 end = pegPose(press_.last().carrier, deflection()).p;
      result.depth = std::max(0.0, hole_.height - hole_.normal.dot(end));
    }
  } catch (const AlignError& error) {
    result.failure = error.failure;
    result.reason = error.what();
  }
  if (!result.success) {
    try {
      leave();
    } catch (const AlignError& error) {
      // what went wrong first is already known; but from a peg that is held nothing goes on
      if (error.failure == AlignFailure::kStuck) {
        result.failure = error.failure;
        result.reason = std::string(error.what()) + "; before: " + result.reason;
      }
    }
  }
  result.insert = inserted_;
  result.contacts = contacts_;
  result.time = press_.last().time - start_time_;
  result.reference_time = reference_time_;
  if (found_) summarise(result);
  return result;
}

// exciter off, and the peg free
void Search::leave() {
  try {
    if (inserted_.end.depth > 0.0) backOutOfBore(inserted_.end.depth);
  } catch (const AlignError&) {
    // what a pull along the bore doesn't free may come free upright
  }
  const double up = press_.last().carrier.z - start_.z;
  // where it began it hung free: goals that fail in the air don't hang it higher each time
  const bool hangs = !isFarIn() && up > -kHeightNoise && press_.force().norm() < press_.freeForce();
  if (begun_ && !hangs && up < kLeave * scale_.room) {
    backOut(kLeave * scale_.room);
  } else {
    PlantCommand off;
    off.exciter = ExciterParameters{0.0, 0.0, 0.0, p_.exciter_direction};
    press_.step(off);
  }
}

RestPose Search::restFor(const Vec3& p, const Mat3& R) const {
  const Pose X_B = X_BS_ * Pose{R, p + length_ * R.col(2)};
  return restFromPose(X_B);
}

Vector6 Search::sag(const RestPose& carrier) const {
  const Vec3 up = poseFromRest(carrier).R.transpose() * Vec3::UnitZ();
  return couplingStiffness(mechanism_.coupling).inverse() *
         pegWeight(mechanism_.peg, mechanism_.gravity, up, Vector6::Zero());
}

Vector6 Search::deflection() const {
  return press_.deflection() + sag(press_.tarePose()) - sag(start_);
}

Pose Search::pegPose(const RestPose& carrier, const Vector6& d) const {
  const Pose deflected{rotationFromVector({Vec3(d.tail<3>())}), d.head<3>()};
  const Pose bottom{Mat3::Identity(), Vec3(0, 0, -length_)};
  return inverse(X_BS_) * poseFromRest(carrier) * deflected * bottom;
}

Vector6 Search::tipWrench(const Vector6& wrench, const Vector6& deflection) const {
  // the weight has turned with the carrier in press_.wrench(), and turns with the deflection here
  const Vec3 up = poseFromRest(press_.last().carrier).R.transpose() * Vec3::UnitZ();
  const auto weight = [&](const Vector6& d) {
    return pegWeight(mechanism_.peg, mechanism_.gravity, up, d);
  };
  const Vector6 turned = weight(deflection) - weight(Vector6::Zero());
  const Pose X_CQ = Pose{rotationFromVector({Vec3(deflection.tail<3>())}), deflection.head<3>()} *
                    Pose{Mat3::Identity(), Vec3(0, 0, -length_)};
  return transformWrench(inverse(X_CQ), wrench - turned);
}

void Search::rememberSag(const Vec3& bottom) {
  hanging_ = deflection();
  sag_ = pegPose(press_.last().carrier, hanging_).p - bottom;
}

Search::Touch Search::feel() {
  const int n = timed(kFeelBlocks);
  press_.wait(n);
  Vector6 w = Vector6::Zero(), d = Vector6::Zero();
  for (int i = 0; i < n; ++i) {
    press_.wait(1);
    w += press_.wrench() / n;
    d += deflection() / n;
  }
  const Vector6 at = tipWrench(w, d);
  Touch touch;
  touch.least *= scale_.force;
  touch.X_SP = pegPose(press_.target(), d);
  touch.force = at(2);
  touch.sideways = at.head<2>().norm();
  if (touch.force > 0.0) {
    touch.point = Vec2(-at(4), at(3)) / touch.force;
    touch.lean = at.head<2>() / touch.force;
    touch.reach = touch.point.norm() / tipRadius(mechanism_.peg);
  }
  return touch;
}

std::optional<Search::Touch> Search::lightTouch(double floor) {
  Touch touch;
  for (int gave_way = 0, swings = 0; gave_way < kTouches && swings < kSwings && !touch.felt();) {
    if (!press_.approach(floor)) return {};
    touch = feel();
    ++(touch.gone() ? swings : gave_way);
  }
  return touch;
}

void Search::refuseWedge(const Touch& touch, const Mat3& R) {
  if (touch.felt() && !touch.steep()) return;
  holeOnLowSide(R);
  if (!touch.felt()) throw AlignError(AlignFailure::kWedged, "a light touch gives way");
  throw AlignError(
      AlignFailure::kWedged,
      text("a light touch of %.1f N pushes sideways with %.1f N", touch.force, touch.sideways));
}

void Search::holeOnLowSide(const Mat3& R) {
  const Vec3 low(R.col(2).x(), R.col(2).y(), 0.0);
  if (low.norm() < 1e-6) return;
  aside_ = -low.normalized();
  asides_ = 0;
}

void Search::backOut(double travel) {
  for (int i = 0;; ++i) {
    const Pose peg = pegPose(press_.last().carrier, deflection());
    try {
      // unstrained; if that does not free it, turned back first: pulling may tighten a wedge
      press_.retreat(restFor(peg.p, i == 0 ? peg.R : Mat3(Mat3::Identity())), travel);
      return;
    } catch (const AlignError& error) {
      if (i == kBackOuts) throw;
      report("recover", error.what());
    }
  }
}

Vec3 Search::wayAside(double tilt) {
  const Mat3 turn = rotationFromVector({Vec3(0, 0, kGolden * asides_++)});
  const double travel = trapWidth(tilt);
  report("aside", text("by %.1f mm", travel * 1e3));
  return travel * (rotationToAxis(hole_.normal) * turn * aside_);
}

double Search::trapWidth(double tilt) const {
  const double r = tipRadius(mechanism_.peg), R = mouthRadius(mechanism_.hole);
  return std::sqrt(R * R - r * r) + r * tilt / kUpright;
}

int Search::blocks(double duration) const {
  return std::max(1, static_cast<int>(std::ceil(duration * scale_.time / block_ - 1e-6)));
}

int Search::timed(int blocks) const {
  return static_cast<int>(std::ceil(blocks * scale_.time - 1e-9));
}

// Sideways to a wall at most: over the clearance, and until the wall has pushed enough to be one.
double Search::wallTravel() const {
  const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
  return std::max(kWallSearch * clearance,
                  2.0 * clearance + kWallPush * kWallForce / kSofter * scale_.give);
}

void Search::report(const char* state, const std::string& message) {
  if (!progress_) return;
  progress_({state, contacts_, press_.last().time - start_time_, message, position_sd_,
             rotation_sd_, inserted_.end.depth, inserted_.end.force(), inserted_.end.walls});
}

bool Search::begin() {
  if (isFarIn())
    press_.tare();
  else
    press_.begin(mechanism_);
  startHere();
  report("tare", isFarIn() ? text("%.1f mm deep in the hole", p_.inserted * 1e3) : "hanging free");
  return isFarIn() ? stillIn() : alreadyIn();
}

void Search::startHere() {
  X_BS_ = poseFromRest(press_.last().carrier);
  start_ = press_.last().carrier;
  begun_ = true;
  reference_time_ = press_.last().time;
}

// What a goal before has left deep in the hole is there, by its walls, or nothing is done from here
// but to take it out.
bool Search::stillIn() {
  knowBore();
  hole_.normal_sd = kUnknownAxis;
  if (centre(Mat3::Identity())) {
    leanInBore();
    return true;
  }
  throw AlignError(AlignFailure::kInContact,
                   text("the goal before has left the peg %.1f mm deep in the hole, and its walls "
                        "aren't where they were; take it out by the action retreat, or reset the "
                        "simulation",
                        p_.inserted * 1e3));
}

// What a peg that swings from its own steps down may feel, too; and less than a soft coupling makes
// of the depth where the peg stands on the face.
double Search::insertionForce() const {
  return std::min(p_.insertion_force * std::max(1.0, scale_.force),
                  kOnFace * mechanism_.coupling.stiffness.diagonal(0) * p_.insertion_depth);
}

// a wall within reach on one side; if so, on all, and nothing below: friction on a face, with the
// peg pressed, would feel like walls
bool Search::alreadyIn() {
  const RestPose start = press_.target();
  const Vec3 bottom = pegPose(start, Vector6::Zero()).p;
  const Vec3 beside = bottom + wallTravel() * Vec3::UnitX();
  press_.moveTo(restFor(beside, Mat3::Identity()));
  press_.wait(timed(kWallBlocks));
  const bool wall = press_.force().head<2>().norm() > kWallForce * scale_.force;
  press_.moveTo(start);
  press_.wait(timed(kWallBlocks));
  if (!wall) return false;
  hole_.normal = Vec3::UnitZ();
  hole_.height = bottom.z() + p_.inserted;
  hole_.normal_sd = kUnknownAxis;
  rememberSag(bottom);
  if (centre(Mat3::Identity()) &&
      lower(pegPose(press_.target(), Vector6::Zero()).p, Mat3::Identity())) {
    leanInBore();
    return true;
  }
  // no hole: something on one side only, or a face
  found_ = false;
  hole_ = HoleEstimate();
  press_.moveTo(start);
  return false;
}

// The axis isn't known: a peg that leans in the bore meets one wall with its edge and the other at
// the rim, and the middle between them is off by up to half the clearance.
void Search::leanInBore() {
  const double play = 0.5 * (mechanism_.hole.radius - mechanism_.peg.radius);
  hole_.center_covariance.diagonal().array() += play * play / 3.0;
}

bool Search::enter(const Vec3& center, int rings) {
  const Mat3 R = rotationToAxis(hole_.normal);
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(hole_.normal);
  const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
  // up along the normal before sideways and straight
  Vec3 above = pegPose(press_.target(), Vector6::Zero()).p;
  const double travel = kTravel * scale_.room;
  above += hole_.normal * std::max(0.0, travel - hole_.normal.dot(above) + hole_.height);
  press_.moveTo(restFor(above, (inverse(X_BS_) * poseFromRest(press_.target())).R), false);
  // the hanging peg sags differently in this pose
  Vec3 target = center + kClear * scale_.room * hole_.normal;
  press_.moveTo(restFor(target + travel * hole_.normal, R), false);
  press_.tare(kZeroBlocks);
  rememberSag(pegPose(press_.target(), Vector6::Zero()).p);
  target -= sag_ - hole_.normal * hole_.normal.dot(sag_);

  // centre, then rings a little closer than the clearance
  for (int ring = 0; ring < rings; ++ring) {
    const int places = ring == 0 ? 1 : 6 * ring;
    for (int i = 0; i < places; ++i) {
      const double a = 2 * M_PI * i / places;
      const Vec2 shift = kRing * clearance * ring * Vec2(std::cos(a), std::sin(a));
      if (lower(target + axes * shift, R) && (!feelsWalls() || centre(R))) return true;
    }
  }
  report("enter", "resistance everywhere, measuring again");
  press_.moveTo(restFor(target + travel * hole_.normal, R));
  return false;
}

double Search::enterReach() const {
  return (kRing * (kRings - 1) + 1.0) * (mechanism_.hole.radius - mechanism_.peg.radius);
}

// down from `from`, just over the plane; back up at the first resistance
bool Search::lower(const Vec3& from, const Mat3& R) {
  press_.moveTo(restFor(from, R));
  const double travel = kClear * scale_.room + entryDepth() + 3.0 * hole_.height_sd;
  const double step = p_.approach_step * scale_.step;
  double down = 0.0;
  while (down < travel && press_.forceZ() < insertionForce()) {
    down = std::min(travel, down + step);
    PlantCommand command;
    command.rest = restFor(from - down * hole_.normal, R);
    press_.step(command);
  }
  if (down >= travel) {
    press_.moveTo(restFor(from - travel * hole_.normal, R));
    press_.wait(blocks(p_.settle));
  }
  const double force = press_.forceZ();
  const bool in = force < insertionForce();
  report("enter", text(in ? "in, contact force %.2f N" : "resistance of %.2f N", force));
  if (!in) press_.moveTo(restFor(from, R));
  return in;
}

}  // namespace assembly_cell
