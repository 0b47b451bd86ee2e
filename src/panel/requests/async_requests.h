// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "links/cell_view.h"

namespace assembly_cell::panel {

/// Requests that may take long, each in a thread of its own, one at a time for each name. The
/// caller doesn't wait; answers are polled.
class AsyncRequests {
 public:
  /// `work` returns text and state; `abandon` makes it return soon, from another thread.
  using Work = std::function<Answer()>;
  using Abandon = std::function<void()>;

  AsyncRequests() = default;
  /// Abandons the running requests and waits for their end.
  ~AsyncRequests();
  AsyncRequests(const AsyncRequests&) = delete;
  AsyncRequests& operator=(const AsyncRequests&) = delete;

  /// False when a request of this name is running. quiet: its answer isn't kept.
  bool start(const std::string& name, Work work, Abandon abandon, bool quiet = false);
  /// Abandons requests that have run for longer.
  void abandonAfter(std::chrono::seconds timeout);
  std::map<std::string, Answer> answers() const;

 private:
  struct Request {
    std::thread thread;
    Abandon abandon;
    bool running = true;
    bool abandoned = false;
    Clock::time_point since;
  };

  mutable std::mutex mutex_;
  std::map<std::string, Request> requests_;
  std::map<std::string, Answer> answers_;
  std::uint64_t count_ = 0;
};

}  // namespace assembly_cell::panel
