// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/displacement.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/observations/dial_gauge.h"
#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/rig.h"

namespace assembly_cell {
namespace {

Pose randomPose(NormalSource& normal, double angle, double distance) {
  const Eigen::Vector3d axis(normal(), normal(), normal());
  return {rotationFromVector({angle * axis.normalized()}),
          distance * Eigen::Vector3d(normal(), normal(), normal())};
}

// The corrected closed form of thesis 11.5 for six gauges on orthogonal faces (exact), against
// which the least squares are evaluated. Readings [m] X11 X12 X21 X22 X31 X32.
Pose poseFromSixGauges(const Vector6& readings, double half_distance) {
  const GaugeLayout layout = thesisGauges(half_distance);
  if (!readings.allFinite()) throw InputError("gauges: a reading is not finite: read it again");
  // slopes of the three faces
  const double E = (readings[1] - readings[0]) / (2 * half_distance);
  const double F = (readings[3] - readings[2]) / (2 * half_distance);
  const double G = (readings[5] - readings[4]) / (2 * half_distance);
  const double q = 1.0 + E * F * G;
  if (!(q > 0.0)) {
    throw InputError("gauges: 1 + EFG is " + std::to_string(q) +
                     ": no such pose of orthogonal faces; check order and signs of the readings");
  }
  const double U = (E * F - G * (E * E + 1.0)) / q;
  const double V = (F * G - E * (F * F + 1.0)) / q;
  const double W = (G * E - F * (G * G + 1.0)) / q;
  Pose X;
  X.R.col(0) = Eigen::Vector3d(1, E, U).normalized();
  X.R.col(1) = Eigen::Vector3d(V, 1, F).normalized();
  X.R.col(2) = Eigen::Vector3d(G, W, 1).normalized();
  // each face passes through the tip of its first gauge
  Eigen::Vector3d d;
  for (int face = 0; face < 3; ++face) {
    const DialGauge& gauge = layout.gauges[static_cast<std::size_t>(2 * face)];
    d[face] = X.R.col(face).dot(gauge.point + readings[2 * face] * gauge.axis);
  }
  X.p = X.R * d;
  return X;
}

// Readings by intersecting the gauge's line with the face, written out again for face 1.
TEST(DialGauges, ReadTheFaceWhereTheirAxisMeetsIt) {
  NormalSource normal(1);
  const Pose X = randomPose(normal, 0.1, 1e-3);
  const std::vector<double> s = gaugeReadings(thesisGauges(0.025), X);
  const Eigen::Vector3d n = X.R.col(0);
  EXPECT_NEAR(s[0], (n.dot(X.p) - 0.025 * n.y()) / n.x(), 1e-16);
  EXPECT_NEAR(s[1], (n.dot(X.p) + 0.025 * n.y()) / n.x(), 1e-16);
}

// The closed form is exact for orthogonal faces: rounding only, also at the large angles.
TEST(DialGauges, ClosedFormAndLeastSquaresInvertTheReadings) {
  NormalSource normal(2);
  const GaugeLayout layout = thesisGauges(0.025);
  for (int i = 0; i < 200; ++i) {
    const Pose X = randomPose(normal, 0.3 * i / 200, 2e-3);
    const std::vector<double> s = gaugeReadings(layout, X);
    const Pose closed = poseFromSixGauges(Vector6(s.data()), 0.025);
    EXPECT_LT((closed.R - X.R).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_LT((closed.p - X.p).cwiseAbs().maxCoeff(), 1e-15);
    const GaugePose fitted = poseFromGauges(layout, s, 1e-6);
    EXPECT_LT((fitted.X_DC.R - X.R).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_LT((fitted.X_DC.p - X.p).cwiseAbs().maxCoeff(), 1e-13);
  }
}

// At rest: σ/√2 per axis and σ/(√2 D) per angle.
TEST(DialGauges, CovarianceAtRestIsThatOfTheGeometry) {
  const GaugePose pose = poseFromGauges(thesisGauges(0.025), std::vector<double>(6, 0.0), 1e-6);
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(std::sqrt(pose.covariance(k, k)), 1e-6 / std::sqrt(2.0), 1e-12);
    EXPECT_NEAR(std::sqrt(pose.covariance(k + 3, k + 3)), 1e-6 / std::sqrt(2.0) / 0.025, 1e-10);
  }
  EXPECT_EQ(pose.dof, 0);
}

TEST(DialGauges, SkewFacesAndMoreGaugesAreFitted) {
  GaugeLayout layout = thesisGauges(0.025);
  layout.faces[0].normal = Eigen::Vector3d(1, 1e-3, -2e-3).normalized();
  layout.faces[1].offset = 3e-5;
  layout.gauges.push_back({Eigen::Vector3d(0.0, 0.02, 0.02), Eigen::Vector3d::UnitX(), 0});
  NormalSource normal(3);
  const Pose X = randomPose(normal, 0.01, 1e-3);
  std::vector<double> s = gaugeReadings(layout, X);
  GaugePose pose = poseFromGauges(layout, s, 1e-6);
  EXPECT_LT((pose.X_DC.p - X.p).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_EQ(pose.dof, 1);
  EXPECT_EQ(pose.suspect, -1);
  // a seventh gauge shows the fault of any that it checks
  s[6] += 30e-6;
  pose = poseFromGauges(layout, s, 1e-6);
  EXPECT_GE(pose.suspect, 0);
  EXPECT_GT(pose.chi2, 10.0);
}

TEST(DialGauges, BadReadingsAreRefused) {
  const GaugeLayout layout = thesisGauges();
  EXPECT_THROW(poseFromGauges(layout, {0, 0, 0, 0, 0}, 1e-6), InputError);
  EXPECT_THROW(poseFromGauges(layout, {0, 0, NAN, 0, 0, 0}, 1e-6), InputError);
  EXPECT_THROW(poseFromGauges(layout, {0, 0, 0, 0, 0, 0}, 0.0), InputError);
  Vector6 s = Vector6::Zero();
  s << 0, 0.1, 0, 0.1, 0.1, 0;  // E F G = 2 · 2 · −2
  EXPECT_THROW(poseFromSixGauges(s, 0.025), InputError);
  GaugeLayout blind = thesisGauges();
  blind.gauges[1] = blind.gauges[0];
  EXPECT_THROW(poseFromGauges(blind, std::vector<double>(6, 0.0), 1e-6), InputError);
}

ObservationSet tests(CalibrationRig& rig, const std::vector<Vector6>& strains,
                     Side side = Side::kA) {
  ObservationSet set = rig.description();
  LoadRequest request;
  set.observations.push_back(rig.measure(request));
  request.target.kind = ObservationKind::kDisplacement;
  request.target.side = side;
  for (const Vector6& strain : strains) {
    request.strain = strain;
    set.observations.push_back(rig.measure(request));
  }
  return set;
}

std::vector<Vector6> oneChannelAtATime() {
  std::vector<Vector6> out;
  for (int k = 0; k < 6; ++k) {
    out.push_back(Vector6::Unit(k));
    out.push_back(-Vector6::Unit(k));
  }
  return out;
}

// With the coupling of a cell on the rig the map is this coupling's; sensor_a keeps its hinges.
TEST(Displacement, IsThatOfACoupling) {
  RigSettings settings;
  settings.nonlinearity = 0.0;
  Matrix6 compliance = Matrix6::Zero();
  compliance.diagonal() << 2e-5, 3e-5, 2e-5, 0.02, 0.015, 0.02;
  compliance(0, 4) = compliance(4, 0) = -6e-5;
  settings.coupling_compliance = compliance;
  CalibrationRig rig(settings);
  const DisplacementSolution found =
      solveDisplacement(tests(rig, centralComposite(), Side::kB), Side::kB);
  ASSERT_TRUE(found.accepted) << found.message;
  const Matrix6 strain = strainMatrix(bridgeB(settings.bits, settings.noise));
  // over the range ±4 V of every channel: gauges of 1 µm on arms of 25 mm, 46 tests
  const Matrix6 wanted = compliance * strain.inverse();
  const Matrix6 error = 4.0 * (found.T.leftCols<6>() - wanted);
  EXPECT_LE(error.topRows<3>().cwiseAbs().maxCoeff(), 3e-6);
  EXPECT_LE(error.bottomRows<3>().cwiseAbs().maxCoeff(), 3e-6 / 0.025);
  CalibrationRig plain(settings);
  const DisplacementSolution a = solveDisplacement(tests(plain, centralComposite()), Side::kA);
  const Matrix6 hinges = a.T.leftCols<6>() * strain;
  EXPECT_LT((hinges.bottomRightCorner<3, 3>().cwiseAbs().maxCoeff()), 0.01);
  settings.coupling_compliance->setConstant(std::nan(""));
  EXPECT_THROW(CalibrationRig{settings}, InputError);
}

// Rms over 400 poses within the range; 1.2 µm is the requirement, gauges of 1 µm.
TEST(Displacement, QuadraticModelReachesTheGauges) {
  const RigSettings settings;
  CalibrationRig rig(settings);
  Bridge ground_truth = bridgeA(settings.bits, settings.noise);  // of the rig
  ground_truth.nonlinearity = settings.nonlinearity;
  const ObservationSet set = tests(rig, centralComposite());
  const auto error = [&](const DisplacementSolution& s) {
    NormalSource normal(5);
    double square = 0.0;
    for (int i = 0; i < 400; ++i) {
      Vector6 strain;
      for (int k = 0; k < 6; ++k) strain[k] = 4.0 * std::erf(normal() / std::sqrt(2.0)) * 0.7;
      const BridgeState state =
          deflect(ground_truth, strainMatrix(ground_truth).inverse() * strain);
      Calibration c;
      c.quadratic_displacement = true;
      c.volts_to_displacement = s.T.leftCols<6>();
      c.displacement_products = s.T.rightCols<kStrainProducts>();
      const Vector6 d = displacementFromVolts(c, state.volts);
      square += (d.head<3>() - (state.X_DC.p - kCarrierAtRest)).squaredNorm() / 3.0;
    }
    return std::sqrt(square / 400);
  };
  const DisplacementSolution quadratic = solveDisplacement(set, Side::kA);
  EXPECT_TRUE(quadratic.accepted) << quadratic.message;
  EXPECT_EQ(quadratic.rank, 27);
  EXPECT_NEAR(quadratic.condition, 4.9, 0.15);  // printed, for the wanted strains
  EXPECT_LE(error(quadratic), 1.2e-6);
  DisplacementSolution linear = quadratic;
  linear.T.rightCols(kStrainProducts).setZero();
  EXPECT_GT(error(linear), 2.0 * error(quadratic));
  Calibration c;
  const DisplacementSolution few = solveDisplacement(tests(rig, oneChannelAtATime()), Side::kA);
  EXPECT_FALSE(few.accepted);
  EXPECT_THROW(applyDisplacement(few, c), InputError);
  applyDisplacement(quadratic, c);
  EXPECT_TRUE(c.quadratic_displacement);
  EXPECT_EQ(c.displacement_covariance.rows(), 27);
  EXPECT_EQ(c.displacement_range, quadratic.range);
}

TEST(Displacement, GatesRefuseByName) {
  CalibrationRig rig({});
  const auto message = [&](const std::vector<Vector6>& strains) {
    const DisplacementSolution s = solveDisplacement(tests(rig, strains), Side::kA);
    EXPECT_FALSE(s.accepted);
    return s.message;
  };
  EXPECT_NE(message(oneChannelAtATime()).find("rank"), std::string::npos);
  // one-sided tests: noise hides the missing rank, the condition does not
  std::vector<Vector6> one_sided = centralComposite();
  for (Vector6& strain : one_sided) strain = strain.array() * 0.3 + 0.7;
  EXPECT_NE(message(one_sided).find("condition"), std::string::npos);
  EXPECT_NE(message({}).find("rank 0 of 27"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
