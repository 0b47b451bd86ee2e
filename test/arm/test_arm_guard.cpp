// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_guard.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr double kPeriod = 0.002, kBlock = 0.02;  // [s]
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kNever = 1e9;  // a limit that isn't there

Pose at(double x, double y, double z) { return {Eigen::Matrix3d::Identity(), {x, y, z}}; }

/// No limits: each test sets the one that it checks.
ArmLimits noLimits() {
  ArmLimits limits;
  limits.guard.force = limits.guard.torque = limits.raw_force = limits.raw_torque = kNever;
  limits.force_rate = limits.following = limits.following_turn = kNever;
  limits.motion.speed = 0.05;
  limits.guard.box_min.setConstant(-10.0);
  limits.guard.box_max.setConstant(10.0);
  limits.guard.rotation = 1.0;
  limits.timeout = kNever;
  limits.guard.lone_exciter = kNever;
  return limits;
}

/// A supervisor, an arm that follows its points, sensors, and a clock.
struct Cell {
  ArmGuard arm;
  double now = 10.0;
  Vector6 wrench_a = Vector6::Zero(), wrench_b = Vector6::Zero(), zero = Vector6::Zero();
  bool data_a = true, data_b = true, state = true, lease = true, follows = true;
  std::uint32_t session = 7;
  Vector6 before = Vector6::Zero();
  double fastest = 0.0;

  explicit Cell(const ArmLimits& limits, double stiffness = 0.0) {
    Braking braking;
    braking.stiffness = stiffness * Matrix6::Identity();
    arm = armGuard(limits, braking, LeaseMode::kRequired, false);
    setRate(arm, kPeriod, 0.02);
    setState(arm, Pose(), now);
    run(0.1);
    EXPECT_EQ(arm.mode, ArmMode::kFollowing);
  }
  Sender sender() const { return {"supervisor", now, true, false}; }
  GuardVerdict go(const Pose& X) { return move(arm, sender(), X, now); }

  void block() {
    const auto samples = [&](int sensor, const Vector6& wrench) {
      std::vector<double> values;
      for (int i = 0; i < 4; ++i) values.insert(values.end(), wrench.begin(), wrench.end());
      addSamples(arm, {sensor, values.data(), 4, kBlock / 4, now, zero, nullptr});
    };
    if (data_a) samples(0, wrench_a);
    if (data_b) samples(1, wrench_b);
    if (lease) renew(arm, sender(), session, now);
  }
  void run(double seconds) {
    for (double end = now + seconds; now < end - 1e-9; now += kBlock) {
      block();
      for (int i = 0; i < 10; ++i) {
        tick(arm, now + i * kPeriod);
        fastest = std::max(fastest, (arm.motion.out - before).head<3>().norm() / kPeriod);
        before = arm.motion.out;
        if (state && follows) setState(arm, poseOfCoordinates(arm.motion.out), now + i * kPeriod);
        if (state && !follows) setState(arm, poseOfCoordinates(arm.measured), now + i * kPeriod);
      }
    }
  }
  /// Starts a long move.
  void start() {
    EXPECT_TRUE(go(at(0.09, 0, 0)).good());
    run(0.2);
    EXPECT_FALSE(isAtRest(arm.motion));
    EXPECT_EQ(arm.mode, ArmMode::kFollowing) << arm.text;
  }
  /// It was brought to rest for this reason, and refuses commands.
  void expectHeld(ArmReason reason) {
    EXPECT_EQ(arm.mode, ArmMode::kHeld);
    EXPECT_EQ(arm.reason, reason) << arm.text;
    EXPECT_EQ(arm.text.rfind(toString(reason), 0), 0u) << arm.text;
    run(0.2);
    EXPECT_TRUE(isAtRest(arm.motion));
    const Vector6 place = arm.motion.out;
    EXPECT_FALSE(go(at(0.01, 0, 0)).good());
    run(0.2);
    EXPECT_EQ(arm.motion.out, place);
  }
};

