// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/dynamics/model.h"

namespace assembly_cell {

/// Commanded motion of the rest pose and of the exciter; shared by the simulator backends.
struct Commands {
  explicit Commands(const Scenario& scenario);
  void setProfile(const RestProfile& from_now_on);
  RestMotion restAt(double t) const {
    RestMotion rest = restMotion(profile, t);
    if (shift) {
      const RestMotion off = restMotion(*shift, t);
      rest.position += off.position;
      rest.rate += off.rate;
      rest.acceleration += off.acceleration;
    }
    return rest;
  }
  Vector6 restPositionAt(double t) const {
    return settledAt(t) && !shift ? settled.position : restAt(t).position;
  }
  bool settledAt(double t) const { return !(t < profile.start + profile.duration); }

  RestProfile profile;
  RestMotion settled;                ///< commanded pose after the end of the profile
  std::optional<RestProfile> shift;  ///< offset of the rest pose from `profile`
  Drive drive;
};

}  // namespace assembly_cell
