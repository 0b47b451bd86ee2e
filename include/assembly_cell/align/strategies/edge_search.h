// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "assembly_cell/align/estimation/touch_fit.h"
#include "assembly_cell/align/search/search.h"

namespace assembly_cell {

/// Locates the hole from the positions of touches: the peg's tilted edge on the face determines the
/// plane and, where it sinks over the rim, roughly the hole; then the low edge is put into the hole
/// and moved against its wall on three sides. Uses positions and thresholds of force only, so
/// strain matrices and the mechanism need not be known well. Part of `touch` and `twin_force`.
class EdgeSearch {
 public:
  explicit EdgeSearch(Search& search);

  /// One touch from above, over `bottom`, with the peg's axes along R in S; an old zero is taken
  /// again there first. Adds a reading. Throws AlignError `not_free`, and `wedged` unless `known`.
  void touch(const Eigen::Matrix3d& R);
  /// Adds a light touch as a reading.
  void add(const Touch& touch);
  /// Plane and hole from the readings, into SearchState::hole. Throws AlignError
  /// `no_plane_reading`.
  void resolve();
  /// The low edge into the hole, against its walls, and the entry; needs `known`. Throws AlignError
  /// `not_inserted` after its attempts, and `too_tight` after these or a minute where by the
  /// touches the peg is larger than the hole.
  void enterByWalls();
  /// Throws AlignError `too_tight` where no entry succeeds and by the touches the peg is larger
  /// than the hole.
  void refuseTooTight() const;

  TouchModel model;
  std::vector<TouchReading> readings;
  Eigen::Vector3d bottom = Eigen::Vector3d::Zero();  ///< the peg's bottom centre, in S [m]
  bool known = false;                                ///< plane and, roughly, the hole
  double min_move_sd = 0.0;  ///< of where moves end, per axis, whatever the readings show [m]

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
  Eigen::Vector2d pushedAt(const Eigen::Vector3d& p, const Eigen::Matrix3d& R,
                           const std::function<Eigen::Vector2d()>& push);

  Search& search_;
  SearchState& s_;
  Eigen::Vector3d ahead_ = Eigen::Vector3d::UnitX();  // direction of the low edge in the hole
  double heading_ = 0.0;                              // its azimuth in the plane [rad]
  std::optional<Eigen::Vector3d> funnelled_;          // hole's centre when the chamfer was to lead
};

/// Tries to put the edge into a hole somewhere in the region of starts, over those of the default
/// cell: more for a small peg.
double moreDrops(const Mechanism& mechanism);

/// From a peg's bottom centre to the hole's, in the plane. [m]
Eigen::Vector3d toHole(const SearchState& s, const Eigen::Vector3d& bottom);

/// Axes of a peg tilted against the normal, its low side at azimuth a [rad].
Eigen::Matrix3d tiltedTo(const Eigen::Vector3d& normal, double a, double tilt);

}  // namespace assembly_cell
