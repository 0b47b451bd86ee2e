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

  /// A queue that notifies the spinner of callbacks.
  class Queue : public ros::CallbackQueue {
   public:
    void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t removal_id) override;

   private:
    friend class SharedSpinner;
    std::atomic<bool> filled_{false};  ///< may have callbacks
  };

  void add(Queue* queue);
  /// Returns once no callback of the queue is running; none is called any more.
  void remove(Queue* queue);

  /// Has it any queues?
  bool works() const { return works_; }

  /// While a thread that waits for callbacks has a Helper, it calls them itself and the spinner's
  /// thread sleeps.
  class Helper {
   public:
    Helper();
    ~Helper();
    Helper(const Helper&) = delete;
    Helper& operator=(const Helper&) = delete;
    /// Calls callbacks until done() or the deadline, and returns done(). The caller must not own a
    /// mutex that a callback locks.
    bool callUntil(const std::function<bool()>& done,
                   std::chrono::steady_clock::time_point deadline);
  };

 private:
  SharedSpinner() = default;

  void notify();
  void spin();
  void change(const std::function<void()>& what);
  void callEach();  ///< one callback of each queue that has any

  std::mutex calling_;            ///< held while callbacks run
  std::atomic<int> changing_{0};  ///< threads that wait for it in change()
  std::vector<Queue*> queues_;
  std::mutex mutex_;
  std::condition_variable changed_, helpers_changed_;
  bool pending_ = false, stopping_ = false;  ///< callbacks
  bool waiting_ = false;                     ///< the thread waits for callbacks
  bool checks_ = false;                      ///< it waits for one period only
  bool helped_ = false;                      ///< there was a helper since it began to wait
  int helpers_ = 0, helpers_waiting_ = 0;
  std::atomic<bool> works_{false};
  std::thread thread_;
};

/// A callback for a queue that calls `what`.
ros::CallbackInterfacePtr callbackOf(std::function<void()> what);
/// Number by which it can be removed from the queue.
inline std::uint64_t removalId(const ros::CallbackInterfacePtr& callback) {
  return reinterpret_cast<std::uint64_t>(callback.get());
}

}  // namespace assembly_cell::ros_bridge
