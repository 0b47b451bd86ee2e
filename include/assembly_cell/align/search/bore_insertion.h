// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/align/search/search_state.h"

namespace assembly_cell {

/// Motion in the bore: down to a depth or the floor, or up and out. The carrier follows the
/// coupling's strain, so that the walls lead the peg and errors of the hole's estimate don't
/// matter. Needs the hole's plane and the deflection of the hanging peg (SearchState::hanging);
/// the force stays bounded by InsertParameters::force down and a part of the force limit up.
class BoreInsertion {
 public:
  explicit BoreInsertion(SearchState& state) : s_(state) {}

  /// From the edge in the hole to the depth or the floor, into SearchState::inserted. Throws
  /// AlignError `jammed`, `not_seated`.
  void insert();
  /// Its time limit where none is given: AlignParameters::default_insert_time, or four times what
  /// the way takes without resistance [s].
  double defaultTime() const;
  /// The peg is upright in the bore at depth AlignParameters::inserted, hanging free of load.
  void startInBore();
  /// Up by `travel` [m], or as far as a bounded pull takes the peg, then until the walls relax.
  void backOut(double travel);
  /// Up along the bore and out of it from AlignParameters::inserted. Returns the target of the
  /// undeflected peg, in S; throws AlignError `stuck`.
  Pose leave();

 private:
  enum class End { kDeep, kStuck, kResisted };
  struct Descent {
    double step, careful;  // in a block, and where the floor may be [m]
    double near;           // depth from which on it may be [m]
  };
  Descent descent(double slow) const;
  End lower();
  double opposing(double direction) const;
  double maxForce() const;
  void pullUp(double travel, double pull);
  int blocksToFollow(double time) const;
  BoreReading move(double down);
  BoreReading measure();
  void sample(const BoreReading& measured, const Pose& X_SP);
  int wallContacts(const Vector6& wrench, double depth) const;
  void shake(double amplitude);
  bool isOnFloor(double min_depth);
  void refuseFloor(double depth, const std::optional<double>& before);
  bool pressAgain(const BoreReading& pressed);

  SearchState& s_;
  Pose X_SP_;        // target of the undeflected peg
  int sampled_ = 0;  // steps since the last sample of the curve
  int every_ = 0;    // steps a sample; 0: none
};

}  // namespace assembly_cell
