// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_server_node.h"

#include <assembly_cell/CalibrationStatus.h>
#include <assembly_cell/GetCalibration.h>
#include <assembly_cell/SetCalibration.h>

#include <map>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/observations/store.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/service_call.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::uint32_t kNextCount = 8;  // steps of plan `next` unless said otherwise

// of a request; empty: what is there already
template <class Value>
void choose(const char* key, const std::string& given, const std::map<std::string, Value>& values,
            const char* names, Value& value) {
  if (given.empty()) return;
  const auto found = values.find(given);
  if (found == values.end()) {
    throw InputError(std::string(key) + " is '" + given + "': give " + names);
  }
  value = found->second;
}

}  // namespace

CalibrationServerNode::CalibrationServerNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh) {
  StrainWindows::Settings windows = readParameters();
  windows.stop = [this] {
    if (stopping_) return "the server shuts down";
    return in_action_ && action_->isPreemptRequested() ? "cancelled" : "";
  };
  if (session_->openJournal()) {
    ROS_WARN(
        "journal '%s/observations.yaml': an observation that was never acknowledged was cut "
        "off",
        session_->store().c_str());
  }
  for (const std::string& text : session_->warnings()) ROS_WARN("%s", text.c_str());
  windows_ = std::make_unique<StrainWindows>(nh_, windows);
  advertise();
}

CalibrationServerNode::~CalibrationServerNode() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  action_.reset();
  service_spinner_.stop();
}

StrainWindows::Settings CalibrationServerNode::readParameters() {
  Parameters parameters(pnh_);
  std::string store = parameters.text("store", "");
  if (store.empty()) store = calibrationStore();
  if (store[0] != '/') {
    throw InputError("parameter " + pnh_.resolveName("store") + " is '" + store +
                     "': give a folder's whole path");
  }
  StrainWindows::Settings windows;
  window_ = windows.window = static_cast<std::size_t>(parameters.integer("window", 8, 100000, 200));
  windows.settle_timeout = Seconds(parameters.number("settle_timeout", {0.0, 3600.0}, 5.0));
  source_timeout_ = Seconds(parameters.number("source_timeout", {0.01, 3600.0}, 2.0));
  windows.source_timeout = source_timeout_;
  rig_ = parameters.text("rig", "");
  default_plan_ =
      parameters.choice("plan", {"recommended", "quadratic", "displacement"}, "recommended");
  zero_every_ = parameters.integer("zero_every", 1, 1000, 11);
  max_dropped_ = parameters.number("max_dropped", {0.0, 1.0}, 0.1);
  set_drivers_ = parameters.flag("set_drivers", true);
  ObservationSet set;
  set.gravity = parameters.number("gravity", kPositive, set.gravity);
  const double half_distance = parameters.number("gauge_half_distance", kPositive, 0.025);
  for (const Side side : kSides) {
    set.gauges[side] = thesisGauges(half_distance);
    SensorDescription& sensor = set.sensor[side];
    Parameters own(ros::NodeHandle(pnh_, sensorName(side)));
    sensor.serial_number = own.text("serial_number");
    sensor.bits = own.integer("bits", 2, 32, 16);
    sensor.full_scale = own.number("full_scale", kPositive, sensor.full_scale);
    sensor.noise = own.number("noise", kNotNegative, sensor.noise);
    own.refuseUnknown();
    if (sensor.serial_number.empty()) {
      throw InputError("parameter " + pnh_.resolveName(sensorName(side) + "/serial_number") +
                       " is empty: give that of the sensor");
    }
  }
  Parameters accuracy(ros::NodeHandle(pnh_, "accuracy"));
  for (const auto& [name, value] : set.accuracy.items()) {
    *value = accuracy.number(name, kPositive, *value);
  }
  accuracy.refuseUnknown();
  Parameters rated(ros::NodeHandle(pnh_, "rated"));
  rated_.force = rated.number("force", kPositive, rated_.force);
  rated_.torque = rated.number("torque", kPositive, rated_.torque);
  rated.refuseUnknown();
  parameters.refuseUnknown({"sensor_a", "sensor_b", "accuracy", "rated"});
  windows.sensor = set.sensor;
  session_ = std::make_unique<CalibrationSession>(store, set);
  return windows;
}

