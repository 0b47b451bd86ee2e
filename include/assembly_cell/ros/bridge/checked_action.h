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

/// An action with one goal at a time, as actionlib::SimpleActionServer has it: a new goal preempts
/// the one before. It differs where a message from anywhere could do harm:
/// - goals and cancels are checked first; absurd stamps and long ids are refused and named. A goal
///   that is refused for what it holds is answered (REJECTED, the text says why).
/// - The last goal to arrive counts, whatever the stamps say: a clock that was set back, or a
///   simulation that began anew, recalls no goal.
/// - What `execute` throws ends the goal (ABORTED, with the text), not the process.
/// - A flood of goals or cancels can't fill the memory.
template <class Spec>
class CheckedActionServer : private actionlib::ActionServerBase<Spec> {
  using Base = actionlib::ActionServerBase<Spec>;
  using Handle = typename Base::GoalHandle;
  using Status = actionlib_msgs::GoalStatus;

 public:
  ACTION_DEFINITION(Spec)
  using Execute = std::function<void(const GoalConstPtr&)>;

  /// `execute` runs in a thread of its own, from start() on.
  CheckedActionServer(const ros::NodeHandle& nh, const std::string& name, Execute execute)
      : Base({}, {}), nh_(nh, name), execute_(std::move(execute)) {
    this->registerGoalCallback([this](Handle goal) { onGoal(goal); });
    this->registerCancelCallback([this](Handle goal) { onCancel(goal); });
  }

  ~CheckedActionServer() override { shutdown(); }

  void start() {
    thread_ = std::thread([this] { loop(); });
    Base::start();
  }

