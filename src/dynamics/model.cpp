// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/dynamics/model.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {
namespace {

// FK or FC = K d with K of thesis order: diagonal, (2,6), (3,5), and cross terms where there are
// any. By elements, here and below: vector loads of elements written one by one would stall (store
// forwarding).
Vector6 multiply(const CouplingMatrix& K, const Vector6& d) {
  Vector6 f;
  f(0) = K.diagonal(0) * d(0);
  f(1) = K.diagonal(1) * d(1) + K.k26 * d(5);
  f(2) = K.diagonal(2) * d(2) + K.k35 * d(4);
  f(3) = K.diagonal(3) * d(3);
  f(4) = K.diagonal(4) * d(4) + K.k35 * d(2);
  f(5) = K.diagonal(5) * d(5) + K.k26 * d(1);
  if (!K.cross.isZero(0.0)) f += fullMatrix({Vector6::Zero(), 0.0, 0.0, K.cross}) * d;
  return f;
}

// Range of the series of directionNear(): the remainder is below 1e-17.
constexpr double kNear = 0.2;                                               // [rad]
constexpr double kShortestMove = 2e-3, kLongestMove = 1e4, kLonger = 1.05;  // of the rest pose [s]

struct Deflection {
  Vector6 d, rate;
};

Deflection couplingDeflection(const Scenario& s, const Kinematics& k, const State& state,
                              const RestMotion& rest) {
  const double d2 = s.mechanism.peg.coupling_height;
  Deflection out;
  const Vector9& q = state.q;
  const Vector9& v = state.v;
  out.d(0) = k.x(0) + d2 * k.a(0) - rest.position(2);
  out.d(1) = k.x(1) + d2 * k.a(1) - q(6);
  out.d(2) = k.x(2) + d2 * k.a(2) - q(7);
  out.d(3) = q(5) - q(8);
  out.d(4) = q(4) - rest.position(4);
  out.d(5) = q(3) - rest.position(5);
  out.rate(0) = k.v(0) + d2 * (k.omega(1) * k.a(2) - k.omega(2) * k.a(1)) - rest.rate(2);
  out.rate(1) = k.v(1) + d2 * (k.omega(2) * k.a(0) - k.omega(0) * k.a(2)) - v(6);
  out.rate(2) = k.v(2) + d2 * (k.omega(0) * k.a(1) - k.omega(1) * k.a(0)) - v(7);
  out.rate(3) = k.omega(0) - v(8);
  out.rate(4) = k.omega(1) - rest.rate(4);
  out.rate(5) = k.omega(2) - rest.rate(5);
  return out;
}

// Deflections of a coupling whose axes turn with the carrier; vectors x, y, z.
struct TurningCoupling {
  Eigen::Matrix3d R;       // of the carrier in `hole`
  Eigen::Vector3d offset;  // from the carrier's coupling point to the peg's, `hole`
  Deflection in_carrier;   // in the carrier's axes, thesis order; rotation vector
};

TurningCoupling turningCoupling(const Scenario& s, const Kinematics& k, const State& state,
                                const RestMotion& rest) {
  const Vector9& v = state.v;
  const double phi = rest.position(5);
  const Deflection apart = couplingDeflection(s, k, state, rest);
  TurningCoupling c;
  c.R = rotationFromEuler({phi, rest.position(4), state.q(8)});
  c.offset = fromThesisAxes(apart.d.head<3>());
  Eigen::Matrix3d peg;
  peg << fromThesisAxes(k.R1), -fromThesisAxes(k.R0), fromThesisAxes(k.a);
  const Eigen::Vector3d turn = rest.rate(5) * Eigen::Vector3d::UnitY() +
                               rest.rate(4) * Eigen::Vector3d(std::cos(phi), 0, -std::sin(phi)) +
                               v(8) * c.R.col(2);
  const Eigen::Matrix3d to_carrier = c.R.transpose();
  const Eigen::Vector3d gliding = fromThesisAxes(apart.rate.head<3>()) - turn.cross(c.offset);
  const Eigen::Vector3d turning = fromThesisAxes(k.omega) - turn;
  c.in_carrier.d << toThesisAxes(to_carrier * c.offset),
      toThesisAxes(vectorFromRotation(to_carrier * peg).value);
  c.in_carrier.rate << toThesisAxes(to_carrier * gliding), toThesisAxes(to_carrier * turning);
  return c;
}

// Moment conjugate to the angular velocity, from the one conjugate to the rate of the rotation
// vector r (`on_vector`): by the transposed inverse of the left Jacobian of SO(3).
Eigen::Vector3d momentOfVector(const Eigen::Vector3d& r, const Eigen::Vector3d& on_vector) {
  const double angle = r.norm(), half = 0.5 * angle;
  const double square = angle < 1e-4 ? 1.0 / 12 : (1.0 - half / std::tan(half)) / (angle * angle);
  return on_vector + 0.5 * r.cross(on_vector) + square * r.cross(r.cross(on_vector));
}

// Rate of the carrier deflection along z; F: coupling force without that rate, `damping`: of the
// coupling, whose force depends on the rate.
double deflectionRateAlongZ(const Scenario& s, double deflection, double F, double damping) {
  const double compliance = s.imperfections.compliance(2);
  return (compliance * F - deflection) / (kComplianceLag + compliance * damping);
}

// Forces of the coupling, thesis axes of `hole`: FK, FC, FCm of FreeMotion, FKm on the angles psi,
// theta, phi, and the moment about the carrier's axis.
void couplingForces(const Scenario& s, const Kinematics& k, const State& state,
                    const RestMotion& rest, FreeMotion& m, double& yaw) {
  const CouplingParameters& coupling = s.mechanism.coupling;
  if (coupling.axes == CouplingAxes::kHole) {
    const Deflection deflection = couplingDeflection(s, k, state, rest);
    for (int i = 0; i < 6; ++i) m.deflection(i) = deflection.d(i);
    Vector6 FK = multiply(coupling.stiffness, deflection.d);
    if (s.thesis.cross_stiffness) {
      FK +=
          multiply({Vector6::Zero(), coupling.stiffness.k26, coupling.stiffness.k35}, deflection.d);
    }
    Vector6 FC = multiply(coupling.damping, deflection.rate);
    if (isCompliant(s)) {
      const double damping = coupling.damping.diagonal(0);
      m.carrier_deflection_rate(2) =
          deflectionRateAlongZ(s, state.carrier_deflection(2), FK(0) + FC(0), damping);
      FC(0) -= damping * m.carrier_deflection_rate(2);
    }
    for (int i = 0; i < 3; ++i) {
      m.FK(i) = FK(i);
      m.FKm(i) = FK(3 + i);
      m.FC(i) = FC(i);
      m.FCm(i) = FC(3 + i);
    }
    yaw = FK(3) + FC(3);
    return;
  }
  const TurningCoupling c = turningCoupling(s, k, state, rest);
  const Vector6 FK = multiply(coupling.stiffness, c.in_carrier.d);
  Vector6 FC = multiply(coupling.damping, c.in_carrier.rate);
  if (isCompliant(s)) {
    Vector6 z = Vector6::Zero();  // deflection in the carrier's axes, thesis order
    z.head<3>() = toThesisAxes(c.R.row(2).transpose());
    const Vector6 damper = multiply(coupling.damping, z);
    m.carrier_deflection_rate(2) = deflectionRateAlongZ(
        s, state.carrier_deflection(2), z.head<3>().dot(FK.head<3>() + FC.head<3>()),
        z.head<3>().dot(damper.head<3>()));
    FC -= m.carrier_deflection_rate(2) * damper;
  }
  const auto turned = [&c](const Eigen::Vector3d& thesis) -> Eigen::Vector3d {
    return c.R * fromThesisAxes(thesis);
  };
  const Eigen::Vector3d spring =
      c.R * momentOfVector(fromThesisAxes(c.in_carrier.d.tail<3>()), fromThesisAxes(FK.tail<3>()));
  const Eigen::Vector3d damper = turned(FC.tail<3>());
  const Eigen::Vector3d force = turned(FK.head<3>() + FC.head<3>());
  m.deflection << toThesisAxes(c.offset), c.in_carrier.d.tail<3>();
  m.FK = toThesisAxes(turned(FK.head<3>()));
  m.FC = toThesisAxes(turned(FC.head<3>()));
  m.FCm = toThesisAxes(damper);
  m.FKm = (k.Re.transpose() * toThesisAxes(spring)).reverse();  // phi, theta, psi
  yaw = c.R.col(2).dot(spring + damper + c.offset.cross(force));
}

}  // namespace

