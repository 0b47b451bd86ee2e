// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/guarded_carrier.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Greatest compliance of a contact that is pressed, as a multiple of the coupling's.
constexpr double kMaxCompliance = 3.0;
// Blocks after which a swing has decayed, so that a remaining change of force may be noise.
constexpr int kSwingBlocks = 50;
// Saturated blocks in a row that are allowed in motion. The impact of stiff parts lasts a few
// samples and may exceed the range of the bridges, in two blocks if one ends in the middle of it.
constexpr int kKnockBlocks = 2;
// Saturated blocks in a row, at rest, that are the fault of a sensor: noise, an offset, a broken
// wire.
constexpr int kFaultyBlocks = 50;
// A carrier that hasn't arrived after kMotionBlocks, but has come nearer by kNearer within the last
// kLastBlocks, is slow: it has kMotionBlocks more, kSlowMotions times in all. A pressed carrier
// creeps by less than kNearer.
constexpr int kSlowMotions = 10;
constexpr int kLastBlocks = 20;
constexpr double kNearer = 2e-5;  // [m]
// Increase of the force, as a fraction of the force limit, at which a peg that moves freely counts
// as caught. A carrier at 50 mm/s then strains the coupling of the default cell by 35 N more until
// it has stopped, after a block, 10 ms, and braking at 1 m/s².
constexpr double kCaught = 0.25;

// Distance between two poses [m].
double wayLeft(const RestPose& at, const RestPose& target) {
  const double turn = std::hypot(at.yaw - target.yaw, at.theta - target.theta, at.phi - target.phi);
  return std::hypot(at.x - target.x, at.y - target.y, at.z - target.z) + kTurnArm * turn;
}

}  // namespace

PressLimits pressLimits(const Mechanism& mechanism) {
  PressLimits limits;
  limits.scale = scaleOf(mechanism);
  limits.approach_step *= limits.scale.step;
  limits.compliance = kMaxCompliance * pressCompliance(mechanism);
  limits.weight = {mechanism.peg, mechanism.gravity, mechanism.up};
  return limits;
}

GuardedCarrier::GuardedCarrier(Plant& plant, const PressLimits& limits)
    : delay(CarrierDelay::ofArm(limits.arm_delay)),
      plant_(plant),
      limits_(limits),
      sensor_(limits.weight, limits.scale.force) {
  checks_.begin = std::numeric_limits<double>::infinity();  // until limitTime()
  wait(1);
  target_ = last().carrier;
}

void GuardedCarrier::limitTime(const TimeLimit& limit) {
  limits_.time = limit;
  checks_.begin = last().time - limit.spent;
}

const PlantBlock& GuardedCarrier::step(const PlantCommand& command, double force_limit) {
  const double limit = std::min(force_limit, limits_.force);
  PlantCommand all = command;
  if (exciter_ && !all.exciter) all.exciter = exciter_;
  exciter_.reset();
  // before the tare the peg may still swing
  const bool guarded = sensor_.isTared() && checks_.on;
  if (guarded && !all.alarm) {
    all.alarm = sensor_.alarmAt(limit, std::numeric_limits<double>::infinity());
  }
  sensor_.update(plant_.next(all));
  delay.since_command = all.rest ? 0 : delay.since_command + 1;
  delay.to_end = std::max(0, delay.to_end - 1);
  const double allowed = limits_.time.at(delay);
  if (checks_.on && last().time - checks_.begin > allowed) {
    throw AlignError(AlignFailure::kTimeLimit, text("not done within %g s", allowed));
  }
  checks_.saturated = last().saturated ? checks_.saturated + 1 : 0;
  if (guarded && checks_.saturated > kKnockBlocks) {
    throw AlignError(AlignFailure::kSensorSaturated,
                     "a channel is at its limit; lower the press force");
  }
  if (guarded && force().norm() > limit) {
    const double reached = force().norm();
    target_ = last().carrier;
    PlantCommand hold;
    hold.rest = target_;
    sensor_.update(plant_.next(hold));
    delay.since_command = 0;
    throw AlignError(AlignFailure::kForceLimit, text("%.1f N is over %.1f N", reached, limit));
  }
  return last();
}

