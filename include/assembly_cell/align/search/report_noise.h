// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Scatter of the pose that a carrier at rest reports from block to block.
struct ReportNoise {
  double position = 0.0;  ///< sd of an axis [m]
  double rotation = 0.0;  ///< [rad]
};

/// Measures the report noise on blocks with the rest pose at rest, from the axes without a spring
/// to swing in: height and tilts. Less than a micrometre and a microradian counts as zero: a
/// swinging peg leaves as much.
class ReportNoiseMeter {
 public:
  void add(const RestPose& at);
  /// The next pose does not follow the last one at rest.
  void interrupt() { last_.reset(); }
  ReportNoise noise() const;

 private:
  std::optional<RestPose> last_;
  double height2_ = 0.0, tilt2_ = 0.0;  // sums of squared differences
  int pairs_ = 0;
};

/// Whether the carrier is at its target. x, y and yaw yield; where the base isn't parallel to the
/// yielding axes, the others yield a little as well: 2e-4 m and 4e-4 rad under 40 N, times a tilt
/// of 0.05 rad. There, arrived means near and without motion since the block before: commands given
/// in the last block of a move, within 20 µm, ended alignments of twin_force with force_limit. A
/// noisy pose counts as arrived within four standard deviations; then blocksToEnd() more blocks are
/// to be waited for, as it does not show the end of the move.
bool arrived(const RestPose& before, const RestPose& at, const RestPose& target,
             const ReportNoise& noise);
/// Blocks from arrived() to the end of the move: 0 without report noise.
int blocksToEnd(const ReportNoise& noise);

}  // namespace assembly_cell
