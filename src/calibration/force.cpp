// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/force.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "assembly_cell/scene/input_error.h"
#include "force_system.h"

namespace assembly_cell {

namespace {

// gates of section 9
constexpr double kWarnCondition = 100.0;
constexpr double kSdLimitFewBits = 0.01;  // of full scale
constexpr double kSdLimit = 0.001;        // of full scale, 16 bits and more
constexpr int kLeastDof = 20;
constexpr double kLeastP = 1e-3;
constexpr double kLowChi2 = 0.3;    // χ²/dof
constexpr double kModelChi2 = 3.0;  // χ²/dof beyond which the linear model is doubted
constexpr double kHoldOut = 1.5;    // normalised rms
constexpr double kParallel = 0.02;  // [rad] orientations nearer than that are one
constexpr double kShift = 1e-3;     // [m] poses nearer than that are one
constexpr double kPlane = 0.1;      // third singular value of unit directions that still counts
constexpr int kQuadraticBits = 16, kQuadraticReacting = 60, kQuadraticWeights = 12,
              kQuadraticIndentations = 18;

std::string format(const char* pattern, double a, double b = 0.0, double c = 0.0) {
  char text[300];
  std::snprintf(text, sizeof text, pattern, a, b, c);
  return text;
}

// rms extents of the rows along their principal axes, largest first
Eigen::Vector3d spread(const std::vector<Eigen::Vector3d>& rows) {
  if (rows.empty()) return Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& row : rows) squares += row * row.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(squares /
                                                             static_cast<double>(rows.size()));
  return eigen.eigenvalues().reverse().cwiseMax(0.0).cwiseSqrt();
}

// what kinds of tests there are, from which advice follows
struct Geometry {
  int reacting = 0;
  std::array<int, 2> weights{}, indentations{};
  int turn_axes = 0;  // 0 parallel, 1 about one axis, 2 enough
  bool shifted = false;
  std::array<int, 2> weight_rank{};
  std::array<bool, 2> collinear{}, coplanar{};
};

Geometry geometryOf(const ForceSystem& system, const ObservationSet& set) {
  Geometry g;
  std::array<std::vector<Eigen::Vector3d>, 2> directions, points, forces;
  std::vector<Eigen::Vector3d> turns;
  const ForceTest* first = nullptr;
  for (const ForceTest& test : system.tests) {
    const std::size_t side = test.a.present ? 0 : 1;
    if (test.kind == ObservationKind::kReacting) {
      ++g.reacting;
      if (first == nullptr) first = &test;
      const Eigen::Vector3d turn =
          vectorFromRotation(first->X_AB.R.transpose() * test.X_AB.R).value;
      if (turn.norm() > kParallel) turns.push_back(turn.normalized());
      g.shifted = g.shifted || (test.X_AB.p - first->X_AB.p).norm() > kShift;
    } else if (test.kind == ObservationKind::kWeight) {
      ++g.weights[side];
      directions[side].push_back(set.observations[test.observation].direction);
    } else {
      ++g.indentations[side];
      const Part& part = side == 0 ? test.a : test.b;
      const Eigen::Vector3d F = ((side == 0 ? set.a : set.b).nominal * part.strain).head<3>();
      if (F.norm() > 0.0) forces[side].push_back(F.normalized());
      points[side].push_back(test.point);
    }
  }
  if (!turns.empty()) g.turn_axes = spread(turns)[1] > kPlane ? 2 : 1;
  for (std::size_t side = 0; side < 2; ++side) {
    const Eigen::Vector3d d = spread(directions[side]);
    for (int k = 0; k < 3; ++k) g.weight_rank[side] += d[k] > kPlane ? 1 : 0;
    if (points[side].empty()) continue;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const auto& p : points[side]) mean += p / static_cast<double>(points[side].size());
    for (auto& p : points[side]) p -= mean;
    g.collinear[side] = !(spread(points[side])[1] > kShift);
    g.coplanar[side] = !(spread(forces[side])[2] > kPlane);
  }
  return g;
}

