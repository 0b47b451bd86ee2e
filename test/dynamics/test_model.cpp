// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The equations of motion against virtual work on a body of six mass points, which has neither
// angular velocities nor inertia matrices; and the profile of the rest pose.
#include "assembly_cell/dynamics/model.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>

namespace assembly_cell {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kHalfPi = 1.5707963267948966;

// Everything on: all stiffnesses and dampers, cross terms, carrier, weight, push and exciter.
Scenario everything() {
  Scenario s;
  s.mechanism.gravity = 9.8;
  s.mechanism.peg = {0.025, 0.030, 0.395, 2.5e-4, 1.0e-4, 0.050, 0.056};
  s.mechanism.hole.radius = 0.0251;
  s.mechanism.carrier.mass = 0.3;
  s.mechanism.carrier.inertia = 0.002;
  s.mechanism.carrier.stiffness = Vector3d(130, 170, 1.3);
  s.mechanism.carrier.damping = Vector3d(2, 3, 0.02);
  s.mechanism.coupling.stiffness.diagonal << 450, 400, 500, 1.4, 2.7, 2.1;
  s.mechanism.coupling.stiffness.k26 = 7;
  s.mechanism.coupling.stiffness.k35 = -8;
  s.mechanism.coupling.damping.diagonal << 5, 6, 7, 0.02, 0.03, 0.04;
  s.mechanism.coupling.damping.k26 = 0.1;
  s.mechanism.coupling.damping.k35 = -0.2;
  s.rest = {0.001, -0.002, 0.08, 0.05, 1.6, -0.03};
  s.mechanism.exciter = {1.5, 40, 0.3, -1};
  s.push = Vector3d(0.3, -0.4, 0.5);
  return s;
}

class Model : public ::testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  // large angles, rates of some rad/s
  State state() {
    State s;
    for (int i = 0; i < 9; ++i) {
      const bool length = i < 3 || i == 6 || i == 7;
      s.q(i) = length ? uniform(-0.02, 0.02) : uniform(-2, 2);
      s.v(i) = length ? uniform(-0.3, 0.3) : uniform(-5, 5);
    }
    s.q(4) = uniform(0.6, 2.5);
    return s;
  }
  // peg and carrier turned against each other by less than half a turn
  State near(CouplingAxes axes) {
    State s = state();
    if (axes == CouplingAxes::kCarrier) {
      for (const int i : {3, 5, 8}) s.q(i) *= 0.4;
      s.q(4) = kHalfPi + 0.5 * (s.q(4) - kHalfPi);
    }
    return s;
  }
  std::mt19937_64 engine_{3};
};

// Pose of the peg in axes x, y, z of the hole.
Matrix3d pegRotation(const Vector9& q) {
  return (AngleAxisd(q(3), Vector3d::UnitY()) * AngleAxisd(q(4) - kHalfPi, Vector3d::UnitX()) *
          AngleAxisd(q(5), Vector3d::UnitZ()))
      .toRotationMatrix();
}
Vector3d pegPoint(const Vector9& q, const Vector3d& in_peg) {
  return Vector3d(q(1), q(2), q(0)) + pegRotation(q) * in_peg;
}

// six points on the axes of the peg with its mass and inertia
struct MassPoints {
  std::array<Vector3d, 6> points;
  double mass;
};
MassPoints massPoints(const PegParameters& p) {
  const double m = p.mass / 6;
  // I3 = 4 m a², I = 2 m a² + 2 m c²
  const double a = std::sqrt(p.inertia_axial / (4 * m));
  const double c = std::sqrt(p.inertia_transverse / (2 * m) - a * a);
  return {{Vector3d(a, 0, 0), Vector3d(-a, 0, 0), Vector3d(0, a, 0), Vector3d(0, -a, 0),
           Vector3d(0, 0, c), Vector3d(0, 0, -c)},
          m};
}

// derivative by central differences of fourth order; error (h⁴/30) f⁽⁵⁾ and rounding/h
template <typename F>
auto derivative(const F& f, double h = 1e-3) {
  return ((f(-2 * h) - 8 * f(-h) + 8 * f(h) - f(2 * h)) / (12 * h)).eval();
}
template <typename F>
auto secondDerivative(const F& f, double h = 2e-3) {
  return ((-f(-2 * h) + 16 * f(-h) - 30 * f(0) + 16 * f(h) - f(2 * h)) / (12 * h * h)).eval();
}
using Scalar = Eigen::Matrix<double, 1, 1>;

