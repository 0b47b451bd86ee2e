// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulated_rig_node.h"

#include <assembly_cell/StrainSamples.h>

#include <Eigen/LU>
#include <string>

#include "assembly_cell/base/fields.h"
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

RigNodeSettings::RigNodeSettings() { rig.nonlinearity = 0.0; }

void fields(FieldList& f, RigNodeSettings& s) {
  RigSettings& rig = s.rig;
  f.integer("bits", rig.bits, 1, 64, "Bits of the converter: 10, 16 or 24.");
  f.number("noise", rig.noise, notNegative("V"), "Noise of a sample, rms.");
  f.number(
      "nonlinearity", rig.nonlinearity, {0.0, 1.0},
      "0: linear sensors; 1: finite rotations and curved gauges, which only plan quadratic can "
      "calibrate.");
  f.number("drift", rig.drift, {-100.0, 100.0, "K/h"}, "Drift of the temperature.");
  f.text(
      "coupling", s.coupling,
      "Scenario or mechanism file whose coupling sensor_b is in the cell: gauges at sensor_b read "
      "how it yields. Empty: the hinges of the sensor.");
  f.flag("reference_errors", rig.reference_errors,
         "Known values have random errors of their accuracies.");
  f.number("gravity", rig.gravity, positive("m/s2"), "Gravity at the rig.");
  f.number("rate", s.rate, {1.0, 1e6, "Hz"}, "Rate of the samples.");
  f.integer("block_size", s.block_size, 1, 100000, "Samples in a block.");
  f.number("real_time_factor", s.real_time_factor, {1e-3, 1e3},
           "Seconds of samples per second of the wall clock.");
  f.number("test_time", rig.test_time, notNegative("s"),
           "Duration of a load on the time base of the temperature.");
  f.integer("seed", rig.seed, 0, 2147483647, "Seed of the true parameters, noise and errors.");
}

SimulatedRigNode::SimulatedRigNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh) {
  Parameters parameters(pnh_);
  parameters.read(fieldsOf(settings_));
  checkBits(settings_.rig.bits, "parameter " + pnh_.resolveName("bits") + " is ");
  settings_.rig.sample_period = 1.0 / settings_.rate;
  parameters.refuseUnknown();
  if (!settings_.coupling.empty()) {
    settings_.rig.coupling_compliance = complianceOf(settings_.coupling);
  }
  if (ros::Time::isSimTime()) {
    throw InputError("parameter /use_sim_time is true: the rig keeps to the wall clock; unset it");
  }

  rig_ = std::make_unique<CalibrationRig>(settings_.rig);
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
  return start_ + ros::Duration(static_cast<double>(sample) * settings_.rig.sample_period);
}

void SimulatedRigNode::publishDueBlocks() {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::chrono::duration<double> elapsed = Clock::now() - wall_start_;
  const auto due = static_cast<std::uint64_t>(elapsed.count() * settings_.real_time_factor /
                                              settings_.rig.sample_period);
  for (int i = 0; i < kMaxBlocksPerTick; ++i) {
    if (samples_ + static_cast<std::uint64_t>(settings_.block_size) > due) return;
    publishBlock();
  }
}

void SimulatedRigNode::publishBlock() {
  PerSide<StrainSamples::Ptr> blocks;
  for (const Side side : kSides) {
    blocks[side] = boost::make_shared<StrainSamples>();
    blocks[side]->header.stamp = stampOf(samples_);
    blocks[side]->header.frame_id = sensorName(side);
    blocks[side]->period = settings_.rig.sample_period;
    blocks[side]->sequence = sequence_;
    blocks[side]->temperature = rig_->temperature();
  }
  for (int k = 0; k < settings_.block_size; ++k) {
    const PerSide<StrainSample> sample = rig_->sample();
    for (const Side side : kSides) append(*blocks[side], sample[side]);
  }
  samples_ += static_cast<std::uint64_t>(settings_.block_size);
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
