// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/known_mechanism.h"

#include <actionlib/client/simple_action_client.h>
#include <std_msgs/String.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

#include "assembly_cell/IdentifyAction.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/identification/mechanism_check.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/node_watch.h"

namespace assembly_cell::ros_bridge {

namespace {

// Wall clock [s].
constexpr double kPollPeriod = 0.02;     // of the action's state
constexpr double kServerTimeout = 10.0;  // for the action's server
constexpr double kCancelTimeout = 10.0;  // for the answer to a cancel
constexpr double kProbePeriod = 1.0;     // between two checks that the node is running
constexpr double kReplyTimeout = 2.0;    // of the node to such a check

// The other strategies locate the hole by touch positions or wrenches.
bool needsMechanism(const std::string& strategy) {
  return strategy == "single_contact" || strategy == "double_contact" || strategy == "vibratory";
}

// False: not within `limit` of wall time, or cancelled.
template <class Condition>
bool waitUntil(double limit, const std::function<bool()>& cancelled, const Condition& condition) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(limit);
  while (!condition()) {
    if (!ros::ok() || cancelled() || ros::WallTime::now() > end) return false;
    ros::WallDuration(kPollPeriod).sleep();
  }
  return true;
}

}  // namespace

ros::Subscriber subscribeMechanism(ros::NodeHandle& nh,
                                   const std::function<void(const KnownMechanism&)>& callback) {
  using Event = ros::MessageEvent<std_msgs::String const>;
  constexpr std::size_t kMaxText = 1000000;  // [bytes]; a hundred times the usual length
  const std::string name = nh.resolveName(kMechanismTopic);
  const boost::function<void(const Event&)> receive = [name, callback](const Event& event) {
    const std::string& text = event.getConstMessage()->data;
    std::string why;
    if (text.size() > kMaxText) {
      why = "a text of " + std::to_string(text.size()) + " bytes";
    } else {
      try {
        const KnownMechanism known = parseKnownMechanism(text, name);
        if (known.accepted) {
          guarded(name, [&] { callback(known); });
          return;
        }
        why = "its identification says " + known.verdict;
      } catch (const InputError& error) {
        why = error.what();
      }
    }
    IncomingLog::ofThisProcess().refuse(name, event.getPublisherName(), why);
  };
  return nh.subscribe<std_msgs::String, const Event&>(kMechanismTopic, 1, receive);
}

void fields(FieldList& f, MechanismSettings& s) {
  f.text(
      "mechanism", s.mechanism,
      "Mechanism file of an identification, checked before each alignment; empty: the mechanism of "
      "the scenario, not checked.");
  f.flag("identify", s.identify,
         "Calls mechanism_identifier where a strategy needs the mechanism and no file is there, or "
         "the file is contradicted.");
  f.number("identify_time", s.identify_time, {5.0, 60.0, "s"},
           "Longest such identification, cell time.");
}

MechanismKeeper::MechanismKeeper(Parameters& parameters) {
  const std::string scenario = parameters.text("scenario");
  const auto overrides = parameters.texts("overrides", std::vector<std::string>{});
  mechanism_ = loadMechanism(scenario, overrides);
  scenario_ = printable(std::filesystem::path(scenario).stem().string());
  std::ostringstream content;
  content << std::ifstream(scenario, std::ios::binary).rdbuf();
  for (const std::string& change : overrides) content << '\n' << change;
  scenario_digest_ = crcText(content.str());
  parameters.read(fieldsOf(settings_));
  if (settings_.mechanism.empty()) return;
  KnownMechanism known = loadKnownMechanism(settings_.mechanism);
  if (!known.accepted) {
    throw InputError("~mechanism: value " + settings_.mechanism + ": its identification says " +
                     known.verdict + "; identify the mechanism again");
  }
  adopt(std::move(known));
}

void MechanismKeeper::connect(ros::NodeHandle& nh, RosPlant& plant, double slow_factor) {
  nh_ = nh;
  plant_ = &plant;
  slow_factor_ = slow_factor;
  sub_ = subscribeMechanism(nh_, [this](const KnownMechanism& known) {
    const std::lock_guard<std::mutex> lock(mutex_);
    latest_ = known;
  });
}

