// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "assembly_cell/dynamics/commands.h"

namespace assembly_cell {

/// How a run ended. kOk, or the named reason to stop.
enum class StopReason {
  kOk,
  kEdgeEdge,        ///< these seven: a contact of a feature closes that contact.features excludes
  kEdgePlane,       ///< lowest edge point on the plane (or the hole's floor)
  kEdgeWall,        ///< edge on the wall of the hole
  kRimSide,         ///< rim on the peg's side
  kRimFace,         ///< rim on the peg's bottom face
  kEdgeCone,        ///< edge on the chamfer of the hole
  kRimCone,         ///< rim on the chamfer of the peg
  kPegTop,          ///< the rim has run off the side over the peg's top edge
  kSingular,        ///< sin(theta) < 0.1: peg nearly horizontal
  kInitialOverlap,  ///< a state deeper than 1e-8 m in the block, refused by the rigid law
  kNonFinite,       ///< state or acceleration not finite
  kStepTooSmall,    ///< error control requires a step below 1e-13 s
  kEventLimit,      ///< more than 1e7 events
};
const char* toString(StopReason reason);

/// State of one contact slot, for reports and topics. Frame `hole`.
struct ContactReport {
  enum State : std::uint8_t { kOpen = 0, kSlip = 1, kStick = 2 };
  ContactFeature feature = ContactFeature::kEdgeEdge;
  State state = kOpen;
  bool valid = false;                                 ///< the slot has a candidate point
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< on the peg's edge [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< from block to peg
  Eigen::Vector3d force = Eigen::Vector3d::Zero();    ///< on the peg, by the block [N]
  double gap = 0.0;                                   ///< [m]; < 0 penetrating
};

/// Number of contact slots; their order is that of ContactSet (contact_geometry.h).
constexpr int kSlots = kContactSlots;

/// Simulator backend: the mechanism in time, with the inputs (rest pose, exciter) and the outputs
/// (wrenches, poses, contacts) of a simulated cell. Implemented by `Simulation` and
/// `MujocoSimulation`. Frame `hole` unless stated otherwise.
class SimulatorBackend {
 public:
  virtual ~SimulatorBackend() = default;

  virtual double time() const = 0;  ///< [s] from the start of the scenario
  virtual const Scenario& scenario() const = 0;
  virtual StopReason stopReason() const = 0;
  virtual std::int64_t steps() const = 0;  ///< accepted so far

  /// Integrates to exactly t_end [s], or stops earlier with a reason. Returns stopReason(). After
  /// `attempts` trial steps it returns with time() < t_end; the next call continues with the same
  /// bits.
  virtual StopReason advance(double t_end,
                             std::int64_t attempts = std::numeric_limits<std::int64_t>::max()) = 0;

  /// As advance(), but the last step may end after t, at most at `ahead` [s]: all outputs are then
  /// samples at t of the step's dense output. A command discards the part of the step after t. The
  /// default is advance(t).
  virtual StopReason sampleAt(double t, double /*ahead*/) { return advance(t); }

  /// Moves the rest pose from now on to `target` along a C² profile within the carrier's limits,
  /// at most at `max_speed` [m/s].
  void setRestTarget(const RestPose& target,
                     double max_speed = std::numeric_limits<double>::infinity());
  /// Moves the rest pose from now on along a quintic that reaches the motion `goal` at t_goal [s].
  /// For a carrier that is moved from outside: to be called again before t_goal.
  void followRest(const RestMotion& goal, double t_goal);
  /// Stops the rest pose from now on within the carrier's maximum acceleration, see planStop().
  void stopRest();
  /// Displacement of the rest pose during a stop that begins now: translation and rotation vector
  /// in the axes of the carrier frame. [m], [rad]
  Vector6 stoppingDisplacement() const;
  RestPose rest() const;  ///< at the present time, restShift() included

  /// Changes the offset of the rest pose from the commanded one to `shift` (x, y, z, yaw, theta,
  /// phi) [m, rad], along a C² profile within the carrier's limits.
  void setRestShift(const Vector6& shift);
  /// Present offset of the rest pose from the commanded one: setRestShift() plus the deflection of
  /// the carrier's compliance [m, rad].
  Vector6 restShift() const;
  /// True after the end of the commanded motion.
  bool atRest() const;

  /// Sets the exciter from now on. Angle of its force: direction·(frequency·(t − t_ref) + phase),
  /// t_ref on the clock of time() [s].
  virtual void setExciter(const ExciterParameters& exciter, double t_ref) = 0;
  /// Sets the friction of all contacts from now on, instead of the scenario's.
  virtual void setFriction(const FrictionParameters& friction) = 0;

  /// Contacts at the present time, by slot.
  virtual std::array<ContactReport, kSlots> contacts() const = 0;
  /// Wrench of the peg's coupling on sensor_b (contact + weight when at rest), in the axes of the
  /// carrier frame about its origin: force, torque. [N], [N·m]
  virtual Vector6 couplingWrench() const = 0;
  /// Wrench of the peg on the hole block about the origin of `hole` in its axes. [N], [N·m]
  virtual Vector6 holeWrench() const = 0;
  /// Specific force (acceleration less gravity) at the point of the peg's axis `height` [m] above
  /// its centre of mass, along the peg's x and y, as accelerometers measure it there [m/s²].
  virtual Eigen::Vector2d specificForce(double height) const = 0;

  virtual Pose pegPose() const = 0;  ///< X_H,peg: frame `peg` (bottom edge centre) in `hole`
  /// X_H,carrier: coupling rest point with tilt and yaw, in `hole`.
  virtual Pose carrierPose() const = 0;
  /// carrierPose() as coordinates: x, y and yaw of the carrier, z and tilt of the rest pose.
  virtual RestPose carrier() const = 0;

 protected:
  SimulatorBackend() = default;
  SimulatorBackend(const SimulatorBackend&) = default;
  SimulatorBackend& operator=(const SimulatorBackend&) = default;

  virtual const Commands& commands() const = 0;
  /// The commands, to be changed from time() on: outputs are evaluated again.
  virtual Commands& changeCommands() = 0;
  /// Deflection of the carrier's compliance: x, y, z [m], as State::carrier_deflection.
  virtual Eigen::Vector3d carrierDeflection() const = 0;
};

}  // namespace assembly_cell
