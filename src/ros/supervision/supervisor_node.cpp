// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/supervisor_node.h"

#include <chrono>
#include <cmath>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/align/search/press_controller.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/identification/mechanism_check.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/supervision/watched_plant.h"

namespace assembly_cell::ros_bridge {

namespace {

/// What is not known is 0 on the wire, never NaN.
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
  ROS_INFO_NAMED("align", "%s: %s", now.state.c_str(), now.message.c_str());
  return feedback;
}

}  // namespace

SupervisorNode::SupervisorNode(ros::NodeHandle& nh, ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  mechanism_ = loadMechanism(parameters.text("scenario"),
                             parameters.texts("overrides", std::vector<std::string>{}));
  readMechanism(parameters);
  X_CP_.p.z() = -mechanism_.peg.coupling_height - mechanism_.peg.half_height;

  AlignParameters& p = parameters_;
  parameters.read(fieldsOf(p));
  limits_.descent = p.descent_limit;
  limits_.approach_step = p.approach_step;
  const RosPlant::Settings plant = plantSettings(parameters, pnh.getNamespace());
  slow_factor_ = plant.slow_factor;
  parameters.refuseUnknown();
  try {
    checkParameters(p);
  } catch (const InputError& error) {
    throw InputError("parameters " + pnh.getNamespace() + ": " + error.what());
  }

  live_ = std::make_unique<LiveSettings>(pnh, liveValues(fieldsOf(p), "from the next goal on"),
                                         parameters.asked(), [this](const LiveValues& values) {
                                           AlignParameters wanted = parameters_;
                                           put(values, fieldsOf(wanted));
                                           checkParameters(wanted);
                                         });
  nh_ = nh;
  name_ = pnh.getNamespace();
  plant_ = std::make_unique<RosPlant>(nh, plant);
  startState(nh, pnh);
  report_pub_ = nh.advertise<AlignmentReport>("report", 1, true);
  align_server_ = std::make_unique<AlignServer>(
      nh, "align", [this](const AlignPegGoalConstPtr& goal) { executeAlign(goal); });
  assemble_server_ = std::make_unique<AssembleServer>(
      nh, "assemble", [this](const AssemblePegGoalConstPtr& goal) { executeAssemble(goal); });
  contact_server_ = std::make_unique<ContactServer>(
      nh, "move_to_contact",
      [this](const MoveToContactGoalConstPtr& goal) { executeContact(goal); });
  retreat_server_ = std::make_unique<RetreatServer>(
      nh, "retreat", [this](const RetreatGoalConstPtr& goal) { executeRetreat(goal); });
  align_server_->start();
  assemble_server_->start();
  contact_server_->start();
  retreat_server_->start();
}

SupervisorNode::~SupervisorNode() {
  plant_->stop();
  // their threads use the rest
  align_server_->shutdown();
  assemble_server_->shutdown();
  contact_server_->shutdown();
  retreat_server_->shutdown();
}

LiveValues SupervisorNode::takeLive() {
  const LiveValues values = live_->now();
  limits_.force = valueOf(values, "force_limit");
  return values;
}

AlignResult SupervisorNode::runStrategy(const std::string& name, AlignParameters parameters,
                                        const std::function<bool()>& cancelled,
                                        const std::function<void(const AlignProgress&)>& progress,
                                        AlignmentReport& answer) {
  const auto start = std::chrono::steady_clock::now();
  AlignResult result;
  const std::unique_lock<std::mutex> turn(busy_, std::try_to_lock);
  if (!turn) {
    result.reason = "busy: another action is running";
  } else {
    const ros::Time before = plant_->stamp();
    End end;
    try {
      put(takeLive(), fieldsOf(parameters));
      enter(name, true);
      const KnownMechanism* known = beginKnown(parameters.strategy, cancelled, progress);
      plant_->know(known);
      parameters.inserted = inserted();
      result = align(*plant_, mechanism_, known ? withDrive(parameters, known->drive) : parameters,
                     progress);
      if (result.success) left_in_ = {result.depth, plant_->carrierPose()};
      end.failed = !result.success;
      end.begun = end.failed && hasBegun(result.failure);
      end.failure = result.failure;
      end.reason = result.reason;
    } catch (...) {
      end = endOfException();
      result.success = false;
      result.reason = end.reason;
      result.contacts = end.contacts;
    }
    // the clock of a goal that never began is that of the one before
    if (result.time == 0.0 && plant_->stamp() != before) result.time = plant_->time();
    leave(end);
  }
  answer = report(result, secondsSince(start));
  if (turn) report_pub_.publish(answer);
  if (turn && result.known) {
    // where that peg has the hole, its rim at the height of the peg's edge
    const Pose X_PH = inverse(fromPose(answer.estimated_pose, "report"));
    frames_.send({transformStamped(kCarrierBaseFrame, kHoleEstimatedFrame,
                                   plant_->carrierPose() * X_CP_ * X_PH, answer.header.stamp)});
  }
  return result;
}

void SupervisorNode::executeAlign(const AlignPegGoalConstPtr& goal) {
  AlignParameters parameters = parameters_;
  if (!goal->strategy.empty()) parameters.strategy = goal->strategy;
  AlignPegResult answer;
  const AlignResult result = runStrategy(
      "align", parameters, [this] { return align_server_->isPreemptRequested(); },
      [this](const AlignProgress& now) {
        align_server_->publishFeedback(feedbackOf<AlignPegFeedback>(now));
      },
      answer.report);
  align_server_->finish(result.success, answer, result.reason);
}