Pose MechanismKeeper::pegInCarrier() const {
  Pose X_CP;
  X_CP.p.z() = -mechanism_.peg.coupling_height - mechanism_.peg.half_height;
  return X_CP;
}

std::string MechanismKeeper::identity() const {
  Mechanism mechanism = mechanism_;
  RestPose rest;
  FieldList list;
  fields(list, mechanism, rest, false);
  return (known_ && known_->identified ? "identified " : "drawn ") + crcText(yamlText(list));
}

std::string MechanismKeeper::contradiction(bool is_inserted) {
  plant_->setMechanism(nullptr);
  if (!known_ || !known_->identified || is_inserted) return "";
  const MechanismCheck check = checkMechanism(*plant_, *known_);
  return check.agrees ? "" : check.message;
}

void MechanismKeeper::adopt(KnownMechanism known) {
  known_ = std::move(known);
  mechanism_ = known_->mechanism;
}

void MechanismKeeper::adoptLatest() {
  std::optional<KnownMechanism> latest;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    latest.swap(latest_);
  }
  if (latest) adopt(std::move(*latest));
}

const KnownMechanism* MechanismKeeper::begin(
    const std::string& strategy, const std::function<bool()>& cancelled,
    const std::function<void(const AlignProgress&)>& progress,
    const std::function<bool()>& is_inserted) {
  adoptLatest();
  const auto report = [&](const std::string& why) {
    AlignProgress now;
    now.state = "identify";
    now.message = why;
    progress(now);
  };
  const bool is_identified = known_ && known_->identified;
  if (settings_.identify && !is_identified && needsMechanism(strategy)) {
    report("no mechanism on file");
    identify(cancelled);
  }
  plant_->begin(cancelled);
  std::string wrong = contradiction(is_inserted());
  if (settings_.identify && !wrong.empty()) {
    report(wrong);
    plant_->end(false);
    identify(cancelled);
    plant_->begin(cancelled);
    wrong = contradiction(is_inserted());
  }
  if (!wrong.empty()) throw AlignError(AlignFailure::kWrongMechanism, wrong);
  return known_ && known_->identified ? &*known_ : nullptr;
}

void MechanismKeeper::identify(const std::function<bool()>& cancelled) {
  using Client = actionlib::SimpleActionClient<IdentifyAction>;
  Client client(nh_, "identify", false);
  const auto ended = [&] { return cancelled() || plant_->state().is_stopping; };
  const auto check_ended = [&] {
    if (plant_->state().is_stopping) {
      throw PlantError(AlignFailure::kStopped, "the node is shutting down");
    }
    if (cancelled()) throw PlantError(AlignFailure::kCancelled, "cancelled");
  };
  if (!waitUntil(kServerTimeout, ended, [&] { return client.isServerConnected(); })) {
    check_ended();
    throw PlantError(AlignFailure::kNoData,
                     text("no action server identify within %g s of wall time: is "
                          "mechanism_identifier running?",
                          kServerTimeout));
  }
  IdentifyGoal goal;
  goal.time_limit = settings_.identify_time;
  client.sendGoal(goal);
  const auto done = [&] { return client.getState().isDone(); };
  // the action ends by itself if the cell stops, but not if its process dies or freezes
  while (!waitUntil(kProbePeriod, ended, done) && !ended()) {
    const auto found =
        publishersOf({nh_.resolveName("identify/status")}, kReplyTimeout * slow_factor_);
    if (found.front().presence != NodePresence::kListening && !done()) {
      throw PlantError(AlignFailure::kNoData, "no result of identify: " + describe(found));
    }
  }
  if (!done()) {
    client.cancelGoal();
    waitUntil(
        kCancelTimeout, [] { return false; }, done);
    check_ended();
  }
  const IdentifyResultConstPtr result = client.getResult();
  if (!result || !result->accepted || result->file.empty()) {
    const std::string why = !result            ? client.getState().toString()
                            : result->accepted ? result->message
                                               : result->verdict;
    throw PlantError(AlignFailure::kNoReading, "identify of mechanism_identifier: " + why);
  }
  adopt(loadKnownMechanism(result->file));
}

}  // namespace assembly_cell::ros_bridge
