// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/estimation/twin_force_session.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/twin_force/contacts_file.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::size_t kMaxContacts = 300;  // of a task: the largest number that the strategy uses
constexpr double kUnknownVariance = 1e6;   // in messages, of what no contact determines
constexpr char kReversed[] = "one sensor reports the opposite sign: check its calibration";

template <class Array, class Source>
void copy(const Source& from, Array& to) {
  for (std::size_t i = 0; i < to.size(); ++i) {
    to[i] = std::isfinite(from.data()[i]) ? from.data()[i] : kUnknownVariance;
  }
}

double positive(double value, const char* name) {
  if (std::isfinite(value) && value > 0.0) return value;
  throw InputError(text("%s is %g: give a positive number", name, value));
}

// Whether both name the same blocks. Windows of coming blocks always differ.
bool same(const BlockWindow& one, const BlockWindow& other) {
  return one.isNamed() && one.first == other.first && one.last == other.last &&
         one.blocks == other.blocks;
}

const char* nameOf(SignVerdict verdict) {
  return verdict == SignVerdict::kRight      ? "right"
         : verdict == SignVerdict::kReversed ? "reversed"
                                             : "undecided";
}

}  // namespace

TwinForceTask fromMessage(const ContactTask& in) {
  TwinForceTask task;
  if (in.reference_known) task.reference = fromPose(in.reference, "reference");
  task.contact_force = positive(in.contact_force, "contact_force");
  task.contact_tilt = positive(in.contact_tilt, "contact_tilt");
  task.settled_force = positive(in.settled_force, "settled_force");
  task.required_position = positive(in.required_position, "required_position");
  task.required_rotation = positive(in.required_rotation, "required_rotation");
  task.capacity = in.capacity;
  if (task.capacity >= 2 && task.capacity <= kMaxContacts) return task;
  throw InputError(text("capacity is %zu: give 2 to %zu", task.capacity, kMaxContacts));
}

void TwinForceSession::begin(const TwinForceTask& task, const ContactTask& message) {
  contacts_.begin(task);
  task_ = message;
  origins_.clear();
  free_.reset();
  has_pose_ = false;
  advised_.reset();
}

// ---- windows ----

std::optional<std::string> TwinForceSession::tareAnswer(const BlockWindow& window) const {
  if (!free_ || !same(window, free_window_)) return std::nullopt;
  return text("zero from %d samples", free_->window.means().samples());
}

std::string TwinForceSession::tare(const BlockWindow& window,
                                   const TwinForceStreams::Average& average) {
  const WindowAnswer answer = contacts_.tare(average.window);
  if (!answer.refusal.empty()) throw InputError(answer.refusal);
  free_ = average;
  free_window_ = window;
  return text("zero from %d samples", free_->window.means().samples());
}

std::optional<std::string> TwinForceSession::addAnswer(const BlockWindow& window) const {
  const auto known = std::find_if(origins_.begin(), origins_.end(), [&](const Origin& origin) {
    const bool same_zero = origin.free && free_ ? origin.free->first == free_->first &&
                                                      origin.free->last == free_->last
                                                : !origin.free && !free_;
    return same_zero && same(origin.window, window);
  });
  if (known == origins_.end()) return std::nullopt;
  return known->answer;
}

std::string TwinForceSession::add(const BlockWindow& window,
                                  const TwinForceStreams::Average& average) {
  const WindowAnswer answer = contacts_.add(average.window);
  if (!answer.refusal.empty()) throw InputError(answer.refusal + ": call ~reset first");
  std::string message = text("contact %zu: %.2f N", origins_.size(), answer.force);
  if (answer.signs_reversed) {
    message += std::string("; ") + kReversed;
    ROS_ERROR("twin force: %s", kReversed);
  }
  origins_.push_back({average, free_, window, message});
  return message;
}

// ---- the pose ----

void TwinForceSession::solve(SolveTwinForce::Response& response) {
  has_pose_ = false;
  advised_.reset();
  try {
    const TwinForceSolution solution = contacts_.solve();
    response.message = toString(solution.status);
    if (!solution.reason.empty()) response.message += ": " + solution.reason;
    if (contacts_.signs() == SignVerdict::kReversed) {
      response.message = kReversed;
    } else if (assembly_cell::hasPose(solution.status)) {
      has_pose_ = true;
      advised_ = contacts_.advise();
    }
  } catch (const InputError& error) {
    response.message = error.what();
  }
  response.success = has_pose_;
  response.status = state();
  ContactsFile file;
  file.contacts = contacts_.contacts();
  file.prior = contacts_.options().prior;
  file.tare_covariance = contacts_.options().tare_covariance;
  file.errors = contacts_.options().errors;
  response.contacts = contactsYaml(file);
}

