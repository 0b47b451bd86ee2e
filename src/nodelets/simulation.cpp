// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <pluginlib/class_list_macros.hpp>

#include "assembly_cell/ros/simulation/cell_player.h"
#include "assembly_cell/ros/simulation/markers/contact_markers_node.h"
#include "assembly_cell/ros/simulation/simulator_node.h"
#include "hosted_nodelet.h"

namespace assembly_cell::ros_bridge {

using SimulatorNodelet = TogetherNodelet<SimulatorNode>;
using ContactMarkersNodelet = HostedNodelet<ContactMarkersNode>;
using CellPlayerNodelet = HostedNodelet<CellPlayer>;

}  // namespace assembly_cell::ros_bridge

PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::SimulatorNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::ContactMarkersNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::CellPlayerNodelet, nodelet::Nodelet)
