// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/align/plant.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Tolerance of a free peg's force against its tare, default cell [N]
inline constexpr double kFreeForce = 1.0;

/// Growth of that tolerance: sensors that warm up drift by 3 N a minute and axis [N/s]
inline constexpr double kZeroDrift = 0.09;

/// Zero of sensor_b: means while the peg hangs free at rest.
struct Tare {
  Vector6 wrench = Vector6::Zero();        ///< sensor_b axes [N], [N·m]
  Vector6 displacement = Vector6::Zero();  ///< of the coupling, sensor_b axes [m], [rad]
  Matrix6 scatter = Matrix6::Zero();       ///< covariance of one sample of the wrench
  RestPose pose;                           ///< of the carrier
  double time = 0.0;                       ///< plant clock [s]
};

/// The weight that turns with the carrier.
struct PegWeight {
  PegParameters peg;
  double gravity = 0.0;               ///< [m/s²]
  Eigen::Vector3d up{0.0, 0.0, 1.0};  ///< see Mechanism
};

/// Contact force as sensor_b measures it: the wrench of the latest block less the latest tare and
/// less the change of the peg's weight, which turns with the carrier. The first tare is the
/// reference for whether the peg is free. Without a mass the weight is as at the tare, always.
class ContactSensor {
 public:
  /// `force_scale`: see Scale::force.
  ContactSensor(const PegWeight& weight, double force_scale);

  void update(const PlantBlock& block) { last_ = block; }
  const PlantBlock& last() const { return last_; }

  /// A new zero, of blocks up to the latest one; it is the first one where isTared() is false.
  void setTare(const Tare& tare);
  /// The next tare counts as the first one.
  void clearTare() { tared_ = false; }
  bool isTared() const { return tared_; }
  const Tare& tare() const { return tare_; }

  /// Contact wrench, sensor_b axes about its origin. [N], [N·m]
  Vector6 wrench() const;
  /// Contact force, sensor_b axes [N]
  Eigen::Vector3d force() const { return wrench().head<3>(); }
  /// Deflection of the coupling since the tare, sensor_b axes. [m], [rad]
  Vector6 deflection() const { return last_.displacement_b - tare_.displacement; }

  /// Force that counts as a touch: that of the scale, or five sd of a block's noise [N]
  double touchForce() const { return touch_; }
  /// Force since the first tare, of a peg that should be free [N]
  double heldForce() const;
  /// Force of the latest tare against the first [N]
  double tareShift() const;
  double freeForce() const { return kFreeForce * force_scale_; }  ///< of this peg [N]
  /// Tolerance of a free peg's force against the first tare, with the drift since [N]
  double freeShift() const { return freeForce() + kZeroDrift * (last_.time - first_.time); }
  /// Change of a block's force from the block before that noise alone explains [N]
  double noiseChange() const;
  /// Alarm at a contact force of `force`, or `sideways` of it in x and y [N].
  ForceAlarm alarmAt(double force, double sideways) const;

 private:
  /// Change of the weight in carrier axes since a pose.
  Vector6 weightChange(const RestPose& from) const;

  PegWeight weight_;
  double force_scale_;
  PlantBlock last_;
  Tare tare_, first_;
  double touch_;
  bool tared_ = false;
};

}  // namespace assembly_cell