// Samples may come before the first state of the arm: no point has been sent yet, so nothing moves.
TEST(ArmGuard, PredictsNoMotionBeforeTheFirstPoint) {
  ArmLimits limits = noLimits();
  limits.guard.force = 100.0;
  Braking braking;
  braking.stiffness = 1e4 * Matrix6::Identity();
  alignas(ArmGuard) unsigned char memory[sizeof(ArmGuard)];
  std::memset(memory, 0xff, sizeof memory);  // each double is a NaN
  auto* arm = new (memory) ArmGuard(armGuard(limits, braking, LeaseMode::kRequired, true));
  Vector6 weight = Vector6::Zero();
  weight(2) = -20.0;
  addSamples(*arm, {1, weight.data(), 1, kBlock, 0.0, Vector6::Zero(), nullptr});
  EXPECT_EQ(arm->text, "");
  arm->~ArmGuard();
}

// ---- each limit by itself stops a bad command ----

TEST(ArmGuard, WithoutLimitsTheArmMoves) {
  Cell cell(noLimits());
  cell.start();
  cell.run(3.0);
  EXPECT_TRUE(isAtRest(cell.arm.motion));
  EXPECT_NEAR(cell.arm.motion.out(0), 0.09, 1e-12);
}

TEST(ArmGuard, SpeedAndAcceleration) {
  ArmLimits limits = noLimits();
  limits.motion.speed = 0.02;
  Cell cell(limits);
  cell.start();
  EXPECT_NEAR(cell.fastest, 0.02, 1e-9);
}

TEST(ArmGuard, Box) {
  ArmLimits limits = noLimits();
  limits.guard.box_max.x() = 0.05;
  Cell cell(limits);
  EXPECT_EQ(cell.go(at(0.06, 0, 0)).reason, GuardReason::kWorkspace);
  EXPECT_EQ(cell.go(at(kNan, 0, 0)).reason, GuardReason::kNotFinite);
  EXPECT_TRUE(cell.go(at(0.05, 0, 0)).good());
  cell.run(3.0);
  EXPECT_NEAR(cell.arm.motion.out(0), 0.05, 1e-12);
}

TEST(ArmGuard, Cone) {
  ArmLimits limits = noLimits();
  limits.guard.rotation = 0.1;
  Cell cell(limits);
  EXPECT_EQ(cell.go({rotationFromVector({Eigen::Vector3d(0.11, 0, 0)}), {0, 0, 0}}).reason,
            GuardReason::kRotation);
  EXPECT_TRUE(cell.go({rotationFromVector({Eigen::Vector3d(0.09, 0, 0)}), {0, 0, 0}}).good());
}

TEST(ArmGuard, ContactForceOfEitherSensor) {
  for (const bool b : {false, true}) {
    ArmLimits limits = noLimits();
    limits.guard.force = 60.0;
    Cell cell(limits);
    cell.start();
    (b ? cell.wrench_b : cell.wrench_a)(1) = 59.0;
    cell.run(0.1);
    EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing);
    (b ? cell.wrench_b : cell.wrench_a)(1) = 61.0;
    cell.block();
    EXPECT_NE(cell.arm.text.find(b ? "sensor_b" : "sensor_a"), std::string::npos) << cell.arm.text;
    cell.expectHeld(ArmReason::kForce);
  }
}

TEST(ArmGuard, ContactTorqueOfEitherSensor) {
  for (const bool b : {false, true}) {
    ArmLimits limits = noLimits();
    limits.guard.torque = 6.0;
    Cell cell(limits);
    cell.start();
    (b ? cell.wrench_b : cell.wrench_a)(4) = -6.1;
    cell.block();
    cell.expectHeld(ArmReason::kTorque);
  }
}

