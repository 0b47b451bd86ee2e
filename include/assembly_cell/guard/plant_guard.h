// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <string>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// What stands between whoever commands a machine and the machine: a lease that has to be kept
/// alive, limits, and a dead man. The simulator uses it as a bridge to a real arm will: it is told
/// of leases, commands and loads and says what to do. All times are cell time [s].

enum class LeaseMode {
  kAuto,      ///< while a session holds the plant only its node commands; else anybody
  kRequired,  ///< nobody commands without a session
  kNone       ///< no sessions: leases are not looked at
};

struct GuardLimits {
  double force = 100.0, torque = 10.0;        ///< load of the coupling, weight included [N], [N·m]
  double amplitude = 50.0, frequency = 2e4;   ///< of the exciter [N], [rad/s]
  Eigen::Vector3d box_min{-0.1, -0.1, -0.1};  ///< of commanded positions, carrier's base,
  Eigen::Vector3d box_max{0.1, 0.1, 0.1};     ///< from the start [m]
  double rotation = 0.35;                     ///< of the same [rad]
  double lease_time = 0.1;                    ///< without a sign of life: hold, exciter off [s]
  double lone_exciter = 10.0;                 ///< that nobody holds runs no longer [s]
};

/// Why something was refused or stopped.
enum class GuardReason {
  kNone,
  // commands and leases
  kOwnedByAnother,
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

/// What became of a lease or a command. `text` is one line with value and limit; empty if good.
struct GuardVerdict {
  GuardReason reason = GuardReason::kNone;
  std::string text;
  bool good() const { return reason == GuardReason::kNone; }
};

/// What the plant does now.
struct GuardAction {
  GuardReason reason = GuardReason::kNone;  ///< why the plant was stopped; kNone: it wasn't
  bool hold = false;                        ///< bring the carrier to a stop where it is
  bool exciter_off = false;
};

/// Who sends, and how old what it knows is.
struct Sender {
  std::string node;
  double stamp = 0.0;    ///< of the message: end of the last block that the sender has seen
  bool stamped = false;  ///< false: `stamp` says nothing
  bool latched = false;  ///< sent before this plant came to life: kept by its publisher
};

/// What an exciter is told.
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

/// How a carrier comes to rest, and what its coupling makes of the way that it takes.
struct Braking {
  Matrix6 stiffness = Matrix6::Zero();  ///< of the coupling, see couplingStiffness(); 0: not known
  double acceleration = 1.0;            ///< of a stop [m/s²]
  double arm = 0.0;                     ///< of a turn: metres of way a radian [m]
};

struct PlantGuard {
  GuardLimits limits;
  Braking braking;
  LeaseMode mode = LeaseMode::kAuto;
  bool lockstep =
      false;   ///< the clock begins anew in each life: a later stamp is of an earlier one
  Pose start;  ///< of the carrier in its base: middle of the workspace

  // the session
  std::string owner;          ///< node; empty: nobody holds the plant
  std::uint32_t session = 0;  ///< its number
  double seen = 0.0;          ///< end of the last block that the holder is known to have seen
  bool expired = false;       ///< the lease ran out
  // the plant
  bool overloaded = false;  ///< stopped by its load: until a move up or another session
  Load load;                ///< of the coupling at the last block's end
  Load allowed;             ///< at present: more than the limits while a load is being taken off
  bool shaking = false;     ///< exciter on by command
  double shaking_since = 0.0;
  double height = 0.0;  ///< of the carrier's commanded pose at present, z in its base [m]
};
PlantGuard plantGuard(const GuardLimits& limits, LeaseMode mode, bool lockstep);

/// Is what comes from there older than this run of the plant? A restarted plant does not move by
/// itself.
bool isFromEarlierBoot(const PlantGuard& guard, const Sender& sender, double now);

/// A sign of life of a session at `now`; session 0 lets the plant go. A session begins with its
/// first one, with the exciter off and the carrier brought to a stop. Refused while another node
/// holds the plant; one whose lease lapsed a second ago holds it no longer.
GuardVerdict renewLease(PlantGuard& guard, const Sender& sender, std::uint32_t session, double now,
                        GuardAction& action);

/// A move of the carrier to X, in its base. What the holder sends is a sign of life, too.
GuardVerdict checkMove(PlantGuard& guard, const Sender& sender, const Pose& X, double now);
/// An exciter command; amplitude 0 is off, which anybody may ask for whenever it is not stale.
GuardVerdict checkExciter(PlantGuard& guard, const Sender& sender, const ExciterCommand& drive,
                          double now);

/// Once a block, before it begins: the dead man. `load` of the coupling and height of the carrier
/// as of now.
GuardAction watch(PlantGuard& guard, const Vector6& load, double height, double now);

/// How fast a move by `way` (translation and rotation vector in the carrier's axes) may become: a
/// stop at any moment of it ends within the allowed load, if the peg meets something that doesn't
/// give way. `load` as of now. At least a millimetre a second, or nothing could be relieved. [m/s]
double speedLimit(const PlantGuard& guard, const Vector6& load, const Vector6& way);

/// Is the load more than `limit`? One that is not finite is.
inline bool exceeds(const Vector6& load, const Load& limit) {
  return !(load.head<3>().squaredNorm() <= limit.force * limit.force &&
           load.tail<3>().squaredNorm() <= limit.torque * limit.torque);
}
/// A tenth of the limits: below it no contact is felt, and what a stop would add isn't asked.
inline Load detectionThreshold(const GuardLimits& limits) {
  constexpr double kFelt = 0.1;
  return {kFelt * limits.force, kFelt * limits.torque};
}
/// Of the coupling when the carrier has gone on by `way` and the peg stood still.
inline Vector6 loadAfter(const Braking& braking, const Vector6& load, const Vector6& way) {
  return load - braking.stiffness * way;
}
/// Every sample whose load is felt: has the plant to be stopped? `way` is what a stop would take.
inline bool mustStop(const Braking& braking, const Vector6& load, const Vector6& way,
                     const Load& allowed) {
  return exceeds(load, allowed) || exceeds(loadAfter(braking, load, way), allowed);
}
/// It had to, and has been stopped. The text has value and limit.
GuardVerdict overload(PlantGuard& guard, const Vector6& load, const Vector6& way);

}  // namespace assembly_cell
