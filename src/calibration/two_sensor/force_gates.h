// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What a set of force tests lacks, and what a fit of them is worth.
#pragma once

#include <string>
#include <vector>

#include "force_system.h"

namespace assembly_cell {

constexpr double kModelChi2 = 3.0;  // χ²/dof beyond which the linear model is doubted

/// What kinds of tests there are, from which advice follows.
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

/// What the quadratic model needs besides; empty when nothing.
std::string missingForQuadratic(const Geometry& geometry, const ObservationSet& set);

void judgeGeometry(const Geometry& geometry, std::vector<Gate>& gates);
/// `force_rows`: what is known of the force rows alone, in brackets.
void judgeRank(const DesignRank& design, const std::string& force_rows, const Geometry& geometry,
               ForceSolution& out);
void judgePrediction(const ObservationSet& set, const RatedLoad& rated, ForceSolution& out);
void judgeDropped(ForceSolution& out);
void judgeFit(const Geometry& geometry, const ObservationSet& set, StrainModel wanted,
              std::size_t tests, ForceSolution& out);

/// Accepted or not, and the message.
void summarise(ForceSolution& out);

}  // namespace assembly_cell
