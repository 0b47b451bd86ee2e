// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/shared_spinner.h"

#include <algorithm>
#include <boost/make_shared.hpp>
#include <memory>
#include <utility>

#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

namespace {

// So often the thread looks whether helpers that come and go left anything, several blocks of a
// cell in lockstep: who decides for longer keeps callbacks waiting by as much.
constexpr std::chrono::milliseconds kLook{2};

}  // namespace

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
  filled_ = true;
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

void SharedSpinner::add(Queue* queue) {
  change([&] {
    queues_.push_back(queue);
    works_ = true;
    if (!thread_.joinable()) thread_ = std::thread([this] { spin(); });
  });
  tell();
}

void SharedSpinner::remove(Queue* queue) {
  change([&] {
    queues_.erase(std::remove(queues_.begin(), queues_.end(), queue), queues_.end());
    works_ = !queues_.empty();
  });
}

// Between two rounds of calls, however closely they follow each other.
void SharedSpinner::change(const std::function<void()>& what) {
  ++changing_;
  const std::shared_ptr<void> until_return(nullptr, [this](void*) { --changing_; });
  const std::lock_guard<std::mutex> lock(calling_);
  what();
}

// One at a time: what is behind one that throws stays in the queue. What is left, and what comes in
// meanwhile, is news.
void SharedSpinner::callEach() {
  while (changing_ > 0) std::this_thread::yield();
  const std::lock_guard<std::mutex> calling(calling_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    news_ = false;
  }
  bool called = false, left = false;
  for (Queue* queue : queues_) {
    if (!queue->filled_.exchange(false)) continue;
    guarded("callback", [&] { queue->callOne(ros::WallDuration(0.0)); });
    called = true;
    if (queue->isEmpty()) continue;
    queue->filled_ = true;
    left = true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  // what another one waits for may have been done here
  const bool others = called && helpers_waiting_ > 0;
  if (left || others) news_ = true;
  if (others) helpers_told_.notify_all();
}

void SharedSpinner::spin() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    waiting_ = true;
    const auto has_work = [this] { return (news_ && helpers_ == 0) || stopping_; };
    while (!has_work()) {
      // what the last helper left waits for the next one, or for this
      looks_ = helped_;
      helped_ = false;
      if (looks_) {
        told_.wait_for(lock, kLook);
      } else {
        told_.wait(lock);
      }
    }
    waiting_ = looks_ = false;
    lock.unlock();
    callEach();
    lock.lock();
  }
}

SharedSpinner::Helper::Helper() {
  SharedSpinner& shared = ofThisProcess();
  const std::lock_guard<std::mutex> lock(shared.mutex_);
  ++shared.helpers_;
  shared.helped_ = true;
}

SharedSpinner::Helper::~Helper() {
  SharedSpinner& shared = ofThisProcess();
  const std::lock_guard<std::mutex> lock(shared.mutex_);
  if (--shared.helpers_ > 0 || !shared.news_ || !shared.waiting_) return;
  // one that helps again and again needs no other thread to wake up each time
  if (!shared.looks_) shared.told_.notify_one();
}

bool SharedSpinner::Helper::callUntil(const std::function<bool()>& done,
                                      std::chrono::steady_clock::time_point deadline) {
  SharedSpinner& shared = ofThisProcess();
  while (true) {
    shared.callEach();
    const bool is_done = done();
    if (is_done || std::chrono::steady_clock::now() >= deadline) return is_done;
    std::unique_lock<std::mutex> lock(shared.mutex_);
    ++shared.helpers_waiting_;
    shared.helpers_told_.wait_until(lock, deadline, [&] { return shared.news_; });
    --shared.helpers_waiting_;
  }
}

namespace {

class Call : public ros::CallbackInterface {
 public:
  explicit Call(std::function<void()> what) : what_(std::move(what)) {}
  CallResult call() override {
    what_();
    return Success;
  }

 private:
  std::function<void()> what_;
};

}  // namespace

ros::CallbackInterfacePtr callbackOf(std::function<void()> what) {
  return boost::make_shared<Call>(std::move(what));
}

}  // namespace assembly_cell::ros_bridge
