// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/math/roots.h"
#include "contact/contact_tolerances.h"
#include "context.h"

namespace assembly_cell {
namespace {

// Slip speed that counts as rest: of a point; of a face and in Zeno phases, which would take ten
// times the steps with the former. Part of the compliant laws as v_ST is of the thesis's, and
// therefore independent of the tolerance: at 1e-9 and 1e-12 m, 2 % of the block ends of alignments
// differ by more than 1e-9 m, 10 % if it is proportional to the tolerance. Half and twice of the
// first: 3 % and 3 %, evaluations up to 4 % more, and as many.
constexpr double kRestSpeed = 3e-7, kFaceRestSpeed = 1e-5;  // [m/s]
// Lower bounds over the tolerance: the error of a step's velocities.
constexpr double kRestOverTolerance = 300.0, kFaceRestOverTolerance = 1e4;  // [1/s]
// Under the rigid law it is proportional to the tolerance, down to this.
constexpr double kMinRestSpeed = 1e-8;  // [m/s]
// Maximum penetration of an impact at 0.7 m/s or a load of 1 kN at 1e6 N/m, under the default laws.
constexpr double kFlush = 1e-3;  // [m]

Method methodOf(const std::string& name) {
  if (name == "rk4") return Method::kRk4;
  if (name == "hamming") return Method::kHamming;
  if (name == "dop853") return Method::kDop853;
  if (name == "dopri5") return Method::kDopri5;
  throw InputError("solver.integrator: " + name +
                   " is not available; use hamming, rk4, dopri5 or dop853");
}

// Smallest gap of the admitted features with the peg's centre of mass at this height [m]; set: warm
// start and result.
double smallestGap(const System& s, State at, double height, ContactSet& set) {
  at.q(0) = height;
  findContacts(s.edge(kinematics(at)), s.shapes, s.admitted & ~s.excluded, set);
  double gap = 1.0;
  for (const std::size_t i : Slots(set.valid)) gap = std::min(gap, set.slots[i].gap);
  return gap;
}

// Lowers the peg until the smallest gap, which decreases with the height, is zero.
double closedHeight(const System& s, const State& start) {
  ContactSet set;
  const auto smallest = [&](double height) { return smallestGap(s, start, height, set); };
  double high = start.q(0), low = high;
  const double span = s.scenario.mechanism.peg.half_height + s.scenario.mechanism.peg.radius;
  double step = 1e-4 * span;
  while (smallest(high) <= 0.0 && high < start.q(0) + 2 * span) high += step, step *= 1.5;
  step = 1e-4 * span;
  while (smallest(low) > 0.0 && low > start.q(0) - 4 * span) {
    high = low;
    low -= step;
    step = std::min(1.2 * step, 0.02 * span);
  }
  if (smallest(low) > 0.0 || smallest(high) <= 0.0) {
    throw InputError(
        "initial.close: true, but lowering the peg closes no contact of contact.features; "
        "move initial.peg.position over the block or set close: false");
  }
  return rootIn(low, high, smallest, 1e-17).high;
}

// Length of the side for the contact search: of a peg as long as the hole is deep, extended by
// kFlush, the penetration of contacts when it is seated.
double lengthOf(const Mechanism& mechanism) {
  const double length = 2.0 * mechanism.peg.half_height;
  const bool flush = std::abs(length - mechanism.hole.depth) < kFlush;
  return flush ? length + kFlush : length;
}

}  // namespace

ContactShapes shapesOf(const Scenario& scenario) {
  const HoleParameters& hole = scenario.mechanism.hole;
  const PegParameters& peg = scenario.mechanism.peg;
  ContactShapes shapes;
  shapes.hole_radius = hole.radius;
  shapes.hole_depth = hole.depth;
  shapes.peg_length = lengthOf(scenario.mechanism);
  shapes.bore_lean = scenario.imperfections.bore_lean;
  if (hole.chamfer_width > 0.0) shapes.chamfer = chamferOf(hole.chamfer_width, hole.chamfer_angle);
  if (peg.chamfer_width > 0.0) shapes.peg_chamfer = chamferOf(peg.chamfer_width, peg.chamfer_angle);
  return shapes;
}

System::System(const Scenario& given)
    : scenario(given), method(methodOf(given.solver.integrator)), inverse_mass(given.mechanism) {
  const SolverParameters& solver = scenario.solver;
  const ContactParameters& contact = scenario.contact;
  if (method == Method::kRk4 && !(solver.step > 0.0)) {
    throw InputError("solver.step: integrator rk4 needs a fixed step; set solver.step > 0 [s]");
  }
  fixed_step = method == Method::kRk4 || (method == Method::kHamming && solver.step > 0.0);
  rigid = contact.law == ContactLaw::kRigid;
  discrete_friction = rigid || (contact.law == ContactLaw::kViscous && contact.stationary_rows);
  // with regularised friction a contact's force ends at zero gap
  leave_gap = discrete_friction ? kReach : kTouch;
  shapes = shapesOf(scenario);
  if (contact.law != ContactLaw::kNone) {
    // excluded features are searched too, as they end the run; not rim_face, whose gap is positive
    // while that of edge_plane is
    const bool face = (contact.features & kRimFaceSlots) && !(contact.features & kEdgePlaneSlots);
    admitted = possibleSlots(shapes) & ~(face ? 0u : kRimFaceSlots);
    excluded = admitted & ~contact.features;
    for (const std::size_t i : Slots(admitted)) slots = i + 1;
  }
  compliant = isCompliant(scenario);
  coarseness = std::clamp(solver.tolerance / 1e-9, 1e-3, 100.0);
  // above the velocity error of the integrator, docs/theory/thesis.md
  const double tolerance = fixed_step ? 1e-9 : solver.tolerance;
  slip_threshold =
      std::max(rigid ? kMinRestSpeed : kFaceRestSpeed, kFaceRestOverTolerance * tolerance);
  fine_slip = rigid ? slip_threshold : std::max(kRestSpeed, kRestOverTolerance * tolerance);
  // the thesis's rows let a stationary contact creep below v_ST
  if (scenario.thesis.creep) {
    slip_threshold = fine_slip = std::max(slip_threshold, contact.regularisation_speed);
  }
  const PegParameters& peg = scenario.mechanism.peg;
  arm = std::hypot(peg.half_height, peg.radius);
}

State initialState(const System& s) {
  const InitialState& given = s.scenario.initial;
  State start;
  start.q.head<3>() = toThesisAxes(given.position);
  start.q.segment<3>(3) << given.euler.phi, given.euler.theta, given.euler.psi;
  start.q.tail<3>() << given.carrier_x, given.carrier_y, given.carrier_yaw;
  start.v.head<3>() = toThesisAxes(given.velocity);
  start.v.segment<3>(3) = given.euler_rates;
  start.v.tail<3>() = given.carrier_velocity;
  if (given.close) start.q(0) = closedHeight(s, start);
  return start;
}

}  // namespace assembly_cell
