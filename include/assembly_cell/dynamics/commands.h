// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <optional>

#include "assembly_cell/dynamics/model.h"

namespace assembly_cell {

/// How far the rest pose stands off from what is commanded. Order of restVector().
struct RestShift {
  /// Of the lag's way since its last update, see giveWay().
  static constexpr double kLag = 0.01;    ///< [s]
  static constexpr double kSlice = 2e-4;  ///< between updates [s]

  Vector6 lagged(double t) const {
    return goal + std::exp(-(t - updated) / kLag) * (lag_start - goal);
  }
  Vector6 at(double t) const { return restMotion(profile, t).position + lagged(t); }
  void addTo(double t, RestMotion& rest) const {
    const RestMotion settling = restMotion(profile, t);
    const Vector6 lag = lagged(t);
    rest.position += settling.position + lag;
    rest.rate += settling.rate - (lag - goal) / kLag;
    rest.acceleration += settling.acceleration + (lag - goal) / (kLag * kLag);
  }

  bool any = false;                                    ///< false: nothing of this is looked at
  RestProfile profile;                                 ///< of what setRestShift() asks for
  Vector6 lag_start = Vector6::Zero();                 ///< by the compliance, at the last update
  Vector6 goal = Vector6::Zero();                      ///< what it tends to
  std::optional<std::array<Eigen::Vector3d, 2>> ways;  ///< for the forces of the last two updates
  double updated = 0.0;                                ///< time of the last update [s]
};

/// What is commanded: the rest pose's motion and the exciter. The same for every world.
struct Commands {
  explicit Commands(const Scenario& scenario);
  void setProfile(const RestProfile& from_now_on);
  RestMotion restAt(double t) const {
    RestMotion rest = restMotion(profile, t);
    if (shift.any) shift.addTo(t, rest);
    return rest;
  }
  bool settledAt(double t) const { return !(t < profile.start + profile.duration); }

  RestProfile profile;
  RestMotion settled;  ///< of the commanded pose once the profile has ended
  RestShift shift;
  Drive drive;
};

/// Some part of the carrier gives way behind its encoders: giveWay() is to be called.
bool isCompliant(const Scenario& scenario);

// From time t [s] on, as the functions of `World` of these names say.
void setRestTarget(Commands& commands, const Mechanism& mechanism, double t, const RestPose& target,
                   double max_speed);
void followRest(Commands& commands, double t, const RestMotion& goal, double t_goal);
void stopRest(Commands& commands, const Mechanism& mechanism, double t);
Vector6 stopWay(const Commands& commands, const Mechanism& mechanism, double t);
void setRestShift(Commands& commands, const Mechanism& mechanism, double t, const Vector6& shift);

/// The carrier gives way to the coupling's force (axes of `hole` [N]) until the next update, kSlice
/// later: as that of the slice's middle, which the last three updates foretell. Exact for a
/// constant force; of one at 900 rad/s it is off by 0.2 %, where the force of now would be by 9 %.
void giveWay(Commands& commands, const Eigen::Vector3d& compliance, double t,
             const Eigen::Vector3d& force);

}  // namespace assembly_cell
