// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

namespace assembly_cell::ros_bridge {

/// Is a node there? Asked when its messages stay out, so that the answer can be told.
enum class NodePresence {
  kUnknown,    ///< nobody publishes the topic, as far as the master knows
  kGone,       ///< the master knows it, nobody listens at its address any more
  kListening,  ///< somebody does, or the node may be frozen
};

struct TopicPublisher {
  std::string topic;  ///< as it was asked for
  std::string node;   ///< empty: none
  NodePresence presence = NodePresence::kUnknown;
};

/// Who publishes these topics (resolved names), and is it there? Takes a few milliseconds, 0.2 s
/// for a host that doesn't answer. Several publishers of a topic: the first that is gone.
std::vector<TopicPublisher> publishersOf(const std::vector<std::string>& topics);

/// "sensor_b/wrench_samples of /sensor_b/driver (gone)" and so on, with commas.
std::string describe(const std::vector<TopicPublisher>& publishers);

}  // namespace assembly_cell::ros_bridge
