// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/force.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/math/distributions.h"
#include "force_gates.h"

namespace assembly_cell {

namespace {

constexpr double kOutlierP = 1e-3;  // p of χ² above which no test counts as an outlier

ForceFit fitOf(const ForceSystem& system, const ObservationSet& set, const ForceFit* start,
               int terms, bool normalise) {
  PerSide<Eigen::MatrixXd> S = nominalMatrices(set, system.rows, terms);
  if (start != nullptr && start->converged) {
    for (const Side side : kSides) {
      S[side].setZero();
      S[side].leftCols(start->S[side].cols()) = start->S[side];
    }
  }
  return fitForce(system, S, normalise);
}

// Removes the test with the largest normalised residual while χ² is improbable.
ForceFit fitWithoutOutliers(ForceSystem& system, const ObservationSet& set, const ForceFit* start,
                            int terms, double fraction) {
  ForceFit fit = fitOf(system, set, start, terms, true);
  int left = static_cast<int>(fraction * static_cast<double>(system.tests.size()));
  while (left-- > 0 && fit.converged && chiSquareTail(fit.chi2, fit.dof) < kOutlierP) {
    std::size_t worst = system.tests.size();
    double excess = 1.0;
    for (std::size_t k = 0; k < system.tests.size(); ++k) {
      const ForceTest& test = system.tests[k];
      if (!test.used) continue;
      const double limit = std::sqrt(chiSquareLimit(1e-3, test.equations) / test.equations);
      if (fit.normalised[k] / limit > excess) {
        excess = fit.normalised[k] / limit;
        worst = k;
      }
    }
    if (worst == system.tests.size()) break;
    system.tests[worst].used = false;
    const ForceFit without = fitOf(system, set, &fit, terms, true);
    if (!without.converged) {
      system.tests[worst].used = true;
      break;
    }
    fit = without;
  }
  return fit;
}

// Leaves a fraction of the tests of each kind out of the fit; rms of their normalised residuals.
void holdOut(ForceSystem system, const ObservationSet& set, const ForceFit& fit, double fraction,
             ForceSolution& out) {
  const int terms = out.terms;
  out.hold_out_rms = std::numeric_limits<double>::quiet_NaN();
  if (!(fraction > 0.0)) return;
  const auto step = static_cast<int>(std::lround(1.0 / fraction));
  std::array<int, 8> count{};
  std::vector<std::size_t> held_out;
  for (std::size_t k = 0; k < system.tests.size(); ++k) {
    ForceTest& test = system.tests[k];
    if (!test.used) continue;
    const auto kind = static_cast<std::size_t>(test.kind) + (test.part.a.present ? 0 : 1);
    if (++count[kind] % step == step / 2) {
      test.used = false;
      held_out.push_back(k);
    }
  }
  if (held_out.empty()) return;
  if (rankOf(noiseFree(system, set), terms).rank < 2 * system.rows * terms) return;
  const ForceFit part = fitOf(system, set, &fit, terms, true);
  if (!part.converged) return;
  double sum = 0.0;
  int equations = 0;
  for (const std::size_t k : held_out) {
    const int m = system.tests[k].equations;
    sum += part.normalised[k] * part.normalised[k] * m;
    equations += m;
  }
  out.hold_out_rms = std::sqrt(sum / equations);
  out.hold_out_tests = static_cast<int>(held_out.size());
}

void fillSolution(const ForceSystem& system, const ForceFit& fit, ForceSolution& out) {
  out.S = fit.S;
  out.covariance = fit.covariance;
  out.terms = static_cast<int>(fit.S.a.cols());
  out.quadratic = out.terms == 27;
  out.unknowns = 2 * out.rows * out.terms;
  out.equations = fit.equations;
  out.dof = fit.dof;
  out.chi2 = fit.chi2;
  out.p = chiSquareTail(fit.chi2, fit.dof);
  out.iterations = fit.iterations;
  out.tests = system.dropped;
  Vector6 squares = Vector6::Zero(), counts = Vector6::Zero();
  for (std::size_t k = 0; k < system.tests.size(); ++k) {
    const ForceTest& test = system.tests[k];
    TestResult result;
    result.observation = test.observation;
    if (!test.used) result.dropped = {CalibrationFailure::kOutlier, "outlier"};
    result.equations = test.equations;
    // an indentation has rows for moments only
    const int first = test.kind == ObservationKind::kIndentation ? 3 : 0;
    result.residual.segment(first, test.equations) = fit.residual[k];
    result.chi2 = fit.test_chi2[k];
    result.normalised = fit.normalised[k];
    if (test.used) {
      squares.segment(first, test.equations) += fit.residual[k].cwiseAbs2();
      counts.segment(first, test.equations).array() += 1.0;
    }
    out.tests.push_back(result);
  }
  std::sort(out.tests.begin(), out.tests.end(),
            [](const TestResult& l, const TestResult& r) { return l.observation < r.observation; });
  for (int i = 0; i < 6; ++i) {
    out.residual_rms[i] = counts[i] > 0.0 ? std::sqrt(squares[i] / counts[i]) : 0.0;
  }
}

int rowsOf(ForceProcedure procedure) { return procedure == ForceProcedure::kAllRows ? 6 : 3; }

// Gates on geometry and noise-free rank; true when the system can be solved.
bool evaluateSystem(const ForceSystem& system, const ObservationSet& set,
                    const ForceSettings& settings, int terms, const Geometry& geometry,
                    ForceSolution& out) {
  out.tests = system.dropped;
  out.procedure = settings.procedure;
  out.rows = system.rows;
  out.terms = terms;
  out.quadratic = terms == 27;
  evaluateGeometry(geometry, out.gates);
  const DesignRank design = rankOf(noiseFree(system, set), terms);
  out.weak_vector = design.weakest;
  out.weak_direction = describeWeak(design.weakest, set, system.rows, terms, settings.rated);
  const bool full = design.rank == design.unknowns;
  std::string force_rows;
  if (!full && system.rows == 6 && terms == 6) {
    const DesignRank alone = rankOf(noiseFree(buildSystem(set, settings, 3), set), terms);
    force_rows = " (force rows alone: rank " + std::to_string(alone.rank) + " of " +
                 std::to_string(alone.unknowns) + ")";
  }
  evaluateRank(design, force_rows, geometry, out);
  return full;
}

void checkAll(const ObservationSet& set) {
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    checkObservation(set.observations[i], set, "observations[" + std::to_string(i) + "]");
  }
}

struct Fitted {
  ForceSystem system;  // with the outliers marked
  ForceFit fit;
};

// The linear model, or the complete quadratic one if it is requested, or if the linear one fits
// badly and there are enough data. `out`: gates of the model chosen.
Fitted fitModel(const ForceSystem& system, const ObservationSet& set, const ForceSettings& settings,
                const Geometry& geometry, ForceSolution& out) {
  Fitted found{system, {}};
  const std::string missing = missingForQuadratic(geometry, set);
  // no outliers are removed before the model fits
  const ForceFit linear = fitOf(system, set, nullptr, 6, false);
  if (settings.model == StrainModel::kQuadratic) {
    addGate(out.gates, !missing.empty(),
            {"quadratic_data", Verdict::kRefuse, 0, 0,
             "too few data for the quadratic model: add " + missing});
    found.fit = fitWithoutOutliers(found.system, set, &linear, 27, settings.max_outliers);
    return found;
  }
  const bool may_grow =
      settings.model == StrainModel::kAutomatic && missing.empty() && system.rows == 6;
  const auto isPoor = [&] {
    return may_grow && found.fit.converged && found.fit.chi2 > kModelChi2 * found.fit.dof;
  };
  found.fit = linear;
  if (!isPoor()) {
    found.fit = fitWithoutOutliers(found.system, set, nullptr, 6, settings.max_outliers);
  }
  if (!isPoor()) return found;
  ForceSolution quadratic;
  if (!evaluateSystem(system, set, settings, 27, geometry, quadratic)) {
    // stay with the linear model and all tests
    for (ForceTest& test : found.system.tests) test.used = true;
    return found;
  }
  const ForceFit start = found.fit;
  found.system = system;
  found.fit = fitWithoutOutliers(found.system, set, &start, 27, settings.max_outliers);
  out = quadratic;
  return found;
}

}  // namespace

