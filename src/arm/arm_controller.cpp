// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_controller.h"

#include <algorithm>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr double kJump = 0.02;         // of the simulator's carrier when it was moved otherwise [m]
constexpr double kTwistTimeout = 0.1;  // a twist isn't integrated for longer [s]

}  // namespace

ArmController::ArmController(const EmulatedArmSettings& settings, const CellPlace& place,
                             std::unique_ptr<ArmKinematics> kinematics)
    : settings_(settings), place_(place), kinematics_(std::move(kinematics)) {
  const auto joints = static_cast<Eigen::Index>(settings_.home.size());
  wanted_ = JointVector::Map(settings_.home.data(), joints);
  JointVector q = wanted_;
  const JointSolution solution = kinematics_->solve(place_.flangeOf(Pose()), q);
  if (solution.reached) return;
  throw InputError(
      text("parameter ~home: from there the arm doesn't reach the start of the carrier (%g m, %g "
           "rad off): give joints near it, see ~place",
           solution.distance, solution.turn));
}

bool ArmController::setCarrier(const Pose& X, double time, bool restarted, std::string& error) {
  const bool moved =
      arm_ && arm_->queue.empty() && (carrier(*arm_, *kinematics_).at.p - X.p).norm() > kJump;
  if (arm_ && !restarted && !moved) return false;
  JointVector q = arm_ ? arm_->q : wanted_;
  const JointSolution solution = kinematics_->solve(place_.flangeOf(X), q);
  if (!solution.reached) {
    error = text("the carrier is %g m, %g rad out of the arm's reach", solution.distance,
                 solution.turn);
  }
  arm_ = emulatedArm(settings_.arm, place_, *kinematics_, q, time);
  wanted_ = q;
  twist_time_ = time;
  return true;
}

void ArmController::commandJoints(const std::vector<std::string>& names,
                                  const std::vector<double>& positions, double time) {
  JointVector q;
  std::string missing;
  if (!kinematics_->select(names, positions, q, missing)) {
    throw InputError("joint_names lacks " + missing + ": give all joints of the arm");
  }
  command(*arm_, q, time);
}

void ArmController::commandPose(const Pose& X_base_flange, double time) {
  kinematics_->solve(X_base_flange, wanted_);
  command(*arm_, wanted_, time);
}

void ArmController::commandTwist(const Vector6& twist, double time) {
  const double passed = std::clamp(time - twist_time_, 0.0, kTwistTimeout);
  twist_time_ = time;
  wanted_ += passed * kinematics_->rates(wanted_, twist);
  command(*arm_, wanted_, time);
}

}  // namespace assembly_cell
