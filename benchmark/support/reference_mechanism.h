// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Independent implementation of the mechanism in extended precision, the reference of the
// simulation. Shares the scenario file with it and nothing else: Newton–Euler equations in fixed
// axes with the angular velocity as state (there: Lagrange's in Euler rates), contact derivatives
// by Taylor arithmetic (there: closed formulas), contact modes by trial and check, Fehlberg's 7(8)
// pair of Boost.Odeint. Two places of contact, edge on edge unless set otherwise; the rest pose
// does not move; impacts plastic or with Stronge's restitution, by reference_impact.h.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "assembly_cell/scene/scenario.h"
#include "reference_impact.h"

namespace assembly_cell::reference {

/// Value and the first two derivatives with respect to time.
template <typename Real>
struct Taylor {
  Real f{}, d{}, dd{};
  Taylor() = default;
  Taylor(Real value) : f(value) {}  // NOLINT: numbers are constants
  Taylor(Real value, Real first, Real second) : f(value), d(first), dd(second) {}
  friend Taylor operator+(const Taylor& a, const Taylor& b) {
    return {a.f + b.f, a.d + b.d, a.dd + b.dd};
  }
  friend Taylor operator-(const Taylor& a, const Taylor& b) {
    return {a.f - b.f, a.d - b.d, a.dd - b.dd};
  }
  friend Taylor operator*(const Taylor& a, const Taylor& b) {
    return {a.f * b.f, a.d * b.f + a.f * b.d, a.dd * b.f + 2 * a.d * b.d + a.f * b.dd};
  }
  friend Taylor operator/(const Taylor& a, const Taylor& b) {
    const Real q = a.f / b.f, qd = (a.d - q * b.d) / b.f;
    return {q, qd, (a.dd - 2 * qd * b.d - q * b.dd) / b.f};
  }
};
template <typename Real>
Taylor<Real> sqrt(const Taylor<Real>& a) {
  const Real r = std::sqrt(a.f), rd = a.d / (2 * r);
  return {r, rd, (a.dd / 2 - rd * rd) / r};
}
template <typename Real>
Taylor<Real> sin(const Taylor<Real>& a) {
  const Real s = std::sin(a.f), c = std::cos(a.f);
  return {s, c * a.d, c * a.dd - s * a.d * a.d};
}
template <typename Real>
Taylor<Real> cos(const Taylor<Real>& a) {
  const Real s = std::sin(a.f), c = std::cos(a.f);
  return {c, -s * a.d, -s * a.dd - c * a.d * a.d};
}

/// Position of the peg's edge over its angle t: the point, its first and second t-derivative.
template <typename Scalar>
struct EdgePoint {
  std::array<Scalar, 3> p, p1, p2;
  Scalar rho, rho1, rho2;
};

/// pose: x1, x2, x3, phi, theta, psi.
template <typename Scalar, typename Real>
EdgePoint<Scalar> edgePoint(const std::array<Scalar, 6>& pose, const Scalar& t, Real h, Real r) {
  using std::cos;
  using std::sin;
  using std::sqrt;
  const Scalar cph = cos(pose[3]), sph = sin(pose[3]), cth = cos(pose[4]), sth = sin(pose[4]);
  // in the peg's equator a turn by t and one by psi add up
  const Scalar u = pose[5] + t, cu = cos(u), su = sin(u);
  const Scalar e1[3] = {cph * cth, sph * cth, Scalar(0) - sth};
  const Scalar e2[3] = {Scalar(0) - sph, cph, Scalar(Real(0))};
  const Scalar a[3] = {cph * sth, sph * sth, cth};
  EdgePoint<Scalar> out;
  for (std::size_t i = 0; i < 3; ++i) {
    const Scalar radial = Scalar(r) * (cu * e1[i] + su * e2[i]);
    out.p[i] = pose[i] - Scalar(h) * a[i] + radial;
    out.p1[i] = Scalar(r) * (cu * e2[i] - su * e1[i]);
    out.p2[i] = Scalar(0) - radial;
  }
  const auto& p = out.p;
  const auto& q = out.p1;
  out.rho = sqrt(p[1] * p[1] + p[2] * p[2]);
  out.rho1 = (p[1] * q[1] + p[2] * q[2]) / out.rho;
  out.rho2 =
      (q[1] * q[1] + q[2] * q[2] + p[1] * out.p2[1] + p[2] * out.p2[2] - out.rho1 * out.rho1) /
      out.rho;
  return out;
}

/// Half the t-derivative of the squared distance of the edges in the meridian, and its slope.
template <typename Scalar>
void stationary(const EdgePoint<Scalar>& e, const Scalar& r_hole, Scalar& phi, Scalar& slope) {
  phi = e.p[0] * e.p1[0] + (e.rho - r_hole) * e.rho1;
  slope = e.p1[0] * e.p1[0] + e.p[0] * e.p2[0] + e.rho1 * e.rho1 + (e.rho - r_hole) * e.rho2;
}

/// What meets what at a place of contact: the peg's bottom edge (first three) or its side or bottom
/// face with the rim.
enum class Meeting { kEdgeEdge, kEdgePlane, kEdgeWall, kRimSide, kRimFace };

template <typename Real>
class Mechanism {
 public:
  using Vec3 = Eigen::Matrix<Real, 3, 1>;
  using Mat3 = Eigen::Matrix<Real, 3, 3>;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
  /// x (3), Euler angles (3), carrier (3), then v (3), omega in fixed axes (3), carrier rates (3)
  using State = std::array<Real, 18>;

  explicit Mechanism(const Scenario& s, Real tolerance,
                     const std::array<Meeting, 2>& places = {Meeting::kEdgeEdge,
                                                             Meeting::kEdgeEdge})
      : s_(s), tolerance_(tolerance), rigid_(s.contact.law == ContactLaw::kRigid), places_(places) {
    const InitialState& i = s.initial;
    const Real q[9] = {i.position.z(), i.position.x(), i.position.y(), i.euler.phi,  i.euler.theta,
                       i.euler.psi,    i.carrier_x,    i.carrier_y,    i.carrier_yaw};
    std::copy(q, q + 9, y_.begin());
    const Vec3 rates(i.euler_rates.x(), i.euler_rates.y(), i.euler_rates.z());
    const Vec3 omega = eulerMatrix(y_) * rates;
    const Real v[9] = {i.velocity.z(),
                       i.velocity.x(),
                       i.velocity.y(),
                       omega(0),
                       omega(1),
                       omega(2),
                       i.carrier_velocity.x(),
                       i.carrier_velocity.y(),
                       i.carrier_velocity.z()};
    std::copy(v, v + 9, y_.begin() + 9);
    if (s.initial.close) close();
    if (s.contact.law != ContactLaw::kNone) {
      Kinetics k = kinetics(time_, y_);
      for (int slot = 0; slot < 2; ++slot) {
        const Contact c = contact(slot, y_, k);
        if (c.found && c.gap <= Real(1e-8)) mode_[slot] = Mode::kSlip;
      }
      if (rigid_) impact();
      if (rigid_) decide();
      if (!rigid_) branch(true);
    }
  }

