// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Simulated recordings of static poses with a known payload.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <random>
#include <vector>

#include "assembly_cell/calibration/payload/payload.h"

namespace assembly_cell::test {

struct RecordingPlan {
  std::size_t poses = 50;
  double weight = 8.0;
  Eigen::Vector3d center{0.01, -0.02, 0.06};
  double force_noise = 0.03, torque_noise = 8e-4;  // sd of a component
  bool base_axes = true;
  std::function<Vector6(double)> bias = [](double) { return Vector6::Zero().eval(); };
  unsigned seed = 1;
};

/// Readings at order 0, 1, … and ground truth half-way between them.
struct SimulatedRecording {
  std::vector<StaticPose> poses, between;
  std::vector<Vector6> wrenches, truth_between;
};

inline SimulatedRecording simulate(const RecordingPlan& plan) {
  std::mt19937 random(plan.seed);
  std::normal_distribution<double> normal;
  SimulatedRecording out;
  for (std::size_t i = 0; i < 2 * plan.poses; ++i) {
    StaticPose pose;
    pose.R = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                 .normalized()
                 .toRotationMatrix();
    pose.order = 0.5 * static_cast<double>(i);
    const Eigen::Vector3d load = pose.R.transpose() * Eigen::Vector3d(0.0, 0.0, -plan.weight);
    Vector6 w;
    w << load, plan.center.cross(load);
    w += plan.bias(pose.order);
    for (int k = 0; k < 6; ++k) {
      const double noise = normal(random) * (k < 3 ? plan.force_noise : plan.torque_noise);
      if (i % 2 == 0) w[k] += noise;
    }
    if (plan.base_axes) {
      w.head<3>() = (pose.R * w.head<3>()).eval();
      w.tail<3>() = (pose.R * w.tail<3>()).eval();
    }
    (i % 2 == 0 ? out.poses : out.between).push_back(pose);
    (i % 2 == 0 ? out.wrenches : out.truth_between).push_back(w);
  }
  return out;
}

}  // namespace assembly_cell::test
