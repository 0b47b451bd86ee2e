// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/contact_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/linear_motion.h"
#include "assembly_cell/math/least_squares.h"

namespace assembly_cell {

using Eigen::Vector2d;
using Eigen::Vector3d;
using linear_motion::check;
using linear_motion::Complex;
using linear_motion::Complex6;
using linear_motion::Complex9;
using linear_motion::counterRotating;
using linear_motion::excitation;
using linear_motion::HeldMotion;
using linear_motion::motionFromSensor;
using linear_motion::MotionParts;
using linear_motion::SeenMotion;
using linear_motion::sensorStiffness;
using linear_motion::sensorWrench;
using linear_motion::unheldMotion;
using linear_motion::UnheldMotion;

namespace {

// centre of mass in the plane by the wrench on the sensor, in its axes
Eigen::Matrix<Complex, 2, 6> planeFromSensor(const Mechanism& mechanism, const UnheldMotion& free,
                                             const Vector3d& static_force) {
  return motionFromSensor(mechanism, free, static_force).topRows<2>();
}

double wrapped(double angle) {
  const double turned = angle - 2.0 * M_PI * std::floor(angle / (2.0 * M_PI));
  return turned < 2.0 * M_PI ? turned : 0.0;
}

// Starts of the refinement. With 6 the search of the other half turn may end at the first one; 24
// find the same directions.
constexpr int kGrid = 12;
double gridDirection(int k) { return 2.0 * M_PI * k / kGrid; }

class DirectionGrid {
 public:
  DirectionGrid(const SeenMotion& seen, const Eigen::Vector2cd& measured) {
    for (int k = 0; k < kGrid; ++k) {
      const double c = (measured - seen.inPlane(gridDirection(k))).squaredNorm();
      cost(k) = std::isfinite(c) ? c : std::numeric_limits<double>::infinity();
    }
  }
  // of `count` directions from `first` on, round the circle
  int best(int first, int count) const {
    int best = first;
    for (int k = first; k < first + count; ++k) {
      if (cost(k) < cost(best)) best = k;
    }
    return best;
  }

 private:
  double& cost(int k) { return cost_[static_cast<std::size_t>((k + kGrid) % kGrid)]; }
  double cost(int k) const { return cost_[static_cast<std::size_t>((k + kGrid) % kGrid)]; }

  std::array<double, kGrid> cost_{};
};

// Squared distance of the predicted P, N from the measured ones over the direction alpha, for
// minimise(): one real unknown.
class DirectionFit {
 public:
  DirectionFit(const SeenMotion& seen, const Eigen::Vector2cd& measured, double noise)
      : seen_(seen), measured_(measured), noise_(noise) {}

  void linearise(double alpha) {
    constexpr double kStep = 1e-4;  // of the central difference [rad]; half: the same to 1e-14
    slope_ = (seen_.inPlane(alpha + kStep) - seen_.inPlane(alpha - kStep)) / (2.0 * kStep);
    rest_ = tried_;
    information_ = slope_.squaredNorm();
  }
  double step(double /*damping*/) const { return slope_.dot(rest_).real() / information_; }
  double cost(double alpha) {
    tried_ = measured_ - seen_.inPlane(alpha);
    return tried_.squaredNorm();
  }
  // to a thousandth of the noise; half, twice: the same to 1e-12
  bool small(double step) const {
    return std::abs(step) <= std::max(1e-8, 1e-3 * std::sqrt(noise_ / information_));
  }
  double information() const { return information_; }  // |d(P, N)/dα|² [m²]

