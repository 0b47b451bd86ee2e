// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "likelihood.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace assembly_cell {
namespace twin_force {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// [v] M and M [v]ᵀ column by column, cheaper than products with skew(v).
Matrix3d crossFromLeft(const Vector3d& v, const Matrix3d& M) {
  Matrix3d out;
  for (int k = 0; k < 3; ++k) out.col(k) = v.cross(M.col(k));
  return out;
}

Matrix3d crossFromRight(const Matrix3d& M, const Vector3d& v) {
  Matrix3d out;
  out.col(0) = M.col(1) * -v.z() + M.col(2) * v.y();
  out.col(1) = M.col(0) * v.z() - M.col(2) * v.x();
  out.col(2) = M.col(1) * v.x() - M.col(0) * v.y();
  return out;
}

// Blocks of Φ Σ Φᵀ + Σ_A, and of R Σ Rᵀ.
struct Blocks {
  Matrix3d rotated_ff, rotated_mf, rotated_mm;
  Matrix3d ff, mf, mm;
};

void carry(const Matrix6& cov_b, const Matrix6& cov_a, const Matrix3d& R, const Vector3d& T,
           Blocks& out) {
  const Matrix3d Rt = R.transpose();
  out.rotated_ff.noalias() = R * cov_b.topLeftCorner<3, 3>().lazyProduct(Rt).eval();
  out.rotated_mf.noalias() = R * cov_b.bottomLeftCorner<3, 3>().lazyProduct(Rt).eval();
  out.rotated_mm.noalias() = R * cov_b.bottomRightCorner<3, 3>().lazyProduct(Rt).eval();
  const Matrix3d mf = out.rotated_mf + crossFromLeft(T, out.rotated_ff);
  out.mm = cov_a.bottomRightCorner<3, 3>() + out.rotated_mm +
           crossFromLeft(T, out.rotated_mf.transpose()) + crossFromRight(mf, T);
  out.ff = cov_a.topLeftCorner<3, 3>() + out.rotated_ff;
  out.mf = cov_a.bottomLeftCorner<3, 3>() + mf;
}

}  // namespace

bool inverseFactor(const Matrix3d& c, Matrix3d& inverse) {
  if (!(c(0, 0) > 0.0)) return false;
  const double i00 = 1.0 / std::sqrt(c(0, 0));
  const double l10 = c(1, 0) * i00, l20 = c(2, 0) * i00;
  const double d1 = c(1, 1) - l10 * l10;
  if (!(d1 > 0.0)) return false;
  const double i11 = 1.0 / std::sqrt(d1);
  const double l21 = (c(2, 1) - l20 * l10) * i11;
  const double d2 = c(2, 2) - l20 * l20 - l21 * l21;
  if (!(d2 > 0.0)) return false;
  const double i22 = 1.0 / std::sqrt(d2);
  const double i10 = -l10 * i00 * i11;
  inverse << i00, 0.0, 0.0, i10, i11, 0.0, -(l20 * i00 + l21 * i10) * i22, -l21 * i11 * i22, i22;
  return true;
}

Eigen::Quaterniond turn(const Vector3d& dphi) {
  const double half = 0.5 * dphi.norm();
  // sin(x)/x to rounding below 1e-4
  const double s = half < 1e-4 ? 0.5 * (1.0 - half * half / 6.0) : 0.5 * std::sin(half) / half;
  return {std::cos(half), s * dphi.x(), s * dphi.y(), s * dphi.z()};
}

Matrix6 wrenchJacobian(const Vector3d& f, const Vector3d& m, const Vector3d& T) {
  Matrix6 J;
  J.topLeftCorner<3, 3>().setZero();
  J.topRightCorner<3, 3>() = -skew(f);
  J.bottomLeftCorner<3, 3>() = -skew(f);
  J.bottomRightCorner<3, 3>() = -skew(m) - skew(T) * skew(f);
  return J;
}

Term bareTerm(const TwinContact& contact) {
  Term t;
  t.F_A = contact.wrench_a.head<3>();
  t.M_A = contact.wrench_a.tail<3>();
  t.F_B.noalias() = contact.move.R * contact.wrench_b.head<3>();
  t.M_B.noalias() = contact.move.R * contact.wrench_b.tail<3>();
  t.M_B += contact.move.p.cross(t.F_B);
  t.var_force = forceVariance(contact.covariance_a) + forceVariance(contact.covariance_b);
  t.var_moment = (contact.covariance_a.diagonal().tail<3>().sum() +
                  contact.covariance_b.diagonal().tail<3>().sum()) /
                 3.0;
  return t;
}

