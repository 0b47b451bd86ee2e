// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/contact_model.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// the default cell
Mechanism thesisMechanism() {
  Mechanism s;
  s.gravity = 9.8;
  s.peg = {0.025, 0.030, 0.395, 2.5e-4, 1.0e-4, 0.050, 0.056};
  s.hole.radius = 0.0251;
  s.carrier.mass = 0.395;
  s.carrier.inertia = 0.001;
  s.carrier.stiffness = {2e5, 2e5, 500};
  s.carrier.damping = {281, 281, 0.7};
  s.coupling.stiffness.diagonal << 5e4, 5e4, 5e4, 50, 50, 50;
  s.coupling.stiffness.k26 = 158;
  s.coupling.stiffness.k35 = -158;
  s.coupling.damping.diagonal << 28, 28, 28, 0.015, 0.015, 0.015;
  s.coupling.damping.k26 = 0.05;
  s.coupling.damping.k35 = -0.05;
  return s;
}

// thesis peg on a coupling of rotational springs alone that does not yaw, fixed carrier; SI
Mechanism thesisPeg() {
  Mechanism s;
  const double m = 0.766, r = 0.025, h = 0.025;
  s.peg = {r, h, m, m * (3 * r * r + 4 * h * h) / 12, m * r * r / 2, h, h};
  s.carrier.mass = 1e9;
  s.carrier.inertia = 1e9;
  s.carrier.stiffness = {1e20, 1e20, 1e20};
  s.coupling.stiffness.diagonal << 0, 0, 0, 1e12, 10, 10;
  return s;
}

OperatingPoint operatingPoint(double frequency, double press = 12.0) {
  OperatingPoint p;
  p.frequency = frequency;
  p.amplitude = 1.0;
  p.press = press;
  return p;
}

Locus locusOf(const ContactResponse& response, double sigma, std::size_t samples) {
  Locus locus;
  locus.P = response.P;
  locus.N = response.N;
  locus.sigma = sigma;
  locus.samples = samples;
  return locus;
}

double relative(const ContactResponse& a, Complex P, Complex N) {
  return std::hypot(std::abs(a.P - P), std::abs(a.N - N)) / std::hypot(std::abs(P), std::abs(N));
}

Matrix6 full(const CouplingMatrix& m) {
  Matrix6 k = m.diagonal.asDiagonal();
  k(1, 5) = k(5, 1) = m.k26;
  k(2, 4) = k(4, 2) = m.k35;
  return k;
}

// ---- closed forms ----

// docs/theory/thesis.md, "Locus", table of the support without yaw (thesis 9.2.2)
TEST(ContactModel, TextbookTableOfTheSupportWithoutYaw) {
  struct Row {
    double frequency, radial, tangential;
  };
  Mechanism s = thesisPeg();
  // the sensor's static map needs some stiffness in all directions: 1e-6 of the rocking's here
  s.coupling.stiffness.diagonal << 1e-3, 1e-3, 1e-3, 1e6, 10, 10;
  for (const Row& row :
       {Row{10, .1898, .1889}, Row{80, .899, .364}, Row{89, 9.21, .469}, Row{95, -1.61, .594},
        Row{108, -.424, 1.62}, Row{125, -.201, -1.017}, Row{180, -.062, -.129}}) {
    OperatingPoint p = operatingPoint(row.frequency, 0.0);
    p.amplitude = 1.5;
    const double alpha = 0.7;
    const ContactResponse response = contactResponse(s, p, alpha);
    const double P = (row.radial + row.tangential) / 2e3, N = (row.radial - row.tangential) / 2e3;
    // three printed digits
    const double tolerance = 0.006e-3 * std::max(0.1, std::abs(row.radial));
    EXPECT_NEAR(response.P.real(), P, tolerance) << row.frequency;
    EXPECT_NEAR((response.N * std::polar(1.0, -2 * alpha)).real(), N, tolerance) << row.frequency;
  }
}

