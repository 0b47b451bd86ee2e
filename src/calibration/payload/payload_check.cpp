// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/payload/payload_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "assembly_cell/base/text.h"

namespace assembly_cell {

namespace {

using Eigen::Vector3d;

constexpr double kOtherBetter = 4.0;     // times: below it may be noise, drift or a bad fit
constexpr double kForceMisfit = 0.1;     // of the weight; 0.4 % and 1.6 % in the real recordings
constexpr double kTorqueMisfit = 0.5;    // [m] torque over force; 0.03 and 0.04 m in them
constexpr double kTorqueShare = 0.05;    // of the payload's torque
constexpr double kRounding = 1e-4;       // [m] torque over weight
constexpr double kFrozenSpan = 5.0;      // sd of the other axes by which a frozen one should move
constexpr double kTurned = 0.04;         // [rad] of the vertical between two equal readings
constexpr double kLargestMass = 150.0;   // [kg] no arm with a sensor carries more
constexpr double kFarthestCenter = 1.0;  // [m] of any load
// farthest centre of a light one [m], and more for each kg: a rod of 0.25 m for 0 kg, 0.45 m for 1
constexpr double kLightCenter = 0.25, kCenterPerMass = 0.2;
constexpr double kLeastCounts = 50.0;  // whole numbers up to this may be coarse rounding

const std::array<const char*, 6> kAxisNames = {"fx", "fy", "fz", "tx", "ty", "tz"};

// "3, 5 to 9", counted from 1
std::string rowList(const std::vector<std::size_t>& rows) {
  std::string out;
  for (std::size_t i = 0; i < rows.size();) {
    std::size_t end = i;
    while (end + 1 < rows.size() && rows[end + 1] == rows[end] + 1) ++end;
    out += (out.empty() ? "" : ", ") + std::to_string(rows[i] + 1);
    if (end > i) out += (end > i + 1 ? " to " : ", ") + std::to_string(rows[end] + 1);
    i = end + 1;
  }
  return out;
}

// Finds wrenches that are equal to the last digit, though the vertical turned in the sensor.
std::vector<std::string> repeated(const std::vector<StaticPose>& poses,
                                  const std::vector<Vector6>& wrenches) {
  std::map<std::array<double, 6>, std::vector<std::size_t>> groups;
  for (std::size_t i = 0; i < wrenches.size(); ++i) {
    std::array<double, 6> key;
    std::copy_n(wrenches[i].data(), 6, key.begin());
    groups[key].push_back(i);
  }
  std::vector<std::string> out;
  for (const auto& group : groups) {
    const std::vector<std::size_t>& rows = group.second;
    double turned = 0.0;
    for (const std::size_t i : rows) {
      const Vector3d up = poses[i].R.row(2), first = poses[rows.front()].R.row(2);
      turned = std::max(turned, up.cross(first).norm());
    }
    if (turned < kTurned) continue;
    out.push_back("rows " + rowList(rows) +
                  " (from 1, without a header) have the same wrench to the last digit, though the "
                  "sensor turned between them: its readings were frozen; take these rows out");
  }
  return out;
}

std::string frozenText(const std::string& axes, const Vector6& value, std::size_t first,
                       std::size_t rows) {
  return axes +
         text(" is %.6g in all %zu rows: frozen, or not connected; ",
              value[static_cast<Eigen::Index>(first)], rows) +
         "check the sensor and what writes the file";
}

bool forceMisfit(const PayloadModel& m) {
  return std::sqrt(3.0) * m.held_out_rms.force > kForceMisfit * m.weight;
}

// more than a sensor's noise of torque beside that of force
bool torqueApart(const PayloadModel& m) {
  return m.held_out_rms.torque > kTorqueMisfit * m.held_out_rms.force &&
         m.held_out_rms.torque > kRounding * m.weight;
}

bool torqueMisfit(const PayloadModel& m) {
  return torqueApart(m) &&
         m.held_out_rms.torque > kTorqueShare * m.center_of_mass.norm() * m.weight;
}

// Axes that never move though the payload should move them.
std::vector<std::string> frozenAxes(const std::vector<StaticPose>& poses,
                                    const std::vector<Vector6>& wrenches,
                                    const PayloadModel& model) {
  std::vector<std::string> out;
  std::array<bool, 6> constant;
  for (std::size_t k = 0; k < 6; ++k) {
    const auto axis = static_cast<Eigen::Index>(k);
    constant[k] = std::all_of(wrenches.begin(), wrenches.end(),
                              [&](const Vector6& w) { return w[axis] == wrenches.front()[axis]; });
  }
  for (std::size_t kind = 0; kind < 6; kind += 3) {
    if (constant[kind] && constant[kind + 1] && constant[kind + 2]) {
      out.push_back(frozenText(kind == 0 ? "each of fx, fy, fz" : "each of tx, ty, tz",
                               wrenches.front(), kind, wrenches.size()));
      continue;
    }
    std::vector<double> noise;
    for (std::size_t k = kind; k < kind + 3; ++k) {
      if (!model.refusal) noise.push_back(model.group[k / 3].component[k % 3].noise);
    }
    std::sort(noise.begin(), noise.end());
    for (std::size_t k = kind; k < kind + 3; ++k) {
      if (!constant[k]) continue;
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (std::size_t i = 0; i < poses.size() && !model.refusal; ++i) {
        const Vector3d load = poses[i].R.transpose() * model.gravity;
        Vector6 w;
        w << load, model.center_of_mass.cross(load);
        if (model.axes == WrenchAxes::kBase) {
          w << poses[i].R * w.head<3>(), poses[i].R * w.tail<3>();
        }
        low = std::min(low, w[static_cast<Eigen::Index>(k)]);
        high = std::max(high, w[static_cast<Eigen::Index>(k)]);
      }
      if (model.refusal || high - low > kFrozenSpan * noise[1] ||
          (kind == 0 ? forceMisfit(model) : torqueMisfit(model))) {
        out.push_back(frozenText(kAxisNames[k], wrenches.front(), k, wrenches.size()));
      }
    }
  }
  return out;
}

// All readings whole numbers, too large to be coarsely rounded.
std::vector<std::string> counts(const std::vector<Vector6>& wrenches) {
  double largest = 0.0;
  for (const Vector6& w : wrenches) {
    for (Eigen::Index k = 0; k < 6; ++k) {
      if (w[k] != std::round(w[k])) return {};
    }
    largest = std::max(largest, w.cwiseAbs().maxCoeff());
  }
  if (largest < kLeastCounts) return {};
  return {"all readings are whole numbers, up to " + text("%.6g", largest) +
          ": counts of a converter? Give N and N m (the counts over the counts per N and per N m "
          "of the sensor)"};
}

bool plausible(double mass, double distance) {
  return mass < kLargestMass && distance < kFarthestCenter &&
         distance < kLightCenter + kCenterPerMass * mass;
}

// Units in which a payload is plausible, by factors of force and torque.
std::string likelyUnits(double mass, double distance) {
  struct Unit {
    const char* name;
    double force, torque;
  };
  // the most common first
  static const std::array<Unit, 9> units = {{{"torques in N mm", 1.0, 1e-3},
                                             {"forces in kgf", 9.80665, 1.0},
                                             {"torques in N cm", 1.0, 1e-2},
                                             {"forces in lbf", 4.4482216, 1.0},
                                             {"torques in lbf in", 1.0, 0.11298483},
                                             {"forces in mN and torques in N mm", 1e-3, 1e-3},
                                             {"forces in gf", 9.80665e-3, 1.0},
                                             {"forces in kN", 1e3, 1.0},
                                             {"forces in mN", 1e-3, 1.0}}};
  std::string out;
  int found = 0;
  for (const Unit& unit : units) {
    const double m = mass * unit.force, d = distance * unit.torque / unit.force;
    if (!plausible(m, d) || m < 0.02 || d < 0.01 || found == 2) continue;
    ++found;
    out += (out.empty() ? "" : ", or ") + std::string(unit.name) +
           text(" (then %.3g kg at %.3g mm)", m, 1e3 * d);
  }
  return out;
}

std::vector<std::string> implausible(const PayloadModel& m, double gravity) {
  const double mass = m.weight / gravity, distance = m.center_of_mass.norm();
  const bool noises = torqueApart(m) && !torqueMisfit(m);
  if (plausible(mass, distance) && !noises) return {};
  const std::string likely = likelyUnits(mass, distance);
  std::string cause = mass > kLargestMass ? "raw counts, or " : "";
  cause += likely.empty() ? "other units than N and N m" : likely;
  const std::string what = noises ? text("; noise of %.3g N m beside %.3g N is no sensor's",
                                         m.held_out_rms.torque, m.held_out_rms.force)
                                  : std::string(" is no likely payload");
  return {text("%.4g kg with its centre %.4g m from the sensor", mass, distance) + what + ": " +
          cause + "? Give N and N m"};
}

std::vector<std::string> misfit(const PayloadModel& m) {
  std::vector<std::string> out;
  if (forceMisfit(m)) {
    const double force = std::sqrt(3.0) * m.held_out_rms.force;
    out.push_back(
        text("the forces follow the orientations only to %.3g N, %.0f %% of the weight "
             "(held out): check that each wrench has its pose, and the axes of both, or "
             "take a heavier load",
             force, 100.0 * force / m.weight));
  }
  if (torqueMisfit(m)) {
    out.push_back(
        text("the torques don't follow the forces: one is met to %.3g N m, a force to "
             "%.3g N (held out, rms); check the axes of the torques",
             m.held_out_rms.torque, m.held_out_rms.force));
  }
  return out;
}

std::vector<std::string> opposite(const PayloadModel& m, bool upside_down) {
  const double up = m.gravity.z() / m.weight * (upside_down ? -1.0 : 1.0);
  if (up < 0.5) return {};
  return {upside_down
              ? "the weight points down the base's z though it hangs upside down: the load has the "
                "opposite sign, or leave out --upside-down"
              : "the load has the opposite sign: the weight points up the base's z; turn the signs "
                "of all six readings, or give --upside-down if the base hangs from a ceiling"};
}

// Why neither axes fit, where a fit was refused.
std::string neitherFits(const std::vector<Vector6>& wrenches, const PayloadModel& m) {
  Vector3d mean = Vector3d::Zero();
  const auto n = static_cast<double>(wrenches.size());
  for (const Vector6& w : wrenches) mean += w.head<3>() / n;
  double squares = 0.0;
  for (const Vector6& w : wrenches) squares += (w.head<3>() - mean).squaredNorm() / n;
  const double left = std::min(m.base_residual, m.sensor_residual);
  if (left < 0.3 * std::sqrt(squares)) return "";
  return text(
      "neither in base nor in sensor axes do the forces follow the orientations (%.3g N of "
      "%.3g N are left): check that each wrench has its pose, the order of a quaternion's "
      "numbers, the unit of angles and the robot's joints",
      left, std::sqrt(squares));
}

void add(std::vector<std::string>& to, const std::vector<std::string>& more) {
  to.insert(to.end(), more.begin(), more.end());
}

}  // namespace

std::vector<std::string> checkPayload(const std::vector<StaticPose>& poses,
                                      const std::vector<OtherRotations>& others,
                                      const std::vector<Vector6>& wrenches,
                                      const PayloadModel& model,
                                      const PayloadCheckOptions& options) {
  const CalibrationFailure refused = model.refusal.code;
  if (refused == CalibrationFailure::kTooFewPoses || refused == CalibrationFailure::kOneAxis) {
    return {};
  }
  std::vector<std::string> out = repeated(poses, wrenches);
  add(out, frozenAxes(poses, wrenches, model));
  if (!out.empty()) return out;
  const OtherReading other = otherReading(
      poses, others, wrenches, model.refusal ? WrenchAxes::kAuto : model.axes, options.gravity);
  const bool fits = other.better < kOtherBetter;
  if (!fits) out.push_back(other.text + ": check how the file is meant");
  if (model.refusal) {
    if (fits && refused == CalibrationFailure::kAxesUndecided) {
      const std::string neither = neitherFits(wrenches, model);
      if (!neither.empty()) out.push_back(neither);
    }
    return out;
  }
  const std::size_t before = out.size();
  add(out, counts(wrenches));
  if (out.size() == before) add(out, implausible(model, options.gravity));
  if (fits) {
    add(out, misfit(model));
    add(out, opposite(model, options.upside_down));
  }
  return out;
}

}  // namespace assembly_cell
