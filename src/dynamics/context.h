// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Values shared by the parts of the simulation: constants of the system, context of a run, and the
// result of the last evaluation of the right-hand side. Thesis axes, SI units.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "assembly_cell/dynamics/commands.h"
#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {

/// Integrators of a scenario, and the linearly implicit one for slow slip (slow_slip.h).
enum class Method : std::uint8_t { kRk4, kDopri5, kDop853, kHamming, kSlowSlip };

/// Constants of a run: the scenario and values derived from it.
struct System {
  /// Throws InputError for a law or integrator that is not available.
  explicit System(const Scenario& s);
  EdgeCircle edge(const Kinematics& k) const {
    return {k.x - scenario.mechanism.peg.half_height * k.a, k.R0, k.R1,
            tipRadius(scenario.mechanism.peg)};
  }

  Scenario scenario;
  Method method = Method::kDopri5;
  bool fixed_step = false;
  bool rigid = false;
  bool discrete_friction = false;  ///< stick and slip are modes; else regularised friction
  bool compliant = false;          ///< see isCompliant()
  double leave_gap = 0.0;          ///< a contact opens above this [m]
  double slip_threshold = 0.0;     ///< slip slower than this is rest, see slipThreshold() [m/s]
  double fine_slip = 0.0;          ///< the same, of points off a face outside of Zeno phases
  /// Tolerance over 1e-9 m, limited to 1e-3 … 100: scale of hysteresis and of event locations.
  double coarseness = 1.0;
  InverseMass inverse_mass;
  double arm = 0.0;                            ///< from the centre of mass to the peg's edge [m]
  ContactSlotMask admitted = 0, excluded = 0;  ///< excluded: searched too, ends the run
  std::size_t slots = 0;                       ///< index of the last admitted one plus 1
  ContactShapes shapes;
};

/// Initial state of the scenario; with initial.close the peg is lowered into contact. Throws
/// InputError where no contact is reached.
State initialState(const System& s);

/// Mode of a slot between two decisions: apart (gap open), idle (closed, no force), slip, stick.
enum class Mode : std::uint8_t { kApart, kIdle, kSlip, kStick };
struct Slot {
  Mode mode = Mode::kApart;
  bool armed = false;  ///< slip has exceeded the threshold: its end is an event
  /// <= 0: gap at which the contact was found where one feature takes over from another without a
  /// common gap. The gap is held there until it opens [m].
  double depth = 0.0;
  double gap = HUGE_VAL, gap_rate = 0.0;  ///< at the step's start, of an open slot [m], [m/s]
  bool rises = false;  ///< at the step's start: apart, and the depth follows its gap up
  Eigen::Vector3d slip_direction =
      Eigen::Vector3d::Zero();  ///< opposite to friction while slip begins, unit
  Eigen::Vector3d slip_start =
      Eigen::Vector3d::Zero();  ///< unit, direction of slip at the step's start
  Eigen::Vector3d rest_force = Eigen::Vector3d::Zero();  ///< set by rest_forces.h [N]
};
using SlotArray = std::array<Slot, kSlots>;

/// Array of which the first `size` values are in use; a copy copies these only.
template <class T, std::size_t kCapacity>
class FirstOf {
 public:
  FirstOf() = default;
  explicit FirstOf(std::size_t size) : size_(size) {}
  FirstOf(const FirstOf& other) { *this = other; }
  FirstOf& operator=(const FirstOf& other) {
    size_ = other.size_;
    std::copy(other.begin(), other.end(), begin());
    return *this;
  }
  ~FirstOf() = default;
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) { return values_[i]; }
  const T& operator[](std::size_t i) const { return values_[i]; }
  const T* begin() const { return values_.data(); }
  const T* end() const { return values_.data() + size_; }
  T* begin() { return values_.data(); }
  T* end() { return values_.data() + size_; }

 private:
  std::array<T, kCapacity> values_;  // NOLINT: the first size_ are set
  std::size_t size_ = 0;
};

/// Values of the event functions: three for each slot, wedgeMargin() and faceEvent(). A mode
/// changes where one falls below zero.
constexpr std::size_t kEventKinds = 3;
class Events : public FirstOf<double, kEventKinds * kSlots + 2> {
 public:
  Events() = default;
  explicit Events(std::size_t slots) : FirstOf(kEventKinds * slots + 2) {
    std::fill(begin(), end(), HUGE_VAL);
  }
  double* ofSlot(std::size_t i) { return begin() + kEventKinds * i; }
  const double* ofSlot(std::size_t i) const { return begin() + kEventKinds * i; }
  double& wedge() { return end()[-2]; }
  double& face() { return end()[-1]; }
};

/// Face contact of the peg's bottom on plane or floor: three contact points on its edge (face.h),
/// in the slots 0 to 2 (edge_edge, edge_plane), which have no other point then. Of a face that
/// covers part of the hole, slots 0 and 1 are where edge and rim cross, except for one of them
/// while the centre of pressure is near the edge.
struct Face {
  bool on = false;
  ContactSlotMask crossings = 0;  ///< slots at crossings of edge and rim; 0: not over the hole
  double height = 0.0;            ///< height of plane or floor [m]
  std::array<double, 3> t = {};   ///< parameters of the points on the edge circle [rad]
  double across = 0.0;            ///< without a face: parameter opposite to the lowest point [rad]
  bool overHole() const { return crossings != 0; }
};
constexpr ContactSlotMask kFaceSlots = 7u;
constexpr ContactSlotMask kFacePlaneSlot = kEdgePlaneSlots & kFaceSlots;
constexpr ContactSlotMask kCrossingSlots = kEdgeEdgeSlots & kFaceSlots;
static_assert(kFacePlaneSlot != 0 && (kFacePlaneSlot | kCrossingSlots) == kFaceSlots);
/// Slots of the points of an active face.
inline ContactSlotMask facePoints(const Face& face) { return face.on ? kFaceSlots : 0u; }