void CalibrationServerNode::advertise() {
  status_pub_ = pnh_.advertise<CalibrationStatus>("status", 1, true);
  observations_pub_ = pnh_.advertise<std_msgs::String>(
      "observations", 10, [this](const ros::SingleSubscriberPublisher& subscriber) {
        subscriber.publish(observationsMessage());
      });
  const MaybePerSide<CalibrationInForce> in_force = session_->inForce();
  for (const Side side : kSides) {
    sensors_[side].calibration_pub =
        pnh_.advertise<SensorCalibration>(sensorName(side) + "/calibration", 1, true);
    sensors_[side].in_force_since = ros::Time::now();
  }
  publishCalibrations({in_force.a.has_value(), in_force.b.has_value()});
  publishStatus();

  action_ = std::make_unique<CheckedActionServer<CalibrateSensorsAction>>(
      nh_, "calibrate", [this](const CalibrateSensorsGoalConstPtr& goal) { calibrate(goal); });
  action_->start();

  // services wait in threads of their own, so that the data path never waits for them
  ros::NodeHandle nh(pnh_);
  nh.setCallbackQueue(&service_queue_);
  using Self = CalibrationServerNode;
  services_ = {nh.advertiseService("plan", &Self::plan, this),
               nh.advertiseService("reset", &Self::reset, this),
               nh.advertiseService("add_observation", &Self::addObservation, this),
               nh.advertiseService("remove_last", &Self::removeLast, this),
               nh.advertiseService("confirm", &Self::confirm, this),
               nh.advertiseService("solve", &Self::solve, this),
               nh.advertiseService("save", &Self::save, this),
               nh.advertiseService("load", &Self::load, this),
               nh.advertiseService("get_calibration", &Self::getCalibrations, this)};
  service_spinner_.start();
}

// ---- observations ----

std::unique_lock<std::mutex> CalibrationServerNode::acquire() {
  std::unique_lock<std::mutex> busy(busy_, std::try_to_lock);
  if (busy) return busy;
  throw InputError((in_action_ ? "the action calibrate" : std::string("another request")) +
                   " is under way: wait for its end" + (in_action_ ? ", or cancel it" : ""));
}

void CalibrationServerNode::keep(const Observation& observation) {
  session_->add(observation);
  publishStatus();
}

void CalibrationServerNode::startAnew() {
  session_->clear();
  publishStatus();
}

bool CalibrationServerNode::addObservation(AddObservation::Request& request,
                                           AddObservation::Response& response) {
  return answer(response, "add_observation", [&] {
    Observation o = fromMessage(request.test, "test");
    const std::unique_lock<std::mutex> busy = acquire();
    PerSide<bool> wanted = {o.concerns(Side::kA), o.concerns(Side::kB)};
    if (o.kind == ObservationKind::kUnloaded && !request.test.sensor.empty()) {
      if (request.test.sensor != "a" && request.test.sensor != "b") {
        throw InputError("sensor is '" + request.test.sensor + "': give a, b or nothing for both");
      }
      wanted = {request.test.sensor == "a", request.test.sensor == "b"};
    }
    read(o, wanted);
    response.success = true;
    response.observations = observationCount();
    if (o.reading.a) Vector6::Map(response.volts_a.data()) = o.reading.a->volts;
    if (o.reading.b) Vector6::Map(response.volts_b.data()) = o.reading.b->volts;
    response.message = "observation " + std::to_string(response.observations) + " (" +
                       toString(o.kind) + ") of " + std::to_string(window_) + " samples is on disk";
  });
}

void CalibrationServerNode::read(Observation& o, const PerSide<bool>& wanted) {
  if (const CalibrationRefusal refusal = windows_->read(o, wanted, ros::Time())) {
    throw CalibrationError(refusal.code, refusal.text);
  }
  keep(o);
}

bool CalibrationServerNode::removeLast(std_srvs::Trigger::Request&,
                                       std_srvs::Trigger::Response& response) {
  return answer(response, "remove_last", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    const std::uint32_t count = observationCount();
    const Observation last = session_->removeLast();
    response.message = "observation " + std::to_string(count) + " (" + toString(last.kind) +
                       (last.id.empty() ? "" : ", " + last.id) + ") removed";
    response.success = true;
    publishStatus();
  });
}

bool CalibrationServerNode::reset(std_srvs::Trigger::Request&,
                                  std_srvs::Trigger::Response& response) {
  return answer(response, "reset", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    const std::uint32_t count = observationCount();
    startAnew();
    response.success = true;
    response.message = std::to_string(count) + " observations put away to " + session_->store() +
                       "/observations.yaml.previous";
  });
}

// ---- plan and solution ----

std::vector<LoadRequest> CalibrationServerNode::makeSteps(const std::string& plan,
                                                          std::uint32_t seed) const {
  const auto name = planName(plan);
  if (!name) throw InputError("plan is '" + plan + "': give " + kPlanNames + " or next");
  ObservationSet empty = session_->observations();
  empty.observations.clear();
  return makePlan(*name, empty, rated_, seed == 0 ? 1 : seed, zero_every_);
}

