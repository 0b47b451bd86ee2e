// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The universal closed form against Duhamel's integral and Runge–Kutta, both in long double.
#include "assembly_cell/vibration/single_dof.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "support/quadrature.h"
#include "support/refusals.h"

namespace assembly_cell {
namespace {

using Real = long double;

// response by convolution with the free response, any damping
SingleDofState duhamel(const SingleDof& s, double t, Real* rate_out = nullptr,
                       Real* out = nullptr) {
  const Real W2 = Real(s.K) / s.I, gamma = Real(s.c) / s.I / 2, k2 = W2 - gamma * gamma;
  const auto sine = [&](Real u) {
    const Real k = std::sqrt(std::abs(k2));
    return std::exp(-gamma * u) * (k2 > 0   ? std::sin(k * u) / k
                                   : k2 < 0 ? std::sinh(k * u) / k
                                            : u);
  };
  const auto cosine = [&](Real u) {
    const Real k = std::sqrt(std::abs(k2));
    return std::exp(-gamma * u) * (k2 > 0 ? std::cos(k * u) : k2 < 0 ? std::cosh(k * u) : 1);
  };
  const auto force = [&](Real x) {
    return (s.A * std::cos(s.w * x) + s.B * std::sin(s.w * x) + s.C) / s.I;
  };
  const Real u = Real(t) - s.t1;
  const int panels = 4 + static_cast<int>((std::sqrt(W2) + s.w + gamma) * u / 2);
  const Real forced = integrate([&](Real x) { return force(x) * sine(t - x); }, s.t1, t, panels);
  const Real forced_rate = integrate(
      [&](Real x) { return force(x) * (cosine(t - x) - gamma * sine(t - x)); }, s.t1, t, panels);
  const Real theta = forced + s.th1 * (cosine(u) + gamma * sine(u)) + s.thd1 * sine(u);
  const Real rate = forced_rate + s.thd1 * (cosine(u) - gamma * sine(u)) - s.th1 * W2 * sine(u);
  if (out) *out = theta;
  if (rate_out) *rate_out = rate;
  return {static_cast<double>(theta), static_cast<double>(rate)};
}

// sum of the sizes of the terms of the closed form
double sizeOf(const SingleDof& s, double t) {
  const double W = std::sqrt(s.K / s.I), u = t - s.t1;
  const auto reach = [&](double difference) {
    return std::min(u, 2 / std::max(std::abs(difference), 1e-300));
  };
  return std::hypot(s.A, s.B) / (2 * s.I * W) * (reach(s.w - W) + reach(s.w + W)) +
         2 * std::abs(s.C) / s.K + std::abs(s.th1) + std::abs(s.thd1) / W;
}

SingleDof randomCase(std::mt19937_64& random, double* t) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto log10 = [&](double decades) { return std::pow(10.0, decades * uniform(random)); };
  SingleDof s;
  s.I = log10(2);
  s.K = s.I * log10(3);
  const double W = std::sqrt(s.K / s.I);
  s.w = W * log10(1);
  s.A = uniform(random) * s.K;
  s.B = uniform(random) * s.K;
  s.C = uniform(random) * s.K;
  s.th1 = uniform(random);
  s.thd1 = uniform(random) * W;
  s.t1 = uniform(random) * 10 / W;
  *t = s.t1 + std::pow(10.0, 3 * std::abs(uniform(random))) / W;
  return s;
}

// Wt up to 1e3; 1e-12 of the terms is the requirement, the phase's own rounding makes 2e-13
TEST(SingleDof, UndampedAgreesWithQuadratureToRounding) {
  std::mt19937_64 random(1);
  for (int run = 0; run < 300; ++run) {
    double t = 0;
    SingleDof s = randomCase(random, &t);
    const double W = std::sqrt(s.K / s.I);
    // every third case at or next to resonance
    if (run % 3 == 0) s.w = W * (1 + (run % 2 ? 1e-9 : 0.0) * (run % 5 - 2));
    // the far end exactly
    if (run % 10 == 0) {
      s.t1 = 0;
      t = 1000 / W;
    }
    const SingleDofState x = singleDof(s, t), y = duhamel(s, t);
    const double size = sizeOf(s, t);
    EXPECT_LT(std::abs(x.theta - y.theta), 1e-12 * size) << run;
    EXPECT_LT(std::abs(x.theta_dot - y.theta_dot), 1e-12 * size * std::max(W, s.w)) << run;
  }
}

TEST(SingleDof, DampedAgreesWithQuadratureToRounding) {
  std::mt19937_64 random(2);
  for (int run = 0; run < 300; ++run) {
    double t = 0;
    SingleDof s = randomCase(random, &t);
    const double W = std::sqrt(s.K / s.I);
    constexpr double kRatios[] = {1e-12, 1e-6, 1e-3, 0.02, 0.3, 0.499, 0.501, 0.9, 1.0, 1.1, 3.0};
    s.c = 2 * s.I * W * kRatios[run % 11];
    if (run % 3 == 0) s.w = W * (1 + (run % 2 ? 1e-9 : 0.0));
    // sinh of the reference itself overflows beyond
    if (kRatios[run % 11] > 0.9) t = std::min(t, s.t1 + 100 / W);
    const SingleDofState x = singleDof(s, t), y = duhamel(s, t);
    const double size = sizeOf(s, t);
    EXPECT_LT(std::abs(x.theta - y.theta), 1e-12 * size) << run;
    EXPECT_LT(std::abs(x.theta_dot - y.theta_dot), 1e-12 * size * std::max(W, s.w)) << run;
  }
}

// a second reference: Runge–Kutta 4 in long double; (W h)^5/120 a step makes 1e-13 over 10 rad
TEST(SingleDof, AgreesWithIntegrationOfTheEquation) {
  std::mt19937_64 random(3);
  for (const double ratio : {0.0, 0.05, 0.7, 1.5}) {
    double t = 0;
    SingleDof s = randomCase(random, &t);
    const Real W = std::sqrt(Real(s.K) / s.I);
    s.w = static_cast<double>(1.3L * W);
    s.c = ratio * 2 * s.I * static_cast<double>(W);
    const int steps = 20000;
    const Real h = 10 / W / steps;
    Real x = s.th1, v = s.thd1, time = s.t1;
    const auto acceleration = [&](Real at, Real p, Real q) {
      return (s.A * std::cos(s.w * at) + s.B * std::sin(s.w * at) + s.C - s.K * p - s.c * q) / s.I;
    };
    for (int k = 0; k < steps; ++k, time += h) {
      const Real a1 = acceleration(time, x, v), v2 = v + h / 2 * a1;
      const Real a2 = acceleration(time + h / 2, x + h / 2 * v, v2), v3 = v + h / 2 * a2;
      const Real a3 = acceleration(time + h / 2, x + h / 2 * v2, v3), v4 = v + h * a3;
      const Real a4 = acceleration(time + h, x + h * v3, v4);
      x += h / 6 * (v + 2 * v2 + 2 * v3 + v4);
      v += h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    }
    const SingleDofState y = singleDof(s, static_cast<double>(s.t1 + 10 / W));
    EXPECT_NEAR(y.theta, static_cast<double>(x), 1e-10 * sizeOf(s, static_cast<double>(time)));
    EXPECT_NEAR(y.theta_dot, static_cast<double>(v),
                1e-10 * static_cast<double>(W) * sizeOf(s, static_cast<double>(time)));
  }
}

TEST(SingleDof, ResonanceIsNoSpecialPoint) {
  SingleDof s{2, 8, 0, 3, 1, 0, 2, 0, 0, 0};
  // at w = W: (A u sin wu + B (sin wu/w − u cos wu))/(2 I w)
  const double u = 7.3;
  const double exact =
      (3 * u * std::sin(2 * u) + std::sin(2 * u) / 2 - u * std::cos(2 * u)) / (2 * 2 * 2);
  EXPECT_NEAR(singleDof(s, u).theta, exact, 1e-14 * sizeOf(s, u));
  SingleDof next = s;
  next.w *= 1 + 1e-9;
  // moves with the frequency by 1e-9 w u, no more
  EXPECT_NEAR(singleDof(next, u).theta, exact, 2e-8 * sizeOf(s, u));
}

TEST(SingleDof, StartsAtItsInitialValues) {
  const SingleDof s{2, 8, 0.3, 3, 1, -5, 2.2, 1.5, 0.7, -0.4};
  EXPECT_DOUBLE_EQ(singleDof(s, 1.5).theta, 0.7);
  EXPECT_DOUBLE_EQ(singleDof(s, 1.5).theta_dot, -0.4);
}

// coherent units: length 1e3, time 1e-2
TEST(SingleDof, ScalesWithUnits) {
  const SingleDof s{2, 8, 0.3, 3, 1, -5, 2.2, 1.5, 0.7, -0.4};
  const double moment = 1e6 / 1e-4;
  const SingleDof scaled{2e6,         8 * moment, 0.3e6 / 1e-2, 3 * moment, 1 * moment,
                         -5 * moment, 2.2 / 1e-2, 1.5e-2,       0.7,        -0.4 / 1e-2};
  const SingleDofState x = singleDof(s, 9.0), y = singleDof(scaled, 9.0e-2);
  EXPECT_NEAR(y.theta, x.theta, 1e-13);
  EXPECT_NEAR(y.theta_dot * 1e-2, x.theta_dot, 1e-13);
}

TEST(SingleDof, SplitsInTime) {
  for (const double c : {0.0, 0.4}) {
    SingleDof s{2, 8, c, 3, 1, -5, 2.2, 0.5, 0.7, -0.4};
    const SingleDofState middle = singleDof(s, 4.0), end = singleDof(s, 11.0);
    s.t1 = 4.0;
    s.th1 = middle.theta;
    s.thd1 = middle.theta_dot;
    EXPECT_NEAR(singleDof(s, 11.0).theta, end.theta, 1e-13);
  }
}

TEST(SingleDof, RefusesWithTheReason) {
  const SingleDof good{2, 8, 0, 3, 1, 0, 2, 0, 0, 0};
  const auto refusal = [&](auto spoil, double t) {
    SingleDof s = good;
    spoil(s);
    return refusalOf([&] { singleDof(s, t); });
  };
  EXPECT_EQ(refusal([](auto& s) { s.I = 0; }, 1), "I: value 0.0: give a positive number");
  EXPECT_EQ(refusal([](auto& s) { s.K = -1; }, 1), "K: value -1.0: give a positive number");
  EXPECT_NE(refusal([](auto& s) { s.c = -1; }, 1).find("c:"), std::string::npos);
  EXPECT_NE(refusal([](auto& s) { s.t1 = 2; }, 1).find("t:"), std::string::npos);
  EXPECT_EQ(refusal([](auto& s) { s.w = std::nan(""); }, 1),
            "w: value not finite: give a finite number");
  // a result out of range is refused
  EXPECT_NE(refusal(
                [](auto& s) {
                  s.C = 1e308;
                  s.K = 1e-308;
                },
                1)
                .find("out of range"),
            std::string::npos);
}

// finite in, finite out or refused: any magnitudes
TEST(SingleDof, NeverNaN) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> exponent(-300, 300), sign(-1, 1);
  int answered = 0;
  for (int run = 0; run < 20000; ++run) {
    const auto any = [&] {
      return std::copysign(std::pow(10.0, exponent(random) * sign(random)), sign(random));
    };
    const SingleDof s{std::abs(any()),
                      std::abs(any()),
                      run % 2 ? std::abs(any()) : 0.0,
                      any(),
                      any(),
                      any(),
                      any(),
                      any(),
                      any(),
                      any()};
    try {
      const SingleDofState x = singleDof(s, s.t1 + std::abs(any()));
      EXPECT_TRUE(std::isfinite(x.theta) && std::isfinite(x.theta_dot));
      ++answered;
    } catch (const InputError&) {
    }
  }
  EXPECT_GT(answered, 1000);
}

}  // namespace
}  // namespace assembly_cell
