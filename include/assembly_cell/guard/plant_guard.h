// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <string>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Guard between the nodes that command a plant and the plant: leases, limits, and a watchdog. Used
/// by the simulator and by arm_bridge: they pass leases, commands and loads, and carry out the
/// actions that it returns. All times are cell time [s].

enum class LeaseMode {
  kAuto,      ///< while a session owns the plant only its node commands; else any node
  kRequired,  ///< commands need a session
  kNone       ///< no sessions: leases are ignored
};

struct GuardLimits {
  double force = 100.0, torque = 10.0;        ///< load of the coupling, weight included [N], [N·m]
  double amplitude = 50.0, frequency = 2e4;   ///< of the exciter [N], [rad/s]
  Eigen::Vector3d box_min{-0.1, -0.1, -0.1};  ///< of commanded positions, in carrier_base,
  Eigen::Vector3d box_max{0.1, 0.1, 0.1};     ///< relative to the start [m]
  double rotation = 0.35;                     ///< angle from the start [rad]
  double lease_time = 0.1;                    ///< without a sign of life: hold, exciter off [s]
  double lone_exciter = 10.0;                 ///< longest run of the exciter without an owner [s]
};

/// Why something was refused or stopped.
enum class GuardReason {
  kNone,
  // commands and leases
  kHeldByAnother,
  kNoLease,
  kStale,
  kEarlierBoot,
  kNotFinite,
  kFrame,
  kWorkspace,
  kRotation,
  kAmplitude,
  kFrequency,
  kDirection,
  kOverloaded,
  // the plant was stopped
  kExpired,
  kForce,
  kTorque,
  kLoneExciter,
  kCount
};
/// "held_by_another" and so on.
const char* toString(GuardReason reason);

/// Result of checking a lease or a command. `text`: one line with value and limit; empty if good.
struct GuardVerdict {
  GuardReason reason = GuardReason::kNone;
  std::string text;
  bool good() const { return reason == GuardReason::kNone; }
};

/// What the plant has to do now.
struct GuardAction {
  GuardReason reason = GuardReason::kNone;  ///< why the plant is stopped; kNone: it isn't
  bool hold = false;                        ///< bring the carrier to a stop where it is
  bool exciter_off = false;
};

/// Node that sent a message, and the age of the data that led to it.
struct Sender {
  std::string node;
  double stamp = 0.0;    ///< end of the last block that the sender has received
  bool stamped = false;  ///< false: the message has no stamp
  bool latched = false;  ///< sent before this plant was started, latched by its publisher
};

/// Command to the exciter.
struct ExciterCommand {
  double amplitude = 0.0;  ///< [N]; 0 is off
  double frequency = 0.0;  ///< [rad/s]
  double phase = 0.0;      ///< [rad]
  int direction = 1;       ///< +1 or −1
};

/// Magnitudes of a load of the coupling.
struct Load {
  double force = 0.0, torque = 0.0;  ///< [N], [N·m]
};

/// Stop of the carrier, and the load of the coupling that its stopping distance adds.
struct Braking {
  Matrix6 stiffness = Matrix6::Zero();  ///< of the coupling, see couplingStiffness(); 0: unknown
  double acceleration = 1.0;            ///< of a stop [m/s²]
  double arm = 0.0;                     ///< lever of a rotation [m]
};

struct PlantGuard {
  GuardLimits limits;
  Braking braking;
  LeaseMode mode = LeaseMode::kAuto;
  bool lockstep =
      false;   ///< the clock restarts with each boot: a later stamp is from an earlier one
  Pose start;  ///< of the carrier in carrier_base: middle of the workspace

  // the session
  std::string owner;          ///< node that owns the plant; empty: none
  std::uint32_t session = 0;  ///< its number
  double seen = 0.0;          ///< end of the last block that the owner has received
  bool expired = false;       ///< the owner's lease has expired
  // the plant
  bool overloaded = false;  ///< stopped by its load: until a move up or a new session
  Load load;                ///< of the coupling at the last block's end
  Load allowed;             ///< above the limits while a load is being relieved
  bool shaking = false;     ///< exciter on by command
  double shaking_since = 0.0;
  double height = 0.0;  ///< of the commanded pose, z in carrier_base [m]
};
PlantGuard plantGuard(const GuardLimits& limits, LeaseMode mode, bool lockstep);

/// Was the message sent before this boot of the plant? A restarted plant ignores older commands.
bool isFromEarlierBoot(const PlantGuard& guard, const Sender& sender, double now);

/// Renews the lease of a session; session 0 releases the plant. The first lease of a session
/// acquires the plant, with the exciter off and the carrier brought to a stop. Refused while
/// another node owns the plant; ownership ends a second after the lease has expired.
GuardVerdict renewLease(PlantGuard& guard, const Sender& sender, std::uint32_t session, double now,
                        GuardAction& action);

/// Checks a move of the carrier to X in carrier_base. A command of the owner renews its lease.
GuardVerdict checkMove(PlantGuard& guard, const Sender& sender, const Pose& X, double now);
/// Checks an exciter command; amplitude 0 switches it off, which any node may request.
GuardVerdict checkExciter(PlantGuard& guard, const Sender& sender, const ExciterCommand& drive,
                          double now);

/// Watchdog, once before each block. `load`: of the coupling; height: of the carrier [m].
GuardAction watch(PlantGuard& guard, const Vector6& load, double height, double now);

/// Largest speed of a move along `way` (translation and rotation vector, carrier axes) at which a
/// stop at any time ends within the allowed load, if the peg touches a rigid surface. `load`:
/// present load of the coupling. At least 1 mm/s, so that a load can be relieved. [m/s]
double speedLimit(const PlantGuard& guard, const Vector6& load, const Vector6& way);

/// Is the load more than `limit`? One that is not finite is.
inline bool exceeds(const Vector6& load, const Load& limit) {
  return !(load.head<3>().squaredNorm() <= limit.force * limit.force &&
           load.tail<3>().squaredNorm() <= limit.torque * limit.torque);
}
/// detectionThreshold() over the limits.
inline constexpr double kDetectable = 0.1;
/// Load below which no contact is detected, and a stop isn't predicted.
inline Load detectionThreshold(const GuardLimits& limits) {
  return {kDetectable * limits.force, kDetectable * limits.torque};
}
/// Load of the coupling after the carrier has moved by `way` while the peg was at rest.
inline Vector6 loadAfter(const Braking& braking, const Vector6& load, const Vector6& way) {
  return load - braking.stiffness * way;
}
/// For each sample above detectionThreshold(): must the plant be stopped? `way`: stopping distance.
inline bool mustStop(const Braking& braking, const Vector6& load, const Vector6& way,
                     const Load& allowed) {
  return exceeds(load, allowed) || exceeds(loadAfter(braking, load, way), allowed);
}
/// Records that the plant was stopped by its load; the text has value and limit.
GuardVerdict overload(PlantGuard& guard, const Vector6& load, const Vector6& way);

}  // namespace assembly_cell
