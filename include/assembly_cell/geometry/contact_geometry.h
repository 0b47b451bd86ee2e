// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>

namespace assembly_cell {

// Exact contact of the peg (solid cylinder) with the hole block (half-space z <= 0 less a
// cylinder); the hole's rim and the peg's bottom edge may be chamfered by a cone. All vectors of
// this header are in thesis axes (1, 2, 3) = (z, x, y) of frame `hole`. [m], [rad]

/// Components along x, y, z of frame `hole` from those along the thesis axes, and the inverse.
inline Eigen::Vector3d fromThesisAxes(const Eigen::Vector3d& v) { return {v(1), v(2), v(0)}; }
inline Eigen::Vector3d toThesisAxes(const Eigen::Vector3d& v) { return {v(2), v(0), v(1)}; }

/// The peg's bottom edge circle: p(t) = center + radius (cos t axis0 + sin t axis1). The peg stands
/// on it along axis0 × axis1.
struct EdgeCircle {
  Eigen::Vector3d center;  ///< bottom centre
  Eigen::Vector3d axis0;   ///< R0, thesis peg axis 1
  Eigen::Vector3d axis1;   ///< R1, thesis peg axis 2
  double radius;
};

/// Contact features: pairs of surfaces and edges of peg and block that can touch. Four are the
/// peg's edge circle p(t) against the block, three the rim circle H(s) against the peg:
///
///   feature     peg          block             normal (block → peg)   gap
///   edge_edge   bottom edge  rim               across both tangents   ± distance of the circles
///   edge_plane  bottom edge  plane z = 0 [1]   e1                     height of the lowest point
///   edge_wall   bottom edge  wall of the hole  −e_rho [2]             r_h − largest rho, z <= 0
///   rim_side    side         rim               −e_r of the peg        least axis distance − r_p
///   rim_face    bottom face  rim               peg axis a             −its height over the face
///   edge_cone   bottom edge  chamfer           sin e1 − cos e_rho     height of the place over it
///   rim_cone    chamfer      rim               sin a − cos e_r        its height over it
///
/// With a chamfer the rim is two circles: the upper edge in the plane and the lower edge where the
/// wall begins. edge_plane and rim_face are at the upper one, edge_wall is below the lower one,
/// edge_edge and rim_side are at both. A peg with a chamfer has two edge circles: the bottom edge
/// and the shoulder, where its side begins. Each takes the role of the bottom edge in the table;
/// rim_face is inside the bottom edge, rim_side above the shoulder. No other pair can touch, see
/// docs/theory/thesis.md.
///
/// [1] or the floor z = −hole_depth where the lowest point lies inside the rim.
/// [2] of an inclined bore: of the circle of radius r_h at the height of the point, see bore_lean.
/// edge_edge is valid while n is in the normal cones of both bodies. Its limits n = e1, −e_rho,
/// −e_r and a are the four others, with continuous gap and normal. A negative rim_face gap implies
/// a negative edge_plane gap: it matters only if edge_plane is not admitted.
enum class ContactFeature : std::uint8_t {
  kEdgeEdge,
  kEdgePlane,
  kEdgeWall,
  kRimSide,
  kRimFace,
  kEdgeCone,
  kRimCone
};
constexpr std::array<ContactFeature, 7> kContactFeatures = {
    ContactFeature::kEdgeEdge, ContactFeature::kEdgePlane, ContactFeature::kEdgeWall,
    ContactFeature::kRimSide,  ContactFeature::kRimFace,   ContactFeature::kEdgeCone,
    ContactFeature::kRimCone};
const char* toString(ContactFeature feature);  ///< as in scenario files: "edge_edge", ...

/// Fixed contact slots. A tilted edge circle has two contact points of one feature only if the axes
/// are nearly aligned, so that seldom more than two and never more than four touch.
///   0, 1  edge_edge: the edge leaves the hole with rising t (0), returns (1); local minima of the
///         distance of the two circles with the edge climbing outwards (thesis Fig 3.3)
///   2     edge_plane: the lowest point outside the rim; of a level edge the one farthest from the
///         hole's axis
///   3, 4  edge_wall: a slot follows its point from call to call; at first, the farther one is 3
///   5, 6  rim_side: likewise, the nearer one is 5
///   7     rim_face
/// With a chamfer on the hole, slots 0 to 2 and 7 are at its upper edge, 3 to 6 at and below its
/// lower edge:
///   8, 9  edge_edge at the lower edge, as 0, 1
///   10, 11  edge_cone: likewise, the deeper one is 10
///   12, 13  rim_side at the upper edge, as 5, 6: of a peg with more tilt than the chamfer
/// With a chamfer on the peg, slots 0 to 4 and 7 to 11 belong to its bottom edge; slots of its
/// shoulder:
///   14, 15  edge_edge, as 0, 1;  16, 17  as 8, 9
///   18      edge_plane, as 2;    19, 20  edge_wall, as 3, 4;  21, 22  edge_cone, as 10, 11
/// and of its chamfer:
///   23, 24  rim_cone, likewise, the deeper one is 23;  25, 26  at the lower edge of the hole's
constexpr int kSharpSlots = 8, kHoleChamferSlots = 14, kContactSlots = 27;
constexpr ContactFeature featureOfSlot(int slot) {
  constexpr ContactFeature kFeatures[kContactSlots] = {
      ContactFeature::kEdgeEdge,  ContactFeature::kEdgeEdge, ContactFeature::kEdgePlane,
      ContactFeature::kEdgeWall,  ContactFeature::kEdgeWall, ContactFeature::kRimSide,
      ContactFeature::kRimSide,   ContactFeature::kRimFace,  ContactFeature::kEdgeEdge,
      ContactFeature::kEdgeEdge,  ContactFeature::kEdgeCone, ContactFeature::kEdgeCone,
      ContactFeature::kRimSide,   ContactFeature::kRimSide,  ContactFeature::kEdgeEdge,
      ContactFeature::kEdgeEdge,  ContactFeature::kEdgeEdge, ContactFeature::kEdgeEdge,
      ContactFeature::kEdgePlane, ContactFeature::kEdgeWall, ContactFeature::kEdgeWall,
      ContactFeature::kEdgeCone,  ContactFeature::kEdgeCone, ContactFeature::kRimCone,
      ContactFeature::kRimCone,   ContactFeature::kRimCone,  ContactFeature::kRimCone};
  return kFeatures[slot];
}

/// Sets of slots, one bit each.
using ContactSlotMask = unsigned;
constexpr ContactSlotMask slotsOf(ContactFeature feature) {
  ContactSlotMask mask = 0;
  for (int slot = 0; slot < kContactSlots; ++slot) {
    if (featureOfSlot(slot) == feature) mask |= 1u << slot;
  }
  return mask;
}
constexpr ContactSlotMask kEdgeEdgeSlots = slotsOf(ContactFeature::kEdgeEdge),
                          kEdgePlaneSlots = slotsOf(ContactFeature::kEdgePlane),
                          kEdgeWallSlots = slotsOf(ContactFeature::kEdgeWall),
                          kRimSideSlots = slotsOf(ContactFeature::kRimSide),
                          kRimFaceSlots = slotsOf(ContactFeature::kRimFace),
                          kEdgeConeSlots = slotsOf(ContactFeature::kEdgeCone),
                          kRimConeSlots = slotsOf(ContactFeature::kRimCone),
                          kAllContactSlots = (1u << kContactSlots) - 1;
/// Slots of sharp shapes; slots added by the hole's chamfer, by the peg's chamfer for any hole, and
/// by both chamfers together. Slots that the shapes don't have are never valid.
constexpr ContactSlotMask kSharpRimSlots = (1u << kSharpSlots) - 1,
                          kHoleChamferMask = ((1u << kHoleChamferSlots) - 1) & ~kSharpRimSlots,
                          kBothChamfersMask = 3u << 16 | 3u << 21 | 3u << 25,
                          kPegChamferMask = kAllContactSlots & ~kSharpRimSlots & ~kHoleChamferMask &
                                            ~kBothChamfersMask;
/// Slots with their point on the peg's shoulder.
constexpr ContactSlotMask kShoulderSlots = 0x1ffu << 14;
/// Slots in pairs that follow their points from call to call.
constexpr ContactSlotMask kPairSlots =
    kEdgeWallSlots | kRimSideSlots | kEdgeConeSlots | kRimConeSlots;

/// One candidate contact point between block and peg.
struct ContactPoint {
  bool valid = false;
  ContactFeature feature = ContactFeature::kEdgeEdge;
  double t = 0.0;                   ///< parameter on the edge circle; on the rim (s) for rim_*
  double cos_t = 1.0, sin_t = 0.0;  ///< cosine and sine of t
  Eigen::Vector3d p;                ///< point of the peg
  Eigen::Vector3d dp;               ///< dp/dt along the edge; zero for rim_*
  Eigen::Vector3d rim;              ///< point of the block: on rim (H), plane, floor or wall
  /// T: rim tangent dH/ds for edge_edge and rim_*; for edge_wall the unit circumferential direction
  /// of the wall; zero for edge_plane
  Eigen::Vector3d tangent;
  Eigen::Vector3d normal;   ///< n: unit, from block to peg
  double cross_norm = 0.0;  ///< |T × dp|, signed so that n = (T × dp)/cross_norm (edge–edge)
  double gap = 0.0;         ///< signed distance n · (p − rim), < 0 penetrating
  /// curvature of the circle touched: 1/rho (edge_wall), 1/axis distance (rim_side), cos/rho
  /// (edge_cone), cos/axis distance (rim_cone)
  double curvature = 0.0;
};

/// A cone frustum in place of an edge: `width` across the axis, `height` along it, sine and cosine
/// of the angle of its face to the axis. Width 0: sharp.
struct Chamfer {
  double width = 0.0, height = 0.0;
  double sine = 0.0, cosine = 1.0;
  explicit operator bool() const { return width > 0.0; }
};
Chamfer chamferOf(double width, double angle);

/// Dimensions of peg and hole, and the search distance.
struct ContactShapes {
  double hole_radius = 0.0;
  double hole_depth = std::numeric_limits<double>::infinity();
  double peg_length = std::numeric_limits<double>::infinity();  ///< 2 h: height of the top edge
  /// Inclination of the bore: displacement of its axis along axes 2 and 3 per unit of height. The
  /// horizontal section at height z is the circle of radius r_h about z · bore_lean, so that the
  /// rim stays a circle. A right cylinder inclined by β has ellipses instead, longer by r_h (1/cos
  /// β − 1): 1 µm of 25 mm at 0.5°.
  Eigen::Vector2d bore_lean = Eigen::Vector2d::Zero();
  double reach = 2e-5;    ///< candidates with a larger gap may be omitted (not valid) [m]
  Chamfer chamfer{};      ///< chamfer of the hole: from radius r_h + width in the plane down to r_h
  Chamfer peg_chamfer{};  ///< chamfer of the peg: from the bottom edge up to the shoulder, wider by
                          ///< width
};

/// Slots that can be valid for these shapes.
ContactSlotMask possibleSlots(const ContactShapes& shapes);
/// Shoulder circle of a peg with this bottom edge and chamfer.
EdgeCircle shoulderOf(const EdgeCircle& edge, const Chamfer& chamfer);

/// Contact slots of one peg, which are also the warm starts of the next search. Copies omit points
/// that are neither in `valid` nor marked so themselves.
struct ContactSet {
  ContactSet() = default;
  ContactSet(const ContactSet& other) { *this = other; }
  ContactSet& operator=(const ContactSet& other);
  ~ContactSet() = default;

