// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/contact_model.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Complex6 = Eigen::Matrix<Complex, 6, 1>;
using Complex9 = Eigen::Matrix<Complex, 9, 1>;
using ComplexMatrix6 = Eigen::Matrix<Complex, 6, 6>;
using ComplexMatrix9 = Eigen::Matrix<Complex, 9, 9>;
using Matrix69 = Eigen::Matrix<double, 6, 9>;

// coordinates: u, translation of the centre of mass; theta, rotation vector; carrier x, y, yaw
constexpr int kU = 0, kTheta = 3, kCarrier = 6;

// rows of the thesis order z, x, y by x, y, z
Matrix3d thesisOrder() { return (Matrix3d() << 0, 0, 1, 1, 0, 0, 0, 1, 0).finished(); }

// 6×6 of the coupling, thesis order
Matrix6 symmetric(const CouplingMatrix& m) {
  Matrix6 full = m.diagonal.asDiagonal();
  full(1, 5) = full(5, 1) = m.k26;
  full(2, 4) = full(4, 2) = m.k35;
  return full;
}

// the same matrix for both halves of a twist or wrench
Matrix6 twice(const Matrix3d& m) {
  Matrix6 both = Matrix6::Zero();
  both.topLeftCorner<3, 3>() = both.bottomRightCorner<3, 3>() = m;
  return both;
}

// axes of a body whose axis is tilted by the rotation vector (x, y), Euler angle psi zero
Matrix3d tilted(const Vector2d& tilt) {
  Vector3d axis = Vector3d::UnitZ();
  const double angle = tilt.norm();
  if (angle > 0.0) {
    axis = Eigen::AngleAxisd(angle, Vector3d(tilt.x(), tilt.y(), 0.0) / angle) * axis;
  }
  const double phi = std::atan2(axis.x(), axis.z());
  const double about_x = std::asin(std::clamp(-axis.y(), -1.0, 1.0));
  return (Eigen::AngleAxisd(phi, Vector3d::UnitY()) * Eigen::AngleAxisd(about_x, Vector3d::UnitX()))
      .toRotationMatrix();
}

// second-order term of a constant force f at the lever l of a body that rotates: the energy
// -f·(θ×(θ×l))/2 as a stiffness
Matrix3d forceStiffness(const Vector3d& f, const Vector3d& l) {
  return f.dot(l) * Matrix3d::Identity() - 0.5 * (f * l.transpose() + l * f.transpose());
}

