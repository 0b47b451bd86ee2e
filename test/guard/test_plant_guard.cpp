// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "assembly_cell/guard/freshness.h"
#include "assembly_cell/guard/plant_guard.h"

namespace assembly_cell {
namespace {

constexpr double kBlock = 0.02;  // [s]
const double kNaN = std::numeric_limits<double>::quiet_NaN();
const Vector6 kNothing = Vector6::Zero();

// A plant with its clock, and nodes that have received its last block.
struct Plant {
  explicit Plant(LeaseMode mode = LeaseMode::kAuto, bool lockstep = false)
      : guard(plantGuard({}, mode, lockstep)) {}

  PlantGuard guard;
  double now = 5.0;
  GuardAction last;

  Sender as(const std::string& node) const { return {node, now, true, false}; }
  GuardReason lease(const std::string& node, std::uint32_t session) {
    last = {};
    return renewLease(guard, as(node), session, now, last).reason;
  }
  GuardReason move(const Sender& sender, double z = 0.001) {
    return checkMove(guard, sender, Pose{Eigen::Matrix3d::Identity(), {0, 0, z}}, now).reason;
  }
  GuardReason shake(const Sender& sender, double amplitude = 1.0) {
    return checkExciter(guard, sender, {amplitude, 450.0, 0.0, 1}, now).reason;
  }
  GuardAction block(const Vector6& load = kNothing) {
    now += kBlock;
    return last = watch(guard, load, 0.0, now);
  }
};

Vector6 down(double force) {
  Vector6 load = Vector6::Zero();
  load(2) = force;
  return load;
}

TEST(PlantGuard, WithoutASessionAnyNodeCommandsUnlessALeaseIsRequired) {
  Plant free, strict(LeaseMode::kRequired);
  EXPECT_EQ(free.move(free.as("/a")), GuardReason::kNone);
  EXPECT_EQ(free.move(free.as("/b")), GuardReason::kNone);
  EXPECT_EQ(free.move({"/c", 0.0, false, false}), GuardReason::kNone);
  EXPECT_EQ(strict.move(strict.as("/a")), GuardReason::kNoLease);
  EXPECT_EQ(strict.lease("/a", 7), GuardReason::kNone);
  EXPECT_EQ(strict.move(strict.as("/a")), GuardReason::kNone);
}

TEST(PlantGuard, ASessionBeginsWithTheExciterOffAndCommandsAlone) {
  Plant plant;
  EXPECT_EQ(plant.shake(plant.as("/b")), GuardReason::kNone);
  EXPECT_TRUE(plant.guard.shaking);
  EXPECT_EQ(plant.lease("/a", 7), GuardReason::kNone);
  EXPECT_TRUE(plant.last.exciter_off);
  EXPECT_FALSE(plant.guard.shaking);
  plant.block();
  EXPECT_EQ(plant.lease("/a", 7), GuardReason::kNone);
  EXPECT_FALSE(plant.last.exciter_off);

  const GuardVerdict other = checkMove(plant.guard, plant.as("/b"), Pose{}, plant.now);
  EXPECT_EQ(other.reason, GuardReason::kHeldByAnother);
  EXPECT_EQ(other.text, "held_by_another: /a owns the plant");
  EXPECT_EQ(plant.shake(plant.as("/b")), GuardReason::kHeldByAnother);
  EXPECT_EQ(plant.lease("/b", 8), GuardReason::kHeldByAnother);
  EXPECT_EQ(plant.lease("/b", 0), GuardReason::kNone);
  EXPECT_EQ(plant.guard.owner, "/a");
  // switching off is never refused
  EXPECT_EQ(plant.shake(plant.as("/a")), GuardReason::kNone);
  EXPECT_EQ(plant.shake(plant.as("/b"), 0.0), GuardReason::kNone);
  EXPECT_FALSE(plant.guard.shaking);

  EXPECT_EQ(plant.shake(plant.as("/a")), GuardReason::kNone);
  EXPECT_EQ(plant.lease("/a", 0), GuardReason::kNone);
  EXPECT_TRUE(plant.last.exciter_off);
  EXPECT_EQ(plant.move(plant.as("/b")), GuardReason::kNone);
}

// When the owner dies at any time, the plant is at rest within lease_time after the last block that
// it received; other nodes can acquire it a second later, not before.
TEST(PlantGuard, Watchdog) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 300; ++trial) {
    Plant plant;
    plant.now = std::uniform_real_distribution<double>(0.0, 1e4)(random);
    ASSERT_EQ(plant.lease("/a", 7), GuardReason::kNone);
    ASSERT_EQ(plant.shake(plant.as("/a")), GuardReason::kNone);
    const int alive = std::uniform_int_distribution<int>(0, 40)(random);
    double seen = plant.now;
    for (int i = 0; i < alive; ++i) {
      ASSERT_FALSE(plant.block().hold);
      // by lease or by command
      if (i % 3 == 0) {
        ASSERT_EQ(plant.move(plant.as("/a")), GuardReason::kNone);
      } else {
        ASSERT_EQ(plant.lease("/a", 7), GuardReason::kNone);
      }
      seen = plant.now;
    }
    while (!plant.block().hold) ASSERT_LT(plant.now, seen + 1.0);
    EXPECT_EQ(plant.last.reason, GuardReason::kExpired);
    EXPECT_TRUE(plant.last.exciter_off);
    EXPECT_FALSE(plant.guard.shaking);
    EXPECT_LE(plant.now - seen, 0.1 + 1e-6);
    EXPECT_GT(plant.now - seen, 0.1 - kBlock);
    // reported once
    EXPECT_FALSE(plant.block().hold);
    EXPECT_EQ(plant.move(plant.as("/b")), GuardReason::kHeldByAnother);
    while (plant.now - seen < 1.0) plant.block();
    EXPECT_EQ(plant.move(plant.as("/b")), GuardReason::kNone);
  }
}

