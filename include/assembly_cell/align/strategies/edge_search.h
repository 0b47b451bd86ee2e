// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "assembly_cell/align/estimation/touch_fit.h"
#include "assembly_cell/align/search/search.h"

namespace assembly_cell {

/// What touch and twin_force share: the peg's tilted edge touches the face, which tells the plane
/// and, where it sinks over the rim, roughly the hole; then the low edge is put into the hole and
/// moved against its wall on three sides. Only places and thresholds of force count.
class EdgeSearch : public Search {
 protected:
  using Vec2 = Eigen::Vector2d;
  using Vec3 = Eigen::Vector3d;
  using Mat3 = Eigen::Matrix3d;

  EdgeSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& p,
             const Progress& progress);

  /// Deflection of the peg hanging free where the carrier is, as deflection() would tell it.
  virtual Vector6 hangingFree() const { return sag(press_.target()) - sag(start_); }

  /// Of where moves end, per axis, by what the readings leave. [m²]
  virtual double placeVarianceOf(const TouchFit& fit) const { return fit.place_variance; }
  /// Rotation with the low side at azimuth a.
  static Mat3 tilted(const Vec3& normal, double a, double tilt);
  /// One touch from above, over bottom_, free before; the zero taken anew.
  void touch(const Mat3& R);
  /// A light touch as a reading.
  void remember(const Touch& light);
  /// Plane and hole by the readings.
  void resolve();
  /// The low edge into the hole, against its walls, and the entry, where the plane and roughly the
  /// hole are known. Throws `not_inserted` after its tries.
  void feelIn();
  /// Of the hole's centre from the peg's bottom at the start, in axes of the plane. [m]
  Vec2 offset() const;

  TouchModel model_;
  std::vector<TouchReading> readings_;
  Vec3 bottom_ = Vec3::Zero();  ///< where the peg's bottom centre is, in S [m]
  bool known_ = false;          ///< plane and, roughly, the hole

 private:
  double dip(const Mat3& R) const;
  void hover(const Vec3& place, const Mat3& R);
  void liftOut(const Mat3& R);
  void keep(const Touch& light);
  bool isFunnelled() const;
  bool drop(int turn);
  bool walls();
  bool wall(const Vec3& way);
  Vec3 relaxed(const Mat3& R);
  Vec2 pushedAt(const Vec3& p, const Mat3& R, const std::function<Vec2()>& push);
  double softness(const Vec3& way, const Mat3& R) const;

  Vec3 ahead_ = Vec3::UnitX();     // way of the low edge in the hole
  double heading_ = 0.0;           // its azimuth in the plane [rad]
  std::optional<Vec3> funnelled_;  // centre of the hole when the chamfer was to lead
};

}  // namespace assembly_cell
