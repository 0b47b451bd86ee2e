// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/shared_spinner.h"

#include <algorithm>
#include <boost/make_shared.hpp>
#include <memory>
#include <utility>

#include "assembly_cell/ros/bridge/incoming_log.h"

namespace assembly_cell::ros_bridge {

namespace {

// Period in which the thread checks for callbacks that helpers have left, several blocks of a cell
// in lockstep. A strategy that computes for longer delays callbacks by as much.
constexpr std::chrono::milliseconds kCheckPeriod{2};

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
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void SharedSpinner::Queue::addCallback(const ros::CallbackInterfacePtr& callback,
                                       std::uint64_t removal_id) {
  ros::CallbackQueue::addCallback(callback, removal_id);
  filled_ = true;
  ofThisProcess().notify();
}

void SharedSpinner::notify() {
  bool waits = false, helper_waits = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    pending_ = true;
    waits = waiting_ && helpers_ == 0;
    helper_waits = helpers_waiting_ > 0;
  }
  if (waits) changed_.notify_one();
  if (helper_waits) helpers_changed_.notify_all();
}

void SharedSpinner::add(Queue* queue) {
  change([&] {
    queues_.push_back(queue);
    works_ = true;
    if (!thread_.joinable()) thread_ = std::thread([this] { spin(); });
  });
  notify();
}

void SharedSpinner::remove(Queue* queue) {
  change([&] {
    queues_.erase(std::remove(queues_.begin(), queues_.end(), queue), queues_.end());
    works_ = !queues_.empty();
  });
}

// Between two rounds of callbacks, also while these follow each other without a pause.
void SharedSpinner::change(const std::function<void()>& what) {
  ++changing_;
  const std::shared_ptr<void> until_return(nullptr, [this](void*) { --changing_; });
  const std::lock_guard<std::mutex> lock(calling_);
  what();
}

// One callback of each queue at a time: those after one that throws stay in the queue. Remaining
// and new ones are pending.
void SharedSpinner::callEach() {
  while (changing_ > 0) std::this_thread::yield();
  const std::lock_guard<std::mutex> calling(calling_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    pending_ = false;
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
  // may have been what another helper waits for
  const bool others = called && helpers_waiting_ > 0;
  if (left || others) pending_ = true;
  if (others) helpers_changed_.notify_all();
}

void SharedSpinner::spin() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    waiting_ = true;
    const auto has_work = [this] { return (pending_ && helpers_ == 0) || stopping_; };
    while (!has_work()) {
      // callbacks that the last helper left are called by the next one, or here
      checks_ = helped_;
      helped_ = false;
      if (checks_) {
        changed_.wait_for(lock, kCheckPeriod);
      } else {
        changed_.wait(lock);
      }
    }
    waiting_ = checks_ = false;
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
  if (--shared.helpers_ > 0 || !shared.pending_ || !shared.waiting_) return;
  // a helper that returns soon needs no other thread
  if (!shared.checks_) shared.changed_.notify_one();
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
    shared.helpers_changed_.wait_until(lock, deadline, [&] { return shared.pending_; });
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
