// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblyRecord.h"
#include "assembly_cell/AssemblyVerdict.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/RecorderState.h"
#include "assembly_cell/align/align.h"
#include "assembly_cell/records/run.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

struct RecordSettings {
  enum class Mode { kOff, kBestEffort, kRequired };
  Mode record = Mode::kOff;
  double record_timeout = 1.0;  ///< for the recorder's answer, wall clock [s]
};
void fields(FieldList& f, RecordSettings& s);

/// Has assembly_recorder store each goal align or assemble, and collects the events of one. No
/// function waits but store(), whose wait is bounded, whether the recorder is running, frozen or
/// gone.
class RunRecorder {
 public:
  RunRecorder(ros::NodeHandle& nh, const RecordSettings& settings, double slow_factor);

  /// A goal begins. Throws InputError if a record is required and can't be stored.
  void begin();
  /// Notes the strategy's retries.
  void add(const AlignProgress& progress);
  /// Adds the goal's events to its record, has it stored, and enters the answer into the report. A
  /// run that has to be stored and isn't has failed. origin: time 0 of the goal; cancelled_by: a
  /// node.
  void store(AssemblyRecord& record, const ros::Time& origin, const std::string& cancelled_by,
             AlignResult& result, AlignmentReport& report);

 private:
  void onState(const RecorderState& state);
  void onVerdict(const AssemblyVerdict& verdict);
  void onPlant(const PlantState& plant);
  struct Answer {
    std::int64_t id = 0;  // in the store; 0: not stored
    std::string text;     // verdict, or why not stored
  };
  /// Publishes the record and waits until it is stored.
  Answer publish(const AssemblyRecord& record);
  void addEvents(AssemblyRecord& record, const ros::Time& origin, const std::string& cancelled_by,
                 const AlignResult& result) const;
  bool isRequired() const { return settings_.record == RecordSettings::Mode::kRequired; }
  /// Empty, or why no run can be stored.
  std::string complaint() const;

  struct Hold {
    ros::Time stamp;
    std::string reason;
  };

  RecordSettings settings_;
  ros::Publisher record_pub_;
  mutable std::mutex mutex_;  // of what follows
  std::condition_variable changed_;
  RecorderState state_;
  ros::WallTime received_;              // the state; zero: never
  std::optional<std::string> pending_;  // goal id of the record that has no answer yet
  AssemblyVerdict verdict_;
  bool is_held_ = false;
  std::vector<Hold> holds_;
  Run run_;                                              // of the goal under way: its retries
  ros::Subscriber state_sub_, verdict_sub_, plant_sub_;  // last: their callbacks use the rest
};

}  // namespace assembly_cell::ros_bridge
