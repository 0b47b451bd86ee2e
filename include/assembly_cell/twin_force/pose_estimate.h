// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

// Pose of component B in component A from the wrenches measured on both (thesis chapter 10,
// corrected). Frames A and B are the components' datum frames, b is B's datum at one contact, B at
// the reference contact. Pose errors are δ = (dT, dφ): T_true = T + dT, R_true = exp([dφ]) R, both
// in axes of A; covariances use this order. [m], [rad]

using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

/// One contact: w_A + Φ(X_AB) Φ(X_Bb) w_b = 0. Wrenches act ON the part that the sensor carries,
/// force before moment, tare and gravity removed at the present orientation. [N], [N·m]
struct TwinContact {
  Vector6 wrench_a = Vector6::Zero();          ///< on A, about A's origin, axes of A
  Vector6 wrench_b = Vector6::Zero();          ///< on B, about B's origin, axes of b
  Matrix6 covariance_a = Matrix6::Identity();  ///< covariance of wrench_a, full [N², N²·m, N²·m²]
  Matrix6 covariance_b = Matrix6::Identity();  ///< covariance of wrench_b, full
  Pose move;  ///< X_Bb: B at this contact in axes of the reference B
  std::optional<Matrix6>
      move_covariance;           ///< covariance of move as a twist (dt, dφ) at O_B, axes of B
  double time_difference = 0.0;  ///< between the two wrenches [s]
  bool moving = false;           ///< B moved while the wrenches were measured
  bool saturated = false;        ///< an ADC channel was at its limit
  double tare_age = 0.0;         ///< time since the older tare [s]
};

/// Prior of X_AB. Standard deviations of 10 mm and 0.1 rad per axis suffice where lines of action
/// may be within 10° of parallel.
struct PosePrior {
  Pose pose;
  Matrix6 covariance = Matrix6::Identity();  ///< covariance of δ
};

/// Standard deviations of the errors of a sensor's calibration and mounting: independent, mean 0,
/// the same in all contacts.
struct SensorErrors {
  Pose frame;             ///< nominal pose of the sensor in the component's datum
  double gain = 0.0;      ///< sd of each entry of E in w' = (I + E) w, in axes of the sensor
  double arm = 0.03;      ///< conversion of torques to forces there [m]
  double rotation = 0.0;  ///< sd of the rotation of the sensor's frame, per axis [rad]
  double offset = 0.0;    ///< sd of its origin, per axis [m]
  /// Covariance of the entries of E in row-major order, SI units, 36 × 36, semidefinite; replaces
  /// gain and arm. 0 × 0: none.
  Eigen::MatrixXd gain_covariance;
};
struct TwinErrors {
  SensorErrors a, b;
};

enum class TwinForceMethod { kThesis, kRobust, kMaximumLikelihood };

struct TwinForceOptions {
  TwinForceMethod method = TwinForceMethod::kMaximumLikelihood;
  std::optional<PosePrior> prior;
  std::optional<Matrix12>
      tare_covariance;  ///< covariance of an offset (w_A, w_b) common to all contacts,
                        ///< mean 0; semidefinite; maximum likelihood only
  /// Errors of both sensors, for maximum likelihood only. Contacts that are consistent without
  /// sensor errors are estimated without them.
  std::optional<TwinErrors> errors;
  double required_position = 1e-3;  ///< s_T: required accuracy per axis [m]
  double required_rotation = 1e-2;  ///< s_φ [rad]
  double smallest_p = 1e-3;         ///< minimum probability of χ² of consistent contacts
  bool remove_outliers = true;      ///< robust and maximum likelihood
  double oldest_tare =
      std::numeric_limits<double>::infinity();  ///< maximum TwinContact::tare_age [s]
};

enum class TwinForceStatus {
  kOk,                  ///< accuracy as required in every direction
  kWeak,                ///< usable with its covariance; see next_contact.h
  kDegenerate,          ///< observable part only; null_directions have infinite variance
  kRefuse,              ///< non-finite, saturated, stale tare, not simultaneous: no pose
  kRefuseTooFew,        ///< fewer than 2 contacts with enough force: no pose
  kRefuseSingular,      ///< thesis form beyond its limits: no pose
  kRefuseInconsistent,  ///< p(χ²) too small after removal: no pose
};

