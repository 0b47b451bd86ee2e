// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulated_rig_node.h"

#include <assembly_cell/StrainSamples.h>

#include <Eigen/LU>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kTick = 2e-3;         // of the wall clock [s]
constexpr int kMaxBlocksPerTick = 10;  // a machine that was asleep catches up little by little

Matrix6 complianceOf(const std::string& file) {
  const Eigen::FullPivLU<Matrix6> stiffness(couplingStiffness(loadMechanism(file).coupling));
  if (!stiffness.isInvertible()) {
    throw InputError(file +
                     ": coupling.stiffness: singular, so nothing holds sensor_b's carrier; "
                     "give every direction a stiffness");
  }
  return stiffness.inverse();
}

void append(StrainSamples& block, const StrainSample& sample) {
  block.volts.insert(block.volts.end(), sample.volts.data(), sample.volts.data() + 6);
  block.saturated.push_back(sample.saturated);
}

}  // namespace

SimulatedRigNode::SimulatedRigNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh) {
  Parameters parameters(pnh_);
  settings_.bits = parameters.integer("bits", 1, 64, 16);
  checkBits(settings_.bits, "parameter " + pnh_.resolveName("bits") + " is ");
  settings_.noise = parameters.number("noise", kNotNegative, settings_.noise);
  settings_.nonlinearity = parameters.number("nonlinearity", {0.0, 1.0}, 0.0);
  settings_.drift = parameters.number("drift", {-100.0, 100.0}, 0.0);
  settings_.reference_errors = parameters.flag("reference_errors", true);
  settings_.gravity = parameters.number("gravity", kPositive, settings_.gravity);
  settings_.sample_period = 1.0 / parameters.number("rate", {1.0, 1e6}, 5000.0);
  settings_.test_time = parameters.number("test_time", kNotNegative, settings_.test_time);
  const std::string coupling = parameters.text("coupling", "");
  settings_.seed = static_cast<std::uint64_t>(parameters.integer("seed", 0, 2147483647, 1));
  block_size_ = parameters.integer("block_size", 1, 100000, 100);
  speed_ = parameters.number("real_time_factor", {1e-3, 1e3}, 1.0);
  parameters.refuseUnknown();
  if (!coupling.empty()) settings_.coupling_compliance = complianceOf(coupling);
  if (ros::Time::isSimTime()) {
    throw InputError("parameter /use_sim_time is true: the rig keeps to the wall clock; unset it");
  }

  rig_ = std::make_unique<CalibrationRig>(settings_);
  start_ = ros::Time::now();
  wall_start_ = Clock::now();
  for (const Side side : kSides) {
    bridge_pub_[side] = nh_.advertise<StrainSamples>(sensorName(side) + "/bridge", kQueue);
  }
  apply_srv_ = pnh_.advertiseService("apply", &SimulatedRigNode::apply, this);
  timer_ = nh_.createWallTimer(ros::WallDuration(kTick),
                               [this](const ros::WallTimerEvent&) { publishDueBlocks(); });
}

ros::Time SimulatedRigNode::stampOf(std::uint64_t sample) const {
  return start_ + ros::Duration(static_cast<double>(sample) * settings_.sample_period);
}

void SimulatedRigNode::publishDueBlocks() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::chrono::duration<double> elapsed = Clock::now() - wall_start_;
  const auto due = static_cast<std::uint64_t>(elapsed.count() * speed_ / settings_.sample_period);
  for (int i = 0; i < kMaxBlocksPerTick; ++i) {
    if (samples_ + static_cast<std::uint64_t>(block_size_) > due) return;
    publishBlock();
  }
}

void SimulatedRigNode::publishBlock() {
  PerSide<StrainSamples::Ptr> blocks;
  for (const Side side : kSides) {
    blocks[side] = boost::make_shared<StrainSamples>();
    blocks[side]->header.stamp = stampOf(samples_);
    blocks[side]->header.frame_id = sensorName(side);
    blocks[side]->period = settings_.sample_period;
    blocks[side]->sequence = sequence_;
    blocks[side]->temperature = rig_->temperature();
  }
  for (int k = 0; k < block_size_; ++k) {
    const PerSide<StrainSample> sample = rig_->sample();
    for (const Side side : kSides) append(*blocks[side], sample[side]);
  }
  samples_ += static_cast<std::uint64_t>(block_size_);
  ++sequence_;
  for (const Side side : kSides) bridge_pub_[side].publish(blocks[side]);
}

bool SimulatedRigNode::apply(ApplyLoad::Request& request, ApplyLoad::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const Observation noted = rig_->apply(fromMessage(request.step, "apply refused"));
    response.test = toMessage(noted);
    response.since = stampOf(samples_);
    response.success = true;
    response.message = request.step.text;
  } catch (const InputError& error) {
    response.success = false;
    response.message = error.what();
  }
  return true;
}

}  // namespace assembly_cell::ros_bridge
