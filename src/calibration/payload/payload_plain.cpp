// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "assembly_cell/calibration/payload/payload.h"
#include "assembly_cell/math/distributions.h"

namespace assembly_cell {

namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// what leaves a base level by the F test
constexpr double kLevelTail = 1e-3;

struct PlainFit {
  VectorXd x;
  MatrixXd inverse;
  double squares = 0.0;
};

// Three equations a pose: a constant in sensor axes and `load` of the pose.
template <typename Load>
PlainFit fit(const std::vector<Vector6>& wrenches, Eigen::Index part, Eigen::Index unknowns,
             const Load& load) {
  MatrixXd normal = MatrixXd::Zero(3 + unknowns, 3 + unknowns);
  VectorXd moment = VectorXd::Zero(3 + unknowns);
  double squares = 0.0;
  MatrixXd A(3, 3 + unknowns);
  for (std::size_t i = 0; i < wrenches.size(); ++i) {
    A << Eigen::Matrix3d::Identity(), load(i);
    const Vector3d y = wrenches[i].segment<3>(part);
    normal += A.transpose() * A;
    moment += A.transpose() * y;
    squares += y.squaredNorm();
  }
  PlainFit out;
  const Eigen::LDLT<MatrixXd> solver(normal);
  out.x = solver.solve(moment);
  out.inverse = solver.solve(MatrixXd::Identity(normal.rows(), normal.cols()));
  out.squares = std::max(squares - out.x.dot(moment), 0.0);
  return out;
}

}  // namespace

PlainPayload plainPayload(const std::vector<StaticPose>& poses,
                          const std::vector<Vector6>& wrenches) {
  PlainPayload out;
  const auto rows = static_cast<double>(3 * wrenches.size());
  const auto turned = [&](std::size_t i) -> MatrixXd { return poses[i].R.transpose(); };
  PlainFit force = fit(wrenches, 0, 3, turned);
  const Vector3d down = force.x[5] < 0.0 ? Vector3d(-Vector3d::UnitZ()) : Vector3d::UnitZ();
  const PlainFit level =
      fit(wrenches, 0, 1, [&](std::size_t i) -> MatrixXd { return poses[i].R.transpose() * down; });
  const double dof = rows - 6.0;
  const double f = (level.squares - force.squares) / 2.0 / (force.squares / dof);
  out.level_p = fTail(f, 2.0, dof);
  const double tilt = std::atan2(force.x.tail<3>().head<2>().norm(), std::abs(force.x[5]));
  out.level = tilt < kLevelBase || out.level_p > kLevelTail;
  if (out.level) force = level;
  out.gravity = out.level ? Vector3d(force.x[3] * down) : Vector3d(force.x.tail<3>());
  const double variance = force.squares / (rows - static_cast<double>(force.x.size()));
  const Vector3d u = out.gravity.normalized();
  const auto n = force.inverse.rows();
  out.weight_sd =
      std::sqrt(variance * (out.level ? force.inverse(3, 3)
                                      : u.dot(force.inverse.block(n - 3, n - 3, 3, 3) * u)));
  const PlainFit torque = fit(wrenches, 3, 3, [&](std::size_t i) -> MatrixXd {
    return -skew(poses[i].R.transpose() * out.gravity);
  });
  out.center_of_mass = torque.x.tail<3>();
  const double torque_variance = torque.squares / (rows - 6.0);
  out.center_sd = (torque_variance * torque.inverse.diagonal().tail<3>()).cwiseSqrt();
  out.bias << force.x.head<3>(), torque.x.head<3>();
  out.bias_sd << (variance * force.inverse.diagonal().head<3>()).cwiseSqrt(),
      (torque_variance * torque.inverse.diagonal().head<3>()).cwiseSqrt();
  return out;
}

}  // namespace assembly_cell
