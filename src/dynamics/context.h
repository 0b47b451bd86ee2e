// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The values that the parts of the simulation work on: the constant system, the explicit context of
// a run, and what the last evaluation of the right-hand side found.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "assembly_cell/dynamics/commands.h"
#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {

/// Integrators of a scenario, and the one that takes over where slip is slow (slow_slip.h).
enum class Method : std::uint8_t { kRk4, kDopri5, kDop853, kHamming, kSlowSlip };

/// What is constant in a run: the scenario and what follows from it.
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
  bool compliant = false;          ///< the carrier gives way behind its encoders
  double leave_gap = 0.0;          ///< a contact opens above this [m]
  double slip_threshold = 0.0;     ///< slip slower than this is rest, see slipThreshold() [m/s]
  double fine_slip = 0.0;          ///< the same of points that are no face, but amid chatter
  /// Tolerance over 1e-9 m, from 1e-3 to 100: as far as hysteresis and places of events follow it.
  double coarseness = 1.0;
  InverseMass inverse_mass;
  double arm = 0.0;                            ///< from the centre of mass to the peg's edge [m]
  ContactSlotMask admitted = 0, excluded = 0;  ///< excluded: watched, ends the run
  std::size_t slots = 0;                       ///< up to the last admitted one
  ContactShapes shapes;
};

/// The scenario's start; lowered into contact where it says so. Throws InputError where there is
/// none.
State initialState(const System& s);

/// What a slot does between two decisions: apart (gap open), idle (in reach, no force), slip,
/// stick.
enum class Mode : std::uint8_t { kApart, kIdle, kSlip, kStick };
struct Slot {
  Mode mode = Mode::kApart;
  bool armed = false;  ///< slip has been fast enough for the event of its end
  /// <= 0: found this deep where features hand over without a common gap; kept there, never pushed
  /// out, until the gap opens [m]
  double depth = 0.0;
  double gap = HUGE_VAL, gap_rate = 0.0;  ///< at the step's start, while apart [m], [m/s]
  bool rises = false;  ///< at the step's start: apart, and the depth follows its gap up
  Eigen::Vector3d slip_direction = Eigen::Vector3d::Zero();  ///< of friction while slip begins
  Eigen::Vector3d slip_start = Eigen::Vector3d::Zero();  ///< unit, of the slip at the step's start
  Eigen::Vector3d rest_force = Eigen::Vector3d::Zero();  ///< kept by rest_forces.h [N]
};
using SlotArray = std::array<Slot, kSlots>;

/// An array of which the first `size` values are used: copies copy no others.
template <class T, std::size_t kMost>
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
  std::array<T, kMost> values_;  // NOLINT: the first size_ are set
  std::size_t size_ = 0;
};

/// Event functions: three a slot, how far friction is from a wedge, and how far a face is from
/// lying down or leaving. Below zero a mode must change.
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

/// The peg's face lies on plane or floor: it is carried at three points of its edge (face.h), in
/// the slots of edge and upper rim and of edge and plane. None of these has another point then.
/// Where the face reaches over the hole the slots of edge and rim have the places where these
/// cross, but for one of them while the pressure is near the edge.
struct Face {
  bool on = false;
  ContactSlotMask crossings = 0;  ///< slots whose places cross the rim; none: not over the hole
  double height = 0.0;            ///< of plane or floor [m]
  std::array<double, 3> t = {};   ///< the points' places on the edge
  double across = 0.0;            ///< before: the place across from the one on the ground
  bool overHole() const { return crossings != 0; }
};
constexpr ContactSlotMask kFaceSlots = 7u;
constexpr ContactSlotMask kFacePlaneSlot = kEdgePlaneSlots & kFaceSlots;
constexpr ContactSlotMask kCrossingSlots = kEdgeEdgeSlots & kFaceSlots;
static_assert(kFacePlaneSlot != 0 && (kFacePlaneSlot | kCrossingSlots) == kFaceSlots);
/// Slots whose points are the face's own.
inline ContactSlotMask facePoints(const Face& face) { return face.on ? kFaceSlots : 0u; }

/// Events that are dense but come to an end (chatter.h).
struct Cluster {
  double span = HUGE_VAL;  ///< time that the last kRecentEvents of them took [s]
  int events = 0;          ///< so many until they are looked at again
};

/// Where a run is: everything that the next step starts from and takes as frozen.
struct Context {
  explicit Context(const System& s) : commands(s.scenario) { recent_events.fill(-1.0); }

