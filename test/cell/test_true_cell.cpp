// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What a mismatch does to the simulated cell, key by key, against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "assembly_cell/align/outcome.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/mismatch/mismatch.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPeriod = 2e-4;  // of samples [s]

Scenario cell(const std::vector<std::string>& overrides = {}) {
  return loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml",
                      overrides);
}
// upright and high over the plane, hanging
Scenario hanging() { return startAt(cell(), Vector2d(0.004, 0.0), Vector2d(0, 0), 0.02); }

struct True {
  Scenario scenario;
  CellParameters cell;
};
True truthOf(const std::string& text, const Scenario& nominal, std::uint64_t seed = 3) {
  const Truth truth = drawTruth(parseMismatch(text, "test"), seed);
  True t{trueScenario(nominal, truth, "test"), {}};
  t.cell.truth = truth.cell;
  t.cell.bits = 24;
  t.cell.seed = seed;
  return t;
}
SimulatedCell made(const True& t) { return SimulatedCell(t.scenario, t.cell); }

// all worlds of this build
std::vector<WorldChoice> worlds() {
  std::vector<WorldChoice> all(1);
  try {
    all.push_back(parseWorld("mujoco", "test"));
  } catch (const InputError&) {  // this build has none
  }
  return all;
}

void run(SimulatedCell& cell, double seconds) {
  StrainBlock block;
  const double end = cell.world().time() + seconds - 1e-9;
  while (cell.world().time() < end) ASSERT_EQ(cell.next(block), StopReason::kOk);
}

// ---- the mechanism

// A softer coupling and a heavier peg hang lower: m g / k, and the carrier's own sag with it.
TEST(TrueCell, StiffnessAndMassHangByStatics) {
  const Scenario nominal = hanging();
  const Mechanism& m = nominal.mechanism;
  const auto height = [&](const std::string& text) {
    SimulatedCell cell = made(truthOf(text, nominal));
    run(cell, 4.0);
    return cell.world().pegPose().p.z();
  };
  const double sag = m.peg.mass * m.gravity / m.coupling.stiffness.diagonal[0];
  const double start = height("{}");
  // ringing of 350 rad/s with 5 % of critical damping is over after 4 s
  EXPECT_NEAR(height("scale: {coupling.stiffness: 0.8}") - start, -sag * (1 / 0.8 - 1), 1e-9);
  EXPECT_NEAR(height("scale: {peg.mass: 1.1}") - start, -sag * 0.1, 1e-9);
  EXPECT_NEAR(height("add: {peg.coupling_height: 0.001}") - start, -0.001, 1e-9);
  EXPECT_NEAR(height("carrier: {compliance: 5.0e-6}") - start, -5e-6 * m.peg.mass * m.gravity,
              1e-9);
}

// ---- the exciter

// Fourier components of the force over a turn: an ellipse is a forward and a backward circle of
// (a ± b)/2, the backward one with the phase of twice the azimuth.
TEST(TrueCell, ExciterHasItsComponents) {
  ExciterErrors errors;
  errors.gain = 0.8;
  errors.delay = 7e-4;
  errors.ellipticity = 0.15;
  errors.azimuth = 0.6;
  errors.harmonic = 0.02;
  ExciterParameters asked;
  asked.amplitude = 5.0;
  asked.frequency = 450.0;
  asked.phase = 0.3;
  for (const int direction : {1, -1}) {
    asked.direction = direction;
    const Drive drive{asked, 0.1, errors};
    constexpr int n = 64;
    const auto component = [&](int order) {
      std::complex<double> sum = 0.0;
      for (int k = 0; k < n; ++k) {
        const double t = 0.1 + 2 * M_PI / asked.frequency * k / n;
        const Vector2d f = exciterForce(drive, t);  // thesis axes: peg y down, peg x
        const double turn = direction * asked.frequency * (t - 0.1);
        sum += std::complex<double>(f.y(), -f.x()) * std::polar(1.0 / n, -order * turn);
      }
      return sum;
    };
    const double angle = direction * (asked.phase - asked.frequency * errors.delay);
    const double a = 0.8 * 5.0, b = a * (1 - 0.15);
    EXPECT_LT(std::abs(component(1) - std::polar(0.5 * (a + b), angle)), 1e-12);
    EXPECT_LT(std::abs(component(-1) - std::polar(0.5 * (a - b), 2 * 0.6 - angle)), 1e-12);
    EXPECT_LT(std::abs(component(2) - std::polar(0.02 * a, 2 * angle)), 1e-12);
    EXPECT_LT(std::abs(component(0)), 1e-12);
    EXPECT_LT(std::abs(component(3)), 1e-12);
  }
}

