// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <string>

#include "assembly_cell/align/align.h"
#include "assembly_cell/align/estimation/hole_fit.h"
#include "assembly_cell/align/search/press_controller.h"
#include "assembly_cell/align/search/search_frame.h"

namespace assembly_cell {

using ProgressCallback = std::function<void(const AlignProgress&)>;

/// What all parts of one search work with: the carrier, frame S, and what is known of the hole.
struct SearchState {
  /// Waits for two blocks. All references must outlive the state. Throws PlantError.
  SearchState(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
              const ProgressCallback& progress);

  /// S is the carrier's present pose.
  void startHere() { frame.startAt(carrier.last().carrier, carrier.last().time); }
  /// Deflection of the coupling that frame `peg` includes, see absolute_deflection.
  Vector6 deflection() const;
  /// The same of the peg hanging free at the carrier's target.
  Vector6 freeDeflection() const;
  /// Frame `peg` in S, with the deflection.
  Pose peg() const { return frame.pegPose(carrier.last().carrier, deflection()); }
  /// Frame `peg` in S at the carrier's target, undeflected.
  Pose target() const { return frame.pegPose(carrier.target(), Vector6::Zero()); }
  /// The peg hangs free and upright with its undeflected bottom centre at `bottom`, in S.
  void setHanging(const Eigen::Vector3d& bottom);
  /// Blocks for a duration of the default cell [s], at least one.
  int blocks(double duration) const;
  void report(const char* state, const std::string& message) const;

  const Mechanism& mechanism;
  const AlignParameters& p;
  const ProgressCallback& progress;
  const Scale scale;  ///< constants of strategies are those of the default cell, times its factors
  GuardedCarrier carrier;
  PressController press;
  SearchFrame frame;
  double start_time;  ///< plant clock [s]
  double block;       ///< duration of a block [s]
  /// deflection() has the coupling's own zero; false: that of the peg hanging at the start.
  bool absolute_deflection = false;
  /// The upright free peg: its deflection(), and its bottom centre less the undeflected one, S [m].
  struct Hanging {
    Vector6 deflection = Vector6::Zero();
    Eigen::Vector3d sag;
  } hanging;

  int contacts = 0;   ///< readings taken
  HoleEstimate hole;  ///< in S
  bool found = false;
  /// Of the hole, as the progress reports it; an sd of 0: not known.
  struct {
    double position_sd = 0.0, rotation_sd = 0.0;  // [m], [rad]
    Clearance clearance;                          // by the drawing, bore walls and touches
  } known;
  InsertResult inserted;
};

}  // namespace assembly_cell
