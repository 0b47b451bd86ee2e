// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/locus_model.h"

#include <algorithm>
#include <limits>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/math/validity.h"
#include "assembly_cell/vibration/inertia.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;
using Eigen::Matrix3d;
using Eigen::Vector3d;
// Rounding of the sums below; the relative distance from a resonance by chance is above 1e-13.
constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();
constexpr const char* kSingular =
    "singular: an undamped resonance or no stiffness, change w, K6 or C6";
constexpr const char* kResonance = "undamped resonance: change w or give a damping";

void requireCase(const LocusCase& s) {
  requireNotNegative({{"F", s.F}, {"w", s.w}});
  requireFinite("alpha", s.alpha);
}

// K − I w² + icw; throws InputError at an undamped resonance.
Complex stiffness(double K, double I, double c, double w) {
  requirePositive("K", K);
  requireNotNegative("c", c);
  const Complex value(K - I * w * w, c * w);
  if (!(std::abs(value) > kRounding * K)) refuse("w", w, kResonance);
  return value;
}

// Matrix M of a support about the contact: T' M T with T = [−[support]; 1].
Matrix3d aboutContact(const SupportMatrix& M, const Vector3d& support) {
  // column by column: K T, then T' (K T)
  const auto forces = [&](int i, int j, int k, int row) {
    return Vector3d(support[j] * M(row, k) - support[k] * M(row, j) + M(row, 3 + i),
                    support[j] * M(row + 1, k) - support[k] * M(row + 1, j) + M(row + 1, 3 + i),
                    support[j] * M(row + 2, k) - support[k] * M(row + 2, j) + M(row + 2, 3 + i));
  };
  Matrix3d result;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    result.col(i) = support.cross(forces(i, j, k, 0)) + forces(i, j, k, 3);
  }
  return result;
}

// Complex vectors without the checks for infinities of std::complex products.
struct ComplexVector {
  Vector3d re, im;
  double squaredNorm() const { return re.squaredNorm() + im.squaredNorm(); }
};
ComplexVector cross(const ComplexVector& a, const ComplexVector& b) {
  return {a.re.cross(b.re) - a.im.cross(b.im), a.re.cross(b.im) + a.im.cross(b.re)};
}
Complex dot(const ComplexVector& a, const ComplexVector& b) {
  return {a.re.dot(b.re) - a.im.dot(b.im), a.re.dot(b.im) + a.im.dot(b.re)};
}

}  // namespace

PlanarLocus planarLocus(Complex P, Complex N) {
  PlanarLocus locus{P, N};
  const double p = std::abs(P), n = std::abs(N);
  locus.a = finiteResult("a", p + n);
  locus.b = p - n;
  locus.has_direction = std::min(p, n) > kRounding * std::max(p, n);
  if (locus.has_direction) {
    // half the angle of the product of both directions
    const double pr = P.real() / p, pi = P.imag() / p, nr = N.real() / n, ni = N.imag() / n;
    const double psi = std::atan2(pr * ni + pi * nr, pr * nr - pi * ni) / 2;
    locus.psi = psi < 0.0 ? psi + M_PI : psi;
    if (locus.psi >= M_PI) locus.psi = 0.0;
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
  requirePositive({{"m", m}, {"w", w}});
  requireNotNegative({{"k", k}, {"mu_N", mu_N}});
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
  requireNotNegative({{"l", l}, {"g", g}});
  requireFinite("hF", hF);
  const double centroid = centroidInertia(s.m, s.r, s.h), axial = s.m * s.r * s.r / 2;
  // from the contact to the centre of mass; force and support lie on the same axis
  const double x = -s.r * std::cos(s.alpha), y = -s.r * std::sin(s.alpha), z = s.h;
  const Vector3d support(x, y, 2 * s.h + l);
  Matrix3d real = aboutContact(K6, support), imag = s.w * aboutContact(C6, support);
  // stiffness − that of the weight − inertia about the contact times w²
  const double weight = s.m * g / 2, ww = s.w * s.w;
  real(0, 0) -= 2 * weight * z + ww * (centroid + s.m * (y * y + z * z));
  real(1, 1) -= 2 * weight * z + ww * (centroid + s.m * (x * x + z * z));
  real(2, 2) -= ww * (axial + s.m * (x * x + y * y));
  const double xy = ww * s.m * x * y, xz = (ww * s.m * z + weight) * x,
               yz = (ww * s.m * z + weight) * y;
  real(0, 1) += xy;
  real(1, 0) += xy;
  real(0, 2) += xz;
  real(2, 0) += xz;
  real(1, 2) += yz;
  real(2, 1) += yz;
  const double size = std::max(real.cwiseAbs().maxCoeff(), imag.cwiseAbs().maxCoeff());
  if (!std::isfinite(real.sum() + imag.sum())) {
    refuse("K6", K6.sum() + C6.sum(), "give finite numbers of comparable size");
  }
  if (!(size > 0.0)) refuse("w", s.w, kSingular);
  real *= 1.0 / size;
  imag *= 1.0 / size;
  // Cramer's rule; the force (F, −iF, 0) has the moment F (i hF, hF, −i x − y)
  const ComplexVector A{real.col(0), imag.col(0)}, B{real.col(1), imag.col(1)},
      C{real.col(2), imag.col(2)};
  const ComplexVector moment{s.F * Vector3d(0, hF, -y), s.F * Vector3d(hF, 0, -x)};
  const ComplexVector BC = cross(B, C), CA = cross(C, A), AB = cross(A, B);
  const Complex determinant = dot(A, BC);
  const double square = std::norm(determinant);
  const double largest = std::max({BC.squaredNorm(), CA.squaredNorm(), AB.squaredNorm()});
  // singular relative to its norm: a resonance, or a support with a free rotation
  if (!(largest * kRounding * kRounding < square)) refuse("w", s.w, kSingular);
  const double scale = 1.0 / (square * size);
  const auto solved = [&](const ComplexVector& cofactor) {
    const Complex n = dot(cofactor, moment);
    return Complex((n.real() * determinant.real() + n.imag() * determinant.imag()) * scale,
                   (n.imag() * determinant.real() - n.real() * determinant.imag()) * scale);
  };
  // motion = rotation × (x, y, z)
  const Complex about_x = solved(BC), about_y = solved(CA), about_z = solved(AB);
  const Complex u = about_y * z - about_z * y, v = about_z * x - about_x * z;
  return planarLocus(Complex(u.real() - v.imag(), u.imag() + v.real()) / 2.0,
                     Complex(u.real() + v.imag(), v.real() - u.imag()) / 2.0);
}

}  // namespace assembly_cell