/// Dense series of events that may end by itself (zeno.h).
struct Cluster {
  double span = HUGE_VAL;  ///< time between the last kRecentEvents events [s]
  int events = 0;          ///< number of events until the next check
};

/// State of a run: initial values and frozen modes of the next step.
struct Context {
  explicit Context(const System& s) : commands(s.scenario) { recent_events.fill(-1.0); }

  double time = 0.0;  ///< [s]
  State state;
  Vector9 slope = Vector9::Zero();  ///< v' at the present state
  Eigen::Vector3d carrier_deflection_rate =
      Eigen::Vector3d::Zero();  ///< rate of State::carrier_deflection there [m/s]
  bool stale = true;            ///< after a command: slope and the last evaluation are outdated
  Commands commands;
  SlotArray slots;
  Face face;
  double pull = 0.0, approach = 0.0;  ///< hysteresis of forces [N] and accelerations [m/s²]
  Events events;                      ///< at the start of the step
  double edge_speed = 0.0;            ///< upper bound of the speed of edge points there [m/s]
  double slip_turning = 0.0;          ///< slipTurning() there [1/s]
  double slip_falling = 0.0;          ///< slipFalling() there [1/s]
  double clearance = 0.0;      ///< no open slot closes before an edge point has moved by this [m]
  std::int64_t decisions = 0;  ///< number of mode decisions; solutions are smooth in between
  static constexpr std::size_t kRecentEvents = 24;
  std::array<double, kRecentEvents> recent_events;  ///< times [s]
  Cluster cluster;
  double zeno_until = -1.0;         ///< end of the Zeno phase, in which no event is located [s]
  double leapt = -1.0, leap = 0.0;  ///< end and length of the last leap [s]
  int short_steps = 0;              ///< number of consecutive steps below kShortStep
  RunCounts counts;                 ///< without evaluations
  StopReason stop = StopReason::kOk;
};

/// Kinematics and force of a slot's contact.
struct ContactKinematics {
  Eigen::Vector3d r = Eigen::Vector3d::Zero();  ///< lever from the centre of mass
  Eigen::Vector3d velocity =
      Eigen::Vector3d::Zero();  ///< velocity of the peg's material point [m/s]
  Eigen::Vector3d tangential = Eigen::Vector3d::Zero();  ///< velocity in the contact plane
  Eigen::Vector3d acceleration =
      Eigen::Vector3d::Zero();  ///< its acceleration without contact forces [m/s²]
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< on the peg
  ContactRates rates;
  double normal_force = 0.0;
  double gap = 0.0;  ///< geometric gap − Slot::depth [m]
  double gap_rate = 0.0;
  double demand = 0.0;  ///< idle slot: g'' + k g' + beta g without its force [m/s²]
};

/// Result and workspace of an evaluation of the right-hand side. Searches work on a copy.
struct Evaluation {
  explicit Evaluation(const System& s) : contacts(s.slots) {}
  const ContactPoint& point(std::size_t i) const {
    return (closed >> i & 1u ? closed_set : open_set).slots[i];
  }
  ContactSlotMask valid() const { return (closed & closed_set.valid) | (~closed & open_set.valid); }
  bool valid(std::size_t i) const { return (valid() >> i & 1u) != 0; }
  /// Closed slots with a valid point.
  ContactSlotMask active() const { return closed & closed_set.valid; }

  Kinematics k;
  EdgeCircle edge;
  FreeMotion motion;
  Vector9 free = Vector9::Zero();  ///< v' without contacts
  Eigen::Vector3d euler_rates = Eigen::Vector3d::Zero();
  ContactSlotMask face = 0;    ///< slots of the face contact
  ContactSlotMask closed = 0;  ///< slots whose mode is not kApart: searched in every evaluation
  ContactSet closed_set, open_set;              ///< points of closed and of the other slots
  FirstOf<ContactKinematics, kSlots> contacts;  ///< contacts of the admitted slots
  double wedge_margin = 1.0;                    ///< wedgeMargin() of the slipping points
  double loads = 0.0;                           ///< limit of internal forces over the load
  double moved = 0.0,
         speed =
             0.0;  ///< bounds: path of an edge point since the step's start [m], its speed [m/s]
  bool clear = false;      ///< no slot is closed, and by these bounds none can close
  bool coarse = false;     ///< in a Zeno phase
  bool present = false;    ///< the evaluation is of the state at which modes change next
  bool watched = true;     ///< false: open slots are not searched
  std::int64_t count = 0;  ///< right-hand sides so far
  // reused from one evaluation to the next
  EulerDirections near;      ///< base of kinematics()
  Direction drive_near;      ///< base of exciterForce()
  double drive_time = -1.0;  ///< time of drive_force [s]
  Eigen::Vector2d drive_force = Eigen::Vector2d::Zero();
};

/// Speed below which slip counts as rest [m/s].
inline double slipThreshold(const System& s, const Evaluation& e) {
  return e.coarse || e.face ? s.slip_threshold : s.fine_slip;
}

/// Range over the slots of a mask in rising order: for (const std::size_t i : Slots(mask)).
class Slots {
 public:
  explicit Slots(ContactSlotMask mask) : left_(mask) {}
  Slots begin() const { return *this; }
  Slots end() const { return Slots(0); }
  std::size_t operator*() const { return static_cast<std::size_t>(__builtin_ctz(left_)); }
  Slots& operator++() {
    left_ &= left_ - 1;
    return *this;
  }
  bool operator!=(const Slots& other) const { return left_ != other.left_; }

 private:
  ContactSlotMask left_;
};

}  // namespace assembly_cell
