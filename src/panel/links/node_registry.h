// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "cell_view.h"

namespace assembly_cell::panel {

/// A node of the package that publishes diagnostics.
struct KnownNode {
  const char* name;   // relative to the cell's namespace
  const char* topic;  // that it alone publishes from its start on; empty: none
  // In every cell, or in those with two sensors: shown also before its first diagnostics.
  enum class Expected { kNo, kYes, kTwoSensors } expected;
};
const std::vector<KnownNode>& knownNodes();

/// Last diagnostics of each node, and the nodes that have become silent.
class NodeRegistry {
 public:
  /// A status `<node>: <part>`; level as in diagnostic_msgs/DiagnosticStatus.
  void update(const std::string& node, const std::string& part, int level,
              const std::string& message, Clock::time_point now);
  /// What has become of a silent node.
  enum class ExitState { kUnknown, kEnded, kGone, kFrozen };
  void setExitState(const std::string& node, ExitState state);

  /// The cell has sensor_b alone.
  void setOneSensor(bool one) { one_sensor_ = one; }

  /// Nodes with diagnostics that are silent now.
  std::vector<std::string> silent(Clock::time_point now) const;
  std::vector<NodeView> view(Clock::time_point now) const;

 private:
  struct Part {
    int level = 0;
    std::string message;
  };
  struct Entry {
    std::map<std::string, Part> parts;
    Clock::time_point updated;
    ExitState exit_state = ExitState::kUnknown;
  };
  static NodeView viewOf(const std::string& node, const Entry& entry, Clock::time_point now);

  std::map<std::string, Entry> entries_;
  bool one_sensor_ = false;
};

}  // namespace assembly_cell::panel
