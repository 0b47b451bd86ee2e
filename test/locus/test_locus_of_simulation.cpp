// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The estimator's linear model against the simulated cell, which shares no code with it: nonlinear
// mechanism, contact law, friction, bridges, driver's static map, harmonic fit.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "assembly_cell/align/simulated_plant.h"
#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// rotation vector (x, y) that tilts an upright axis to R's
Vector2d tiltOf(const Eigen::Matrix3d& R) {
  const Vector3d axis = R.col(2);
  return std::acos(axis.z()) * Vector2d(-axis.y(), axis.x()).normalized();
}

struct Reading {
  Scenario mechanism;
  OperatingPoint point;
  Locus locus;
  std::vector<ContactReport> closed;
  Vector3d bottom;  // centre of the peg's lower edge
};

// Presses the peg, leaning towards `lean`, at `offset` from the hole, and vibrates it.
Reading readLocus(double lean, double tilt, const Vector2d& offset, double frequency,
                  int direction) {
  Reading r;
  Scenario& s = r.mechanism;
  s = loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  const Vector3d axis(std::sin(tilt) * std::cos(lean), std::sin(tilt) * std::sin(lean),
                      std::cos(tilt));
  s.rest.theta = std::acos(axis.y());
  s.rest.phi = std::atan2(axis.x(), axis.z());
  s.rest.x = offset.x() + 0.08 * axis.x();
  s.rest.y = offset.y() + 0.08 * axis.y();
  s.initial.euler = {s.rest.phi, s.rest.theta, 0.0};
  s.initial.carrier_x = s.rest.x;
  s.initial.carrier_y = s.rest.y;
  s.initial.position = Vector3d(s.rest.x, s.rest.y, s.rest.z) - s.peg.coupling_height * axis;

  CellParameters cell;
  cell.bits = 24;
  cell.noise = 1e-5;
  SimulatedPlant plant(s, cell);
  constexpr double kPress = 12.0;
  PlantCommand command;
  RestPose rest = s.rest;
  PlantBlock block = plant.next({});
  for (int k = 0; k < 150; ++k) {
    const double force = contactForceFromDeflection(s, block.displacement_b).z();
    rest.z -= force < 0.5 ? 2e-4 : std::clamp((kPress - force) / 1.6e5, -5e-4, 5e-4);
    command.rest = rest;
    block = plant.next(command);
  }
  PlantCommand vibrate;
  vibrate.exciter = ExciterParameters{0.1, frequency, 0.4, direction};
  block = plant.next(vibrate);
  for (int k = 0; k < 25; ++k) block = plant.next({});
  PlantCommand measure;
  measure.locus = LocusRequest{block.time, 0.2};
  block = plant.next(measure);
  while (!block.locus) block = plant.next({});

  Simulation& truth = plant.truth();
  const Vector3d force = contactForceFromDeflection(s, block.displacement_b);
  r.locus = block.locus->locus;
  r.point.frequency = frequency;
  r.point.amplitude = 0.1;
  r.point.direction = direction;
  r.point.press = force.z();
  r.point.friction = force.head<2>();
  r.point.tilt = tiltOf(truth.pegPose().R);
  r.point.sensor_tilt = tiltOf(truth.carrierPose().R);
  r.bottom = truth.pegPose().p;
  for (const ContactReport& contact : truth.contacts()) {
    if (contact.valid && contact.state != ContactReport::kOpen) r.closed.push_back(contact);
  }
  return r;
}

double degrees(double radians) { return std::abs(radians) * 180 / M_PI; }

// What the linear model leaves out: the law's lag in the contact (700 1/s), the static force's
// lever on the deflected coupling (0.5 % of its moments), products of amplitude and tilt.
constexpr double kMisfit = 0.02;
constexpr double kDirection = 0.6;  // [deg], of which an eighth comes from rolling to and fro

TEST(LocusOfSimulation, SingleContactOfTwoEdges) {
  for (const double frequency : {500.0, 770.0}) {
    for (const int direction : {1, -1}) {
      // leaning across the offset: the lowest point hangs over the hole, one edge crossing carries
      const Reading r =
          readLocus(direction > 0 ? 3.34 : 4.91, 0.017, {0.0032, 0.0050}, frequency, direction);
      ASSERT_EQ(r.closed.size(), 1u);
      ASSERT_EQ(r.closed[0].feature, ContactReport::kEdgeEdge);
      const Vector3d arm = r.closed[0].point - r.bottom;
      const DirectionEstimate e =
          contactDirection(r.mechanism, r.point, r.locus, LocusAxes::kSensor);
      // either half turn: how clearly they differ depends on where the tilt points
      EXPECT_LT(degrees(std::remainder(e.alpha - std::atan2(arm.y(), arm.x()), M_PI)), kDirection)
          << frequency << " " << direction;
      EXPECT_LT(e.misfit, kMisfit);
    }
  }
}

TEST(LocusOfSimulation, EdgeRollingOnThePlane) {
  for (const double frequency : {500.0, 770.0}) {
    Reading r = readLocus(0.2, 0.035, {0.016, 0.025}, frequency, 1);
    ASSERT_EQ(r.closed.size(), 1u);
    ASSERT_EQ(r.closed[0].feature, ContactReport::kEdgePlane);
    const Vector3d arm = r.closed[0].point - r.bottom;
    r.point.rolling = true;
    const DirectionEstimate e = contactDirection(r.mechanism, r.point, r.locus, LocusAxes::kSensor);
    EXPECT_LT(degrees(std::remainder(e.alpha - std::atan2(arm.y(), arm.x()), 2 * M_PI)),
              2 * kDirection)
        << frequency;
    EXPECT_LT(e.misfit, kMisfit);
    // without rolling the model fits worse
    r.point.rolling = false;
    EXPECT_GT(contactDirection(r.mechanism, r.point, r.locus, LocusAxes::kSensor).misfit, e.misfit);
  }
}

// Two contacts at once: no direction of a single one explains the locus.
TEST(LocusOfSimulation, DoubleContactIsRefusedByItsMisfit) {
  const Reading r = readLocus(1.0 + M_PI, 0.017, {0.0032, 0.0050}, 500, 1);
  ASSERT_EQ(r.closed.size(), 2u);
  EXPECT_GT(contactDirection(r.mechanism, r.point, r.locus, LocusAxes::kSensor).misfit, 0.2);
}

}  // namespace
}  // namespace assembly_cell
