// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/contact_formulas.h"

#include <cmath>

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
constexpr double kParallel = 1e-9;  // sine below which two directions are one

}  // namespace

std::optional<Complex> centreThrough(double hole_radius, Complex p1, Complex p2, Complex away) {
  const Complex half = 0.5 * (p2 - p1), middle = 0.5 * (p1 + p2);
  const double square = hole_radius * hole_radius - std::norm(half);
  if (!(square >= 0.0) || half == 0.0) return {};
  const Complex across = Complex(0.0, 1.0) * half / std::abs(half);
  const double side = (std::conj(across) * (away - middle)).real() < 0.0 ? -1.0 : 1.0;
  return middle + side * std::sqrt(square) * across;
}

std::optional<double> tiltFromDouble(double alpha, const std::vector<TurnReading>& readings) {
  double up = 0.0, down = 0.0;
  for (const TurnReading& r : readings) {
    const double c = alpha - r.alpha;
    up += r.turn * std::cos(c) * std::sin(c);
    down += std::sin(c) * std::sin(c);
  }
  if (!(down > kParallel * kParallel)) return {};
  return up / down;
}

}  // namespace assembly_cell