  /// Waits for the end of the goal under way: `execute` must see that the node ends.
  void shutdown() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
    goal_sub_.shutdown();
    cancel_sub_.shutdown();
    status_timer_.stop();
  }

  /// The goal under way was cancelled, or another one came.
  bool isPreemptRequested() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return preempted_;
  }

  void publishFeedback(const Feedback& feedback) {
    if (std::optional<Handle> goal = current()) goal->publishFeedback(feedback);
  }
  void setSucceeded(const Result& result, const std::string& text) {
    if (std::optional<Handle> goal = current()) goal->setSucceeded(result, text);
  }
  void setPreempted(const Result& result, const std::string& text) {
    if (std::optional<Handle> goal = current()) goal->setCanceled(result, text);
  }
  void setAborted(const Result& result, const std::string& text) {
    if (std::optional<Handle> goal = current()) goal->setAborted(result, text);
  }
  /// Succeeded, or else preempted where that was asked for, or else aborted.
  void finish(bool success, const Result& result, const std::string& text) {
    if (success) {
      setSucceeded(result, text);
    } else if (isPreemptRequested()) {
      setPreempted(result, text);
    } else {
      setAborted(result, text);
    }
  }

 private:
  static constexpr std::uint32_t kQueue = 50;
  static constexpr double kStatusPeriod = 0.2;        // wall clock [s]
  static constexpr double kStatusLife = 5.0;          // of a goal's status after its end [s]
  static constexpr std::size_t kMostStatuses = 1000;  // goals and cancels remembered

  std::optional<Handle> current() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return current_;
  }

  // ---- the wire ----

  void initialize() override {
    result_pub_ = nh_.template advertise<ActionResult>("result", kQueue);
    feedback_pub_ = nh_.template advertise<ActionFeedback>("feedback", kQueue);
    status_pub_ = nh_.template advertise<actionlib_msgs::GoalStatusArray>("status", kQueue, true);
    status_timer_ = nh_.createWallTimer(ros::WallDuration(kStatusPeriod),
                                        [this](const ros::WallTimerEvent&) { publishStatus(); });
    goal_sub_ = nh_.template subscribe<ActionGoal, const ros::MessageEvent<ActionGoal const>&>(
        "goal", kQueue,
        [this](const ros::MessageEvent<ActionGoal const>& event) { receiveGoal(event); });
    cancel_sub_ = nh_.template subscribe<actionlib_msgs::GoalID,
                                         const ros::MessageEvent<actionlib_msgs::GoalID const>&>(
        "cancel", kQueue, [this](const ros::MessageEvent<actionlib_msgs::GoalID const>& event) {
          receiveCancel(event);
        });
  }

  // empty, or why the message is dropped
  std::string faultOf(const actionlib_msgs::GoalID& id) {
    MessageCheck check;
    check.name("goal_id.id", id.id).stamp("goal_id.stamp", id.stamp.toSec());
    if (!check.good()) return check.text();
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    if (this->status_list_.size() < kMostStatuses) return {};
    return "more than " + std::to_string(kMostStatuses) + " goals within some seconds";
  }

  // Stamps from the future count as now: what was cancelled "up to" them would stay so for ever.
  template <class Message, class Edit>
  boost::shared_ptr<const Message> notFromFuture(const boost::shared_ptr<const Message>& message,
                                                 const Edit& stampOf) {
    const ros::Time now = ros::Time::now();
    if (stampOf(*message) <= now) return message;
    const auto copy = boost::make_shared<Message>(*message);
    const_cast<ros::Time&>(stampOf(*copy)) = now;
    return copy;
  }

  void receiveGoal(const ros::MessageEvent<ActionGoal const>& event) {
    guarded(goal_sub_.getTopic(), [&] {
      const std::string fault = faultOf(event.getConstMessage()->goal_id);
      if (!fault.empty()) {
        IncomingLog::ofThisProcess().refuse(goal_sub_.getTopic(), event.getPublisherName(), fault);
        return;
      }
      const auto goal = notFromFuture<ActionGoal>(
          event.getConstMessage(),
          [](const auto& m) -> const ros::Time& { return m.goal_id.stamp; });
      {
        // the clock was set back since a cancel
        const boost::recursive_mutex::scoped_lock lock(this->lock_);
        if (this->last_cancel_ > ros::Time::now()) this->last_cancel_ = ros::Time();
      }
      Base::goalCallback(goal);
    });
  }

  void receiveCancel(const ros::MessageEvent<actionlib_msgs::GoalID const>& event) {
    guarded(cancel_sub_.getTopic(), [&] {
      const std::string fault = faultOf(*event.getConstMessage());
      if (!fault.empty()) {
        IncomingLog::ofThisProcess().refuse(cancel_sub_.getTopic(), event.getPublisherName(),
                                            fault);
        return;
      }
      Base::cancelCallback(notFromFuture<actionlib_msgs::GoalID>(
          event.getConstMessage(), [](const auto& m) -> const ros::Time& { return m.stamp; }));
      // a cancel that comes before its goal is remembered for a while, not for ever
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
    result_pub_.publish(message);
    publishStatus();
  }

  void publishFeedback(const Status& status, const Feedback& feedback) override {
    const boost::recursive_mutex::scoped_lock lock(this->lock_);
    ActionFeedback message;
    message.header.stamp = ros::Time::now();
    message.status = status;
    message.feedback = feedback;
    feedback_pub_.publish(message);
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
      const bool old = !ended.isZero() && std::abs((now - ended).toSec()) > kStatusLife;
      it = old ? this->status_list_.erase(it) : std::next(it);
    }
    status_pub_.publish(message);
  }

  // ---- one goal at a time ----

  void onGoal(Handle goal) {
    const MessageCheck found = check(*goal.getGoal());
    if (!found.good()) {
      const std::string text = "goal refused: " + found.text();
      IncomingLog::ofThisProcess().refuse(goal_sub_.getTopic(), goal.getGoalID().id, found.text());
      goal.setRejected(Result(), text);
      return;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (next_) next_->setCanceled(Result(), "another goal came");
    next_ = goal;
    next_cancelled_ = false;
    if (current_) preempted_ = true;
    changed_.notify_all();
  }

  void onCancel(Handle goal) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (current_ && goal == *current_) preempted_ = true;
    if (next_ && goal == *next_) next_cancelled_ = true;
  }

  void loop() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return stopping_ || next_; });
      if (stopping_) return;
      current_.swap(next_);
      next_.reset();
      preempted_ = std::exchange(next_cancelled_, false);
      Handle goal = *current_;
      lock.unlock();
      goal.setAccepted("accepted");
      std::string failure = "the goal ended without a result";
      try {
        execute_(goal.getGoal());
      } catch (const std::exception& error) {
        failure = error.what();
        IncomingLog::ofThisProcess().caught(nh_.getNamespace(), failure);
      }
      const auto status = goal.getGoalStatus().status;
      if (status == Status::ACTIVE || status == Status::PREEMPTING) {
        goal.setAborted(Result(), failure);
      }
      lock.lock();
      current_.reset();
    }
  }

  ros::NodeHandle nh_;
  const Execute execute_;
  ros::Publisher result_pub_, feedback_pub_, status_pub_;
  ros::Subscriber goal_sub_, cancel_sub_;
  ros::WallTimer status_timer_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Handle> current_, next_;
  bool preempted_ = false, next_cancelled_ = false, stopping_ = false;
  std::thread thread_;  // last: what it uses is there before and after
};

}  // namespace assembly_cell::ros_bridge
