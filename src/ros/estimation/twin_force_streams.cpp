// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_streams.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "assembly_cell/Ack.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/publish_shared.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kStampRounding = 1e-9;  // [s]
// Without a calibration a channel counts as its own newton or newton metre and as sure as this:
// beside it the scatter of the samples rules. Half or twice changes nothing that is decided. [N²]
constexpr double kPlainVariance = 1e-6;

const std::vector<double>& valuesOf(const WrenchSamples& m) { return m.wrench; }
const std::vector<double>& valuesOf(const DisplacementSamples& m) { return m.displacement; }
std::vector<double>& valuesOf(WrenchSamples& m) { return m.wrench; }
std::vector<double>& valuesOf(DisplacementSamples& m) { return m.displacement; }

template <class Message>
std::size_t sizeOf(const Message& message) {
  return valuesOf(message).size() / 6;
}

// one that isn't is kept without its samples, so that a window knows of it
template <class Message>
bool usable(const Message& m) {
  return !valuesOf(m).empty();
}

template <class Message>
BlockMoments momentsOf(const Message& m) {
  return assembly_cell::momentsOf(valuesOf(m).data(), sizeOf(m));
}

// of the last sample
ros::Time endOf(const WrenchSamples& m) {
  return later(m.header.stamp, m.period * (static_cast<double>(sizeOf(m)) - 1.0));
}

template <class List>
bool reaches(const List& list, const ros::Time& until) {
  return !list.empty() && list.back()->header.stamp >= until;
}

// Nearest in time; of an empty list null.
template <class List>
typename List::value_type nearest(const List& list, const ros::Time& stamp) {
  const auto distance = [&](const auto& m) { return std::abs((m->header.stamp - stamp).toSec()); };
  const auto best = std::min_element(
      list.begin(), list.end(),
      [&](const auto& one, const auto& other) { return distance(one) < distance(other); });
  return best == list.end() ? nullptr : *best;
}

template <class List>
void keep(List& list, const typename List::value_type& message) {
  // a clock that went back starts anew
  if (!list.empty() && message->header.stamp < list.back()->header.stamp) list.clear();
  list.push_back(message);
  while ((list.back()->header.stamp - list.front()->header.stamp).toSec() >
         TwinForceStreams::kHistory) {
    list.pop_front();
  }
}

bool saturated(const WrenchSamples& m) {
  return std::any_of(m.saturated.begin(), m.saturated.end(), [](auto bits) { return bits != 0; });
}

}  // namespace

TwinForceStreams::TwinForceStreams(ros::NodeHandle& nh, const Settings& settings,
                                   std::function<void()> on_carrier)
    : settings_(settings), on_carrier_(std::move(on_carrier)) {
  if (settings_.lockstep) ack_pub_ = {nh, "ack", kQueue};
  const auto wrenches = [&](const std::string& sensor, std::deque<Wrench>& list) {
    return subscribeStream<WrenchSamples>(
        nh, sensor + "/wrench_samples", kQueue,
        [this, &list](const Wrench& m) { onBlock<WrenchSamples>(list, m); },
        [this, &list](const WrenchSamples& m, const std::string&) { onUnusable(list, m); },
        settings_.lockstep);
  };
  a_sub_ = wrenches("sensor_a", a_);
  b_sub_ = wrenches("sensor_b", b_);
  if (settings_.use_displacement) {
    d_sub_ = subscribeStream<DisplacementSamples>(
        nh, "sensor_b/displacement_samples", kQueue,
        [this](const Displacement& m) { onBlock<DisplacementSamples>(d_, m); },
        [this](const DisplacementSamples& m, const std::string&) { onUnusable(d_, m); },
        settings_.lockstep);
  }
  carrier_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
      nh, "carrier_pose", kQueue, [this](const auto& m) { onCarrier(m); }, nullptr,
      settings_.lockstep);
  const auto calibrations = [&](Side side, std::optional<Matrix6>& S) {
    const std::string sensor = sensorName(side);
    return subscribeChecked<SensorCalibration>(
        nh, sensor + "/calibration", 1,
        [this, side, sensor, &S](const SensorCalibration::ConstPtr& m) {
          const Calibration calibration = fromMessage(*m, "calibration of " + sensor);
          const std::lock_guard<std::mutex> lock(mutex_);
          S = calibration.volts_to_wrench;
          gains_[side] = gainCovariance(calibration);
          arrived_.notify_all();
        });
  };
  calibration_a_sub_ = calibrations(Side::kA, S_a_);
  calibration_b_sub_ = calibrations(Side::kB, S_b_);
}

