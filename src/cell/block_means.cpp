// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/block_means.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

// Rounding moves a mean by less than 3e-5 of a code where the noise is so much of it: codes times
// exp(−2 π² noise²) / π (Widrow). Half of it: 3 %.
constexpr double kNoiseOverCode = 0.7;
// A Wishart matrix of six channels has degrees of freedom down to this less 6.
constexpr int kMinSamples = 8;
// The largest of a hundred normal numbers, on average.
constexpr double kLargestNoise = 2.5;

}  // namespace

SampleSum::SampleSum(int samples, int most) : samples_(samples), spacing_(std::max(1, most)) {
  while (spacing_ > 1 && samples % (2 * spacing_) != 0) --spacing_;
  const double k = spacing_;
  end_ = (2.0 * k * k + 1.0) / (6.0 * k);
  middle_ = 2.0 * (k - end_);
}

double SampleSum::weight(int node) const {
  if (node == 0) return end_ - 0.5;
  if (node == nodes()) return end_ + 0.5;
  return node % 2 == 0 ? 2.0 * end_ : middle_;
}

bool BlockMeans::serves(const Bridge& bridge, int samples) {
  return samples >= kMinSamples && bridge.noise >= kNoiseOverCode * resolution(bridge);
}

void BlockMeans::add(const Bridge& bridge, const Vector6& volts, double weight) {
  Vector6 input = converterInput(bridge, volts);
  const double most = bridge.full_scale - resolution(bridge);
  saturated_ = saturated_ || !(input.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <
                               most - kLargestNoise * bridge.noise);
  // the end codes stand for everything beyond, and for what is no number
  for (double& channel : input) {
    if (!(channel < most)) channel = most;
    if (channel < -bridge.full_scale) channel = -bridge.full_scale;
  }
  if (!begun_) first_ = input;
  begun_ = true;
  const Vector6 off = input - first_;
  sum_ += weight * off;
  squares_.noalias() += off * (weight * off).transpose();
}

BlockMoments BlockMeans::end(const Bridge& bridge, int samples, NormalSource& normal) const {
  const double n = samples, noise = std::sqrt(sampleVariance(bridge));
  BlockMoments m;
  m.count = samples;
  m.mean = first_ + sum_ / n;
  for (double& channel : m.mean) channel += noise / std::sqrt(n) * normal();
  // Bartlett's decomposition of the scatter
  Matrix6 root = Matrix6::Zero();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) root(i, j) = normal();
    root(i, i) = std::sqrt(normal.sumOfSquares(samples - 1 - i));
  }
  const Matrix6 scatter = noise * noise * root * root.transpose();
  m.covariance = (scatter + squares_ - sum_ * sum_.transpose() / n) / (n - 1.0);
  return m;
}

}  // namespace assembly_cell
