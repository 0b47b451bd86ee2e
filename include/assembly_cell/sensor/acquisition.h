// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

struct AcquisitionOptions {
  std::size_t queue = 100;                             ///< blocks, at least 2
  std::chrono::nanoseconds read_timeout{100'000'000};  ///< of one read
  /// Without a sample for so long the device is closed and opened again; 0: never.
  std::chrono::nanoseconds silence{2'000'000'000};
  std::chrono::nanoseconds first_back_off{250'000'000};      ///< doubles with every failure …
  std::chrono::nanoseconds longest_back_off{5'000'000'000};  ///< … up to here
  bool lossless = false;  ///< a full queue makes the source wait (a recording) instead of dropping
  int priority = 0;       ///< of the thread, SCHED_FIFO 1 … 99; 0: as the program
};

/// Gives this thread SCHED_FIFO with that priority, 0 leaves it as it is. Returns why it can't, in
/// one line, or nothing.
std::string raisePriority(int priority);

enum class LinkState {
  kConnecting,     ///< open() is under way
  kConnected,      ///< open; last_samples shows whether samples arrive
  kBackingOff,     ///< not there; the next attempt comes at next_attempt
  kMisconfigured,  ///< the device or its data show that the configuration can't work
  kEnded,          ///< a recording is over
};

/// connecting, connected, backing off, misconfigured or ended.
const char* toText(LinkState state);

/// State of the link to a device.
struct LinkStatus {
  using Clock = std::chrono::steady_clock;
  LinkState state = LinkState::kConnecting;
  std::string static_cause;             ///< of the configuration: stays until it is changed
  std::string dynamic_cause;            ///< why the link isn't there now; empty once samples come
  std::string last_loss;                ///< why it went the last time
  std::string priority_fault;           ///< why the thread didn't get its priority
  bool ever_sampled = false;            ///< a sample has come since the start
  Clock::time_point last_samples{};     ///< arrival of the newest block, if ever_sampled
  Clock::time_point next_attempt{};     ///< while backing off
  std::chrono::nanoseconds back_off{};  ///< the present one
  std::uint64_t opens = 0, failed_opens = 0;
  std::uint64_t reconnects = 0;  ///< times samples came again after the link was lost
  std::uint64_t faults = 0;      ///< reads that ended in a fault of the device
  std::uint32_t fault = 0;       ///< its latest status word
  std::uint64_t dropped_blocks = 0, dropped_samples = 0;  ///< because the queue was full
  std::size_t queue_high = 0;                             ///< most blocks that ever waited
};

/// Reads a source in a thread of its own into a bounded queue, and opens it again when it has gone
/// away: after 0.25 s, doubling to 5 s. A full queue loses its oldest block, counted. Blocks are
/// made once: no sample and no block costs an allocation.
class Acquisition {
 public:
  /// The source is configured and outlives this.
  Acquisition(StrainSource& source, const AcquisitionOptions& options);
  ~Acquisition();

  void start();
  void stop();  ///< closes the source; next() then gives nothing any more

  /// The oldest block, or null when none comes in time. It's the caller's until the next call; for
  /// one thread.
  const SourceBlock* next(std::chrono::nanoseconds timeout);

  LinkStatus status() const;
  SourceInfo info() const;  ///< of the latest open

  /// What the reader of the blocks found wrong with the configuration: closes the source for good.
  void misconfigured(const std::string& cause);

  /// True once the source has ended or is misconfigured for good, and the queue is empty.
  bool done() const;

 private:
  void run();
  /// False when stopped; sets the causes.
  bool tryOpen();
  /// Until the link is lost; false when there's nothing to come back for.
  bool readAll();
  void backOff();
  SourceBlock& slot();
  void commit();
  void lose(const std::string& reason);

  StrainSource& source_;
  const AcquisitionOptions options_;

  mutable std::mutex mutex_;
  std::condition_variable arrived_, freed_;
  std::vector<SourceBlock> blocks_;
  std::vector<std::size_t> free_;
  std::vector<std::size_t> ready_;  // a ring, oldest at first_
  std::size_t first_ = 0, count_ = 0;
  std::size_t writing_ = 0;  // index of the block under way
  std::size_t lent_;         // of the one that next() gave
  LinkStatus status_;
  SourceInfo info_;
  bool was_lost_ = false;  // a link that had samples has gone, and none came since
  bool barred_ = false;    // misconfigured() was called
  bool finished_ = false;  // the thread is through
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace assembly_cell
