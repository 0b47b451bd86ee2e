// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/locus_node.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/estimation/locus_messages.h"
#include "assembly_cell/ros/process/participants.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr Range kHistory{1e-3, 60.0, "s"};
constexpr double kDefaultHistory = 2.0, kMaxWindow = 10.0;  // [s]

// Why an exciter that should be running is refused; empty: it is valid.
std::string exciterFault(const Exciter& exciter) {
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

// end: of the window.
LocusEstimate stampedEstimate(const LocusReading& reading, const Exciter& exciter,
                              const ros::Time& end, const std::string& frame_id) {
  LocusEstimate out = toLocusEstimate(reading, exciter.frequency);
  out.header.stamp = end;
  out.header.frame_id = frame_id;
  return out;
}

}  // namespace

void fields(FieldList& f, LocusSettings& s) {
  f.text("scenario", s.scenario,
         "Scenario file with the nominal parts of the mechanism; their poses are not used.")
      .required();
  f.number(
       "window", s.window, {1e-3, std::min(kMaxWindow, s.history), "s"},
       "Longest window of the sliding estimate, shortened to whole periods of the exciter; at most "
       "history where that is given.")
      .live();
  f.number("history", s.history, kHistory,
           "Duration of the samples that are kept, and of the longest measurement.")
      .derived("2, or window where that is longer");
  f.number(
      "false_alarm", s.limits.false_alarm, {1e-6, 0.49},
      "Rate at which a true contact mode is refused; lower: fewer false ellipses, higher: fewer "
      "undecided.");
  f.number("indifference", s.limits.indifference, {0.0, 0.5},
           "A minor axis or a counter-rotating part below this ratio counts as none.");
  f.number("misfit_limit", s.limits.misfit, Range::kPositive,
           "Hypotheses only where a single contact explains the locus but for this fraction.");
  f.number("direction_limit", s.limits.direction_sd, positive("rad"),
           "A measurement is refused as too_uncertain if noise makes the sd of the worst contact "
           "direction larger.");
  f.number("carrier_motion", s.carrier_motion, positive("m"),
           "A measurement is refused if the carrier moves the tip of the peg farther meanwhile.");
  f.number("data_timeout", s.data_timeout, {0.01, 3600.0, "s"},
           "Longest wait for the next block of a measurement, wall clock.");
  f.flag("lockstep", s.lockstep, "Blocks are acknowledged.");
  f.text("name_in_lockstep", s.name_in_lockstep, "Name in the participants of the simulator.")
      .derived("its name relative to the cell");
}

LocusNode::LocusNode(const ros::NodeHandle& node_handle, const ros::NodeHandle& private_handle)
    : server_(node_handle, "identify_locus",
              [this](const IdentifyLocusGoal::ConstPtr& goal) { identify(goal); }) {
  ros::NodeHandle nh = node_handle, pnh = private_handle;
  Parameters parameters(pnh);
  LocusSettings& s = settings_;
  s.name_in_lockstep = participantName(nh.getNamespace(), pnh.getNamespace());
  // the window's range depends on the history; without one, the history on the window
  const double history = parameters.number("history", kHistory, 0.0);
  s.history = history > 0.0 ? history : kMaxWindow;
  parameters.read(fieldsOf(s));
  if (history == 0.0) s.history = std::max(kDefaultHistory, s.window);
  mechanism_ = loadMechanism(s.scenario, parameters.texts("overrides", std::vector<std::string>{}));
  parameters.refuseUnknown();
  history_.setLength(s.history);
  live_ = std::make_unique<LiveSettings>(pnh, liveValues(fieldsOf(s), "from the next block on"),
                                         parameters.known());

  output_.locus = nh.advertise<LocusEstimate>("locus", kQueue);
  output_.mode = nh.advertise<LocusEstimate>("contact_mode", 1, true);
  if (s.lockstep) ack_pub_ = {nh, "ack", kQueue};
  enable_srv_ = pnh.advertiseService<std_srvs::SetBool::Request, std_srvs::SetBool::Response>(
      "enable", [this](std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
        const std::lock_guard<std::mutex> lock(mutex_);
        enabled_ = request.data;
        response.success = true;
        response.message = enabled_ ? "enabled" : "disabled: samples are kept, nothing is computed";
        return true;
      });
  server_.start();
  exciter_sub_ = subscribeChecked<Exciter>(
      nh, "exciter", kQueue, [this](const Exciter::ConstPtr& m) { onExciter(m); },
      ros::TransportHints().tcpNoDelay());
  carrier_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
      nh, "carrier_pose", kQueue,
      [this](const geometry_msgs::PoseStamped::ConstPtr& m) {
        const std::lock_guard<std::mutex> lock(mutex_);
        history_.addCarrier(m);
      },
      nullptr, s.lockstep);
  block_sub_ = subscribeStream<DisplacementSamples>(
      nh, "sensor_b/displacement_samples", kQueue,
      [this](const DisplacementSamples::ConstPtr& m) { onBlock(m); },
      [this](const DisplacementSamples& m, const std::string&) { acknowledge(m.sequence); },
      s.lockstep);
}

