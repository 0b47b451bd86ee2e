// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <string>

#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/simulation/markers/contact_markers_drawings.h"

namespace assembly_cell::ros_bridge {

namespace {

// Words are beside the cell in the view of rviz/cell.rviz, whose direction is kYaw. Lengths are
// in radii of the hole, but of a small hole in kSmallest: that view is as far away for any peg.
constexpr double kYaw = 0.9;        // [rad]
constexpr double kSmallest = 0.02;  // [m]
constexpr double kStateBeside = 4.0, kLegendBeside = 4.4, kNamesBeside = 2.8;
constexpr double kLetters = 0.26, kLine = 1.5;  // height; from line to line, in letters
constexpr std::size_t kLongestLine = 20;        // of the state

struct Entry {
  const char* text;
  const Color* color;
};
constexpr Entry kLegend[] = {
    {"rim of the hole", &kHoleColor},
    {"true peg", &kTruePegColor},
    {"estimated peg", &kEstimatedPegColor},
    {"estimated hole", &kEstimatedHoleColor},
    {"contact", &kContactPointColor},
    {"its normal", &kContactNormalColor},
    {"its force", &kContactForceColor},
    {"locus", &kLocusColor},
    {"directions it allows", &kHypothesisColor},
};

// lines of at most kLongestLine characters, where there are blanks
std::string wrapped(const std::string& words) {
  std::string lines;
  std::size_t length = 0;
  std::istringstream in(words);
  for (std::string word; in >> word; length += word.size()) {
    if (!lines.empty()) {
      const bool full = length + 1 + word.size() > kLongestLine;
      lines += full ? '\n' : ' ';
      length = full ? 0 : length + 1;
    }
    lines += word;
  }
  return lines;
}

double unit(double radius) { return std::max(radius, kSmallest); }

// to the right of the view
Eigen::Vector3d right(double distance, double height) {
  return {-std::sin(kYaw) * distance, std::cos(kYaw) * distance, height};
}

void drawState(MarkerCanvas& canvas, const PartShapes& shapes, const MarkerInputs& view) {
  const double radius = shapes.hole_radius > 0.0 ? shapes.hole_radius : shapes.peg_radius;
  if (!(radius > 0.0)) return;
  const double r = unit(radius);
  const auto show = [&](const std::string& words, const Color& color) {
    canvas.addText("state", kHoleFrame, right(-kStateBeside * r, 4.0 * r), kLetters * r, words,
                   color);
  };
  if (!view.report) {
    if (!view.feedback.empty()) show(wrapped(view.feedback), kTextColor);
    return;
  }
  const AlignmentReport& report = *view.report;
  // a report is of the alignment, whatever came after it; the last feedback has the depth
  const bool seated = report.success && view.inserts;
  const bool deep = view.feedback.rfind("seated", 0) == 0;
  std::string words = wrapped(!seated ? report.reason : deep ? view.feedback : "seated");
  if (report.estimate_known && view.truth_at_report) {
    const Pose estimated = fromPose(report.estimated_pose, "report");
    const Pose truth = fromPose(view.truth_at_report->pose, "truth/pose");
    const double tilt = std::atan2(estimated.R.col(2).cross(truth.R.col(2)).norm(),
                                   estimated.R.col(2).dot(truth.R.col(2)));
    words += text("\noffset wrong by %.3f mm\ntilt wrong by %.3f deg",
                  1e3 * (estimated.p - truth.p).head<2>().norm(), 180.0 / M_PI * tilt);
  }
  show(words, report.success ? kSuccessColor : kFailureColor);
}

void drawNames(MarkerCanvas& canvas, const PartShapes& shapes) {
  const double r = unit(shapes.hole_radius);
  const auto name = [&](const char* words, const char* frame, double height) {
    canvas.addText("names", frame, right(kNamesBeside * r, height), kLetters * r, words,
                   kTextColor);
  };
  name("hole", kHoleFrame, 0.0);
  name("sensor_a", "sensor_a", 0.0);
  name("sensor_b", "sensor_b", 0.0);
  name("peg", kPegFrame, shapes.peg_radius);
}

void drawLegend(MarkerCanvas& canvas, const MarkerSettings& settings, const PartShapes& shapes) {
  const double r = unit(shapes.hole_radius);
  Eigen::Vector3d at = right(kLegendBeside * r, 4.5 * r);
  for (const Entry& entry : kLegend) {
    const bool locus = entry.color == &kLocusColor;
    canvas.addText("legend", kHoleFrame, at, kLetters * r,
                   locus ? text("%s, %g times", entry.text, settings.locus_scale) : entry.text,
                   *entry.color);
    at.z() -= kLine * kLetters * r;
  }
}

}  // namespace

void drawWords(MarkerCanvas& canvas, const MarkerSettings& settings, const PartShapes& shapes,
               const MarkerInputs& view) {
  drawState(canvas, shapes, view);
  if (!(shapes.hole_radius > 0.0)) return;
  drawNames(canvas, shapes);
  drawLegend(canvas, settings, shapes);
}

}  // namespace assembly_cell::ros_bridge
