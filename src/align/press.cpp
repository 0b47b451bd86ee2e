// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/press.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {
namespace {

constexpr double kTouchForce = 1.5;      // this much along z is contact [N]
constexpr double kFirstStiffness = 3e4;  // of the first secant step [N/m]
constexpr int kSettleBlocks = 3;
constexpr int kStillLimit = 200;  // blocks that a settling may take

std::string line(const char* format, double a, double b) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

}  // namespace

Hand::Hand(Plant& plant, const PressLimits& limits) : plant_(plant), limits_(limits) {
  wait(1);
  target_ = last_.carrier;
}

const PlantBlock& Hand::step(const PlantCommand& command) {
  last_ = plant_.next(command);
  const Vector6 contact = last_.wrench_b - tare_;
  if (last_.saturated) {
    throw PressError("sensor_saturated: a channel is at its limit; lower the press force");
  }
  const double force = contact.head<3>().norm();
  if (tared_ && force > limits_.force) {
    throw PressError(line("force_limit: %.1f N is over %.1f N", force, limits_.force));
  }
  return last_;
}

const PlantBlock& Hand::wait(int blocks) {
  for (int i = 0; i < blocks; ++i) step({});
  return last_;
}

void Hand::tare(int blocks) {
  // hanging free: wait until two blocks agree, then average
  for (int i = 0; i < kStillLimit; ++i) {
    const Vector6 before = last_.wrench_b;
    wait(1);
    if ((last_.wrench_b - before).head<3>().norm() < 0.03) break;
    if (i + 1 == kStillLimit) {
      throw PressError("not_still: the hanging peg doesn't come to rest; check for contact");
    }
  }
  Vector6 wrench = Vector6::Zero(), displacement = Vector6::Zero();
  for (int i = 0; i < blocks; ++i) {
    wait(1);
    wrench += last_.wrench_b;
    displacement += last_.displacement_b;
  }
  tare_ = wrench / blocks;
  tare_displacement_ = displacement / blocks;
  tared_ = true;
}

void Hand::moveTo(const RestPose& target) {
  target_ = target;
  PlantCommand command;
  command.rest = target;
  step(command);
  for (int i = 0; i < kStillLimit; ++i) {
    const RestPose& at = last_.carrier;
    const bool arrived = std::abs(at.z - target.z) < 1e-7 && std::abs(at.theta - target.theta) < 1e-7 &&
                         std::abs(at.phi - target.phi) < 1e-7 &&
                         std::hypot(at.x - target.x, at.y - target.y) < 5e-4;
    if (arrived) return;
    step({});
  }
  throw PressError(line("not_arrived: carrier at z %.4f m instead of %.4f m", last_.carrier.z,
                        target.z));
}

void Hand::press(double force, double tolerance) {
  // descend a little every block until the first touch
  const double start = target_.z;
  const double down = limits_.approach_step;
  RestPose target = target_;
  while (forceZ() < kTouchForce) {
    if (start - target.z > limits_.descent) {
      throw PressError(line("no_contact: none within %.1f mm of descent from z %.4f m",
                            limits_.descent * 1e3, start));
    }
    target.z -= down;
    PlantCommand command;
    command.rest = target;
    step(command);
  }
  touch_z_ = last_.carrier.z;

  // secant steps to the force
  double stiffness = kFirstStiffness;
  target.z = last_.carrier.z;
  moveTo(target);
  wait(kSettleBlocks);
  for (int i = 0; i < 25; ++i) {
    const double before = forceZ();
    if (std::abs(before - force) <= tolerance * force) return;
    const double change = std::clamp((force - before) / stiffness, -3e-4, 3e-4);
    target.z -= change;
    moveTo(target);
    wait(kSettleBlocks);
    const double measured = (forceZ() - before) / change;
    stiffness = std::clamp(measured, 0.3 * stiffness, 3.0 * stiffness);
    stiffness = std::clamp(stiffness, 2e3, 2e5);
  }
  throw PressError(line("press_not_held: %.2f N instead of %.2f N", forceZ(), force));
}

}  // namespace assembly_cell
