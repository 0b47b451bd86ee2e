// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/supervisor_node.h"

#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/align/search/press_controller.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/identification/mechanism_check.h"
#include "assembly_cell/records/align_record.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "assembly_cell/ros/records/record_messages.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr char kBusy[] = "busy: another action is running";
const std::string kMessages =
    std::string("AssemblePegAction ") + ros::message_traits::MD5Sum<AssemblePegAction>::value() +
    ", AssemblyRecord " + ros::message_traits::MD5Sum<AssemblyRecord>::value();

// In messages an unknown number is 0, never NaN.
double finite(double value) { return std::isfinite(value) ? value : 0.0; }

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

template <class Feedback>
Feedback feedbackOf(const AlignProgress& now) {
  Feedback feedback;
  feedback.state = now.state;
  feedback.contacts = static_cast<std::uint32_t>(now.contacts);
  feedback.time = finite(now.time);
  feedback.message = now.message;
  feedback.position_sd = finite(now.position_sd);
  feedback.rotation_sd = finite(now.rotation_sd);
  feedback.clearance = finite(now.clearance);
  feedback.clearance_sd = finite(now.clearance_sd);
  ROS_INFO_NAMED("align", "%s: %s", now.state.c_str(), now.message.c_str());
  return feedback;
}

// X_CP: peg in the carrier, at rest.
AlignmentReport reportOf(const AlignResult& result, double wall_time, const RosPlant::State& plant,
                         const Pose& X_CP) {
  AlignmentReport report;
  report.header.stamp = plant.stamp;
  report.header.frame_id = kHoleFrame;
  if (result.reference_time > 0.0) {
    report.reference = plant.origin + ros::Duration(result.reference_time);
  }
  report.success = result.success;
  report.reason = result.reason;
  report.estimate_known = result.known;
  for (int i = 0; i < 2 && result.known; ++i) {
    const auto k = static_cast<std::size_t>(i);
    report.estimated_offset[k] = finite(result.offset(i));
    report.estimated_tilt[k] = finite(result.tilt(i));
  }
  if (result.known) {
    report.clearance = finite(result.clearance.mean);
    report.clearance_sd = finite(result.clearance.sd);
  }
  report.contacts = static_cast<std::uint32_t>(result.contacts);
  report.simulated_time = finite(result.time);
  report.wall_time = wall_time;

  // the peg at the start as estimated, moved as the carrier has moved since
  const Eigen::Vector3d tilt(report.estimated_tilt[0], report.estimated_tilt[1], 0.0);
  const Pose X_HP_start{
      rotationFromVector({tilt}),
      Eigen::Vector3d(-report.estimated_offset[0], -report.estimated_offset[1], 0.0)};
  const Pose motion = inverse(plant.start) * plant.carrier;
  Pose X_HP = X_HP_start * inverse(X_CP) * motion * X_CP;
  X_HP.p.z() = 0.0;
  report.estimated_pose = toPose(result.known ? X_HP : Pose());
  return report;
}

template <class Server, class Goal>
StrategyGoal strategyGoal(const std::string& name, const Server& server, const Goal& goal,
                          const AlignParameters& parameters) {
  StrategyGoal out;
  out.name = name;
  if (const auto current = server.goals().current()) out.id = current->getGoalID().id;
  out.serial = goal.serial;
  out.program = goal.program;
  out.parameters = parameters;
  if (!goal.strategy.empty()) out.parameters.strategy = goal.strategy;
  out.preempted_by = [&server] { return server.goals().preemptedBy(); };
  return out;
}

// Without its header and start, and without events.
AssemblyRecord recordOf(const AlignResult& result, const StrategyGoal& goal,
                        const MechanismKeeper& mechanism) {
  Run run;
  describe(result, goal.parameters, run);
  run.serial = goal.serial;
  run.program = goal.program;
  run.program_hash = mechanism.scenarioDigest();
  run.versions["package"] = packageBuild();
  run.versions["messages"] = kMessages;
  run.calibrations["mechanism"] = mechanism.identity();
  AssemblyRecord out = toMessage(run);
  out.goal_id = goal.id;
  out.scenario = mechanism.scenario();
  return out;
}

// A peg that is free by its load may be in the hole: unless it is known to be out, its walls show
// that, and it is taken out.
void showOutside(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                 InsertedPeg& peg) {
  if (!peg.known && withdraw(plant, mechanism, parameters)) {
    ROS_INFO("the peg was in the hole, and is out of it");
  }
  peg = {0.0, Pose(), true};
}

