// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/force_sensor_node.h"

#include <array>
#include <utility>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/participants.h"

namespace assembly_cell::ros_bridge {

ForceSensorNode::ForceSensorNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh) {
  readParameters();
  state_.calibration_time = ros::Time::now();
  // a recording that is played as fast as possible outruns every queue of fixed size
  const std::uint32_t queue = reader_ && isFast(reader_->source().info()) ? 0 : kQueue;
  output_ = std::make_unique<SensorOutput>(nh_, queue, settings_, *live_, state_);
  if (deliversVolts()) output_->advertiseStrain();
  // all participants answer at the cell's root, one above the sensor's group
  if (settings_.lockstep) ack_pub_ = {nh_, ros::names::append(cellNamespace(), "ack"), kQueue};
  StrainSource* device =
      reader_ && !reader_->source().info().recorded ? &reader_->source() : nullptr;
  services_ = std::make_unique<SensorServices>(pnh_, settings_, state_, *output_, device,
                                               source_settings_.device_bias_timeout);
  diagnostics_ =
      std::make_unique<SensorDiagnostics>(nh_, pnh_, settings_, source_, state_, reader_.get());
  if (reader_) {
    reader_->start(*output_, settings_.frame_id);
  } else {
    subscribe();
  }
}

ForceSensorNode::~ForceSensorNode() {
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    state_.stopping = true;
  }
  state_.changed.notify_all();
  if (reader_) reader_->stop();
}

std::string ForceSensorNode::cellNamespace() const {
  return ros::names::parentNamespace(nh_.getNamespace());
}

void ForceSensorNode::readParameters() {
  Parameters parameters(pnh_);
  SourceChoice choice = chooseSource(pnh_);
  parameters.markKnown("source");
  settings_.has_source = choice.source != nullptr;
  settings_.name_in_lockstep = participantName(cellNamespace(), pnh_.getNamespace());
  parameters.read(fieldsOf(settings_));
  settings_.overrides = parameters.texts("overrides", std::vector<std::string>{});
  if (settings_.frame_id.empty() || settings_.frame_id[0] == '/') {
    throw InputError("parameter " + pnh_.resolveName("frame_id") + " is '" + settings_.frame_id +
                     "': give the sensor's frame, without a leading slash");
  }
  source_ = nh_.resolveName("bridge");
  if (choice.source) openSource(std::move(choice), parameters);
  const bool required = settings_.expected_rate > 0.0;
  settings_.expected_rate = parameters.number(
      "expected_rate", required ? positive("Hz") : notNegative("Hz"), settings_.expected_rate);
  parameters.refuseUnknown({"replay"});
  // the simulator waits for an answer to each block in lockstep; it computes its readings
  state_.pipeline.frozen().setLimit(settings_.lockstep ? 0.0 : settings_.frozen_after);
  loadCalibrationFile();
  live_ = std::make_unique<LiveSettings>(
      pnh_, liveValues(fieldsOf(settings_), "from the next block on"), parameters.known());
  if (reader_ && reader_->source().info().recorded) {
    ROS_INFO_NAMED("driver", "%s: %s", source_.c_str(), reader_->source().info().note.c_str());
  }
}

void ForceSensorNode::openSource(SourceChoice choice, Parameters& parameters) {
  const std::string type = choice.type;
  if (settings_.lockstep) {
    throw InputError("parameter " + pnh_.resolveName("lockstep") + " is true with source " + type +
                     ": only the simulator has a lockstep");
  }
  parameters.read(fieldsOf(source_settings_));
  reader_ = std::make_unique<SourceReader>(std::move(choice), source_settings_,
                                           settings_.source_timeout, state_);
  const SourceInfo& info = reader_->source().info();
  source_ = (info.recorded ? "replay of " : type + " ") + info.device;
  if (info.paced && ros::Time::isSimTime()) {
    throw InputError("parameter " + pnh_.resolveName("source") + " is " + type +
                     ", which keeps to the wall clock, with use_sim_time: set use_sim_time false" +
                     (info.recorded ? ", or rate fast" : ""));
  }
  state_.recorded = info.recorded;
  if (info.recorded) state_.rules.quantity = info.quantity;
  settings_.expected_rate = info.recorded ? info.rate : 0.0;
}

void ForceSensorNode::loadCalibrationFile() {
  CalibrationRules& rules = state_.rules;
  rules.needs_displacement = settings_.publish_displacement;
  rules.calibrated = !settings_.calibration_file.empty();
  Calibration calibration;
  std::string source = "calibration_file is not set";
  if (rules.calibrated) {
    source = "calibration file '" + settings_.calibration_file + "'";
    constexpr std::array<double, 3> kNone{};
    if (source_settings_.device_position != kNone || source_settings_.device_rotation != kNone) {
      throw InputError("parameter " + pnh_.resolveName("calibration_file") + " is '" +
                       settings_.calibration_file +
                       "' with device_position or device_rotation: these are for a device that "
                       "delivers wrenches, leave them out");
    }
    calibration = loadCalibration(settings_.calibration_file);
  } else {
    calibration.id = "in the device";
    calibration.serial_number = kUnknownSerial;
    const RotationVector turn{Eigen::Vector3d::Map(source_settings_.device_rotation.data())};
    rules.device_to_sensor = wrenchTransform(
        {rotationFromVector(turn), Eigen::Vector3d::Map(source_settings_.device_position.data())});
    calibration.volts_to_wrench = rules.device_to_sensor;
  }
  if (!settings_.scenario.empty()) {
    if (!settings_.publish_displacement) {
      throw InputError("parameter " + pnh_.resolveName("scenario") + " is '" + settings_.scenario +
                       "' with publish_displacement false: it is for the "
                       "displacement, set publish_displacement true or leave it out");
    }
    const Mechanism mechanism = loadMechanism(settings_.scenario, settings_.overrides);
    calibration = withDisplacement(calibration, couplingStiffness(mechanism.coupling));
  }
  rules.check(calibration, source);
  state_.pipeline.setCalibration(calibration);
}

bool ForceSensorNode::deliversVolts() const {
  const CalibrationRules& rules = state_.rules;
  if (rules.quantity) return *rules.quantity != SampleQuantity::kWrench;
  return rules.calibrated && !isIdentity(state_.pipeline.calibration());
}

void ForceSensorNode::subscribe() {
  bridge_sub_ = subscribeStream<StrainSamples>(
      nh_, "bridge", kQueue,
      [this](const StrainSamples::ConstPtr& block) {
        output_->process(block);
        acknowledge(*block);
      },
      [this](const StrainSamples& block, const std::string& why) { refuseBlock(block, why); },
      settings_.lockstep);
}

// A block from the network that is malformed.
void ForceSensorNode::refuseBlock(const StrainSamples& block, const std::string& why) {
  const std::lock_guard<std::mutex> lock(state_.mutex);
  state_.pipeline.statistics().addMalformed(block.sequence, why);
  acknowledge(block);
}

void ForceSensorNode::acknowledge(const StrainSamples& block) {
  if (!settings_.lockstep) return;
  Ack ack;
  ack.node = settings_.name_in_lockstep;
  ack.sequence = block.sequence;
  ack_pub_.publish(ack);
}

}  // namespace assembly_cell::ros_bridge
