// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/vibration_point.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/press.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/linear_motion.h"

namespace assembly_cell {
namespace {

constexpr int kDirections = 8;
constexpr int kFrequencies = 60;
constexpr double kMinAxis = 0.15;  // minor over major axis: less looks like double contact
constexpr double kHeld = 1.1;      // reserve of friction
constexpr double kRocking = 0.05;  // of the tilt: beyond, rolling isn't linear any more
constexpr double kEnough = 1e-3;   // the model is no better than this [rad]
constexpr double kPressSteps[] = {12, 16, 20, 25, 30, 40};  // [N]
using linear_motion::Complex;
using linear_motion::Complex6;
using linear_motion::Complex9;
using linear_motion::counterRotating;
using linear_motion::HeldMotion;
using linear_motion::motionFromSensor;
using linear_motion::UnheldMotion;

// real and imaginary parts of P and N by those of the sensor's six wrench phasors
Eigen::Matrix<double, 4, 12> planeByWrench(const Mechanism& mechanism, double frequency) {
  const UnheldMotion upright(mechanism, frequency, Eigen::Vector2d::Zero(),
                             Eigen::Vector2d::Zero());
  const Eigen::Matrix<Complex, 2, 6> plane =
      motionFromSensor(mechanism, upright, Eigen::Vector3d::Zero()).topRows<2>();
  Eigen::Matrix<double, 4, 12> A;
  for (int j = 0; j < 12; ++j) {
    const Eigen::Vector2cd xy = plane.col(j / 2) * (j % 2 == 0 ? Complex(1, 0) : Complex(0, 1));
    const Locus locus = locusFromPhasors(xy.x(), xy.y(), 0.0, 1, 1.0);
    A.col(j) << locus.P.real(), locus.P.imag(), locus.N.real(), locus.N.imag();
  }
  return A;
}

// of a contact shaken with 1 N at one frequency, the worst over all directions
struct Answer {
  double need = 0.0;     // press that friction asks for
  double axis = 1e9;     // |minor| over major axis
  double rocking = 0.0;  // [rad]
  double white = 0.0;    // variance of the direction by scatter and rounding [rad²]
  double alike = 0.0;    // by rounding that repeats, times the vibration in steps
  double steps = 1e9;    // rms vibration of a channel in steps of the converter
};

Answer answerAt(const Mechanism& mechanism, const VibrationDemand& demand, double frequency,
                double press) {
  const Eigen::Matrix<double, 4, 12> plane = planeByWrench(mechanism, frequency);
  const auto carried = [&plane](const Matrix6& covariance) {
    Eigen::Matrix<double, 12, 12> both = Eigen::Matrix<double, 12, 12>::Zero();
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j)
        both(2 * i, 2 * j) = both(2 * i + 1, 2 * j + 1) = covariance(i, j);
    }
    return Eigen::Matrix4d(plane * both * plane.transpose());
  };
  const Eigen::Matrix4d white = 2.0 / demand.samples * carried(demand.scatter + demand.rounding);
  // the noise of a channel in steps: what is wider than a step rounds evenly
  const Matrix6 stiffness = couplingStiffness(mechanism.coupling);
  const Eigen::FullPivLU<Matrix6> rounding(demand.rounding);
  const bool rounds = rounding.isInvertible();
  double pattern = 0.0;
  Matrix6 information = Matrix6::Zero();
  if (rounds) {
    information = rounding.inverse();
    const double noise = (information * demand.scatter).trace() / 6.0 / 12.0;
    pattern = 12.0 * 0.11 * 0.11 * std::exp(-4.0 * M_PI * M_PI * noise);
  }
  const Eigen::Matrix4d alike = pattern * carried(demand.rounding);

  Answer answer;
  const double friction = std::max(
      0.01, demand.friction > 0.0 ? demand.friction : mechanism.friction.static_coefficient);
  const double lever = std::hypot(mechanism.peg.radius, mechanism.peg.half_height);
  for (int k = 0; k < kDirections; ++k) {
    const double a = 2 * M_PI * k / kDirections;
    OperatingPoint point;
    point.frequency = frequency;
    point.amplitude = 1.0;
    point.press = press;
    point.tilt = point.sensor_tilt = demand.tilt * Eigen::Vector2d(-std::sin(a), std::cos(a));
    point.rolling = true;
    constexpr double kStep = 1e-4;
    linear_motion::check(point);
    const HeldMotion held(mechanism, point);
    const ContactResponse r = contactResponse(mechanism, held, a);
    const Complex9 turned = held.solve(a + kStep);
    const Eigen::Vector2cd more = counterRotating(turned[0], turned[1]);
    const Complex dP = (more[0] - r.P) / kStep, dN = (more[1] - r.N) / kStep;
    const Eigen::Vector4d slope(dP.real(), dP.imag(), dN.real(), dN.imag());
    const double square = slope.squaredNorm() * slope.squaredNorm();
    answer.white = std::max(answer.white, slope.dot(white * slope) / square);
    answer.alike = std::max(answer.alike, slope.dot(alike * slope) / square);
    const double major = std::abs(r.P) + std::abs(r.N);
    answer.axis = std::min(answer.axis, std::abs(std::abs(r.P) - std::abs(r.N)) / major);
    answer.rocking = std::max(answer.rocking, major / lever);
    for (int i = 0; i < 24; ++i) {
      const Eigen::Vector3d f = (r.contact * std::polar(1.0, 2 * M_PI * i / 24)).real();
      answer.need = std::max(answer.need, f.head<2>().norm() / friction - f.z());
    }
    if (rounds) {
      const Complex6 w = stiffness.cast<Complex>() * r.coupling;
      const double sum =
          (w.real().dot(information * w.real()) + w.imag().dot(information * w.imag())) / 12.0;
      answer.steps = std::min(answer.steps, std::sqrt(sum / 6.0));
    }
  }
  return answer;
}

}  // namespace

VibrationPoint chooseVibration(const Mechanism& mechanism, const VibrationDemand& demand) {
  const VibrationPoint& given = demand.given;
  const double middle = given.frequency > 0.0
                            ? given.frequency
                            : operatingFrequency(mechanism, std::max(1.0, given.press));
  VibrationPoint best;
  best.direction_sd = 1e9;
  for (const double step : kPressSteps) {
    const double press = given.press > 0.0 ? given.press : std::min(step, demand.greatest_press);
    for (int k = 0; k < kFrequencies; ++k) {
      // from half the middle frequency to twice of it
      const double frequency =
          given.frequency > 0.0 ? middle : 0.5 * middle * std::pow(4.0, (k + 0.5) / kFrequencies);
      const Answer answer = answerAt(mechanism, demand, frequency, press);
      if (given.frequency == 0.0 && !(answer.axis >= kMinAxis)) continue;
      const double amplitude = given.amplitude > 0.0
                                   ? given.amplitude
                                   : std::min(press / (kHeld * demand.shake * answer.need),
                                              kRocking * demand.tilt / answer.rocking);
      const double sd =
          std::sqrt(answer.white + answer.alike / (answer.steps * amplitude)) / amplitude;
      if (sd < best.direction_sd) best = {frequency, amplitude, press, sd};
      if (given.frequency > 0.0) break;
    }
    if (best.direction_sd <= kEnough || given.press > 0.0 || press >= demand.greatest_press) break;
  }
  if (!(best.frequency > 0.0)) {
    throw InputError(
        "exciter_frequency: 0: every frequency makes a segment of the locus; give one");
  }
  return best;
}

}  // namespace assembly_cell
