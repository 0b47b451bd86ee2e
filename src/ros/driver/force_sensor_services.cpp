// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/force_sensor_node.h"

#include <algorithm>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::size_t kUndoSteps = 32;  // biases remembered

// NaN is not within
bool isWrench(const Vector6& w) { return cutWrench(w) == w; }

// Of six numbers that somebody sent; empty, or the first that is no force or moment.
std::string faultOf(const char* field, const Vector6& w) {
  return MessageCheck().sixes(field, w.data(), 6, kForceField, kTorqueField).text();
}

}  // namespace

void ForceSensorNode::publishBias() {
  geometry_msgs::WrenchStamped message;
  message.header.stamp = bias_time_.value_or(ros::Time());
  message.header.frame_id = frame_id_;
  message.wrench = toWrench(bias_);
  bias_pub_.publish(message);
}

void ForceSensorNode::publishCalibration() {
  SensorCalibration message = toMessage(calibration_);
  message.header.stamp = calibration_time_;
  message.header.frame_id = frame_id_;
  calibration_pub_.publish(message);
}

void ForceSensorNode::changeBias(const Vector6& bias, std::optional<ros::Time> time) {
  if (earlier_biases_.size() == kUndoSteps) earlier_biases_.pop_front();
  earlier_biases_.push_back({bias_, bias_time_});
  bias_ = bias;
  bias_time_ = time;
  publishBias();
}

bool ForceSensorNode::zero(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  takeZero(Vector6::Zero(), "zero", response.success, response.message);
  return true;
}

bool ForceSensorNode::zeroTo(ZeroTo::Request& request, ZeroTo::Response& response) {
  const Vector6 load = Vector6::Map(request.wrench.data());
  const std::string fault = faultOf("wrench", load);
  if (fault.empty()) {
    takeZero(load, "zero_to", response.success, response.message);
  } else {
    response.success = false;
    response.message = "zero_to refused: " + fault;
  }
  return true;
}

void ForceSensorNode::takeZero(const Vector6& load, const std::string& service, uint8_t& success,
                               std::string& message) {
  std::unique_lock<std::mutex> lock(mutex_);
  success = false;
  if (zero_.active) {
    message = service + " refused: another one is under way: wait for it";
    return;
  }
  zero_ = Zero();
  zero_.active = true;

  // wait for samples that were all taken after the call; a silent source ends it early
  const Clock::time_point called = Clock::now();
  const auto later = [](Clock::time_point from, std::chrono::duration<double> wait) {
    return from + std::chrono::duration_cast<Clock::duration>(wait);
  };
  while (zero_.failure.empty() && zero_.moments.count() < zero_samples_) {
    const Clock::time_point silent =
        later(std::max(called, last_block_.value_or(called)), source_timeout_);
    const Clock::time_point limit = std::min(later(called, zero_timeout_), silent);
    if (stopping_) {
      zero_.failure = "the driver shuts down";
    } else if (Clock::now() < limit) {
      zero_changed_.wait_until(lock, limit);
    } else if (limit == silent) {
      zero_.failure = "no samples for " + text("%g s", source_timeout_.count()) +
                      ": start the source, or let the simulator run";
    } else {
      zero_.failure = "only " + std::to_string(zero_.moments.count()) + " of " +
                      std::to_string(zero_samples_) + " samples came in " +
                      text("%g s", zero_timeout_.count()) + ": raise zero_timeout";
    }
  }
  zero_.active = false;
  if (!zero_.failure.empty()) {
    message = service + " refused: " + zero_.failure;
    return;
  }

  const Vector6 bias = zero_.moments.mean() - load;
  if (!isWrench(bias)) {
    message = service + " refused: the bias would be " + wrenchText(bias, "%.5g") +
              ", beyond 1e5 N, 1e4 N m: look at the calibration in force";
    return;
  }
  changeBias(bias, ros::Time::now());
  success = true;
  message = "bias = mean of " + std::to_string(zero_.moments.count()) + " samples" +
            (load.isZero(0.0) ? "" : " - load (" + wrenchText(load, "%.5g") + ")") + ": " +
            wrenchText(bias_, "%.5g") +
            "; sigma of a sample: " + wrenchText(zero_.moments.sd(), "%.3g") + "; it was " +
            wrenchText(earlier_biases_.back().bias, "%.5g");
}