std::string advice(const Geometry& g, int rows) {
  std::string out;
  const auto add = [&](const std::string& text) { out += (out.empty() ? "" : "; ") + text; };
  if (g.reacting > 0 && g.turn_axes == 0) {
    add(std::string("all relative orientations are parallel") +
        (g.shifted ? "" : " and the relative pose is the same in all tests") +
        ": add reacting tests at known different orientations about two or more axes (90 degree "
        "turns on the datum faces)" +
        (g.shifted ? ", or three non-coplanar weights on one sensor"
                   : ", or six weights of independent wrench on one sensor"));
  } else if (g.reacting > 0 && g.turn_axes == 1) {
    add("the relative orientations turn about one axis only: add reacting tests turned about a "
        "second axis, or a weight oblique to that axis");
  }
  if (g.weights[0] + g.weights[1] == 0) {
    add("no weight fixes the scale: add at least one weight, better 6 on each sensor along + and - "
        "each axis");
  }
  if (g.reacting == 0) {
    for (std::size_t side = 0; side < 2; ++side) {
      if (g.weights[side] < 6) {
        add(std::string("sensor ") + (side == 0 ? "a" : "b") +
            " has no reacting tests and too few weights: add reacting tests turned about two axes, "
            "or 18 weights at known points");
      }
    }
  }
  if (out.empty()) {
    add(rows == 6
            ? "add reacting tests at other orientations and contact points, and weights along "
              "the missing axes"
            : "add weights along the missing axes");
  }
  return out;
}

void judgeGeometry(const Geometry& g, std::vector<Gate>& gates) {
  const int rank = std::max(g.weight_rank[0], g.weight_rank[1]);
  Gate turns{"orientations", Verdict::kPass, double(g.turn_axes), 2, ""};
  if (g.reacting > 0 && g.turn_axes < 2 && rank < 3) {
    turns.verdict = Verdict::kRefuse;
    turns.text = "reacting tests turn about " + std::to_string(g.turn_axes) +
                 " axes and the weights span " + std::to_string(rank) +
                 " of 3 directions: add reacting tests turned about two or more axes, or three "
                 "non-coplanar weights on one sensor";
  }
  gates.push_back(turns);
  for (std::size_t side = 0; side < 2; ++side) {
    if (g.indentations[side] == 0) continue;
    Gate gate{std::string("indentations_") + (side == 0 ? "a" : "b"), Verdict::kPass,
              double(g.indentations[side]), 0, ""};
    if (g.collinear[side] || g.coplanar[side]) {
      // one or two more points beside other tests do no harm
      gate.verdict = g.indentations[side] < 3 ? Verdict::kWarn : Verdict::kRefuse;
      gate.text =
          std::string("indentations of sensor ") + (side == 0 ? "a" : "b") +
          (g.collinear[side]
               ? " lie on one line: add a point off it (three non-collinear points at least)"
               : " press in coplanar directions: turn the sensor on its datum faces and add "
                 "a third direction");
    }
    gates.push_back(gate);
  }
}

void judgeRank(const DesignRank& design, const DesignRank* force_rows, const Geometry& geometry,
               int rows, ForceSolution& out) {
  out.rank = design.rank;
  out.unknowns = design.unknowns;
  out.equations = design.equations;
  out.dof = design.equations - design.unknowns;
  out.condition = design.condition;
  Gate rank{"rank", Verdict::kPass, double(design.rank), double(design.unknowns), ""};
  if (design.rank < design.unknowns) {
    rank.verdict = Verdict::kRefuse;
    rank.text = "rank " + std::to_string(design.rank) + " of " + std::to_string(design.unknowns);
    if (force_rows != nullptr) {
      rank.text += " (force rows alone: rank " + std::to_string(force_rows->rank) + " of " +
                   std::to_string(force_rows->unknowns) + ")";
    }
    rank.text += ", weakest direction: " + out.weak_direction + ": " + advice(geometry, rows);
  }
  out.gates.push_back(rank);
  Gate condition{"condition", Verdict::kPass, design.condition, kWarnCondition, ""};
  if (design.rank == design.unknowns && design.condition > kWarnCondition) {
    condition.verdict = Verdict::kWarn;
    condition.text = format("condition %.3g is above %.3g: ", design.condition, kWarnCondition) +
                     "add tests that move " + out.weak_direction;
  }
  out.gates.push_back(condition);
  Gate dof{"dof", Verdict::kPass, double(out.dof), kLeastDof, ""};
  if (out.dof < kLeastDof) {
    dof.verdict = Verdict::kRefuse;
    dof.text = format("%.0f residual degrees of freedom, below %.0f: nothing would prove the fit; ",
                      out.dof, kLeastDof) +
               "add " + std::to_string((kLeastDof - out.dof + rows - 1) / rows) +
               " or more reacting tests or weights";
  }
  out.gates.push_back(dof);
}

