// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_operations.h"

#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"

namespace assembly_cell::ros_bridge {

namespace {

StrainWindows::Settings windowSettings(const CalibrationServerSettings& settings,
                                       std::function<std::string()> stop) {
  StrainWindows::Settings out;
  out.sensor = settings.sensors.sensor;
  out.window = settings.window;
  out.settle_timeout = StrainWindows::Seconds(settings.settle_timeout);
  out.source_timeout = StrainWindows::Seconds(settings.source_timeout);
  out.stop = std::move(stop);
  return out;
}

}  // namespace

CalibrationOperations::CalibrationOperations(const ros::NodeHandle& nh, const ros::NodeHandle& pnh,
                                             CalibrationServerSettings settings,
                                             std::function<std::string()> stop)
    : settings_(std::move(settings)),
      session_(settings_.store, settings_.sensors),
      windows_(nh, windowSettings(settings_, std::move(stop))),
      drivers_(
          nh, settings_.set_drivers,
          {settings_.sensors.sensor.a.serial_number, settings_.sensors.sensor.b.serial_number}) {
  if (session_.openJournal()) {
    ROS_WARN(
        "journal '%s/observations.yaml': an observation that was never acknowledged was cut "
        "off",
        session_.store().c_str());
  }
  for (const std::string& text : session_.warnings()) ROS_WARN("%s", text.c_str());
  topics_.emplace(pnh, session_);
}

std::uint32_t CalibrationOperations::observationCount() const {
  return static_cast<std::uint32_t>(session_.observations().observations.size());
}

std::vector<LoadRequest> CalibrationOperations::steps(const std::string& plan,
                                                      std::uint32_t seed) const {
  const auto name = planName(plan);
  if (!name) throw InputError("plan is '" + plan + "': give " + kPlanNames + " or next");
  return makePlan(*name, settings_.sensors, settings_.rated, seed == 0 ? 1 : seed,
                  settings_.zero_every);
}

std::unique_lock<std::mutex> CalibrationOperations::tryAcquire() {
  return std::unique_lock<std::mutex>(busy_, std::try_to_lock);
}

std::unique_lock<std::mutex> CalibrationOperations::acquire() {
  std::unique_lock<std::mutex> busy = tryAcquire();
  if (busy) return busy;
  throw InputError((in_action_ ? "the action calibrate" : std::string("another request")) +
                   " is under way: wait for its end" + (in_action_ ? ", or cancel it" : ""));
}

void CalibrationOperations::setInAction(bool in_action) {
  in_action_ = in_action;
  topics_->publishStatus(in_action);
}

CalibrationRefusal CalibrationOperations::read(Observation& observation,
                                               const PerSide<bool>& wanted, const ros::Time& from) {
  CalibrationRefusal refusal = windows_.read(observation, wanted, from);
  if (refusal) return refusal;
  session_.add(observation);
  topics_->publishStatus(in_action_);
  return {};
}

Observation CalibrationOperations::removeLast() {
  const Observation last = session_.removeLast();
  topics_->publishStatus(in_action_);
  return last;
}

void CalibrationOperations::clear() {
  session_.clear();
  topics_->publishStatus(in_action_);
}

CalibrationResult CalibrationOperations::solve(const ForceSettings& force) {
  SolveSettings settings = solveSettings(session_.observations());
  settings.force = force;
  settings.force.rated = settings_.rated;
  return toMessage(session_.solve(settings));
}

CalibrationOperations::Stored CalibrationOperations::save(const std::string& id) {
  const MaybePerSide<Calibration> stored = session_.save(id, drivers_.current({true, true}));
  Stored out;
  MaybePerSide<ActiveCalibration> calibrations;
  for (const Side side : kSides) {
    if (!stored[side]) continue;
    calibrations[side] = ActiveCalibration{*stored[side], ""};
    out.id = stored[side]->id;
  }
  activate(calibrations);
  out.message = "stored and active: " + out.id + drivers_.send(calibrations, nullptr);
  return out;
}

std::string CalibrationOperations::load(const std::string& id, const PerSide<bool>& wanted) {
  // all of them are whole, and no driver refuses, before any becomes active
  const PerSide<Calibration> before = drivers_.current(wanted);
  const auto loaded = session_.load(id, wanted, before);
  std::string message = "active: " + id + drivers_.send(loaded, &before);
  activate(loaded);
  for (const Side side : kSides) {
    if (!loaded[side] || loaded[side]->displacement_of.empty()) continue;
    message +=
        "; " + sensorName(side) + " keeps the displacement of " + loaded[side]->displacement_of;
  }
  return message;
}

void CalibrationOperations::activate(const MaybePerSide<ActiveCalibration>& calibrations) {
  session_.activate(calibrations);
  topics_->publishCalibrations({calibrations.a.has_value(), calibrations.b.has_value()});
  topics_->publishStatus(in_action_);
}

}  // namespace assembly_cell::ros_bridge
