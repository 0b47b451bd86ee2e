// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>
#include <string>

#include "assembly_cell/dynamics/simulator_backend.h"
#include "assembly_cell/dynamics/soft_contact.h"

namespace assembly_cell {

/// MuJoCo's model of a scenario: MJCF, frame `hole`. Peg (free) and carrier (x, y, yaw) without
/// springs, which `MujocoSimulation` applies. Friction is the sliding coefficient.
std::string mjcf(const Scenario& scenario, const SoftContact& contact);

/// Simulator backend with MuJoCo: rigid-body dynamics, collisions, contact forces and friction are
/// the engine's. The springs of coupling and carrier are applied forces, computed from the rotation
/// vector of the coupling and in the carrier's axes; `Simulation` uses Euler angles and the hole's
/// axes. The commands (rest pose, exciter) are those of `Simulation`.
///
/// A step: mj_forward at the present state with the applied forces, then the engine's semi-implicit
/// Euler step. All outputs are of the present time.
class MujocoSimulation final : public SimulatorBackend {
 public:
  /// Initial state as that of `Simulation`. Throws InputError for a scenario that is not supported
  /// and for an error of the engine.
  MujocoSimulation(const Scenario& scenario, const SoftContact& contact);
  ~MujocoSimulation() override;

  int contactCount() const;  ///< contacts of the engine, which contacts() merges

  double time() const override;
  const Scenario& scenario() const override { return scenario_; }
  StopReason stopReason() const override { return stop_; }
  std::int64_t steps() const override { return steps_; }
  StopReason advance(double t_end,
                     std::int64_t attempts = std::numeric_limits<std::int64_t>::max()) override;
  void setExciter(const ExciterParameters& exciter, double t_ref) override;
  void setFriction(const FrictionParameters& friction) override;
  std::array<ContactReport, kSlots> contacts() const override;
  Vector6 couplingWrench() const override;
  Vector6 holeWrench() const override;
  Eigen::Vector2d specificForce(double height) const override;
  Pose pegPose() const override;
  Pose carrierPose() const override;
  RestPose carrier() const override;

 private:
  const Commands& commands() const override { return commands_; }
  Commands& changeCommands() override;
  Eigen::Vector3d carrierDeflection() const override { return deflection_; }
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
  Eigen::Vector3d deflection_ = Eigen::Vector3d::Zero();       // State::carrier_deflection
  Eigen::Vector3d deflection_rate_ = Eigen::Vector3d::Zero();  // over the last step
  std::unique_ptr<Engine> engine_;
  StopReason stop_ = StopReason::kOk;
  std::int64_t steps_ = 0;
  bool stale_ = true;  // after a command: forces are outdated
};

}  // namespace assembly_cell
