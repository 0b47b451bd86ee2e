// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>

#include "assembly_cell/dynamics/model.h"

namespace assembly_cell {

struct Body;

/// How a run ended. kOk, or the named reason to stop.
enum class StopReason {
  kOk,
  kEdgeEdge,        ///< these five: a contact closes that contact.features excludes
  kEdgePlane,       ///< lowest edge point on the plane (or the hole's floor)
  kEdgeWall,        ///< edge on the wall of the hole
  kRimSide,         ///< rim on the peg's side
  kRimFace,         ///< rim on the peg's bottom face
  kPegTop,          ///< the rim has run off the side over the peg's top edge
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
  std::int64_t jams = 0;     ///< impacts without collision: slipping points wedged by friction
};

/// One contact as people and topics see it. Frame `hole`.
struct ContactReport {
  enum Feature : std::uint8_t { kEdgeEdge, kEdgePlane, kEdgeWall, kRimSide, kRimFace };
  enum State : std::uint8_t { kOpen = 0, kSlip = 1, kStick = 2 };
  Feature feature = kEdgeEdge;
  State state = kOpen;
  bool valid = false;                                 ///< the slot has a candidate point
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    ///< on the peg's edge [m]
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< from block to peg
  Eigen::Vector3d force = Eigen::Vector3d::Zero();    ///< on the peg, by the block [N]
  double gap = 0.0;                                   ///< [m]; < 0 penetrating
};

/// Contact slots, as geometry numbers them: edge–edge left and right of the lowest edge point,
/// edge–plane, then those of a peg in the hole.
constexpr int kSlots = kContactSlots;

/// The nine-degree-of-freedom mechanism in time. Deterministic: the same calls give the same bits.
/// No allocation after construction.
class Simulation {
 public:
  /// Throws InputError when the scenario asks for what is not available (law, integrator).
  explicit Simulation(const Scenario& scenario);

  double time() const { return time_; }  ///< [s] from the start of the scenario
  const State& state() const { return state_; }
  /// Rates of state().v at the end of the last step.
  const Vector9& acceleration() const { return slope_v_; }
  const Scenario& scenario() const { return scenario_; }
  const RunCounts& counts() const { return counts_; }
  StopReason stopReason() const { return stop_; }

  /// Integrates to exactly t_end, or stops earlier with a reason. Returns stopReason(). Comes back
  /// after so many `attempts` at a step, time() before t_end: the next call goes on, same bits.
  StopReason advance(double t_end,
                     std::int64_t attempts = std::numeric_limits<std::int64_t>::max());

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
  // what a slot does between two decisions: apart (gap open), idle (in reach, no force), slip,
  // stick
  enum class Mode : std::uint8_t { kApart, kIdle, kSlip, kStick };
  struct Slot {
    Mode mode = Mode::kApart;
    bool armed = false;  // slip has been fast enough for the stop event
    // <= 0: found this deep where features hand over without a common gap; kept there, never pushed
    // out, until the gap opens
    double depth = 0.0;
    Eigen::Vector3d slip_direction = Eigen::Vector3d::Zero();  // of friction while slip begins
    Eigen::Vector3d slip_start = Eigen::Vector3d::Zero();  // unit, of the slip at the step's start
  };
  // what the last evaluation found at a slot
  struct Touch {
    Eigen::Vector3d r = Eigen::Vector3d::Zero();             // lever from the centre of mass
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();      // of the material point
    Eigen::Vector3d tangential = Eigen::Vector3d::Zero();    // its part along the contact plane
    Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // of the material point, force-free
    Eigen::Vector3d force = Eigen::Vector3d::Zero();         // on the peg
    ContactRates rates;
    double normal_force = 0.0;
    double gap = 0.0;  // over the slot's depth
    double gap_rate = 0.0;
    double demand = 0.0;  // g'' + k g' + beta g without a force on an idle slot
  };
  // how much an evaluation must find: forces alone, what events need, what people see
  enum class Look : std::uint8_t { kForces, kEvents, kReport };
  enum class Method : std::uint8_t { kRk4, kDopri5, kDop853, kHamming };
  // the past of a multistep method: rows 0 (oldest) to count − 1 (present state)
  struct History {
    static constexpr int kMost = 7;
    std::array<State, kMost> y, slope;
    State defect;  // predictor less corrector of the last step
    int count = 0;
    double h = 0.0;
  };

  RestMotion restAt(double t) const { return restMotion(profile_, t); }
  bool rigid() const { return scenario_.contact.law == ContactLaw::kRigid; }
  bool discreteFriction() const;
  double leaveGap() const;
  const ContactPoint& point(std::size_t i) const {
    return (closed_ >> i & 1u ? closed_set_ : open_set_).slots[i];
  }
  bool valid(std::size_t i) const {
    return ((closed_ >> i & 1u ? closed_set_ : open_set_).valid >> i & 1u) != 0;
  }
  void setMode(std::size_t i, Mode mode);
  void keepDepth(std::size_t i, double handed);
  void healDepths();

