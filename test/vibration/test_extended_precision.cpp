// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Closed forms against long double: linear equations with the inertia of a cylinder by quadrature,
// the exponential of the equations of motion, residuals of roots. 1e-12 of the sum of the terms is
// the requirement; rounding of the phase w t up to 1e3 makes 2e-13.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <complex>
#include <random>

#include "assembly_cell/vibration/bounce.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/locus_model.h"
#include "assembly_cell/vibration/rig.h"
#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/steady_state.h"
#include "support/thesis_forms.h"

namespace assembly_cell {
namespace {

using Real = long double;
using Complex = std::complex<Real>;
using Vec = Eigen::Matrix<Real, 3, 1>;
using Mat = Eigen::Matrix<Real, 3, 3>;
using ComplexVec = Eigen::Matrix<Complex, 3, 1>;
using ComplexMat = Eigen::Matrix<Complex, 3, 3>;
constexpr double kTolerance = 1e-12;
const Real kPi = std::acos(Real(-1));

Mat skew(const Vec& v) {
  Mat m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// of a solid cylinder about a point at `to_mass` from its centre of mass: Gauss points in height
// and radius, exact for the squares that inertia is made of
Mat inertiaAbout(const Vec& to_mass, Real m, Real r, Real h) {
  Mat sum = Mat::Zero();
  const Real heights[] = {-h / std::sqrt(Real(3)), h / std::sqrt(Real(3))};
  constexpr int kAngles = 8;
  for (const Real z : heights) {
    for (int k = 0; k < kAngles; ++k) {
      const Real angle = 2 * kPi * k / kAngles, rho = r / std::sqrt(Real(2));
      const Vec p = to_mass + Vec(rho * std::cos(angle), rho * std::sin(angle), z);
      sum += m / (2 * kAngles) * (p.squaredNorm() * Mat::Identity() - p * p.transpose());
    }
  }
  return sum;
}

struct Draw {
  std::mt19937_64 random{20};
  double operator()(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  double decades(double low, double high) { return std::pow(10.0, (*this)(low, high)); }
};

// Rotation about the contact under the rotating force at height hF, support K6, C6 at height hG
ComplexVec rotationOf(const LocusCase& s, Real hF, Real hG, Real g,
                      const Eigen::Matrix<Real, 6, 6>& K6, const Eigen::Matrix<Real, 6, 6>& C6) {
  const Vec in(-s.r * std::cos(Real(s.alpha)), -s.r * std::sin(Real(s.alpha)), 0);
  const Vec mass = in + Vec(0, 0, s.h), force = in + Vec(0, 0, hF), support = in + Vec(0, 0, hG);
  Eigen::Matrix<Real, 6, 3> T;
  T << -skew(support), Mat::Identity();
  // the weight's moment in second order: half of (axis lists) a (a·W) + ..., symmetric
  const Vec W(0, 0, -s.m * g);
  const Mat geometric =
      (W * mass.transpose() + mass * W.transpose()) / 2 - mass.dot(W) * Mat::Identity();
  ComplexMat system;
  const Mat inertia = inertiaAbout(mass, s.m, s.r, s.h);
  const Mat K = T.transpose() * K6 * T - geometric, C = T.transpose() * C6 * T;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      system(i, j) = Complex(K(i, j) - Real(s.w) * s.w * inertia(i, j), Real(s.w) * C(i, j));
    }
  }
  const Vec re = skew(force) * Vec(s.F, 0, 0), im = skew(force) * Vec(0, -s.F, 0);
  ComplexVec moment;
  for (int i = 0; i < 3; ++i) moment(i) = Complex(re(i), im(i));
  return system.fullPivLu().solve(moment);
}

void expectLocus(const PlanarLocus& locus, const LocusCase& s, const ComplexVec& rotation,
                 const char* what) {
  const Vec mass(-s.r * std::cos(Real(s.alpha)), -s.r * std::sin(Real(s.alpha)), s.h);
  const Complex x = rotation(1) * mass.z() - rotation(2) * mass.y(),
                y = rotation(2) * mass.x() - rotation(0) * mass.z(), i(0, 1);
  const Complex P = (x + i * y) / Real(2), N = std::conj(x - i * y) / Real(2);
  const Real terms = Real(s.r + s.h) * rotation.cwiseAbs().sum();
  EXPECT_LT(std::abs(P - Complex(locus.P)), kTolerance * terms) << what << " w " << s.w;
  EXPECT_LT(std::abs(N - Complex(locus.N)), kTolerance * terms) << what << " w " << s.w;
}

// at least 2 % away from the undamped resonances, where input rounding alone is amplified more
bool nearResonance(double w, std::initializer_list<double> squares) {
  for (const double square : squares) {
    if (std::abs(w * w / square - 1) < 0.02) return true;
  }
  return false;
}

TEST(ExtendedPrecision, LociOfSection9) {
  Draw draw;
  using Support = Eigen::Matrix<Real, 6, 6>;
  for (int run = 0; run < 400; ++run) {
    const double size = draw.decades(-2, 2);
    LocusCase s{draw.decades(-2, 2), size, size * draw.decades(-.5, .5),
                draw.decades(-3, 3), 0.0,  draw(-3.1, 3.1)};
    const double K = draw.decades(-1, 4);
    const ContactInertia c = contactInertia(s.m, s.r, s.h);
    s.w = std::sqrt(K / c.Ix) * draw.decades(-1, 1);
    if (nearResonance(s.w, {K / c.Ix, K / c.Iy, K / c.Iz, K / c.Iy_local, K / c.Iz_local}))
      continue;
    const double damping = draw(0, .3) * std::sqrt(K * c.Ix);
    Support K6 = Support::Zero(), C6 = Support::Zero();
    K6.diagonal().tail<3>().setConstant(K);
    C6.diagonal().tail<3>().setConstant(damping);
    expectLocus(isotropicLocus(s, K, damping), s, rotationOf(s, 2 * s.h, 0, 0, K6, C6),
                "isotropic");
    // a full support, not even symmetric, with weight
    const double l = s.h * draw(0, 2), hF = s.h * draw(.5, 3), g = .01 * K / (s.m * s.h);
    SupportMatrix Kd, Cd;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        const double unit = (i < 3 ? 1 / size : 1) * (j < 3 ? 1 / size : 1);
        Kd(i, j) = unit * (i == j ? K * draw(.5, 1) : .05 * K * draw(-1, 1));
        Cd(i, j) = unit * (i == j ? damping : .05 * damping * draw(-1, 1));
      }
    }
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) K6(i, j) = Kd(i, j), C6(i, j) = Cd(i, j);
    }
    // damped, so that no resonance is sharp
    if (damping > .02 * std::sqrt(K * c.Ix)) {
      expectLocus(generalLocus(s, l, hF, g, Kd, Cd), s,
                  rotationOf(s, hF, 2 * Real(s.h) + l, g, K6, C6), "general");
    }
  }
}