// A zero taken under load must not hide the load of the sensor.
TEST(ArmGuard, ForceAndTorqueWithTheirZero) {
  ArmLimits limits = noLimits();
  limits.raw_force = 60.0;
  Cell cell(limits);
  cell.start();
  cell.zero(2) = -40.0;
  cell.wrench_a(2) = -21.0;
  cell.block();
  cell.expectHeld(ArmReason::kRawForce);
  limits = noLimits();
  limits.raw_torque = 6.0;
  Cell turned(limits);
  turned.start();
  turned.zero(5) = 4.0;
  turned.wrench_b(5) = 2.1;
  turned.block();
  turned.expectHeld(ArmReason::kRawTorque);
}

TEST(ArmGuard, NotANumberIsTooMuch) {
  ArmLimits limits = noLimits();
  Cell cell(limits);
  cell.start();
  cell.wrench_b(3) = kNan;
  cell.block();
  cell.expectHeld(ArmReason::kTorque);
}

TEST(ArmGuard, ASaturatedSensor) {
  Cell cell(noLimits());
  cell.start();
  const std::uint8_t bits = 4;
  addSamples(cell.arm, {1, cell.wrench_b.data(), 1, kBlock, cell.now, cell.zero, &bits});
  cell.expectHeld(ArmReason::kSaturated);
}

// Stiff parts that touch saturate a sample or two, which give no load.
TEST(ArmGuard, AKnockIsNoLoad) {
  constexpr double kSample = 2e-4;
  ArmLimits limits = noLimits();
  limits.guard.force = 100.0;
  limits.saturated_time = 1e-3;
  Cell cell(limits);
  cell.start();
  // five samples are the time allowed, six are more
  for (const std::size_t count : {1U, 5U, 5U, 6U}) {
    std::vector<std::uint8_t> bits(10, 0);
    std::vector<double> values(60, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
      bits[2 + i] = 1;
      values[6 * (2 + i)] = 155.0;
    }
    addSamples(cell.arm, {0, values.data(), 10, kSample, cell.now, cell.zero, bits.data()});
    EXPECT_EQ(cell.arm.mode, count < 6 ? ArmMode::kFollowing : ArmMode::kHeld) << cell.arm.text;
    EXPECT_EQ(cell.arm.wrench[0].norm(), 0.0);
  }
  EXPECT_EQ(cell.arm.reason, ArmReason::kSaturated);
}

TEST(ArmGuard, ForceRate) {
  ArmLimits limits = noLimits();
  limits.force_rate = 500.0;
  for (const double rise : {8.0, 12.0}) {  // [N] a block: 400 and 600 N/s
    Cell cell(limits);
    cell.start();
    for (int i = 0; i < 6 && cell.arm.mode == ArmMode::kFollowing; ++i) {
      cell.wrench_b(2) += rise;
      cell.run(kBlock);
    }
    if (rise < 10.0) {
      EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing) << cell.arm.text;
    } else {
      cell.expectHeld(ArmReason::kForceRate);
    }
  }
}

// The force at the end of a stop counts.
TEST(ArmGuard, StopsBeforeTheForceIsTooMuch) {
  ArmLimits limits = noLimits();
  limits.guard.force = 60.0;
  Cell cell(limits, 5e4);
  cell.start();
  // at 50 mm/s a stop that begins 50 ms later would add 190 N, were it fast; it isn't
  const double v = cell.fastest;
  EXPECT_LT(v, 0.03);
  // v² 0.8 / a + v delay within 60 N / (5e4 N/m), less a fifth for a contact as it is detected
  EXPECT_NEAR(0.8 * v * v + v * limits.delay, 0.8 * 60.0 / 5e4, 1e-6);
  cell.wrench_b(0) = -40.0;
  cell.block();
  EXPECT_NE(cell.arm.text.find("would be"), std::string::npos) << cell.arm.text;
  cell.expectHeld(ArmReason::kForce);
}

