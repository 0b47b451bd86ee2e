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

/// What all parts of a search share: the carrier, frame S, and the estimate of the hole.
struct SearchState {
  /// Waits for two blocks. All references must outlive the state. Throws PlantError.
  SearchState(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
              const ProgressCallback& progress);

  /// Makes the carrier's present frame S.
  void startHere() { frame.startAt(carrier.last().carrier, carrier.last().time); }
  /// Deflection of the coupling from which the peg's pose follows, see absolute_deflection.
  Vector6 deflection() const;
  /// Deflection of the free peg at the carrier's target.
  Vector6 freeDeflection() const;
  /// The peg's pose in S, with the deflection.
  Pose peg() const { return frame.pegPose(carrier.last().carrier, deflection()); }
  /// Pose in S of the undeflected peg at the carrier's target.
  Pose target() const { return frame.pegPose(carrier.target(), Vector6::Zero()); }
  /// Sets `hanging` for a free, upright peg whose undeflected bottom centre is at `bottom`, in S.
  void setHanging(const Eigen::Vector3d& bottom);
  /// Number of blocks, at least one, for a duration in the default cell [s].
  int blocks(double duration) const;
  void report(const char* state, const std::string& message) const;

  const Mechanism& mechanism;
  const AlignParameters& p;
  const ProgressCallback& progress;
  const Scale scale;  ///< factors of the strategies' constants, which are for the default cell
  GuardedCarrier carrier;
  PressController press;
  SearchFrame frame;
  double start_time;  ///< plant clock [s]
  double block;       ///< duration of a block [s]
  /// Whether deflection() is measured from the unloaded coupling, or from the peg hanging at the
  /// start.
  bool absolute_deflection = false;
  /// Of the upright free peg: deflection(), and its bottom centre minus the undeflected one, in S
  /// [m].
  struct Hanging {
    Vector6 deflection = Vector6::Zero();
    Eigen::Vector3d sag;
  } hanging;

  int contacts = 0;    ///< number of readings
  HoleEstimate hole;   ///< in S
  bool found = false;  ///< whether there is an estimate of the hole
  /// What the progress reports of the hole. A standard deviation of 0 means unknown.
  struct {
    double position_sd = 0.0, rotation_sd = 0.0;  // [m], [rad]
    Clearance clearance;                          // from drawing, bore walls and touches
  } known;
  InsertResult inserted;
};

}  // namespace assembly_cell
