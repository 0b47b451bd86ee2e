// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Recordings in bursts reduced to averages of equal weight.
#pragma once

#include <vector>

#include "assembly_cell/calibration/reference/reference.h"

namespace assembly_cell {

/// One average: a burst, or a piece of it.
struct ReferenceCell {
  double t = 0.0;                    ///< mean [s]
  std::size_t first = 0, count = 0;  ///< samples
  Eigen::VectorXd raw;               ///< mean
  Vector6 wrench = Vector6::Zero();  ///< mean
  Vector6 slope = Vector6::Zero();   ///< of the wrench [1/s]
};

struct ReferenceCells {
  std::vector<ReferenceCell> cells;
  std::size_t bursts = 0;
  double spacing = 0.0;  ///< of samples, median [s]
  bool tared = false;
  Eigen::VectorXd raw_tare;
  Vector6 wrench_tare = Vector6::Zero();
};

ReferenceCells cellsOf(const ReferenceRun& run);

/// Wrench of the reference at t, tare taken off: on the line through the nearest cell.
Vector6 referenceAt(const ReferenceCells& run, std::size_t nearest, double t);

constexpr double kLagRange = 0.1;  // [s] longer than the delay of a sensor's filter
// cells a coefficient: with fewer the error of a run left out is meaningless
constexpr double kCellsPerCoefficient = 3.0;

/// A run with its averages.
struct ReferenceAverages {
  const ReferenceRun* run;
  ReferenceCells cells;
};

/// Throws InputError for runs that are not of one set-up.
void checkReferenceRuns(const std::vector<ReferenceAverages>& runs);

/// Fills gates and `accepted` of a solution that is otherwise complete.
void evaluateReference(const std::vector<ReferenceAverages>& runs,
                       const ReferenceAverages* hold_out, ReferenceSolution& out);

}  // namespace assembly_cell