// the same support: P vanishes at sqrt((K_x + K_y)/(I_x + I_y')), 100.13 rad/s
TEST(ContactModel, OperatingFrequencyOfTheTextbook) {
  Mechanism s = thesisPeg();
  const double m = 0.766, r = 0.025, h = 0.025;
  const double inertia = m * (16 * h * h + 15 * r * r) / 12 + m * (16 * h * h + 3 * r * r) / 12;
  // golden section to 1e-7, on a dip that is sharp
  EXPECT_NEAR(operatingFrequency(s, 0.0), std::sqrt(20.0 / inertia), 1e-5);
  EXPECT_NEAR(operatingFrequency(s, 0.0), 100.13, 0.01);
}

// docs/theory/thesis.md, "Locus", general support: any coupling, fixed carrier, no static terms
TEST(ContactModel, GeneralSupportFormula) {
  Mechanism s = thesisMechanism();
  s.gravity = 0.0;
  s.carrier.stiffness.setConstant(1e18);
  s.coupling.stiffness.diagonal << 4e4, 5e4, 6e4, 40, 50, 60;
  s.coupling.damping.diagonal << 20, 28, 35, 0.01, 0.015, 0.02;
  Matrix3d order;
  order << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  Matrix6 both = Matrix6::Zero();
  both.topLeftCorner<3, 3>() = both.bottomRightCorner<3, 3>() = order;
  const Matrix6 K = both.transpose() * full(s.coupling.stiffness) * both;
  const Matrix6 C = both.transpose() * full(s.coupling.damping) * both;

  for (const double w : {100.0, 500.0, 770.0, 1500.0}) {
    for (const double alpha : {0.0, 0.9, 2.5, 4.0, 5.9}) {
      const Vector3d to_mass(-s.peg.radius * std::cos(alpha), -s.peg.radius * std::sin(alpha),
                             s.peg.half_height);
      const Vector3d to_support = to_mass + s.peg.coupling_height * Vector3d::UnitZ();
      const Vector3d to_force = to_mass + s.peg.exciter_height * Vector3d::UnitZ();
      Eigen::Matrix<double, 6, 3> T;
      T << -skew(to_support), Matrix3d::Identity();
      Matrix3d inertia =
          Vector3d(s.peg.inertia_transverse, s.peg.inertia_transverse, s.peg.inertia_axial)
              .asDiagonal();
      inertia += s.peg.mass *
                 (to_mass.squaredNorm() * Matrix3d::Identity() - to_mass * to_mass.transpose());
      Eigen::Matrix3cd system;
      system.real() = T.transpose() * K * T - w * w * inertia;
      system.imag() = w * T.transpose() * C * T;
      const Eigen::Vector3cd force(1.0, Complex(0.0, -1.0), 0.0);
      const Eigen::Vector3cd theta = system.inverse() * (skew(to_force).cast<Complex>() * force);
      const Eigen::Vector3cd u = -skew(to_mass).cast<Complex>() * theta;
      const Locus locus = locusFromPhasors(u.x(), u.y(), 0, 1, 1);
      // the carrier gives by K/1e18
      EXPECT_LT(relative(contactResponse(s, operatingPoint(w, 0.0), alpha), locus.P, locus.N),
                1e-9);
    }
  }
}

// docs/theory/thesis.md, "Locus": without tilt and yaw-tilt coupling nothing distinguishes alpha
// from alpha + π, and alpha is in N alone, as 2 alpha
TEST(ContactModel, HalfTurnAndDoubleAngle) {
  const Mechanism s = thesisMechanism();
  for (const double w : {300.0, 500.0, 770.0}) {
    const OperatingPoint p = operatingPoint(w);
    const ContactResponse zero = contactResponse(s, p, 0.0);
    for (double alpha = 0.1; alpha < 6.2; alpha += 0.37) {
      const ContactResponse a = contactResponse(s, p, alpha);
      const ContactResponse b = contactResponse(s, p, alpha + M_PI);
      EXPECT_LT(relative(a, b.P, b.N), 1e-12);
      EXPECT_LT(relative(a, zero.P, zero.N * std::polar(1.0, 2 * alpha)), 1e-12);
      // the vertical deflection distinguishes them
      EXPECT_LT(std::abs(a.coupling[2] + b.coupling[2]), 1e-12 * std::abs(a.coupling[2]));
    }
  }
}

