// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/Exciter.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

/// Holds the plant for a goal: a session with a lease, what the plant's guard says of it, and who
/// or what spoils the goal: another commander, another life of the plant, a zero or a calibration
/// that changes. Thread-safe; calls `changed` whenever there is news.
class PlantLink {
 public:
  /// holder: the node that holds the plant by it, its whole name.
  PlantLink(ros::NodeHandle& nh, const std::string& holder, bool lockstep,
            std::function<void()> changed);
  ~PlantLink();
  PlantLink(const PlantLink&) = delete;
  PlantLink& operator=(const PlantLink&) = delete;

  bool isFree() const;            ///< no node of another process holds it, as far as is known
  void begin();                   ///< a session with a new number; none while another node of this
                                  ///< process has one, which is a fault
  void forget();                  ///< the blocks show another life: its state may come later
  void move();                    ///< it moves from now on: the plant must stay the same
  void end();                     ///< lets the plant go
  std::uint32_t session() const;  ///< 0: none

  /// Who publishes the carrier's pose is the plant: its state counts, no other's.
  void isOf(const std::string& node);

  /// Sign of life: the holder has seen the block that ended at `seen`. In lockstep the Ack says so.
  void renew(const ros::Time& seen);

  /// Why the goal has to end, if it has to: one line that names who and what.
  std::optional<std::string> fault() const;

  /// The plant has stopped, or not followed, since the last call of repeated(): the lease lapsed or
  /// a command came too late. Never in lockstep, where time waits for the holder.
  bool lapsed() const;
  /// The plant follows this session at present. True where no guard is known.
  bool follows() const;
  /// What was lost is being said again.
  void repeated();

 private:
  void onState(const PlantState::ConstPtr& state, const std::string& node);
  /// Empty, or why a state of that node is refused.
  std::string judgeUnlocked(const std::string& node);
  void onCommand(const std::string& topic, const std::string& node);
  /// A value that must stay what it was at the goal's start.
  void onConstant(const std::string& what, const std::string& bytes);
  template <class Message>
  void watchConstant(ros::NodeHandle& nh, const std::string& topic, const std::string& what);
  template <class Message>
  ros::Subscriber watchCommands(ros::NodeHandle& nh, const std::string& topic);
  bool followsUnlocked() const;
  bool freeUnlocked() const;

  const std::string node_, plant_;  // names of who holds, and of what
  const bool lockstep_;
  const std::function<void()> changed_;

  mutable std::mutex mutex_;
  std::uint32_t session_ = 0;
  std::optional<PlantState> state_;
  std::uint32_t life_ = 0;     // of the plant when the session began; 0: not known
  std::uint32_t refused_ = 0;  // commands, when the session began or was repeated
  bool moving_ = false;
  StreamDoor door_;         // of the plant's state, until it is known whose it is
  std::string plant_node_;  // who publishes carrier_pose; empty: not heard yet
  std::string state_node_;  // whose state_ is
  bool lost_ = false;       // something that was commanded is not in force
  std::string fault_;
  std::map<std::string, std::string> constants_;  // by name, as bytes

  ros::Publisher lease_pub_;
  ros::Subscriber state_sub_, command_sub_, exciter_sub_;
  std::vector<ros::Subscriber> constant_subs_;
};

}  // namespace assembly_cell::ros_bridge
