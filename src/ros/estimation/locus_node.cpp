// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/locus_node.h"

#include <assembly_cell/Ack.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/estimation/locus_messages.h"
#include "assembly_cell/ros/process/lockstep.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kTwoPi = 2.0 * M_PI;

std::size_t sizeOf(const DisplacementSamples& block) { return block.displacement.size() / 6; }

ros::Time timeOf(const DisplacementSamples& block, std::size_t sample) {
  return block.header.stamp + ros::Duration(block.period * static_cast<double>(sample));
}

ros::Time lastOf(const DisplacementSamples& block) { return timeOf(block, sizeOf(block) - 1); }

// what is wrong with an exciter that should be running; empty: nothing
std::string faultOf(const Exciter& exciter) {
  if (!exciter.on) return "the exciter is off: switch it on before the window";
  if (!(std::isfinite(exciter.frequency) && exciter.frequency > 0.0)) {
    return text("exciter frequency is %g: give a positive one in rad/s", exciter.frequency);
  }
  if (!(std::isfinite(exciter.amplitude) && exciter.amplitude > 0.0)) {
    return text("exciter amplitude is %g: give a positive one in N", exciter.amplitude);
  }
  if (!std::isfinite(exciter.phase)) return "exciter phase is not finite: give it in rad";
  if (exciter.direction != 1 && exciter.direction != -1) {
    return text("exciter direction is %d: give 1 or -1", exciter.direction);
  }
  return {};
}

}  // namespace

LocusNode::LocusNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh),
      pnh_(pnh),
      server_(nh_, "identify_locus",
              [this](const IdentifyLocusGoal::ConstPtr& goal) { identify(goal); }) {
  readParameters();
  locus_pub_ = nh_.advertise<LocusEstimate>("locus", kQueue);
  mode_pub_ = nh_.advertise<LocusEstimate>("contact_mode", 1, true);
  // latched: who connects late must not miss the first one
  if (lockstep_) ack_pub_ = {nh_, "ack", kQueue};
  enable_srv_ = pnh_.advertiseService("enable", &LocusNode::enable, this);
  server_.start();
  const auto hints = ros::TransportHints().tcpNoDelay();
  exciter_sub_ = subscribeChecked<Exciter>(
      nh_, "exciter", kQueue, [this](const Exciter::ConstPtr& m) { onExciter(m); }, hints);
  carrier_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
      nh_, "carrier_pose", kQueue,
      [this](const geometry_msgs::PoseStamped::ConstPtr& m) { onCarrier(m); }, nullptr, lockstep_);
  block_sub_ = subscribeStream<DisplacementSamples>(
      nh_, "sensor_b/displacement_samples", kQueue,
      [this](const DisplacementSamples::ConstPtr& m) { onBlock(m); },
      [this](const DisplacementSamples& m, const std::string&) { acknowledge(m.sequence); },
      lockstep_);
}

LocusNode::~LocusNode() {
  block_sub_.shutdown();
  server_.shutdown();
}

void LocusNode::readParameters() {
  Parameters parameters(pnh_);
  mechanism_ = loadMechanism(parameters.text("scenario"),
                             parameters.texts("overrides", std::vector<std::string>{}));
  const Range windows{1e-3, 10.0};
  const double window = parameters.number("window", windows, 0.2);
  limits_.false_alarm = parameters.number("false_alarm", {1e-6, 0.49}, limits_.false_alarm);
  limits_.indifference = parameters.number("indifference", {0.0, 0.5}, limits_.indifference);
  limits_.misfit = parameters.number("misfit_limit", kPositive, limits_.misfit);
  limits_.direction_sd = parameters.number("direction_limit", kPositive, limits_.direction_sd);
  carrier_motion_ = parameters.number("carrier_motion", kPositive, 1e-3);
  history_ = parameters.number("history", {window, 60.0}, std::max(2.0, window));
  data_timeout_ = parameters.number("data_timeout", {0.01, 3600.0}, 10.0);
  lockstep_ = parameters.flag("lockstep", false);
  name_in_lockstep_ =
      parameters.text("name_in_lockstep", participantName(nh_.getNamespace(), pnh_.getNamespace()));
  parameters.refuseUnknown();
  live_ = std::make_unique<LiveSettings>(
      pnh_,
      LiveValues{liveNumber("window", window, {windows.low, std::min(windows.high, history_)},
                            "Of the sliding estimate, from the next block on [s]")},
      parameters.asked());
}

