// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "assembly_cell/arm/command_motion.h"
#include "assembly_cell/guard/plant_guard.h"

namespace assembly_cell {

/// What stands last between commands and an arm: the plant's guard (sessions, dead man, workspace),
/// the way that the arm is sent along, and limits of what is felt and of how the arm follows. Plain
/// state and free functions; poses are of the carrier in its base, times are cell time [s].

struct ArmLimits {
  MotionLimits motion;  ///< its box and cone are those of `guard`, see armGuard()
  GuardLimits guard;    ///< force and torque: of either sensor's contact, zero taken off
  double raw_force = 150.0, raw_torque = 15.0;  ///< of either sensor, its zero included [N], [N·m]
  double force_rate = 5000.0;    ///< of either contact force's mean over `rate_window` [N/s]
  double rate_window = 0.02;     ///< [s]
  double saturated_time = 2e-3;  ///< that a channel may be at its end: a knock of stiff parts [s]
  double following = 0.002;      ///< arm from where it was sent within `following_time` [m]
  double following_turn = 0.02;  ///< [rad]
  double following_time = 0.1;   ///< [s]
  double timeout = 0.1;          ///< of wrenches, the arm's state and the holder's lease [s]
  double delay = 0.05;  ///< from a contact to the arm's answer, for the speed that is safe [s]
};

enum class ArmMode {
  kWaiting,    ///< the arm's state has not come yet
  kFollowing,  ///< it goes where it is sent
  kHeld,       ///< it was brought to rest; until resume() or another session
  kStopped     ///< by stop(): for good
};
const char* toString(ArmMode mode);  ///< waiting, following, held, stopped

/// Why the arm was held or stopped.
enum class ArmReason {
  kNone,
  kExpired,      ///< no sign of life of who holds it
  kNoWrenchA,    ///< no fresh samples of sensor_a
  kNoWrenchB,    ///< of sensor_b
  kNoState,      ///< no fresh state of the arm
  kForce,        ///< contact force
  kTorque,       ///< contact torque
  kRawForce,     ///< force, zero included
  kRawTorque,    ///< torque, zero included
  kSaturated,    ///< a sensor is at the end of its range
  kForceRate,    ///< contact force rises too fast
  kFollowing,    ///< the arm is not where it was sent
  kOutside,      ///< the arm is not in its workspace
  kUnreachable,  ///< by the arm's joints
  kStop,         ///< asked for
  kLoneExciter,  ///< nobody holds the plant
  kCount
};
const char* toString(ArmReason reason);  ///< "expired" and so on

/// Means over the latest window, for the rate of a force.
struct ForceWindow {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double start = 0.0;
  std::size_t count = 0;
  std::optional<Eigen::Vector3d> last;  ///< mean of the window before
  double rate = 0.0;                    ///< greatest of the last two windows [N/s]
};

struct ArmGuard {
  ArmLimits limits;
  PlantGuard guard;
  CommandMotion motion;
  ArmMode mode = ArmMode::kWaiting;
  ArmReason reason = ArmReason::kNone;
  std::string text;  ///< of the last hold or stop, with value and limit; empty: none

  // what is known of the arm
  bool begun = false;  ///< its place is known: `motion` has begun there
  double state_time = 0.0;
  bool state_known = false;
  Vector6 measured = Vector6::Zero();  ///< coordinates, see coordinatesOf()
  std::array<Vector6, 256> sent{};     ///< the latest points, a ring: where it should be
  std::size_t sent_next = 0;
  // what is felt, sensor_a and sensor_b
  std::array<double, 2> wrench_time{};
  std::array<bool, 2> wrench_known{};
  std::array<Vector6, 2> wrench{};  ///< the last sample that is known, zero taken off
  std::array<Load, 2> allowed;      ///< more than the limits while a load is being taken off
  std::array<Load, 2> raw_load, raw_allowed;
  std::array<ForceWindow, 2> windows;
  std::array<double, 2> saturated{};  ///< for so long now, without a break [s]
};

/// The workspace is about the carrier's base.
ArmGuard armGuard(const ArmLimits& limits, const Braking& braking, LeaseMode mode, bool lockstep);
/// Points each `period` [s], the mean of those within `smoothing` [s].
void setRate(ArmGuard& arm, double period, double smoothing);

/// Samples of a sensor (0: sensor_a, 1: sensor_b): 6 × count, zero taken off, the last one at
/// `end`; `zero` is what was taken off.
struct ContactSamples {
  int sensor = 0;
  const double* values = nullptr;
  std::size_t count = 0;
  double period = 0.0, end = 0.0;  ///< [s]
  Vector6 zero = Vector6::Zero();
  /// A byte a sample, not 0: a channel was at its end, the load isn't known. Null: none was.
  const std::uint8_t* saturated = nullptr;
};
void addSamples(ArmGuard& arm, const ContactSamples& samples);
/// The arm's own word of where it is, as of `stamp`.
void setState(ArmGuard& arm, const Pose& X, double stamp);

/// Leases and commands, as the plant's guard takes them. A new session ends a hold; it doesn't
/// begin while something that is watched isn't fresh. While a load is above its limit only moves up
/// are taken.
GuardVerdict renew(ArmGuard& arm, const Sender& sender, std::uint32_t session, double now);
GuardVerdict move(ArmGuard& arm, const Sender& sender, const Pose& X, double now);
GuardVerdict drive(ArmGuard& arm, const Sender& sender, const ExciterCommand& exciter, double now);

/// Once a period: watches, and makes the next point in `arm.motion.out`.
void tick(ArmGuard& arm, double now);

/// Brings the arm to rest, exciter off.
void hold(ArmGuard& arm, ArmReason reason, const std::string& text);
/// The same for good.
void stopForGood(ArmGuard& arm, const std::string& text);
/// By a person: ends a hold. Empty, or why not.
std::string resume(ArmGuard& arm, double now);

inline bool isHalted(const ArmGuard& arm) {
  return arm.mode == ArmMode::kHeld || arm.mode == ArmMode::kStopped;
}
/// How fast a move by `way` may become, so that a stop that begins `limits.delay` after the contact
/// ends within the allowed load. [m/s]
double safeSpeed(const ArmGuard& arm, const Vector6& way);

}  // namespace assembly_cell
