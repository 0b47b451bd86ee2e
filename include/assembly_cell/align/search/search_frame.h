// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Frame S of a search: the carrier's frame (origin: coupling point) at the start, as its encoders
/// report it; and the kinematics from the carrier to the peg in S. Identity before startAt().
class SearchFrame {
 public:
  explicit SearchFrame(const Mechanism& mechanism);

  /// S is the carrier's pose here. time: plant clock [s]
  void startAt(const RestPose& carrier, double time);
  bool isStarted() const { return started_; }
  const RestPose& start() const { return start_; }  ///< of the carrier, in its base
  double time() const { return time_; }             ///< of startAt(), plant clock; 0 before [s]
  const Pose& X_BS() const { return X_BS_; }        ///< S in the carrier's base
  double length() const { return length_; }         ///< coupling to the peg's bottom edge [m]

  /// Carrier in S.
  Pose carrierPose(const RestPose& carrier) const { return inverse(X_BS_) * poseFromRest(carrier); }
  /// Frame `peg` in S, from the carrier's pose and the coupling's deflection [m], [rad].
  Pose pegPose(const RestPose& carrier, const Vector6& deflection) const;
  /// Rest pose whose undeflected peg has its bottom centre at p and its axes along R, in S.
  RestPose restFor(const Eigen::Vector3d& p, const Eigen::Matrix3d& R) const;
  /// Deflection of the coupling under the weight of the free peg. [m], [rad]
  Vector6 sag(const RestPose& carrier) const;
  /// Contact wrench at the centre of the bottom edge, peg axes, from the contact wrench in
  /// sensor_b axes; the weight turns with the deflection as well. [N], [N·m]
  Vector6 tipWrench(const RestPose& carrier, const Vector6& wrench,
                    const Vector6& deflection) const;

 private:
  const Mechanism& mechanism_;
  double length_;
  Pose X_BS_;
  RestPose start_;
  double time_ = 0.0;
  bool started_ = false;
};

/// Rotation that tilts z by a rotation vector (x, y).
Eigen::Matrix3d tiltRotation(const Eigen::Vector2d& tilt);
/// Smallest rotation that takes z to n.
Eigen::Matrix3d rotationToAxis(const Eigen::Vector3d& n);
/// Rotation vector (x, y) of the smallest rotation that takes z to the axis.
Eigen::Vector2d axisTilt(const Eigen::Vector3d& axis);

}  // namespace assembly_cell
