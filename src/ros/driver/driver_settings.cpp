// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/driver_settings.h"

#include <cmath>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/wrench_range.h"

namespace assembly_cell::ros_bridge {

void fields(FieldList& f, DriverSettings& s) {
  f.text("frame_id", s.frame_id, "Frame of the sensor, without a leading slash.").required();
  f.text("calibration_file", s.calibration_file,
         "Calibration of the sensor; not for a device that delivers wrenches.")
      .required(!s.has_source);
  f.flag("publish_displacement", s.publish_displacement,
         "Publishes the displacement of the coupling, too.");
  f.text("scenario", s.scenario,
         "File with the coupling, or the compliance of the sensor's mount, that serves as "
         "displacement sensor instead of the calibration's map.");
  f.flag("lockstep", s.lockstep, "Acknowledges blocks on ack.");
  f.text("name_in_lockstep", s.name_in_lockstep, "Name in the simulator's participants.");
  f.number("display_rate", s.display_rate, {1e-3, 1e6, "Hz"}, "Of wrench and wrench_raw.").live();
  f.number("rate_tolerance", s.rate_tolerance, positive(""),
           "Deviation from expected_rate without a warning, fraction.");
  f.number("frozen_after", s.frozen_after, notNegative("s", 3600),
           "Equal readings of all six channels for this time are an error, and are not published; "
           "0: never, for a noise below a step of the converter. Not in lockstep.");
  f.integer("zero_samples", s.zero_samples, 2, 1000000, "Samples of a zero.");
  f.number("zero_timeout", s.zero_timeout, notNegative("s", 3600),
           "A zero fails without its samples for this time.");
  f.number("source_timeout", s.source_timeout, notNegative("s", 3600),
           "Silence of the source that is reported, and ends a zero.");
  f.number("diagnostic_period", s.diagnostic_period, {0.01, 3600, "s"}, "Of the diagnostics.");
}

SourceSettings::SourceSettings() : range_force(kLargestForce), range_torque(kLargestTorque) {}

void fields(FieldList& f, SourceSettings& s) {
  f.integer("queue_size", s.queue_size, 2, 10000, "Blocks between reading and publishing.");
  f.number("read_timeout", s.read_timeout, {1e-3, 10.0, "s"}, "Of one read.");
  f.number("back_off", s.back_off, {1e-3, 60.0, "s"},
           "Before the first attempt to open a lost device again; doubles with each.");
  f.number("longest_back_off", s.longest_back_off, {1e-3, 600.0, "s"}, "Longest such wait.");
  f.integer("realtime_priority", s.realtime_priority, 0, 99,
            "SCHED_FIFO of the reading and the publishing thread; 0: none.");
  f.number("device_bias_timeout", s.device_bias_timeout, {0.01, 3600, "s"},
           "A bias of the device fails if no samples verify it for this time.");
  f.number("range_force", s.range_force, positive("N"),
           "A force beyond counts as saturated, of a device that delivers wrenches.");
  f.number("range_torque", s.range_torque, positive("N m"), "The same of a torque.");
  f.numbers("device_position", s.device_position.data(), s.device_position.size(), {-2.0, 2.0, "m"},
            "Origin of a device that delivers wrenches, in the sensor's frame.");
  f.numbers("device_rotation", s.device_rotation.data(), s.device_rotation.size(),
            {-2.0 * M_PI, 2.0 * M_PI, "rad"},
            "Rotation vector of its axes; [3.14159265, 0, 0] where its z points down.");
}

namespace {

bool isMap(const Calibration& c, const Matrix6& map) {
  return !c.quadratic_wrench && c.volts_to_wrench == map && c.zero_volts.isZero(0.0);
}

}  // namespace

bool isIdentity(const Calibration& c) { return isMap(c, Matrix6::Identity()); }

void CalibrationRules::check(const Calibration& c, const std::string& source) const {
  if (needs_displacement && !calibrated && c.volts_to_displacement.isZero(0.0)) {
    throw InputError(source +
                     " but publish_displacement is true: set scenario, the file with the "
                     "compliance of the sensor's mount (coupling)");
  }
  if (needs_displacement && c.volts_to_displacement.isZero(0.0)) {
    throw InputError(source +
                     ": volts_to_displacement is zero but publish_displacement is true: "
                     "identify the displacement, set publish_displacement false, or give the "
                     "calibration of this sensor (this one is of '" +
                     c.serial_number + "')");
  }
  if (!quantity) return;
  if (*quantity == SampleQuantity::kWrench && !isMap(c, device_to_sensor)) {
    const bool placed = !device_to_sensor.isIdentity(0.0);
    throw InputError(source + ": volts_to_wrench is not the " +
                     (placed ? "transform of device_position, device_rotation" : "identity") +
                     " but the source delivers wrenches: leave calibration_file out");
  }
  if (*quantity != SampleQuantity::kWrench && !calibrated) {
    throw InputError(source + " but the source delivers volts: set calibration_file");
  }
}

}  // namespace assembly_cell::ros_bridge
