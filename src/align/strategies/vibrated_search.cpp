// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/strategies/vibrated_search.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kMostLean = 0.5;  // of the peg on the plane: the model of small motions [rad]
constexpr double kLonger = 4.0;    // window of a second reading: half the noise
constexpr double kNoise =
    1e-3;  // of a direction that a window needn't go below: the fit's floor [rad]
constexpr double kPeriods = 7.0;  // of the exciter in the shortest window
constexpr double kFirmer = 0.7;   // exciter, and press over it, where a contact slipped: half the
                                  // friction asked for
constexpr double kClearlyLow = 0.6;  // cosine from the low side
constexpr double kSpread =
    0.02;  // of them round the edge, determinant: 0.06 for 0, 72 and 144 degrees
constexpr double kOver = 0.5;    // of the lift, over a known plane
constexpr double kRough = 5e-4;  // over a plane that is roughly known, before a turn [m]
constexpr int kAttempts = 4;
// Plane and directions settle each other: a turn leaves a thirtieth of the error.
constexpr int kMostTurns = 4;
constexpr double kSameNormal = 1e-6;   // change in a turn that ends them [rad]
constexpr double kMoreTilt = 0.035;    // of another attempt [rad]
constexpr double kMaxTilt = 0.14;      // 8 degrees [rad]
constexpr double kRetreat = 8e-3;      // above where an attempt failed [m]
constexpr double kGentler = 0.8;       // press and exciter after too much force
constexpr double kUnknownTilt = 0.05;  // that the peg may have begun with [rad]
constexpr double kHoverGive = 4e-4;    // sideways, to find out whether the peg is free, and twice
                                       // the clearance [m]
constexpr double kHoverForce = 1.0;    // [N]
constexpr int kHoverBlocks = 3, kHoverSteps = 3;
constexpr double kPressReserve = 0.75;  // of the force limit, for the press [-]
constexpr double kPressTurn = 0.3;      // of the tilt, that a press on the edge may turn the peg

// what another attempt would end with, too
bool isFinal(AlignFailure failure) {
  return failure == AlignFailure::kTooUncertain || failure == AlignFailure::kNoReading ||
         failure == AlignFailure::kNoContact;
}

}  // namespace

void VibratedSearch::find() {
  if (begin()) return;
  bottom_ = Vec3(0, 0, -length_);
  tilt_ = p_.sweep_tilt;
  choosePoint();
  for (int k = 1;; ++k) {
    try {
      if (attempt()) return;
      throw AlignError(AlignFailure::kNotInserted, "resistance everywhere");
    } catch (const AlignError& error) {
      if (k >= kAttempts || isFinal(error.failure)) throw;
      recover(error, k);
    }
  }
}

VibrationPoint VibratedSearch::pointFor(double friction) const {
  VibrationDemand demand;
  demand.given = {p_.exciter_frequency, p_.exciter_amplitude, p_.press_force, 0.0};
  demand.tilt = p_.sweep_tilt;
  demand.shake = p_.shake;
  const auto& stiffness = mechanism_.coupling.stiffness.diagonal;
  const double turns = std::min(stiffness(4), stiffness(5)) / mechanism_.peg.radius;  // [N/rad]
  demand.greatest_press =
      std::min(kPressReserve * p_.force_limit, kPressTurn * p_.sweep_tilt * turns);
  demand.friction = friction;
  demand.window = p_.window;
  demand.samples = std::max(8.0, press_.last().samples * p_.window / block_);
  demand.scatter = press_.scatter();
  demand.rounding = press_.rounding();
  return chooseVibration(mechanism_, demand);
}

void VibratedSearch::choosePoint() {
  try {
    vibration_ = pointFor(0.0);
  } catch (const InputError& error) {
    throw AlignError(AlignFailure::kTooUncertain, error.what());
  }
  report("operating_point",
         text("exciter %.0f rad/s with %.2f N, ", vibration_.frequency, vibration_.amplitude) +
             text("press %.1f N, expected sd of a direction %.3f deg", vibration_.press,
                  vibration_.direction_sd * 180 / M_PI));
  if (vibration_.direction_sd > p_.direction_limit) {
    throw AlignError(AlignFailure::kTooUncertain,
                     text("a reading's direction would have an sd of %.2f deg, %.2f "
                          "are allowed; use a finer converter, more force or a longer window",
                          vibration_.direction_sd * 180 / M_PI, p_.direction_limit * 180 / M_PI));
  }
}