void SupervisorNode::executeAssemble(const AssemblePegGoalConstPtr& goal) {
  AlignParameters parameters = parameters_;
  if (!goal->strategy.empty()) parameters.strategy = goal->strategy;
  parameters.insert.depth = goal->depth;
  parameters.insert.floor = goal->floor;
  AssemblePegResult answer;
  AlignResult result;
  if (goal->floor ? goal->depth != 0.0 || !std::isfinite(mechanism_.hole.depth)
                  : !(goal->depth > 0.0 && goal->depth < mechanism_.hole.depth)) {
    result.reason =
        text(goal->floor ? "depth is %g m with floor: give 0 and a hole with a depth, it has %g m"
                         : "depth is %g m: give more than 0 and less than the hole's, %g m",
             std::isnan(goal->depth) ? std::abs(goal->depth) : goal->depth, mechanism_.hole.depth);
    answer.report = report(result, 0.0);
  } else {
    result = runStrategy(
        "assemble", parameters, [this] { return assemble_server_->isPreemptRequested(); },
        [this](const AlignProgress& now) {
          auto feedback = feedbackOf<AssemblePegFeedback>(now);
          feedback.depth = finite(now.depth);
          feedback.force = finite(now.force);
          feedback.walls = static_cast<std::uint8_t>(now.walls);
          assemble_server_->publishFeedback(feedback);
        },
        answer.report);
  }
  answer.depth = finite(result.insert.end.depth);
  answer.force = finite(result.insert.force);
  answer.time = finite(result.insert.time);
  answer.backed_out = static_cast<std::uint32_t>(result.insert.backed_out);
  for (const BoreReading& felt : result.insert.profile) {
    answer.profile_depth.push_back(finite(felt.depth));
    answer.profile_along.push_back(finite(felt.along));
    answer.profile_sideways.push_back(finite(felt.sideways));
    answer.profile_moment.push_back(finite(felt.moment));
  }
  assemble_server_->finish(result.success, answer, result.reason);
}

AlignmentReport SupervisorNode::report(const AlignResult& result, double wall_time) const {
  AlignmentReport report;
  report.header.stamp = plant_->stamp();
  report.header.frame_id = kHoleFrame;
  if (result.reference_time > 0.0) report.reference = plant_->stampOf(result.reference_time);
  report.success = result.success;
  report.reason = result.reason;
  report.estimate_known = result.known;
  for (int i = 0; i < 2 && result.known; ++i) {
    const auto k = static_cast<std::size_t>(i);
    report.estimated_offset[k] = finite(result.offset(i));
    report.estimated_tilt[k] = finite(result.tilt(i));
  }
  report.contacts = static_cast<std::uint32_t>(result.contacts);
  report.simulated_time = finite(result.time);
  report.wall_time = wall_time;

  // the peg at the start as estimated, moved as the carrier has moved since
  const Eigen::Vector3d tilt(report.estimated_tilt[0], report.estimated_tilt[1], 0.0);
  const Pose X_HP_start{
      rotationFromVector({tilt}),
      Eigen::Vector3d(-report.estimated_offset[0], -report.estimated_offset[1], 0.0)};
  Pose X_HP = X_HP_start * inverse(X_CP_) * plant_->carrierMotion() * X_CP_;
  X_HP.p.z() = 0.0;
  report.estimated_pose = toPose(result.known ? X_HP : Pose());
  return report;
}

void SupervisorNode::executeContact(const MoveToContactGoalConstPtr& goal) {
  MoveToContactResult result;
  const double force = goal->force;
  const std::unique_lock<std::mutex> turn(busy_, std::try_to_lock);
  if (turn) takeLive();
  // what is held may be more by the tolerance
  const double most = limits_.force / (1.0 + parameters_.press_tolerance);
  if (!turn) {
    result.message = "busy: another action is running";
  } else if (!std::isfinite(force) || force <= 0.0 || force >= most) {
    result.message = "force is " + (std::isnan(force) ? "nan" : text("%g N", force)) +
                     text(
                         ": give more than 0 and less than %.4g N, ~force_limit less "
                         "~press_tolerance",
                         most);
  } else {
    End end;
    try {
      enter("move_to_contact", true);
      plant_->begin([this] { return contact_server_->isPreemptRequested(); });
      const GuardedCarrier* watched = nullptr;
      WatchedPlant plant(*plant_, [this, &watched](const PlantBlock& block) {
        MoveToContactFeedback feedback;
        // the controller's zero, as it shows in its last block
        if (watched != nullptr) {
          feedback.force = block.wrench_b(2) - watched->last().wrench_b(2) + watched->force().z();
        }
        feedback.z = block.carrier.z;
        contact_server_->publishFeedback(feedback);
      });
      GuardedCarrier carrier(plant, limits_);
      watched = &carrier;
      tareFreePeg(carrier, mechanism_);
      PressController press(carrier);
      if (const double least = press.minForce(parameters_.press_tolerance); force < least) {
        throw InputError(
            text("force is %g N: give at least %.2g N, less is lost in the steps of a press or the "
                 "scatter of sensor_b",
                 force, least));
      }
      if (!press.approach(carrier.target().z - limits_.descent)) {
        throw AlignError(AlignFailure::kNoContact,
                         text("none within %g m of descent", limits_.descent));
      }
      press.holdStill(force, parameters_.press_tolerance);
      result.success = true;
      result.force = carrier.force().z();
      result.message = "pressing";
      end.pressing = true;
      end.reason = text("move_to_contact presses with %.1f N", result.force);
    } catch (...) {
      end = endOfException();
      result.message = end.reason;
    }
    leave(end);
  }
  contact_server_->finish(result.success, result, result.message);
}

}  // namespace assembly_cell::ros_bridge
