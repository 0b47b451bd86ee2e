// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Errors of both sensors as unknowns of the likelihood.
#include <cmath>

#include "likelihood.h"

namespace assembly_cell {
namespace twin_force {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kTare = 12;              // unknowns of the common offset
constexpr int kGain = 36, kFrame = 6;  // and of each sensor
constexpr int kUnknowns = kTare + 2 * (kGain + kFrame);

constexpr double kSemidefinite =
    1e-12;  // relative pivot of a correlation matrix that may be singular

// L of C = L Lᵀ for a semidefinite C with any units, from the correlations.
MatrixXd rootOf(const MatrixXd& covariance) {
  if (covariance.size() == 0) return {};
  const VectorXd sd = covariance.diagonal().cwiseSqrt();
  MatrixXd correlation = MatrixXd::Identity(sd.size(), sd.size());
  for (Eigen::Index i = 0; i < sd.size(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      if (sd[i] > 0.0 && sd[j] > 0.0) correlation(i, j) = covariance(i, j) / (sd[i] * sd[j]);
    }
    correlation(i, i) += kSemidefinite * static_cast<double>(sd.size());
  }
  return sd.asDiagonal() * MatrixXd(correlation.llt().matrixL());
}

// Derivatives of a wrench in the datum's axes by the errors of its sensor.
Eigen::Matrix<double, 6, kGain + kFrame> sensorColumns(const SensorErrors& e, const MatrixXd& root,
                                                       const Vector6& w) {
  const Vector6 local = transformWrench(inverse(e.frame), w);
  Vector6 arms;
  arms << Vector3d::Ones(), Vector3d::Constant(e.arm);
  Eigen::Matrix<double, 6, kGain + kFrame> out;
  out.setZero();
  for (int row = 0; row < 6; ++row) {
    if (root.size() > 0) {
      out.row(row).head<kGain>().noalias() = local.transpose() * root.middleRows<6>(6 * row);
      continue;
    }
    for (int col = 0; col < 6; ++col) {
      out(row, 6 * row + col) = e.gain * arms[row] * local[col] / arms[col];
    }
  }
  const Vector3d F = local.head<3>(), M = local.tail<3>();
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d unit = Vector3d::Unit(axis);
    out.col(kGain + axis) << e.rotation * unit.cross(F), e.rotation * unit.cross(M);
    out.col(kGain + 3 + axis) << Vector3d::Zero(), e.offset * unit.cross(F);
  }
  return wrenchTransform(e.frame) * out;
}

}  // namespace

ErrorRoots errorRoots(const TwinForceOptions& options) {
  ErrorRoots roots{tareRoot(options), {}, {}};
  if (!options.errors) return roots;
  roots.gain_a = rootOf(options.errors->a.gain_covariance);
  roots.gain_b = rootOf(options.errors->b.gain_covariance);
  return roots;
}

ErrorColumns errorColumns(const TwinErrors& errors, const ErrorRoots& roots,
                          const Vector6& wrench_a, const Vector6& wrench_b) {
  ErrorColumns out = ErrorColumns::Zero(12, kUnknowns);
  out.leftCols<kTare>() = roots.tare;
  out.block<6, kGain + kFrame>(0, kTare) = sensorColumns(errors.a, roots.gain_a, wrench_a);
  out.block<6, kGain + kFrame>(6, kTare + kGain + kFrame) =
      sensorColumns(errors.b, roots.gain_b, wrench_b);
  return out;
}

Eigen::Matrix<double, 6, Eigen::Dynamic> errorJacobian(const ErrorColumns& columns,
                                                       const Pose& move, const Pose& X_AB) {
  // r changes by −o_A − Φ(X) Φ(X_Bb) o_b
  Eigen::Matrix<double, 6, Eigen::Dynamic> J = -columns.topRows<6>();
  J.noalias() -= wrenchTransform(X_AB * move) * columns.bottomRows<6>();
  return J;
}

void begin(ErrorState& state) {
  const Eigen::Index n = state.u.size();
  state.N_uu.setIdentity(n, n);
  state.N_du.setZero(6, n);
  state.g_u = state.u;
}

void add(const Term& term, std::size_t index, const Whitened& w, const Pose& X_AB,
         ErrorState& state) {
  const Eigen::Matrix<double, 6, Eigen::Dynamic> J_u =
      errorJacobian(state.columns[index], term.move, X_AB);
  Matrix6 whitener;
  whitener << w.inv_f, Eigen::Matrix3d::Zero(), -w.inv_m * w.K * w.inv_f, w.inv_m;
  const Matrix6 J = whitener * wrenchJacobian(w.f, w.m, X_AB.p);
  const Eigen::Matrix<double, 6, Eigen::Dynamic> white_u = whitener * J_u;
  Vector6 lambda;
  lambda << w.lambda_f, w.lambda_m;
  state.N_uu.noalias() += white_u.transpose() * white_u;
  state.N_du.noalias() += J.transpose() * white_u;
  state.g_u.noalias() += J_u.transpose() * lambda;
}

void eliminate(ErrorState& state, Normal& normal) {
  state.factor.compute(state.N_uu);
  const MatrixXd solved = state.factor.solve(state.N_du.transpose());
  normal.information -= state.N_du * solved;
  normal.gradient -= solved.transpose() * state.g_u;
  normal.chi2 += state.u.squaredNorm();
}

VectorXd errorStep(const ErrorState& state, const Vector6& d) {
  const VectorXd rhs = -(state.g_u + state.N_du.transpose() * d);
  return state.factor.solve(rhs);
}

}  // namespace twin_force
}  // namespace assembly_cell
