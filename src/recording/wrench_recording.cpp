// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/calibration/payload/payload_files.h"
#include "assembly_cell/recording/contacts.h"

namespace assembly_cell {

namespace {

// No cell has its base farther away [m], and no arm moves a tool faster in half of a recording
// [m/s].
constexpr double kFarthest = 15.0, kFastest = 5.0;

bool isBag(const std::string& path) {
  const auto ends = [&](const std::string& end) {
    return path.size() >= end.size() &&
           path.compare(path.size() - end.size(), end.size(), end) == 0;
  };
  return ends(".bag") || ends(".bag.active");
}

void checkPositions(const WrenchRecording& r, const std::string& path) {
  double farthest = 0.0;
  std::vector<double> speeds;
  for (std::size_t i = 0; i < r.t.size(); ++i) {
    farthest = std::max(farthest, r.pose[i].p.norm());
    if (i == 0) continue;
    speeds.push_back((r.pose[i].p - r.pose[i - 1].p).norm() / (r.t[i] - r.t[i - 1]));
  }
  const double speed = speeds.empty() ? 0.0 : upperMedian(speeds);
  if (farthest <= kFarthest && speed <= kFastest) return;
  throw InputError(path + ": columns x, y, z: " +
                   (farthest > kFarthest ? text("%.4g from the origin", farthest)
                                         : text("%.4g a second in the median", speed)) +
                   " is too much in m: positions in mm or cm? give m, or name the unit, x [mm]");
}

}  // namespace

WrenchRecording readWrenchRecording(const std::string& path, const RecordingOptions& options) {
  const std::vector<std::string> names = {"t", "fx", "fy", "fz", "tx", "ty", "tz",
                                          "x", "y",  "z",  "qx", "qy", "qz", "qw"};
  WrenchRecording out;
  const bool bag = isBag(path);
  if (!bag && !(options.topic.empty() && options.pose_topic.empty())) {
    throw InputError(path + ": --topic, --pose-topic: are for bags only");
  }
  Table table = bag ? tableFromText(textFromBag("wrench", path, {options.topic, options.pose_topic},
                                                &out.notes),
                                    path, names)
                    : readTable(path, names);
  const TableTimes times = readTimes(table, bag ? TimeUnit::kSeconds : options.time_unit);
  const auto wrench = wrenchColumns(table);
  const auto place = table.needAll({{"x"}, {"y"}, {"z"}}, Quantity::kLength);
  const std::vector<Eigen::Matrix3d> R = readRotations(table);
  out.t = times.t;
  out.time_unit = bag ? "s, of a bag" : times.unit + ", " + times.reason;
  out.notes.insert(out.notes.end(), table.notes.begin(), table.notes.end());
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    Vector6 w;
    for (std::size_t k = 0; k < 6; ++k) w[static_cast<Eigen::Index>(k)] = row[wrench[k]];
    out.wrench.push_back(w);
    out.pose.push_back({R[i], {row[place[0]], row[place[1]], row[place[2]]}});
  }
  checkPositions(out, path);
  return out;
}

}  // namespace assembly_cell
