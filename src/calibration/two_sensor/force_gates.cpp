// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "force_gates.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {

namespace {

// gates: docs/how_to/calibration.md, "What is refused"
constexpr double kWarnCondition = 100.0;
constexpr double kSdLimitFewBits = 0.01;  // of full scale
constexpr double kSdLimit = 0.001;        // of full scale, 16 bits and more
constexpr int kMinDof = 20;
constexpr double kMinP = 1e-3;
constexpr double kLowChi2 = 0.3;    // χ²/dof
constexpr double kHoldOut = 1.5;    // normalised rms
constexpr double kParallel = 0.02;  // [rad] orientations nearer than that are one
constexpr double kShift = 1e-3;     // [m] poses nearer than that are one
constexpr double kPlane = 0.1;      // singular value of unit directions above which they span it
constexpr int kQuadraticBits = 16, kQuadraticReacting = 60, kQuadraticWeights = 12,
              kQuadraticIndentations = 18;

// rms extents of the rows along their principal axes, largest first
Eigen::Vector3d spread(const std::vector<Eigen::Vector3d>& rows) {
  if (rows.empty()) return Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& row : rows) squares += row * row.transpose();
  squares /= static_cast<double>(rows.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(squares);
  return eigen.eigenvalues().reverse().cwiseMax(0.0).cwiseSqrt();
}

struct Directions {
  std::vector<Eigen::Vector3d> weights, points, forces;
};

void evaluateSide(Directions& found, SideGeometry& g) {
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

std::string lackOfFit(const Geometry& geometry, const ObservationSet& set, StrainModel wanted,
                      const ForceSolution& out) {
  const double ratio = out.dof > 0 ? out.chi2 / out.dof : 0.0;
  const std::string finding = text("chi2/dof %.3g (p %.2g): the ", ratio, out.p) +
                              (out.quadratic ? "quadratic" : "linear") +
                              " model does not fit the tests";
  if (out.quadratic || !(ratio > kModelChi2)) {
    return finding + ": check poses, masses and points of the tests with the largest residuals";
  }
  const std::string missing = missingForQuadratic(geometry, set);
  return finding + (missing.empty() || wanted == StrainModel::kLinear
                        ? ": use the quadratic model, or restrict the loads to half the rated range"
                        : ": for the quadratic model add " + missing +
                              "; or restrict the loads to half the rated range");
}

}  // namespace

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
  for (const Side side : kSides) evaluateSide(found[side], g.on[side]);
  return g;
}