  const State& state() const { return y_; }
  Real time() const { return time_; }
  long events() const { return events_; }
  long impacts() const { return impacts_; }
  bool failed() const { return failed_; }

  /// To exactly t_end; false when it cannot go on.
  bool advance(Real t_end) {
    boost::numeric::odeint::runge_kutta_fehlberg78<State, Real, State, Real> stepper;
    const auto rhs = [this](const State& y, State& dy, Real t) { derivative(t, y, dy); };
    long guard = 0;
    while (time_ < t_end && !failed_) {
      if (++guard > 20000000) return false;
      Real h = std::min(step_, t_end - time_);
      State end, error;
      const State start = y_;
      start_slip(start);
      const std::array<Real, 2> warm = warm_;
      crossed_ = false;
      stepper.do_step(rhs, start, time_, end, h, error);
      Real e = 0;
      for (std::size_t i = 0; i < 18; ++i) {
        const bool angle = i % 9 > 2 && i % 9 != 6 && i % 9 != 7;
        const Real scale = tolerance_ * (i > 8 ? 30 : 1) * (angle ? 30 : 1);
        e = std::max(e, std::abs(error[i]) / scale);
      }
      const Real factor = e > 0 ? Real(0.85) * std::pow(e, Real(-1) / 8) : Real(4);
      // Fehlberg's estimate does not see what happens between the first and the last stage
      if ((!(e <= 1) || crossed_) && h > Real(1e-16)) {
        step_ = h * std::clamp(std::isfinite(e) ? factor : Real(0.1), Real(0.1),
                               crossed_ ? Real(0.5) : Real(0.9));
        warm_ = warm;
        continue;
      }
      if (s_.contact.law == ContactLaw::kNone || eventValue(time_ + h, end) >= 0) {
        time_ = h < step_ || time_ + h >= t_end ? std::min(t_end, time_ + h) : time_ + h;
        y_ = end;
        if (rigid_) hold();
        step_ = std::min(kLongest, std::max(step_, h) * std::clamp(factor, Real(0.2), Real(4)));
        continue;
      }
      // the event: shortest step beyond it, by false position with bisection
      Real low = 0, high = h, f_low = std::max(eventValue(time_, start), Real(1e-30));
      Real f_high = eventValue(time_ + h, end);
      State at_high = end;
      for (int i = 0; i < 300 && high - low > Real(1e-17); ++i) {
        Real middle =
            i % 3 == 2 ? (low + high) / 2 : (low * f_high - high * f_low) / (f_high - f_low);
        const Real inset = Real(0.2) * Real(1e-17);
        middle = std::clamp(middle, low + inset, high - inset);
        stepper.do_step(rhs, start, time_, end, middle, error);
        const Real f = eventValue(time_ + middle, end);
        if (f < 0) {
          high = middle;
          f_high = f;
          at_high = end;
        } else {
          low = middle;
          f_low = std::max(f, Real(1e-30));
        }
      }
      y_ = at_high;
      time_ += high;
      change();
      step_ = std::min(h, Real(1e-7));
    }
    return !failed_;
  }

 private:
  enum class Mode { kOpen, kSlip, kStick };
  static constexpr Real kLongest = Real(2e-5);
  static constexpr Real kRest = Real(1e-13);  // slip slower than this is at rest [m/s]
  static constexpr Real kRounding = Real(1e-11);

  struct Kinetics {
    Vec3 x, a, v, omega, force, torque;  // without contacts
    Vec3 acc, alpha;                     // linear and angular acceleration, without contacts
    Real carrier[3];
    Vec3 rates, rates2;  // Euler rates, and their derivative at acc and alpha
    Mat3 J_inverse;
  };
  struct Contact {
    bool found = false;
    Real gap = 0, gap_rate = 0, gap_acc = 0;  // the last without contact forces
    Vec3 r = Vec3::Zero(), n = Vec3::Zero(), v = Vec3::Zero(), v_t = Vec3::Zero();
    Vec3 acc = Vec3::Zero();  // change of v at the moving contact, without forces
  };

  static Mat3 eulerMatrix(const State& y) {
    Mat3 E;
    const Real cph = std::cos(y[3]), sph = std::sin(y[3]), cth = std::cos(y[4]),
               sth = std::sin(y[4]);
    E << 0, -sph, cph * sth, 0, cph, sph * sth, 1, 0, cth;
    return E;
  }

  Kinetics kinetics(Real t, const State& y) const {
    Kinetics k;
    const PegParameters& peg = s_.mechanism.peg;
    k.x << y[0], y[1], y[2];
    k.v << y[9], y[10], y[11];
    k.omega << y[12], y[13], y[14];
    const Mat3 E = eulerMatrix(y);
    k.a = E.col(2);
    const Mat3 E_inverse = E.inverse();
    k.rates = E_inverse * k.omega;
    const Real d1 = peg.exciter_height, d2 = peg.coupling_height;
    // coupling
    Real d[6], dd[6];
    const Vec3 tip = k.x + d2 * k.a, tip_v = k.v + d2 * k.omega.cross(k.a);
    d[0] = tip(0) - Real(s_.rest.z), dd[0] = tip_v(0);
    d[1] = tip(1) - y[6], dd[1] = tip_v(1) - y[15];
    d[2] = tip(2) - y[7], dd[2] = tip_v(2) - y[16];
    d[3] = y[5] - y[8], dd[3] = k.omega(0) - y[17];
    d[4] = y[4] - Real(s_.rest.theta), dd[4] = k.omega(1);
    d[5] = y[3] - Real(s_.rest.phi), dd[5] = k.omega(2);
    Real spring[6], damper[6];
    apply(s_.mechanism.coupling.stiffness, d, spring);
    apply(s_.mechanism.coupling.damping, dd, damper);
    const Vec3 pull(spring[0] + damper[0], spring[1] + damper[1], spring[2] + damper[2]);
    // exciter and push in peg axes x = axis 2, y = −(axis 1)
    const ExciterParameters& e = s_.mechanism.exciter;
    const Real angle = Real(e.direction) * (Real(e.frequency) * t + Real(e.phase));
    const Real fx = Real(s_.push(0)) + Real(e.amplitude) * std::cos(angle);
    const Real fy = Real(s_.push(1)) + Real(e.amplitude) * std::sin(angle);
    const Real cph = std::cos(y[3]), sph = std::sin(y[3]), cth = std::cos(y[4]),
               sth = std::sin(y[4]), cps = std::cos(y[5]), sps = std::sin(y[5]);
    const Vec3 e1(cph * cth, sph * cth, -sth), e2(-sph, cph, 0);
    const Vec3 axis1 = cps * e1 + sps * e2, axis2 = cps * e2 - sps * e1;
    const Vec3 drive = -fy * axis1 + fx * axis2 + Real(s_.push(2)) * k.a;
    k.force = drive - pull - Real(peg.mass) * Real(s_.mechanism.gravity) * Vec3::UnitX();
    // springs act on the angles: the moment whose work on a turn of (phi, theta, psi) is theirs
    const Vec3 on_angles(-spring[5], -spring[4], -spring[3]);
    k.torque = d1 * k.a.cross(drive) - d2 * k.a.cross(pull) -
               Vec3(damper[3], damper[4], damper[5]) + E_inverse.transpose() * on_angles;
    const Real I = peg.inertia_transverse, I3 = peg.inertia_axial;
    const Vec3 momentum = I * k.omega + (I3 - I) * k.a.dot(k.omega) * k.a;
    k.J_inverse = Mat3::Identity() / I + (1 / I3 - 1 / I) * k.a * k.a.transpose();
    k.acc = k.force / Real(peg.mass);
    k.alpha = k.J_inverse * (k.torque - k.omega.cross(momentum));
    const CarrierParameters& c = s_.mechanism.carrier;
    k.carrier[0] =
        (pull(1) - Real(c.stiffness(0)) * (y[6] - Real(s_.rest.x)) - Real(c.damping(0)) * y[15]) /
        Real(c.mass);
    k.carrier[1] =
        (pull(2) - Real(c.stiffness(1)) * (y[7] - Real(s_.rest.y)) - Real(c.damping(1)) * y[16]) /
        Real(c.mass);
    k.carrier[2] = (spring[3] + damper[3] - Real(c.stiffness(2)) * (y[8] - Real(s_.rest.yaw)) -
                    Real(c.damping(2)) * y[17]) /
                   Real(c.inertia);
    // E' rates: columns of E turn with phi and theta
    const Vec3 turned = Vec3(-cph, -sph, 0) * (k.rates(0) * k.rates(1)) +
                        k.rates(2) * (Vec3(-sph * sth, cph * sth, 0) * k.rates(0) +
                                      Vec3(cph * cth, sph * cth, -sth) * k.rates(1));
    k.rates2 = E_inverse * (k.alpha - turned);
    return k;
  }

