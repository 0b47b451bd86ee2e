// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/peg_state.h"

#include <diagnostic_msgs/DiagnosticArray.h>

#include <algorithm>
#include <utility>

#include "assembly_cell/ros/bridge/diagnostics.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

namespace {

// Largest motion of the carrier across the bore and rotation with the peg in it: compliance of the
// coupling. [m], [rad]
constexpr double kMaxLateral = 1e-3, kMaxRotation = 0.02;
constexpr double kDiagnosticPeriod = 0.5;    // wall clock [s]
constexpr char kNotKnown[] = "not known: ";  // before the first goal
constexpr char kIdentify[] = "identify: ", kIdentifier[] = "mechanism_identifier";

// The reason belongs to the goal before.
SupervisorState withoutOldReason(SupervisorState state) {
  if (!state.goal.empty()) state.reason.clear();
  return state;
}

}  // namespace

bool isKnown(const SupervisorState& state) { return state.reason.rfind(kNotKnown, 0) != 0; }

std::string notKnown(const std::string& reason) {
  return reason.rfind(kNotKnown, 0) == 0 ? reason : kNotKnown + reason;
}

PegState::PegState(ros::NodeHandle& pnh, std::function<ros::Time()> stamp, bool is_known)
    : stamp_(std::move(stamp)), pub_(pnh.advertise<SupervisorState>("state", 10, true)) {
  update([is_known](SupervisorState& state) {
    if (!is_known) {
      state.in_contact = true;
      state.reason = notKnown("no goal has run since the node was started");
    }
    return true;
  });
}

SupervisorState PegState::get() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return state_;
}

void PegState::update(const std::function<bool(SupervisorState&)>& edit) {
  const ros::Time stamp = stamp_();
  const std::lock_guard<std::mutex> lock(mutex_);
  SupervisorState next = state_;
  next.header.stamp = stamp;
  const bool publishes = edit(next);
  state_ = next;
  if (publishes) pub_.publish(withoutOldReason(next));
}

PegMonitor::PegMonitor(ros::NodeHandle& nh, const std::string& name, PegState& state)
    : name_(name), state_(state) {
  diagnostics_pub_ = nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10);
  timer_ = nh.createWallTimer(ros::WallDuration(kDiagnosticPeriod),
                              [this](const ros::WallTimerEvent&) { publishDiagnostics(); });
  identifier_sub_ = subscribeChecked<SupervisorState>(
      nh, std::string(kIdentifier) + "/state", 10,
      [this](const SupervisorState::ConstPtr& message) { onIdentifier(*message); });
  plant_sub_ = subscribeChecked<PlantState>(
      nh, "plant_state", 10, [this](const PlantState::ConstPtr& message) { onPlant(*message); });
}

// The identifier's state counts while no goal runs here: once its goal has run, since it receives
// what goals here have left; before, unless a goal here has left the peg in contact.
void PegMonitor::onIdentifier(const SupervisorState& identifier) {
  const bool runs = !identifier.goal.empty();
  const bool has_run = identifier_runs_.exchange(runs) && !runs;
  state_.update([&](SupervisorState& s) {
    if (runs || !s.goal.empty()) return false;
    const bool is_ours = s.in_contact && s.reason.rfind(kIdentify, 0) != 0;
    const bool is_news =
        s.in_contact != identifier.in_contact || (!isKnown(s) && isKnown(identifier));
    const bool counts = has_run || !is_ours || (!isKnown(s) && identifier.in_contact);
    if (!counts || !is_news) return false;
    s.in_contact = identifier.in_contact;
    s.stuck = s.stuck && identifier.in_contact;
    s.reason = identifier.in_contact ? kIdentify + identifier.reason.substr(0, 500) : "";
    s.header.stamp = std::max(s.header.stamp, identifier.header.stamp);
    return true;
  });
}

// An identifier that dies during its goal reports nothing; the plant reports that it has stopped.
void PegMonitor::onPlant(const PlantState& plant) {
  const bool has_stopped = plant.held && plant.reason.find(kIdentifier) != std::string::npos;
  if (!has_stopped || !identifier_runs_) return;
  state_.update([&](SupervisorState& s) {
    if (!s.goal.empty()) return false;
    s.in_contact = true;
    s.reason = kIdentify + plant.reason.substr(0, 500);
    s.header.stamp = std::max(s.header.stamp, plant.header.stamp);
    return true;
  });
}

void PegMonitor::publishDiagnostics() {
  const SupervisorState state = withoutOldReason(state_.get());
  using Status = diagnostic_msgs::DiagnosticStatus;
  Status status;
  status.name = name_.substr(1) + ": peg";
  status.hardware_id = "cell";
  status.level = state.stuck                          ? Status::ERROR
                 : state.in_contact && isKnown(state) ? Status::WARN
                                                      : Status::OK;
  status.message = state.stuck        ? "stuck: call the action retreat"
                   : !isKnown(state)  ? "not known"
                   : state.in_contact ? "in contact"
                                      : "free";
  publishStatus(diagnostics_pub_, status, {{"Goal", state.goal}, {"Reason", state.reason}});
}

double InsertedPeg::depthAt(const Pose& X_BC) const {
  if (!(depth > 0.0)) return 0.0;
  const Pose moved = inverse(carrier) * X_BC;
  const double rotation = vectorFromRotation(moved.R).value.norm();
  const bool in_bore = moved.p.head<2>().norm() < kMaxLateral && rotation < kMaxRotation;
  return in_bore ? std::max(0.0, depth - moved.p.z()) : 0.0;
}

}  // namespace assembly_cell::ros_bridge
