// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/contact_formulas.h"

#include <cmath>

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
constexpr double kParallel = 1e-9;  // sine below which two directions are one

}  // namespace

std::optional<Complex> tiltFromWobble(Complex dq, double a0, double a1) {
  const double sine = std::sin(a1 - a0);
  if (!(std::abs(sine) > kParallel)) return {};
  return (dq * std::polar(1.0, -a1)).imag() / sine * std::polar(1.0, a0);
}

std::optional<Complex> tiltFromReadings(const std::vector<WobbleReading>& readings) {
  // each says that its tilt has no part across its direction
  double ss = 0.0, sc = 0.0, cc = 0.0, bs = 0.0, bc = 0.0;
  for (const WobbleReading& r : readings) {
    const double s = -std::sin(r.alpha), c = std::cos(r.alpha);
    const double across = (r.dq * std::polar(1.0, -r.alpha)).imag();
    ss += s * s;
    sc += s * c;
    cc += c * c;
    bs -= s * across;
    bc -= c * across;
  }
  const double determinant = ss * cc - sc * sc;
  const double n = ss + cc;
  if (!(determinant > kParallel * kParallel * n * n)) return {};
  return Complex(bs * cc - bc * sc, bc * ss - bs * sc) / determinant;
}

Complex edgePoint(double radius, Complex q, double a) {
  // the projected edge is an ellipse, short along the tilt
  const double b = q == 0.0 ? 0.0 : a - std::arg(q);
  const double shrink = std::cos(std::abs(q));
  return std::polar(radius * shrink / std::hypot(std::cos(b), shrink * std::sin(b)), a);
}

Complex equalRadiusCentre(double radius, double a1, double a2) {
  return radius * (std::polar(1.0, a1) + std::polar(1.0, a2));
}

std::optional<Complex> centreThrough(double hole_radius, Complex p1, Complex p2, Complex away) {
  const Complex half = 0.5 * (p2 - p1), middle = 0.5 * (p1 + p2);
  const double square = hole_radius * hole_radius - std::norm(half);
  if (!(square >= 0.0) || half == 0.0) return {};
  const Complex across = Complex(0.0, 1.0) * half / std::abs(half);
  const double side = (std::conj(across) * (away - middle)).real() < 0.0 ? -1.0 : 1.0;
  return middle + side * std::sqrt(square) * across;
}

std::optional<Complex> holeFromEdges(double radius, double hole_radius, Complex q, double a1,
                                     double a2) {
  return centreThrough(hole_radius, edgePoint(radius, q, a1), edgePoint(radius, q, a2),
                       equalRadiusCentre(radius, a1, a2));
}

std::optional<Complex> holeFromDouble(double radius, double hole_radius, Complex q, double alpha,
                                      double a_c) {
  const Complex p = edgePoint(radius, q, a_c) * std::polar(1.0, -alpha);
  const double square = hole_radius * hole_radius - p.imag() * p.imag();
  if (!(square >= 0.0)) return {};
  return (p.real() + std::copysign(std::sqrt(square), p.real())) * std::polar(1.0, alpha);
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
