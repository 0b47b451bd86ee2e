// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/geometry/contact_geometry.h"

#include <algorithm>
#include <cmath>

#include "contact_search.h"

namespace assembly_cell {

using namespace contact_search;

namespace {

// at a hand-over both neighbours may hold by rounding, at one place: the edge–edge candidate stays
void dropDoubles(double r, ContactSet& set, ContactSlotMask& valid) {
  for (std::size_t i = 0; i < set.slots.size(); ++i) {
    if (!(kEdgeEdgeSlots >> i & 1u) || !set.slots[i].valid) continue;
    for (std::size_t j = 1; j < set.slots.size(); ++j) {
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
    if (!(contact.gap <= 2 * reach)) contact.valid = false;
  }
}

void findAtRim(const EdgeCircle& edge, const Peg& e, const ContactShapes& shapes,
               ContactSlotMask admitted, ContactSet& set) {
  const double far = 2 * shapes.reach;
  const Rim rim{shapes.hole_radius};
  edgePair(e, rim, shapes.reach, 0, admitted, set);
  set.slots[2].valid = false;
  if (e.leans()) {
    // below the plane the block is where its bore is
    const Peg seen(straightened(edge, e.lean), shapes.bore_lean);
    if (admitted & kEdgePlaneSlots) edgePlane(seen, rim, shapes.hole_depth, far, set.slots[2]);
    if (admitted & kEdgeWallSlots) edgeWall(seen, rim, far, admitted, set);
  } else {
    if (admitted & kEdgePlaneSlots) edgePlane(e, rim, shapes.hole_depth, far, set.slots[2]);
    if (admitted & kEdgeWallSlots) edgeWall(e, rim, far, admitted, set);
  }
  if (admitted & kRimSideSlots) rimSide(e, rim, shapes.peg_length, far, admitted, set);
  set.slots[7].valid = false;
  if (admitted & kRimFaceSlots) rimFace(e, rim.radius, far, set.slots[7]);
}

// at a chamfered rim: the searches of its upper edge, its face, and its lower edge with the wall,
// for which heights are counted from that edge
void findAtChamfer(const EdgeCircle& edge, const Peg& e, const ContactShapes& shapes,
                   ContactSlotMask admitted, ContactSet& set) {
  const double far = 2 * shapes.reach, depth = shapes.chamfer.height;
  const Rim upper{shapes.hole_radius + shapes.chamfer.width, &shapes.chamfer, false};
  const Rim lower{shapes.hole_radius, &shapes.chamfer, true};
  const Peg seen = e.leans() ? Peg(straightened(edge, e.lean), shapes.bore_lean) : e;
  edgePair(e, upper, shapes.reach, 0, admitted, set);
  set.slots[2].valid = set.slots[7].valid = false;
  if (admitted & kEdgePlaneSlots) edgePlane(seen, upper, shapes.hole_depth, far, set.slots[2]);
  if (admitted & kEdgeConeSlots) edgeCone(seen, upper, far, admitted, set);
  if (admitted & kRimSideSlots & ~kSharpRimSlots)
    rimSide(e, upper, shapes.peg_length, far, admitted, set);
  if (admitted & kRimFaceSlots) rimFace(e, upper.radius, far, set.slots[7]);

  const Peg e_low = raised(e, depth), seen_low = raised(seen, depth);
  edgePair(e_low, lower, shapes.reach, 8, admitted, set);
  if (admitted & kEdgeWallSlots) edgeWall(seen_low, lower, far, admitted, set);
  if (admitted & kRimSideSlots & kSharpRimSlots)
    rimSide(e_low, lower, shapes.peg_length, far, admitted, set);
  const Vec3 down = -depth * Vec3(1.0, e.lean(1), e.lean(2));
  for (const std::size_t i : {3, 4, 5, 6, 8, 9}) {
    if (!(admitted >> i & 1u) || !set.slots[i].valid) continue;
    set.slots[i].p += down;
    set.slots[i].rim += down;
  }
}

}  // namespace

const char* toString(ContactFeature feature) {
  constexpr const char* kNames[] = {"edge_edge", "edge_plane", "edge_wall",
                                    "rim_side",  "rim_face",   "edge_cone"};
  return kNames[static_cast<std::size_t>(feature)];
}

Chamfer chamferOf(double width, double angle) {
  return {width, width / std::tan(angle), std::sin(angle), std::cos(angle)};
}

EdgeHeight edgeHeight(const EdgeCircle& e) {
  return {e.center(0), e.radius * std::sqrt(square(e.axis0(0)) + square(e.axis1(0)))};
}

ContactSlotMask findContacts(const EdgeCircle& edge, const ContactShapes& shapes,
                             ContactSlotMask admitted, ContactSet& set) {
  set.top_reached = false;
  if (!shapes.chamfer) admitted &= kSharpRimSlots;
  // all of the peg is above the plane: the height test needs neither root nor search
  const double above = edge.center(0) - shapes.reach;
  const double amplitude2 = square(edge.radius) * (square(edge.axis0(0)) + square(edge.axis1(0)));
  if (!(above <= 0.0 || above * above <= amplitude2)) {
    set.valid = 0;
    return 0;
  }

  const Peg e(edge, shapes.bore_lean);
  if (!e.finite()) {
    set.valid = 0;
    return 0;
  }
  if (shapes.chamfer) {
    findAtChamfer(edge, e, shapes, admitted, set);
  } else {
    findAtRim(edge, e, shapes, admitted, set);
  }

  ContactSlotMask valid = 0;
  const std::size_t slots = shapes.chamfer ? kContactSlots : kSharpSlots;
  for (std::size_t i = 0; i < slots; ++i) {
    if (admitted >> i & 1u && set.slots[i].valid) valid |= 1u << i;
  }
  if (valid & kEdgeEdgeSlots && valid & (valid - 1)) dropDoubles(e.r, set, valid);
  set.valid = valid;
  return valid;
}

double contactClearance(const EdgeCircle& edge, const ContactShapes& shapes) {
  const Peg e(edge);
  const double lowest = e.center(0) - e.amplitude;
  if (lowest > 0.0) return lowest;
  if (!(e.axis(0) > 0.1)) return 0.0;
  // level slices of the peg from the bottom to the plane: ellipses no longer than r / cos(tilt)
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