void fields(FieldList& f, RatedLoad& rated) {
  f.number("force", rated.force, positive("N"), "Largest force, each axis.");
  f.number("torque", rated.torque, positive("N m"), "Largest torque, each axis.");
}

const char* toString(ForceProcedure procedure) {
  return std::array{"all_rows", "force_rows", "thesis"}[static_cast<std::size_t>(procedure)];
}

ForceSolution solveForce(const ObservationSet& set, const ForceSettings& settings) {
  checkAll(set);
  const ForceSystem system = buildSystem(set, settings, rowsOf(settings.procedure));
  const Geometry geometry = geometryOf(system, set);
  const int terms = settings.model == StrainModel::kQuadratic ? 27 : 6;
  ForceSolution out;
  const bool solvable = evaluateSystem(system, set, settings, terms, geometry, out);
  // plain least squares, as in the thesis
  if (settings.procedure == ForceProcedure::kThesis) out.S = plainLeastSquares(system);
  if (!solvable) evaluateDropped(out);
  if (!solvable || settings.procedure == ForceProcedure::kThesis) {
    summarise(out);
    return out;
  }
  const Fitted found = fitModel(system, set, settings, geometry, out);
  if (!found.fit.converged) {
    out.gates.push_back({"convergence", Verdict::kRefuse, double(found.fit.iterations), 30,
                         "the estimate does not converge: check units, poses and signs of the "
                         "tests"});
    summarise(out);
    return out;
  }
  fillSolution(found.system, found.fit, out);
  evaluatePrediction(set, settings.rated, out);
  holdOut(found.system, set, found.fit, settings.hold_out, out);
  evaluateFit(geometry, set, settings.model, system.tests.size(), out);
  summarise(out);
  return out;
}

