// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/displacement.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "format.h"

namespace assembly_cell {

namespace {

constexpr double kRank = 1e-8;
constexpr double kWorstCondition = 30.0;
constexpr double kResidual = 3.0;         // times the expected noise
constexpr double kCorner = 0.7;           // of the central composite
constexpr Eigen::Index kFewestTests = 6;  // for a name of the weak direction

// columns of the complete 27 that a model has
std::vector<int> columnsOf(DisplacementModel model) {
  std::vector<int> columns;
  for (int k = 0; k < (model == DisplacementModel::kQuadratic ? 27 : 6); ++k) columns.push_back(k);
  if (model != DisplacementModel::kThesis) return columns;
  for (int i = 0, k = 6; i < 6; k += 6 - i, ++i) columns.push_back(k);  // squares
  return columns;
}

std::string termName(int column) {
  if (column < 6) return "channel " + std::to_string(column);
  for (int i = 0, k = 6; i < 6; ++i) {
    for (int j = i; j < 6; ++j, ++k) {
      if (k == column) {
        return "channel " + std::to_string(i) + " times channel " + std::to_string(j);
      }
    }
  }
  return "";
}

Eigen::Matrix<double, 27, 1> allTerms(const Vector6& s) {
  Eigen::Matrix<double, 27, 1> x;
  x << s, strainProducts(s);
  return x;
}

// strains against the unloaded reading before, poses from the gauges
struct Movements {
  std::vector<Vector6> strains, poses;
  Matrix6 gauge_covariance = Matrix6::Zero(), strain_covariance = Matrix6::Zero();
};

Movements movementsOf(const ObservationSet& set, Side side, DisplacementSolution& out) {
  Movements found;
  std::optional<Vector6> zero;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const auto& reading = o.reading[side];
    const std::string source = "observations[" + std::to_string(i) + "]";
    const bool usable = reading && !unusable(*reading, set.sensor[side]);
    if (o.kind == ObservationKind::kUnloaded && usable) zero = reading->volts;
    if (o.kind != ObservationKind::kDisplacement || o.side != side) continue;
    checkObservation(o, set, source);
    if (!usable || !zero) {
      out.dropped.push_back(
          source + ": " +
          (usable ? "no unloaded reading before it" : unusable(*reading, set.sensor[side]).text));
      continue;
    }
    Vector6 d;
    if (o.displacement) {
      d = *o.displacement;
      found.gauge_covariance.diagonal().setConstant(set.accuracy.gauge * set.accuracy.gauge);
    } else {
      const GaugePose pose = poseFromGauges(set.gauges[side], o.gauges, set.accuracy.gauge);
      if (pose.suspect >= 0) {
        out.dropped.push_back(source + ": gauge " + std::to_string(pose.suspect) +
                              " contradicts the others");
        continue;
      }
      d << pose.X_DC.p, vectorFromRotation(pose.X_DC.R).value;
      found.gauge_covariance = pose.covariance;
    }
    found.strains.push_back(reading->volts - *zero);
    found.poses.push_back(d);
    found.strain_covariance += reading->covariance;
    out.range = out.range.cwiseMax(found.strains.back().cwiseAbs());
  }
  if (!found.strains.empty()) found.strain_covariance /= double(found.strains.size());
  return found;
}

// rank, condition and weak direction of the design; true when it can be solved
bool judgeDesign(const Eigen::MatrixXd& Z, const std::vector<int>& columns,
                 DisplacementSolution& out) {
  std::string& weak = out.weak_direction = "every channel";
  if (Z.rows() >= kFewestTests) {
    const Eigen::VectorXd norms = Z.colwise().norm().transpose().cwiseMax(1e-300);
    const Eigen::JacobiSVD<Eigen::MatrixXd> scaled(Z * norms.cwiseInverse().asDiagonal(),
                                                   Eigen::ComputeFullV);
    for (const double value : scaled.singularValues()) {
      out.rank += value > kRank * scaled.singularValues()[0] ? 1 : 0;
    }
    Eigen::Index which = 0;
    scaled.matrixV().col(out.terms - 1).cwiseAbs().maxCoeff(&which);
    weak = termName(columns[which]);
    const Eigen::JacobiSVD<Eigen::MatrixXd> plain(Z);
    const auto& values = plain.singularValues();
    out.condition = out.rank == out.terms ? values[0] / values[out.terms - 1] : HUGE_VAL;
  }
  const bool full = out.rank == out.terms;
  out.gates.push_back(makeGate(
      "rank", out.rank, out.terms,
      full
          ? ""
          : "rank " + std::to_string(out.rank) + " of " + std::to_string(out.terms) + " with " +
                std::to_string(out.tests) + " displacement tests, weakest direction: " + weak +
                ": add tests that strain it both ways" +
                (out.model == DisplacementModel::kQuadratic ? ", 46 in a central composite are best"
                                                            : "")));
  if (!full) return false;
  out.gates.push_back(makeGate("condition", out.condition, kWorstCondition,
                               out.condition > kWorstCondition
                                   ? format("condition %.3g is above %.3g, weakest direction: ",
                                            out.condition, kWorstCondition) +
                                         weak + ": add tests that strain it both ways"
                                   : ""));
  return true;
}

void judgeFit(DisplacementSolution& out) {
  const double ratio = out.residual_sd.cwiseQuotient(out.output_sd).maxCoeff();
  out.gates.push_back(makeGate(
      "residual", ratio, kResidual,
      ratio <= kResidual
          ? ""
          : format("residuals are %.3g times the noise of gauges and strain, above %.3g: ", ratio,
                   kResidual) +
                (out.model == DisplacementModel::kQuadratic
                     ? "reduce the range or check the gauges"
                     : "use the complete quadratic model with 46 tests")));
  out.gates.push_back(
      makeGate("lack_of_fit", out.p, 1e-3,
               out.dof > 0 && out.p < 1e-3
                   ? format("chi2/dof %.3g (p %.2g): the residuals are more than gauge noise",
                            out.chi2 / (6 * out.dof), out.p)
                   : "",
               Verdict::kWarn));
}

void summarise(DisplacementSolution& out) {
  out.gates.push_back(makeGate(
      "dropped", double(out.dropped.size()), 0,
      out.dropped.empty()
          ? ""
          : std::to_string(out.dropped.size()) + " tests dropped, the first: " + out.dropped[0],
      Verdict::kWarn));
  const std::string reasons = gateTexts(out.gates, Verdict::kRefuse);
  const std::string warnings = gateTexts(out.gates, Verdict::kWarn);
  out.accepted = reasons.empty() && out.model != DisplacementModel::kThesis;
  if (!reasons.empty()) {
    out.message = "refused: " + reasons;
  } else if (out.model == DisplacementModel::kThesis) {
    out.message =
        "refused for use: the thesis model leaves out the products of different strains; "
        "use the quadratic model with 46 tests";
  } else {
    out.message = std::to_string(out.tests) + " tests" +
                  format(", condition %.3g, residual %.3g m", out.condition,
                         out.residual_sd.head<3>().maxCoeff());
  }
  if (!warnings.empty()) out.message += "; warning: " + warnings;
}

}  // namespace

