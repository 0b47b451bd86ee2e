// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_client.h"

#include <chrono>

#include "assembly_cell/AddContact.h"
#include "assembly_cell/BeginTwinForce.h"
#include "assembly_cell/SolveTwinForce.h"
#include "assembly_cell/TareTwinForce.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/ros/process/master_call.h"
#include "assembly_cell/ros/process/node_watch.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr char kNode[] = "twin_force_estimator";
constexpr int kAttempts = 2;           // of a call whose connection is lost
constexpr double kMasterAnswer = 0.2;  // [s wall]

TwinForceStatus statusOf(const std::string& name) {
  using Status = TwinForceStatus;
  for (const Status status :
       {Status::kOk, Status::kWeak, Status::kDegenerate, Status::kRefuse, Status::kRefuseTooFew,
        Status::kRefuseSingular, Status::kRefuseInconsistent}) {
    if (name == toString(status)) return status;
  }
  throw PlantError(AlignFailure::kNoData,
                   std::string(kNode) + " has a status '" + name + "' that is unknown");
}

}  // namespace

ContactTask contactTask(const TwinForceTask& task) {
  ContactTask out;
  out.reference_known = task.reference.has_value();
  out.reference = toPose(task.X_BS * task.reference.value_or(Pose{}));
  out.contact_force = task.contact_force;
  out.contact_tilt = task.contact_tilt;
  out.settled_force = task.settled_force;
  out.required_position = task.required_position;
  out.required_rotation = task.required_rotation;
  out.capacity = static_cast<std::uint32_t>(task.capacity);
  return out;
}

// Polls every few milliseconds; false after the time limit.
bool TwinForceClient::wait(double limit, const std::function<bool(double)>& ready) {
  using Clock = std::chrono::steady_clock;
  const auto deadline = Clock::now() + std::chrono::duration<double>(limit);
  while (!ready(0.02)) {
    if (!ros::ok()) throw PlantError(AlignFailure::kStopped, "the supervisor is shutting down");
    if (settings_.cancelled()) throw PlantError(AlignFailure::kCancelled, "cancelled");
    if (Clock::now() >= deadline) return false;
  }
  return true;
}

// A node that computes responds, a frozen one doesn't. An unregistered one may be starting, unless
// it was used before.
void TwinForceClient::lookForNode(const std::string& service, bool may_be_starting) const {
  const auto found = publishersOf({nh_.resolveName("twin_force/status")}, settings_.answer_within);
  const NodePresence presence = found.front().presence;
  if (presence == NodePresence::kListening) return;
  if (may_be_starting && presence == NodePresence::kUnknown) return;
  throw PlantError(
      AlignFailure::kNoData,
      text("no answer of service %s within %.3g s of wall time: %s", service.c_str() + 1,
           settings_.patience + settings_.answer_within, describe(found).c_str()));
}

bool TwinForceClient::waitUntilFree(double limit) {
  return wait(limit, [this](double patience) {
    return !call_.valid() ||
           call_.wait_for(std::chrono::duration<double>(patience)) == std::future_status::ready;
  });
}

// ROS waits for an answer as long as the connection is open: in another thread.
template <class Service>
std::optional<typename Service::Response> TwinForceClient::attempt(
    const std::string& service, const typename Service::Request& request) {
  struct Answer {
    Service service;
    bool good = false;
  };
  const auto answer = std::make_shared<Answer>();
  answer->service.request = request;
  ros::WallTime looked = ros::WallTime::now();
  if (!wait(settings_.timeout, [&](double patience) {
        if (callMaster("lookupService", service, kMasterAnswer)) return true;
        if ((ros::WallTime::now() - looked).toSec() > settings_.patience) {
          lookForNode(service, !begun_);
          looked = ros::WallTime::now();
        }
        ros::WallDuration(patience).sleep();
        return false;
      })) {
    throw PlantError(AlignFailure::kNoData,
                     text("no service %s within %g s of wall time: is it running?",
                          service.c_str() + 1, settings_.timeout));
  }
  call_ = std::async(std::launch::async,
                     [answer, service] { answer->good = callService(service, answer->service); });
  if (!waitUntilFree(settings_.patience)) lookForNode(service);
  if (!waitUntilFree(settings_.timeout)) {
    throw PlantError(AlignFailure::kNoData,
                     text("no answer of %s within %g s of wall time: is it alive?",
                          service.c_str() + 1, settings_.timeout));
  }
  if (!answer->good) return std::nullopt;
  return answer->service.response;
}