  static void apply(const CouplingMatrix& K, const Real* d, Real* f) {
    for (int i = 0; i < 6; ++i) f[i] = Real(K.diagonal(i)) * d[i];
    f[1] += Real(K.k26) * d[5];
    f[5] += Real(K.k26) * d[1];
    f[2] += Real(K.k35) * d[4];
    f[4] += Real(K.k35) * d[2];
  }

  // change of the velocity of peg point r by a unit impulse at r_other
  Mat3 influence(const Kinetics& k, const Vec3& r, const Vec3& r_other) const {
    return Mat3::Identity() / Real(s_.mechanism.peg.mass) - skew(r) * k.J_inverse * skew(r_other);
  }
  static Mat3 skew(const Vec3& r) {
    Mat3 S;
    S << 0, -r(2), r(1), r(2), 0, -r(0), -r(1), r(0), 0;
    return S;
  }

  // angle of the candidate of one half of the edge at a pose
  bool search(int slot, const std::array<Real, 6>& pose, Real& t) const {
    const Real h = s_.mechanism.peg.half_height, r = s_.mechanism.peg.radius,
               R = s_.mechanism.hole.radius;
    const Real pi = std::acos(Real(-1));
    // lowest point: height over u = psi + t is cos(phi) cos(theta) cos(u) − sin(phi) sin(u)
    const Real c = std::cos(pose[3]) * std::cos(pose[4]), sn = -std::sin(pose[3]);
    const Real low = std::atan2(-sn, -c) - pose[5];
    const Real side = slot == 0 ? 1 : -1;
    const auto inside = [&](Real u) {
      const Real x = std::remainder(side * (u - low), 2 * pi);
      return x > 0 && x < pi;
    };
    const auto polish = [&](Real& u) {
      for (int i = 0; i < 12; ++i) {
        const auto e = edgePoint<Real, Real>(pose, u, h, r);
        Real phi, slope;
        stationary<Real>(e, R, phi, slope);
        if (!(slope > 0)) return false;
        const Real du = -phi / slope;
        if (std::abs(du) > Real(0.1)) return false;
        u += du;
        if (std::abs(du) < Real(1e-17)) break;
      }
      const auto e = edgePoint<Real, Real>(pose, u, h, r);
      return inside(u) && e.p1[0] * e.rho1 >= 0;
    };
    Real u = t;
    if (std::isfinite(u) && polish(u)) {
      t = u;
      return true;
    }
    bool any = false;
    Real best = 1;
    constexpr int n = 120;
    Real before = 1;
    for (int i = 0; i <= n; ++i) {
      const Real at = low + side * pi * (i + Real(0.01)) / (n + Real(0.02));
      const auto e = edgePoint<Real, Real>(pose, at, h, r);
      Real phi, slope;
      stationary<Real>(e, R, phi, slope);
      phi *= side;
      if (i > 0 && before < 0 && phi >= 0) {
        Real v = at - side * pi / (2 * n);
        if (polish(v)) {
          const auto p = edgePoint<Real, Real>(pose, v, h, r);
          const Real distance = std::hypot(p.p[0], p.rho - R);
          if (distance < best) best = distance, t = v, any = true;
        }
      }
      before = phi;
    }
    return any;
  }

  // The other meetings: the gap over the angle u on the circle that meets (edge or rim), half the
  // derivative of what is least there, its slope, the point of the peg, and the normal.
  template <typename Scalar>
  struct Place {
    Scalar gap, phi, slope;
    std::array<Scalar, 3> p, n;
  };
  template <typename Scalar>
  Place<Scalar> place(Meeting meeting, const std::array<Scalar, 6>& pose, const Scalar& u) const {
    using std::cos;
    using std::sin;
    using std::sqrt;
    const Real h = s_.mechanism.peg.half_height, r = s_.mechanism.peg.radius;
    const Scalar R(static_cast<Real>(s_.mechanism.hole.radius)), zero(Real(0)), one(Real(1));
    Place<Scalar> out;
    if (meeting == Meeting::kEdgePlane || meeting == Meeting::kEdgeWall) {
      const auto e = edgePoint<Scalar, Real>(pose, u, h, r);
      out.p = e.p;
      if (meeting == Meeting::kEdgePlane) {
        out.gap = e.p[0], out.phi = e.p1[0], out.slope = e.p2[0];
        out.n = {one, zero, zero};
      } else {
        out.gap = R - e.rho, out.phi = zero - e.rho1, out.slope = zero - e.rho2;
        out.n = {zero, zero - e.p[1] / e.rho, zero - e.p[2] / e.rho};
      }
      return out;
    }
    const Scalar sth = sin(pose[4]);
    const std::array<Scalar, 3> a = {cos(pose[3]) * sth, sin(pose[3]) * sth, cos(pose[4])};
    const std::array<Scalar, 3> H = {zero, R * cos(u), R * sin(u)};
    const std::array<Scalar, 3> H1 = {zero, zero - H[2], H[1]};
    std::array<Scalar, 3> w;
    for (std::size_t i = 0; i < 3; ++i) w[i] = H[i] - pose[i] + Scalar(h) * a[i];
    const auto dot = [](const std::array<Scalar, 3>& x, const std::array<Scalar, 3>& y) {
      return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    };
    const Scalar up = dot(w, a), up1 = dot(H1, a), up2 = zero - dot(H, a);
    if (meeting == Meeting::kRimFace) {
      out.gap = zero - up, out.phi = zero - up1, out.slope = zero - up2;
      out.n = a;
    } else {
      const Scalar d = sqrt(dot(w, w) - up * up);
      out.gap = d - Scalar(r), out.phi = dot(w, H1) - up * up1;
      out.slope = dot(H1, H1) - dot(w, H) - up1 * up1 - up * up2;
      for (std::size_t i = 0; i < 3; ++i) out.n[i] = (up * a[i] - w[i]) / d;
    }
    for (std::size_t i = 0; i < 3; ++i) out.p[i] = H[i] + out.gap * out.n[i];
    return out;
  }

