// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "cell_view.h"

namespace assembly_cell::panel {

/// Requests that may take long, each in a thread of its own, of each name one at a time: whoever
/// asks goes on at once and looks at the answers later.
class Errands {
 public:
  /// `work` fills text and state; `abandon` makes it return soon, from another thread.
  using Work = std::function<Answer()>;
  using Abandon = std::function<void()>;

  Errands() = default;
  /// Abandons what is under way and waits for its end.
  ~Errands();
  Errands(const Errands&) = delete;
  Errands& operator=(const Errands&) = delete;

  /// False when one of this name is under way. quiet: its answer is not told.
  bool begin(const std::string& name, Work work, Abandon abandon, bool quiet = false);
  bool running(const std::string& name) const;
  /// Abandons those that were asked longer ago.
  void abandonAfter(std::chrono::seconds patience);
  std::map<std::string, Answer> answers() const;

 private:
  struct Errand {
    std::thread thread;
    Abandon abandon;
    bool running = true;
    bool abandoned = false;
    Clock::time_point since;
  };

  mutable std::mutex mutex_;
  std::map<std::string, Errand> errands_;
  std::map<std::string, Answer> answers_;
  std::uint64_t count_ = 0;
};

}  // namespace assembly_cell::panel
