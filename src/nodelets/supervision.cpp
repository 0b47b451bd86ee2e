// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <pluginlib/class_list_macros.hpp>

#include "assembly_cell/ros/records/recorder_node.h"
#include "assembly_cell/ros/supervision/identifier_node.h"
#include "assembly_cell/ros/supervision/supervisor_node.h"
#include "hosted_nodelet.h"

namespace assembly_cell::ros_bridge {

using SupervisorNodelet = TogetherNodelet<SupervisorNode>;
using RecorderNodelet = HostedNodelet<RecorderNode>;
using IdentifierNodelet = TogetherNodelet<IdentifierNode>;

}  // namespace assembly_cell::ros_bridge

PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::SupervisorNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::IdentifierNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::RecorderNodelet, nodelet::Nodelet)
