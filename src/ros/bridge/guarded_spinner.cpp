// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/guarded_spinner.h"

#include "assembly_cell/ros/bridge/incoming_log.h"

namespace assembly_cell::ros_bridge {

namespace {

const ros::WallDuration kSlice(0.1);  // of waiting, between checks for the end

}  // namespace

GuardedSpinner::GuardedSpinner(unsigned threads, ros::CallbackQueue* queue)
    : count_(threads), queue_(queue != nullptr ? queue : ros::getGlobalCallbackQueue()) {}

GuardedSpinner::~GuardedSpinner() { stop(); }

void GuardedSpinner::start() {
  for (unsigned k = 0; k < count_; ++k) threads_.emplace_back([this] { spin(); });
}

void GuardedSpinner::stop() {
  stopping_ = true;
  wait();
}

void GuardedSpinner::wait() {
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

// One callback at a time: those after one that throws stay in the queue.
void GuardedSpinner::spin() {
  while (!stopping_ && ros::ok()) {
    guarded("callback", [this] { queue_->callOne(kSlice); });
  }
}

}  // namespace assembly_cell::ros_bridge
