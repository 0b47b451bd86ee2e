// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {

// Independent reference of peg and block: both circles sampled densely, then refined, in extended
// precision. Thesis axes.

using Real = long double;
using Vec3L = Eigen::Matrix<Real, 3, 1>;

constexpr double kPi = 3.14159265358979323846;
constexpr double kRadius = 0.025;  // of the peg [m]

inline ContactShapes shapesOf(double clearance) {
  ContactShapes s;
  s.hole_radius = kRadius + clearance;
  s.peg_length = 0.06;
  return s;
}

/// Of the edge circle over the hole plane: its points lie at center ± amplitude.
struct EdgeHeight {
  double center;
  double amplitude;
  double lowest() const { return center - amplitude; }
};

inline EdgeHeight edgeHeight(const EdgeCircle& e) {
  return {e.center(0), e.radius * std::hypot(e.axis0(0), e.axis1(0))};
}

struct BodiesReference {
  Vec3L center, axis0, axis1, axis;
  Real r_p, r_h, length, depth;
  Real r_mouth, chamfer, sine, cosine;  // of the chamfer: upper radius, height, angle to the axis
  Real r_side, shoulder, peg_sine, peg_cosine;  // of the peg's: radius and height of its upper edge

  BodiesReference(const EdgeCircle& e, const ContactShapes& s)
      : center(e.center.cast<Real>()),
        axis0(e.axis0.cast<Real>()),
        axis1(e.axis1.cast<Real>()),
        axis(axis0.cross(axis1)),
        r_p(e.radius),
        r_h(s.hole_radius),
        length(s.peg_length),
        depth(s.hole_depth),
        r_mouth(r_h + s.chamfer.width),
        chamfer(s.chamfer.height),
        sine(s.chamfer.sine),
        cosine(s.chamfer.cosine),
        r_side(r_p + s.peg_chamfer.width),
        shoulder(s.peg_chamfer.height),
        peg_sine(s.peg_chamfer.sine),
        peg_cosine(s.peg_chamfer.cosine) {}

  Vec3L edge(Real t) const { return center + r_p * (std::cos(t) * axis0 + std::sin(t) * axis1); }
  Vec3L upperEdge(Real t) const {
    return center + shoulder * axis + r_side * (std::cos(t) * axis0 + std::sin(t) * axis1);
  }
  // the sharp rim; the chamfer's edges where the wall begins and in the plane
  Vec3L rim(Real s) const { return {-chamfer, r_h * std::cos(s), r_h * std::sin(s)}; }
  Vec3L mouth(Real s) const { return {0, r_mouth * std::cos(s), r_mouth * std::sin(s)}; }
  static Real rho(const Vec3L& p) { return std::hypot(p(1), p(2)); }
  Real height(const Vec3L& x) const { return axis.dot(x - center); }
  Real axisDistance(const Vec3L& x) const { return axis.cross(x - center).norm(); }

  // how far a point of the edge is inside the block, of the rim inside the peg: the least of the
  // distances to the surfaces' carriers, > 0 inside
  Real edgeDepth(Real t) const { return blockDepth(edge(t)); }
  Real blockDepth(const Vec3L& p) const {
    Real inside = std::min(-p(0), rho(p) - r_h);
    if (chamfer > 0) inside = std::min(inside, -coneHeight(p));
    return std::max(inside, -depth - p(0));
  }
  Real coneHeight(const Vec3L& p) const { return cosine * (r_mouth - rho(p)) + sine * p(0); }
  Real pegDepth(const Vec3L& x) const {
    const Real w = height(x);
    const Real inside = std::min({w, r_side - axisDistance(x), length - w});
    return shoulder > 0 ? std::min(inside, -pegConeHeight(x)) : inside;
  }
  Real pegConeHeight(const Vec3L& x) const {
    return peg_cosine * (axisDistance(x) - r_p) - peg_sine * height(x);
  }
  // > 0: the bodies overlap
  Real overlap() const {
    Real e = largest([&](Real t) { return edgeDepth(t); });
    if (shoulder > 0) e = std::max(e, largest([&](Real t) { return blockDepth(upperEdge(t)); }));
    const Real r = largest([&](Real s) { return pegDepth(rim(s)); });
    if (!(chamfer > 0)) return std::max(e, r);
    return std::max({e, r, largest([&](Real s) { return pegDepth(mouth(s)); })});
  }

  // global maximum over the circle: samples, then golden section around the best ones
  template <typename F>
  static Real largest(const F& f, Real* where = nullptr) {
    constexpr int n = 180;
    constexpr Real step = 2 * 3.14159265358979323846L / n;
    Real values[n];
    for (int i = 0; i < n; ++i) values[i] = f(i * step);
    Real best = -1e30L;
    for (int i = 0; i < n; ++i) {
      const Real before = values[(i + n - 1) % n], here = values[i], after = values[(i + 1) % n];
      if (here < before || here < after) continue;
      Real at = 0;
      const Real value = peak(f, (i - 1) * step, (i + 1) * step, at);
      if (value <= best) continue;
      best = value;
      if (where) *where = at;
    }
    return best;
  }

  template <typename F>
  static Real peak(const F& f, Real low, Real high, Real& at) {
    const Real g = 0.5L * (std::sqrt(5.0L) - 1);
    Real a = high - g * (high - low), b = low + g * (high - low);
    Real fa = f(a), fb = f(b);
    for (int i = 0; i < 80; ++i) {
      if (fa > fb) {
        high = b, b = a, fb = fa;
        fa = f(a = high - g * (high - low));
      } else {
        low = a, a = b, fa = fb;
        fb = f(b = low + g * (high - low));
      }
    }
    at = (low + high) / 2;
    return f(at);
  }
};

// edge whose lowest point lies in the direction of `lean` (angle from axis 2), tilted by `tilt`
inline EdgeCircle edgeAt(const Eigen::Vector3d& center, double tilt, double lean, double spin = 0.0,
                         double radius = kRadius) {
  const Eigen::Vector3d sideways(0.0, -std::sin(lean), std::cos(lean));
  const Eigen::Matrix3d R =
      (Eigen::AngleAxisd(tilt, sideways) * Eigen::AngleAxisd(spin, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  return {center, R.col(1), R.col(2), radius};
}

// The minimum of a function of a circle's place within 1 mrad of t, by halving intervals of its
// slope; bend: its second derivative.
struct Minimum {
  Real t, bend;
  bool found;
};
template <class Function>
Minimum minimumNear(Real t, const Function& f) {
  const auto slope = [&](Real at) { return f(at + 1e-6L) - f(at - 1e-6L); };
  Real low = t - 1e-3L, high = t + 1e-3L;
  const Real low_slope = slope(low), high_slope = slope(high);
  const bool found = low_slope < 0 && high_slope > 0;
  for (int k = 0; found && k < 60; ++k) {
    const Real middle = (low + high) / 2;
    (slope(middle) < 0 ? low : high) = middle;
  }
  return {(low + high) / 2, (high_slope - low_slope) / 4e-9L, found};
}

}  // namespace assembly_cell
