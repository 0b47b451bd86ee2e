// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration/calibration_server_node.h"

#include <map>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/process/node_watch.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::uint32_t kNextCount = 8;  // steps of plan `next` by default

// Value of a request's text; an empty one leaves it.
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

// Runs `work`; a request that it refuses is answered with the reason.
template <class Response, class Work>
bool answer(Response& response, const char* service, const Work& work) {
  try {
    work();
  } catch (const InputError& error) {
    response.success = false;
    response.message = std::string(service) + " refused: " + error.what();
  }
  return true;
}

}  // namespace

CalibrationServerNode::CalibrationServerNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : operations_(nh, pnh, readCalibrationServerSettings(pnh),
                  [this] { return action_.stopReason(); }),
      action_(nh, operations_) {
  refuseSecondServer(nh, "calibrate");
  action_.start();
  // services have threads of their own, so that the data path never waits for them
  ros::NodeHandle services(pnh);
  services.setCallbackQueue(&service_queue_);
  using Self = CalibrationServerNode;
  services_ = {services.advertiseService("plan", &Self::plan, this),
               services.advertiseService("reset", &Self::reset, this),
               services.advertiseService("add_observation", &Self::addObservation, this),
               services.advertiseService("remove_last", &Self::removeLast, this),
               services.advertiseService("confirm", &Self::confirm, this),
               services.advertiseService("solve", &Self::solve, this),
               services.advertiseService("save", &Self::save, this),
               services.advertiseService("load", &Self::load, this),
               services.advertiseService("get_calibration", &Self::getCalibrations, this)};
  service_spinner_.start();
}

CalibrationServerNode::~CalibrationServerNode() {
  action_.shutdown();
  service_spinner_.stop();
}

bool CalibrationServerNode::addObservation(AddObservation::Request& request,
                                           AddObservation::Response& response) {
  return answer(response, "add_observation", [&] {
    Observation o = fromMessage(request.test, "test");
    const std::unique_lock<std::mutex> busy = operations_.acquire();
    PerSide<bool> wanted = {o.concerns(Side::kA), o.concerns(Side::kB)};
    if (o.kind == ObservationKind::kUnloaded && !request.test.sensor.empty()) {
      if (request.test.sensor != "a" && request.test.sensor != "b") {
        throw InputError("sensor is '" + request.test.sensor + "': give a, b or nothing for both");
      }
      wanted = {request.test.sensor == "a", request.test.sensor == "b"};
    }
    if (const CalibrationRefusal refusal = operations_.read(o, wanted, ros::Time())) {
      throw CalibrationError(refusal.code, refusal.text);
    }
    response.success = true;
    response.observations = operations_.observationCount();
    if (o.reading.a) Vector6::Map(response.volts_a.data()) = o.reading.a->volts;
    if (o.reading.b) Vector6::Map(response.volts_b.data()) = o.reading.b->volts;
    response.message = "observation " + std::to_string(response.observations) + " (" +
                       toString(o.kind) + ") of " + std::to_string(operations_.settings().window) +
                       " samples is on disk";
  });
}

bool CalibrationServerNode::confirm(ConfirmLoad::Request& request,
                                    ConfirmLoad::Response& response) {
  return answer(response, "confirm", [&] { action_.confirm(request, response); });
}

bool CalibrationServerNode::removeLast(std_srvs::Trigger::Request&,
                                       std_srvs::Trigger::Response& response) {
  return answer(response, "remove_last", [&] {
    const std::unique_lock<std::mutex> busy = operations_.acquire();
    const std::uint32_t count = operations_.observationCount();
    const Observation last = operations_.removeLast();
    response.message = "observation " + std::to_string(count) + " (" + toString(last.kind) +
                       (last.id.empty() ? "" : ", " + last.id) + ") removed";
    response.success = true;
  });
}

bool CalibrationServerNode::reset(std_srvs::Trigger::Request&,
                                  std_srvs::Trigger::Response& response) {
  return answer(response, "reset", [&] {
    const std::unique_lock<std::mutex> busy = operations_.acquire();
    const std::uint32_t count = operations_.observationCount();
    operations_.clear();
    response.success = true;
    response.message = std::to_string(count) + " observations put away to " +
                       operations_.session().store() + "/observations.yaml.previous";
  });
}

bool CalibrationServerNode::plan(PlanCalibration::Request& request,
                                 PlanCalibration::Response& response) {
  return answer(response, "plan", [&] {
    const std::string name = request.plan.empty() ? operations_.settings().plan : request.plan;
    ObservationSet set = operations_.session().observations();
    ForceSettings settings;
    settings.rated = operations_.settings().rated;
    std::vector<LoadRequest> steps;
    if (name == "next") {
      const std::vector<LoadRequest> candidates =
          standardCandidates(settings.rated, request.seed == 0 ? 1 : request.seed);
      const NextTests next =
          nextTests(set, candidates, request.count == 0 ? kNextCount : request.count, settings);
      for (const std::size_t i : next.chosen) steps.push_back(candidates.at(i));
      response.success = true;
      response.message = std::to_string(steps.size()) +
                         " steps; weak direction before: " + next.weak_direction_before +
                         "; after: " + next.weak_direction_after;
      response.design = toMessage(next.after, predictPlan(steps, set));
    } else {
      steps = operations_.steps(name, request.seed);
      set.observations.clear();
      response.success = true;
      response.message = std::to_string(steps.size()) + " steps";
      if (name != "displacement") {
        if (name == "quadratic") settings.model = StrainModel::kQuadratic;
        const ObservationSet predicted = predictPlan(steps, set);
        const ForceSolution design = evaluateDesign(predicted, settings);
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
    const std::unique_lock<std::mutex> busy = operations_.acquire();
    response.result = operations_.solve(force);
    response.success = response.result.accepted;
    response.message = response.result.message;
  });
}

bool CalibrationServerNode::save(SaveCalibration::Request& request,
                                 SaveCalibration::Response& response) {
  return answer(response, "save", [&] {
    const std::unique_lock<std::mutex> busy = operations_.acquire();
    const CalibrationOperations::Stored stored = operations_.save(request.id);
    response.success = true;
    response.id = stored.id;
    response.message = stored.message;
  });
}

bool CalibrationServerNode::load(LoadCalibration::Request& request,
                                 LoadCalibration::Response& response) {
  return answer(response, "load", [&] {
    const std::unique_lock<std::mutex> busy = operations_.acquire();
    const std::string& sensor = request.sensor;
    if (!sensor.empty() && sensor != "sensor_a" && sensor != "sensor_b") {
      throw InputError("sensor is '" + sensor.substr(0, 100) +
                       "': give sensor_a, sensor_b or nothing for both");
    }
    response.message = operations_.load(request.id, {sensor != "sensor_b", sensor != "sensor_a"});
    response.success = true;
  });
}

bool CalibrationServerNode::getCalibrations(GetCalibrations::Request&,
                                            GetCalibrations::Response& response) {
  const CalibrationSession& session = operations_.session();
  for (const Side side : kSides) {
    const auto active = session.active()[side];
    if (!active) continue;
    const Calibration& calibration = active->calibration;
    response.calibrations.push_back(operations_.topics().messageOf(side, calibration));
    response.message += (response.message.empty() ? "" : "; ") + sensorName(side) + ": " +
                        calibration.id + " of " + calibration.date;
  }
  response.stored_a = session.stored(Side::kA);
  response.stored_b = session.stored(Side::kB);
  response.success = !response.calibrations.empty();
  if (!response.success) response.message = "no active calibration: solve and save, or load one";
  return true;
}

}  // namespace assembly_cell::ros_bridge
