// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/description/urdf_text.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <sstream>

namespace assembly_cell {
namespace {

constexpr double kAluminium = 2700.0;                           // [kg/m³]
constexpr double kMinHeight = 0.060;                            // minimum height of the block [m]
constexpr int kBoxes = 24;                                      // boxes of the block's ring
constexpr int kSteps = 8;                                       // cylinders of the peg's chamfer
constexpr double kSensorRadius = 0.04, kSensorHeight = 0.03;    // sensor_a [m]
constexpr double kCouplingRadius = 0.018, kCouplingUp = 0.010;  // sensor_b [m]
constexpr double kCouplingDown = 0.020, kMinDown = 0.001;       // where the peg is long enough [m]

// Angles of R = Rz(yaw) Ry(pitch) Rx(roll), as URDF has them; where pitch is a right angle roll is
// 0.
Eigen::Vector3d rollPitchYaw(const Eigen::Matrix3d& R) {
  constexpr double kRightAngle = 1.0 - 1e-12;
  if (std::abs(R(2, 0)) > kRightAngle) {
    return {0.0, -std::copysign(M_PI_2, R(2, 0)), std::atan2(-R(0, 1), R(1, 1))};
  }
  return {std::atan2(R(2, 1), R(2, 2)), 0.0 - std::asin(R(2, 0)), std::atan2(R(1, 0), R(0, 0))};
}

// Writer of URDF elements; visual and collision shapes are the same.
class Text {
 public:
  Text() { out_.precision(15); }

  void link(const std::string& name) { out_ << "  <link name=\"" << name << "\">\n"; }
  void end() { out_ << "  </link>\n"; }
  /// Origin at a height along the child's z axis.
  void joint(const std::string& parent, const std::string& child, double z,
             const char* type = "fixed", const Eigen::Matrix3d& R = Eigen::Matrix3d::Identity()) {
    const Eigen::Vector3d p = z * R.col(2), rpy = rollPitchYaw(R);
    out_ << "  <joint name=\"" << parent << "_to_" << child << "\" type=\"" << type << "\">"
         << "<parent link=\"" << parent << "\"/><child link=\"" << child << "\"/><origin xyz=\""
         << p.x() << " " << p.y() << " " << p.z() << "\" rpy=\"" << rpy.x() << " " << rpy.y() << " "
         << rpy.z() << "\"/></joint>\n";
  }
  void inertial(double z, double mass, double transverse, double axial) {
    out_ << "    <inertial><origin xyz=\"0 0 " << z << "\"/><mass value=\"" << mass
         << "\"/><inertia ixx=\"" << transverse << "\" ixy=\"0\" ixz=\"0\" iyy=\"" << transverse
         << "\" iyz=\"0\" izz=\"" << axial << "\"/></inertial>\n";
  }
  void cylinder(const std::string& name, const char* material, double z, double radius,
                double length) {
    std::ostringstream shape;
    shape.precision(15);
    shape << "<origin xyz=\"0 0 " << z << "\"/><geometry><cylinder radius=\"" << radius
          << "\" length=\"" << length << "\"/></geometry>";
    solid(name, material, shape.str());
  }
  void box(const std::string& name, const char* material, const Eigen::Vector3d& at, double yaw,
           const Eigen::Vector3d& size, double pitch = 0.0) {
    std::ostringstream shape;
    shape.precision(15);
    shape << "<origin xyz=\"" << at.x() << " " << at.y() << " " << at.z() << "\" rpy=\"0 " << pitch
          << " " << yaw << "\"/><geometry><box size=\"" << size.x() << " " << size.y() << " "
          << size.z() << "\"/></geometry>";
    solid(name, material, shape.str());
  }
  // visual of a cavity, from the face down
  void hollow(const char* name, double radius, double depth) {
    out_ << "    <visual name=\"" << name << "\"><origin xyz=\"0 0 " << -0.5 * depth
         << "\"/><geometry><cylinder radius=\"" << radius << "\" length=\"" << depth
         << "\"/></geometry><material name=\"bore\"/></visual>\n";
  }
  void raw(const char* text) { out_ << text; }
  std::string str() const { return out_.str(); }

