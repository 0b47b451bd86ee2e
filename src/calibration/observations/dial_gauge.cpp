// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/observations/dial_gauge.h"

#include <Eigen/Cholesky>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/common/gate.h"
#include "assembly_cell/math/distributions.h"
#include "assembly_cell/math/least_squares.h"

namespace assembly_cell {

namespace {

constexpr int kIterations = 50;
constexpr double kGrazing = 1e-3;    // |n·a|: a gauge along its face
constexpr double kArm = 0.025;       // scales rotation against translation [m]
constexpr double kGaugeRank = 1e-8;  // smallest over largest singular value
constexpr double kFault = 1e-3;      // p(χ²) below which a gauge is called faulty

// Reading at a pose; `row`: its derivative by (dp, dφ).
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

// A pose as state of minimise(); a step is (dp, dφ) in axes of the datum.
struct PoseState {
  Pose X;

  friend PoseState operator+(const PoseState& state, const Vector6& step) {
    return {{rotationFromVector({step.tail<3>()}) * state.X.R, state.X.p + step.head<3>()}};
  }
};

// Residuals of the gauges over the pose of the carrier, for minimise().
class GaugeFit {
 public:
  GaugeFit(const GaugeLayout& layout, const std::vector<double>& readings)
      : layout_(layout),
        readings_(readings),
        residuals_(static_cast<Eigen::Index>(readings.size())),
        J_(residuals_.size(), 6) {
    scale_ << 1, 1, 1, 1 / kArm, 1 / kArm, 1 / kArm;
  }

  // throws InputError where the gauges don't determine the pose
  void linearise(const PoseState& state) {
    for (Eigen::Index i = 0; i < residuals_.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      Eigen::Matrix<double, 1, 6> row;
      residuals_[i] = readings_[k] - reading(layout_, k, state.X, &row);
      J_.row(i) = row;
    }
    const Eigen::MatrixXd scaled = J_ * scale_.asDiagonal();
    svd_.compute(scaled, Eigen::ComputeThinU | Eigen::ComputeThinV);
    if (!(svd_.singularValues()[5] > kGaugeRank * svd_.singularValues()[0])) {
      throw InputError(
          "gauges: rank below 6, a movement is not seen by any of them: add gauges on "
          "other faces or farther apart");
    }
  }
  Vector6 step(double /*damping*/) const {
    Vector6 step = scale_.asDiagonal() * svd_.solve(residuals_);
    const double turn = step.tail<3>().norm();
    if (turn > 0.5) step *= 0.5 / turn;
    if (!step.allFinite()) fail();
    return step;
  }
  // rounding
  bool small(const Vector6& step) const {
    return step.head<3>().norm() < 1e-14 && step.tail<3>().norm() < 1e-13;
  }

  [[noreturn]] static void fail() {
    throw InputError("gauges: no pose fits the readings: check their order, signs and units [m]");
  }
  const Eigen::VectorXd& residuals() const { return residuals_; }
  const Eigen::MatrixXd& J() const { return J_; }
  Matrix6 inverse() const {  // of JᵀJ
    const Matrix6 V = scale_.asDiagonal() * svd_.matrixV();
    return V * svd_.singularValues().cwiseAbs2().cwiseInverse().asDiagonal() * V.transpose();
  }

 private:
  const GaugeLayout& layout_;
  const std::vector<double>& readings_;
  Eigen::VectorXd residuals_;
  Eigen::MatrixXd J_;
  Vector6 scale_;
  Eigen::JacobiSVD<Eigen::MatrixXd> svd_;
};

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
  GaugeFit fit(layout, readings);
  PoseState state;
  LeastSquaresOptions options;
  options.max_iterations = kIterations;
  const LeastSquaresResult result = minimise<StepControl::kNone>(fit, state, options);
  if (result.iterations == kIterations) GaugeFit::fail();
  const Matrix6 inverse = fit.inverse();
  GaugePose out;
  out.X_DC = state.X;
  out.covariance = sigma * sigma * inverse;
  out.chi2 = fit.residuals().squaredNorm() / (sigma * sigma);
  out.dof = static_cast<int>(n) - 6;
  if (out.dof == 0) out.chi2 = 0.0;
  if (out.dof == 0 || chiSquareTail(out.chi2, out.dof) >= kFault) return out;

  // with one spare gauge every removal fits: the largest normalised residual is a hint
  double best = -1.0;
  for (std::size_t k = 0; k < n; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const auto row = fit.J().row(i);
    const double redundancy = 1.0 - (row * inverse * row.transpose()).value();
    const double improvement = fit.residuals()[i] * fit.residuals()[i] / std::max(redundancy, 1e-6);
    if (redundancy > 1e-6 && improvement > best) {
      best = improvement;
      out.suspect = static_cast<int>(k);
    }
  }
  return out;
}

}  // namespace assembly_cell