// The simulation is driven by that force: the coupling's load is scaled with it (linear).
TEST(TrueCell, ExciterDrivesTheCell) {
  const auto power = [](const std::string& text) {
    const True t = truthOf(text, hanging());
    Simulation simulation(t.scenario);
    ExciterParameters drive;
    drive.amplitude = 2.0;
    drive.frequency = 450.0;
    simulation.setExciter(drive, 0.0);
    double sum = 0.0;
    for (int i = 0; i < 10000; ++i) {
      EXPECT_EQ(simulation.advance((i + 1) * kPeriod), StopReason::kOk);
      if (i > 7500) sum += simulation.couplingWrench().head<2>().squaredNorm();
    }
    return std::sqrt(sum);
  };
  // large angles make it nonlinear by their square, below 1e-4
  EXPECT_NEAR(power("exciter: {amplitude: 0.7}") / power("{}"), 0.7, 1e-3);
}

// ---- the sensors

Vector6 wrench() {
  Vector6 w;
  w << 3.0, -2.0, 5.0, 0.1, -0.2, 0.3;
  return w;
}

TEST(MeasuredWrench, ExactSensorsChangeNothing) {
  MeasuredWrench measured(SensorTruth{}, kPeriod);
  EXPECT_EQ(measured(wrench(), 1.0), wrench());
}

// Entry by entry: a force of 1 N counts as much as a torque of 0.03 N m.
TEST(MeasuredWrench, MatrixMapsTorquesAtTheirLever) {
  SensorTruth truth;
  truth.matrix(0, 1) = 0.01;  // x from y
  truth.matrix(2, 3) = 0.02;  // force from torque
  truth.matrix(5, 0) = 0.03;  // torque from force
  truth.matrix(4, 4) = -0.04;
  MeasuredWrench measured(truth, kPeriod);
  Vector6 expected = wrench();
  expected(0) += 0.01 * -2.0;
  expected(2) += 0.02 * 0.1 / 0.03;
  expected(5) += 0.03 * 0.03 * 3.0;
  expected(4) += -0.04 * -0.2;
  EXPECT_LT((measured(wrench(), 0.0) - expected).norm(), 1e-15);
}

// A sensor turned by a quarter about z and moved along x: by hand.
TEST(MeasuredWrench, FrameIsTurnedAndMoved) {
  SensorTruth truth;
  truth.rotation = Vector3d(0, 0, M_PI / 2);
  truth.offset = Vector3d(0.01, 0, 0);
  MeasuredWrench measured(truth, kPeriod);
  const Vector6 w = measured(wrench(), 0.0);
  // its x is the old y, its y the old −x; about its origin the torque lacks offset × force
  EXPECT_LT((w.head<3>() - Vector3d(-2.0, -3.0, 5.0)).norm(), 1e-14);
  const Vector3d about(0.1, -0.2 + 0.01 * 5.0, 0.3 + 0.01 * 2.0);
  EXPECT_LT((w.tail<3>() - Vector3d(about.y(), -about.x(), about.z())).norm(), 1e-14);
}

TEST(MeasuredWrench, DriftsAndHums) {
  SensorTruth truth;
  truth.drift << 1.0, -0.5, 0.0, 0.01, 0.0, -0.02;
  MeasuredWrench drifting(truth, kPeriod);
  EXPECT_LT((drifting(wrench(), 30.0) - wrench() - 0.5 * truth.drift).norm(), 1e-15);

  SensorTruth humming;
  humming.hum = Vector3d(0.1, 0.0, -0.2);
  humming.hum_frequency = 50.0;
  humming.hum_phase = 0.7;
  MeasuredWrench measured(humming, kPeriod);
  for (const double t : {0.0, 0.001, 0.013}) {
    const Vector6 hum = measured(wrench(), t) - wrench();
    EXPECT_LT((hum.head<3>() - std::sin(2 * M_PI * 50 * t + 0.7) * humming.hum).norm(), 1e-14);
    EXPECT_TRUE(hum.tail<3>().isZero());
  }
}