LocusNode::~LocusNode() {
  block_sub_.shutdown();
  server_.shutdown();
}

// ---- the sliding estimate ----

void LocusNode::onExciter(const Exciter::ConstPtr& exciter) {
  const std::string fault = exciter->on ? exciterFault(*exciter) : std::string();
  if (!fault.empty()) ROS_ERROR("exciter ignored: %s", fault.c_str());
  const std::lock_guard<std::mutex> lock(mutex_);
  exciter_ = *exciter;
  if (!fault.empty()) exciter_->on = false;
}

void LocusNode::onBlock(const DisplacementSamples::ConstPtr& block) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const LocusHistory::Arrival arrival = history_.add(block);
    if (arrival == LocusHistory::Arrival::kClockJumped) {
      sliding_.reset();
      if (exciter_ && exciter_->header.stamp > history_.lastSample()) exciter_.reset();
    }
    if (arrival != LocusHistory::Arrival::kRepeated && enabled_) publishLocus();
  }
  arrived_.notify_all();
  acknowledge(block->sequence);
}

void LocusNode::acknowledge(std::uint32_t sequence) {
  if (!settings_.lockstep) return;
  Ack ack;
  ack.node = settings_.name_in_lockstep;
  ack.sequence = sequence;
  ack_pub_.publish(ack);
}

void LocusNode::publishLocus() {
  // Nothing is computed while the exciter is off or without subscribers. In lockstep it is computed
  // without them too: its last bits depend on the sample at which it began.
  const bool wanted = settings_.lockstep || output_.locus.getNumSubscribers() > 0 ||
                      output_.mode.getNumSubscribers() > 0;
  if (!exciter_ || !exciter_->on || !wanted) {
    sliding_.reset();
    return;
  }
  try {
    const auto reading = sliding_.update(mechanism_, settings_.limits, *exciter_, history_,
                                         live_->number("window"), settings_.history);
    if (!reading) return;
    const DisplacementSamples& newest = *history_.blocks().back();
    const LocusEstimate estimate =
        stampedEstimate(*reading, *exciter_, history_.lastSample() + ros::Duration(newest.period),
                        newest.header.frame_id);
    output_.locus.publish(estimate);
    if (output_.last_mode == estimate.mode) return;
    output_.last_mode = estimate.mode;
    output_.mode.publish(estimate);
  } catch (const InputError& error) {
    ROS_WARN_THROTTLE(5.0, "no locus: %s", error.what());
  }
}

// ---- the action ----

void LocusNode::identify(const IdentifyLocusGoal::ConstPtr& goal) {
  IdentifyLocusResult result;
  try {
    result.message = identifyInto(*goal, result);
    result.success = true;
  } catch (const InputError& error) {
    result.message = error.what();
  }
  if (server_.isPreemptRequested()) {
    server_.end(Server::Status::PREEMPTED, result, result.message);
  } else {
    server_.finish(result.success, result, result.message);
  }
}