// The mechanism without contact at one frequency and tilt.
struct FreeMotion {
  FreeMotion(const Scenario& mechanism, double rate, const Vector2d& tilt,
             const Vector2d& sensor_tilt)
      : R_HP(tilted(tilt)), R_HS(tilted(sensor_tilt)) {
    const Matrix6 stiffness = symmetric(mechanism.coupling.stiffness);
    const Complex s(0.0, rate);
    const Matrix6 damping = symmetric(mechanism.coupling.damping);
    const Vector3d axis = R_HP.col(2);
    to_coupling = mechanism.peg.coupling_height * axis;
    to_exciter = mechanism.peg.exciter_height * axis;

    // deflection of the coupling by the peg's rotation: springs see Euler angles, dampers rates
    const double phi = std::atan2(axis.x(), axis.z());
    Matrix3d euler;  // columns: rotation by theta, phi, psi
    euler << std::cos(phi), 0.0, axis.x(), 0.0, 1.0, axis.y(), -std::sin(phi), 0.0, axis.z();
    Matrix3d about;  // rows: about z (psi), about x (theta), about y (phi)
    const Matrix3d inverse = euler.inverse();
    about << inverse.row(2), inverse.row(0), inverse.row(1);

    // deflection = twist of the coupling point + carrier's part
    const Matrix6 damper = twice(thesisOrder());
    Matrix6 spring = damper;
    spring.bottomRightCorner<3, 3>() = about;
    Matrix69 twist = Matrix69::Zero();  // of the coupling point by all coordinates
    twist.block<3, 3>(0, kU).setIdentity();
    twist.block<3, 3>(0, kTheta) = -skew(to_coupling);
    twist.block<3, 3>(3, kTheta).setIdentity();
    Matrix69 carrier = Matrix69::Zero();
    carrier(1, kCarrier) = carrier(2, kCarrier + 1) = carrier(3, kCarrier + 2) = -1.0;
    const Matrix69 spring_of = spring * twist + carrier;
    const Matrix69 damper_of = damper * twist + carrier;

    const Eigen::Matrix<Complex, 6, 9> spring_force = (stiffness * spring_of).cast<Complex>();
    const Eigen::Matrix<Complex, 6, 9> damper_force = s * (damping * damper_of).cast<Complex>();
    wrench = spring.transpose().cast<Complex>() * spring_force +
             damper.transpose().cast<Complex>() * damper_force;
    displaced = twist.topRows<3>();
    displaced.block<2, 2>(0, kCarrier) -= Eigen::Matrix2d::Identity();
    dynamic = spring_of.transpose().cast<Complex>() * spring_force +
              damper_of.transpose().cast<Complex>() * damper_force;

    // masses and the carrier's own springs and dampers
    const PegParameters& peg = mechanism.peg;
    const Matrix3d inertia =
        R_HP *
        Vector3d(peg.inertia_transverse, peg.inertia_transverse, peg.inertia_axial).asDiagonal() *
        R_HP.transpose();
    dynamic.block<3, 3>(kU, kU) -= (rate * rate * peg.mass * Matrix3d::Identity()).cast<Complex>();
    dynamic.block<3, 3>(kTheta, kTheta) -= (rate * rate * inertia).cast<Complex>();
    const Vector3d carrier_mass(mechanism.carrier.mass, mechanism.carrier.mass,
                                mechanism.carrier.inertia);
    for (int k = 0; k < 3; ++k) {
      dynamic(kCarrier + k, kCarrier + k) += mechanism.carrier.stiffness[k] +
                                             s * mechanism.carrier.damping[k] -
                                             rate * rate * carrier_mass[k];
    }
  }

  Matrix3d R_HP, R_HS;
  Vector3d to_coupling, to_exciter;       // from the centre of mass [m]
  Eigen::Matrix<Complex, 6, 9> wrench;    // of the peg on the sensor at the coupling, hole axes
  Eigen::Matrix<double, 3, 9> displaced;  // coupling point against the carrier, hole axes
  ComplexMatrix9 dynamic;                 // generalised forces per coordinates
};

// The six coordinates that are left with a point of the peg's edge held: theta and the carrier.
class HeldMotion {
 public:
  HeldMotion(const Scenario& mechanism, const OperatingPoint& point)
      : free_(mechanism, point.direction * point.frequency, point.tilt, point.sensor_tilt),
        peg_(mechanism.peg),
        contact_(point.friction.x(), point.friction.y(), point.press),
        weight_(mechanism.peg.mass * mechanism.gravity),
        rolling_(point.rolling && point.tilt.norm() > 1e-3
                     ? mechanism.peg.radius / point.tilt.norm()
                     : 0.0) {
    const Vector3d force_in_peg(point.amplitude, 0.0, 0.0), quarter(0.0, point.amplitude, 0.0);
    force_.real() = free_.R_HP * force_in_peg;
    force_.imag() = free_.R_HP * -quarter;
  }

  const FreeMotion& free() const { return free_; }

  // static force of the peg on the sensor, hole axes [N]
  Vector3d couplingForce() const { return contact_ - Vector3d(0.0, 0.0, weight_); }

