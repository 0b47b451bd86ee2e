// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/lockstep_answers.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

namespace {

using Clock = std::chrono::steady_clock;

// Until a block is published again to nodes that have not answered it, wall clock. At the start
// nodes subscribe one after another, and a second subscription to a topic in one process receives
// only later messages.
constexpr std::chrono::milliseconds kRepeat{2000}, kRepeatAtStart{200};
constexpr int kConnectionCheck = 3;  // repetitions between two
constexpr double kStamp = 1e-6;      // rounding of stamps [s]

bool sharesThread() { return SharedSpinner::ofThisProcess().works(); }

}  // namespace

LockstepAnswers::LockstepAnswers(const ros::NodeHandle& nh, const SimulatorSettings& settings,
                                 SimulatorState& state, const std::function<void()>& go_on)
    : nh_(nh), settings_(settings), state_(state), go_on_(callbackOf(go_on)) {
  if (!settings.lockstep) return;
  participants_ = Participants(settings.participants, nh_.getNamespace());
  subscribe();
}

LockstepAnswers::~LockstepAnswers() { nh_.getCallbackQueue()->removeByID(removalId(go_on_)); }

void LockstepAnswers::subscribe() {
  ack_sub_.shutdown();
  ack_sub_ = nh_.subscribe("ack", kQueue, &LockstepAnswers::onAck, this,
                           ros::TransportHints().tcpNoDelay());
}

void LockstepAnswers::onAck(const ros::MessageEvent<Ack const>& event) {
  const Ack& ack = *event.getConstMessage();
  const std::lock_guard<std::mutex> lock(state_.mutex);
  // latched in an earlier boot of this plant, which had counted farther
  if (ack.sequence > awaited_) return;
  const std::string why = participants_.answer(ack, event.getPublisherName());
  if (!why.empty()) {
    IncomingLog::ofThisProcess().refuse("ack", event.getPublisherName(), why);
    return;
  }
  // in lockstep the answer is the owner's sign of life
  if (participants_.reportsSession(ack) && ack.sequence >= awaited_) {
    const double now = state_.now;
    warnThrottled(
        state_.gate.renew({event.getPublisherName(), now, true, false}, ack.session, now));
  }
  notifyIfComplete();
}

void LockstepAnswers::expect(std::uint32_t sequence, bool awaited) {
  // answers may arrive while the block is being published
  awaited_ = sequence;
  awaiting_ = settings_.lockstep && awaited;
  participants_.expect(sequence);
}

void LockstepAnswers::stopAwaiting() {
  awaiting_ = false;
  state_.changed.notify_all();
}

bool LockstepAnswers::complete() const {
  const double block = settings_.cell.block_size * settings_.cell.sample_period;
  return participants_.allAnswered(awaited_) &&
         (!settings_.follow_motion || motion_end_ >= state_.now + block - kStamp);
}

bool LockstepAnswers::awaits(std::uint32_t sequence) const {
  return awaiting_ && awaited_ == sequence && !complete();
}

void LockstepAnswers::notifyIfComplete() {
  if (!awaiting_ || !complete()) return;
  if (sharesThread()) {
    nh_.getCallbackQueue()->addCallback(go_on_, removalId(go_on_));
  } else {
    state_.changed.notify_all();
  }
}

void LockstepAnswers::wait(const std::function<void(std::uint32_t sequence)>& repeat) {
  std::unique_lock<std::mutex> lock(state_.mutex);
  double timeout = 0.0;
  Clock::time_point deadline;
  std::optional<std::uint32_t> sequence;
  for (int repetitions = 1;; ++repetitions) {
    // another block by now, or the next one is being computed
    if (awaited_ != sequence || complete()) {
      sequence = awaited_;
      timeout = participants_.allKnown() ? settings_.ack_timeout : settings_.start_timeout;
      deadline = Clock::now() + std::chrono::nanoseconds(std::llround(1e9 * timeout));
      repetitions = 1;
    }
    const auto over = [&] { return state_.quit || !awaiting_ || (!sharesThread() && complete()); };
    const bool starting = sharesThread() && !participants_.allKnown();
    const auto next = Clock::now() + (starting ? kRepeatAtStart : kRepeat);
    if (state_.changed.wait_until(lock, std::min(next, deadline), over)) {
      awaiting_ = false;
      return;
    }
    if (awaited_ != sequence || complete()) {
      notifyIfComplete();  // the notification may have preceded the sharing of a thread
      continue;
    }
    if (Clock::now() >= deadline) break;
    lock.unlock();
    // a flood on a topic pushes the block out of its receivers' queues
    repeat(*sequence);
    // ROS doesn't retry a connection that was never made: answers are latched
    if (repetitions % kConnectionCheck == 0) subscribe();
    lock.lock();
  }
  fail(timeout);
}

void LockstepAnswers::fail(double timeout) {
  const std::string missing = participants_.missing(awaited_);
  ROS_FATAL(
      "no answer to block %u within %g s of wall time from %s: it has ended, is frozen, computes "
      "for longer than that, runs without ~lockstep or waits for another node (its log names it); "
      "look at it, or raise ~ack_timeout",
      awaited_, timeout, missing.empty() ? "who publishes carrier_motion" : missing.c_str());
  exit_code_ = 1;
  state_.quit = true;
  ros::requestShutdown();
}

}  // namespace assembly_cell::ros_bridge
