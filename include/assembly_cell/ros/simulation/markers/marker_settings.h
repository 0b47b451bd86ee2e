// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>

#include <string>

#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/LocusEstimate.h"
#include "assembly_cell/TwinForceState.h"

namespace assembly_cell {
class FieldList;
struct CellDescription;
}  // namespace assembly_cell

namespace assembly_cell::ros_bridge {

/// Parameters of contact_markers that may change while it runs.
struct MarkerSettings {
  std::string wrench;             ///< topic of a live wrench; empty: none
  double rate = 15.0;             ///< of the pictures, wall clock [Hz]
  double lifetime = 5.0;          ///< [s]
  double size = 1.0;              ///< times the width of lines, points and arrows
  double force_scale = 0.002;     ///< [m/N]
  double force_threshold = 0.05;  ///< [N]
  double locus_scale = 1000.0;
  double locus_height = 0.15;  ///< above the peg's edge [m]
  double ellipsoid_scale = 100.0;
  double tip_height = 0.0;   ///< of the tip's plane along z of the wrench's frame [m]
  double one_pitch = 0.006;  ///< couple over force of one contact, at most [m]
  bool words = true;         ///< names, legend and state
};
void fields(FieldList& f, MarkerSettings& s);

/// Sizes of peg and hole that are drawn [m]; 0: not known, or without a chamfer.
struct PartShapes {
  double peg_radius = 0.0, peg_length = 0.0, hole_radius = 0.0;
  double tip_radius = 0.0, shoulder = 0.0;         ///< of the peg's chamfer
  double mouth_radius = 0.0, chamfer_depth = 0.0;  ///< of the hole's chamfer
};
PartShapes partShapes(const CellDescription& description);

/// The newest message of each topic; null: none.
struct MarkerInputs {
  ContactArray::ConstPtr contacts;
  LocusEstimate::ConstPtr locus;
  geometry_msgs::PoseStamped::ConstPtr truth;
  AlignmentReport::ConstPtr report;
  geometry_msgs::PoseStamped::ConstPtr truth_at_report;  ///< the peg moves on
  Exciter::ConstPtr exciter;
  TwinForceState::ConstPtr twin_force;
  geometry_msgs::WrenchStamped::ConstPtr wrench;
  std::string goal_id, feedback;  ///< of the goal that runs or ran last, and its last feedback
  bool inserts = false;           ///< that goal is of the action assemble
};

}  // namespace assembly_cell::ros_bridge