bool ForceSensorNode::setBias(SetBias::Request& request, SetBias::Response& response) {
  const Vector6 bias = Vector6::Map(request.bias.data());
  const std::string fault = faultOf("bias", bias);
  response.success = fault.empty();
  if (!response.success) {
    response.message = "set_bias refused: " + fault;
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  changeBias(bias, ros::Time::now());
  response.message = "bias = " + wrenchText(bias_, "%.5g");
  return true;
}

bool ForceSensorNode::clearBias(std_srvs::Trigger::Request&,
                                std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.message = "cleared; it was " + wrenchText(bias_, "%.5g");
  changeBias(Vector6::Zero(), std::nullopt);
  response.success = true;
  return true;
}

bool ForceSensorNode::undoBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.success = !earlier_biases_.empty();
  if (!response.success) {
    response.message = "undo_bias refused: nothing to undo since the calibration came in force";
    return true;
  }
  response.message = "bias was " + wrenchText(bias_, "%.5g");
  bias_ = earlier_biases_.back().bias;
  bias_time_ = earlier_biases_.back().time;
  earlier_biases_.pop_back();
  publishBias();
  response.message += "; it is " + wrenchText(bias_, "%.5g") + ", " +
                      (bias_time_ ? "taken " + text("%.0f s ago", age(*bias_time_)) : "never set");
  return true;
}

bool ForceSensorNode::deviceBias(std_srvs::Trigger::Request&,
                                 std_srvs::Trigger::Response& response) {
  response.success = false;
  try {
    choice_.source->requestDeviceBias();
  } catch (const SourceError& error) {
    response.message = std::string("device_bias refused: ") + error.what();
    return true;
  }
  // nothing on the wire acknowledges it: the samples tell
  const Clock::time_point limit =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(device_bias_timeout_);
  DeviceBias bias = choice_.source->deviceBias();
  while (bias.state == DeviceBias::State::kPending && Clock::now() < limit && !stopping_) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    bias = choice_.source->deviceBias();
  }
  const std::string residual =
      "residual of " + std::to_string(bias.samples) +
      " samples: " + wrenchText(Vector6::Map(bias.residual.data()), "%.3g") +
      "; sigma of a sample: " + wrenchText(Vector6::Map(bias.noise.data()), "%.3g");
  switch (bias.state) {
    case DeviceBias::State::kVerified:
      response.success = true;
      response.message = "device bias verified, " + residual + "; the node's bias is as it was";
      break;
    case DeviceBias::State::kFailed:
      response.message =
          "device bias not seen in the samples, " + residual + ": is the load constant? try again";
      break;
    default:
      response.message = "device bias sent but not verified in " +
                         text("%g s", device_bias_timeout_.count()) +
                         ": no samples came: look at the device";
  }
  return true;
}

bool ForceSensorNode::getCalibration(GetCalibration::Request&, GetCalibration::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.calibration = toMessage(calibration_);
  response.calibration.header.stamp = calibration_time_;
  response.calibration.header.frame_id = frame_id_;
  response.success = true;
  response.message = calibration_.id + " of " + calibration_.date + ", in force for " +
                     text("%.0f s", age(calibration_time_));
  return true;
}

bool ForceSensorNode::setCalibration(SetCalibration::Request& request,
                                     SetCalibration::Response& response) {
  Calibration calibration;
  response.success = false;
  try {
    calibration = fromMessage(request.calibration, "set_calibration refused");
    // names the number, which the checks of a file don't
    if (const MessageCheck found = check(request.calibration); !found.good()) {
      throw InputError("set_calibration refused: " + found.text());
    }
    checkCalibration(calibration, "set_calibration refused");
    checkUse(calibration, "set_calibration refused");
  } catch (const InputError& error) {
    response.message = error.what();
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (calibration.serial_number != calibration_.serial_number) {
    response.message = "set_calibration refused: serial_number is '" + calibration.serial_number +
                       "' but this sensor is '" + calibration_.serial_number +
                       "': send the calibration to its own sensor";
    return true;
  }
  // the bias was read through the old calibration, and so was a zero under way
  calibration_ = calibration;
  calibration_time_ = ros::Time::now();
  bias_.setZero();
  bias_time_.reset();
  earlier_biases_.clear();
  noise_ = DifferenceNoise();
  noise_samples_ = 0;
  display_sum_.setZero();
  display_volts_.setZero();
  display_count_ = 0;
  if (zero_.active) zero_.failure = "the calibration changed meanwhile: try again";
  zero_changed_.notify_all();
  publishCalibration();
  publishBias();
  response.success = true;
  response.message = "calibration '" + calibration_.id + "' in force, bias cleared: call zero";
  return true;
}

}  // namespace assembly_cell::ros_bridge