// A clockwise exciter is the mirror image: y, alpha and the angle change sign.
TEST(ContactModel, ClockwiseExciterIsTheMirrorImage) {
  const Mechanism s = thesisMechanism();
  OperatingPoint p = operatingPoint(600), q = p;
  p.tilt = {0.02, -0.03};
  q.tilt = {-0.02, -0.03};
  q.direction = -1;
  for (const double alpha : {0.3, 1.9, 4.4}) {
    const ContactResponse a = contactResponse(s, p, alpha), b = contactResponse(s, q, -alpha);
    EXPECT_LT(relative(b, std::conj(a.P), std::conj(a.N)), 1e-12);
  }
}

// ---- static terms against the exact potential energy ----

// The mechanism's potential energy for finite rotations with a point of the edge fixed.
class ExactPotential {
 public:
  ExactPotential(const Mechanism& s, const Vector2d& tilt, double alpha, const Vector3d& contact)
      : s_(s) {
    const double phi = tilt.y(), about_x = tilt.x();
    R0_ =
        (Eigen::AngleAxisd(phi, Vector3d::UnitY()) * Eigen::AngleAxisd(about_x, Vector3d::UnitX()))
            .toRotationMatrix();
    // body azimuth whose horizontal direction is alpha, by bisection
    double low = alpha - 0.5, high = alpha + 0.5;
    while (high - low > 1e-15) {
      const double a = 0.5 * (low + high);
      const Vector3d radial = R0_ * Vector3d(std::cos(a), std::sin(a), 0);
      (std::remainder(std::atan2(radial.y(), radial.x()) - alpha, 2 * M_PI) > 0 ? high : low) = a;
    }
    rho_ = {s.peg.radius * std::cos(low), s.peg.radius * std::sin(low), -s.peg.half_height};
    K_ = full(s.coupling.stiffness);
    // rest deflection that holds press, weight and their moments
    const Vector3d coupling = Vector3d(0, 0, s.peg.mass * s.gravity) - contact;
    const Vector3d moment =
        (R0_ * rho_).cross(contact) + (R0_ * Vector3d(0, 0, s.peg.coupling_height)).cross(coupling);
    Matrix3d rates;  // rotation vector by psi, theta, phi
    rates << R0_(0, 2), std::cos(phi), 0, R0_(1, 2), 0, 1, R0_(2, 2), -std::sin(phi), 0;
    Vector6 load;  // on the sensor, generalised
    load << -coupling.z(), -coupling.x(), -coupling.y(), rates.transpose() * moment;
    rest_ = K_.inverse() * load;
    euler0_ = euler(R0_);
    coupling0_ = R0_ * (Vector3d(0, 0, s.peg.coupling_height) - rho_);
    // the carrier of a coupling that turns with it: where its springs balance the same
    carrier_ = R0_;
    if (s.coupling.axes == CouplingAxes::kHole) return;
    for (int i = 0; i < 20; ++i) {
      const Vector3d f = -carrier_.transpose() * coupling, m = carrier_.transpose() * moment;
      rest_ = K_.inverse() * (Vector6() << f.z(), f.x(), f.y(), m.z(), m.x(), m.y()).finished();
      const Vector3d turn(rest_[4], rest_[5], rest_[3]);
      carrier_ = R0_ * Eigen::AngleAxisd(-turn.norm(), turn.normalized());
    }
  }
  // the carrier's, as OperatingPoint has tilts
  Vector2d carrierTilt() const {
    const Vector3d axis = carrier_.col(2);
    return std::acos(axis.z()) * Vector2d(-axis.y(), axis.x()).normalized();
  }

