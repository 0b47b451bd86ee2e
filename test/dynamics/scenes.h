// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Scenes that the tests of the dynamics share.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "assembly_cell/dynamics/simulation.h"
#include "scenarios.h"

namespace assembly_cell {

// Tilts the peg of a scene towards `lean` (angle from x) with its bottom edge centre at `bottom`
// and the coupling free of load.
inline void place(Scenario& s, const Eigen::Vector3d& bottom, double tilt, double lean) {
  const Eigen::Vector3d axis(std::sin(tilt) * std::cos(lean), std::sin(tilt) * std::sin(lean),
                             std::cos(tilt));
  s.initial.euler = {std::atan2(axis.x(), axis.z()), std::acos(axis.y()), 0.0};
  s.initial.position = bottom + s.mechanism.peg.half_height * axis;
  const Eigen::Vector3d coupling = s.initial.position + s.mechanism.peg.coupling_height * axis;
  s.rest = {coupling.x(), coupling.y(),          coupling.z(),
            0.0,          s.initial.euler.theta, s.initial.euler.phi};
  s.initial.carrier_x = coupling.x();
  s.initial.carrier_y = coupling.y();
  s.initial.carrier_yaw = 0.0;
}

// The cell far beside the hole, its lowest edge point on the plane: one contact of edge and plane.
inline Scenario onThePlane(double tilt, double lean = 0.0) {
  Scenario s = load("cell");
  place(s, {0.05, 0.02, 0.025 * std::sin(tilt)}, tilt, lean);
  return s;
}

// The cell half over the hole, leaning towards it, both edge contacts pressed by `press` metres of
// the coupling.
inline Scenario onTwoEdges(double tilt, double press) {
  Scenario s = load("cell");
  place(s, {0.004, 0.0, 0.01}, tilt, 3.14159265358979323846);
  s.initial.close = true;
  const Simulation closed(s);
  s.initial.close = false;
  s.initial.position.z() = closed.state().q(0);
  s.rest.z = closed.state().q(0) + s.mechanism.peg.coupling_height * std::cos(tilt) - press;
  return s;
}

inline int closedContacts(const Simulation& sim) {
  int n = 0;
  for (const ContactReport& c : sim.contacts()) {
    n += c.valid && c.state != ContactReport::kOpen ? 1 : 0;
  }
  return n;
}

inline double kineticSpeed(const State& s) { return s.v.cwiseAbs().maxCoeff(); }

// The scene with its start at this state.
inline Scenario startedFrom(Scenario s, const State& state) {
  s.initial = InitialState{};
  s.initial.position = fromThesisAxes(state.q.head<3>());
  s.initial.euler = {state.q(3), state.q(4), state.q(5)};
  s.initial.velocity = fromThesisAxes(state.v.head<3>());
  s.initial.euler_rates = state.v.segment<3>(3);
  s.initial.carrier_x = state.q(6);
  s.initial.carrier_y = state.q(7);
  s.initial.carrier_yaw = state.q(8);
  s.initial.carrier_velocity = state.v.tail<3>();
  return s;
}

// Deflection of the coupling: translation of the coupling point relative to its rest and rotation
// vector, in the axes of the carrier frame. [m], [rad]
inline Vector6 couplingDeflection(const Simulation& sim) {
  const Scenario& s = sim.scenario();
  const Pose peg = sim.pegPose(), carrier = sim.carrierPose();
  const Eigen::Vector3d point =
      peg.p + (s.mechanism.peg.half_height + s.mechanism.peg.coupling_height) * peg.R.col(2);
  Vector6 d;
  d << carrier.R.transpose() * (point - carrier.p),
      vectorFromRotation(carrier.R.transpose() * peg.R).value;
  return d;
}

}  // namespace assembly_cell
