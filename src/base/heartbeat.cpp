// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/heartbeat.h"

#include <utility>

namespace assembly_cell {

Heartbeat::Heartbeat(std::chrono::milliseconds pause, std::function<void(double)> report)
    : pause_(pause), report_(std::move(report)), next_(begun_ + pause) {
  thread_ = std::thread([this] { beat(); });
}

Heartbeat::~Heartbeat() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
  }
  end_.notify_one();
  thread_.join();
}

void Heartbeat::rest() {
  const std::lock_guard<std::mutex> lock(mutex_);
  next_ = std::chrono::steady_clock::now() + pause_;
}

void Heartbeat::beat() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!ended_) {
    if (std::chrono::steady_clock::now() < next_) {
      end_.wait_until(lock, next_);
      continue;
    }
    const auto now = std::chrono::steady_clock::now();
    next_ = now + pause_;
    // the report may own a lock of the caller, which rest() is called under
    lock.unlock();
    report_(std::chrono::duration<double>(now - begun_).count());
    lock.lock();
  }
}

}  // namespace assembly_cell