// After a minute a walk has the variance of its square; half of that after half of it.
TEST(MeasuredWrench, WalksAtRandom) {
  constexpr int n = 400;
  constexpr double period = 0.05;
  double half = 0.0, whole = 0.0, torque = 0.0;
  for (int seed = 0; seed < n; ++seed) {
    SensorTruth truth;
    truth.walk = 0.1;
    truth.walk_seed = static_cast<std::uint64_t>(seed);
    MeasuredWrench measured(truth, period);
    for (int i = 1; i <= 1200; ++i) {
      const Vector6 w = measured(Vector6::Zero(), i * period);
      if (i == 600) half += w.head<3>().squaredNorm();
      if (i == 1200) whole += w.head<3>().squaredNorm();
      if (i == 1200) torque += w.tail<3>().squaredNorm();
    }
  }
  // relative standard error of a variance from 3 n normal numbers
  const double error = 5 * std::sqrt(2.0 / (3 * n));
  EXPECT_NEAR(whole / (3 * n * 0.01), 1.0, error);
  EXPECT_NEAR(half / (3 * n * 0.005), 1.0, error);
  EXPECT_NEAR(torque / (3 * n * 0.01 * 9e-4), 1.0, error);
}

TEST(MeasuredWrench, ComesLate) {
  for (const double latency : {3e-5, 2e-4, 4.7e-4, 1e-3, 3.33e-3}) {
    SensorTruth truth;
    truth.latency = latency;
    MeasuredWrench measured(truth, kPeriod);
    const double omega = 450.0;
    // a cubic through four samples errs by (omega period)⁴ / 4! times the product of the
    // distances, at most 1 in the middle and 6 outside of it
    const double error = std::pow(omega * kPeriod, 4) / 24 * 6;
    for (int i = 0; i < 200; ++i) {
      const double t = i * kPeriod;
      Vector6 w = Vector6::Zero();
      w(0) = 2.0 * t;
      w(1) = std::sin(omega * t);
      const Vector6 late = measured(w, t);
      if (i < 30) continue;
      EXPECT_NEAR(late(0), 2.0 * (t - latency), 1e-15);
      EXPECT_NEAR(late(1), std::sin(omega * (t - latency)), error);
    }
  }
}

// The noise of both sensors stays what it was, whatever the truth: volts differ by the map of what
// was added, to half of a converter's step.
TEST(TrueCell, NoiseIsNotTouched) {
  const Scenario nominal = hanging();
  const auto first = [&](const std::string& text) {
    SimulatedCell cell = made(truthOf(text, nominal));
    StrainBlock block;
    EXPECT_EQ(cell.next(block), StopReason::kOk);
    return block;
  };
  const StrainBlock before = first("{}");
  const StrainBlock other = first("carrier: {reading_noise: 1.0e-5}");
  EXPECT_EQ(before.volts_a, other.volts_a);
  EXPECT_EQ(before.volts_b, other.volts_b);
  const StrainBlock after = first("sensor_a: {drift: {force: 60}}");  // 1 N/s
  EXPECT_EQ(before.volts_b, after.volts_b);
  const Matrix6 C = strainMatrix(bridgeA(24, 0.5e-3));
  const double step = 10.0 / std::pow(2.0, 24);
  for (int i = 0; i < 100; ++i) {
    Vector6 drift = Vector6::Zero();
    drift.head<3>().setConstant((i + 1) * kPeriod);
    const Vector6 difference =
        Vector6::Map(after.volts_a.data() + 6 * i) - Vector6::Map(before.volts_a.data() + 6 * i);
    EXPECT_LT((difference - C * drift).cwiseAbs().maxCoeff(), 1.01 * step);
  }
}

// ---- the carrier

TEST(TrueCarrier, ReportsWithNoise) {
  SimulatedCell noisy = made(truthOf("carrier: {reading_noise: 1.0e-5}", hanging()));
  SimulatedCell exact = made(truthOf("{}", hanging()));
  constexpr int n = 500;
  StrainBlock block;
  double squares = 0.0, turns = 0.0, products = 0.0;
  Vector3d last = Vector3d::Zero();
  for (int i = 0; i < n; ++i) {
    ASSERT_EQ(noisy.next(block), StopReason::kOk);
    ASSERT_EQ(exact.next(block), StopReason::kOk);
    const Vector3d d = noisy.reported().p - exact.reported().p;
    squares += d.squaredNorm() / (3 * n);
    products += d.dot(last) / (3 * n);
    turns += vectorFromRotation(exact.reported().R.transpose() * noisy.reported().R)
                 .value.squaredNorm() /
             (3 * n);
    last = d;
  }
  const double error = 5 * std::sqrt(2.0 / (3 * n));
  EXPECT_NEAR(squares / 1e-10, 1.0, error);
  EXPECT_NEAR(turns / 1e-12, 1.0, error);  // 0.1 rad/m
  EXPECT_NEAR(products / 1e-10, 0.0, 5 / std::sqrt(3.0 * n));
}

