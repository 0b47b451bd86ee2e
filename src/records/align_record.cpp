// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/align_record.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {
namespace {

// States of a strategy that begins again, and strategies that follow a failed one.
constexpr const char* kRetries[] = {"jam",       "recover",   "double_contact", "single_contact",
                                    "vibratory", "twin_force"};

std::map<std::string, std::string> changedSettings(AlignParameters parameters) {
  AlignParameters defaults;
  const FieldList present = fieldsOf(parameters), standard = fieldsOf(defaults);
  std::map<std::string, std::string> changed;
  auto before = standard.begin();
  for (const Field& field : present) {
    const Field& other = *before++;
    if (field.kind == Field::Kind::kSection || field.value() == other.value()) continue;
    changed[field.path] = field.value();
  }
  // the goal's own, no parameters
  if (parameters.insert.floor) changed["insert.floor"] = "true";
  if (parameters.insert.depth > 0.0) changed["insert.depth"] = yamlNumber(parameters.insert.depth);
  return changed;
}

}  // namespace

void describe(const AlignResult& result, const AlignParameters& parameters, Run& run) {
  run.duration = result.time;
  run.strategy = parameters.strategy;
  run.result = !result.success ? "failed" : parameters.insert.wanted() ? "seated" : "aligned";
  run.failure = result.failure == AlignFailure::kNone ? "" : toString(result.failure);
  run.text = result.reason;
  run.settings = changedSettings(parameters);
  run.curve = result.insert.curve;
  run.estimates.clear();
  if (!result.known) return;
  const auto estimate = [&](const char* name, double value, double sd) {
    if (std::isfinite(value)) run.estimates.push_back({name, value, std::isfinite(sd) ? sd : 0.0});
  };
  const Eigen::Vector2d hole_sd = result.offset_covariance.diagonal().cwiseSqrt();
  estimate("hole_x", result.offset.x(), hole_sd.x());
  estimate("hole_y", result.offset.y(), hole_sd.y());
  estimate("tilt_x", result.tilt.x(), result.tilt_sd);
  estimate("tilt_y", result.tilt.y(), result.tilt_sd);
  estimate("clearance", result.clearance.mean, result.clearance.sd);
}

void addEvent(const AlignProgress& progress, Run& run) {
  const bool is_retry =
      std::find(std::begin(kRetries), std::end(kRetries), progress.state) != std::end(kRetries);
  if (is_retry)
    run.events.push_back({progress.time, "retry", progress.state + ": " + progress.message});
}

}  // namespace assembly_cell
