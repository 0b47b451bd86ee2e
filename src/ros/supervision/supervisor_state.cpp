// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <diagnostic_msgs/DiagnosticArray.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/supervision/mechanism_news.h"
#include "assembly_cell/ros/supervision/supervisor_node.h"
#include "assembly_cell/ros/supervision/watched_plant.h"

// Is the peg free? How goals begin and end, the action that frees it, and what is told of it.
namespace assembly_cell::ros_bridge {

namespace {

// A carrier that holds a peg in its bore: what the coupling gives way to it. [m], [rad]
constexpr double kBeside = 1e-3, kTurned = 0.02;
constexpr double kReleaseTimeout = 5.0;    // of cell time after a goal that failed [s]
constexpr double kDiagnosticPeriod = 0.5;  // wall clock [s]
constexpr char kIdentify[] = "identify: ", kIdentifier[] = "mechanism_identifier";

}  // namespace

void SupervisorNode::startState(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  state_pub_ = pnh.advertise<SupervisorState>("state", 10, true);
  diagnostics_pub_ = nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  diagnostics_timer_ =
      nh.createWallTimer(ros::WallDuration(kDiagnosticPeriod),
                         [this](const ros::WallTimerEvent&) { publishDiagnostics(); });
  identifier_sub_ = subscribeChecked<SupervisorState>(
      nh, std::string(kIdentifier) + "/state", 10,
      [this](const SupervisorState::ConstPtr& message) { hearIdentifier(*message); });
  plant_sub_ = subscribeChecked<PlantState>(
      nh, "plant_state", 10, [this](const PlantState::ConstPtr& message) { hearPlant(*message); });
  mechanism_sub_ = subscribeMechanism(nh, [this](const KnownMechanism& known) {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    news_ = known;
  });
  publishState();
}

// What the identifier's goal has left, while no goal of our own knows better. Once it has run it
// knows better than ours before it: it hears of what they left.
void SupervisorNode::hearIdentifier(const SupervisorState& identifier) {
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    const bool ran = identifier_runs_ && identifier.goal.empty();
    identifier_runs_ = !identifier.goal.empty();
    if (identifier_runs_ || !state_.goal.empty()) return;
    const bool ours = state_.in_contact && state_.reason.rfind(kIdentify, 0) != 0;
    if ((ours && !ran) || state_.in_contact == identifier.in_contact) return;
    state_.in_contact = identifier.in_contact;
    state_.stuck = state_.stuck && identifier.in_contact;
    state_.reason = identifier.in_contact ? kIdentify + identifier.reason.substr(0, 500) : "";
    identified_ = identifier.header.stamp;
  }
  publishState();
}

// An identifier that ends amid its goal says nothing of the peg: the plant does that it has
// stopped.
void SupervisorNode::hearPlant(const PlantState& plant) {
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    const bool ended = plant.held && plant.reason.find(kIdentifier) != std::string::npos;
    if (!ended || !identifier_runs_ || !state_.goal.empty()) return;
    state_.in_contact = true;
    state_.reason = kIdentify + plant.reason.substr(0, 500);
    identified_ = plant.header.stamp;
  }
  publishState();
}

void SupervisorNode::enter(const std::string& goal, bool needs_free_peg) {
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    if (needs_free_peg && state_.stuck) {
      throw InputError("in_contact: the peg got stuck (" + state_.reason +
                       "): call the action retreat first");
    }
    state_.goal = goal;
    began_free_ = !state_.in_contact;
    identified_ = ros::Time();
  }
  publishState();
}

// A goal that failed. A cancel before anything has moved leaves what was known of the peg.
bool SupervisorNode::hasBegun(AlignFailure failure) const {
  return plant_->hasMoved() || failure != AlignFailure::kCancelled;
}

SupervisorNode::End SupervisorNode::endOfException() const {
  End end;
  end.failed = true;
  // bad input is mostly found before anything moves
  end.begun = plant_->hasMoved();
  try {
    throw;
  } catch (const InputError& error) {
    end.reason = error.what();
  } catch (const PlantError& error) {
    end.begun = hasBegun(error.failure);
    end.failure = error.failure;
    end.contacts = error.contacts;
    end.reason = error.what();
  } catch (const AlignError& error) {
    end.begun = true;
    end.failure = error.failure;
    end.stuck = error.failure == AlignFailure::kInContact || error.failure == AlignFailure::kStuck;
    end.reason = error.what();
  } catch (const std::exception& error) {
    end.begun = true;
    end.reason = error.what();
  }
  return end;
}

