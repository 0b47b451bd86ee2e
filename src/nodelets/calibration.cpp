// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <pluginlib/class_list_macros.hpp>

#include "assembly_cell/ros/calibration/calibration_server_node.h"
#include "assembly_cell/ros/simulation/simulated_rig_node.h"
#include "hosted_nodelet.h"

namespace assembly_cell::ros_bridge {

using CalibrationServerNodelet = HostedNodelet<CalibrationServerNode>;
using SimulatedRigNodelet = HostedNodelet<SimulatedRigNode>;

}  // namespace assembly_cell::ros_bridge

PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::CalibrationServerNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::SimulatedRigNodelet, nodelet::Nodelet)
