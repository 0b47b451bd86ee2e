// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Shared by the estimators: a contact transformed to the reference, its likelihood, the normal
// equations.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {
namespace twin_force {

/// A contact at the reference: w_B = Φ(X_Bb) w_b, its covariance including that of the move.
struct Term {
  Eigen::Vector3d F_A, M_A, F_B, M_B;
  Matrix6 cov_a;
  Matrix6 cov_b;            ///< Σ_B + J_x Σ_x J_xᵀ
  Pose move;                ///< X_Bb
  double var_force = 0.0;   ///< variance of one component, σ_A² + σ_B² [N²]
  double var_moment = 0.0;  ///< the same of the moments [N²·m²]
};
Term makeTerm(const TwinContact& contact);
/// makeTerm() without covariances, for the closed forms.
Term bareTerm(const TwinContact& contact);

/// Mean variance of one force component of a wrench covariance. [N²]
inline double forceVariance(const Matrix6& c) { return c.topLeftCorner<3, 3>().trace() / 3.0; }

/// −2 log likelihood and its Gauss–Helmert normal equations in δ.
struct Normal {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();  ///< half of dQ/dδ
  double chi2 = 0.0;
};

/// Residual, its covariance and the adjusted wrench of one term at (R, T), whitened.
struct Whitened {
  Eigen::Matrix3d inv_f;               ///< La⁻¹ of C = L Lᵀ in blocks
  Eigen::Matrix3d inv_m;               ///< Ls⁻¹
  Eigen::Matrix3d K;                   ///< C_mf La⁻ᵀ
  Eigen::Vector3d lambda_f, lambda_m;  ///< C⁻¹ r
  Eigen::Vector3d f, m;                ///< adjusted R F_B, R M_B in axes of A
  double chi2;
};
/// offset: (o_A, o_b) of both wrenches, or null.
Whitened whiten(const Term& term, const Eigen::Matrix3d& R, const Eigen::Vector3d& T,
                const Vector12* offset = nullptr);

/// Covariance C of the residual at (R, T).
Matrix6 residualCovariance(const Term& term, const Pose& X_AB);

/// J = d(Φ w_B)/dδ for f = R F_B, m = R M_B.
Matrix6 wrenchJacobian(const Eigen::Vector3d& f, const Eigen::Vector3d& m,
                       const Eigen::Vector3d& T);

/// Adds one whitened term.
void add(const Whitened& w, const Eigen::Vector3d& T, Normal& normal);

/// Adds a prior: e = (T − T₀, log(R R₀ᵀ)), J = diag(I, J_l⁻¹). `weight` is P₀⁻¹.
void add(const Pose& prior, const Matrix6& weight, const Pose& X_AB, Normal& normal);

/// Tare offset o = L z, z ~ N(0, I), eliminated from the normal equations.
struct TareState {
  Matrix12 L = Matrix12::Zero();
  Vector12 z = Vector12::Zero();
  // normal equations of the last assembly
  Matrix12 N_zz;
  Eigen::Matrix<double, 6, 12> N_dz;
  Vector12 g_z;
};
/// L of the options' tare offset, semidefinite; zero without one.
Matrix12 tareRoot(const TwinForceOptions& options);
void begin(TareState& tare);
void add(const Term& term, const Whitened& w, const Pose& X_AB, TareState& tare);
void eliminate(TareState& tare, Normal& normal);             ///< Schur complement on normal
Vector12 tareStep(const TareState& tare, const Vector6& d);  ///< step of z for δ = d

/// Errors of both sensors and the tare offset as unknowns u ~ N(0, I), eliminated in the same way.
/// The offset of (w_A, w_b) of contact i is columns[i] u, to first order in the errors.
using ErrorColumns = Eigen::Matrix<double, 12, Eigen::Dynamic>;
struct ErrorState {
  std::vector<ErrorColumns> columns;  ///< derivatives of each term
  Eigen::VectorXd u;
  // normal equations of the last assembly
  Eigen::MatrixXd N_uu;
  Eigen::Matrix<double, 6, Eigen::Dynamic> N_du;
  Eigen::VectorXd g_u;
  Eigen::LLT<Eigen::MatrixXd> factor;  ///< Cholesky factor of N_uu, after eliminate()
};
/// Factors L of C = L Lᵀ of the covariances common to all contacts: tare and each gain_covariance.
struct ErrorRoots {
  Matrix12 tare = Matrix12::Zero();
  Eigen::MatrixXd gain_a, gain_b;  ///< 0 × 0: none
};
ErrorRoots errorRoots(const TwinForceOptions& options);
/// Derivatives of a contact's wrenches by the unknowns.
ErrorColumns errorColumns(const TwinErrors& errors, const ErrorRoots& roots,
                          const Vector6& wrench_a, const Vector6& wrench_b);
void begin(ErrorState& state);
void add(const Term& term, std::size_t index, const Whitened& w, const Pose& X_AB,
         ErrorState& state);
void eliminate(ErrorState& state, Normal& normal);
Eigen::VectorXd errorStep(const ErrorState& state, const Vector6& d);
/// dr/du of a contact at (R, T).
Eigen::Matrix<double, 6, Eigen::Dynamic> errorJacobian(const ErrorColumns& columns,
                                                       const Pose& move, const Pose& X_AB);

/// Inverse of the lower Cholesky factor of a 3×3; false if not positive definite.
bool inverseFactor(const Eigen::Matrix3d& c, Eigen::Matrix3d& inverse);

/// exp([dphi]) as a quaternion, exact for all sizes.
Eigen::Quaterniond turn(const Eigen::Vector3d& dphi);

/// Eigenvalues below this of Λ = S I S are not observable.
constexpr double kUnobservable = 1e-6;

/// Step −Λ⁺ g over the observable directions. scale: diagonal of S.
Vector6 solveObservable(const Normal& normal, const Vector6& scale);

}  // namespace twin_force
}  // namespace assembly_cell
