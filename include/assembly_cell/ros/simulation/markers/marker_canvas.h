// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Core>
#include <map>
#include <string>

#include "assembly_cell/ros/simulation/markers/marker_colors.h"

namespace assembly_cell::ros_bridge {

using Marker = visualization_msgs::Marker;

/// Markers of one picture. Those of the picture before that are not drawn again are deleted.
class MarkerCanvas {
 public:
  /// Begins a picture. size: times the width of lines and arrows; lifetime: of a marker [s].
  void begin(double size, double lifetime);
  /// Begins without a picture before: deletes all markers, also those of an earlier run of the
  /// node.
  void clear();
  /// The picture's array, to be published.
  visualization_msgs::MarkerArray finish();

  /// Adds a marker with all that is common; its id is the next free one of its namespace.
  Marker& add(const std::string& ns, int type, const std::string& frame, const Color& color);
  void addArrow(const std::string& ns, const std::string& frame, const Eigen::Vector3d& from,
                const Eigen::Vector3d& to, const Color& color);
  void addCircle(const std::string& ns, const std::string& frame, double radius, const Color& color,
                 double height = 0.0);
  /// A line strip without points.
  Marker& addLine(const std::string& ns, const std::string& frame, const Color& color);
  void addPoint(const std::string& ns, const std::string& frame, const Eigen::Vector3d& at,
                const Color& color);
  void addText(const std::string& ns, const std::string& frame, const Eigen::Vector3d& at,
               double height, const std::string& words, const Color& color);
  Marker& last() { return array_.markers.back(); }

 private:
  double size_ = 1.0, lifetime_ = 0.0;
  visualization_msgs::MarkerArray array_;
  std::map<std::string, int> drawn_, drawn_before_;  // markers by namespace
};

}  // namespace assembly_cell::ros_bridge
