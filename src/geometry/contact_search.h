// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Shared by the searches of edge and rim: points on circles, the peg, Newton steps, pairs of slots.
// Thesis axes.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstddef>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {
namespace contact_search {

using Vec3 = Eigen::Vector3d;

// Effect of half and twice each value, in this order: number of 360 000 random searches near
// contact (tilts from 1e-14 to 0.5, warm and cold starts) with other contacts.

constexpr int kNewtonLimit = 12;  // maximum number of Newton steps: 40, 0
// below this |T × p'| / (r_h r_p) the tangents count as parallel and there is no candidate:
// 28, 49
constexpr double kParallel = 1e-6;
// over the peg's radius: tilt (sine) and offset below which their direction is undefined, and
// rounding of a height where features meet: 32, 34; 8, 13; 0, 1
constexpr double kLevel = 1e-12, kCoaxial = 1e-13, kTouch = 1e-12;
constexpr double kNoOffset = 1e-15;  // offset without a direction [m]
// distance over the reach up to which candidates of edge and rim are kept as warm starts; without
// them a vibrated peg takes 2 % more; no other contacts
constexpr double kKept = 20.0;
// angle (chord over radius) below which candidates of one feature are merged: 12, 11
constexpr double kMerged = 1e-6;

inline double square(double x) { return x * x; }

// Products and norms of horizontal components; by elements, as vector loads of elements written one
// by one would stall (a fifth of a search).
inline double levelDot(const Vec3& a, const Vec3& b) { return a(1) * b(1) + a(2) * b(2); }
inline Vec3 combined(double a, const Vec3& u, double b, const Vec3& v) {
  return {a * u(0) + b * v(0), a * u(1) + b * v(1), a * u(2) + b * v(2)};
}
inline double squaredNorm(const Vec3& v) { return v(0) * v(0) + v(1) * v(1) + v(2) * v(2); }
inline double levelNorm(const Vec3& v) { return std::sqrt(levelDot(v, v)); }

// Point on a circle by cosine, sine and angle t, so that Newton steps need no trigonometry.
struct Place {
  double c, s, t;
};

struct Turn {
  double cosine, sine;
};
inline Turn turnOf(double step) {
  const double d = step * step;
  // the next terms are below 1e-17
  if (std::abs(step) < 1e-4) return {1.0 - d / 2, step * (1.0 - d / 6)};
  if (!(std::abs(step) < 0.02)) return {std::cos(step), std::sin(step)};
  return {1.0 - d / 2 * (1.0 - d / 12 * (1.0 - d / 30)),
          step * (1.0 - d / 6 * (1.0 - d / 20 * (1.0 - d / 42)))};
}

// Moves a point back by the angle `step`; normalises it.
inline Place stepBack(const Place& at, double step) {
  const auto [cosine, sine] = turnOf(step);
  const double c = at.c * cosine + at.s * sine, s = at.s * cosine - at.c * sine;
  const double scale = 1.5 - 0.5 * (c * c + s * s);
  return {c * scale, s * scale, at.t - step};
}

inline Place placeOf(double c, double s) { return {c, s, std::atan2(s, c)}; }

// Point in the direction (x, y); false for a zero vector.
inline bool placeTowards(double x, double y, Place& at) {
  const double norm = std::sqrt(x * x + y * y);
  if (!(norm > 0.0)) return false;
  const double inverse = 1.0 / norm;
  at.c = x * inverse;
  at.s = y * inverse;
  return true;
}

// An edge circle of the peg with quantities of the searches.
struct Peg {
  double r;
  Vec3 center;
  Vec3 p, q;  // r R0, r R1
  Vec3 axis;
  double amplitude;     // A = r sin(tilt)
  double sine, offset;  // sine of the tilt; distance of the centre from the hole's axis
  double lc, ls;        // cosine and sine of the lowest point's t; t = 0 for an upright peg
  Vec3 lean;            // (0, bore_lean)
  double length = 0.0;  // from this circle to the top
  // chamfer of the peg; shoulder: the circle is the shoulder, else the bottom edge
  const Chamfer* cone = nullptr;
  bool shoulder = false;

