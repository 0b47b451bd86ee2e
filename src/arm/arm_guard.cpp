// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_guard.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr double kRelief = 1.1;     // allowed fraction of the present load while it is relieved
constexpr double kMinSpeed = 1e-3;  // [m/s]
constexpr double kStopWay = 0.8;  // stopping distance as a fraction of v²/a, as in plant_guard.cpp
constexpr double kBlocksOwner =
    0.5;  // silence of a source that keeps the owner waiting, of the timeout
// An error of the arm's clock that lasts holds the arm, in timeouts. Shorter ones are a burst after
// a process was frozen, or the cell's time after a pause: six blocks, 0.12 s (CellClock).
constexpr double kClockPatience = 3.0;
constexpr char kSensors[] = "ab";

Load loadOf(const Vector6& wrench) { return {wrench.head<3>().norm(), wrench.tail<3>().norm()}; }

// Allowed load: above the limit while a larger load is being relieved, never growing.
double relieved(double load, double limit, double allowed) {
  return std::isfinite(load) ? std::clamp(kRelief * load, limit, std::max(limit, allowed)) : limit;
}

Load relieved(const Load& load, const Load& limit, const Load& allowed) {
  return {relieved(load.force, limit.force, allowed.force),
          relieved(load.torque, limit.torque, allowed.torque)};
}

Load contactLimit(const ArmGuard& arm) { return {arm.limits.guard.force, arm.limits.guard.torque}; }
Load rawLimit(const ArmGuard& arm) { return {arm.limits.raw_force, arm.limits.raw_torque}; }

void allowRelief(ArmGuard& arm) {
  constexpr double kAny = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 2; ++i) {
    arm.allowed[i] = relieved(loadOf(arm.wrench[i]), contactLimit(arm), {kAny, kAny});
    arm.raw_allowed[i] = relieved(arm.raw_load[i], rawLimit(arm), {kAny, kAny});
  }
}

void holdBeyond(ArmGuard& arm, ArmReason reason, const std::string& what, double value,
                double limit, const char* unit) {
  hold(arm, reason,
       text("%s is %g %s, allowed are 0 to %g %s", what.c_str(), value, unit, limit, unit));
}

// Holds the arm if the sample exceeds an allowed load.
void checkSample(ArmGuard& arm, std::size_t sensor, const Vector6& contact, const Vector6& raw) {
  const std::string of = std::string(" of sensor_") + kSensors[sensor];
  const Load load = loadOf(contact), raw_load = loadOf(raw);
  const Load &allowed = arm.allowed[sensor], &raw_allowed = arm.raw_allowed[sensor];
  if (!(load.force <= allowed.force)) {
    holdBeyond(arm, ArmReason::kForce, "contact force" + of, load.force, allowed.force, "N");
  } else if (!(load.torque <= allowed.torque)) {
    holdBeyond(arm, ArmReason::kTorque, "contact torque" + of, load.torque, allowed.torque, "N m");
  } else if (!(raw_load.force <= raw_allowed.force)) {
    holdBeyond(arm, ArmReason::kRawForce, "force with its zero" + of, raw_load.force,
               raw_allowed.force, "N");
  } else if (!(raw_load.torque <= raw_allowed.torque)) {
    holdBeyond(arm, ArmReason::kRawTorque, "torque with its zero" + of, raw_load.torque,
               raw_allowed.torque, "N m");
  }
}

void updateRate(ArmGuard& arm, std::size_t sensor, const Eigen::Vector3d& force, double time) {
  ForceWindow& window = arm.windows[sensor];
  if (window.count == 0) window.start = time;
  window.sum += force;
  ++window.count;
  const double passed = time - window.start;
  if (passed < 0.0 || passed > 10.0 * arm.limits.rate_window) {
    window = ForceWindow();  // the sensor was restarted, or samples are missing
    return;
  }
  if (passed < arm.limits.rate_window * (1.0 - 1e-6)) return;
  const Eigen::Vector3d mean = window.sum / static_cast<double>(window.count);
  if (window.last) window.rate = (mean - *window.last).norm() / passed;
  window.last = mean;
  window.sum.setZero();
  window.count = 0;
}

bool isBusy(const ArmGuard& arm) {
  return !arm.guard.owner.empty() || arm.guard.shaking || !isAtRest(arm.motion);
}

