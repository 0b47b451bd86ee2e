// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/locus_history.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/estimation/locus_messages.h"

namespace assembly_cell::ros_bridge {

namespace {

std::size_t sizeOf(const DisplacementSamples& block) { return block.displacement.size() / 6; }

// Stamp of the last sample.
ros::Time lastOf(const DisplacementSamples& block) {
  return block.header.stamp + ros::Duration(block.period * static_cast<double>(sizeOf(block) - 1));
}

}  // namespace

LocusHistory::Arrival LocusHistory::add(const Block& block) {
  Arrival arrival = Arrival::kNext;
  if (!blocks_.empty()) {
    const DisplacementSamples& last = *blocks_.back();
    // latched blocks may arrive twice
    if (block->header.stamp == last.header.stamp && block->sequence == last.sequence) {
      return Arrival::kRepeated;
    }
    if (block->header.stamp <= lastOf(last)) {
      ROS_WARN("the clock jumped back to %.3f s: samples dropped", block->header.stamp.toSec());
      blocks_.clear();
      ++jump_count_;
      arrival = Arrival::kClockJumped;
    }
  }
  blocks_.push_back(block);
  ++block_count_;
  while (lastOf(*blocks_.front()) + ros::Duration(length_ + block->period) < lastOf(*block)) {
    blocks_.pop_front();
  }
  return arrival;
}

void LocusHistory::addCarrier(const geometry_msgs::PoseStamped::ConstPtr& pose) {
  if (!carrier_.empty() && pose->header.stamp < carrier_.back()->header.stamp) carrier_.clear();
  carrier_.push_back(pose);
  while (carrier_.front()->header.stamp + ros::Duration(length_) < pose->header.stamp) {
    carrier_.pop_front();
  }
}

ros::Time LocusHistory::lastSample() const {
  return blocks_.empty() ? ros::Time() : lastOf(*blocks_.back());
}

LocusHistory::Window LocusHistory::window(const ros::Time& start, const ros::Time& end,
                                          const Exciter& exciter) const {
  Window window;
  window.end = end;
  for (const auto& block : blocks_) {
    window.period = block->period;
    window.frame_id = block->header.frame_id;
    const double first = (block->header.stamp - start).toSec() + kSampleRounding * block->period;
    const double limit = (end - start).toSec();
    const double since = (block->header.stamp - exciter.header.stamp).toSec();
    for (std::size_t k = 0; k < sizeOf(*block); ++k) {
      const double later = block->period * static_cast<double>(k);
      if (first + later < 0.0 || first + later >= limit) continue;
      window.angle.push_back(exciter.direction *
                             (exciter.frequency * (since + later) + exciter.phase));
      const auto sample = block->displacement.begin() + static_cast<std::ptrdiff_t>(6 * k);
      window.signals.insert(window.signals.end(), sample, sample + 6);
    }
  }
  return window;
}

double LocusHistory::carrierMotion(const ros::Time& start, const ros::Time& end,
                                   double lever) const {
  std::optional<Pose> reference;
  double largest = 0.0;
  for (const auto& stamped : carrier_) {
    if (stamped->header.stamp < start || stamped->header.stamp > end) continue;
    const Pose X = fromPose(stamped->pose, "carrier_pose");
    if (!reference) reference = X;
    const double rotation = vectorFromRotation(reference->R.transpose() * X.R).value.norm();
    largest = std::max(largest, (X.p - reference->p).norm() + lever * rotation);
  }
  return largest;
}

std::optional<LocusReading> SlidingLocus::update(const Mechanism& mechanism,
                                                 const ReadingLimits& limits,
                                                 const Exciter& exciter,
                                                 const LocusHistory& history, double window,
                                                 double length) {
  const std::deque<LocusHistory::Block>& blocks = history.blocks();
  // as many whole periods as fit, at least one
  const DisplacementSamples& newest = *blocks.back();
  const double cycle = 2.0 * M_PI / exciter.frequency;
  const double duration = cycle * std::max(1.0, std::floor(window / cycle));
  const double samples = std::ceil(duration / newest.period - 1e-6);
  if (samples * newest.period > length || samples < static_cast<double>(kMinLocusSamples)) {
    return std::nullopt;
  }
  if (!stream_ || stream_->exciter.header.stamp != exciter.header.stamp ||
      stream_->exciter.frequency != exciter.frequency || stream_->exciter.phase != exciter.phase ||
      stream_->exciter.direction != exciter.direction ||
      static_cast<double>(stream_->fit.window()) != samples) {
    // drift is fitted: the carrier may still creep
    stream_.emplace(
        Stream{SlidingFit<6>(static_cast<std::size_t>(samples), true), exciter, {}, {}});
  }

  // samples since the last call; for a new stream a window of the past
  const ros::Time from =
      stream_->last ? *stream_->last + ros::Duration(0.5 * newest.period)
                    : std::max(later(exciter.header.stamp, -kSampleRounding * newest.period),
                               later(history.lastSample(), -(samples - 0.5) * newest.period));
  auto block = blocks.end();
  while (block != blocks.begin() && lastOf(**std::prev(block)) >= from) --block;
  for (; block != blocks.end(); ++block) {
    const DisplacementSamples& b = **block;
    if (stream_->last && (b.header.stamp - *stream_->last).toSec() > 1.5 * b.period) {
      stream_->fit.reset();
    }
    const double since = (b.header.stamp - exciter.header.stamp).toSec();
    const double skipped = std::ceil((from - b.header.stamp).toSec() / b.period);
    for (auto k = static_cast<std::size_t>(std::max(0.0, skipped)); k < sizeOf(b); ++k) {
      const double t = since + b.period * static_cast<double>(k);
      stream_->fit.add(exciter.direction * (exciter.frequency * t + exciter.phase),
                       Vector6::Map(b.displacement.data() + 6 * k));
    }
    stream_->last = lastOf(b);
  }
  if (!stream_->fit.full()) return std::nullopt;

  MeasuredMotion motion;
  motion.fit = stream_->fit.fit();
  const LocusReading reading =
      readLocus(mechanism, exciterOf(exciter), motion, limits, stream_->mode);
  stream_->mode = reading.mode.mode;
  return reading;
}

}  // namespace assembly_cell::ros_bridge
