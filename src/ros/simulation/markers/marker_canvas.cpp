// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/markers/marker_canvas.h"

#include <cmath>
#include <utility>

#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kCirclePoints = 64;
constexpr double kLineWidth = 0.0008;   // [m]
constexpr double kPointSize = 0.004;    // [m]
constexpr double kArrowShaft = 0.0012;  // diameter [m]
constexpr double kArrowHead = 0.003;    // diameter [m]

}  // namespace

void MarkerCanvas::begin(double size, double lifetime) {
  size_ = size;
  lifetime_ = lifetime;
  drawn_before_.swap(drawn_);
  drawn_.clear();
}

void MarkerCanvas::clear() {
  Marker all;
  all.action = Marker::DELETEALL;
  all.pose.orientation.w = 1.0;
  array_.markers.push_back(all);
  drawn_.clear();
}

visualization_msgs::MarkerArray MarkerCanvas::finish() {
  for (const auto& [ns, count] : drawn_before_) {
    for (int id = drawn_[ns]; id < count; ++id) {
      Marker gone;
      gone.ns = ns;
      gone.id = id;
      gone.action = Marker::DELETE;
      gone.pose.orientation.w = 1.0;
      array_.markers.push_back(gone);
    }
  }
  return std::exchange(array_, {});
}

Marker& MarkerCanvas::add(const std::string& ns, int type, const std::string& frame,
                          const Color& color) {
  Marker marker;
  marker.header.frame_id = frame;  // no stamp: with the latest transform
  marker.ns = ns;
  marker.id = drawn_[ns]++;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.color = color;
  marker.lifetime = ros::Duration(lifetime_);
  array_.markers.push_back(marker);
  return array_.markers.back();
}

void MarkerCanvas::addArrow(const std::string& ns, const std::string& frame,
                            const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                            const Color& color) {
  Marker& arrow = add(ns, Marker::ARROW, frame, color);
  arrow.scale.x = size_ * kArrowShaft;
  arrow.scale.y = size_ * kArrowHead;
  arrow.points = {toPoint(from), toPoint(to)};
}

Marker& MarkerCanvas::addLine(const std::string& ns, const std::string& frame, const Color& color) {
  Marker& line = add(ns, Marker::LINE_STRIP, frame, color);
  line.scale.x = size_ * kLineWidth;
  return line;
}

void MarkerCanvas::addPoint(const std::string& ns, const std::string& frame,
                            const Eigen::Vector3d& at, const Color& color) {
  Marker& point = add(ns, Marker::SPHERE, frame, color);
  point.pose.position = toPoint(at);
  point.scale.x = point.scale.y = point.scale.z = size_ * kPointSize;
}

void MarkerCanvas::addCircle(const std::string& ns, const std::string& frame, double radius,
                             const Color& color, double height) {
  Marker& circle = addLine(ns, frame, color);
  for (int i = 0; i <= kCirclePoints; ++i) {
    const double a = 2.0 * M_PI * i / kCirclePoints;
    circle.points.push_back(toPoint({radius * std::cos(a), radius * std::sin(a), height}));
  }
}

void MarkerCanvas::addText(const std::string& ns, const std::string& frame,
                           const Eigen::Vector3d& at, double height, const std::string& words,
                           const Color& color) {
  Marker& marker = add(ns, Marker::TEXT_VIEW_FACING, frame, color);
  marker.pose.position = toPoint(at);
  marker.scale.z = height;
  marker.text = words;
}

}  // namespace assembly_cell::ros_bridge
