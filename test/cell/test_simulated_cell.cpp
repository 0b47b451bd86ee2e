// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Mechanism and both strain bridges together.
#include "assembly_cell/cell/simulated_cell.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "../dynamics/scenes.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/two_sensor/rig.h"
#include "assembly_cell/cell/start.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

Vector6 sample(const std::vector<double>& volts, std::size_t i) {
  return Vector6::Map(volts.data() + 6 * i);
}

TEST(SimulatedCell, BlocksFollowEachOtherInTime) {
  CellParameters p;
  p.block_size = 30;
  p.sample_period = 2e-4;
  SimulatedCell cell(load("cell"), p);
  StrainBlock block;
  for (std::uint32_t k = 0; k < 20; ++k) {
    ASSERT_EQ(cell.next(block), StopReason::kOk);
    EXPECT_EQ(block.sequence, k);
    EXPECT_EQ(block.period, 2e-4);
    // the first sample one period after the block's start, the last at its end
    EXPECT_NEAR(block.time, 2e-4 * (30 * k + 1), 1e-15);
    EXPECT_NEAR(cell.world().time(), block.time + 29 * block.period, 1e-15);
    EXPECT_EQ(block.volts_a.size(), 180u);
    EXPECT_EQ(block.volts_b.size(), 180u);
    EXPECT_EQ(block.saturated_a.size(), 30u);
    EXPECT_EQ(block.saturated_b.size(), 30u);
  }
}

// The cell hangs at rest, so that what varies is noise.
TEST(SimulatedCell, NoiseHasItsRms) {
  CellParameters p;
  p.bits = 24;
  p.noise = 0.5e-3;
  SimulatedCell cell(load("cell"), p);
  Vector6 sum_a = Vector6::Zero(), sum_b = sum_a, squares_a = sum_a, squares_b = sum_a;
  Vector6 products = sum_a;
  StrainBlock block;
  const int n = 100 * p.block_size;
  Vector6 first_a = sum_a, first_b = sum_a;
  for (int k = 0; k < 100; ++k) {
    ASSERT_EQ(cell.next(block), StopReason::kOk);
    for (std::size_t i = 0; i < block.saturated_a.size(); ++i) {
      if (k == 0 && i == 0) first_a = sample(block.volts_a, 0), first_b = sample(block.volts_b, 0);
      const Vector6 a = sample(block.volts_a, i) - first_a, b = sample(block.volts_b, i) - first_b;
      sum_a += a;
      sum_b += b;
      squares_a += a.cwiseAbs2();
      squares_b += b.cwiseAbs2();
      products += a.cwiseProduct(b);
    }
  }
  const Vector6 var_a = squares_a / n - (sum_a / n).cwiseAbs2();
  const Vector6 var_b = squares_b / n - (sum_b / n).cwiseAbs2();
  const Vector6 covariance = products / n - (sum_a / n).cwiseProduct(sum_b / n);
  // five standard deviations of an estimate from n samples: rms/sqrt(2n), 1/sqrt(n)
  for (int c = 0; c < 6; ++c) {
    EXPECT_NEAR(std::sqrt(var_a(c)), p.noise, 5 * p.noise / std::sqrt(2.0 * n)) << c;
    EXPECT_NEAR(std::sqrt(var_b(c)), p.noise, 5 * p.noise / std::sqrt(2.0 * n)) << c;
    EXPECT_NEAR(covariance(c), 0.0, 5 * p.noise * p.noise / std::sqrt(1.0 * n)) << c;
  }
}

TEST(SimulatedCell, VoltsAreCodesOfTheConverter) {
  for (const int bits : {10, 16, 24}) {
    CellParameters p;
    p.bits = bits;
    SimulatedCell cell(load("cell"), p);
    StrainBlock block;
    ASSERT_EQ(cell.next(block), StopReason::kOk);
    const double lsb = 10.0 / std::ldexp(1.0, bits);
    for (const std::vector<double>& volts : {block.volts_a, block.volts_b}) {
      for (const double v : volts) EXPECT_EQ(v / lsb, std::nearbyint(v / lsb)) << bits;
    }
  }
}

// Without noise the reading is within half a code of the design's volts.
TEST(SimulatedCell, ReadingIsTheWrenchToHalfACode) {
  CellParameters p;
  p.noise = 0.0;
  SimulatedCell cell(load("cell"), p);
  StrainBlock block;
  ASSERT_EQ(cell.next(block), StopReason::kOk);
  const Calibration b = designCalibration(bridgeB(p.bits, 0.0));
  const Vector6 exact = b.volts_to_wrench.inverse() * cell.world().couplingWrench() + b.zero_volts;
  const Vector6 last = sample(block.volts_b, block.saturated_b.size() - 1);
  const double lsb = 10.0 / std::ldexp(1.0, p.bits);
  EXPECT_LE((last - exact).cwiseAbs().maxCoeff(), 0.5 * lsb * (1 + 1e-9));
}

