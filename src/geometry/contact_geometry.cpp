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
  for (std::size_t i = 0; i < 2; ++i) {
    if (!set.slots[i].valid) continue;
    for (std::size_t j = i == 0 ? 1 : 2; j < set.slots.size(); ++j) {
      if (!set.slots[j].valid) continue;
      const double distance2 = (set.slots[i].p - set.slots[j].p).squaredNorm();
      if (distance2 > square(kMerged * r)) continue;
      if (set.slots[i].normal.dot(set.slots[j].normal) < 1.0 - 1e-9) continue;
      set.slots[j].valid = false;
      valid &= ~(1u << j);
    }
  }
}

}  // namespace

const char* toString(ContactFeature feature) {
  constexpr const char* kNames[] = {"edge_edge", "edge_plane", "edge_wall", "rim_side", "rim_face"};
  return kNames[static_cast<std::size_t>(feature)];
}

EdgeHeight edgeHeight(const EdgeCircle& e) {
  return {e.center(0), e.radius * std::sqrt(square(e.axis0(0)) + square(e.axis1(0)))};
}

ContactSlotMask findContacts(const EdgeCircle& edge, const ContactShapes& shapes,
                             ContactSlotMask admitted, ContactSet& set) {
  set.top_reached = false;
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
  const double far = 2 * shapes.reach;
  for (int slot = 0; slot < 2; ++slot) {
    ContactPoint& contact = set.slots[static_cast<std::size_t>(slot)];
    contact.valid = false;
    if (!(admitted >> slot & 1u)) continue;
    edgeEdge(e, shapes.hole_radius, shapes.reach, slot, set.valid >> slot & 1u, contact);
    if (!(contact.gap <= far)) contact.valid = false;
  }
  set.slots[2].valid = false;
  if (e.leans()) {
    // below the plane the block is where its bore is
    const Peg seen(straightened(edge, e.lean), shapes.bore_lean);
    if (admitted & kEdgePlaneSlots) edgePlane(seen, shapes, far, set.slots[2]);
    if (admitted & kEdgeWallSlots) edgeWall(seen, shapes.hole_radius, far, admitted, set);
  } else {
    if (admitted & kEdgePlaneSlots) edgePlane(e, shapes, far, set.slots[2]);
    if (admitted & kEdgeWallSlots) edgeWall(e, shapes.hole_radius, far, admitted, set);
  }
  if (admitted & kRimSideSlots) rimSide(e, shapes, far, admitted, set);
  set.slots[7].valid = false;
  if (admitted & kRimFaceSlots) rimFace(e, shapes, far, set.slots[7]);

  ContactSlotMask valid = 0;
  for (std::size_t i = 0; i < set.slots.size(); ++i) {
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
