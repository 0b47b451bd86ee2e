// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/participants.h"

#include <algorithm>

namespace assembly_cell::ros_bridge {

Participants::Participants(const std::vector<std::string>& names) {
  for (const auto& name : names) answers_[name];
}

bool Participants::allKnown() const {
  return std::all_of(answers_.begin(), answers_.end(),
                     [](const auto& entry) { return entry.second.known; });
}

bool Participants::count(const std::string& publisher, const std::string& topic,
                         const std_msgs::Header& header) {
  Sender& sender = senders_[publisher];
  const std::pair<std::uint32_t, ros::Time> mark(header.seq, header.stamp);
  const auto [last, first_time] = sender.last.try_emplace(topic, mark);
  if (!first_time && last->second == mark) return false;
  last->second = mark;
  ++sender.commands;
  return true;
}

bool Participants::answer(const Ack& ack, const std::string& publisher) {
  const auto found = answers_.find(ack.node);
  if (found == answers_.end()) return false;
  found->second = {true, ack.sequence, ack.commands, publisher};
  return true;
}

std::string Participants::missing(std::uint32_t sequence) const {
  std::string list;
  for (const auto& [name, answer] : answers_) {
    const auto sender = senders_.find(answer.publisher);
    const std::uint32_t received = sender == senders_.end() ? 0 : sender->second.commands;
    const bool answered = answer.known && answer.sequence >= sequence;
    if (answered && received >= answer.commands) continue;
    list += (list.empty() ? "" : ", ") + name;
    if (!answer.known) list += " (never answered)";
    if (answered) list += " (commands lost)";
  }
  return list;
}

}  // namespace assembly_cell::ros_bridge