// An arm that is late still goes to the points that were sent before, and no farther.
TEST(ArmGuard, CountsThePointsThatAreOnTheirWay) {
  ArmLimits limits = noLimits();
  limits.guard.force = 60.0;
  limits.delay = 0.25;
  Cell cell(limits, 5e4);
  // a short move: 25 N more at most. At its speed a delay of 0.25 s would add 56 N
  EXPECT_TRUE(cell.go(at(5e-4, 0, 0)).good());
  while (motionRate(cell.arm.motion)(0) < 4.5e-3 && cell.now < 11.0) cell.run(kBlock);
  cell.wrench_b(0) = -10.0;
  cell.block();
  EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing) << cell.arm.text;
  cell.wrench_b(0) = 0.0;
  cell.run(1.0);
  // the last point is sent, the arm is on its way for 0.25 s: 1 mm, 50 N
  EXPECT_TRUE(cell.go(at(3e-3, 0, 0)).good());
  while (!isAtRest(cell.arm.motion)) cell.run(kBlock);
  cell.wrench_b(0) = -40.0;
  cell.block();
  cell.expectHeld(ArmReason::kForce);
}

TEST(ArmGuard, FollowingError) {
  ArmLimits limits = noLimits();
  limits.following = 0.003;
  limits.following_turn = 0.1;
  Cell cell(limits);
  cell.start();
  cell.follows = false;
  const Vector6 stuck = cell.arm.measured;
  cell.run(0.3);
  cell.expectHeld(ArmReason::kFollowing);
  // the next point is where the arm is
  EXPECT_EQ(resume(cell.arm, cell.now), "");
  EXPECT_LT((cell.arm.motion.out - stuck).norm(), 1e-12);
}

TEST(ArmGuard, TurnedAway) {
  ArmLimits limits = noLimits();
  limits.following_turn = 0.02;
  limits.following = 1.0;
  Cell cell(limits);
  cell.start();
  cell.follows = false;
  cell.arm.measured(4) = 0.03;
  cell.run(kBlock);
  cell.expectHeld(ArmReason::kFollowing);
}

TEST(ArmGuard, StaleDataEachAlone) {
  const std::vector<std::pair<bool Cell::*, ArmReason>> kinds = {
      {&Cell::data_a, ArmReason::kNoWrenchA},
      {&Cell::data_b, ArmReason::kNoWrenchB},
      {&Cell::state, ArmReason::kNoState},
      {&Cell::lease, ArmReason::kExpired}};
  for (const auto& [data, reason] : kinds) {
    ArmLimits limits = noLimits();
    limits.timeout = 0.1;
    Cell cell(limits);
    cell.start();
    cell.*data = false;
    cell.run(0.06);
    EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing) << toString(reason) << ": " << cell.arm.text;
    cell.run(0.08);
    EXPECT_EQ(cell.arm.reason, reason) << cell.arm.text;
    cell.run(0.1);
    EXPECT_TRUE(isAtRest(cell.arm.motion));
    // data that are back start nothing
    cell.*data = true;
    cell.run(0.2);
    EXPECT_EQ(cell.arm.mode, ArmMode::kHeld);
    EXPECT_FALSE(cell.go(at(0.01, 0, 0)).good());
    EXPECT_TRUE(isAtRest(cell.arm.motion));
  }
}

TEST(ArmGuard, WithOneSensorItsSilenceAloneHolds) {
  ArmLimits limits = noLimits();
  limits.timeout = 0.1;
  limits.sensors = Sensors::kB;
  Cell cell(limits);
  cell.data_a = false;
  cell.start();
  cell.run(0.3);
  EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing) << cell.arm.text;
  EXPECT_TRUE(cell.go(at(0.01, 0, 0)).good());
  cell.data_b = false;
  cell.run(0.2);
  EXPECT_EQ(cell.arm.reason, ArmReason::kNoWrenchB) << cell.arm.text;

  Cell without_owner(limits);
  without_owner.data_a = false;
  without_owner.start();
  without_owner.lease = false;
  without_owner.run(0.2);
  EXPECT_EQ(without_owner.arm.reason, ArmReason::kExpired) << without_owner.arm.text;
}

