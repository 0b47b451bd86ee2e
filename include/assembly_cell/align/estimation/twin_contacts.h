// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <vector>

#include "assembly_cell/align/estimation/twin_sensing.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/twin_force/contact_checks.h"

namespace assembly_cell {

/// Prior of the hole's pose before any contact, sd per axis [m], [rad]: wide enough for
/// starts 15 mm and 2° off, and lines near parallel need one (docs/theory/twin_force.md). Half or
/// twice moves the median error of 30 alignments by 0.01 µm.
inline constexpr double kNominalPositionSd = 0.02, kNominalRotationSd = 0.1;

/// Prior of a hole whose pose is only nominally known: pose of the peg at the start, sd of each
/// axis [m], [rad].
PosePrior nominalPrior(const Pose& X_HP, double position_sd, double rotation_sd);

/// Errors that are left in a carefully measured cell: standard deviations.
/// Six-axis sensors' matrices are good to 1 to 2 % of their range; a level and a vernier measure a
/// frame to 1° and 0.5 mm, as a size; warming sensors drift by a newton a minute; arms repeat to
/// 20 to 50 µm. With a third of these errors in the cell (level 1) and with all (level 2) 100 of
/// 100 align, with twice as many (level 3) it gets worse: docs/results/robustness.md.
struct TwinUncertainty {
  double gain = 0.01;        ///< of every entry of both strain matrices, as in SensorErrors, where
                             ///< their calibrations have none
  double rotation = 0.01;    ///< of a sensor's frame, per axis [rad]
  double offset = 3e-4;      ///< [m]
  double drift = 0.01;       ///< steady, between a zero and its contact; torques at 30 mm [N/s]
  double walk = 6.5e-3;      ///< random, on top of it [N/√s]
  double move = 3e-5;        ///< of the carrier's pose against its encoders, per axis [m]
  double move_angle = 1e-5;  ///< [rad]
};

/// Setup of a cell's dual wrench sensing.
struct TwinForceSetup {
  Mechanism mechanism;       ///< nominal parts
  Pose X_AH;                 ///< hole in sensor_a
  Pose X_CP;                 ///< undeflected peg in the carrier
  TwinForceOptions options;  ///< a prior's pose is the nominal one; a task requires the accuracy
  bool on_plane = true;  ///< contacts are in the hole's plane, which determines the peg's height
  TwinUncertainty uncertainty;
  /// Covariances of the sensors' matrices from their calibrations, see gainCovariance(); 0 × 0: not
  /// known. Where the contacts of a task contradict them, the uncertainty's gain replaces them.
  Eigen::MatrixXd gain_covariance_a, gain_covariance_b;
};

/// Contacts measured by sensor_a and sensor_b, and the pose of the peg in the hole from them. A is
/// `hole`; B is the undeflected `peg`, its reference that of the task. Poses of the carrier are
/// X_SC in the task's frame S, which does not move.
class TwinForceContacts : public TwinForceSensing {
 public:
  explicit TwinForceContacts(const TwinForceSetup& setup);

  /// Replaces those of the setup; for the tasks that begin from now on.
  void setGainCovariances(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

  /// Allocates the memory of a task's contacts.
  void begin(const TwinForceTask& task) override;
  /// Contacts without a zero are taken as they are.
  WindowAnswer tare(const AveragingWindow& free) override;
  /// The rounding of a load hanging free is common to all contacts.
  WindowAnswer add(const AveragingWindow& pressed) override;
  TwinForceSolution solve() override;
  /// By the information matrix: the edge on rim or plane from eight sides, with and without a pull
  /// sideways that friction holds. Needs a pose.
  ReachableContact advise() override;

  const std::vector<TwinContact>& contacts() const { return contacts_; }
  const TwinForceOptions& options() const { return setup_.options; }
  const TwinForceEstimate& estimate() const { return estimate_; }  ///< as of the last solve()
  SignVerdict signs() const { return signs_; }                     ///< of all contacts kept

  /// Pose of the carrier in S.
  Pose carrierPose(const RestPose& carrier) const;
  /// Pose of the peg in S, with the coupling's displacement.
  Pose pegPose(const Pose& X_SC, const Vector6& displacement) const;

 private:
  void fit();
  Pose moveOf(const Pose& X_SC) const;

  TwinForceSetup setup_;
  TwinForceTask task_;
  TwinForceWorkspace workspace_;
  std::optional<Pose> X_SP_;  // of the reference
  struct Zero {
    ContactWindow free;
    double end = 0.0;                               // plant clock of its last block [s]
    Pose X_SC;                                      // carrier
    Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  // against gravity, in S
  };
  std::optional<Zero> zero_;
  double zero_age_ = 0.0;  // the oldest at a contact [s]
  std::vector<TwinContact> contacts_;
  std::vector<Eigen::Vector3d> points_;  // of the lines of action on the peg's bottom, reference
  SignVerdict signs_ = SignVerdict::kUndecided;
  TwinForceEstimate estimate_;
};

}  // namespace assembly_cell
