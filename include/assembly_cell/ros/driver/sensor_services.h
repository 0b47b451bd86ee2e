// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <std_srvs/Trigger.h>

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/GetCalibration.h"
#include "assembly_cell/SetBias.h"
#include "assembly_cell/SetCalibration.h"
#include "assembly_cell/ZeroTo.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/driver/sensor_output.h"
#include "assembly_cell/ros/driver/sensor_state.h"

namespace assembly_cell::ros_bridge {

/// The services of a driver: bias and calibration. They have threads of their own, so that the data
/// path never waits for them.
class SensorServices {
 public:
  /// device: serves ~device_bias, too, with `device_bias_timeout` [s]; null: none. All are referred
  /// to.
  SensorServices(const ros::NodeHandle& pnh, const DriverSettings& settings, SensorState& state,
                 SensorOutput& output, StrainSource* device, double device_bias_timeout);
  /// The state's `stopping` must be set and announced before.
  ~SensorServices() { spinner_.stop(); }

 private:
  /// ~undo_bias goes back to it.
  struct EarlierBias {
    Vector6 bias;
    std::optional<ros::Time> time;
  };

  bool zero(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool zeroTo(ZeroTo::Request& request, ZeroTo::Response& response);
  bool undoBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool setBias(SetBias::Request& request, SetBias::Response& response);
  bool clearBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool getCalibration(GetCalibration::Request&, GetCalibration::Response& response);
  bool setCalibration(SetCalibration::Request& request, SetCalibration::Response& response);
  bool deviceBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);

  /// Blocks: bias = mean of new samples − load. Returns what was done; throws InputError.
  std::string takeZero(const Vector6& load);
  /// With the state locked.
  void changeBias(const Vector6& bias, std::optional<ros::Time> time);

  const DriverSettings& settings_;
  SensorState& state_;
  SensorOutput& output_;
  StrainSource* const device_;
  const double device_bias_timeout_;
  std::deque<EarlierBias> earlier_biases_;  // the newest last, all of the same calibration
  ros::CallbackQueue queue_;
  std::vector<ros::ServiceServer> servers_;
  GuardedSpinner spinner_{2, &queue_};
};

}  // namespace assembly_cell::ros_bridge