 private:
  void solid(const std::string& name, const char* material, const std::string& shape) {
    out_ << "    <visual name=\"" << name << "\">" << shape << "<material name=\"" << material
         << "\"/></visual>\n    <collision name=\"" << name << "\">" << shape << "</collision>\n";
  }

  std::ostringstream out_;
};

// Body of revolution; moments of inertia about the centre of mass, which is at height `centre` [m].
struct Inertia {
  double mass, centre, transverse, axial;
};

// Subtracts the volume of the chamfer.
void cutChamfer(const HoleParameters& hole, Inertia& block) {
  const double R = hole.radius, deep = chamferDepth(hole);
  double mass = 0.0, moment = 0.0, about_face = 0.0, axial = 0.0;
  // integrands are polynomials of fourth degree in z, exact with three Gauss points
  const double step = std::sqrt(0.6);
  for (const double x : {-step, 0.0, step}) {
    const double weight = kAluminium * deep * (x == 0.0 ? 4.0 / 9.0 : 5.0 / 18.0);
    const double z = -0.5 * deep * (1.0 + x);
    const double r = R + (z + deep) * hole.chamfer_width / deep;
    const double area = M_PI * (r * r - R * R),
                 polar = 0.5 * M_PI * (std::pow(r, 4) - std::pow(R, 4));
    mass += weight * area;
    moment += weight * area * z;
    axial += weight * polar;
    about_face += weight * (0.5 * polar + area * z * z);
  }
  const double left = block.mass - mass;
  const double centre = (block.mass * block.centre - moment) / left;
  block.transverse +=
      block.mass * block.centre * block.centre - about_face - left * centre * centre;
  block = {left, centre, block.transverse, block.axial - axial};
}

// Chamfer: a ring of boxes outside the mouth, and a box along each of kBoxes generators.
void writeMouth(Text& out, const HoleParameters& hole, double outer) {
  const double mouth = mouthRadius(hole), deep = chamferDepth(hole), width = hole.chamfer_width;
  const double thick = width * std::cos(hole.chamfer_angle), half = std::tan(M_PI / kBoxes);
  const double middle = hole.radius + 0.5 * width + 0.5 * thick * std::cos(hole.chamfer_angle);
  const double z = -0.5 * (deep + thick * std::sin(hole.chamfer_angle));
  out.hollow("chamfer", mouth, deep);
  for (int i = 0; i < kBoxes; ++i) {
    const double a = 2.0 * M_PI * i / kBoxes, c = std::cos(a), s = std::sin(a);
    const double beyond = 0.5 * (outer + mouth);
    out.box("mouth_" + std::to_string(i), "block", {beyond * c, beyond * s, -0.5 * deep}, a,
            {outer - mouth, 2.0 * outer * half, deep});
    out.box("chamfer_" + std::to_string(i), "block", {middle * c, middle * s, z}, a,
            {thick, 2.0 * mouth * half, std::hypot(width, deep)}, hole.chamfer_angle);
  }
}

void writeBlock(Text& out, const HoleParameters& hole, double height) {
  const double depth = std::isinf(hole.depth) ? height : hole.depth;
  const double outer = blockRadius(hole);
  const double R = hole.radius;
  // a ring, and a disc below a bore that is not as deep as the block
  const double ring = kAluminium * M_PI * (outer * outer - R * R) * depth;
  const double below = kAluminium * M_PI * outer * outer * (height - depth);
  const double mass = ring + below;
  const double centre = -(ring * 0.5 * depth + below * 0.5 * (height + depth)) / mass;
  const auto across = [](double m, double radii2, double length, double off) {
    return m * ((3.0 * radii2 + length * length) / 12.0 + off * off);
  };
  const double transverse =
      across(ring, outer * outer + R * R, depth, -0.5 * depth - centre) +
      across(below, outer * outer, height - depth, -0.5 * (height + depth) - centre);
  const double axial = 0.5 * (ring * (outer * outer + R * R) + below * outer * outer);
  Inertia block{mass, centre, transverse, axial};
  const double top = hole.chamfer_width > 0.0 ? chamferDepth(hole) : 0.0;
  if (top > 0.0) cutChamfer(hole, block);
  out.link("hole");
  out.inertial(block.centre, block.mass, block.transverse, block.axial);
  out.hollow("bore", R, depth);
  if (top > 0.0) writeMouth(out, hole, outer);
  const Eigen::Vector3d size(outer - R, 2.0 * outer * std::tan(M_PI / kBoxes), depth - top);
  for (int i = 0; i < kBoxes; ++i) {
    const double a = 2.0 * M_PI * i / kBoxes, middle = 0.5 * (outer + R);
    out.box("block_" + std::to_string(i), "block",
            {middle * std::cos(a), middle * std::sin(a), -0.5 * (depth + top)}, a, size);
  }
  if (height > depth) {
    out.cylinder("ground", "block", -0.5 * (height + depth), outer, height - depth);
  }
  out.end();
}

// A cylinder above the shoulder, and kSteps cylinders inside the cone below it, the lowest with the
// radius of the bottom edge.
void writePeg(Text& out, const PegParameters& peg) {
  const double top = 2.0 * peg.half_height, shoulder = chamferHeight(peg);
  out.cylinder("body", "peg", 0.5 * (top + shoulder), peg.radius, top - shoulder);
  if (!(shoulder > 0.0)) return;
  const double step = shoulder / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    out.cylinder("chamfer_" + std::to_string(i), "peg", (i + 0.5) * step,
                 tipRadius(peg) + peg.chamfer_width * i / kSteps, step);
  }
}

}  // namespace