  explicit Peg(const EdgeCircle& e, const Eigen::Vector2d& bore_lean = Eigen::Vector2d::Zero())
      : r(e.radius),
        center(e.center),
        p(r * e.axis0),
        q(r * e.axis1),
        axis(e.axis0.cross(e.axis1)),
        amplitude(std::sqrt(p(0) * p(0) + q(0) * q(0))),
        sine(amplitude / r),
        offset(levelNorm(center)),
        lean(0.0, bore_lean(0), bore_lean(1)) {
    const bool upright = !tilted();
    const double inverse = upright ? 0.0 : 1.0 / amplitude;
    lc = upright ? 1.0 : -p(0) * inverse;
    ls = -q(0) * inverse;
  }

  bool tilted() const { return sine > kLevel; }
  bool leans() const { return lean(1) != 0.0 || lean(2) != 0.0; }
  bool finite() const { return std::isfinite(center(0) + offset + amplitude + axis.sum()); }

  // point of the edge in the direction of the centre's offset from the hole's axis
  bool placeOfOffset(Place& at) const {
    return placeTowards(levelDot(p, center), levelDot(q, center), at);
  }
};

// The peg with heights above a horizontal section that is lower by `by`.
inline Peg raised(const Peg& e, double by) {
  Peg up = e;
  up.center += by * Vec3(1.0, e.lean(1), e.lean(2));
  up.offset = levelNorm(up.center);
  return up;
}

// Edge of the block at height 0: the sharp rim (no cone), or one edge of a chamfer.
struct Rim {
  double radius;
  const Chamfer* cone = nullptr;
  bool lower = false;  // the edge at the wall, else the one in the plane
};

// Shear that maps an inclined bore to a right cylinder, applied to the edge (which becomes an
// ellipse); heights are unchanged.
inline EdgeCircle straightened(const EdgeCircle& e, const Vec3& lean) {
  return {e.center - e.center(0) * lean, e.axis0 - e.axis0(0) * lean, e.axis1 - e.axis1(0) * lean,
          e.radius};
}

enum class Search { kFound, kNone, kFailed };

// Halley's step for the root of a function with this value, slope and half second derivative.
// `last`: the error after the step is rounding, by cubic convergence (twice and half of the limits:
// the same contacts).
inline double halley(double value, double slope, double half_bend, bool& last) {
  const double inverse = 1.0 / slope, step = value * inverse, bend = half_bend * inverse * step;
  last = std::abs(step) < 1e-4 && bend * bend * std::abs(step) < 1e-15;
  return std::abs(bend) < 0.25 ? step * (1.0 + bend) : step;
}

// ---- extrema on a circle, and pairs of slots

// Half of a squared distance along a circle: first and second derivative, half of the third, and
// the squared distance.
struct Extremum {
  double value, slope, half_bend, distance2;
};

// Newton's method for the minimum (sign 1) or maximum (sign -1) of the distance; evaluate(place)
// returns an Extremum. `e` is the last but one; the last evaluation is for its side effect. kNone:
// beyond limit2, the squared limit of the distance.
template <typename Evaluate>
Search searchExtremum(const Evaluate& evaluate, double sign, double limit2, Place& at,
                      Extremum& e) {
  for (int i = 0; i < kNewtonLimit; ++i) {
    e = evaluate(at);
    if (!(sign * e.slope > 0.0)) return Search::kFailed;
    bool last = false;
    const double step = halley(e.value, e.slope, e.half_bend, last);
    if (!(std::abs(step) < 0.7)) return Search::kFailed;
    // extremum of the parabola, with its change doubled for the remainder
    if (std::abs(step) < 0.2 && sign * (e.distance2 - 2 * e.value * step) > sign * limit2) {
      return Search::kNone;
    }
    at = stepBack(at, step);
    if (last) {
      evaluate(at);
      return Search::kFound;
    }
  }
  return Search::kFailed;
}

inline bool sameAngle(const ContactPoint& a, const Place& b) {
  return std::abs(a.sin_t * b.c - a.cos_t * b.s) < kMerged && a.cos_t * b.c + a.sin_t * b.s > 0.0;
}

// The two slots of a feature with pairs of points: admitted ones are cleared, the points of the
// others are reserved.
struct SlotPair {
  ContactSet& set;
  ContactSlotMask admitted, warm;  // warm: slots with a candidate of the previous call
  std::size_t first;
  int found = 0;  // number of points reserved and found

