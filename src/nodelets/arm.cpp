// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <pluginlib/class_list_macros.hpp>

#include "assembly_cell/ros/arm/arm_bridge_node.h"
#include "assembly_cell/ros/arm/emulated_arm_node.h"
#include "assembly_cell/ros/arm/exciter_output_node.h"
#include "hosted_nodelet.h"

namespace assembly_cell::ros_bridge {

using ArmBridgeNodelet = TogetherNodelet<ArmBridgeNode>;
using EmulatedArmNodelet = TogetherNodelet<EmulatedArmNode>;
using ExciterOutputNodelet = HostedNodelet<ExciterOutputNode>;

}  // namespace assembly_cell::ros_bridge

PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::ArmBridgeNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::EmulatedArmNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::ExciterOutputNodelet, nodelet::Nodelet)