  // all nine coordinates [m], [rad]
  Complex9 solve(double alpha) const {
    // the held point: its horizontal direction from the bottom centre is alpha
    const Vector2d radial(std::cos(alpha), std::sin(alpha));
    const Vector2d body = (free_.R_HP.topLeftCorner<2, 2>().inverse() * radial).normalized();
    const Vector3d rho =
        free_.R_HP * Vector3d(peg_.radius * body.x(), peg_.radius * body.y(), -peg_.half_height);

    // static forces: contact, and the coupling that balances it and the weight
    const Vector3d coupling(-contact_.x(), -contact_.y(), weight_ - contact_.z());
    Matrix3d fixed = forceStiffness(contact_, rho) + forceStiffness(coupling, free_.to_coupling);
    // the coupling's static moment acts on Euler angles, which differ from θ by θ×θ terms
    const Vector3d moment = rho.cross(contact_) + free_.to_coupling.cross(coupling);
    Matrix3d euler;
    euler << 0.0, moment.z(), moment.y(), moment.z(), 0.0, -moment.x(), moment.y(), -moment.x(),
        0.0;
    fixed += 0.5 * euler;
    // rolling: a turn s about the radial axis moves the contact by -(r / tilt) s along the edge
    const Vector3d along(-radial.y(), radial.x(), 0.0);
    fixed.leftCols<2>() += rolling_ * along.cross(contact_) * radial.transpose();

    // u = -θ × rho
    const Eigen::Matrix3cd held = skew(rho).cast<Complex>();
    const ComplexMatrix9& d = free_.dynamic;
    ComplexMatrix6 reduced = d.bottomRightCorner<6, 6>();
    reduced.topLeftCorner<3, 3>() +=
        held.transpose() * (d.block<3, 3>(kU, kU) * held + d.block<3, 3>(kU, kTheta)) +
        d.block<3, 3>(kTheta, kU) * held + fixed.cast<Complex>();
    reduced.topRightCorner<3, 3>() += held.transpose() * d.block<3, 3>(kU, kCarrier);
    reduced.bottomLeftCorner<3, 3>() += d.block<3, 3>(kCarrier, kU) * held;
    Complex6 load = Complex6::Zero();
    load.head<3>() = skew(free_.to_exciter - rho).cast<Complex>() * force_;

    Complex9 q;
    q.tail<6>() = reduced.partialPivLu().solve(load);
    q.head<3>() = held * q.segment<3>(kTheta);
    return q;
  }

  // on the peg at the held point, besides the press force [N]
  Eigen::Vector3cd contactForce(const Complex9& q) const {
    return free_.dynamic.topRows<3>() * q - force_;
  }

 private:
  FreeMotion free_;
  PegParameters peg_;
  Vector3d contact_;  // static force on the peg [N]
  double weight_;     // [N]
  double rolling_;    // contact's way along the edge per turn about the radial axis [m]
  Eigen::Vector3cd force_;
};

void check(const OperatingPoint& point) {
  if (!(std::isfinite(point.frequency) && point.frequency > 0.0)) {
    throw InputError("exciter frequency is " + std::to_string(point.frequency) +
                     ": give a positive one in rad/s");
  }
  if (!(std::isfinite(point.amplitude) && point.amplitude > 0.0)) {
    throw InputError("exciter amplitude is " + std::to_string(point.amplitude) +
                     ": give a positive one in N");
  }
  if (point.direction != 1 && point.direction != -1) {
    throw InputError("exciter direction is " + std::to_string(point.direction) + ": give 1 or -1");
  }
  if (!(std::isfinite(point.press) && point.press >= 0.0)) {
    throw InputError("press force is " + std::to_string(point.press) +
                     ": give one of at least 0 in N");
  }
  if (!point.friction.allFinite()) {
    throw InputError("friction force is not finite: give the horizontal contact force in N");
  }
  if (!(point.tilt.norm() < 0.5 && point.sensor_tilt.norm() < 0.5)) {
    throw InputError("tilt is " + std::to_string(point.tilt.norm()) +
                     ": the small-motion model holds below 0.5 rad");
  }
}

// counter-rotating amplitudes of the plane motion
Eigen::Vector2cd counterRotating(Complex x, Complex y) {
  const Complex i(0.0, 1.0);
  return {0.5 * (x + i * y), 0.5 * std::conj(x - i * y)};
}

// stiffness of the coupling in the order x, y, z, about x, about y, about z
Matrix6 sensorStiffness(const Scenario& mechanism) {
  const Matrix6 order = twice(thesisOrder());
  return order.transpose() * symmetric(mechanism.coupling.stiffness) * order;
}

