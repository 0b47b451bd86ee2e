// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <random>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/simulation/simulator_node.h"

// What the simulator does for its guard: leases, commands and loads go to guard/plant_guard.h, what
// comes back stops the mechanism.
namespace assembly_cell::ros_bridge {

namespace {

// A plan that begins in mid-motion passes its speed by up to this factor (planRest).
constexpr double kOvershoot = 1.5;
constexpr double kCreep = 1e-5;  // of the way of a stop: what moves so little doesn't [m]

}  // namespace

void SimulatorNode::readGuard(Parameters& parameters) {
  GuardLimits& limits = limits_;
  const double offset = parameters.number("max_offset", kPositive, 0.1);
  const std::vector<double> box = parameters.numbers(
      "workspace", 6, std::vector<double>{-offset, offset, -offset, offset, -offset, offset});
  for (int i = 0; i < 3; ++i) {
    const auto k = static_cast<std::size_t>(2 * i);
    limits.box_min(i) = box[k];
    limits.box_max(i) = box[k + 1];
    if (box[k] <= 0.0 && box[k + 1] >= 0.0) continue;
    throw InputError(
        text("parameter ~workspace is %g to %g m along %c: the start, 0, must lie in it", box[k],
             box[k + 1], "xyz"[i]));
  }
  limits.rotation = parameters.number("max_rotation", Range{0.0, 1.0}, limits.rotation);
  limits.force = parameters.number("max_force", kPositive, limits.force);
  limits.torque = parameters.number("max_torque", kPositive, limits.torque);
  limits.amplitude = parameters.number("max_amplitude", kNotNegative, limits.amplitude);
  limits.frequency = parameters.number("max_frequency", kNotNegative, limits.frequency);
  limits.lease_time = parameters.number("lease_time", Range{0.04, 10.0}, limits.lease_time);
  max_speed_ = parameters.number("max_speed", kPositive, max_speed_);
  max_acceleration_ = parameters.number("max_acceleration", kPositive, max_acceleration_);
  felt_ = detectionThreshold(limits);
  const std::string mode = parameters.choice("lease", {"auto", "required", "none"}, "auto");
  if (mode == "required") lease_mode_ = LeaseMode::kRequired;
  if (mode == "none") lease_mode_ = LeaseMode::kNone;
  beginLife();
}

void SimulatorNode::beginLife() {
  std::random_device random;
  const std::uint32_t before = life_;
  do {
    life_ = random();
  } while (life_ == 0 || life_ == before);
}

// Who keeps a message for us from before: a latched one of theirs is not meant for this life.
void SimulatorNode::findEarlierPublishers() {
  XmlRpc::XmlRpcValue request, response, state;
  request[0] = ros::this_node::getName();
  if (!ros::master::execute("getSystemState", request, response, state, false)) return;
  XmlRpc::XmlRpcValue& topics = state[0];
  for (const std::string topic : {"carrier_command", "exciter", "lease"}) {
    const std::string name = nh_.resolveName(topic);
    for (int i = 0; i < topics.size(); ++i) {
      if (std::string(topics[i][0]) != name) continue;
      for (int k = 0; k < topics[i][1].size(); ++k) {
        earlier_publishers_.insert(topic + std::string(topics[i][1][k]));
      }
    }
  }
}

void SimulatorNode::refuse(const std::string& what, const std::string& node,
                           const GuardVerdict& why) {
  ++refused_;
  refused_node_ = node;
  refusal_ = {why.reason, what + " of " + node + " refused: " + why.text};
  ROS_WARN("%s", refusal_.text.c_str());
}

void SimulatorNode::renew(const Sender& sender, std::uint32_t session) {
  const std::uint32_t before = guard_.session;
  GuardAction action;
  const GuardVerdict verdict = renewLease(guard_, sender, session, now_, action);
  // late ones come in heaps; others once a block
  if (!verdict.good() && verdict.reason != GuardReason::kStale) {
    refused_node_ = sender.node;
    refusal_ = {verdict.reason, "lease of " + sender.node + " refused: " + verdict.text};
    ROS_WARN_THROTTLE(1.0, "%s", refusal_.text.c_str());
  }
  if (guard_.session != before) stopped_because_.clear();
  stop_.hold |= action.hold;
  if (!action.exciter_off) return;
  stop_.exciter_off = true;
  exciter_.reset();
}

// Before a block: the dead man, and what the coupling may bear during it.
void SimulatorNode::watchPlant() {
  SimulatorBackend& world = cell_->world();
  const Vector6 load = world.couplingWrench();
  const double height = cell_->carrier().encoders(world).p.z();
  std::lock_guard<std::mutex> lock(mutex_);
  const std::string holder = guard_.owner;
  const GuardAction action = watch(guard_, load, height, now_);
  allowed_ = guard_.allowed;
  // somebody else's motion isn't ours to stop
  watched_ = !guard_.overloaded && !follows_;
  too_much_.reset();
  if (action.reason == GuardReason::kNone) return;
  if (action.reason == GuardReason::kExpired) {
    carrier_command_.reset();
    stopped_because_ =
        text("expired: no sign of life of %s for %g s", holder.c_str(), limits_.lease_time);
  } else {
    stopped_because_ = text("%s: the exciter ran for %g s and nobody holds the plant",
                            toString(action.reason), limits_.lone_exciter);
  }
  exciter_.reset();
  stop_.hold |= action.hold;
  stop_.exciter_off |= action.exciter_off;
  ROS_WARN("%s: %s", action.hold ? "carrier held, exciter off" : "exciter off",
           stopped_because_.c_str());
}

// Of a move that begins now, to `target` in the carrier's base.
double SimulatorNode::speedOf(const Pose& target) {
  SimulatorBackend& world = cell_->world();
  const Pose X = inverse(cell_->carrier().encoders(world)) * target;
  Vector6 way;
  way << X.p, vectorFromRotation(X.R).value;
  const Vector6 stop = world.stoppingDisplacement();
  const double moving = stop.head<3>().norm() + braking_.arm * stop.tail<3>().norm();
  std::lock_guard<std::mutex> lock(mutex_);
  return std::min(scenario_.mechanism.carrier.max_speed,
                  speedLimit(guard_, world.couplingWrench(), way)) /
         (moving > kCreep ? kOvershoot : 1.0);
}

void SimulatorNode::feel(const Vector6& load) {
  if (!watched_ || too_much_ || !exceeds(load, felt_)) return;
  SimulatorBackend& world = cell_->world();
  const Vector6 way = world.stoppingDisplacement();
  if (!mustStop(braking_, load, way, allowed_)) return;
  too_much_ = load;
  world.stopRest();
  world.setExciter(ExciterParameters{}, world.time());
  std::lock_guard<std::mutex> lock(mutex_);
  carrier_command_.reset();
  exciter_.reset();
  stopped_because_ = overload(guard_, load, way).text;
  ROS_WARN("carrier held, exciter off: %s", stopped_because_.c_str());
}

void SimulatorNode::publishPlantState() {
  PlantState state;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    state.session = guard_.session;
    state.holder = guard_.owner;
    state.held = guard_.expired || guard_.overloaded;
    state.overload = guard_.overloaded;
    state.exciter = guard_.shaking;
    state.reason = stopped_because_;
    state.refused = refused_;
    state.refused_node = refused_node_;
    state.refused_reason = refusal_.good() ? "" : toString(refusal_.reason);
    state.refusal = refusal_.text;
  }
  state.life = life_;
  const PlantState& last = plant_state_;
  const bool same =
      state.life == last.life && state.session == last.session && state.holder == last.holder &&
      state.held == last.held && state.overload == last.overload && state.exciter == last.exciter &&
      state.reason == last.reason && state.refused == last.refused && state.refusal == last.refusal;
  if (same && plant_state_known_) return;
  state.header.stamp = stampAt(cell_->world().time());
  plant_state_known_ = true;
  plant_state_ = state;
  plant_state_pub_.publish(state);
}

}  // namespace assembly_cell::ros_bridge
