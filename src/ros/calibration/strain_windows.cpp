// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/strain_windows.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/base/text.h"
#include "assembly_cell/calibration/common/drift.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kStopPollPeriod = 0.05;  // between two calls of `stop` while waiting [s]

constexpr int kDelays = 100;  // least blocks for the shortest delay

ros::Time lastStamp(const StrainSamples& block) {
  const auto steps = static_cast<double>(block.saturated.size()) - 1.0;
  return block.header.stamp + ros::Duration(block.period * steps);
}

}  // namespace

void StrainWindows::Delay::add(const ros::Duration& delay) {
  if (!recent_ || delay < *recent_) recent_ = delay;
  if (++count_ < kDelays) return;
  earlier_ = recent_;
  recent_.reset();
  count_ = 0;
}

std::optional<ros::Duration> StrainWindows::Delay::shortest() const {
  if (!earlier_ || !recent_) return earlier_ ? earlier_ : recent_;
  return std::min(*earlier_, *recent_);
}

StrainWindows::StrainWindows(const ros::NodeHandle& nh, Settings settings)
    : settings_(std::move(settings)) {
  ros::NodeHandle node(nh);
  for (const Side side : kSides) {
    Collector& collector = collectors_[side];
    collector.strain_sub = subscribeStream<StrainSamples>(
        node, sensorName(side) + "/strain", kQueue,
        [this, &collector](const StrainSamples::ConstPtr& block) { collect(collector, *block); });
  }
}

void StrainWindows::collect(Collector& c, const StrainSamples& block) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    c.last_block = Clock::now();
    const Arrival arrival = c.sequence.accept(block.sequence);
    if (arrival == Arrival::kRestart) c.delay = Delay();
    c.delay.add(ros::Time::now() - lastStamp(block));
    if (!c.active || arrival == Arrival::kDuplicate) return;
    if (arrival == Arrival::kRestart) {
      c.restarted = true;
    } else if (!c.armed) {
      c.armed = true;
    } else {
      for (std::size_t k = 0; k < block.saturated.size() && c.volts.size() < settings_.window;
           ++k) {
        const ros::Time stamp =
            block.header.stamp + ros::Duration(static_cast<double>(k) * block.period);
        if (stamp < c.from) continue;
        if (c.volts.empty()) c.first = stamp.toSec();
        c.last = stamp.toSec();
        c.volts.push_back(Eigen::Map<const Vector6>(&block.volts[6 * k]));
        c.saturated.push_back(block.saturated[k]);
      }
      c.temperature = block.temperature;
    }
    if (!c.restarted && c.volts.size() < settings_.window) return;
  }
  changed_.notify_all();
}

CalibrationRefusal StrainWindows::unsettled(const Reading& reading, Side side) const {
  const SensorDescription& sensor = settings_.sensor[side];
  SettlingLimits limits;
  limits.window = collectors_[side].volts.size();
  // includes quantisation noise
  for (int k = 0; k < 6; ++k) {
    limits.noise[k] = std::sqrt(std::max(sensor.noise * sensor.noise + sensor.quantisation(),
                                         reading.noise[k] * reading.noise[k]));
  }
  SettledWindow window(limits);
  for (const Vector6& volts : collectors_[side].volts) window.add(volts);
  const SettlingReport report = window.report();
  if (report.verdict == Settling::kSettled) return unusable(reading, sensor);
  return {CalibrationFailure::kUnsettled,
          "channel " + std::to_string(report.axis + 1) + " unsettled (" + toString(report.verdict) +
              "; sd " + text("%.3g V", reading.spread[report.axis]) + ", change " +
              text("%.3g V", report.change[report.axis]) + " in " + std::to_string(report.samples) +
              " samples)"};
}

