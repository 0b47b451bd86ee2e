// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Height of a tool's tip along the sensor's z, from windows in which one point touches.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "assembly_cell/recording/contacts.h"

namespace assembly_cell {

constexpr double kLeverForce = 3.0;  ///< least force of a window [N]

/// One window's contact.
struct LeverWindow {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< in sensor axes [m]
  double sd = 0.0;                                  ///< of its z
  double depth = 0.0;                               ///< of the tool, see depths()
};

/// The point that samples first to end touch; none: not one point.
std::optional<LeverWindow> leverWindow(const ContactAnalysis& a, std::size_t first,
                                       std::size_t end);

/// Position of each sample along the mean direction of the tool's z [m].
std::vector<double> depths(const WrenchRecording& r);

/// Depth at which the tip first presses on a face across z; none: it doesn't.
std::optional<double> firstSurface(const ContactAnalysis& a, const std::vector<double>& depth);

struct Lever {
  double value = 0.0, sd = 0.0;  ///< [m]
};

/// Two hypotheses: all windows touch with the tip, or those below a face touch its edge with the
/// tool's side, as far above the tip as the tip is below the edge. The second counts where it
/// predicts windows left out clearly better, or makes the first one's lever unlikely.
Lever leverOf(const std::vector<LeverWindow>& windows, const std::optional<double>& surface);

}  // namespace assembly_cell
