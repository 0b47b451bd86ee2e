// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <random>

#include "assembly_cell/arm/late_motion.h"
#include "assembly_cell/dynamics/simulator_backend.h"
#include "assembly_cell/mismatch/truth.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell {

/// The carrier's ground truth: its base in the hole, the axes and the noise of its encoders, the
/// true ends of its moves, and a drive that is late, lags and has backlash.
class TrueCarrier {
 public:
  /// X_HB: pose of the carrier's base in `hole`, see carrierBase(); the encoders' differs from
  /// it where they are not exact.
  TrueCarrier(const Pose& X_HB, const Scenario& scenario, const CarrierTruth& truth);

  /// Base in `hole` that the encoders' poses refer to.
  const Pose& base() const { return X_HB_; }
  /// Moves the rest pose to `pose` as the encoders have it, in the base, no faster than
  /// `max_speed` [m/s].
  void command(SimulatorBackend& world, const Pose& pose, double max_speed);
  /// Before a block that ends at `end` [s]: moves the rest pose as a drive that is not exact.
  void lead(SimulatorBackend& world, double end);
  /// Stops the rest pose at once; commands that have not taken effect are dropped.
  void stop(SimulatorBackend& world);
  /// After a block: draws the carrier's error of repeatability again once a long enough move has
  /// come to rest.
  void settle(SimulatorBackend& world);
  /// What the encoders report now; every call draws its noise.
  Pose report(const SimulatorBackend& world);
  /// The reported pose without noise.
  Pose encoders(const SimulatorBackend& world) const;

 private:
  struct Command {
    RestPose target;
    double max_speed = 0.0;  // [m/s]
  };
  Pose scaled(const Pose& pose, bool reported) const;
  bool isStill(const SimulatorBackend& world) const;
  Vector6 carriedRest(const SimulatorBackend& world) const;
  void drive(const SimulatorBackend& world, double from, double to);

  CarrierTruth truth_;
  bool scales_ = false, noisy_ = false, repeats_ = false, late_ = false;
  Pose X_HB_;
  Pose last_draw_;                 // encoders' pose at the last draw
  double way_ = 0.0, turn_ = 0.0;  // farthest from there since [m], [rad]
  NormalSource reading_, repeatability_;
  // the drive, where it is late
  CommandQueue<Command> queue_;
  std::mt19937_64 jitter_;
  RestProfile commanded_;  // of the commands that have taken effect
  RestMotion driven_;      // what the encoders measure
  Backlash backlash_;
  bool stopping_ = false, moved_ = false;
};

}  // namespace assembly_cell
