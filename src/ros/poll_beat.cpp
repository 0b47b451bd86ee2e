// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/poll_beat.h"

#include <ros/poll_manager.h>

#include <algorithm>
#include <thread>
#include <utility>

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::chrono::milliseconds kBehind(100);  // then beats that were missed aren't made up for
constexpr std::chrono::milliseconds kDeaf(5);      // longest time that no socket is looked at

}  // namespace

PollBeat::PollBeat(double period, std::function<void()> beat)
    : period_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(period))),
      beat_(std::move(beat)),
      next_(Clock::now() + period_) {
  // roscpp's own listeners, which send what is published, were there first and come first
  listener_ = ros::PollManager::instance()->addPollThreadListener([this] { onRound(); });
  ros::PollManager::instance()->getPollSet().signal();
}

PollBeat::~PollBeat() { ros::PollManager::instance()->removePollThreadListener(listener_); }

void PollBeat::onRound() {
  switch (round_) {
    case Round::kQueue:
      round_ = Round::kSend;
      break;
    case Round::kSend:
      round_ = Round::kSleep;
      break;
    case Round::kSleep:
      sleep();
      round_ = Clock::now() < next_ ? Round::kQueue : Round::kBeat;
      break;
    case Round::kBeat:
      beat_();
      next_ += period_;
      if (Clock::now() - next_ > kBehind) next_ = Clock::now();
      round_ = Round::kQueue;
      break;
  }
  // the round that follows doesn't wait for a socket
  ros::PollManager::instance()->getPollSet().signal();
}

void PollBeat::sleep() { std::this_thread::sleep_until(std::min(next_, Clock::now() + kDeaf)); }

}  // namespace assembly_cell::ros_bridge