template <class Service>
typename Service::Response TwinForceClient::call(const std::string& name,
                                                 const typename Service::Request& request) {
  const std::string service = nh_.resolveName(std::string(kNode) + "/" + name);
  if (!waitUntilFree(settings_.timeout)) {
    throw PlantError(
        AlignFailure::kNoData,
        text("no answer of %s to an earlier call within %g s of wall time: is it alive?", kNode,
             settings_.timeout));
  }
  for (int k = 0; k < kAttempts; ++k) {
    if (k > 0) lookForNode(service);
    if (const auto response = attempt<Service>(service, request)) return *response;
  }
  throw PlantError(AlignFailure::kNoData,
                   text("service %s ended without an answer: is it running?", service.c_str() + 1));
}

template <class Request>
void TwinForceClient::fill(Request& request, const AveragingWindow& window) const {
  request.first = settings_.stamp_of(window.firstEnd());
  request.last = settings_.stamp_of(window.lastEnd());
  request.blocks = static_cast<std::uint32_t>(window.blocks());
}

void TwinForceClient::begin(const TwinForceTask& task) {
  BeginTwinForce::Request request;
  request.task = contactTask(task);
  const auto answer = call<BeginTwinForce>("begin", request);
  if (!answer.success)
    throw PlantError(AlignFailure::kNoData, std::string(kNode) + ": " + answer.message);
  state_ = TwinForceState();
  task_ = request.task;
  zero_blocks_ = 0;
  contacts_ = 0;
  begun_ = true;
}

// The strategy continues with the state of the node, which must be that of its calls.
void TwinForceClient::checkState(const TwinForceState& state) const {
  const auto complain = [](const std::string& what) {
    throw PlantError(AlignFailure::kNoData, std::string(kNode) + what +
                                                ": was it restarted, or does another client use "
                                                "it?");
  };
  if (state.contacts.size() != contacts_) {
    complain(text(" keeps %zu contacts of %zu that were made", state.contacts.size(), contacts_));
  }
  if (state.task != task_) complain(" keeps another task");
  if (contacts_ > 0 && state.contacts.back().zero_blocks < zero_blocks_) {
    complain(" has lost the zero");
  }
}

std::string TwinForceClient::complaint() const {
  const std::string service = nh_.resolveName(std::string(kNode) + "/solve");
  if (!begun_) return "";
  const NodePresence presence =
      publishersOf({nh_.resolveName("twin_force/status")}).front().presence;
  if (presence != NodePresence::kGone && presence != NodePresence::kUnknown) return "";
  return text(" (no service %s: is it running?)", service.c_str() + 1);
}

WindowAnswer TwinForceClient::tare(const AveragingWindow& free) {
  TareTwinForce::Request request;
  fill(request, free);
  const auto answer = call<TareTwinForce>("tare_window", request);
  if (answer.success) zero_blocks_ = request.blocks;
  return {answer.success ? "" : answer.message};
}

WindowAnswer TwinForceClient::add(const AveragingWindow& pressed) {
  AddContact::Request request;
  fill(request, pressed);
  const auto answer = call<AddContact>("add_contact", request);
  if (!answer.success) return {answer.message};
  const MessageCheck found = check(answer.status);
  if (answer.status.contacts.empty() || !found.good()) {
    throw PlantError(AlignFailure::kNoData,
                     std::string(kNode) + " answered without a contact " + found.text());
  }
  ++contacts_;
  checkState(answer.status);
  WindowAnswer out;
  out.signs_reversed = answer.status.signs == "reversed";
  out.force = Vector6::Map(answer.status.contacts.back().wrench_b.data()).head<3>().norm();
  return out;
}

TwinForceSolution TwinForceClient::solve() {
  state_ = call<SolveTwinForce>("solve", {}).status;
  if (const MessageCheck found = check(state_); !found.good()) {
    throw PlantError(AlignFailure::kNoData, std::string(kNode) + ": " + found.text());
  }
  checkState(state_);
  TwinForceSolution out;
  out.status = statusOf(state_.status);
  out.reason = state_.reason;
  if (hasPose(out.status) && !state_.pose_known) {
    out.status = TwinForceStatus::kRefuse;
    out.reason = "signs " + state_.signs;
  }
  out.X_HP = fromPose(state_.reference_pose.pose, kNode);
  out.covariance = Matrix6::Map(state_.reference_pose.covariance.data());
  out.chi2 = state_.chi2;
  out.dof = static_cast<int>(state_.dof);
  out.smallest_eigenvalue = state_.eigenvalues[0];
  return out;
}

ReachableContact TwinForceClient::advise() {
  if (!state_.advice_known) {
    throw PlantError(AlignFailure::kNoData, std::string(kNode) + " has no advice");
  }
  ReachableContact out;
  out.X_HP = fromPose(state_.advised_pose, kNode);
  out.force << state_.advised_force.x, state_.advised_force.y, state_.advised_force.z;
  out.pull << out.force.head<2>(), 0.0;
  out.smallest_eigenvalue = state_.advised_eigenvalue;
  out.position_sd = state_.advised_position_sd;
  out.rotation_sd = state_.advised_rotation_sd;
  return out;
}

}  // namespace assembly_cell::ros_bridge