// A saturated sample gives no load. A knock saturates a few samples; longer saturation is an error.
void addSaturated(ArmGuard& arm, std::size_t sensor, double period) {
  arm.saturated[sensor] += period;
  if (arm.saturated[sensor] <= arm.limits.saturated_time || isHalted(arm) || !isBusy(arm)) return;
  hold(arm, ArmReason::kSaturated,
       text("sensor_%c is at the end of its range for %g s, allowed are %g s: its load isn't known",
            kSensors[sensor], arm.saturated[sensor], arm.limits.saturated_time));
}

struct Source {
  ArmReason reason;  // of a hold when the source isn't fresh
  const char* what;
  bool known;
  double time;  // last stamp
};

std::array<Source, 3> sourcesOf(const ArmGuard& arm) {
  return {{{ArmReason::kNoWrenchA, "samples of sensor_a", arm.wrench_known[0], arm.wrench_time[0]},
           {ArmReason::kNoWrenchB, "samples of sensor_b", arm.wrench_known[1], arm.wrench_time[1]},
           {ArmReason::kNoState, "state of the arm", arm.state_known, arm.state_time}}};
}

bool isThere(const ArmGuard& arm, const Source& source) {
  return source.reason != ArmReason::kNoWrenchA || arm.limits.sensors != Sensors::kB;
}

bool isFresh(const ArmGuard& arm, const Source& source, double now) {
  if (!isThere(arm, source)) return true;
  return source.known && now - source.time < arm.limits.timeout - 1e-6;
}

// Is the arm's state received, but with stamps of another clock?
bool hasClockError(const ArmGuard& arm, double now) {
  return !arm.clock_error.empty() && now - arm.clock_checked < arm.limits.timeout;
}

// What is wrong with a source that isn't fresh.
std::string describe(const ArmGuard& arm, const Source& source, double now) {
  std::string out = source.known ? text("no fresh %s for %.3f s, allowed are %g s", source.what,
                                        now - source.time, arm.limits.timeout)
                                 : text("no %s has come in yet", source.what);
  if (source.reason == ArmReason::kNoState && !arm.refusal.empty()) out += ": " + arm.refusal;
  return out;
}

void watchData(ArmGuard& arm, double now) {
  for (const Source& source : sourcesOf(arm)) {
    if (isFresh(arm, source, now)) continue;
    if (source.reason == ArmReason::kNoState && hasClockError(arm, now)) {
      hold(arm, ArmReason::kClock, arm.clock_error);
    } else {
      hold(arm, source.reason, describe(arm, source, now));
    }
    return;
  }
}

// An owner that receives no block because a source is missing sends no lease: the source is named.
void holdExpired(ArmGuard& arm, const std::string& owner, double now) {
  const double timeout = arm.limits.timeout;
  const std::string expiry = text("no sign of life of %s for %g s", owner.c_str(), timeout);
  for (const Source& source : sourcesOf(arm)) {
    if (!isThere(arm, source)) continue;
    if (source.known && now - source.time < kBlocksOwner * timeout) continue;
    hold(arm, source.reason,
         text("no fresh %s for %.3f s, and so ", source.what, now - source.time) + expiry);
    return;
  }
  hold(arm, ArmReason::kExpired, expiry);
}

// From where the arm is to where it stops: points already sent can't be recalled.
Vector6 wayToStop(const ArmGuard& arm) {
  const auto points = static_cast<std::size_t>(std::lround(arm.limits.delay / arm.motion.period));
  const std::size_t count = arm.sent.size();
  if (points >= count) return stopWay(arm.motion) + motionRate(arm.motion) * arm.limits.delay;
  const Vector6& reached = arm.sent[(arm.sent_next + count - 1 - points) % count];
  return stopWay(arm.motion) + arm.motion.out - reached;
}

// Compares with all points within the following time, so the arm's latency is no error.
void watchFollowing(ArmGuard& arm) {
  const double points = arm.limits.following_time / arm.motion.period;
  const auto count = std::min(static_cast<std::size_t>(std::max(1.0, points)), arm.sent.size());
  double distance = std::numeric_limits<double>::infinity(), turn = distance;
  for (std::size_t k = 1; k <= count; ++k) {
    const Vector6& point = arm.sent[(arm.sent_next + arm.sent.size() - k) % arm.sent.size()];
    const double d = (point - arm.measured).head<3>().norm();
    const double t = (point - arm.measured).tail<3>().norm();
    if (d <= arm.limits.following && t <= arm.limits.following_turn) return;
    distance = std::min(distance, d);
    turn = std::min(turn, t);
  }
  hold(arm, ArmReason::kFollowing,
       text("the arm is %g m and %g rad from where it was sent within %g s, allowed are %g m and "
            "%g rad",
            distance, turn, arm.limits.following_time, arm.limits.following,
            arm.limits.following_turn));
}

