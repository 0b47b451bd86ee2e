// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Which drifts, temperature coefficients and breaks the bias of a recording has
// (docs/how_to/payload.md).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "assembly_cell/calibration/payload/payload.h"

namespace assembly_cell::bias_series {

enum Kind : std::size_t { kForce, kTorque };
constexpr std::array<Kind, 2> kKinds = {kForce, kTorque};

struct Timeline {
  std::vector<double> order;
  std::vector<double> temperature;  ///< about its mean, empty: unknown or constant
  double step = 1.0;                ///< mean spacing
};

/// Readings in sensor axes.
struct Problem {
  std::vector<Eigen::Matrix3d> R;
  std::vector<Vector6> w;
  Timeline line;
  std::array<double, 2> floor{};  ///< lower bound of the sd by kind: rounding
  std::vector<double> no_break;   ///< orders where a break was too small
};

/// One component: readings y = X shared + own effects + drift + noise.
struct Series {
  Eigen::VectorXd y;
  Eigen::MatrixXd X;  ///< n × 3
};
using Triple = std::array<Series, 3>;

/// Shared effects: of the force the weight, of the torque under that weight the centre of mass.
Triple seriesOf(const Problem& problem, Kind kind, const Eigen::Vector3d& gravity);

/// A component's model without its shared effects and its noise.
struct Candidate {
  DriftShape shape;
  double ratio;
  bool temperature;
  double cost;  ///< criterion
  double log_det;
  Eigen::Matrix4d gram;  ///< of [X y], own effects projected out
};
Candidate candidateOf(const Series& series, DriftShape shape, double ratio, bool temperature,
                      const Timeline& line, const std::vector<std::size_t>& starts);

struct GroupFit {
  std::array<Candidate, 3> choice;
  Eigen::Vector3d shared = Eigen::Vector3d::Zero();
  Eigen::Vector3d variance = Eigen::Vector3d::Ones();
  double criterion = 0.0;
};

/// Shared effects and variances of three chosen candidates, alternately.
void profile(GroupFit& fit, double n, double floor);

/// One recording, the same shape on all components; random walk of a variance of `ratio` per step,
/// or none with 0.
GroupFit uniformFit(const Triple& data, const Timeline& line, double ratio, double floor);

struct Structure {
  std::vector<std::size_t> starts{0};
  std::array<GroupFit, 2> fit;  ///< by kind
  double criterion = 0.0;
  std::vector<double> gains;  ///< of the breaks
};
Structure searchStructure(const Problem& problem, bool drift, bool breaks);

/// A chosen structure in full: effects, covariance, what prediction and hold-out need.
struct FullGroup {
  BiasGroup group;
  std::array<Eigen::VectorXd, 3> residual;  ///< from effects and best drift
  std::vector<Eigen::Vector3d> held_out;
  std::vector<Eigen::Matrix3d> held_out_covariance;
};
FullGroup fullFit(const Triple& data, const GroupFit& fit, const Timeline& line,
                  const std::vector<std::size_t>& starts, double floor, bool equal_weights = false);

}  // namespace assembly_cell::bias_series
