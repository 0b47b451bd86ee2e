// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/plant_monitor.h"

namespace assembly_cell::ros_bridge {

void PlantMonitor::beginStep() {
  if (lockstep_) helper_.emplace();
}

void PlantMonitor::waitForChange(Lock& lock, const std::function<bool()>& ready) {
  const auto until = Steady::now() + std::chrono::duration_cast<Steady::duration>(
                                         std::chrono::duration<double>(kTick));
  if (!lockstep_ || !SharedSpinner::ofThisProcess().works()) {
    changed_.wait_until(lock, until);
    onActivity();
    return;
  }
  const auto is_ready = [&] {
    const Lock check = this->lock();
    return ready();
  };
  lock.unlock();
  SharedSpinner::Helper().callUntil(is_ready, until);
  lock.lock();
  onActivity();
}

void PlantMonitor::runUnlocked(Lock& lock, const std::function<void()>& call) {
  const bool in_step = helper_.has_value();
  helper_.reset();
  lock.unlock();
  call();
  lock.lock();
  if (in_step) helper_.emplace();
}

}  // namespace assembly_cell::ros_bridge
