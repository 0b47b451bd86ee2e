// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "assembly_cell/align/estimation/averaging_window.h"
#include "assembly_cell/twin_force/pose_estimate.h"

namespace assembly_cell {

/// Task of the following contacts.
struct TwinForceTask {
  Pose X_BS;                        ///< frame S of all poses of the carrier, in the carrier's base
  std::optional<Pose> reference;    ///< X_SC that the pose refers to; none: of the first contact
  double contact_force = 15.0;      ///< of the advised contacts [N]
  double contact_tilt = 0.052;      ///< of the peg against the plane there [rad]
  double settled_force = 0.02;      ///< halves of a window that differ by more are refused [N]
  double required_position = 3e-5;  ///< sd that is enough, per axis [m]
  double required_rotation = 1e-3;  ///< [rad]
  std::size_t capacity = 64;        ///< contacts that can be kept
};

/// Result of a window.
struct WindowAnswer {
  std::string refusal;          ///< why it was refused, one phrase; empty: accepted
  bool signs_reversed = false;  ///< one sensor reports the opposite sign
  double force = 0.0;           ///< of the contact [N]
};

/// Pose of the peg in the hole, as far as the contacts determine it.
struct TwinForceSolution {
  TwinForceStatus status = TwinForceStatus::kRefuseTooFew;
  std::string reason;                    ///< why the status is not OK
  Pose X_HP;                             ///< at the reference; if hasPose(status)
  Matrix6 covariance = Matrix6::Zero();  ///< of δ, see TwinForceEstimate
  double chi2 = 0.0;
  int dof = 0;
  double smallest_eigenvalue = 0.0;  ///< of the scaled information; 1 is just as good as required
};

/// A contact that the carrier can make: the undeflected peg at the touch, then a pull sideways.
struct ReachableContact {
  Pose X_HP;
  Eigen::Vector3d pull = Eigen::Vector3d::Zero();   ///< axes of hole [N]
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< expected on the peg, axes of hole [N]
  double smallest_eigenvalue = 0.0;                 ///< expected with it
  double position_sd = 0.0, rotation_sd = 0.0;      ///< expected, 3 axes; ∞ if unobservable then
};

/// Dual wrench sensing for a strategy: in the same process, or the node twin_force_estimator. Keeps
/// contacts and advises; never moves the carrier. Calls throw PlantError without a response.
class TwinForceSensing {
 public:
  virtual ~TwinForceSensing() = default;
  /// Drops contacts and zero.
  virtual void begin(const TwinForceTask& task) = 0;
  /// The peg hangs free: the zero of both sensors from here on, weight included.
  virtual WindowAnswer tare(const AveragingWindow& free) = 0;
  /// Keeps a contact.
  virtual WindowAnswer add(const AveragingWindow& pressed) = 0;
  virtual TwinForceSolution solve() = 0;
  /// The contact within reach with the most information, with the pose of the last solve().
  virtual ReachableContact advise() = 0;
};

/// Peg with the coupling deflected, relative to the undeflected one. X_CP: of the undeflected peg
/// in the carrier; displacement: x y z [m], rotation vector [rad], carrier axes.
Pose deflectedPeg(const Pose& X_CP, const Vector6& displacement);

/// Covariance of the hole's centre and height in hole axes, against the reference peg. [m²]
Eigen::Matrix3d centerCovariance(const TwinForceSolution& solution);

}  // namespace assembly_cell
