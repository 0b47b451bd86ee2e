// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/acquisition.h"

#include <pthread.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
using Clock = std::chrono::steady_clock;

}  // namespace

std::string raisePriority(int priority) {
  if (priority <= 0) return {};
  sched_param parameter{};
  parameter.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
  if (error == 0) return {};
  return "no real-time priority " + std::to_string(priority) + ": " + std::strerror(error) +
         ": give this user rtprio, see docs/how_to/hardware.md";
}

const char* toText(LinkState state) {
  switch (state) {
    case LinkState::kConnecting:
      return "connecting";
    case LinkState::kConnected:
      return "connected";
    case LinkState::kBackingOff:
      return "backing off";
    case LinkState::kMisconfigured:
      return "misconfigured";
    case LinkState::kEnded:
      return "ended";
  }
  return "";
}

Acquisition::Acquisition(StrainSource& source, const AcquisitionOptions& options)
    : source_(source), options_(options), lent_(kNone) {
  const std::size_t count = std::max<std::size_t>(options_.queue, 2);
  // one is being written, one is lent, the others wait
  blocks_.resize(count + 2);
  ready_.resize(count);
  free_.reserve(blocks_.size());
  for (std::size_t i = 0; i < blocks_.size(); ++i) free_.push_back(i);
  writing_ = kNone;
}

Acquisition::~Acquisition() { stop(); }

void Acquisition::start() {
  if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
}

void Acquisition::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  freed_.notify_all();
  arrived_.notify_all();
  source_.close();
  if (thread_.joinable()) thread_.join();
}

// ---- the reading thread ----

void Acquisition::run() {
  const std::string fault = raisePriority(options_.priority);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.priority_fault = fault;
    status_.back_off = options_.first_back_off;
  }
  while (!stop_) {
    if (tryOpen() && !readAll()) break;
    source_.close();
    backOff();
  }
  source_.close();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    finished_ = true;
  }
  arrived_.notify_all();
}

bool Acquisition::tryOpen() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status_.state = LinkState::kConnecting;
  }
  std::string static_cause, dynamic_cause;
  try {
    // the owner may have opened it, to be sure of it
    if (!source_.isOpen()) source_.open();
  } catch (const InputError& error) {
    static_cause = error.what();
  } catch (const std::exception& error) {
    dynamic_cause = error.what();
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.static_cause = static_cause;
  if (static_cause.empty() && dynamic_cause.empty()) {
    ++status_.opens;
    status_.state = LinkState::kConnected;
    info_ = source_.info();
    return true;
  }
  ++status_.failed_opens;
  if (!dynamic_cause.empty()) status_.dynamic_cause = dynamic_cause;
  // what was configured can't work: no hurry to try it again
  if (!static_cause.empty()) status_.back_off = options_.longest_back_off;
  return false;
}

bool Acquisition::readAll() {
  Clock::time_point alive = Clock::now();
  while (!stop_) {
    SourceBlock& block = slot();
    if (stop_) return false;
    const ReadResult result = source_.read(block, options_.read_timeout);
    const Clock::time_point now = Clock::now();
    switch (result) {
      case ReadResult::kSamples:
        alive = now;
        commit();
        break;
      case ReadResult::kTimeout:
        if (options_.silence.count() > 0 && now - alive > options_.silence) {
          lose("no samples for " +
               std::to_string(
                   std::chrono::duration_cast<std::chrono::milliseconds>(now - alive).count()) +
               " ms from " + source_.info().device);
          return true;
        }
        break;
      case ReadResult::kFault: {
        alive = now;
        const std::lock_guard<std::mutex> lock(mutex_);
        ++status_.faults;
        status_.fault = block.fault;
        break;
      }
      case ReadResult::kLost:
        lose(source_.lostReason());
        return true;
      case ReadResult::kEnd: {
        const std::lock_guard<std::mutex> lock(mutex_);
        status_.state = LinkState::kEnded;
        return false;
      }
      case ReadResult::kClosed: {
        const std::lock_guard<std::mutex> lock(mutex_);
        return !barred_ && !stop_;
      }
    }
  }
  return false;
}

// A free block to read into; there always is one, as the queue and the reader leave one over.
SourceBlock& Acquisition::slot() {
  std::unique_lock<std::mutex> lock(mutex_);
  if (writing_ != kNone) return blocks_[writing_];
  if (options_.lossless) {
    freed_.wait(lock, [this] { return stop_ || count_ < ready_.size(); });
  }
  writing_ = free_.back();
  free_.pop_back();
  return blocks_[writing_];
}

void Acquisition::commit() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (count_ == ready_.size()) {
      const std::size_t oldest = ready_[first_];
      first_ = (first_ + 1) % ready_.size();
      --count_;
      free_.push_back(oldest);
      ++status_.dropped_blocks;
      status_.dropped_samples += blocks_[oldest].count;
    }
    ready_[(first_ + count_) % ready_.size()] = writing_;
    ++count_;
    status_.queue_high = std::max(status_.queue_high, count_);
    status_.last_samples = Clock::now();
    if (was_lost_) ++status_.reconnects;
    was_lost_ = false;
    status_.ever_sampled = true;
    status_.fault = blocks_[writing_].fault;
    status_.dynamic_cause.clear();
    status_.back_off = options_.first_back_off;
    writing_ = kNone;
  }
  arrived_.notify_one();
}

void Acquisition::lose(const std::string& reason) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.dynamic_cause = status_.last_loss = reason;
  was_lost_ = was_lost_ || status_.ever_sampled;
}

void Acquisition::backOff() {
  std::unique_lock<std::mutex> lock(mutex_);
  if (stop_) return;
  const auto wait = status_.back_off;
  status_.state = status_.static_cause.empty() ? LinkState::kBackingOff : LinkState::kMisconfigured;
  status_.next_attempt = Clock::now() + wait;
  freed_.wait_until(lock, status_.next_attempt, [this] { return stop_.load(); });
  status_.back_off = std::min(2 * wait, options_.longest_back_off);
}

// ---- the consumer ----

const SourceBlock* Acquisition::next(std::chrono::nanoseconds timeout) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (lent_ != kNone) {
    free_.push_back(lent_);
    lent_ = kNone;
  }
  arrived_.wait_for(lock, timeout, [this] { return count_ > 0 || stop_ || finished_; });
  if (count_ == 0 || stop_) return nullptr;
  lent_ = ready_[first_];
  first_ = (first_ + 1) % ready_.size();
  --count_;
  if (options_.lossless) freed_.notify_all();
  return &blocks_[lent_];
}

LinkStatus Acquisition::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

SourceInfo Acquisition::info() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return info_;
}

void Acquisition::misconfigured(const std::string& cause) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    barred_ = true;
    stop_ = true;
    status_.state = LinkState::kMisconfigured;
    status_.static_cause = cause;
  }
  freed_.notify_all();
  source_.close();
}

bool Acquisition::done() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return barred_ || (finished_ && count_ == 0);
}

}  // namespace assembly_cell