  // the least gap of a meeting: the nearest place to a warm start, from a scan without one
  bool searchPlace(Meeting meeting, const std::array<Real, 6>& pose, Real& u) const {
    const auto polish = [&](Real& at) {
      for (int i = 0; i < 30; ++i) {
        const auto f = place<Real>(meeting, pose, at);
        if (!(f.slope > 0)) return false;
        const Real step = -f.phi / f.slope;
        if (std::abs(step) > Real(0.1)) return false;
        at += step;
        if (std::abs(step) < Real(1e-17)) break;
      }
      return true;
    };
    if (std::isfinite(u) && polish(u)) return true;
    Real best = 1e3L;
    constexpr int n = 400;
    for (int i = 0; i < n; ++i) {
      Real at = 2 * std::acos(Real(-1)) * i / n;
      if (place<Real>(meeting, pose, at).gap > best || !polish(at)) continue;
      const Real gap = place<Real>(meeting, pose, at).gap;
      if (gap < best) best = gap, u = at;
    }
    return best < 1e3L;
  }

  Contact placeContact(Meeting meeting, const std::array<Taylor<Real>, 6>& moving,
                       const std::array<Real, 6>& pose, const Kinetics& k, Real& warm) const {
    Contact c;
    if (!searchPlace(meeting, pose, warm)) return c;
    using T = Taylor<Real>;
    T u(warm);
    for (int i = 0; i < 2; ++i) {
      const auto f = place<T>(meeting, moving, u);
      u = u - f.phi / f.slope;
    }
    const auto f = place<T>(meeting, moving, u);
    if (std::abs(f.gap.f) > Real(0.1) * Real(s_.mechanism.peg.radius)) return c;
    c.found = true;
    c.gap = f.gap.f, c.gap_rate = f.gap.d, c.gap_acc = f.gap.dd;
    c.n << f.n[0].f, f.n[1].f, f.n[2].f;
    const Vec3 p(f.p[0].f, f.p[1].f, f.p[2].f), p_dot(f.p[0].d, f.p[1].d, f.p[2].d);
    c.r = p - k.x;
    c.v = k.v + k.omega.cross(c.r);
    c.v_t = c.v - c.n.dot(c.v) * c.n;
    c.acc = k.acc + k.alpha.cross(c.r) + k.omega.cross(p_dot - k.v);
    return c;
  }

  Contact contact(int slot, const State& y, const Kinetics& k) {
    Contact c;
    std::array<Real, 6> pose;
    std::copy(y.begin(), y.begin() + 6, pose.begin());
    Real& t = warm_[static_cast<std::size_t>(slot)];
    using T = Taylor<Real>;
    std::array<T, 6> moving;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      moving[i] = T(pose[i], k.v(j), k.acc(j));
      moving[i + 3] = T(pose[i + 3], k.rates(j), k.rates2(j));
    }
    const Meeting meeting = places_[static_cast<std::size_t>(slot)];
    if (meeting != Meeting::kEdgeEdge) return placeContact(meeting, moving, pose, k, t);
    if (!search(slot, pose, t)) return c;
    const Real h = s_.mechanism.peg.half_height, r = s_.mechanism.peg.radius;
    const T R(static_cast<Real>(s_.mechanism.hole.radius));
    T u(t);
    for (int i = 0; i < 2; ++i) {
      T phi, slope;
      stationary<T>(edgePoint<T, Real>(moving, u, h, r), R, phi, slope);
      u = u - phi / slope;
    }
    const auto e = edgePoint<T, Real>(moving, u, h, r);
    // both slopes have one sign: the normal (|rho'|, −|x1'|) in the meridian
    const Real sign = e.rho1.f < 0 || e.p1[0].f < 0 ? -1 : 1;
    const T norm = sqrt(e.p1[0] * e.p1[0] + e.rho1 * e.rho1);
    const T gap = T(sign) * (e.rho1 * e.p[0] - e.p1[0] * (e.rho - R)) / norm;
    c.gap = gap.f;
    if (std::abs(c.gap) > Real(0.1) * r) return c;
    c.found = true;
    c.gap_rate = gap.d;
    c.gap_acc = gap.dd;
    const Vec3 p(e.p[0].f, e.p[1].f, e.p[2].f), p_dot(e.p[0].d, e.p[1].d, e.p[2].d);
    const Vec3 tangent(e.p1[0].f, e.p1[1].f, e.p1[2].f);
    Vec3 rim(0, -e.p[2].f, e.p[1].f);
    c.n = rim.cross(tangent).normalized();
    if (c.n(0) < 0 || (c.n(0) == 0 && c.n(1) * p(1) + c.n(2) * p(2) > 0)) c.n = -c.n;
    c.r = p - k.x;
    c.v = k.v + k.omega.cross(c.r);
    c.v_t = c.v - c.n.dot(c.v) * c.n;
    // p_dot is the whole motion of the contact point on the peg's edge
    c.acc = k.acc + k.alpha.cross(c.r) + k.omega.cross(p_dot - k.v);
    return c;
  }

  // forces for given modes: directions of slip and normals known
  struct Solution {
    std::array<Vec3, 2> force{Vec3::Zero(), Vec3::Zero()};
    std::array<Real, 2> normal{0, 0}, tangential{0, 0};
  };
  Solution solve(const Kinetics& k, const std::array<Contact, 2>& c, const std::array<Mode, 2>& m,
                 const std::array<Vec3, 2>& direction) const {
    struct Row {
      int slot;
      Vec3 row, column;
      Real target;
    };
    std::vector<Row> rows;
    for (int i = 0; i < 2; ++i) {
      if (m[i] == Mode::kOpen || !c[i].found) continue;
      if (m[i] == Mode::kSlip) {
        rows.push_back({i, c[i].n,
                        c[i].n + Real(s_.mechanism.friction.sliding_coefficient) * direction[i],
                        -c[i].gap_acc});
      } else {
        // normal by the gap, tangential by the rest of the contact point
        const Vec3 one = c[i].n.unitOrthogonal(), two = c[i].n.cross(one);
        rows.push_back({i, c[i].n, c[i].n, -c[i].gap_acc});
        rows.push_back({i, one, one, -one.dot(c[i].acc)});
        rows.push_back({i, two, two, -two.dot(c[i].acc)});
      }
    }
    Solution out;
    const auto n = static_cast<Eigen::Index>(rows.size());
    if (n == 0) return out;
    Matrix A(n, n);
    Vector b(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Row& ri = rows[static_cast<std::size_t>(i)];
      b(i) = ri.target;
      for (Eigen::Index j = 0; j < n; ++j) {
        const Row& rj = rows[static_cast<std::size_t>(j)];
        A(i, j) = ri.row.dot(influence(k, c[ri.slot].r, c[rj.slot].r) * rj.column);
      }
    }
    Vector x;
    if (n == 6) {
      Eigen::CompleteOrthogonalDecomposition<Matrix> decomposition(A);
      decomposition.setThreshold(kRounding);
      x = decomposition.solve(b);
    } else {
      x = A.fullPivLu().solve(b);
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      const Row& r = rows[static_cast<std::size_t>(i)];
      out.force[r.slot] += x(i) * r.column;
    }
    if (n == 6) share(c, out);
    for (int i = 0; i < 2; ++i) {
      if (!c[i].found) continue;
      out.normal[i] = c[i].n.dot(out.force[i]);
      out.tangential[i] = (out.force[i] - out.normal[i] * c[i].n).norm();
    }
    return out;
  }

