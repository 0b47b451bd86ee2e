// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/callback_queue.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace assembly_cell::ros_bridge {

/// One thread that calls what is in the queues of several nodes of a process, each in its own
/// order. For nodes whose callbacks never wait: what one of them publishes the next one gets
/// without a switch of threads, which costs more than the callback. Exceptions as in
/// GuardedSpinner.
class SharedSpinner {
 public:
  static SharedSpinner& ofThisProcess();
  ~SharedSpinner();
  SharedSpinner(const SharedSpinner&) = delete;
  SharedSpinner& operator=(const SharedSpinner&) = delete;

  /// A queue that tells the thread what comes in.
  class Queue : public ros::CallbackQueue {
   public:
    void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t removal_id) override;

   private:
    friend class SharedSpinner;
    std::atomic<bool> filled_{false};  ///< there may be something in it
  };

  void add(Queue* queue);
  /// Returns once no callback of the queue is under way, and none comes any more.
  void remove(Queue* queue);

  /// Are there any queues?
  bool works() const { return works_; }

  /// Who will have to wait for what callbacks do takes the thread's place: it sleeps until the last
  /// of these has gone.
  class Helper {
   public:
    Helper();
    ~Helper();
    Helper(const Helper&) = delete;
    Helper& operator=(const Helper&) = delete;
    /// Calls what comes in until done() or the deadline, and returns done(). The caller must not
    /// hold what a callback locks.
    bool callUntil(const std::function<bool()>& done,
                   std::chrono::steady_clock::time_point deadline);
  };

 private:
  SharedSpinner() = default;

  void tell();
  void spin();
  void change(const std::function<void()>& what);
  void callEach();  ///< one callback of each queue that has any

  std::mutex calling_;            ///< held while callbacks run
  std::atomic<int> changing_{0};  ///< who want it for something else
  std::vector<Queue*> queues_;
  std::mutex mutex_;
  std::condition_variable told_, helpers_told_;
  bool news_ = false, stopping_ = false;
  bool waiting_ = false;                   ///< the thread, for news
  bool looks_ = false;                     ///< it does so for a moment only
  bool helped_ = false;                    ///< somebody has since it last began to wait
  int helpers_ = 0, helpers_waiting_ = 0;  ///< who do its work
  std::atomic<bool> works_{false};
  std::thread thread_;
};

/// To call `what` by way of a queue.
ros::CallbackInterfacePtr callbackOf(std::function<void()> what);
/// By which it can be taken out of the queue again.
inline std::uint64_t removalId(const ros::CallbackInterfacePtr& callback) {
  return reinterpret_cast<std::uint64_t>(callback.get());
}

}  // namespace assembly_cell::ros_bridge
