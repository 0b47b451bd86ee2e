// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {

// One slot of the contact search alone, however far away its candidate is.
inline ContactPoint findSlot(const EdgeCircle& edge, double hole_radius, int slot, bool use_warm,
                             double warm) {
  ContactShapes shapes;
  shapes.hole_radius = hole_radius;
  shapes.reach = 10.0;  // [m]
  ContactSet set;
  ContactPoint& contact = set.slots[static_cast<std::size_t>(slot)];
  contact.t = warm;
  contact.cos_t = std::cos(warm);
  contact.sin_t = std::sin(warm);
  set.valid = use_warm ? 1u << slot : 0u;
  findContacts(edge, shapes, 1u << slot, set);
  return contact;
}

// Edge–edge candidate of a slot: 0 where the edge leaves the hole with rising t (rho' > 0), 1 where
// it returns. `warm`: t of the previous call, used when `use_warm`.
inline ContactPoint findEdgeEdge(const EdgeCircle& edge, double hole_radius, int slot,
                                 bool use_warm, double warm) {
  return findSlot(edge, hole_radius, slot, use_warm, warm);
}

// Edge–plane candidate: the lowest edge point, valid while it lies outside the rim. With the edge
// parallel to the plane: the edge point farthest from the hole's axis.
inline ContactPoint findEdgePlane(const EdgeCircle& edge, double hole_radius) {
  return findSlot(edge, hole_radius, 2, false, 0.0);
}

}  // namespace assembly_cell