void requireHoldable(double force, double min_force) {
  if (force >= min_force) return;
  throw InputError(
      text("force is %g N: give at least %g N, less is lost in the steps of a press or "
           "the scatter of sensor_b",
           force, std::ceil(1e3 * min_force) / 1e3));
}

template <class Node, class Spec, class Goal>
void startServer(ros::NodeHandle& nh, const std::string& name, Node* node,
                 void (Node::*execute)(const Goal&),
                 std::unique_ptr<CheckedActionServer<Spec>>& server) {
  refuseSecondServer(nh, name);
  server = std::make_unique<CheckedActionServer<Spec>>(
      nh, name, [node, execute](const Goal& goal) { (node->*execute)(goal); });
  server->start();
  // both may have started at once
  refuseSecondServer(nh, name);
}

}  // namespace

SupervisorNode::SupervisorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  mechanism_ = std::make_unique<MechanismKeeper>(parameters);
  parameters.read(fieldsOf(parameters_));
  limits_.descent = parameters_.descent_limit;
  limits_.approach_step = parameters_.approach_step;
  PlantSettings plant;
  plant.node = pnh.getNamespace();
  parameters.read(fieldsOf(plant));
  RecordSettings record;
  parameters.read(fieldsOf(record));
  parameters.refuseUnknown();
  try {
    checkParameters(parameters_);
  } catch (const InputError& error) {
    throw InputError("parameters " + plant.node + ": " + error.what());
  }

  live_ = std::make_unique<LiveSettings>(pnh,
                                         liveValues(fieldsOf(parameters_), "from the next goal on"),
                                         parameters.known(), [this](const LiveValues& values) {
                                           AlignParameters wanted = parameters_;
                                           put(values, fieldsOf(wanted));
                                           checkParameters(wanted);
                                         });
  plant_ = std::make_unique<RosPlant>(nh, plant);
  mechanism_->connect(nh, *plant_, plant.slow_factor);
  peg_ = std::make_unique<PegState>(
      pnh, [this] { return plant_->state().stamp; }, false);
  peg_monitor_ = std::make_unique<PegMonitor>(nh, plant.node, *peg_);
  goals_ = std::make_unique<GoalRunner>(*plant_, *peg_);
  if (record.record != RecordSettings::Mode::kOff) {
    recorder_ = std::make_unique<RunRecorder>(nh, record, plant.slow_factor);
  }
  report_pub_ = nh.advertise<AlignmentReport>("report", 1, true);
  startServer(nh, "align", this, &SupervisorNode::executeAlign, servers_.align);
  startServer(nh, "assemble", this, &SupervisorNode::executeAssemble, servers_.assemble);
  startServer(nh, "move_to_contact", this, &SupervisorNode::executeContact, servers_.contact);
  startServer(nh, "retreat", this, &SupervisorNode::executeRetreat, servers_.retreat);
}

SupervisorNode::~SupervisorNode() {
  plant_->stop();
  // their threads use the rest
  servers_.align->shutdown();
  servers_.assemble->shutdown();
  servers_.contact->shutdown();
  servers_.retreat->shutdown();
}

void SupervisorNode::stop() {
  plant_->stop();
  goals_->wait();
}

void SupervisorNode::takeLive(AlignParameters& parameters) {
  put(live_->now(), fieldsOf(parameters));
  limits_.force = parameters.force_limit;
}