// a rotation held about one axis: transverse and vertical support are limits of a stiff yaw or a
// stiff tilt, here with the row and column left out
TEST(ExtendedPrecision, LociWithFewerFreedoms) {
  Draw draw;
  for (int run = 0; run < 400; ++run) {
    const double size = draw.decades(-2, 2);
    LocusCase s{draw.decades(-2, 2), size, size * draw.decades(-.5, .5),
                draw.decades(-3, 3), 0.0,  0.0};
    const double K = draw.decades(-1, 4), Ky = K * draw(.7, 1.5);
    const Vec mass(-s.r, 0, s.h), top(-s.r, 0, 2 * Real(s.h));
    const Mat inertia = inertiaAbout(mass, s.m, s.r, s.h);
    s.w = static_cast<double>(std::sqrt(K / inertia(1, 1))) * draw.decades(-1, 1);
    if (nearResonance(s.w, {K / double(inertia(1, 1)), Ky / double(inertia(0, 0)),
                            K / double(inertia(2, 2))})) {
      continue;
    }
    const double c = draw(0, .3) * std::sqrt(K * double(inertia(1, 1)));
    const auto over = [&](int axis, Real stiffness) {
      return Complex(1) / Complex(stiffness - Real(s.w) * s.w * inertia(axis, axis), Real(s.w) * c);
    };
    const Complex i(0, 1);
    // the contact lies along x: rocking about y is radial, about x tangential
    ComplexVec rotation(i * Real(s.F) * top.z() * over(0, Ky), Real(s.F) * top.z() * over(1, K), 0);
    expectLocus(transverseLocus(s, K, Ky, c, c), s, rotation, "transverse");
    rotation << 0, 0, -i * Real(s.F) * top.x() * over(2, K);
    expectLocus(verticalLocus(s, K, c), s, rotation, "vertical");
    const double d = s.r * draw(0, 1);
    const Real chord = inertiaAbout(Vec(-d, 0, s.h), s.m, s.r, s.h)(1, 1);
    if (nearResonance(s.w, {K / double(chord)})) continue;
    rotation << 0, Real(s.F) * top.z() / Complex(K - Real(s.w) * s.w * chord, Real(s.w) * c), 0;
    const PlanarLocus locus = doubleContactLocus(s, d, K, c);
    const Complex x = rotation(1) * Real(s.h);
    EXPECT_LT(std::abs(Complex(locus.P) - x / Real(2)), kTolerance * std::abs(x));
    EXPECT_LT(std::abs(Complex(locus.N) - std::conj(x) / Real(2)), kTolerance * std::abs(x));
    const double theta = doubleContact(s.F, s.h, K, double(chord), s.w, 0.0);
    EXPECT_NEAR(theta, double(Real(s.F) * top.z() / (K - Real(s.w) * s.w * chord)),
                kTolerance * std::abs(theta) * 60);  // chord rounded to double, 2 % from resonance
  }
}

