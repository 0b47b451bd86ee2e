// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "closed_forms.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace twin_force {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Minimum of the relative denominators, where errors of the forces are amplified tenfold. Twice
// refuses 23 more of 500 random sets of contacts.
constexpr double kThesisLimit = 0.1;
// The others were chosen for the geometries of docs/theory/twin_force.md; at half and twice the
// tests of test/twin_force reach the bound in each, unless stated otherwise.
constexpr double kThesisNoise =
    3.0;  // sd: length of a vector below which its direction is undefined
// Relative second singular value of the forces below which lines count as parallel (3°). At twice,
// couple pairs add the noise of moments to lines that forces resolve: the likelihood misses the
// bound.
constexpr double kCouplePairs = 0.05;
constexpr double kUnknownArm = 0.2;       // typical T before its estimate, arms of 30 to 140 mm [m]
constexpr double kTurnInformation = 9.0;  // minimum information, an sd of 1/3 rad [1/rad²]
constexpr double kShiftNoise = 9.0;       // over the expected value of noise: 3 sd
constexpr double kRounding = 1e-13;       // of eigenvalues, 500 times the machine epsilon

// Free vectors u = R v of two nearly parallel forces, Σ c F ≈ 0.
struct CouplePair {
  int i, k;
  double c_i, c_k;
  Vector3d u, v;
  double lever;  // variance of T × Σ c F, T unknown [N²·m²]
  double weight;
};

// Term with the largest force along the axis: partner of all others.
int partner(const std::vector<Term>& terms, const std::vector<int>& used, const Vector3d& axis) {
  return *std::max_element(used.begin(), used.end(), [&](int i, int k) {
    return std::abs(terms[static_cast<std::size_t>(i)].F_A.dot(axis)) <
           std::abs(terms[static_cast<std::size_t>(k)].F_A.dot(axis));
  });
}

CouplePair couplePair(const std::vector<Term>& terms, int i, int k, const Vector3d& axis) {
  const Term& a = terms[static_cast<std::size_t>(i)];
  const Term& b = terms[static_cast<std::size_t>(k)];
  CouplePair pair{i, k, b.F_A.dot(axis), -a.F_A.dot(axis), {}, {}, 0.0, 0.0};
  const double size = std::hypot(pair.c_i, pair.c_k);
  pair.c_i /= size;
  pair.c_k /= size;
  pair.u = pair.c_i * a.M_A + pair.c_k * b.M_A;
  pair.v = -(pair.c_i * a.M_B + pair.c_k * b.M_B);
  const auto mix = [&pair](double x, double y) {
    return pair.c_i * pair.c_i * x + pair.c_k * pair.c_k * y;
  };
  // forces that are not exactly parallel leave a resultant, beyond its noise, with an unknown lever
  const double left = (pair.c_i * a.F_A + pair.c_k * b.F_A).squaredNorm();
  pair.lever =
      kUnknownArm * kUnknownArm * std::max(0.0, left - 3.0 * mix(a.var_force, b.var_force));
  pair.weight = 1.0 / (mix(a.var_moment, b.var_moment) + pair.lever);
  return pair;
}

// [v]ᵀ[v] = v·v I − v vᵀ.
Matrix3d squaredCross(const Vector3d& v) {
  Matrix3d out = -v * v.transpose();
  out.diagonal().array() += v.squaredNorm();
  return out;
}

}  // namespace

