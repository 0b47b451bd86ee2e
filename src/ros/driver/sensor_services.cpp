// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/sensor_services.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <thread>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/guard/message_check.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/process/ros_clock.h"
#include "assembly_cell/sensor/wrench_range.h"

namespace assembly_cell::ros_bridge {

namespace {

using Clock = SensorState::Clock;

constexpr std::size_t kUndoSteps = 32;  // biases remembered

Clock::time_point later(Clock::time_point from, double seconds) {
  return from + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

// false for NaN
bool isWrench(const Vector6& w) { return cutWrench(w) == w; }

// Throws InputError for the first of six numbers that is no force or torque.
void checkWrench(const char* field, const Vector6& w) {
  const std::string fault =
      MessageCheck().sixes(field, w.data(), 6, kForceField, kTorqueField).text();
  if (!fault.empty()) throw InputError(fault);
}

/// Answers a service with the text that `what` returns, or with the refusal that it throws.
template <class Response, class What>
bool answer(const char* service, Response& response, const What& what) {
  try {
    response.message = what();
    response.success = true;
  } catch (const InputError& error) {
    response.message = std::string(service) + " refused: " + error.what();
  }
  return true;
}

}  // namespace

SensorServices::SensorServices(const ros::NodeHandle& pnh, const DriverSettings& settings,
                               SensorState& state, SensorOutput& output, StrainSource* device,
                               double device_bias_timeout)
    : settings_(settings),
      state_(state),
      output_(output),
      device_(device),
      device_bias_timeout_(device_bias_timeout) {
  ros::NodeHandle nh(pnh);
  nh.setCallbackQueue(&queue_);
  const auto serve = [&](const char* name, auto callback) {
    servers_.push_back(nh.advertiseService(name, callback, this));
  };
  serve("zero", &SensorServices::zero);
  serve("zero_to", &SensorServices::zeroTo);
  serve("undo_bias", &SensorServices::undoBias);
  serve("set_bias", &SensorServices::setBias);
  serve("clear_bias", &SensorServices::clearBias);
  serve("get_calibration", &SensorServices::getCalibration);
  serve("set_calibration", &SensorServices::setCalibration);
  if (device != nullptr) serve("device_bias", &SensorServices::deviceBias);
  spinner_.start();
}

void SensorServices::changeBias(const Vector6& bias, std::optional<ros::Time> time) {
  if (earlier_biases_.size() == kUndoSteps) earlier_biases_.pop_front();
  earlier_biases_.push_back({state_.pipeline.bias(), state_.bias_time});
  state_.pipeline.setBias(bias);
  state_.bias_time = time;
  output_.publishBias();
}

bool SensorServices::zero(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer("zero", response, [this] { return takeZero(Vector6::Zero()); });
}

bool SensorServices::zeroTo(ZeroTo::Request& request, ZeroTo::Response& response) {
  return answer("zero_to", response, [&] {
    const Vector6 load = Vector6::Map(request.wrench.data());
    checkWrench("wrench", load);
    return takeZero(load);
  });
}

std::string SensorServices::takeZero(const Vector6& load) {
  std::unique_lock<std::mutex> lock(state_.mutex);
  ZeroMeasurement& zero = state_.pipeline.zero();
  if (zero.active) throw InputError("another one is under way: wait for it");
  zero = ZeroMeasurement();
  zero.active = true;

  // wait for samples that were all taken after the call; a silent source ends it early
  const auto samples = static_cast<std::size_t>(settings_.zero_samples);
  const Clock::time_point called = Clock::now();
  // equal samples may be a frozen device: go on until one differs, or they count as frozen
  const FrozenReadings& frozen = state_.pipeline.frozen();
  while (zero.failure.empty() &&
         (zero.moments.count() < samples || frozen.covers(zero.moments.count()))) {
    const Clock::time_point silent =
        later(std::max(called, state_.last_block.value_or(called)), settings_.source_timeout);
    const Clock::time_point limit = std::min(later(called, settings_.zero_timeout), silent);
    if (state_.stopping) {
      zero.failure = "the driver shuts down";
    } else if (Clock::now() < limit) {
      state_.changed.wait_until(lock, limit);
    } else if (limit == silent) {
      zero.failure = "no samples for " + text("%g s", settings_.source_timeout) +
                     ": start the source, or let the simulator run";
    } else if (zero.moments.count() >= samples) {
      zero.failure = frozen.describe() + kFrozenRemedy;
    } else {
      zero.failure = "only " + std::to_string(zero.moments.count()) + " of " +
                     std::to_string(samples) + " samples came in " +
                     text("%g s", settings_.zero_timeout) + ": raise zero_timeout";
    }
  }
  zero.active = false;
  if (!zero.failure.empty()) throw InputError(zero.failure);

  const Vector6 bias = zero.moments.mean() - load;
  if (!isWrench(bias)) {
    throw InputError("the bias would be " + wrenchText(bias, "%.5g") +
                     ", beyond 1e5 N, 1e4 N m: look at the active calibration");
  }
  changeBias(bias, ros::Time::now());
  return "bias = mean of " + std::to_string(zero.moments.count()) + " samples" +
         (load.isZero(0.0) ? "" : " - load (" + wrenchText(load, "%.5g") + ")") + ": " +
         wrenchText(bias, "%.5g") +
         "; sigma of a sample: " + wrenchText(zero.moments.sd(), "%.3g") + "; it was " +
         wrenchText(earlier_biases_.back().bias, "%.5g");
}

bool SensorServices::setBias(SetBias::Request& request, SetBias::Response& response) {
  return answer("set_bias", response, [&] {
    const Vector6 bias = Vector6::Map(request.bias.data());
    checkWrench("bias", bias);
    const std::lock_guard<std::mutex> lock(state_.mutex);
    changeBias(bias, ros::Time::now());
    return "bias = " + wrenchText(bias, "%.5g");
  });
}

bool SensorServices::clearBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer("clear_bias", response, [this] {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    const std::string before = wrenchText(state_.pipeline.bias(), "%.5g");
    changeBias(Vector6::Zero(), std::nullopt);
    return "cleared; it was " + before;
  });
}

bool SensorServices::undoBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  return answer("undo_bias", response, [this] {
    const std::lock_guard<std::mutex> lock(state_.mutex);
    if (earlier_biases_.empty()) {
      throw InputError("nothing to undo since the calibration was set");
    }
    const std::string before = wrenchText(state_.pipeline.bias(), "%.5g");
    state_.pipeline.setBias(earlier_biases_.back().bias);
    state_.bias_time = earlier_biases_.back().time;
    earlier_biases_.pop_back();
    output_.publishBias();
    return "bias was " + before + "; it is " + wrenchText(state_.pipeline.bias(), "%.5g") + ", " +
           (state_.bias_time ? "taken " + text("%.0f s ago", age(*state_.bias_time)) : "never set");
  });
}

