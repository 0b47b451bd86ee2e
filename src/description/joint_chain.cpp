// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/description/joint_chain.h"

#include <urdf_parser/urdf_parser.h>

#include "assembly_cell/base/input_error.h"
#include "urdf_pose.h"

namespace assembly_cell {

namespace {

constexpr double kShortestAxis = 1e-6;  // of a unit vector in a URDF

}  // namespace

JointChain loadJointChain(const std::string& urdf, const std::string& link,
                          const std::string& source) {
  const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(urdf);
  if (!model) throw InputError(source + ": is no URDF: give the robot's description");
  urdf::LinkConstSharedPtr at = model->getLink(link);
  if (!at) throw InputError(source + ": link " + link + ": is missing: give a link of the robot");
  // from the link up to the root
  std::vector<urdf::JointSharedPtr> up;
  for (; at->parent_joint; at = model->getLink(at->parent_joint->parent_link_name)) {
    up.push_back(at->parent_joint);
  }
  JointChain out;
  Pose between;
  for (auto joint = up.rbegin(); joint != up.rend(); ++joint) {
    const urdf::Joint& j = **joint;
    between = between * poseOf(j.parent_to_joint_origin_transform);
    if (j.type == urdf::Joint::FIXED) continue;
    const bool slides = j.type == urdf::Joint::PRISMATIC;
    if (!slides && j.type != urdf::Joint::REVOLUTE && j.type != urdf::Joint::CONTINUOUS) {
      throw InputError(source + ": joint " + j.name +
                       ": neither fixed, revolute, continuous nor prismatic: leave it out");
    }
    const Eigen::Vector3d axis(j.axis.x, j.axis.y, j.axis.z);
    if (!(axis.norm() > kShortestAxis)) {
      throw InputError(source + ": joint " + j.name + ": axis has length " +
                       std::to_string(axis.norm()) + ": give a direction");
    }
    out.joints.push_back({j.name, between, axis.normalized(), slides});
    between = Pose();
  }
  out.end = between;
  return out;
}

Pose linkPose(const JointChain& chain, const std::vector<double>& positions) {
  Pose out;
  for (std::size_t k = 0; k < chain.joints.size(); ++k) {
    const JointChain::Joint& joint = chain.joints[k];
    Pose moved;
    if (joint.slides) {
      moved.p = positions[k] * joint.axis;
    } else {
      moved.R = Eigen::AngleAxisd(positions[k], joint.axis).toRotationMatrix();
    }
    out = out * joint.before * moved;
  }
  return out * chain.end;
}

}  // namespace assembly_cell