Vector6 restVector(const RestPose& pose) {
  Vector6 v;
  v << pose.x, pose.y, pose.z, pose.yaw, pose.theta, pose.phi;
  return v;
}

RestPose restPose(const Vector6& position) {
  return {position(0), position(1), position(2), position(3), position(4), position(5)};
}

RestProfile restProfile(const RestPose& at_rest) {
  RestProfile profile;
  profile.coefficients.col(0) = restVector(at_rest);
  return profile;
}

RestMotion restMotion(const RestProfile& profile, double t) {
  RestMotion motion;
  const auto& c = profile.coefficients;
  if (!(profile.duration > 0.0) || t >= profile.start + profile.duration) {
    motion.position = profile.duration > 0.0 ? Vector6(c.rowwise().sum()) : Vector6(c.col(0));
    return motion;
  }
  const double u = std::max(0.0, (t - profile.start) / profile.duration);
  const double rate = 1.0 / profile.duration;
  motion.position =
      c.col(0) + u * (c.col(1) + u * (c.col(2) + u * (c.col(3) + u * (c.col(4) + u * c.col(5)))));
  motion.rate =
      rate *
      (c.col(1) + u * (2 * c.col(2) + u * (3 * c.col(3) + u * (4 * c.col(4) + u * 5 * c.col(5)))));
  motion.acceleration =
      rate * rate * (2 * c.col(2) + u * (6 * c.col(3) + u * (12 * c.col(4) + u * 20 * c.col(5))));
  return motion;
}

