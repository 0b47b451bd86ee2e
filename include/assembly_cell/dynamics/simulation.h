// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <memory>

#include "assembly_cell/dynamics/simulator_backend.h"

namespace assembly_cell {

/// Shapes of peg and hole for the contact search.
ContactShapes shapesOf(const Scenario& scenario);

struct RunCounts {
  std::int64_t evaluations = 0;  ///< right-hand sides
  std::int64_t steps = 0;        ///< accepted
  std::int64_t rejected = 0;
  std::int64_t events = 0;            ///< located changes of contact modes
  std::int64_t impacts = 0;           ///< contacts closed at an approaching speed
  std::int64_t zeno_phases = 0;       ///< Zeno phases: events too dense to be located one by one
  std::int64_t painleve_impacts = 0;  ///< Painlevé (frictional) impacts, without a collision
};

/// The nine-degree-of-freedom mechanism in time. Deterministic: the same calls give the same bits.
/// No allocation after construction and the first sampleAt(). Between two events the contacts keep
/// their modes (open, idle, sliding, sticking) and the motion is smooth; a step is
///
///   until t_end, or a reason to stop:
///     if events accumulate (Zeno):        a step of fixed length that locates none
///     else
///       try a step h of the integrator, modes frozen       v' = f(t, q, v): free motion of the
///       its error is over the tolerance:  a shorter one      mechanism, contact points, forces
///       no event function below zero:     accept it
///       else                              find the first zero, shorten the step to end there,
///                                         open or close the contacts that it names,
///                                         rigid contacts that closed: impact,
///                                         decide the modes of all closed contacts again
///
/// In src/dynamics: `System` (constants), `Context` (state of the run) and `Evaluation` (result of
/// f) are plain values in context.h; evaluation.h is f, contact_solver.h its forces, integrator.h
/// the step, event_locator.h the events, impact.h the impacts, contact_modes.h and mode_search.h
/// the modes, zeno.h the event accumulation; simulation_run.h the run and its dense output.
/// Equations: docs/theory/thesis.md.
class Simulation final : public SimulatorBackend {
 public:
  /// Throws InputError for a contact law or integrator that is not available, and for an initial
  /// overlap of more than 1e-8 m under the rigid law.
  explicit Simulation(const Scenario& scenario);

  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;
  ~Simulation() override;

  const State& state() const;
  /// Rates of state().v.
  const Vector9& acceleration() const;
  RunCounts counts() const;
  double energy() const;  ///< kinetic + coupling + carrier springs + weight [J]

  double time() const override;
  const Scenario& scenario() const override;
  StopReason stopReason() const override;
  std::int64_t steps() const override { return counts().steps; }
  StopReason advance(double t_end,
                     std::int64_t attempts = std::numeric_limits<std::int64_t>::max()) override;
  StopReason sampleAt(double t, double ahead) override;
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
  const Commands& commands() const override;
  Commands& changeCommands() override;
  Eigen::Vector3d carrierDeflection() const override;
  struct Run;
  std::unique_ptr<Run> run_;
};

}  // namespace assembly_cell