  // undetermined force along the chord: as far inside both cones as possible (golden section)
  void share(const std::array<Contact, 2>& c, Solution& out) const {
    const Vec3 along = (c[1].r - c[0].r).normalized();
    const Real mu = s_.mechanism.friction.static_coefficient;
    const auto worst = [&](Real s) {
      Real w = -1e30L;
      for (int i = 0; i < 2; ++i) {
        const Vec3 f = out.force[i] + (i == 0 ? s : -s) * along;
        const Real N = c[i].n.dot(f);
        w = std::max(w, (f - N * c[i].n).norm() - mu * N);
      }
      return w;
    };
    const Real g = (std::sqrt(Real(5)) - 1) / 2;
    Real low = -2 * (out.force[0].norm() + out.force[1].norm()), high = -low;
    Real a = high - g * (high - low), b = low + g * (high - low), fa = worst(a), fb = worst(b);
    for (int i = 0; i < 60; ++i) {
      if (fa < fb) {
        high = b, b = a, fb = fa, a = high - g * (high - low), fa = worst(a);
      } else {
        low = a, a = b, fa = fb, b = low + g * (high - low), fb = worst(b);
      }
    }
    out.force[0] += (low + high) / 2 * along;
    out.force[1] -= (low + high) / 2 * along;
  }

  Vec3 slipDirection(int i, const Contact& c) const {
    const Real speed = c.v_t.norm();
    return speed > kRest ? Vec3(-c.v_t / speed) : slip_[i];
  }

  std::array<Vec3, 2> forces(const Kinetics& k, const std::array<Contact, 2>& c) const {
    if (!rigid_) return compliant(k, c).force;
    return solve(k, c, mode_, {slipDirection(0, c[0]), slipDirection(1, c[1])}).force;
  }

  // Laws with regularised friction. Each branch of the law (creeping or sliding, pressing or not)
  // is kept through a step, so that every step sees smooth equations; `margin` < 0 requests a
  // change.
  struct Compliant {
    std::array<Vec3, 2> force{Vec3::Zero(), Vec3::Zero()};
    std::array<Real, 2> speed_margin{1, 1}, press_margin{1, 1};
  };
  Compliant compliant(const Kinetics& k, const std::array<Contact, 2>& c) const {
    const ContactParameters& law = s_.contact;
    Compliant out;
    std::array<Vec3, 2> d;
    std::array<bool, 2> in{false, false};
    for (int i = 0; i < 2; ++i) {
      in[i] = c[i].found && mode_[i] != Mode::kOpen;
      if (!in[i]) continue;
      const Real u = c[i].v_t.norm(), limit = law.regularisation_speed;
      // divided by the speed already
      const Real over = sliding_[i] ? Real(s_.mechanism.friction.sliding_coefficient) / u
                                    : Real(s_.mechanism.friction.static_coefficient) / limit;
      d[i] = c[i].n - over * c[i].v_t;
      out.speed_margin[i] = sliding_[i] ? u - limit : limit - u;
    }
    if (law.law == ContactLaw::kSpringDashpot) {
      for (int i = 0; i < 2; ++i) {
        if (!in[i]) continue;
        const Real N = -Real(law.stiffness) * c[i].gap - Real(law.damping) * c[i].gap_rate;
        out.press_margin[i] = presses_[i] ? N : -N;
        if (presses_[i]) out.force[i] = N * d[i];
      }
      return out;
    }
    const auto row = [&](int i, int j) { return c[i].n.dot(influence(k, c[i].r, c[j].r) * d[j]); };
    std::array<Real, 2> w{0, 0}, N{0, 0};
    for (int i = 0; i < 2; ++i) {
      if (!in[i]) continue;
      w[i] = c[i].gap_acc + Real(law.rate) * c[i].gap_rate + Real(law.pull_back) * c[i].gap;
    }
    const bool first = in[0] && presses_[0], second = in[1] && presses_[1];
    if (first && second) {
      const Real a = row(0, 0), b = row(0, 1), e = row(1, 0), f = row(1, 1), det = a * f - b * e;
      N = {(-w[0] * f + w[1] * b) / det, (-w[1] * a + w[0] * e) / det};
    } else if (first) {
      N[0] = -w[0] / row(0, 0);
    } else if (second) {
      N[1] = -w[1] / row(1, 1);
    }
    for (int i = 0; i < 2; ++i) {
      if (!in[i]) continue;
      out.force[i] = N[i] * d[i];
      Real demand = w[i];
      for (int j = 0; j < 2; ++j) {
        if (in[j] && N[j] != 0) demand += row(i, j) * N[j];
      }
      out.press_margin[i] = presses_[i] ? N[i] : demand;
    }
    return out;
  }

  // branches of the compliant laws at the present state: from scratch, or after an event
  void branch(bool afresh) {
    const Kinetics k = kinetics(time_, y_);
    const std::array<Contact, 2> c = contacts(y_, k);
    const Compliant before = compliant(k, c);
    for (int i = 0; i < 2; ++i) {
      if (!c[i].found || mode_[i] == Mode::kOpen) continue;
      if (afresh || fresh_[i]) {
        sliding_[i] = c[i].v_t.norm() > Real(s_.contact.regularisation_speed);
      } else if (before.speed_margin[i] < 0) {
        sliding_[i] = !sliding_[i];
      }
    }
    if (s_.contact.law == ContactLaw::kSpringDashpot) {
      for (int i = 0; i < 2; ++i) {
        if (!c[i].found || mode_[i] == Mode::kOpen) continue;
        const Real N =
            -Real(s_.contact.stiffness) * c[i].gap - Real(s_.contact.damping) * c[i].gap_rate;
        if (afresh || fresh_[i]) {
          presses_[i] = N > 0;
        } else if (before.press_margin[i] < 0) {
          presses_[i] = !presses_[i];
        }
      }
    } else {
      Real best = -1;
      std::array<bool, 2> chosen{false, false};
      for (int code = 3; code >= 0 && best < 0; --code) {
        presses_ = {(code & 1) != 0, (code & 2) != 0};
        const Compliant f = compliant(k, c);
        Real least = 0;
        for (int i = 0; i < 2; ++i) least = std::min(least, f.press_margin[i]);
        if (code == 3 || least > best) best = least, chosen = presses_;
      }
      presses_ = chosen;
    }
    fresh_ = {false, false};
  }

