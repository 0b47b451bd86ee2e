// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <limits>
#include <vector>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/align/plant.h"

namespace assembly_cell {

/// Acceptance limits of a window as a zero or a contact.
struct AveragingLimits {
  int blocks = 2;              ///< of a window
  double settled_force = 0.0;  ///< halves that differ by more are not settled [N]
  /// Motion of the carrier within a window, beyond the scatter of its encoders [m].
  double carrier_motion = std::numeric_limits<double>::infinity();
  int tries = 1;  ///< windows at most
};

/// Averages block after block at rest, until a window of them is settled. One block alone has no
/// halves: it counts as settled.
class AveragingWindow {
 public:
  enum class State { kFilling, kSettled, kNotSettled, kMoved, kSaturated };

  explicit AveragingWindow(const AveragingLimits& limits) : limits_(limits) {}

  /// The next block; anything but kFilling is final. A window that isn't settled is replaced by
  /// the next one until all tries are used up; saturation ends it at once, motion that no scatter
  /// of encoders explains when it is full.
  State add(const PlantBlock& block);

  const ContactWindow& means() const { return means_; }
  int blocks() const { return static_cast<int>(means_.blocks()); }
  const PlantBlock& last() const { return last_; }  ///< its rounding counts
  /// Mean of the carrier's encoders, and the variance of that mean: of a position by the
  /// height, of a rotation by the tilts, which have no spring to swing in [m²], [rad²].
  RestPose carrier() const;
  double positionVariance() const;
  double rotationVariance() const;
  double firstEnd() const { return first_end_; }  ///< of the window's first block [s]
  double lastEnd() const { return last_.time; }   ///< of its last block [s]
  double motion() const { return motion_; }       ///< of the carrier by its encoders [m]

 private:
  bool hasMoved();

  AveragingLimits limits_;
  ContactWindow means_;
  PlantBlock last_;
  double first_end_ = 0.0, motion_ = 0.0;
  // of the carrier less the window's first: x, y, z, yaw, theta, phi of each block where motion is
  // limited, and sums of them and of their squares
  RestPose origin_;
  std::vector<Vector6> displacements_;
  Vector6 sum_ = Vector6::Zero(), squares_ = Vector6::Zero();
  int tried_ = 0;
};

}  // namespace assembly_cell