// clear of everything, zero checked; then what may help this time
void VibratedSearch::recover(const AlignError& error, int attempt) {
  const AlignFailure failure = error.failure;
  report("recover", error.what());
  backOut(kRetreat * scale_.room);
  bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
  touches_ = 0;
  if (failure == AlignFailure::kForceLimit || failure == AlignFailure::kSensorSaturated) {
    vibration_.press *= kGentler;
    vibration_.amplitude *= kGentler;
  }
  if (!planeKnown() || failure == AlignFailure::kWedged || failure == AlignFailure::kGaveWay ||
      failure == AlignFailure::kEdgeInHole) {
    // the hole may be right below, where a tilted edge goes in: beside it the edge stays out
    goAside();
  } else if (failure == AlignFailure::kNoHoleUnderEdge) {
    // a quarter of a turn from one attempt to the next: three recoveries look to three sides
    const double a = 2 * M_PI * attempt / kAttempts;
    bottom_ += tipRadius(mechanism_.peg) *
               (rotationToAxis(hole_.normal) * Vec3(std::cos(a), std::sin(a), 0.0));
  }
  if (failure == AlignFailure::kNoPlaneReading || failure == AlignFailure::kOneEdgeOnly) {
    tilt_ = std::min(kMaxTilt, tilt_ + kMoreTilt);
  }
  if (!found_) felt_.clear();
}

void VibratedSearch::goAside() { bottom_ += wayAside(tilt_ + (planeKnown() ? 0.0 : kUnknownTilt)); }

void VibratedSearch::exciterNext(double amplitude) {
  press_.exciterNext({amplitude, vibration_.frequency, 0.0, p_.exciter_direction});
}

// rest height at which a peg tilted by R must have touched unless its edge is in the hole: outside,
// the bottom's centre stays above the plane
double VibratedSearch::entryHeight(const Mat3& R) const {
  if (!planeKnown()) {
    if (touches_ == 0) return -1e9;
    return restFor(Vec3(bottom_.x(), bottom_.y(), highest_ - touchRange()), R).z;
  }
  const double drop = hole_.normal.dot(bottom_) - hole_.height + entryDepth();
  return restFor(bottom_ - drop * hole_.normal, R).z;
}

// as long as the plane is not known: by how much the bottom's centre may be lower at one touch than
// at another
double VibratedSearch::touchRange() const {
  return tipRadius(mechanism_.peg) * std::sin(tilt_ + kUnknownTilt) + entryDepth();
}

// just off the first touch: a peg that can't be moved sideways is in the hole already
bool VibratedSearch::caught() {
  RestPose hover = press_.target();
  hover.z += p_.lift;
  press_.moveTo(hover);
  press_.wait(timed(kHoverBlocks));
  const double least = kHoverForce * scale_.force;
  if (press_.forceZ() < -least) {
    // it doesn't even come up: not pulled any more
    hover.z -= p_.lift;
    press_.moveTo(hover);
    return true;
  }
  const Vec3 before = press_.force();
  RestPose beside = hover;
  const auto pushed = [&] { return (press_.force() - before).head<2>().norm() > least; };
  const double way =
      kHoverGive * scale_.give + 2.0 * (mechanism_.hole.radius - mechanism_.peg.radius);
  bool held = false;
  for (int i = 0; i < kHoverSteps && !held; ++i) {
    beside.x += way / kHoverSteps;
    press_.moveTo(beside);
    press_.wait(timed(1));
    if (pushed()) press_.wait(timed(kHoverBlocks));  // it may only swing
    held = pushed();
  }
  press_.moveTo(hover);
  if (held) return true;
  hover.z -= p_.lift;
  press_.moveTo(hover);
  return false;
}

