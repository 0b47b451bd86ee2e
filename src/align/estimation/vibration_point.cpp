// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/vibration_point.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "assembly_cell/align/search/scale.h"
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
using linear_motion::MotionParts;
using linear_motion::UnheldMotion;

// Response of a contact shaken with 1 N at one frequency, the worst over all directions.
struct Answer {
  double need = 0.0;     // press that friction requires
  double axis = 1e9;     // |minor| over major axis
  double rocking = 0.0;  // [rad]
  double white = 0.0;    // variance of the direction by scatter and rounding [rad²]
  double alike = 0.0;    // by rounding that repeats, times the vibration in steps
  double steps = 1e9;    // rms vibration of a channel in steps of the converter
};

// Real and imaginary parts of P and N by those of the sensor's six wrench phasors.
struct PlaneByWrench {
  Eigen::Matrix<double, 4, 6> real, imaginary;

  Eigen::Matrix4d carried(const Matrix6& covariance) const {
    return real * covariance * real.transpose() + imaginary * covariance * imaginary.transpose();
  }
};

// The contacts that are compared: their terms that depend neither on frequency nor on press.
class Contacts {
 public:
  Contacts(const Mechanism& mechanism, const VibrationDemand& demand);
  // Ends at the first direction whose axes, minor over major, are below `min_axis`.
  Answer at(double frequency, double press, double min_axis) const;

 private:
  PlaneByWrench planeByWrench(double frequency) const;

  const Mechanism& mechanism_;
  const VibrationDemand& demand_;
  MotionParts upright_;
  std::vector<OperatingPoint> points_;  // of 1 N, by direction
  std::vector<MotionParts> tilted_;
  Matrix6 stiffness_;
  bool rounds_;
  Matrix6 information_ = Matrix6::Zero();  // of the rounding
  double pattern_ =
      0.0;  // of the rounding pattern that noise leaves; noise wider than a step removes it
  double friction_, lever_;
};

Contacts::Contacts(const Mechanism& mechanism, const VibrationDemand& demand)
    : mechanism_(mechanism),
      demand_(demand),
      upright_(mechanism, Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()),
      stiffness_(couplingStiffness(mechanism.coupling)),
      friction_(std::max(
          0.01, demand.friction > 0.0 ? demand.friction : mechanism.friction.static_coefficient)),
      lever_(std::hypot(mechanism.peg.radius, mechanism.peg.half_height)) {
  const Eigen::FullPivLU<Matrix6> rounding(demand.rounding);
  rounds_ = rounding.isInvertible();
  if (rounds_) {
    information_ = rounding.inverse();
    const double noise = (information_ * demand.scatter).trace() / 6.0 / 12.0;
    pattern_ = 12.0 * 0.11 * 0.11 * std::exp(-4.0 * M_PI * M_PI * noise);
  }
  for (int k = 0; k < kDirections; ++k) {
    const double a = 2 * M_PI * k / kDirections;
    OperatingPoint point;
    point.amplitude = 1.0;
    point.tilt = point.sensor_tilt = demand.tilt * Eigen::Vector2d(-std::sin(a), std::cos(a));
    point.rolling = true;
    points_.push_back(point);
    tilted_.emplace_back(mechanism, point.tilt, point.sensor_tilt);
  }
}

PlaneByWrench Contacts::planeByWrench(double frequency) const {
  const Eigen::Matrix<Complex, 2, 6> plane =
      motionFromSensor(mechanism_, UnheldMotion(upright_, frequency), Eigen::Vector3d::Zero())
          .topRows<2>();
  const auto of = [](const Eigen::Vector2cd& xy) {
    const Locus locus = locusFromPhasors(xy.x(), xy.y(), 0.0, 1, 1.0);
    return Eigen::Vector4d(locus.P.real(), locus.P.imag(), locus.N.real(), locus.N.imag());
  };
  PlaneByWrench by;
  for (int j = 0; j < 6; ++j) {
    by.real.col(j) = of(plane.col(j));
    by.imaginary.col(j) = of(plane.col(j) * Complex(0, 1));
  }
  return by;
}

