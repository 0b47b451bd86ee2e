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
    waits = waiting_ && helpers_ == 0;
    helper_waits = helpers_waiting_ > 0;
  }
  if (waits) told_.notify_one();
  if (helper_waits) helpers_told_.notify_all();
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

// Until nothing is left: what comes in after that is news.
void SharedSpinner::callAll() {
  do {
    const std::lock_guard<std::mutex> lock(mutex_);
    news_ = false;
  } while (callEach());
}

void SharedSpinner::spin() {
  while (true) {
    {
      std::unique_lock<std::mutex> lock(mutex_);
      waiting_ = true;
      told_.wait(lock, [this] { return (news_ && helpers_ == 0) || stopping_; });
      waiting_ = false;
      if (stopping_) return;
    }
    callAll();
  }
}

SharedSpinner::Helper::Helper() {
  SharedSpinner& shared = ofThisProcess();
  const std::lock_guard<std::mutex> lock(shared.mutex_);
  ++shared.helpers_;
}

SharedSpinner::Helper::~Helper() {
  SharedSpinner& shared = ofThisProcess();
  const std::lock_guard<std::mutex> lock(shared.mutex_);
  if (--shared.helpers_ == 0 && shared.news_ && shared.waiting_) shared.told_.notify_one();
}

bool SharedSpinner::Helper::callUntil(const std::function<bool()>& done,
                                      std::chrono::steady_clock::time_point deadline) {
  SharedSpinner& shared = ofThisProcess();
  while (true) {
    shared.callAll();
    if (done()) return true;
    std::unique_lock<std::mutex> lock(shared.mutex_);
    ++shared.helpers_waiting_;
    const bool news = shared.helpers_told_.wait_until(lock, deadline, [&] { return shared.news_; });
    --shared.helpers_waiting_;
    if (!news) return false;
  }
}

}  // namespace assembly_cell::ros_bridge