// A new session isn't held for sources that were missing before: it starts when all are fresh.
TEST(ArmGuard, TheNextSessionWaitsForWhatIsWatched) {
  for (bool Cell::*data : {&Cell::data_a, &Cell::data_b, &Cell::state}) {
    ArmLimits limits = noLimits();
    limits.timeout = 0.1;
    Cell cell(limits);
    cell.start();
    cell.*data = false;
    cell.run(0.2);
    EXPECT_EQ(cell.arm.mode, ArmMode::kHeld);
    const std::uint32_t before = cell.session++;
    cell.run(1.0);
    EXPECT_EQ(renew(cell.arm, cell.sender(), cell.session, cell.now).reason, GuardReason::kStale);
    EXPECT_NE(cell.arm.guard.session, cell.session) << before;
    EXPECT_FALSE(cell.go(at(0.01, 0, 0)).good());
    cell.*data = true;
    cell.run(0.2);
    EXPECT_EQ(cell.arm.guard.session, cell.session);
    EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing) << cell.arm.text;
    EXPECT_TRUE(cell.go(at(0.01, 0, 0)).good());
  }
}

// An owner without blocks for want of data sends no lease: the missing source is named.
TEST(ArmGuard, AMissingSourceThatBlocksTheOwnerIsTheReason) {
  const std::vector<std::pair<bool Cell::*, ArmReason>> kinds = {
      {&Cell::data_a, ArmReason::kNoWrenchA},
      {&Cell::data_b, ArmReason::kNoWrenchB},
      {&Cell::state, ArmReason::kNoState}};
  for (const auto& [data, reason] : kinds) {
    ArmLimits limits = noLimits();
    limits.timeout = 0.1;
    Cell cell(limits);
    cell.start();
    cell.lease = false;
    cell.run(kBlock);
    cell.*data = false;
    cell.run(0.2);
    EXPECT_EQ(cell.arm.reason, reason) << cell.arm.text;
    EXPECT_NE(cell.arm.text.find("no sign of life of supervisor"), std::string::npos)
        << cell.arm.text;
  }
}

TEST(ArmGuard, StaleOrForeignCommandsAreRefused) {
  Cell cell(noLimits());
  EXPECT_EQ(move(cell.arm, {"other", cell.now, true, false}, at(0.01, 0, 0), cell.now).reason,
            GuardReason::kHeldByAnother);
  EXPECT_EQ(
      move(cell.arm, {"supervisor", cell.now - 0.1, true, false}, at(0.01, 0, 0), cell.now).reason,
      GuardReason::kStale);
  cell.run(0.2);
  EXPECT_EQ(cell.arm.motion.out, Vector6::Zero());
}

// ---- the watchdog's states ----

TEST(ArmGuard, NothingMovesBeforeTheArmsPoseIsKnown) {
  ArmGuard arm = armGuard(noLimits(), Braking(), LeaseMode::kAuto, false);
  setRate(arm, kPeriod, 0.02);
  EXPECT_EQ(arm.mode, ArmMode::kWaiting);
  EXPECT_FALSE(move(arm, {"node", 1.0, true, false}, at(0.01, 0, 0), 1.0).good());
  tick(arm, 1.0);
  EXPECT_FALSE(arm.begun);
  const Pose X{rotationFromVector({Eigen::Vector3d(0.1, 0.2, 0)}), {0.03, -0.02, 0.01}};
  setState(arm, X, 1.0);
  tick(arm, 1.0);
  EXPECT_TRUE(arm.begun);
  EXPECT_LT((arm.motion.out - coordinatesOf(X)).norm(), 1e-12);
}

