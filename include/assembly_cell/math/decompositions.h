// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Dense>

// Eigen's decompositions of the sizes that the core uses, and their solutions, are instantiated
// once, in math/decompositions.cpp. The modules' precompiled header brings these declarations; code
// that doesn't see them works as well and compiles longer. Who includes them links the core.

namespace Eigen {

// clang-format off
#define ASSEMBLY_CELL_SELF_ADJOINT(prefix, Matrix) \
  prefix template SelfAdjointEigenSolver<Matrix>& SelfAdjointEigenSolver<Matrix>::compute<Matrix>(const EigenBase<Matrix>&, int);
#define ASSEMBLY_CELL_LLT(prefix, Matrix) \
  prefix template LLT<Matrix>& LLT<Matrix>::compute<Matrix>(const EigenBase<Matrix>&);
#define ASSEMBLY_CELL_SVD(prefix, Matrix) \
  prefix template JacobiSVD<Matrix>& JacobiSVD<Matrix>::compute(const Matrix&, unsigned int);
#define ASSEMBLY_CELL_IN_PLACE(prefix, Solver, Matrix) \
  prefix template void Solver<Matrix>::computeInPlace();

#define ASSEMBLY_CELL_SOLVE(prefix, Solver, Matrix, Right, Left) \
  prefix template void Solver<Matrix>::_solve_impl<Right, Left>(const Right&, Left&) const;

#define ASSEMBLY_CELL_DECOMPOSITIONS(prefix, Matrix6, Vector6, Matrix12) \
  ASSEMBLY_CELL_SELF_ADJOINT(prefix, Matrix3d) \
  ASSEMBLY_CELL_SELF_ADJOINT(prefix, Matrix6) \
  ASSEMBLY_CELL_SELF_ADJOINT(prefix, Matrix12) \
  ASSEMBLY_CELL_SELF_ADJOINT(prefix, MatrixXd) \
  ASSEMBLY_CELL_LLT(prefix, Matrix6) \
  ASSEMBLY_CELL_LLT(prefix, Matrix12) \
  ASSEMBLY_CELL_LLT(prefix, MatrixXd) \
  ASSEMBLY_CELL_SVD(prefix, Matrix3d) \
  ASSEMBLY_CELL_SVD(prefix, Matrix6) \
  ASSEMBLY_CELL_SVD(prefix, MatrixXd) \
  ASSEMBLY_CELL_IN_PLACE(prefix, FullPivLU, Matrix6) \
  ASSEMBLY_CELL_IN_PLACE(prefix, HouseholderQR, MatrixXd) \
  ASSEMBLY_CELL_IN_PLACE(prefix, ColPivHouseholderQR, MatrixXd) \
  ASSEMBLY_CELL_IN_PLACE(prefix, ColPivHouseholderQR, Matrix3d) \
  ASSEMBLY_CELL_IN_PLACE(prefix, CompleteOrthogonalDecomposition, Matrix6) \
  ASSEMBLY_CELL_IN_PLACE(prefix, CompleteOrthogonalDecomposition, MatrixXd) \
  ASSEMBLY_CELL_SOLVE(prefix, HouseholderQR, MatrixXd, VectorXd, VectorXd) \
  ASSEMBLY_CELL_SOLVE(prefix, HouseholderQR, MatrixXd, MatrixXd, MatrixXd) \
  ASSEMBLY_CELL_SOLVE(prefix, ColPivHouseholderQR, Matrix3d, Vector3d, Vector3d) \
  ASSEMBLY_CELL_SOLVE(prefix, ColPivHouseholderQR, MatrixXd, VectorXd, VectorXd) \
  ASSEMBLY_CELL_SOLVE(prefix, ColPivHouseholderQR, MatrixXd, MatrixXd, MatrixXd) \
  ASSEMBLY_CELL_SOLVE(prefix, CompleteOrthogonalDecomposition, Matrix6, Vector6, Vector6) \
  ASSEMBLY_CELL_SOLVE(prefix, CompleteOrthogonalDecomposition, Matrix6, Matrix6::IdentityReturnType, Matrix6) \
  ASSEMBLY_CELL_SOLVE(prefix, CompleteOrthogonalDecomposition, MatrixXd, VectorXd, VectorXd) \
  ASSEMBLY_CELL_SOLVE(prefix, CompleteOrthogonalDecomposition, MatrixXd, MatrixXd, MatrixXd) \
  ASSEMBLY_CELL_SOLVE(prefix, CompleteOrthogonalDecomposition, MatrixXd, MatrixXd::IdentityReturnType, MatrixXd) \
  prefix template void PartialPivLU<Matrix6>::compute();
// clang-format on

using SquareMatrix6 = Matrix<double, 6, 6>;
using ColumnVector6 = Matrix<double, 6, 1>;
using SquareMatrix12 = Matrix<double, 12, 12>;
ASSEMBLY_CELL_DECOMPOSITIONS(extern, SquareMatrix6, ColumnVector6, SquareMatrix12)

}  // namespace Eigen