  // q: rotation vector, carrier x, y, yaw
  double operator()(const Vector6& q) const {
    const Vector3d v = q.head<3>();
    const double angle = v.norm();
    const Matrix3d R = angle > 0 ? Matrix3d(Eigen::AngleAxisd(angle, v / angle) * R0_) : R0_;
    const Vector3d shift = R * (Vector3d(0, 0, s_.peg.coupling_height) - rho_) - coupling0_;
    const Vector3d turn = euler(R) - euler0_;
    Vector6 d = rest_;
    d += (Vector6() << shift.z(), shift.x() - q[3], shift.y() - q[4], turn[0] - q[5], turn[1],
          turn[2])
             .finished();
    if (s_.coupling.axes == CouplingAxes::kCarrier) {
      const Matrix3d carrier = carrier_ * Eigen::AngleAxisd(q[5], Vector3d::UnitZ());
      const Vector3d at_rest = carrier_ * Vector3d(rest_[1], rest_[2], rest_[0]);
      const Vector3d along = carrier.transpose() * (at_rest + shift - Vector3d(q[3], q[4], 0.0));
      const Eigen::AngleAxisd by(Matrix3d(carrier.transpose() * R));
      const Vector3d vector = by.angle() * by.axis();
      d << along.z(), along.x(), along.y(), vector.z(), vector.x(), vector.y();
    }
    const double height = (R0_ * rho_ - R * rho_).z();
    return 0.5 * d.dot(K_ * d) + s_.peg.mass * s_.gravity * height +
           0.5 * q.tail<3>().cwiseAbs2().dot(s_.carrier.stiffness);
  }

  Vector6 gradient() const {
    Vector6 g;
    for (int i = 0; i < 3; ++i) {
      const Vector6 e = 1e-4 * Vector6::Unit(i);
      g[i] = ((*this)(e) - (*this)(-e)) / 2e-4;
    }
    g.tail<3>().setZero();
    return g;
  }

  Matrix6 hessian() const {
    Matrix6 H;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        const Vector6 a = 1e-4 * Vector6::Unit(i), b = 1e-4 * Vector6::Unit(j);
        H(i, j) = ((*this)(a + b) - (*this)(a - b) - (*this)(b - a) + (*this)(-a - b)) / 4e-8;
      }
    }
    return H;
  }

  // locus of the centre of mass with this stiffness
  Locus locus(double w) const {
    const Vector3d to_mass = -(R0_ * rho_);
    Eigen::Matrix<double, 6, 6> damper;  // deflection rates by q's rates
    damper.setZero();
    const Matrix3d lever = -skew(coupling0_);
    damper.block<1, 3>(0, 0) = lever.row(2);
    damper.block<1, 3>(1, 0) = lever.row(0);
    damper.block<1, 3>(2, 0) = lever.row(1);
    damper(3, 2) = damper(4, 0) = damper(5, 1) = 1;
    damper(1, 3) = damper(2, 4) = damper(3, 5) = -1;
    if (s_.coupling.axes == CouplingAxes::kCarrier) {
      Matrix3d order;
      order << 0, 0, 1, 1, 0, 0, 0, 1, 0;
      Eigen::Matrix<double, 6, 6> hole = Eigen::Matrix<double, 6, 6>::Zero();  // x, y, z
      hole.topLeftCorner<3, 3>() = lever;
      hole.bottomLeftCorner<3, 3>().setIdentity();
      hole(0, 3) = hole(1, 4) = -1;
      hole.block<3, 1>(3, 5) = -carrier_.col(2);
      damper << order * carrier_.transpose() * hole.topRows<3>(),
          order * carrier_.transpose() * hole.bottomRows<3>();
    }
    Matrix6 mass = Matrix6::Zero();
    mass.topLeftCorner<3, 3>() =
        R0_ *
            Vector3d(s_.peg.inertia_transverse, s_.peg.inertia_transverse, s_.peg.inertia_axial)
                .asDiagonal() *
            R0_.transpose() +
        s_.peg.mass * skew(to_mass).transpose() * skew(to_mass);
    mass(3, 3) = mass(4, 4) = s_.carrier.mass;
    mass(5, 5) = s_.carrier.inertia;
    Matrix6 C = damper.transpose() * full(s_.coupling.damping) * damper;
    C.diagonal().tail<3>() += s_.carrier.damping;
    Eigen::Matrix<Complex, 6, 6> system;
    system.real() = hessian() - w * w * mass;
    system.imag() = w * C;
    const Vector3d to_force = to_mass + s_.peg.exciter_height * R0_.col(2);
    Eigen::Matrix<Complex, 6, 1> load = Eigen::Matrix<Complex, 6, 1>::Zero();
    load.head<3>() =
        (skew(to_force) * R0_).cast<Complex>() * Eigen::Vector3cd(1.0, Complex(0.0, -1.0), 0.0);
    const Eigen::Matrix<Complex, 6, 1> q = system.inverse() * load;
    const Eigen::Vector3cd u = -skew(to_mass).cast<Complex>() * q.head<3>();
    return locusFromPhasors(u.x(), u.y(), 0, 1, 1);
  }

 private:
  // psi, theta, phi of Ry(phi) Rx(theta) Rz(psi)
  static Vector3d euler(const Matrix3d& R) {
    return {std::atan2(R(1, 0), R(1, 1)), std::asin(-R(1, 2)), std::atan2(R(0, 2), R(2, 2))};
  }

  Mechanism s_;
  Matrix3d R0_, carrier_;
  Vector3d rho_, euler0_, coupling0_;
  Matrix6 K_;
  Vector6 rest_;
};