  std::array<Contact, 2> contacts(const State& y, const Kinetics& k) {
    return {contact(0, y, k), contact(1, y, k)};
  }

  void derivative(Real t, const State& y, State& dy) {
    const Kinetics k = kinetics(t, y);
    Vec3 acc = k.acc, alpha = k.alpha;
    if (mode_[0] != Mode::kOpen || mode_[1] != Mode::kOpen) {
      const std::array<Contact, 2> c = contacts(y, k);
      const std::array<Vec3, 2> f = forces(k, c);
      for (int i = 0; i < 2; ++i) {
        if (rigid_ && mode_[i] == Mode::kSlip && fast_[i] && c[i].found) {
          crossed_ = crossed_ || slip_[i].dot(c[i].v_t) >= 0;
        }
      }
      for (int i = 0; i < 2; ++i) {
        if (!c[i].found) continue;
        acc += f[i] / Real(s_.mechanism.peg.mass);
        alpha += k.J_inverse * c[i].r.cross(f[i]);
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      dy[i] = k.v(j);
      dy[i + 3] = k.rates(j);
      dy[i + 6] = y[i + 15];
      dy[i + 9] = acc(j);
      dy[i + 12] = alpha(j);
      dy[i + 15] = k.carrier[i];
    }
  }

  // directions of slip at the start of a step, by which its stop is detected
  void start_slip(const State& y) {
    if (!rigid_ || (mode_[0] == Mode::kOpen && mode_[1] == Mode::kOpen)) return;
    const Kinetics k = kinetics(time_, y);
    for (int i = 0; i < 2; ++i) {
      if (mode_[i] != Mode::kSlip) continue;
      const Contact c = contact(i, y, k);
      if (!c.found) {
        failed_ = true;
        return;
      }
      slip_[i] = slipDirection(i, c);
      fast_[i] = fast_[i] || c.v_t.norm() > 2 * kRest;
    }
  }

  // below zero a mode must change
  Real eventValue(Real t, const State& y) {
    const Kinetics k = kinetics(t, y);
    const std::array<Contact, 2> c = contacts(y, k);
    Real value = 1;
    for (int i = 0; i < 2; ++i) {
      if (mode_[i] == Mode::kOpen && c[i].found &&
          !(c[i].gap > -Real(1e-15) && c[i].gap_rate > 0)) {
        value = std::min(value, c[i].gap);
      }
      if (mode_[i] != Mode::kOpen && !c[i].found) return -1;
    }
    if (!rigid_) {
      const Compliant f = compliant(k, c);
      for (int i = 0; i < 2; ++i) {
        if (mode_[i] == Mode::kOpen) continue;
        value = std::min(
            {value, Real(1e-15) - c[i].gap, f.speed_margin[i], f.press_margin[i] + kRounding});
      }
      return value;
    }
    if (mode_[0] == Mode::kOpen && mode_[1] == Mode::kOpen) return value;
    const Solution f = solve(k, c, mode_, {slipDirection(0, c[0]), slipDirection(1, c[1])});
    for (int i = 0; i < 2; ++i) {
      if (mode_[i] == Mode::kOpen) continue;
      value = std::min(value, f.normal[i] + kRounding);
      if (mode_[i] == Mode::kStick) {
        value = std::min(value, Real(s_.mechanism.friction.static_coefficient) * f.normal[i] -
                                    f.tangential[i] + kRounding);
      } else if (fast_[i]) {
        value = std::min(value, -slip_[i].dot(c[i].v_t) - kRest);
      }
    }
    return value;
  }

  // what an event does
  void change() {
    ++events_;
    const Kinetics k = kinetics(time_, y_);
    const std::array<Contact, 2> c = contacts(y_, k);
    bool closed = false;
    for (int i = 0; i < 2; ++i) {
      if (mode_[i] != Mode::kOpen && !c[i].found) {
        failed_ = true;
        return;
      }
      if (mode_[i] == Mode::kOpen && c[i].found && c[i].gap < 0 && c[i].gap_rate < 0) {
        mode_[i] = Mode::kSlip;
        fresh_[i] = true;
        ++impacts_;
        closed = true;
      } else if (!rigid_ && mode_[i] != Mode::kOpen && c[i].gap >= Real(1e-15)) {
        mode_[i] = Mode::kOpen;
      }
    }
    if (!rigid_) {
      branch(false);
      return;
    }
    if (closed) {
      if (s_.contact.restitution > 0) bounce();
      impact();
    }
    decide();
  }

  // points that bounce, the fastest first; the package's rules: slower than 1 mm/s does not
  void bounce() {
    for (int n = 0; n < 60; ++n) {
      const Kinetics k = kinetics(time_, y_);
      const std::array<Contact, 2> c = contacts(y_, k);
      int fastest = -1;
      Real approach = -Real(1e-3);
      for (int i = 0; i < 2; ++i) {
        if (mode_[i] == Mode::kOpen || !c[i].found || c[i].gap_rate >= approach) continue;
        approach = c[i].gap_rate;
        fastest = i;
      }
      if (fastest < 0) return;
      std::array<Vec3, 2> P{Vec3::Zero(), Vec3::Zero()};
      const Contact& hit = c[fastest];
      P[fastest] =
          strongeImpact<Real>(influence(k, hit.r, hit.r), hit.v, hit.n,
                              s_.mechanism.friction.sliding_coefficient,
                              s_.mechanism.friction.static_coefficient, s_.contact.restitution)
              .impulse;
      kick(k, c, P);
    }
  }

  void kick(const Kinetics& k, const std::array<Contact, 2>& c, const std::array<Vec3, 2>& P) {
    for (int i = 0; i < 2; ++i) {
      if (!c[i].found) continue;
      const Vec3 dv = P[i] / Real(s_.mechanism.peg.mass), dw = k.J_inverse * c[i].r.cross(P[i]);
      for (std::size_t j = 0; j < 3; ++j) {
        y_[9 + j] += dv(static_cast<Eigen::Index>(j));
        y_[12 + j] += dw(static_cast<Eigen::Index>(j));
      }
    }
  }

  // impulses of the closed contacts for given kinds; slip by fixed-point iteration of its direction
  bool impulses(const Kinetics& k, const std::array<Contact, 2>& c, const std::array<Mode, 2>& m,
                std::array<Vec3, 2>& P) const {
    std::array<Contact, 2> virtually = c;
    std::array<Vec3, 2> direction{};
    for (int i = 0; i < 2; ++i) {
      if (!c[i].found) continue;
      virtually[i].gap_acc = c[i].n.dot(c[i].v);
      virtually[i].acc = c[i].v;
      direction[i] = c[i].v_t.norm() > 0 ? Vec3(-c[i].v_t.normalized()) : Vec3(Vec3::Zero());
    }
    return fixedPoint(k, virtually, m, direction, {true, true}, Real(1e-16), P);
  }

  // Solves modes whose slip directions, where free, oppose the resulting motion: Newton on their
  // angles, from the given directions and then from a grid. False when it finds none.
  bool fixedPoint(const Kinetics& k, const std::array<Contact, 2>& c, const std::array<Mode, 2>& m,
                  std::array<Vec3, 2>& direction, const std::array<bool, 2>& free, Real still,
                  std::array<Vec3, 2>& force) const {
    std::array<int, 2> unknown{};
    int n = 0;
    for (int i = 0; i < 2; ++i) {
      if (m[i] == Mode::kSlip && free[i]) unknown[n++] = i;
    }
    if (n == 0) {
      force = solve(k, c, m, direction).force;
      return true;
    }
    std::array<Vec3, 2> one, two;
    for (int i = 0; i < 2; ++i) {
      if (c[i].found) one[i] = c[i].n.unitOrthogonal(), two[i] = c[i].n.cross(one[i]);
    }
    const auto along = [&](int i, Real angle) {
      return Vec3(std::cos(angle) * one[i] + std::sin(angle) * two[i]);
    };
    // turn from each direction to the one that opposes the motion; false without a motion
    const auto turn = [&](const std::array<Real, 2>& angle, std::array<Real, 2>& out) {
      for (int j = 0; j < n; ++j) direction[unknown[j]] = along(unknown[j], angle[j]);
      force = solve(k, c, m, direction).force;
      for (int j = 0; j < n; ++j) {
        const int i = unknown[j];
        Vec3 motion = c[i].acc;
        for (int l = 0; l < 2; ++l) {
          if (m[l] != Mode::kOpen) motion += influence(k, c[i].r, c[l].r) * force[l];
        }
        const Real x = -motion.dot(one[i]), y = -motion.dot(two[i]);
        if (std::hypot(x, y) <= still) return false;
        out[j] = std::remainder(std::atan2(y, x) - angle[j], 2 * std::acos(Real(-1)));
      }
      return true;
    };
    const std::array<Vec3, 2> given = direction;
    // first guesses: as if those points rested, then as given, then a grid of angles
    std::array<Mode, 2> resting = m;
    for (int j = 0; j < n; ++j) resting[unknown[j]] = Mode::kStick;
    std::array<Vec3, 2> as_resting = given;
    const Solution held = solve(k, c, resting, given);
    for (int j = 0; j < n; ++j) {
      const int i = unknown[j];
      const Vec3 t = held.force[i] - held.normal[i] * c[i].n;
      if (t.norm() > 0) as_resting[i] = t.normalized();
    }
    const int grid = n == 1 ? 26 : 83;
    for (int start = 0; start < grid; ++start) {
      std::array<Real, 2> angle{}, f{}, g{};
      for (int j = 0; j < n; ++j) {
        const Vec3& d = start == 0 ? as_resting[unknown[j]] : given[unknown[j]];
        angle[j] = start < 2 ? std::atan2(d.dot(two[unknown[j]]), d.dot(one[unknown[j]]))
                   : n == 1  ? Real(start) * Real(0.2618)
                             : Real(j == 0 ? (start - 2) / 9 : (start - 2) % 9) * Real(0.6981);
      }
      for (int pass = 0; pass < 60; ++pass) {
        if (!turn(angle, f)) break;
        Real size = 0;
        for (int j = 0; j < n; ++j) size = std::max(size, std::abs(f[j]));
        if (size < Real(1e-17)) return true;
        if (pass > 40 && size < Real(1e-14)) return true;
        Real J[2][2] = {{0, 0}, {0, 1}};
        const Real delta = std::min(Real(1e-6), std::max(Real(1e-10), size * Real(1e-2)));
        bool good = true;
        for (int j = 0; j < n; ++j) {
          std::array<Real, 2> shifted = angle;
          shifted[j] += delta;
          good = good && turn(shifted, g);
          for (int l = 0; l < n; ++l) J[l][j] = (g[l] - f[l]) / delta;
        }
        const Real det = J[0][0] * J[1][1] - J[0][1] * J[1][0];
        if (!good || det == 0) break;
        const Real s0 = -(f[0] * J[1][1] - (n == 2 ? f[1] * J[0][1] : Real(0))) / det;
        const Real s1 = n == 2 ? -(J[0][0] * f[1] - J[1][0] * f[0]) / det : Real(0);
        angle[0] += std::clamp(s0, Real(-0.5), Real(0.5));
        angle[1] += std::clamp(s1, Real(-0.5), Real(0.5));
      }
    }
    return false;
  }

  static int sticks(const std::array<Mode, 2>& m) {
    return (m[0] == Mode::kStick) + (m[1] == Mode::kStick);
  }

  void impact() {
    const Kinetics k = kinetics(time_, y_);
    const std::array<Contact, 2> c = contacts(y_, k);
    constexpr Mode kinds[3] = {Mode::kStick, Mode::kSlip, Mode::kOpen};
    std::array<Vec3, 2> P{Vec3::Zero(), Vec3::Zero()};
    const Real mu = s_.mechanism.friction.sliding_coefficient;
    bool done = false;
    for (int code = 0; code < 9 && !done; ++code) {
      const std::array<Mode, 2> m{kinds[code % 3], kinds[code / 3]};
      bool possible = true;
      for (int i = 0; i < 2; ++i) {
        if (mode_[i] == Mode::kOpen && m[i] != Mode::kOpen) possible = false;
      }
      if (!possible || !impulses(k, c, m, P)) continue;
      bool right = true;
      for (int i = 0; i < 2; ++i) {
        if (mode_[i] == Mode::kOpen) continue;
        Vec3 after = c[i].v;
        for (int j = 0; j < 2; ++j) {
          if (m[j] != Mode::kOpen) after += influence(k, c[i].r, c[j].r) * P[j];
        }
        const Real N = c[i].n.dot(P[i]);
        if (m[i] == Mode::kOpen) right = right && c[i].n.dot(after) >= -Real(1e-15);
        if (m[i] != Mode::kOpen) right = right && N >= -Real(1e-16);
        if (m[i] == Mode::kStick)
          right = right && (P[i] - N * c[i].n).norm() <= mu * N + Real(1e-15);
      }
      if (right) {
        for (int i = 0; i < 2; ++i) {
          if (m[i] == Mode::kOpen) P[i].setZero();
        }
        kick(k, c, P);
        done = true;
      }
    }
    if (!done) failed_ = true;
  }

  // who opens, slips and rests at the present velocity
  void decide() {
    Kinetics k = kinetics(time_, y_);
    std::array<Contact, 2> c = contacts(y_, k);
    std::array<bool, 2> rests{false, false}, closed{false, false};
    for (int i = 0; i < 2; ++i) {
      if (mode_[i] == Mode::kOpen) continue;
      closed[i] = c[i].found && c[i].gap_rate < Real(1e-12);
      rests[i] = closed[i] && c[i].v_t.norm() <= 10 * kRest;
      if (!closed[i]) mode_[i] = Mode::kOpen;
    }
    rest(k, c, closed, rests);
    k = kinetics(time_, y_);
    c = contacts(y_, k);

    const auto options = [&](int i) {
      if (!closed[i]) return std::vector<Mode>{Mode::kOpen};
      if (rests[i]) return std::vector<Mode>{Mode::kStick, Mode::kSlip, Mode::kOpen};
      return std::vector<Mode>{Mode::kSlip, Mode::kOpen};
    };
    // all rest first, then all slip, then the mixed ones
    std::vector<std::array<Mode, 2>> trials;
    for (Mode a : options(0)) {
      for (Mode b : options(1)) trials.push_back({a, b});
    }
    const auto rank = [&](const std::array<Mode, 2>& m) {
      int open = 0, mixed = 0;
      for (int i = 0; i < 2; ++i) open += closed[i] && m[i] == Mode::kOpen;
      if (rests[0] && rests[1] && sticks(m) == 1) mixed = 2;
      if (sticks(m) == 0 && (rests[0] || rests[1])) mixed = 1;
      return 10 * open + mixed;
    };
    std::stable_sort(trials.begin(), trials.end(),
                     [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
    const Real mu_s = Real(s_.mechanism.friction.static_coefficient) * (1 - Real(1e-9));
    for (const auto& m : trials) {
      std::array<Vec3, 2> direction{}, force{};
      for (int i = 0; i < 2; ++i) {
        direction[i].setZero();
        if (m[i] != Mode::kSlip) continue;
        if (!rests[i]) {
          direction[i] = -c[i].v_t.normalized();
        } else {
          const Vec3 t = -(c[i].acc - c[i].n.dot(c[i].acc) * c[i].n);
          direction[i] = t.norm() > 0 ? Vec3(t.normalized()) : Vec3(Vec3::Zero());
        }
      }
      if (!fixedPoint(k, c, m, direction, rests, Real(1e-12), force)) continue;
      bool right = true;
      for (int i = 0; i < 2; ++i) {
        if (!closed[i]) continue;
        const Real N = c[i].n.dot(force[i]);
        if (m[i] == Mode::kOpen) {
          Real acc = c[i].gap_acc;
          for (int j = 0; j < 2; ++j) {
            if (m[j] != Mode::kOpen) acc += c[i].n.dot(influence(k, c[i].r, c[j].r) * force[j]);
          }
          right = right && acc >= -Real(1e-8);
        } else {
          right = right && N >= 0;
          if (m[i] == Mode::kStick) right = right && (force[i] - N * c[i].n).norm() <= mu_s * N;
        }
      }
      if (!right) continue;
      mode_ = m;
      slip_ = direction;
      for (int i = 0; i < 2; ++i) fast_[i] = !rests[i];
      return;
    }
    failed_ = true;
  }

  // gap rates of closed contacts and the slip of resting points to zero, least kinetic energy
  void rest(const Kinetics& k, const std::array<Contact, 2>& c, const std::array<bool, 2>& closed,
            const std::array<bool, 2>& rests) {
    struct Row {
      int slot;
      Vec3 direction;
    };
    std::vector<Row> rows;
    for (int i = 0; i < 2; ++i) {
      if (!closed[i]) continue;
      rows.push_back({i, c[i].n});
      if (!rests[i]) continue;
      const Vec3 one = c[i].n.unitOrthogonal();
      rows.push_back({i, one});
      rows.push_back({i, c[i].n.cross(one)});
    }
    if (rows.empty()) return;
    const auto n = static_cast<Eigen::Index>(rows.size());
    Matrix A(n, n);
    Vector b(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Row& ri = rows[static_cast<std::size_t>(i)];
      b(i) = -ri.direction.dot(c[ri.slot].v);
      for (Eigen::Index j = 0; j < n; ++j) {
        const Row& rj = rows[static_cast<std::size_t>(j)];
        A(i, j) = ri.direction.dot(influence(k, c[ri.slot].r, c[rj.slot].r) * rj.direction);
      }
    }
    Eigen::CompleteOrthogonalDecomposition<Matrix> decomposition(A);
    decomposition.setThreshold(kRounding);
    const Vector x = decomposition.solve(b);
    std::array<Vec3, 2> P{Vec3::Zero(), Vec3::Zero()};
    for (Eigen::Index i = 0; i < n; ++i) {
      const Row& r = rows[static_cast<std::size_t>(i)];
      P[r.slot] += x(i) * r.direction;
    }
    for (int i = 0; i < 2; ++i) {
      if (closed[i]) continue;
      P[i].setZero();
    }
    std::array<Contact, 2> levers = c;
    for (Contact& l : levers) {
      if (!l.found) l.r.setZero();
    }
    kick(k, levers, P);
  }

  // what rounding and step errors leave of the velocities at closed contacts goes
  void hold() {
    if (mode_[0] == Mode::kOpen && mode_[1] == Mode::kOpen) return;
    const Kinetics k = kinetics(time_, y_);
    const std::array<Contact, 2> c = contacts(y_, k);
    std::array<bool, 2> closed{}, rests{};
    for (int i = 0; i < 2; ++i) {
      closed[i] = mode_[i] != Mode::kOpen && c[i].found;
      rests[i] = mode_[i] == Mode::kStick;
    }
    rest(k, c, closed, rests);
  }

  // the smallest gap is put to zero by the height
  void close() {
    const auto smallest = [this](Real height) {
      State y = y_;
      y[0] = height;
      std::array<Real, 6> pose;
      std::copy(y.begin(), y.begin() + 6, pose.begin());
      Real least = 1;
      for (int slot = 0; slot < 2; ++slot) {
        Real t = std::nan("");
        if (!search(slot, pose, t)) continue;
        const auto e = edgePoint<Real, Real>(pose, t, Real(s_.mechanism.peg.half_height),
                                             Real(s_.mechanism.peg.radius));
        const Real distance = std::hypot(e.p[0], e.rho - Real(s_.mechanism.hole.radius));
        least = std::min(least, e.p[0] < 0 ? -distance : distance);
      }
      return least;
    };
    Real high = y_[0], low = high;
    while (smallest(low) > 0 && low > high - Real(0.01)) low -= Real(1e-5);
    while (smallest(high) <= 0 && high < low + Real(0.01)) high += Real(1e-5);
    for (int i = 0; i < 90; ++i) {
      const Real middle = (low + high) / 2;
      (smallest(middle) > 0 ? high : low) = middle;
    }
    y_[0] = high;
  }

  Scenario s_;
  Real tolerance_;
  bool rigid_;
  std::array<Meeting, 2> places_;
  State y_{};
  Real time_ = 0, step_ = Real(1e-7);
  std::array<Mode, 2> mode_{Mode::kOpen, Mode::kOpen};
  std::array<Vec3, 2> slip_{Vec3::Zero(), Vec3::Zero()};
  std::array<bool, 2> fast_{false, false}, sliding_{false, false}, presses_{true, true},
      fresh_{false, false};
  bool crossed_ = false;  // a stage of the step saw a slip reversed
  std::array<Real, 2> warm_{std::nan(""), std::nan("")};
  long events_ = 0, impacts_ = 0;
  bool failed_ = false;
};

}  // namespace assembly_cell::reference