// Why the missing samples of a sensor are not waited for any longer; empty: wait.
CalibrationRefusal StrainWindows::giveUp(Side side, Clock::time_point begun) const {
  const Collector& c = collectors_[side];
  const auto now = Clock::now();
  const std::string name = sensorName(side);
  if (now - std::max(begun, c.last_block.value_or(begun)) > settings_.source_timeout) {
    return {CalibrationFailure::kSilent,
            name + ": no samples on " + c.strain_sub.topic() + " for " +
                text("%g s", settings_.source_timeout.count()) + ": start its driver"};
  }
  if (now - begun > settings_.settle_timeout + settings_.source_timeout +
                        Seconds(static_cast<double>(settings_.window) * 1e-2)) {
    return {CalibrationFailure::kTooSlow, name + ": only " + std::to_string(c.volts.size()) +
                                              " of " + std::to_string(settings_.window) +
                                              " samples received: check stamps and rate"};
  }
  if (c.restarted) {
    return {CalibrationFailure::kRestarted, name + ": the source restarted: try again"};
  }
  return {};
}

// Collects a window of each sensor wanted.
CalibrationRefusal StrainWindows::fill(const PerSide<bool>& wanted, const ros::Time& from,
                                       std::unique_lock<std::mutex>& lock) {
  for (const Side side : kSides) {
    Collector& c = collectors_[side];
    c.active = wanted[side];
    c.restarted = false;
    c.from = from;
    // blocks from before the call may still be on their way
    const std::optional<ros::Duration> delay = c.delay.shortest();
    if (from.isZero() && delay) c.from = ros::Time::now() - *delay;
    c.armed = !c.from.isZero();
    c.volts.clear();
    c.saturated.clear();
  }
  const Clock::time_point begun = Clock::now();
  CalibrationRefusal refusal;
  for (bool ready = false; !ready && !refusal;) {
    const std::string stop = settings_.stop();
    if (!stop.empty()) refusal = {CalibrationFailure::kCancelled, stop};
    ready = true;
    for (const Side side : kSides) {
      if (!wanted[side] || collectors_[side].volts.size() == settings_.window) continue;
      ready = false;
      if (!refusal) refusal = giveUp(side, begun);
    }
    if (!ready && !refusal) changed_.wait_for(lock, Seconds(kStopPollPeriod));
  }
  for (const Side side : kSides) collectors_[side].active = false;
  return refusal;
}

CalibrationRefusal StrainWindows::evaluate(const PerSide<bool>& wanted,
                                           PerSide<std::optional<Reading>>& readings) {
  CalibrationRefusal refusal;
  for (const Side side : kSides) {
    if (!wanted[side]) continue;
    const Collector& c = collectors_[side];
    Reading& reading =
        readings[side].emplace(averageReading(c.volts, c.saturated, settings_.sensor[side]));
    reading.temperature = c.temperature;
    if (reading.saturated != 0) {
      return {CalibrationFailure::kSaturated, sensorName(side) + ": channel " +
                                                  channelText(reading.saturated) +
                                                  " saturated: take a smaller load"};
    }
    if (refusal) continue;
    refusal = unsettled(reading, side);
    if (refusal) refusal.text = sensorName(side) + ": " + refusal.text;
  }
  const Collector &a = collectors_.a, &b = collectors_.b;
  if (!refusal && wanted.a && wanted.b && (a.last < b.first || b.last < a.first)) {
    refusal = {CalibrationFailure::kApart,
               "sensor_a and sensor_b: readings " + text("%.3g s", std::abs(a.first - b.first)) +
                   " apart, not of the same time: synchronise their clocks"};
  }
  return refusal;
}

CalibrationRefusal StrainWindows::read(Observation& observation, const PerSide<bool>& wanted,
                                       const ros::Time& from) {
  std::unique_lock<std::mutex> lock(mutex_);
  const Clock::time_point called = Clock::now();
  for (;;) {
    if (CalibrationRefusal refusal = fill(wanted, from, lock)) return refusal;
    PerSide<std::optional<Reading>> readings;
    CalibrationRefusal refusal = evaluate(wanted, readings);
    if (!refusal) {
      observation.reading = readings;
      const Collector& c = wanted.a ? collectors_.a : collectors_.b;
      observation.stamp = 0.5 * (c.first + c.last);
      return {};
    }
    if (refusal.code == CalibrationFailure::kSaturated) return refusal;
    if (Clock::now() - called > settings_.settle_timeout) {
      refusal.text +=
          " after " + text("%g s", settings_.settle_timeout.count()) + ": wait until nothing moves";
      return refusal;
    }
  }
}

}  // namespace assembly_cell::ros_bridge