// ---- what comes in ----

template <class Message>
void TwinForceStreams::onBlock(std::deque<typename Message::ConstPtr>& list,
                               const typename Message::ConstPtr& m) {
  const std::lock_guard<std::mutex> lock(mutex_);
  // a latched block may come twice, and cell_player repeats them; it is answered again
  const bool repeated = !list.empty() && list.back()->header.stamp == m->header.stamp &&
                        list.back()->sequence == m->sequence;
  if (!repeated) keep(list, m);
  arrived_.notify_all();
  acknowledge();
}

template <class Message>
void TwinForceStreams::onUnusable(std::deque<boost::shared_ptr<Message const>>& list,
                                  const Message& m) {
  MessageCheck frame;
  frame.stamp("header.stamp", m.header.stamp.toSec()).number("period", m.period, kPeriodField);
  if (!frame.good()) return;
  const auto known = boost::make_shared<Message>(m);
  valuesOf(*known).clear();
  onBlock<Message>(list, known);
}

void TwinForceStreams::onCarrier(const geometry_msgs::PoseStamped::ConstPtr& message) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    keep(carrier_, message);
    arrived_.notify_all();
  }
  on_carrier_();
}

// once all streams have a block
void TwinForceStreams::acknowledge() {
  if (!settings_.lockstep || a_.empty() || b_.empty()) return;
  const std::uint32_t sequence = a_.back()->sequence;
  if (b_.back()->sequence != sequence) return;
  if (settings_.use_displacement && (d_.empty() || d_.back()->sequence != sequence)) return;
  Ack ack;
  ack.node = settings_.name;
  ack.sequence = sequence;
  ack_pub_.publish(ack);
}

std::optional<TwinForceStreams::Now> TwinForceStreams::now() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (carrier_.empty()) return std::nullopt;
  Now out;
  out.stamp = carrier_.back()->header.stamp;
  out.carrier = restFromPose(fromPose(carrier_.back()->pose, "carrier_pose"));
  if (!d_.empty() && usable(*d_.back())) out.displacement = momentsOf(*d_.back()).mean;
  return out;
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
  return wait(lock, [this] { return S_a_ && S_b_; });
}

PerSide<Eigen::MatrixXd> TwinForceStreams::gainCovariances() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return gains_;
}

// Blocks of sensor_b: all that end within the window's times, or so many after a time as it takes.
// Empty until they are there.
std::vector<TwinForceStreams::Wrench> TwinForceStreams::select(const Window& window,
                                                               const ros::Time& after) const {
  const bool named = !window.last.isZero();
  std::vector<Wrench> out;
  double covered = 0.0;
  bool complete = false;
  for (const Wrench& b : b_) {
    const ros::Duration half(0.5 * b->period);
    const ros::Time end = endOf(*b);
    if (!complete &&
        (named ? end >= later(window.first, -0.5 * b->period) && end <= window.last + half
               : b->header.stamp > after)) {
      if (!usable(*b)) throw InputError("sensor_b: a block is not one of finite samples");
      covered += b->period * static_cast<double>(sizeOf(*b));
      out.push_back(b);
    }
    // who asks may have missed a block that came late, the node may not
    complete = named ? end >= later(window.last, -0.5 * b->period) && out.size() >= window.blocks
                     : covered >= window.duration - kStampRounding;
  }
  if (!complete) out.clear();
  return out;
}

