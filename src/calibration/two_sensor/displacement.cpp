// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/displacement.h"

#include <Eigen/Cholesky>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/math/distributions.h"

namespace assembly_cell {

namespace {

constexpr int kTerms = 27;  // strains and all products
constexpr double kTestsRank = 1e-8;
constexpr double kWorstCondition = 30.0;
constexpr double kResidual = 3.0;      // largest ratio of residual to expected noise
constexpr double kCorner = 0.7;        // corner of the central composite design
constexpr Eigen::Index kMinTests = 6;  // below it the weak direction has no name

std::string termName(Eigen::Index column) {
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

// Rank, condition and weak direction of the design Z; true when it can be solved.
bool evaluateDesign(const Eigen::MatrixXd& Z, DisplacementSolution& out) {
  std::string& weak = out.weak_direction = "every channel";
  if (Z.rows() >= kMinTests) {
    const Eigen::VectorXd norms = Z.colwise().norm().transpose().cwiseMax(1e-300);
    const Eigen::JacobiSVD<Eigen::MatrixXd> scaled(Z * norms.cwiseInverse().asDiagonal(),
                                                   Eigen::ComputeFullV);
    for (const double value : scaled.singularValues()) {
      out.rank += value > kTestsRank * scaled.singularValues()[0] ? 1 : 0;
    }
    Eigen::Index which = 0;
    scaled.matrixV().col(kTerms - 1).cwiseAbs().maxCoeff(&which);
    weak = termName(which);
    const Eigen::JacobiSVD<Eigen::MatrixXd> plain(Z);
    const auto& values = plain.singularValues();
    out.condition = out.rank == kTerms ? values[0] / values[kTerms - 1] : HUGE_VAL;
  }
  addGate(out.gates, out.rank < kTerms,
          {"rank", Verdict::kRefuse, double(out.rank), kTerms,
           "rank " + std::to_string(out.rank) + " of " + std::to_string(kTerms) + " with " +
               std::to_string(out.tests) + " displacement tests, weakest direction: " + weak +
               ": add tests that strain it both ways, 46 in a central composite are best"});
  if (out.rank < kTerms) return false;
  addGate(
      out.gates, out.condition > kWorstCondition,
      {"condition", Verdict::kRefuse, out.condition, kWorstCondition,
       text("condition %.3g is above %.3g, weakest direction: ", out.condition, kWorstCondition) +
           weak + ": add tests that strain it both ways"});
  return true;
}

void summarise(DisplacementSolution& out) {
  const std::size_t dropped = out.dropped.size();
  addGate(out.gates, dropped > 0,
          {"dropped", Verdict::kWarn, double(dropped), 0,
           std::to_string(dropped) +
               " tests dropped, the first: " + (dropped > 0 ? out.dropped[0] : "")});
  const std::string reasons = gateTexts(out.gates, Verdict::kRefuse);
  const std::string warnings = gateTexts(out.gates, Verdict::kWarn);
  out.accepted = reasons.empty();
  out.message = out.accepted ? std::to_string(out.tests) + " tests" +
                                   text(", condition %.3g, residual %.3g m", out.condition,
                                        out.residual_sd.head<3>().maxCoeff())
                             : "refused: " + reasons;
  if (!warnings.empty()) out.message += "; warning: " + warnings;
}

}  // namespace

DisplacementSolution solveDisplacement(const ObservationSet& set, Side side) {
  DisplacementSolution out;
  const Movements found = movementsOf(set, side, out);
  const std::size_t n = found.strains.size();
  out.tests = static_cast<int>(n);
  out.dof = out.tests - kTerms;

  // one matrix for six right sides; strains in parts of their range
  const auto scale = allTerms(out.range.cwiseMax(1e-12));
  Eigen::MatrixXd Z(n, kTerms), Y(n, 6);
  for (std::size_t i = 0; i < n; ++i) {
    Z.row(i) = allTerms(found.strains[i]).cwiseQuotient(scale).transpose();
    Y.row(i) = found.poses[i].transpose();
  }
  if (evaluateDesign(Z, out)) {
    const Eigen::HouseholderQR<Eigen::MatrixXd> qr(Z);
    const Eigen::MatrixXd solution = qr.solve(Y);
    const Eigen::MatrixXd inverse =
        (Z.transpose() * Z).llt().solve(Eigen::MatrixXd::Identity(kTerms, kTerms));
    for (int k = 0; k < kTerms; ++k) {
      out.T.col(k) = solution.row(k).transpose() / scale[k];
      for (int l = 0; l < kTerms; ++l) {
        out.unit_covariance(k, l) = 0.5 * (inverse(k, l) + inverse(l, k)) / scale[k] / scale[l];
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
      out.p = chiSquareTail(out.chi2, 6 * out.dof);
    }
    const double ratio = out.residual_sd.cwiseQuotient(out.output_sd).maxCoeff();
    addGate(out.gates, !(ratio <= kResidual),
            {"residual", Verdict::kRefuse, ratio, kResidual,
             text("residuals are %.3g times the noise of gauges and strain, above %.3g: reduce "
                  "the range or check the gauges",
                  ratio, kResidual)});
    addGate(out.gates, out.dof > 0 && out.p < 1e-3,
            {"lack_of_fit", Verdict::kWarn, out.p, 1e-3,
             text("chi2/dof %.3g (p %.2g): the residuals are more than gauge noise",
                  out.chi2 / (6 * out.dof), out.p)});
  }
  summarise(out);
  return out;
}

void applyDisplacement(const DisplacementSolution& s, Calibration& c) {
  if (!s.accepted) throw InputError("displacement calibration: " + s.message);
  c.volts_to_displacement = s.T.leftCols<6>();
  c.quadratic_displacement = true;
  c.displacement_products = s.T.rightCols<kStrainProducts>();
  c.displacement_covariance = s.unit_covariance;
  // the larger of expected and measured: a poor fit shows in its residuals
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
