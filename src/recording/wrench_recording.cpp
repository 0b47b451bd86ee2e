// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <filesystem>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/calibration/payload/payload_files.h"
#include "assembly_cell/recording/contacts.h"

namespace assembly_cell {

WrenchRecording readWrenchRecording(const std::string& path) {
  const std::vector<std::string> names = {"t", "fx", "fy", "fz", "tx", "ty", "tz",
                                          "x", "y",  "z",  "qx", "qy", "qz", "qw"};
  const bool bag = std::filesystem::path(path).extension() == ".bag";
  const Table table =
      bag ? tableFromText(textFromBag("wrench", path), path, names) : readTable(path, names);
  const std::size_t time = table.need({"t", "time"});
  table.checkRising(time);
  const auto wrench =
      table.needAll({{"fx"}, {"fy"}, {"fz"}, {"tx", "mx"}, {"ty", "my"}, {"tz", "mz"}});
  const auto place = table.needAll({{"x"}, {"y"}, {"z"}});
  const std::vector<Eigen::Matrix3d> R = readRotations(table);
  WrenchRecording out;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    Vector6 w;
    for (std::size_t k = 0; k < 6; ++k) w[static_cast<Eigen::Index>(k)] = row[wrench[k]];
    out.t.push_back(row[time]);
    out.wrench.push_back(w);
    out.pose.push_back({R[i], {row[place[0]], row[place[1]], row[place[2]]}});
  }
  const double unit = timeUnit(out.t);
  for (double& t : out.t) t *= unit;
  return out;
}

}  // namespace assembly_cell