Vector6 multiply(const CouplingMatrix& m, const Vector6& d) {
  Matrix6 K = m.diagonal.asDiagonal();
  K(1, 5) = K(5, 1) = m.k26;
  K(2, 4) = K(4, 2) = m.k35;
  return K * d;
}

// Deflection of a coupling whose axes turn with the carrier, thesis order.
Vector6 turningDeflection(const Scenario& s, const Vector9& q) {
  const Matrix3d carrier =
      (AngleAxisd(s.rest.phi, Vector3d::UnitY()) *
       AngleAxisd(s.rest.theta - kHalfPi, Vector3d::UnitX()) * AngleAxisd(q(8), Vector3d::UnitZ()))
          .toRotationMatrix();
  const Vector3d along =
      carrier.transpose() *
      (pegPoint(q, {0, 0, s.mechanism.peg.coupling_height}) - Vector3d(q(6), q(7), s.rest.z));
  const AngleAxisd turn(Matrix3d(carrier.transpose() * pegRotation(q)));
  const Vector3d vector = turn.angle() * turn.axis();
  return (Vector6() << along.z(), along.x(), along.y(), vector.z(), vector.x(), vector.y())
      .finished();
}

double potential(const Scenario& s, const Vector9& q) {
  const Vector3d coupling = pegPoint(q, {0, 0, s.mechanism.peg.coupling_height});
  Vector6 d;  // thesis order
  d << coupling.z() - s.rest.z, coupling.x() - q(6), coupling.y() - q(7), q(5) - q(8),
      q(4) - s.rest.theta, q(3) - s.rest.phi;
  if (s.mechanism.coupling.axes == CouplingAxes::kCarrier) d = turningDeflection(s, q);
  const Vector3d c(q(6) - s.rest.x, q(7) - s.rest.y, q(8) - s.rest.yaw);
  return 0.5 * d.dot(multiply(s.mechanism.coupling.stiffness, d)) +
         0.5 * c.dot(s.mechanism.carrier.stiffness.cwiseProduct(c)) +
         s.mechanism.peg.mass * s.mechanism.gravity * q(0);
}

// force on the peg at the exciter's point, hole axes; angle law of Drive
Vector3d drivingForce(const Scenario& s, const Vector9& q, double t) {
  const double angle = s.mechanism.exciter.direction *
                       (s.mechanism.exciter.frequency * t + s.mechanism.exciter.phase);
  const Vector3d in_peg =
      s.push + s.mechanism.exciter.amplitude * Vector3d(std::cos(angle), std::sin(angle), 0);
  return pegRotation(q) * in_peg;
}

Vector9 acceleration(const Scenario& s, const State& state, double t) {
  const Kinematics k = kinematics(state);
  const RestMotion rest = restMotion(restProfile(s.rest), t);
  FreeMotion motion;
  freeMotion(s, k, state, rest, exciterForce({s.mechanism.exciter, 0.0}, t), motion);
  Vector9 rate;
  solveMass(InverseMass(s.mechanism), k, motion.force, rate);
  return rate;
}

void switchDampersOff(Scenario& s) {
  s.mechanism.carrier.damping.setZero();
  s.mechanism.coupling.damping = CouplingMatrix{};
}

// sum over mass points of m P'' · dP = (driving force) · dP − dV for every variation
TEST_F(Model, VirtualWorkVanishesOnTheSolution) {
  Scenario s = everything();
  switchDampersOff(s);
  const MassPoints body = massPoints(s.mechanism.peg);
  for (int n = 0; n < 600; ++n) {
    s.mechanism.coupling.axes = n < 300 ? CouplingAxes::kHole : CouplingAxes::kCarrier;
    const State at = near(s.mechanism.coupling.axes);
    const double t = uniform(0, 1);
    const Vector9 a = acceleration(s, at, t);
    Vector9 residual = Vector9::Zero(), size = Vector9::Zero();
    // mass times each point's acceleration: along q'' at rest, and at the constant rates v
    const double scale = a.norm();
    std::array<Vector3d, 6> forces;
    for (std::size_t k = 0; k < 6; ++k) {
      const auto point = [&](const Vector9& q) { return pegPoint(q, body.points[k]); };
      forces[k] =
          body.mass * (scale * derivative([&](double h) { return point(at.q + h / scale * a); }) +
                       secondDerivative([&](double h) { return point(at.q + h * at.v); }));
    }
    const Vector3d drive = drivingForce(s, at.q, t);
    const Vector3d exciter_point(0, 0, s.mechanism.peg.exciter_height);
    for (int i = 0; i < 9; ++i) {
      const auto varied = [&](const Vector3d& in_peg) {
        return derivative([&](double h) { return pegPoint(at.q + h * Vector9::Unit(i), in_peg); });
      };
      const auto add = [&](double work) {
        residual(i) += work;
        size(i) += std::abs(work);
      };
      for (std::size_t k = 0; k < 6; ++k) add(forces[k].dot(varied(body.points[k])));
      add(-drive.dot(varied(exciter_point)));
      add(derivative([&](double h) { return Scalar(potential(s, at.q + h * Vector9::Unit(i))); })(
          0));
    }
    residual(6) += s.mechanism.carrier.mass * a(6);
    residual(7) += s.mechanism.carrier.mass * a(7);
    residual(8) += s.mechanism.carrier.inertia * a(8);
    // second differences: h⁴/90 times the sixth power of some 10 rad/s, 1e-17 m/h² of rounding
    for (int i = 0; i < 9; ++i) EXPECT_NEAR(residual(i), 0.0, 1e-6 * size(i) + 1e-9) << i;
  }
}

