// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <mutex>
#include <string>
#include <vector>

#include "links/cell_view.h"
#include "links/locked_subscriber.h"

namespace assembly_cell::panel {

/// Curve of the descent, band, verdicts: from the supervisor and the recorder.
class RecordLink {
 public:
  explicit RecordLink(const ros::NodeHandle& nh);
  /// Fills in record.
  void show(CellView& view) const;

 private:
  mutable std::mutex mutex_;
  LockedSubscriber topics_;
  RecordView record_;
  std::string goal_;  // of the supervisor; empty: none
  ros::Subscriber state_sub_;
  std::vector<ros::Subscriber> subs_;
};

}  // namespace assembly_cell::panel
