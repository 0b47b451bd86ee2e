// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <vector>

#include "assembly_cell/align/contact_window.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/twin_force/next_contact.h"

namespace assembly_cell {

/// What the cell's twin-force sensing is made of.
struct TwinForceSetup {
  Mechanism mechanism;          ///< nominal parts
  Pose X_AH;                    ///< hole in sensor_a
  Pose X_CP;                    ///< undeflected peg in the carrier
  TwinForceOptions options;     ///< a prior's pose is the nominal one
  bool on_plane = true;         ///< contacts lie in the hole's plane, which tells the peg's height
  double contact_force = 15.0;  ///< of the contacts to come [N]
  double contact_tilt = 0.052;  ///< of the peg against the plane there [rad]
  double move_sd = 1e-6;        ///< of the known moves [m]
  double move_angle_sd = 1e-5;  ///< [rad]
  std::size_t capacity = 64;    ///< contacts that can be kept
};

/// Prior of a hole whose place is only nominally known: pose of the peg at the start, sd of each
/// axis [m], [rad].
PosePrior nominalPrior(const Pose& X_HP, double position_sd, double rotation_sd);

/// A contact that the carrier can make: the undeflected peg at the touch, then a pull sideways.
struct ReachableContact {
  Pose X_HP;
  Eigen::Vector3d pull = Eigen::Vector3d::Zero();   ///< axes of hole [N]
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< to be felt by the peg, axes of hole [N]
};

/// Contacts felt by sensor_a and sensor_b, and the pose of the peg in the hole from them. A is
/// `hole`; B is the undeflected `peg`, its reference is the first pose given. Poses of the carrier
/// are X_SC in any frame S that does not move.
class TwinForceContacts {
 public:
  /// Throws InputError for options out of range.
  explicit TwinForceContacts(const TwinForceSetup& setup);

  void clear();  ///< forgets contacts, tare and reference

  /// The reference pose; otherwise that of the first contact.
  void setReference(const Pose& X_SC);
  /// Hanging free: the zero of both sensors from here on, weight included. Contacts made without
  /// are taken as they are.
  void tare(const ContactWindow& free, const Pose& X_SC);
  /// Keeps a contact. The rounding of a load hanging free is common to all contacts.
  const TwinContact& add(const ContactWindow& pressed, const Pose& X_SC, const Matrix6& rounding_a,
                         const Matrix6& rounding_b);
  std::size_t size() const { return contacts_.size(); }
  bool full() const { return contacts_.size() >= setup_.capacity; }
  const std::vector<TwinContact>& contacts() const { return contacts_; }
  const TwinForceOptions& options() const { return setup_.options; }

  /// Pose of the peg at the reference. X_AB of the estimate is X_HP.
  const TwinForceEstimate& solve();
  const TwinForceEstimate& estimate() const { return estimate_; }

  /// Peg with the coupling deflected, relative to the undeflected one.
  Pose deflected(const Vector6& displacement) const;
  /// Of the peg now, deflection included; needs a pose.
  Pose pegPose(const Pose& X_SC, const Vector6& displacement) const;
  /// Covariance of the hole's centre and height in hole axes, against the reference peg. [m²]
  Eigen::Matrix3d centerCovariance() const;

  /// Next contact by the information matrix, of those within reach: the edge on rim or plane from
  /// eight sides, with and without a pull sideways that friction holds. Needs a pose.
  ContactAdvice advise(ReachableContact& best) const;

 private:
  Pose moveOf(const Pose& X_SC) const;
  Eigen::Vector3d touchPoint(const Pose& X_HP) const;

  TwinForceSetup setup_;
  Pose X_HA_, X_PC_;
  TwinForceWorkspace workspace_;
  bool referenced_ = false, tared_ = false;
  Pose X_SP_;  // of the reference
  ContactWindow free_;
  Pose X_SC_free_;
  Eigen::Vector3d up_ = Eigen::Vector3d::UnitZ();  // against gravity, in S
  std::vector<TwinContact> contacts_;
  std::vector<Eigen::Vector3d> points_;  // of the lines of action on the peg's bottom, reference
  TwinForceEstimate estimate_;
};

}  // namespace assembly_cell
