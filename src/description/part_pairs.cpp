// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/description/part_pairs.h"

#include <fcl/narrowphase/collision.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

fcl::CollisionObjectd collisionObject(const PartShape& shape) {
  std::shared_ptr<fcl::CollisionGeometryd> geometry;
  if (shape.kind == PartShape::Kind::kBox) {
    geometry = std::make_shared<fcl::Boxd>(shape.size.x(), shape.size.y(), shape.size.z());
  } else {
    geometry = std::make_shared<fcl::Cylinderd>(0.5 * shape.size.x(), shape.size.z());
  }
  return fcl::CollisionObjectd(geometry, shape.X_PS.R, shape.X_PS.p);
}

// Bounding box in axes of `hole` of all positions of a shape of the carrier.
PartShape sweptBox(const PartShape& shape, const Eigen::Vector3d& peg_in_carrier,
                   const CarrierTravel& travel) {
  fcl::CollisionObjectd object = collisionObject(shape);
  object.computeAABB();
  const fcl::AABBd& box = object.getAABB();

  // a rotation by angle moves no point by more than angle times its distance from the origin
  const double farthest = box.min_.cwiseAbs().cwiseMax(box.max_.cwiseAbs()).norm();
  const Eigen::Vector3d swing = Eigen::Vector3d::Constant(farthest * travel.rotation);
  const Eigen::Vector3d lower(-travel.lateral, -travel.lateral, travel.lowest);
  const Eigen::Vector3d upper(travel.lateral, travel.lateral, travel.highest);
  const Eigen::Vector3d from = box.min_ - swing + lower - peg_in_carrier;
  const Eigen::Vector3d to = box.max_ + swing + upper - peg_in_carrier;
  return {PartShape::Kind::kBox, to - from, {Eigen::Matrix3d::Identity(), 0.5 * (from + to)}};
}

bool canMeet(const Part& moving, const Part& fixed, const Eigen::Vector3d& peg_in_carrier,
             const CarrierTravel& travel) {
  for (const PartShape& shape : moving.shapes) {
    const PartShape swept = sweptBox(shape, peg_in_carrier, travel);
    const auto meets = [&](const PartShape& other) { return shapesMeet(swept, other); };
    if (std::any_of(fixed.shapes.begin(), fixed.shapes.end(), meets)) return true;
  }
  return false;
}

}  // namespace

bool shapesMeet(const PartShape& a, const PartShape& b) {
  const fcl::CollisionObjectd object_a = collisionObject(a);
  const fcl::CollisionObjectd object_b = collisionObject(b);
  fcl::CollisionResultd result;
  fcl::collide(&object_a, &object_b, fcl::CollisionRequestd(), result);
  return result.isCollision();
}

std::vector<PartPair> canMeet(const CellDescription& description, const CarrierTravel& travel) {
  const bool finite = std::isfinite(travel.lateral) && std::isfinite(travel.lowest) &&
                      std::isfinite(travel.highest) && std::isfinite(travel.rotation);
  if (!finite || travel.lateral < 0.0 || travel.highest < travel.lowest || travel.rotation < 0.0) {
    std::ostringstream line;
    line << "carrier travel: value lateral " << travel.lateral << ", z " << travel.lowest << " to "
         << travel.highest << ", rotation " << travel.rotation
         << ": give finite limits, lowest <= highest, the others >= 0";
    throw InputError(line.str());
  }
  std::vector<PartPair> pairs;
  for (const Part& moving : description.moving_parts) {
    for (const Part& fixed : description.fixed_parts) {
      if (canMeet(moving, fixed, description.X_BP.p, travel)) {
        pairs.emplace_back(moving.link, fixed.link);
      }
    }
  }
  return pairs;
}

}  // namespace assembly_cell
