// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/press_controller.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Lengths, forces and times are those of the default cell; PressLimits::scale has the factors.
// Lateral force that counts as a touch, over the force of a touch. An edge that slides down the
// bore's wall pushes with 0.3 to 0.5 N before it wedges. With half of it near starts take 0.5 s
// longer, with twice of it one of 80 of them is held with 200 N.
constexpr double kSidewaysTouch = 0.2;
// Bounds of the estimated stiffness of a contact, and its first value [N/m].
constexpr double kSoftest = 2e3, kStiffest = 2e5;
constexpr double kFirstStiffness = 3e4;
// Greatest change of height in one step of a press [m].
constexpr double kMaxChange = 3e-4;
constexpr int kHoldSteps = 30;
// Time from a command until a force shows its whole effect [s]: a block may be 60 ms old when it
// arrives, the command as old when it is executed, and an arm needs 50 ms.
constexpr double kCommandDelay = 0.2;
// Attempts to hold a force that changes again at rest. The end of an arm's move makes it do so
// once.
constexpr int kHolds = 5;
// Least force of a press, over that of a touch. A smaller one may be lost in the steps of the
// press: of six from 0.15 to 0.4 N two were.
constexpr double kMinPress = 0.33;
constexpr int kSettleBlocks = 3;
// Standard deviations of the reported height that don't count as a lag.
constexpr double kReportScatter = 4.0;
// The force shows a delay half a step later than the pose does, since it is the mean of a step. An
// arm that moves in steps differs by up to half a step.
constexpr double kForceLater = 0.5 * kStepTime, kDelayTolerance = kStepTime;
// Standard deviations of the delay in the mechanism's file within which a descent agrees with it.
constexpr double kDelayReach = 3.0;
constexpr double kLongestDelay = CarrierDelay::kMost * kStepTime;
// Standard deviations within which 99 of 100 blocks are.
constexpr double kScatterReach = 2.5;

}  // namespace

PressController::PressController(GuardedCarrier& carrier)
    : carrier_(carrier),
      stiffness_(kFirstStiffness * carrier.limits().scale.force / carrier.limits().scale.sink) {}

bool PressController::approach(double floor, double faster) {
  // descend a little every block until a touch, which may push sideways rather than up
  const double start = carrier_.target().z, touch = carrier_.sensor().touchForce();
  lowest_start_ = std::min(lowest_start_, start);
  // no faster with an arm or a carrier that answers late, which move on after the contact, nor in a
  // stiff coupling
  const Scale& scale = carrier_.limits().scale;
  const bool late = carrier_.limits().arm_delay > 0.0 || carrier_.delay.slowing() < 1.0;
  const double most = late ? 1.0 : faster * scale.sink / scale.step;
  const double step = carrier_.limits().approach_step * std::clamp(most, 1.0, faster);
  RestPose target = carrier_.target();
  delay_.begin(target.z, carrier_.last().time);
  while (carrier_.force().norm() < touch &&
         carrier_.force().head<2>().norm() < kSidewaysTouch * touch) {
    if (target.z <= floor) {
      // a late carrier hasn't arrived yet
      if (carrier_.delay.since_command >= carrier_.delay.toEffect()) return false;
      carrier_.wait(1);
      continue;
    }
    if (lowest_start_ - target.z > carrier_.limits().descent) {
      throw AlignError(
          AlignFailure::kNoContact,
          text("none within %.1f mm of descent from z %.4f m", (start - target.z) * 1e3, start));
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

// Measures the delay in a descent. Compares that of the first one with the mechanism's file.
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
  // wait without a further command until it moves
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

// Throws `gave_way` for a press that has moved down by more than the compliance allows for a force.
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
  // secant method
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
    carrier_.settle();  // a swing could pass the tolerance
    limitTravel(start - carrier_.target().z, force);
    if (std::abs(carrier_.force().z() - force) <= tolerance * force) return;
  }
  throw AlignError(AlignFailure::kPressNotHeld, text("%.4g N instead of %.4g N, or it doesn't stay",
                                                     carrier_.force().z(), force));
}

}  // namespace assembly_cell