  SlotPair(ContactSet& s, ContactSlotMask a, std::size_t f)
      : set(s), admitted(a), warm(s.valid & a & 3u << f), first(f) {
    for (std::size_t i = first; i < first + 2; ++i) {
      if (admitted >> i & 1u) set.slots[i].valid = false;
      found += set.slots[i].valid ? 1 : 0;
    }
  }
  bool taken(const Place& at) const {
    const ContactPoint &a = set.slots[first], &b = set.slots[first + 1];
    return (a.valid && sameAngle(a, at)) || (b.valid && sameAngle(b, at));
  }
};

// Fills a pair: from its candidates of the previous call, then from cold starts into the free
// slots. find(at) moves a point to a contact, start(first, at) returns the first or second cold
// start, fill(at, contact) sets the contact. single: there is one point only.
template <typename Find, typename Start, typename Fill>
void fillPair(SlotPair& pair, bool single, const Find& find, const Start& start, const Fill& fill) {
  auto& slots = pair.set.slots;
  for (std::size_t slot = pair.first; slot < pair.first + 2; ++slot) {
    if (!(pair.warm >> slot & 1u)) continue;
    Place at{slots[slot].cos_t, slots[slot].sin_t, slots[slot].t};
    if (!find(at) || pair.taken(at)) continue;
    fill(at, slots[slot]);
    ++pair.found;
  }
  if (pair.found == 2 || (pair.found == 1 && single)) return;
  for (int k = 0; k < (single ? 1 : 2) && pair.found < 2; ++k) {
    Place at{};
    if (!start(k == 0, at) || !find(at) || pair.taken(at)) continue;
    const std::size_t slot =
        pair.first + (pair.admitted >> pair.first & 1u && !slots[pair.first].valid ? 0 : 1);
    if (!(pair.admitted >> slot & 1u) || slots[slot].valid) continue;
    fill(at, slots[slot]);
    ++pair.found;
  }
}

// Projection of a circle of radius r with the sine of its tilt: an ellipse with its centre at (x,
// y) along major and minor axis, relative to a point.
struct Ellipse {
  double r, sine, cosine, x, y;

  // closed-form start for the farthest point of the ellipse (at end `end` = ±1 of the major axis)
  // or the nearest one (of the minor axis)
  bool start(double end, bool nearest, Place& at) const {
    const double bend = r * sine * sine;
    double lead = end;
    for (int i = 0; i < 2; ++i) {
      const bool directed = nearest ? placeTowards(-x, bend * lead - cosine * y, at)
                                    : placeTowards(x + bend * lead, cosine * y, at);
      if (!directed) return false;
      lead = nearest ? at.s : at.c;
    }
    return true;
  }
};

// ---- the searches; candidates with a gap above `far` are omitted; heights are above the rim's

// Point of the edge and its meridian curve (x(0), rho), with derivatives by t.
struct Meridian {
  Vec3 x, dx, u;  // p, p', p − centre
  double rho, inverse_rho, drho, ddrho;
};

inline void edgePoint(const Peg& e, const Place& at, Meridian& m) {
  m.u = combined(at.c, e.p, at.s, e.q);
  m.dx = combined(at.c, e.q, -at.s, e.p);
  m.x = combined(1.0, e.center, 1.0, m.u);
}

// Sets all but the block's point, normal and gap; by elements, which stay in registers.
inline void setEdge(ContactFeature feature, const Place& at, const Meridian& m,
                    ContactPoint& contact) {
  contact.valid = true;
  contact.feature = feature;
  contact.t = at.t;
  contact.cos_t = at.c;
  contact.sin_t = at.s;
  contact.p = Vec3(m.x);
  contact.dp = Vec3(m.dx);
  contact.tangent.setZero();
  contact.cross_norm = contact.curvature = 0.0;
}

// Depth of a point of the edge below a surface of the block, with derivatives by t.
struct Depth {
  double value, slope, bend;