// ---- the data path ----

void LocusNode::onExciter(const Exciter::ConstPtr& exciter) {
  const std::string fault = exciter->on ? faultOf(*exciter) : std::string();
  if (!fault.empty()) ROS_ERROR("exciter ignored: %s", fault.c_str());
  const std::lock_guard<std::mutex> lock(mutex_);
  exciter_ = *exciter;
  if (!fault.empty()) exciter_->on = false;
}

void LocusNode::onCarrier(const geometry_msgs::PoseStamped::ConstPtr& pose) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!carrier_.empty() && pose->header.stamp < carrier_.back()->header.stamp) carrier_.clear();
  carrier_.push_back(pose);
  while (carrier_.front()->header.stamp + ros::Duration(history_) < pose->header.stamp) {
    carrier_.pop_front();
  }
}

void LocusNode::onBlock(const DisplacementSamples::ConstPtr& block) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (keep(block) && enabled_) slide();
  }
  arrived_.notify_all();
  acknowledge(block->sequence);
}

bool LocusNode::keep(const DisplacementSamples::ConstPtr& block) {
  if (!blocks_.empty()) {
    const DisplacementSamples& last = *blocks_.back();
    // who connects late may get a latched block twice
    if (block->header.stamp == last.header.stamp && block->sequence == last.sequence) return false;
    if (timeOf(*block, 0) < lastOf(last) + ros::Duration(0.5 * last.period)) {
      ROS_WARN("the clock jumped back to %.3f s: samples dropped", block->header.stamp.toSec());
      blocks_.clear();
      stream_.reset();
      ++cleared_;
      if (exciter_ && exciter_->header.stamp > lastOf(*block)) exciter_.reset();
    }
  }
  blocks_.push_back(block);
  ++block_count_;
  while (lastOf(*blocks_.front()) + ros::Duration(history_ + block->period) < lastOf(*block)) {
    blocks_.pop_front();
  }
  return true;
}

void LocusNode::acknowledge(std::uint32_t sequence) {
  if (!lockstep_) return;
  Ack ack;
  ack.node = name_in_lockstep_;
  ack.sequence = sequence;
  ack_pub_.publish(ack);
}

ros::Time LocusNode::lastSample() const {
  return blocks_.empty() ? ros::Time() : lastOf(*blocks_.back());
}

