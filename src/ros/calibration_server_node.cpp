// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/calibration_server_node.h"

#include <assembly_cell/ApplyLoad.h>
#include <assembly_cell/CalibrationStatus.h>
#include <assembly_cell/GetCalibration.h>
#include <assembly_cell/SetCalibration.h>
#include <std_msgs/String.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <set>
#include <utility>

#include "assembly_cell/calibration/drift.h"
#include "assembly_cell/calibration/store.h"
#include "assembly_cell/ros/calibration_messages.h"
#include "assembly_cell/ros/parameters.h"
#include "assembly_cell/scene/input_error.h"

namespace assembly_cell::ros_bridge {

namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kQueue = 100;    // every sample counts
constexpr double kSlice = 0.05;          // of waiting, after which a cancel is looked at [s]
constexpr int kTries = 3;                // of a step whose window doesn't settle
constexpr std::uint32_t kNextCount = 8;  // steps of plan `next` unless said otherwise
constexpr const char* kPlans[] = {"recommended", "quadratic", "displacement", "thesis_fixed",
                                  "thesis_shifted"};
constexpr PlanName kPlanNames[] = {PlanName::kRecommended, PlanName::kQuadratic,
                                   PlanName::kDisplacement, PlanName::kThesisFixed,
                                   PlanName::kThesisShifted};

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, value);
  return text;
}

std::string dateNow() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

std::array<bool, 2> sidesOf(const Observation& o) {
  const bool both = o.kind == ObservationKind::kReacting || o.kind == ObservationKind::kUnloaded;
  return {both || o.side == Side::kA, both || o.side == Side::kB};
}

bool isForceTest(const Observation& o) {
  return o.kind == ObservationKind::kReacting || o.kind == ObservationKind::kWeight ||
         o.kind == ObservationKind::kIndentation;
}

