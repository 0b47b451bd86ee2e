// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/strategies/vibrated_search.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kClearlyLow = 0.6;  // cosine from the low side
// Their spread round the edge, determinant: 0.06 for 0, 72 and 144 degrees.
constexpr double kSpread = 0.02;
constexpr double kOver = 0.5;    // of the lift, over a known plane
constexpr double kRough = 5e-4;  // over a plane that is roughly known, before a rotation [m]
constexpr int kAttempts = 4;
// Plane and directions are found in turn: an iteration leaves a thirtieth of the error.
constexpr int kMaxIterations = 4;
constexpr double kSameNormal = 1e-6;   // change in the last iteration [rad]
constexpr double kMoreTilt = 0.035;    // of another attempt [rad]
constexpr double kMaxTilt = 0.14;      // 8 degrees [rad]
constexpr double kRetreat = 8e-3;      // above where an attempt failed [m]
constexpr double kGentler = 0.8;       // press and exciter after too much force
constexpr double kUnknownTilt = 0.05;  // of the peg at the start, at most [rad]
constexpr double kHoverGive = 4e-4;    // sideways, to find out whether the peg is free, and twice
                                       // the clearance [m]
constexpr double kHoverForce = 1.0;    // [N]
constexpr int kHoverBlocks = 3, kHoverSteps = 3;

}  // namespace

VibratedSearch::VibratedSearch(Search& search)
    : sensor(search.state), search_(search), s_(search.state) {}

void VibratedSearch::run(const std::function<bool()>& attempt) {
  if (search_.begin()) return;
  bottom = Vec3(0, 0, -s_.frame.length());
  tilt = s_.p.sweep_tilt;
  sensor.choosePoint();
  for (int k = 1;; ++k) {
    try {
      if (attempt()) return;
      throw AlignError(AlignFailure::kNotInserted, "resistance everywhere");
    } catch (const AlignError& error) {
      if (k >= kAttempts || !traitsOf(error.failure).vibration_again) throw;
      recover(error, k);
    }
  }
}

// Clear of everything, zero checked; then a change that may help this time.
void VibratedSearch::recover(const AlignError& error, int attempt) {
  const AlignFailure failure = error.failure;
  s_.report("recover", error.what());
  search_.retreat.backOut(kRetreat * s_.scale.travel);
  bottom = s_.target().p;
  touches_.count = 0;
  if (failure == AlignFailure::kForceLimit || failure == AlignFailure::kSensorSaturated) {
    sensor.point.press *= kGentler;
    sensor.point.amplitude *= kGentler;
  }
  if (!planeKnown() || failure == AlignFailure::kWedged || failure == AlignFailure::kGaveWay ||
      failure == AlignFailure::kEdgeInHole) {
    // the hole may be right below, where a tilted edge goes in: beside it the edge stays out
    goAside();
  } else if (failure == AlignFailure::kNoHoleUnderEdge) {
    // a quarter of a turn from one attempt to the next: three recoveries go to three sides
    const double a = 2 * M_PI * attempt / kAttempts;
    bottom += tipRadius(s_.mechanism.peg) *
              (rotationToAxis(s_.hole.normal) * Vec3(std::cos(a), std::sin(a), 0.0));
  }
  if (failure == AlignFailure::kNoPlaneReading || failure == AlignFailure::kOneEdgeOnly) {
    tilt = std::min(kMaxTilt, tilt + kMoreTilt);
  }
  if (!s_.found) measured.clear();
}

void VibratedSearch::goAside() {
  bottom += search_.retreat.nextOffset(tilt + (planeKnown() ? 0.0 : kUnknownTilt));
}

// Rest height at which a peg tilted by R must have touched unless its edge is in the hole: outside,
// the bottom's centre stays above the plane. [m]
double VibratedSearch::entryHeight(const Mat3& R) const {
  if (!planeKnown()) {
    if (touches_.count == 0) return -1e9;
    return s_.frame.restFor(Vec3(bottom.x(), bottom.y(), touches_.highest - touchRange()), R).z;
  }
  const double drop = s_.hole.normal.dot(bottom) - s_.hole.height + search_.entry.depth();
  return s_.frame.restFor(bottom - drop * s_.hole.normal, R).z;
}

// While the plane is not known: largest difference of the bottom centre's height between two
// touches outside the hole. [m]
double VibratedSearch::touchRange() const {
  return tipRadius(s_.mechanism.peg) * std::sin(tilt + kUnknownTilt) + search_.entry.depth();
}

