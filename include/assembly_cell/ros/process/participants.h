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

/// Who must answer a block in lockstep before the next one begins, and how many commands have come
/// in from whom. Participants in one process share its name: their commands are counted together.
/// Not thread-safe.
class Participants {
 public:
  /// root: the cell's namespace.
  explicit Participants(const std::vector<std::string>& names = {}, const std::string& root = "/");

  std::size_t size() const { return answers_.size(); }
  /// All have answered at least once.
  bool allKnown() const;
  /// Counts a command of a node; false for a repetition (latched messages may come twice).
  bool count(const std::string& publisher, const std::string& topic,
             const std_msgs::Header& header);
  /// Block `sequence` goes out: nobody can have answered a later one.
  void expect(std::uint32_t sequence) { newest_ = sequence; }
  /// Takes an answer; empty, or why it doesn't count: of none of them, to a block that hasn't gone
  /// out, or of another node. A participant is the node of its name; who has another name
  /// (~name_in_lockstep) is the node that answered first.
  std::string answer(const Ack& ack, const std::string& publisher);
  /// Does this answer speak of a session? One that has none, of a participant that had none before,
  /// says nothing of the session of another node of its process.
  bool speaksOfSession(const Ack& ack);
  /// All have answered block `sequence`, and their commands have come in.
  bool allAnswered(std::uint32_t sequence) const;
  /// Those who have not answered block `sequence`, or whose commands have not all come in, with the
  /// reason; empty when there are none.
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
  /// Of participants that have answered from `publisher`.
  std::uint32_t claimedBy(const std::string& publisher) const;
  static bool hasAnswered(const Answer& answer, std::uint32_t sequence);
  bool commandsCameIn(const Answer& answer) const;

  std::string root_;
  std::uint32_t newest_ = 0;               // block that has gone out
  std::map<std::string, Answer> answers_;  // the latest, by participant
  std::map<std::string, Sender> senders_;
};

}  // namespace assembly_cell::ros_bridge