// what a kill left of files that were never finished; only this process writes here
void removeLeftovers(const std::string& folder) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    const std::size_t mark = name.rfind(".yaml.tmp");
    if (mark == std::string::npos || mark == 0) continue;
    const std::string digits = name.substr(mark + 9);
    if (!digits.empty() && digits.find_first_not_of("0123456789") == std::string::npos) {
      std::error_code ignored;
      fs::remove(entry->path(), ignored);
    }
  }
}

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
    : nh_(nh), pnh_(pnh) {
  sensors_[0].name = "sensor_a";
  sensors_[1].name = "sensor_b";
  sensors_[1].side = Side::kB;
  readParameters();
  openStore();
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

void CalibrationServerNode::readParameters() {
  Parameters parameters(pnh_);
  store_ = parameters.text("store", "");
  if (store_.empty()) store_ = calibrationStore();
  if (store_[0] != '/') {
    throw InputError("parameter " + pnh_.resolveName("store") + " is '" + store_ +
                     "': give a folder's whole path");
  }
  window_ = static_cast<std::size_t>(parameters.integer("window", 8, 100000, 200));
  settle_timeout_ = Seconds(parameters.number("settle_timeout", {0.0, 3600.0}, 5.0));
  source_timeout_ = Seconds(parameters.number("source_timeout", {0.01, 3600.0}, 2.0));
  rig_ = parameters.text("rig", "");
  default_plan_ =
      parameters.choice("plan", {"recommended", "quadratic", "displacement"}, "recommended");
  zero_every_ = parameters.integer("zero_every", 1, 1000, 11);
  max_dropped_ = parameters.number("max_dropped", {0.0, 1.0}, 0.1);
  set_drivers_ = parameters.flag("set_drivers", true);
  set_.gravity = parameters.number("gravity", kPositive, set_.gravity);
  const double half_distance = parameters.number("gauge_half_distance", kPositive, 0.025);
  set_.gauges_a = set_.gauges_b = thesisGauges(half_distance);
  for (SensorDescription* sensor : {&set_.a, &set_.b}) {
    const std::string name = sensor == &set_.a ? "sensor_a" : "sensor_b";
    Parameters own(ros::NodeHandle(pnh_, name));
    sensor->serial_number = own.text("serial_number");
    sensor->bits = own.integer("bits", 2, 32, 16);
    sensor->full_scale = own.number("full_scale", kPositive, sensor->full_scale);
    sensor->noise = own.number("noise", kNotNegative, sensor->noise);
    own.refuseUnknown();
    if (sensor->serial_number.empty()) {
      throw InputError("parameter " + pnh_.resolveName(name + "/serial_number") +
                       " is empty: give that of the sensor");
    }
  }
  Parameters accuracy(ros::NodeHandle(pnh_, "accuracy"));
  for (const auto& [name, value] :
       {std::pair<const char*, double*>{"direction", &set_.accuracy.direction},
        {"mass", &set_.accuracy.mass},
        {"point", &set_.accuracy.point},
        {"position", &set_.accuracy.position},
        {"rotation", &set_.accuracy.rotation},
        {"gauge", &set_.accuracy.gauge}}) {
    *value = accuracy.number(name, kPositive, *value);
  }
  accuracy.refuseUnknown();
  Parameters rated(ros::NodeHandle(pnh_, "rated"));
  rated_.force = rated.number("force", kPositive, rated_.force);
  rated_.torque = rated.number("torque", kPositive, rated_.torque);
  rated.refuseUnknown();
  parameters.refuseUnknown({"sensor_a", "sensor_b", "accuracy", "rated"});
}

void CalibrationServerNode::openStore() {
  for (const Sensor& sensor : sensors_) makeCalibrationFolder(store_, sensor.name);
  const std::string path = store_ + "/observations.yaml";
  journal_ = std::make_unique<ObservationLog>(path, observationHeader(set_));
  if (journal_->torn()) {
    ROS_WARN("journal '%s': an observation that was never acknowledged was cut off", path.c_str());
  }
  for (const std::string& folder : {store_, store_ + "/sensor_a", store_ + "/sensor_b"}) {
    removeLeftovers(folder);
  }
  for (std::size_t i = 0; i < journal_->records().size(); ++i) {
    set_.observations.push_back(parseObservation(
        journal_->records()[i], set_, "journal '" + path + "', record " + std::to_string(i + 1)));
  }
  if (!set_.observations.empty()) last_id_ = set_.observations.back().id;
  readInForce();
}

void CalibrationServerNode::advertise() {
  status_pub_ = pnh_.advertise<CalibrationStatus>("status", 1, true);
  observations_pub_ = pnh_.advertise<std_msgs::String>(
      "observations", 10, [this](const ros::SingleSubscriberPublisher& subscriber) {
        subscriber.publish(observationsMessage());
      });
  for (Sensor& sensor : sensors_) {
    sensor.calibration_pub =
        pnh_.advertise<SensorCalibration>(sensor.name + "/calibration", 1, true);
    sensor.driver_service = nh_.resolveName(sensor.name + "/driver/set_calibration");
    if (sensor.in_force) publishCalibration(sensor);
    const boost::function<void(const StrainSamples::ConstPtr&)> callback =
        [this, &sensor](const StrainSamples::ConstPtr& block) { collect(sensor, block); };
    sensor.strain_sub =
        nh_.subscribe<StrainSamples>(sensor.name + "/strain", kQueue, callback, ros::VoidConstPtr(),
                                     ros::TransportHints().tcpNoDelay());
  }
  publishStatus();

  action_ = std::make_unique<actionlib::SimpleActionServer<CalibrateSensorsAction>>(
      nh_, "calibrate", [this](const CalibrateSensorsGoalConstPtr& goal) { calibrate(goal); },
      false);
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

// ---- data ----

void CalibrationServerNode::collect(Sensor& sensor, const StrainSamples::ConstPtr& block) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    Collector& c = sensor.collector;
    if (!faultOf(*block).empty()) return;
    c.heard = Clock::now();
    const Arrival arrival = c.sequence.accept(block->sequence);
    if (!c.active || arrival == Arrival::kDuplicate) return;
    if (arrival == Arrival::kRestart) {
      c.failure = "the source started anew: try again";
    } else if (!c.armed) {
      c.armed = true;
    } else {
      for (std::size_t k = 0; k < block->saturated.size() && c.volts.size() < window_; ++k) {
        const ros::Time stamp =
            block->header.stamp + ros::Duration(static_cast<double>(k) * block->period);
        if (stamp < c.from) continue;
        if (c.volts.empty()) c.first = stamp.toSec();
        c.last = stamp.toSec();
        c.volts.push_back(Eigen::Map<const Vector6>(&block->volts[6 * k]));
        c.saturated.push_back(block->saturated[k]);
      }
      c.temperature = block->temperature;
    }
    if (c.failure.empty() && c.volts.size() < window_) return;
  }
  changed_.notify_all();
}

std::string CalibrationServerNode::unsettled(const Reading& reading, const Sensor& sensor) const {
  const SensorDescription& description = sensor.side == Side::kA ? set_.a : set_.b;
  SettlingLimits limits;
  limits.window = sensor.collector.volts.size();
  // a converter's steps are noise, too
  const double steps = description.lsb() * description.lsb() / 12.0;
  for (int k = 0; k < 6; ++k) {
    limits.noise[k] = std::sqrt(std::max(description.noise * description.noise + steps,
                                         reading.noise[k] * reading.noise[k]));
  }
  SettledWindow window(limits);
  for (const Vector6& volts : sensor.collector.volts) window.add(volts);
  const SettlingReport report = window.report();
  if (report.verdict != Settling::kSettled) {
    return "channel " + std::to_string(report.axis + 1) + " unsettled (" +
           toString(report.verdict) + "; sd " + format("%.3g V", reading.spread[report.axis]) +
           ", change " + format("%.3g V", report.change[report.axis]) + " in " +
           std::to_string(report.samples) + " samples)";
  }
  return unusable(reading, description);
}

