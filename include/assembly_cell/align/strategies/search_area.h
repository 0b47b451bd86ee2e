// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>

#include <optional>
#include <vector>

namespace assembly_cell {

/// Where to put an edge down next in a search for a hole, by elimination: a touch of the face at a
/// point rules out the hole's centres within `reach` of it. Centres are those of a grid over the
/// disc of radius `region` around `start`. Returns the centre around which most of those that are
/// left are ruled out, of equal ones the nearest to `from`; empty when none is left. All in one
/// plane. [m]
std::optional<Eigen::Vector2d> nextPlace(const Eigen::Vector2d& start, double region, double reach,
                                         const std::vector<Eigen::Vector2d>& touched,
                                         const Eigen::Vector2d& from);

}  // namespace assembly_cell
