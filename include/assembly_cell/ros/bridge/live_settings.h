// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <dynamic_reconfigure/Config.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/parameters.h"

// Parameters that may change while a node runs, for the clients of dynamic_reconfigure. Its server
// isn't used: it silently limits values to their range, accepts NaN, and applies the known part of
// a request with unknown names. See docs/reference/interfaces.md.
namespace assembly_cell::ros_bridge {

/// A parameter that may change while the node runs.
struct LiveSetting {
  std::string name;         ///< relative to the node
  std::string description;  ///< unit, and from when on a change holds
  Range range;
  double value = 0.0;        ///< active; of a switch 0 or 1
  bool is_switch = false;    ///< true or false
  bool lowers_only = false;  ///< range.high is the value at the start and limits the value
};
using LiveValues = std::vector<LiveSetting>;

LiveSetting liveNumber(const std::string& name, double value, const Range& range,
                       const std::string& description);
LiveSetting liveSwitch(const std::string& name, bool value, const std::string& description);
/// A limit that stays at or below what the node was started with.
LiveSetting liveLimit(const std::string& name, double value, double min,
                      const std::string& description);

/// The fields that may change while the node runs, with their present values. `when` ends the
/// descriptions: "from the next goal on".
LiveValues liveValues(const FieldList& fields, const std::string& when);
/// Sets the fields of these names.
void put(const LiveValues& values, const FieldList& fields);

/// Throws std::logic_error where there is none of the name.
double valueOf(const LiveValues& values, std::string_view name);

/// Result of a request.
struct LiveChange {
  LiveValues values;    ///< with it; as before where it is refused
  std::string refusal;  ///< one line; empty: accepted
  std::string cut;      ///< value that was limited to its bound, one line; empty: none
};

/// Applies a request as a whole or not at all. Refused are a name that is unknown, not live or
/// given twice, another kind of value, NaN and a value out of range. `prefix` of the names in the
/// lines: the node with a slash. `restart`: parameters that need a restart of the node.
LiveChange applied(const LiveValues& values, const dynamic_reconfigure::Config& request,
                   const std::string& prefix, const std::set<std::string>& restart);

/// The node's `~set_parameters`, `~parameter_descriptions` and `~parameter_updates`. A request
/// changes only now() and number(), which the node reads where a change is safe. Active values are
/// set on the parameter server, too, so that a restarted node keeps them.
class LiveSettings {
 public:
  /// Throws InputError if the values contradict each other; that refuses a request.
  using Check = std::function<void(const LiveValues&)>;

  /// `restart`: all other parameters of the node.
  LiveSettings(const ros::NodeHandle& pnh, LiveValues values, const std::set<std::string>& restart,
               Check check = nullptr);
  ~LiveSettings();

  LiveValues now() const;
  double number(std::string_view name) const;

 private:
  friend struct LiveCall;

  /// Empty, or why it is refused. In a thread of its own: the node's data never wait.
  std::string apply(const dynamic_reconfigure::Config& request, const std::string& caller);
  void describe();

  ros::CallbackQueue queue_;  ///< first: publishers and service leave it when they end
  ros::NodeHandle nh_;
  const std::set<std::string> restart_;
  const Check check_;
  mutable std::mutex mutex_;
  LiveValues values_;
  ros::WallTime logged_;  ///< the last change
  ros::Publisher description_pub_, update_pub_;
  ros::ServiceServer service_;
  GuardedSpinner spinner_{1, &queue_};  ///< last: its thread uses the rest
};

}  // namespace assembly_cell::ros_bridge
