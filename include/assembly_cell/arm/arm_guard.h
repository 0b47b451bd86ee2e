// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "assembly_cell/arm/command_motion.h"
#include "assembly_cell/guard/plant_guard.h"
#include "assembly_cell/mechanism/sensors.h"

namespace assembly_cell {

/// The last check between commands and an arm: the plant guard (sessions, watchdog, workspace), the
/// commanded motion, and limits on the measured loads and on the following error. Plain state and
/// free functions; poses are those of the carrier in carrier_base, times are cell time [s].

struct ArmLimits {
  Sensors sensors = Sensors::kBoth;  ///< whose loads are limited, and must be fresh
  MotionLimits motion;               ///< its box and cone are those of `guard`, see armGuard()
  GuardLimits guard;                 ///< force and torque: contact at either sensor, zero removed
  double raw_force = 150.0, raw_torque = 15.0;  ///< at either sensor, zero included [N], [N·m]
  double force_rate = 5000.0;    ///< change of either contact force's mean over `rate_window` [N/s]
  double rate_window = 0.02;     ///< [s]
  double saturated_time = 2e-3;  ///< longest saturation that counts as a knock of stiff parts [s]
  double following = 0.002;      ///< from the arm to the nearest point within `following_time` [m]
  double following_turn = 0.02;  ///< [rad]
  double following_time = 0.1;   ///< latency and lag of the arm [s]
  double timeout = 0.1;          ///< for wrenches, the arm's state and the owner's lease [s]
  double delay = 0.05;           ///< from a contact to the arm's reaction, for the safe speed [s]
};

enum class ArmMode {
  kWaiting,    ///< no state of the arm has been received
  kFollowing,  ///< the arm follows the commanded motion
  kHeld,       ///< brought to rest; until resume() or a new session
  kStopped     ///< by stopForGood(): until the bridge is restarted
};
const char* toString(ArmMode mode);  ///< waiting, following, held, stopped

/// Why the arm was held or stopped.
enum class ArmReason {
  kNone,
  kExpired,      ///< the owner's lease has expired
  kNoWrenchA,    ///< no fresh samples of sensor_a
  kNoWrenchB,    ///< no fresh samples of sensor_b
  kNoState,      ///< no fresh state of the arm
  kClock,        ///< the arm's stamps are ahead of the samples', or behind
  kForce,        ///< contact force
  kTorque,       ///< contact torque
  kRawForce,     ///< force, zero included
  kRawTorque,    ///< torque, zero included
  kSaturated,    ///< a sensor is at the end of its range
  kForceRate,    ///< contact force rises too fast
  kFollowing,    ///< following error
  kOutside,      ///< the arm is outside its workspace
  kUnreachable,  ///< outside the limits of the arm's joints
  kStop,         ///< requested by a person
  kLoneExciter,  ///< the exciter ran without an owner
  kCount
};
const char* toString(ArmReason reason);  ///< "expired" and so on

/// Means over consecutive windows, for the rate of a force.
struct ForceWindow {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double start = 0.0;
  std::size_t count = 0;
  std::optional<Eigen::Vector3d> last;  ///< mean of the previous window
  double rate = 0.0;                    ///< between the last two windows [N/s]
};

struct ArmGuard {
  ArmLimits limits;
  PlantGuard guard;
  CommandMotion motion;
  ArmMode mode = ArmMode::kWaiting;
  ArmReason reason = ArmReason::kNone;
  std::string text;  ///< of the last hold or stop, with value and limit; empty: none

