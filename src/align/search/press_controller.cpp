// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/press_controller.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Lengths, forces and times of the default cell; PressLimits::scale carries them over.
// Touch force sideways, of a touch. An edge that slides down the bore's wall pushes with 0.3 to
// 0.5 N before it wedges. Half: near starts take 0.5 s longer. Twice: one of 80 of them is held
// with 200 N.
constexpr double kSidewaysTouch = 0.2;
constexpr double kSoftest = 2e3, kStiffest = 2e5;  // bounds of the secant's stiffness [N/m]
constexpr double kFirstStiffness = 3e4;            // [N/m]
constexpr double kMaxChange = 3e-4;                // of height in one step of a press [m]
constexpr int kHoldSteps = 30;
// Delay from a command to the end of its effect: a block may be 60 ms old when it arrives, the
// command as old when it is taken, and an arm needs 50 ms [s]. An earlier force has no meaning.
constexpr double kCommandDelay = 0.2;
// Times that a force may have gone on and is held again: an arm's end of a move does so once.
constexpr int kHolds = 5;
// Of a touch. Less is lost again in the steps of a press: of six from 0.15 to 0.4 N two were.
constexpr double kMinPress = 0.33;
constexpr int kSettleBlocks = 3;
constexpr double kReportScatter = 4.0;  // sd of a reported height that are no delay
// A delay in the force is half a step longer than in the pose, the mean of a step; an arm that
// moves in steps is up to half a step off.
constexpr double kForceLater = 0.5 * kStepTime, kDelayTolerance = kStepTime;
constexpr double kDelayReach = 3.0;  // sd of the delay on file
constexpr double kLongestDelay = CarrierDelay::kMost * kStepTime;
// 99 of 100 blocks scatter by less than 2.5 sd.
constexpr double kScatterReach = 2.5;

}  // namespace

PressController::PressController(GuardedCarrier& carrier)
    : carrier_(carrier),
      stiffness_(kFirstStiffness * carrier.limits().scale.force / carrier.limits().scale.sink) {}

bool PressController::approach(double floor, double faster) {
  // descend a little every block until the first touch; a steep one hardly pushes up
  const double start = carrier_.target().z, touch = carrier_.sensor().touchForce();
  // not an arm nor one that answers late, which go on for as long after the contact, nor in a stiff
  // coupling
  const Scale& scale = carrier_.limits().scale;
  const bool late = carrier_.limits().arm_delay > 0.0 || carrier_.delay.slowing() < 1.0;
  const double most = late ? 1.0 : faster * scale.sink / scale.step;
  const double step = carrier_.limits().approach_step * std::clamp(most, 1.0, faster);
  RestPose target = carrier_.target();
  delay_.begin(target.z, carrier_.last().time);
  while (carrier_.force().norm() < touch &&
         carrier_.force().head<2>().norm() < kSidewaysTouch * touch) {
    if (target.z <= floor) {
      // a late carrier isn't there yet
      if (carrier_.delay.since_command >= carrier_.delay.toEffect()) return false;
      carrier_.wait(1);
      continue;
    }
    if (start - target.z > carrier_.limits().descent) {
      throw AlignError(AlignFailure::kNoContact,
                       text("none within %.1f mm of descent from z %.4f m",
                            carrier_.limits().descent * 1e3, start));
    }
    target.z -= step * carrier_.delay.slowing();
    delay_.command(target.z, carrier_.last().time);
    carrier_.nudge(target, carrier_.sensor().alarmAt(touch, kSidewaysTouch * touch));
    const double scatter = kReportScatter * carrier_.reportNoise().position;
    carrier_.delay.measure((carrier_.last().carrier.z - target.z - scatter) / step);
    measureDelay();
  }
  touch_z_ = carrier_.last().carrier.z;
  target.z = touch_z_;
  carrier_.moveTo(target);
  return true;
}