// way up before the peg is turned to R, so that its edge stays off the plane: no point of the edge
// goes down by more than the radius times the turn, nor below its lowest point
double VibratedSearch::clearance(const Mat3& R) const {
  const Mat3 before = (inverse(X_BS_) * poseFromRest(press_.target())).R;
  const double turn = std::acos(std::clamp(R.col(2).dot(before.col(2)), -1.0, 1.0));
  const double travel = tipRadius(mechanism_.peg) * turn;
  Vec3 normal = hole_.normal;
  double height = hole_.height, above = kOver * p_.lift;
  if (!planeKnown()) {
    const std::optional<Vec3> rough = roughPlane();
    if (!rough) return travel;
    normal = Vec3(-rough->x(), -rough->y(), 1.0).normalized();
    height = rough->z() * normal.z();
    above = kRough * scale_.room;
  }
  const double low =
      tipRadius(mechanism_.peg) * std::sqrt(std::max(0.0, 1.0 - std::pow(normal.dot(R.col(2)), 2)));
  return std::clamp(low + above - normal.dot(bottom_) + height, 0.0, travel);
}

// slopes and height over the origin of a plane through the contacts so far that were clearly on the
// peg's low side
std::optional<Vec3> VibratedSearch::roughPlane() const {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero();
  int n = 0;
  for (const Felt& felt : felt_) {
    const Pose& peg = felt.reading.X_SP;
    const Vec3 edge(std::cos(felt.reading.alpha), std::sin(felt.reading.alpha), 0.0);
    const Vec3 side = peg.R * edge;
    const double low = side.dot((peg.R.col(2) - hole_.normal).normalized());
    if (std::abs(low) < kClearlyLow) continue;
    const Vec3 at = (peg.p - bottom_) / tipRadius(mechanism_.peg) + std::copysign(1.0, low) * side;
    const Vec3 row(at.x(), at.y(), 1.0);
    ++n;
    A += row * row.transpose();
    b += row * at.z();
  }
  if (n < 3 || A.determinant() < kSpread * n * n * n) return {};
  Vec3 plane = A.inverse() * b;
  if (plane.head<2>().norm() > kUnknownTilt) return {};
  plane.z() =
      bottom_.z() + tipRadius(mechanism_.peg) * plane.z() - plane.head<2>().dot(bottom_.head<2>());
  return plane;
}

Mat3 VibratedSearch::lowAt(double low) const {
  // the rotation vector is a right angle ahead of the low side
  return rotationToAxis(hole_.normal) * tiltRotation(tilt_ * Vec2(-std::sin(low), std::cos(low)));
}

bool VibratedSearch::read(const Mat3& R, const char* state, Felt& felt, bool press_both) {
  bottom_ += clearance(R) * (planeKnown() ? hole_.normal : Vec3::UnitZ());
  press_.moveTo(restFor(bottom_, R));
  const std::optional<Touch> light = lightTouch(entryHeight(R));
  const bool in = !light;
  if (in && planeKnown()) return false;
  RestPose touch = press_.target();
  if (!in) {
    touch.z = press_.touchZ();
    const double height = pegPose(touch, Vector6::Zero()).p.z();
    highest_ = touches_ == 0 ? height : std::max(highest_, height);
    lowest_ = touches_ == 0 ? height : std::min(lowest_, height);
    ++touches_;
  }
  // light first: a wedge is never pressed, nor are both edges unless they are what is looked for
  if (light) refuseWedge(*light, R);
  if (in || (!planeKnown() && (highest_ - lowest_ > touchRange() || (touches_ == 1 && caught())))) {
    throw AlignError(AlignFailure::kEdgeInHole,
                     "the tilted edge went into the hole before the plane was known");
  }

  felt = Felt{};
  if (light->straddles() && !press_both) {
    holeOnLowSide(R);
    felt.straddles = true;
    report(state, text("both edges carry, line of action %.1f mm from the axis",
                       light->reach * mechanism_.peg.radius * 1e3));
    touch.z += p_.lift;
    press_.moveTo(touch);
    bottom_ = pegPose(touch, Vector6::Zero()).p;
    return true;
  }

  shake(vibration_);
  // whether both edges carry takes a longer look than where one does
  feel(press_both ? p_.window : window(), felt);
  if (felt.seen.advice != ReadingAdvice::kNone) feelAgain(state, felt);
  exciterNext(0.0);
  std::string note = toString(felt.seen.mode.mode);
  if (felt.seen.direction) {
    note += text(", direction %.2f deg, sd %.2f", felt.reading.alpha * 180 / M_PI,
                 felt.reading.sd * 180 / M_PI);
  }
  if (felt.seen.misfit > 0.0) note += text(", misfit %.3f", felt.seen.misfit);
  if (!felt.usable) note += ": left out";
  report(state, note);

  // the way to the next tilt begins there: all of the edge goes up from the first on
  touch.z += p_.lift;
  bottom_ = pegPose(touch, Vector6::Zero()).p;
  return true;
}

