// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/PlantState.h"
#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::ros_bridge {

/// Detects what must not happen during a goal: commands of another node, and another zero or
/// calibration of a sensor. Calls `fault` with one line that names it.
class GoalDisturbances {
 public:
  GoalDisturbances(ros::NodeHandle& nh, std::function<void(const std::string&)> fault);

 private:
  template <class Message>
  void watchCommands(ros::NodeHandle& nh, const std::string& topic);
  /// The values of the topic's message must stay the same; what: their name in words.
  template <class Message>
  void watchConstant(ros::NodeHandle& nh, const std::string& topic, const std::string& what);

  const std::function<void(const std::string&)> fault_;
  std::mutex mutex_;
  std::map<std::string, std::string> constants_;  // serialized, by their names
  std::vector<ros::Subscriber> subs_;
};

/// Ownership of the plant during a goal: a session with a lease, the state that the plant's guard
/// publishes, and faults that end the goal: another owner, another boot of the plant, see also
/// GoalDisturbances. Thread-safe; calls `changed` when any of it changes.
class PlantLink {
 public:
  /// node: that owns the plant during its goals, resolved name.
  PlantLink(ros::NodeHandle& nh, const std::string& node, bool lockstep,
            std::function<void()> changed);
  ~PlantLink();

  /// Begins a session with a new number. Another owner of the plant is a fault; then there is no
  /// session.
  void acquire();
  /// Commands follow, based on a block that ended at `origin`: the plant must not restart later.
  void beginMotion(const ros::Time& origin);
  void release();

  /// The node that publishes the carrier's pose is the plant; states of other nodes are refused.
  void setPlantNode(const std::string& node);
  /// In lockstep: drops the state of the earlier boot. A fault once motion has begun.
  void onPlantRestart();

  /// Renews the lease: the owner has received the block that ended at `stamp`. In lockstep the
  /// acknowledgement of a block does so.
  void renew(const ros::Time& stamp);

  struct Status {
    std::uint32_t session = 0;  ///< 0: none
    bool is_free = true;        ///< no node of another process is known to own the plant
    bool is_obeyed = true;      ///< the plant obeys this session, or has no guard
    /// Since clearInterruption() the plant has stopped or refused a command, because the lease
    /// expired or the command came too late. Never in lockstep, where time waits for the owner.
    bool is_interrupted = false;
    std::string fault;  ///< why the goal has to end, one line; empty: it may go on
  };
  Status status() const;
  void clearInterruption();

 private:
  struct Session {
    std::uint32_t number = 0;         // 0: none
    std::uint32_t boot_id = 0;        // of the plant; 0: not known
    std::uint32_t refused = 0;        // commands that the plant had refused
    std::optional<ros::Time> origin;  // of the motion, once it has begun
    bool interrupted = false;
    std::string fault;
  };

  void onState(const PlantState::ConstPtr& state, const std::string& publisher);
  /// Compares a new state with the session. had_session: the state before was of this session.
  void checkSession(bool had_session);
  void setFault(const std::string& fault);

  const std::string node_, plant_;
  const bool lockstep_;
  const std::function<void()> changed_;
  mutable std::mutex mutex_;
  Session session_;
  std::optional<PlantState> state_;
  StreamFilter filter_;  // of plant_state, until the plant's node is known
  struct {
    std::string carrier_pose, state;  // of state_; empty: none yet
  } publishers_;
  ros::Publisher lease_pub_;
  ros::Subscriber state_sub_;
  GoalDisturbances disturbances_;
};

}  // namespace assembly_cell::ros_bridge
