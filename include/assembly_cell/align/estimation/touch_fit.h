// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <vector>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

// Plane and circle of a hole from the carrier's poses when a tilted peg touched: needs no strain
// matrix, and the mechanism's parameters to a tenth only.

/// One touch of the peg's bottom edge or its chamfer, frame `peg` in a frame S that does not move.
struct TouchReading {
  enum Kind {
    kEdge,  ///< from above: the edge outside the hole rests on its plane or on the chamfer
    kWall,  ///< from the side: the edge below the plane is against the wall
    kFree   ///< none: no point of the edge is in the block
  } kind = kEdge;
  Pose X_SP;        ///< with the coupling's deflection
  double sd = 0.0;  ///< of the peg's position along the touch [m]
  /// Where the line of action crosses the bottom, peg axes [m]; the sensor's own offset included.
  std::optional<Eigen::Vector2d> point;
  /// A sharp edge from above rests on the rim at two points, on both sides of its lowest one.
  bool on_two = false;
  /// Lateral slope of that line, aside over up, peg axes; only a chamfered peg is touched above its
  /// bottom.
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();
};

/// Prior knowledge, and the errors of a measured point. All standard deviations.
struct TouchModel {
  PegParameters peg;                                ///< its bottom edge with its chamfer
  HoleParameters hole;                              ///< with its chamfer
  Eigen::Vector2d start = Eigen::Vector2d::Zero();  ///< centre of the region of the hole, S [m]
  double position_sd = 0.012;                       ///< of the hole from there, per axis [m]
  double radius_sd = 2e-5;                          ///< of the hole's radius [m]
  double tilt_sd = 0.05;                            ///< of its plane against S, per axis [rad]
  double point_sd = 1e-3;                           ///< of a point of touch, per axis [m]
  double offset_sd = 4e-3;                          ///< common to all points, per axis [m]
};

/// The hole in S.
struct TouchFit {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< of its plane
  double height = 0.0;                                ///< normal · any point of the plane [m]
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   ///< of the rim [m]
  Eigen::Matrix2d center_covariance = Eigen::Matrix2d::Zero();  ///< of x and y in S [m²]
  double radius = 0.0;                                          ///< of the rim [m]
  double radius_sd = 0.0;                                       ///< [m]
  double height_sd = 0.0;                                       ///< at the centre [m]
  double normal_sd = 0.0;                                       ///< both axes [rad]
  /// Variance of where a move ends, per axis, from the residuals of touches from above. Its
  /// inverse, the weight of an error, is unbiased. [m²]
  double place_variance = 0.0;
  double chi2 = 0.0;  ///< prior included; as many degrees of freedom as residuals
  int residuals = 0;
};

/// Maximum a posteriori, from the best of a grid of centres: two circles of nearly one size cross
/// in places that several centres explain. Needs three edge readings whose points don't lie on a
/// line; throws InputError otherwise.
TouchFit fitTouches(const TouchModel& model, const std::vector<TouchReading>& readings);

/// Residual of a reading for a given hole, in metres: gap between edge and block outside the bore
/// (kEdge), reach of the edge below the plane beyond the wall (kWall), or how deep the edge would
/// be in the block (kFree, never positive).
double touchResidual(const TouchModel& model, const TouchReading& reading,
                     const Eigen::Vector3d& normal, const Eigen::Vector3d& center);

}  // namespace assembly_cell