TEST(PlantGuard, AnExpiredLeaseIsRenewedByTheNextSignOfLife) {
  Plant plant;
  plant.lease("/a", 7);
  while (!plant.block().hold) ASSERT_LT(plant.now, 6.0);
  EXPECT_TRUE(plant.guard.expired);
  EXPECT_EQ(plant.lease("/a", 7), GuardReason::kNone);
  EXPECT_FALSE(plant.guard.expired);
  // the same node, restarted, acquires it at once
  EXPECT_EQ(plant.lease("/a", 8), GuardReason::kNone);
  EXPECT_TRUE(plant.last.exciter_off);
  EXPECT_EQ(plant.guard.session, 8U);
}

TEST(PlantGuard, OldMessagesRenewNoLeaseAndLeadToNoCommand) {
  Plant plant;
  plant.lease("/a", 7);
  const Sender old = plant.as("/a");
  for (int i = 0; i < 3; ++i) {
    plant.block();
    plant.lease("/a", 7);
  }
  EXPECT_EQ(plant.move(old), GuardReason::kNone) << "60 ms";
  plant.block();
  plant.lease("/a", 7);
  EXPECT_EQ(plant.move(old), GuardReason::kStale) << "80 ms";
  EXPECT_EQ(plant.shake(old), GuardReason::kStale);
  EXPECT_EQ(plant.move({"/a", 0.0, false, false}), GuardReason::kStale) << "no stamp";
  // a burst of leases from before a freeze
  const double seen = plant.guard.seen;
  plant.block();
  GuardAction action;
  EXPECT_EQ(renewLease(plant.guard, old, 7, plant.now, action).reason, GuardReason::kStale);
  EXPECT_EQ(plant.guard.seen, seen);
}

TEST(PlantGuard, CommandsFromBeforeTheBootAreRefused) {
  for (const bool lockstep : {false, true}) {
    Plant plant(LeaseMode::kAuto, lockstep);
    plant.now = 0.0;
    EXPECT_EQ(plant.move({"/a", 0.0, false, true}), GuardReason::kEarlierBoot) << "latched";
    const double before = lockstep ? 37.0 : -0.5;
    EXPECT_EQ(plant.move({"/a", before, true, true}), GuardReason::kEarlierBoot);
    EXPECT_EQ(plant.move({"/a", before, true, false}), GuardReason::kEarlierBoot);
    EXPECT_EQ(plant.shake({"/a", before, true, false}), GuardReason::kEarlierBoot);
    GuardAction action;
    EXPECT_EQ(renewLease(plant.guard, {"/a", before, true, false}, 7, 0.0, action).reason,
              GuardReason::kEarlierBoot);
    EXPECT_TRUE(plant.guard.owner.empty());
    EXPECT_EQ(plant.move({"/a", 0.0, true, false}), GuardReason::kNone);
    EXPECT_EQ(plant.move({"/a", 0.0, false, false}), GuardReason::kNone);
  }
}