RestProfile planRest(const RestMotion& now, double t, const RestPose& target,
                     const CarrierParameters& limits, double arm) {
  RestProfile profile;
  profile.start = t;
  const Vector6 distance = restVector(target) - now.position;
  Vector6 weight;
  weight << 1, 1, 1, arm, arm, arm;

  // the shortest duration on a geometric grid whose quintic keeps the limits (or already moves so)
  const double initial_speed = now.rate.cwiseProduct(weight).cwiseAbs().maxCoeff();
  const double initial_acceleration = now.acceleration.cwiseProduct(weight).cwiseAbs().maxCoeff();
  const double speed_limit = std::max(limits.max_speed, initial_speed) * (1 + 1e-9);
  const double acceleration_limit =
      std::max(limits.max_acceleration, initial_acceleration) * (1 + 1e-9);
  const auto shape = [&](double T) {
    const Vector6 v0 = now.rate * T, a0 = now.acceleration * (T * T);
    auto& c = profile.coefficients;
    c.col(0) = now.position;
    c.col(1) = v0;
    c.col(2) = 0.5 * a0;
    c.col(3) = 10 * distance - 6 * v0 - 1.5 * a0;
    c.col(4) = -15 * distance + 8 * v0 + 1.5 * a0;
    c.col(5) = 6 * distance - 3 * v0 - 0.5 * a0;
    profile.duration = T;
  };
  // maximum of speed and acceleration over their limits; or the first value above `enough`
  const auto excess = [&](double enough) {
    double maximum = 0.0;
    // in strides of 12 over the 41 samples: a violation is found among the first few
    for (int i = 0; i <= 40 && !(maximum > enough); ++i) {
      const RestMotion m =
          restMotion(profile, t + profile.duration * (12 * i % 41) / 40.0 * (1 - 1e-12));
      maximum = std::max(
          {maximum, m.rate.cwiseProduct(weight).cwiseAbs().maxCoeff() / speed_limit,
           m.acceleration.cwiseProduct(weight).cwiseAbs().maxCoeff() / acceleration_limit});
    }
    return maximum;
  };
  for (double T = kShortestMove; T < kLongestMove; T *= kLonger) {
    shape(T);
    if (excess(1.0) <= 1.0) return profile;
  }
  // none does: the one with the smallest violation
  RestProfile best;
  double minimum = 1e300;
  for (double T = kShortestMove; T < kLongestMove; T *= kLonger) {
    shape(T);
    const double over = excess(minimum);
    if (over < minimum) {
      minimum = over;
      best = profile;
    }
  }
  return best;
}