RobustSolution solveRobust(const std::vector<Term>& terms, const std::vector<int>& used,
                           const Pose& start) {
  RobustSolution s;
  // R minimises Σ w |F_A + R F_B|²
  Matrix3d B = Matrix3d::Zero(), gram = Matrix3d::Zero();
  for (const int i : used) {
    const Term& t = terms[static_cast<std::size_t>(i)];
    B.noalias() -= (t.F_A / t.var_force) * t.F_B.transpose();
    gram.noalias() += t.F_A * t.F_A.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Matrix3d> forces;
  forces.computeDirect(gram);
  s.mean_axis = forces.eigenvectors().col(2);
  s.parallelism = std::sqrt(std::max(0.0, forces.eigenvalues()[1]) / forces.eigenvalues()[2]);

  // couples determine the rotation about parallel lines
  s.couple_pairs = s.parallelism < kCouplePairs;
  if (s.couple_pairs) {
    const int k = partner(terms, used, s.mean_axis);
    for (const int i : used) {
      if (i == k) continue;
      const CouplePair pair = couplePair(terms, i, k, s.mean_axis);
      B += pair.weight * pair.u * pair.v.transpose();
    }
  }
  const Eigen::JacobiSVD<Matrix3d> svd(B, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix3d& U = svd.matrixU();
  const Matrix3d& V = svd.matrixV();
  const double sign = U.determinant() * V.determinant() < 0.0 ? -1.0 : 1.0;
  Matrix3d R = U * Vector3d(1.0, 1.0, sign).asDiagonal() * V.transpose();

  // rotation about the axis of the first singular value: information s2 + s3
  const Vector3d axis = U.col(0);
  const double turn_information = svd.singularValues()[1] + sign * svd.singularValues()[2];
  s.turn_known = turn_information > kTurnInformation;
  if (!s.turn_known) {
    // nearest to the start
    const Matrix3d M = R * start.R.transpose();
    const Matrix3d cross = skew(axis);
    const double psi = std::atan2((cross * M).trace(), M.trace() - axis.dot(M * axis));
    R = Eigen::AngleAxisd(psi, axis) * R;
  }
  // inverse of Hessian tr(D) I − D, D = U S' Uᵀ
  Vector3d h(turn_information, svd.singularValues()[0] + sign * svd.singularValues()[2],
             svd.singularValues()[0] + svd.singularValues()[1]);
  Vector3d inverse = h.cwiseInverse();
  if (!s.turn_known) inverse[0] = 0.0;
  s.turn_inverse = U * inverse.asDiagonal() * U.transpose();
  s.pose.R = R;
  solveTranslation(terms, used, start.p, s);
  return s;
}

void solveTranslation(const std::vector<Term>& terms, const std::vector<int>& used,
                      const Vector3d& start, RobustSolution& out) {
  const Matrix3d& R = out.pose.R;
  // −[F̂] T = M, weighted; F̂ from both sensors
  Matrix3d normal = Matrix3d::Zero();
  Vector3d rhs = Vector3d::Zero();
  double noise = 0.0;
  for (const int i : used) {
    const Term& t = terms[static_cast<std::size_t>(i)];
    const Vector3d f = 0.5 * (t.F_A - R * t.F_B);
    const Vector3d h = t.M_A + R * t.M_B - start.cross(f);
    const double weight = 1.0 / t.var_moment;
    normal += weight * squaredCross(f);
    rhs += weight * f.cross(h);  // (−[f])ᵀ h
    noise += weight * 0.5 * t.var_force;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(normal);
  const Vector3d& values = eigen.eigenvalues();
  const double limit = std::max(kRounding * values[2], kShiftNoise * noise);
  Vector3d inverse = Vector3d::Zero();
  out.dropped_count = 0;
  for (int k = 0; k < 3; ++k) {
    if (values[k] > limit) {
      inverse[k] = 1.0 / values[k];
    } else {
      out.dropped.col(out.dropped_count++) = eigen.eigenvectors().col(k);
    }
  }
  out.shift_inverse =
      eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
  out.pose.p = start + out.shift_inverse * rhs;
}

Matrix6 robustCovariance(const std::vector<Term>& terms, const std::vector<int>& used,
                         const RobustSolution& s) {
  const Pose& X = s.pose;
  const Matrix3d cross_T = skew(X.p);
  const int k = s.couple_pairs ? partner(terms, used, s.mean_axis) : -1;
  // derivative of the translation by the rotation: −N⁺ Σ w [f]ᵀ (−[m] + ½[T][f])
  Matrix3d turn_to_shift = Matrix3d::Zero();
  Matrix3d partner_gain = Matrix3d::Zero(), lever = Matrix3d::Zero();
  for (const int i : used) {
    const Term& t = terms[static_cast<std::size_t>(i)];
    const Matrix3d cross_f = skew(0.5 * (t.F_A - X.R * t.F_B));
    turn_to_shift +=
        1.0 / t.var_moment * cross_f.transpose() * (-skew(X.R * t.M_B) + 0.5 * cross_T * cross_f);
    if (k >= 0 && i != k) {
      const CouplePair pair = couplePair(terms, i, k, s.mean_axis);
      partner_gain += pair.c_k * pair.weight * skew(pair.u).transpose();
      lever += pair.weight * pair.weight * pair.lever * squaredCross(pair.u);
    }
  }
  turn_to_shift = (-s.shift_inverse * turn_to_shift).eval();

  Eigen::Matrix<double, 6, 3> from_turn;
  from_turn << turn_to_shift * s.turn_inverse, s.turn_inverse;
  Matrix6 P = from_turn * lever * from_turn.transpose();
  for (const int i : used) {
    const Term& t = terms[static_cast<std::size_t>(i)];
    const Matrix3d cross_f = skew(0.5 * (t.F_A - X.R * t.F_B));
    Matrix6 gain = Matrix6::Zero();  // −δ per residual
    gain.bottomLeftCorner<3, 3>() = 1.0 / t.var_force * s.turn_inverse * cross_f.transpose();
    if (k >= 0) {
      Matrix3d couple = partner_gain;
      if (i != k) {
        const CouplePair pair = couplePair(terms, i, k, s.mean_axis);
        couple = pair.c_i * pair.weight * skew(pair.u).transpose();
      }
      gain.bottomRightCorner<3, 3>() = s.turn_inverse * couple;
    }
    const Matrix3d shift = 1.0 / t.var_moment * s.shift_inverse * cross_f.transpose();
    gain.topLeftCorner<3, 3>() =
        -0.5 * shift * cross_T + turn_to_shift * gain.bottomLeftCorner<3, 3>();
    gain.topRightCorner<3, 3>() = shift + turn_to_shift * gain.bottomRightCorner<3, 3>();
    P += gain * residualCovariance(t, X) * gain.transpose();
  }
  return 0.5 * (P + P.transpose());
}

bool solveThesis(const Term& first, const Term& second, Pose& pose,
                 Eigen::Matrix<double, 6, 12>& slope) {
  // g × a = b, 10.3–10.5
  const Vector3d a2 = second.F_A - second.F_B;
  const Vector3d b1 = first.F_A + first.F_B, b2 = second.F_A + second.F_B;
  const double d = a2.dot(b1);
  const double noise_b = 3.0 * kThesisNoise * kThesisNoise;
  if (!(d * d > kThesisLimit * kThesisLimit * a2.squaredNorm() * b1.squaredNorm()) ||
      !(b1.squaredNorm() > noise_b * first.var_force) ||
      !(b2.squaredNorm() > noise_b * second.var_force)) {
    return false;
  }
  const Vector3d g = b1.cross(b2) / d;
  const Matrix3d cross = skew(g);
  pose.R = Matrix3d::Identity() + 2.0 / (1.0 + g.squaredNorm()) * (cross + cross * cross);
  // T × F_A = M, 10.6 and 10.10
  const Vector3d m1 = pose.R * first.M_B, m2 = pose.R * second.M_B;
  const Vector3d M1 = first.M_A + m1, M2 = second.M_A + m2;
  const double e = second.F_A.dot(M1);
  if (!(e * e > kThesisLimit * kThesisLimit * second.F_A.squaredNorm() * M1.squaredNorm()) ||
      !(M1.squaredNorm() > noise_b * first.var_moment)) {
    return false;
  }
  pose.p = M1.cross(M2) / e;

  // dg, dφ = 2/(1 + g²) (dg + g × dg)
  Eigen::Matrix<double, 3, 12> dg = Eigen::Matrix<double, 3, 12>::Zero();
  dg.block<3, 3>(0, 0) = (-skew(b2) - g * a2.transpose()) / d;
  dg.block<3, 3>(0, 6) = (skew(b1) - g * b1.transpose()) / d;
  const Eigen::Matrix<double, 3, 12> dphi =
      2.0 / (1.0 + g.squaredNorm()) * (Matrix3d::Identity() + cross) * dg;
  Eigen::Matrix<double, 3, 12> dM1 = -skew(m1) * dphi, dM2 = -skew(m2) * dphi;
  dM1.block<3, 3>(0, 3) += Matrix3d::Identity();
  dM2.block<3, 3>(0, 9) += Matrix3d::Identity();
  Eigen::Matrix<double, 1, 12> de = second.F_A.transpose() * dM1;
  de.segment<3>(6) += M1.transpose();
  slope.topRows<3>() = (skew(M1) * dM2 - skew(M2) * dM1 - pose.p * de) / e;
  slope.bottomRows<3>() = dphi;
  return true;
}

}  // namespace twin_force

}  // namespace assembly_cell