// Is a load above its limit, so that it has to be relieved?
bool isOverloaded(const ArmGuard& arm) {
  for (std::size_t i = 0; i < 2; ++i) {
    const Load load = loadOf(arm.wrench[i]), limit = contactLimit(arm);
    if (load.force > limit.force || load.torque > limit.torque) return true;
    const Load &raw = arm.raw_load[i], raw_limit = rawLimit(arm);
    if (raw.force > raw_limit.force || raw.torque > raw_limit.torque) return true;
  }
  return false;
}

void begin(ArmGuard& arm, const Pose& X) {
  beginMotion(arm.motion, X);
  arm.sent.fill(arm.motion.out);
  arm.begun = true;
}

GuardVerdict halted(const ArmGuard& arm) {
  const std::string& why = arm.text.empty() ? arm.clock_error : arm.text;
  return {GuardReason::kOverloaded,
          text("overloaded: the arm is %s: %s", toString(arm.mode), why.c_str())};
}

}  // namespace

const char* toString(ArmMode mode) {
  static constexpr const char* kNames[] = {"waiting", "following", "held", "stopped"};
  return kNames[static_cast<int>(mode)];
}

const char* toString(ArmReason reason) {
  static constexpr const char* kNames[] = {
      "none",      "expired",    "no_wrench_a", "no_wrench_b", "no_state",    "clock",
      "max_force", "max_torque", "raw_force",   "raw_torque",  "saturated",   "force_rate",
      "following", "outside",    "unreachable", "stop",        "lone_exciter"};
  static_assert(std::size(kNames) == static_cast<std::size_t>(ArmReason::kCount));
  return kNames[static_cast<int>(reason)];
}

ArmGuard armGuard(const ArmLimits& limits, const Braking& braking, LeaseMode mode, bool lockstep) {
  ArmGuard arm;
  arm.limits = limits;
  arm.limits.guard.lease_time = limits.timeout;
  arm.guard = plantGuard(arm.limits.guard, mode, lockstep);
  arm.guard.braking = braking;
  arm.guard.braking.acceleration = limits.motion.acceleration;
  arm.motion.limits = limits.motion;
  arm.motion.limits.box_min = limits.guard.box_min;
  arm.motion.limits.box_max = limits.guard.box_max;
  arm.motion.limits.rotation = limits.guard.rotation;
  arm.allowed.fill(contactLimit(arm));
  arm.raw_allowed.fill(rawLimit(arm));
  for (Vector6& wrench : arm.wrench) wrench.setZero();
  arm.sent.fill(arm.motion.out);
  return arm;
}

void setRate(ArmGuard& arm, double period, double smoothing) {
  arm.motion.period = period;
  arm.motion.smoothing = static_cast<std::size_t>(std::clamp(
      std::round(smoothing / period), 1.0, static_cast<double>(CommandMotion::kMaxSmoothing)));
}

void addSamples(ArmGuard& arm, const ContactSamples& samples) {
  const auto sensor = static_cast<std::size_t>(samples.sensor);
  const Load detectable = detectionThreshold(arm.limits.guard);
  Vector6 way = Vector6::Zero();
  if (sensor == 1) {
    way = wayToStop(arm);
  }
  Vector6 known = arm.wrench[sensor];
  for (std::size_t i = 0; i < samples.count; ++i) {
    const Vector6 contact = Vector6::Map(samples.values + 6 * i);
    const double behind = static_cast<double>(samples.count - 1 - i) * samples.period;
    if (samples.saturated != nullptr && samples.saturated[i] != 0) {
      addSaturated(arm, sensor, samples.period);
      continue;
    }
    arm.saturated[sensor] = 0.0;
    known = contact;
    updateRate(arm, sensor, contact.head<3>(), samples.end - behind);
    if (isHalted(arm)) continue;
    checkSample(arm, sensor, contact, contact + samples.zero);
    const Load& allowed = arm.allowed[sensor];
    if (isHalted(arm) || sensor != 1 || !exceeds(contact, detectable)) continue;
    if (!mustStop(arm.guard.braking, contact, way, allowed)) continue;
    const Load then = loadOf(loadAfter(arm.guard.braking, contact, way));
    hold(arm, then.force > allowed.force ? ArmReason::kForce : ArmReason::kTorque,
         text("contact at sensor_b is %g N, %g N m and would be %g N, %g N m when the arm has "
              "stopped, allowed are %g N, %g N m",
              contact.head<3>().norm(), contact.tail<3>().norm(), then.force, then.torque,
              allowed.force, allowed.torque));
  }
  if (samples.count > 0) {
    arm.wrench[sensor] = known;
    arm.raw_load[sensor] = loadOf(arm.wrench[sensor] + samples.zero);
    arm.wrench_time[sensor] = samples.end;
    arm.wrench_known[sensor] = true;
  }
  arm.allowed[sensor] =
      relieved(loadOf(arm.wrench[sensor]), contactLimit(arm), arm.allowed[sensor]);
  arm.raw_allowed[sensor] = relieved(arm.raw_load[sensor], rawLimit(arm), arm.raw_allowed[sensor]);
  const double rate = arm.windows[sensor].rate;
  if (!isHalted(arm) && isBusy(arm) && !(rate <= arm.limits.force_rate)) {
    holdBeyond(arm, ArmReason::kForceRate,
               std::string("rate of the contact force of sensor_") + kSensors[sensor], rate,
               arm.limits.force_rate, "N/s");
  }
}

