// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "assembly_cell/dynamics/model.h"

namespace assembly_cell {

/// How a run ended. kOk, or the named reason to stop.
enum class StopReason {
  kOk,
  kEdgePlane,       ///< lowest point on the plane, and features exclude edge_plane
  kSingular,        ///< sin(theta) < 0.1: peg nearly horizontal
  kInitialOverlap,  ///< a state deeper than 1e-8 m in the block, refused by the rigid law
  kNonFinite,       ///< state or acceleration not finite
  kStepTooSmall,    ///< error control asks for steps below 1e-13 s
  kEventLimit,      ///< more events than a run may have
};
const char* toString(StopReason reason);

struct RunCounts {
  std::int64_t evaluations = 0;  ///< right-hand sides
  std::int64_t steps = 0;        ///< accepted
  std::int64_t rejected = 0;
  std::int64_t events = 0;   ///< contact opened, closed, stick, slip
  std::int64_t impacts = 0;  ///< contacts closed at an approaching speed
};

/// One contact as people and topics see it. Frame `hole`.
struct ContactReport {
  enum Feature : std::uint8_t { kEdgeEdge = 0, kEdgePlane = 1 };
  enum State : std::uint8_t { kOpen = 0, kSlip = 1, kStick = 2 };
  Feature feature = kEdgeEdge;
  State state = kOpen;
  bool valid = false;                                 ///< the slot has a candidate point
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< on the peg's edge [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< from block to peg
  Eigen::Vector3d force = Eigen::Vector3d::Zero();    ///< on the peg, by the block [N]
  double gap = 0.0;                                   ///< [m]; < 0 penetrating
};

/// Contact slots: two edge–edge candidates (thesis: left and right of the lowest edge point), then
/// the edge–plane candidate.
constexpr int kSlots = 3;

/// The nine-degree-of-freedom mechanism in time. Deterministic: the same calls give the same bits.
/// No allocation after construction.
class Simulation {
 public:
  /// Throws InputError when the scenario asks for what is not available (law, integrator).
  explicit Simulation(const Scenario& scenario);

  double time() const { return time_; }  ///< [s] from the start of the scenario
  const State& state() const { return state_; }
  const Scenario& scenario() const { return scenario_; }
  const RunCounts& counts() const { return counts_; }
  StopReason stopReason() const { return stop_; }

  /// Integrates to exactly t_end, or stops earlier with a reason. Returns stopReason().
  StopReason advance(double t_end);

  /// From now on move the rest pose to `target` along a C² profile within the carrier's limits.
  void setRestTarget(const RestPose& target);
  /// Rest pose at the present time.
  RestPose rest() const { return restPose(restAt(time_).position); }
  /// True until the profile has reached its target.
  bool restMoving() const { return time_ < profile_.start + profile_.duration; }

  /// Exciter from now on. `angle_at` is the force angle law: direction·(frequency·(t − t_ref) +
  /// phase) with t_ref on the simulation's clock.
  void setExciter(const ExciterParameters& exciter, double t_ref);

  /// Replaces the state (same time); contacts are found anew.
  void setState(const State& state);

  /// Contacts at the present time. Forces are those of the last evaluation.
  const std::array<ContactReport, kSlots>& contacts();

  /// Wrench of the peg's coupling on sensor_b (contact + weight when at rest), in the axes of the
  /// carrier frame about its origin: force, torque. [N], [N·m]
  Vector6 couplingWrench();
  /// Deflection of the coupling: translation of the coupling point relative to its rest and
  /// rotation vector, in the axes of the carrier frame. [m], [rad]
  Vector6 couplingDeflection();
  /// Wrench of the peg on the hole block about the origin of `hole` in its axes. [N], [N·m]
  Vector6 holeWrench();

  Pose pegPose() const;      ///< X_H,peg: frame `peg` (bottom edge centre) in `hole`
  Pose carrierPose() const;  ///< X_H,carrier: coupling rest point with tilt and yaw, in `hole`
  double energy() const;     ///< kinetic + coupling + carrier springs + weight [J]

 private:
  // what a slot does: apart (gap open), idle (in reach but no force), slip, stick
  enum class Mode : std::uint8_t { kApart, kIdle, kSlip, kStick };
  struct Slot {
    Mode mode = Mode::kApart;
    ContactPoint point;                                        // at the last evaluation
    Eigen::Vector3d r = Eigen::Vector3d::Zero();               // lever from the centre of mass
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();        // of the material point
    Eigen::Vector3d tangential = Eigen::Vector3d::Zero();      // its part along the contact plane
    Eigen::Vector3d force = Eigen::Vector3d::Zero();           // on the peg
    Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();    // of the material point, force-free
    Eigen::Vector3d slip_direction = Eigen::Vector3d::Zero();  // of friction while slip begins
    double normal_force = 0.0;
    double gap_rate = 0.0;
    ContactRates rates;
    double demand = 0.0;  // g'' + k g' + beta g without a force on an idle slot
    bool armed = false;   // slip has been fast enough for the stop event
  };
  using Slots = std::array<Slot, kSlots>;

  RestMotion restAt(double t) const { return restMotion(profile_, t); }
  void locate(const Kinematics& k, Slots& slots);
  Vector9 evaluate(double t, const State& state, Slots& slots, bool share = true);
  void solveRegularised(const Kinematics& k, Slots& slots) const;
  void solveModes(const Kinematics& k, Slots& slots, bool share) const;
  void decide();
  void shareInternalForce(Slots& slots) const;
  void findModes(bool initial);
  bool rigid() const { return scenario_.contact.law == ContactLaw::kRigid; }
  bool discreteFriction() const;
  void impact();
  void project();
  void applyImpulse(const Kinematics& k, const Eigen::Vector3d& impulse,
                    const Eigen::Vector3d& moment);
  double tryStep(double h, State& end, Vector9& slope, Slots& slots);
  double eventValue(const Slots& start, const Slots& end) const;
  void accept(double t, const State& end, const Vector9& slope, const Slots& slots);
  void refresh();
  bool finite(const State& state) const;

  Scenario scenario_;
  State state_;
  double time_ = 0.0;
  RestProfile profile_;
  Drive drive_;
  RunCounts counts_;
  StopReason stop_ = StopReason::kOk;
  Slots slots_;
  Vector9 slope_v_;          // v' at the present state
  FreeMotion motion_;        // at the last evaluation
  bool fixed_step_ = false;  // rk4
  bool stale_ = true;        // slope_v_, slots_ and motion_ don't belong to the present state
  double next_step_ = 0.0;
  double slip_threshold_ = 0.0;
  static constexpr std::size_t kRecentEvents = 24;
  std::array<double, kRecentEvents> recent_events_;  // times [s]
  double coarse_until_ = -1.0;                       // no event is located before this time [s]
  std::array<ContactReport, kSlots> report_;
};

}  // namespace assembly_cell
