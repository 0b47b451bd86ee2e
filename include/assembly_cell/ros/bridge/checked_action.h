// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/server/action_server_base.h>
#include <ros/ros.h>

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

/// The goals of an action, one at a time: a new goal preempts the one before. Thread-safe.
template <class Handle>
class GoalQueue {
 public:
  /// The next goal; one that waits already is returned: it is replaced. by: its client.
  std::optional<Handle> push(const Handle& goal, const std::string& by) {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::optional<Handle> replaced = std::exchange(next_, goal);
    next_cancelled_ = false;
    if (current_) preempt(by + ", another goal");
    changed_.notify_all();
    return replaced;
  }
  void cancel(const Handle& goal, const std::string& by) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (current_ && goal == *current_) preempt(by);
    if (next_ && goal == *next_) {
      next_cancelled_ = true;
      next_cancelled_by_ = by;
    }
  }
  /// Waits for the next goal, which becomes the current one; none after stop().
  std::optional<Handle> pop() {
    std::unique_lock<std::mutex> lock(mutex_);
    current_.reset();
    changed_.wait(lock, [this] { return stopping_ || next_; });
    if (stopping_) return std::nullopt;
    current_.swap(next_);
    preempted_ = std::exchange(next_cancelled_, false);
    preempted_by_ = preempted_ ? next_cancelled_by_ : "";
    return current_;
  }
  void stop() {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  std::optional<Handle> current() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return current_;
  }
  /// The goal that has arrived after the current one.
  std::optional<Handle> next() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return next_;
  }
  /// The current goal was cancelled, or another one has arrived.
  bool isPreempted() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return preempted_;
  }
  /// Node that has preempted the current goal; empty: none.
  std::string preemptedBy() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return preempted_by_;
  }

 private:
  void preempt(const std::string& by) {
    if (!preempted_) preempted_by_ = by;
    preempted_ = true;
  }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Handle> current_, next_;
  bool preempted_ = false, next_cancelled_ = false, stopping_ = false;
  std::string preempted_by_, next_cancelled_by_;
};

/// Empty, or why a goal or a cancel is refused: its id.
inline std::string faultOf(const actionlib_msgs::GoalID& id) {
  MessageCheck check;
  check.name("goal_id.id", id.id).stamp("goal_id.stamp", id.stamp.toSec());
  return check.good() ? std::string() : check.text();
}

/// The message, with a stamp from the future set to now: all goals up to the stamp of a cancel are
/// cancelled, for ever if it is far ahead. stampOf: the stamp in a message.
template <class Message, class StampOf>
boost::shared_ptr<const Message> notFromFuture(const boost::shared_ptr<const Message>& message,
                                               const StampOf& stampOf) {
  const ros::Time now = ros::Time::now();
  if (stampOf(*message) <= now) return message;
  const auto copy = boost::make_shared<Message>(*message);
  const_cast<ros::Time&>(stampOf(*copy)) = now;
  return copy;
}

/// An action with one goal at a time, as actionlib::SimpleActionServer, but robust against any
/// message:
/// - goals and cancels are checked; those with absurd stamps or long ids are refused and logged. A
///   goal that is refused for its content is answered (REJECTED, with the reason).
/// - The goal that arrived last is the valid one, whatever the stamps are: after the clock was set
///   back, or a simulation was restarted, no goal is recalled.
/// - An exception of `execute` ends the goal (ABORTED, with its text), not the process.
/// - The number of goals and cancels that are remembered is limited.
template <class Spec>
class CheckedActionServer : private actionlib::ActionServerBase<Spec> {
  using Base = actionlib::ActionServerBase<Spec>;
  using Handle = typename Base::GoalHandle;

 public:
  ACTION_DEFINITION(Spec)
  using Execute = std::function<void(const GoalConstPtr&)>;
  using Status = actionlib_msgs::GoalStatus;

  /// `execute` runs in a thread of its own, from start() on.
  CheckedActionServer(const ros::NodeHandle& nh, const std::string& name, Execute execute)
      : Base({}, {}), nh_(nh, name), execute_(std::move(execute)) {
    this->registerGoalCallback([this](Handle goal) { onGoal(goal); });
    this->registerCancelCallback([this](Handle goal) { goals_.cancel(goal, sender_); });
  }

