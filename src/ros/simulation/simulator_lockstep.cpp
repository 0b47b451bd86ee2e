// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// How the simulator waits for its participants.
#include <rosgraph_msgs/Clock.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/simulation/simulator_node.h"

namespace assembly_cell::ros_bridge {

namespace {

// Of who has not answered a block, wall clock. At the start nodes subscribe one after another, and
// a second subscription to a topic in one process hears only what comes after it.
constexpr std::chrono::milliseconds kAskAgain{2000}, kAskAtStart{200};
constexpr int kConnectionCheck = 3;  // so many of them
constexpr double kStamp = 1e-6;      // rounding of stamps [s]

}  // namespace

void SimulatorNode::publishClock(const ros::Time& stamp) {
  clock_stamp_ = stamp;
  rosgraph_msgs::Clock clock;
  clock.clock = stamp;
  publishShared(clock_pub_, clock);
}

bool SimulatorNode::isAnswered() const {
  return participants_.allAnswered(awaited_) &&
         (!follows_ || motion_time_ >= now_ + blockLength() - kStamp);
}

void SimulatorNode::tellLoop() {
  if (!awaiting_ || !isAnswered()) return;
  if (SharedSpinner::ofThisProcess().works()) {
    nh_.getCallbackQueue()->addCallback(go_on_, removalId(go_on_));
  } else {
    changed_.notify_all();
  }
}

// Who floods a topic pushes the block out of its receivers' queues; who has it answers again.
void SimulatorNode::askAgain(std::uint32_t sequence) {
  const std::lock_guard<std::mutex> computing(computing_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!awaiting_ || awaited_ != sequence || isAnswered()) return;
  }
  publishBlock();
}

void SimulatorNode::subscribeToAcks() {
  ack_sub_.shutdown();
  ack_sub_ =
      nh_.subscribe("ack", kQueue, &SimulatorNode::onAck, this, ros::TransportHints().tcpNoDelay());
}

// Where nodes share a thread, whoever calls back the last answer computes the next block, and no
// other thread needs to wake up.
void SimulatorNode::goOn() {
  const std::lock_guard<std::mutex> computing(computing_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!awaiting_ || quit_ || !isAnswered()) return;
    if (!tasks_.empty() || (paused_ && steps_ <= 1)) {
      awaiting_ = false;
      changed_.notify_all();
      return;
    }
  }
  finishBlock();
  if (!computeBlock()) changed_.notify_all();
}

// Of the last block, whoever computes those up to it.
void SimulatorNode::waitForAcks() {
  using Clock = std::chrono::steady_clock;
  std::unique_lock<std::mutex> lock(mutex_);
  double timeout = 0.0;
  Clock::time_point deadline;
  std::optional<std::uint32_t> sequence;
  for (int asked = 1;; ++asked) {
    // another block by now, or the next one is being computed
    if (awaited_ != sequence || isAnswered()) {
      sequence = awaited_;
      timeout = participants_.allKnown() ? ack_timeout_ : start_timeout_;
      deadline = Clock::now() + std::chrono::nanoseconds(std::llround(1e9 * timeout));
      asked = 1;
    }
    const auto over = [&] {
      return quit_ || !awaiting_ || (!SharedSpinner::ofThisProcess().works() && isAnswered());
    };
    const bool begins = SharedSpinner::ofThisProcess().works() && !participants_.allKnown();
    const auto again = Clock::now() + (begins ? kAskAtStart : kAskAgain);
    if (changed_.wait_until(lock, std::min(again, deadline), over)) {
      awaiting_ = false;
      return;
    }
    if (awaited_ != sequence || isAnswered()) {
      tellLoop();  // it may have been told before the nodes began to share a thread
      continue;
    }
    if (Clock::now() >= deadline) break;
    lock.unlock();
    askAgain(*sequence);
    // a connection that was never made isn't tried again by ROS: answers are latched, ask anew
    if (asked % kConnectionCheck == 0) subscribeToAcks();
    lock.lock();
  }
  ROS_FATAL(
      "no answer to block %u within %g s of wall time from %s: it has ended, is frozen, computes "
      "for longer than that or runs without ~lockstep; look at it, or raise ~ack_timeout",
      *sequence, timeout,
      participants_.missing(*sequence).empty() ? "who publishes carrier_motion"
                                               : participants_.missing(*sequence).c_str());
  exit_code_ = 1;
  quit_ = true;
  ros::requestShutdown();
}

}  // namespace assembly_cell::ros_bridge