ForceSolution evaluateDesign(const ObservationSet& set, const ForceSettings& settings) {
  checkAll(set);
  const int rows = rowsOf(settings.procedure);
  const int terms = settings.model == StrainModel::kQuadratic ? 27 : 6;
  const ForceSystem system = buildSystem(set, settings, rows);
  const Geometry geometry = geometryOf(system, set);
  ForceSolution out;
  if (evaluateSystem(system, set, settings, terms, geometry, out)) {
    out.S = nominalMatrices(set, rows, terms);
    const ForceFit fit = covarianceAt(noiseFree(system, set), out.S);
    if (fit.converged) {
      out.covariance = fit.covariance;
      evaluatePrediction(set, settings.rated, out);
    }
  }
  summarise(out);
  if (out.accepted) {
    out.message = "design is good: rank " + std::to_string(out.rank) + " of " +
                  std::to_string(out.unknowns) +
                  text(", condition %.3g, %d degrees of freedom", out.condition, out.dof);
    const std::string warnings = gateTexts(out.gates, Verdict::kWarn);
    if (!warnings.empty()) out.message += "; warning: " + warnings;
  }
  return out;
}

void applyForce(const ForceSolution& solution, const ObservationSet& set, Side side,
                Calibration& c) {
  if (!solution.accepted || solution.rows != 6) {
    throw InputError("calibration: " + solution.message);
  }
  const SensorDescription& sensor = set.sensor[side];
  const Eigen::MatrixXd& S = solution.S[side];
  const Eigen::Index half = 6 * solution.terms, first = side == Side::kA ? 0 : half;
  if (!sensor.serial_number.empty()) c.serial_number = sensor.serial_number;
  c.volts_to_wrench = S.leftCols<6>();
  c.quadratic_wrench = solution.quadratic;
  c.wrench_products.setZero();
  if (solution.quadratic) c.wrench_products = S.rightCols<kStrainProducts>();
  c.wrench_covariance = solution.covariance.block(first, first, half, half);
  c.wrench_fit = {solution.chi2, solution.dof, solution.p, solution.residual_rms,
                  solution.predicted_sd[side]};
  c.noise.setConstant(std::sqrt(sensor.variance(sensor.noise)));
  c.observations_digest = observationsDigest(set);
  c.wrench_range.setZero();
  double temperatures = 0.0;
  int count = 0;
  for (const Observation& o : set.observations) {
    const auto& reading = o.reading[side];
    if (!reading || unusable(*reading, sensor)) continue;
    if (o.kind == ObservationKind::kUnloaded) c.zero_volts = reading->volts;
    if (std::isfinite(reading->temperature)) {
      temperatures += reading->temperature;
      ++count;
    }
  }
  if (count > 0) c.temperature = temperatures / count;
  for (const TestResult& test : solution.tests) {
    if (test.dropped) continue;
    const auto& reading = set.observations[test.observation].reading[side];
    if (!reading) continue;
    c.wrench_range = c.wrench_range.cwiseMax((reading->volts - c.zero_volts).cwiseAbs());
  }
}

}  // namespace assembly_cell