// The arm is not sent to the limit: without a point it stays where it is.
TEST(ArmGuard, AJointBeyondItsLimitHoldsWithoutAPoint) {
  const std::string beyond = "joint wrist is at 6.9 rad, its limits are -6.28 to 6.28 rad";
  const Pose X = at(0.01, 0, 0);
  ArmGuard arm = armGuard(noLimits(), Braking(), LeaseMode::kAuto, false);
  setRate(arm, kPeriod, 0.02);
  EXPECT_FALSE(setState(arm, X, 1.0, beyond));
  EXPECT_EQ(arm.mode, ArmMode::kHeld);
  EXPECT_EQ(arm.text, "unreachable: " + beyond);
  tick(arm, 1.0);
  EXPECT_FALSE(arm.begun);
  EXPECT_EQ(resume(arm, 1.0), "unreachable: " + beyond);
  EXPECT_NE(move(arm, {"node", 1.0, true, false}, X, 1.0).text.find(beyond), std::string::npos);
  // moved back by hand it still is held, until a person resumes it
  EXPECT_FALSE(setState(arm, X, 1.1));
  EXPECT_FALSE(arm.begun);
  EXPECT_EQ(resume(arm, 1.1), "");
  EXPECT_TRUE(arm.begun);
  tick(arm, 1.1);
  EXPECT_LT((arm.motion.out - coordinatesOf(X)).norm(), 1e-12);
}

TEST(ArmGuard, AnIdleArmMovedBeyondAJointLimitGetsNoMorePoints) {
  ArmLimits limits = noLimits();
  limits.following = 0.002;
  Cell cell(limits);
  EXPECT_TRUE(renew(cell.arm, cell.sender(), 0, cell.now).good());
  EXPECT_TRUE(setState(cell.arm, at(0.02, 0, 0), cell.now));
  EXPECT_TRUE(cell.arm.begun);
  EXPECT_FALSE(setState(cell.arm, at(0.03, 0, 0), cell.now, "joint wrist is at 6.9 rad"));
  EXPECT_FALSE(cell.arm.begun);
  EXPECT_EQ(cell.arm.reason, ArmReason::kUnreachable);
}

TEST(ArmGuard, APersonOrTheNextSessionResumesAHold) {
  ArmLimits limits = noLimits();
  limits.guard.force = 60.0;
  for (const bool person : {true, false}) {
    Cell cell(limits);
    cell.start();
    cell.wrench_b(2) = 70.0;
    cell.block();
    cell.expectHeld(ArmReason::kForce);
    if (person) {
      EXPECT_EQ(resume(cell.arm, cell.now), "");
    } else {
      ++cell.session;  // a new goal of the same supervisor
    }
    cell.run(0.1);
    EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing) << cell.arm.text;
    // the load may be taken off, not grow
    const Vector6 place = cell.arm.motion.out;
    EXPECT_EQ(cell.go(at(place(0) + 0.01, 0, 0.001)).reason, GuardReason::kOverloaded);
    EXPECT_TRUE(cell.go(at(place(0), 0, 0.01)).good());
    cell.run(0.1);
    EXPECT_EQ(cell.arm.mode, ArmMode::kFollowing) << cell.arm.text;
    cell.wrench_b(2) = 50.0;
    cell.run(0.1);
    cell.wrench_b(2) = 70.0;
    cell.block();
    EXPECT_EQ(cell.arm.mode, ArmMode::kHeld);
  }
}

TEST(ArmGuard, AStopIsForGood) {
  Cell cell(noLimits());
  cell.start();
  stopForGood(cell.arm, "requested");
  EXPECT_EQ(cell.arm.mode, ArmMode::kStopped);
  cell.run(0.2);
  EXPECT_TRUE(isAtRest(cell.arm.motion));
  EXPECT_NE(resume(cell.arm, cell.now), "");
  ++cell.session;
  cell.run(0.2);
  EXPECT_FALSE(cell.go(at(0.01, 0, 0)).good());
  EXPECT_EQ(cell.arm.mode, ArmMode::kStopped);
  EXPECT_EQ(drive(cell.arm, cell.sender(), {1.0, 100.0, 0.0, 1}, cell.now).reason,
            GuardReason::kOverloaded);
  EXPECT_TRUE(drive(cell.arm, cell.sender(), {0.0, 0.0, 0.0, 1}, cell.now).good());
}