  // state of the arm
  bool begun = false;  ///< `motion` has started at the arm's pose: points are sent
  double state_time = 0.0;
  bool state_known = false;
  std::string beyond_limit;  ///< see setState(); empty: all joints are within limits
  std::string refusal;  ///< why the last message of the arm's state was refused; empty: it wasn't
  std::string clock_error;             ///< of the arm's stamps, see checkClock(); empty: none
  double clock_since = 0.0;            ///< time at which the error began [s]
  double clock_checked = 0.0;          ///< time of the last check [s]
  Vector6 measured = Vector6::Zero();  ///< coordinates, see coordinatesOf()
  std::array<Vector6, 256> sent{};     ///< the latest points, a ring
  std::size_t sent_next = 0;
  // loads at sensor_a and sensor_b
  std::array<double, 2> wrench_time{};
  std::array<bool, 2> wrench_known{};
  std::array<Vector6, 2> wrench{};  ///< last unsaturated sample, zero removed
  std::array<Load, 2> allowed;      ///< above the limits while a load is being relieved
  std::array<Load, 2> raw_load, raw_allowed;
  std::array<ForceWindow, 2> windows;
  std::array<double, 2> saturated{};  ///< uninterrupted saturation until now [s]
};

/// Samples of all sensors of the cell have been received.
inline bool knowsWrenches(const ArmGuard& arm) {
  return arm.wrench_known[1] && (arm.limits.sensors == Sensors::kB || arm.wrench_known[0]);
}

/// The workspace is relative to carrier_base.
ArmGuard armGuard(const ArmLimits& limits, const Braking& braking, LeaseMode mode, bool lockstep);
/// A point each `period` [s], the mean of those within `smoothing` [s].
void setRate(ArmGuard& arm, double period, double smoothing);

/// Samples of a sensor (0: sensor_a, 1: sensor_b): 6 × count, zero removed, the last one at `end`.
struct ContactSamples {
  int sensor = 0;
  const double* values = nullptr;
  std::size_t count = 0;
  double period = 0.0, end = 0.0;  ///< [s]
  Vector6 zero = Vector6::Zero();  ///< that was removed
  /// A byte a sample; not 0: a channel was saturated, the load is unknown. Null: no saturation.
  const std::uint8_t* saturated = nullptr;
};
/// Checks the samples against the limits; holds the arm at the first one beyond.
void addSamples(ArmGuard& arm, const ContactSamples& samples);
/// Compares the stamp of a state of the arm that is received at `now` with the time of the samples.
/// The motion doesn't start while they differ by more than `limits.timeout`, ahead or behind; an
/// error that lasts holds the arm. Not in lockstep, where no time passes between two blocks.
void checkClock(ArmGuard& arm, double stamp, double now);
/// Measured pose of the arm at `stamp`; `beyond_limit`: ArmKinematics::beyondLimit() of its joints.
/// The motion starts at the first pose, and again where the idle arm was moved by other means; true
/// if it did. While a joint is beyond its limit it doesn't start: the arm is held, no point is
/// sent. Nor while there is an error of the clock.
bool setState(ArmGuard& arm, const Pose& X, double stamp, const std::string& beyond_limit = {});

/// Leases and commands, as in the plant guard. A new session ends a hold; it is refused while a
/// watched source isn't fresh. While a load is above its limit only moves up are accepted.
GuardVerdict renew(ArmGuard& arm, const Sender& sender, std::uint32_t session, double now);
GuardVerdict move(ArmGuard& arm, const Sender& sender, const Pose& X, double now);
GuardVerdict drive(ArmGuard& arm, const Sender& sender, const ExciterCommand& exciter, double now);

/// Once a period: checks the watched sources, and computes the next point, `arm.motion.out`.
void tick(ArmGuard& arm, double now);

/// Brings the arm to rest, exciter off.
void hold(ArmGuard& arm, ArmReason reason, const std::string& text);
/// Stops the arm until the bridge is restarted.
void stopForGood(ArmGuard& arm, const std::string& text);
/// Ends a hold on a person's request. Empty, or the reason why the arm stays held.
std::string resume(ArmGuard& arm, double now);

/// The first watched source that isn't fresh at `now`, in one line, with the likely cause; empty:
/// all are.
std::string missingData(const ArmGuard& arm, double now);

inline bool isHalted(const ArmGuard& arm) {
  return arm.mode == ArmMode::kHeld || arm.mode == ArmMode::kStopped;
}
/// Largest speed of a move along `way` at which a stop that begins `limits.delay` after a contact
/// ends within the allowed load. [m/s]
double safeSpeed(const ArmGuard& arm, const Vector6& way);

}  // namespace assembly_cell