TEST(PlantGuard, RefusesBeyondItsLimitsByNameValueAndLimit) {
  Plant plant;
  const auto exciter = [&](const ExciterCommand& drive) {
    return checkExciter(plant.guard, plant.as("/a"), drive, plant.now).text;
  };
  EXPECT_EQ(exciter({50.0, 2e4, 0.0, 1}), "");
  EXPECT_EQ(exciter({1000.0, 450, 0, 1}),
            "max_amplitude: amplitude is 1000 N, allowed are 0 to 50 N");
  EXPECT_EQ(exciter({-1.0, 450, 0, 1}), "max_amplitude: amplitude is -1 N, allowed are 0 to 50 N");
  EXPECT_EQ(exciter({1.0, 1e308, 0, 1}),
            "max_frequency: frequency is 1e+308 rad/s, allowed are 0 to 20000 rad/s");
  EXPECT_EQ(exciter({1.0, 450, 0, 3}), "direction: direction is 3: give 1 or -1");
  EXPECT_EQ(exciter({kNaN, 450, 0, 1}).rfind("not_finite", 0), 0U);
  // off, too, must be finite
  EXPECT_EQ(exciter({0.0, kNaN, 0, 1}).rfind("not_finite", 0), 0U);

  const auto move = [&](const Pose& X) {
    return checkMove(plant.guard, plant.as("/a"), X, plant.now).text;
  };
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  EXPECT_EQ(move({I, {0.1, -0.1, 0.1}}), "");
  EXPECT_EQ(move({I, {0.0, -5.0, 0.0}}),
            "workspace: y is -5 m from the start, allowed are -0.1 to 0.1 m");
  EXPECT_EQ(move({I, {0.0, kNaN, 0.0}}), "not_finite: give finite numbers");
  EXPECT_EQ(move({Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX()).toRotationMatrix(), {0, 0, 0}}),
            "max_rotation: turn from the start is 0.5 rad, allowed are 0 to 0.35 rad");
}

TEST(PlantGuard, AnOverloadStopsThePlantUntilAMoveUpOrAnotherSession) {
  for (const bool session : {false, true}) {
    Plant plant;
    if (session) plant.lease("/a", 7);
    EXPECT_EQ(plant.move(plant.as("/a"), -0.02), GuardReason::kNone);
    EXPECT_FALSE(exceeds(down(99.9), plant.guard.allowed));
    EXPECT_TRUE(exceeds(down(kNaN), plant.guard.allowed));
    ASSERT_TRUE(exceeds(down(150.0), plant.guard.allowed));
    EXPECT_EQ(overload(plant.guard, down(150.0), kNothing).text,
              "max_force: load of the coupling is 150 N, allowed are 0 to 100 N");
    plant.block(down(150.0));
    if (session) plant.lease("/a", 7);
    EXPECT_EQ(plant.move(plant.as("/a"), -0.02), GuardReason::kOverloaded);
    EXPECT_EQ(plant.shake(plant.as("/a")), GuardReason::kOverloaded);
    if (session) {
      plant.lease("/a", 8);
    } else {
      EXPECT_EQ(plant.move(plant.as("/a"), 0.001), GuardReason::kNone);
    }
    EXPECT_FALSE(plant.guard.overloaded);
    // the load may be relieved, but not grow; then the limit is restored
    EXPECT_FALSE(exceeds(down(160.0), plant.guard.allowed));
    EXPECT_TRUE(exceeds(down(170.0), plant.guard.allowed));
    plant.block(down(120.0));
    EXPECT_TRUE(exceeds(down(133.0), plant.guard.allowed));
    plant.block(down(10.0));
    EXPECT_TRUE(exceeds(down(101.0), plant.guard.allowed));
    plant.block(down(kNaN));
    EXPECT_TRUE(exceeds(down(101.0), plant.guard.allowed));
    EXPECT_FALSE(exceeds(down(99.0), plant.guard.allowed));
    plant.block(down(99.0));
    EXPECT_TRUE(exceeds(down(101.0), plant.guard.allowed));
  }
  Plant plant;
  Vector6 torque = Vector6::Zero();
  torque(3) = 11.0;
  ASSERT_TRUE(exceeds(torque, plant.guard.allowed));
  EXPECT_EQ(overload(plant.guard, torque, kNothing).text,
            "max_torque: load of the coupling is 11 N m, allowed are 0 to 10 N m");
}

// A plant with a coupling of 5e4 N/m and 50 N·m/rad, whose carrier brakes with 1 m/s².
Plant braking() {
  Plant plant;
  plant.guard.braking.stiffness.diagonal() << 5e4, 5e4, 5e4, 50.0, 50.0, 50.0;
  plant.guard.braking.acceleration = 1.0;
  plant.guard.braking.arm = 0.08;
  return plant;
}