TEST(ArmGuard, AHoldSwitchesTheExciterOff) {
  Cell cell(noLimits());
  EXPECT_TRUE(drive(cell.arm, cell.sender(), {1.0, 100.0, 0.0, 1}, cell.now).good());
  EXPECT_TRUE(cell.arm.guard.shaking);
  hold(cell.arm, ArmReason::kStop, "now");
  EXPECT_FALSE(cell.arm.guard.shaking);
  EXPECT_FALSE(drive(cell.arm, cell.sender(), {1.0, 100.0, 0.0, 1}, cell.now).good());
}

// ---- a million commands against a wall ----

// The peg touches a face of 5e4 N/m below z = −2 mm; the sensors report it a block later, the arm's
// latency is 20 ms. Moves to any pose at any time, sessions start and end, holds are resumed. The
// force may exceed its limit by a fifth: the samples' age and the motion between two of them.
TEST(ArmGuard, HostileCommandsNeverPassTheForceLimit) {
  ArmLimits limits;
  limits.guard.force = 60.0;
  limits.following = limits.following_turn = kNever;
  limits.force_rate = kNever;
  Cell cell(limits, 5e4);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0), chance(0.0, 1.0);
  std::vector<double> heights(20, 0.0);  // of the last points: the arm's latency
  std::size_t next = 0;
  double largest = 0.0, fastest = 0.0;
  int holds = 0, commands = 0;
  Vector6 last = cell.arm.motion.out;
  while (commands < 1000000) {
    cell.block();
    for (int i = 0; i < 10; ++i) {
      for (int k = 0; k < 10; ++k) {
        ++commands;
        Pose X = at(0.3 * unit(random), 0.3 * unit(random), 0.02 * unit(random));
        if (chance(random) < 0.9) X = at(0.02 * unit(random), 0.0, -0.02 * chance(random));
        if (chance(random) < 0.01) X.p(k % 3) = kNan;
        Sender sender = cell.sender();
        if (chance(random) < 0.1) sender.stamp += unit(random);
        if (chance(random) < 0.05) sender.node = "other";
        if (chance(random) < 0.02 || k == 0) move(cell.arm, sender, X, cell.now);
      }
      tick(cell.arm, cell.now + i * kPeriod);
      const double speed = (cell.arm.motion.out - last).head<3>().norm() / kPeriod;
      fastest = std::max(fastest, speed);
      last = cell.arm.motion.out;
      heights[next] = cell.arm.motion.out(2);
      next = (next + 1) % heights.size();
      const double deep = std::max(0.0, -0.002 - heights[next]);
      largest = std::max(largest, 5e4 * deep);
      cell.wrench_b(2) = 5e4 * deep;
      setState(cell.arm, poseOfCoordinates(cell.arm.motion.out), cell.now + i * kPeriod);
    }
    cell.now += kBlock;
    if (cell.arm.mode == ArmMode::kHeld) {
      ++holds;
      if (chance(random) < 0.05) ++cell.session;
      if (chance(random) < 0.05) resume(cell.arm, cell.now);
    }
  }
  EXPECT_GT(holds, 100);
  EXPECT_GT(largest, 30.0);
  EXPECT_LT(largest, 1.2 * 60.0);
  EXPECT_LE(fastest, limits.motion.speed * (1.0 + 1e-9));
}

// ---- the clock of the arm ----

