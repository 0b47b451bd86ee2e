// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/periodic_thread.h"

#include <utility>

#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::chrono::milliseconds kMaxBehind(100);

}  // namespace

void PeriodicThread::start(double period, std::function<void()> work) {
  using Duration = std::chrono::steady_clock::duration;
  const auto step = std::chrono::duration_cast<Duration>(std::chrono::duration<double>(period));
  thread_ = std::thread([this, step, call = std::move(work)] { run(step, call); });
}

void PeriodicThread::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void PeriodicThread::run(std::chrono::steady_clock::duration period,
                         const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  auto next = Clock::now() + period;
  std::unique_lock<std::mutex> lock(mutex_);
  while (!changed_.wait_until(lock, next, [this] { return stopping_; })) {
    lock.unlock();
    guarded("periodic thread", work);
    lock.lock();
    next += period;
    if (Clock::now() - next > kMaxBehind) next = Clock::now();
  }
}

}  // namespace assembly_cell::ros_bridge