DisplacementSolution solveDisplacement(const ObservationSet& set, Side side,
                                       DisplacementModel model) {
  DisplacementSolution out;
  out.model = model;
  const std::vector<int> columns = columnsOf(model);
  out.terms = static_cast<int>(columns.size());
  out.T = Eigen::MatrixXd::Zero(6, 27);
  const Movements found = movementsOf(set, side, out);
  const auto n = static_cast<Eigen::Index>(found.strains.size());
  out.tests = static_cast<int>(n);
  out.dof = out.tests - out.terms;

  // one matrix for six right sides; strains in parts of their range
  const auto scale = allTerms(out.range.cwiseMax(1e-12));
  Eigen::MatrixXd Z(n, out.terms), Y(n, 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto x = allTerms(found.strains[i]);
    for (int c = 0; c < out.terms; ++c) Z(i, c) = x[columns[c]] / scale[columns[c]];
    Y.row(i) = found.poses[i].transpose();
  }
  if (judgeDesign(Z, columns, out)) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(Z);
    const Eigen::MatrixXd solution = qr.solve(Y);
    const Eigen::MatrixXd inverse =
        (Z.transpose() * Z).llt().solve(Eigen::MatrixXd::Identity(out.terms, out.terms));
    out.unit_covariance = Eigen::MatrixXd::Zero(27, 27);
    for (int c = 0; c < out.terms; ++c) {
      const int k = columns[c];
      out.T.col(k) = solution.row(c).transpose() / scale[k];
      for (int e = 0; e < out.terms; ++e) {
        const int l = columns[e];
        out.unit_covariance(k, l) = 0.5 * (inverse(c, e) + inverse(e, c)) / scale[k] / scale[l];
      }
    }
    const Eigen::MatrixXd residuals = Y - Z * solution;
    const Matrix6 expected = found.gauge_covariance + out.T.leftCols<6>() *
                                                          found.strain_covariance *
                                                          out.T.leftCols<6>().transpose();
    out.output_sd = expected.diagonal().cwiseSqrt();
    if (out.dof > 0) {
      out.residual_sd = (residuals.colwise().squaredNorm().transpose() / out.dof).cwiseSqrt();
      const Eigen::LLT<Matrix6> root(expected);
      out.chi2 = root.matrixL().solve(residuals.transpose()).squaredNorm();
      out.p = chi2Tail(out.chi2, 6 * out.dof);
    }
    judgeFit(out);
  }
  summarise(out);
  return out;
}

void applyDisplacement(const DisplacementSolution& s, Calibration& c) {
  if (!s.accepted) throw InputError("displacement calibration: " + s.message);
  c.volts_to_displacement = s.T.leftCols<6>();
  c.quadratic_displacement = s.model == DisplacementModel::kQuadratic;
  c.displacement_products.setZero();
  if (c.quadratic_displacement) c.displacement_products = s.T.rightCols<kStrainProducts>();
  const int terms = c.quadratic_displacement ? 27 : 6;
  c.displacement_covariance = s.unit_covariance.topLeftCorner(terms, terms);
  // where the fit is worse than its noise the residuals speak
  c.displacement_variance = s.output_sd.cwiseMax(s.residual_sd).cwiseAbs2();
  c.displacement_range = s.range;
  c.displacement_fit = {s.chi2, 6 * s.dof, s.p, s.residual_sd, s.output_sd};
}

std::vector<Vector6> centralComposite() {
  std::vector<Vector6> out;
  for (unsigned bits = 0; bits < 32; ++bits) {
    Vector6 s;
    double product = 1.0;
    for (int k = 0; k < 5; ++k) {
      s[k] = (bits >> k & 1u) != 0 ? kCorner : -kCorner;
      product *= s[k] > 0 ? 1.0 : -1.0;
    }
    s[5] = product * kCorner;  // sixth factor: the product of the others
    out.push_back(s);
  }
  for (int k = 0; k < 6; ++k) {
    out.push_back(Vector6::Unit(k));
    out.push_back(-Vector6::Unit(k));
  }
  out.push_back(Vector6::Zero());
  out.push_back(Vector6::Zero());
  return out;
}

}  // namespace assembly_cell