  std::array<ContactPoint, kContactSlots> slots;  ///< only those of `valid` are meaningful
  ContactSlotMask valid = 0;
  bool top_reached = false;  ///< the rim has run off the side over the peg's top edge
};

/// Searches the candidate contacts of the admitted slots: bounds first, then Newton's method from
/// the set's candidates or from closed-form starts. Returns and stores the mask of valid slots.
/// Does not allocate; results are finite; without a finite pose no slot is valid. Candidates with
/// one normal and less than 1e-6 radii between their points are merged. An overlapping point
/// belongs to the surface with the smallest penetration. The valid point of a wall or side slot
/// that is not admitted is reserved: the other slot of its pair does not get the same.
ContactSlotMask findContacts(const EdgeCircle& edge, const ContactShapes& shapes,
                             ContactSlotMask admitted, ContactSet& set);

/// Moves a candidate along its circle by an angle [rad], up to about 0.01, as the start of a
/// search.
void turnPlace(double by, ContactPoint& candidate);

/// Lower bound of the distance of peg and block [m], 0 if none is available. No contact closes
/// before a point of the peg has moved that far. Chamfers are ignored: they only remove material.
double contactClearance(const EdgeCircle& edge, const ContactShapes& shapes);

/// Second-order kinematics of a contact point that moves along both bodies: with a_m the
/// acceleration of the peg's material point, g'' = n · a_m + gap_bias, and the rate of the peg's
/// velocity at the contact point is a_m + rolling. The gap rate is g' = n · v_m. Exact for any gap.
struct ContactRates {
  double gap_bias = 0.0;  ///< [m/s²]
  Eigen::Vector3d rolling =
      Eigen::Vector3d::Zero();  ///< omega × (velocity of the contact point along the peg) [m/s²]
  double run = 0.0;             ///< dt/dtime of ContactPoint::t [rad/s]
};
/// edge: the circle of the contact's edge point (shoulderOf() for kShoulderSlots), any of them for
/// rim_*. v_m: velocity of the peg's material point at p [m/s]; omega: angular velocity of the peg
/// [rad/s].
ContactRates contactRates(const EdgeCircle& edge, const ContactPoint& contact,
                          const Eigen::Vector3d& v_m, const Eigen::Vector3d& omega);

}  // namespace assembly_cell
