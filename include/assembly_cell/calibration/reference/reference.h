// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A sensor's map against a reference sensor in series, from recordings of both under any loads.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/base/table.h"
#include "assembly_cell/calibration/common/gate.h"
#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/sensor/calibration.h"

namespace assembly_cell {

/// One recording: raw channels and the reference's wrench, sample by sample.
struct ReferenceRun {
  std::string name;
  std::string time_unit;   ///< of the file, and why
  std::vector<double> t;   ///< rising [s]
  Eigen::MatrixXd raw;     ///< samples × n ≥ 6 channels, any unit
  Eigen::MatrixXd wrench;  ///< samples × 6 of the reference [N], [N m]
};

/// Columns t, ch1 … chN (also raw1 …, s1 …), fx fy fz tx ty tz by name; without a header that order
/// with `channels` raw ones, further columns are passed over. Times as readTimes(). Throws
/// InputError naming file, line and column.
ReferenceRun readReferenceRun(const std::string& path, int channels = 6,
                              TimeUnit unit = TimeUnit::kFound);

/// wrench(t) = map of the tared raw readings at t + lag.
enum class ReferenceModel {
  kLinear,
  kSquares,   ///< and the square of each channel
  kQuadratic  ///< and all products of two channels
};
constexpr ReferenceModel kReferenceModels[] = {ReferenceModel::kLinear, ReferenceModel::kSquares,
                                               ReferenceModel::kQuadratic};
const char* toString(ReferenceModel model);  ///< linear, squares, quadratic

struct ReferenceOptions {
  std::optional<ReferenceModel> model;  ///< none: the one that predicts a run left out best
  std::optional<double> lag;            ///< none: estimated [s]
};

/// Rms of a component over force and torque, and of each.
struct ReferenceError {
  double force = 0.0, torque = 0.0;  ///< [N], [N m]
  Vector6 axis = Vector6::Zero();
};

/// Results of one run: its tare and residuals.
struct ReferenceRunResult {
  std::string name, time_unit;
  std::size_t samples = 0, bursts = 0;
  bool tared = false;  ///< false: never unloaded, its first reading counts as zero
  Eigen::VectorXd raw_tare;
  Vector6 wrench_tare = Vector6::Zero();
  Vector6 offset = Vector6::Zero(), offset_sd = Vector6::Zero();  ///< mean left over
  Vector6 drift = Vector6::Zero(), drift_sd = Vector6::Zero();    ///< its change over the run
  ReferenceError error;                                           ///< of every sample
};

struct ReferenceSolution {
  ReferenceModel model = ReferenceModel::kLinear;
  double lag = 0.0, lag_sd = 0.0;  ///< raw after reference [s]
  Eigen::MatrixXd map;             ///< 6 × n
  Eigen::MatrixXd products;        ///< 6 × n(n+1)/2 of s1s1 s1s2 …; 0 × 0 for the linear model
  Eigen::MatrixXd covariance;      ///< of the rows' coefficients, row after row
  int coefficients = 0;            ///< of a row that were fitted
  std::size_t cells = 0;           ///< readings that count: averages over bursts
  Vector6 residual_sd = Vector6::Zero();  ///< of a cell
  std::vector<ReferenceRunResult> runs;   ///< the fit rests on
  std::optional<ReferenceRunResult> hold_out;
  /// Error of runs left out, by model in the order of kReferenceModels: of the hold-out run, or of
  /// each run in turn.
  std::vector<ReferenceError> left_out;
  ReferenceError plain;  ///< of the same run left out by ordinary least squares of all samples,
                         ///< with an offset: no tare, no lag
  std::vector<Gate> gates;
  bool accepted = false;
};

/// Averages bursts (and pieces of what has no gaps) to cells, tares each run by its unloaded cells,
/// estimates lag and map together by Huber's M-estimate, and checks the model against a run left
/// out. Throws InputError: one run and none held out, another number of channels, a rate or
/// duration that is out of place.
ReferenceSolution solveReference(const std::vector<ReferenceRun>& runs,
                                 const ReferenceRun* hold_out, const ReferenceOptions& options);

/// As a calibration of the driver, volts being the raw unit; for six channels. Throws InputError
/// for another number.
Calibration referenceCalibration(const ReferenceSolution& solution,
                                 const std::vector<ReferenceRun>& runs);

}  // namespace assembly_cell
