// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/locus_model.h"

#include <Eigen/LU>
#include <limits>

#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/validity.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::Vector3d;
constexpr double kPi = 3.14159265358979323846;
constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();
constexpr const char* kResonance = "undamped resonance: change w or give a damping";

void requireCase(const LocusCase& s) {
  requireNotNegative("F", s.F);
  requireNotNegative("w", s.w);
  requireFinite("alpha", s.alpha);
}

// K − I w² + icw, apart from an undamped resonance
Complex stiffness(double K, double I, double c, double w) {
  requirePositive("K", K);
  requireNotNegative("c", c);
  const Complex value(K - I * w * w, c * w);
  if (!(std::abs(value) > kRounding * K)) refuse("w", w, kResonance);
  return value;
}

Matrix3d skew(const Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

}  // namespace

PlanarLocus planarLocus(Complex P, Complex N) {
  PlanarLocus locus{P, N};
  const double p = std::abs(P), n = std::abs(N);
  locus.a = finiteResult("a", p + n);
  locus.b = p - n;
  locus.has_direction = std::min(p, n) > kRounding * std::max(p, n);
  if (locus.has_direction) {
    const double psi = std::remainder((std::arg(P) + std::arg(N)) / 2, kPi);
    locus.psi = psi < 0.0 ? psi + kPi : psi;
    if (locus.psi >= kPi) locus.psi = 0.0;
  }
  return locus;
}

PlanarLocus planarLocus(Complex A_r, Complex A_t, double alpha) {
  requireFinite("alpha", alpha);
  return planarLocus((A_r + A_t) / 2.0, std::conj(A_r - A_t) / 2.0 * std::polar(1.0, 2 * alpha));
}

PlanarLocus isotropicLocus(const LocusCase& s, double K, double c) {
  requireCase(s);
  const ContactInertia i = contactInertia(s.m, s.r, s.h);
  // one real rotation to the principal axes diagonalises stiffness, damping and inertia
  const double sb = std::sin(i.beta), cb = std::cos(i.beta);
  const double p = s.r * sb + 2 * s.h * cb, q = s.r * cb - 2 * s.h * sb;
  const Complex A_r = 2 * s.F * s.h * s.h / stiffness(K, i.Ix, c, s.w);
  const Complex A_t = s.F * (p * (s.h * cb + s.r * sb) / stiffness(K, i.Iy, c, s.w) +
                             q * (s.r * cb - s.h * sb) / stiffness(K, i.Iz, c, s.w));
  return planarLocus(A_r, A_t, s.alpha);
}

PlanarLocus transverseLocus(const LocusCase& s, double Kx, double Ky, double cx, double cy) {
  requireCase(s);
  const ContactInertia i = contactInertia(s.m, s.r, s.h);
  const double lever = 2 * s.F * s.h * s.h;
  return planarLocus(lever / stiffness(Kx, i.Ix, cx, s.w),
                     lever / stiffness(Ky, i.Iy_local, cy, s.w), s.alpha);
}

PlanarLocus verticalLocus(const LocusCase& s, double K, double c) {
  requireCase(s);
  const ContactInertia i = contactInertia(s.m, s.r, s.h);
  return planarLocus(0.0, s.F * s.r * s.r / stiffness(K, i.Iz_local, c, s.w), s.alpha);
}

PlanarLocus doubleContactLocus(const LocusCase& s, double d, double K, double c) {
  requireCase(s);
  const double I = chordInertia(s.m, s.r, s.h, d);
  return planarLocus(2 * s.F * s.h * s.h / stiffness(K, I, c, s.w), 0.0, s.alpha);
}

PlanarLocus slidingLocus(double m, double k, double F, double mu_N, double w) {
  requirePositive("m", m);
  requireNotNegative("k", k);
  requireNotNegative("mu_N", mu_N);
  requirePositive("w", w);
  if (!(F > mu_N) || !std::isfinite(F)) refuse("F", F, "give more than mu_N, else the peg sticks");
  const double stiff = k - m * w * w;
  if (!(std::abs(stiff) > kRounding * (k + m * w * w))) refuse("w", w, kResonance);
  // R e^{-if}: k R − m w² R along the force's drive, friction across
  const double drive = std::sqrt((F - mu_N) * (F + mu_N)), R = drive / std::abs(stiff);
  return planarLocus(std::polar(R, -std::atan2(mu_N, stiff * R)), 0.0);
}

PlanarLocus generalLocus(const LocusCase& s, double l, double hF, double g, const SupportMatrix& K6,
                         const SupportMatrix& C6) {
  requireCase(s);
  requireNotNegative("l", l);
  requireFinite("hF", hF);
  requireNotNegative("g", g);
  if (!K6.allFinite() || !C6.allFinite()) refuse("K6", K6.sum() + C6.sum(), "give finite numbers");
  const double centroid = centroidInertia(s.m, s.r, s.h);
  // from the contact to the centre of mass, the force and the support
  const Vector3d mass(-s.r * std::cos(s.alpha), -s.r * std::sin(s.alpha), s.h);
  const Vector3d force(mass.x(), mass.y(), hF), support(mass.x(), mass.y(), 2 * s.h + l);
  Eigen::Matrix<double, 6, 3> T;
  T << -skew(support), Matrix3d::Identity();
  Matrix3d K = T.transpose() * K6 * T;
  const Matrix3d C = T.transpose() * C6 * T;
  Matrix3d weight;
  weight << 2 * mass.z(), 0, -mass.x(), 0, 2 * mass.z(), -mass.y(), -mass.x(), -mass.y(), 0;
  K -= s.m * g / 2 * weight;
  Matrix3d I = Vector3d(centroid, centroid, s.m * s.r * s.r / 2).asDiagonal();
  I += s.m * (mass.squaredNorm() * Matrix3d::Identity() - mass * mass.transpose());
  Eigen::Matrix3cd system;
  system.real() = K - s.w * s.w * I;
  system.imag() = s.w * C;
  const Eigen::Vector3cd moment =
      skew(force).cast<Complex>() * Eigen::Vector3cd(s.F, Complex(0.0, -s.F), 0.0);
  // singular relative to its own size: a resonance, or a support that lets the peg turn
  const double size = system.cwiseAbs().maxCoeff();
  const Eigen::Matrix3cd inverse = (system / size).inverse();
  if (!(size > 0.0) || !inverse.allFinite() || inverse.cwiseAbs().maxCoeff() * kRounding > 1.0) {
    refuse("w", s.w, "singular: an undamped resonance or no stiffness, change w, K6 or C6");
  }
  const Eigen::Vector3cd motion = -skew(mass).cast<Complex>() * (inverse * moment / size);
  const Complex i(0.0, 1.0), x = motion.x(), y = motion.y();
  return planarLocus((x + i * y) / 2.0, std::conj(x - i * y) / 2.0);
}

}  // namespace assembly_cell
