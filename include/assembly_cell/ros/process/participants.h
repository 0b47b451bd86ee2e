// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/time.h>
#include <std_msgs/Header.h>

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/Ack.h"

namespace assembly_cell::ros_bridge {

/// The name of `node` in the simulator's ~participants: relative to `root`, the cell's namespace.
/// Outside of it, the whole name without the first slash. A node has the namespace of its private
/// handle as its name: nodelets share the name of their process.
std::string participantName(const std::string& root, const std::string& node);

/// The node with the name `participant` in the cell of namespace `root`.
std::string participantNode(const std::string& root, const std::string& participant);

/// Nodes that acknowledge a block in lockstep before the next one begins, and the number of
/// commands that have arrived from each. Participants in one process share its name: their commands
/// are counted together. Not thread-safe.
class Participants {
 public:
  /// root: the cell's namespace.
  explicit Participants(const std::vector<std::string>& names = {}, const std::string& root = "/");

  std::size_t size() const { return answers_.size(); }
  /// All have acknowledged at least once.
  bool allKnown() const;
  /// Counts a command of a node; false for a repetition (latched messages may arrive twice).
  bool count(const std::string& publisher, const std::string& topic,
             const std_msgs::Header& header);
  /// Block `sequence` is published: later ones can't be acknowledged yet.
  void expect(std::uint32_t sequence) { newest_ = sequence; }
  /// Takes an acknowledgement; empty, or why it is refused: of no participant, of a block that
  /// isn't published yet, or of another node. A participant is the node of its name; one with
  /// another name (~name_in_lockstep) is the node that acknowledged first.
  std::string answer(const Ack& ack, const std::string& publisher);
  /// Does this acknowledgement begin, keep or end a session of its participant? One without a
  /// session says nothing of the session of another node of its process.
  bool reportsSession(const Ack& ack);
  /// All have acknowledged block `sequence`, and their commands have arrived.
  bool allAnswered(std::uint32_t sequence) const;
  /// Those who have not acknowledged block `sequence`, or whose commands have not all arrived, with
  /// the reason; empty: none.
  std::string missing(std::uint32_t sequence) const;

 private:
  struct Answer {
    bool known = false;
    std::uint32_t sequence = 0, commands = 0, session = 0;
    std::string publisher;  ///< node that sent it
  };
  struct Sender {
    std::uint32_t commands = 0;
    std::map<std::string, std::pair<std::uint32_t, ros::Time>> last;  ///< seq, stamp by topic
  };
  /// Commands by the acknowledgements of the participants of `publisher`.
  std::uint32_t claimedBy(const std::string& publisher) const;
  static bool hasAnswered(const Answer& answer, std::uint32_t sequence);
  bool commandsCameIn(const Answer& answer) const;

  std::string root_;
  std::uint32_t newest_ = 0;               // published block
  std::map<std::string, Answer> answers_;  // the latest, by participant
  std::map<std::string, Sender> senders_;
};

}  // namespace assembly_cell::ros_bridge