std::optional<CalibrationServerNode::Refusal> CalibrationServerNode::read(
    Observation& observation, const std::array<bool, 2>& wanted, const ros::Time& from) {
  std::unique_lock<std::mutex> lock(mutex_);
  const Clock::time_point called = Clock::now();
  const auto stop = [&] {
    for (Sensor& sensor : sensors_) sensor.collector.active = false;
  };
  for (;;) {
    for (std::size_t i = 0; i < 2; ++i) {
      Collector& c = sensors_[i].collector;
      c.active = wanted[i];
      c.armed = !from.isZero();
      c.from = from;
      c.volts.clear();
      c.saturated.clear();
      c.failure.clear();
    }
    const Clock::time_point begun = Clock::now();
    const auto ready = [&] {
      for (std::size_t i = 0; i < 2; ++i) {
        if (wanted[i] && sensors_[i].collector.volts.size() < window_) return false;
      }
      return true;
    };
    while (!ready()) {
      std::optional<Refusal> refusal;
      if (stopping_) refusal = {"the server shuts down", false};
      if (in_action_ && action_->isPreemptRequested()) refusal = {"cancelled", false};
      for (std::size_t i = 0; i < 2 && !refusal; ++i) {
        const Collector& c = sensors_[i].collector;
        if (!wanted[i] || c.volts.size() == window_) continue;
        if (!c.failure.empty()) refusal = {sensors_[i].name + ": " + c.failure, true};
        if (Clock::now() - std::max(begun, c.heard.value_or(begun)) > source_timeout_) {
          refusal = {sensors_[i].name + ": no samples on " + sensors_[i].strain_sub.getTopic() +
                         " for " + format("%g s", source_timeout_.count()) + ": start its driver",
                     false};
        } else if (Clock::now() - begun > settle_timeout_ + source_timeout_ +
                                              Seconds(static_cast<double>(window_) * 1e-2)) {
          refusal = {sensors_[i].name + ": only " + std::to_string(c.volts.size()) + " of " +
                         std::to_string(window_) + " samples came: look at stamps and rate",
                     false};
        }
      }
      if (refusal) {
        stop();
        return refusal;
      }
      changed_.wait_for(lock, Seconds(kSlice));
    }
    stop();

    std::string reason;
    std::array<std::optional<Reading>, 2> readings;
    for (std::size_t i = 0; i < 2; ++i) {
      const Sensor& sensor = sensors_[i];
      const Collector& c = sensor.collector;
      if (!wanted[i]) continue;
      Reading reading =
          averageReading(c.volts, c.saturated, sensor.side == Side::kA ? set_.a : set_.b);
      reading.temperature = c.temperature;
      if (reading.saturated != 0) {
        return Refusal{sensor.name + ": channel " + channelText(reading.saturated) +
                           " saturated: take a smaller load",
                       false};
      }
      if (reason.empty()) {
        const std::string text = unsettled(reading, sensor);
        if (!text.empty()) reason = sensor.name + ": " + text;
      }
      readings[i] = reading;
    }
    const Collector &a = sensors_[0].collector, &b = sensors_[1].collector;
    if (reason.empty() && wanted[0] && wanted[1] && (a.last < b.first || b.last < a.first)) {
      reason = "sensor_a and sensor_b: readings " + format("%.3g s", std::abs(a.first - b.first)) +
               " apart, not of the same time: synchronise their clocks";
    }
    if (reason.empty()) {
      observation.a = readings[0];
      observation.b = readings[1];
      const Collector& c = wanted[0] ? a : b;
      observation.stamp = 0.5 * (c.first + c.last);
      return std::nullopt;
    }
    if (Clock::now() - called > settle_timeout_) {
      return Refusal{reason + " after " + format("%g s", settle_timeout_.count()) +
                         ": wait until nothing moves",
                     true};
    }
  }
}

// ---- observations ----

std::unique_lock<std::mutex> CalibrationServerNode::acquire() {
  std::unique_lock<std::mutex> busy(busy_, std::try_to_lock);
  if (busy) return busy;
  const std::lock_guard<std::mutex> lock(mutex_);
  throw InputError((in_action_ ? "the action calibrate" : std::string("another request")) +
                   " is under way: wait for its end" + (in_action_ ? ", or cancel it" : ""));
}

ObservationSet CalibrationServerNode::observations() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return set_;
}