// Where moves of 1 mm end: off by the stated deviation, unseen by the encoders; moves of 0.1 mm
// keep it.
TEST(TrueCarrier, RepeatsWithinItsDeviation) {
  const Scenario nominal = hanging();
  SimulatedCell cell = made(truthOf("carrier: {repeatability: 3.0e-5}", nominal));
  const Pose X_HB = carrierBase(nominal);
  const auto offset = [&] {
    const Pose truth = inverse(X_HB) * cell.world().carrierPose();
    return Vector3d(truth.p - cell.reported().p);
  };
  run(cell, 0.1);
  EXPECT_LT(offset().norm(), 1e-12) << "drawn at the end of a move only";
  double squares = 0.0, kept = 0.0;
  Vector3d last = Vector3d::Zero();
  constexpr int n = 120;
  for (int i = 0; i < n; ++i) {
    const double x = i % 2 == 0 ? 0.001 : 0.0;
    cell.command({Eigen::Matrix3d::Identity(), Vector3d(x, 0, 0)});
    run(cell, 0.4);
    const Vector3d drawn = offset();
    EXPECT_GT((drawn - last).norm(), 1e-7);
    squares += drawn.squaredNorm() / (3 * n);
    cell.command({Eigen::Matrix3d::Identity(), Vector3d(x, 1e-4, 0)});
    run(cell, 0.4);
    kept = std::max(kept, (offset() - drawn).norm());
    last = drawn;
  }
  EXPECT_NEAR(squares / 9e-10, 1.0, 5 * std::sqrt(2.0 / (3 * n)));
  // what is left of the mechanism's ringing after 0.4 s
  EXPECT_LT(kept, 1e-8);
}

// First-order: the carrier yields to the weight like 1 − exp(−t / 10 ms), unseen.
TEST(TrueCarrier, YieldsWithItsLag) {
  Scenario nominal = hanging();
  const Mechanism& m = nominal.mechanism;
  const double weight = m.peg.mass * m.gravity;
  nominal.initial.position.z() -= weight / m.coupling.stiffness.diagonal[0];
  SimulatedCell cell = made(truthOf("carrier: {compliance: 5.0e-6}", nominal));
  const double start = cell.reported().p.z();
  for (int block = 1; block <= 5; ++block) {
    run(cell, 0.02);
    const double t = 0.02 * block;
    // the force rings by some per cent as the peg follows
    EXPECT_NEAR(cell.world().restShift()(2), -5e-6 * weight * (1 - std::exp(-t / 0.01)),
                0.03 * 5e-6 * weight);
    EXPECT_NEAR(cell.reported().p.z(), start, 1e-12);
  }
}

// Both worlds: a profile of 10 mm begins the latency later, and is otherwise the same.
TEST(TrueCarrier, TakesCommandsAfterItsLatency) {
  const Scenario nominal = hanging();
  for (const WorldChoice& world : worlds()) {
    const auto path = [&](const std::string& text, double before) {
      True t = truthOf(text, nominal);
      t.cell.world = world;
      SimulatedCell cell = made(t);
      run(cell, 0.02);
      cell.command({Eigen::Matrix3d::Identity(), Vector3d(0.01, 0, 0)});
      std::vector<double> x;
      for (double time = 0.0; time < before - 1e-9; time += 0.02) {
        run(cell, 0.02);
        EXPECT_NEAR(cell.world().rest().x, nominal.rest.x, 1e-12) << time;
      }
      for (int block = 0; block < 30; ++block) {
        run(cell, 0.02);
        x.push_back(cell.world().rest().x);
      }
      return x;
    };
    const std::vector<double> prompt = path("{}", 0.0);
    const std::vector<double> late = path("carrier: {latency: 0.1}", 0.1);
    for (std::size_t i = 0; i < prompt.size(); ++i) EXPECT_NEAR(late[i], prompt[i], 1e-9) << i;
    EXPECT_NEAR(prompt.back() - nominal.rest.x, 0.01, 1e-12);
  }
}

