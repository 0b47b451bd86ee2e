// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/strategies/direction_sensor.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kMaxLean = 0.5;  // of the peg on the plane: the model of small motions [rad]
constexpr double kLonger = 4.0;   // window of a second measurement: half the noise
constexpr double kNoise = 1e-3;  // of a direction: the fit's floor, a longer window is no use [rad]
constexpr double kPeriods = 7.0;  // of the exciter in the shortest window
// Exciter, and press over it, where a contact slipped: half the friction is needed.
constexpr double kFirmer = 0.7;
constexpr double kPressReserve = 0.75;  // of the force limit, for the press [-]
constexpr double kPressTurn = 0.3;      // of the tilt, that a press on the edge may turn the peg

}  // namespace

VibrationPoint DirectionSensor::pointFor(double friction) const {
  VibrationDemand demand;
  demand.given = {s_.p.exciter_frequency, s_.p.exciter_amplitude, s_.p.press_force, 0.0};
  demand.tilt = s_.p.sweep_tilt;
  demand.shake = s_.p.shake;
  const auto& stiffness = s_.mechanism.coupling.stiffness.diagonal;
  const double turns = std::min(stiffness(4), stiffness(5)) / s_.mechanism.peg.radius;  // [N/rad]
  demand.max_press =
      std::min(kPressReserve * s_.p.force_limit, kPressTurn * s_.p.sweep_tilt * turns);
  demand.friction = friction;
  demand.window = s_.p.window;
  demand.samples = std::max(8.0, s_.carrier.last().samples * s_.p.window / s_.block);
  demand.scatter = s_.carrier.sensor().tare().scatter;
  demand.rounding = s_.carrier.last().rounding_b;
  return chooseVibration(s_.mechanism, demand);
}

void DirectionSensor::choosePoint() {
  try {
    point = pointFor(0.0);
  } catch (const InputError& error) {
    throw AlignError(AlignFailure::kTooUncertain, error.what());
  }
  s_.report("operating_point",
            text("exciter %.0f rad/s with %.2f N, ", point.frequency, point.amplitude) +
                text("press %.1f N, expected sd of a direction %.3f deg", point.press,
                     point.direction_sd * 180 / M_PI));
  if (point.direction_sd > s_.p.direction_limit) {
    throw AlignError(AlignFailure::kTooUncertain,
                     text("a reading's direction would have an sd of %.2f deg, %.2f "
                          "are allowed; use a finer converter, more force or a longer window",
                          point.direction_sd * 180 / M_PI, s_.p.direction_limit * 180 / M_PI));
  }
}

void DirectionSensor::exciterNext(double amplitude) {
  s_.carrier.exciterNext({amplitude, point.frequency, 0.0, s_.p.exciter_direction});
}

// As long as the noise requires. [s]
double DirectionSensor::window() const {
  const double shortest = kPeriods * 2 * M_PI / point.frequency;
  const double enough = s_.p.window * std::pow(point.direction_sd / kNoise, 2);
  return std::min(s_.p.window, std::max(shortest, enough));
}

// Shakes harder than in the measurement while it presses, so that friction keeps no preload near
// its limit.
void DirectionSensor::shake(const VibrationPoint& vibration) {
  point = vibration;
  exciterNext(s_.p.shake * point.amplitude);
  s_.press.hold(point.press, s_.p.press_tolerance, true);
  exciterNext(point.amplitude);
  s_.carrier.wait(1 + s_.blocks(s_.p.settle));
}