TEST(ExtendedPrecision, SteadySingleContact) {
  Draw draw;
  using Support = Eigen::Matrix<Real, 6, 6>;
  for (int run = 0; run < 400; ++run) {
    const double size = draw.decades(-2, 2);
    LocusCase s{draw.decades(-2, 2), size, size * draw.decades(-.5, .5),
                draw.decades(-3, 3), 0.0,  draw(-3.1, 3.1)};
    const double K = draw.decades(-1, 4);
    const ContactInertia c = contactInertia(s.m, s.r, s.h);
    s.w = std::sqrt(K / c.Ix) * draw.decades(-1, 1);
    if (nearResonance(s.w, {K / c.Ix, K / c.Iy, K / c.Iz})) continue;
    const double t = draw(0, 1e3) / s.w;
    Support K6 = Support::Zero();
    K6.diagonal().tail<3>().setConstant(K);
    const ComplexVec rotation = rotationOf(s, 2 * s.h, 0, 0, K6, Support::Zero());
    const Complex turn = std::polar(Real(1), Real(s.w) * t);
    Vec theta;
    for (int i = 0; i < 3; ++i) theta(i) = (rotation(i) * turn).real();
    // principal axes: x' clockwise tangent, y' and z' turned by beta
    const Real sa = std::sin(Real(s.alpha)), ca = std::cos(Real(s.alpha)),
               beta =
                   std::atan2(24 * Real(s.r) * s.h, 16 * Real(s.h) * s.h - 15 * Real(s.r) * s.r) /
                   2,
               sb = std::sin(beta), cb = std::cos(beta);
    const Vec x(sa, -ca, 0), y(ca * cb, sa * cb, sb), z(-ca * sb, -sa * sb, cb);
    const ContactRotation found = singleContact({s.m, s.r, s.h, K, s.F, s.w, s.alpha}, t);
    const Real terms = rotation.cwiseAbs().sum();
    EXPECT_NEAR(found.theta_x, double(x.dot(theta)), double(kTolerance * terms));
    EXPECT_NEAR(found.theta_y, double(y.dot(theta)), double(kTolerance * terms));
    EXPECT_NEAR(found.theta_z, double(z.dot(theta)), double(kTolerance * terms));
  }
}

// exponential of the first-order system: Taylor to rounding over a short time, then squared
TEST(ExtendedPrecision, FreeFlight) {
  using State = Eigen::Matrix<Real, 4, 1>;
  using System = Eigen::Matrix<Real, 4, 4>;
  Draw draw;
  for (int run = 0; run < 300; ++run) {
    const double size = draw.decades(-2, 2);
    FreeFlight f;
    f.m = draw.decades(-2, 2);
    f.r = size;
    f.h = size * draw(.5, 2);
    f.l = size * draw(0, 2);
    f.I = f.m * size * size * draw(.2, 2);
    f.kx = draw.decades(-1, 4);
    f.Krot = run % 3 ? f.kx * size * size * draw(0, 3) : 0.0;
    f.J = draw.decades(-3, 0);
    f.g = draw(0, 10);
    const double fastest = freeFlight(f, 0).w_hi, t = draw.decades(-2, 3) / fastest;
    const FreeFlightState found = freeFlight(f, t);
    const Real arm = Real(f.l) + f.h;
    // lengths in units of `arm`, rates in units of `fastest`
    System A = System::Zero();
    const Real unit = fastest;
    A(0, 1) = A(2, 3) = 1;
    A(1, 0) = A(1, 2) = -Real(f.kx) / f.m / (unit * unit);
    A(3, 0) = -Real(f.kx) * arm * arm / f.I / (unit * unit);
    A(3, 2) = -(Real(f.Krot) + Real(f.kx) * arm * arm) / f.I / (unit * unit);
    int squarings = 0;
    Real span = Real(t) * unit;
    for (; span > Real(.25); ++squarings) span /= 2;
    System E = System::Identity(), term = System::Identity();
    for (int k = 1; k < 24; ++k) {
      term = term * A * (span / k);
      E += term;
    }
    for (; squarings > 0; --squarings) E = E * E;
    const Real spin = Real(f.J) * f.r / f.I / unit;
    const State end = E * State(0, 0, 0, spin);
    // free motion along X and theta grows with the time where nothing holds it
    const Real terms = spin * (2 + (f.Krot > 0 ? 0 : Real(t) * unit));
    const Real swing = f.Krot > 0 ? fastest / std::max(found.w_lo, 1e-300) : Real(1);
    EXPECT_NEAR(found.theta, double(end(2)), double(kTolerance * terms * swing)) << run;
    EXPECT_NEAR(found.X, double(end(0) * arm), double(kTolerance * terms * swing * arm)) << run;
    const Real fall = Real(f.g) * t * t / 2, rise = Real(f.J) * t / f.m;
    EXPECT_NEAR(found.Z, double(rise - fall), double(kTolerance * (rise + fall)));
  }
}

