// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/calibrated_sensors.h"

#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/two_sensor/force.h"
#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/rig.h"

namespace assembly_cell {
namespace {

constexpr int kTrials = 5;  // a sound calibration is refused once in a thousand
// streams of their own beside those of the cell's noise and its mismatch
constexpr std::uint64_t kStream = 0x9e3779b97f4a7c15;

ForceSolution solveOnBench(const RigSettings& settings, ObservationSet& set) {
  CalibrationRig rig(settings);
  set = rig.description();
  for (const LoadRequest& request : makePlan(PlanName::kRecommended, set)) {
    set.observations.push_back(rig.measure(request));
  }
  ForceSettings force;
  force.model = StrainModel::kLinear;
  return solveForce(set, force);
}

}  // namespace

PerSide<Calibration> calibratedSensors(const CellParameters& cell, int samples) {
  RigSettings settings;
  settings.bits = cell.bits;
  settings.noise = cell.noise;
  settings.nonlinearity = cell.bridge_nonlinearity;
  settings.samples = samples;
  settings.gain = {cell.truth.sensor_a.gain(), cell.truth.sensor_b.gain()};
  std::string refused;
  for (int trial = 0; trial < kTrials; ++trial) {
    settings.seed = kStream ^ (static_cast<std::uint64_t>(kTrials) * cell.seed +
                               static_cast<std::uint64_t>(trial));
    ObservationSet set;
    const ForceSolution solution = solveOnBench(settings, set);
    refused = solution.message;
    if (!solution.accepted) continue;
    PerSide<Calibration> out;
    for (const Side side : kSides) {
      out[side].id = "bench";
      applyForce(solution, set, side, out[side]);
    }
    return out;
  }
  throw InputError("calibration refused " + std::to_string(kTrials) + " times: " + refused);
}

}  // namespace assembly_cell
