// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/dial_gauge.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/gate.h"
#include "assembly_cell/math/distributions.h"

namespace assembly_cell {

namespace {

constexpr int kIterations = 50;
constexpr double kGrazing = 1e-3;    // |n·a|: a gauge along its face
constexpr double kArm = 0.025;       // scales rotation against translation [m]
constexpr double kGaugeRank = 1e-8;  // smallest over largest singular value
constexpr double kFault = 1e-3;      // p(χ²) below which a gauge is called faulty

// reading at a pose and its derivative to (dp, dφ)
double reading(const GaugeLayout& layout, std::size_t k, const Pose& X,
               Eigen::Matrix<double, 1, 6>* row) {
  const DialGauge& gauge = layout.gauges[k];
  const CarrierFace& face = layout.faces[static_cast<std::size_t>(gauge.face)];
  const Eigen::Vector3d n = X.R * face.normal;
  const double along = n.dot(gauge.axis);
  if (!(std::abs(along) > kGrazing)) {
    throw InputError("gauge " + std::to_string(k) +
                     ": its axis lies in its face: mount it across the face");
  }
  const double s = (n.dot(X.p - gauge.point) + face.offset) / along;
  if (row != nullptr) {
    const Eigen::Vector3d tip = gauge.point + s * gauge.axis;
    *row << n.transpose() / along, n.cross(X.p - tip).transpose() / along;
  }
  return s;
}

void checkLayout(const GaugeLayout& layout) {
  const auto unit = [](const Eigen::Vector3d& v) { return std::abs(v.norm() - 1.0) < 1e-6; };
  for (std::size_t k = 0; k < layout.gauges.size(); ++k) {
    const DialGauge& gauge = layout.gauges[k];
    if (!gauge.point.allFinite() || !unit(gauge.axis) || gauge.face < 0 || gauge.face > 2) {
      throw InputError("gauge " + std::to_string(k) +
                       ": give a finite point, a unit axis and a face from 0 to 2");
    }
  }
  for (const CarrierFace& face : layout.faces) {
    if (!unit(face.normal) || !std::isfinite(face.offset)) {
      throw InputError("carrier face: give a unit normal and a finite offset");
    }
  }
}

struct Fit {
  Pose X;
  Matrix6 inverse = Matrix6::Zero();  // of JᵀJ
  Eigen::VectorXd residuals;
  Eigen::MatrixXd J;
};

Fit fit(const GaugeLayout& layout, const std::vector<double>& readings) {
  const auto n = static_cast<Eigen::Index>(readings.size());
  Fit out{Pose(), Matrix6::Zero(), Eigen::VectorXd(n), Eigen::MatrixXd(n, 6)};
  Vector6 scale;
  scale << 1, 1, 1, 1 / kArm, 1 / kArm, 1 / kArm;
  for (int iteration = 1; iteration <= kIterations; ++iteration) {
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      Eigen::Matrix<double, 1, 6> row;
      out.residuals[i] = readings[k] - reading(layout, k, out.X, &row);
      out.J.row(i) = row;
    }
    const Eigen::MatrixXd scaled = out.J * scale.asDiagonal();
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinU | Eigen::ComputeThinV);
    if (!(svd.singularValues()[5] > kGaugeRank * svd.singularValues()[0])) {
      throw InputError(
          "gauges: rank below 6, a movement is not seen by any of them: add gauges on "
          "other faces or farther apart");
    }
    Vector6 step = scale.asDiagonal() * svd.solve(out.residuals);
    const double turn = step.tail<3>().norm();
    if (turn > 0.5) step *= 0.5 / turn;
    out.X.p += step.head<3>();
    out.X.R = rotationFromVector({step.tail<3>()}) * out.X.R;
    if (!step.allFinite()) break;
    // at rounding: 1e-15 of a metre, or no longer getting better
    if (step.head<3>().norm() < 1e-14 && step.tail<3>().norm() < 1e-13) {
      const Matrix6 V = scale.asDiagonal() * svd.matrixV();
      out.inverse =
          V * svd.singularValues().cwiseAbs2().cwiseInverse().asDiagonal() * V.transpose();
      return out;
    }
  }
  throw InputError("gauges: no pose fits the readings: check their order, signs and units [m]");
}

}  // namespace

GaugeLayout thesisGauges(double half_distance) {
  if (!(half_distance > 0.0) || !std::isfinite(half_distance)) {
    throw InputError("gauges: half_distance is " + std::to_string(half_distance) +
                     ": give a positive distance in m");
  }
  const double D = half_distance;
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(),
                        z = Eigen::Vector3d::UnitZ();
  GaugeLayout layout;
  layout.gauges = {{D * y, x, 0},  {-D * y, x, 0}, {D * z, y, 1},
                   {-D * z, y, 1}, {D * x, z, 2},  {-D * x, z, 2}};
  layout.faces = {CarrierFace{x, 0.0}, CarrierFace{y, 0.0}, CarrierFace{z, 0.0}};
  return layout;
}

std::vector<double> gaugeReadings(const GaugeLayout& layout, const Pose& X_DC) {
  checkLayout(layout);
  std::vector<double> readings;
  for (std::size_t k = 0; k < layout.gauges.size(); ++k) {
    readings.push_back(reading(layout, k, X_DC, nullptr));
  }
  return readings;
}

GaugePose poseFromGauges(const GaugeLayout& layout, const std::vector<double>& readings,
                         double sigma) {
  checkLayout(layout);
  const std::size_t n = layout.gauges.size();
  if (n < 6 || readings.size() != n) {
    throw InputError("gauges: " + std::to_string(readings.size()) + " readings of " +
                     std::to_string(n) + " gauges: give one of each, at least six");
  }
  if (!(sigma > 0.0) || !std::isfinite(sigma)) {
    throw InputError("gauges: sigma is not positive: give a standard deviation in m");
  }
  for (const double value : readings) {
    if (!std::isfinite(value)) throw InputError("gauges: a reading is not finite: read it again");
  }
  const Fit all = fit(layout, readings);
  GaugePose out;
  out.X_DC = all.X;
  out.covariance = sigma * sigma * all.inverse;
  out.chi2 = all.residuals.squaredNorm() / (sigma * sigma);
  out.dof = static_cast<int>(n) - 6;
  if (out.dof == 0) out.chi2 = 0.0;
  if (out.dof == 0 || chiSquareTail(out.chi2, out.dof) >= kFault) return out;

  // with one spare gauge every removal fits: the largest normalised residual is a hint
  double best = -1.0;
  for (std::size_t k = 0; k < n; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const double redundancy = 1.0 - (all.J.row(i) * all.inverse * all.J.row(i).transpose()).value();
    const double improvement = all.residuals[i] * all.residuals[i] / std::max(redundancy, 1e-6);
    if (redundancy > 1e-6 && improvement > best) {
      best = improvement;
      out.suspect = static_cast<int>(k);
    }
  }
  return out;
}

}  // namespace assembly_cell
