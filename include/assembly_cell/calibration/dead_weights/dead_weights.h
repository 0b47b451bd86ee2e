// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Calibration of a six-axis sensor with dead weights, robust against wrong labels.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// A reading and the load that the person noted for it: force before moment about the sensor's
/// origin. The reading is a wrench through a first matrix, or any six signals.
struct DeadWeight {
  Vector6 reading = Vector6::Zero();
  std::optional<Vector6> label;  ///< [N], [N m]; none: not noted
  std::size_t line = 0;          ///< of the file
};

/// Columns fx fy fz tx ty tz (or mx my mz) and known_fx … known_tz (or known_mx …) by name; without
/// a header twelve in this order. A row whose known cells are all empty has no label. Throws
/// InputError naming file, line and column.
std::vector<DeadWeight> readDeadWeights(const std::string& path);

/// A wrong label: the load that the other rows predict for this reading fits another label of the
/// file much better, or none.
struct WrongLabel {
  std::size_t row = 0;
  double force_error = 0.0, moment_error = 0.0;  ///< of the label [N], [N m]
  Vector6 expected = Vector6::Zero();            ///< load predicted by the other rows
  std::string text;                              ///< the likely mistake, one line
};

struct DeadWeightSolution {
  std::vector<std::size_t>
      block;  ///< of each row: begins where the reading falls to that of no load
  std::size_t blocks = 0;
  std::vector<WrongLabel> wrong;
  std::vector<std::size_t> used;  ///< rows of the fit
  std::vector<std::size_t> unlabelled;
  std::vector<Vector6> unlabelled_load, unlabelled_sd;  ///< as the map reads them; block's own zero
  int rank = 0;                                         ///< of the loads, 6 is full
  std::vector<std::string> missing;                     ///< loads that full rank lacks
  std::vector<std::string> one_sign;                    ///< axes loaded one way only, such as "-fx"
  /// What speaks against readings, units or loads as a whole (frozen, another unit, no relation).
  std::vector<std::string> findings;
  Matrix6 map = Matrix6::Zero();  ///< load = map (reading − zero of the block)
  Eigen::MatrixXd covariance;     ///< of the map, row after row
  std::vector<Vector6> zero;      ///< of each block, in the reading's unit
  Vector6 residual_rms = Vector6::Zero();
  Vector6 left_out_rms = Vector6::Zero();        ///< each row in turn
  Vector6 left_out_block_rms = Vector6::Zero();  ///< each block in turn, zero from its first row
  bool block_possible = false;                   ///< every block left out leaves full rank
};

/// Throws InputError for fewer than 8 labelled rows, or no load at all.
DeadWeightSolution solveDeadWeights(const std::vector<DeadWeight>& rows);

}  // namespace assembly_cell