void DirectionSensor::read(double window, DirectionMeasurement& measured) {
  measured = DirectionMeasurement{};
  measured.vibration = point;
  PlantCommand measure;
  measure.locus = LocusRequest{s_.carrier.last().time, window};
  measured.start = s_.carrier.last().time;
  Vector6 bent = Vector6::Zero();
  int taken = 0;
  for (; !s_.carrier.last().locus || taken == 0; measure.locus.reset()) {
    if (taken > s_.blocks(window) + 2)
      throw AlignError(AlignFailure::kNoReading, "the estimator gave none");
    s_.carrier.step(measure);
    const PlantBlock& block = s_.carrier.last();
    if (block.reading_start > measured.start) {
      measured.start = block.reading_start;
      taken = 0;
    }
    // blocks before the window don't count
    if (block.time <= measured.start) continue;
    if (taken++ == 0) {
      bent.setZero();
      measured.force.setZero();
    }
    bent += s_.deflection();
    measured.force += s_.carrier.force();
  }
  bent /= taken;
  measured.force /= taken;
  measured.end = measured.start + window;
  measured.seen = *s_.carrier.last().locus;
  measured.X_SC = s_.frame.carrierPose(s_.carrier.last().carrier);
  measured.reading.X_SP = s_.frame.pegPose(s_.carrier.last().carrier, bent);
  ++s_.contacts;
  invert(measured);
  measured.usable = measured.seen.direction && measured.seen.mode.mode == LocusMode::kEllipse;
}

// Once, by the advice of the locus. A point that helped against a slip is kept for all that follow.
void DirectionSensor::readAgain(const char* state, DirectionMeasurement& measured) {
  s_.report(state, std::string(toString(measured.seen.mode.mode)) +
                       text(", misfit %.2f: ", measured.seen.misfit) +
                       toString(measured.seen.advice));
  if (measured.seen.advice == ReadingAdvice::kReadLonger) {
    read(kLonger * s_.p.window, measured);
    return;
  }
  const VibrationPoint before = point;
  VibrationPoint firm = before;
  if (measured.seen.friction) firm = pointFor(measured.seen.friction->coefficient);
  if (firm.amplitude * before.press > kFirmer * kFirmer * before.amplitude * firm.press) {
    firm = before;
    firm.amplitude *= kFirmer;
    firm.press = std::min(firm.press / kFirmer, kPressReserve * s_.p.force_limit);
  }
  shake(firm);
  read(window(), measured);
  if (!measured.usable) point = before;
}

DirectionMeasurement DirectionSensor::measure(const char* state, bool full_window) {
  DirectionMeasurement measured;
  shake(point);
  read(full_window ? s_.p.window : window(), measured);
  if (measured.seen.advice != ReadingAdvice::kNone) readAgain(state, measured);
  exciterNext(0.0);
  return measured;
}

void DirectionSensor::invert(DirectionMeasurement& measured) const {
  const Mat3 R_HS = rotationToAxis(s_.hole.normal).transpose();
  const Mat3 R_HP = R_HS * measured.reading.X_SP.R;
  OperatingPoint then;
  then.frequency = measured.vibration.frequency;
  then.amplitude = measured.vibration.amplitude;
  then.direction = s_.p.exciter_direction;
  then.ellipse = s_.p.exciter_ellipse;
  then.compliance = s_.p.carrier_compliance;
  const Vec3 force = R_HS * measured.X_SC.R * measured.force;
  then.press = std::max(0.0, force.z());
  then.friction = force.head<2>();
  then.rolling = measured.reading.kind == HoleReading::kPlane;
  then.tilt = axisTilt(R_HP.col(2));
  then.sensor_tilt = axisTilt((R_HS * measured.X_SC.R).col(2));
  const double lean = std::max(then.tilt.norm(), then.sensor_tilt.norm());
  if (!(lean < kMaxLean)) {
    throw AlignError(AlignFailure::kNoPlaneReading,
                     text("the contacts make a plane that the peg leans on by %.2f rad", lean));
  }
  const ReadingLimits limits;
  explain(s_.mechanism, then, limits, measured.seen);
  if (!measured.seen.direction) return;
  // horizontal direction from the bottom centre -> azimuth on the edge
  const DirectionEstimate& direction = *measured.seen.direction;
  const Vec2 horizontal(std::cos(direction.alpha), std::sin(direction.alpha));
  const Vec2 body = R_HP.topLeftCorner<2, 2>().inverse() * horizontal;
  measured.reading.alpha = std::atan2(body.y(), body.x());
  measured.reading.sd = direction.sd;
  measured.reading.end_known = direction.weight > limits.half_turn;
}

}  // namespace assembly_cell
