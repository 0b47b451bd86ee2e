// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Closed-form algebra of the contact points of one rigid body, shared by the files of this folder.
// The same equations give forces from accelerations, impulses from velocities and corrections from
// gaps.
#pragma once

#include <Eigen/Geometry>
#include <array>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {

/// How the peg answers a force at a point: linear and angular acceleration.
struct Body {
  double mass = 1.0, inertia_transverse = 1.0, inertia_axial = 1.0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  Eigen::Matrix3d inverse_inertia = Eigen::Matrix3d::Identity();
  bool symmetric = true;  ///< inverse_inertia is the inverse of the inertia, not a thesis switch's
};

/// A force at the centre of mass with its moment about it.
struct ForceMoment {
  void add(const Eigen::Vector3d& r, const Eigen::Vector3d& at_r) {
    force += at_r;
    moment += r.cross(at_r);
  }
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), moment = Eigen::Vector3d::Zero();
};

/// One point of the body whose change is asked for, and the force that makes it. Made by
/// Constraints::add(): room for all slots costs nothing.
struct Constraint {
  std::size_t slot;           ///< of the contact; free to the caller
  bool stick;                 ///< three components are asked for, else the one along the normal
  Eigen::Vector3d r;          ///< lever from the centre of mass
  Eigen::Vector3d normal;     ///< slip: row
  Eigen::Vector3d direction;  ///< slip: of the force, scaled to 1 along the normal
  Eigen::Vector3d change;     ///< asked for; slip: only its part along the normal
  Eigen::Vector3d force;      ///< result
};

/// Points that are solved together.
struct Constraints {
  /// Frictionless until told otherwise; `change` is left to the caller.
  Constraint& add(std::size_t slot, const Eigen::Vector3d& r, const Eigen::Vector3d& normal) {
    Constraint& row = rows[n++];
    row.slot = slot;
    row.stick = false;
    row.force.setZero();
    row.r = r;
    row.normal = row.direction = normal;
    return row;
  }
  Constraint* begin() { return rows.data(); }
  Constraint* end() { return rows.data() + n; }
  const Constraint* begin() const { return rows.data(); }
  const Constraint* end() const { return rows.data() + n; }
  ForceMoment total() const {
    ForceMoment sum;
    for (const Constraint& row : *this) sum.add(row.r, row.force);
    return sum;
  }

  std::array<Constraint, kContactSlots> rows;
  std::size_t n = 0;
};

/// Forces that make the changes asked for. Redundant rows (two sticking points never change their
/// distance, points that coincide) get the least-norm solution. A slipping point beyond Painlevé's
/// bound, where friction would pull the contact shut by itself, is solved without its friction.
/// True where it has shown that wedgeMargin() is 1.
bool solveConstraints(const Body& body, Constraints& constraints);

/// How far slipping points are from being wedged by their friction: the determinant of their
/// equations, sticking points held, over the one without friction. At zero no finite force keeps
/// the points apart (Painlevé's paradox), beyond it friction drives them together. 1 where nothing
/// slips, where the points are redundant, and anywhere well above zero.
double wedgeMargin(const Body& body, const Constraints& constraints);

/// Change of the acceleration (velocity) of point r by a force (impulse) at point s.
inline Eigen::Vector3d response(const Body& body, const Eigen::Vector3d& r,
                                const Eigen::Vector3d& s, const Eigen::Vector3d& force) {
  return force / body.mass + (body.inverse_inertia * s.cross(force)).cross(r);
}

}  // namespace assembly_cell