Answer Contacts::at(double frequency, double press, double min_axis) const {
  const PlaneByWrench plane = planeByWrench(frequency);
  const Eigen::Matrix4d white =
      2.0 / demand_.samples * plane.carried(demand_.scatter + demand_.rounding);
  const Eigen::Matrix4d alike = pattern_ * plane.carried(demand_.rounding);
  Answer answer;
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const double a = 2 * M_PI * static_cast<double>(k) / kDirections;
    OperatingPoint point = points_[k];
    point.frequency = frequency;
    point.press = press;
    constexpr double kStep = 1e-4;
    linear_motion::check(point);
    const HeldMotion held(mechanism_, point, UnheldMotion(tilted_[k], frequency),
                          linear_motion::excitation(point));
    const ContactResponse r = contactResponse(mechanism_, held, a);
    const double major = std::abs(r.P) + std::abs(r.N);
    answer.axis = std::min(answer.axis, std::abs(std::abs(r.P) - std::abs(r.N)) / major);
    if (!(answer.axis >= min_axis)) return answer;
    const Complex9 turned = held.solve(a + kStep);
    const Eigen::Vector2cd more = counterRotating(turned[0], turned[1]);
    const Complex dP = (more[0] - r.P) / kStep, dN = (more[1] - r.N) / kStep;
    const Eigen::Vector4d slope(dP.real(), dP.imag(), dN.real(), dN.imag());
    const double square = slope.squaredNorm() * slope.squaredNorm();
    answer.white = std::max(answer.white, slope.dot(white * slope) / square);
    answer.alike = std::max(answer.alike, slope.dot(alike * slope) / square);
    answer.rocking = std::max(answer.rocking, major / lever_);
    for (int i = 0; i < 24; ++i) {
      const Eigen::Vector3d f = (r.contact * std::polar(1.0, 2 * M_PI * i / 24)).real();
      answer.need = std::max(answer.need, f.head<2>().norm() / friction_ - f.z());
    }
    if (rounds_) {
      const Complex6 w = stiffness_.cast<Complex>() * r.coupling;
      const double sum =
          (w.real().dot(information_ * w.real()) + w.imag().dot(information_ * w.imag())) / 12.0;
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
  const Contacts contacts(mechanism, demand);
  const double min_axis = given.frequency > 0.0 ? -1.0 : kMinAxis;
  VibrationPoint best;
  best.direction_sd = 1e9;
  for (const double step : kPressSteps) {
    const double press = given.press > 0.0 ? given.press : std::min(step, demand.max_press);
    for (int k = 0; k < kFrequencies; ++k) {
      // from half the middle frequency to twice of it
      const double frequency =
          given.frequency > 0.0 ? middle : 0.5 * middle * std::pow(4.0, (k + 0.5) / kFrequencies);
      const Answer answer = contacts.at(frequency, press, min_axis);
      if (!(answer.axis >= min_axis)) continue;
      const double amplitude = given.amplitude > 0.0
                                   ? given.amplitude
                                   : std::min(press / (kHeld * demand.shake * answer.need),
                                              kRocking * demand.tilt / answer.rocking);
      const double sd =
          std::sqrt(answer.white + answer.alike / (answer.steps * amplitude)) / amplitude;
      if (sd < best.direction_sd) best = {frequency, amplitude, press, sd};
      if (given.frequency > 0.0) break;
    }
    if (best.direction_sd <= kEnough || given.press > 0.0 || press >= demand.max_press) break;
  }
  if (!(best.frequency > 0.0)) {
    throw InputError(
        "exciter_frequency: 0: every frequency makes a segment of the locus; give one");
  }
  return best;
}

}  // namespace assembly_cell
