// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/force.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "force_system.h"
#include "format.h"

namespace assembly_cell {

namespace {

// gates: docs/calibration.md, "What is refused"
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
struct SideGeometry {
  int weights = 0, indentations = 0, weight_rank = 0;
  bool collinear = false, coplanar = false;  // indentations
};
struct Geometry {
  int reacting = 0;
  int turn_axes = 0;  // 0 parallel, 1 about one axis, 2 enough
  bool shifted = false;
  PerSide<SideGeometry> on;
};

struct Directions {
  std::vector<Eigen::Vector3d> weights, points, forces;
};

void judgeSide(Directions& found, SideGeometry& g) {
  g.weights = static_cast<int>(found.weights.size());
  g.indentations = static_cast<int>(found.points.size());
  for (const double extent : spread(found.weights)) g.weight_rank += extent > kPlane ? 1 : 0;
  if (found.points.empty()) return;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : found.points) mean += p / static_cast<double>(found.points.size());
  for (auto& p : found.points) p -= mean;
  g.collinear = !(spread(found.points)[1] > kShift);
  g.coplanar = !(spread(found.forces)[2] > kPlane);
}

Geometry geometryOf(const ForceSystem& system, const ObservationSet& set) {
  Geometry g;
  PerSide<Directions> found;
  std::vector<Eigen::Vector3d> turns;
  const ForceTest* first = nullptr;
  for (const ForceTest& test : system.tests) {
    const Side side = test.part.a.present ? Side::kA : Side::kB;
    if (test.kind == ObservationKind::kReacting) {
      ++g.reacting;
      if (first == nullptr) first = &test;
      const Eigen::Vector3d turn =
          vectorFromRotation(first->X_AB.R.transpose() * test.X_AB.R).value;
      if (turn.norm() > kParallel) turns.push_back(turn.normalized());
      g.shifted = g.shifted || (test.X_AB.p - first->X_AB.p).norm() > kShift;
    } else if (test.kind == ObservationKind::kWeight) {
      found[side].weights.push_back(set.observations[test.observation].direction);
    } else {
      const Eigen::Vector3d F = (set.sensor[side].nominal * test.part[side].strain).head<3>();
      if (F.norm() > 0.0) found[side].forces.push_back(F.normalized());
      found[side].points.push_back(test.point);
    }
  }
  if (!turns.empty()) g.turn_axes = spread(turns)[1] > kPlane ? 2 : 1;
  for (const Side side : kSides) judgeSide(found[side], g.on[side]);
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
  if (g.on.a.weights + g.on.b.weights == 0) {
    add("no weight fixes the scale: add at least one weight, better 6 on each sensor along + and - "
        "each axis");
  }
  for (const Side side : kSides) {
    if (g.reacting > 0 || g.on[side].weights >= 6) continue;
    add(std::string("sensor ") + toString(side) +
        " has no reacting tests and too few weights: add reacting tests turned about two axes, "
        "or 18 weights at known points");
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
  const int rank = std::max(g.on.a.weight_rank, g.on.b.weight_rank);
  std::string text;
  if (g.reacting > 0 && g.turn_axes < 2 && rank < 3) {
    text = "reacting tests turn about " + std::to_string(g.turn_axes) +
           " axes and the weights span " + std::to_string(rank) +
           " of 3 directions: add reacting tests turned about two or more axes, or three "
           "non-coplanar weights on one sensor";
  }
  gates.push_back(makeGate("orientations", g.turn_axes, 2, text));
  for (const Side side : kSides) {
    const SideGeometry& on = g.on[side];
    if (on.indentations == 0) continue;
    text.clear();
    if (on.collinear || on.coplanar) {
      text = std::string("indentations of sensor ") + toString(side) +
             (on.collinear
                  ? " lie on one line: add a point off it (three non-collinear points at least)"
                  : " press in coplanar directions: turn the sensor on its datum faces and add "
                    "a third direction");
    }
    // one or two more points beside other tests do no harm
    gates.push_back(makeGate(std::string("indentations_") + toString(side), on.indentations, 0,
                             text, on.indentations < 3 ? Verdict::kWarn : Verdict::kRefuse));
  }
}

// `force_rows`: what is known of the force rows alone, in brackets
void judgeRank(const DesignRank& design, const std::string& force_rows, const Geometry& geometry,
               ForceSolution& out) {
  out.rank = design.rank;
  out.unknowns = design.unknowns;
  out.equations = design.equations;
  out.dof = design.equations - design.unknowns;
  out.condition = design.condition;
  const bool full = design.rank == design.unknowns;
  out.gates.push_back(makeGate("rank", design.rank, design.unknowns,
                               full ? ""
                                    : "rank " + std::to_string(design.rank) + " of " +
                                          std::to_string(design.unknowns) + force_rows +
                                          ", weakest direction: " + out.weak_direction + ": " +
                                          advice(geometry, out.rows)));
  out.gates.push_back(
      makeGate("condition", design.condition, kWarnCondition,
               full && design.condition > kWarnCondition
                   ? format("condition %.3g is above %.3g: ", design.condition, kWarnCondition) +
                         "add tests that move " + out.weak_direction
                   : "",
               Verdict::kWarn));
  out.gates.push_back(makeGate(
      "dof", out.dof, kLeastDof,
      out.dof < kLeastDof
          ? format("%d residual degrees of freedom, below %d: nothing would prove the fit; ",
                   out.dof, kLeastDof) +
                "add " + std::to_string((kLeastDof - out.dof + out.rows - 1) / out.rows) +
                " or more reacting tests or weights"
          : ""));
}

void judgePrediction(const ObservationSet& set, const RatedLoad& rated, ForceSolution& out) {
  const Eigen::Index half = out.rows * out.terms;
  double worst = 0.0;
  for (const Side side : kSides) {
    const Eigen::Index first = side == Side::kA ? 0 : half;
    const Vector6 sd = predictedSd(out.covariance.block(first, first, half, half), out.S[side],
                                   set.sensor[side].nominal, rated);
    const double force = sd.head<3>().norm() / std::sqrt(3.0) / rated.force;
    const double torque = sd.tail<3>().norm() / std::sqrt(3.0) / rated.torque;
    out.predicted_sd[side] = sd;
    // a NaN stays
    const double larger = std::max(force, torque);
    worst = side == Side::kA ? larger : std::max(worst, larger);
  }
  const double limit =
      std::min(set.sensor.a.bits, set.sensor.b.bits) < 16 ? kSdLimitFewBits : kSdLimit;
  out.gates.push_back(makeGate(
      "predicted_sd", worst, limit,
      worst <= limit
          ? ""
          : format("predicted standard deviation of a wrench over rated loads is %.3g %% "
                   "of full scale, above %.3g %%: ",
                   100 * worst, 100 * limit) +
                "add tests that move " + out.weak_direction + ", or average more samples"));
}

void summarise(ForceSolution& out) {
  const std::string reasons = gateTexts(out.gates, Verdict::kRefuse);
  const std::string warnings = gateTexts(out.gates, Verdict::kWarn);
  out.accepted = reasons.empty() && out.procedure == ForceProcedure::kAllRows;
  if (out.procedure != ForceProcedure::kAllRows) {
    out.message = std::string("refused for use: the ") + toString(out.procedure) +
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
  PerSide<Eigen::MatrixXd> S = nominalMatrices(set, system.rows, terms);
  if (start != nullptr && start->converged) {
    for (const Side side : kSides) {
      S[side].setZero();
      S[side].leftCols(start->S[side].cols()) = start->S[side];
    }
  }
  return fitForce(system, S, normalise);
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
void holdOut(ForceSystem system, const ObservationSet& set, const ForceFit& fit, double share,
             ForceSolution& out) {
  const int terms = out.terms;
  out.hold_out_rms = std::numeric_limits<double>::quiet_NaN();
  if (!(share > 0.0)) return;
  const auto step = static_cast<int>(std::lround(1.0 / share));
  std::array<int, 8> count{};
  std::vector<std::size_t> aside;
  for (std::size_t k = 0; k < system.tests.size(); ++k) {
    ForceTest& test = system.tests[k];
    if (!test.used) continue;
    const auto kind = static_cast<std::size_t>(test.kind) + (test.part.a.present ? 0 : 1);
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
  if (std::min(set.sensor.a.bits, set.sensor.b.bits) < kQuadraticBits) {
    return "a converter of 16 bits or more (10 bits fit noise)";
  }
  need(g.reacting, kQuadraticReacting, "reacting tests");
  for (const Side side : kSides) {
    const std::string on = std::string(" on sensor ") + toString(side);
    need(g.on[side].weights, kQuadraticWeights, "weights" + on);
    need(g.on[side].indentations, kQuadraticIndentations, "indentations" + on);
  }
  return out;
}

void takeOver(const ForceSystem& system, const ForceFit& fit, ForceSolution& out) {
  out.S = fit.S;
  out.covariance = fit.covariance;
  out.terms = static_cast<int>(fit.S.a.cols());
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
    if (!test.used) result.dropped = {CalibrationFailure::kOutlier, "outlier"};
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

Gate droppedGate(const std::vector<TestResult>& tests) {
  int count = 0;
  std::string first;
  for (const TestResult& test : tests) {
    if (!test.dropped || test.dropped.code == CalibrationFailure::kOutlier) continue;
    if (++count == 1) first = test.dropped.text;
  }
  return makeGate(
      "dropped", count, 0,
      count > 0 ? std::to_string(count) + " tests dropped, the first because of " + first : "",
      Verdict::kWarn);
}

std::string lackOfFit(const Geometry& geometry, const ObservationSet& set, StrainModel wanted,
                      const ForceSolution& out) {
  if (!(out.p < kLeastP)) return "";
  const double ratio = out.dof > 0 ? out.chi2 / out.dof : 0.0;
  const std::string text = format("chi2/dof %.3g (p %.2g): the ", ratio, out.p) +
                           (out.quadratic ? "quadratic" : "linear") +
                           " model does not fit the tests";
  if (out.quadratic || !(ratio > kModelChi2)) {
    return text + ": check poses, masses and points of the tests with the largest residuals";
  }
  const std::string missing = missingForQuadratic(geometry, set);
  return text + (missing.empty() || wanted == StrainModel::kLinear
                     ? ": use the quadratic model, or restrict the loads to half the rated range"
                     : ": for the quadratic model add " + missing +
                           "; or restrict the loads to half the rated range");
}

void judgeFit(const Geometry& geometry, const ObservationSet& set, StrainModel wanted,
              std::size_t tests, ForceSolution& out) {
  const double ratio = out.dof > 0 ? out.chi2 / out.dof : 0.0;
  out.gates.push_back(makeGate("chi2", out.p, kLeastP, lackOfFit(geometry, set, wanted, out)));
  out.gates.push_back(makeGate(
      "low_chi2", ratio, kLowChi2,
      out.dof >= kLeastDof && ratio < kLowChi2
          ? format("chi2/dof %.3g is below %.3g: the noise is overstated or data are copied", ratio,
                   kLowChi2)
          : "",
      Verdict::kWarn));
  const auto outliers = std::count_if(
      out.tests.begin(), out.tests.end(),
      [](const TestResult& test) { return test.dropped.code == CalibrationFailure::kOutlier; });
  out.gates.push_back(makeGate(
      "outliers", double(outliers), 0.1 * static_cast<double>(tests),
      outliers > 0 ? std::to_string(outliers) + " tests removed as outliers" : "", Verdict::kWarn));
  out.gates.push_back(droppedGate(out.tests));
  out.gates.push_back(
      makeGate("hold_out", out.hold_out_rms, kHoldOut,
               out.hold_out_rms > kHoldOut
                   ? format("tests held out miss by %.3g standard deviations rms, above %.3g: ",
                            out.hold_out_rms, kHoldOut) +
                         "the fit does not predict; add tests"
                   : ""));
}

int rowsOf(ForceProcedure procedure) { return procedure == ForceProcedure::kAllRows ? 6 : 3; }

// geometry, noise-free rank; true when the system can be solved
bool judgeSystem(const ForceSystem& system, const ObservationSet& set,
                 const ForceSettings& settings, int terms, const Geometry& geometry,
                 ForceSolution& out) {
  out.tests = system.dropped;
  out.procedure = settings.procedure;
  out.rows = system.rows;
  out.terms = terms;
  out.quadratic = terms == 27;
  judgeGeometry(geometry, out.gates);
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
  judgeRank(design, force_rows, geometry, out);
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

// linear, or complete quadratic where that is wanted or the linear one fits badly and data suffice;
// `out`: gates of the model taken
Fitted fitModel(const ForceSystem& system, const ObservationSet& set, const ForceSettings& settings,
                const Geometry& geometry, ForceSolution& out) {
  Fitted found{system, {}};
  const std::string missing = missingForQuadratic(geometry, set);
  // a model that is wrong everywhere has no outliers
  const ForceFit linear = fitOf(system, set, nullptr, 6, false);
  if (settings.model == StrainModel::kQuadratic) {
    out.gates.push_back(
        makeGate("quadratic_data", 0, 0,
                 missing.empty() ? "" : "too few data for the quadratic model: add " + missing));
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
  if (!judgeSystem(system, set, settings, 27, geometry, quadratic)) {
    // as it was before: all tests count
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

const char* toString(ForceProcedure procedure) {
  return procedure == ForceProcedure::kAllRows     ? "all_rows"
         : procedure == ForceProcedure::kForceRows ? "force_rows"
                                                   : "thesis";
}

ForceSolution solveForce(const ObservationSet& set, const ForceSettings& settings) {
  checkAll(set);
  const ForceSystem system = buildSystem(set, settings, rowsOf(settings.procedure));
  const Geometry geometry = geometryOf(system, set);
  const int terms = settings.model == StrainModel::kQuadratic ? 27 : 6;
  ForceSolution out;
  const bool solvable = judgeSystem(system, set, settings, terms, geometry, out);
  // the noisy numbers that the thesis would have taken
  if (settings.procedure == ForceProcedure::kThesis) out.S = plainLeastSquares(system);
  if (!solvable) out.gates.push_back(droppedGate(system.dropped));
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
  takeOver(found.system, found.fit, out);
  judgePrediction(set, settings.rated, out);
  holdOut(found.system, set, found.fit, settings.hold_out, out);
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
  if (judgeSystem(system, set, settings, terms, geometry, out)) {
    out.S = nominalMatrices(set, rows, terms);
    const ForceFit fit = covarianceAt(noiseFree(system, set), out.S);
    if (fit.converged) {
      out.covariance = fit.covariance;
      judgePrediction(set, settings.rated, out);
    }
  }
  summarise(out);
  if (out.accepted) {
    out.message = "design is good: rank " + std::to_string(out.rank) + " of " +
                  std::to_string(out.unknowns) +
                  format(", condition %.3g, %d degrees of freedom", out.condition, out.dof);
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
  double warmth = 0.0;
  int warm = 0;
  for (const Observation& o : set.observations) {
    const auto& reading = o.reading[side];
    if (!reading || unusable(*reading, sensor)) continue;
    if (o.kind == ObservationKind::kUnloaded) c.zero_volts = reading->volts;
    if (std::isfinite(reading->temperature)) {
      warmth += reading->temperature;
      ++warm;
    }
  }
  if (warm > 0) c.temperature = warmth / warm;
  for (const TestResult& test : solution.tests) {
    if (test.dropped) continue;
    const auto& reading = set.observations[test.observation].reading[side];
    if (!reading) continue;
    c.wrench_range = c.wrench_range.cwiseMax((reading->volts - c.zero_volts).cwiseAbs());
  }
}

}  // namespace assembly_cell
