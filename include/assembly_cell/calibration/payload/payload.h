// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/common/failure.h"
#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// The axes in which a recording gives its wrenches (always about the sensor's origin).
enum class WrenchAxes { kAuto, kBase, kSensor };
const char* toString(WrenchAxes axes);  ///< auto, base, sensor

/// One static pose under gravity.
struct StaticPose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();  ///< R_BS: sensor axes seen in base axes
  double order = 0.0;  ///< when it was taken: number of the pose, or any time that rises
  double temperature = std::numeric_limits<double>::quiet_NaN();  ///< [°C], NaN: unknown
};

/// How a bias component runs through one recording (between two breaks).
enum class DriftShape {
  kNone,
  kLinear,      ///< a straight line in each recording
  kRandomWalk,  ///< steps of unknown size at each pose, best linear prediction in between
  kSmooth,      ///< line plus integrated random walk: a cubic smoothing spline
};
const char* toString(DriftShape shape);  ///< none, linear, random_walk, smooth

struct PayloadOptions {
  WrenchAxes axes = WrenchAxes::kAuto;
  bool drift = true;                   ///< false: constant bias in each recording
  bool breaks = true;                  ///< false: one recording
  bool outliers = true;                ///< false: keep every pose
  bool in_situ = false;                ///< correction matrix
  std::optional<double> known_weight;  ///< [N] fixes the scale of the correction matrix
};

/// One component of the bias in sensor axes: b(t) = level of the recording + drift, white noise on
/// top. Filled by identifyPayload; what predictWrench needs is in here.
struct BiasComponent {
  DriftShape shape = DriftShape::kNone;
  bool temperature = false;  ///< has a temperature coefficient (first after the three shared)
  double ratio = 0.0;        ///< drift variance per unit of order over the noise's variance
  double noise = 0.0;        ///< sd of one reading [N] or [N·m]
  double drift_gain = 0.0;   ///< log likelihood ratio ×2 against no drift
  int first_effect = 0;      ///< index of its own effects in BiasGroup::effects
  int own_effects = 0;
  Eigen::MatrixXd whitener;  ///< n × n lower triangular, L⁻¹ with L Lᵀ = V / noise²
  Eigen::VectorXd weighted;  ///< V⁻¹ (y − X effects) noise²
  Eigen::MatrixXd design;    ///< n × all effects
};

/// Three components of force (shared effects: weight vector in base axes) or of torque (shared:
/// centre of mass in sensor axes).
struct BiasGroup {
  std::array<BiasComponent, 3> component;
  Eigen::VectorXd effects;
  Eigen::MatrixXd covariance;
};

/// A jump of the bias where a new recording begins.
struct BiasBreak {
  std::size_t pose = 0;            ///< first pose after it
  double order = 0.0;              ///< its order
  Vector6 jump = Vector6::Zero();  ///< in sensor axes, from the last pose before to the first after
  Vector6 jump_sd = Vector6::Zero();
  double gain = 0.0;  ///< criterion's gain over its threshold and all it costs
};

struct DriftSize {
  double change = 0.0, sd = 0.0;  ///< from the first to the last pose of a recording
};

/// Structure in a sequence of residuals: first-order serial correlation and Wald–Wolfowitz runs of
/// signs, each with its two-sided p value (normal approximation).
struct SequenceTest {
  double lag1 = 0.0, lag1_p = 1.0, runs_p = 1.0;
};
SequenceTest testSequence(const std::vector<double>& residuals);

struct ForceTorque {
  double force = 0.0, torque = 0.0;
};

struct InSituCorrection {
  bool given = false;
  std::string reason;                    ///< why not, or what it rests on
  Matrix6 matrix = Matrix6::Identity();  ///< w_corrected = matrix (w_measured − bias)
  double p = 1.0;                        ///< of no correction
  double largest_sd = 0.0;               ///< of the elements of the force block
};