// With dampers, energy falls by what they take and rises by what the exciter gives.
double energyOf(const Scenario& s, const State& at, const RestMotion& rest) {
  return mechanicalEnergy(s, kinematics(at), at, rest);
}

TEST_F(Model, PowerIsBalanced) {
  Scenario s = everything();
  const RestMotion rest = restMotion(restProfile(s.rest), 0.0);
  for (int n = 0; n < 600; ++n) {
    s.mechanism.coupling.axes = n < 300 ? CouplingAxes::kHole : CouplingAxes::kCarrier;
    const State at = near(s.mechanism.coupling.axes);
    const double t = uniform(0, 1);
    const Vector9 a = acceleration(s, at, t);
    // along the rates, and along v', in which energy is quadratic: differences are exact
    const auto moved = [&](double h) { return Scalar(energyOf(s, {at.q + h * at.v, at.v}, rest)); };
    const auto accelerated = [&](double h) {
      return Scalar(energyOf(s, {at.q, at.v + h * a}, rest));
    };
    const auto moving = [&](const Vector3d& in_peg) {
      return derivative([&](double h) { return pegPoint(at.q + h * at.v, in_peg); });
    };
    // angular velocity from the rotation's derivative, hole axes
    const Matrix3d W = derivative([&](double h) { return pegRotation(at.q + h * at.v); }) *
                       pegRotation(at.q).transpose();
    const Vector3d omega(W(2, 1), W(0, 2), W(1, 0));
    const Vector3d coupling = moving({0, 0, s.mechanism.peg.coupling_height});
    Vector6 rate;
    rate << coupling.z(), coupling.x() - at.v(6), coupling.y() - at.v(7), omega.z() - at.v(8),
        omega.x(), omega.y();
    if (s.mechanism.coupling.axes == CouplingAxes::kCarrier) {
      // springs' deflections by their derivative; of the rotation, omega in the carrier's axes
      const Vector6 d = derivative([&](double h) { return turningDeflection(s, at.q + h * at.v); });
      const Matrix3d R = (AngleAxisd(s.rest.phi, Vector3d::UnitY()) *
                          AngleAxisd(s.rest.theta - kHalfPi, Vector3d::UnitX()) *
                          AngleAxisd(at.q(8), Vector3d::UnitZ()))
                             .toRotationMatrix();
      const Vector3d turn = R.transpose() * omega - at.v(8) * Vector3d::UnitZ();
      rate << d.head<3>(), turn.z(), turn.x(), turn.y();
    }
    const Vector3d carrier = at.v.tail<3>();
    const double lost = rate.dot(multiply(s.mechanism.coupling.damping, rate)) +
                        carrier.dot(s.mechanism.carrier.damping.cwiseProduct(carrier));
    const double given =
        drivingForce(s, at.q, t).dot(moving({0, 0, s.mechanism.peg.exciter_height}));
    EXPECT_GT(lost, 0.0);
    // (h·5 rad/s)⁴/30 of rates of change that nearly cancel
    const double gained = derivative(moved)(0) + derivative(accelerated)(0);
    EXPECT_NEAR(gained, given - lost, 1e-8 * (std::abs(given) + lost));
  }
}

