// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_streams.h"

#include <chrono>
#include <utility>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

// add: adds a message to the history. Latched blocks may arrive twice, and cell_player repeats
// them: only the acknowledgement is repeated.
template <class Message, class Add>
StreamSubscriber TwinForceStreams::subscribe(ros::NodeHandle& nh, const std::string& topic,
                                             const Add& add) {
  using ConstPtr = typename Message::ConstPtr;
  const auto receive = [this, add, latest = std::make_shared<ConstPtr>()](const ConstPtr& message) {
    const Lock lock(mutex_);
    const bool is_repeated = *latest && (*latest)->header.stamp == message->header.stamp &&
                             (*latest)->sequence == message->sequence;
    if (!is_repeated) add(message);
    *latest = message;
    arrived_.notify_all();
    acknowledge();
  };
  return subscribeStream<Message>(
      nh, topic, kQueue, receive,
      [receive](const Message& message, const std::string&) {
        if (const ConstPtr block = withoutSamples(message)) receive(block);
      },
      settings_.lockstep);
}

TwinForceStreams::TwinForceStreams(ros::NodeHandle& nh, const Settings& settings,
                                   std::function<void()> on_carrier)
    : settings_(settings), history_(settings.history) {
  if (settings_.lockstep) ack_pub_ = {nh, "ack", kQueue};
  for (const Side side : {Side::kA, Side::kB}) {
    const std::string sensor = sensorName(side);
    subs_[side == Side::kA ? 0 : 1] = subscribe<WrenchSamples>(
        nh, sensor + "/wrench_samples",
        [this, side](const WrenchSamples::ConstPtr& m) { history_.add(side, m); });
    calibration_subs_[side] = subscribeChecked<SensorCalibration>(
        nh, sensor + "/calibration", 1, [this, side](const SensorCalibration::ConstPtr& m) {
          const Lock lock(mutex_);
          history_.add(side, *m);
          arrived_.notify_all();
        });
  }
  if (settings_.history.use_displacement) {
    subs_[2] = subscribe<DisplacementSamples>(
        nh, "sensor_b/displacement_samples",
        [this](const DisplacementSamples::ConstPtr& m) { history_.add(m); });
  }
  subs_[3] = subscribeStream<geometry_msgs::PoseStamped>(
      nh, "carrier_pose", kQueue,
      [this, on_carrier = std::move(on_carrier)](const geometry_msgs::PoseStamped::ConstPtr& m) {
        {
          const Lock lock(mutex_);
          history_.add(m);
          arrived_.notify_all();
        }
        on_carrier();
      },
      nullptr, settings_.lockstep);
}

// Once all streams have a block.
void TwinForceStreams::acknowledge() {
  if (!settings_.lockstep) return;
  const std::optional<std::uint32_t> sequence = history_.commonSequence();
  if (!sequence) return;
  Ack ack;
  ack.node = settings_.name;
  ack.sequence = *sequence;
  ack_pub_.publish(ack);
}

PerSide<Eigen::MatrixXd> TwinForceStreams::gainCovariances() const {
  const Lock lock(mutex_);
  return history_.gainCovariances();
}

std::optional<TwinForceHistory::Now> TwinForceStreams::now() const {
  const Lock lock(mutex_);
  return history_.now();
}

// ---- windows ----

bool TwinForceStreams::wait(Lock& lock, const std::function<bool()>& ready) {
  using Clock = std::chrono::steady_clock;
  const auto deadline = Clock::now() + std::chrono::duration<double>(settings_.data_timeout);
  while (!ready()) {
    if (!ros::ok()) throw InputError("the node is shutting down");
    if (Clock::now() >= deadline) return false;
    arrived_.wait_for(lock, std::chrono::milliseconds(20));
  }
  return true;
}

bool TwinForceStreams::waitForCalibrations() {
  Lock lock(mutex_);
  return wait(lock, [this] { return history_.hasCalibrations(); });
}

std::vector<TwinForceHistory::Wrench> TwinForceStreams::collect(Lock& lock,
                                                                const BlockWindow& window) {
  const bool named = window.isNamed();
  const MessageCheck stamps =
      MessageCheck().stamp("first", window.first.toSec()).stamp("last", window.last.toSec());
  if (!stamps.good()) throw InputError("window: " + stamps.text());
  if (named && (window.blocks == 0 || window.last < window.first)) {
    throw InputError("window: first, last and blocks don't fit: give the ends of its blocks");
  }
  if (!named && !(window.duration >= 1e-3 && window.duration <= 0.5 * TwinForceHistory::kLength)) {
    throw InputError(text("window is %g s: give 0.001 to %g s, 0 for the node's own",
                          window.duration, 0.5 * TwinForceHistory::kLength));
  }
  const ros::Time after = history_.lastWrench();
  std::vector<TwinForceHistory::Wrench> blocks;
  const bool complete = wait(lock, [&] {
    blocks = history_.select(window, after);
    return !blocks.empty();
  });
  if (!complete && named) {
    throw InputError(
        text("not all of the %u blocks of sensor_b that end from %.3f to %.3f s came in "
             "within %g s of wall time",
             window.blocks, window.first.toSec(), window.last.toSec(), settings_.data_timeout));
  }
  if (!complete) {
    throw InputError(
        text("no wrench of sensor_b within %g s of wall time", settings_.data_timeout));
  }
  return blocks;
}

TwinForceStreams::Average TwinForceStreams::average(const BlockWindow& window,
                                                    AveragingLimits limits) {
  Lock lock(mutex_);
  const std::vector<TwinForceHistory::Wrench> blocks = collect(lock, window);
  const char* missing = nullptr;
  const bool complete = wait(lock, [&] {
    missing = history_.missing(blocks.back());
    return missing == nullptr;
  });
  if (!complete) {
    throw InputError(text("no %s within %g s of wall time", missing, settings_.data_timeout));
  }

  using State = AveragingWindow::State;
  limits.blocks = static_cast<int>(blocks.size());
  Average out;
  out.window = AveragingWindow(limits);
  out.first = blockEnd(*blocks.front());
  out.last = blockEnd(*blocks.back());
  const ros::Time start = blocks.front()->header.stamp;
  out.middle = start + (out.last - start) * 0.5;
  State state = State::kFilling;
  for (const TwinForceHistory::Wrench& b : blocks) {
    state = out.window.add(history_.blockOf(b, start, out.time_difference));
    if (state != State::kFilling) break;
  }
  if (state == State::kMoved) {
    throw InputError(text("moving: the carrier moved by %.2g m, more than %g m; hold it",
                          out.window.motion(), limits.carrier_motion));
  }
  if (state != State::kSettled) {
    throw InputError(
        text("not settled: halves of the window differ by more than %g N", limits.settled_force));
  }
  return out;
}

}  // namespace assembly_cell::ros_bridge