void checkClock(ArmGuard& arm, double stamp, double now) {
  if (arm.guard.lockstep) return;
  const double error = stamp - now, allowed = arm.limits.timeout;
  arm.clock_checked = now;
  if (std::abs(error) <= allowed) {
    arm.clock_error.clear();
    return;
  }
  if (arm.clock_error.empty() || now < arm.clock_since) arm.clock_since = now;
  arm.clock_error =
      text("the arm's stamps are %.3f s %s those of sensor_b, allowed are %g s: ", std::abs(error),
           error > 0.0 ? "ahead of" : "behind", allowed);
  arm.clock_error += error > 0.0 ? "set both clocks" : "set both clocks, or its messages are late";
  if (now - arm.clock_since >= kClockPatience * allowed) {
    hold(arm, ArmReason::kClock, arm.clock_error);
  }
}

std::string missingData(const ArmGuard& arm, double now) {
  if (hasClockError(arm, now)) return arm.clock_error;
  for (const Source& source : sourcesOf(arm)) {
    if (!isFresh(arm, source, now)) return describe(arm, source, now);
  }
  return {};
}

bool setState(ArmGuard& arm, const Pose& X, double stamp, const std::string& beyond_limit) {
  if (!X.p.allFinite() || !X.R.allFinite()) return false;
  arm.measured = coordinatesOf(X);
  arm.state_time = stamp;
  arm.state_known = true;
  arm.beyond_limit = beyond_limit;
  arm.refusal.clear();
  // moved by other means while it wasn't commanded
  const Vector6 off = arm.measured - arm.motion.out;
  const bool moved = arm.begun && !isBusy(arm) &&
                     !(off.head<3>().norm() <= arm.limits.following &&
                       off.tail<3>().norm() <= arm.limits.following_turn);
  if (arm.begun && !moved) return false;
  if (!arm.clock_error.empty()) return false;
  if (!beyond_limit.empty()) {
    arm.begun = false;
    hold(arm, ArmReason::kUnreachable, beyond_limit);
    return false;
  }
  // held before its start, it starts at resume()
  const bool was_held = arm.reason == ArmReason::kUnreachable || arm.reason == ArmReason::kClock;
  if (!arm.begun && was_held) return false;
  begin(arm, X);
  if (arm.mode == ArmMode::kWaiting) arm.mode = ArmMode::kFollowing;
  return true;
}

GuardVerdict renew(ArmGuard& arm, const Sender& sender, std::uint32_t session, double now) {
  const std::uint32_t before = arm.guard.session;
  // A restarted driver may reach other nodes before this one: the session starts with a later
  // lease, when all watched sources are fresh.
  if (session != 0 && session != before && !arm.guard.lockstep) {
    if (hasClockError(arm, now)) return {GuardReason::kStale, "stale: " + arm.clock_error};
    for (const Source& source : sourcesOf(arm)) {
      if (isFresh(arm, source, now)) continue;
      return {GuardReason::kStale, text("stale: there are no fresh %s", source.what)};
    }
  }
  GuardAction action;
  const GuardVerdict verdict = renewLease(arm.guard, sender, session, now, action);
  if (action.hold) brake(arm.motion);
  const bool starts = arm.guard.session != 0 && arm.guard.session != before;
  if (verdict.good() && starts && arm.mode == ArmMode::kHeld) resume(arm, now);
  return verdict;
}

