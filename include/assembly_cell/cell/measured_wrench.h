// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cmath>
#include <vector>

#include "assembly_cell/mismatch/truth.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

/// Wrench measured by a sensor with errors, sample after sample: delayed, in a rotated and offset
/// frame, with gain errors, drifting zeros and hum. Noise and conversion come after it. An exact
/// sensor returns the wrench unchanged.
class MeasuredWrench {
 public:
  /// period: of the samples [s].
  MeasuredWrench(const SensorTruth& truth, double period);

  /// The next sample, at `time` [s]; w in the frame that the files name. No allocation.
  Vector6 operator()(const Vector6& w, double time);

  /// The value depends on earlier samples: none may be left out.
  bool remembers() const { return truth_.latency > 0.0 || truth_.walk > 0.0; }
  /// Angular frequency of the hum, 0 without one [rad/s].
  double humRate() const { return truth_.hum.isZero(0.0) ? 0.0 : 2 * M_PI * truth_.hum_frequency; }

 private:
  Vector6 late(const Vector6& w);

  SensorTruth truth_;
  double period_;
  bool exact_ = true;
  Matrix6 map_;  // of frame and matrix
  Vector6 walk_ = Vector6::Zero();
  NormalSource normal_;
  std::vector<Vector6> past_;          // a ring, empty without latency; filled by the first sample
  std::size_t newest_ = 0, back_ = 0;  // back_: samples from the newest to the first node
  double weights_[4] = {0.0, 0.0, 0.0, 0.0};
  bool filled_ = false;
};

}  // namespace assembly_cell