// Of a descent; that of the first is compared with the one on file.
void PressController::measureDelay() {
  const auto report = [&] {
    const PlantBlock& last = carrier_.last();
    delay_.report(last.carrier.z, last.time, carrier_.reportNoise().position);
  };
  report();
  const std::optional<double> settled = delay_.settled();
  if (settled) carrier_.delay.answers(*settled);
  const ArmResponse& arm = carrier_.limits().arm;
  if (delay_checked_ || !(arm.delay_sd > 0.0)) return;
  const double tolerance = kDelayTolerance + kDelayReach * arm.delay_sd;
  double delay = settled.value_or(delay_.still()) + kForceLater;
  const bool is_later = delay > arm.delay + tolerance;
  if (!settled && !is_later) return;
  delay_checked_ = true;
  if (!is_later && delay >= arm.delay - tolerance) return;
  // sent no farther, until it moves
  for (double before = -1.0; !settled && delay_.still() > before && before < kLongestDelay;) {
    before = delay_.still();
    carrier_.wait(1);
    report();
    delay = delay_.still() + 0.5 * kStepTime + kForceLater;
  }
  throw AlignError(AlignFailure::kWrongMechanism,
                   text("the arm answers after %.3f s, on file are %.3f s (arm.delay): measure it "
                        "again, identify with target arm",
                        delay, arm.delay));
}

// Refuses a press that has gone down by `down` [m] for a force.
void PressController::limitTravel(double down, double force) const {
  if (down <= carrier_.limits().compliance * force) return;
  throw AlignError(AlignFailure::kGaveWay,
                   text("%.1f mm down for %.1f N", down * 1e3, carrier_.force().z()));
}

double PressController::minForce(double tolerance) const {
  const PlantBlock& last = carrier_.last();
  const Matrix6 of_mean =
      carrier_.sensor().tare().scatter / std::max(1, last.samples) + last.rounding_b;
  const double scatter = kScatterReach * std::sqrt(of_mean(2, 2));
  return std::max(kMinPress * carrier_.sensor().touchForce(), scatter / tolerance);
}

void PressController::hold(double force, double tolerance, bool settled) {
  // secant steps to the force
  RestPose target = carrier_.target();
  const double start = target.z;
  const Scale& scale = carrier_.limits().scale;
  const double stiffer = scale.force / scale.sink;
  if (!settled) awaitEffect(carrier_);
  if (!settled) carrier_.wait(scale.timed(kSettleBlocks));
  for (int i = 0; i < kHoldSteps; ++i) {
    const double before = carrier_.force().z();
    if (std::abs(before - force) <= tolerance * force) return;
    const double max_change = kMaxChange * scale.sink;
    const double change = std::clamp((force - before) / stiffness_, -max_change, max_change);
    target.z -= change;
    limitTravel(start - target.z, force);
    carrier_.moveTo(target);
    carrier_.wait(scale.timed(kSettleBlocks));
    // slip makes single secants unreliable: change the estimate by no more than threefold
    const double measured = (carrier_.force().z() - before) / change;
    stiffness_ = std::clamp(measured, stiffness_ / 3, stiffness_ * 3);
    stiffness_ = std::clamp(stiffness_, kSoftest * stiffer, kStiffest * stiffer);
  }
  throw AlignError(AlignFailure::kPressNotHeld,
                   text("%.4g N instead of %.4g N", carrier_.force().z(), force));
}

void PressController::holdStill(double force, double tolerance) {
  const double start = carrier_.target().z;
  for (int i = 0; i < kHolds; ++i) {
    hold(force, tolerance, i > 0);
    for (double passed = 0.0; passed < kCommandDelay; passed += carrier_.last().length) {
      carrier_.wait(1);
    }
    carrier_.settle();  // or it swings within the tolerance
    limitTravel(start - carrier_.target().z, force);
    if (std::abs(carrier_.force().z() - force) <= tolerance * force) return;
  }
  throw AlignError(AlignFailure::kPressNotHeld, text("%.4g N instead of %.4g N, or it doesn't stay",
                                                     carrier_.force().z(), force));
}

}  // namespace assembly_cell
