// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Closed-form algebra of the contact points of one rigid body, shared by the files of this folder.
// The same equations give forces from accelerations, impulses from velocities and corrections from
// gaps.
#pragma once

#include <Eigen/Geometry>
#include <array>

#include "assembly_cell/geometry/contact_geometry.h"

namespace assembly_cell {

/// Mass and inertia of the peg. `axis`: unit, thesis axes.
struct Body {
  double mass = 1.0, inertia_transverse = 1.0, inertia_axial = 1.0;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  Eigen::Matrix3d inverse_inertia = Eigen::Matrix3d::Identity();
  bool symmetric = true;  ///< false: inverse_inertia is that of thesis_moments, not symmetric
};

/// A force at the centre of mass with its moment about it.
struct ForceMoment {
  void add(const Eigen::Vector3d& r, const Eigen::Vector3d& at_r) {
    force += at_r;
    moment += r.cross(at_r);
  }
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), moment = Eigen::Vector3d::Zero();
};

/// Prescribed change of acceleration (velocity, position) of one point of the body, and the force
/// that causes it. Filled in by Constraints::add(); deliberately uninitialised before.
struct Constraint {
  std::size_t slot;           ///< for the caller: contact slot
  bool stick;                 ///< all three components are prescribed, else the normal one
  Eigen::Vector3d r;          ///< lever from the centre of mass
  Eigen::Vector3d normal;     ///< unit; slip: row of the equations
  Eigen::Vector3d direction;  ///< slip: of the force, normal component 1
  Eigen::Vector3d change;     ///< prescribed; slip: only its normal component
  Eigen::Vector3d force;      ///< result
};

/// Coupled constraints of one body.
struct Constraints {
  /// Appends a frictionless constraint; `change` is to be set by the caller.
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

/// Solves for the forces of the constraints. Redundant rows (the distance of two sticking points is
/// constant; coinciding points) get the minimum-norm solution. A slipping point beyond Painlevé's
/// bound, where a positive normal force would accelerate it towards the block, is solved without
/// friction. True if wedgeMargin() is known to be 1.
bool solveConstraints(const Body& body, Constraints& constraints);

/// Distance of the slipping points from Painlevé's paradox: determinant of their equations with
/// friction, sticking points held, over the one without friction. At zero no finite force keeps the
/// bodies apart; below zero friction accelerates them together. Returns 1 without slip, for
/// redundant points, and wherever it is well above zero.
double wedgeMargin(const Body& body, const Constraints& constraints);

/// Change of the acceleration (velocity) of point r by a force (impulse) at point s.
inline Eigen::Vector3d response(const Body& body, const Eigen::Vector3d& r,
                                const Eigen::Vector3d& s, const Eigen::Vector3d& force) {
  return force / body.mass + (body.inverse_inertia * s.cross(force)).cross(r);
}

}  // namespace assembly_cell