void SupervisorNode::leave(const End& end) {
  if (!end.begun) {
    plant_->end(false);
    if (end.failed) {
      // nothing has moved: what was known of the peg still is
      const std::lock_guard<std::mutex> lock(state_mutex_);
      state_.goal.clear();
    } else {
      tell(end.pressing, false, end.reason);
    }
    publishState();
    return;
  }
  bool in_contact = end.failed, stuck = end.stuck;
  std::string reason = end.reason;
  if (!end.freed && !plant_->hasData()) {
    reason = "not known, nothing to feel with: " + reason;
  } else if (!end.freed) {
    try {
      plant_->recover(kReleaseTimeout);
      GuardedCarrier carrier(*plant_, limits_);
      const bool hung_free = began_free_ && !end.stuck;
      releasePeg(carrier, mechanism_,
                 hung_free ? std::optional(plant_->startPose()) : std::nullopt);
      in_contact = stuck = false;
    } catch (const AlignError& error) {
      // what a sensor that tells nothing leaves unknown isn't stuck: the next goal feels first
      stuck = error.failure != AlignFailure::kSensorSaturated;
      reason = error.what();
    } catch (const std::exception& error) {
      reason = error.what();
    }
  }
  plant_->end(in_contact);
  tell(in_contact, stuck, reason);
  publishState();
}

double SupervisorNode::inserted() const {
  if (!(left_in_.depth > 0.0)) return 0.0;
  const Pose moved = inverse(left_in_.carrier) * plant_->carrierPose();
  const double turned = vectorFromRotation(moved.R).value.norm();
  const bool in_bore = moved.p.head<2>().norm() < kBeside && turned < kTurned;
  return in_bore ? std::max(0.0, left_in_.depth - moved.p.z()) : 0.0;
}

void SupervisorNode::executeRetreat(const RetreatGoalConstPtr&) {
  RetreatResult result;
  const std::unique_lock<std::mutex> turn(busy_, std::try_to_lock);
  if (!turn) {
    result.message = "busy: another action is running";
  } else {
    End end;
    try {
      takeLive();
      enter("retreat", false);
      plant_->begin([this] { return retreat_server_->isPreemptRequested(); });
      std::optional<Vector6> first;
      WatchedPlant plant(*plant_, [&](const PlantBlock& block) {
        if (!first) first = block.wrench_b;
        RetreatFeedback feedback;
        feedback.force = (block.wrench_b - *first).head<3>().norm();
        retreat_server_->publishFeedback(feedback);
        result.z = block.carrier.z;
      });
      if (AlignParameters out = parameters_; (out.inserted = inserted()) > 0.0) {
        withdraw(plant, mechanism_, out);
        left_in_ = LeftIn();
      }
      GuardedCarrier carrier(plant, limits_);
      releasePeg(carrier, mechanism_);
      result.success = true;
      result.message = end.reason = "free";
    } catch (...) {
      end = endOfException();
      end.freed = true;
      result.message = end.reason;
    }
    leave(end);
  }
  retreat_server_->finish(result.success, result, result.message);
}

void SupervisorNode::stop() {
  plant_->stop();
  // a goal under way ends, frees the peg and answers
  const std::lock_guard<std::mutex> turn(busy_);
}

// ---- what is told ----

void SupervisorNode::tell(bool in_contact, bool stuck, const std::string& reason) {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  state_.goal.clear();
  state_.in_contact = in_contact;
  state_.stuck = stuck;
  state_.reason = reason;
}

// The reason is that of the goal before: none of the one that runs.
SupervisorState SupervisorNode::told() const {
  SupervisorState told = state_;
  if (!told.goal.empty()) told.reason.clear();
  return told;
}

void SupervisorNode::publishState() {
  const std::lock_guard<std::mutex> lock(state_mutex_);
  state_.header.stamp = std::max(plant_->stamp(), identified_);
  state_pub_.publish(told());
}

void SupervisorNode::publishDiagnostics() {
  SupervisorState state;
  {
    const std::lock_guard<std::mutex> lock(state_mutex_);
    state = told();
  }
  using Status = diagnostic_msgs::DiagnosticStatus;
  Status status;
  status.name = name_.substr(1) + ": peg";
  status.hardware_id = "cell";
  status.level = state.stuck ? Status::ERROR : state.in_contact ? Status::WARN : Status::OK;
  status.message = state.stuck        ? "stuck: call the action retreat"
                   : state.in_contact ? "in contact"
                                      : "free";
  publishStatus(diagnostics_pub_, status, {{"Goal", state.goal}, {"Reason", state.reason}});
}

}  // namespace assembly_cell::ros_bridge