  ~CheckedActionServer() override { shutdown(); }

  void start() {
    thread_ = std::thread([this] {
      while (std::optional<Handle> goal = goals_.pop()) {
        goal->setAccepted("accepted");
        std::string failure = "the goal ended without a result";
        try {
          execute_(goal->getGoal());
        } catch (const std::exception& error) {
          failure = error.what();
          IncomingLog::ofThisProcess().caught(nh_.getNamespace(), failure);
        }
        const auto status = goal->getGoalStatus().status;
        if (status == Status::ACTIVE || status == Status::PREEMPTING) {
          goal->setAborted(Result(), failure);
        }
      }
    });
    Base::start();
  }

  /// Waits for the end of the current goal: `execute` must notice that the node ends.
  void shutdown() {
    goals_.stop();
    if (thread_.joinable()) thread_.join();
    topics_.goal.shutdown();
    topics_.cancel.shutdown();
    topics_.timer.stop();
  }

  /// The current goal was cancelled, or another one has arrived.
  bool isPreemptRequested() const { return goals_.isPreempted(); }
  /// Why: "cancelled", or the id of the goal that has arrived; clients begin it with their name.
  std::string preemptReason() const {
    const std::optional<Handle> next = goals_.next();
    return next ? "replaced by the goal " + next->getGoalID().id + ": one goal runs at a time"
                : "cancelled";
  }
  const GoalQueue<Handle>& goals() const { return goals_; }

  void publishFeedback(const Feedback& feedback) {
    if (std::optional<Handle> goal = goals_.current()) goal->publishFeedback(feedback);
  }
  /// Ends the current goal. status: SUCCEEDED, PREEMPTED or ABORTED.
  void end(std::uint8_t status, const Result& result, const std::string& text) {
    std::optional<Handle> goal = goals_.current();
    if (!goal) return;
    if (status == Status::SUCCEEDED) goal->setSucceeded(result, text);
    if (status == Status::PREEMPTED) goal->setCanceled(result, text);
    if (status == Status::ABORTED) goal->setAborted(result, text);
  }
  /// Succeeded, or preempted where that was requested, or else aborted.
  void finish(bool success, const Result& result, const std::string& text) {
    const std::uint8_t failure = isPreemptRequested() ? Status::PREEMPTED : Status::ABORTED;
    end(success ? std::uint8_t{Status::SUCCEEDED} : failure, result, text);
  }

 private:
  static constexpr std::uint32_t kQueueSize = 50;
  static constexpr double kStatusPeriod = 0.2;       // wall clock [s]
  static constexpr double kStatusTime = 5.0;         // status of a goal after its end [s]
  static constexpr std::size_t kMaxStatuses = 1000;  // goals and cancels that are remembered

  // ---- messages ----

  void initialize() override {
    topics_.result = nh_.template advertise<ActionResult>("result", kQueueSize);
    topics_.feedback = nh_.template advertise<ActionFeedback>("feedback", kQueueSize);
    topics_.status =
        nh_.template advertise<actionlib_msgs::GoalStatusArray>("status", kQueueSize, true);
    topics_.timer = nh_.createWallTimer(ros::WallDuration(kStatusPeriod),
                                        [this](const ros::WallTimerEvent&) { publishStatus(); });
    topics_.goal = nh_.template subscribe<ActionGoal, const ros::MessageEvent<ActionGoal const>&>(
        "goal", kQueueSize,
        [this](const ros::MessageEvent<ActionGoal const>& event) { receiveGoal(event); });
    topics_.cancel = nh_.template subscribe<actionlib_msgs::GoalID,
                                            const ros::MessageEvent<actionlib_msgs::GoalID const>&>(
        "cancel", kQueueSize, [this](const ros::MessageEvent<actionlib_msgs::GoalID const>& event) {
          receiveCancel(event);
        });
  }