GuardVerdict move(ArmGuard& arm, const Sender& sender, const Pose& X, double now) {
  GuardVerdict verdict = checkMove(arm.guard, sender, X, now);
  if (!verdict.good()) return verdict;
  if (arm.mode != ArmMode::kFollowing) return halted(arm);
  if (!isWithin(arm.motion.limits, arm.motion.out)) {
    hold(arm, ArmReason::kOutside,
         text("the arm is outside of its workspace, at %g %g %g m: bring it back by hand",
              arm.motion.out(0), arm.motion.out(1), arm.motion.out(2)));
    return halted(arm);
  }
  const Vector6 way = coordinatesOf(X) - arm.motion.out;
  if (isOverloaded(arm) && !(way(2) > 0.0 && way.head<2>().norm() <= way(2))) {
    return {GuardReason::kOverloaded, "overloaded: the load is above its limit: only up"};
  }
  moveTo(arm.motion, X, std::min(arm.limits.motion.speed, safeSpeed(arm, way)));
  return verdict;
}

GuardVerdict drive(ArmGuard& arm, const Sender& sender, const ExciterCommand& exciter, double now) {
  if (exciter.amplitude > 0.0 && isHalted(arm)) return halted(arm);
  return checkExciter(arm.guard, sender, exciter, now);
}

void tick(ArmGuard& arm, double now) {
  if (!arm.state_known) return;
  const std::string owner = arm.guard.owner;
  const GuardAction action = watch(arm.guard, arm.wrench[1], arm.motion.out(2), now);
  if (action.reason == GuardReason::kExpired) {
    holdExpired(arm, owner, now);
  } else if (action.reason == GuardReason::kLoneExciter) {
    arm.text = text("%s: the exciter ran for %g s while no session owned the plant",
                    toString(action.reason), arm.limits.guard.lone_exciter);
  }
  if (!isHalted(arm) && isBusy(arm)) {
    watchData(arm, now);
    if (!isHalted(arm)) watchFollowing(arm);
  }
  if (!arm.begun) return;
  stepMotion(arm.motion);
  arm.sent[arm.sent_next] = arm.motion.out;
  arm.sent_next = (arm.sent_next + 1) % arm.sent.size();
}

void hold(ArmGuard& arm, ArmReason reason, const std::string& text) {
  if (isHalted(arm)) return;
  arm.mode = ArmMode::kHeld;
  arm.reason = reason;
  arm.text = std::string(toString(reason)) + ": " + text;
  arm.guard.shaking = false;
  brake(arm.motion);
}

void stopForGood(ArmGuard& arm, const std::string& text) {
  if (arm.mode == ArmMode::kStopped) return;
  arm.mode = ArmMode::kWaiting;
  hold(arm, ArmReason::kStop, text);
  arm.mode = ArmMode::kStopped;
}

std::string resume(ArmGuard& arm, double now) {
  if (arm.mode == ArmMode::kStopped)
    return arm.text + ": start the bridge again, in lockstep the whole cell";
  if (arm.mode != ArmMode::kHeld) return text("the arm is not held, it is %s", toString(arm.mode));
  if (hasClockError(arm, now)) {
    arm.reason = ArmReason::kClock;
    arm.text = std::string(toString(arm.reason)) + ": " + arm.clock_error;
    return arm.text;
  }
  if (!arm.state_known || now - arm.state_time >= arm.limits.timeout) {
    return "no fresh state of the arm: the next point must be at its pose";
  }
  if (!arm.beyond_limit.empty()) {
    arm.reason = ArmReason::kUnreachable;
    arm.text = std::string(toString(arm.reason)) + ": " + arm.beyond_limit;
    return arm.text;
  }
  allowRelief(arm);
  for (ForceWindow& window : arm.windows) window = ForceWindow();
  // the motion restarts where the arm is: it isn't sent back to an old point
  if (!arm.begun || isAtRest(arm.motion)) begin(arm, poseOfCoordinates(arm.measured));
  brake(arm.motion);
  arm.mode = ArmMode::kFollowing;
  arm.reason = ArmReason::kNone;
  arm.text.clear();
  return {};
}

double safeSpeed(const ArmGuard& arm, const Vector6& way) {
  const double a = arm.limits.motion.acceleration, delay = arm.limits.delay;
  const double speed = speedLimit(arm.guard, arm.wrench[1], way);
  if (!std::isfinite(speed)) return speed;
  // the same stopping distance with the way during the delay, less what a contact may push with
  // when it is detected, twice the threshold: a peg that swings back from the face does so, too
  const double distance = (1.0 - 2.0 * kDetectable) * kStopWay * speed * speed / a;
  const double v =
      (std::sqrt(delay * delay + 4.0 * kStopWay * distance / a) - delay) * 0.5 * a / kStopWay;
  return std::max(kMinSpeed, v);
}

}  // namespace assembly_cell