// The calibration rig and the cell have the same sensors: as built, and warm, they read the same.
TEST(SimulatedCell, BridgesAreThoseOfTheRig) {
  CellParameters p;
  p.bits = 24;
  p.noise = 0.0;
  p.bridge_nonlinearity = 1.0;
  p.bridge_drift = 5e5;                                             // 2.8 K within the block [K/h]
  p.truth.sensor_b.drift << 6e4, -3e4, 3e4, 1200.0, -900.0, 600.0;  // a load for the sensor alone
  SimulatedCell cell(load("cell"), p);
  StrainBlock block;
  ASSERT_EQ(cell.next(block), StopReason::kOk);
  const double time = cell.world().time();
  LoadRequest request;
  request.target.kind = ObservationKind::kLinearity;
  request.target.side = Side::kB;
  request.wrench = cell.world().couplingWrench() + time / 60.0 * p.truth.sensor_b.drift;

  // in codes, against a rig of this nonlinearity and drift
  const auto difference = [&](double nonlinearity, double drift) {
    RigSettings settings;
    settings.bits = p.bits;
    settings.noise = 0.0;
    settings.nonlinearity = nonlinearity;
    settings.drift = drift;
    settings.reference_errors = false;
    settings.test_time = time;  // the rig is then as old as the cell
    CalibrationRig rig(settings);
    rig.apply(request);
    const Vector6 volts = sample(block.volts_b, block.saturated_b.size() - 1);
    return (volts - rig.sample().b.volts).cwiseAbs().maxCoeff() * std::ldexp(1.0, p.bits) / 10.0;
  };
  EXPECT_LE(difference(1.0, p.bridge_drift), 1.0 + 1e-6);
  EXPECT_GT(difference(0.0, p.bridge_drift), 1000.0);
  EXPECT_GT(difference(1.0, 0.0), 1000.0);
  EXPECT_NEAR(block.temperature, Bridge{}.temperature + p.bridge_drift * time / 3600.0, 1e-9);

  for (const double bad : {-0.1, 1.1, std::nan("")}) {
    p.bridge_nonlinearity = bad;
    EXPECT_THROW(SimulatedCell(load("cell"), p), InputError) << bad;
  }
}

TEST(SimulatedCell, OverloadIsFlagged) {
  CellParameters p;
  Scenario scene = load("cell", {"contact={law: none}"});
  SimulatedCell relaxed(scene, p);
  StrainBlock block;
  ASSERT_EQ(relaxed.next(block), StopReason::kOk);
  for (const std::uint8_t flags : block.saturated_b) EXPECT_EQ(flags, 0);

  // the coupling stretched far beyond what its bridge can show
  scene.initial.position += Vector3d(0.02, 0.0, 0.05);
  SimulatedCell cell(scene, p);
  ASSERT_EQ(cell.next(block), StopReason::kOk);
  int flagged = 0;
  const double lsb = 10.0 / std::ldexp(1.0, p.bits);
  for (std::size_t i = 0; i < block.saturated_b.size(); ++i) {
    for (int c = 0; c < 6; ++c) {
      const double v = sample(block.volts_b, i)(c);
      const bool end_code = v == -5.0 || v == 5.0 - lsb;
      EXPECT_EQ((block.saturated_b[i] >> c & 1) != 0, end_code);
      flagged += end_code ? 1 : 0;
    }
    EXPECT_EQ(block.saturated_a[i], 0);  // nothing touches the hole
  }
  EXPECT_GT(flagged, 0);
}

TEST(SimulatedCell, SeedsDecideTheNoise) {
  std::vector<StrainBlock> blocks(3);
  for (std::size_t run = 0; run < 3; ++run) {
    CellParameters p;
    p.seed = run < 2 ? 7 : 8;
    SimulatedCell cell(load("cell"), p);
    for (int k = 0; k < 3; ++k) ASSERT_EQ(cell.next(blocks[run]), StopReason::kOk);
  }
  EXPECT_EQ(blocks[0].volts_a, blocks[1].volts_a);
  EXPECT_EQ(blocks[0].volts_b, blocks[1].volts_b);
  EXPECT_NE(blocks[0].volts_a, blocks[2].volts_a);
  EXPECT_NE(blocks[0].volts_b, blocks[2].volts_b);
}

