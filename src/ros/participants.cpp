// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/participants.h"

#include <algorithm>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/lockstep.h"

namespace assembly_cell::ros_bridge {

Participants::Participants(const std::vector<std::string>& names, const std::string& root)
    : root_(root) {
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

std::string Participants::answer(const Ack& ack, const std::string& publisher) {
  const auto found = answers_.find(ack.node);
  if (found == answers_.end()) return printable(ack.node) + " is not in ~participants";
  Answer& latest = found->second;
  const std::string node = participantNode(root_, ack.node);
  if (latest.known && latest.publisher != publisher && publisher != node) {
    return ack.node + " is " + latest.publisher;
  }
  if (ack.sequence > newest_) {
    return "block " + std::to_string(ack.sequence) + " hasn't gone out yet, the last one is " +
           std::to_string(newest_);
  }
  // an earlier block's, again
  if (latest.known && ack.sequence < latest.sequence) return {};
  latest = {true, ack.sequence, ack.commands, publisher};
  return {};
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