 private:
  const SeenMotion& seen_;
  const Eigen::Vector2cd& measured_;
  double noise_;
  Eigen::Vector2cd slope_, rest_, tried_;
  double information_ = 0.0;
};

struct Refined {
  double alpha = 0.0;
  double cost = 0.0;         // [m²]
  double information = 0.0;  // at the last step's start [m²]
};

Refined refine(const SeenMotion& seen, const Eigen::Vector2cd& measured, double alpha,
               double noise) {
  LeastSquaresOptions options;
  options.max_step = 0.2;       // [rad]; half, twice: the same to 1e-10
  options.max_iterations = 30;  // half, twice: the same bits
  DirectionFit fit(seen, measured, noise);
  const double cost = minimise<StepControl::kHalving>(fit, alpha, options).cost;
  return {alpha, cost, fit.information()};
}

}  // namespace

ContactResponse contactResponse(const Mechanism& mechanism, const OperatingPoint& point,
                                double alpha) {
  check(point);
  return linear_motion::contactResponse(mechanism, HeldMotion(mechanism, point), alpha);
}

ContactResponse linear_motion::contactResponse(const Mechanism& mechanism, const HeldMotion& held,
                                               double alpha) {
  const Complex9 q = held.solve(alpha);
  const Eigen::Vector2cd pn = counterRotating(q[0], q[1]);
  ContactResponse response;
  response.P = pn[0];
  response.N = pn[1];
  response.contact = held.contactForce(q);

  // the sensor turns its wrench into a displacement by the static stiffness
  const Eigen::FullPivLU<Matrix6> stiffness(sensorStiffness(mechanism));
  if (!stiffness.isInvertible()) {
    throw InputError(
        "coupling.stiffness is singular: the sensor's displacement needs a positive definite one");
  }
  response.coupling = stiffness.inverse().cast<Complex>() *
                      (sensorWrench(mechanism, held.free(), held.couplingForce()) * q);
  return response;
}

Eigen::Vector2cd centreOfMassPhasors(const Mechanism& mechanism, double frequency,
                                     const Complex6& coupling, const Posture& posture) {
  OperatingPoint point;
  point.frequency = frequency;
  point.tilt = posture.tilt;
  point.sensor_tilt = posture.sensor_tilt;
  point.compliance = posture.compliance;
  const UnheldMotion free = unheldMotion(mechanism, point);
  return planeFromSensor(mechanism, free, posture.static_force) *
         (sensorStiffness(mechanism).cast<Complex>() * coupling);
}

Locus centreOfMassLocus(const Mechanism& mechanism, double frequency, const HarmonicFit& fit,
                        const Vector2d& tilt, const Vector2d& sensor_tilt) {
  const UnheldMotion free(mechanism, frequency, tilt, sensor_tilt);
  const Eigen::Matrix<Complex, 2, 6> plane = planeFromSensor(mechanism, free, Vector3d::Zero()) *
                                             sensorStiffness(mechanism).cast<Complex>();
  const Eigen::Vector2cd xy = plane * fit.phasor;
  // mean of both axes
  const double variance =
      0.5 * (plane * fit.noise.cast<Complex>() * plane.adjoint()).trace().real();
  return locusFromPhasors(xy[0], xy[1], std::sqrt(variance), fit.samples, fit.inflation);
}

Vector3d contactForceFromDeflection(const Mechanism& mechanism, const Vector6& deflection) {
  Vector3d force = (sensorStiffness(mechanism) * deflection).head<3>();
  force += mechanism.peg.mass * mechanism.gravity * mechanism.up;
  force.z() = std::max(0.0, force.z());
  return force;
}

DirectionEstimate contactDirection(const Mechanism& mechanism, const OperatingPoint& point,
                                   const Locus& locus, LocusAxes axes) {
  return linear_motion::contactDirection(SeenMotion(mechanism, point, axes), locus);
}

DirectionEstimate linear_motion::contactDirection(const SeenMotion& seen, const Locus& locus) {
  const Eigen::Vector2cd measured(locus.P, locus.N);
  const double size = measured.norm();
  if (!(std::isfinite(size) && size > 0.0)) {
    throw InputError("the locus has no size: excite the peg before asking for a direction");
  }
  const DirectionGrid grid(seen, measured);
  const double noise_of_locus = locus.samples > 0 ? locus.variance() : 0.0;

  const int start = grid.best(0, kGrid);
  Refined best = refine(seen, measured, gridDirection(start), noise_of_locus);
  // the other half turn: within a quarter of the opposite direction
  const int turned = grid.best(start + kGrid / 2 - kGrid / 4, kGrid / 2 + 1);
  Refined opposite = refine(seen, measured, gridDirection(turned), noise_of_locus);
  if (opposite.cost < best.cost) std::swap(best, opposite);

  // noise of the four numbers, or what the model leaves (three degrees of freedom) where larger
  const double noise = std::max(noise_of_locus, std::max(best.cost / 3.0, 1e-32 * size * size));
  DirectionEstimate estimate;
  estimate.alpha = wrapped(best.alpha);
  estimate.alpha_opposite = wrapped(opposite.alpha);
  estimate.weight = 1.0 / (1.0 + std::exp(-0.5 * (opposite.cost - best.cost) / noise));
  estimate.sd = best.information > 0.0 ? std::min(std::sqrt(noise / best.information), M_PI) : M_PI;
  estimate.misfit = std::sqrt(best.cost) / size;
  return estimate;
}

double operatingFrequency(const Mechanism& mechanism, double press) {
  OperatingPoint point;
  point.amplitude = 1.0;
  point.press = press;
  point.frequency = 1.0;
  check(point);
  const MotionParts parts(mechanism, point.tilt, point.sensor_tilt);
  // mean |P| relative to mean |N|; both are largest together near the rocking resonances
  struct Means {
    double p = 0.0, n = 0.0;
  };
  const auto means = [&](double frequency) {
    point.frequency = frequency;
    const HeldMotion held(mechanism, point, UnheldMotion(parts, frequency), excitation(point));
    Means m;
    constexpr int kDirections = 8;  // half, twice: the same to 1e-10
    for (int k = 0; k < kDirections; ++k) {
      const Complex9 q = held.solve(2.0 * M_PI * k / kDirections);
      const Eigen::Vector2cd pn = counterRotating(q[0], q[1]);
      m.p += std::abs(pn[0]) / kDirections;
      m.n += std::abs(pn[1]) / kDirections;
    }
    return m;
  };

  // rocking about the held point sets the scale: springs over inertia
  const PegParameters& peg = mechanism.peg;
  const Vector6& k = mechanism.coupling.stiffness.diagonal;
  const auto squares = [](double a, double b) { return a * a + b * b; };
  const double spring =
      k.tail<2>().maxCoeff() +
      k.head<3>().maxCoeff() * squares(peg.half_height + peg.coupling_height, peg.radius);
  const double inertia = peg.inertia_transverse + peg.mass * squares(peg.half_height, peg.radius);
  const double scale = std::sqrt(spring / inertia);
  if (!(std::isfinite(scale) && scale > 0.0)) {
    throw InputError("coupling.stiffness is zero: there is no resonance to work between");
  }

  // the dip of |P| against |N| with the largest |N|
  constexpr std::size_t kScan = 400;  // half, twice: the same to 3e-8
  std::array<double, kScan> frequency{}, ratio{}, size{};
  for (std::size_t j = 0; j < kScan; ++j) {
    frequency[j] = scale * std::pow(10.0, -1.5 + 2.0 * static_cast<double>(j) / (kScan - 1));
    const Means m = means(frequency[j]);
    ratio[j] = m.p / m.n;
    size[j] = m.n;
  }
  std::size_t best = 0;
  for (std::size_t j = 1; j + 1 < kScan; ++j) {
    if (ratio[j] <= ratio[j - 1] && ratio[j] <= ratio[j + 1] &&
        (best == 0 || size[j] > size[best])) {
      best = j;
    }
  }
  if (best == 0) {
    throw InputError(
        "coupling.stiffness and coupling.damping leave no frequency that shows the contact's "
        "direction: lower the damping");
  }

  // golden section
  double low = frequency[best - 1], high = frequency[best + 1];
  const double golden = 0.5 * (std::sqrt(5.0) - 1.0);
  while (high - low > 1e-7 * high) {
    const double a = high - golden * (high - low), b = low + golden * (high - low);
    const Means at_a = means(a), at_b = means(b);
    (at_a.p / at_a.n < at_b.p / at_b.n ? high : low) = at_a.p / at_a.n < at_b.p / at_b.n ? b : a;
  }
  return 0.5 * (low + high);
}

}  // namespace assembly_cell