// At rest in contact what the hole's sensor gains is what the peg's sensor loses.
TEST(SimulatedCell, SensorsSeeTheContactWithOppositeSigns) {
  CellParameters p;
  p.bits = 24;
  p.noise = 0.0;
  const Scenario s = load("cell", {"coupling.damping.diagonal=[280, 280, 280, 0.15, 0.15, 0.15]",
                                   "solver.max_step=5e-4"});
  SimulatedCell cell(s, p);
  auto& sim = dynamic_cast<Simulation&>(cell.world());
  const Calibration a = designCalibration(bridgeA(p.bits, 0.0));
  const Calibration b = designCalibration(bridgeB(p.bits, 0.0), s.mechanism.coupling);
  RestPose down = s.rest;
  down.z -= 0.0034;  // the lowest point hangs 3 mm above the plane
  sim.setRestTarget(down);
  StrainBlock block;
  for (int k = 0; k < 100; ++k) ASSERT_EQ(cell.next(block), StopReason::kOk);
  ASSERT_LT(sim.state().v.cwiseAbs().maxCoeff(), 1e-7);

  const std::size_t last = block.saturated_a.size() - 1;
  ASSERT_EQ(block.saturated_a[last] | block.saturated_b[last], 0);
  // everything about the origin of `hole`
  Vector6 weight = Vector6::Zero();
  weight(2) = -p.hole_block_mass * s.mechanism.gravity;
  const Vector6 block_weight =
      transformWrench({Eigen::Matrix3d::Identity(), p.hole_block_center}, weight);
  const Vector6 on_hole =
      transformWrench(inverse(p.X_AH), wrenchFromVolts(a, sample(block.volts_a, last))) -
      block_weight;
  const Vector6 on_b =
      transformWrench(sim.carrierPose(), wrenchFromVolts(b, sample(block.volts_b, last)));
  const Pose peg = sim.pegPose();
  weight(2) = -s.mechanism.peg.mass * s.mechanism.gravity;
  const Vector6 peg_weight = transformWrench(
      {Eigen::Matrix3d::Identity(), peg.p + s.mechanism.peg.half_height * peg.R.col(2)}, weight);
  const Vector6 on_peg = on_b - peg_weight;
  EXPECT_GT(on_peg(2), 5.0);
  // half a code of six channels, 0.3 uV, through the inverse of the strain matrix
  const double code = 0.5 * 10.0 / std::ldexp(1.0, p.bits) * 6;
  const double bound =
      code * (a.volts_to_wrench.cwiseAbs().maxCoeff() + b.volts_to_wrench.cwiseAbs().maxCoeff());
  EXPECT_LT((on_hole + on_peg).cwiseAbs().maxCoeff(), bound + 1e-5);
  // and the displacement it reports is the coupling's: frames differ by its tilt of 1e-3 rad
  const Vector6 shown = displacementFromVolts(b, sample(block.volts_b, last));
  const Vector6 truth = couplingDeflection(sim);
  EXPECT_LT((shown - truth).head<3>().norm(), 0.02 * truth.head<3>().norm());
}

// Largest friction over normal force of the sliding contacts; 0 without one.
double slidingRatio(const SimulatorBackend& world) {
  double ratio = 0.0;
  for (const ContactReport& c : world.contacts()) {
    const double normal = c.force.dot(c.normal);
    if (!c.valid || c.state != ContactReport::kSlip || normal < 0.1) continue;
    ratio = std::max(ratio, (c.force - normal * c.normal).norm() / normal);
  }
  return ratio;
}

// A peg that is pressed aside in the bore goes down through the burr: by Coulomb's law the sliding
// contacts have the friction of the depth.
TEST(SimulatedCell, BurrMultipliesTheFrictionOverItsDepthOnly) {
  for (const bool rigid : {false, true}) {
    Scenario s = load("cell", {rigid ? "contact.law=rigid" : "contact.law=viscous"});
    place(s, {0.0, 0.0, -0.02}, 0.0, 0.0);
    CellParameters p, far;
    p.truth.burr = {3.0, 0.021, 0.002};
    far.truth.burr = {3.0, 0.035, 0.002};
    SimulatedCell cell(s, p), plain(s, {}), below(s, far);
    RestPose down = s.rest;
    down.x += 0.5e-3;
    down.z -= 0.005;
    for (SimulatedCell* each : {&cell, &plain, &below}) each->world().setRestTarget(down, 2e-3);
    const double mu = s.mechanism.friction.sliding_coefficient;
    StrainBlock a, b, c;
    int outside = 0, inside = 0;
    for (int k = 0; k < 250; ++k) {
      const double before = -cell.world().pegPose().p.z();
      ASSERT_EQ(cell.next(a), StopReason::kOk);
      ASSERT_EQ(plain.next(b), StopReason::kOk);
      ASSERT_EQ(below.next(c), StopReason::kOk);
      ASSERT_EQ(b.volts_b, c.volts_b);
      const double ratio = slidingRatio(cell.world());
      if (ratio == 0.0) continue;
      const bool in = before >= 0.021 && before <= 0.023;
      EXPECT_NEAR(ratio, in ? 3.0 * mu : mu, 1e-6 * mu) << before;
      (in ? inside : outside) += 1;
    }
    EXPECT_GT(inside, 5) << rigid;
    EXPECT_GT(outside, 5) << rigid;
  }
}

