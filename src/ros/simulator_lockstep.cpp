// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// How the simulator waits for its participants.
#include <algorithm>
#include <cmath>

#include "assembly_cell/ros/conversions.h"
#include "assembly_cell/ros/shared_spinner.h"
#include "assembly_cell/ros/simulator_node.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::chrono::seconds kAskAgain{2};  // of who has not answered a block, wall clock
constexpr int kConnectionCheck = 3;           // so many of them
constexpr double kStamp = 1e-6;               // rounding of stamps [s]

}  // namespace

void SimulatorNode::subscribeToAcks() {
  ack_sub_.shutdown();
  ack_sub_ =
      nh_.subscribe("ack", kQueue, &SimulatorNode::onAck, this, ros::TransportHints().tcpNoDelay());
}

// Where nodes share a thread it is this one that works for it meanwhile.
bool SimulatorNode::waitUntil(std::unique_lock<std::mutex>& lock,
                              std::chrono::steady_clock::time_point limit,
                              const std::function<bool()>& ready) {
  if (!SharedSpinner::ofThisProcess().works()) return changed_.wait_until(lock, limit, ready);
  constexpr std::chrono::milliseconds slice(100);  // then the end of the node is looked for
  const auto done = [&] {
    const std::lock_guard<std::mutex> look(mutex_);
    return ready();
  };
  lock.unlock();
  SharedSpinner::Helper helper;
  bool is_ready = false;
  for (auto now = std::chrono::steady_clock::now(); !is_ready && now < limit;
       now = std::chrono::steady_clock::now()) {
    is_ready = helper.callUntil(done, std::min(limit, now + slice));
  }
  lock.lock();
  return is_ready;
}

void SimulatorNode::waitForAcks(std::uint32_t sequence) {
  std::unique_lock<std::mutex> lock(mutex_);
  const double timeout = participants_.allKnown() ? ack_timeout_ : start_timeout_;
  const auto deadline =
      std::chrono::steady_clock::now() + std::chrono::nanoseconds(std::llround(1e9 * timeout));
  const auto answered = [&] {
    return quit_ || (participants_.allAnswered(sequence) &&
                     (!follows_ || motion_time_ >= now_ + blockLength() - kStamp));
  };
  for (int asked = 1;; ++asked) {
    const auto again = std::chrono::steady_clock::now() + kAskAgain;
    if (waitUntil(lock, std::min(again, deadline), answered)) return;
    if (std::chrono::steady_clock::now() >= deadline) break;
    lock.unlock();
    // who floods a topic pushes the block out of its receivers' queues; who has it answers again
    publishBlock();
    // a connection that was never made isn't tried again by ROS: answers are latched, ask anew
    if (asked % kConnectionCheck == 0) subscribeToAcks();
    lock.lock();
  }
  ROS_FATAL(
      "no answer to block %u within %g s of wall time from %s: it has ended, is frozen, computes "
      "for longer than that or runs without ~lockstep; look at it, or raise ~ack_timeout",
      sequence, timeout,
      participants_.missing(sequence).empty() ? "who publishes carrier_motion"
                                              : participants_.missing(sequence).c_str());
  exit_code_ = 1;
  quit_ = true;
  ros::requestShutdown();
}

}  // namespace assembly_cell::ros_bridge
