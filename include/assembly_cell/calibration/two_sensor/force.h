// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "assembly_cell/calibration/common/gate.h"
#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

/// How the strain-to-wrench matrices are found.
enum class ForceProcedure {
  kAllRows,    ///< all six rows of both sensors at once from every test: the one to use
  kForceRows,  ///< force rows only, from reacting tests and weights
  kThesis,     ///< thesis 11.7, 11.8: force rows, poses taken as parallel; for comparison, its
               ///< result is refused for use
};
enum class StrainModel {
  kAutomatic,  ///< linear; complete quadratic when χ²/dof > 3 and the data allow it
  kLinear,
  kQuadratic,
};

/// Loads over which the accuracy of a wrench is evaluated: uniform in ± these, about the reference
/// point.
struct RatedLoad {
  double force = 50.0;  ///< [N]
  double torque = 2.0;  ///< [N·m]
};
void fields(FieldList& f, RatedLoad& rated);

struct ForceSettings {
  ForceProcedure procedure = ForceProcedure::kAllRows;
  StrainModel model = StrainModel::kAutomatic;
  RatedLoad rated;
  bool use_reference_covariance = true;
  double max_outliers = 0.1;  ///< largest fraction of the tests that may be removed
  double hold_out = 0.2;      ///< fraction of the tests left out to check the prediction
  /// Displacement calibrations, for points given at rest; null: such points are refused.
  PerSide<const Calibration*> displacement;
};

const char* toString(ForceProcedure procedure);  ///< all_rows, force_rows, thesis

/// Outcome of one test.
struct TestResult {
  std::size_t observation = 0;  ///< index in the set
  CalibrationRefusal dropped;   ///< why it was not used
  int equations = 0;
  Vector6 residual = Vector6::Zero();  ///< force, torque; unused rows 0 [N], [N·m]
  double chi2 = 0.0;                   ///< rᵀ C⁻¹ r
  double normalised = 0.0;             ///< sqrt(χ² / equations), leverage taken out
};

/// Strain to wrench of both sensors with its covariance, statistics and gates. Parameters: rows of
/// S_A one after another, then of S_B; a row has 6 coefficients of the strains and, quadratic, 21
/// of the products (strainProducts).
struct ForceSolution {
  bool accepted = false;  ///< no gate refuses and the procedure may be used
  ForceProcedure procedure = ForceProcedure::kAllRows;
  bool quadratic = false;
  int rows = 6;                ///< a sensor; 3: forces only
  int terms = 6;               ///< a row: 6 or 27
  PerSide<Eigen::MatrixXd> S;  ///< rows × terms; empty when the rank is short
  Eigen::MatrixXd covariance;  ///< of the parameters
  int unknowns = 0, equations = 0, dof = 0;
  int rank = 0;            ///< noise-free, column-scaled, at 10⁻⁸
  double condition = 0.0;  ///< column-scaled
  double chi2 = 0.0;
  double p = 0.0;
  int iterations = 0;
  Vector6 residual_rms = Vector6::Zero();  ///< by axis [N], [N·m]
  /// Standard deviation of a wrench, rms over the rated loads [N], [N·m].
  PerSide<Vector6> predicted_sd = {Vector6::Zero(), Vector6::Zero()};
  double hold_out_rms = 0.0;  ///< normalised; NaN: not possible
  int hold_out_tests = 0;
  std::string weak_direction;   ///< described by loads and components
  Eigen::VectorXd weak_vector;  ///< unit, of the scaled parameters
  std::vector<TestResult> tests;
  std::vector<Gate> gates;
  std::string message;  ///< one line
};

/// Solves for both sensors. Poor data don't throw: the gates name what is wrong and what to add.
/// Throws InputError for observations that checkObservation refuses.
ForceSolution solveForce(const ObservationSet& set, const ForceSettings& settings = {});

/// Before any measurement: rank, condition, χ² degrees of freedom and predicted standard deviation
/// of a design whose observations carry poses, weights and points but no readings of their own
/// (predictPlan() in plan.h gives noise-free ones), with the nominal matrices S. Gates: geometry,
/// rank, condition, dof and predicted sd.
ForceSolution evaluateDesign(const ObservationSet& set, const ForceSettings& settings = {});

/// Puts a solution into a calibration of one side: matrices, covariance, statistics, digest. The
/// zero is that of the last unloaded reading. Throws InputError for a solution not accepted.
void applyForce(const ForceSolution& solution, const ObservationSet& set, Side side,
                Calibration& calibration);

}  // namespace assembly_cell