// A mount whose axes are all coupled: the peg's weight bends it by compliance times wrench.
TEST(SimulatedCell, AMountYieldsByItsCompliance) {
  std::ifstream in(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  std::string text{std::istreambuf_iterator<char>(in), {}};
  const std::size_t at = text.find("  stiffness: {diagonal");
  ASSERT_NE(at, std::string::npos);
  text.replace(
      at, text.find('\n', at) - at,
      "  compliance: [2e-5, 0, 8e-6, 0, 1e-4, 1e-4, 0, 3e-5, 6e-6, 2e-4, 0, 0, 8e-6, 6e-6, "
      "2e-5, 1e-4, -1e-4, 0, 0, 2e-4, 1e-4, 2e-2, 0, 1e-3, 1e-4, 0, -1e-4, 0, 2e-2, 0, "
      "1e-4, 0, 0, 1e-3, 0, 2e-2]\n  axes: carrier");
  const Scenario nominal =
      startAt(parseScenario(text, "test"), Eigen::Vector2d(0.004, 0), Eigen::Vector2d(0, 0), 0.02);
  const Mechanism& m = nominal.mechanism;
  std::vector<WorldChoice> worlds(1);
  try {
    worlds.push_back(parseWorld("mujoco", "test"));
  } catch (const InputError&) {  // this build has none
  }
  for (const WorldChoice& world : worlds) {
    CellParameters parameters;
    parameters.world = world;
    SimulatedCell cell(nominal, parameters);
    StrainBlock block;
    while (cell.world().time() < 6.0) ASSERT_EQ(cell.next(block), StopReason::kOk);
    const Vector6 wrench = cell.world().couplingWrench();
    EXPECT_NEAR(wrench(2), -m.peg.mass * m.gravity, 1e-3);
    const Pose carrier = cell.world().carrierPose();
    const Pose arm{Eigen::Matrix3d::Identity(),
                   Eigen::Vector3d(0, 0, m.peg.half_height + m.peg.coupling_height)};
    const Pose off = inverse(carrier) * (cell.world().pegPose() * arm);
    Vector6 bent;
    bent << off.p, vectorFromRotation(off.R).value;
    const Vector6 expected = couplingStiffness(m.coupling).inverse() * wrench;
    EXPECT_GT(std::abs(expected(0)), 1e-5);
    EXPECT_GT(std::abs(expected(3)), 1e-4);
    for (int i = 0; i < 6; ++i) {
      EXPECT_NEAR(bent(i), expected(i), 1e-2 * std::abs(expected(i)) + (i < 3 ? 2e-7 : 2e-6)) << i;
    }
  }
}

TEST(SimulatedCell, ReusesTheBlock) {
  SimulatedCell cell(load("cell"), CellParameters{});
  StrainBlock block;
  ASSERT_EQ(cell.next(block), StopReason::kOk);
  const double* a = block.volts_a.data();
  const double* b = block.volts_b.data();
  ASSERT_EQ(cell.next(block), StopReason::kOk);
  EXPECT_EQ(block.volts_a.data(), a);
  EXPECT_EQ(block.volts_b.data(), b);
}

TEST(SimulatedCell, StopIsReported) {
  Scenario lying = load("cell");
  lying.initial.euler.theta = 0.05;
  SimulatedCell cell(lying, CellParameters{});
  StrainBlock block;
  EXPECT_EQ(cell.next(block), StopReason::kSingular);
}

TEST(SimulatedCell, RefusesWhatCanNotMeasure) {
  CellParameters p;
  p.bits = 12;
  EXPECT_THROW(SimulatedCell(load("cell"), p), InputError);
  CouplingParameters loose;
  loose.stiffness.diagonal.setOnes();
  loose.stiffness.diagonal(0) = 0.0;
  EXPECT_THROW(designCalibration(bridgeB(16, 0.0), loose), InputError);
}

}  // namespace
}  // namespace assembly_cell
