// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/identification/mechanism_check.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/math/distributions.h"
#include "problem.h"

namespace assembly_cell {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::Problem;
using identification::Rows;

constexpr double kSwing = 0.3, kWindow = 0.2;  // of each step [s]
constexpr double kForce = 1.5;                 // of the exciter [N]
// error of a reading by a swing that has not decayed, relative to its force
constexpr double kSwingLeft = 1.2e-3;

// The change of one unknown that explains most of the misfit.
std::string mostLikely(const KnownMechanism& known, const VectorXd& residual,
                       const MatrixXd& jacobian, const Eigen::LLT<MatrixXd>& expected) {
  const VectorXd weighted = expected.solve(residual);
  int best = 0;
  double largest = -1.0, step = 0.0;
  for (int i = 0; i < kUnknowns; ++i) {
    const VectorXd direction = jacobian.col(i);
    const double information = direction.dot(expected.solve(direction));
    const double slope = direction.dot(weighted);
    if (!(information > 0.0) || slope * slope <= largest * information) continue;
    largest = slope * slope / information;
    best = i;
    step = slope / information;
  }
  const Unknown& unknown = known.unknowns[static_cast<std::size_t>(best)];
  const double by = unknown.sd * step;
  return unknown.factor
             ? unknown.name + text(" most: a change by %.1f %% ", 100.0 * std::expm1(by)) +
                   "alone would explain most of it"
             : unknown.name + text(" most: a change by %.2g ", by) +
                   "(SI) alone would explain most of it";
}

}  // namespace

MechanismCheck evaluateMechanism(const KnownMechanism& known,
                                 const std::vector<VibrationReading>& readings,
                                 const IdentificationPrior& prior) {
  IdentificationPrior about = prior;
  about.unknowns = known.unknowns;
  IdentificationData data;
  data.vibrations = readings;
  const Problem problem(known.mechanism, data, about);
  const VectorXd zero = VectorXd::Zero(problem.size());
  const Rows rows = problem.rows(zero, false, true);
  MatrixXd covariance = MatrixXd::Identity(problem.size(), problem.size());
  covariance.topLeftCorner<kUnknowns, kUnknowns>() = known.covariance;
  const MatrixXd expected = rows.jacobian * covariance * rows.jacobian.transpose() +
                            MatrixXd::Identity(rows.residual.size(), rows.residual.size());
  const Eigen::LLT<MatrixXd> root(expected);
  MechanismCheck check;
  check.dof = static_cast<int>(rows.residual.size());
  check.chi2 = rows.residual.dot(root.solve(rows.residual));
  check.p = chiSquareTail(check.chi2, check.dof);
  check.agrees = check.p >= kCheckLevel;
  if (!check.agrees) {
    check.message = text("the hanging peg contradicts the mechanism, chi2 %.0f of %d, ", check.chi2,
                         check.dof) +
                    mostLikely(known, rows.residual, rows.jacobian, root) +
                    "; identify the mechanism again";
  }
  return check;
}

AlignParameters withDrive(AlignParameters parameters, const DriveErrors& drive) {
  parameters.exciter_ellipse = drive.ellipse;
  parameters.carrier_compliance = drive.compliance;
  return parameters;
}

MechanismCheck checkMechanism(Plant& plant, const KnownMechanism& known) {
  GuardedCarrier carrier(plant, PressLimits());
  tareFreePeg(carrier, known.mechanism);
  // beside the first resonance of the model, and where the carrier moves with the peg
  const std::vector<double> all = planFor(known.mechanism).hanging;
  std::vector<VibrationReading> readings;
  for (const int direction : {1, -1}) {
    const double frequency = direction > 0 ? all[1] : all[all.size() / 2];
    readings.push_back(
        readVibration(carrier, {kForce, frequency, 0.0, direction}, kSwing, kWindow));
  }
  exciterOff(carrier);
  IdentificationPrior prior;
  prior.hanging_model = kSwingLeft;
  return evaluateMechanism(known, readings, prior);
}

}  // namespace assembly_cell
