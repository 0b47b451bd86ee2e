// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/ros_plant.h"

#include <algorithm>
#include <chrono>
#include <memory>

#include "assembly_cell/align/search/step.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/mechanism/compliance.h"
#include "assembly_cell/ros/estimation/locus_messages.h"

namespace assembly_cell::ros_bridge {

namespace {

using Steady = std::chrono::steady_clock;

constexpr double kStrategyTimeout = 2.0;  // without a call of the strategy the lease ends [s wall]
constexpr double kAnswer = 0.2;           // of a node that is looked for [s wall]
constexpr double kSlowAnswer = 2.0;       // the same in lockstep, where cell time stands
constexpr double kMaxStale = 10.0;        // without a fresh block, cell time [s]
constexpr double kJump = 1.0;             // of stamps: the plant was restarted or frozen [s]
constexpr double kSettle = 0.2;           // exciter on before a measurement is repeated [s]
constexpr std::chrono::seconds kReleaseWait(1);  // for the owner before, wall clock
constexpr char kBlock[] = "block of samples";

double answerTime(const PlantSettings& settings) {
  return settings.slow_factor * (settings.lockstep ? kSlowAnswer : kAnswer);
}

double seconds(Steady::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

RosPlant::RosPlant(ros::NodeHandle& nh, const PlantSettings& settings)
    : monitor_(settings.lockstep),
      link_(nh, settings.node, settings.lockstep, [this] { monitor_.notify(); }),
      commands_(nh),
      blocks_(nh, settings, monitor_,
              {[this](const StreamBlock& block, const WrenchSamples::ConstPtr& samples) {
                 vibration_.add(samples);
                 // a strategy that hangs keeps no plant
                 const auto idle = blocks_.arrivals().lastBlock() - monitor_.lastActivity();
                 if (seconds(idle) < kStrategyTimeout) link_.renew(block.end);
               },
               [this] {
                 commands_.onPlantRestart();
                 link_.onPlantRestart();
               },
               [this](const std::string& node) { link_.setPlantNode(node); },
               [this](Ack& ack) {
                 ack.commands = commands_.count();
                 ack.session = link_.status().session;
               }}),
      goal_(settings),
      locus_(nh, [this] { monitor_.notify(); }),
      twin_force_(nh, {settings.timeout,
                       settings.lockstep ? kProbe : settings.data_timeout * settings.slow_factor,
                       answerTime(settings),
                       [this](double time) {
                         const Lock lock = monitor_.lock();
                         return goal_.stampOf(time);
                       },
                       [this] {
                         const Lock lock = monitor_.lock();
                         monitor_.onActivity();
                         return goal_.isCancelled();
                       }}) {}

RosPlant::State RosPlant::state() const {
  const Lock lock = monitor_.lock();
  const StreamBlock& last = blocks_.last();
  const BlockArrivals& arrivals = blocks_.arrivals();
  const PlantSettings& settings = goal_.settings();
  State out;
  out.stamp = last.end;
  out.origin = goal_.stampOf(0.0);
  out.time = goal_.timeOf(last.end);
  out.start = goal_.start();
  out.carrier = last.X_BC;
  out.has_moved = commands_.hasMoved();
  // in lockstep cell time stands while a participant is missing
  const double limit =
      settings.lockstep ? kProbe * settings.slow_factor : goal_.patience(arrivals.interval());
  out.has_data = goal_.hasOrigin() && arrivals.sinceBlock() < limit;
  out.is_stopping = goal_.isStopping();
  return out;
}

void RosPlant::setMechanism(const KnownMechanism* known) {
  const Lock lock = monitor_.lock();
  commands_.setDriveErrors(known != nullptr ? known->drive : DriveErrors());
  blocks_.decoder().setCoupling(known != nullptr ? &known->mechanism.coupling : nullptr);
}

// ---- a goal ----

void RosPlant::begin(const std::function<bool()>& cancelled) {
  Lock lock = monitor_.lock();
  const bool lockstep = goal_.settings().lockstep;
  goal_.begin(cancelled);
  monitor_.onActivity();
  vibration_.clear();
  saturation_.clear();
  commands_.forgetCarrier();
  blocks_.begin(lock);
  const auto is_ready = [this] { return blocks_.ready(); };
  // a plant with a watchdog would stop a session that begins before the drivers are back
  if (!lockstep) waitFor(lock, kBlock, is_ready);
  // the previous owner may release the plant by its answer to the next block
  const auto is_free = [this] { return link_.status().is_free; };
  const auto until = Steady::now() + kReleaseWait;
  while (!is_free() && Steady::now() < until) {
    blocks_.acknowledge();
    monitor_.waitForChange(lock, is_free);
  }
  link_.acquire();
  waitFor(lock, kBlock, is_ready);
  const bool has_a = goal_.settings().sensors == Sensors::kBoth;
  waitFor(lock, has_a ? "calibration of sensor_a and sensor_b" : "calibration of sensor_b",
          [this] { return blocks_.decoder().hasCalibrations(); });
  blocks_.decoder().checkCalibrations();
  blocks_.take();
  // a plant that has a guard must report that it obeys
  if (!lockstep && !(blocks_.arrivals().isFresh(blocks_.last().end) && link_.status().is_obeyed)) {
    takeFreshBlock(lock);
  }
  goal_.setOrigin(blocks_.last().end, blocks_.last().X_BC);
  link_.beginMotion(blocks_.last().end);
}

void RosPlant::recover(double seconds) {
  Lock lock = monitor_.lock();
  if (!goal_.hasOrigin()) throw PlantError(AlignFailure::kNoData, "nothing is known of the cell");
  blocks_.setActive(true);
  goal_.beginRecovery();
  monitor_.onActivity();
  vibration_.cancel();
  lock.unlock();
  locus_.cancel();
  lock.lock();
  commands_.stopExciter(blocks_.last().end);
  commands_.forgetCarrier();
  link_.acquire();
  blocks_.drop();
  takeFreshBlock(lock);
  link_.beginMotion(blocks_.last().end);
  goal_.limitRecovery(blocks_.last().end, seconds);
}

void RosPlant::end(bool hold) {
  Lock lock = monitor_.lock();
  vibration_.cancel();
  lock.unlock();
  locus_.cancel();
  lock.lock();
  const StreamBlock& last = blocks_.last();
  commands_.stopExciter(last.end);
  // a goal that did not begin commands nothing: another node may own the plant
  const bool is_fresh = goal_.settings().lockstep || blocks_.arrivals().isFresh(last.end);
  if (hold && goal_.hasOrigin() && is_fresh) commands_.moveCarrier(last.X_BC, last.end);
  link_.release();
  blocks_.setActive(false);
  goal_.end();
  commands_.endGoal();
  twin_force_.release();
  blocks_.acknowledge();
}

// ---- a step ----

PlantBlock RosPlant::next(const PlantCommand& command) {
  return nextStep(command, [this](const PlantCommand& part, bool is_first) {
    return nextBlock(part, is_first);
  });
}

PlantBlock RosPlant::nextBlock(const PlantCommand& command, bool is_first) {
  const std::shared_ptr<void> until_return(nullptr, [this](void*) { monitor_.endStep(); });
  monitor_.beginStep();
  Lock lock = monitor_.lock();
  goal_.check(blocks_.last().end, link_.status().fault);
  if (command.rest || command.exciter || command.locus || command.vibration) {
    // a decision on a stale block waits for a fresh one
    const auto may_command = [this] {
      const PlantLink::Status link = link_.status();
      return goal_.settings().lockstep || (blocks_.arrivals().isFresh(blocks_.last().end) &&
                                           link.is_obeyed && !link.is_interrupted);
    };
    while (!may_command()) {
      blocks_.drop();
      takeFreshBlock(lock);
    }
  }
  const StreamBlock& last = blocks_.last();
  if (command.rest) commands_.moveCarrier(poseFromRest(*command.rest), last.end);
  if (command.exciter) commands_.drive(*command.exciter, last.end);
  if (command.locus) requestLocus(lock, *command.locus);
  if (command.vibration) {
    vibration_.begin(*command.vibration, commands_.exciter(), goal_.stampOf(0.0));
  }

  // blocks from before the commands are of no interest
  if (is_first) blocks_.drop();
  takeFreshBlock(lock);
  PlantBlock block = last.means;
  block.time = goal_.timeOf(last.end);
  if (vibration_.window()) {
    block.reading_start = vibration_.window()->start;
    if (vibration_.endsBy(block.time)) block.vibration = vibration_.take();
  } else if (locus_.isPending()) {
    block.reading_start = locus_.window().start;
    if (hasEnded(locus_.window(), block.time)) takeLocus(lock, block);
  }
  return block;
}

// ---- blocks ----

void RosPlant::waitFor(Lock& lock, const std::string& what, const std::function<bool()>& ready) {
  const auto begin = Steady::now();
  double waited = 0.0, probed = 0.0;
  while (true) {
    goal_.check(blocks_.last().end, link_.status().fault);
    if (ready()) return;
    const double patience = goal_.patience(blocks_.arrivals().interval());
    const bool is_over = waited >= patience;
    if (is_over || waited >= probed + kProbe) {
      probed = waited;
      std::string missing = blocks_.describeMissing(
          lock, {patience, answerTime(goal_.settings()), is_over, goal_.hasOrigin()});
      if (missing.empty()) {
        monitor_.runUnlocked(lock, [&] { missing = twin_force_.complaint(); });
        if (!missing.empty()) missing = "twin_force_estimator is gone" + missing;
      }
      if (ready()) return;
      if (is_over || !missing.empty()) {
        // with the time for the search, which a frozen node makes long
        throw PlantError(
            AlignFailure::kNoData,
            text("no %s within %.3g s of wall time%s%s", what.c_str(),
                 seconds(Steady::now() - begin),
                 !missing.empty() ? ": "
                 : what == kBlock ? " (is the simulator paused or stopped? see its diagnostics)"
                                  : "",
                 missing.c_str()));
      }
    }
    const auto before = Steady::now();
    monitor_.waitForChange(lock, ready);
    // a process that was frozen has not waited
    waited += std::min(seconds(monitor_.lastActivity() - before), 2 * PlantMonitor::kTick);
  }
}

void RosPlant::takeBlock(Lock& lock) {
  blocks_.acknowledge();
  waitFor(lock, kBlock, [this] { return blocks_.ready(); });
  blocks_.take();
}

// The next block that the strategy may get: fresh, from a plant that obeys.
void RosPlant::takeFreshBlock(Lock& lock) {
  const StreamBlock& last = blocks_.last();
  double passed = 0.0;
  while (true) {
    const ros::Time before = last.end;
    takeBlock(lock);
    for (const BlockPart sensor : {kWrenchA, kWrenchB}) {
      const auto fault = saturation_.add(last, sensor);
      if (!fault || goal_.isRecovering()) continue;
      throw PlantError(
          AlignFailure::kSensorSaturated,
          text(
              "sensor_saturated: %s: %s: %s; look at its load, its offset, its noise and its wires",
              sensor == kWrenchA ? "sensor_a" : "sensor_b", fault->c_str(),
              blocks_.publisherOf(lock, sensor).c_str()));
    }
    if (goal_.settings().lockstep) return;
    const double step = before.isZero() ? 0.0 : (last.end - before).toSec();
    if (step < kJump) passed += step;
    const bool is_fresh = blocks_.arrivals().isFresh(last.end);
    if (passed > kMaxStale) {
      throw PlantError(
          AlignFailure::kNoData,
          is_fresh
              ? text("the plant doesn't follow within %g s: its guard has no fresh samples or "
                     "state, see the diagnostics of the node that commands it",
                     kMaxStale)
              : text("no block younger than %g s within %g s: the machine, or a driver, is too "
                     "slow; for a simulation give real_time_factor:=0.2 or lockstep:=true",
                     kFreshAge, kMaxStale));
    }
    const PlantLink::Status link = link_.status();
    if (!is_fresh || !link.is_obeyed) continue;
    if (!link.is_interrupted) return;
    restoreCommands(lock);
  }
}

// After an interruption the plant is at rest with the exciter off.
void RosPlant::restoreCommands(Lock& lock) {
  const StreamBlock& last = blocks_.last();
  ROS_WARN_THROTTLE(1.0, "the plant was interrupted: commands repeated");
  link_.clearInterruption();
  commands_.repeat(last.end);
  const bool has_vibration = vibration_.window().has_value();
  if (!has_vibration && !locus_.isPending()) return;
  const double duration = (has_vibration ? *vibration_.window() : locus_.window()).duration;
  lock.unlock();
  locus_.cancel();
  lock.lock();
  const ros::Time settled = last.end + ros::Duration(kSettle);
  while (last.end < settled) {
    takeBlock(lock);
    if (link_.status().is_interrupted) break;
  }
  // another interruption restarts this measurement again
  const LocusRequest again{goal_.timeOf(last.end), duration};
  if (has_vibration) {
    vibration_.begin(again, commands_.exciter(), goal_.stampOf(0.0));
  } else {
    requestLocus(lock, again);
  }
}

// ---- locus measurements ----

void RosPlant::requestLocus(Lock& lock, const LocusRequest& request) {
  const std::string server = locus_.server();
  waitFor(lock,
          "action server identify_locus" +
              (server.empty() ? " (is the locus estimator running?)" : " of " + server),
          [this] { return locus_.isConnected(); });
  // not before the latest block
  const LocusRequest window{std::max(request.start, goal_.timeOf(blocks_.last().end)),
                            request.duration};
  IdentifyLocusGoal goal;
  goal.start = goal_.stampOf(window.start);
  goal.duration = ros::Duration(window.duration);
  goal.exciter = commands_.exciter();
  lock.unlock();
  locus_.send(goal, window);
  lock.lock();
  // the estimator must know the window before its first sample
  waitFor(lock, "acceptance of identify_locus of " + locus_.server(),
          [this] { return locus_.isAccepted(); });
}

// The window has ended: the result belongs to this block.
void RosPlant::takeLocus(Lock& lock, PlantBlock& block) {
  waitFor(lock, "result of identify_locus of " + locus_.server(),
          [this] { return locus_.isDone(); });
  const LocusRequests::Outcome outcome = locus_.take();
  block.locus = outcome.reading;
  if (outcome.reading) return;
  const std::string error = "identify_locus of " + locus_.server() + ": " + outcome.error;
  if (outcome.is_final) throw PlantError(AlignFailure::kNoReading, error);
  ROS_WARN("%s: once more", error.c_str());
  requestLocus(lock, {block.time, locus_.window().duration});
  block.reading_start = locus_.window().start;
}

}  // namespace assembly_cell::ros_bridge
