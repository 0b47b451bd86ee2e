// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Collision shape of a part. Cylinder: size x and y are the diameter, axis along z of the shape.
struct PartShape {
  enum class Kind { kBox, kCylinder };
  Kind kind = Kind::kBox;
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  ///< full extents along x, y, z [m]
  Pose X_PS;                                       ///< pose of the shape in the part's base frame
};

/// A link of the URDF with its collision shapes.
struct Part {
  std::string link;
  std::vector<PartShape> shapes;
};

/// Geometry, masses and inertias of the cell, from its URDF.
struct CellDescription {
  PegParameters peg;
  HoleParameters hole;                                          ///< depth: length of the bore
  double carrier_mass = 0.0;                                    ///< [kg]
  double carrier_inertia = 0.0;                                 ///< yaw [kg m²]
  double hole_block_mass = 0.0;                                 ///< carried by sensor_a [kg]
  Eigen::Vector3d hole_block_centre = Eigen::Vector3d::Zero();  ///< centre of mass, in `hole` [m]
  Pose X_WA;                                                    ///< sensor_a in world
  Pose X_AH;                                                    ///< hole in sensor_a
  Pose X_BP;                       ///< peg in sensor_b at rest (sensor_b = carrier frame)
  std::vector<Part> fixed_parts;   ///< sensor_a, hole; shapes in `hole`
  std::vector<Part> moving_parts;  ///< carrier, sensor_b, peg at rest; shapes in `carrier`
};

/// Reads the text of urdf/cell.urdf. Throws InputError naming the link or joint, its element, the
/// value and the remedy: not URDF, missing part, shape, mass or inertia, values that contradict
/// each other. `source` names the text in messages.
CellDescription loadCellDescription(const std::string& urdf,
                                    const std::string& source = "robot_description");

/// Throws InputError naming both values where scenario and description differ by more than 1e-9
/// (relative). A scenario without hole.depth leaves the depth open.
void checkAgainst(const CellDescription& description, const Mechanism& mechanism,
                  const std::string& scenario);

}  // namespace assembly_cell