TEST(PlantGuard, TheLoadIsStoppedBeforeItIsTooMuch) {
  Plant plant = braking();
  PlantGuard& guard = plant.guard;
  const auto stops = [&](double load, double way) {
    return mustStop(guard.braking, down(load), down(way), guard.allowed);
  };
  // on downwards by a millimetre adds 50 N, upwards takes them off
  EXPECT_FALSE(stops(49.9, -1e-3));
  EXPECT_TRUE(stops(50.1, -1e-3));
  EXPECT_FALSE(stops(99.0, 1e-3));
  EXPECT_TRUE(stops(99.0, 4e-3));
  EXPECT_TRUE(stops(kNaN, 0.0));
  EXPECT_TRUE(stops(20.0, kNaN));
  EXPECT_EQ(overload(guard, down(60.0), down(-1e-3)).text,
            "max_force: load of the coupling is 60 N and would be 110 N when the carrier has "
            "stopped, allowed are 0 to 100 N");
}

// The speed limit keeps a stop within the allowed load, for any direction and load; it is tight.
TEST(PlantGuard, AMoveIsNoFasterThanAStopMayCost) {
  Plant plant = braking();
  PlantGuard& guard = plant.guard;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  int slowest = 0;
  for (int n = 0; n < 1000; ++n) {
    Vector6 load, way;
    for (int i = 0; i < 6; ++i) {
      load(i) = (i < 3 ? 55.0 : 5.0) * uniform(random);
      way(i) = (i < 3 ? 0.01 : 0.1) * uniform(random);
    }
    const double speed = speedLimit(guard, load, way);
    // stopping distance at that speed, the fastest coordinate braking with 1 m/s²
    Vector6 arm;
    arm << 1, 1, 1, 0.08, 0.08, 0.08;
    const Vector6 direction = way / way.cwiseProduct(arm).cwiseAbs().maxCoeff();
    const Vector6 stop = 0.79 * speed * speed * direction;
    EXPECT_FALSE(mustStop(guard.braking, load, stop, guard.allowed)) << n;
    // what opposes the growth of the load may be gone by then: the edge leaves one wall
    const Vector6 growth = -guard.braking.stiffness * direction;
    Vector6 left = load;
    for (const int part : {0, 3}) {
      const Eigen::Vector3d change = growth.segment<3>(part);
      const double along = std::min(0.0, left.segment<3>(part).dot(change));
      left.segment<3>(part) -= along / change.squaredNorm() * change;
    }
    EXPECT_FALSE(mustStop(guard.braking, left, stop, guard.allowed)) << n;
    EXPECT_TRUE(mustStop(guard.braking, left, 1.03 * stop, guard.allowed)) << n;
    slowest += speed < 0.03 ? 1 : 0;
  }
  EXPECT_GT(slowest, 0);
  // a load at the limit may still be relieved
  EXPECT_GT(speedLimit(guard, down(100.0), down(0.01)), 0.049);
  EXPECT_EQ(speedLimit(guard, down(100.0), down(-0.01)), 1e-3);
  EXPECT_EQ(speedLimit(guard, down(50.0), kNothing), std::numeric_limits<double>::infinity());
}

// A stamp an hour ahead doesn't renew a lease for an hour.
TEST(PlantGuard, AStampFromTheFutureIsASignOfLifeOfNow) {
  Plant plant;
  GuardAction action;
  const Sender ahead{"/a", plant.now + 3600.0, true, false};
  EXPECT_TRUE(renewLease(plant.guard, ahead, 7, plant.now, action).good());
  EXPECT_TRUE(renewLease(plant.guard, ahead, 7, plant.now, action).good());
  EXPECT_EQ(plant.move(ahead), GuardReason::kNone);
  const double last = plant.now;
  while (!plant.block().hold) ASSERT_LT(plant.now, last + 0.2);
  EXPECT_EQ(plant.last.reason, GuardReason::kExpired);
}

TEST(PlantGuard, ALoneExciterStops) {
  Plant plant;
  const double start = plant.now;
  EXPECT_EQ(plant.shake(plant.as("/a")), GuardReason::kNone);
  while (!plant.block().exciter_off) ASSERT_LT(plant.now, start + 20.0);
  EXPECT_EQ(plant.last.reason, GuardReason::kLoneExciter);
  EXPECT_FALSE(plant.last.hold);
  EXPECT_NEAR(plant.now - start, 10.0, 1e-6);
}

}  // namespace
}  // namespace assembly_cell