RestProfile followProfile(const RestMotion& now, double t, const RestMotion& goal, double t_goal) {
  const double T = t_goal - t;
  const Vector6 v0 = now.rate * T, a0 = now.acceleration * (T * T);
  const Vector6 v1 = goal.rate * T, a1 = goal.acceleration * (T * T);
  const Vector6 distance = goal.position - now.position;
  RestProfile profile;
  profile.start = t;
  profile.duration = 2.0 * T;
  auto& c = profile.coefficients;
  c.col(0) = now.position;
  c.col(1) = v0;
  c.col(2) = 0.5 * a0;
  c.col(3) = 10 * distance - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1;
  c.col(4) = -15 * distance + 8 * v0 + 7 * v1 + 1.5 * a0 - a1;
  c.col(5) = 6 * distance - 3 * (v0 + v1) - 0.5 * (a0 - a1);
  double scale = 1.0;
  for (int power = 0; power < 6; ++power, scale *= 2.0) c.col(power) *= scale;
  return profile;
}

RestProfile planStop(const RestMotion& now, double t, double max_acceleration, double arm) {
  Vector6 weight;
  weight << 1, 1, 1, arm, arm, arm;
  const double speed = now.rate.cwiseProduct(weight).cwiseAbs().maxCoeff();
  // A rate of v0 (1 - u)^2 (1 + 2 u) + a0 T u (1 - u)^2 has the acceleration
  // (1 - u) (a0 - b u), b = 3 a0 + 6 v0 / T, with the minimum -(b - a0)^2 / (4 b), which equals the
  // limit -a for
  const double a0 = now.acceleration.cwiseProduct(weight).cwiseAbs().maxCoeff();
  const double a = std::max(max_acceleration, a0);
  const double b = a0 + 2 * a + 2 * std::sqrt(a * (a + a0));
  const double T = std::max(kShortestMove, 6 * speed / (b - 3 * a0));
  const Vector6 v = now.rate * T, w = now.acceleration * (T * T);
  RestProfile profile;
  profile.start = t;
  profile.duration = T;
  auto& c = profile.coefficients;
  c.col(0) = now.position;
  c.col(1) = v;
  c.col(2) = 0.5 * w;
  c.col(3) = -v - 2.0 / 3.0 * w;
  c.col(4) = 0.5 * v + 0.25 * w;
  return profile;
}

Direction directionOf(double angle) { return {angle, std::cos(angle), std::sin(angle)}; }

namespace {

// Recomputes a direction that is more than kNear from the angle.
void keepWithin(double reach, double angle, Direction& near) {
  if (!(std::abs(angle - near.angle) < reach)) near = directionOf(angle);
}

}  // namespace

Direction directionNear(const Direction& base, double angle) {
  const double turn = angle - base.angle;
  if (!(std::abs(turn) < kNear)) return directionOf(angle);
  // series in independent pairs; of cosine − 1, so that the error is the rounding of the base
  const double d = turn * turn, d2 = d * d;
  const double versine = d * ((-1.0 / 2 + d * (1.0 / 24)) +
                              d2 * ((-1.0 / 720 + d * (1.0 / 40320)) - d2 * (1.0 / 3628800)));
  const double sine =
      turn * ((1.0 - d * (1.0 / 6)) +
              d2 * ((1.0 / 120 - d * (1.0 / 5040)) + d2 * (1.0 / 362880 - d * (1.0 / 39916800))));
  return {angle, base.cosine + (base.cosine * versine - base.sine * sine),
          base.sine + (base.sine * versine + base.cosine * sine)};
}

Eigen::Vector2d exciterForce(const Drive& drive, double t) {
  Direction near;
  return exciterForce(drive, t, near);
}

Eigen::Vector2d exciterForce(const Drive& drive, double t, Direction& near) {
  const ExciterParameters& e = drive.exciter;
  if (e.amplitude == 0.0) return Eigen::Vector2d::Zero();
  const ExciterErrors& errors = drive.errors;
  const double angle = e.direction * (e.frequency * (t - drive.t_ref - errors.delay) + e.phase);
  const double amplitude = errors.gain * e.amplitude;
  keepWithin(kNear, angle, near);
  const Direction at = directionNear(near, angle);
  Eigen::Vector2d force(at.cosine, at.sine);  // peg axes x, y
  if (errors.ellipticity != 0.0) {
    const Eigen::Vector2d minor(-std::sin(errors.azimuth), std::cos(errors.azimuth));
    force -= errors.ellipticity * minor.dot(force) * minor;
  }
  if (errors.harmonic != 0.0) {
    force += errors.harmonic * Eigen::Vector2d(std::cos(2 * angle), std::sin(2 * angle));
  }
  // peg axes x = thesis axis 2, y = −(thesis axis 1)
  return {-amplitude * force.y(), amplitude * force.x()};
}

