// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/identifier_node.h"

#include <std_msgs/String.h>

#include <filesystem>
#include <vector>

#include "assembly_cell/base/date.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/identification/arm_response.h"
#include "assembly_cell/identification/fit.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "assembly_cell/ros/supervision/goal_runner.h"
#include "assembly_cell/ros/supervision/known_mechanism.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kMinTime = 5.0, kMaxTime = 60.0;  // of a goal's time_limit [s]

void setResult(const Mechanism& nominal, const Identification& found, IdentifyResult& result) {
  result.accepted = found.accepted;
  result.verdict = found.verdict;
  result.chi2 = found.chi2;
  result.dof = static_cast<std::uint32_t>(found.dof);
  result.p = found.p;
  result.notes = found.notes;
  for (int i = 0; i < kUnknowns; ++i) {
    result.parameters.push_back(found.unknowns[static_cast<std::size_t>(i)].name);
    result.values.push_back(valueAt(nominal, found.unknowns, i, found.z[i]));
    result.sds.push_back(sdAt(nominal, found.unknowns, i, found.z[i], found.sd(i)));
  }
  for (const int i : found.unseen) {
    result.unseen.push_back(found.unknowns[static_cast<std::size_t>(i)].name);
  }
}

}  // namespace

void fields(FieldList& f, IdentifierSettings& s) {
  f.text("scenario", s.scenario, "Scenario file: the drawing that the fit begins with.").required();
  f.text("file", s.file, "File for the result of a goal that names none; empty: not stored.");
  f.number("prior_scale", s.prior_scale, {0.1, 10.0},
           "Multiplies the standard deviations of a cell as drawn.");
  f.number("force_limit", s.force_limit, {1.0, 1000.0, "N"},
           "Contact force above which a goal ends.");
}

IdentifierNode::IdentifierNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  parameters.read(fieldsOf(settings_));
  mechanism_ =
      loadMechanism(settings_.scenario, parameters.texts("overrides", std::vector<std::string>{}));
  limits_.force = settings_.force_limit;
  PlantSettings plant;
  plant.node = pnh.getNamespace();
  parameters.read(fieldsOf(plant));
  parameters.refuseUnknown();
  plant_ = std::make_unique<RosPlant>(nh, plant);
  peg_ = std::make_unique<PegState>(pnh, [this] { return plant_->state().stamp; });
  mechanism_pub_ = nh.advertise<std_msgs::String>(kMechanismTopic, 1, true);
  supervisor_sub_ = subscribeChecked<SupervisorState>(
      nh, "assembly_supervisor/state", 10,
      [this](const SupervisorState::ConstPtr& message) { onSupervisor(*message); });
  refuseSecondServer(nh, "identify");
  server_ = std::make_unique<Server>(nh, "identify",
                                     [this](const IdentifyGoalConstPtr& goal) { execute(goal); });
  server_->start();
}

IdentifierNode::~IdentifierNode() {
  plant_->stop();
  server_->shutdown();
}

void IdentifierNode::stop() {
  plant_->stop();
  const std::lock_guard<std::mutex> turn(busy_);
}

void IdentifierNode::publish(const IdentificationProgress& now) {
  IdentifyFeedback feedback;
  feedback.state = now.state;
  feedback.time = now.time;
  feedback.readings = static_cast<std::uint32_t>(now.readings);
  server_->publishFeedback(feedback);
}

void IdentifierNode::identifyArmInto(const IdentifyGoal& goal, IdentifyResult& result) {
  if (goal.time_limit != 0.0) {
    throw InputError(
        text("time_limit is %g s: target arm takes about half a minute; give 0", goal.time_limit));
  }
  ArmPlan plan;
  plan.force_limit = limits_.force;
  checkArmPlan(mechanism_, plan);
  if (!goal.file.empty()) checkWritable(goal.file, "file '" + printable(goal.file, 200) + "'");
  plant_->begin([this] { return server_->isPreemptRequested(); });
  const ArmIdentification found =
      identifyArm(*plant_, mechanism_, plan, [this](const auto& now) { publish(now); });
  plant_->end(false);
  result.time = found.time;
  result.readings = static_cast<std::uint32_t>(found.points.size());
  result.parameters = {"arm.delay", "arm.stiffness"};
  result.values = {found.arm.delay, found.arm.stiffness};
  result.sds = {found.arm.delay_sd, found.arm.stiffness_sd};
  result.accepted = true;
  result.verdict = "accepted";
  result.message = armLine(found.arm);
  if (goal.file.empty()) return;
  Mechanism mechanism = mechanism_;
  mechanism.arm = found.arm;
  writeFileAtomically(goal.file, mechanismText(mechanism), goal.file);
  result.file = std::filesystem::absolute(goal.file).string();
}

