// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "node_registry.h"

namespace assembly_cell::panel {

namespace {

constexpr auto kSilence = std::chrono::seconds(3);  // each node publishes once a second
constexpr char kMessages[] = "messages";            // the part that every node has

bool isSilent(Clock::time_point updated, Clock::time_point now) { return now - updated > kSilence; }

}  // namespace

const std::vector<KnownNode>& knownNodes() {
  using Expected = KnownNode::Expected;
  static const std::vector<KnownNode> nodes = {
      {"peg_hole_simulator", "accelerometers", Expected::kYes},
      {"sensor_a/driver", "sensor_a/wrench", Expected::kTwoSensors},
      {"sensor_b/driver", "sensor_b/wrench", Expected::kYes},
      {"locus_estimator", "contact_mode", Expected::kYes},
      {"twin_force_estimator", "twin_force/status", Expected::kTwoSensors},
      {"assembly_supervisor", "assembly_supervisor/state", Expected::kYes},
      {"assembly_recorder", "recorder_state", Expected::kNo},
      {"contact_markers", "markers", Expected::kNo},
      {"mechanism_identifier", "mechanism_identifier/state", Expected::kNo},
      {"calibration_server", "calibration_server/status", Expected::kNo},
      {"simulated_calibration_rig", "", Expected::kNo},
      {"arm_bridge", "", Expected::kNo},
      {"emulate_arm", "", Expected::kNo},
      {"exciter_output", "", Expected::kNo},
  };
  return nodes;
}

void NodeRegistry::update(const std::string& node, const std::string& part, int level,
                          const std::string& message, Clock::time_point now) {
  Entry& entry = entries_[node];
  entry.parts[part] = {level, message};
  entry.updated = now;
  entry.exit_state = ExitState::kUnknown;
}

void NodeRegistry::setExitState(const std::string& node, ExitState state) {
  const auto found = entries_.find(node);
  if (found != entries_.end()) found->second.exit_state = state;
}

std::vector<std::string> NodeRegistry::silent(Clock::time_point now) const {
  std::vector<std::string> nodes;
  for (const auto& [node, entry] : entries_) {
    if (isSilent(entry.updated, now)) nodes.push_back(node);
  }
  return nodes;
}

NodeView NodeRegistry::viewOf(const std::string& node, const Entry& entry, Clock::time_point now) {
  NodeView view{node, Light::kGood, "", isSilent(entry.updated, now)};
  if (view.silent) {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - entry.updated);
    const std::string silence = "silent for " + std::to_string(seconds.count()) + " s";
    view.light = Light::kFault;
    switch (entry.exit_state) {
      case ExitState::kUnknown:
        view.reason = silence;
        break;
      case ExitState::kEnded:
        view.light = Light::kNotThere;
        view.reason = "has ended";
        break;
      case ExitState::kGone:
        view.reason = "gone: no process at its address, " + silence;
        break;
      case ExitState::kFrozen:
        view.reason = "frozen: it doesn't answer, " + silence;
        break;
    }
    return view;
  }
  // the worst part; among equal ones not `messages`
  int worst = -1;
  for (const auto& [name, part] : entry.parts) {
    if (part.level < worst || (part.level == worst && name == kMessages)) continue;
    worst = part.level;
    view.reason = part.message;
  }
  view.light = worst == 0 ? Light::kGood : worst == 1 ? Light::kWarning : Light::kFault;
  return view;
}

std::vector<NodeView> NodeRegistry::view(Clock::time_point now) const {
  std::vector<NodeView> views;
  for (const KnownNode& known : knownNodes()) {
    const auto found = entries_.find(known.name);
    if (found != entries_.end()) {
      views.push_back(viewOf(known.name, found->second, now));
    } else if (known.expected == KnownNode::Expected::kYes ||
               (known.expected == KnownNode::Expected::kTwoSensors && !one_sensor_)) {
      views.push_back({known.name, Light::kNotThere, "not there", false});
    }
  }
  return views;
}

}  // namespace assembly_cell::panel