// Jitter: the commands of a ramp take effect within latency and jitter, in their order.
TEST(TrueCarrier, JitterKeepsTheOrderOfCommands) {
  const Scenario nominal = hanging();
  SimulatedCell cell = made(truthOf("carrier: {latency: 0.04, jitter: 0.05}", nominal));
  const double start = cell.world().rest().x;
  double last = start;
  bool uneven = false;
  for (int i = 1; i <= 50; ++i) {
    cell.command({Eigen::Matrix3d::Identity(), Vector3d(1e-4 * i, 0, 0)});
    run(cell, 0.02);
    const double x = cell.world().rest().x;
    EXPECT_GE(x, last - 1e-12);
    EXPECT_GE(start + 1e-4 * i - x, 1e-4);
    EXPECT_LE(start + 1e-4 * i - x, 1e-4 * 9);
    uneven = uneven || (i > 10 && std::abs(x - last - 1e-4) > 1e-5);
    last = x;
  }
  EXPECT_TRUE(uneven);
  run(cell, 0.4);
  EXPECT_NEAR(cell.world().rest().x - start, 50e-4, 1e-12);
}

// First order: behind a steady motion of speed v by v·lag.
TEST(TrueCarrier, LagsByItsTimeConstant) {
  const Scenario nominal = hanging();
  for (const WorldChoice& world : worlds()) {
    True t = truthOf("carrier: {lag: 0.03}", nominal);
    t.cell.world = world;
    SimulatedCell cell = made(t);
    const double speed = 0.005;
    cell.command({Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.01)}, speed);
    True exact = truthOf("{}", nominal);
    exact.cell.world = world;
    SimulatedCell prompt = made(exact);
    prompt.command({Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.01)}, speed);
    // numerical solution of the lag behind the prompt carrier's profile
    double expected = prompt.world().rest().z, most = 0.0;
    for (int block = 0; block < 300; ++block) {
      run(cell, 0.02);
      const int n = 100;
      const double from = prompt.world().rest().z;
      run(prompt, 0.02);
      const double to = prompt.world().rest().z;
      for (int i = 0; i < n; ++i) {
        const double r = from + (to - from) * (i + 0.5) / n;
        expected += (r - expected) * (1.0 - std::exp(-0.02 / n / 0.03));
      }
      EXPECT_NEAR(cell.world().rest().z, expected, 0.02 * speed * 0.03 + 1e-7) << block;
      most = std::max(most, to - cell.world().rest().z);
    }
    EXPECT_GT(most, 0.5 * speed * 0.03);
    EXPECT_NEAR(cell.world().rest().z, prompt.world().rest().z, 2e-9);
  }
}

// Moves to and fro end half of the gap short of where the encoders report them.
TEST(TrueCarrier, BacklashIsUnseenByItsEncoders) {
  const Scenario nominal = hanging();
  const Pose X_HB = carrierBase(nominal);
  for (const WorldChoice& world : worlds()) {
    True t = truthOf("carrier: {backlash: 6.0e-5}", nominal);
    t.cell.world = world;
    SimulatedCell cell = made(t);
    for (const double x : {0.002, 0.001, 0.0011, 0.00105, -0.001}) {
      const double before = cell.world().rest().x;
      cell.command({Eigen::Matrix3d::Identity(), Vector3d(x, 0, 0)});
      run(cell, 1.0);
      const double rest = (inverse(X_HB) * poseFromRest(cell.world().rest())).p.x();
      // the first reversal by less than the gap moves nothing
      if (x == 0.00105) {
        EXPECT_NEAR(cell.world().rest().x, before, 1e-12);
        EXPECT_NEAR(rest - x, 2e-5, 1e-9);
      } else {
        EXPECT_NEAR(rest - x, x == 0.002 || x == 0.0011 ? -3e-5 : 3e-5, 1e-9) << x;
      }
      EXPECT_NEAR(cell.carrier().encoders(cell.world()).p.x(), x, 1e-6) << x;
    }
  }
}

