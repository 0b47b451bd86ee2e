// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/calibration/two_sensor/force.h"

namespace assembly_cell {

// matrices of one test, at most 6 × 6
using Small = Eigen::MatrixXd;
using SmallVector = Eigen::VectorXd;

/// A zero that several tests share: an unknown with a prior.
struct ZeroPart {
  int index = -1;  ///< of the unknown; six numbers each
  double weight = 0.0;
};

/// One sensor's part of a test: K S b(strain).
struct SensorPart {
  bool present = false;
  Small K;                               ///< equations × rows
  Vector6 strain = Vector6::Zero();      ///< reading − zero [V]
  Matrix6 covariance = Matrix6::Zero();  ///< of the strain without the shared zeros
  std::array<ZeroPart, 2> zeros;
};

/// K_a S_A b(a) + K_b S_B b(b) = known.
struct ForceTest {
  std::size_t observation = 0;
  ObservationKind kind = ObservationKind::kReacting;
  int equations = 0;
  PerSide<SensorPart> part;
  SmallVector known;
  Small reference;  ///< covariance of what the strains are compared with; reacting: see pose
  Pose X_AB;
  Matrix6 pose_covariance = Matrix6::Zero();  ///< (dp, dφ)
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  double point_variance = 0.0;
  bool used = true;
};

struct ForceSystem {
  int rows = 6;
  std::vector<ForceTest> tests;
  std::vector<Matrix6> zero_covariance;  ///< of the shared zeros
  std::vector<TestResult> dropped;
};

/// Number of equations of the tests in use.
int equationsOf(const ForceSystem& system);

/// Equations of all usable force observations; rows 3 leaves moments and indentations out.
ForceSystem buildSystem(const ObservationSet& set, const ForceSettings& settings, int rows);

/// The system's loads with noise-free strains of sensors that have the nominal matrices.
ForceSystem noiseFree(const ForceSystem& system, const ObservationSet& set);

/// Rank at 10⁻⁸ and condition of the column-scaled design, with the vector of the smallest
/// singular value.
struct DesignRank {
  int rank = 0, unknowns = 0, equations = 0;
  double condition = 0.0;
  Eigen::VectorXd weakest;  ///< unscaled parameters, largest entry 1
};
DesignRank rankOf(const ForceSystem& system, int terms);

/// Linear or quadratic terms of strains.
Eigen::VectorXd strainTerms(const Vector6& strain, int terms);

/// The parameters as two matrices of rows × terms.
PerSide<Eigen::MatrixXd> matricesOf(const Eigen::VectorXd& theta, int rows, int terms);

/// The drawings' matrices with zeros for products.
PerSide<Eigen::MatrixXd> nominalMatrices(const ObservationSet& set, int rows, int terms);

/// Rows of one test's design matrix divided by the standard deviations of their residuals
/// (whitened), at the matrices given and the test's own strains. Shared zeros are left out.
Eigen::MatrixXd whitenedRows(const ForceTest& test, const PerSide<Eigen::MatrixXd>& S);

/// Rows of the design matrix of one test at these strains.
void designRows(const ForceTest& test, int rows, int terms, const PerSide<Vector6>& strain,
                Eigen::Ref<Eigen::MatrixXd> A);
/// Design of all tests in use, at their own strains.
Eigen::MatrixXd designOf(const ForceSystem& system, int terms);

struct ForceFit {
  bool converged = false;
  PerSide<Eigen::MatrixXd> S;  ///< rows × terms
  Eigen::MatrixXd covariance;  ///< of the parameters
  double chi2 = 0.0;
  int equations = 0, dof = 0, iterations = 0;
  std::vector<SmallVector> residual;  ///< of every test, used or not
  std::vector<double> test_chi2;      ///< rᵀ C⁻¹ r
  std::vector<double> normalised;  ///< sqrt(χ²/equations), leverage of the used tests taken out;
                                   ///< of the unused the prediction's uncertainty added
};

/// Gauss–Helmert adjustment from S. Without `normalise` the leverage is not taken out.
ForceFit fitForce(const ForceSystem& system, const PerSide<Eigen::MatrixXd>& S, bool normalise);

/// The covariance of a fit at S.
ForceFit covarianceAt(const ForceSystem& system, const PerSide<Eigen::MatrixXd>& S);

/// Unweighted least squares of the rows, as in the thesis.
PerSide<Eigen::MatrixXd> plainLeastSquares(const ForceSystem& system);

/// The weakest direction as text: which wrench component is wrong under which load.
std::string describeWeak(const Eigen::VectorXd& weakest, const ObservationSet& set, int rows,
                         int terms, const RatedLoad& rated);

/// The covariance of w over rated loads, rms by axis, of one side's block of the covariance.
Vector6 predictedSd(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& S,
                    const Matrix6& nominal, const RatedLoad& rated);

}  // namespace assembly_cell