void keepNear(const State& state, EulerDirections& near) {
  for (int i = 0; i < 3; ++i) {
    keepWithin(0.5 * kNear, state.q(3 + i), near[static_cast<std::size_t>(i)]);
  }
}

Kinematics kinematics(const State& state) {
  Kinematics k;
  kinematics(state, {directionOf(state.q(3)), directionOf(state.q(4)), directionOf(state.q(5))}, k);
  return k;
}

void kinematics(const State& state, const EulerDirections& near, Kinematics& k) {
  const Vector9& q = state.q;
  const Vector9& v = state.v;
  const Direction phi = directionNear(near[0], q(3)), theta = directionNear(near[1], q(4));
  const Direction psi = directionNear(near[2], q(5));
  const double cph = phi.cosine, sph = phi.sine, cth = theta.cosine, sth = theta.sine;
  const double cps = psi.cosine, sps = psi.sine;
  k.x = q.head<3>();
  k.v = v.head<3>();
  k.R0 << cph * cth * cps - sph * sps, sph * cth * cps + cph * sps, -sth * cps;
  k.R1 << -cph * cth * sps - sph * cps, -sph * cth * sps + cph * cps, sth * sps;
  k.a << cph * sth, sph * sth, cth;
  k.sin_theta = sth;
  k.cos_theta = cth;
  k.Re << 0, -sph, k.a(0), 0, cph, k.a(1), 1, 0, k.a(2);
  const double p = v(3), th = v(4);
  k.Re_rate << 0, -cph * p, -sph * sth * p + cph * cth * th,  //
      0, -sph * p, cph * sth * p + sph * cth * th,            //
      0, 0, -sth * th;
  k.omega = k.Re * v.segment<3>(3);
}

void freeMotion(const Scenario& s, const Kinematics& k, const State& state, const RestMotion& rest,
                const Eigen::Vector2d& exciter_force, FreeMotion& m) {
  const Vector9& q = state.q;
  const Vector9& v = state.v;
  double yaw = 0.0;
  const bool compliant = isCompliant(s);
  std::optional<RestMotion> given;
  if (compliant) {
    given = rest;
    given->position.head<3>() += state.carrier_deflection;
  }
  couplingForces(s, k, state, given ? *given : rest, m, yaw);
  const Eigen::Vector3d T(m.FK(0) + m.FC(0), m.FK(1) + m.FC(1), m.FK(2) + m.FC(2));
  if (compliant) {
    m.carrier_deflection_rate.head<2>() =
        (s.imperfections.compliance.head<2>().cwiseProduct(T.tail<2>()) -
         state.carrier_deflection.head<2>()) /
        kComplianceLag;
  }

  // exciter and constant push at d1 along the axis; peg axes x = axis 2, y = −(axis 1)
  Eigen::Vector3d Fp(-s.push(1), s.push(0), s.push(2));
  Fp.head<2>() += exciter_force;
  const Eigen::Vector3d F = k.R0 * Fp(0) + k.R1 * Fp(1) + k.a * Fp(2);

  m.force.head<3>() = F - T;
  m.force.head<3>() -= s.mechanism.peg.mass * s.mechanism.gravity * toThesisAxes(s.mechanism.up);

  // dampers work on omega, springs on the angles (thesis 6.6, 6.10)
  const double d2 = s.mechanism.peg.coupling_height;
  const Eigen::Vector3d moment = k.a.cross(s.mechanism.peg.exciter_height * F - d2 * T) - m.FCm;
  Eigen::Vector3d Q = k.Re.transpose() * moment;
  if (s.thesis.moments) {
    // moment of exciter and push by the inverse instead of the transpose
    const Eigen::Vector3d drive_moment = s.mechanism.peg.exciter_height * k.a.cross(F);
    Q += k.Re.inverse() * drive_moment - k.Re.transpose() * drive_moment;
  }
  Q(0) -= m.FKm(2);
  Q(1) -= m.FKm(1);
  Q(2) -= m.FKm(0);
  const double I = s.mechanism.peg.inertia_transverse, I3 = s.mechanism.peg.inertia_axial;
  const double sc = k.sin_theta * k.cos_theta, sth = k.sin_theta;
  const double ph = v(3), th = v(4), ps = v(5);
  Q(0) -= 2 * I * ph * th * sc - I3 * (2 * ph * th * sc + th * ps * sth);
  Q(1) += I * ph * ph * sc - I3 * (ph * ph * sc + ph * ps * sth);
  Q(2) += I3 * ph * th * sth;
  m.force.segment<3>(3) = Q;

  const CarrierParameters& c = s.mechanism.carrier;
  m.force(6) =
      T(1) - c.stiffness(0) * (q(6) - rest.position(0)) - c.damping(0) * (v(6) - rest.rate(0));
  m.force(7) =
      T(2) - c.stiffness(1) * (q(7) - rest.position(1)) - c.damping(1) * (v(7) - rest.rate(1));
  m.force(8) =
      yaw - c.stiffness(2) * (q(8) - rest.position(3)) - c.damping(2) * (v(8) - rest.rate(3));
  if (compliant) {
    m.force.segment<2>(6) +=
        c.stiffness.head<2>().cwiseProduct(state.carrier_deflection.head<2>()) +
        c.damping.head<2>().cwiseProduct(m.carrier_deflection_rate.head<2>());
  }
}

