// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_server_settings.h"

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/common/store.h"
#include "assembly_cell/ros/bridge/parameters.h"

namespace assembly_cell::ros_bridge {

void fields(FieldList& f, CalibrationServerSettings& s) {
  f.text("store", s.store,
         "Folder of observations and calibrations, whole path; empty: "
         "~/.ros/assembly_cell/calibrations (or below ROS_HOME). One server at a time.");
  f.number("gravity", s.sensors.gravity, positive("m/s2"), "Gravity at the place of calibration.");
  f.number("gauge_half_distance", s.gauge_half_distance, positive("m"),
           "Half distance of the dial gauges in pairs.");
  f.integer("window", s.window, 8, 100000, "Samples in an observation.");
  f.number("settle_timeout", s.settle_timeout, notNegative("s", 3600.0),
           "Longest wait for a window in which nothing moves, wall clock.");
  f.number("source_timeout", s.source_timeout, {0.01, 3600.0, "s"},
           "Without a block for this time a sensor counts as silent, wall clock.");
  f.choice("plan", s.plan, {"recommended", "quadratic", "displacement"},
           "Plan of a goal or request that names none.");
  f.integer("zero_every", s.zero_every, 1, 1000, "Loaded tests between two unloaded readings.");
  f.number("max_dropped", s.max_dropped, {0.0, 1.0},
           "Fraction of a plan's steps that may lack an observation.");
  f.text("rig", s.rig,
         "Service (ApplyLoad) that applies loads, relative to the cell; empty: a person, who calls "
         "~confirm.");
  f.flag("set_drivers", s.set_drivers,
         "Active calibrations are sent to the drivers of the sensors.");
}

namespace {

// reads a map of parameters below `pnh`
template <class Struct>
void readMap(const ros::NodeHandle& pnh, const std::string& name, Struct& value) {
  Parameters parameters(ros::NodeHandle(pnh, name));
  parameters.read(fieldsOf(value));
  parameters.refuseUnknown();
}

}  // namespace

CalibrationServerSettings readCalibrationServerSettings(const ros::NodeHandle& pnh) {
  CalibrationServerSettings settings;
  Parameters parameters(pnh);
  parameters.read(fieldsOf(settings));
  if (settings.store.empty()) settings.store = calibrationStore();
  if (settings.store[0] != '/') {
    throw InputError("parameter " + pnh.resolveName("store") + " is '" + settings.store +
                     "': give a folder's whole path");
  }
  for (const Side side : kSides) {
    settings.sensors.gauges[side] = thesisGauges(settings.gauge_half_distance);
    readMap(pnh, sensorName(side), settings.sensors.sensor[side]);
    if (settings.sensors.sensor[side].serial_number.empty()) {
      throw InputError("parameter " + pnh.resolveName(sensorName(side) + "/serial_number") +
                       " is empty: give that of the sensor");
    }
  }
  readMap(pnh, "accuracy", settings.sensors.accuracy);
  readMap(pnh, "rated", settings.rated);
  parameters.refuseUnknown({"sensor_a", "sensor_b", "accuracy", "rated"});
  return settings;
}

}  // namespace assembly_cell::ros_bridge