TEST(ContactModel, StaticTermsAreTheSecondDerivativeOfTheExactEnergy) {
  const Mechanism s = thesisMechanism();
  for (const double press : {0.0, 12.0, 40.0}) {
    for (const double alpha : {0.4, 2.2, 3.9}) {
      const Vector3d contact(-0.1 * press, 0.05 * press, press);
      OperatingPoint p = operatingPoint(500, press);
      p.friction = contact.head<2>();
      const ExactPotential upright(s, {0, 0}, alpha, contact);
      // at rest: forces balance to the rounding of a difference quotient
      EXPECT_LT(upright.gradient().norm(), 1e-6);
      const Locus exact = upright.locus(500);
      const ContactResponse r = contactResponse(s, p, alpha);
      // differences of the energy: 1e-8 of the stiffness
      EXPECT_LT(relative(r, exact.P, exact.N), 1e-6) << press;
      // and the static terms are seen by this: they are larger than 1e-4
      if (press > 0) {
        const ContactResponse without = contactResponse(s, operatingPoint(500, 0), alpha);
        EXPECT_GT(relative(without, exact.P, exact.N), 1e-4);
      }
      // tilted: the model leaves out products of tilt and static moment, to 0.05 · 1/50 near
      // resonance
      const Vector2d tilt(0.03, -0.04);
      const Locus tilted = ExactPotential(s, tilt, alpha, contact).locus(500);
      // the rotation vector whose axis is Ry(tilt y) Rx(tilt x) z
      const Vector3d axis(std::sin(tilt.y()) * std::cos(tilt.x()), -std::sin(tilt.x()),
                          std::cos(tilt.y()) * std::cos(tilt.x()));
      p.tilt = std::acos(axis.z()) * Vector2d(-axis.y(), axis.x()).normalized();
      EXPECT_LT(relative(contactResponse(s, p, alpha), tilted.P, tilted.N), 5e-3) << press;
    }
  }
}

// A coupling that turns with the carrier, tilted by 2.9 degrees.
TEST(ContactModel, TurningCouplingIsThatOfTheExactEnergy) {
  Mechanism s = thesisMechanism();
  s.coupling.axes = CouplingAxes::kCarrier;
  for (const double alpha : {0.4, 2.2, 3.9}) {
    const Vector3d contact(-1.2, 0.6, 12.0);
    const ExactPotential exact(s, {0.03, -0.04}, alpha, contact);
    OperatingPoint p = operatingPoint(500);
    p.friction = contact.head<2>();
    const Vector3d axis(std::sin(-0.04) * std::cos(0.03), -std::sin(0.03),
                        std::cos(-0.04) * std::cos(0.03));
    p.tilt = std::acos(axis.z()) * Vector2d(-axis.y(), axis.x()).normalized();
    p.sensor_tilt = exact.carrierTilt();
    const Locus locus = exact.locus(500);
    EXPECT_LT(relative(contactResponse(s, p, alpha), locus.P, locus.N), 5e-3) << alpha;
    // which takes the axes into account: those of `hole` are far off
    Mechanism fixed = s;
    fixed.coupling.axes = CouplingAxes::kHole;
    EXPECT_GT(relative(contactResponse(fixed, p, alpha), locus.P, locus.N), 2e-2) << alpha;
  }
}

