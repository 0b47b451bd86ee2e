// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>

namespace assembly_cell {

// Exact contact of the peg's bottom edge circle with the hole block {z <= 0, rho >= r_h}.
// All vectors of this header are in thesis axes (1, 2, 3) = (z, x, y) of frame `hole`. [m], [rad]

/// A vector of thesis axes in the axes x, y, z of frame `hole`, and back.
inline Eigen::Vector3d fromThesisAxes(const Eigen::Vector3d& v) { return {v(1), v(2), v(0)}; }
inline Eigen::Vector3d toThesisAxes(const Eigen::Vector3d& v) { return {v(2), v(0), v(1)}; }

/// The peg's edge circle: p(t) = center + radius (cos t axis0 + sin t axis1).
struct EdgeCircle {
  Eigen::Vector3d center;  ///< bottom centre
  Eigen::Vector3d axis0;   ///< R0, thesis peg axis 1
  Eigen::Vector3d axis1;   ///< R1, thesis peg axis 2
  double radius;
};

/// Height quantities of the edge circle over the hole plane: its points lie at c1 ± A.
struct EdgeHeight {
  double center;     ///< c1
  double amplitude;  ///< A = r_p sin(tilt)
  double lowest() const { return center - amplitude; }
  double highest() const { return center + amplitude; }
};
EdgeHeight edgeHeight(const EdgeCircle& edge);

/// One candidate contact point between block and peg edge.
struct ContactPoint {
  bool valid = false;
  double t = 0.0;      ///< parameter on the edge circle
  Eigen::Vector3d p;   ///< point of the peg's edge
  Eigen::Vector3d dp;  ///< dp/dt
  Eigen::Vector3d rim;  ///< H: nearest point of the rim (edge–edge), foot on the plane (edge–plane)
  Eigen::Vector3d tangent;  ///< T: rim tangent dH/ds, zero on the plane
  Eigen::Vector3d normal;   ///< n: unit, from block to peg
  double cross_norm = 0.0;  ///< |T × dp|, signed so that n = (T × dp)/cross_norm (edge–edge)
  double gap = 0.0;         ///< signed distance, < 0 penetrating
};

/// Edge–edge candidate of a slot: 0 where the edge leaves the hole with rising t (rho' > 0), 1
/// where it returns. Local minimum of the distance of the two circles with the edge climbing
/// outwards (thesis Fig 3.3); invalid where there is none, or where the tangents are parallel.
/// `warm`: t of the previous call, used when `use_warm`. Dynamics specification section 3.
ContactPoint findEdgeEdge(const EdgeCircle& edge, double hole_radius, int slot, bool use_warm,
                          double warm);

/// Edge–plane candidate: the lowest edge point, valid while it lies outside the rim. With the edge
/// parallel to the plane: the edge point farthest from the hole's axis.
ContactPoint findEdgePlane(const EdgeCircle& edge, double hole_radius);

/// The contact point runs along the edges and the normal turns: with a_m the acceleration of the
/// material point now in contact, g'' = n · a_m + gap_bias, and the velocity of the peg at the
/// contact point changes by a_m + rolling.
struct ContactRates {
  double gap_bias = 0.0;                              ///< [m/s²]
  Eigen::Vector3d rolling = Eigen::Vector3d::Zero();  ///< (omega × p') t' [m/s²]
};
/// v_m: velocity of the material point [m/s], omega: of the peg [rad/s].
ContactRates contactRates(const EdgeCircle& edge, const ContactPoint& contact,
                          const Eigen::Vector3d& v_m, const Eigen::Vector3d& omega);

}  // namespace assembly_cell