// forces resolved along and across the mean slope, 4.19 and 4.20 with the inertia forces
TEST(ExtendedPrecision, SlidingRatios) {
  Draw draw;
  for (int run = 0; run < 400; ++run) {
    const double size = draw.decades(-2, 2), m = draw.decades(-2, 2), g = draw(1, 10);
    SlidingCase s;
    s.m = m;
    s.g = g;
    s.h = size * draw(.5, 2);
    s.l = size * draw(0, 1);
    s.d = size * draw(0, 1);
    s.I = chordInertia(m, size, s.h, s.d);
    s.K = m * g * size * draw(3, 30);
    s.kx = draw(0, 1) * s.K / std::pow(2 * s.h + s.l, 2);
    s.w = std::sqrt(s.K / s.I) * draw(0, 2);
    s.phi = draw(-.5, .5);
    s.theta = draw(0, .05);
    const SlidingRatio found = slidingRatio(s);
    const Real drive = (Real(s.K) - Real(s.I) * s.w * s.w) / (2 * Real(s.h)),
               spring = Real(s.kx) * (2 * Real(s.h) + s.l), lift = Real(m) * s.h * s.w * s.w;
    for (const bool inertia : {false, true}) {
      const Real D = drive - spring + (inertia ? lift : 0);
      const double sign = D < 0 ? -1 : 1;
      for (const double side : {sign, -sign}) {
        const Real x = side * s.theta;
        const Real weight = Real(m) * (g - (inertia ? Real(s.d) * s.w * s.w * x : Real(0)));
        const Real mean = (s.phi + x) / 2, lag = (s.phi - x) / 2;
        const Real normal = weight * std::cos(mean) + D * x * std::sin(lag);
        const Real along = weight * std::sin(mean) + D * x * std::cos(lag);
        const auto& p = side == sign ? (inertia ? found.p1_inertia : found.p1)
                                     : (inertia ? found.p2_inertia : found.p2);
        if (normal < 1e-3 * m * g) continue;  // a quotient of what cancels
        ASSERT_TRUE(p) << run;
        const Real terms = (std::abs(weight) + (std::abs(drive) + spring + lift) * s.theta) /
                           normal * (1 + std::abs(along / normal));
        EXPECT_NEAR(side == sign ? *p : -*p, double(along / normal), double(kTolerance * terms));
      }
    }
  }
}

// 5.6 at the root that was found, and no earlier one
TEST(ExtendedPrecision, RigRoot) {
  Draw draw;
  for (int run = 0; run < 300; ++run) {
    const RigCase c{0.0, draw.decades(-2, 2), draw.decades(-1, 1), draw.decades(-2, 0), 9.8066};
    const Real A = 2 * Real(c.M_over_L), w = 2 * kPi * c.f_hz, a = Real(c.K) * c.g;
    const double x = double(A) * draw(.01, .99);
    const RigSlide slide = rigSlide(c, x);
    const Real b0 = std::acos(Real(x) / A);
    const auto f = [&](Real t) { return a * t * t / 2 - x + A * std::cos(w * t - b0); };
    if (slide.x > 0) {
      // slope of f there turns a residual into an error of the time
      const Real slope = std::abs(a * slide.time - A * w * std::sin(w * slide.time - b0));
      const Real terms = a * slide.time * slide.time / 2 + x + A;
      EXPECT_LT(std::abs(f(slide.time)), kTolerance * (terms + slope * slide.time)) << run;
      EXPECT_NEAR(slide.x, double(x - a * slide.time * slide.time / 2), double(kTolerance * terms))
          << run;
    } else {
      EXPECT_NEAR(slide.time, double(std::sqrt(2 * x / a)), kTolerance * slide.time) << run;
    }
    for (int k = 1; k < 200; ++k) EXPECT_GT(f(Real(slide.time) * k / 200), 0) << run << " " << k;
  }
}

}  // namespace
}  // namespace assembly_cell
