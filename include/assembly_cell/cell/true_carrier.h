// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/dynamics/simulator_backend.h"
#include "assembly_cell/mismatch/truth.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

/// The carrier's ground truth: its base in the hole, the axes and the noise of its encoders, and
/// the true ends of its moves.
class TrueCarrier {
 public:
  /// X_HB: pose of the carrier's base in `hole`, see carrierBase(); the encoders' differs from
  /// it where they are not exact.
  TrueCarrier(const Pose& X_HB, const Scenario& scenario, const CarrierTruth& truth);

  /// Base in `hole` that the encoders' poses refer to.
  const Pose& base() const { return X_HB_; }
  /// Moves the rest pose to `pose` as the encoders have it, in the base, no faster than
  /// `max_speed` [m/s].
  void command(SimulatorBackend& world, const Pose& pose, double max_speed) const;
  /// After a block: draws the carrier's error of repeatability again once a long enough move has
  /// come to rest.
  void settle(SimulatorBackend& world);
  /// What the encoders report now; every call draws its noise.
  Pose report(const SimulatorBackend& world);
  /// The same without noise.
  Pose encoders(const SimulatorBackend& world) const;

 private:
  Pose scaled(const Pose& pose, bool reported) const;

  CarrierTruth truth_;
  bool scales_ = false, noisy_ = false, repeats_ = false;
  Pose X_HB_;
  Pose last_draw_;                 // encoders' pose at the last draw
  double way_ = 0.0, turn_ = 0.0;  // farthest from there since [m], [rad]
  NormalSource reading_, repeatability_;
};

}  // namespace assembly_cell