AlignResult SupervisorNode::runStrategy(const StrategyGoal& goal, AlignmentReport& report) {
  const auto start = std::chrono::steady_clock::now();
  const ros::WallTime wall_start = ros::WallTime::now();
  AlignResult result;
  GoalEnd end;
  StrategyGoal live = goal;
  const std::unique_lock<std::mutex> turn = goals_->tryLock();
  if (!turn) {
    result.reason = kBusy;
  } else {
    takeLive(live.parameters);
    const auto cancelled = [&] { return !goal.preempted_by().empty(); };
    const auto progress = [&](const AlignProgress& now) {
      if (recorder_) recorder_->add(now);
      goal.progress(now);
    };
    const auto depth = [this] { return inserted_.depthAt(plant_->state().carrier); };
    end = goals_->run(goal.name, true, {mechanism_->mechanism(), limits_}, [&](GoalEnd& out) {
      if (recorder_) recorder_->begin();
      AlignParameters parameters = live.parameters;
      const KnownMechanism* known = mechanism_->begin(parameters.strategy, cancelled, progress,
                                                      [&] { return depth() > 0.0; });
      plant_->setMechanism(known);
      parameters.inserted = depth();
      result = align(*plant_, mechanism_->mechanism(),
                     known ? withDrive(parameters, known->drive) : parameters,
                     [&](const AlignProgress& now) {
                       out.shown = out.shown || now.state == AlignProgress::kOutside;
                       progress(now);
                     });
      if (result.success) {
        inserted_ = {result.depth, plant_->state().carrier, result.depth > 0.0};
      }
      out.failed = !result.success;
      out.begun = out.failed && goals_->hasBegun(result.failure);
      out.failure = result.failure;
      out.contacts = result.contacts;
      out.reason = result.reason;
    });
    if (end.failed) inserted_.known = !end.stuck && (inserted_.known || end.shown);
    result.success = !end.failed;
    result.failure = end.failure;
    result.reason = end.reason;
    result.contacts = end.contacts;
    if (result.time == 0.0) result.time = end.time;
  }
  const RosPlant::State plant = plant_->state();
  const Pose X_CP = mechanism_->pegInCarrier();
  report = reportOf(result, secondsSince(start), plant, X_CP);
  if (!turn) return result;
  // a goal that was refused or cancelled before it moved anything is no run
  if (recorder_ && (end.begun || !end.failed)) {
    AssemblyRecord run = recordOf(result, live, *mechanism_);
    run.start = ros::Time(wall_start.sec, wall_start.nsec);
    run.header = report.header;
    recorder_->store(run, plant.origin, goal.preempted_by(), result, report);
  }
  report_pub_.publish(report);
  if (result.known) {
    // hole as estimated from that peg, its rim at the height of the peg's edge
    const Pose X_PH = inverse(fromPose(report.estimated_pose, "report"));
    frames_.send({transformStamped(kCarrierBaseFrame, kHoleEstimatedFrame,
                                   plant.carrier * X_CP * X_PH, report.header.stamp)});
  }
  return result;
}

void SupervisorNode::executeAlign(const AlignPegGoalConstPtr& request) {
  StrategyGoal goal = strategyGoal("align", *servers_.align, *request, parameters_);
  goal.progress = [this](const AlignProgress& now) {
    servers_.align->publishFeedback(feedbackOf<AlignPegFeedback>(now));
  };
  AlignPegResult answer;
  const AlignResult result = runStrategy(goal, answer.report);
  servers_.align->finish(result.success, answer, result.reason);
}

void SupervisorNode::executeAssemble(const AssemblePegGoalConstPtr& request) {
  StrategyGoal goal = strategyGoal("assemble", *servers_.assemble, *request, parameters_);
  const double depth = request->depth;
  goal.parameters.insert.depth = depth;
  goal.parameters.insert.floor = request->floor;
  goal.progress = [this](const AlignProgress& now) {
    auto feedback = feedbackOf<AssemblePegFeedback>(now);
    feedback.depth = finite(now.depth);
    feedback.force = finite(now.force);
    feedback.axial = finite(now.axial);
    feedback.walls = static_cast<std::uint8_t>(now.walls);
    servers_.assemble->publishFeedback(feedback);
  };
  AssemblePegResult answer;
  AlignResult result;
  const double hole = mechanism_->mechanism().hole.depth;
  if (request->floor ? depth != 0.0 || !std::isfinite(hole) : !(depth > 0.0 && depth < hole)) {
    result.reason = text(
        request->floor ? "depth is %g m with floor: give 0 and a hole with a depth, it has %g m"
                       : "depth is %g m: give more than 0 and less than the hole's, %g m",
        std::isnan(depth) ? std::abs(depth) : depth, hole);
    answer.report = reportOf(result, 0.0, plant_->state(), mechanism_->pegInCarrier());
  } else {
    result = runStrategy(goal, answer.report);
  }
  answer.depth = finite(result.insert.end.depth);
  answer.force = finite(result.insert.force);
  answer.time = finite(result.insert.time);
  answer.backed_out = static_cast<std::uint32_t>(result.insert.backed_out);
  for (const BoreReading& reading : result.insert.profile) {
    answer.profile_depth.push_back(finite(reading.depth));
    answer.profile_along.push_back(finite(reading.along));
    answer.profile_sideways.push_back(finite(reading.sideways));
    answer.profile_moment.push_back(finite(reading.moment));
  }
  servers_.assemble->finish(
      result.success, answer,
      result.insert.seated ? text("seated: %.2f mm deep", answer.depth * 1e3) : result.reason);
}