LocusNode::Window LocusNode::collect(const ros::Time& start, const ros::Time& end,
                                     const Exciter& exciter) const {
  Window window;
  window.start = start;
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

double LocusNode::carrierMotion(const ros::Time& start, const ros::Time& end) const {
  const double lever = mechanism_.peg.coupling_height + mechanism_.peg.half_height;
  std::optional<Pose> reference;
  double largest = 0.0;
  for (const auto& stamped : carrier_) {
    if (stamped->header.stamp < start || stamped->header.stamp > end) continue;
    const Pose X = fromPose(stamped->pose, "carrier_pose");
    if (!reference) reference = X;
    const double turn = vectorFromRotation(reference->R.transpose() * X.R).value.norm();
    largest = std::max(largest, (X.p - reference->p).norm() + lever * turn);
  }
  return largest;
}

void LocusNode::slide() {
  // idle while the exciter is off or nobody looks
  if (!exciter_ || !exciter_->on ||
      (locus_pub_.getNumSubscribers() == 0 && mode_pub_.getNumSubscribers() == 0)) {
    stream_.reset();
    return;
  }

  // as many whole periods as fit, at least one, all under this exciter
  const DisplacementSamples& newest = *blocks_.back();
  const double cycle = kTwoPi / exciter_->frequency;
  const double length = cycle * std::max(1.0, std::floor(live_->number("window") / cycle));
  const double samples = std::ceil(length / newest.period - 1e-6);
  if (samples * newest.period > history_ || samples < static_cast<double>(kMinLocusSamples)) return;
  if (!stream_ || stream_->exciter.header.stamp != exciter_->header.stamp ||
      stream_->exciter.frequency != exciter_->frequency ||
      stream_->exciter.phase != exciter_->phase ||
      stream_->exciter.direction != exciter_->direction ||
      static_cast<double>(stream_->fit.window()) != samples) {
    // drift is fitted: the carrier may still creep
    stream_.emplace(
        Stream{SlidingFit<6>(static_cast<std::size_t>(samples), true), *exciter_, {}, {}});
  }

  // what has come since, of a new stream a window's worth from the past
  const ros::Time from =
      stream_->last ? *stream_->last + ros::Duration(0.5 * newest.period)
                    : std::max(later(exciter_->header.stamp, -kSampleRounding * newest.period),
                               later(lastSample(), -(samples - 0.5) * newest.period));
  auto block = blocks_.end();
  while (block != blocks_.begin() && lastOf(**std::prev(block)) >= from) --block;
  for (; block != blocks_.end(); ++block) {
    const DisplacementSamples& b = **block;
    if (stream_->last && (b.header.stamp - *stream_->last).toSec() > 1.5 * b.period) {
      stream_->fit.reset();
    }
    const double since = (b.header.stamp - exciter_->header.stamp).toSec();
    const double skipped = std::ceil((from - b.header.stamp).toSec() / b.period);
    for (auto k = static_cast<std::size_t>(std::max(0.0, skipped)); k < sizeOf(b); ++k) {
      const double t = since + b.period * static_cast<double>(k);
      stream_->fit.add(exciter_->direction * (exciter_->frequency * t + exciter_->phase),
                       Vector6::Map(b.displacement.data() + 6 * k));
    }
    stream_->last = lastOf(b);
  }
  if (!stream_->fit.full()) return;

  try {
    const ros::Time end = lastSample() + ros::Duration(newest.period);
    MeasuredMotion motion;
    motion.fit = stream_->fit.fit();
    const LocusReading reading =
        readLocus(mechanism_, exciterOf(*exciter_), motion, limits_, stream_->mode);
    stream_->mode = reading.mode.mode;
    const LocusEstimate result = message(reading, *exciter_, end, newest.header.frame_id);
    locus_pub_.publish(result);
    if (!mode_ || *mode_ != result.mode) {
      mode_ = result.mode;
      mode_pub_.publish(result);
    }
  } catch (const InputError& error) {
    ROS_WARN_THROTTLE(5.0, "no locus: %s", error.what());
  }
}

LocusEstimate LocusNode::message(const LocusReading& reading, const Exciter& exciter,
                                 const ros::Time& end, const std::string& frame_id) {
  LocusEstimate out = toLocusEstimate(reading, exciter.frequency);
  out.header.stamp = end;
  out.header.frame_id = frame_id;
  return out;
}

bool LocusNode::enable(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  enabled_ = request.data;
  response.success = true;
  response.message = enabled_ ? "enabled" : "disabled: samples are kept, nothing is computed";
  return true;
}

// ---- the action ----

void LocusNode::identify(const IdentifyLocusGoal::ConstPtr& goal) {
  IdentifyLocusResult result;
  Exciter exciter = goal->exciter;
  const ros::Time end = later(goal->start, goal->duration.toSec());
  Window window;
  result.message = [&]() -> std::string {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!enabled_) return "disabled: call ~enable first";
      if (exciter.header.stamp.isZero()) {
        if (!exciter_) return "no exciter message yet: give the exciter in the goal";
        exciter = *exciter_;
      }
    }
    const std::string fault = faultOf(exciter);
    if (!fault.empty()) return fault;
    const double duration = goal->duration.toSec();
    if (!(duration > 0.0 && duration <= history_)) {
      return text("duration is %g s: give a positive one up to %g s", duration, history_);
    }
    const std::string reason = await(goal->start, end, exciter);
    if (!reason.empty()) return reason;

    double motion = 0.0;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      window = collect(goal->start, end, exciter);
      motion = carrierMotion(goal->start, end);
    }
    const double expected = std::floor(duration / window.period + kSampleRounding);
    if (static_cast<double>(window.angle.size()) < expected) {
      return text("%.0f of the window's %.0f samples are missing: repeat the reading",
                  expected - static_cast<double>(window.angle.size()), expected);
    }
    if (motion > carrier_motion_) {
      return text("the carrier moved the peg by %.2g m, more than %.2g m: hold it while reading",
                  motion, carrier_motion_);
    }
    try {
      const LocusReading reading =
          readLocus(mechanism_, exciterOf(exciter), window.angle, window.signals, limits_);
      result.locus = message(reading, exciter, window.end, window.frame_id);
      if (!reading.refusal.empty()) return reading.refusal;
    } catch (const InputError& error) {
      return error.what();
    }
    result.success = true;
    const char* const advice = toString(static_cast<ReadingAdvice>(result.locus.advice));
    return text("%s from %zu samples%s%s", toString(static_cast<LocusMode>(result.locus.mode)),
                window.angle.size(), *advice != 0 ? ": " : "", advice);
  }();

  if (server_.isPreemptRequested()) {
    server_.setPreempted(result, result.message);
  } else if (result.success) {
    server_.setSucceeded(result, result.message);
  } else {
    server_.setAborted(result, result.message);
  }
}

