// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/cell_place.h"

#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {
namespace {

constexpr double kMaxDistance = 10.0;  // of any position [m]

Pose readPose(yaml::Section in) {
  Pose X;
  X.p = in.vector("position");
  const Eigen::Vector3d rotation = in.vector("rotation");
  if (!(X.p.cwiseAbs().maxCoeff() <= kMaxDistance)) {
    in.refuse(in.at("position"), X.p.norm(), "give at most 10 m along each axis");
  }
  if (!(rotation.norm() <= 2.0 * M_PI)) {
    in.refuse(in.at("rotation"), rotation.norm(), "give a rotation vector of at most 2 pi rad");
  }
  X.R = rotationFromVector({rotation});
  in.finish();
  return X;
}

}  // namespace

CellPlace loadCellPlace(const std::string& path) {
  yaml::Section in(
      yaml::loadYaml(yaml::fileText(path, "place of the cell"), path, yaml::FileKind::kPlace), "",
      path);
  in.integer("format", 1, 1);
  CellPlace place;
  place.flange = in.text("flange", "give the link of the arm that carries the carrier");
  place.X_flange_carrier = readPose(in.section("carrier_in_flange"));
  place.X_base_hole = readPose(in.section("hole_in_base"));
  place.carrier_height = in.number("carrier_height", 0.0, kMaxDistance);
  in.finish();
  return place;
}

}  // namespace assembly_cell
