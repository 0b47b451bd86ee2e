// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/geometry/contact_geometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kNewtonLimit = 12;
constexpr int kScanPoints = 96;
// below this |T × p'| / (r_h r_p) the tangents count as parallel and there is no candidate
constexpr double kParallel = 1e-6;
// an edge that crosses the hole's cylinder this high over the plane is not searched further [m]
constexpr double kHighCrossing = 2e-5;

// the meridian curve (x1, rho) of the edge and its derivatives by t
struct Meridian {
  double x1, dx1, ddx1;
  double rho, drho, ddrho;
  Eigen::Vector3d p, dp;
};

Meridian meridian(const EdgeCircle& e, double t) {
  const double c = std::cos(t), s = std::sin(t);
  const Eigen::Vector3d u = e.radius * (c * e.axis0 + s * e.axis1);
  Meridian m;
  m.p = e.center + u;
  m.dp = e.radius * (c * e.axis1 - s * e.axis0);
  m.x1 = m.p(0);
  m.dx1 = m.dp(0);
  m.ddx1 = -u(0);
  m.rho = std::hypot(m.p(1), m.p(2));
  const double inverse = m.rho > 0.0 ? 1.0 / m.rho : 0.0;
  m.drho = (m.p(1) * m.dp(1) + m.p(2) * m.dp(2)) * inverse;
  const double dp2 = m.dp(1) * m.dp(1) + m.dp(2) * m.dp(2);
  m.ddrho = (dp2 - (m.p(1) * u(1) + m.p(2) * u(2)) - m.drho * m.drho) * inverse;
  return m;
}

double phi(const Meridian& m, double r_h) { return m.x1 * m.dx1 + (m.rho - r_h) * m.drho; }

double distanceSquared(const Meridian& m, double r_h) {
  return m.x1 * m.x1 + (m.rho - r_h) * (m.rho - r_h);
}

bool admissible(const Meridian& m, int slot) {
  const double side = slot == 0 ? 1.0 : -1.0;
  return side * m.drho >= 0.0 && side * m.dx1 >= 0.0;
}

enum class Search { kFound, kOtherKind, kFailed };

// Newton on Phi(t) = 0 to a local minimum; of the slot's kind or not
Search newton(const EdgeCircle& e, double r_h, int slot, double& t, Meridian& m) {
  const double tolerance = 1e-14;
  for (int i = 0; i < kNewtonLimit; ++i) {
    m = meridian(e, t);
    const double slope = m.dx1 * m.dx1 + m.x1 * m.ddx1 + m.drho * m.drho + (m.rho - r_h) * m.ddrho;
    if (!(slope > 0.0)) return Search::kFailed;
    const double step = phi(m, r_h) / slope;
    if (!(std::abs(step) < 0.5)) return Search::kFailed;
    t -= step;
    if (std::abs(step) < 1e-9) {
      // quadratic convergence: one more evaluation is exact to rounding
      if (std::abs(step) > tolerance) m = meridian(e, t);
      return admissible(m, slot) ? Search::kFound : Search::kOtherKind;
    }
  }
  return Search::kFailed;
}

}  // namespace

EdgeHeight edgeHeight(const EdgeCircle& e) {
  return {e.center(0), e.radius * std::hypot(e.axis0(0), e.axis1(0))};
}

