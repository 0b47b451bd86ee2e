// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "assembly_cell/Ack.h"
#include "assembly_cell/ros/process/participants.h"
#include "assembly_cell/ros/process/shared_spinner.h"
#include "assembly_cell/ros/simulation/simulator_settings.h"
#include "assembly_cell/ros/simulation/simulator_state.h"

namespace assembly_cell::ros_bridge {

/// The participants' answers to the blocks of a lockstep. Without lockstep no answer is awaited.
class LockstepAnswers {
 public:
  /// go_on: computes the next block in the thread that called back the last answer, where nodes
  /// share a thread. settings and state are referred to.
  LockstepAnswers(const ros::NodeHandle& nh, const SimulatorSettings& settings,
                  SimulatorState& state, const std::function<void()>& go_on);
  ~LockstepAnswers();

  /// Those below: with the state locked, except wait().
  /// Counts a command; false for a repetition.
  bool count(const std::string& publisher, const std::string& topic,
             const std_msgs::Header& header) {
    return participants_.count(publisher, topic, header);
  }
  /// A motion of the carrier has arrived that ends at `time`, node time [s].
  void setMotionEnd(double time) { motion_end_ = time; }

  /// Block `sequence` goes out. awaited: its answers are awaited.
  void expect(std::uint32_t sequence, bool awaited);
  bool awaiting() const { return awaiting_; }
  void stopAwaiting();
  /// All have answered the last block.
  bool complete() const;
  /// Has the loop go on once all answers have arrived.
  void notifyIfComplete();

  /// Until the last block is answered, in whichever thread it was computed. repeat: publishes a
  /// block again if it's still the last one. Ends the node after the timeout.
  void wait(const std::function<void(std::uint32_t sequence)>& repeat);
  /// Is `sequence` the last block, and not answered yet?
  bool awaits(std::uint32_t sequence) const;

  /// 1 after a participant has failed to answer.
  int exitCode() const { return exit_code_; }

 private:
  void subscribe();
  void onAck(const ros::MessageEvent<Ack const>& event);
  void fail(double timeout);  // with the state locked

  ros::NodeHandle nh_;
  const SimulatorSettings& settings_;
  SimulatorState& state_;
  Participants participants_;
  std::uint32_t awaited_ = 0;  // last block
  bool awaiting_ = false;
  double motion_end_ = 0.0;  // of the last motion, node time [s]
  std::atomic<int> exit_code_{0};
  ros::Subscriber ack_sub_;
  const ros::CallbackInterfacePtr go_on_;
};

}  // namespace assembly_cell::ros_bridge