/// OK, WEAK, DEGENERATE, REFUSE, REFUSE_TOO_FEW, REFUSE_SINGULAR, REFUSE_INCONSISTENT.
const char* toString(TwinForceStatus status);
bool hasPose(TwinForceStatus status);  ///< kOk, kWeak, kDegenerate

struct TwinForceEstimate {
  TwinForceStatus status = TwinForceStatus::kRefuseTooFew;
  const char* reason = "";  ///< reason if the status is not OK; static text
  int culprit = -1;         ///< contact that caused a REFUSE; −1: none
  Pose pose;                ///< X_AB; meaningful if hasPose(status)
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< rotation of `pose`, w ≥ 0
  Matrix6 covariance =
      Matrix6::Zero();  ///< covariance of δ over the observable directions, always finite
  /// Variance of each component of δ; infinite if a null direction contributes to it.
  Vector6 variance = Vector6::Constant(std::numeric_limits<double>::infinity());
  Matrix6 information = Matrix6::Zero();  ///< Fisher information, prior included; finite
  double chi2 = 0.0;
  int dof = 0;
  double p = 0.0;  ///< probability of a larger χ²
  Vector6 eigenvalues =
      Vector6::Zero();  ///< eigenvalues of Λ = S I S, ascending; 1: accuracy exactly as required
  Vector6 scale = Vector6::Ones();           ///< diagonal of S: s_T three times, s_φ three times
  Vector6 weak_direction = Vector6::Zero();  ///< unit eigenvector of the smallest: δ/(s_T, s_φ)
  Matrix6 null_directions =
      Matrix6::Zero();  ///< first null_count columns, scaled as weak_direction
  int null_count = 0;
  std::vector<int> rejected;         ///< contacts removed as outliers, ascending, zero-based
  std::vector<int> too_light;        ///< contacts without enough force
  bool unconfirmed = false;          ///< 3 contacts, one rejected: no redundancy left
  bool opposed_signs = false;        ///< consistent with the sign of one sensor reversed
  Vector12 tare = Vector12::Zero();  ///< estimated offset, with tare_covariance
  /// With errors, for the next contact: the unknowns besides the pose are −slope δ + rest, rest
  /// independent of δ. Empty otherwise.
  Eigen::MatrixXd error_slope, error_rest;
  int iterations = 0;
};

/// Covariance for messages and files: variance on the diagonal; rows and columns of components with
/// infinite variance are 0 elsewhere.
Matrix6 coordinateCovariance(const TwinForceEstimate& estimate);

/// Memory for up to `capacity` contacts. estimatePose does not allocate, except with errors of the
/// sensors as unknowns.
class TwinForceWorkspace {
 public:
  explicit TwinForceWorkspace(std::size_t capacity);
  ~TwinForceWorkspace();
  TwinForceWorkspace(TwinForceWorkspace&&) noexcept;
  TwinForceWorkspace& operator=(TwinForceWorkspace&&) noexcept;
  struct Memory;
  Memory& memory() { return *memory_; }

 private:
  std::unique_ptr<Memory> memory_;
};

/// Estimates X_AB at the reference. The result is in the workspace and valid until the next call.
/// Throws InputError for covariances that are not finite, symmetric and positive definite, naming
/// them
/// (`contacts[2].covariance_b`), options out of range and more contacts than the workspace holds;
/// non-finite wrenches, moves and times give kRefuse with the contact as culprit.
const TwinForceEstimate& estimatePose(const std::vector<TwinContact>& contacts,
                                      const TwinForceOptions& options,
                                      TwinForceWorkspace& workspace);

/// Checks a covariance of 6 components. Throws InputError with `name`, the fault and the remedy.
void checkCovariance(const Matrix6& covariance, const std::string& name, bool semidefinite = false);

}  // namespace assembly_cell
