// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>

namespace assembly_cell {

/// g = tan(θ/2) n, the vector of thesis 10.3–10.5. Infinite at θ = π.
struct GibbsVector {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
};

/// (λ, μ, ν) = 2 tan(θ/2) n of thesis 10.7 and 11.3: twice the Gibbs vector. Infinite at θ = π.
struct RodriguesVector {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
};

/// R = I + 2/(1 + g·g) ([g] + [g]²).
Eigen::Matrix3d rotationFromGibbs(const GibbsVector& g);

/// R = I + ([λ] + ½[λ]²)/(1 + ¼ λ·λ), thesis 10.7.
Eigen::Matrix3d rotationFromRodrigues(const RodriguesVector& lambda);

/// Inverses, exact at θ = 0. Throw InputError within 1e-8 rad of θ = π, where they are infinite.
GibbsVector gibbsFromRotation(const Eigen::Matrix3d& R);
RodriguesVector rodriguesFromRotation(const Eigen::Matrix3d& R);

}  // namespace assembly_cell