// Edge on plane: turning the tilted peg about the radial axis moves its lowest point along the
// edge; the press force there makes a moment about the old one.
TEST(ContactModel, RollingStiffnessIsThatOfTheMovingLowestPoint) {
  const double tilt = 0.01, press = 12.0, s = 1e-6;
  const Mechanism mechanism = thesisMechanism();
  const auto lowest = [&](const Matrix3d& R) {
    // direction of steepest descent in the plane of the edge
    const Vector2d down(-R(2, 0), -R(2, 1));
    return Vector3d(mechanism.peg.radius * down.x() / down.norm(),
                    mechanism.peg.radius * down.y() / down.norm(), 0);
  };
  const Matrix3d R0 = Eigen::AngleAxisd(tilt, Vector3d::UnitY()).toRotationMatrix();
  const Matrix3d R1 = Eigen::AngleAxisd(s, Vector3d::UnitX()) * R0;
  const Vector3d moved = R1 * (lowest(R1) - lowest(R0));
  const double stiffness = -moved.cross(Vector3d(0, 0, press)).x() / s;
  // first order in s over tilt
  EXPECT_NEAR(stiffness, press * mechanism.peg.radius / tilt, 1e-3 * stiffness);
  // friction inward makes a moment about the vertical: the sign that the model takes
  EXPECT_NEAR(moved.cross(Vector3d(-3.0, 0, press)).z() / s, -3.0 * mechanism.peg.radius / tilt,
              1e-2 * stiffness);

  // the low side of a tilt about y is alpha = 0: there it acts as a spring about x
  Mechanism stiffer = mechanism;
  stiffer.coupling.stiffness.diagonal[4] += stiffness;
  OperatingPoint p = operatingPoint(600, press);
  p.tilt = {0, tilt};
  const ContactResponse fixed = contactResponse(mechanism, p, 0.0);
  const ContactResponse spring = contactResponse(stiffer, p, 0.0);
  p.rolling = true;
  const ContactResponse rolling = contactResponse(mechanism, p, 0.0);
  // up to the tilt of the axis
  EXPECT_LT(relative(rolling, spring.P, spring.N), 2 * tilt);
  EXPECT_GT(relative(rolling, fixed.P, fixed.N), 5 * tilt);
}

// ---- inversion ----

TEST(ContactModel, PlaneMotionComesBackFromTheSensor) {
  const Mechanism s = thesisMechanism();
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> angle(0, 2 * M_PI), size(0, 0.05);
  for (int run = 0; run < 100; ++run) {
    OperatingPoint p = operatingPoint(300 + 10 * run);
    const double a = angle(random), b = angle(random), t = size(random), u = size(random);
    p.tilt = {t * std::cos(a), t * std::sin(a)};
    p.sensor_tilt = {u * std::cos(b), u * std::sin(b)};
    p.friction = {-1.0 + 0.02 * run, 0.7};
    p.direction = run % 2 ? -1 : 1;
    const ContactResponse r = contactResponse(s, p, angle(random));
    const Vector3d on_sensor(p.friction.x(), p.friction.y(), p.press - s.peg.mass * s.gravity);
    const Eigen::Vector2cd xy = centreOfMassPhasors(s, p.direction * p.frequency, r.coupling,
                                                    {p.tilt, p.sensor_tilt, on_sensor});
    const Locus locus = locusFromPhasors(xy.x(), xy.y(), 0, 1, 1);
    EXPECT_LT(relative(r, locus.P, locus.N), 1e-12);
  }
}

// The noise of the centre of mass is that of the six displacements through the same linear map.
TEST(ContactModel, NoiseIsCarriedOver) {
  const Mechanism s = thesisMechanism();
  HarmonicFit fit;
  fit.samples = 500;
  fit.inflation = 1.25;
  // correlated, as a strain matrix makes it
  Eigen::Matrix<double, 6, 6> mix;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) mix(i, j) = (i < 3 ? 1 : 20) * std::sin(1.0 + 5 * i + 7 * j);
  }
  fit.noise = mix * mix.transpose();
  fit.phasor.setZero();
  const Locus locus = centreOfMassLocus(s, 700, fit);
  EXPECT_EQ(locus.samples, 500u);
  EXPECT_EQ(locus.inflation, 1.25);
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  double sum = 0.0;
  constexpr int kRuns = 5000;
  for (int run = 0; run < kRuns; ++run) {
    Eigen::Matrix<Complex, 6, 1> white;
    for (Complex& w : white) w = {normal(random), normal(random)};
    fit.phasor = std::sqrt(2.0 / 500 * 1.25) * mix.cast<Complex>() * white;
    const Locus noisy = centreOfMassLocus(s, 700, fit);
    sum += (std::norm(noisy.P) + std::norm(noisy.N)) / (4.0 * kRuns);
  }
  // four numbers a run, not all equal: five standard errors of 2·kRuns
  EXPECT_NEAR(sum / locus.variance(), 1.0, 5.0 / std::sqrt(2.0 * kRuns));
}

