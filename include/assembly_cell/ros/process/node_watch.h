// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/master.h>
#include <ros/node_handle.h>

#include <cstdint>
#include <string>
#include <vector>

namespace assembly_cell::ros_bridge {

/// State of a node whose messages are missing.
enum class NodePresence {
  kGone,         ///< registered, but its address accepts no connection
  kMute,         ///< accepts connections and doesn't respond: frozen, or its host is off
  kUnreachable,  ///< there is no network to it
  kListening,    ///< accepts connections, and responds if that was checked
  kUnknown,      ///< no publisher of the topic is registered
  kNoMaster,     ///< the master doesn't respond, and its last response has no such topic
};

/// State of the process at an address. answer_within > 0: it must respond to a request of ROS's
/// XML-RPC interface within this time [s].
NodePresence presenceAt(const std::string& host, std::uint32_t port, double answer_within);

struct TopicPublisher {
  std::string topic;  ///< as requested
  std::string node;   ///< empty: none; several with " and "
  NodePresence presence = NodePresence::kUnknown;
};

/// Requests the publishers of topics (resolved names) from the master, and keeps them.
void rememberPublishers(const std::vector<std::string>& topics);

/// Publishers of topics (resolved names) and their state. Takes a few milliseconds; 0.1 s more for
/// a master that doesn't respond, whose last response is used (1 s if there is none), and 0.2 s
/// more for a host that doesn't. Of several publishers of a topic: those that are gone, otherwise
/// those that are mute, otherwise all. answer_within: time for a node to respond to a request [s];
/// 0: none is sent. master: its address.
std::vector<TopicPublisher> publishersOf(const std::vector<std::string>& topics,
                                         double answer_within = 0.0,
                                         const std::string& master = ros::master::getURI());

/// Throws InputError "`what` NODE already: ..." if another node, which is there, publishes a topic
/// that one node may publish.
void refuseSecondPublisher(const ros::NodeHandle& nh, const std::string& name,
                           const std::string& what);

/// Refuses a second server of an action, as both would execute its goals.
void refuseSecondServer(const ros::NodeHandle& nh, const std::string& action);

/// "sensor_b/wrench_samples of /sensor_b/driver (gone)" and so on, with commas.
std::string describe(const std::vector<TopicPublisher>& publishers);

}  // namespace assembly_cell::ros_bridge