// Half a second ahead or behind: the motion doesn't start, and the arm is held by name.
TEST(ArmGuard, AnArmWithAnotherClockIsHeldBeforeItsFirstPoint) {
  for (const double error : {0.5, -0.5, 0.11, -0.11}) {
    ArmGuard arm = armGuard({}, Braking(), LeaseMode::kAuto, false);
    setRate(arm, kPeriod, 0.02);
    std::string first;
    for (double now = 10.0; now < 11.0; now += kPeriod) {
      checkClock(arm, now + error, now);
      EXPECT_FALSE(setState(arm, Pose(), now + error));
      tick(arm, now);
      if (first.empty()) first = missingData(arm, now);
    }
    EXPECT_FALSE(arm.begun);
    EXPECT_EQ(arm.mode, ArmMode::kHeld);
    EXPECT_EQ(arm.reason, ArmReason::kClock);
    const std::string side = text("%.3f s ", std::abs(error)) + (error > 0 ? "ahead" : "behind");
    EXPECT_EQ(arm.text.rfind("clock: the arm's stamps are " + side, 0), 0U) << arm.text;
    EXPECT_EQ(arm.text, "clock: " + first);
    // neither a person nor a session ends that, before the clock is right
    EXPECT_EQ(resume(arm, 11.0), arm.text);
    const GuardVerdict verdict = renew(arm, {"supervisor", 11.0, true, false}, 7, 11.0);
    EXPECT_EQ(verdict.reason, GuardReason::kStale);
    EXPECT_NE(verdict.text.find(side), std::string::npos) << verdict.text;
    checkClock(arm, 11.0, 11.0);
    EXPECT_FALSE(setState(arm, Pose(), 11.0));
    EXPECT_EQ(resume(arm, 11.0), "");
    EXPECT_TRUE(arm.begun);
  }
}

TEST(ArmGuard, AClockWithinATenthOfASecondIsGood) {
  for (const double error : {0.09, -0.09}) {
    ArmGuard arm = armGuard({}, Braking(), LeaseMode::kAuto, false);
    checkClock(arm, 10.0 + error, 10.0);
    EXPECT_TRUE(setState(arm, Pose(), 10.0 + error));
  }
}

// A burst after a freeze, or the cell's time after a pause.
TEST(ArmGuard, LateStatesForAMomentAreNoErrorOfTheClock) {
  ArmGuard arm = armGuard({}, Braking(), LeaseMode::kAuto, false);
  setRate(arm, kPeriod, 0.02);
  for (double now = 10.0; now < 11.0; now += kPeriod) {
    const double late = now > 10.1 && now < 10.35 ? 0.3 : 0.0;
    checkClock(arm, now - late, now);
    EXPECT_EQ(arm.clock_error.empty(), late == 0.0);
    setState(arm, Pose(), now - late);
    tick(arm, now);
  }
  EXPECT_EQ(arm.mode, ArmMode::kFollowing) << arm.text;
}

// States that are received, with stamps of another clock, are not silence.
TEST(ArmGuard, AClockThatIsSetBackWhileItMovesIsNamed) {
  ArmLimits limits;
  limits.guard.lone_exciter = kNever;
  Cell cell(limits);
  cell.start();
  cell.state = false;
  for (int i = 0; i < 100 && cell.arm.mode == ArmMode::kFollowing; ++i) {
    checkClock(cell.arm, cell.now - 0.5, cell.now);
    setState(cell.arm, poseOfCoordinates(cell.arm.motion.out), cell.now - 0.5);
    cell.run(kBlock);
  }
  EXPECT_EQ(cell.arm.reason, ArmReason::kClock) << cell.arm.text;
  EXPECT_NE(cell.arm.text.find("0.500 s behind"), std::string::npos) << cell.arm.text;
}

TEST(ArmGuard, AHoldForASilentArmNamesWhyItsMessagesAreRefused) {
  ArmLimits limits;
  limits.guard.lone_exciter = kNever;
  Cell cell(limits);
  cell.start();
  cell.state = false;
  cell.arm.refusal = "position of joint elbow is nan";
  cell.run(0.3);
  EXPECT_EQ(cell.arm.reason, ArmReason::kNoState);
  EXPECT_NE(cell.arm.text.find(": position of joint elbow is nan"), std::string::npos)
      << cell.arm.text;
}

}  // namespace
}  // namespace assembly_cell