std::string LocusNode::identifyInto(const IdentifyLocusGoal& goal, IdentifyLocusResult& result) {
  Exciter exciter = goal.exciter;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!enabled_) throw InputError("disabled: call ~enable first");
    if (exciter.header.stamp.isZero()) {
      if (!exciter_) throw InputError("no exciter message yet: give the exciter in the goal");
      exciter = *exciter_;
    }
  }
  const std::string fault = exciterFault(exciter);
  if (!fault.empty()) throw InputError(fault);
  const double duration = goal.duration.toSec();
  if (!(duration > 0.0 && duration <= settings_.history)) {
    throw InputError(
        text("duration is %g s: give a positive one up to %g s", duration, settings_.history));
  }
  const ros::Time end = later(goal.start, duration);
  waitForWindow(goal.start, end, exciter);

  LocusHistory::Window window;
  double motion = 0.0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    window = history_.window(goal.start, end, exciter);
    motion = history_.carrierMotion(goal.start, end,
                                    mechanism_.peg.coupling_height + mechanism_.peg.half_height);
  }
  const double expected = std::floor(duration / window.period + kSampleRounding);
  if (static_cast<double>(window.angle.size()) < expected) {
    throw InputError(text("%.0f of the window's %.0f samples are missing: repeat the reading",
                          expected - static_cast<double>(window.angle.size()), expected));
  }
  if (motion > settings_.carrier_motion) {
    throw InputError(
        text("the carrier moved the peg by %.2g m, more than %.2g m: hold it while reading", motion,
             settings_.carrier_motion));
  }
  const LocusReading reading =
      readLocus(mechanism_, exciterOf(exciter), window.angle, window.signals, settings_.limits);
  result.locus = stampedEstimate(reading, exciter, window.end, window.frame_id);
  if (!reading.refusal.empty()) throw InputError(reading.refusal);
  const char* const advice = toString(static_cast<ReadingAdvice>(result.locus.advice));
  return text("%s from %zu samples%s%s", toString(static_cast<LocusMode>(result.locus.mode)),
              window.angle.size(), *advice != 0 ? ": " : "", advice);
}

void LocusNode::waitForWindow(const ros::Time& start, const ros::Time& end,
                              const Exciter& exciter) {
  using Clock = std::chrono::steady_clock;
  const auto patience = std::chrono::duration<double>(settings_.data_timeout);
  auto deadline = Clock::now() + patience;
  std::unique_lock<std::mutex> lock(mutex_);
  const std::uint64_t jumps = history_.jumpCount();
  std::optional<std::uint64_t> seen;
  while (true) {
    if (!ros::ok()) throw InputError("the node is shutting down");
    if (server_.isPreemptRequested()) throw InputError(server_.preemptReason());
    if (history_.jumpCount() != jumps) {
      throw InputError("the clock jumped back: repeat the reading");
    }
    if (!history_.blocks().empty()) {
      const double period = history_.blocks().back()->period;
      const ros::Time first = history_.blocks().front()->header.stamp;
      if (start + ros::Duration((1.0 + kSampleRounding) * period) < first) {
        throw InputError(
            text("the window starts at %.6f s but samples are kept from %.6f s on: ask earlier",
                 start.toSec(), first.toSec()));
      }
      if (history_.lastSample() + ros::Duration((1.0 + kSampleRounding) * period) >= end) return;
    }
    if (seen != history_.blockCount()) {
      seen = history_.blockCount();
      deadline = Clock::now() + patience;
      // progress of the measurement
      const LocusHistory::Window window = history_.window(start, end, exciter);
      IdentifyLocusFeedback feedback;
      feedback.probabilities[4] = 1.0;
      feedback.cycles = static_cast<double>(window.angle.size()) * window.period *
                        exciter.frequency / (2.0 * M_PI);
      lock.unlock();
      if (feedback.cycles >= 1.0) {
        try {
          MeasuredMotion motion;
          motion.fit = fitHarmonic(window.angle, window.signals);
          const LocusReading reading =
              readLocus(mechanism_, exciterOf(exciter), motion, settings_.limits);
          feedback.probabilities = stampedEstimate(reading, exciter, window.end, {}).probabilities;
        } catch (const InputError&) {
          // too few samples yet: undecided
        }
      }
      server_.publishFeedback(feedback);
      lock.lock();
      continue;
    }
    if (Clock::now() >= deadline) {
      throw InputError(text("no displacement samples for %g s: is the driver of sensor_b running?",
                            settings_.data_timeout));
    }
    arrived_.wait_for(lock, std::chrono::milliseconds(20));
  }
}

}  // namespace assembly_cell::ros_bridge
