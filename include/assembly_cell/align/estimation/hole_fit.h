// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <vector>

#include "assembly_cell/align/failure.h"
#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// One measured contact: where the peg was (frame `peg` in a frame S that does not move) and in
/// which direction on its bottom edge the contact lay.
struct HoleReading {
  Pose X_SP;
  /// Azimuth on the edge in peg axes, unless `end_known` modulo π until fitHole resolves it [rad].
  double alpha = 0.0;
  double sd = 0.0;         ///< of alpha [rad]
  bool end_known = false;  ///< the locus determines which end of the diameter it is
  enum Kind {
    kOut,
    kPlane,
    kRim
  } kind = kOut;          ///< by fitHole: outlier, edge on plane, edge on rim
  bool explained = true;  ///< by fitHole: plane or an edge of the hole found lie in this direction
};

constexpr int kRimReadings = 4;  ///< that determine a hole, with one to spare

/// The hole in S.
struct HoleEstimate {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< of the hole plane, out of the hole
  double height = 0.0;                                ///< normal · any point of the plane [m]
  double height_sd = 0.0;                             ///< at the centre [m]; fitHole doesn't set it
  Eigen::Vector3d center = Eigen::Vector3d::Zero();   ///< of the rim [m]
  Eigen::Matrix2d center_covariance = Eigen::Matrix2d::Zero();  ///< in planeAxes(normal) [m²]
  double normal_sd = 0.0;                                       ///< [rad]
  int plane_readings = 0, rim_readings = 0;
};

/// Outcome of a fit: kNone, or why it doesn't determine the hole.
struct FitStatus {
  AlignFailure failure = AlignFailure::kNone;
  const char* message = "";
  bool good() const { return failure == AlignFailure::kNone; }
};

/// Two unit vectors that span the plane: S's x projected, and normal × it.
Eigen::Matrix<double, 3, 2> planeAxes(const Eigen::Vector3d& normal);

/// Plane alone: normal, height and normal_sd through the contacts by least squares. Resolves alpha;
/// kind is kPlane for all that lie in it, rim or not. Fails with kNoPlaneReading.
FitStatus fitPlane(double peg_radius, std::vector<HoleReading>& readings, HoleEstimate& estimate);

/// Finds plane and centre from readings at several tilts. All contacts lie in the hole plane, which
/// also distinguishes C from C*: of the two ends of the edge's diameter only one is at the plane's
/// height in every tilt of the wobble. Contacts away from the peg's lowest point are on the rim: at
/// distance hole_radius from the centre; the others on the plane, outside of it
/// (docs/theory/thesis.md, "From contacts to the hole"). `estimate.normal` is the start.
/// Resolves alpha and kind of every reading. Fails with kNoPlaneReading, kNoHoleUnderEdge (fewer
/// than `min_rim` contacts on the rim) or kOneEdgeOnly, which has the centre of the best circle.
FitStatus fitHole(double peg_radius, double hole_radius, std::vector<HoleReading>& readings,
                  HoleEstimate& estimate, int min_rim = kRimReadings);

}  // namespace assembly_cell
