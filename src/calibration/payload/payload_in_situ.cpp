// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>

#include "bias_series.h"
#include "payload_parts.h"

namespace assembly_cell {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// gravity's directions in sensor axes have to fill space
bool fillSpace(const std::vector<Vector3d>& loads, double weight) {
  const auto n = static_cast<double>(loads.size());
  Matrix3d second = Matrix3d::Zero();
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& f : loads) mean += f / n;
  for (const Vector3d& f : loads) second += (f - mean) * (f - mean).transpose();
  second /= n;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> spread(second);
  return !(std::sqrt(spread.eigenvalues()[0]) < 0.15 * weight);
}

}  // namespace

InSituCorrection correctInSitu(const PayloadModel& model, const bias_series::Problem& problem,
                               const PayloadOptions& options) {
  InSituCorrection out;
  const std::size_t n = problem.R.size();
  if (n < 20) {
    out.reason = std::to_string(n) + " poses: the 15 gains and cross-talks need at least 20";
    return out;
  }
  std::vector<Vector3d> load;
  for (const Matrix3d& R : problem.R) load.push_back(R.transpose() * model.gravity);
  if (!fillSpace(load, model.weight)) {
    out.reason = "gravity's directions in sensor axes lie near a plane: tilt about other axes too";
    return out;
  }
  // each component: bias model as found, three free gains about the fitted load
  Matrix3d A = Matrix3d::Identity(), T = Matrix3d::Zero();
  double gain = 0.0;
  for (std::size_t axis = 0; axis < 6; ++axis) {
    const bool force = axis < 3;
    const std::size_t a = axis % 3;
    const BiasComponent& b = model.group[axis / 3].component[a];
    MatrixXd X(n, 3 + b.own_effects);
    VectorXd y(n);
    for (std::size_t i = 0; i < n; ++i) {
      const Vector3d expected = force ? load[i] : Vector3d(model.center_of_mass.cross(load[i]));
      X.row(i).head<3>() = load[i].transpose();
      y[i] = problem.w[i][axis] - expected[a];
    }
    X.rightCols(b.own_effects) = b.design.middleCols(b.first_effect, b.own_effects);
    const MatrixXd Xw = b.whitener * X;
    const VectorXd yw = b.whitener * y;
    const VectorXd x = Xw.colPivHouseholderQr().solve(yw);
    const MatrixXd own = Xw.rightCols(b.own_effects);
    const VectorXd x0 = own.colPivHouseholderQr().solve(yw);
    gain += ((yw - own * x0).squaredNorm() - (yw - Xw * x).squaredNorm()) / (b.noise * b.noise);
    (force ? A : T).row(a) += x.head<3>().transpose();
    if (force) {
      const MatrixXd P = (Xw.transpose() * Xw).inverse() * b.noise * b.noise;
      out.largest_sd = std::max(out.largest_sd, std::sqrt(P.diagonal().head<3>().maxCoeff()));
    }
  }
  const double scale =
      options.known_weight ? *options.known_weight / model.weight : 3.0 / A.trace();
  // shared effects were fitted already: 18 gains less weight vector (3) and centre of mass (3)
  out.p = bias_series::chiSquareTail(12, gain);
  const Matrix3d force = scale * A.inverse();
  const Matrix3d cross = 0.5 * (T + T.transpose());
  if (out.largest_sd > 0.02) {
    out.reason = "elements of the force block are known to " + std::to_string(out.largest_sd) +
                 " only: record more poses";
    return out;
  }
  if (out.p > 0.01 && !options.known_weight) {
    out.reason = "residuals ask for no correction: p = " + std::to_string(out.p);
    return out;
  }
  out.given = true;
  out.reason = options.known_weight ? "scale from the known weight"
                                    : "scale unknown without a known weight: mean gain kept at 1";
  out.matrix.topLeftCorner<3, 3>() = force;
  out.matrix.bottomLeftCorner<3, 3>() = -cross * A.inverse();
  return out;
}

}  // namespace assembly_cell