void IdentifierNode::identifyInto(const IdentifyGoal& goal, IdentifyResult& result) {
  if (goal.target == "arm") return identifyArmInto(goal, result);
  if (!goal.target.empty() && goal.target != "mechanism") {
    throw InputError("target is '" + printable(goal.target, 50) + "': give mechanism or arm");
  }
  IdentificationPlan plan = planFor(mechanism_);
  plan.force_limit = limits_.force;
  if (goal.time_limit != 0.0) plan.time_limit = goal.time_limit;
  if (!(plan.time_limit >= kMinTime && plan.time_limit <= kMaxTime)) {
    throw InputError(text("time_limit is %g s: give %g to %g s, or 0 for the most", goal.time_limit,
                          kMinTime, kMaxTime));
  }
  const std::string file = goal.file.empty() ? settings_.file : goal.file;
  if (!file.empty()) checkWritable(file, "file '" + printable(file, 200) + "'");
  const auto progress = [this](const IdentificationProgress& now) { publish(now); };
  plant_->begin([this] { return server_->isPreemptRequested(); });
  const IdentificationData data = measure(*plant_, mechanism_, plan, progress);
  result.time = data.time;
  result.readings = static_cast<std::uint32_t>(data.vibrations.size());
  // the peg hangs where it did at the start
  plant_->end(false);
  setPeg("identify", false, "");
  progress({"fit", data.time, static_cast<int>(data.vibrations.size() + data.poses.size())});
  IdentificationPrior prior;
  prior.unknowns = unknownsAsDrawn(settings_.prior_scale);
  const Identification found = identify(mechanism_, data, prior);
  setResult(mechanism_, found, result);
  std_msgs::String record;
  record.data =
      mechanismRecord(mechanism_, found, "mechanism_identifier, " + settings_.scenario, utcNow());
  if (!file.empty()) {
    writeFileAtomically(file, record.data, file);
    result.file = std::filesystem::absolute(file).string();
  }
  if (found.accepted) mechanism_pub_.publish(record);
  result.message = file.empty() ? "not stored: no file was named" : "stored in " + result.file;
}

// What a goal of the supervisor has left, for a goal here that moves nothing.
void IdentifierNode::onSupervisor(const SupervisorState& supervisor) {
  peg_->update([&](SupervisorState& state) {
    if (supervisor.goal.empty() && state.goal.empty()) {
      state.in_contact = supervisor.in_contact;
      state.reason = supervisor.reason;
    }
    return false;
  });
}

void IdentifierNode::setPeg(const std::string& goal, bool in_contact, const std::string& reason) {
  peg_->update([&](SupervisorState& state) {
    state.goal = goal;
    state.in_contact = in_contact;
    state.reason = reason;
    return true;
  });
}

bool IdentifierNode::release(bool was_free) {
  const RosPlant::State plant = plant_->state();
  bool in_contact = plant.has_moved;
  try {
    if (plant.has_moved && plant.has_data) {
      freePeg(*plant_, {mechanism_, limits_}, was_free);
      in_contact = false;
    }
  } catch (const std::exception& error) {
    ROS_WARN("the peg could not be freed: %s", error.what());
  }
  plant_->end(in_contact);
  return !in_contact;
}

void IdentifierNode::execute(const IdentifyGoalConstPtr& goal) {
  IdentifyResult result;
  bool failed = false;
  const std::lock_guard<std::mutex> turn(busy_);
  const SupervisorState before = peg_->get();
  setPeg("identify", before.in_contact, before.reason);
  try {
    identifyInto(*goal, result);
    setPeg("", false, "");
  } catch (const std::exception& error) {
    failed = true;
    result.accepted = false;
    result.message = error.what();
    if (result.verdict.empty()) result.verdict = "refused: " + result.message;
    const bool moved = plant_->state().has_moved;
    const bool freed = release(!before.in_contact);
    // a goal that has moved nothing leaves the peg as it was
    const SupervisorState left = peg_->get();
    if (moved) setPeg("", !freed, freed ? "" : result.message);
    if (!moved) setPeg("", left.in_contact, left.reason);
  }
  server_->finish(result.accepted, result, failed ? result.message : result.verdict);
}

}  // namespace assembly_cell::ros_bridge
