// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Simulated contacts on both sensors with their ground truth, and the Cramér–Rao bound by
// differences of the raw measurement equations: nothing here comes from the estimator.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {
namespace twin_truth {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

struct Scene {
  std::string name;
  Pose X_AB;                 ///< truth
  std::vector<Pose> moves;   ///< X_Bb, truth
  std::vector<Vector6> w_b;  ///< on B, axes of b, truth
  Matrix6 covariance_a, covariance_b;
  std::vector<Matrix6> move_covariance;  ///< empty: moves are known
  std::size_t size() const { return w_b.size(); }
};

Matrix3d rotation(const Vector3d& v);

// moment about the origin of another frame, written out
Vector6 seenFrom(const Pose& X, const Vector6& w);

Vector6 onLine(const Vector3d& point, const Vector3d& force);

Matrix6 noise(double sigma_force, double sigma_moment);

/// Adds a contact along a line given in the axes of A, with B turned and shifted by `move`.
void press(Scene& s, const Vector3d& point_A, const Vector3d& force_on_B_A, const Pose& move = {});

Scene begin(const std::string& name, const Matrix3d& R, const Vector3d& T);

Vector6 gaussian(const Matrix6& covariance, std::mt19937_64& random);

/// What the sensors report; without `random` free of noise.
std::vector<TwinContact> measure(const Scene& s, std::mt19937_64* random = nullptr);

/// Cramér–Rao bound of δ = (dT, dφ): pose, all wrenches and moves unknown; central differences of
/// the stacked measurements. `offset` > 0: sd of a tare offset common to all contacts, 12 more
/// unknowns. `prior`, if given, adds its information.
Matrix6 bound(const Scene& s, const Matrix6* prior = nullptr, double offset_force = 0.0,
              double offset_moment = 0.0);

/// δ of the ground truth relative to an estimate.
Vector6 errorOf(const Pose& truth, const Pose& estimate);

/// 10 mm and 0.1 rad per axis.
PosePrior defaultPrior(const Pose& nominal);

/// δᵀ P⁻¹ δ of `pose` against the estimate over the observable directions: 6 in the mean if pose is
/// the truth and all six are observable.
double normalisedDistance(const TwinForceEstimate& estimate, const Pose& pose);

/// What must agree between A and B whatever the pose: F_i·F_j and F_i·M_j + F_j·M_i (i = j allowed,
/// then F·M counts twice). Differences A − B in standard deviations. Moves are known.
struct PairMisfit {
  double force = 0.0, reciprocal = 0.0;
};
PairMisfit pairMisfit(const TwinContact& i, const TwinContact& j);

/// The geometries of docs/theory/twin_force.md: 20 N, arms about 60 mm, |T| 0.14 m.
std::vector<Scene> geometries();

}  // namespace twin_truth
}  // namespace assembly_cell
