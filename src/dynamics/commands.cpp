// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/dynamics/commands.h"

#include <algorithm>

#include "assembly_cell/dynamics/simulator_backend.h"

namespace assembly_cell {
namespace {

// Weight of angles in planRest(): distance from the coupling to the peg's edge [m].
double armOf(const PegParameters& peg) { return peg.coupling_height + peg.half_height; }

}  // namespace

Commands::Commands(const Scenario& scenario) {
  setProfile(restProfile(scenario.rest));
  drive.exciter = scenario.mechanism.exciter;
  drive.errors = scenario.imperfections.exciter;
}

void Commands::setProfile(const RestProfile& from_now_on) {
  profile = from_now_on;
  settled = restMotion(profile, profile.start + profile.duration);
}

void SimulatorBackend::setRestTarget(const RestPose& target, double max_speed) {
  Commands& c = changeCommands();
  const Mechanism& mechanism = scenario().mechanism;
  CarrierParameters limits = mechanism.carrier;
  limits.max_speed = std::min(limits.max_speed, max_speed);
  c.setProfile(
      planRest(restMotion(c.profile, time()), time(), target, limits, armOf(mechanism.peg)));
}

void SimulatorBackend::followRest(const RestMotion& goal, double t_goal) {
  Commands& c = changeCommands();
  c.setProfile(followProfile(restMotion(c.profile, time()), time(), goal, t_goal));
}

void SimulatorBackend::stopRest() {
  Commands& c = changeCommands();
  const Mechanism& mechanism = scenario().mechanism;
  c.setProfile(planStop(restMotion(c.profile, time()), time(), mechanism.carrier.max_acceleration,
                        armOf(mechanism.peg)));
}

Vector6 SimulatorBackend::stoppingDisplacement() const {
  Vector6 displacement = Vector6::Zero();
  const double t = time();
  if (commands().settledAt(t)) return displacement;
  const Mechanism& mechanism = scenario().mechanism;
  const RestMotion now = restMotion(commands().profile, t);
  const RestProfile stop =
      planStop(now, t, mechanism.carrier.max_acceleration, armOf(mechanism.peg));
  const Pose from = poseFromRest(restPose(now.position));
  const Pose to = poseFromRest(restPose(stop.coefficients.rowwise().sum()));
  displacement << from.R.transpose() * (to.p - from.p),
      vectorFromRotation(from.R.transpose() * to.R).value;
  return displacement;
}

RestPose SimulatorBackend::rest() const {
  Vector6 rest = commands().restPositionAt(time());
  rest.head<3>() += carrierDeflection();
  return restPose(rest);
}

void SimulatorBackend::setRestShift(const Vector6& shift) {
  Commands& c = changeCommands();
  if (!c.shift) c.shift.emplace();
  RestProfile& now = *c.shift;
  const Mechanism& mechanism = scenario().mechanism;
  now = planRest(restMotion(now, time()), time(), restPose(shift), mechanism.carrier,
                 armOf(mechanism.peg));
}

Vector6 SimulatorBackend::restShift() const {
  const std::optional<RestProfile>& commanded = commands().shift;
  Vector6 shift = commanded ? restMotion(*commanded, time()).position : Vector6::Zero();
  shift.head<3>() += carrierDeflection();
  return shift;
}

bool SimulatorBackend::atRest() const { return commands().settledAt(time()); }

}  // namespace assembly_cell
