// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/calibration/two_sensor/force.h"

namespace assembly_cell {

/// One step of a plan: the known part of an observation, and the load or movement to apply.
struct LoadRequest {
  Observation target;                ///< kind, side, pose, mass, direction, point; no readings
  Vector6 wrench = Vector6::Zero();  ///< reacting: on A, frame A; indentation: force and its
                                     ///< moment about the sensor frame's origin [N], [N·m]
  Vector6 strain = Vector6::Zero();  ///< displacement: wanted, in parts of ±4 V
};

/// One line for a person: what to mount, where and how hard to press.
std::string describe(const LoadRequest& request);

/// Named plans.
enum class PlanName {
  kRecommended,    ///< 32 reacting over 8 orientations + 6 weights on each
  kQuadratic,      ///< 120 reacting, bolted so that all of the rated load is covered, + 24 weights
                   ///< and 30 indentations on each
  kDisplacement,   ///< 46 tests of each sensor, central composite
  kThesisFixed,    ///< 11 reacting at one pose + 1 weight: rank 21 of 36; for comparison
  kThesisShifted,  ///< 11 parallel, shifted + 1 weight: rank 30 of 36; for comparison
};

/// recommended, quadratic, displacement, thesis_fixed, thesis_shifted; none for another name.
std::optional<PlanName> planName(const std::string& name);
constexpr const char* kPlanNames =
    "recommended, quadratic, displacement, thesis_fixed, thesis_shifted";

/// Unloaded readings are put in before the first test and after every `zero_every` tests. The seed
/// chooses sizes and points of the loads.
std::vector<LoadRequest> makePlan(PlanName name, const ObservationSet& set,
                                  const RatedLoad& rated = {}, std::uint64_t seed = 1,
                                  int zero_every = 11);

/// A set with the readings that the nominal sensors would give under a plan, free of noise,
/// appended to its observations: input of evaluateDesign().
ObservationSet predictPlan(const std::vector<LoadRequest>& plan, const ObservationSet& set);

/// D-optimal continuation: from the candidates the `count` that add most to log det of the
/// information, one after another, in the order to do them; each may be taken once. With the
/// design short of rank the smallest eigenvalues are filled first.
struct NextTests {
  std::vector<std::size_t> chosen;  ///< indices of candidates
  std::vector<double> gain;         ///< log det added by each
  std::string weak_direction_before, weak_direction_after;
  ForceSolution after;  ///< design with the chosen ones added
};
NextTests nextTests(const ObservationSet& set, const std::vector<LoadRequest>& candidates,
                    std::size_t count, const ForceSettings& settings = {});

/// Reacting tests at all 24 orientations of the square faces, weights along ± each axis on both
/// sensors at several points, indentations at the corners: what a person can do.
std::vector<LoadRequest> standardCandidates(const RatedLoad& rated = {}, std::uint64_t seed = 1);

}  // namespace assembly_cell