// any tilt to 3°, either sense, either definition of the locus: exact
TEST(ContactModel, DirectionIsExactWithoutNoise) {
  const Mechanism s = thesisMechanism();
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> angle(0, 2 * M_PI), size(0, 3 * M_PI / 180);
  for (int run = 0; run < 200; ++run) {
    OperatingPoint p = operatingPoint(run % 3 == 0 ? 770 : 500);
    const double a = angle(random), t = size(random), alpha = angle(random);
    p.tilt = {t * std::cos(a), t * std::sin(a)};
    p.sensor_tilt = 0.9 * p.tilt;
    p.rolling = run % 4 == 0;
    p.direction = run % 2 ? -1 : 1;
    const ContactResponse r = contactResponse(s, p, alpha);
    const Eigen::Vector2cd xy = centreOfMassPhasors(s, p.direction * p.frequency, r.coupling);
    for (const bool sensor : {false, true}) {
      const Locus locus =
          sensor ? locusFromPhasors(xy.x(), xy.y(), 1e-12, 1000, 1) : locusOf(r, 1e-12, 1000);
      const DirectionEstimate e =
          contactDirection(s, p, locus, sensor ? LocusAxes::kSensor : LocusAxes::kHole);
      // the half turn is only as distinct as tilt makes it; one of both is exact
      const double best = std::abs(std::remainder(e.alpha - alpha, 2 * M_PI));
      const double other = std::abs(std::remainder(e.alpha_opposite - alpha, 2 * M_PI));
      EXPECT_LT(std::min(best, other), 1e-9) << "tilt " << t << " alpha " << alpha;
      if (t > 0.01) {
        EXPECT_LT(best, 1e-9);
      }
      EXPECT_LT(e.misfit, 1e-9);
      EXPECT_GE(e.weight, 0.5);
      EXPECT_GE(e.alpha, 0.0);
      EXPECT_LT(e.alpha, 2 * M_PI);
    }
  }
}

TEST(ContactModel, DirectionAttainsTheCramerRaoBound) {
  const Mechanism s = thesisMechanism();
  const OperatingPoint p = operatingPoint(500);
  const double alpha = 2.3;
  const Locus ground_truth = locusOf(contactResponse(s, p, alpha), 1e-6, 1000);
  // closed form of the upright peg: alpha is in arg N alone (docs/theory/thesis.md, "Locus")
  const double bound = std::sqrt(ground_truth.variance() / (4 * std::norm(ground_truth.N)));
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  constexpr int kRuns = 4000;
  double sum = 0.0, stated = 0.0;
  int within = 0;
  for (int run = 0; run < kRuns; ++run) {
    Locus noisy = ground_truth;
    const double sd = std::sqrt(ground_truth.variance());
    noisy.P += sd * Complex(normal(random), normal(random));
    noisy.N += sd * Complex(normal(random), normal(random));
    const DirectionEstimate e = contactDirection(s, p, noisy);
    const double error = std::remainder(e.alpha - alpha, M_PI);
    sum += error * error;
    stated += e.sd / kRuns;
    within += std::abs(error) < 2 * e.sd;
    EXPECT_NEAR(e.weight, 0.5, 1e-6);  // upright: the half turn is unobservable
  }
  // five standard errors of an rms over 4000 runs: 5.6 %
  EXPECT_NEAR(std::sqrt(sum / kRuns) / bound, 1.0, 0.056);
  // the stated sd is never below the bound and widened in a third of the runs
  EXPECT_GT(stated, bound * 0.98);
  EXPECT_LT(stated, bound * 1.2);
  EXPECT_GT(within, 0.95 * kRuns);
}