void CalibrationServerNode::keep(const Observation& observation) {
  checkObservation(observation, set_, "observation");
  const std::string line = observationLine(observation);
  // as it will be after a restart, to the last bit
  const Observation kept = parseObservation(line, set_, "observation");
  journal_->append(line);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    set_.observations.push_back(kept);
    solution_.reset();
    last_id_ = kept.id;
    feedback_.observations = static_cast<std::uint32_t>(set_.observations.size());
  }
  publishStatus();
}

void CalibrationServerNode::startAnew() {
  ObservationSet empty = set_;
  empty.observations.clear();
  journal_->clear(observationHeader(empty));
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    set_.observations.clear();
    solution_.reset();
    last_id_.clear();
    feedback_.observations = 0;
  }
  publishStatus();
}

bool CalibrationServerNode::addObservation(AddObservation::Request& request,
                                           AddObservation::Response& response) {
  return answer(response, "add_observation", [&] {
    Observation o = fromMessage(request.test, "test");
    const std::unique_lock<std::mutex> busy = acquire();
    std::array<bool, 2> wanted = sidesOf(o);
    if (o.kind == ObservationKind::kUnloaded && !request.test.sensor.empty()) {
      if (request.test.sensor != "a" && request.test.sensor != "b") {
        throw InputError("sensor is '" + request.test.sensor + "': give a, b or nothing for both");
      }
      wanted = {request.test.sensor == "a", request.test.sensor == "b"};
    }
    if (const auto refusal = read(o, wanted, ros::Time())) throw InputError(refusal->reason);
    keep(o);
    response.success = true;
    response.observations = static_cast<std::uint32_t>(set_.observations.size());
    if (o.a) Vector6::Map(response.volts_a.data()) = o.a->volts;
    if (o.b) Vector6::Map(response.volts_b.data()) = o.b->volts;
    response.message = "observation " + std::to_string(response.observations) + " (" +
                       toString(o.kind) + ") of " + std::to_string(window_) + " samples is on disk";
  });
}

bool CalibrationServerNode::removeLast(std_srvs::Trigger::Request&,
                                       std_srvs::Trigger::Response& response) {
  return answer(response, "remove_last", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    journal_->removeLast();
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const Observation& last = set_.observations.back();
      response.message = "observation " + std::to_string(set_.observations.size()) + " (" +
                         toString(last.kind) + (last.id.empty() ? "" : ", " + last.id) +
                         ") removed";
      set_.observations.pop_back();
      solution_.reset();
      last_id_ = set_.observations.empty() ? "" : set_.observations.back().id;
    }
    response.success = true;
    publishStatus();
  });
}

bool CalibrationServerNode::reset(std_srvs::Trigger::Request&,
                                  std_srvs::Trigger::Response& response) {
  return answer(response, "reset", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    const std::size_t count = set_.observations.size();
    startAnew();
    response.success = true;
    response.message =
        std::to_string(count) + " observations put away to " + journal_->path() + ".previous";
  });
}

// ---- plan and solution ----

std::vector<LoadRequest> CalibrationServerNode::makeSteps(const std::string& plan,
                                                          std::uint32_t seed) const {
  const auto name = std::find(std::begin(kPlans), std::end(kPlans), plan);
  if (name == std::end(kPlans)) {
    throw InputError("plan is '" + plan +
                     "': give recommended, quadratic, displacement, thesis_fixed, thesis_shifted "
                     "or next");
  }
  ObservationSet empty = observations();
  empty.observations.clear();
  return makePlan(kPlanNames[name - std::begin(kPlans)], empty, rated_, seed == 0 ? 1 : seed,
                  zero_every_);
}