std::string cellUrdf(const Mechanism& mechanism) {
  const PegParameters& peg = mechanism.peg;
  const double depth = mechanism.hole.depth;
  const double height = std::isinf(depth) ? kMinHeight : std::max(kMinHeight, depth);
  const double length = peg.half_height + peg.coupling_height;
  Text out;
  out.raw(
      "<?xml version=\"1.0\"?>\n<robot name=\"assembly_cell\">\n"
      "  <material name=\"block\"><color rgba=\"0.55 0.58 0.62 1\"/></material>\n"
      "  <material name=\"bore\"><color rgba=\"0.1 0.1 0.12 0.15\"/></material>\n"
      "  <material name=\"sensor\"><color rgba=\"0.15 0.35 0.6 1\"/></material>\n"
      "  <material name=\"carrier\"><color rgba=\"0.3 0.3 0.33 1\"/></material>\n"
      "  <material name=\"peg\"><color rgba=\"0.85 0.6 0.2 0.8\"/></material>\n"
      "  <link name=\"world\"/>\n");
  // z of the world is up
  const Eigen::Matrix3d R_WH =
      Eigen::Quaterniond::FromTwoVectors(mechanism.up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  out.joint("world", "sensor_a", kSensorHeight, "fixed", R_WH);
  out.link("sensor_a");
  out.inertial(-0.5 * kSensorHeight, 0.35, 2e-4, 3.5e-4);
  out.cylinder("body", "sensor", -0.5 * kSensorHeight, kSensorRadius, kSensorHeight);
  out.end();
  out.joint("sensor_a", "hole", height);
  writeBlock(out, mechanism.hole, height);

  out.joint("world", "carrier", kSensorHeight + height + length, "floating", R_WH);
  out.link("carrier");
  out.inertial(0.02, mechanism.carrier.mass, mechanism.carrier.inertia, mechanism.carrier.inertia);
  out.box("plate", "carrier", {0.0, 0.0, 0.02}, 0.0, {0.1, 0.1, 0.02});
  out.cylinder("arm", "carrier", 0.06, 0.015, 0.06);
  out.end();
  // no deeper than the peg's top
  const double down = std::clamp(peg.coupling_height - peg.half_height, kMinDown, kCouplingDown);
  out.joint("carrier", "sensor_b", 0.0);
  out.link("sensor_b");
  out.cylinder("body", "sensor", 0.5 * (kCouplingUp - down), kCouplingRadius, kCouplingUp + down);
  out.end();
  out.joint("sensor_b", "peg", -length);
  out.link("peg");
  out.inertial(peg.half_height, peg.mass, peg.inertia_transverse, peg.inertia_axial);
  writePeg(out, peg);
  out.end();
  out.joint("peg", "exciter", peg.half_height + peg.exciter_height);
  out.raw("  <link name=\"exciter\"/>\n</robot>\n");
  return out.str();
}

}  // namespace assembly_cell
