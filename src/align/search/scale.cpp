// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/scale.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "assembly_cell/mechanism/compliance.h"

namespace assembly_cell {
namespace {

// Numbers of the default cell, config/scenarios/cell.yaml.
constexpr double kRadius = 0.025;                // [m]
constexpr double kMass = 0.395, kGravity = 9.8;  // [kg], [m/s²]
constexpr double kPress = 3.2626e-5;             // [m/N]
constexpr double kSideways = 1.5971e-4;          // [m/N]
constexpr double kImpedance = 140.6;             // √(stiffness · mass) along the axis [N s/m]
constexpr double kDecay = 0.2;                   // [s]

// Bounds of a touch, of the default one of 1.5 N: 0.3 N, 60 of a 16 bit block's noise, and 4 N.
constexpr double kMinTouch = 0.2, kMaxTouch = kMaxTouchForce / kTouchForce;
// In one block a touch may reach four light ones: 0.1 mm in the default cell makes two, so that
// only couplings twice as stiff are approached more slowly.
constexpr double kMoreSink = 2.0;
constexpr double kMaxTime = 20.0;        // of the default cell's decay
constexpr double kStill = 0.03;          // at rest, from block to block [N]
constexpr double kStillFraction = 0.25;  // of the gap between mouth and tip
constexpr double kMinStill = 0.3;        // of kStill: twice the noise of a 16 bit block

// Decay time of the slowest mode of the peg in its coupling, the carrier held. [s]
double slowestDecay(const Mechanism& mechanism) {
  const PegParameters& peg = mechanism.peg;
  CouplingParameters damping;
  damping.stiffness = mechanism.coupling.damping;
  Matrix6 mass = Matrix6::Zero();
  const Eigen::Vector3d centre(0, 0, -peg.coupling_height);
  mass.topLeftCorner<3, 3>().diagonal().setConstant(peg.mass);
  mass.topRightCorner<3, 3>() = -peg.mass * skew(centre);
  mass.bottomLeftCorner<3, 3>() = peg.mass * skew(centre);
  mass.bottomRightCorner<3, 3>() = -peg.mass * skew(centre) * skew(centre);
  mass.diagonal().tail<3>() +=
      Eigen::Vector3d(peg.inertia_transverse, peg.inertia_transverse, peg.inertia_axial);
  const Matrix6 inverse = mass.inverse();
  Eigen::Matrix<double, 12, 12> rate = Eigen::Matrix<double, 12, 12>::Zero();
  rate.topRightCorner<6, 6>().setIdentity();
  rate.bottomLeftCorner<6, 6>() = -inverse * couplingStiffness(mechanism.coupling);
  rate.bottomRightCorner<6, 6>() = -inverse * couplingStiffness(damping);
  const Eigen::EigenSolver<Eigen::Matrix<double, 12, 12>> modes(rate, false);
  const double slowest = -modes.eigenvalues().real().maxCoeff();
  return slowest > 0.0 ? 1.0 / slowest : kMaxTime;
}

}  // namespace

int Scale::timed(int blocks) const { return static_cast<int>(std::ceil(blocks * time - 1e-9)); }

double sidewaysCompliance(const Mechanism& mechanism) {
  Eigen::Matrix<double, 1, 6> row;
  row << 1, 0, 0, 0, -(mechanism.peg.half_height + mechanism.peg.coupling_height), 0;
  return (row * couplingCompliance(mechanism.coupling) * row.transpose()).value();
}

double pressCompliance(const Mechanism& mechanism) {
  const Matrix6 compliance = couplingCompliance(mechanism.coupling);
  const double r = mechanism.peg.radius;
  return compliance(2, 2) + r * r * std::max(compliance(3, 3), compliance(4, 4));
}

Scale scaleOf(const Mechanism& mechanism) {
  const PegParameters& peg = mechanism.peg;
  Scale scale;
  scale.length = peg.radius / kRadius;
  scale.travel = std::max(1.0, scale.length);
  const double weight = peg.mass * mechanism.gravity / (kMass * kGravity);
  const double landing = kLanding * mechanism.coupling.stiffness.diagonal(0) / kTouchForce;
  scale.force = std::clamp(std::max(weight, landing), kMinTouch, kMaxTouch);
  scale.sink = scale.force * pressCompliance(mechanism) / kPress;
  const double sideways = sidewaysCompliance(mechanism);
  scale.give = scale.force * sideways / kSideways;
  // a chamfer leads in a peg that is farther off
  const double mouth = mechanism.hole.radius + mechanism.hole.chamfer_width - tipRadius(peg);
  scale.still = std::clamp(kStillFraction * mouth / sideways / kStill, kMinStill,
                           std::max(kMinStill, scale.force));
  const double impedance = std::sqrt(mechanism.coupling.stiffness.diagonal(0) * peg.mass);
  scale.step = std::min({1.0, kMoreSink * scale.sink, scale.force * kImpedance / impedance});
  scale.time = std::clamp(slowestDecay(mechanism) / kDecay, 1.0, kMaxTime);
  return scale;
}

}  // namespace assembly_cell
