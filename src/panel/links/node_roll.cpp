// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "node_roll.h"

namespace assembly_cell::panel {

namespace {

constexpr auto kSilence = std::chrono::seconds(3);  // each node speaks once a second
constexpr char kMessages[] = "messages";            // the part that every node has

bool isSilent(Clock::time_point heard, Clock::time_point now) { return now - heard > kSilence; }

}  // namespace

const std::vector<KnownNode>& knownNodes() {
  static const std::vector<KnownNode> nodes = {
      {"peg_hole_simulator", "accelerometers", true},
      {"sensor_a/driver", "sensor_a/wrench", true},
      {"sensor_b/driver", "sensor_b/wrench", true},
      {"locus_estimator", "contact_mode", true},
      {"twin_force_estimator", "twin_force/status", true},
      {"assembly_supervisor", "assembly_supervisor/state", true},
      {"contact_markers", "markers", false},
      {"mechanism_identifier", "mechanism_identifier/state", false},
      {"calibration_server", "calibration_server/status", false},
      {"simulated_calibration_rig", "", false},
      {"arm_bridge", "", false},
      {"emulate_arm", "", false},
      {"exciter_output", "", false},
  };
  return nodes;
}

void NodeRoll::hear(const std::string& node, const std::string& part, int level,
                    const std::string& message, Clock::time_point now) {
  Entry& entry = heard_[node];
  entry.parts[part] = {level, message};
  entry.heard = now;
  entry.fate = Fate::kUnknown;
}

void NodeRoll::tellFate(const std::string& node, Fate fate) {
  const auto found = heard_.find(node);
  if (found != heard_.end()) found->second.fate = fate;
}

std::vector<std::string> NodeRoll::silent(Clock::time_point now) const {
  std::vector<std::string> nodes;
  for (const auto& [node, entry] : heard_) {
    if (isSilent(entry.heard, now)) nodes.push_back(node);
  }
  return nodes;
}

NodeView NodeRoll::viewOf(const std::string& node, const Entry& entry, Clock::time_point now) {
  NodeView view{node, Light::kGood, "", isSilent(entry.heard, now)};
  if (view.silent) {
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - entry.heard);
    const std::string silence = "silent for " + std::to_string(seconds.count()) + " s";
    view.light = Light::kFault;
    switch (entry.fate) {
      case Fate::kUnknown:
        view.reason = silence;
        break;
      case Fate::kEnded:
        view.light = Light::kNotThere;
        view.reason = "has ended";
        break;
      case Fate::kGone:
        view.reason = "gone: nobody listens at its address, " + silence;
        break;
      case Fate::kFrozen:
        view.reason = "frozen: it doesn't answer, " + silence;
        break;
    }
    return view;
  }
  // the worst part; among equals its own work rather than its messages
  int worst = -1;
  for (const auto& [part, said] : entry.parts) {
    if (said.level < worst || (said.level == worst && part == kMessages)) continue;
    worst = said.level;
    view.reason = said.message;
  }
  view.light = worst == 0 ? Light::kGood : worst == 1 ? Light::kWarning : Light::kFault;
  return view;
}

std::vector<NodeView> NodeRoll::view(Clock::time_point now) const {
  std::vector<NodeView> views;
  for (const KnownNode& known : knownNodes()) {
    const auto found = heard_.find(known.name);
    if (found != heard_.end()) {
      views.push_back(viewOf(known.name, found->second, now));
    } else if (known.expected) {
      views.push_back({known.name, Light::kNotThere, "not there", false});
    }
  }
  return views;
}

}  // namespace assembly_cell::panel
