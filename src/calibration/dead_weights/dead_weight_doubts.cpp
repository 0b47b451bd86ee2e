// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/base/text.h"
#include "dead_weight_labels.h"

namespace assembly_cell {

namespace {

using Eigen::Index;
using Eigen::Matrix3d;

constexpr double kLongestArm = 1.0;  // [m] on which a weight hangs; 0.15 in the recordings
constexpr double kShareLeft = 0.3;   // of an axis' load, rows left out; 0.01 in the recordings
constexpr double kLoaded = 0.05;     // of the largest axis: less load isn't evaluated
constexpr double kOtherLoad = 0.05;  // of the largest: loads that one reading can't have
// a block of the map that is a multiple of unity to this share, the multiple that of two units
constexpr double kUnity = 0.15, kSameUnit = 0.05;

const std::array<const char*, 6> kReadAxes = {"fx", "fy", "fz", "tx", "ty", "tz"};

struct Loads {
  Vector6 rms = Vector6::Zero();
  double force = 0.0, torque = 0.0;  // rms of a vector
};

Loads loadsOf(const std::vector<DeadWeight>& rows) {
  Loads out;
  double n = 0.0;
  for (const DeadWeight& row : rows) {
    if (!row.label) continue;
    out.rms += row.label->cwiseAbs2();
    ++n;
  }
  out.rms = (out.rms / n).cwiseSqrt();
  out.force = out.rms.head<3>().norm();
  out.torque = out.rms.tail<3>().norm();
  return out;
}

// Finds readings that are equal to the last digit under different loads, and axes that never
// change.
void frozen(const std::vector<DeadWeight>& rows, const Loads& loads,
            std::vector<std::string>& out) {
  for (Index k = 0; k < 6; ++k) {
    const bool constant = std::all_of(rows.begin(), rows.end(), [&](const DeadWeight& row) {
      return row.reading[k] == rows.front().reading[k];
    });
    if (!constant) continue;
    out.push_back(
        std::string(kReadAxes[static_cast<std::size_t>(k)]) +
        text(" reads %.6g in all rows: frozen, or not connected", rows.front().reading[k]));
  }
  std::string lines;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = 0; j < rows.size(); ++j) {
      if (i == j || !rows[i].label || !rows[j].label || rows[i].reading != rows[j].reading) {
        continue;
      }
      const Vector6 other = *rows[i].label - *rows[j].label;
      if (other.head<3>().norm() < kOtherLoad * loads.force &&
          other.tail<3>().norm() < kOtherLoad * loads.torque) {
        continue;
      }
      lines += (lines.empty() ? "" : ", ") + std::to_string(rows[i].line);
      break;
    }
  }
  if (!lines.empty()) {
    out.push_back("lines " + lines +
                  ": the same reading to the last digit under different loads: frozen; take them "
                  "out");
  }
}

// Name of the unit in which one newton (or N m) is `ratio`; nullptr for no known one.
const char* unitOf(double ratio, bool force) {
  struct Unit {
    double ratio;
    const char *force, *torque;
  };
  static const std::array<Unit, 5> units = {{{1.0 / 9.80665, "kgf", "kgf m"},
                                             {1e3, "mN", "N mm"},
                                             {1e2, "cN", "N cm"},
                                             {1e3 / 9.80665, "gf", "gf m"},
                                             {1.0 / 4.4482216, "lbf", "lbf m"}}};
  for (const Unit& unit : units) {
    if (std::abs(ratio / unit.ratio - 1.0) < kSameUnit) return force ? unit.force : unit.torque;
  }
  return nullptr;
}

// Readings that are a wrench in another unit, or of the other sign.
void units(const DeadWeightSolution& s, std::vector<std::string>& out) {
  for (const bool force : {true, false}) {
    const Index at = force ? 0 : 3;
    const Matrix3d block = s.map.block<3, 3>(at, at);
    const double scale = block.trace() / 3.0;
    if (!((block - scale * Matrix3d::Identity()).norm() < kUnity * std::abs(scale))) continue;
    const char *what = force ? "forces" : "torques", *unit = force ? "N" : "N m";
    if (scale < 0.0) {
      out.push_back(std::string("the known ") + what +
                    " have the opposite sign of those read: the load on the sensor, not that by "
                    "it, is known_fx to known_tz");
    }
    // load = scale × reading
    if (const char* read = unitOf(1.0 / std::abs(scale), force)) {
      out.push_back(text("the %s read are %.4g times the known ones: read in %s? Give %s", what,
                         1.0 / std::abs(scale), read, unit));
    } else if (const char* known = unitOf(std::abs(scale), force)) {
      out.push_back(text("the known %s are %.4g times those read: known ones in %s? Give %s", what,
                         std::abs(scale), known, unit));
    }
  }
}

}  // namespace

std::vector<std::string> deadWeightDoubts(const std::vector<DeadWeight>& rows,
                                          const DeadWeightSolution& s) {
  std::vector<std::string> out;
  const Loads loads = loadsOf(rows);
  frozen(rows, loads, out);
  if (!out.empty()) return out;
  const double arm = loads.torque / loads.force;
  if (arm > kLongestArm) {
    out.push_back(
        text("the known torques are those of weights %.3g m from the sensor: in %s? Give "
             "N m",
             arm, arm > 10.0 ? "N mm" : "N cm"));
  }
  units(s, out);
  if (s.rank < 6) return out;
  for (Index k = 0; k < 6; ++k) {
    const double group = k < 3 ? loads.rms.head<3>().maxCoeff() : loads.rms.tail<3>().maxCoeff();
    if (loads.rms[k] < kLoaded * group || s.left_out_rms[k] < kShareLeft * loads.rms[k]) continue;
    out.push_back(
        text("%s of a row left out is predicted to %.3g only, where %.3g hung (rms): the "
             "readings don't follow the known loads",
             kReadAxes[static_cast<std::size_t>(k)], s.left_out_rms[k], loads.rms[k]));
  }
  return out;
}

}  // namespace assembly_cell