// tilt breaks the half turn: the weight states how clearly
TEST(ContactModel, WeightDistinguishesTheHalfTurnsWhenTheDataDo) {
  const Mechanism s = thesisMechanism();
  OperatingPoint p = operatingPoint(500);
  p.tilt = {0.03, 0.0};
  const ContactResponse r = contactResponse(s, p, 1.0);
  EXPECT_GT(contactDirection(s, p, locusOf(r, 1e-9, 1000)).weight, 0.999);
  EXPECT_NEAR(contactDirection(s, p, locusOf(r, 1e-3, 1000)).weight, 0.5, 0.01);
}

// a locus that no direction explains shows as misfit
TEST(ContactModel, MisfitOfAnotherMechanism) {
  const Mechanism s = thesisMechanism();
  Mechanism other = s;
  other.coupling.stiffness.diagonal.tail<3>() *= 1.5;
  const OperatingPoint p = operatingPoint(500);
  const Locus locus = locusOf(contactResponse(other, p, 1.0), 1e-9, 1000);
  EXPECT_GT(contactDirection(s, p, locus).misfit, 0.05);
}

// the default cell's operating point lies between its resonances, where alpha shows best
TEST(ContactModel, OperatingFrequencyOfTheCell) {
  const Mechanism s = thesisMechanism();
  const double w0 = operatingFrequency(s, 12.0);
  const auto ratio = [&](double w) {
    double p = 0, n = 0;
    for (int k = 0; k < 8; ++k) {
      const ContactResponse r = contactResponse(s, operatingPoint(w), k * M_PI / 4);
      p += std::abs(r.P);
      n += std::abs(r.N);
    }
    return p / n;
  };
  // a minimum, flat within rounding over 1e-3
  EXPECT_LT(ratio(w0), ratio(w0 * 1.01));
  EXPECT_LT(ratio(w0), ratio(w0 * 0.99));
  EXPECT_GT(w0, 350);
  EXPECT_LT(w0, 700);
}

TEST(ContactModel, ContactForceFromTheMeanDeflection) {
  const Mechanism s = thesisMechanism();
  Vector6 d;
  d << 2e-5, -4e-5, (12.0 - s.peg.mass * s.gravity) / 5e4, 1e-3, 2e-3, 3e-3;
  // on the sensor: contact + weight; across by 5e4 d, k26 about y, k35 about x
  const Vector3d force(1.0 + 158 * 2e-3, -2.0 - 158 * 1e-3, 12.0);
  EXPECT_LT((contactForceFromDeflection(s, d) - force).norm(), 1e-12);
  d[2] = -1.0;
  EXPECT_EQ(contactForceFromDeflection(s, d).z(), 0.0);
}

TEST(ContactModel, RefusesBadInput) {
  const Mechanism s = thesisMechanism();
  const auto message = [&](const std::function<void(OperatingPoint&)>& spoil) {
    OperatingPoint p = operatingPoint(500);
    spoil(p);
    try {
      contactResponse(s, p, 0.0);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("nothing thrown");
  };
  EXPECT_NE(message([](auto& p) { p.frequency = 0; }).find("frequency"), std::string::npos);
  EXPECT_NE(message([](auto& p) { p.amplitude = -1; }).find("amplitude"), std::string::npos);
  EXPECT_NE(message([](auto& p) { p.direction = 0; }).find("direction"), std::string::npos);
  EXPECT_NE(message([](auto& p) { p.press = -1; }).find("press"), std::string::npos);
  EXPECT_NE(message([](auto& p) { p.tilt = {1, 0}; }).find("tilt"), std::string::npos);
  EXPECT_THROW(contactDirection(s, operatingPoint(500), Locus{}), InputError);
  Mechanism soft = s;
  soft.coupling.stiffness.diagonal[0] = 0;
  EXPECT_THROW(contactResponse(soft, operatingPoint(500), 0.0), InputError);
  soft.coupling.stiffness = CouplingMatrix{};
  EXPECT_THROW(operatingFrequency(soft, 12.0), InputError);
}

}  // namespace
}  // namespace assembly_cell