  // one right-hand side: free motion, contact points, contact forces
  Vector9 evaluate(double t, const State& state, Look look);
  void setProfile(const RestProfile& profile);
  void evaluateFree(double t, const State& state);
  void locate(ContactSlotMask mask, ContactSet& set);
  void locateAll();
  double edgeSpeed() const;
  Body body() const;
  Vector9 accelerationBy(const Eigen::Vector3d& force, const Eigen::Vector3d& moment) const;
  Vector9 withContacts(Look look);
  void solveRegularised();
  void solveModes(Look look);
  void shareInternalForce(std::size_t one, std::size_t two, double most);
  void shareInternalForces(ContactSlotMask points, double most);
  bool inCones(ContactSlotMask points, double by) const;
  double coneExcess(std::size_t i) const;

  // who carries, slips and rests; what the rigid law does to velocities and positions
  void findModes(bool initial);
  void decide(int again = 0);
  bool contradicted(double limit) const;
  void turnSlip();
  double slipAhead(std::size_t i) const;
  bool stopTurnedSlip();
  void impact();
  void plasticImpact(ContactSlotMask points);
  std::size_t fastestApproach(double speed) const;
  void restitutionImpacts();
  Eigen::Vector3d restitutionImpulse(std::size_t i) const;
  void jam(bool everything = false);
  bool restInCones(ContactSlotMask points, ContactSlotMask others);
  void project();
  void stormStep(double t);
  void limitEnergy(double most);
  void applyImpulse(const Eigen::Vector3d& impulse, const Eigen::Vector3d& moment);

  // one step from the present state with the modes frozen; returns error over tolerance
  double tryStep(double h, State& end, Vector9& slope);
  double tryOneStep(Method method, double h, State& end, Vector9& slope);
  double tryHamming(double h, State& end, Vector9& slope);
  template <class Tableau>
  double tryTableau(double h, State& end, Vector9& slope);
  using Vector18 = Eigen::Matrix<double, 18, 1>;  // a state, q before v
  double errorOf(const Vector18& error) const;
  double errorOf(const State& error) const;
  void remember(double h);
  void resetDefect();
  void halveHistory();
  void doubleHistory();

  // events on the interpolant of a step
  static constexpr std::size_t kEventKinds = 3;
  using Events = std::array<double, kEventKinds * kSlots + 1>;  // the last: friction wedges
  Events eventValues() const;
  double locateEvent(double h, const Events& at_end, State& end, Vector9& slope);
  State interpolate(double h, const State& end, const Vector9& slope, double tau) const;
  void accept(double t, const State& end, const Vector9& slope);
  void startStep();
  void changeModes();
  bool flat() const;   // the peg's tilt is too small to tell its lowest point
  bool slips() const;  // some point has a slip to lose
  bool hiddenEvent(double h, const State& end, const Vector9& slope);
  bool storm(double t);
  void refresh();
  void checkState();
  StopReason excludedContact() const;
  double planStep(double t_end, bool& last) const;
  double freeAcceleration() const;
  double coarseStep() const;
  bool shorten(double h, double error, bool finite);
  void lengthen(double h, double error, bool last, double t_end);

  Scenario scenario_;
  State state_;
  double time_ = 0.0;
  RestProfile profile_;
  RestMotion settled_;  // of the rest pose once the profile has ended
  Drive drive_;
  RunCounts counts_;
  StopReason stop_ = StopReason::kOk;
  EulerDirections near_;      // at the start of the step
  double drive_time_ = -1.0;  // of drive_force_, kept for the stages at one time [s]
  Eigen::Vector2d drive_force_ = Eigen::Vector2d::Zero();
  Vector9 slope_v_;    // v' at the present state
  bool stale_ = true;  // slope_v_, touches_ and now_ don't belong to the present state

  // contacts
  ContactSlotMask admitted_ = 0, excluded_ = 0;  // excluded: watched, ends the run
  ContactShapes shapes_;
  std::array<Slot, kSlots> slots_;
  std::array<Touch, kSlots> touches_;
  ContactSlotMask closed_ = 0;        // slots that are not apart
  ContactSet closed_set_, open_set_;  // their points, and the others'
  double clearance_ = 0.0;            // no open slot closes before an edge point moved this far [m]
  double moved_ = 0.0, speed_ = 0.0;  // of the edge in the step, at its end: bounds
  bool clear_ = false;                // the last evaluation has left out the search by them
  double arm_ = 0.0;                  // from the centre of mass to the edge [m]
  Events start_events_;               // event functions at the start of the step
  double start_speed_ = 0.0;          // of the edge's fastest point, at the start of the step
  double slip_threshold_ = 0.0;       // slip slower than this is rest [m/s]
  double wedge_margin_ = 1.0;         // of the slipping points, as of wedgeMargin()
  double pull_ = 0.0, approach_ = 0.0;  // hysteresis of forces [N] and accelerations [m/s²]
  std::array<ContactReport, kSlots> report_;

  // the last evaluation
  struct Now {
    Kinematics k;
    EdgeCircle edge;
    FreeMotion motion;
    Vector9 free = Vector9::Zero();  // v' without contacts
    Eigen::Vector3d rates;           // of the Euler angles
  } now_;

  // integration
  Method method_ = Method::kDopri5;
  bool fixed_step_ = false;
  History history_;
  State trial_defect_;
  bool bridging_ = false;  // hamming: one step of another method, past what it can't start in
  double next_step_ = 0.0;

  // storms of events: a peg that lies flat
  static constexpr std::size_t kRecentEvents = 24;
  std::array<double, kRecentEvents> recent_events_;  // times [s]
  double coarse_until_ = -1.0;                       // no event is located before this time [s]
};

}  // namespace assembly_cell
