// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <vector>

#include "assembly_cell/align/estimation/touch_fit.h"
#include "assembly_cell/align/search/search.h"

namespace assembly_cell {

/// Locates the hole from the positions of touches. Touches of the tilted peg's edge determine the
/// plane of the face and, where the edge sinks in over the rim, roughly the hole. Then the low edge
/// is put into the hole and moved against its wall on three sides. Only positions and thresholds
/// of force are used, so that strain matrices and the mechanism need not be known well. Part of the
/// strategies `touch` and `twin_force`.
class EdgeSearch {
 public:
  explicit EdgeSearch(Search& search);

  /// Lowers the peg from above `bottom`, its axes along R in S, to a touch, and adds a reading. An
  /// old zero is taken again before the descent. Throws AlignError `not_free`, and `wedged` unless
  /// `known`.
  void touch(const Eigen::Matrix3d& R);
  /// Adds a touch as a reading.
  void add(const Touch& touch);
  /// Fits plane and hole to the readings, into SearchState::hole. Throws AlignError
  /// `no_plane_reading`.
  void resolve();
  /// Puts the low edge into the hole, measures its walls, and enters; needs `known`. Throws
  /// AlignError `no_hole_under_edge` where each attempt touched the face, `not_inserted` after its
  /// attempts, and `too_tight` if the touches measured a peg that is larger than the hole.
  void enterByWalls();
  /// Throws AlignError `too_tight` if the touches measured a peg that is larger than the hole, or
  /// may be after several refused entries. For use where no entry has succeeded.
  void refuseTooTight() const;

  TouchModel model;
  std::vector<TouchReading> readings;
  Eigen::Vector3d bottom = Eigen::Vector3d::Zero();  ///< the peg's bottom centre, in S [m]
  bool known = false;                                ///< plane and, roughly, the hole
  double min_move_sd = 0.0;  ///< least standard deviation of where moves end, per axis [m]

 private:
  double dip(const Eigen::Matrix3d& R) const;
  void hover(const Eigen::Vector3d& place, const Eigen::Matrix3d& R);
  void liftOut(const Eigen::Matrix3d& R);
  void keep(const Touch& light);
  bool isFunnelled() const;
  bool drop(int attempt);
  bool walls();
  bool wall(const Eigen::Vector3d& direction);
  Eigen::Vector3d relaxed(const Eigen::Matrix3d& R);

  Search& search_;
  SearchState& s_;
  Eigen::Vector3d ahead_ = Eigen::Vector3d::UnitX();  // direction of the low edge in the hole
  double heading_ = 0.0;                              // its azimuth in the plane [rad]
  std::optional<Eigen::Vector3d> funnelled_;          // hole's centre when the chamfer was to lead
};

/// Number of attempts to put the edge into a hole in the region of starts, over that of the default
/// cell: a small peg needs more.
double moreDrops(const Mechanism& mechanism);

/// Vector from a peg's bottom centre to the hole's centre, in the plane of the face. [m]
Eigen::Vector3d toHole(const SearchState& s, const Eigen::Vector3d& bottom);

/// Axes of a peg that is tilted against the normal by `tilt`, its low side at azimuth a [rad].
Eigen::Matrix3d tiltedTo(const Eigen::Vector3d& normal, double a, double tilt);

}  // namespace assembly_cell
