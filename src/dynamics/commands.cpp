// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/dynamics/commands.h"

#include <algorithm>

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

void setRestTarget(Commands& commands, const Mechanism& mechanism, double t, const RestPose& target,
                   double max_speed) {
  CarrierParameters limits = mechanism.carrier;
  limits.max_speed = std::min(limits.max_speed, max_speed);
  commands.setProfile(
      planRest(restMotion(commands.profile, t), t, target, limits, armOf(mechanism.peg)));
}

void followRest(Commands& commands, double t, const RestMotion& goal, double t_goal) {
  commands.setProfile(followProfile(restMotion(commands.profile, t), t, goal, t_goal));
}

void stopRest(Commands& commands, const Mechanism& mechanism, double t) {
  commands.setProfile(planStop(restMotion(commands.profile, t), t,
                               mechanism.carrier.max_acceleration, armOf(mechanism.peg)));
}

Vector6 stoppingDisplacement(const Commands& commands, const Mechanism& mechanism, double t) {
  Vector6 way = Vector6::Zero();
  if (commands.settledAt(t)) return way;
  const RestMotion now = restMotion(commands.profile, t);
  const RestProfile stop =
      planStop(now, t, mechanism.carrier.max_acceleration, armOf(mechanism.peg));
  const Pose from = poseFromRest(restPose(now.position));
  const Pose to = poseFromRest(restPose(stop.coefficients.rowwise().sum()));
  way << from.R.transpose() * (to.p - from.p), vectorFromRotation(from.R.transpose() * to.R).value;
  return way;
}

void setRestShift(Commands& commands, const Mechanism& mechanism, double t, const Vector6& shift) {
  if (!commands.shift) commands.shift.emplace();
  RestProfile& now = *commands.shift;
  now = planRest(restMotion(now, t), t, restPose(shift), mechanism.carrier, armOf(mechanism.peg));
}

}  // namespace assembly_cell
