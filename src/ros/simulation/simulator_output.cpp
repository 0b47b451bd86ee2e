// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_output.h"

#include <rosgraph_msgs/Clock.h>

#include <random>
#include <utility>

#include "assembly_cell/AccelerometerSamples.h"
#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

namespace {

std::uint32_t newBootId(std::uint32_t before) {
  std::random_device random;
  std::uint32_t id = before;
  while (id == 0 || id == before) id = random();
  return id;
}

}  // namespace

void warn(const std::string& line) {
  if (!line.empty()) ROS_WARN("%s", line.c_str());
}

void warnThrottled(const std::string& line) {
  if (!line.empty()) ROS_WARN_THROTTLE(1.0, "%s", line.c_str());
}

SimulatorOutput::SimulatorOutput(ros::NodeHandle& nh, const SimulatorSettings& settings,
                                 const SimulatorSetup& setup, SimulatorState& state,
                                 GuardedCell& cell)
    : settings_(settings), state_(state), cell_(cell), boot_id_(newBootId(0)) {
  // In lockstep a participant that connects late doesn't miss the first block. It may get the
  // latest one before those that are still queued, which paced samples must not: there the next
  // block comes by itself.
  if (settings.cell.sensors == Sensors::kBoth) {
    bridge_a_pub_ = {nh, "sensor_a/bridge", kQueue, settings.lockstep};
  }
  bridge_b_pub_ = {nh, "sensor_b/bridge", kQueue, settings.lockstep};
  accelerometers_pub_ = nh.advertise<AccelerometerSamples>("accelerometers", kQueue);
  carrier_pub_ = {nh, "carrier_pose", kQueue};
  plant_state_pub_ = nh.advertise<PlantState>("plant_state", 10, true);
  if (settings.lockstep) clock_pub_ = nh.advertise<rosgraph_msgs::Clock>("/clock", 10, true);
  if (settings.publish_truth) truth_.emplace(nh, setup);
  publishStaticFrames(setup);
}

void SimulatorOutput::publishClock(const ros::Time& stamp) {
  clock_stamp_ = stamp;
  rosgraph_msgs::Clock clock;
  clock.clock = stamp;
  publishShared(clock_pub_, clock);
}

void SimulatorOutput::publishBlock(const StrainBlock& block, std::uint32_t sequence) {
  const ros::Time stamp = stampAt(block.time);
  const auto bridge = [&](auto& pub, const char* sensor, const auto& volts, const auto& saturated) {
    StrainSamples message;
    message.header.stamp = stamp;
    message.header.frame_id = sensor;
    message.period = block.period;
    message.sequence = sequence;
    message.temperature = block.temperature;
    message.volts = volts;
    message.saturated = saturated;
    pub.publish(std::move(message));
  };
  if (settings_.cell.sensors == Sensors::kBoth) {
    bridge(bridge_a_pub_, "sensor_a", block.volts_a, block.saturated_a);
  }
  bridge(bridge_b_pub_, "sensor_b", block.volts_b, block.saturated_b);
  if (!block.accelerations.empty()) {
    AccelerometerSamples samples;
    samples.header.stamp = stamp;
    samples.header.frame_id = kPegFrame;
    samples.period = block.period;
    samples.sequence = sequence;
    samples.acceleration = block.accelerations;
    publishShared(accelerometers_pub_, std::move(samples));
  }
  carrier_pub_.publish(
      poseStamped(kCarrierBaseFrame, cell_.cell().reported(), stampAt(cell_.world().time())));
}

// The nominal pose of the carrier's base: upright over the hole's middle. The true one is part of
// the ground truth.
void SimulatorOutput::publishStaticFrames(const SimulatorSetup& setup) {
  const Pose X_HB{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, setup.nominal_height)};
  const CellDescription& description = setup.description;
  std::vector<geometry_msgs::TransformStamped> frames = {transformStamped(
      kWorldFrame, kCarrierBaseFrame, description.X_WA * description.X_AH * X_HB, state_.epoch)};
  if (truth_) {
    frames.push_back(transformStamped(kCarrierBaseFrame, kHoleTruthFrame,
                                      inverse(cell_.cell().carrier().base()), state_.epoch));
  }
  static_tf_.send(frames);
}

void SimulatorOutput::publishState() {
  const ros::Time stamp = stampAt(cell_.world().time());
  frames_.assign(
      1, transformStamped(kCarrierBaseFrame, kCarrierFrame, cell_.cell().reported(), stamp));
  if (truth_) {
    truth_->publish(cell_.world(), stamp);
    frames_.push_back(
        transformStamped(kHoleTruthFrame, kPegTruthFrame, cell_.world().pegPose(), stamp));
  }
  tf_.sendTransform(frames_);
  if (settings_.lockstep && stamp != clock_stamp_) publishClock(stamp);
}

void SimulatorOutput::onPlantRestart() {
  boot_id_ = newBootId(boot_id_);
  publishState();
  publishPlantState();
}

void SimulatorOutput::publishPlantState() {
  PlantState state;
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    const PlantGuard& guard = state_.gate.guard();
    const CommandGate::Refusals& refusals = state_.gate.refusals();
    state.session = guard.session;
    state.holder = guard.owner;
    state.held = guard.expired || guard.overloaded;
    state.overload = guard.overloaded;
    state.exciter = guard.shaking;
    state.reason = state_.gate.stopReason();
    state.refused = refusals.commands;
    state.refused_node = refusals.node;
    state.refused_reason = refusals.last.good() ? "" : toString(refusals.last.reason);
    state.refusal = refusals.last.text;
  }
  state.life = boot_id_;
  const PlantState& last = plant_state_;  // life 0: none yet
  const bool same =
      state.life == last.life && state.session == last.session && state.holder == last.holder &&
      state.held == last.held && state.overload == last.overload && state.exciter == last.exciter &&
      state.reason == last.reason && state.refused == last.refused && state.refusal == last.refusal;
  if (same) return;
  state.header.stamp = stampAt(cell_.world().time());
  plant_state_ = state;
  plant_state_pub_.publish(state);
}

}  // namespace assembly_cell::ros_bridge
