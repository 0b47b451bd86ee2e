// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "cell_view.h"

namespace assembly_cell::panel {

/// A node of the package that tells how it is.
struct KnownNode {
  const char* name;   // relative to the cell's namespace
  const char* topic;  // that it alone publishes, from its start on; empty: none
  bool expected;      // in every cell: shown also before it was heard
};
const std::vector<KnownNode>& knownNodes();

/// What the diagnostics have said of each node, and which have fallen silent.
class NodeRoll {
 public:
  /// A status `<node>: <part>`; level as in diagnostic_msgs/DiagnosticStatus.
  void hear(const std::string& node, const std::string& part, int level, const std::string& message,
            Clock::time_point now);
  /// What has become of a node that is silent.
  enum class Fate { kUnknown, kEnded, kGone, kFrozen };
  void tellFate(const std::string& node, Fate fate);

  /// Nodes that were heard once and are silent now.
  std::vector<std::string> silent(Clock::time_point now) const;
  std::vector<NodeView> view(Clock::time_point now) const;

 private:
  struct Part {
    int level = 0;
    std::string message;
  };
  struct Entry {
    std::map<std::string, Part> parts;
    Clock::time_point heard;
    Fate fate = Fate::kUnknown;
  };
  static NodeView viewOf(const std::string& node, const Entry& entry, Clock::time_point now);

  std::map<std::string, Entry> heard_;
};

}  // namespace assembly_cell::panel