InverseMass::InverseMass(const Mechanism& mechanism)
    : peg(1.0 / mechanism.peg.mass),
      transverse(1.0 / mechanism.peg.inertia_transverse),
      axial(1.0 / mechanism.peg.inertia_axial),
      carrier(1.0 / mechanism.carrier.mass),
      yaw(1.0 / mechanism.carrier.inertia) {}

void solveMass(const InverseMass& inverse, const Kinematics& k, const Vector9& f, Vector9& a) {
  for (int i = 0; i < 3; ++i) a(i) = inverse.peg * f(i);
  a(3) = inverse.transverse / (k.sin_theta * k.sin_theta) * (f(3) - k.cos_theta * f(5));
  a(4) = inverse.transverse * f(4);
  a(5) = inverse.axial * f(5) - k.cos_theta * a(3);
  a(6) = inverse.carrier * f(6);
  a(7) = inverse.carrier * f(7);
  a(8) = inverse.yaw * f(8);
}

double kineticEnergy(const Scenario& s, const Kinematics& k, const Vector9& v) {
  const double I = s.mechanism.peg.inertia_transverse, I3 = s.mechanism.peg.inertia_axial;
  const double spin = k.omega.dot(k.a);
  return 0.5 *
         (s.mechanism.peg.mass * k.v.squaredNorm() + I * (k.omega.squaredNorm() - spin * spin) +
          I3 * spin * spin + s.mechanism.carrier.mass * (v(6) * v(6) + v(7) * v(7)) +
          s.mechanism.carrier.inertia * v(8) * v(8));
}

double mechanicalEnergy(const Scenario& s, const Kinematics& k, const State& state,
                        const RestMotion& commanded) {
  RestMotion rest = commanded;
  rest.position.head<3>() += state.carrier_deflection;
  const Vector6 d = s.mechanism.coupling.axes == CouplingAxes::kHole
                        ? couplingDeflection(s, k, state, rest).d
                        : turningCoupling(s, k, state, rest).in_carrier.d;
  const double coupling = 0.5 * d.dot(multiply(s.mechanism.coupling.stiffness, d));
  const Eigen::Vector3d c =
      state.q.tail<3>() - Eigen::Vector3d(rest.position(0), rest.position(1), rest.position(3));
  const double carrier = 0.5 * s.mechanism.carrier.stiffness.dot(c.cwiseProduct(c));
  return kineticEnergy(s, k, state.v) + coupling + carrier +
         s.mechanism.peg.mass * s.mechanism.gravity *
             toThesisAxes(s.mechanism.up).dot(state.q.head<3>());
}

}  // namespace assembly_cell
