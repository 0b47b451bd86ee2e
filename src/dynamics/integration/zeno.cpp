// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "zeno.h"

#include <algorithm>
#include <cmath>

#include "contact/contact_modes.h"
#include "contact/contact_tolerances.h"
#include "face/face.h"
#include "face/face_edge.h"
#include "impact/impact.h"
#include "integrator.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;
// A Zeno phase begins with kRecentEvents (24) events within kCluster: 120 kHz, hundreds of times
// the highest eigenfrequency of the mechanism (docs/theory/thesis.md). Half and twice: 14 and 16 of
// 400 random scenes end elsewhere, effort within 3 %; jammed runs take 13 % more and 1 % less.
constexpr double kCluster = 2e-4;  // [s]
// Length of a Zeno phase. Half and twice: 60 of 400 random scenes end elsewhere, effort −9 % and +8
// %; jammed runs −14 % and +89 %, as late mode decisions jam them again.
constexpr double kZenoSpan = 2e-3;  // [s]
// Maximum step in a Zeno phase, a hundredth of that. Half and twice: effort within 1 % in random
// scenes, 60 % more in jammed runs either way.
constexpr double kMaxZenoStep = 2e-5;  // [s]
// Rigid law: maximum free fall of a loaded point between two impacts, a tenth of the default
// tolerance. Half and twice: effort +12 % and −13 %; the run of Chapter 8 that ends flat moves by
// 0.2 um.
constexpr double kHop = 1e-10;  // [m]
// Under the rigid law a Zeno phase begins only for a flat peg (the least rocking moves its lowest
// point around the edge), or at three events a microsecond: two merging contact points that open
// each other. Half and twice: 9 and 8, 3 and 4 of 400 scenes end elsewhere, effort within 2 %.
constexpr double kFlatTilt = 1e-3;    // [rad]
constexpr double kStandstill = 8e-6;  // [s]
// Where a face can rest, a convergent series of events ends by itself: kRecentEvents events take
// less than this fraction of the time of those before. At 0.25 and 0.8 as many of 1000 scenes of
// test_agreement have a Zeno phase.
constexpr double kFaster = 0.5;
constexpr int kImpactPasses = 24;  // maximum number of impacts in a step
// Penetration tolerated by them, above the rounding of a gap: 14 of 400 scenes end elsewhere,
// effort within 1 %.
constexpr double kPenetration = 1e-12;  // [m]

void openAll(Context& c, Evaluation& e) {
  for (std::size_t i = 0; i < kSlots; ++i) setMode(i, Mode::kApart, c, e);
}

// Changes the velocities so that no gap is negative at the step's end t; returns the impulses [N
// s].
std::array<Vec3, kSlots> stopPenetration(const System& s, double t, Context& c, Evaluation& e) {
  const double h = t - c.time;
  const State start = c.state;
  std::array<Vec3, kSlots> impulse;
  impulse.fill(Vec3::Zero());
  evaluateFree(s, c.commands, c.time, c.state, e);
  const Vector9 fall = 0.5 * h * e.free;
  c.state.v += fall;
  for (Slot& slot : c.slots) slot.depth = 0.0;
  for (int pass = 0; pass < kImpactPasses; ++pass) {
    // mean velocity of the step, positions at its end
    c.state.q = start.q + h * c.state.v;
    openAll(c, e);
    evaluateFree(s, c.commands, t, c.state, e);
    locateAll(s, c, e);
    for (const std::size_t i : Slots(s.admitted & e.open_set.valid)) {
      const ContactPoint& point = e.point(i);
      if (point.gap > -kPenetration) continue;
      e.contacts[i].velocity += (point.gap / h - e.contacts[i].gap_rate) * point.normal;
      setMode(i, Mode::kIdle, c, e);
    }
    if (!e.closed) break;
    plasticImpact(s, e.closed, c, e);
    for (const std::size_t i : Slots(e.closed)) impulse[i] += e.contacts[i].force;
  }
  openAll(c, e);
  c.state.q = start.q;
  c.state.v -= fall;
  return impulse;
}

// Records an event at time t [s]; true if a Zeno phase is to begin.
bool isDense(const System& s, const Evaluation& e, double t, Context& c) {
  double& oldest =
      c.recent_events[static_cast<std::size_t>(c.counts.events) % Context::kRecentEvents];
  const double span = t - oldest;
  oldest = t;
  Cluster& before = c.cluster;
  if (span >= kCluster) {
    before = {};
    return false;
  }
  if (!s.discrete_friction || !(c.face.on || canRestOnFace(s, e.edge))) {
    return !s.rigid || isFlat(e) || span < kStandstill;
  }
  if (before.events-- > 0) return false;
  const bool faster = span < kFaster * before.span;
  before = {span, Context::kRecentEvents};
  return !faster;
}

}  // namespace

void recordEvent(const System& s, const Evaluation& e, double t, Context& c) {
  if (isDense(s, e, t, c)) beginZenoPhase(t, c);
}

void beginZenoPhase(double t, Context& c) {
  c.zeno_until = t + kZenoSpan;
  ++c.counts.zeno_phases;
}

bool isFlat(const Evaluation& e) { return std::hypot(e.k.a(1), e.k.a(2)) < kFlatTilt; }

double zenoStep(const System& s, const Evaluation& e, double h) {
  if (!s.rigid) {
    const double minimum =
        hasSprings(s) && !s.fixed_step ? std::min(kMinZenoStep, s.scenario.solver.max_step) : 0.0;
    return std::clamp(h, minimum, kMaxZenoStep);
  }
  return std::clamp(std::sqrt(8.0 * kHop / freeAcceleration(s, e)), kMinZenoStep, kMaxZenoStep);
}

void takeTimeSteppingStep(const System& s, double t, Context& c, Evaluation& e) {
  const double before = energyOf(s, c, e);
  dropFace(c, e);
  Trial flight;
  flight.h = t - c.time;
  const std::array<Vec3, kSlots> impulse = stopPenetration(s, t, c, e);
  limitEnergy(s, before, c, e);
  evaluateFree(s, c.commands, c.time, c.state, e);
  c.slope = e.free;
  c.carrier_deflection_rate = e.motion.carrier_deflection_rate;
  attemptStep(s, c, Method::kRk4, flight, e);
  c.time = t;
  c.state = flight.end;
  ++c.counts.steps;
  if (c.time >= c.zeno_until) {
    return findModesWithin(s, energyOf(s, c, e), c, e);
  }
  // mean forces of the step
  evaluatePresent(s, c, e);
  for (const std::size_t i : Slots(s.admitted & e.open_set.valid)) {
    if (impulse[i].isZero()) continue;
    ContactKinematics& at = e.contacts[i];
    at.force = impulse[i] / flight.h;
    const Vec3& normal = e.point(i).normal;
    at.normal_force = normal.dot(at.force);
    const Vec3 friction = at.force - at.normal_force * normal;
    const bool slides = friction.norm() >
                        0.999 * s.scenario.mechanism.friction.sliding_coefficient * at.normal_force;
    setMode(i, slides ? Mode::kSlip : Mode::kStick, c, e);
  }
}

}  // namespace assembly_cell
