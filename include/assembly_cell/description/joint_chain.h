// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// The joints from a robot's base to one of its links, fixed ones folded in.
struct JointChain {
  struct Joint {
    std::string name;
    Pose before;                                      ///< in the frame of the joint before it
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< unit
    bool slides = false;                              ///< prismatic
  };
  std::vector<Joint> joints;  ///< that move, from the base on
  Pose end;                   ///< of the link in the frame of the last one
};

/// From the text of a URDF; the base is its root link. Throws InputError naming `source`: not URDF,
/// no such link, a joint that is neither fixed nor turns about or slides along one axis.
JointChain loadJointChain(const std::string& urdf, const std::string& link,
                          const std::string& source);

/// Pose of the link in the base; a position for each joint [rad] or [m].
Pose linkPose(const JointChain& chain, const std::vector<double>& positions);

}  // namespace assembly_cell
