// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Geometry>
#include <cmath>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

// Curvature of a minimum over its radius below which its point is undetermined: no rolling terms.
constexpr double kFlat = 1e-9;

// Vector from the centre of the rim's circle to its point; H'' = −radial.
Vec3 rimRadial(const ContactPoint& c) { return {0.0, c.tangent(2), -c.tangent(1)}; }

// Edge on edge: the rates t' and s' keep p − H normal to both tangents.
ContactRates edgeEdgeRates(const EdgeCircle& e, const ContactPoint& c, const Vec3& v_m,
                           const Vec3& omega) {
  const Vec3 radial = c.p - e.center;  // p'' = −radial, H'' = −rim, D = p − H = gap n
  const Vec3 turn = omega.cross(c.dp);
  const double rate = c.normal.dot(v_m), n_turn = c.normal.dot(turn);
  const double a11 = e.radius * e.radius - c.gap * c.normal.dot(radial);  // p'·p' + p''·D
  const double a12 = c.dp.dot(c.tangent);
  const Vec3 rim = rimRadial(c);
  const double a22 = rim.dot(c.p - (c.rim - rim));  // T·T − H''·D
  const double b1 = c.dp.dot(v_m) + c.gap * n_turn, b2 = c.tangent.dot(v_m);
  const double inverse = 1.0 / (a11 * a22 - a12 * a12), inverse_cross = 1.0 / c.cross_norm;
  const double t_rate = (a12 * b2 - a22 * b1) * inverse;
  const double s_rate = (a11 * b2 - a12 * b1) * inverse;
  // n' · v_m with n' = (I − n nᵀ)(T × p')' / |T × p'|
  const Vec3 slide = v_m - rate * c.normal;
  const double across =
      slide.cross(c.tangent).dot(turn - radial * t_rate) - s_rate * slide.cross(rim).dot(c.dp);
  return {n_turn * t_rate + across * inverse_cross, turn * t_rate, t_rate};
}

// Edge on plane, wall or cone: second derivatives of the gap by t and time.
ContactRates edgeRates(const EdgeCircle& e, const ContactPoint& c, const Vec3& v_m,
                       const Vec3& omega) {
  const Vec3 turn = omega.cross(c.dp);
  // along the circles of wall and cone; zero on the plane
  const double v_round = c.tangent.dot(v_m), dp_round = c.tangent.dot(c.dp);
  const double bend = -c.curvature * v_round;
  const double mixed = c.normal.dot(turn) + bend * dp_round;
  const double sharpness = -c.normal.dot(c.p - e.center) - c.curvature * dp_round * dp_round;
  ContactRates rates;
  rates.gap_bias = bend * v_round;
  if (sharpness < kFlat * e.radius) return rates;
  const double t_rate = -mixed / sharpness;
  rates.gap_bias += mixed * t_rate;
  rates.rolling = turn * t_rate;
  rates.run = t_rate;
  return rates;
}

// Rim on side, face or chamfer of the peg, relative to which the rim's point moves at −v_m.
ContactRates rimRates(const EdgeCircle& e, const ContactPoint& c, const Vec3& v_m,
                      const Vec3& omega) {
  const Vec3& n = c.normal;
  const Vec3 axis = e.axis0.cross(e.axis1);
  Vec3 round = axis.cross(n);
  if (c.feature == ContactFeature::kRimCone) round.normalize();
  const Vec3 v_rim =
      v_m - c.gap * omega.cross(n);  // velocity of the peg's material point at the rim
  const double spin = omega.dot(n);
  const double v_round = -round.dot(v_rim), t_round = round.dot(c.tangent);
  const double mixed = n.dot(omega.cross(c.tangent)) + c.curvature * v_round * t_round;
  const Vec3 rim = rimRadial(c);
  const double sharpness = n.dot(rim) + c.curvature * t_round * t_round;  // n · (−H'')
  ContactRates rates;
  rates.gap_bias = c.gap * (omega.squaredNorm() - spin * spin) - 2 * n.dot(omega.cross(v_rim)) +
                   c.curvature * v_round * v_round;
  const bool flat = sharpness < kFlat * rim.norm();
  const double s_rate = flat ? 0.0 : -mixed / sharpness;
  rates.gap_bias += mixed * s_rate;
  // velocity of the contact point along the peg; on the side, its circumferential part at the
  // radius
  Vec3 run = s_rate * c.tangent - v_rim;
  run -= n.dot(run) * n + c.curvature * c.gap * round.dot(run) * round;
  rates.rolling = omega.cross(run);
  rates.run = s_rate;
  return rates;
}

}  // namespace

ContactRates contactRates(const EdgeCircle& edge, const ContactPoint& contact, const Vec3& v_m,
                          const Vec3& omega) {
  switch (contact.feature) {
    case ContactFeature::kEdgeEdge:
      return edgeEdgeRates(edge, contact, v_m, omega);
    case ContactFeature::kEdgePlane:
    case ContactFeature::kEdgeWall:
    case ContactFeature::kEdgeCone:
      return edgeRates(edge, contact, v_m, omega);
    case ContactFeature::kRimSide:
    case ContactFeature::kRimFace:
    case ContactFeature::kRimCone:
      break;
  }
  return rimRates(edge, contact, v_m, omega);
}

}  // namespace assembly_cell
