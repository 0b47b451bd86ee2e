// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Preselection of the boxes of the block for the engine, whose own broad phase tests bounding
// spheres, which all contain the peg.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace assembly_cell {

/// Axes are the columns of R.
struct Box {
  Eigen::Matrix3d R;
  Eigen::Vector3d center, half;
};

struct Cylinder {
  Eigen::Vector3d center, axis;
  double radius, half_height;
};

/// False only if a plane separates them: normal to the cylinder's axis, or parallel to a face of
/// the box for the part of the cylinder below the box's top.
inline bool mayTouch(const Box& box, const Cylinder& peg) {
  const Eigen::Vector3d between = peg.center - box.center;
  const Eigen::Vector3d along = box.R.transpose() * peg.axis;
  // across the axis
  const double s = -between.dot(peg.axis), reach = box.half.dot(along.cwiseAbs());
  if (std::abs(s) > peg.half_height + reach) return false;
  // part of the cylinder below the box's top
  double top = peg.half_height;
  const double rise = peg.axis.z();
  if (rise > 0.1) {
    const double height = box.center.z() + box.half.dot(box.R.row(2).transpose().cwiseAbs());
    const double lean = peg.radius * std::sqrt(std::max(0.0, 1.0 - rise * rise));
    top = std::min(top, (height - peg.center.z() + lean) / rise);
    if (top < -peg.half_height) return false;
  }
  const double middle = 0.5 * (top - peg.half_height), half = 0.5 * (top + peg.half_height);
  const Eigen::Vector3d from = box.R.transpose() * (between + middle * peg.axis);
  for (int i = 0; i < 3; ++i) {
    const double cosine = along(i);
    const double extent =
        half * std::abs(cosine) + peg.radius * std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
    if (std::abs(from(i)) > box.half(i) + extent) return false;
  }
  return true;
}

}  // namespace assembly_cell
