// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/AssemblyRecord.h"
#include "assembly_cell/AssemblyVerdict.h"
#include "assembly_cell/RecorderState.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/SetPart.h"
#include "assembly_cell/records/store.h"
#include "assembly_cell/records/verdict.h"
#include "assembly_cell/ros/bridge/publish_shared.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

struct RecorderSettings {
  std::string store;    ///< file; empty: below ROS_HOME
  std::string station;  ///< empty: the host's name
  /// What a simulated cell was; empty for a real one.
  struct Simulation {
    std::string seed, world, mismatch;
  } simulation;
};
void fields(FieldList& f, RecorderSettings& s);
void fields(FieldList& f, RecorderSettings::Simulation& s);

/// Node assembly_recorder: stores the runs that the supervisor publishes, and publishes a verdict
/// on each. Interfaces: docs/reference/nodes/assembly_recorder.md.
class RecorderNode {
 public:
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters or rules, and where another recorder is running. A store
  /// that can't be written is in the node's state.
  RecorderNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  void onRecord(const AssemblyRecord& record);
  AssemblyVerdict store(Run& run);
  bool setPart(SetPart::Request& request, SetPart::Response& response);
  /// Adds what this node knows of the cell.
  void complete(Run& run, const std::string& scenario) const;
  /// The store, opened again after a failure. Throws InputError.
  RunStore& open();
  void checkStore();
  void setComplaint(const std::string& why);
  /// Loads the band of the next part's program.
  void setBand();
  void publishState();

  const std::string name_;
  RecorderSettings settings_;
  RunRules rules_;
  std::optional<RunStore> store_;  // none: closed since the last failure
  std::map<std::string, std::string> calibrations_, simulation_;
  std::string program_;  // by set_part; empty: the scenario's
  RecorderState state_;
  LatestPublisher<RecorderState> state_pub_;
  ros::Publisher verdict_pub_, diagnostics_pub_;
  ros::ServiceServer part_server_;
  std::vector<ros::Subscriber> subs_;
  ros::WallTimer timer_;
};

}  // namespace assembly_cell::ros_bridge