  // the maximum of the parabola is below `depth`
  bool turnsAbove(double depth) const {
    return bend < 0.0 && slope * slope < 2 * bend * (value - depth);
  }
  // maximum of the parabola within ±sqrt(width2)
  double max(double width2) const {
    const double width = std::sqrt(width2), turn = std::abs(slope);
    if (bend < 0.0 && turn < -bend * width) return value - 0.5 * slope * slope / bend;
    return value + turn * width + 0.5 * bend * width2;
  }
};

// Below the plane.
inline Depth planeDepth(const Meridian& m) { return {-m.x(0), -m.dx(0), m.u(0)}; }

// Below the hole's chamfer.
inline Depth coneDepth(const Rim& rim, const Meridian& m) {
  const double s = rim.cone->sine, c = rim.cone->cosine;
  return {c * (m.rho - rim.radius) - s * m.x(0), c * m.drho - s * m.dx(0),
          c * m.ddrho + s * m.u(0)};
}

// Transforms a contact on the straightened edge back (inverse shear).
inline void leanBack(const Peg& seen, ContactPoint& contact) {
  if (!seen.leans()) return;
  contact.p += contact.p(0) * seen.lean;
  contact.dp += contact.dp(0) * seen.lean;
  contact.rim += contact.rim(0) * seen.lean;
}

// Contact of the inclined wall or cone, with normal and gap from the gradient of the gap; rise: its
// component along the first axis by the inclination.
inline void leanWall(const Peg& seen, double rise, ContactPoint& contact) {
  contact.normal(0) += rise;
  contact.tangent(0) = -levelDot(seen.lean, contact.tangent);
  const double length = contact.normal.norm(), inverse = 1.0 / length;
  contact.normal *= inverse;
  contact.tangent *= inverse;
  contact.gap *= inverse;
  contact.curvature *= length;
  leanBack(seen, contact);
}

// One or two lowest local minima of the gap over a cone among samples of a circle, in rising order.
// gap_at(place): gap; the samples begin at `start`.
struct LowestPlaces {
  // half of the smallest distance of two minima
  static constexpr int kSamples = 24;

  std::array<Place, 2> places;
  std::array<double, 2> gaps{};
  int n = 0;

  template <typename Gap>
  LowestPlaces(const Place& start, const Gap& gap_at) {
    std::array<Place, kSamples> at;
    std::array<double, kSamples> gap;
    at[0] = start;
    for (std::size_t i = 0; i < kSamples; ++i) {
      if (i > 0) at[i] = stepBack(at[i - 1], -2 * M_PI / kSamples);
      gap[i] = gap_at(at[i]);
    }
    for (std::size_t i = 0; i < kSamples; ++i) {
      const double before = gap[(i + kSamples - 1) % kSamples], after = gap[(i + 1) % kSamples];
      if (!(gap[i] <= before && gap[i] < after)) continue;
      const std::size_t to = n > 0 && gap[i] < gaps[0] ? 0 : 1;
      if (n == 0 || to == 0) {
        places[1] = places[0];
        gaps[1] = gaps[0];
        places[0] = at[i];
        gaps[0] = gap[i];
      } else if (n == 1 || gap[i] < gaps[1]) {
        places[1] = at[i];
        gaps[1] = gap[i];
      }
      n = n < 2 ? n + 1 : 2;
    }
  }

  // the lowest minimum, or the other
  bool start(bool lowest, Place& at) const {
    const std::size_t i = lowest ? 0 : 1;
    if (n <= static_cast<int>(i)) return false;
    at = placeOf(places[i].c, places[i].s);
    return true;
  }
};
// Ratio of the first to the second harmonic of the gap above which there is one minimum, which
// Newton's method reaches from that of the first harmonic.
constexpr double kOneMinimum = 12.0;

// slot: 0 or 1 of the pair
void edgeEdge(const Peg& e, const Rim& rim, double reach, int slot, bool warm,
              ContactPoint& contact);
void edgePlane(const Peg& e, const Rim& rim, double hole_depth, double far, ContactPoint& contact);
// pairs: slots `first` and first + 1
void edgeWall(const Peg& e, const Rim& rim, double far, std::size_t first, ContactSlotMask admitted,
              ContactSet& set);
// the rim is the upper one
void edgeCone(const Peg& e, const Rim& rim, double far, std::size_t first, ContactSlotMask admitted,
              ContactSet& set);
// e: the circle where the side begins
void rimSide(const Peg& e, const Rim& rim, double far, std::size_t first, ContactSlotMask admitted,
             ContactSet& set);
// e: the bottom edge
void rimCone(const Peg& e, double rim_radius, double far, std::size_t first,
             ContactSlotMask admitted, ContactSet& set);
void rimFace(const Peg& e, double rim_radius, double far, ContactPoint& contact);

}  // namespace contact_search
}  // namespace assembly_cell
