// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <cstdint>
#include <exception>
#include <map>
#include <mutex>
#include <string>

namespace assembly_cell::ros_bridge {

/// Messages that this process has refused and exceptions of callbacks that it has caught, for its
/// log and its diagnostics. Thread-safe.
class IncomingLog {
 public:
  struct Figures {
    std::uint64_t refused = 0;  ///< messages
    std::uint64_t caught = 0;   ///< exceptions of callbacks
    std::string last;           ///< the latest of them, one line; empty: none yet
  };
  static IncomingLog& ofThisProcess();

  /// Both count, and write to the log at most once a second for a topic or place.
  void refuse(const std::string& topic, const std::string& publisher, const std::string& why);
  void caught(const std::string& where, const std::string& what);
  Figures figures() const;

 private:
  bool isDue(const std::string& where);

  mutable std::mutex mutex_;
  Figures figures_;
  std::map<std::string, ros::WallTime> logged_;  // by topic or place
};

/// Publishes the figures of the log once a second of wall time, as the status "<node>: messages".
class IncomingDiagnostics {
 public:
  explicit IncomingDiagnostics(ros::NodeHandle& nh);

 private:
  void publish();

  ros::Publisher pub_;
  ros::WallTimer timer_;
  std::uint64_t published_ = 0;  // refused and caught
};

/// Runs `what`; an exception is logged and counted, not passed on. False if there was one.
template <class What>
bool guarded(const std::string& where, const What& what) {
  try {
    what();
    return true;
  } catch (const std::exception& error) {
    IncomingLog::ofThisProcess().caught(where, error.what());
    return false;
  }
}

}  // namespace assembly_cell::ros_bridge