// Just off the first touch: a peg that can't be moved sideways is in the hole already.
bool VibratedSearch::isCaught() {
  RestPose hover = s_.carrier.target();
  hover.z += s_.p.lift;
  s_.carrier.moveTo(hover);
  s_.carrier.wait(s_.scale.timed(kHoverBlocks));
  const double min_force = kHoverForce * s_.scale.force;
  if (s_.carrier.force().z() < -min_force) {
    // it doesn't even come up: the pull ends
    hover.z -= s_.p.lift;
    s_.carrier.moveTo(hover);
    return true;
  }
  const Vec3 before = s_.carrier.force();
  RestPose beside = hover;
  const auto pushed = [&] { return (s_.carrier.force() - before).head<2>().norm() > min_force; };
  const double travel =
      kHoverGive * s_.scale.give + 2.0 * (s_.mechanism.hole.radius - s_.mechanism.peg.radius);
  bool held = false;
  for (int i = 0; i < kHoverSteps && !held; ++i) {
    beside.x += travel / kHoverSteps;
    s_.carrier.moveTo(beside);
    s_.carrier.wait(s_.scale.timed(1));
    if (pushed()) s_.carrier.wait(s_.scale.timed(kHoverBlocks));  // it may only swing
    held = pushed();
  }
  s_.carrier.moveTo(hover);
  if (held) return true;
  hover.z -= s_.p.lift;
  s_.carrier.moveTo(hover);
  return false;
}

// Travel up before the peg is rotated to R, so that its edge stays off the plane: no point of the
// edge goes down by more than the radius times the rotation, nor below its lowest point. [m]
double VibratedSearch::clearance(const Mat3& R) const {
  const Mat3 before = s_.frame.carrierPose(s_.carrier.target()).R;
  const double turn = std::acos(std::clamp(R.col(2).dot(before.col(2)), -1.0, 1.0));
  const double travel = tipRadius(s_.mechanism.peg) * turn;
  Vec3 normal = s_.hole.normal;
  double height = s_.hole.height, above = kOver * s_.p.lift;
  if (!planeKnown()) {
    const std::optional<Vec3> rough = roughPlane();
    if (!rough) return travel;
    normal = Vec3(-rough->x(), -rough->y(), 1.0).normalized();
    height = rough->z() * normal.z();
    above = kRough * s_.scale.travel;
  }
  const double low = tipRadius(s_.mechanism.peg) *
                     std::sqrt(std::max(0.0, 1.0 - std::pow(normal.dot(R.col(2)), 2)));
  return std::clamp(low + above - normal.dot(bottom) + height, 0.0, travel);
}

// Slopes and height over the origin of a plane through the contacts so far that were clearly on the
// peg's low side.
std::optional<Vec3> VibratedSearch::roughPlane() const {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  int n = 0;
  for (const Measurement& m : measured) {
    const Pose& peg = m.reading.X_SP;
    const Vec3 edge(std::cos(m.reading.alpha), std::sin(m.reading.alpha), 0.0);
    const Vec3 side = peg.R * edge;
    const double low = side.dot((peg.R.col(2) - s_.hole.normal).normalized());
    if (std::abs(low) < kClearlyLow) continue;
    const Vec3 at = (peg.p - bottom) / tipRadius(s_.mechanism.peg) + std::copysign(1.0, low) * side;
    const Vec3 row(at.x(), at.y(), 1.0);
    ++n;
    A += row * row.transpose();
    b += row * at.z();
  }
  if (n < 3 || A.determinant() < kSpread * n * n * n) return {};
  Vec3 plane = A.inverse() * b;
  if (plane.head<2>().norm() > kUnknownTilt) return {};
  plane.z() =
      bottom.z() + tipRadius(s_.mechanism.peg) * plane.z() - plane.head<2>().dot(bottom.head<2>());
  return plane;
}

Mat3 VibratedSearch::lowAt(double low) const {
  // the rotation vector is a right angle ahead of the low side
  return rotationToAxis(s_.hole.normal) * tiltRotation(tilt * Vec2(-std::sin(low), std::cos(low)));
}