bool CalibrationServerNode::plan(PlanCalibration::Request& request,
                                 PlanCalibration::Response& response) {
  return answer(response, "plan", [&] {
    const std::string name = request.plan.empty() ? default_plan_ : request.plan;
    ObservationSet set = observations();
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

CalibrationServerNode::Solution CalibrationServerNode::solveAll(ForceSettings settings) const {
  Solution solution;
  std::array<Calibration, 2> maps;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    solution.set = set_;
    for (std::size_t i = 0; i < 2; ++i) {
      if (sensors_[i].in_force) maps[i] = *sensors_[i].in_force;
    }
  }
  const ObservationSet& set = solution.set;
  settings.rated = rated_;
  const auto any = [&](const auto& condition) {
    return std::any_of(set.observations.begin(), set.observations.end(), condition);
  };
  bool accepted = true, solved = false;
  std::string message;
  for (std::size_t i = 0; i < 2; ++i) {
    const Side side = sensors_[i].side;
    if (!any([&](const Observation& o) {
          return o.kind == ObservationKind::kDisplacement && o.side == side;
        })) {
      continue;
    }
    solution.displacement[i] = solveDisplacement(set, side);
    const DisplacementSolution& found = *solution.displacement[i];
    if (found.accepted) applyDisplacement(found, maps[i]);
    solved = true;
    accepted = accepted && found.accepted;
    message += (message.empty() ? "" : "; ") + sensors_[i].name + ": " + found.message;
  }
  if (any(isForceTest)) {
    if (!maps[0].volts_to_displacement.isZero(0.0)) settings.displacement_a = &maps[0];
    if (!maps[1].volts_to_displacement.isZero(0.0)) settings.displacement_b = &maps[1];
    solution.force = solveForce(set, settings);
    solution.result = toMessage(solution.force, set);
    solved = true;
    accepted = accepted && solution.force.accepted;
    message = solution.force.message + (message.empty() ? "" : "; ") + message;
  }
  if (!solved) {
    throw InputError(std::to_string(set.observations.size()) +
                     " observations, no loaded one: add reacting tests and weights (plan tells)");
  }
  if (solution.displacement[0]) {
    solution.result.displacement_a = toMessage(*solution.displacement[0]);
  }
  if (solution.displacement[1]) {
    solution.result.displacement_b = toMessage(*solution.displacement[1]);
  }
  solution.result.accepted = accepted;
  solution.result.message = message;
  return solution;
}

bool CalibrationServerNode::solve(SolveCalibration::Request& request,
                                  SolveCalibration::Response& response) {
  return answer(response, "solve", [&] {
    ForceSettings settings;
    if (request.procedure == "force_rows") {
      settings.procedure = ForceProcedure::kForceRows;
    } else if (request.procedure == "thesis") {
      settings.procedure = ForceProcedure::kThesis;
    } else if (!request.procedure.empty() && request.procedure != "all_rows") {
      throw InputError("procedure is '" + request.procedure +
                       "': give all_rows, force_rows or thesis");
    }
    if (request.model == "linear") {
      settings.model = StrainModel::kLinear;
    } else if (request.model == "quadratic") {
      settings.model = StrainModel::kQuadratic;
    } else if (!request.model.empty() && request.model != "automatic") {
      throw InputError("model is '" + request.model + "': give automatic, linear or quadratic");
    }
    const std::unique_lock<std::mutex> busy = acquire();
    Solution solution = solveAll(settings);
    response.result = solution.result;
    response.success = solution.result.accepted;
    response.message = solution.result.message;
    const std::lock_guard<std::mutex> lock(mutex_);
    solution_ = std::move(solution);
  });
}

// ---- calibrations ----

Calibration CalibrationServerNode::before(const Sensor& sensor) const {
  if (sensor.in_force) return *sensor.in_force;
  GetCalibration call;
  const std::string& serial = sensor.side == Side::kA ? set_.a.serial_number : set_.b.serial_number;
  const std::string name = nh_.resolveName(sensor.name + "/driver/get_calibration");
  if (set_drivers_ && ros::service::call(name, call) &&
      call.response.calibration.serial_number == serial) {
    return fromMessage(call.response.calibration, name);
  }
  return {};
}

std::string CalibrationServerNode::saveSolution(const std::string& wanted) {
  if (!solution_) throw InputError("nothing solved since the last observation: call solve");
  const Solution& solution = *solution_;
  if (!solution.result.accepted) throw InputError("not accepted: " + solution.result.message);
  std::string id = wanted;
  for (const Sensor& sensor : sensors_) {
    if (id.empty()) id = newCalibrationId(store_, sensor.name);
    if (fs::exists(calibrationPath(store_, sensor.name, id))) {
      throw InputError("id '" + id + "' is taken: give another; stored ones are never overwritten");
    }
  }
  std::array<std::optional<Calibration>, 2> calibrations;
  for (std::size_t i = 0; i < 2; ++i) {
    const Sensor& sensor = sensors_[i];
    const bool force = solution.result.tests > 0;
    if (!force && !solution.displacement[i]) continue;
    // what this solution doesn't tell stays as it was
    Calibration c = before(sensor);
    if (!force && c.volts_to_wrench.isZero(0.0)) {
      throw InputError(sensor.name +
                       " has a displacement but no wrench yet: calibrate the force, or load");
    }
    c.id = id;
    c.serial_number = sensor.side == Side::kA ? set_.a.serial_number : set_.b.serial_number;
    c.date = dateNow();
    if (force) applyForce(solution.force, solution.set, sensor.side, c);
    if (solution.displacement[i]) applyDisplacement(*solution.displacement[i], c);
    calibrations[i] = c;
  }
  for (std::size_t i = 0; i < 2; ++i) {
    if (calibrations[i]) {
      saveCalibration(*calibrations[i], calibrationPath(store_, sensors_[i].name, id));
    }
  }
  const std::string complaints = putInForce(calibrations);
  return id + complaints;
}

std::string CalibrationServerNode::putInForce(
    const std::array<std::optional<Calibration>, 2>& calibrations) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t i = 0; i < 2; ++i) {
      if (!calibrations[i]) continue;
      sensors_[i].in_force = calibrations[i];
      sensors_[i].in_force_since = ros::Time::now();
    }
  }
  writeInForce();
  std::string complaints;
  for (std::size_t i = 0; i < 2; ++i) {
    if (!calibrations[i]) continue;
    publishCalibration(sensors_[i]);
    if (!set_drivers_) continue;
    SetCalibration call;
    call.request.calibration = toMessage(*calibrations[i]);
    if (!ros::service::call(sensors_[i].driver_service, call)) {
      complaints += "; " + sensors_[i].driver_service + " isn't there: load again once it is";
    } else if (!call.response.success) {
      complaints += "; driver of " + sensors_[i].name + ": " + call.response.message;
    }
  }
  publishStatus();
  return complaints;
}

