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

/// Measures this noise in blocks in which the carrier is at rest, from the axes that don't yield to
/// a swinging peg: height and tilts. Below a micrometre and a microradian it counts as zero, since
/// the swing causes as much.
class ReportNoiseMeter {
 public:
  void add(const RestPose& at);
  /// The next pose isn't compared with the last one.
  void interrupt() { last_.reset(); }
  ReportNoise noise() const;

 private:
  std::optional<RestPose> last_;
  double height2_ = 0.0, tilt2_ = 0.0;  // sums of squared differences
  int pairs_ = 0;
};

/// Whether the carrier is at its target. Its x, y and yaw are compliant. Where the base isn't
/// parallel to these axes, the others yield a little as well: 2e-4 m and 4e-4 rad under 40 N, times
/// a tilt of 0.05 rad. In these axes it has arrived when it is near and hasn't moved since the
/// block before: a command given within the last 20 µm of a move made alignments of `twin_force`
/// end with `force_limit`. A noisy pose counts as arrived within four standard deviations. It
/// doesn't show the end of the move, so blocksToEnd() more blocks have to be waited for.
bool arrived(const RestPose& before, const RestPose& at, const RestPose& target,
             const ReportNoise& noise);
/// Blocks from arrived() to the end of the move, 0 without noise.
int blocksToEnd(const ReportNoise& noise);

}  // namespace assembly_cell
