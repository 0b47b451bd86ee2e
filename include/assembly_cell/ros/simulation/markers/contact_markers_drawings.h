// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include "assembly_cell/ros/simulation/markers/marker_canvas.h"
#include "assembly_cell/ros/simulation/markers/marker_settings.h"

namespace assembly_cell::ros_bridge {

/// Hole and peg, contacts, locus, lines of action and uncertainty of the twin-force estimate, line
/// of action of a sensor's wrench.
void drawParts(MarkerCanvas& canvas, const MarkerSettings& settings, const PartShapes& shapes,
               const MarkerInputs& view);

/// State and result in words, names and legend.
void drawWords(MarkerCanvas& canvas, const MarkerSettings& settings, const PartShapes& shapes,
               const MarkerInputs& view);

}  // namespace assembly_cell::ros_bridge