bool CalibrationServerNode::plan(PlanCalibration::Request& request,
                                 PlanCalibration::Response& response) {
  return answer(response, "plan", [&] {
    const std::string name = request.plan.empty() ? default_plan_ : request.plan;
    ObservationSet set = session_->observations();
    ForceSettings settings;
    settings.rated = rated_;
    std::vector<LoadRequest> steps;
    if (name == "next") {
      const std::vector<LoadRequest> candidates =
          standardCandidates(rated_, request.seed == 0 ? 1 : request.seed);
      const NextTests next =
          nextTests(set, candidates, request.count == 0 ? kNextCount : request.count, settings);
      for (const std::size_t i : next.chosen) steps.push_back(candidates.at(i));
      response.success = true;
      response.message = std::to_string(steps.size()) +
                         " steps; weak direction before: " + next.weak_direction_before +
                         "; after: " + next.weak_direction_after;
      response.design = toMessage(next.after, predictPlan(steps, set));
    } else {
      steps = makeSteps(name, request.seed);
      set.observations.clear();
      response.success = true;
      response.message = std::to_string(steps.size()) + " steps";
      if (name != "displacement") {
        if (name == "quadratic") settings.model = StrainModel::kQuadratic;
        const ObservationSet predicted = predictPlan(steps, set);
        const ForceSolution design = judgeDesign(predicted, settings);
        response.design = toMessage(design, predicted);
        response.design.normalised.clear();
        const std::string refusal = gateTexts(design.gates, Verdict::kRefuse);
        response.success = refusal.empty();
        response.message += "; " + (refusal.empty() ? design.message : "refused: " + refusal);
      }
    }
    for (const LoadRequest& step : steps) response.steps.push_back(toMessage(step));
  });
}

bool CalibrationServerNode::solve(SolveCalibration::Request& request,
                                  SolveCalibration::Response& response) {
  return answer(response, "solve", [&] {
    ForceSettings force;
    choose<ForceProcedure>("procedure", request.procedure,
                           {{"all_rows", ForceProcedure::kAllRows},
                            {"force_rows", ForceProcedure::kForceRows},
                            {"thesis", ForceProcedure::kThesis}},
                           "all_rows, force_rows or thesis", force.procedure);
    choose<StrainModel>("model", request.model,
                        {{"automatic", StrainModel::kAutomatic},
                         {"linear", StrainModel::kLinear},
                         {"quadratic", StrainModel::kQuadratic}},
                        "automatic, linear or quadratic", force.model);
    const std::unique_lock<std::mutex> busy = acquire();
    response.result = solveAll(force);
    response.success = response.result.accepted;
    response.message = response.result.message;
  });
}

CalibrationResult CalibrationServerNode::solveAll(const ForceSettings& force) {
  SolveSettings settings = solveSettings(session_->observations());
  settings.force = force;
  settings.force.rated = rated_;
  return toMessage(session_->solve(settings));
}

// ---- calibrations ----

PerSide<Calibration> CalibrationServerNode::inDrivers(const PerSide<bool>& wanted) const {
  PerSide<Calibration> found;
  const ObservationSet set = session_->observations();
  for (const Side side : kSides) {
    GetCalibration call;
    const std::string name = nh_.resolveName(sensorName(side) + "/driver/get_calibration");
    if (wanted[side] && set_drivers_ && callService(name, call) &&
        call.response.calibration.serial_number == set.sensor[side].serial_number) {
      found[side] = fromMessage(call.response.calibration, name);
    }
  }
  return found;
}

std::string CalibrationServerNode::handOver(const MaybePerSide<CalibrationInForce>& calibrations,
                                            const PerSide<Calibration>* before) {
  std::string complaints;
  for (const Side side : kSides) {
    if (!calibrations[side] || !set_drivers_) continue;
    const std::string service = nh_.resolveName(sensorName(side) + "/driver/set_calibration");
    SetCalibration call;
    call.request.calibration = toMessage(calibrations[side]->calibration);
    if (!callService(service, call)) {
      complaints += "; " + service + " isn't there: load again once it is";
    } else if (!call.response.success) {
      const std::string refusal =
          "driver of " + sensorName(side) + ": " + std::string(call.response.message);
      if (before != nullptr) {
        MaybePerSide<CalibrationInForce> undo;
        if (side == Side::kB && calibrations.a && !before->a.id.empty()) {
          undo.a = CalibrationInForce{before->a, ""};
        }
        handOver(undo, nullptr);
        throw CalibrationError(CalibrationFailure::kDriverRefused,
                               refusal + "; what was in force stays");
      }
      complaints += "; " + refusal;
    }
  }
  return complaints;
}

