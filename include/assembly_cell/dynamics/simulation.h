// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>

#include "assembly_cell/dynamics/model.h"

namespace assembly_cell {

/// How a run ended. kOk, or the named reason to stop.
enum class StopReason {
  kOk,
  kEdgeEdge,        ///< these five: a contact closes that contact.features excludes
  kEdgePlane,       ///< lowest edge point on the plane (or the hole's floor)
  kEdgeWall,        ///< edge on the wall of the hole
  kRimSide,         ///< rim on the peg's side
  kRimFace,         ///< rim on the peg's bottom face
  kPegTop,          ///< the rim has run off the side over the peg's top edge
  kSingular,        ///< sin(theta) < 0.1: peg nearly horizontal
  kInitialOverlap,  ///< a state deeper than 1e-8 m in the block, refused by the rigid law
  kNonFinite,       ///< state or acceleration not finite
  kStepTooSmall,    ///< error control asks for steps below 1e-13 s
  kEventLimit,      ///< more events than a run may have
};
const char* toString(StopReason reason);

struct RunCounts {
  std::int64_t evaluations = 0;  ///< right-hand sides
  std::int64_t steps = 0;        ///< accepted
  std::int64_t rejected = 0;
  std::int64_t events = 0;   ///< contact opened, closed, stick, slip
  std::int64_t impacts = 0;  ///< contacts closed at an approaching speed
  std::int64_t jams = 0;     ///< impacts without collision: slipping points wedged by friction
};

/// One contact as people and topics see it. Frame `hole`.
struct ContactReport {
  enum Feature : std::uint8_t { kEdgeEdge, kEdgePlane, kEdgeWall, kRimSide, kRimFace };
  enum State : std::uint8_t { kOpen = 0, kSlip = 1, kStick = 2 };
  Feature feature = kEdgeEdge;
  State state = kOpen;
  bool valid = false;                                 ///< the slot has a candidate point
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< on the peg's edge [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< from block to peg
  Eigen::Vector3d force = Eigen::Vector3d::Zero();    ///< on the peg, by the block [N]
  double gap = 0.0;                                   ///< [m]; < 0 penetrating
};

/// Contact slots, as geometry numbers them: edge–edge left and right of the lowest edge point,
/// edge–plane, then those of a peg in the hole.
constexpr int kSlots = kContactSlots;

/// The nine-degree-of-freedom mechanism in time. Deterministic: the same calls give the same bits.
/// No allocation after construction. Between two events the contacts keep their modes (open, idle,
/// sliding, sticking) and the motion is smooth; a step is
///
///   until t_end, or a reason to stop:
///     if events have become too dense:    a step of fixed length that locates none (chatter)
///     else
///       try a step h of the integrator, modes frozen       v' = f(t, q, v): free motion of the
///       its error is over the tolerance:  a shorter one      mechanism, contact points, forces
///       no event function below zero:     accept it
///       else                              find the first zero, shorten the step to end there,
///                                         open or close the contacts that it names,
///                                         rigid contacts that closed: impact,
///                                         decide the modes of all closed contacts anew
///
/// In src/dynamics: `System` (constant), `Context` (where the run is) and `Evaluation` (what f
/// found) are plain values in context.h; evaluation.h is f, contact_solver.h its forces,
/// integrator.h the step, event_locator.h the events, impact.h the impacts, contact_modes.h the
/// decisions, chatter.h the rest. Equations: docs/theory.md.
class Simulation {
 public:
  /// Throws InputError when the scenario asks for what is not available (law, integrator).
  explicit Simulation(const Scenario& scenario);

  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;
  ~Simulation();

  double time() const;  ///< [s] from the start of the scenario
  const State& state() const;
  /// Rates of state().v at the end of the last step.
  const Vector9& acceleration() const;
  const Scenario& scenario() const;
  RunCounts counts() const;
  StopReason stopReason() const;

  /// Integrates to exactly t_end, or stops earlier with a reason. Returns stopReason(). Comes back
  /// after so many `attempts` at a step, time() before t_end: the next call goes on, same bits.
  StopReason advance(double t_end,
                     std::int64_t attempts = std::numeric_limits<std::int64_t>::max());

  /// From now on move the rest pose to `target` along a C² profile within the carrier's limits, no
  /// faster than `max_speed` [m/s].
  void setRestTarget(const RestPose& target,
                     double max_speed = std::numeric_limits<double>::infinity());
  /// From now on bring the rest pose to a stop within the carrier's limits, no farther than that
  /// takes: see planStop().
  void stopRest();
  /// How far the rest pose would go on in a stop that began now: translation and rotation vector in
  /// the axes of the carrier frame. [m], [rad]
  Vector6 stopWay() const;
  RestPose rest() const;  ///< at the present time, with the shift

  /// From now on lets the rest pose stand off by `shift` (x, y, z, yaw, theta, phi) from what is
  /// commanded, along a C² profile within the carrier's limits.
  void setRestShift(const Vector6& shift);
  /// How far the rest pose stands off now: by setRestShift() and by the carrier's compliance.
  Vector6 restShift() const;
  /// The commanded motion is over.
  bool atRest() const;

  /// Exciter from now on. `angle_at` is the force angle law: direction·(frequency·(t − t_ref) +
  /// phase) with t_ref on the simulation's clock.
  void setExciter(const ExciterParameters& exciter, double t_ref);

  /// Contacts at the present time. Forces are those of the last evaluation.
  std::array<ContactReport, kSlots> contacts() const;

  /// Wrench of the peg's coupling on sensor_b (contact + weight when at rest), in the axes of the
  /// carrier frame about its origin: force, torque. [N], [N·m]
  Vector6 couplingWrench() const;
  /// Wrench of the peg on the hole block about the origin of `hole` in its axes. [N], [N·m]
  Vector6 holeWrench() const;

  Pose pegPose() const;      ///< X_H,peg: frame `peg` (bottom edge centre) in `hole`
  Pose carrierPose() const;  ///< X_H,carrier: coupling rest point with tilt and yaw, in `hole`
  double energy() const;     ///< kinetic + coupling + carrier springs + weight [J]

 private:
  struct Run;
  std::unique_ptr<Run> run_;
};

}  // namespace assembly_cell
