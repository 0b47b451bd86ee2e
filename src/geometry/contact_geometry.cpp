// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/geometry/contact_geometry.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "contact_search.h"

namespace assembly_cell {

using namespace contact_search;

namespace {

// Where features meet, both may be valid at one point by rounding: keeps the edge–edge candidate.
void dropDoubles(double r, std::size_t slots, ContactSet& set, ContactSlotMask& valid) {
  for (std::size_t i = 0; i < slots; ++i) {
    if (!(kEdgeEdgeSlots >> i & 1u) || !set.slots[i].valid) continue;
    for (std::size_t j = 1; j < slots; ++j) {
      if (!set.slots[j].valid || (j <= i && kEdgeEdgeSlots >> j & 1u)) continue;
      const double distance2 = (set.slots[i].p - set.slots[j].p).squaredNorm();
      if (distance2 > square(kMerged * r)) continue;
      if (set.slots[i].normal.dot(set.slots[j].normal) < 1.0 - 1e-9) continue;
      set.slots[j].valid = false;
      valid &= ~(1u << j);
    }
  }
}

void edgePair(const Peg& e, const Rim& rim, double reach, std::size_t first,
              ContactSlotMask admitted, ContactSet& set) {
  for (std::size_t slot = first; slot < first + 2; ++slot) {
    ContactPoint& contact = set.slots[slot];
    contact.valid = false;
    if (!(admitted >> slot & 1u)) continue;
    edgeEdge(e, rim, reach, static_cast<int>(slot - first), set.valid >> slot & 1u, contact);
    if (!(contact.gap <= kKept * reach)) contact.valid = false;
  }
}

// Slots of one edge circle of the peg, the first of each pair.
struct EdgeSlots {
  std::size_t edge, plane, wall, low_edge, cone;
};
constexpr EdgeSlots kBottom{0, 2, 3, 8, 10}, kShoulder{14, 18, 19, 16, 21};
// First slots of rim_side and rim_cone, at lower and upper edge of the hole's chamfer.
constexpr std::size_t kSide = 5, kUpperSide = 12, kCone = 23, kLowerCone = 25;
constexpr ContactSlotMask pairOf(std::size_t first) { return 3u << first; }

// One edge circle of the peg against the block; with a chamfer in the hole against its upper edge,
// its cone, and its lower edge with the wall, with heights above that edge.
void findEdge(const EdgeCircle& circle, const Peg& e, const EdgeSlots& at,
              const ContactShapes& shapes, ContactSlotMask admitted, ContactSet& set) {
  const double far = 2 * shapes.reach, depth = shapes.chamfer.height;
  const Chamfer* cone = shapes.chamfer ? &shapes.chamfer : nullptr;
  const Rim upper{shapes.hole_radius + shapes.chamfer.width, cone, false};
  // below the plane, contacts with an inclined bore
  std::optional<Peg> straight;
  if (e.leans()) straight.emplace(straightened(circle, e.lean), shapes.bore_lean);
  const Peg& seen = straight ? *straight : e;
  edgePair(e, upper, shapes.reach, at.edge, admitted, set);
  set.slots[at.plane].valid = false;
  if (admitted >> at.plane & 1u) {
    edgePlane(seen, upper, shapes.hole_depth, far, set.slots[at.plane]);
  }
  if (!cone) {
    if (admitted & pairOf(at.wall)) edgeWall(seen, upper, far, at.wall, admitted, set);
    return;
  }
  const Rim lower{shapes.hole_radius, cone, true};
  if (admitted & pairOf(at.cone)) edgeCone(seen, upper, far, at.cone, admitted, set);
  edgePair(raised(e, depth), lower, shapes.reach, at.low_edge, admitted, set);
  if (admitted & pairOf(at.wall)) {
    edgeWall(raised(seen, depth), lower, far, at.wall, admitted, set);
  }
}

constexpr ContactSlotMask kOfRims = kRimSideSlots | kRimFaceSlots | kRimConeSlots;
// The rim, or the edges of the hole's chamfer, against the peg; side: circle where the peg's side
// begins.
void findRims(const Peg& e, const Peg& side, const ContactShapes& shapes, ContactSlotMask admitted,
              ContactSet& set) {
  set.slots[7].valid = false;
  if (!(admitted & kOfRims)) return;
  const double far = 2 * shapes.reach, depth = shapes.chamfer.height;
  const Chamfer* cone = shapes.chamfer ? &shapes.chamfer : nullptr;
  const Rim upper{shapes.hole_radius + shapes.chamfer.width, cone, false};
  const std::size_t first = cone ? kUpperSide : kSide;
  if (admitted & pairOf(first)) rimSide(side, upper, far, first, admitted, set);
  if (admitted & kRimFaceSlots) rimFace(e, upper.radius, far, set.slots[7]);
  if (admitted & pairOf(kCone)) rimCone(e, upper.radius, far, kCone, admitted, set);
  if (!cone) return;
  const Rim lower{shapes.hole_radius, cone, true};
  if (admitted & pairOf(kSide)) {
    rimSide(raised(side, depth), lower, far, kSide, admitted, set);
  }
  if (admitted & pairOf(kLowerCone)) {
    rimCone(raised(e, depth), lower.radius, far, kLowerCone, admitted, set);
  }
}

// Transforms contacts found with heights above the lower edge of the chamfer back.
void lowerBack(const Peg& e, double depth, ContactSlotMask admitted, ContactSet& set) {
  const Vec3 down = -depth * Vec3(1.0, e.lean(1), e.lean(2));
  for (const std::size_t i : {3, 4, 5, 6, 8, 9, 16, 17, 19, 20, 25, 26}) {
    if (!(admitted >> i & 1u) || !set.slots[i].valid) continue;
    set.slots[i].p += down;
    set.slots[i].rim += down;
  }
}

}  // namespace

ContactSet& ContactSet::operator=(const ContactSet& other) {
  for (std::size_t i = 0; i < kContactSlots; ++i) {
    if (other.slots[i].valid || (other.valid >> i & 1u)) {
      slots[i] = other.slots[i];
    } else {
      slots[i].valid = false;
    }
  }
  valid = other.valid;
  top_reached = other.top_reached;
  return *this;
}

const char* toString(ContactFeature feature) {
  constexpr const char* kNames[] = {"edge_edge", "edge_plane", "edge_wall", "rim_side",
                                    "rim_face",  "edge_cone",  "rim_cone"};
  return kNames[static_cast<std::size_t>(feature)];
}

Chamfer chamferOf(double width, double angle) {
  return {width, width / std::tan(angle), std::sin(angle), std::cos(angle)};
}

ContactSlotMask possibleSlots(const ContactShapes& shapes) {
  ContactSlotMask mask = kSharpRimSlots;
  if (shapes.chamfer) mask |= kHoleChamferMask;
  if (shapes.peg_chamfer) mask |= kPegChamferMask;
  if (shapes.chamfer && shapes.peg_chamfer) mask |= kBothChamfersMask;
  return mask;
}

EdgeCircle shoulderOf(const EdgeCircle& edge, const Chamfer& chamfer) {
  return {edge.center + chamfer.height * edge.axis0.cross(edge.axis1), edge.axis0, edge.axis1,
          edge.radius + chamfer.width};
}

ContactSlotMask findContacts(const EdgeCircle& edge, const ContactShapes& shapes,
                             ContactSlotMask admitted, ContactSet& set) {
  set.top_reached = false;
  admitted &= possibleSlots(shapes);
  // all of the peg is above the plane
  const double above = edge.center(0) - shapes.reach;
  const double amplitude2 = square(edge.radius + shapes.peg_chamfer.width) *
                            (square(edge.axis0(0)) + square(edge.axis1(0)));
  if (!(above <= 0.0 || above * above <= amplitude2)) {
    set.valid = 0;
    return 0;
  }

  Peg e(edge, shapes.bore_lean);
  if (!e.finite()) {
    set.valid = 0;
    return 0;
  }
  if (shapes.peg_chamfer) {
    e.cone = &shapes.peg_chamfer;
    const EdgeCircle circle = shoulderOf(edge, shapes.peg_chamfer);
    Peg shoulder(circle, shapes.bore_lean);
    shoulder.cone = e.cone;
    shoulder.shoulder = true;
    shoulder.length = shapes.peg_length - shapes.peg_chamfer.height;
    findEdge(circle, shoulder, kShoulder, shapes, admitted, set);
    findEdge(edge, e, kBottom, shapes, admitted, set);
    findRims(e, shoulder, shapes, admitted, set);
  } else {
    e.length = shapes.peg_length;
    findEdge(edge, e, kBottom, shapes, admitted, set);
    findRims(e, e, shapes, admitted, set);
  }
  if (shapes.chamfer) lowerBack(e, shapes.chamfer.height, admitted, set);

  ContactSlotMask valid = 0;
  for (ContactSlotMask left = admitted; left; left &= left - 1) {
    const int i = __builtin_ctz(left);
    if (set.slots[static_cast<std::size_t>(i)].valid) valid |= 1u << i;
  }
  if (valid & kEdgeEdgeSlots && valid & (valid - 1)) {
    const std::size_t slots = shapes.peg_chamfer ? kContactSlots
                              : shapes.chamfer   ? kHoleChamferSlots
                                                 : kSharpSlots;
    dropDoubles(e.r, slots, set, valid);
  }
  set.valid = valid;
  return valid;
}

void turnPlace(double by, ContactPoint& candidate) {
  // normalised to fourth order in `by`, its angle to seventh; stepBack() would take twice as long
  // (1 % of a vibrated run)
  const double d = by * by, scale = 1.0 - d * (0.5 - 0.375 * d);
  const double c = candidate.cos_t, s = candidate.sin_t;
  candidate.cos_t = scale * (c - by * s);
  candidate.sin_t = scale * (s + by * c);
  candidate.t += by * (1.0 - d * (1.0 / 3 - d * (1.0 / 5)));
}

double contactClearance(const EdgeCircle& edge, const ContactShapes& shapes) {
  // bounding cylinder of a chamfered peg
  const Peg e({edge.center, edge.axis0, edge.axis1, edge.radius + shapes.peg_chamfer.width});
  const double lowest = e.center(0) - e.amplitude;
  if (lowest > 0.0) return lowest;
  if (!(e.axis(0) > 0.1)) return 0.0;
  // horizontal sections of the peg up to the plane: ellipses with a semi-axis of at most r /
  // cos(tilt)
  const double lift = -e.center(0) / e.axis(0);
  const double at_plane = levelNorm(e.center + lift * e.axis);
  const double lean = shapes.bore_lean.norm();
  const double at_bottom =
      lean > 0.0 ? (e.center.tail<2>() - e.center(0) * shapes.bore_lean).norm() : e.offset;
  double wall = (shapes.hole_radius - std::max(at_bottom, at_plane)) * e.axis(0) - e.r;
  if (lean > 0.0) wall *= 1.0 - lean;
  return std::max(0.0, std::min(wall, lowest + shapes.hole_depth));
}

}  // namespace assembly_cell