// as long as the noise asks for
double VibratedSearch::window() const {
  const double least = kPeriods * 2 * M_PI / vibration_.frequency;
  const double enough = p_.window * std::pow(vibration_.direction_sd / kNoise, 2);
  return std::min(p_.window, std::max(least, enough));
}

// shakes harder than the reading will while it presses, so that friction keeps no preload near its
// limit
void VibratedSearch::shake(const VibrationPoint& vibration) {
  vibration_ = vibration;
  exciterNext(p_.shake * vibration_.amplitude);
  press_.hold(vibration_.press, p_.press_tolerance, true);
  exciterNext(vibration_.amplitude);
  press_.wait(1 + blocks(p_.settle));
}

// one reading of the contact that is shaken
void VibratedSearch::feel(double window, Felt& felt) {
  felt = Felt{};
  felt.vibration = vibration_;
  PlantCommand measure;
  measure.locus = LocusRequest{press_.last().time, window};
  felt.start = press_.last().time;
  Vector6 bent = Vector6::Zero();
  int taken = 0;
  for (; !press_.last().locus || taken == 0; measure.locus.reset()) {
    if (taken > blocks(window) + 2)
      throw AlignError(AlignFailure::kNoReading, "the estimator gave none");
    press_.step(measure);
    const PlantBlock& block = press_.last();
    if (block.reading_start > felt.start) {
      felt.start = block.reading_start;
      taken = 0;
    }
    // what comes before the window is none of it
    if (block.time <= felt.start) continue;
    if (taken++ == 0) {
      bent.setZero();
      felt.force.setZero();
    }
    bent += deflection();
    felt.force += press_.force();
  }
  bent /= taken;
  felt.force /= taken;
  felt.end = felt.start + window;
  felt.seen = *press_.last().locus;
  felt.X_SC = carrierPose();
  felt.reading.X_SP = pegPose(press_.last().carrier, bent);
  ++contacts_;
  invert(felt);
  felt.usable = felt.seen.direction && felt.seen.mode.mode == LocusMode::kEllipse;
}

// once, by the reading's own advice. What helped against a slip stays for all that follow.
void VibratedSearch::feelAgain(const char* state, Felt& felt) {
  report(state, std::string(toString(felt.seen.mode.mode)) +
                    text(", misfit %.2f: ", felt.seen.misfit) + toString(felt.seen.advice));
  if (felt.seen.advice == ReadingAdvice::kReadLonger) {
    feel(kLonger * p_.window, felt);
    return;
  }
  const VibrationPoint before = vibration_;
  VibrationPoint firm = before;
  if (felt.seen.friction) firm = pointFor(felt.seen.friction->coefficient);
  if (firm.amplitude * before.press > kFirmer * kFirmer * before.amplitude * firm.press) {
    firm = before;
    firm.amplitude *= kFirmer;
    firm.press = std::min(firm.press / kFirmer, kPressReserve * p_.force_limit);
  }
  shake(firm);
  feel(window(), felt);
  if (!felt.usable) vibration_ = before;
}