std::string missingForQuadratic(const Geometry& g, const ObservationSet& set) {
  std::string out;
  const auto need = [&](int have, int needed, const std::string& what) {
    if (have >= needed) return;
    out += (out.empty() ? "" : ", ") + std::to_string(needed - have) + " more " + what;
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

void evaluateGeometry(const Geometry& g, std::vector<Gate>& gates) {
  const int rank = std::max(g.on.a.weight_rank, g.on.b.weight_rank);
  addGate(gates, g.reacting > 0 && g.turn_axes < 2 && rank < 3,
          {"orientations", Verdict::kRefuse, double(g.turn_axes), 2,
           "reacting tests turn about " + std::to_string(g.turn_axes) +
               " axes and the weights span " + std::to_string(rank) +
               " of 3 directions: add reacting tests turned about two or more axes, or three "
               "non-coplanar weights on one sensor"});
  for (const Side side : kSides) {
    const SideGeometry& on = g.on[side];
    if (on.indentations == 0) continue;
    // one or two points in addition to other tests are allowed
    addGate(gates, on.collinear || on.coplanar,
            {std::string("indentations_") + toString(side),
             on.indentations < 3 ? Verdict::kWarn : Verdict::kRefuse, double(on.indentations), 0,
             std::string("indentations of sensor ") + toString(side) +
                 (on.collinear
                      ? " lie on one line: add a point off it (three non-collinear points at least)"
                      : " press in coplanar directions: turn the sensor on its datum faces and add "
                        "a third direction")});
  }
}

void evaluateRank(const DesignRank& design, const std::string& force_rows, const Geometry& geometry,
                  ForceSolution& out) {
  out.rank = design.rank;
  out.unknowns = design.unknowns;
  out.equations = design.equations;
  out.dof = design.equations - design.unknowns;
  out.condition = design.condition;
  const bool full = design.rank == design.unknowns;
  addGate(out.gates, !full,
          {"rank", Verdict::kRefuse, double(design.rank), double(design.unknowns),
           "rank " + std::to_string(design.rank) + " of " + std::to_string(design.unknowns) +
               force_rows + ", weakest direction: " + out.weak_direction + ": " +
               advice(geometry, out.rows)});
  addGate(out.gates, full && design.condition > kWarnCondition,
          {"condition", Verdict::kWarn, design.condition, kWarnCondition,
           text("condition %.3g is above %.3g: add tests that move ", design.condition,
                kWarnCondition) +
               out.weak_direction});
  addGate(out.gates, out.dof < kMinDof,
          {"dof", Verdict::kRefuse, double(out.dof), kMinDof,
           text("%d residual degrees of freedom, below %d: nothing would prove the fit; add %d "
                "or more reacting tests or weights",
                out.dof, kMinDof, (kMinDof - out.dof + out.rows - 1) / out.rows)});
}

void evaluatePrediction(const ObservationSet& set, const RatedLoad& rated, ForceSolution& out) {
  const Eigen::Index half = out.rows * out.terms;
  PerSide<double> worst;
  for (const Side side : kSides) {
    const Eigen::Index first = side == Side::kA ? 0 : half;
    const Vector6 sd = predictedSd(out.covariance.block(first, first, half, half), out.S[side],
                                   set.sensor[side].nominal, rated);
    out.predicted_sd[side] = sd;
    worst[side] = std::max(sd.head<3>().norm() / std::sqrt(3.0) / rated.force,
                           sd.tail<3>().norm() / std::sqrt(3.0) / rated.torque);
  }
  const double value = std::max(worst.a, worst.b);
  const double limit =
      std::min(set.sensor.a.bits, set.sensor.b.bits) < 16 ? kSdLimitFewBits : kSdLimit;
  addGate(out.gates, !(value <= limit),
          {"predicted_sd", Verdict::kRefuse, value, limit,
           text("predicted standard deviation of a wrench over rated loads is %.3g %% of full "
                "scale, above %.3g %%: add tests that move ",
                100 * value, 100 * limit) +
               out.weak_direction + ", or average more samples"});
}

void evaluateDropped(ForceSolution& out) {
  int count = 0;
  std::string first;
  for (const TestResult& test : out.tests) {
    if (!test.dropped || test.dropped.code == CalibrationFailure::kOutlier) continue;
    if (++count == 1) first = test.dropped.text;
  }
  addGate(out.gates, count > 0,
          {"dropped", Verdict::kWarn, double(count), 0,
           std::to_string(count) + " tests dropped, the first because of " + first});
}

void evaluateFit(const Geometry& geometry, const ObservationSet& set, StrainModel wanted,
                 std::size_t tests, ForceSolution& out) {
  const double ratio = out.dof > 0 ? out.chi2 / out.dof : 0.0;
  addGate(out.gates, out.p < kMinP,
          {"chi2", Verdict::kRefuse, out.p, kMinP, lackOfFit(geometry, set, wanted, out)});
  addGate(out.gates, out.dof >= kMinDof && ratio < kLowChi2,
          {"low_chi2", Verdict::kWarn, ratio, kLowChi2,
           text("chi2/dof %.3g is below %.3g: the noise is overstated or data are copied", ratio,
                kLowChi2)});
  const auto outliers = std::count_if(
      out.tests.begin(), out.tests.end(),
      [](const TestResult& test) { return test.dropped.code == CalibrationFailure::kOutlier; });
  addGate(out.gates, outliers > 0,
          {"outliers", Verdict::kWarn, double(outliers), 0.1 * double(tests),
           std::to_string(outliers) + " tests removed as outliers"});
  evaluateDropped(out);
  addGate(out.gates, out.hold_out_rms > kHoldOut,
          {"hold_out", Verdict::kRefuse, out.hold_out_rms, kHoldOut,
           text("tests held out miss by %.3g standard deviations rms, above %.3g: the fit does "
                "not predict; add tests",
                out.hold_out_rms, kHoldOut)});
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
                  text(" model, chi2/dof %.3g", out.dof > 0 ? out.chi2 / out.dof : 0.0) + " with " +
                  std::to_string(out.dof) + " degrees of freedom";
  }
  if (!warnings.empty()) out.message += "; warning: " + warnings;
}

}  // namespace assembly_cell
