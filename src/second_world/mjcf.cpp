// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <cmath>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/second_world/second_world.h"
#include "layout.h"

namespace assembly_cell {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Tolerance of the engine's search for a contact's depth and normal. With 1e-10 normals are
// arbitrary for penetrations of an edge below a micrometre at the rim.
constexpr const char* kSearch = "mpr_tolerance='1e-8' mpr_iterations='100'";
constexpr double kFarDepth = 0.2;  // depth of a hole without a bottom [m]

void box(std::ostringstream& out, const char* name, const Matrix3d& R, const Vector3d& p,
         const Vector3d& half) {
  const Eigen::Quaterniond q(R);
  out << "<geom class='block' type='box' name='" << name << "' pos='" << p.x() << " " << p.y()
      << " " << p.z() << "' quat='" << q.w() << " " << q.x() << " " << q.y() << " " << q.z()
      << "' size='" << half.x() << " " << half.y() << " " << half.z() << "'/>\n";
}

// A box by its face towards the axis: midpoint of that face's upper edge, extents from there, and
// tilt of the face about that edge, its lower end inwards.
struct Wall {
  double angle, distance, z;  // of the edge's midpoint, cylindrical
  double height, thickness, half_width;
  double lean;
};

void wall(std::ostringstream& out, const std::string& name, const Wall& w) {
  const Matrix3d about =
      Eigen::AngleAxisd(w.angle, Vector3d::UnitZ()).toRotationMatrix();  // x: outwards
  const Matrix3d R = about * Eigen::AngleAxisd(w.lean, Vector3d::UnitY()).toRotationMatrix();
  const Vector3d edge = about * Vector3d(w.distance, 0.0, w.z);
  box(out, name.c_str(), R, edge + R * Vector3d(0.5 * w.thickness, 0.0, -0.5 * w.height),
      {0.5 * w.thickness, w.half_width, 0.5 * w.height});
}

}  // namespace

BoreLayout boreLayout(const Scenario& s, const SoftContact& contact) {
  BoreLayout b;
  b.facets = contact.facets;
  b.rim = s.mechanism.hole.radius;
  b.chamfer = contact.chamfer.value_or(s.mechanism.hole.chamfer_width);
  b.deep = contact.chamfer.value_or(chamferDepth(s.mechanism.hole));
  b.mouth = b.rim + b.chamfer;
  b.plate = b.mouth + 1e-4;
  b.reach = b.plate / std::cos(M_PI / BoreLayout::kPlates) + 1e-4;
  b.lean = s.imperfections.bore_lean.norm();
  b.depth = std::isfinite(s.mechanism.hole.depth) ? s.mechanism.hole.depth : kFarDepth;
  if (!(b.deep < b.depth)) {
    throw InputError("world: chamfer: value " + text("%g", b.chamfer) + ": it goes " +
                     text("%g m deep, the hole %g m; give less", b.deep, b.depth));
  }
  return b;
}

std::string mjcf(const Scenario& s, const SoftContact& contact) {
  const BoreLayout b = boreLayout(s, contact);
  const PegParameters& peg = s.mechanism.peg;
  if (peg.chamfer_width > 0.0) {
    throw InputError("peg.chamfer.width: value " + text("%g", peg.chamfer_width) +
                     ": the peg of world mujoco has a sharp edge; give 0 or world exact");
  }
  const CarrierParameters& carrier = s.mechanism.carrier;
  const double pi = M_PI, corner = std::tan(pi / b.facets);
  const Vector3d gravity = -s.mechanism.gravity * s.mechanism.up;
  std::ostringstream out;
  out.precision(17);
  out << "<mujoco model='second_world'>\n"
      << "<compiler angle='radian'/>\n"
      << "<option timestep='" << contact.time_step << "' gravity='" << gravity.x() << " "
      << gravity.y() << " " << gravity.z() << "' integrator='Euler' cone='elliptic' impratio='"
      << contact.friction_ratio << "' solver='Newton' iterations='50' tolerance='1e-12' " << kSearch
      << "/>\n"
      << "<size njmax='1500' nconmax='500'/>\n"
      << "<default><geom condim='3' friction='" << s.mechanism.friction.sliding_coefficient
      << " 0 0' solref='" << contact.contact_time << " 1' solimp='" << contact.impedance << " "
      << contact.impedance << " 1e-3'/><default class='block'/></default>\n"
      << "<worldbody><body name='block'>\n";
  // mean radius of the facets is the bore's: corners are as far outside as midpoints are inside
  const double middle = 0.5 * (1.0 + std::cos(pi / b.facets));
  for (int i = 0; i < b.facets; ++i) {
    const double angle = 2 * pi * i / b.facets;
    const Vector3d u(std::cos(angle), std::sin(angle), 0.0);
    const double slope = s.imperfections.bore_lean.dot(u.head<2>()), lean = std::atan(slope);
    const std::string number = std::to_string(i);
    wall(out, "wall" + number,
         {angle, b.rim * middle - b.deep * slope, -b.deep, b.depth, b.reach - b.rim, b.rim * corner,
          lean});
    if (b.chamfer <= 0.0) continue;
    const double inwards = b.chamfer + b.deep * slope;  // taper from the mouth to the bore
    wall(out, "chamfer" + number,
         {angle, b.mouth * middle, 0.0, std::hypot(inwards, b.deep), b.chamfer, b.mouth * corner,
          std::atan2(inwards, b.deep)});
    wall(out, "mouth" + number,
         {angle, b.mouth * middle, 0.0, b.uprightDepth(b.mouth), b.reach - b.mouth,
          b.mouth * corner, 0.0});
  }
  // plates around it, beyond the reach of the peg, and the bottom
  const double size = 4 * b.rim + 0.05;
  for (int i = 0; i < BoreLayout::kPlates; ++i) {
    const double angle = 2 * pi * i / BoreLayout::kPlates;
    const double half_width = (b.plate + size) * std::tan(pi / BoreLayout::kPlates);
    wall(out, "plate" + std::to_string(i),
         {angle, b.plate, 0.0, b.uprightDepth(b.plate), size, half_width, 0.0});
  }
  box(out, "bottom", Matrix3d::Identity(), {0.0, 0.0, -b.depth - 0.01},
      {b.reach + 0.01, b.reach + 0.01, 0.01});
  out << "</body>\n<body name='peg' pos='0 0 " << 1.0 + peg.half_height
      << "'><freejoint/><inertial pos='0 0 0' mass='" << peg.mass << "' diaginertia='"
      << peg.inertia_transverse << " " << peg.inertia_transverse << " " << peg.inertia_axial
      << "'/><geom type='cylinder' name='peg' size='" << peg.radius << " " << peg.half_height
      << "'/></body>\n"
      << "<body name='carrier'><joint type='slide' axis='1 0 0'/><joint type='slide' "
         "axis='0 1 0'/><joint type='hinge' axis='0 0 1'/><inertial pos='0 0 0' mass='"
      << carrier.mass << "' diaginertia='" << carrier.inertia << " " << carrier.inertia << " "
      << carrier.inertia << "'/></body>\n"
      << "</worldbody></mujoco>\n";
  return out.str();
}

}  // namespace assembly_cell