const PlantBlock& GuardedCarrier::wait(int blocks) {
  for (int i = 0; i < blocks; ++i) step({});
  return last();
}

bool GuardedCarrier::settle(const Rest& rest) {
  int still = 0;
  for (int i = 0; still < rest.blocks; ++i) {
    if (i == limits_.scale.timed(kMotionBlocks)) return false;
    const Vector6 before = last().wrench_b;
    wait(1);
    if (checks_.saturated >= limits_.scale.timed(kFaultyBlocks)) {
      throw AlignError(AlignFailure::kSensorSaturated,
                       "a channel stays at its limit with the peg at rest; look at both sensors, "
                       "their offsets and their noise");
    }
    double limit = rest.force * limits_.scale.still;
    if (i >= limits_.scale.timed(kSwingBlocks) && last().samples > 0) {
      limit = std::max(limit, sensor_.noiseChange());
    }
    const bool agrees = (last().wrench_b - before).head<3>().norm() < limit;
    still = agrees && !last().saturated ? still + 1 : 0;
  }
  return true;
}

void GuardedCarrier::tare(int blocks, const Rest& rest) {
  if (!settle(rest)) {
    throw AlignError(AlignFailure::kNotStill,
                     "the hanging peg doesn't come to rest; check for contact");
  }
  Tare sum;
  meter_.interrupt();
  for (int i = 0; i < blocks; ++i) {
    wait(1);
    meter_.add(last().carrier);
    sum.wrench += last().wrench_b;
    sum.displacement += last().displacement_b;
    sum.scatter += last().covariance_b;
  }
  target_ = last().carrier;
  sensor_.setTare(
      {sum.wrench / blocks, sum.displacement / blocks, sum.scatter / blocks, target_, last().time});
}

void GuardedCarrier::moveTo(const RestPose& target, Move move) {
  wait(delay.to_end);
  const double limit =
      move == Move::kFree ? force().norm() + kCaught * limits_.force : limits_.force;
  target_ = target;
  PlantCommand command;
  command.rest = target;
  double earlier = 0.0;  // way that was left kLastBlocks before the end
  int blocks = kMotionBlocks;
  for (int i = 0; i <= blocks; ++i) {
    const RestPose before = last().carrier;
    step(command, limit);
    if (i >= delay.toEffect() && arrived(before, last().carrier, target, reportNoise())) {
      delay.to_end = blocksToEnd(reportNoise());
      if (move == Move::kToTheEnd) wait(delay.to_end);
      return;
    }
    command.rest.reset();
    const double left = wayLeft(last().carrier, target);
    if (i == blocks - kLastBlocks) earlier = left;
    const double nearer = kNearer + 4.0 * reportNoise().position;
    if (i == blocks && left < earlier - nearer && blocks < kSlowMotions * kMotionBlocks) {
      blocks += kMotionBlocks;
    }
  }
  if (blocks > kMotionBlocks && wayLeft(last().carrier, target) < earlier - kNearer) {
    throw AlignError(AlignFailure::kNotArrived,
                     text("the carrier is still on its way after %d blocks, %.3f mm are left: it "
                          "is too slow, look at its max_speed and max_acceleration",
                          blocks, wayLeft(last().carrier, target) * 1e3));
  }
  const RestPose& at = last().carrier;
  const double away = std::hypot(at.x - target.x, at.y - target.y, at.z - target.z);
  throw AlignError(
      AlignFailure::kNotArrived,
      text("the carrier comes no nearer than %.3f mm to where it was sent, %.1f N on the peg",
           away * 1e3, force().norm()));
}

void GuardedCarrier::nudge(const RestPose& target, const std::optional<ForceAlarm>& alarm) {
  target_ = target;
  PlantCommand command;
  command.rest = target;
  command.alarm = alarm;
  step(command);
}

bool awaitEffect(GuardedCarrier& carrier) {
  const int blocks = carrier.delay.toEffect() - carrier.delay.since_command;
  if (blocks > 0) carrier.wait(blocks);
  return blocks > 0;
}

void exciterOff(GuardedCarrier& carrier, int direction) {
  PlantCommand off;
  off.exciter = ExciterParameters{0.0, 0.0, 0.0, direction};
  carrier.step(off);
}

}  // namespace assembly_cell