// Wrench on the sensor about its origin, in its axes, by all coordinates. The coupling point leaves
// the origin, so the static force and the moving one each have the other's displacement as arm.
Eigen::Matrix<Complex, 6, 9> sensorWrench(const Scenario& mechanism, const FreeMotion& free,
                                          const Vector3d& static_force) {
  const Vector6& k = mechanism.coupling.stiffness.diagonal;
  const auto give = [](double force, double stiffness) {
    return stiffness > 0.0 ? force / stiffness : 0.0;
  };
  const Vector3d static_displacement(give(static_force.x(), k[1]), give(static_force.y(), k[2]),
                                     give(static_force.z(), k[0]));
  Eigen::Matrix<Complex, 6, 9> wrench = free.wrench;
  const Eigen::Matrix<Complex, 3, 9> forces = free.wrench.topRows<3>();
  wrench.bottomRows<3>() += skew(static_displacement).cast<Complex>() * forces -
                            (skew(static_force) * free.displaced).cast<Complex>();
  return twice(free.R_HS.transpose()).cast<Complex>() * wrench;
}

// centre of mass in the plane by the wrench on the sensor, in its axes: six wrench equations and
// the carrier's three give all coordinates
Eigen::Matrix<Complex, 2, 6> planeFromSensor(const Scenario& mechanism, const FreeMotion& free,
                                             const Vector3d& static_force) {
  ComplexMatrix9 system;
  system << sensorWrench(mechanism, free, static_force), free.dynamic.bottomRows<3>();
  return system.fullPivLu().inverse().topLeftCorner<2, 6>();
}

double wrapped(double angle) {
  const double turned = angle - 2.0 * M_PI * std::floor(angle / (2.0 * M_PI));
  return turned < 2.0 * M_PI ? turned : 0.0;
}

}  // namespace

