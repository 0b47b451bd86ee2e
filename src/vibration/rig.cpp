// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/rig.h"

#include <algorithm>

#include "assembly_cell/vibration/validity.h"

namespace assembly_cell {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kMostTurns = 1000000;
constexpr double kKnifeEdge = 1e-12;  // misalignment this near to tipping alone: never

void requireRig(const RigCase& c) {
  requirePositive("M_over_L", c.M_over_L);
  requirePositive("f_hz", c.f_hz);
  requirePositive("K", c.K);
  requirePositive("g", c.g);
  finiteResult("K g", c.K * c.g);
  finiteResult("M_over_L", 2 * c.M_over_L);
}

// x in (low, high) where f changes sign, f(low) > 0
template <typename Function>
double bisect(double low, double high, const Function& f) {
  for (int k = 0; k < 200; ++k) {
    const double middle = 0.5 * (low + high);
    if (!(middle > low && middle < high)) break;
    (f(middle) > 0.0 ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// sliding time in units of 1/w from misalignment x A with acceleration a A w²
RigSlide slide(double x, double a) {
  const double b0 = std::acos(x), to_hole = std::sqrt(2 * x / a);
  // 5.6 without cancellation: positive up to 2 b0, then concave while cos > a, then convex
  const auto f = [&](double t) {
    return a * t * t / 2 + 2 * std::sin(t / 2) * std::sin(b0 - t / 2);
  };
  const double end = b0 + kPi / 2;
  const double convex = std::max(2 * b0, b0 + std::acos(std::min(1.0, a)));
  const auto falling = [&](double t) { return std::sin(t - b0) - a * t; };
  const double lowest = !(falling(convex) > 0.0) ? convex
                        : falling(end) > 0.0     ? end
                                                 : bisect(convex, end, falling);
  double stop = to_hole;
  if (f(convex) <= 0.0) {
    stop = bisect(2 * b0, convex, f);
  } else if (f(lowest) <= 0.0) {
    stop = bisect(convex, lowest, f);
  }
  if (stop >= to_hole) return {to_hole, 0.0};
  return {stop, x - a * stop * stop / 2};
}

}  // namespace

RigSlide rigSlide(const RigCase& c, double x) {
  requireRig(c);
  const double A = 2 * c.M_over_L, w = 2 * kPi * c.f_hz;
  if (!(x > 0.0 && x < A)) refuse("x", x, "give a misalignment between 0 and 2 M_over_L");
  const double a = c.K * c.g / (A * w * w);
  requirePositive("K g / (2 M_over_L w^2)", a);
  const RigSlide s = slide(x / A, a);
  return {finiteResult("time", s.time / w), s.x * A};
}

RigResult rigAssembly(const RigCase& c) {
  requireRig(c);
  requirePositive("x0", c.x0);
  const double A = 2 * c.M_over_L, w = 2 * kPi * c.f_hz, a = c.K * c.g / (A * w * w);
  requirePositive("K g / (2 M_over_L w^2)", a);
  RigResult result;
  if (c.x0 >= A * (1 - kKnifeEdge)) {
    result.never = true;
    return result;
  }
  const double first = std::acos(c.x0 / A);
  double x = c.x0 / A;
  for (int n = 0; n < kMostTurns; ++n) {
    const double start = 2 * kPi * n - std::acos(x) + first;
    const RigSlide s = slide(x, a);
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

double rigOneSlideFrequency(const RigCase& c) {
  requireRig(c);
  requirePositive("x0", c.x0);
  if (c.x0 >= 2 * c.M_over_L) refuse("x0", c.x0, "give less than 2 M_over_L, else it never tips");
  const double turn = (std::acos(c.x0 / (2 * c.M_over_L)) + kPi / 2) / (2 * kPi);
  return finiteResult("f", turn * std::sqrt(c.K * c.g / (2 * c.x0)));
}

}  // namespace assembly_cell