/// Payload and bias: f = R_BSᵀ g + b_f(t), τ = c × (R_BSᵀ g) + b_τ(t) in sensor axes.
struct PayloadModel {
  CalibrationRefusal refusal;  ///< none: identified
  WrenchAxes axes = WrenchAxes::kBase;
  double base_residual = 0.0,
         sensor_residual = 0.0;  ///< median held-out |force| error of either reading
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< g: weight vector in base axes [N]
  Eigen::Matrix3d gravity_covariance = Eigen::Matrix3d::Zero();
  double weight = 0.0, weight_sd = 0.0;                      ///< |g| [N]
  Eigen::Vector3d center_of_mass = Eigen::Vector3d::Zero();  ///< c, sensor axes [m]
  Eigen::Matrix3d center_covariance = Eigen::Matrix3d::Zero();
  Vector6 bias = Vector6::Zero(), bias_sd = Vector6::Zero();  ///< mean over the poses, sensor axes
  Vector6 last_bias = Vector6::Zero(), last_bias_sd = Vector6::Zero();  ///< at the last pose

  std::array<BiasGroup, 2> group;  ///< force, torque
  std::vector<std::size_t> used;   ///< poses that the fit rests on
  std::vector<std::size_t> rejected;
  std::vector<double> order;        ///< of the used poses
  std::vector<std::size_t> starts;  ///< first used pose of each recording, starts[0] = 0
  std::vector<BiasBreak> breaks;
  std::array<std::vector<DriftSize>, 6> drift;  ///< by axis and recording
  double temperature_mean = 0.0;                ///< NaN where unknown
  Vector6 temperature_coefficient = Vector6::Zero(), temperature_sd = Vector6::Zero();
  bool has_temperature = false;

  ForceTorque plain_rms, rms;  ///< per component: with a constant bias, with drift and breaks
  ForceTorque held_out_rms;    ///< leave-one-out, used poses
  std::vector<Vector6> residual, held_out;  ///< of the used poses, sensor axes
  std::array<SequenceTest, 6> plain_test, final_test;
  bool structure_tested = false;  ///< false: too few poses to look for drift and breaks
  InSituCorrection in_situ;
};

/// Identifies payload and bias from static poses, looks for drift, breaks and outliers and models
/// what is significant. Refusals (`refusal`): gravity's directions in sensor axes do not determine
/// the weight, neither reading of the axes fits better, too few poses, readings without a weight.
/// Throws InputError for sizes that disagree, non-finite values or an order that does not rise.
PayloadModel identifyPayload(const std::vector<StaticPose>& poses,
                             const std::vector<Vector6>& wrenches, const PayloadOptions& options);

/// A base tilted by less counts as level [rad]: accuracy of a spirit level, with margin for
/// residuals that aren't white. Half and twice give the same results for the recordings.
constexpr double kLevelBase = 0.02;

/// The payload by ordinary least squares of all poses with a constant bias, as it is commonly
/// published; gravity along the base's z where the base is level.
struct PlainPayload {
  bool level = false;                                 ///< gravity was taken along z
  double level_p = 1.0;                               ///< of a level base, F test
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< weight in base axes [N]
  double weight_sd = 0.0;
  Eigen::Vector3d center_of_mass = Eigen::Vector3d::Zero(), center_sd = Eigen::Vector3d::Zero();
  Vector6 bias = Vector6::Zero(), bias_sd = Vector6::Zero();
};
/// wrenches: in sensor axes, one a pose. For poses that identifyPayload accepts.
PlainPayload plainPayload(const std::vector<StaticPose>& poses,
                          const std::vector<Vector6>& wrenches);

/// Wrenches in sensor axes from those of a recording in `axes`.
std::vector<Vector6> inSensorAxes(const std::vector<StaticPose>& poses,
                                  const std::vector<Vector6>& wrenches, WrenchAxes axes);

/// Wrench of a further reading and its sd (noise included), in the recording's axes. A pose between
/// the last of one recording and the first of the next belongs to the earlier one. Throws
/// InputError for a model that was refused.
struct PredictedWrench {
  Vector6 wrench = Vector6::Zero();
  Vector6 sd = Vector6::Zero();
};
PredictedWrench predictWrench(const PayloadModel& model, const StaticPose& pose);

/// Bias at a time, sensor axes: what predictWrench adds to the weight.
PredictedWrench predictBias(const PayloadModel& model, double order, double temperature);

}  // namespace assembly_cell
