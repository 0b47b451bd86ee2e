// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Acceptance tests of a set of force tests and of their fit.
#pragma once

#include <string>
#include <vector>

#include "force_system.h"

namespace assembly_cell {

constexpr double kModelChi2 = 3.0;  // χ²/dof beyond which the linear model is doubted

/// Geometry of the tests in use: basis of the advice on missing ones.
struct SideGeometry {
  int weights = 0, indentations = 0, weight_rank = 0;
  bool collinear = false, coplanar = false;  ///< indentations
};
struct Geometry {
  int reacting = 0;
  int turn_axes = 0;  ///< 0 parallel, 1 about one axis, 2 enough
  bool shifted = false;
  PerSide<SideGeometry> on;
};
Geometry geometryOf(const ForceSystem& system, const ObservationSet& set);

/// Tests that the quadratic model needs in addition; empty when none.
std::string missingForQuadratic(const Geometry& geometry, const ObservationSet& set);

void evaluateGeometry(const Geometry& geometry, std::vector<Gate>& gates);
/// `force_rows`: rank of the force rows alone, in brackets, or empty.
void evaluateRank(const DesignRank& design, const std::string& force_rows, const Geometry& geometry,
                  ForceSolution& out);
void evaluatePrediction(const ObservationSet& set, const RatedLoad& rated, ForceSolution& out);
void evaluateDropped(ForceSolution& out);
void evaluateFit(const Geometry& geometry, const ObservationSet& set, StrainModel wanted,
                 std::size_t tests, ForceSolution& out);

/// Sets `accepted` and the message from the gates.
void summarise(ForceSolution& out);

}  // namespace assembly_cell