  double time = 0.0;  ///< [s]
  State state;
  Vector9 slope = Vector9::Zero();                      ///< v' at the present state
  Eigen::Vector3d give_rate = Eigen::Vector3d::Zero();  ///< of State::give there [m/s]
  bool stale = true;  ///< after a command: slope and the last evaluation are not of the present
  Commands commands;
  SlotArray slots;
  Face face;
  double pull = 0.0, approach = 0.0;  ///< hysteresis of forces [N] and accelerations [m/s²]
  Events events;                      ///< at the start of the step
  double edge_speed = 0.0;            ///< of the edge's fastest point there, a bound [m/s]
  double slip_turning = 0.0;          ///< rate at which friction turns slip there [1/s]
  double slip_falling = 0.0;          ///< rate at which slip that comes to rest falls there [1/s]
  double clearance = 0.0;      ///< no open slot closes before an edge point moved this far [m]
  std::int64_t decisions = 0;  ///< times that modes were decided: solutions are smooth in between
  static constexpr std::size_t kRecentEvents = 24;
  std::array<double, kRecentEvents> recent_events;  ///< times [s]
  Cluster cluster;
  double chatter_until = -1.0;      ///< no event is located before this time [s]
  double leapt = -1.0, leap = 0.0;  ///< end and length of the last leap [s]
  int crawling = 0;                 ///< very short steps in a row
  RunCounts counts;                 ///< without evaluations
  StopReason stop = StopReason::kOk;
};

/// Kinematics of a slot's contact, and its force.
struct ContactKinematics {
  Eigen::Vector3d r = Eigen::Vector3d::Zero();             ///< lever from the centre of mass
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();      ///< of the material point
  Eigen::Vector3d tangential = Eigen::Vector3d::Zero();    ///< its part along the contact plane
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  ///< of the material point, force-free
  Eigen::Vector3d force = Eigen::Vector3d::Zero();         ///< on the peg
  ContactRates rates;
  double normal_force = 0.0;
  double gap = 0.0;  ///< over the slot's depth
  double gap_rate = 0.0;
  double demand = 0.0;  ///< g'' + k g' + beta g without a force on an idle slot
};

/// What one right-hand side finds. A part that looks ahead works on a copy.
struct Evaluation {
  explicit Evaluation(const System& s) : contacts(s.slots) {}
  const ContactPoint& point(std::size_t i) const {
    return (closed >> i & 1u ? closed_set : open_set).slots[i];
  }
  ContactSlotMask valid() const { return (closed & closed_set.valid) | (~closed & open_set.valid); }
  bool valid(std::size_t i) const { return (valid() >> i & 1u) != 0; }
  /// Closed slots that have a point.
  ContactSlotMask active() const { return closed & closed_set.valid; }

  Kinematics k;
  EdgeCircle edge;
  FreeMotion motion;
  Vector9 free = Vector9::Zero();  ///< v' without contacts
  Eigen::Vector3d euler_rates = Eigen::Vector3d::Zero();
  ContactSlotMask face = 0;         ///< slots that carry the peg's face, level on its ground
  ContactSlotMask closed = 0;       ///< slots that are not apart: searched in every evaluation
  ContactSet closed_set, open_set;  ///< their points, and the others'
  FirstOf<ContactKinematics, kSlots> contacts;  ///< of the slots that the run may use
  double wedge_margin = 1.0;                    ///< of the slipping points, as of wedgeMargin()
  double loads = 0.0;               ///< force between sticking points, of their load, at most
  double moved = 0.0, speed = 0.0;  ///< of the edge since the step's start, and now: bounds
  bool clear = false;               ///< open slots were left out by these bounds, none is closed
  bool coarse = false;              ///< amid chatter
  bool present = false;  ///< of an event that changes modes next: all is known of that state
  bool watched = true;   ///< open slots are searched where events are; else they stay as they were
  std::int64_t count = 0;  ///< right-hand sides so far
  // kept from one to the next because they cost
  EulerDirections near;      ///< angles near those of the step
  Direction drive_near;      ///< direction near that of the exciter's force
  double drive_time = -1.0;  ///< of drive_force [s]
  Eigen::Vector2d drive_force = Eigen::Vector2d::Zero();
};

/// Slip slower than this is rest [m/s].
inline double slipThreshold(const System& s, const Evaluation& e) {
  return e.coarse || e.face ? s.slip_threshold : s.fine_slip;
}

/// The slots of a mask, rising: for (const std::size_t i : Slots(mask)).
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