bool CalibrationServerNode::save(SaveCalibration::Request& request,
                                 SaveCalibration::Response& response) {
  return answer(response, "save", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    const std::string saved = saveSolution(request.id);
    response.success = true;
    response.id = saved.substr(0, saved.find(';'));
    response.message = "stored and in force: " + saved;
  });
}

Calibration CalibrationServerNode::loadStored(const Sensor& sensor, const std::string& id) const {
  const std::string path = calibrationPath(store_, sensor.name, id);
  if (!fs::exists(path)) {
    std::string known;
    for (const std::string& stored : storedCalibrations(store_, sensor.name)) {
      known += (known.empty() ? "" : ", ") + stored;
    }
    throw InputError(sensor.name + " has no calibration '" + id +
                     "' stored: give one of: " + (known.empty() ? "(none)" : known));
  }
  Calibration c = loadCalibration(path);
  const std::string& serial = sensor.side == Side::kA ? set_.a.serial_number : set_.b.serial_number;
  if (c.serial_number != serial) {
    throw InputError("calibration file '" + path + "' is of sensor '" + c.serial_number + "', " +
                     sensor.name + " is '" + serial + "': give one of its own");
  }
  if (c.id != id) {
    throw InputError("calibration file '" + path + "' holds calibration '" + c.id +
                     "': a file that was copied or renamed; give the original");
  }
  return c;
}

bool CalibrationServerNode::load(LoadCalibration::Request& request,
                                 LoadCalibration::Response& response) {
  return answer(response, "load", [&] {
    const std::unique_lock<std::mutex> busy = acquire();
    if (!request.sensor.empty() && request.sensor != "sensor_a" && request.sensor != "sensor_b") {
      throw InputError("sensor is '" + request.sensor.substr(0, 100) +
                       "': give sensor_a, sensor_b or nothing for both");
    }
    // all of them are whole before any comes in force
    std::array<std::optional<Calibration>, 2> calibrations;
    for (std::size_t i = 0; i < 2; ++i) {
      if (request.sensor.empty() || request.sensor == sensors_[i].name) {
        calibrations[i] = loadStored(sensors_[i], request.id);
      }
    }
    const std::string complaints = putInForce(calibrations);
    response.success = true;
    response.message = "in force: " + request.id + complaints;
  });
}

bool CalibrationServerNode::getCalibrations(GetCalibrations::Request&,
                                            GetCalibrations::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Sensor& sensor : sensors_) {
    if (!sensor.in_force) continue;
    SensorCalibration message = toMessage(*sensor.in_force);
    message.header.stamp = sensor.in_force_since;
    message.header.frame_id = sensor.name;
    response.calibrations.push_back(message);
    response.message += (response.message.empty() ? "" : "; ") + sensor.name + ": " +
                        sensor.in_force->id + " of " + sensor.in_force->date;
  }
  response.stored_a = storedCalibrations(store_, "sensor_a");
  response.stored_b = storedCalibrations(store_, "sensor_b");
  response.success = !response.calibrations.empty();
  if (!response.success) response.message = "none in force: solve and save, or load one";
  return true;
}

void CalibrationServerNode::writeInForce() const {
  std::string text;
  for (const Sensor& sensor : sensors_) {
    if (sensor.in_force) text += sensor.name + ": \"" + sensor.in_force->id + "\"\n";
  }
  const std::string path = store_ + "/in_force.yaml";
  writeFileAtomically(path, text, "file '" + path + "'");
}