void VibratedSearch::invert(Felt& felt) const {
  const Mat3 R_HS = rotationToAxis(hole_.normal).transpose();
  const Mat3 R_HP = R_HS * felt.reading.X_SP.R;
  OperatingPoint point;
  point.frequency = felt.vibration.frequency;
  point.amplitude = felt.vibration.amplitude;
  point.direction = p_.exciter_direction;
  point.ellipse = p_.exciter_ellipse;
  point.compliance = p_.carrier_compliance;
  const Vec3 force = R_HS * felt.X_SC.R * felt.force;
  point.press = std::max(0.0, force.z());
  point.friction = force.head<2>();
  point.rolling = felt.reading.kind == HoleReading::kPlane;
  point.tilt = axisTilt(R_HP.col(2));
  point.sensor_tilt = axisTilt((R_HS * felt.X_SC.R).col(2));
  const double lean = std::max(point.tilt.norm(), point.sensor_tilt.norm());
  if (!(lean < kMostLean)) {
    throw AlignError(AlignFailure::kNoPlaneReading,
                     text("the contacts make a plane that the peg leans on by %.2f rad", lean));
  }
  const ReadingLimits limits;
  explain(mechanism_, point, limits, felt.seen);
  if (!felt.seen.direction) return;
  // horizontal direction from the bottom centre -> azimuth on the edge
  const DirectionEstimate& direction = *felt.seen.direction;
  const Vec2 horizontal(std::cos(direction.alpha), std::sin(direction.alpha));
  const Vec2 body = R_HP.topLeftCorner<2, 2>().inverse() * horizontal;
  felt.reading.alpha = std::atan2(body.y(), body.x());
  felt.reading.sd = direction.sd;
  felt.reading.end_known = direction.weight > limits.half_turn;
}

bool VibratedSearch::level() {
  std::vector<HoleReading> readings(felt_.size());
  HoleEstimate plane = hole_;
  for (int turn = 0; turn < 3; ++turn) {
    for (std::size_t i = 0; i < felt_.size(); ++i) {
      invert(felt_[i]);
      readings[i] = felt_[i].reading;
    }
    plane = hole_;
    if (!fitPlane(tipRadius(mechanism_.peg), readings, plane).good()) return false;
    hole_.normal = plane.normal;
  }
  hole_.height = plane.height;
  hole_.normal_sd = plane.normal_sd;
  level_ = true;
  rotation_sd_ = hole_.normal_sd;
  report("level", text("plane from %.0f contacts, tilt sd %.4f deg",
                       static_cast<double>(felt_.size()), hole_.normal_sd * 180 / M_PI));
  return true;
}

// directions need the plane's normal, the plane needs directions: a few turns settle both
FitStatus VibratedSearch::fit(int least_rim) {
  std::vector<HoleReading> readings(felt_.size());
  Vec3 before;
  int turn = 0;
  do {
    for (std::size_t i = 0; i < felt_.size(); ++i) {
      invert(felt_[i]);
      readings[i] = felt_[i].reading;
    }
    before = hole_.normal;
    const FitStatus status = fitHole(tipRadius(mechanism_.peg), mouthRadius(mechanism_.hole),
                                     readings, hole_, least_rim);
    for (std::size_t i = 0; i < felt_.size(); ++i) felt_[i].reading = readings[i];
    if (!status.good()) return status;
  } while (++turn < kMostTurns && (hole_.normal - before).norm() > kSameNormal);
  return {};
}

void VibratedSearch::resolve() {
  const FitStatus status = fit(kRimReadings);
  if (!status.good()) throw AlignError(status.failure, status.message);
  found_ = true;
  position_sd_ = std::sqrt(hole_.center_covariance.trace());
  rotation_sd_ = hole_.normal_sd;
  report("resolve",
         text("%.0f contacts on the plane, %.0f on the rim", hole_.plane_readings,
              hole_.rim_readings) +
             text(", centre %.3f %.3f mm", offset().x() * 1e3, offset().y() * 1e3) +
             text(" +- %.3f mm, tilt sd %.4f deg", position_sd_ * 1e3, rotation_sd_ * 180 / M_PI));
}

void VibratedSearch::takeEntry() {
  report("entry", "the tilted edge went in");
  const Vec3 at = pegPose(press_.target(), Vector6::Zero()).p;
  hole_.center = at - hole_.normal * (hole_.normal.dot(at) - hole_.height);
}

Vec2 VibratedSearch::offset() const {
  return (rotationToAxis(hole_.normal).transpose() * (hole_.center - Vec3(0, 0, -length_)))
      .head<2>();
}

void VibratedSearch::summarise(AlignResult& result) const {
  result.known = true;
  result.offset = offset();
  result.offset_covariance = hole_.center_covariance;
  result.tilt = -axisTilt(hole_.normal);
  result.tilt_sd = hole_.normal_sd;
  for (const Felt& felt : felt_) {
    if (felt.reading.kind == HoleReading::kOut || !felt.reading.explained) continue;
    result.readings.push_back({felt.start, felt.end, felt.reading.alpha, felt.reading.sd});
  }
}

}  // namespace assembly_cell
