// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/plant.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Change of force since the tare up to which a peg counts as free, default cell [N]
inline constexpr double kFreeForce = 1.0;

/// Growth of that tolerance with the tare's age: a sensor that warms up drifts by 3 N a minute in
/// each axis [N/s]
inline constexpr double kZeroDrift = 0.09;

/// Zero of sensor_b: means over some blocks while the peg hangs free and at rest.
struct Tare {
  Vector6 wrench = Vector6::Zero();        ///< sensor_b axes [N], [N·m]
  Vector6 displacement = Vector6::Zero();  ///< of the coupling, sensor_b axes [m], [rad]
  Matrix6 scatter = Matrix6::Zero();       ///< covariance of one sample of the wrench
  RestPose pose;                           ///< of the carrier
  double time = 0.0;                       ///< plant clock [s]
};

/// What the peg's weight in sensor axes follows from.
struct PegWeight {
  PegParameters peg;
  double gravity = 0.0;               ///< [m/s²]
  Eigen::Vector3d up{0.0, 0.0, 1.0};  ///< see Mechanism
};

/// Contact force from sensor_b: the wrench of the latest block minus the latest tare and minus the
/// change of the peg's weight in sensor axes, which rotate with the carrier. The first tare is the
/// reference for whether the peg is free. With an unknown mass (0) no change of weight is computed.
class ContactSensor {
 public:
  /// `force_scale`: see Scale::force.
  ContactSensor(const PegWeight& weight, double force_scale);

  void update(const PlantBlock& block) { last_ = block; }
  const PlantBlock& last() const { return last_; }

  /// Sets a zero of blocks up to the latest one. It becomes the first tare where there is none.
  void setTare(const Tare& tare);
  /// Makes isTared() false. The next tare becomes the reference for whether the peg is free.
  void clearTare() { tared_ = false; }
  bool isTared() const { return tared_; }
  const Tare& tare() const { return tare_; }

  /// Contact wrench, sensor_b axes about its origin. [N], [N·m]
  Vector6 wrench() const;
  /// Contact force, sensor_b axes [N]
  Eigen::Vector3d force() const { return wrench().head<3>(); }
  /// Deflection of the coupling since the tare, sensor_b axes. [m], [rad]
  Vector6 deflection() const { return last_.displacement_b - tare_.displacement; }

  /// Force that counts as a touch: that of the scale, five sd of a block's noise at least [N]
  double touchForce() const { return touch_; }
  /// Magnitude of the force since the first tare, of a peg that should be free [N]
  double heldForce() const;
  /// Magnitude of the latest tare's force minus the first one's [N]
  double tareShift() const;
  double freeForce() const { return kFreeForce * force_scale_; }  ///< kFreeForce for this peg [N]
  /// freeForce() plus the drift that is possible since the first tare [N]
  double freeShift() const { return freeForce() + kZeroDrift * (last_.time - first_.time); }
  /// Largest change of force from block to block that noise alone explains [N]
  double noiseChange() const;
  /// Alarm at a contact force of `force`, or of `sideways` in x and y [N].
  ForceAlarm alarmAt(double force, double sideways) const;

 private:
  /// Change of the weight's wrench, sensor_b axes, since a pose of the carrier.
  Vector6 weightChange(const RestPose& from) const;

  PegWeight weight_;
  double force_scale_;
  PlantBlock last_;
  Tare tare_, first_;
  double touch_;
  bool tared_ = false;
};

}  // namespace assembly_cell