void CalibrationServerNode::putInForce(const MaybePerSide<CalibrationInForce>& calibrations) {
  session_->putInForce(calibrations);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const Side side : kSides) {
      if (calibrations[side]) sensors_[side].in_force_since = ros::Time::now();
    }
  }
  publishCalibrations({calibrations.a.has_value(), calibrations.b.has_value()});
  publishStatus();
}

CalibrationServerNode::Stored CalibrationServerNode::saveSolution(const std::string& wanted) {
  const MaybePerSide<Calibration> stored = session_->save(wanted, inDrivers({true, true}));
  Stored out;
  MaybePerSide<CalibrationInForce> calibrations;
  for (const Side side : kSides) {
    if (!stored[side]) continue;
    calibrations[side] = CalibrationInForce{*stored[side], ""};
    out.id = stored[side]->id;
  }
  putInForce(calibrations);
  out.message = "stored and in force: " + out.id + handOver(calibrations, nullptr);
  return out;
}

bool CalibrationServerNode::save(SaveCalibration::Request& request,
                                 SaveCalibration::Response& response) {
  return answer(response, "save", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    const Stored stored = saveSolution(request.id);
    response.success = true;
    response.id = stored.id;
    response.message = stored.message;
  });
}

bool CalibrationServerNode::load(LoadCalibration::Request& request,
                                 LoadCalibration::Response& response) {
  return answer(response, "load", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    const std::string& sensor = request.sensor;
    if (!sensor.empty() && sensor != "sensor_a" && sensor != "sensor_b") {
      throw InputError("sensor is '" + sensor.substr(0, 100) +
                       "': give sensor_a, sensor_b or nothing for both");
    }
    // all of them are whole, and no driver refuses, before any comes in force
    const PerSide<bool> wanted = {sensor != "sensor_b", sensor != "sensor_a"};
    const PerSide<Calibration> before = inDrivers(wanted);
    const auto loaded = session_->load(request.id, wanted, before);
    response.message = "in force: " + request.id + handOver(loaded, &before);
    putInForce(loaded);
    for (const Side side : kSides) {
      if (!loaded[side] || loaded[side]->displacement_of.empty()) continue;
      response.message +=
          "; " + sensorName(side) + " keeps the displacement of " + loaded[side]->displacement_of;
    }
    response.success = true;
  });
}

bool CalibrationServerNode::getCalibrations(GetCalibrations::Request&,
                                            GetCalibrations::Response& response) {
  for (const Side side : kSides) {
    const auto in_force = session_->inForce()[side];
    if (!in_force) continue;
    response.calibrations.push_back(messageOf(side, in_force->calibration));
    response.message += (response.message.empty() ? "" : "; ") + sensorName(side) + ": " +
                        in_force->calibration.id + " of " + in_force->calibration.date;
  }
  response.stored_a = session_->stored(Side::kA);
  response.stored_b = session_->stored(Side::kB);
  response.success = !response.calibrations.empty();
  if (!response.success) response.message = "none in force: solve and save, or load one";
  return true;
}

SensorCalibration CalibrationServerNode::messageOf(Side side, const Calibration& c) const {
  SensorCalibration message = toMessage(c);
  const std::lock_guard<std::mutex> lock(mutex_);
  message.header.stamp = sensors_[side].in_force_since;
  message.header.frame_id = sensorName(side);
  return message;
}

void CalibrationServerNode::publishCalibrations(const PerSide<bool>& wanted) {
  for (const Side side : kSides) {
    if (!wanted[side]) continue;
    sensors_[side].calibration_pub.publish(messageOf(side, session_->inForce()[side]->calibration));
  }
}

void CalibrationServerNode::publishStatus() {
  const ObservationSet set = session_->observations();
  const MaybePerSide<CalibrationInForce> in_force = session_->inForce();
  CalibrationStatus status;
  status.observations = static_cast<std::uint32_t>(set.observations.size());
  if (!set.observations.empty()) status.last_id = set.observations.back().id;
  if (in_force.a) status.calibration_a = in_force.a->calibration.id;
  if (in_force.b) status.calibration_b = in_force.b->calibration.id;
  status.state = in_action_ ? "calibrate" : "idle";
  status.header.stamp = ros::Time::now();
  status_pub_.publish(status);
  // The whole observation file, so that a bag's last message is the session: written out only for a
  // subscriber, who gets it on connecting and after each change.
  if (observations_pub_.getNumSubscribers() > 0) observations_pub_.publish(observationsMessage());
}

std_msgs::String CalibrationServerNode::observationsMessage() const {
  std_msgs::String file;
  file.data = observationsText(session_->observations());
  return file;
}

}  // namespace assembly_cell::ros_bridge
