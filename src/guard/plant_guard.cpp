// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/guard/plant_guard.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "assembly_cell/base/text.h"
#include "assembly_cell/guard/freshness.h"

namespace assembly_cell {
namespace {

constexpr double kStamp = 1e-6;     // rounding of stamps [s]
constexpr double kForget = 1.0;     // from the expiry of a lease to the end of ownership [s]
constexpr double kUnload = 1.1;     // allowed fraction of the present load while it is relieved
constexpr double kHeight = 1e-6;    // smallest move up [m]
constexpr double kMinSpeed = 1e-3;  // [m/s]
// Stopping distance of planStop() as a fraction of v²/a: 0.75 at full speed, up to 0.79 while still
// accelerating.
constexpr double kStopWay = 0.8;
constexpr char kBeyond[] = "%s: %s is %g %s, allowed are 0 to %g %s";

GuardVerdict beyond(GuardReason reason, const char* what, double value, double limit,
                    const char* unit) {
  return {reason, text(kBeyond, toString(reason), what, value, unit, limit, unit)};
}

GuardVerdict refused(GuardReason reason, const std::string& why) {
  return {reason, std::string(toString(reason)) + ": " + why};
}

// A stamp from the future renews the lease no longer than one of now.
void renewUntil(PlantGuard& guard, const Sender& sender, double now) {
  guard.seen = std::max(guard.seen, std::min(sender.stamp, now));
  guard.expired = false;
}

// May this sender command?
GuardVerdict checkSender(PlantGuard& guard, const Sender& sender, double now) {
  if (isFromEarlierBoot(guard, sender, now)) {
    return refused(GuardReason::kEarlierBoot,
                   "the command is older than this run of the plant: send it again");
  }
  if (guard.mode == LeaseMode::kNone) return {};
  if (guard.owner.empty()) {
    if (guard.mode == LeaseMode::kAuto) return {};
    return refused(GuardReason::kNoLease, "commands need a lease");
  }
  if (guard.owner != sender.node) {
    return refused(GuardReason::kHeldByAnother, guard.owner + " owns the plant");
  }
  if (!sender.stamped || !isFresh(sender.stamp, now - kStamp)) {
    return refused(GuardReason::kStale,
                   sender.stamped ? text("what led to the command is %.3f s old, at most %g s",
                                         now - sender.stamp, kFreshAge)
                                  : "a session's command needs the stamp of its last block");
  }
  renewUntil(guard, sender, now);
  return {};
}

// Distance along a path with a load gradient `growth` per metre until the load reaches `limit`. [m]
double distanceTo(const Eigen::Vector3d& load, const Eigen::Vector3d& growth, double limit) {
  const double steepness = growth.squaredNorm();
  if (!(steepness > 0.0)) return std::numeric_limits<double>::infinity();
  const double along = load.dot(growth);
  const double margin = std::max(0.0, limit * limit - load.squaredNorm());
  const double root = std::sqrt(along * along + steepness * margin);
  // what opposes the growth may be gone before: the edge leaves one wall and meets the other
  if (along <= 0.0) return root / steepness;
  return margin / (root + along);
}

void endSession(PlantGuard& guard) {
  guard.owner.clear();
  guard.session = 0;
  guard.expired = false;
}

GuardAction stop(PlantGuard& guard, GuardReason reason) {
  guard.shaking = false;
  return {reason, true, true};
}

// Allowed load while a larger one is being relieved; `load`: present one. NaN doesn't raise it.
double unloading(double load, double limit, double allowed) {
  return std::isfinite(load) ? std::clamp(kUnload * load, limit, std::max(limit, allowed)) : limit;
}

// The present load may be above the limit while it is relieved, but must not grow.
void allowUnloading(PlantGuard& guard) {
  guard.overloaded = false;
  constexpr double kAny = std::numeric_limits<double>::infinity();
  guard.allowed.force = unloading(guard.load.force, guard.limits.force, kAny);
  guard.allowed.torque = unloading(guard.load.torque, guard.limits.torque, kAny);
}

}  // namespace

const char* toString(GuardReason reason) {
  static constexpr const char* kNames[] = {
      "good",          "held_by_another", "no_lease",   "stale",        "earlier_boot",
      "not_finite",    "frame_id",        "workspace",  "max_rotation", "max_amplitude",
      "max_frequency", "direction",       "overloaded", "expired",      "max_force",
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

bool isFromEarlierBoot(const PlantGuard& guard, const Sender& sender, double now) {
  if (!sender.stamped) return sender.latched;
  return guard.lockstep ? sender.stamp > now + kStamp : sender.stamp < -kStamp;
}

GuardVerdict renewLease(PlantGuard& guard, const Sender& sender, std::uint32_t session, double now,
                        GuardAction& action) {
  if (guard.mode == LeaseMode::kNone) return {};
  const bool mine = guard.owner == sender.node && guard.session == session;
  if (session == 0) {
    if (guard.owner == sender.node) {
      action.exciter_off = guard.shaking;
      guard.shaking = false;
      endSession(guard);
    }
    return {};
  }
  if (!guard.owner.empty() && guard.owner != sender.node) {
    return refused(GuardReason::kHeldByAnother, guard.owner + " owns the plant");
  }
  if (isFromEarlierBoot(guard, sender, now)) {
    return refused(GuardReason::kEarlierBoot, "the lease is older than this run of the plant");
  }
  // a lease message older than the lease time doesn't renew it
  if (!sender.stamped || !(now - sender.stamp < guard.limits.lease_time - kStamp)) {
    return refused(GuardReason::kStale, text("the lease is based on a block of %.3f s ago",
                                             sender.stamped ? now - sender.stamp : now));
  }
  if (!mine) {
    guard.owner = sender.node;
    guard.session = session;
    // acquiring the plant cancels the previous owner's motion
    action.hold = action.exciter_off = true;
    guard.shaking = false;
    guard.seen = std::min(sender.stamp, now);
    allowUnloading(guard);
  }
  renewUntil(guard, sender, now);
  return {};
}

GuardVerdict checkMove(PlantGuard& guard, const Sender& sender, const Pose& X, double now) {
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
  GuardVerdict verdict = checkSender(guard, sender, now);
  if (!verdict.good() || !guard.overloaded) return verdict;
  if (X.p.z() < guard.height + kHeight) {
    return refused(GuardReason::kOverloaded, "the plant was stopped by its load: only up");
  }
  allowUnloading(guard);
  return {};
}

GuardVerdict checkExciter(PlantGuard& guard, const Sender& sender, const ExciterCommand& drive,
                          double now) {
  const GuardLimits& limits = guard.limits;
  if (!std::isfinite(drive.amplitude) || !std::isfinite(drive.frequency) ||
      !std::isfinite(drive.phase)) {
    return refused(GuardReason::kNotFinite,
                   text("amplitude %g, frequency %g, phase %g: give finite numbers",
                        drive.amplitude, drive.frequency, drive.phase));
  }
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
  GuardVerdict verdict = checkSender(guard, sender, now);
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
  allowed.force = unloading(guard.load.force, guard.limits.force, allowed.force);
  allowed.torque = unloading(guard.load.torque, guard.limits.torque, allowed.torque);
  if (guard.owner.empty()) {
    const bool lone = guard.shaking && guard.mode != LeaseMode::kNone;
    if (!lone || now - guard.shaking_since < guard.limits.lone_exciter - kStamp) return {};
    guard.shaking = false;
    return {GuardReason::kLoneExciter, false, true};
  }
  const double silent = now - guard.seen;
  if (guard.expired) {
    if (silent >= kForget) endSession(guard);
    return {};
  }
  if (silent < guard.limits.lease_time - kStamp) return {};
  guard.expired = true;
  return stop(guard, GuardReason::kExpired);
}

double speedLimit(const PlantGuard& guard, const Vector6& load, const Vector6& way) {
  const Braking& braking = guard.braking;
  Vector6 weight;
  weight << 1, 1, 1, braking.arm, braking.arm, braking.arm;
  const double size = way.cwiseProduct(weight).cwiseAbs().maxCoeff();
  if (!(size > 0.0)) return std::numeric_limits<double>::infinity();
  const Vector6 growth = -braking.stiffness * way / size;
  const double distance =
      std::min(distanceTo(load.head<3>(), growth.head<3>(), guard.allowed.force),
               distanceTo(load.tail<3>(), growth.tail<3>(), guard.allowed.torque));
  return std::max(kMinSpeed, std::sqrt(distance * braking.acceleration / kStopWay));
}

GuardVerdict overload(PlantGuard& guard, const Vector6& load, const Vector6& way) {
  guard.overloaded = true;
  guard.shaking = false;
  const Load& allowed = guard.allowed;
  const Vector6 after = loadAfter(guard.braking, load, way);
  const auto verdict = [](GuardReason reason, const auto& now, const auto& then, double limit,
                          const char* unit) {
    const double value = now.norm();
    if (value > limit) return beyond(reason, "load of the coupling", value, limit, unit);
    return refused(reason, text("load of the coupling is %g %s and would be %g %s when the carrier "
                                "has stopped, allowed are 0 to %g %s",
                                value, unit, then.norm(), unit, limit, unit));
  };
  if (load.head<3>().norm() > allowed.force || after.head<3>().norm() > allowed.force) {
    return verdict(GuardReason::kForce, load.head<3>(), after.head<3>(), allowed.force, "N");
  }
  return verdict(GuardReason::kTorque, load.tail<3>(), after.tail<3>(), allowed.torque, "N m");
}

}  // namespace assembly_cell
