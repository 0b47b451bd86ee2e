// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>

#include <cstddef>
#include <string>

#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/calibration/two_sensor/force.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

/// Parameters of calibration_server (config/calibration_server.yaml).
struct CalibrationServerSettings {
  std::string store;            ///< folder of observations and calibrations, absolute path
  ObservationSet sensors;       ///< sensors, reference accuracy and gauges; without observations
  RatedLoad rated;              ///< loads over which the accuracy is evaluated
  std::size_t window = 200;     ///< samples in an observation
  double settle_timeout = 5.0;  ///< for a window in which nothing moves, wall clock [s]
  double source_timeout = 2.0;  ///< without a block a sensor counts as silent, wall clock [s]
  std::string rig;              ///< service that applies loads; empty: a person does
  std::string plan = "recommended";    ///< of a goal that names none
  int zero_every = 11;                 ///< loaded tests between two unloaded readings
  double max_dropped = 0.1;            ///< fraction of a plan's steps that may lack an observation
  double gauge_half_distance = 0.025;  ///< of the dial gauges in pairs [m]
  bool set_drivers = true;  ///< whether active calibrations are sent to the sensors' drivers
};

/// Without the maps of parameters sensor_a, sensor_b, accuracy and rated.
void fields(FieldList& f, CalibrationServerSettings& s);

/// Reads the private parameters. Throws InputError for a bad or unknown one.
CalibrationServerSettings readCalibrationServerSettings(const ros::NodeHandle& pnh);

}  // namespace assembly_cell::ros_bridge
