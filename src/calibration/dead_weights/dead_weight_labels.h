// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

#include "assembly_cell/calibration/dead_weights/dead_weights.h"

namespace assembly_cell {

/// Labelled rows as a linear model Y = A C.
struct LabelledRows {
  const std::vector<DeadWeight>& rows;
  const std::vector<std::size_t>& block;
  const std::vector<std::size_t>& labelled;
  const Eigen::MatrixXd& A;  ///< a row for each labelled one
  const Eigen::MatrixXd& Y;  ///< its label
};

/// Labels that contradict a robust fit of the other rows.
std::vector<WrongLabel> wrongLabels(const LabelledRows& data);

/// What speaks against readings, units or loads as a whole, one line each; empty where nothing
/// does.
std::vector<std::string> deadWeightDoubts(const std::vector<DeadWeight>& rows,
                                          const DeadWeightSolution& solution);

}  // namespace assembly_cell
