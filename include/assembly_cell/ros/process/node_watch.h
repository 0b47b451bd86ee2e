// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

namespace assembly_cell::ros_bridge {

/// Is a node there? Asked when its messages stay out, so that the answer can be told.
enum class NodePresence {
  kGone,       ///< the master knows it, nobody listens at its address any more
  kMute,       ///< somebody does and doesn't answer: it is frozen, or its host is off
  kListening,  ///< somebody does, and answers if that was asked
  kUnknown,    ///< nobody publishes the topic, as far as the master knows
};

struct TopicPublisher {
  std::string topic;  ///< as it was asked for
  std::string node;   ///< empty: none; several with " and "
  NodePresence presence = NodePresence::kUnknown;
};

/// Who publishes these topics (resolved names), and is it there? Takes a few milliseconds, 0.2 s
/// for a host that doesn't answer. Several publishers of a topic: those that are gone, otherwise
/// those that are mute, otherwise all.
/// answer_within: a node that is there must answer a question in this time; 0: it isn't asked [s].
std::vector<TopicPublisher> publishersOf(const std::vector<std::string>& topics,
                                         double answer_within = 0.0);

/// "sensor_b/wrench_samples of /sensor_b/driver (gone)" and so on, with commas.
std::string describe(const std::vector<TopicPublisher>& publishers);

}  // namespace assembly_cell::ros_bridge