void judgePrediction(const ObservationSet& set, const RatedLoad& rated, ForceSolution& out) {
  const Eigen::Index half = out.rows * out.terms;
  out.predicted_sd_a = predictedSd(out.covariance.topLeftCorner(half, half), out.S_a, set.a.nominal,
                                   out.rows, out.terms, rated);
  out.predicted_sd_b = predictedSd(out.covariance.bottomRightCorner(half, half), out.S_b,
                                   set.b.nominal, out.rows, out.terms, rated);
  const auto worst = [&](const Vector6& sd) {
    const double force = sd.head<3>().norm() / std::sqrt(3.0) / rated.force;
    const double torque = sd.tail<3>().norm() / std::sqrt(3.0) / rated.torque;
    return std::max(force, torque);
  };
  Gate gate{"predicted_sd", Verdict::kPass,
            std::max(worst(out.predicted_sd_a), worst(out.predicted_sd_b)),
            std::min(set.a.bits, set.b.bits) < 16 ? kSdLimitFewBits : kSdLimit, ""};
  if (!(gate.value <= gate.limit)) {
    gate.verdict = Verdict::kRefuse;
    gate.text = format(
                    "predicted standard deviation of a wrench over rated loads is %.3g %% of "
                    "full scale, above %.3g %%: ",
                    100 * gate.value, 100 * gate.limit) +
                "add tests that move " + out.weak_direction + ", or average more samples";
  }
  out.gates.push_back(gate);
}

void summarise(ForceSolution& out) {
  const std::string reasons = gateTexts(out.gates, Verdict::kRefuse);
  const std::string warnings = gateTexts(out.gates, Verdict::kWarn);
  out.accepted = reasons.empty() && out.procedure == ForceProcedure::kAllRows;
  if (out.procedure != ForceProcedure::kAllRows) {
    out.message = std::string("refused for use: the ") +
                  (out.procedure == ForceProcedure::kThesis ? "thesis" : "force_rows") +
                  " procedure is for comparison" + (reasons.empty() ? "" : "; " + reasons);
  } else if (!reasons.empty()) {
    out.message = "refused: " + reasons;
  } else {
    out.message = (out.quadratic ? std::string("quadratic") : std::string("linear")) +
                  format(" model, chi2/dof %.3g", out.dof > 0 ? out.chi2 / out.dof : 0.0) +
                  " with " + std::to_string(out.dof) + " degrees of freedom";
  }
  if (!warnings.empty()) out.message += "; warning: " + warnings;
}

// ---- fitting ----

ForceFit fitOf(const ForceSystem& system, const ObservationSet& set, const ForceFit* start,
               int terms, bool normalise) {
  Eigen::MatrixXd S_a = Eigen::MatrixXd::Zero(system.rows, terms), S_b = S_a;
  if (start != nullptr && start->converged) {
    S_a.leftCols(start->S_a.cols()) = start->S_a;
    S_b.leftCols(start->S_b.cols()) = start->S_b;
  } else {
    S_a.leftCols(6) = set.a.nominal.topRows(system.rows);
    S_b.leftCols(6) = set.b.nominal.topRows(system.rows);
  }
  return fitForce(system, S_a, S_b, terms, true, normalise);
}