ContactPoint findEdgeEdge(const EdgeCircle& e, double r_h, int slot, bool use_warm, double warm) {
  ContactPoint contact;

  // the edge stays inside the hole's cylinder, or outside it: no crossing, no contact
  const double offset = std::hypot(e.center(1), e.center(2));
  if (offset + e.radius <= r_h || offset >= e.radius + r_h || offset < 1e-15) return contact;

  Meridian m;
  double t = warm;
  Search search = use_warm ? newton(e, r_h, slot, t, m) : Search::kFailed;

  if (search != Search::kFound) {
    // closed-form start: where the edge, if it were upright, crosses the hole's cylinder
    const double ey = e.center(1) / offset, ez = e.center(2) / offset;
    const double t_out =
        std::atan2(e.axis1(1) * ey + e.axis1(2) * ez, e.axis0(1) * ey + e.axis0(2) * ez);
    const double c = std::clamp(
        (r_h * r_h - e.radius * e.radius - offset * offset) / (2 * e.radius * offset), -1.0, 1.0);
    const double side = slot == 0 ? 1.0 : -1.0;
    const double crossing = t_out - side * std::acos(c);
    const EdgeHeight height = edgeHeight(e);
    const double t_low = std::atan2(-e.axis1(0), -e.axis0(0));

    // no contact where the edge crosses well above the plane; the bound on how far tilt moves the
    // crossing: the projected ellipse is narrower than the circle by r (1 − cos tilt)
    const double tilt = height.amplitude / e.radius;
    const double slope = offset * std::sqrt(1.0 - c * c);
    const double shift = e.radius * tilt * tilt / std::max(slope, 1e-12);
    const double at_crossing = height.center - height.amplitude * std::cos(crossing - t_low);
    if (shift < 0.3 && at_crossing > kHighCrossing + 2 * height.amplitude * shift) return contact;

    t = crossing;
    search = newton(e, r_h, slot, t, m);
    if (search != Search::kFound && height.amplitude > 0.0) {
      // second start: where the edge crosses the plane
      t = t_low + side * std::acos(std::clamp(height.center / height.amplitude, -1.0, 1.0));
      const Search second = newton(e, r_h, slot, t, m);
      if (second != Search::kFailed) search = second;
    }
    // last resort: scan the half circle for the nearest point of the right kind
    if (search == Search::kFailed && height.amplitude > 0.0) {
      double best = 1e300, best_t = 0.0;
      for (int i = 0; i < kScanPoints; ++i) {
        const double ti = t_low + side * kPi * (i + 0.5) / kScanPoints;
        const Meridian mi = meridian(e, ti);
        const double d = distanceSquared(mi, r_h);
        if (d < best && admissible(mi, slot)) {
          best = d;
          best_t = ti;
        }
      }
      if (best < 1e299) {
        t = best_t;
        search = newton(e, r_h, slot, t, m);
      }
    }
  }
  const bool found = search == Search::kFound;
  if (!found) return contact;

  const double inverse_rho = 1.0 / m.rho;
  contact.t = t;
  contact.p = m.p;
  contact.dp = m.dp;
  contact.rim = Eigen::Vector3d(0.0, m.p(1), m.p(2)) * (r_h * inverse_rho);
  contact.tangent = Eigen::Vector3d(0.0, -contact.rim(2), contact.rim(1));
  const Eigen::Vector3d cross = contact.tangent.cross(m.dp);
  const double norm = cross.norm();
  if (!(norm > kParallel * r_h * e.radius)) return contact;
  // n1 >= 0 and n · e_rho <= 0: up and towards the axis
  const double outward = (cross(1) * m.p(1) + cross(2) * m.p(2)) * inverse_rho;
  const double sign = std::abs(cross(0)) > std::abs(outward) ? (cross(0) >= 0.0 ? 1.0 : -1.0)
                                                             : (outward <= 0.0 ? 1.0 : -1.0);
  contact.cross_norm = sign * norm;
  contact.normal = cross / contact.cross_norm;
  // the signed distance along n; exact since p − H is normal to both tangents
  contact.gap = contact.normal.dot(m.p - contact.rim);
  contact.valid = true;
  return contact;
}

ContactPoint findEdgePlane(const EdgeCircle& e, double r_h) {
  ContactPoint contact;
  const EdgeHeight height = edgeHeight(e);
  double t;
  if (height.amplitude > 1e-12 * e.radius) {
    t = std::atan2(-e.axis1(0), -e.axis0(0));
  } else {
    const double offset = std::hypot(e.center(1), e.center(2));
    if (offset < 1e-15) return contact;
    t = std::atan2(e.axis1(1) * e.center(1) + e.axis1(2) * e.center(2),
                   e.axis0(1) * e.center(1) + e.axis0(2) * e.center(2));
  }
  const Meridian m = meridian(e, t);
  if (m.rho <= r_h) return contact;
  contact.valid = true;
  contact.t = t;
  contact.p = m.p;
  contact.dp = m.dp;
  contact.rim = Eigen::Vector3d(0.0, m.p(1), m.p(2));
  contact.tangent.setZero();
  contact.normal = Eigen::Vector3d::UnitX();
  contact.gap = height.lowest();
  return contact;
}

ContactRates contactRates(const EdgeCircle& e, const ContactPoint& c, const Eigen::Vector3d& v_m,
                          const Eigen::Vector3d& omega) {
  const Eigen::Vector3d radial = c.p - e.center;  // p'' = −radial
  const Eigen::Vector3d turn = omega.cross(c.dp);
  if (c.tangent.isZero()) {
    // the lowest point runs along the edge: e1 · (p'' t' + omega × p') = 0
    const double curvature = -radial(0);
    if (curvature < 1e-9 * e.radius) return {};
    const double t_rate = -turn(0) / curvature;
    return {turn(0) * t_rate, turn * t_rate};
  }
  const Eigen::Vector3d D = c.p - c.rim;
  const Eigen::Vector3d rim_curvature = -c.rim;  // H'' by the hole angle s
  // speeds of the contact point along both edges
  const double a11 = c.dp.squaredNorm() - radial.dot(D), a12 = -c.dp.dot(c.tangent);
  const double a21 = c.dp.dot(c.tangent), a22 = -c.tangent.squaredNorm() + rim_curvature.dot(D);
  const double b1 = -(c.dp.dot(v_m) + turn.dot(D)), b2 = -c.tangent.dot(v_m);
  const double determinant = a11 * a22 - a12 * a21;
  const double t_rate = (b1 * a22 - a12 * b2) / determinant;
  const double s_rate = (a11 * b2 - a21 * b1) / determinant;
  const Eigen::Vector3d cross_rate =
      s_rate * rim_curvature.cross(c.dp) + c.tangent.cross(turn - radial * t_rate);
  const Eigen::Vector3d n_rate = (cross_rate - c.normal * c.normal.dot(cross_rate)) / c.cross_norm;
  return {c.normal.dot(turn) * t_rate + n_rate.dot(v_m), turn * t_rate};
}

}  // namespace assembly_cell
