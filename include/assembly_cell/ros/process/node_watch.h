// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

namespace assembly_cell::ros_bridge {

/// State of a node whose messages are missing.
enum class NodePresence {
  kGone,       ///< registered, but its address accepts no connection
  kMute,       ///< accepts connections and doesn't respond: frozen, or its host is off
  kListening,  ///< accepts connections, and responds if that was checked
  kUnknown,    ///< no publisher of the topic is registered
};

struct TopicPublisher {
  std::string topic;  ///< as requested
  std::string node;   ///< empty: none; several with " and "
  NodePresence presence = NodePresence::kUnknown;
};

/// Publishers of topics (resolved names) and their state. Takes a few milliseconds, 0.2 s for a
/// host that doesn't respond. Of several publishers of a topic: those that are gone, otherwise
/// those that are mute, otherwise all. answer_within: time for a node to respond to a request [s];
/// 0: none is sent.
std::vector<TopicPublisher> publishersOf(const std::vector<std::string>& topics,
                                         double answer_within = 0.0);

/// "sensor_b/wrench_samples of /sensor_b/driver (gone)" and so on, with commas.
std::string describe(const std::vector<TopicPublisher>& publishers);

}  // namespace assembly_cell::ros_bridge