std::string LocusNode::await(const ros::Time& start, const ros::Time& end, const Exciter& exciter) {
  using Clock = std::chrono::steady_clock;
  const auto patience = std::chrono::duration<double>(data_timeout_);
  auto deadline = Clock::now() + patience;
  std::unique_lock<std::mutex> lock(mutex_);
  const std::uint64_t cleared = cleared_;
  std::optional<std::uint64_t> seen;
  while (true) {
    if (!ros::ok()) return "the node is shutting down";
    if (server_.isPreemptRequested()) return "preempted";
    if (cleared_ != cleared) return "the clock jumped back: repeat the reading";
    if (!blocks_.empty()) {
      const double period = blocks_.back()->period;
      const ros::Time first = blocks_.front()->header.stamp;
      if (start + ros::Duration((1.0 + kSampleRounding) * period) < first) {
        return text("the window starts at %.6f s but samples are kept from %.6f s on: ask earlier",
                    start.toSec(), first.toSec());
      }
      if (lastSample() + ros::Duration((1.0 + kSampleRounding) * period) >= end) return {};
    }
    if (seen != block_count_) {
      seen = block_count_;
      deadline = Clock::now() + patience;
      // how far the reading is
      const Window window = collect(start, end, exciter);
      IdentifyLocusFeedback feedback;
      feedback.probabilities[4] = 1.0;
      feedback.cycles =
          static_cast<double>(window.angle.size()) * window.period * exciter.frequency / kTwoPi;
      lock.unlock();
      if (feedback.cycles >= 1.0) {
        try {
          MeasuredMotion motion;
          motion.fit = fitHarmonic(window.angle, window.signals);
          const LocusReading reading = readLocus(mechanism_, exciterOf(exciter), motion, limits_);
          feedback.probabilities = message(reading, exciter, window.end, {}).probabilities;
        } catch (const InputError&) {
          // too few samples yet: undecided
        }
      }
      server_.publishFeedback(feedback);
      lock.lock();
      continue;
    }
    if (Clock::now() >= deadline) {
      return text("no displacement samples for %g s: is the driver of sensor_b running?",
                  data_timeout_);
    }
    arrived_.wait_for(lock, std::chrono::milliseconds(20));
  }
}

}  // namespace assembly_cell::ros_bridge
