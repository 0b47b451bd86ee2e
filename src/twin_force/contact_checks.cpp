// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/twin_force/contact_checks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "likelihood.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using twin_force::Term;

// A verdict is given only if it is certain: half or twice (kSlant: at most 1) changes when, not
// which.
constexpr double kCertain = 20.0;      // sd of force: its direction is accurate to 3°
constexpr double kSlant = 0.70710678;  // cos 45°, halfway between right and no verdict at 90°
constexpr double kDeterminant = 3.0;   // sd
// Minimum cosine of the pair: with a nominal orientation within 90° its sign decides, less 3°, the
// accuracy of the directions of the forces.
constexpr double kSide = 0.05;

SignVerdict verdict(const Vector3d& force, double variance, const Vector3d& expected) {
  const double size = force.norm() * expected.norm();
  if (!(size > 0.0) || !(force.squaredNorm() > kCertain * kCertain * variance)) {
    return SignVerdict::kUndecided;
  }
  const double cosine = force.dot(expected) / size;
  if (!(std::abs(cosine) > kSlant)) return SignVerdict::kUndecided;
  return cosine > 0.0 ? SignVerdict::kRight : SignVerdict::kReversed;
}

double determinant(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  return a.dot(b.cross(c));
}

// Variance of a determinant for isotropic errors of its columns.
double determinantVariance(const Vector3d& a, const Vector3d& b, const Vector3d& c, double va,
                           double vb, double vc) {
  return va * b.cross(c).squaredNorm() + vb * c.cross(a).squaredNorm() +
         vc * a.cross(b).squaredNorm();
}

}  // namespace

SignCheck checkSigns(const TwinContact& contact, const Matrix3d& R_AB, const Vector3d& force_on_b) {
  const double var_a = twin_force::forceVariance(contact.covariance_a);
  const double var_b = twin_force::forceVariance(contact.covariance_b);
  const Vector3d F_A = contact.wrench_a.head<3>(), F_b = contact.wrench_b.head<3>();
  const Matrix3d R_Ab = R_AB * contact.move.R;
  SignCheck out;
  out.b = verdict(F_b, var_b, force_on_b);
  out.a = verdict(F_A, var_a, -(R_Ab * force_on_b));
  // the nominal orientation may be off by up to 90°: only the sign of the cosine is used
  const Vector3d back = -(R_Ab * F_b);
  if (F_A.squaredNorm() > kCertain * kCertain * var_a &&
      F_b.squaredNorm() > kCertain * kCertain * var_b) {
    const double cosine = F_A.dot(back) / (F_A.norm() * back.norm());
    if (std::abs(cosine) > kSide) {
      out.pair = cosine > 0.0 ? SignVerdict::kRight : SignVerdict::kReversed;
    }
  }
  return out;
}

SignVerdict checkSigns(const std::vector<TwinContact>& contacts) {
  // the triple with the most significant determinant on both sides
  double best = kDeterminant * kDeterminant;
  SignVerdict out = SignVerdict::kUndecided;
  const std::size_t n = contacts.size();
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      for (std::size_t k = j + 1; k < n; ++k) {
        const Term a = twin_force::bareTerm(contacts[i]), b = twin_force::bareTerm(contacts[j]),
                   c = twin_force::bareTerm(contacts[k]);
        const double on_a = determinant(a.F_A, b.F_A, c.F_A);
        const double on_b = determinant(a.F_B, b.F_B, c.F_B);
        const double clear = std::min(
            on_a * on_a /
                determinantVariance(a.F_A, b.F_A, c.F_A, a.var_force, b.var_force, c.var_force),
            on_b * on_b /
                determinantVariance(a.F_B, b.F_B, c.F_B, a.var_force, b.var_force, c.var_force));
        if (clear > best) {
          best = clear;
          // F_A = −R F_B: the determinant changes sign
          out = on_a * on_b < 0.0 ? SignVerdict::kRight : SignVerdict::kReversed;
        }
      }
    }
  }
  return out;
}

}  // namespace assembly_cell
