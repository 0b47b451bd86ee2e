// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/process/participants.h"

#include <ros/ros.h>

#include <algorithm>
#include <utility>

#include "assembly_cell/base/text.h"

namespace assembly_cell::ros_bridge {

std::string participantName(const std::string& root, const std::string& node) {
  const std::string above = root == "/" ? "/" : root + "/";
  return node.compare(0, above.size(), above) == 0 ? node.substr(above.size()) : node.substr(1);
}

std::string participantNode(const std::string& root, const std::string& participant) {
  return ros::names::append(root, participant);
}

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
  // a repetition for an earlier block
  if (latest.known && ack.sequence < latest.sequence) return {};
  latest.known = true;
  latest.sequence = ack.sequence;
  latest.commands = ack.commands;
  latest.publisher = publisher;
  return {};
}

bool Participants::reportsSession(const Ack& ack) {
  const std::uint32_t before = std::exchange(answers_[ack.node].session, ack.session);
  return before != 0 || ack.session != 0;
}

std::uint32_t Participants::claimedBy(const std::string& publisher) const {
  std::uint32_t claimed = 0;
  for (const auto& [name, answer] : answers_) {
    if (answer.publisher == publisher) claimed += answer.commands;
  }
  return claimed;
}

bool Participants::hasAnswered(const Answer& answer, std::uint32_t sequence) {
  return answer.known && answer.sequence >= sequence;
}

bool Participants::commandsCameIn(const Answer& answer) const {
  if (answer.commands == 0) return true;
  const auto sender = senders_.find(answer.publisher);
  return sender != senders_.end() && sender->second.commands >= claimedBy(answer.publisher);
}

bool Participants::allAnswered(std::uint32_t sequence) const {
  return std::all_of(answers_.begin(), answers_.end(), [&](const auto& entry) {
    return hasAnswered(entry.second, sequence) && commandsCameIn(entry.second);
  });
}

std::string Participants::missing(std::uint32_t sequence) const {
  std::string list;
  for (const auto& [name, answer] : answers_) {
    const bool answered = hasAnswered(answer, sequence);
    if (answered && commandsCameIn(answer)) continue;
    list += (list.empty() ? "" : ", ") + name;
    if (!answer.known) list += " (never answered)";
    if (answered) list += " (commands lost)";
  }
  return list;
}

}  // namespace assembly_cell::ros_bridge
