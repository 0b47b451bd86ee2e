// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Movable joints from a robot's base to one of its links; fixed joints are included in the poses.
struct JointChain {
  struct Joint {
    std::string name;
    Pose before;                                      ///< pose in the frame of the previous joint
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit
    bool slides = false;                              ///< prismatic
  };
  std::vector<Joint> joints;  ///< movable, from the base on
  Pose end;                   ///< pose of the link in the frame of the last joint
};

/// Chain of a URDF text; the base is its root link. Throws InputError naming `source`: not URDF,
/// no such link, a joint that is neither fixed, revolute, continuous nor prismatic.
JointChain loadJointChain(const std::string& urdf, const std::string& link,
                          const std::string& source);

/// Pose of the link in the base. positions: one for each joint [rad] or [m].
Pose linkPose(const JointChain& chain, const std::vector<double>& positions);

}  // namespace assembly_cell