TEST_F(Model, EnergyIsThatOfTheMassPoints) {
  const Scenario s = everything();
  const MassPoints body = massPoints(s.mechanism.peg);
  const RestMotion rest = restMotion(restProfile(s.rest), 0.0);
  for (int n = 0; n < 100; ++n) {
    const State at = state();
    double expected = potential(s, at.q) +
                      0.5 * s.mechanism.carrier.mass * at.v.segment<2>(6).squaredNorm() +
                      0.5 * s.mechanism.carrier.inertia * at.v(8) * at.v(8);
    for (const Vector3d& p : body.points) {
      const Vector3d v = derivative([&](double h) { return pegPoint(at.q + h * at.v, p); });
      expected += 0.5 * body.mass * v.squaredNorm();
    }
    // differences as above, rates of 5 rad/s: (5 h)⁴/30
    EXPECT_NEAR(energyOf(s, at, rest), expected, 1e-9 * expected);
  }
}

TEST_F(Model, ExciterTurnsInPegAxes) {
  // thesis peg axes 1, 2 are -y, x of the peg
  const Drive drive{{2.0, 10.0, 0.3, -1}, 0.5};
  for (const double t : {0.5, 0.6, 1.7}) {
    const double angle = -(10.0 * (t - 0.5) + 0.3);
    const Eigen::Vector2d F = exciterForce(drive, t);
    EXPECT_NEAR(F(1), 2.0 * std::cos(angle), 1e-14);
    EXPECT_NEAR(-F(0), 2.0 * std::sin(angle), 1e-14);
  }
}

// ---- the rest pose's profile ----

constexpr double kArm = 0.08;

RestPose moved(const RestPose& from, const Vector6& by) { return restPose(restVector(from) + by); }

// largest speed and acceleration in any coordinate, angles with their arm
std::pair<double, double> peaks(const RestProfile& profile) {
  Vector6 weight;
  weight << 1, 1, 1, kArm, kArm, kArm;
  double speed = 0, acceleration = 0;
  for (int i = 0; i < 4000; ++i) {
    const RestMotion m = restMotion(profile, profile.start + profile.duration * i / 4000.0);
    speed = std::max(speed, m.rate.cwiseProduct(weight).cwiseAbs().maxCoeff());
    acceleration =
        std::max(acceleration, m.acceleration.cwiseProduct(weight).cwiseAbs().maxCoeff());
  }
  return {speed, acceleration};
}

TEST_F(Model, RestProfileStartsAndEndsAtRest) {
  const Scenario s = everything();
  for (int n = 0; n < 100; ++n) {
    Vector6 by;
    for (int i = 0; i < 6; ++i) by(i) = uniform(-0.02, 0.02);
    const RestMotion rest = restMotion(restProfile(s.rest), 0.0);
    const RestPose target = moved(s.rest, by);
    const RestProfile profile = planRest(rest, 2.0, target, s.mechanism.carrier, kArm);
    const double end = profile.start + profile.duration;
    for (const double t : {0.0, 2.0, end, end + 1.0}) {
      const RestMotion m = restMotion(profile, t);
      const Vector6 expected = restVector(t < end ? s.rest : target);
      EXPECT_LT((m.position - expected).norm(), 1e-15) << t;
      EXPECT_LT(m.rate.norm(), 1e-12) << t;
      EXPECT_LT(m.acceleration.norm(), 1e-9) << t;
    }
    // just before the end nothing jumps: jerk times the distance
    const RestMotion last = restMotion(profile, end - 1e-9);
    EXPECT_LT((last.position - restVector(target)).norm(), 1e-15);
    EXPECT_LT(last.acceleration.norm(), 1e-5);
    // rate and acceleration are the derivatives
    const double t = profile.start + uniform(0.1, 0.9) * profile.duration;
    const auto positionAt = [&](double h) { return restMotion(profile, t + h).position; };
    EXPECT_LT((derivative(positionAt, 1e-4) - restMotion(profile, t).rate).norm(), 1e-9);
    EXPECT_LT((secondDerivative(positionAt, 1e-3) - restMotion(profile, t).acceleration).norm(),
              1e-6);
    // limits are looked at in 41 places: a peak between two is 0.3 % higher (third derivative of
    // the quintic); the grid of durations is 5 % coarse, so one of the limits is nearly used
    const auto [speed, acceleration] = peaks(profile);
    EXPECT_LE(speed, 1.003 * s.mechanism.carrier.max_speed);
    EXPECT_LE(acceleration, 1.003 * s.mechanism.carrier.max_acceleration);
    EXPECT_TRUE(speed > 0.94 * s.mechanism.carrier.max_speed ||
                acceleration > 0.89 * s.mechanism.carrier.max_acceleration);
  }
}

