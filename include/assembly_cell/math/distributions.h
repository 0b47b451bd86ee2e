// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell {

/// P(N(0, 1) > z).
double normalTail(double z);
/// P(χ² of `dof` degrees of freedom > chi2); 1 for dof 0.
double chiSquareTail(double chi2, int dof);
/// The value that χ² of `dof` degrees of freedom exceeds with probability p in (0, 1); 0 for dof 0.
double chiSquareLimit(double p, int dof);
/// P(F of d1 and d2 degrees of freedom > f); 1 where one of them is 0.
double fTail(double f, double d1, double d2, double non_centrality = 0.0);

}  // namespace assembly_cell
