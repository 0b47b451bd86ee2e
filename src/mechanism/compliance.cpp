// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/mechanism/compliance.h"

#include <Eigen/LU>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

Matrix6 couplingCompliance(const CouplingParameters& coupling) {
  const Eigen::FullPivLU<Matrix6> stiffness(couplingStiffness(coupling));
  if (!stiffness.isInvertible()) {
    throw InputError("coupling.stiffness: singular: give every direction a stiffness");
  }
  return stiffness.inverse();
}

}  // namespace assembly_cell
