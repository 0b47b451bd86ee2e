// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/math/decompositions.h"

namespace Eigen {

ASSEMBLY_CELL_DECOMPOSITIONS(, SquareMatrix6, ColumnVector6, SquareMatrix12)

}  // namespace Eigen