// A new target at any time takes over position, speed and acceleration.
TEST_F(Model, RestProfileIsReplannedWithoutAStep) {
  const Scenario s = everything();
  RestProfile profile = restProfile(s.rest);
  double t = 0.0;
  for (int n = 0; n < 500; ++n) {
    Vector6 by;
    for (int i = 0; i < 6; ++i) by(i) = uniform(-0.01, 0.01);
    const RestPose target = moved(s.rest, by);
    const RestMotion before = restMotion(profile, t);
    profile = planRest(before, t, target, s.mechanism.carrier, kArm);
    const RestMotion after = restMotion(profile, t);
    // rounding of coefficients of a few times the distance over the duration's powers
    EXPECT_LT((after.position - before.position).norm(), 1e-16);
    EXPECT_LT((after.rate - before.rate).norm(), 1e-15);
    EXPECT_LT((after.acceleration - before.acceleration).norm(), 1e-13);
    const RestMotion end = restMotion(profile, t + profile.duration);
    EXPECT_LT((end.position - restVector(target)).norm(), 1e-15);
    // one quintic that takes over an acceleration near full speed overshoots: the worst of all
    // phases of a profile reaches 1.4 times the speed limit; acceleration keeps its limit
    const auto [speed, acceleration] = peaks(profile);
    EXPECT_LE(speed, 1.5 * s.mechanism.carrier.max_speed);
    EXPECT_LE(acceleration, 1.01 * s.mechanism.carrier.max_acceleration);
    t += uniform(0.1, 1.1) * profile.duration;
  }
}

// Whatever moves comes to rest within its acceleration, nothing of it backwards when it wasn't
// braking already, no slower than a constant deceleration would by a factor of 1.5 to 2.2.
TEST_F(Model, StopIsShortAndKeepsTheAcceleration) {
  const Scenario s = everything();
  const CarrierParameters& carrier = s.mechanism.carrier;
  Vector6 by;
  by << 0.02, 0.01, -0.015, 0.1, -0.05, 0.02;
  const RestProfile profile =
      planRest(restMotion(restProfile(s.rest), 0.0), 0.0, moved(s.rest, by), carrier, kArm);
  Vector6 weight;
  weight << 1, 1, 1, kArm, kArm, kArm;
  double farthest = 0.0, longest = 0.0;
  for (int n = 1; n < 200; ++n) {
    const double t = profile.duration * n / 200;
    const RestMotion now = restMotion(profile, t);
    const RestProfile stop = planStop(now, t, carrier.max_acceleration, kArm);
    const RestMotion first = restMotion(stop, t);
    EXPECT_LT((first.position - now.position).norm(), 1e-15);
    EXPECT_LT((first.rate - now.rate).norm(), 1e-12);
    EXPECT_LT((first.acceleration - now.acceleration).norm(), 1e-9);
    const RestMotion last = restMotion(stop, t + stop.duration * (1 - 1e-9));
    EXPECT_LT(last.rate.norm(), 1e-9);
    EXPECT_LT(last.acceleration.norm(), 1e-6);
    EXPECT_LE(peaks(stop).second, 1.001 * carrier.max_acceleration);
    const double speed = now.rate.cwiseProduct(weight).cwiseAbs().maxCoeff();
    const double shortest = std::max(speed / carrier.max_acceleration, 1e-3);
    longest = std::max(longest, stop.duration / shortest);
    const Vector6 way = stop.coefficients.rowwise().sum() - now.position;
    farthest = std::max(farthest, way.cwiseProduct(weight).cwiseAbs().maxCoeff());
    if (n <= 100) {
      EXPECT_GE((way.array() * by.array()).minCoeff(), 0.0);
    }
  }
  EXPECT_LE(longest, 2.2);
  // 0.79 v²/a, v the greatest speed of the profile: what the plant's guard counts with
  const double v = peaks(profile).first;
  EXPECT_LE(farthest, 0.79 * v * v / carrier.max_acceleration);
  EXPECT_GE(farthest, 0.70 * v * v / carrier.max_acceleration);
}

TEST_F(Model, RestProfileToWhereItIsStaysThere) {
  const Scenario s = everything();
  const RestProfile profile =
      planRest(restMotion(restProfile(s.rest), 0.0), 1.0, s.rest, s.mechanism.carrier, kArm);
  for (const double t : {1.0, 1.001, 3.0}) {
    EXPECT_EQ(restMotion(profile, t).position, restVector(s.rest));
    EXPECT_EQ(restMotion(profile, t).rate, Vector6::Zero());
  }
}

}  // namespace
}  // namespace assembly_cell
