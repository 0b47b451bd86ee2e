// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <string>

#include "assembly_cell/dynamics/commands.h"
#include "assembly_cell/dynamics/soft_contact.h"
#include "assembly_cell/dynamics/world.h"

namespace assembly_cell {

/// The engine's model of a scenario: MJCF, frame `hole`. Peg (free) and carrier (x, y, yaw) have no
/// springs in it, `SecondWorld` applies them. Friction is the sliding coefficient.
std::string mjcf(const Scenario& scenario, const SoftContact& contact);

/// The cell in MuJoCo: rigid-body dynamics, collisions, contact forces and friction are the
/// engine's. The springs of coupling and carrier are forces on its bodies, by the rotation vector
/// of the coupling and in the carrier's axes; `Simulation` takes Euler angles and the hole's. The
/// carrier's profile and the exciter's force are commands and the same for both.
///
/// A step: positions and contacts of now (mj_forward) under the forces of now, then the engine's
/// semi-implicit Euler step. All that is asked for is of the present time.
class SecondWorld final : public World {
 public:
  /// Starts where `Simulation` does. Throws InputError where the scenario or the engine refuses.
  SecondWorld(const Scenario& scenario, const SoftContact& contact);
  ~SecondWorld() override;

  double kineticEnergy() const;  ///< of peg and carrier, by the engine [J]
  /// + coupling, carrier springs and weight [J].
  double energy() const;
  int contactCount() const;  ///< of the engine's: several may make one of contacts()

  double time() const override;
  const Scenario& scenario() const override { return scenario_; }
  StopReason stopReason() const override { return stop_; }
  std::int64_t steps() const override { return steps_; }
  StopReason advance(double t_end,
                     std::int64_t attempts = std::numeric_limits<std::int64_t>::max()) override;
  void setRestTarget(const RestPose& target,
                     double max_speed = std::numeric_limits<double>::infinity()) override;
  void followRest(const RestMotion& goal, double t_goal) override;
  void stopRest() override;
  Vector6 stoppingDisplacement() const override;
  RestPose rest() const override;
  void setRestShift(const Vector6& shift) override;
  Vector6 restShift() const override;
  bool atRest() const override;
  void setExciter(const ExciterParameters& exciter, double t_ref) override;
  std::array<ContactReport, kSlots> contacts() const override;
  Vector6 couplingWrench() const override;
  Vector6 holeWrench() const override;
  Eigen::Vector2d specificForce(double height) const override;
  Pose pegPose() const override;
  Pose carrierPose() const override;
  RestPose carrier() const override;

 private:
  struct Engine;
  struct Coupling;

  Coupling coupling() const;
  RestMotion restNow() const;
  void updateDeflection(double h);
  void evaluate();
  void step(double h);

  Scenario scenario_;
  SoftContact contact_;
  Commands commands_;
  Eigen::Vector3d give_ = Eigen::Vector3d::Zero();       // as in State
  Eigen::Vector3d give_rate_ = Eigen::Vector3d::Zero();  // over the last step
  std::unique_ptr<Engine> engine_;
  StopReason stop_ = StopReason::kOk;
  std::int64_t steps_ = 0;
  bool stale_ = true;  // after a command: forces are not of the present
};

}  // namespace assembly_cell
