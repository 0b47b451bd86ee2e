// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

namespace assembly_cell::ros_bridge {

/// While it exists, lines for standard output and standard error (also std::cout, std::cerr) go
/// through pipes to threads that write them to the terminal. So no caller waits for a terminal that
/// doesn't read. When a pipe is full, further lines are lost; a line there counts them. One object
/// a process.
class LogRelay {
 public:
  LogRelay();
  /// Waits until the terminal has the lines, at most half a second.
  ~LogRelay();
  LogRelay(const LogRelay&) = delete;
  LogRelay& operator=(const LogRelay&) = delete;
};

}  // namespace assembly_cell::ros_bridge