Term makeTerm(const TwinContact& contact) {
  Term t = bareTerm(contact);
  t.cov_a = contact.covariance_a;
  t.move = contact.move;
  Blocks b;
  carry(contact.covariance_b, Matrix6::Zero(), contact.move.R, contact.move.p, b);
  t.cov_b << b.ff, b.mf.transpose(), b.mf, b.mm;
  if (contact.move_covariance) {
    Matrix6 J;
    J << Matrix3d::Zero(), -skew(t.F_B), -skew(t.F_B), -skew(t.M_B);
    t.cov_b += J * *contact.move_covariance * J.transpose();
    t.var_force = forceVariance(t.cov_a) + forceVariance(t.cov_b);
  }
  return t;
}

Matrix6 residualCovariance(const Term& term, const Pose& X_AB) {
  Blocks b;
  carry(term.cov_b, term.cov_a, X_AB.R, X_AB.p, b);
  Matrix6 C;
  C << b.ff, b.mf.transpose(), b.mf, b.mm;
  return C;
}

Whitened whiten(const Term& term, const Matrix3d& R, const Vector3d& T, const Vector12* offset) {
  Whitened w;
  w.f.noalias() = R * term.F_B;
  w.m.noalias() = R * term.M_B;
  Vector3d F_A = term.F_A, M_A = term.M_A;
  if (offset != nullptr) {
    F_A -= offset->head<3>();
    M_A -= offset->segment<3>(3);
    const Vector6 o_B = transformWrench(term.move, offset->tail<6>());
    w.f -= R * o_B.head<3>();
    w.m -= R * o_B.tail<3>();
  }
  const Vector3d r_f = F_A + w.f;
  const Vector3d r_m = M_A + w.m + T.cross(w.f);

  // C = L Lᵀ in 3×3 blocks; positive definite by the check of its parts
  Blocks b;
  carry(term.cov_b, term.cov_a, R, T, b);
  const bool definite_f = inverseFactor(b.ff, w.inv_f);
  w.K.noalias() = b.mf.lazyProduct(w.inv_f.transpose());
  const Matrix3d S = b.mm - w.K.lazyProduct(w.K.transpose()).eval();
  if (!inverseFactor(S, w.inv_m) || !definite_f) {
    // a pose so far away that the covariance of the moments is lost in rounding
    w.inv_f.setZero();
    w.inv_m.setZero();
    w.K.setZero();
    w.lambda_f.setZero();
    w.lambda_m.setZero();
    w.chi2 = std::numeric_limits<double>::infinity();
    return w;
  }

  // C⁻¹ r and the adjusted wrench of B
  const Vector3d y_f = w.inv_f * r_f;
  const Vector3d y_m = w.inv_m * (r_m - w.K * y_f);
  w.chi2 = y_f.squaredNorm() + y_m.squaredNorm();
  w.lambda_m.noalias() = w.inv_m.transpose() * y_m;
  w.lambda_f.noalias() = w.inv_f.transpose() * (y_f - w.K.transpose() * w.lambda_m);
  const Vector3d pulled = w.lambda_f - T.cross(w.lambda_m);
  w.f -= b.rotated_ff * pulled + b.rotated_mf.transpose() * w.lambda_m;
  w.m -= b.rotated_mf * pulled + b.rotated_mm * w.lambda_m;
  return w;
}

void add(const Whitened& w, const Vector3d& T, Normal& normal) {
  normal.chi2 += w.chi2;
  // g = Jᵀ C⁻¹ r
  normal.gradient.head<3>() += w.f.cross(w.lambda_m);
  normal.gradient.tail<3>() += w.f.cross(w.lambda_f - T.cross(w.lambda_m)) + w.m.cross(w.lambda_m);
  // L⁻¹ J with −[f] = [f]ᵀ
  const Matrix3d turn_f = crossFromRight(w.inv_f, w.f);
  const Matrix3d shift_m = crossFromRight(w.inv_m, w.f);
  // −[m] − [T][f] = −[m] − f Tᵀ + (T·f) I
  Matrix3d J_m = -skew(w.m);
  J_m -= w.f * T.transpose();
  J_m.diagonal().array() += T.dot(w.f);
  J_m -= w.K.lazyProduct(turn_f).eval();
  Matrix3d turn_m;
  turn_m.noalias() = w.inv_m.lazyProduct(J_m);
  normal.information.topLeftCorner<3, 3>() += shift_m.transpose().lazyProduct(shift_m);
  normal.information.bottomLeftCorner<3, 3>() += turn_m.transpose().lazyProduct(shift_m);
  normal.information.bottomRightCorner<3, 3>() +=
      turn_f.transpose().lazyProduct(turn_f) + turn_m.transpose().lazyProduct(turn_m);
}

