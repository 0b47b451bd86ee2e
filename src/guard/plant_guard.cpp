// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/guard/plant_guard.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "assembly_cell/base/text.h"
#include "assembly_cell/guard/freshness.h"

namespace assembly_cell {
namespace {

constexpr double kStamp = 1e-6;   // rounding of stamps [s]
constexpr double kForget = 1.0;   // a holder whose lease lapsed so long ago has none [s]
constexpr double kUnload = 1.1;   // of the present load, while it is being taken off
constexpr double kHeight = 1e-6;  // a move by more is one up [m]
constexpr char kBeyond[] = "%s: %s is %g %s, allowed are 0 to %g %s";

Verdict beyond(GuardReason reason, const char* what, double value, double limit, const char* unit) {
  return {reason, text(kBeyond, toString(reason), what, value, unit, limit, unit)};
}

Verdict refused(GuardReason reason, const std::string& why) {
  return {reason, std::string(toString(reason)) + ": " + why};
}

// may this sender command at all?
Verdict judgeSender(PlantGuard& guard, const Sender& sender, double now) {
  if (isOfEarlierLife(guard, sender, now)) {
    return refused(GuardReason::kEarlierLife,
                   "the command is older than this run of the plant: send it anew");
  }
  if (guard.mode == LeaseMode::kNone) return {};
  if (guard.holder.empty()) {
    if (guard.mode == LeaseMode::kAuto) return {};
    return refused(GuardReason::kNoLease, "nobody commands without a lease");
  }
  if (guard.holder != sender.node) {
    return refused(GuardReason::kHeldByAnother, guard.holder + " holds the plant");
  }
  if (!sender.stamped || !isFresh(sender.stamp, now - kStamp)) {
    return refused(GuardReason::kStale,
                   sender.stamped ? text("what led to the command is %.3f s old, at most %g s",
                                         now - sender.stamp, kFreshAge)
                                  : "a session's command needs the stamp of its last block");
  }
  guard.seen = std::max(guard.seen, sender.stamp);
  guard.lapsed = false;
  return {};
}

void endSession(PlantGuard& guard) {
  guard.holder.clear();
  guard.session = 0;
  guard.lapsed = false;
}

GuardAction stop(PlantGuard& guard, GuardReason reason) {
  guard.shaking = false;
  return {reason, true, true};
}

// a load that is being taken off may be above the limit, but not grow
void allowUnloading(PlantGuard& guard) {
  guard.overloaded = false;
  guard.allowed.force = std::max(guard.limits.force, kUnload * guard.load.force);
  guard.allowed.torque = std::max(guard.limits.torque, kUnload * guard.load.torque);
}

}  // namespace

const char* toString(GuardReason reason) {
  static constexpr const char* kNames[] = {
      "good",          "held_by_another", "no_lease",   "stale",        "earlier_life",
      "not_finite",    "frame_id",        "workspace",  "max_rotation", "max_amplitude",
      "max_frequency", "direction",       "overloaded", "lapsed",       "max_force",
      "max_torque",    "lone_exciter"};
  static_assert(std::size(kNames) == static_cast<std::size_t>(GuardReason::kCount));
  return kNames[static_cast<int>(reason)];
}

PlantGuard plantGuard(const GuardLimits& limits, LeaseMode mode, bool lockstep) {
  PlantGuard guard;
  guard.limits = limits;
  guard.mode = mode;
  guard.lockstep = lockstep;
  guard.allowed = {limits.force, limits.torque};
  return guard;
}

bool isOfEarlierLife(const PlantGuard& guard, const Sender& sender, double now) {
  if (!sender.stamped) return sender.latched;
  return guard.lockstep ? sender.stamp > now + kStamp : sender.stamp < -kStamp;
}

Verdict renewLease(PlantGuard& guard, const Sender& sender, std::uint32_t session, double now,
                   GuardAction& action) {
  if (guard.mode == LeaseMode::kNone) return {};
  const bool mine = guard.holder == sender.node && guard.session == session;
  if (session == 0) {
    if (guard.holder == sender.node) {
      action.exciter_off = guard.shaking;
      guard.shaking = false;
      endSession(guard);
    }
    return {};
  }
  if (!guard.holder.empty() && guard.holder != sender.node) {
    return refused(GuardReason::kHeldByAnother, guard.holder + " holds the plant");
  }
  if (isOfEarlierLife(guard, sender, now)) {
    return refused(GuardReason::kEarlierLife, "the lease is older than this run of the plant");
  }
  // late news are no sign of life
  if (!sender.stamped || now - sender.stamp >= guard.limits.lease_time - kStamp) {
    return refused(GuardReason::kStale, text("the lease knows the plant as of %.3f s ago",
                                             sender.stamped ? now - sender.stamp : now));
  }
  if (!mine) {
    guard.holder = sender.node;
    guard.session = session;
    // whatever somebody else began ends
    action.hold = action.exciter_off = true;
    guard.shaking = false;
    guard.seen = sender.stamp;
    allowUnloading(guard);
  }
  guard.seen = std::max(guard.seen, sender.stamp);
  guard.lapsed = false;
  return {};
}

Verdict judgeMove(PlantGuard& guard, const Sender& sender, const Pose& X, double now) {
  const GuardLimits& limits = guard.limits;
  if (!X.p.allFinite() || !X.R.allFinite()) {
    return refused(GuardReason::kNotFinite, "give finite numbers");
  }
  const Eigen::Vector3d way = X.p - guard.start.p;
  for (int i = 0; i < 3; ++i) {
    if (way(i) >= limits.box_min(i) && way(i) <= limits.box_max(i)) continue;
    return refused(GuardReason::kWorkspace,
                   text("%c is %g m from the start, allowed are %g to %g m", "xyz"[i], way(i),
                        limits.box_min(i), limits.box_max(i)));
  }
  const double angle = Eigen::AngleAxisd(guard.start.R.transpose() * X.R).angle();
  if (!(angle <= limits.rotation)) {
    return beyond(GuardReason::kRotation, "turn from the start", angle, limits.rotation, "rad");
  }
  Verdict verdict = judgeSender(guard, sender, now);
  if (!verdict.good() || !guard.overloaded) return verdict;
  if (X.p.z() < guard.height + kHeight) {
    return refused(GuardReason::kOverloaded, "the plant was stopped by its load: only up");
  }
  allowUnloading(guard);
  return {};
}

Verdict judgeExciter(PlantGuard& guard, const Sender& sender, const ExciterCommand& drive,
                     double now) {
  const GuardLimits& limits = guard.limits;
  if (!std::isfinite(drive.amplitude) || !std::isfinite(drive.frequency) ||
      !std::isfinite(drive.phase)) {
    return refused(GuardReason::kNotFinite,
                   text("amplitude %g, frequency %g, phase %g: give finite numbers",
                        drive.amplitude, drive.frequency, drive.phase));
  }
  // amplitude and frequency not negative, too
  if (!(drive.amplitude >= 0.0 && drive.amplitude <= limits.amplitude)) {
    return beyond(GuardReason::kAmplitude, "amplitude", drive.amplitude, limits.amplitude, "N");
  }
  if (!(drive.frequency >= 0.0 && drive.frequency <= limits.frequency)) {
    return beyond(GuardReason::kFrequency, "frequency", drive.frequency, limits.frequency, "rad/s");
  }
  if (drive.direction != 1 && drive.direction != -1) {
    return refused(GuardReason::kDirection, text("direction is %d: give 1 or -1", drive.direction));
  }
  if (drive.amplitude == 0.0) {
    guard.shaking = false;
    return {};
  }
  Verdict verdict = judgeSender(guard, sender, now);
  if (!verdict.good()) return verdict;
  if (guard.overloaded) {
    return refused(GuardReason::kOverloaded, "the plant was stopped by its load");
  }
  guard.shaking = true;
  guard.shaking_since = now;
  return {};
}

GuardAction watch(PlantGuard& guard, const Vector6& load, double height, double now) {
  guard.height = height;
  guard.load = {load.head<3>().norm(), load.tail<3>().norm()};
  Load& allowed = guard.allowed;
  allowed.force = std::clamp(kUnload * guard.load.force, guard.limits.force,
                             std::max(guard.limits.force, allowed.force));
  allowed.torque = std::clamp(kUnload * guard.load.torque, guard.limits.torque,
                              std::max(guard.limits.torque, allowed.torque));
  if (guard.holder.empty()) {
    const bool lone = guard.shaking && guard.mode != LeaseMode::kNone;
    if (!lone || now - guard.shaking_since < guard.limits.lone_exciter - kStamp) return {};
    guard.shaking = false;
    return {GuardReason::kLoneExciter, false, true};
  }
  const double silent = now - guard.seen;
  if (guard.lapsed) {
    if (silent >= kForget) endSession(guard);
    return {};
  }
  if (silent < guard.limits.lease_time - kStamp) return {};
  guard.lapsed = true;
  return stop(guard, GuardReason::kLapsed);
}

Verdict overload(PlantGuard& guard, const Vector6& load) {
  guard.overloaded = true;
  guard.shaking = false;
  const double force = load.head<3>().norm(), torque = load.tail<3>().norm();
  if (force > guard.allowed.force) {
    return beyond(GuardReason::kForce, "load of the coupling", force, guard.allowed.force, "N");
  }
  return beyond(GuardReason::kTorque, "load of the coupling", torque, guard.allowed.torque, "N m");
}

}  // namespace assembly_cell
