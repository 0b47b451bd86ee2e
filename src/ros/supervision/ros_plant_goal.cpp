// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <vector>

#include "assembly_cell/align/search/step.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/locus/vibration_fit.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/estimation/locus_messages.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

// A goal over the cell: how it begins, waits, goes on after a lapse, and ends.
namespace assembly_cell::ros_bridge {

namespace {

constexpr double kTick = 0.02;       // between two looks while waiting, wall clock [s]
constexpr double kAnswer = 0.2;      // of a node to a question, wall clock [s]
constexpr double kSlowAnswer = 2.0;  // in lockstep, where time stands meanwhile [s wall]
constexpr double kTooSlow = 10.0;    // without a fresh block, cell time [s]
constexpr double kSettle = 0.2;      // shaken anew before a reading is repeated [s]
constexpr double kIntervals = 15.0;  // of blocks: silence, on a machine that is slow
constexpr double kParting = 1.0;     // for data while the node is shutting down [s]
constexpr double kJump = 1.0;        // of the stamps: another life of the plant, or a freeze [s]
constexpr int kReadings = 2;         // of one contact, where samples or the estimator got lost
constexpr std::size_t kLeastSamples = 8;  // of a vibration
// Of a channel at its limit [s]. A press ends at the third such block and takes the load off within
// 0.3 s; so long is nothing that a strategy does.
constexpr double kSaturated = 0.5;
constexpr int kLeastSaturated = 5;  // blocks: two with a freeze between them are no proof
constexpr char kBlock[] = "block of samples";
constexpr std::chrono::seconds kLettingGo(1);  // of wall time
// of the participants of a lockstep that a cell may have: time waits for them, asked or not
constexpr const char* kOptional[] = {"twin_force/status", "align/status", "identify/status"};

}  // namespace

// ---- waiting ----

void RosPlant::checkGoal() const {
  if (!ros::ok()) throw PlantError(AlignFailure::kStopped, "the node is shutting down");
  const double time = origin_.isZero() ? 0.0 : (last_.end - origin_).toSec();
  if (time > most_time_) {
    throw PlantError(AlignFailure::kStopped,
                     recovering_
                         ? text("not freed within %g s", recovery_time_)
                         : text("not done within %g s: see ~goal_time", settings_.goal_time));
  }
  if (recovering_) return;
  if (stopping_) throw PlantError(AlignFailure::kStopped, "the node is shutting down");
  if (cancelled_ && cancelled_()) throw PlantError(AlignFailure::kCancelled, "cancelled");
  if (const auto fault = link_.fault()) throw PlantError(AlignFailure::kStopped, *fault);
}

// Of a wait, wall time. In lockstep the cell's time stands while somebody is slow.
double RosPlant::patience() const {
  if (stopping_) return std::min(kParting * settings_.slow_factor, settings_.timeout);
  // who cancels a goal has an answer, also while the plant is paused
  if (recovering_ && lockstep_) return std::min(kProbe * settings_.slow_factor, settings_.timeout);
  if (lockstep_ || origin_.isZero()) return settings_.timeout;
  return std::max(settings_.data_timeout * settings_.slow_factor,
                  std::min(kIntervals * block_interval_, settings_.timeout));
}

void RosPlant::waitFor(std::unique_lock<std::mutex>& lock, const std::string& what,
                       const std::function<bool()>& ready) {
  const auto begin = Steady::now();
  double waited = 0.0, probed = 0.0;
  while (true) {
    checkGoal();
    if (ready()) return;
    const bool over = waited >= patience();
    if (over || waited >= probed + kProbe) {
      probed = waited;
      const std::string who = whoIsMissing(lock, !over);
      if (ready()) return;
      if (over || !who.empty()) {
        // with the questions, which a frozen node leaves open for long
        const double passed = std::chrono::duration<double>(Steady::now() - begin).count();
        throw PlantError(
            AlignFailure::kNoData,
            text("no %s within %.3g s of wall time%s%s", what.c_str(), passed,
                 !who.empty()     ? ": "
                 : what == kBlock ? " (is the simulator paused or stopped? its diagnostics tell)"
                                  : "",
                 who.c_str()));
      }
    }
    const auto before = Steady::now();
    waitForChange(lock, ready);
    alive_ = Steady::now();
    // a process that was frozen has not waited
    waited += std::min(std::chrono::duration<double>(alive_ - before).count(), 2 * kTick);
  }
}

// A tick, or less. In lockstep, where nodes share a thread, it is this one that works for it: what
// a strategy waits for needs no other thread to wake up.
void RosPlant::waitForChange(std::unique_lock<std::mutex>& lock,
                             const std::function<bool()>& ready) {
  const auto until = Steady::now() + std::chrono::duration_cast<Steady::duration>(
                                         std::chrono::duration<double>(kTick));
  if (!lockstep_ || !SharedSpinner::ofThisProcess().works()) {
    changed_.wait_until(lock, until);
    return;
  }
  const auto is_ready = [&] {
    const std::lock_guard<std::mutex> look(mutex_);
    return ready();
  };
  lock.unlock();
  SharedSpinner::Helper().callUntil(is_ready, until);
  lock.lock();
}

void RosPlant::waitForBlock(std::unique_lock<std::mutex>& lock) {
  acknowledge();
  waitFor(lock, kBlock, [this] { return fresh_.has_value(); });
  last_ = *fresh_;
  fresh_.reset();
}

double RosPlant::questionTime() const {
  return settings_.slow_factor * (lockstep_ ? kSlowAnswer : kAnswer);
}

// Of other nodes, which may take long to answer: callbacks go on meanwhile, by another thread.
void RosPlant::ask(std::unique_lock<std::mutex>& lock, const std::function<void()>& question) {
  const bool helps = helper_.has_value();
  helper_.reset();
  lock.unlock();
  question();
  lock.lock();
  if (helps) helper_.emplace();
}

// Whose messages stay out.
std::string RosPlant::whoIsMissing(std::unique_lock<std::mutex>& lock, bool only_gone) {
  std::vector<std::string> topics;
  const auto add = [&](const char* topic) { topics.push_back(nh_.resolveName(topic)); };
  if (lockstep_) {
    for (const std::string& topic : missingParts()) add(topic.c_str());
  } else {
    const auto now = Steady::now();
    const auto silent = [&](std::size_t part) {
      return std::chrono::duration<double>(now - arrived_[part]).count() > 0.5 * patience();
    };
    // without the plant nobody else has anything to say
    for (std::size_t part = 0; part < 4 && !silent(3); ++part) {
      if (silent(part)) add(kBlockTopics[part]);
    }
    if (silent(3)) add(kBlockTopics[3]);
  }
  const bool anybody = topics.empty();
  if (anybody) {
    for (const char* topic : kBlockTopics) add(topic);
    add("identify_locus/status");
    for (const char* topic : kOptional) {
      if (lockstep_) add(topic);
    }
  }
  const bool running = !origin_.isZero();
  std::vector<TopicPublisher> found;
  std::string lost;
  ask(lock, [&] {
    found = publishersOf(topics, lockstep_ || anybody ? questionTime() : 0.0);
    lost = twin_force_.complaint();
  });
  if (only_gone || anybody) {
    const auto there = [&](const TopicPublisher& publisher) {
      const bool unknown = publisher.presence == NodePresence::kUnknown;
      const bool nobody = unknown && running;
      const bool optional =
          std::any_of(std::begin(kOptional), std::end(kOptional),
                      [&](const char* topic) { return publisher.topic == nh_.resolveName(topic); });
      return publisher.presence == NodePresence::kListening || (nobody ? optional : unknown);
    };
    found.erase(std::remove_if(found.begin(), found.end(), there), found.end());
  }
  for (TopicPublisher& publisher : found) {
    // who ended in order has told the master
    for (std::size_t part = 0; part < publishers_.size() && publisher.node.empty(); ++part) {
      if (publishers_[part].empty() || publisher.topic != nh_.resolveName(kBlockTopics[part])) {
        continue;
      }
      publisher.node = publishers_[part];
      publisher.presence = NodePresence::kGone;
    }
  }
  const std::string gone = describe(found);
  return gone.empty() && !lost.empty() ? "twin_force_estimator is gone" + lost : gone;
}

// ---- fresh blocks ----

bool RosPlant::lastIsFresh() const {
  return isFresh(last_.end.toSec(), clock_.now(wallTime(Steady::now())));
}

bool RosPlant::hasData() const {
  std::lock_guard<std::mutex> lock(mutex_);
  if (origin_.isZero()) return false;
  // in lockstep time stands when somebody is missing
  const std::chrono::duration<double> silent = Steady::now() - block_arrived_;
  return silent.count() < (lockstep_ ? kProbe * settings_.slow_factor : patience());
}

// The next block that may be handed out: fresh, from a plant that follows.
void RosPlant::takeNext(std::unique_lock<std::mutex>& lock) {
  double passed = 0.0;
  while (true) {
    const ros::Time before = last_.end;
    waitForBlock(lock);
    checkSensors(lock);
    if (lockstep_) return;
    const double step = before.isZero() ? 0.0 : (last_.end - before).toSec();
    if (step < kJump) passed += step;
    if (passed > kTooSlow && lastIsFresh()) {
      throw PlantError(AlignFailure::kNoData,
                       text("the plant doesn't follow within %g s: who leads it has no fresh "
                            "samples or state, see its diagnostics",
                            kTooSlow));
    }
    if (passed > kTooSlow) {
      throw PlantError(AlignFailure::kNoData,
                       text("no block younger than %g s within %g s: the machine, or a driver, is "
                            "too slow; for a simulation give real_time_factor:=0.2 or "
                            "lockstep:=true",
                            kFreshAge, kTooSlow));
    }
    if (!lastIsFresh() || !link_.follows()) continue;
    if (!link_.lapsed()) return;
    repeat(lock);
  }
}

// A channel that is at its limit for as long as a press never is says nothing any more.
void RosPlant::checkSensors(std::unique_lock<std::mutex>& lock) {
  for (std::size_t sensor = 0; sensor < saturation_.size(); ++sensor) {
    Saturation& s = saturation_[sensor];
    if (last_.saturated[sensor] == 0) {
      s = {};
      continue;
    }
    if (s.blocks++ == 0) s.since = last_.end;
    s.channels = static_cast<std::uint8_t>(s.channels | last_.saturated[sensor]);
    const double time = (last_.end - s.since).toSec();
    if (recovering_ || s.blocks < kLeastSaturated || time < kSaturated) continue;
    const std::string channels = channelText(s.channels);
    TopicPublisher from;
    ask(lock, [&] { from = publishersOf({nh_.resolveName(kBlockTopics[sensor])}).front(); });
    throw PlantError(
        AlignFailure::kSensorSaturated,
        text(
            "sensor_saturated: %s: channels %s at their limit in every block for %.2g s: %s of %s; "
            "look at its load, its offset, its noise and its wires",
            sensor == 0 ? "sensor_a" : "sensor_b", channels.c_str(), time, from.topic.c_str(),
            from.node.c_str()));
  }
}

// Before a command. What has been decided on an old block waits for a young one.
void RosPlant::freshen(std::unique_lock<std::mutex>& lock) {
  if (lockstep_) return;
  while (!lastIsFresh() || !link_.follows() || link_.lapsed()) {
    fresh_.reset();
    takeNext(lock);
  }
}

// The lease lapsed, or a command came too late: the plant stands, exciter off.
void RosPlant::repeat(std::unique_lock<std::mutex>& lock) {
  ROS_WARN_THROTTLE(1.0, "the plant had been let go: commands repeated");
  link_.repeated();
  if (exciter_.on) {
    const double passed = (last_.end - exciter_.header.stamp).toSec();
    ExciterParameters drive;
    drive.amplitude = exciter_.amplitude;
    drive.frequency = exciter_.frequency;
    drive.phase = std::remainder(exciter_.phase + exciter_.frequency * passed, 2 * M_PI);
    drive.direction = exciter_.direction;
    publishExciter(drive);
  }
  if (commanded_) publishCarrier(*commanded_);
  const bool vibration = vibration_.request.has_value();
  if (!locus_wanted_ && !vibration) return;
  if (locus_wanted_) endReading(lock);
  const ros::Time settled = last_.end + ros::Duration(kSettle);
  while (last_.end < settled) {
    waitForBlock(lock);
    if (link_.lapsed()) break;
  }
  // where it lapsed again, this one is given up in its turn
  const LocusRequest again{(last_.end - origin_).toSec(), locus_duration_};
  if (vibration) {
    beginVibration(again);
  } else {
    sendLocusGoal(lock, again);
  }
}

void RosPlant::endReading(std::unique_lock<std::mutex>& lock) {
  // actionlib's locks come before ours
  lock.unlock();
  locus_client_->cancelGoal();
  lock.lock();
  locus_wanted_ = false;
}

// ---- the goal ----

void RosPlant::begin(const std::function<bool()>& cancelled) {
  std::unique_lock<std::mutex> lock(mutex_);
  cancelled_ = cancelled;
  active_ = true;
  recovering_ = false;
  locus_wanted_ = false;
  vibration_.request.reset();
  recent_.clear();
  fresh_.reset();
  last_ = Block{};
  saturation_ = {};
  origin_ = ros::Time();
  start_ = Pose{};
  commanded_.reset();
  alive_ = Steady::now();
  most_time_ = settings_.goal_time;
  const auto arrived = [this] { return fresh_.has_value(); };
  // a plant with a dead man would stop a session that begins before a driver is back
  if (!lockstep_) waitFor(lock, kBlock, arrived);
  // who held it a moment ago may still be letting it go, by its answer to the next block
  const auto is_free = [this] { return link_.isFree(); };
  const auto until = Steady::now() + kLettingGo;
  while (!is_free() && Steady::now() < until) {
    acknowledge();
    waitForChange(lock, is_free);
  }
  link_.begin();
  waitFor(lock, kBlock, arrived);
  waitFor(lock, "calibration of sensor_a and sensor_b",
          [this] { return rounding_a_ && rounding_b_; });
  if (serial_a_ == serial_b_ && serial_a_ != kUnknownSerial) {
    throw PlantError(AlignFailure::kStopped,
                     "sensor_a and sensor_b both have a calibration of '" + serial_a_ +
                         "': give each the one of its own serial number (cell.launch "
                         "calibration_a:=, calibration_b:=)");
  }
  last_ = *fresh_;
  fresh_.reset();
  // a plant that has a guard must say that it follows
  if (!lockstep_ && !(lastIsFresh() && link_.follows())) takeNext(lock);
  origin_ = last_.end;
  start_ = last_.X_BC;
  link_.move();
}

PlantBlock RosPlant::next(const PlantCommand& command) {
  return nextStep(
      command, [this](const PlantCommand& asked, bool first) { return nextBlock(asked, first); });
}

PlantBlock RosPlant::nextBlock(const PlantCommand& command, bool first) {
  // from here on the spinner's thread need not wake up for what is commanded
  const std::shared_ptr<void> until_return(nullptr, [this](void*) { helper_.reset(); });
  if (lockstep_) helper_.emplace();
  std::unique_lock<std::mutex> lock(mutex_);
  checkGoal();
  if (command.rest || command.exciter || command.locus || command.vibration) freshen(lock);
  if (command.rest) publishCarrier(poseFromRest(*command.rest));
  if (command.exciter) publishExciter(*command.exciter);
  if (command.locus) {
    locus_attempts_ = 0;
    sendLocusGoal(lock, *command.locus);
  }
  if (command.vibration) beginVibration(*command.vibration);

  // blocks from before the commands are of no interest
  if (first) fresh_.reset();
  takeNext(lock);
  PlantBlock block = plantBlock(last_);
  if (locus_wanted_ && block.time >= locus_end_) takeReading(lock, block);
  if (vibration_.request && block.time >= locus_end_) {
    const std::size_t samples = vibration_.angles.size();
    if (samples < kLeastSamples) {
      throw PlantError(AlignFailure::kNoReading,
                       text("%zu samples of sensor_b/wrench_samples in a window of %g s", samples,
                            locus_duration_));
    }
    block.vibration = fitVibration(vibration_.angles, vibration_.wrenches);
    vibration_.request.reset();
  }
  return block;
}

// The window of a reading has ended: its result comes with this block.
void RosPlant::takeReading(std::unique_lock<std::mutex>& lock, PlantBlock& block) {
  waitFor(lock, "result of identify_locus of " + locus_node_, [this] { return locus_done_; });
  locus_wanted_ = false;
  if (locus_error_.empty()) {
    block.locus = fromLocusEstimate(locus_result_->locus);
    if (!locus_result_->success) block.locus->refusal = locus_result_->message;
    return;
  }
  const std::string error = "identify_locus of " + locus_node_ + ": " + locus_error_;
  if (++locus_attempts_ == kReadings) throw PlantError(AlignFailure::kNoReading, error);
  ROS_WARN("%s: once more", error.c_str());
  sendLocusGoal(lock, {block.time, locus_duration_});
  block.reading_start = locus_start_;
}

void RosPlant::recover(double seconds) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (origin_.isZero()) {
    throw PlantError(AlignFailure::kNoData, "nothing is known of the cell");
  }
  active_ = recovering_ = true;
  alive_ = Steady::now();
  cancelled_ = nullptr;
  vibration_.request.reset();
  if (locus_wanted_) endReading(lock);
  if (exciter_.on) publishExciter(ExciterParameters{});
  // with the next block
  most_time_ = std::numeric_limits<double>::infinity();
  commanded_.reset();
  link_.begin();
  fresh_.reset();
  takeNext(lock);
  link_.move();
  recovery_time_ = seconds;
  most_time_ = (last_.end - origin_).toSec() + seconds;
}

void RosPlant::end(bool hold) {
  std::unique_lock<std::mutex> lock(mutex_);
  vibration_.request.reset();
  if (locus_wanted_) endReading(lock);
  if (exciter_.on) publishExciter(ExciterParameters{});
  // a goal that did not even begin commands nothing: somebody else may hold the plant
  if (hold && !origin_.isZero() && (lockstep_ || lastIsFresh())) publishCarrier(last_.X_BC);
  link_.end();
  active_ = false;
  recovering_ = false;
  moved_ = false;
  cancelled_ = nullptr;
  twin_force_.release();
  acknowledge();
}

}  // namespace assembly_cell::ros_bridge