ContactResponse contactResponse(const Scenario& mechanism, const OperatingPoint& point,
                                double alpha) {
  check(point);
  const HeldMotion held(mechanism, point);
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

void centreOfMassPhasors(const Scenario& mechanism, double frequency, const Complex6& coupling,
                         Complex& x, Complex& y, const Vector2d& tilt, const Vector2d& sensor_tilt,
                         const Vector3d& static_force) {
  const FreeMotion free(mechanism, frequency, tilt, sensor_tilt);
  const Eigen::Vector2cd plane = planeFromSensor(mechanism, free, static_force) *
                                 (sensorStiffness(mechanism).cast<Complex>() * coupling);
  x = plane[0];
  y = plane[1];
}

Locus centreOfMassLocus(const Scenario& mechanism, double frequency, const HarmonicFit& fit,
                        const Vector2d& tilt, const Vector2d& sensor_tilt) {
  const FreeMotion free(mechanism, frequency, tilt, sensor_tilt);
  const Eigen::Matrix<Complex, 2, 6> plane = planeFromSensor(mechanism, free, Vector3d::Zero()) *
                                             sensorStiffness(mechanism).cast<Complex>();
  const Eigen::Vector2cd xy = plane * fit.phasor;
  // noise of each displacement by its column, mean of both axes
  const double variance = 0.5 * (plane.cwiseAbs2().colwise().sum() * fit.variance).value();
  return locusFromPhasors(xy[0], xy[1], std::sqrt(variance), fit.samples, fit.inflation);
}

Vector3d contactForceFromDeflection(const Scenario& mechanism, const Vector6& deflection) {
  Vector3d force = (sensorStiffness(mechanism) * deflection).head<3>();
  force.z() = std::max(0.0, force.z() + mechanism.peg.mass * mechanism.gravity);
  return force;
}

DirectionEstimate contactDirection(const Scenario& mechanism, const OperatingPoint& point,
                                   const Locus& locus, LocusAxes axes) {
  check(point);
  const Eigen::Vector2cd measured(locus.P, locus.N);
  const double size = measured.norm();
  if (!(std::isfinite(size) && size > 0.0)) {
    throw InputError("the locus has no size: excite the peg before asking for a direction");
  }
  // what the estimator sees of all coordinates: the true plane, or that of a map without tilts
  const HeldMotion held(mechanism, point);
  Eigen::Matrix<Complex, 2, 9> seen = Eigen::Matrix<Complex, 2, 9>::Identity();
  if (axes == LocusAxes::kSensor) {
    const FreeMotion upright(mechanism, point.direction * point.frequency, Vector2d::Zero(),
                             Vector2d::Zero());
    seen = planeFromSensor(mechanism, upright, Vector3d::Zero()) *
           sensorWrench(mechanism, held.free(), held.couplingForce());
  }
  const auto predicted = [&](double alpha) {
    const Eigen::Vector2cd xy = seen * held.solve(alpha);
    return counterRotating(xy[0], xy[1]);
  };
  const auto cost = [&](double alpha) {
    const double c = (measured - predicted(alpha)).squaredNorm();
    return std::isfinite(c) ? c : std::numeric_limits<double>::infinity();
  };

  // best of a coarse grid
  constexpr int kGrid = 24;
  std::array<double, kGrid> grid{};
  for (std::size_t k = 0; k < kGrid; ++k) {
    grid[k] = cost(2.0 * M_PI * static_cast<double>(k) / kGrid);
  }
  const auto best_of = [&](int first, int count) {
    int best = first;
    for (int k = first; k < first + count; ++k) {
      if (grid[static_cast<std::size_t>((k + kGrid) % kGrid)] <
          grid[static_cast<std::size_t>((best + kGrid) % kGrid)]) {
        best = k;
      }
    }
    return best;
  };

  // Gauss–Newton, a step only where it lowers the cost
  double information = 0.0;  // of the last one refined, |d(P, N)/dα|² [m²]
  const auto refine = [&](double alpha, double& lowest) {
    constexpr double kStep = 1e-4;
    lowest = cost(alpha);
    for (int iteration = 0; iteration < 30; ++iteration) {
      const Eigen::Vector2cd slope =
          (predicted(alpha + kStep) - predicted(alpha - kStep)) / (2.0 * kStep);
      information = slope.squaredNorm();
      double step = slope.dot(measured - predicted(alpha)).real() / information;
      if (!std::isfinite(step)) {
        break;
      }
      step = std::clamp(step, -0.2, 0.2);
      double tried = cost(alpha + step);
      while (tried > lowest && std::abs(step) > 1e-12) {
        step *= 0.5;
        tried = cost(alpha + step);
      }
      if (tried > lowest) {
        break;
      }
      alpha += step;
      lowest = tried;
      if (std::abs(step) < 1e-12) {
        break;
      }
    }
    return alpha;
  };

  DirectionEstimate estimate;
  const int start = best_of(0, kGrid);
  double cost_best = 0.0, cost_opposite = 0.0;
  double best = refine(2.0 * M_PI * start / kGrid, cost_best);
  double information_best = information;
  // the other half turn: within a quarter of the opposite direction
  const int turned = best_of(start + kGrid / 2 - kGrid / 4, kGrid / 2 + 1);
  double opposite = refine(2.0 * M_PI * turned / kGrid, cost_opposite);
  if (cost_opposite < cost_best) {
    std::swap(best, opposite);
    std::swap(cost_best, cost_opposite);
    information_best = information;
  }

  // noise of the four numbers, or what the model leaves (three degrees of freedom) where larger
  const double noise = std::max(locus.samples > 0 ? locus.variance() : 0.0,
                                std::max(cost_best / 3.0, 1e-32 * size * size));
  estimate.alpha = wrapped(best);
  estimate.alpha_opposite = wrapped(opposite);
  estimate.weight = 1.0 / (1.0 + std::exp(-0.5 * (cost_opposite - cost_best) / noise));
  estimate.sd = information_best > 0.0 ? std::min(std::sqrt(noise / information_best), M_PI) : M_PI;
  estimate.misfit = std::sqrt(cost_best) / size;
  return estimate;
}

double operatingFrequency(const Scenario& mechanism, double press) {
  OperatingPoint point;
  point.amplitude = 1.0;
  point.press = press;
  point.frequency = 1.0;
  check(point);
  // mean |P| relative to mean |N|; both are largest together near the rocking resonances
  struct Means {
    double p = 0.0, n = 0.0;
  };
  const auto means = [&](double frequency) {
    point.frequency = frequency;
    const HeldMotion held(mechanism, point);
    Means m;
    constexpr int kDirections = 8;
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
  constexpr std::size_t kScan = 400;
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
