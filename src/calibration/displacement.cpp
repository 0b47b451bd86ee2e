// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/displacement.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>
#include <cstdio>

#include "assembly_cell/scene/input_error.h"

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

std::string format(const char* pattern, double a, double b) {
  char text[200];
  std::snprintf(text, sizeof text, pattern, a, b);
  return text;
}

}  // namespace

DisplacementSolution solveDisplacement(const ObservationSet& set, Side side,
                                       DisplacementModel model) {
  const SensorDescription& sensor = side == Side::kA ? set.a : set.b;
  const GaugeLayout& layout = side == Side::kA ? set.gauges_a : set.gauges_b;
  DisplacementSolution out;
  out.model = model;
  const std::vector<int> columns = columnsOf(model);
  out.terms = static_cast<int>(columns.size());
  out.T = Eigen::MatrixXd::Zero(6, 27);

  // strains against the unloaded reading before, poses from the gauges
  std::vector<Vector6> strains, poses;
  Matrix6 gauge_covariance = Matrix6::Zero(), strain_covariance = Matrix6::Zero();
  Vector6 zero = Vector6::Zero();
  bool zeroed = false;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    const auto& reading = side == Side::kA ? o.a : o.b;
    const std::string source = "observations[" + std::to_string(i) + "]";
    if (o.kind == ObservationKind::kUnloaded && reading && unusable(*reading, sensor).empty()) {
      zero = reading->volts;
      zeroed = true;
    }
    if (o.kind != ObservationKind::kDisplacement || o.side != side) continue;
    checkObservation(o, set, source);
    std::string why = unusable(*reading, sensor);
    if (why.empty() && !zeroed) why = "no unloaded reading before it";
    if (!why.empty()) {
      out.dropped.push_back(source + ": " + why);
      continue;
    }
    Vector6 d;
    if (o.displacement) {
      d = *o.displacement;
      gauge_covariance.diagonal().setConstant(set.accuracy.gauge * set.accuracy.gauge);
    } else {
      const GaugePose pose = poseFromGauges(layout, o.gauges, set.accuracy.gauge);
      if (pose.suspect >= 0) {
        out.dropped.push_back(source + ": gauge " + std::to_string(pose.suspect) +
                              " contradicts the others");
        continue;
      }
      d << pose.X_DC.p, vectorFromRotation(pose.X_DC.R).value;
      gauge_covariance = pose.covariance;
    }
    strains.push_back(reading->volts - zero);
    poses.push_back(d);
    strain_covariance += reading->covariance;
    out.range = out.range.cwiseMax(strains.back().cwiseAbs());
  }
  const auto n = static_cast<Eigen::Index>(strains.size());
  out.tests = static_cast<int>(n);
  out.dof = out.tests - out.terms;
  if (n > 0) strain_covariance /= static_cast<double>(n);

  // one matrix for six right sides; strains in parts of their range
  Eigen::Matrix<double, 27, 1> scale;
  const Vector6 range = out.range.cwiseMax(1e-12);
  scale << range, strainProducts(range);
  Eigen::MatrixXd Z(n, out.terms), Y(n, 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto x = allTerms(strains[static_cast<std::size_t>(i)]);
    for (int c = 0; c < out.terms; ++c) {
      const int k = columns[static_cast<std::size_t>(c)];
      Z(i, c) = x[k] / scale[k];
    }
    Y.row(i) = poses[static_cast<std::size_t>(i)].transpose();
  }
  Eigen::VectorXd norms = Eigen::VectorXd::Ones(out.terms);
  if (n > 0) norms = Z.colwise().norm().transpose().cwiseMax(1e-300);
  std::string weak = "every channel";
  if (n >= kFewestTests) {
    const Eigen::JacobiSVD<Eigen::MatrixXd> scaled(Z * norms.cwiseInverse().asDiagonal(),
                                                   Eigen::ComputeFullV);
    for (const double value : scaled.singularValues()) {
      out.rank += value > kRank * scaled.singularValues()[0] ? 1 : 0;
    }
    Eigen::Index which = 0;
    scaled.matrixV().col(out.terms - 1).cwiseAbs().maxCoeff(&which);
    weak = termName(columns[static_cast<std::size_t>(which)]);
    const Eigen::JacobiSVD<Eigen::MatrixXd> plain(Z);
    const auto& values = plain.singularValues();
    out.condition = out.rank == out.terms ? values[0] / values[out.terms - 1] : HUGE_VAL;
  }
  out.weak_direction = weak;
  Gate rank{"rank", Verdict::kPass, double(out.rank), double(out.terms), ""};
  if (out.rank < out.terms) {
    rank.verdict = Verdict::kRefuse;
    rank.text =
        "rank " + std::to_string(out.rank) + " of " + std::to_string(out.terms) + " with " +
        std::to_string(out.tests) + " displacement tests, weakest direction: " + weak +
        ": add tests that strain it both ways" +
        (model == DisplacementModel::kQuadratic ? ", 46 in a central composite are best" : "");
  }
  out.gates.push_back(rank);

  if (rank.verdict == Verdict::kPass) {
    Gate condition{"condition", Verdict::kPass, out.condition, kWorstCondition, ""};
    if (out.condition > kWorstCondition) {
      condition.verdict = Verdict::kRefuse;
      condition.text = format("condition %.3g is above %.3g, weakest direction: ", out.condition,
                              kWorstCondition) +
                       weak + ": add tests that strain it both ways";
    }
    out.gates.push_back(condition);

    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(Z);
    const Eigen::MatrixXd solution = qr.solve(Y);
    const Eigen::MatrixXd inverse =
        (Z.transpose() * Z).llt().solve(Eigen::MatrixXd::Identity(out.terms, out.terms));
    out.unit_covariance = Eigen::MatrixXd::Zero(27, 27);
    for (int c = 0; c < out.terms; ++c) {
      const int k = columns[static_cast<std::size_t>(c)];
      out.T.col(k) = solution.row(c).transpose() / scale[k];
      for (int e = 0; e < out.terms; ++e) {
        const int l = columns[static_cast<std::size_t>(e)];
        out.unit_covariance(k, l) = 0.5 * (inverse(c, e) + inverse(e, c)) / scale[k] / scale[l];
      }
    }
    const Eigen::MatrixXd residuals = Y - Z * solution;
    const Matrix6 expected = gauge_covariance + out.T.leftCols<6>() * strain_covariance *
                                                    out.T.leftCols<6>().transpose();
    out.output_sd = expected.diagonal().cwiseSqrt();
    if (out.dof > 0) {
      out.residual_sd = (residuals.colwise().squaredNorm().transpose() / out.dof).cwiseSqrt();
      const Eigen::LLT<Matrix6> root(expected);
      out.chi2 = root.matrixL().solve(residuals.transpose()).squaredNorm();
      out.p = chi2Tail(out.chi2, 6 * out.dof);
    }
    Gate residual{"residual", Verdict::kPass,
                  (out.residual_sd.cwiseQuotient(out.output_sd)).maxCoeff(), kResidual, ""};
    if (!(residual.value <= kResidual)) {
      residual.verdict = Verdict::kRefuse;
      residual.text =
          format("residuals are %.3g times the noise of gauges and strain, above %.3g: ",
                 residual.value, kResidual) +
          (model == DisplacementModel::kQuadratic
               ? "reduce the range or check the gauges"
               : "use the complete quadratic model with 46 tests");
    }
    out.gates.push_back(residual);
    Gate fit{"lack_of_fit", Verdict::kPass, out.p, 1e-3, ""};
    if (out.dof > 0 && out.p < 1e-3) {
      fit.verdict = Verdict::kWarn;
      fit.text = format("chi2/dof %.3g (p %.2g): the residuals are more than gauge noise",
                        out.chi2 / (6 * out.dof), out.p);
    }
    out.gates.push_back(fit);
  }
  Gate dropped{"dropped", Verdict::kPass, double(out.dropped.size()), 0, ""};
  if (!out.dropped.empty()) {
    dropped.verdict = Verdict::kWarn;
    dropped.text =
        std::to_string(out.dropped.size()) + " tests dropped, the first: " + out.dropped[0];
  }
  out.gates.push_back(dropped);

  const std::string reasons = gateTexts(out.gates, Verdict::kRefuse);
  const std::string warnings = gateTexts(out.gates, Verdict::kWarn);
  out.accepted = reasons.empty() && model != DisplacementModel::kThesis;
  if (!reasons.empty()) {
    out.message = "refused: " + reasons;
  } else if (model == DisplacementModel::kThesis) {
    out.message =
        "refused for use: the thesis model leaves out the products of different strains; "
        "use the quadratic model with 46 tests";
  } else {
    out.message = std::to_string(out.tests) + " tests" +
                  format(", condition %.3g, residual %.3g m", out.condition,
                         out.residual_sd.head<3>().maxCoeff());
  }
  if (!warnings.empty()) out.message += "; warning: " + warnings;
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
  for (const Vector6& s : oneChannelAtATime()) out.push_back(s);
  out.push_back(Vector6::Zero());
  out.push_back(Vector6::Zero());
  return out;
}

std::vector<Vector6> oneChannelAtATime() {
  std::vector<Vector6> out;
  for (int k = 0; k < 6; ++k) {
    out.push_back(Vector6::Unit(k));
    out.push_back(-Vector6::Unit(k));
  }
  return out;
}

std::vector<Vector6> conferenceDesign() {
  // Paley: squares modulo 5 are 1 and 4
  Matrix6 C = Matrix6::Zero();
  for (int i = 1; i < 6; ++i) {
    C(0, i) = C(i, 0) = 1.0;
    for (int j = 1; j < 6; ++j) {
      const int d = (i - j + 5) % 5;
      if (d != 0) C(i, j) = d == 1 || d == 4 ? 1.0 : -1.0;
    }
  }
  std::vector<Vector6> out;
  for (int i = 0; i < 6; ++i) {
    out.push_back(C.row(i).transpose());
    out.push_back(-C.row(i).transpose());
  }
  return out;
}

}  // namespace assembly_cell
