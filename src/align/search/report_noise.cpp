// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/report_noise.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

constexpr double kAtTarget = 1e-7;    // of height [m] and tilt [rad], as commanded
constexpr double kNearTarget = 2e-5;  // of the same where they yield a little
constexpr double kAtRest = 2e-6;      // their change in a block once the move has ended
constexpr double kAside = 5e-4;       // of x and y, which yield [m]

constexpr double kMinNoise = 1e-6;  // of the reported pose that counts as such [m], [rad]
// One pose in 5000 is farther off; it costs one block more.
constexpr double kNoiseReach = 4.0;
// A quintic at the carrier's default limits is 60 um from its end at most 32 ms before it: two
// blocks. Three: an alignment at mismatch level 2 takes 0.5 s longer.
constexpr int kBlocksToEnd = 2;

// Largest difference of height and tilts, less what `reach` deviations of the noise explain.
double distance(const RestPose& a, const RestPose& b, const ReportNoise& noise, double reach) {
  const double height = std::abs(a.z - b.z) - reach * noise.position;
  const double tilt = std::max(std::abs(a.theta - b.theta), std::abs(a.phi - b.phi));
  return std::max(height, tilt - reach * noise.rotation);
}

}  // namespace

void ReportNoiseMeter::add(const RestPose& at) {
  if (last_) {
    height2_ += std::pow(at.z - last_->z, 2);
    tilt2_ += 0.5 * (std::pow(at.theta - last_->theta, 2) + std::pow(at.phi - last_->phi, 2));
    ++pairs_;
  }
  last_ = at;
}

ReportNoise ReportNoiseMeter::noise() const {
  if (pairs_ == 0) return {};
  // a difference has twice the variance
  const ReportNoise measured{std::sqrt(0.5 * height2_ / pairs_), std::sqrt(0.5 * tilt2_ / pairs_)};
  return {measured.position < kMinNoise ? 0.0 : measured.position,
          measured.rotation < kMinNoise ? 0.0 : measured.rotation};
}

bool arrived(const RestPose& before, const RestPose& at, const RestPose& target,
             const ReportNoise& noise) {
  if (std::hypot(at.x - target.x, at.y - target.y) >= kAside) return false;
  const double off = distance(at, target, noise, kNoiseReach);
  return off < kAtTarget ||
         (off < kNearTarget && distance(at, before, noise, std::sqrt(2.0) * kNoiseReach) < kAtRest);
}

int blocksToEnd(const ReportNoise& noise) {
  return noise.position > 0.0 || noise.rotation > 0.0 ? kBlocksToEnd : 0;
}

}  // namespace assembly_cell