// a file that is damaged is told and passed over: nothing is in force then
void CalibrationServerNode::readInForce() {
  const std::string path = store_ + "/in_force.yaml";
  if (!fs::exists(path)) return;
  for (Sensor& sensor : sensors_) {
    try {
      const YAML::Node root = YAML::LoadFile(path);
      if (!root.IsMap() || !root[sensor.name]) continue;
      sensor.in_force = loadStored(sensor, root[sensor.name].as<std::string>());
      sensor.in_force_since = ros::Time::now();
    } catch (const YAML::Exception& error) {
      ROS_WARN("file '%s': %s: load a calibration", path.c_str(), error.msg.c_str());
    } catch (const InputError& error) {
      ROS_WARN("nothing in force for %s: %s", sensor.name.c_str(), error.what());
    }
  }
}

void CalibrationServerNode::publishCalibration(Sensor& sensor) {
  SensorCalibration message = toMessage(*sensor.in_force);
  message.header.stamp = sensor.in_force_since;
  message.header.frame_id = sensor.name;
  sensor.calibration_pub.publish(message);
}

void CalibrationServerNode::publishStatus() {
  CalibrationStatus status;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    status.observations = static_cast<std::uint32_t>(set_.observations.size());
    status.last_id = last_id_;
    status.state = state_;
    if (sensors_[0].in_force) status.calibration_a = sensors_[0].in_force->id;
    if (sensors_[1].in_force) status.calibration_b = sensors_[1].in_force->id;
  }
  status.header.stamp = ros::Time::now();
  status_pub_.publish(status);
  publishObservations();
}

// The whole observation file, so that a bag's last message is the session: written out only for a
// subscriber, who gets it on connecting and after each change.
void CalibrationServerNode::publishObservations() {
  if (observations_pub_.getNumSubscribers() > 0) observations_pub_.publish(observationsMessage());
}

std_msgs::String CalibrationServerNode::observationsMessage() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std_msgs::String file;
  file.data = observationsText(set_);
  return file;
}

// ---- the action ----

bool CalibrationServerNode::cancelled() {
  return action_->isPreemptRequested() || !ros::ok() || stopping_;
}

void CalibrationServerNode::tell(const std::string& state, const std::string& message) {
  CalibrateSensorsFeedback feedback;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    feedback_.state = state;
    feedback_.message = message;
    feedback = feedback_;
  }
  action_->publishFeedback(feedback);
}

std::string CalibrationServerNode::stepByRig(const LoadRequest& step) {
  std::string reason;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    tell("loading", describe(step));
    ApplyLoad call;
    call.request.step = toMessage(step);
    const std::string name = nh_.resolveName(rig_);
    if (!ros::service::waitForService(name, ros::Duration(source_timeout_.count())) ||
        !ros::service::call(name, call)) {
      throw InputError("service " + name + " doesn't answer: start the rig, or set ~rig empty");
    }
    if (!call.response.success) return call.response.message;
    tell("averaging", step.target.id);
    Observation o = fromMessage(call.response.test, "rig");
    o.id = step.target.id;
    const auto refusal = read(o, sidesOf(o), call.response.since);
    if (!refusal) {
      keep(o);
      return {};
    }
    reason = refusal->reason;
    if (cancelled()) return reason;
    if (!refusal->again) break;
  }
  // a silent source ends the plan, a load that's too high only the step
  if (reason.find("no samples") != std::string::npos) throw InputError(reason);
  return reason;
}

std::string CalibrationServerNode::stepByPerson(const LoadRequest& step) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    awaited_ = step.target;
    waiting_ = Waiting::kOpen;
  }
  tell("waiting for confirmation", describe(step) + "; then call confirm");
  std::unique_lock<std::mutex> lock(mutex_);
  while (waiting_ == Waiting::kReading || (waiting_ == Waiting::kOpen && !cancelled())) {
    changed_.wait_for(lock, Seconds(kSlice));
  }
  const bool done = waiting_ == Waiting::kDone;
  waiting_ = Waiting::kNo;
  return done ? "" : "cancelled";
}

bool CalibrationServerNode::confirm(ConfirmLoad::Request& request,
                                    ConfirmLoad::Response& response) {
  return answer(response, "confirm", [&] {
    Observation o;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (waiting_ != Waiting::kOpen) {
        throw InputError(waiting_ == Waiting::kReading ? "another confirmation is being read"
                                                       : "no action waits for a load");
      }
      waiting_ = Waiting::kReading;
      o = awaited_;
    }
    // the action waits meanwhile, so that this thread may change the observations
    const auto finish = [&](Waiting next) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        waiting_ = next;
      }
      changed_.notify_all();
    };
    try {
      if (request.changed) {
        const std::string id = o.id;
        o = fromMessage(request.test, "test");
        o.id = id;
      }
      if (const auto refusal = read(o, sidesOf(o), ros::Time())) {
        throw InputError(refusal->reason);
      }
      keep(o);
    } catch (...) {
      finish(Waiting::kOpen);
      throw;
    }
    response.observations = static_cast<std::uint32_t>(observations().observations.size());
    response.success = true;
    response.message =
        "observation " + std::to_string(response.observations) + " (" + o.id + ") is on disk";
    finish(Waiting::kDone);
  });
}

