// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Small dense algebra of the contact points, shared by the files of this folder.
#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

/// Matrices and vectors of at most N rows without heap.
template <int N>
using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, N, N>;
template <int N>
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, N, 1>;

/// Relative diagonal shift that makes redundant rows solvable (near least norm).
constexpr double kShift = 1e-11;

/// Change of the acceleration (velocity) of peg point r by a unit force (impulse) at peg point s,
/// levers from the centre of mass: 1/m − [r] I^-1 [s]. a: peg axis.
inline Eigen::Matrix3d influence(const PegParameters& peg, const Eigen::Vector3d& a,
                                 const Eigen::Vector3d& r, const Eigen::Vector3d& s) {
  const double it = 1.0 / peg.inertia_transverse, ia = 1.0 / peg.inertia_axial - it;
  const Eigen::Vector3d ra = r.cross(a), sa = s.cross(a);
  // −[r](it 1 + ia a aᵀ)[s] = −it [r][s] + ia (r×a)(s×a)ᵀ, and [r][s] = s rᵀ − (r·s) 1
  return (1.0 / peg.mass + it * r.dot(s)) * Eigen::Matrix3d::Identity() - it * s * r.transpose() +
         ia * ra * sa.transpose();
}

}  // namespace assembly_cell