bool SensorServices::deviceBias(std_srvs::Trigger::Request&,
                                std_srvs::Trigger::Response& response) {
  response.success = false;
  try {
    device_->requestDeviceBias();
  } catch (const SourceError& error) {
    response.message = std::string("device_bias refused: ") + error.what();
    return true;
  }
  // no protocol acknowledges it: the samples show it
  const Clock::time_point limit = later(Clock::now(), device_bias_timeout_);
  DeviceBias bias = device_->deviceBias();
  while (bias.state == DeviceBias::State::kPending && Clock::now() < limit && !state_.stopping) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    bias = device_->deviceBias();
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
                         text("%g s", device_bias_timeout_) +
                         ": no samples came: look at the device";
  }
  return true;
}

bool SensorServices::getCalibration(GetCalibration::Request&, GetCalibration::Response& response) {
  const std::lock_guard<std::mutex> lock(state_.mutex);
  const Calibration& calibration = state_.pipeline.calibration();
  response.calibration = toMessage(calibration);
  response.calibration.header.stamp = state_.calibration_time;
  response.calibration.header.frame_id = settings_.frame_id;
  response.success = true;
  response.message = calibration.id + " of " + calibration.date + ", active for " +
                     text("%.0f s", age(state_.calibration_time));
  return true;
}

bool SensorServices::setCalibration(SetCalibration::Request& request,
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
    const std::lock_guard<std::mutex> lock(state_.mutex);
    state_.rules.check(calibration, "set_calibration refused");
    const std::string& serial = state_.pipeline.calibration().serial_number;
    if (calibration.serial_number != serial) {
      throw InputError("set_calibration refused: serial_number is '" + calibration.serial_number +
                       "' but this sensor is '" + serial +
                       "': send the calibration to its own sensor");
    }
    // the bias was measured by the old calibration, and so was a zero under way
    state_.pipeline.setCalibration(calibration);
    state_.calibration_time = ros::Time::now();
    state_.bias_time.reset();
    earlier_biases_.clear();
    output_.publishCalibration();
    output_.publishBias();
  } catch (const InputError& error) {
    response.message = error.what();
    return true;
  }
  state_.changed.notify_all();
  response.success = true;
  response.message = "calibration '" + calibration.id + "' active, bias cleared: call zero";
  return true;
}

}  // namespace assembly_cell::ros_bridge
