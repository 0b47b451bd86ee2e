// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/step.h"

#include <cmath>
#include <utility>

namespace assembly_cell {
namespace {

constexpr double kRounding = 1e-6;  // of times [s]
constexpr double kNoise = 5.0;      // sd of a block's force that are no alarm

bool isBeyond(const ForceAlarm& alarm, const PlantBlock& block) {
  const Eigen::Vector3d force = block.wrench_b.head<3>() - alarm.reference;
  const Matrix6 of_mean = block.covariance_b / std::max(1, block.samples);
  const double noise = kNoise * std::sqrt(of_mean.topLeftCorner<3, 3>().trace());
  return force.norm() >= std::max(alarm.force, noise) ||
         force.head<2>().norm() >= std::max(alarm.sideways, noise);
}

// Mean and covariance of one sample about it, of both parts' samples.
void join(Vector6& mean, Matrix6& covariance, double count, const Vector6& other_mean,
          const Matrix6& other_covariance, double other_count) {
  const double all = count + other_count;
  const Vector6 difference = other_mean - mean;
  covariance = ((count - 1.0) * covariance + (other_count - 1.0) * other_covariance +
                count * other_count / all * difference * difference.transpose()) /
               (all - 1.0);
  mean += other_count / all * difference;
}

// Results that only one block of a step has.
void keepReadings(PlantBlock& block, const PlantBlock& before) {
  if (!block.locus) block.locus = before.locus;
  if (!block.vibration) block.vibration = before.vibration;
}

PlantBlock joined(PlantBlock step, const PlantBlock& block) {
  const double n = step.samples, m = block.samples;
  PlantBlock out = block;
  join(step.wrench_a, step.covariance_a, n, block.wrench_a, block.covariance_a, m);
  join(step.wrench_b, step.covariance_b, n, block.wrench_b, block.covariance_b, m);
  out.wrench_a = step.wrench_a;
  out.wrench_b = step.wrench_b;
  out.covariance_a = step.covariance_a;
  out.covariance_b = step.covariance_b;
  out.displacement_b =
      step.displacement_b + m / (n + m) * (block.displacement_b - step.displacement_b);
  out.samples = step.samples + block.samples;
  out.saturated = step.saturated || block.saturated;
  // from the first one's start, whatever got lost between them
  out.length = block.time - step.time + step.length;
  keepReadings(out, step);
  return out;
}

}  // namespace

PlantBlock nextStep(const PlantCommand& command, const NextBlock& next) {
  PlantBlock step = next(command, true);
  const auto ends = [&](const PlantBlock& block) {
    return step.length >= kStepTime - kRounding || block.samples == 0 ||
           (command.alarm && isBeyond(*command.alarm, block));
  };
  if (ends(step)) return step;
  while (true) {
    PlantBlock block = next({}, false);
    if (command.alarm && isBeyond(*command.alarm, block)) {
      keepReadings(block, step);
      return block;
    }
    step = joined(std::move(step), block);
    if (ends(block)) return step;
  }
}

}  // namespace assembly_cell
