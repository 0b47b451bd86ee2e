// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/sensor_output.h"

#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/process/master_call.h"

namespace assembly_cell::ros_bridge {

SensorOutput::SensorOutput(const ros::NodeHandle& nh, std::uint32_t queue,
                           const DriverSettings& settings, const LiveSettings& live,
                           SensorState& state)
    : nh_(nh),
      queue_(queue),
      settings_(settings),
      live_(live),
      state_(state),
      display_(nh_, queue, settings) {
  // in lockstep a subscriber that connects late must not miss the first block
  wrench_samples_pub_ = {nh_, "wrench_samples", queue, settings.lockstep};
  if (settings.publish_displacement) {
    displacement_samples_pub_ = {nh_, "displacement_samples", queue, settings.lockstep};
  }
  bias_pub_ = nh_.advertise<geometry_msgs::WrenchStamped>("bias", 1, true);
  calibration_pub_ = nh_.advertise<SensorCalibration>("calibration", 1, true);
  publishBias();
  publishCalibration();
}

void SensorOutput::advertiseStrain() {
  strain_pub_ = nh_.advertise<StrainSamples>("strain", queue_);
}

bool SensorOutput::hasSubscribers() const {
  return wrench_samples_pub_.getNumSubscribers() > 0 || display_.hasSubscribers();
}

bool SensorOutput::allConnected() const {
  auto state = registrations();
  if (!state) return false;
  const auto has_all = [&](const auto& publisher) {
    return publisher.getNumSubscribers() >= state->subscribers[publisher.getTopic()].size();
  };
  return has_all(wrench_samples_pub_) && (!strain_pub_ || has_all(strain_pub_));
}

void SensorOutput::publishBias() {
  geometry_msgs::WrenchStamped message;
  message.header.stamp = state_.bias_time.value_or(ros::Time());
  message.header.frame_id = settings_.frame_id;
  message.wrench = toWrench(state_.pipeline.bias());
  bias_pub_.publish(message);
}

void SensorOutput::publishCalibration() {
  SensorCalibration message = toMessage(state_.pipeline.calibration());
  message.header.stamp = state_.calibration_time;
  message.header.frame_id = settings_.frame_id;
  calibration_pub_.publish(message);
}

void SensorOutput::process(const StrainSamples::ConstPtr& block) {
  {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    state_.last_block = SensorState::Clock::now();
    processLocked(block);
  }
  state_.changed.notify_all();
}

void SensorOutput::processLocked(const StrainSamples::ConstPtr& block) {
  if (settings_.lockstep && last_wrench_ && last_wrench_->sequence == block->sequence &&
      last_wrench_->header.stamp == block->header.stamp) {
    // a second repetition: a node after this one hasn't answered
    if (++repetitions_ > 1) wrench_samples_pub_.publish(last_wrench_);
    if (repetitions_ > 1 && last_displacement_) {
      displacement_samples_pub_.publish(last_displacement_);
    }
    return;
  }
  repetitions_ = 0;
  BridgeBlock strain;
  strain.samples = {block->volts.data(), block->saturated.data(), block->saturated.size()};
  strain.start = block->header.stamp.toSec();
  strain.period = block->period;
  strain.sequence = block->sequence;
  strain.temperature = block->temperature;
  auto wrench = boost::make_shared<WrenchSamples>();
  const SensorPipeline::Result result =
      state_.pipeline.process(strain, wrench->wrench, wrench->saturated);
  if (result == SensorPipeline::Result::kDuplicate) return;
  if (block->header.frame_id != settings_.frame_id) state_.foreign_frame = block->header.frame_id;
  if (result == SensorPipeline::Result::kNotFinite) return;

  if (strain_pub_) strain_pub_.publish(block);
  // no wrench: who commands a machine holds it, as with a sensor that is silent
  if (state_.pipeline.frozen().isFrozen() && !state_.recorded) return;
  wrench->header.stamp = block->header.stamp;
  wrench->header.frame_id = settings_.frame_id;
  wrench->period = block->period;
  wrench->sequence = block->sequence;
  wrench_samples_pub_.publish(wrench);
  last_wrench_ = wrench;
  if (settings_.publish_displacement &&
      (settings_.lockstep || displacement_samples_pub_.getNumSubscribers() > 0)) {
    publishDisplacement(strain.samples, *wrench);
  }
  const ros::Time end = block->header.stamp + ros::Duration(strain.end() - strain.start);
  const double interval = 1.0 / live_.number("display_rate");
  if (const auto average = state_.pipeline.takeAverage(end.toSec(), interval, block->period)) {
    display_.publish(*average, end, state_.pipeline);
  }
}

void SensorOutput::publishDisplacement(const SensorSamples& strain, const WrenchSamples& wrench) {
  auto message = boost::make_shared<DisplacementSamples>();
  message->header = wrench.header;
  message->period = wrench.period;
  message->sequence = wrench.sequence;
  state_.pipeline.displacements(strain, message->displacement);
  displacement_samples_pub_.publish(message);
  last_displacement_ = message;
}

}  // namespace assembly_cell::ros_bridge
