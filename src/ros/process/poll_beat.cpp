// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/poll_beat.h"

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

// A round of the network thread is its listeners, then its sockets. roscpp's own listeners have
// just handed what the last beat published to its connections. The sockets are looked at from here:
// a round for each look would cost twenty system calls of signals a beat.
void PollBeat::onRound() {
  ros::PollSet& sockets = ros::PollManager::instance()->getPollSet();
  sockets.update(0);  // sends
  std::this_thread::sleep_until(std::min(next_, Clock::now() + kDeaf));
  sockets.update(0);  // takes what has come in
  if (Clock::now() >= next_) {
    beat_();
    next_ += period_;
    if (Clock::now() - next_ > kBehind) next_ = Clock::now();
  }
  sockets.signal();  // the thread's own look doesn't wait for a socket
}

}  // namespace assembly_cell::ros_bridge
