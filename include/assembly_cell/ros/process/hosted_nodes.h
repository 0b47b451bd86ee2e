// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace assembly_cell::ros_bridge {

/// The end of the nodes that share this process as nodelets: they end together, as a launch in
/// which each node is required. Thread-safe.
class HostedNodes {
 public:
  static HostedNodes& ofThisProcess();

  /// `node` can't start: logs the reason in one line and requests the end of the process.
  void fail(const std::string& node, const std::string& why);
  bool failed() const;

  /// `stop` ends the node's activity while it can still publish. Returns its number.
  int add(std::function<void()> stop);
  /// Calls it, once.
  void stop(int number);
  /// Calls all of them, while every node still runs.
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