void SupervisorNode::executeContact(const MoveToContactGoalConstPtr& goal) {
  MoveToContactResult result;
  const double force = goal->force, tolerance = parameters_.press_tolerance;
  const std::unique_lock<std::mutex> turn = goals_->tryLock();
  AlignParameters parameters = parameters_;
  if (turn) takeLive(parameters);
  // the force may exceed its setpoint by the tolerance
  const double max_force = limits_.force / (1.0 + tolerance);
  if (!turn) {
    result.message = kBusy;
  } else if (!std::isfinite(force) || force <= 0.0 || force >= max_force) {
    result.message = "force is " + (std::isnan(force) ? "nan" : text("%g N", force)) +
                     text(
                         ": give more than 0 and less than %.4g N, ~force_limit less "
                         "~press_tolerance",
                         max_force);
  } else {
    const Mechanism& mechanism = mechanism_->mechanism();
    const GoalEnd end =
        goals_->run("move_to_contact", true, {mechanism, limits_}, [&](GoalEnd& out) {
          plant_->begin([this] { return servers_.contact->isPreemptRequested(); });
          const GuardedCarrier* guarded = nullptr;
          ObservedPlant plant(*plant_, [&](const PlantBlock& block) {
            MoveToContactFeedback feedback;
            // the zero is subtracted, as in the carrier's latest block
            if (guarded != nullptr) {
              feedback.force =
                  block.wrench_b(2) - guarded->last().wrench_b(2) + guarded->force().z();
            }
            feedback.z = block.carrier.z;
            servers_.contact->publishFeedback(feedback);
          });
          if (!inserted_.known) {
            GuardedCarrier still(plant, limits_);
            still.tare();
            requireHoldable(force, PressController(still).minForce(tolerance));
            tareFreePeg(still, mechanism);
            showOutside(plant, mechanism, parameters_, inserted_);
            out.shown = true;
          }
          GuardedCarrier carrier(plant, limits_);
          guarded = &carrier;
          tareFreePeg(carrier, mechanism);
          PressController press(carrier);
          requireHoldable(force, press.minForce(tolerance));
          if (!press.approach(carrier.target().z - limits_.descent)) {
            throw AlignError(AlignFailure::kNoContact,
                             text("none within %g m of descent", limits_.descent));
          }
          press.holdStill(force, tolerance);
          result.force = carrier.force().z();
          out.pressing = true;
          out.reason = text("move_to_contact presses with %.1f N", result.force);
        });
    result.success = !end.failed;
    result.message = end.failed ? end.reason : "pressing";
  }
  servers_.contact->finish(result.success, result, result.message);
}

void SupervisorNode::executeRetreat(const RetreatGoalConstPtr&) {
  RetreatResult result;
  const std::unique_lock<std::mutex> turn = goals_->tryLock();
  if (!turn) {
    result.message = kBusy;
  } else {
    AlignParameters live = parameters_;
    takeLive(live);
    const Mechanism& mechanism = mechanism_->mechanism();
    const GoalEnd end = goals_->run("retreat", false, {mechanism, limits_}, [&](GoalEnd& out) {
      out.freed = true;
      plant_->begin([this] { return servers_.retreat->isPreemptRequested(); });
      std::optional<Vector6> first;
      ObservedPlant plant(*plant_, [&](const PlantBlock& block) {
        if (!first) first = block.wrench_b;
        RetreatFeedback feedback;
        feedback.force = (block.wrench_b - *first).head<3>().norm();
        servers_.retreat->publishFeedback(feedback);
        result.z = block.carrier.z;
      });
      AlignParameters parameters = parameters_;
      parameters.inserted = inserted_.depthAt(plant_->state().carrier);
      if (parameters.inserted > 0.0) {
        withdraw(plant, mechanism, parameters);
        inserted_ = {0.0, Pose(), true};
      }
      {
        GuardedCarrier carrier(plant, limits_);
        releasePeg(carrier, mechanism);
      }
      showOutside(plant, mechanism, parameters_, inserted_);
      out.reason = "free";
    });
    result.success = !end.failed;
    result.message = end.reason;
  }
  servers_.retreat->finish(result.success, result, result.message);
}

}  // namespace assembly_cell::ros_bridge
