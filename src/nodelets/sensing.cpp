// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <pluginlib/class_list_macros.hpp>

#include "assembly_cell/ros/driver/force_sensor_node.h"
#include "assembly_cell/ros/estimation/locus_node.h"
#include "assembly_cell/ros/estimation/twin_force_node.h"
#include "hosted_nodelet.h"

namespace assembly_cell::ros_bridge {

using ForceSensorNodelet = TogetherNodelet<ForceSensorNode>;
using LocusNodelet = TogetherNodelet<LocusNode>;
using TwinForceNodelet = TogetherNodelet<TwinForceNode>;

}  // namespace assembly_cell::ros_bridge

PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::ForceSensorNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::LocusNodelet, nodelet::Nodelet)
PLUGINLIB_EXPORT_CLASS(assembly_cell::ros_bridge::TwinForceNodelet, nodelet::Nodelet)