  // Empty, or why a goal or a cancel is refused.
  std::string refusalOf(const actionlib_msgs::GoalID& id) {
    const std::string fault = faultOf(id);
    if (!fault.empty()) return fault;
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    if (this->status_list_.size() < kMaxStatuses) return {};
    return "more than " + std::to_string(kMaxStatuses) + " goals within some seconds";
  }

  void receiveGoal(const ros::MessageEvent<ActionGoal const>& event) {
    guarded(topics_.goal.getTopic(), [&] {
      const std::string fault = refusalOf(event.getConstMessage()->goal_id);
      if (!fault.empty()) {
        IncomingLog::ofThisProcess().refuse(topics_.goal.getTopic(), event.getPublisherName(),
                                            fault);
        return;
      }
      const auto goal = notFromFuture<ActionGoal>(
          event.getConstMessage(),
          [](const auto& m) -> const ros::Time& { return m.goal_id.stamp; });
      {
        // the clock was set back after a cancel
        const boost::recursive_mutex::scoped_lock lock(this->lock_);
        if (this->last_cancel_ > ros::Time::now()) this->last_cancel_ = ros::Time();
      }
      sender_ = event.getPublisherName();
      Base::goalCallback(goal);
    });
  }

  void receiveCancel(const ros::MessageEvent<actionlib_msgs::GoalID const>& event) {
    guarded(topics_.cancel.getTopic(), [&] {
      const std::string fault = refusalOf(*event.getConstMessage());
      if (!fault.empty()) {
        IncomingLog::ofThisProcess().refuse(topics_.cancel.getTopic(), event.getPublisherName(),
                                            fault);
        return;
      }
      sender_ = event.getPublisherName();
      Base::cancelCallback(notFromFuture<actionlib_msgs::GoalID>(
          event.getConstMessage(), [](const auto& m) -> const ros::Time& { return m.stamp; }));
      // a cancel that arrives before its goal is remembered for kStatusTime
      const boost::recursive_mutex::scoped_lock lock(this->lock_);
      for (auto& tracker : this->status_list_) {
        if (tracker.handle_tracker_.expired()) tracker.handle_destruction_time_ = ros::Time::now();
      }
    });
  }

  void publishResult(const Status& status, const Result& result) override {
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    ActionResult message;
    message.header.stamp = ros::Time::now();
    message.status = status;
    message.result = result;
    topics_.result.publish(message);
    publishStatus();
  }

  void publishFeedback(const Status& status, const Feedback& feedback) override {
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    ActionFeedback message;
    message.header.stamp = ros::Time::now();
    message.status = status;
    message.feedback = feedback;
    topics_.feedback.publish(message);
  }

  void publishStatus() override {
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    if (!this->started_) return;
    const ros::Time now = ros::Time::now();
    actionlib_msgs::GoalStatusArray message;
    message.header.stamp = now;
    for (auto it = this->status_list_.begin(); it != this->status_list_.end();) {
      message.status_list.push_back(it->status_);
      const ros::Time ended = it->handle_destruction_time_;
      const bool old = !ended.isZero() && std::abs((now - ended).toSec()) > kStatusTime;
      it = old ? this->status_list_.erase(it) : std::next(it);
    }
    topics_.status.publish(message);
  }

  // ---- one goal at a time ----

  void onGoal(Handle goal) {
    const MessageCheck found = check(*goal.getGoal());
    if (!found.good()) {
      const std::string text = "goal refused: " + found.text();
      IncomingLog::ofThisProcess().refuse(topics_.goal.getTopic(), goal.getGoalID().id,
                                          found.text());
      goal.setRejected(Result(), text);
      return;
    }
    if (std::optional<Handle> replaced = goals_.push(goal, sender_)) {
      replaced->setCanceled(Result(), "another goal came");
    }
  }

  ros::NodeHandle nh_;
  const Execute execute_;
  struct {
    ros::Publisher result, feedback, status;
    ros::Subscriber goal, cancel;
    ros::WallTimer timer;  // of status
  } topics_;
  GoalQueue<Handle> goals_;
  std::string sender_;  // of the goal or cancel that is received; in the callbacks' thread
  std::thread thread_;  // last: uses the other members
};

}  // namespace assembly_cell::ros_bridge