std::vector<TwinForceStreams::Wrench> TwinForceStreams::collect(Lock& lock, const Window& window) {
  const bool named = !window.last.isZero();
  const MessageCheck stamps =
      MessageCheck().stamp("first", window.first.toSec()).stamp("last", window.last.toSec());
  if (!stamps.good()) throw InputError("window: " + stamps.text());
  if (named && (window.blocks == 0 || window.last < window.first)) {
    throw InputError("window: first, last and blocks don't fit: give the ends of its blocks");
  }
  if (!named && !(window.duration >= 1e-3 && window.duration <= 0.5 * kHistory)) {
    throw InputError(text("window is %g s: give 0.001 to %g s, 0 for the node's own",
                          window.duration, 0.5 * kHistory));
  }
  const ros::Time after = b_.empty() ? ros::Time() : b_.back()->header.stamp;
  std::vector<Wrench> blocks;
  const bool complete = wait(lock, [&] {
    blocks = select(window, after);
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

// what goes with the blocks up to `last`
void TwinForceStreams::awaitPartners(Lock& lock, const Wrench& last) {
  const ros::Time stamp = later(last->header.stamp, -(settings_.time_limit + kStampRounding));
  const ros::Time end = endOf(*last) - ros::Duration(0.5 * last->period);
  const char* missing = nullptr;
  const auto complete = [&] {
    missing = !reaches(a_, stamp)                                 ? "wrench of sensor_a"
              : settings_.use_displacement && !reaches(d_, stamp) ? "displacement of sensor_b"
              : !reaches(carrier_, end)                           ? "carrier_pose"
                                                                  : nullptr;
    return missing == nullptr;
  };
  if (!wait(lock, complete)) {
    throw InputError(text("no %s within %g s of wall time", missing, settings_.data_timeout));
  }
}

Vector6 TwinForceStreams::displacementOf(const Wrench& b) const {
  if (!settings_.use_displacement) return Vector6::Zero();
  const Displacement d = nearest(d_, b->header.stamp);
  if (std::abs((d->header.stamp - b->header.stamp).toSec()) >
      settings_.time_limit + kStampRounding) {
    throw InputError("not simultaneous: no displacement goes with the wrench of sensor_b");
  }
  if (!usable(*d)) {
    throw InputError("sensor_b: a block of displacements is not one of finite samples");
  }
  return momentsOf(*d).mean;
}

// A block of sensor_b with what goes with it, as a strategy's plant gives it.
PlantBlock TwinForceStreams::blockOf(const Wrench& b, const ros::Time& origin,
                                     double& time_difference) const {
  const Wrench a = nearest(a_, b->header.stamp);
  const double apart = std::abs((a->header.stamp - b->header.stamp).toSec());
  if (apart > settings_.time_limit + kStampRounding) {
    throw InputError(
        text("not simultaneous: the wrenches of both sensors are %.3g s apart, more than %g s",
             apart, settings_.time_limit));
  }
  time_difference = std::max(time_difference, apart);
  if (!usable(*a)) throw InputError("sensor_a: a block is not one of finite samples");
  for (const auto& [samples, sensor] : {std::make_pair(a, "sensor_a"), {b, "sensor_b"}}) {
    if (saturated(*samples)) {
      throw InputError(text("saturated: a channel of %s is at its limit; press less", sensor));
    }
  }
  const BlockMoments moments_a = momentsOf(*a), moments_b = momentsOf(*b);
  const auto rounding = [this](const std::optional<Matrix6>& S) {
    return S ? roundingCovariance(*S, settings_.converter_step)
             : Matrix6(kPlainVariance * Matrix6::Identity());
  };
  PlantBlock out;
  out.time = (endOf(*b) - origin).toSec();
  out.wrench_a = moments_a.mean;
  out.wrench_b = moments_b.mean;
  out.covariance_a = moments_a.covariance;
  out.covariance_b = moments_b.covariance;
  out.rounding_a = rounding(S_a_);
  out.rounding_b = rounding(S_b_);
  out.samples = std::min(moments_a.count, moments_b.count);
  out.displacement_b = displacementOf(b);
  // at the block's end
  const ros::Time end = endOf(*b) + ros::Duration(0.5 * b->period);
  geometry_msgs::PoseStamped::ConstPtr carrier = carrier_.front();
  for (const auto& pose : carrier_) {
    if (pose->header.stamp <= end) carrier = pose;
  }
  out.carrier = restFromPose(fromPose(carrier->pose, "carrier_pose"));
  return out;
}

TwinForceStreams::Reading TwinForceStreams::read(const Window& window, AveragingLimits limits) {
  Lock lock(mutex_);
  const std::vector<Wrench> blocks = collect(lock, window);
  awaitPartners(lock, blocks.back());

  using State = AveragingWindow::State;
  limits.blocks = static_cast<int>(blocks.size());
  Reading out;
  out.window = AveragingWindow(limits);
  out.first = endOf(*blocks.front());
  out.last = endOf(*blocks.back());
  const ros::Time start = blocks.front()->header.stamp;
  out.middle = start + (out.last - start) * 0.5;
  State state = State::kFilling;
  for (const Wrench& b : blocks) {
    state = out.window.add(blockOf(b, start, out.time_difference));
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