// removes the largest normalised residual while χ² is improbable
ForceFit fitWithoutOutliers(ForceSystem& system, const ObservationSet& set, const ForceFit* start,
                            int terms, double share) {
  ForceFit fit = fitOf(system, set, start, terms, true);
  int left = static_cast<int>(share * static_cast<double>(system.tests.size()));
  while (left-- > 0 && fit.converged && chi2Tail(fit.chi2, fit.dof) < kLeastP) {
    std::size_t worst = system.tests.size();
    double excess = 1.0;
    for (std::size_t k = 0; k < system.tests.size(); ++k) {
      const ForceTest& test = system.tests[k];
      if (!test.used) continue;
      const double limit = std::sqrt(chi2Limit(1e-3, test.equations) / test.equations);
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

// every so many tests of each kind aside; normalised rms of their residuals
void holdOut(ForceSystem system, const ObservationSet& set, const ForceFit& fit, int terms,
             double share, ForceSolution& out) {
  out.hold_out_rms = std::numeric_limits<double>::quiet_NaN();
  if (!(share > 0.0)) return;
  const auto step = static_cast<int>(std::lround(1.0 / share));
  std::array<int, 8> count{};
  std::vector<std::size_t> aside;
  for (std::size_t k = 0; k < system.tests.size(); ++k) {
    ForceTest& test = system.tests[k];
    if (!test.used) continue;
    const auto kind = static_cast<std::size_t>(test.kind) + (test.a.present ? 0 : 1);
    if (++count[kind] % step == step / 2) {
      test.used = false;
      aside.push_back(k);
    }
  }
  if (aside.empty()) return;
  if (rankOf(noiseFree(system, set), terms).rank < 2 * system.rows * terms) return;
  const ForceFit part = fitOf(system, set, &fit, terms, true);
  if (!part.converged) return;
  double sum = 0.0;
  int equations = 0;
  for (const std::size_t k : aside) {
    const int m = system.tests[k].equations;
    sum += part.normalised[k] * part.normalised[k] * m;
    equations += m;
  }
  out.hold_out_rms = std::sqrt(sum / equations);
  out.hold_out_tests = static_cast<int>(aside.size());
}

std::string missingForQuadratic(const Geometry& g, const ObservationSet& set) {
  std::string out;
  const auto need = [&](int have, int least, const std::string& what) {
    if (have >= least) return;
    out += (out.empty() ? "" : ", ") + std::to_string(least - have) + " more " + what;
  };
  if (std::min(set.a.bits, set.b.bits) < kQuadraticBits) {
    return "a converter of 16 bits or more (10 bits fit noise)";
  }
  need(g.reacting, kQuadraticReacting, "reacting tests");
  for (std::size_t side = 0; side < 2; ++side) {
    const std::string on = std::string(" on sensor ") + (side == 0 ? "a" : "b");
    need(g.weights[side], kQuadraticWeights, "weights" + on);
    need(g.indentations[side], kQuadraticIndentations, "indentations" + on);
  }
  return out;
}

void takeOver(const ForceSystem& system, const ForceFit& fit, ForceSolution& out) {
  out.S_a = fit.S_a;
  out.S_b = fit.S_b;
  out.covariance = fit.covariance;
  out.terms = static_cast<int>(fit.S_a.cols());
  out.quadratic = out.terms == 27;
  out.unknowns = 2 * out.rows * out.terms;
  out.equations = fit.equations;
  out.dof = fit.dof;
  out.chi2 = fit.chi2;
  out.p = chi2Tail(fit.chi2, fit.dof);
  out.iterations = fit.iterations;
  out.tests = system.dropped;
  Vector6 squares = Vector6::Zero(), counts = Vector6::Zero();
  for (std::size_t k = 0; k < system.tests.size(); ++k) {
    const ForceTest& test = system.tests[k];
    TestResult result;
    result.observation = test.observation;
    result.outlier = !test.used;
    if (result.outlier) result.dropped = "outlier";
    result.equations = test.equations;
    // the rows of an indentation are moments
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

void judgeFit(const Geometry& geometry, const ObservationSet& set, StrainModel wanted,
              std::size_t tests, ForceSolution& out) {
  const double ratio = out.dof > 0 ? out.chi2 / out.dof : 0.0;
  Gate chi2{"chi2", Verdict::kPass, out.p, kLeastP, ""};
  if (out.p < kLeastP) {
    chi2.verdict = Verdict::kRefuse;
    chi2.text = format("chi2/dof %.3g (p %.2g): the ", ratio, out.p) +
                (out.quadratic ? "quadratic" : "linear") + " model does not fit the tests";
    if (!out.quadratic && ratio > kModelChi2) {
      const std::string missing = missingForQuadratic(geometry, set);
      chi2.text += missing.empty() || wanted == StrainModel::kLinear
                       ? ": use the quadratic model, or restrict the loads to half the rated range"
                       : ": for the quadratic model add " + missing +
                             "; or restrict the loads to half the rated range";
    } else {
      chi2.text += ": check poses, masses and points of the tests with the largest residuals";
    }
  }
  out.gates.push_back(chi2);
  Gate low{"low_chi2", Verdict::kPass, ratio, kLowChi2, ""};
  if (out.dof >= kLeastDof && ratio < kLowChi2) {
    low.verdict = Verdict::kWarn;
    low.text = format("chi2/dof %.3g is below %.3g: the noise is overstated or data are copied",
                      ratio, kLowChi2);
  }
  out.gates.push_back(low);
  int outliers = 0, dropped = 0;
  std::string first_reason;
  for (const TestResult& test : out.tests) {
    outliers += test.outlier ? 1 : 0;
    if (!test.outlier && !test.dropped.empty()) {
      ++dropped;
      if (first_reason.empty()) first_reason = test.dropped;
    }
  }
  Gate outlier{"outliers", Verdict::kPass, double(outliers), 0.1 * static_cast<double>(tests), ""};
  if (outliers > 0) {
    outlier.verdict = Verdict::kWarn;
    outlier.text = std::to_string(outliers) + " tests removed as outliers";
  }
  out.gates.push_back(outlier);
  Gate unusable{"dropped", Verdict::kPass, double(dropped), 0, ""};
  if (dropped > 0) {
    unusable.verdict = Verdict::kWarn;
    unusable.text =
        std::to_string(dropped) + " tests dropped, the first because of " + first_reason;
  }
  out.gates.push_back(unusable);
  Gate held{"hold_out", Verdict::kPass, out.hold_out_rms, kHoldOut, ""};
  if (out.hold_out_rms > kHoldOut) {
    held.verdict = Verdict::kRefuse;
    held.text = format("tests held out miss by %.3g standard deviations rms, above %.3g: ",
                       out.hold_out_rms, kHoldOut) +
                "the fit does not predict; add tests";
  }
  out.gates.push_back(held);
}

int rowsOf(ForceProcedure procedure) { return procedure == ForceProcedure::kAllRows ? 6 : 3; }

// geometry, noise-free rank; true when the system can be solved
bool judgeSystem(const ForceSystem& system, const ObservationSet& set,
                 const ForceSettings& settings, int terms, const Geometry& geometry,
                 ForceSolution& out) {
  out.procedure = settings.procedure;
  out.rows = system.rows;
  out.terms = terms;
  out.quadratic = terms == 27;
  judgeGeometry(geometry, out.gates);
  const DesignRank design = rankOf(noiseFree(system, set), terms);
  out.weak_vector = design.weakest;
  out.weak_direction = describeWeak(design.weakest, set, system.rows, terms, settings.rated);
  const bool full = design.rank == design.unknowns;
  DesignRank force_rows;
  const bool both = !full && system.rows == 6 && terms == 6;
  if (both) {
    force_rows = rankOf(noiseFree(buildSystem(set, settings, 3), set), terms);
  }
  judgeRank(design, both ? &force_rows : nullptr, geometry, system.rows, out);
  return full;
}

void checkAll(const ObservationSet& set) {
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    checkObservation(set.observations[i], set, "observations[" + std::to_string(i) + "]");
  }
}

}  // namespace

ForceSolution solveForce(const ObservationSet& set, const ForceSettings& settings) {
  checkAll(set);
  const int rows = rowsOf(settings.procedure);
  ForceSystem system = buildSystem(set, settings, rows);
  const Geometry geometry = geometryOf(system, set);
  const int first_terms = settings.model == StrainModel::kQuadratic ? 27 : 6;
  ForceSolution out;
  out.tests = system.dropped;
  if (!judgeSystem(system, set, settings, first_terms, geometry, out)) {
    // the noisy numbers that the thesis would have taken
    if (settings.procedure == ForceProcedure::kThesis) {
      plainLeastSquares(system, out.S_a, out.S_b);
    }
    Gate dropped{"dropped", Verdict::kPass, double(system.dropped.size()), 0, ""};
    if (!system.dropped.empty()) {
      dropped.verdict = Verdict::kWarn;
      dropped.text = std::to_string(system.dropped.size()) +
                     " tests dropped, the first because of " + system.dropped[0].dropped;
    }
    out.gates.push_back(dropped);
    summarise(out);
    return out;
  }
  if (settings.procedure == ForceProcedure::kThesis) {
    plainLeastSquares(system, out.S_a, out.S_b);
    summarise(out);
    return out;
  }

  const ForceSystem whole = system;
  ForceFit fit;
  int terms = first_terms;
  if (terms == 27) {
    const std::string missing = missingForQuadratic(geometry, set);
    Gate gate{"quadratic_data", Verdict::kPass, 0, 0, ""};
    if (!missing.empty()) {
      gate.verdict = Verdict::kRefuse;
      gate.text = "too few data for the quadratic model: add " + missing;
    }
    out.gates.push_back(gate);
    const ForceFit linear = fitOf(system, set, nullptr, 6, false);
    fit = fitWithoutOutliers(system, set, &linear, terms, settings.max_outliers);
  } else {
    // a model that is wrong everywhere has no outliers
    fit = fitOf(system, set, nullptr, 6, false);
    const bool may_grow = settings.model == StrainModel::kAutomatic &&
                          missingForQuadratic(geometry, set).empty() && rows == 6;
    if (!(may_grow && fit.converged && fit.chi2 > kModelChi2 * fit.dof)) {
      fit = fitWithoutOutliers(system, set, nullptr, 6, settings.max_outliers);
    }
    if (may_grow && fit.converged && fit.chi2 > kModelChi2 * fit.dof) {
      ForceSolution quadratic;
      system = whole;
      quadratic.tests = system.dropped;
      if (judgeSystem(system, set, settings, 27, geometry, quadratic)) {
        const ForceFit linear = fit;
        fit = fitWithoutOutliers(system, set, &linear, 27, settings.max_outliers);
        terms = 27;
        out = quadratic;
      }
    }
  }
  if (!fit.converged) {
    out.gates.push_back({"convergence", Verdict::kRefuse, double(fit.iterations), 30,
                         "the estimate does not converge: check units, poses and signs of the "
                         "tests"});
    summarise(out);
    return out;
  }
  takeOver(system, fit, out);
  judgePrediction(set, settings.rated, out);
  holdOut(system, set, fit, terms, settings.hold_out, out);
  judgeFit(geometry, set, settings.model, system.tests.size(), out);
  summarise(out);
  return out;
}

ForceSolution judgeDesign(const ObservationSet& set, const ForceSettings& settings) {
  checkAll(set);
  const int rows = rowsOf(settings.procedure);
  const int terms = settings.model == StrainModel::kQuadratic ? 27 : 6;
  const ForceSystem system = buildSystem(set, settings, rows);
  const Geometry geometry = geometryOf(system, set);
  ForceSolution out;
  out.tests = system.dropped;
  if (judgeSystem(system, set, settings, terms, geometry, out)) {
    Eigen::MatrixXd S_a = Eigen::MatrixXd::Zero(rows, terms), S_b = S_a;
    S_a.leftCols(6) = set.a.nominal.topRows(rows);
    S_b.leftCols(6) = set.b.nominal.topRows(rows);
    const ForceFit fit = fitForce(noiseFree(system, set), S_a, S_b, terms, false, false);
    if (fit.converged) {
      out.S_a = S_a;
      out.S_b = S_b;
      out.covariance = fit.covariance;
      judgePrediction(set, settings.rated, out);
    }
  }
  summarise(out);
  if (out.accepted) {
    out.message = "design is good: rank " + std::to_string(out.rank) + " of " +
                  std::to_string(out.unknowns) +
                  format(", condition %.3g, %.0f degrees of freedom", out.condition, out.dof);
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
  const SensorDescription& sensor = side == Side::kA ? set.a : set.b;
  const Eigen::MatrixXd& S = side == Side::kA ? solution.S_a : solution.S_b;
  const Eigen::Index half = 6 * solution.terms, first = side == Side::kA ? 0 : half;
  if (!sensor.serial_number.empty()) c.serial_number = sensor.serial_number;
  c.volts_to_wrench = S.leftCols<6>();
  c.quadratic_wrench = solution.quadratic;
  c.wrench_products.setZero();
  if (solution.quadratic) c.wrench_products = S.rightCols<kStrainProducts>();
  c.wrench_covariance = solution.covariance.block(first, first, half, half);
  c.wrench_fit = {solution.chi2, solution.dof, solution.p, solution.residual_rms,
                  side == Side::kA ? solution.predicted_sd_a : solution.predicted_sd_b};
  c.noise.setConstant(std::sqrt(sensor.noise * sensor.noise + sensor.lsb() * sensor.lsb() / 12.0));
  c.observations_digest = observationsDigest(set);
  c.wrench_range.setZero();
  double warmth = 0.0;
  int warm = 0;
  for (const Observation& o : set.observations) {
    const auto& reading = side == Side::kA ? o.a : o.b;
    if (!reading || !unusable(*reading, sensor).empty()) continue;
    if (o.kind == ObservationKind::kUnloaded) c.zero_volts = reading->volts;
    if (std::isfinite(reading->temperature)) {
      warmth += reading->temperature;
      ++warm;
    }
  }
  if (warm > 0) c.temperature = warmth / warm;
  for (const TestResult& test : solution.tests) {
    if (!test.dropped.empty()) continue;
    const auto& reading = side == Side::kA ? set.observations[test.observation].a
                                           : set.observations[test.observation].b;
    if (!reading) continue;
    c.wrench_range = c.wrench_range.cwiseMax((reading->volts - c.zero_volts).cwiseAbs());
  }
}

}  // namespace assembly_cell
