// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/rig.h"

#include <algorithm>

#include "assembly_cell/math/validity.h"
#include "numeric.h"

namespace assembly_cell {
namespace {

// Maximum number of revolutions: a second of computing.
constexpr int kMaxTurns = 1000000;
// Relative distance of the misalignment from the limit of tipping below which the peg never tips.
// 221 cycles at a distance of 1e-9, 293 at 1e-12; 1e-15 is the rounding of x0/A. Same at half and
// twice.
constexpr double kKnifeEdge = 1e-12;

void requireRig(const RigCase& c) {
  requirePositive({{"M_over_L", c.M_over_L}, {"f_hz", c.f_hz}, {"K", c.K}, {"g", c.g}});
  finiteResult("K g", c.K * c.g);
  finiteResult("M_over_L", 2 * c.M_over_L);
}

}  // namespace

RigSlide rigSlide(double x, double a) {
  const double b0 = std::acos(x), to_hole = std::sqrt(2 * x / a);
  // 5.6 without cancellation: positive up to 2 b0, then concave while cos > a, then convex
  const auto f = [&](double t) {
    return a * t * t / 2 + 2 * std::sin(t / 2) * std::sin(b0 - t / 2);
  };
  const double end = b0 + M_PI / 2;
  const double convex = std::max(2 * b0, b0 + std::acos(std::min(1.0, a)));
  const auto positive = [&](double t) { return f(t) > 0.0; };
  const auto falls = [&](double t) { return std::sin(t - b0) - a * t > 0.0; };
  const double lowest = !falls(convex) ? convex
                        : falls(end)   ? end
                                       : vibration::lastOf(convex, end, falls);
  double stop = to_hole;
  if (f(convex) <= 0.0) {
    stop = vibration::lastOf(2 * b0, convex, positive);
  } else if (f(lowest) <= 0.0) {
    stop = vibration::lastOf(convex, lowest, positive);
  }
  if (stop >= to_hole) return {to_hole, 0.0};
  return {stop, x - a * stop * stop / 2};
}

RigResult rigAssembly(const RigCase& c) {
  requireRig(c);
  requirePositive("x0", c.x0);
  const double A = 2 * c.M_over_L, w = 2 * M_PI * c.f_hz, a = c.K * c.g / (A * w * w);
  requirePositive("K g / (2 M_over_L w^2)", a);
  RigResult result;
  if (c.x0 >= A * (1 - kKnifeEdge)) {
    result.never = true;
    return result;
  }
  const double first = std::acos(c.x0 / A);
  double x = c.x0 / A;
  for (int n = 0; n < kMaxTurns; ++n) {
    const double start = 2 * M_PI * n - std::acos(x) + first;
    const RigSlide s = rigSlide(x, a);
    if (!(s.x > 0.0)) {
      result.time = finiteResult("time", (start + s.time) / w);
      result.cycles = n + 1;
      return result;
    }
    x = s.x;
  }
  refuse("x0", c.x0,
         "not assembled in a million turns, give a smaller x0 or a larger M_over_L or K");
}

}  // namespace assembly_cell
