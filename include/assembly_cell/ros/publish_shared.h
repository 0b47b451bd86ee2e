// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/publisher.h>
#include <boost/make_shared.hpp>

#include <utility>

namespace assembly_cell::ros_bridge {

/// Publishes a message that subscribers in this process get as it is, not written to bytes and read
/// again. Nobody may change it any more. Its header.seq is what it says there: ROS counts only what
/// it writes to bytes.
template <class Message>
void publishShared(const ros::Publisher& publisher, Message message) {
  publisher.publish(boost::make_shared<Message>(std::move(message)));
}

}  // namespace assembly_cell::ros_bridge
