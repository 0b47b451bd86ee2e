// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Pose of the cell relative to an arm, as measured by hand to a few millimetres and a degree.
struct CellPlace {
  std::string flange;           ///< link of the arm's URDF that the carrier is mounted on
  Pose X_flange_carrier;        ///< coupling point, z up the peg's axis
  Pose X_base_hole;             ///< middle of the hole's rim in the arm's base, z out of the hole
  double carrier_height = 0.0;  ///< of carrier_base over `hole` [m]

  Pose carrierBase() const {
    return X_base_hole * Pose{Eigen::Matrix3d::Identity(), {0.0, 0.0, carrier_height}};
  }
  /// Carrier in carrier_base from the flange in the arm's base, and back.
  Pose carrierOf(const Pose& X_base_flange) const {
    return inverse(carrierBase()) * X_base_flange * X_flange_carrier;
  }
  Pose flangeOf(const Pose& carrier) const {
    return carrierBase() * carrier * inverse(X_flange_carrier);
  }
};

/// Reads a file of a cell's pose, see docs/how_to/arm.md. Throws InputError naming
/// file, key, value and remedy.
CellPlace loadCellPlace(const std::string& path);

}  // namespace assembly_cell