bool VibratedSearch::read(const Mat3& R, const char* state, Measurement& result, bool press_both) {
  bottom += clearance(R) * (planeKnown() ? s_.hole.normal : Vec3::UnitZ());
  s_.carrier.moveTo(s_.frame.restFor(bottom, R));
  const std::optional<Touch> light = search_.touch.lower(entryHeight(R));
  const bool in = !light;
  if (in && planeKnown()) return false;
  RestPose touch = s_.carrier.target();
  if (!in) {
    touch.z = s_.press.touchZ();
    const double height = s_.frame.pegPose(touch, Vector6::Zero()).p.z();
    touches_.highest = touches_.count == 0 ? height : std::max(touches_.highest, height);
    touches_.lowest = touches_.count == 0 ? height : std::min(touches_.lowest, height);
    ++touches_.count;
  }
  // light first: a wedge is never pressed, nor are both edges except on request
  if (light) search_.touch.refuseWedge(*light, R);
  if (in || (!planeKnown() && (touches_.highest - touches_.lowest > touchRange() ||
                               (touches_.count == 1 && isCaught())))) {
    throw AlignError(AlignFailure::kEdgeInHole,
                     "the tilted edge went into the hole before the plane was known");
  }

  if (light->straddles() && !press_both) {
    search_.retreat.avoidLowSide(R);
    result = Measurement{};
    result.straddles = true;
    s_.report(state, text("both edges carry, line of action %.1f mm from the axis",
                          light->reach * s_.mechanism.peg.radius * 1e3));
    touch.z += s_.p.lift;
    s_.carrier.moveTo(touch);
    bottom = s_.frame.pegPose(touch, Vector6::Zero()).p;
    return true;
  }

  result = sensor.measure(state, press_both);
  std::string note = toString(result.seen.mode.mode);
  if (result.seen.direction) {
    note += text(", direction %.2f deg, sd %.2f", result.reading.alpha * 180 / M_PI,
                 result.reading.sd * 180 / M_PI);
  }
  if (result.seen.misfit > 0.0) note += text(", misfit %.3f", result.seen.misfit);
  if (!result.usable) note += ": left out";
  s_.report(state, note);

  // the path to the next tilt begins there: all of the edge goes up from the first block on
  touch.z += s_.p.lift;
  bottom = s_.frame.pegPose(touch, Vector6::Zero()).p;
  return true;
}

bool VibratedSearch::level() {
  std::vector<HoleReading> readings(measured.size());
  HoleEstimate plane = s_.hole;
  for (int iteration = 0; iteration < 3; ++iteration) {
    for (std::size_t i = 0; i < measured.size(); ++i) {
      sensor.invert(measured[i]);
      readings[i] = measured[i].reading;
    }
    plane = s_.hole;
    if (!fitPlane(tipRadius(s_.mechanism.peg), readings, plane).good()) return false;
    s_.hole.normal = plane.normal;
  }
  s_.hole.height = plane.height;
  s_.hole.normal_sd = plane.normal_sd;
  level_ = true;
  s_.known.rotation_sd = s_.hole.normal_sd;
  s_.report("level", text("plane from %.0f contacts, tilt sd %.4f deg",
                          static_cast<double>(measured.size()), s_.hole.normal_sd * 180 / M_PI));
  return true;
}

// Directions need the plane's normal, the plane needs directions: found in turn.
FitStatus VibratedSearch::fit(int min_rim) {
  std::vector<HoleReading> readings(measured.size());
  Vec3 before;
  int iteration = 0;
  do {
    for (std::size_t i = 0; i < measured.size(); ++i) {
      sensor.invert(measured[i]);
      readings[i] = measured[i].reading;
    }
    before = s_.hole.normal;
    const FitStatus status = fitHole(tipRadius(s_.mechanism.peg), mouthRadius(s_.mechanism.hole),
                                     readings, s_.hole, min_rim);
    for (std::size_t i = 0; i < measured.size(); ++i) measured[i].reading = readings[i];
    if (!status.good()) return status;
  } while (++iteration < kMaxIterations && (s_.hole.normal - before).norm() > kSameNormal);
  return {};
}

void VibratedSearch::resolve() {
  const FitStatus status = fit(kRimReadings);
  if (!status.good()) throw AlignError(status.failure, status.message);
  s_.found = true;
  s_.known.position_sd = std::sqrt(s_.hole.center_covariance.trace());
  s_.known.rotation_sd = s_.hole.normal_sd;
  s_.report("resolve",
            text("%d contacts on the plane, %d on the rim", s_.hole.plane_readings,
                 s_.hole.rim_readings) +
                text(", centre %.3f %.3f mm", holeOffset(s_).x() * 1e3, holeOffset(s_).y() * 1e3) +
                text(" +- %.3f mm, tilt sd %.4f deg", s_.known.position_sd * 1e3,
                     s_.known.rotation_sd * 180 / M_PI));
}

void VibratedSearch::takeEntry() {
  s_.report("entry", "the tilted edge went in");
  const Vec3 at = s_.target().p;
  s_.hole.center = at - s_.hole.normal * (s_.hole.normal.dot(at) - s_.hole.height);
}

void VibratedSearch::summarise(AlignResult& result) const {
  summariseHole(s_, result);
  for (const Measurement& m : measured) {
    if (m.reading.kind == HoleReading::kOut || !m.reading.explained) continue;
    result.readings.push_back({m.start, m.end, m.reading.alpha, m.reading.sd});
  }
}

}  // namespace assembly_cell