CalibrateSensorsResult CalibrationServerNode::runPlan(const CalibrateSensorsGoal& goal) {
  CalibrateSensorsResult result;
  const std::string plan = goal.plan.empty() ? default_plan_ : goal.plan;
  const std::uint32_t seed = goal.seed == 0 ? 1 : goal.seed;
  if (plan.rfind("thesis", 0) == 0) {
    throw InputError("plan '" + plan + "' is for comparison: ask service plan what it lacks");
  }
  std::vector<LoadRequest> steps = makeSteps(plan, seed);
  if (goal.restart) startAnew();

  // what an interrupted run has left counts
  std::set<std::string> there;
  for (const Observation& o : set_.observations) there.insert(o.id);
  const std::string name = plan + "/" + std::to_string(seed) + "/";
  for (std::size_t i = 0; i < steps.size(); ++i) {
    steps[i].target.id = name + std::to_string(i + 1);
    result.resumed += there.count(steps[i].target.id) > 0;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    feedback_ = CalibrateSensorsFeedback();
    feedback_.steps = static_cast<std::uint32_t>(steps.size());
    feedback_.step = result.resumed;
    feedback_.observations = static_cast<std::uint32_t>(set_.observations.size());
  }
  if (result.resumed > 0) {
    ROS_INFO("calibrate: goes on after %u of %zu steps", result.resumed, steps.size());
  }

  std::vector<std::string> dropped;
  const auto run = [&](const LoadRequest& step) {
    const std::string reason = rig_.empty() ? stepByPerson(step) : stepByRig(step);
    if (cancelled()) return false;
    if (!reason.empty()) {
      dropped.push_back(step.target.id + ": " + reason);
      ROS_WARN("calibrate: step dropped: %s", dropped.back().c_str());
      if (static_cast<double>(dropped.size()) > max_dropped_ * static_cast<double>(steps.size())) {
        throw InputError(std::to_string(dropped.size()) + " steps dropped, the last one " +
                         dropped.back());
      }
    }
    return true;
  };
  // the zero may have moved since the last run
  const auto zero = std::find_if(steps.begin(), steps.end(), [](const LoadRequest& step) {
    return step.target.kind == ObservationKind::kUnloaded;
  });
  if (result.resumed > 0 && result.resumed < steps.size() && zero != steps.end()) {
    LoadRequest again = *zero;
    again.target.id = name + "zero/" + std::to_string(set_.observations.size() + 1);
    if (!run(again)) return result;
  }
  for (const LoadRequest& step : steps) {
    if (there.count(step.target.id) > 0) continue;
    if (cancelled() || !run(step)) return result;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++feedback_.step;
    }
    tell("averaging", step.target.id + " done");
  }

  tell("solving", std::to_string(set_.observations.size()) + " observations");
  Solution solution = solveAll(ForceSettings());
  result.result = solution.result;
  result.success = solution.result.accepted;
  result.message = solution.result.message;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    solution_ = std::move(solution);
  }
  if (result.success && !goal.dry_run && !cancelled()) {
    tell("saving", goal.id);
    const std::string saved = saveSolution(goal.id);
    result.id = saved.substr(0, saved.find(';'));
    result.message = "stored and in force: " + saved + "; " + result.message;
  }
  return result;
}

void CalibrationServerNode::calibrate(const CalibrateSensorsGoalConstPtr& goal) {
  CalibrateSensorsResult result;
  const std::unique_lock<std::mutex> busy(busy_, std::try_to_lock);
  if (!busy) {
    result.message = "another request is under way: try again";
    action_->setAborted(result, result.message);
    return;
  }
  const auto enter = [&](bool in_action) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      in_action_ = in_action;
      state_ = in_action ? "calibrate" : "idle";
    }
    publishStatus();
  };
  enter(true);
  bool failed = false;
  try {
    result = runPlan(*goal);
  } catch (const InputError& error) {
    failed = true;
    result.message = error.what();
  }
  enter(false);
  result.observations = static_cast<std::uint32_t>(observations().observations.size());
  if (cancelled() && !result.success) {
    result.message = "cancelled; " + std::to_string(result.observations) +
                     " observations are on disk: the same goal goes on from here";
    action_->setPreempted(result, result.message);
  } else if (failed || !result.success) {
    result.success = false;
    action_->setAborted(result, result.message);
  } else {
    action_->setSucceeded(result, result.message);
  }
}

}  // namespace assembly_cell::ros_bridge