// A stop takes effect without latency; commands still in the queue are discarded.
TEST(TrueCarrier, AStopDropsLateCommands) {
  const Scenario nominal = hanging();
  SimulatedCell cell = made(truthOf("carrier: {latency: 0.1}", nominal));
  cell.command({Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.01)}, 0.02);
  run(cell, 0.2);
  cell.command({Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.03)}, 0.02);
  const double at = cell.world().rest().z;
  cell.stop();
  run(cell, 1.0);
  EXPECT_NEAR(cell.world().rest().z, at, 1e-3);
  const double held = cell.world().rest().z;
  cell.command({Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.005)}, 0.02);
  run(cell, 0.1);
  EXPECT_NEAR(cell.world().rest().z, held, 1e-12);
  run(cell, 1.0);
  EXPECT_NEAR((inverse(carrierBase(nominal)) * poseFromRest(cell.world().rest())).p.z(), 0.005,
              1e-9);
}

// The encoders' axes: a way of 10 mm that is commanded is another one in the cell.
TEST(TrueCarrier, EncodersHaveTheirOwnAxes) {
  const Scenario nominal = hanging();
  const True t = truthOf("carrier: {frame: {rotation: 0.05, scale: 0.01, offset: 0.004}}", nominal);
  SimulatedCell cell = made(t);
  run(cell, 0.3);
  const Pose before = cell.world().carrierPose();
  const CarrierTruth& truth = t.cell.truth.carrier;
  // at the start the base's origin, seen in axes that are turned, moved and scaled
  const Eigen::Matrix3d R = Eigen::AngleAxisd(0.05, truth.rotation.normalized()).toRotationMatrix();
  EXPECT_NEAR(truth.offset.norm(), 0.004, 1e-15);
  const Pose X_HB = carrierBase(nominal);
  const Vector3d in_base = X_HB.R.transpose() * (before.p - X_HB.p);
  EXPECT_LT((cell.reported().p - 1.01 * (R.transpose() * (in_base - truth.offset))).norm(), 1e-12);
  // and the way there
  const Vector3d way(0.0, 0.0101, 0.0);
  Pose goal = cell.reported();
  goal.p += way;
  cell.command(goal);
  run(cell, 1.0);
  const Vector3d gone = cell.world().carrierPose().p - before.p;
  // the carrier's springs carry nothing but weight before and after
  EXPECT_LT((gone - X_HB.R * R * Vector3d(0.0, 0.01, 0.0)).norm(), 1e-7);
}

// ---- the hole

// A peg let down into a bore that leans, with little clearance, takes on its tilt.
TEST(TrueCell, PegFollowsTheBore) {
  Scenario nominal =
      startAt(cell({"hole.radius=0.02502", "friction.static=0", "friction.sliding=0"}),
              Vector2d(0, 0), Vector2d(0, 0), 0.0);
  const True t = truthOf("hole: {bore_tilt: 0.0035}", nominal);
  const Vector2d lean = t.scenario.imperfections.bore_lean;
  SimulatedCell cell = made(t);
  cell.command({Eigen::Matrix3d::Identity(), Vector3d(0, 0, -0.03)});
  run(cell, 3.0);
  const Pose X_HP = cell.world().pegPose();
  ASSERT_LT(X_HP.p.z(), -0.029);
  // within the bore all round, and not in an upright one; the viscous law does not push out again
  // what its approach left, below 1 um
  EXPECT_LE(edgeReach(X_HP, 0.025, lean), 0.02502 + 1e-6);
  EXPECT_GT(edgeReach(X_HP, 0.025), 0.02502 + 2e-5);
  // its axis between the two that the clearance allows
  const Vector2d tilt = X_HP.R.col(2).head<2>() / X_HP.R(2, 2);
  EXPECT_LT((tilt - lean).norm(), 2 * 2e-5 / 0.029);
}

// With nothing drawn a trial is the same to the last bit.
TEST(TrueCell, EmptyMismatchChangesNothing) {
  const Scenario start = startAt(cell(), Vector2d(0.006, -0.003), Vector2d(0.01, 0.02), 0.003);
  AlignParameters parameters;
  parameters.strategy = "twin_force";
  const AlignTrial plain = tryAlignment(start, start.mechanism, {}, parameters);
  True t = truthOf("scale: {}\nsensor_b: {}\n", start);
  t.cell = CellParameters();
  const AlignTrial empty = tryAlignment(t.scenario, start.mechanism, t.cell, parameters);
  EXPECT_EQ(plain.result.offset, empty.result.offset);
  EXPECT_EQ(plain.X_HP.p, empty.X_HP.p);
  EXPECT_EQ(plain.result.time, empty.result.time);
  EXPECT_EQ(plain.result.reason, empty.result.reason);
}

}  // namespace
}  // namespace assembly_cell