void add(const Pose& prior, const Matrix6& weight, const Pose& X_AB, Normal& normal) {
  Vector6 e;
  e.head<3>() = X_AB.p - prior.p;
  const Vector3d phi = vectorFromRotation(X_AB.R * prior.R.transpose()).value;
  e.tail<3>() = phi;
  // J_l⁻¹ = I − ½[φ] + c [φ]², finite at θ = π
  const double theta = phi.norm();
  const double c = theta < 1e-3 ? 1.0 / 12.0 + theta * theta / 720.0
                                : (1.0 - 0.5 * theta / std::tan(0.5 * theta)) / (theta * theta);
  Matrix6 J = Matrix6::Identity();
  const Matrix3d cross = skew(phi);
  J.bottomRightCorner<3, 3>() += -0.5 * cross + c * cross * cross;
  const Vector6 we = weight * e;
  normal.chi2 += e.dot(we);
  normal.gradient += J.transpose() * we;
  normal.information += J.transpose() * weight * J;
}

Matrix12 tareRoot(const TwinForceOptions& options) {
  if (!options.tare_covariance) return Matrix12::Zero();
  const Eigen::SelfAdjointEigenSolver<Matrix12> eigen(*options.tare_covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

void begin(TareState& tare) {
  tare.N_zz.setIdentity();
  tare.N_dz.setZero();
  tare.g_z = tare.z;
}

void add(const Term& term, const Whitened& w, const Pose& X_AB, TareState& tare) {
  // r changes by −o_A − Φ(X) Φ(X_Bb) o_b
  Eigen::Matrix<double, 6, 12> J_z;
  J_z.noalias() = -tare.L.topRows<6>();
  J_z.noalias() -= wrenchTransform(X_AB * term.move) * tare.L.bottomRows<6>();
  Matrix6 whitener;
  whitener << w.inv_f, Matrix3d::Zero(), -w.inv_m * w.K * w.inv_f, w.inv_m;
  const Matrix6 J = whitener * wrenchJacobian(w.f, w.m, X_AB.p);
  const Eigen::Matrix<double, 6, 12> white_z = whitener * J_z;
  Vector6 lambda;
  lambda << w.lambda_f, w.lambda_m;
  tare.N_zz.noalias() += white_z.transpose() * white_z;
  tare.N_dz.noalias() += J.transpose() * white_z;
  tare.g_z.noalias() += J_z.transpose() * lambda;
}

void eliminate(TareState& tare, Normal& normal) {
  const Eigen::LLT<Matrix12> factor(tare.N_zz);
  const Eigen::Matrix<double, 12, 6> solved = factor.solve(tare.N_dz.transpose());
  normal.information -= tare.N_dz * solved;
  normal.gradient -= solved.transpose() * tare.g_z;
  normal.chi2 += tare.z.squaredNorm();
}

Vector12 tareStep(const TareState& tare, const Vector6& d) {
  const Vector12 rhs = -(tare.g_z + tare.N_dz.transpose() * d);
  return Eigen::LLT<Matrix12>(tare.N_zz).solve(rhs);
}

Vector6 solveObservable(const Normal& normal, const Vector6& scale) {
  const Matrix6 scaled = scale.asDiagonal() *
                         Matrix6(normal.information.selfadjointView<Eigen::Lower>()) *
                         scale.asDiagonal();
  const Vector6 g = scale.cwiseProduct(normal.gradient);
  // Cholesky decomposition in 3×3 blocks if no pivot is near the limit
  Matrix3d inv_t, inv_s;
  const Matrix3d A = scaled.topLeftCorner<3, 3>(), B = scaled.bottomLeftCorner<3, 3>();
  if (inverseFactor(A, inv_t)) {
    Matrix3d K;
    K.noalias() = B.lazyProduct(inv_t.transpose());
    const Matrix3d S = scaled.bottomRightCorner<3, 3>() - K.lazyProduct(K.transpose()).eval();
    if (inverseFactor(S, inv_s)) {
      const double largest = std::max(inv_t.cwiseAbs().maxCoeff(), inv_s.cwiseAbs().maxCoeff());
      if (largest * largest < 0.01 / kUnobservable) {
        const Vector3d y_t = inv_t * g.head<3>();
        const Vector3d y_s = inv_s * (g.tail<3>() - K * y_t);
        Vector6 d;
        d.tail<3>() = -(inv_s.transpose() * y_s);
        d.head<3>() = -(inv_t.transpose() * (y_t + K.transpose() * d.tail<3>()));
        return scale.cwiseProduct(d);
      }
    }
  }
  // no step in unobservable directions
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(scaled);
  Vector6 d = Vector6::Zero();
  for (int k = 0; k < 6; ++k) {
    if (eigen.eigenvalues()[k] < kUnobservable) continue;
    const auto v = eigen.eigenvectors().col(k);
    d -= v * (v.dot(g) / eigen.eigenvalues()[k]);
  }
  return scale.cwiseProduct(d);
}

}  // namespace twin_force
}  // namespace assembly_cell
