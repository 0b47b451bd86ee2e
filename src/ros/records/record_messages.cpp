// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/records/record_messages.h"

#include <map>
#include <vector>

namespace assembly_cell::ros_bridge {

namespace {

using Pairs = std::map<std::string, std::string>;

std::vector<diagnostic_msgs::KeyValue> toMessage(const Pairs& pairs) {
  std::vector<diagnostic_msgs::KeyValue> out(pairs.size());
  std::size_t i = 0;
  for (const auto& [key, value] : pairs) {
    out[i].key = key;
    out[i++].value = value;
  }
  return out;
}

Pairs fromMessage(const std::vector<diagnostic_msgs::KeyValue>& message) {
  Pairs out;
  for (const auto& pair : message) out[pair.key] = pair.value;
  return out;
}

}  // namespace

AssemblyRecord toMessage(const Run& run) {
  AssemblyRecord message;
  message.serial = run.serial;
  message.program = run.program;
  message.program_hash = run.program_hash;
  message.start = ros::Time(run.start);
  message.duration = run.duration;
  message.strategy = run.strategy;
  message.result = run.result;
  message.failure = run.failure;
  message.text = run.text;
  message.versions = toMessage(run.versions);
  message.calibrations = toMessage(run.calibrations);
  message.settings = toMessage(run.settings);
  message.curve_time = run.curve.time;
  message.curve_depth = run.curve.depth;
  message.curve_axial = run.curve.axial;
  message.curve_lateral = run.curve.lateral;
  message.curve_moment = run.curve.moment;
  message.curve_tilt = run.curve.tilt;
  for (const RunEstimate& estimate : run.estimates) {
    message.estimates.push_back(estimate.name);
    message.estimate_values.push_back(estimate.value);
    message.estimate_sds.push_back(estimate.sd);
  }
  for (const RunEvent& event : run.events) {
    message.events.push_back(event.kind);
    message.event_times.push_back(event.time);
    message.event_texts.push_back(event.text);
  }
  return message;
}

Run fromMessage(const AssemblyRecord& message) {
  Run run;
  run.serial = message.serial;
  run.program = message.program;
  run.program_hash = message.program_hash;
  run.start = message.start.toSec();
  run.duration = message.duration;
  run.strategy = message.strategy;
  run.result = message.result;
  run.failure = message.failure;
  run.text = message.text;
  run.versions = fromMessage(message.versions);
  run.calibrations = fromMessage(message.calibrations);
  run.settings = fromMessage(message.settings);
  run.curve.time = message.curve_time;
  run.curve.depth = message.curve_depth;
  run.curve.axial = message.curve_axial;
  run.curve.lateral = message.curve_lateral;
  run.curve.moment = message.curve_moment;
  run.curve.tilt = message.curve_tilt;
  for (std::size_t i = 0; i < message.estimates.size(); ++i) {
    run.estimates.push_back(
        {message.estimates[i], message.estimate_values[i], message.estimate_sds[i]});
  }
  for (std::size_t i = 0; i < message.events.size(); ++i) {
    run.events.push_back({message.event_times[i], message.events[i], message.event_texts[i]});
  }
  return run;
}

}  // namespace assembly_cell::ros_bridge
