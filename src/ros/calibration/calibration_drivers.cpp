// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_drivers.h"

#include <assembly_cell/GetCalibration.h>
#include <assembly_cell/SetCalibration.h>

#include <utility>

#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/service_call.h"

namespace assembly_cell::ros_bridge {

CalibrationDrivers::CalibrationDrivers(const ros::NodeHandle& nh, bool enabled,
                                       PerSide<std::string> serial_numbers)
    : nh_(nh), enabled_(enabled), serial_numbers_(std::move(serial_numbers)) {}

PerSide<Calibration> CalibrationDrivers::current(const PerSide<bool>& wanted) const {
  PerSide<Calibration> found;
  for (const Side side : kSides) {
    GetCalibration call;
    const std::string name = nh_.resolveName(sensorName(side) + "/driver/get_calibration");
    if (wanted[side] && enabled_ && callService(name, call) &&
        call.response.calibration.serial_number == serial_numbers_[side]) {
      found[side] = fromMessage(call.response.calibration, name);
    }
  }
  return found;
}

std::string CalibrationDrivers::send(const MaybePerSide<ActiveCalibration>& calibrations,
                                     const PerSide<Calibration>* before) const {
  std::string complaints;
  for (const Side side : kSides) {
    if (!calibrations[side] || !enabled_) continue;
    const std::string service = nh_.resolveName(sensorName(side) + "/driver/set_calibration");
    SetCalibration call;
    call.request.calibration = toMessage(calibrations[side]->calibration);
    if (!callService(service, call)) {
      complaints += "; " + service + " isn't there: load again once it is";
    } else if (!call.response.success) {
      const std::string refusal =
          "driver of " + sensorName(side) + ": " + std::string(call.response.message);
      if (before != nullptr) {
        MaybePerSide<ActiveCalibration> undo;
        if (side == Side::kB && calibrations.a && !before->a.id.empty()) {
          undo.a = ActiveCalibration{before->a, ""};
        }
        send(undo, nullptr);
        throw CalibrationError(CalibrationFailure::kDriverRefused,
                               refusal + "; the active ones stay");
      }
      complaints += "; " + refusal;
    }
  }
  return complaints;
}

}  // namespace assembly_cell::ros_bridge
