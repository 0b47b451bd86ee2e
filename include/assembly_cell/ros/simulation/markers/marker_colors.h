// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <std_msgs/ColorRGBA.h>

namespace assembly_cell::ros_bridge {

/// Colours of the markers. The screenshot test looks for their hues.
struct Color {
  float r, g, b, a;
  operator std_msgs::ColorRGBA() const {
    std_msgs::ColorRGBA color;
    color.r = r;
    color.g = g;
    color.b = b;
    color.a = a;
    return color;
  }
};

constexpr Color kContactPointColor{0.9F, 0.0F, 0.0F, 1.0F};     ///< red
constexpr Color kContactNormalColor{0.0F, 0.35F, 0.95F, 1.0F};  ///< blue
constexpr Color kContactForceColor{1.0F, 0.5F, 0.0F, 1.0F};     ///< orange
constexpr Color kLocusColor{0.9F, 0.0F, 0.8F, 1.0F};            ///< magenta
constexpr Color kHypothesisColor{0.5F, 0.2F, 0.9F, 1.0F};      ///< violet; alpha follows the weight
constexpr Color kEstimatedPegColor{0.0F, 0.65F, 0.8F, 0.7F};   ///< cyan, under others
constexpr Color kEstimatedHoleColor{0.75F, 0.5F, 0.0F, 1.0F};  ///< amber
constexpr Color kTruePegColor{0.0F, 0.6F, 0.1F, 1.0F};         ///< green
constexpr Color kActionAColor{0.9F, 0.2F, 0.2F, 0.6F};         ///< red, see-through
constexpr Color kActionBColor{0.2F, 0.4F, 0.9F, 0.6F};         ///< blue, see-through
constexpr Color kSeveralColor{0.6F, 0.6F, 0.6F, 0.6F};         ///< grey, see-through
constexpr Color kUncertaintyColor{0.0F, 0.65F, 0.8F, 0.3F};    ///< cyan, see-through
constexpr Color kHoleColor{0.1F, 0.1F, 0.1F, 1.0F};            ///< black
constexpr Color kTextColor{0.15F, 0.15F, 0.18F, 1.0F};         ///< nearly black
constexpr Color kSuccessColor{0.0F, 0.5F, 0.1F, 1.0F};         ///< dark green
constexpr Color kFailureColor{0.8F, 0.0F, 0.0F, 1.0F};         ///< dark red

}  // namespace assembly_cell::ros_bridge
