// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace assembly_cell::ros_bridge {

/// The nodes that share this process as nodelets: how they end together, as a launch of processes
/// does in which each is required. Thread-safe.
class HostedNodes {
 public:
  static HostedNodes& ofThisProcess();

  /// `node` can't begin: one line says why, and the process is asked to end.
  void fail(const std::string& node, const std::string& why);
  bool failed() const;

  /// `stop` ends what the node does, while it can still publish. Returns its number.
  int add(std::function<void()> stop);
  /// Calls it, unless it has been called.
  void stop(int number);
  /// Of all nodes: while each of them still runs.
  void stopAll();

  /// A node has ended with this code.
  void ended(int code);
  int exitCode() const;  ///< the highest of them, 1 after fail()

 private:
  mutable std::mutex mutex_;
  int numbers_ = 0;
  std::map<int, std::function<void()>> stops_;
  bool failed_ = false;
  int exit_code_ = 0;
};

}  // namespace assembly_cell::ros_bridge
