// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/shared_spinner.h"

#include <algorithm>

#include "assembly_cell/ros/message_guard.h"

namespace assembly_cell::ros_bridge {

SharedSpinner& SharedSpinner::ofThisProcess() {
  static SharedSpinner spinner;
  return spinner;
}

SharedSpinner::~SharedSpinner() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  told_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void SharedSpinner::Queue::addCallback(const ros::CallbackInterfacePtr& callback,
                                       std::uint64_t removal_id) {
  ros::CallbackQueue::addCallback(callback, removal_id);
  ofThisProcess().tell();
}

void SharedSpinner::tell() {
  bool waits = false, helper_waits = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    news_ = true;
    waits = waiting_ && !helped_;
    helper_waits = helper_waiting_;
  }
  if (waits) told_.notify_one();
  if (helper_waits) helper_told_.notify_one();
}

void SharedSpinner::add(ros::CallbackQueue* queue) {
  {
    const std::lock_guard<std::mutex> lock(calling_);
    queues_.push_back(queue);
    works_ = true;
    if (!thread_.joinable()) thread_ = std::thread([this] { spin(); });
  }
  tell();
}

void SharedSpinner::remove(ros::CallbackQueue* queue) {
  const std::lock_guard<std::mutex> lock(calling_);
  queues_.erase(std::remove(queues_.begin(), queues_.end(), queue), queues_.end());
  works_ = !queues_.empty();
}

// One at a time: what is behind one that throws stays in the queue.
bool SharedSpinner::callEach() {
  const std::lock_guard<std::mutex> lock(calling_);
  bool called = false;
  for (ros::CallbackQueue* queue : queues_) {
    guarded("callback",
            [&] { called |= queue->callOne(ros::WallDuration(0.0)) != ros::CallbackQueue::Empty; });
  }
  return called;
}

void SharedSpinner::spin() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    waiting_ = true;
    told_.wait(lock, [this] { return (news_ && !helped_) || stopping_; });
    waiting_ = news_ = false;
    lock.unlock();
    while (callEach()) {
    }
    lock.lock();
  }
}

bool SharedSpinner::helpUntil(const std::function<bool()>& done,
                              std::chrono::steady_clock::time_point deadline) {
  std::unique_lock<std::mutex> lock(mutex_);
  helped_ = true;
  bool ended = false, late = false;
  while (!ended && !late) {
    news_ = false;
    lock.unlock();
    do {
      ended = done();
    } while (!ended && callEach());
    lock.lock();
    if (ended) break;
    helper_waiting_ = true;
    late = !helper_told_.wait_until(lock, deadline, [this] { return news_; });
    helper_waiting_ = false;
  }
  helped_ = false;
  // what is left, and what came in since
  news_ = true;
  if (waiting_) told_.notify_one();
  return ended;
}

}  // namespace assembly_cell::ros_bridge
