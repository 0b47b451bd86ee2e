// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <functional>

#include "assembly_cell/identification/mechanism_record.h"

namespace assembly_cell::ros_bridge {

/// Topic, latched: the text of the mechanism.yaml that mechanism_identifier has found.
constexpr const char* kMechanismTopic = "mechanism";

/// Gives `heard` what comes on kMechanismTopic and its identification has accepted, in the thread
/// of the callbacks. What can't be read or was not accepted is named in the log.
ros::Subscriber subscribeMechanism(ros::NodeHandle& nh,
                                   const std::function<void(const KnownMechanism&)>& heard);

}  // namespace assembly_cell::ros_bridge
