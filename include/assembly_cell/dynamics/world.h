// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "assembly_cell/dynamics/model.h"

namespace assembly_cell {

/// How a run ended. kOk, or the named reason to stop.
enum class StopReason {
  kOk,
  kEdgeEdge,        ///< these seven: a contact closes that contact.features excludes
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
  kStepTooSmall,    ///< error control asks for steps below 1e-13 s
  kEventLimit,      ///< more events than a run may have
};
const char* toString(StopReason reason);

/// One contact as people and topics see it. Frame `hole`.
struct ContactReport {
  enum Feature : std::uint8_t {
    kEdgeEdge,
    kEdgePlane,
    kEdgeWall,
    kRimSide,
    kRimFace,
    kEdgeCone,
    kRimCone
  };
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
/// edge–plane, then those of a peg in the hole, then those of chamfers.
constexpr int kSlots = kContactSlots;

/// A mechanism in time: what the sensors, the carrier and the exciter of a simulated cell work on.
/// `Simulation` is one; another engine may be another. Frame `hole` unless it says otherwise.
class World {
 public:
  virtual ~World() = default;

  virtual double time() const = 0;  ///< [s] from the start of the scenario
  virtual const Scenario& scenario() const = 0;
  virtual StopReason stopReason() const = 0;
  virtual std::int64_t steps() const = 0;  ///< accepted so far

  /// Integrates to exactly t_end, or stops earlier with a reason. Returns stopReason(). Comes back
  /// after so many `attempts` at a step, time() before t_end: the next call goes on, same bits.
  virtual StopReason advance(double t_end,
                             std::int64_t attempts = std::numeric_limits<std::int64_t>::max()) = 0;

  /// As advance(), but a step may go on beyond t, up to `ahead`: what is asked of the world is of t
  /// then, from within the step. A command goes back to t. A world need not make use of it.
  virtual StopReason look(double t, double /*ahead*/) { return advance(t); }

  /// From now on move the rest pose to `target` along a C² profile within the carrier's limits, no
  /// faster than `max_speed` [m/s].
  virtual void setRestTarget(const RestPose& target,
                             double max_speed = std::numeric_limits<double>::infinity()) = 0;
  /// From now on the rest pose goes along a quintic that has the motion `goal` at t_goal: somebody
  /// else moves the carrier, and says so again before that time has passed.
  virtual void followRest(const RestMotion& goal, double t_goal) = 0;
  /// From now on bring the rest pose to a stop within the carrier's limits, no farther than that
  /// takes: see planStop().
  virtual void stopRest() = 0;
  /// How far the rest pose would go on in a stop that began now: translation and rotation vector in
  /// the axes of the carrier frame. [m], [rad]
  virtual Vector6 stopWay() const = 0;
  virtual RestPose rest() const = 0;  ///< at the present time, with the shift

  /// From now on lets the rest pose stand off by `shift` (x, y, z, yaw, theta, phi) from what is
  /// commanded, along a C² profile within the carrier's limits.
  virtual void setRestShift(const Vector6& shift) = 0;
  /// How far the rest pose stands off now: by setRestShift() and by the carrier's compliance.
  virtual Vector6 restShift() const = 0;
  /// The commanded motion is over.
  virtual bool atRest() const = 0;

  /// Exciter from now on. `angle_at` is the force angle law: direction·(frequency·(t − t_ref) +
  /// phase) with t_ref on the world's clock.
  virtual void setExciter(const ExciterParameters& exciter, double t_ref) = 0;

  /// Contacts at the present time. Forces are those of the last evaluation.
  virtual std::array<ContactReport, kSlots> contacts() const = 0;
  /// Wrench of the peg's coupling on sensor_b (contact + weight when at rest), in the axes of the
  /// carrier frame about its origin: force, torque. [N], [N·m]
  virtual Vector6 couplingWrench() const = 0;
  /// Wrench of the peg on the hole block about the origin of `hole` in its axes. [N], [N·m]
  virtual Vector6 holeWrench() const = 0;
  /// Acceleration less gravity of the point of the peg's axis `height` above its centre of mass,
  /// along the peg's x and y: what accelerometers there feel [m/s²].
  virtual Eigen::Vector2d specificForce(double height) const = 0;

  virtual Pose pegPose() const = 0;  ///< X_H,peg: frame `peg` (bottom edge centre) in `hole`
  /// X_H,carrier: coupling rest point with tilt and yaw, in `hole`.
  virtual Pose carrierPose() const = 0;
  /// The same as coordinates: x, y and yaw of the carrier, z and tilt of the rest pose.
  virtual RestPose carrier() const = 0;

 protected:
  World() = default;
  World(const World&) = default;
  World& operator=(const World&) = default;
};

}  // namespace assembly_cell