Pose TwinForceSession::pose(const TwinForceHistory::Now& now) const {
  return contacts_.pegPose(contacts_.carrierPose(now.carrier), now.displacement);
}

void TwinForceSession::setCovariance(const Pose& X_HP, boost::array<double, 36>& out) const {
  // that of the estimate refers to another point
  const TwinForceEstimate& e = contacts_.estimate();
  Matrix6 shift = Matrix6::Identity();
  shift.topRightCorner<3, 3>() = -skew(X_HP.p - e.pose.p);
  const bool observable = e.null_count == 0;
  copy(observable ? Matrix6(shift * e.covariance * shift.transpose()) : coordinateCovariance(e),
       out);
}

// ---- messages ----

FeltContact TwinForceSession::contactMessage(std::size_t i) const {
  const TwinContact& c = contacts_.contacts()[i];
  const TwinForceStreams::Average& pressed = origins_[i].pressed;
  FeltContact out;
  out.stamp = pressed.middle;
  copy(c.wrench_a, out.wrench_a);
  copy(c.wrench_b, out.wrench_b);
  copy(c.covariance_a, out.covariance_a);
  copy(c.covariance_b, out.covariance_b);
  out.move = toPose(c.move);
  if (c.move_covariance) copy(*c.move_covariance, out.move_covariance);
  copy(pressed.window.means().displacement(), out.deflection);
  out.samples = static_cast<std::uint32_t>(pressed.window.means().samples());
  out.time_difference = pressed.time_difference;
  out.window = {pressed.first, pressed.last};
  out.blocks = static_cast<std::uint32_t>(pressed.window.blocks());
  if (const auto& free = origins_[i].free) {
    out.zero_window = {free->first, free->last};
    out.zero_blocks = static_cast<std::uint32_t>(free->window.blocks());
  }
  return out;
}

TwinForceState TwinForceSession::state() const {
  TwinForceState out;
  out.header.frame_id = kHoleFrame;
  out.task = task_;
  const TwinForceEstimate& e = contacts_.estimate();
  out.status = toString(e.status);
  out.reason = e.reason;
  out.signs = nameOf(contacts_.signs());
  for (std::size_t i = 0; i < origins_.size(); ++i) {
    out.contacts.push_back(contactMessage(i));
    out.header.stamp = out.contacts.back().stamp;
  }
  for (auto* pose :
       {&out.pose.pose, &out.advised_move, &out.reference_pose.pose, &out.advised_pose}) {
    pose->orientation.w = 1.0;
  }
  if (has_pose_) setPose(out);
  return out;
}

void TwinForceSession::setPose(TwinForceState& out) const {
  const TwinForceEstimate& e = contacts_.estimate();
  out.pose_known = true;
  for (const int i : e.rejected) out.rejected.push_back(static_cast<std::uint32_t>(i));
  const AveragingWindow& last = origins_.back().pressed.window;
  const Pose X_HP =
      contacts_.pegPose(contacts_.carrierPose(last.carrier()), last.means().displacement());
  out.pose.pose = toPose(X_HP);
  copy(coordinateCovariance(e), out.pose.covariance);
  out.reference_pose.pose = toPose(e.pose);
  copy(e.covariance, out.reference_pose.covariance);
  out.chi2 = e.chi2;
  out.dof = static_cast<std::uint32_t>(e.dof);
  copy(e.eigenvalues, out.eigenvalues);
  copy(e.weak_direction, out.weak_direction);
  out.position_sd = std::sqrt(e.covariance.topLeftCorner<3, 3>().trace());
  out.rotation_sd = std::sqrt(e.covariance.bottomRightCorner<3, 3>().trace());
  if (!advised_) return;
  out.advice_known = true;
  out.advised_move = toPose(inverse(X_HP) * advised_->X_HP);
  out.advised_pose = toPose(advised_->X_HP);
  out.advised_force = toVector3(advised_->force);
  out.advised_eigenvalue = advised_->smallest_eigenvalue;
  if (std::isfinite(advised_->position_sd)) out.advised_position_sd = advised_->position_sd;
  if (std::isfinite(advised_->rotation_sd)) out.advised_rotation_sd = advised_->rotation_sd;
}

}  // namespace assembly_cell::ros_bridge
