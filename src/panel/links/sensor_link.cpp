// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "sensor_link.h"

#include <geometry_msgs/WrenchStamped.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "assembly_cell/LocusEstimate.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::panel {

namespace {

constexpr double kFullScale = 5.0;  // of the converters, ± [V]
constexpr auto kReadingAge = std::chrono::seconds(2);

// Load along or about each axis alone at which the first channel leaves its range.
bool loadLimits(const SensorCalibration& calibration, std::array<double, 6>& limit) {
  using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  const Eigen::FullPivLU<Matrix6> map(Matrix6(RowMajor(calibration.volts_to_wrench.data())));
  if (!map.isInvertible()) return false;
  const Matrix6 volts = map.inverse();
  for (int axis = 0; axis < 6; ++axis) {
    double smallest = std::numeric_limits<double>::infinity();
    for (int channel = 0; channel < 6; ++channel) {
      const double zero = calibration.zero_volts[static_cast<std::size_t>(channel)];
      const double range = kFullScale - std::abs(zero);
      smallest = std::min(smallest, range / std::abs(volts(channel, axis)));
    }
    limit[static_cast<std::size_t>(axis)] = smallest;
  }
  return std::all_of(limit.begin(), limit.end(),
                     [](double value) { return std::isfinite(value) && value > 0.0; });
}

std::string describe(const LocusEstimate& locus) {
  static const std::array<const char*, 5> modes = {"no contact", "segment", "ellipse", "circle",
                                                   "undecided"};
  std::string out = "locus: ";
  out += locus.mode < modes.size() ? modes[locus.mode] : "?";
  out += text(" %.1f x %.1f um", 1e6 * locus.semi_major, 1e6 * locus.semi_minor);
  if (!locus.hypothesis_direction.empty()) {
    out += text(", contact at %.1f +- %.1f deg", locus.hypothesis_direction[0] * 180.0 / M_PI,
                locus.direction_sd * 180.0 / M_PI);
  }
  return out;
}

std::string describe(const TwinForceState& state) {
  std::string out =
      text("twin force: %zu contacts, %s", state.contacts.size(), state.status.c_str());
  if (state.pose_known) {
    out +=
        text(", sd %.3f mm, %.3f deg", 1e3 * state.position_sd, state.rotation_sd * 180.0 / M_PI);
  }
  return out;
}

}  // namespace

SensorLink::SensorLink(const ros::NodeHandle& nh) : topics_{nh, mutex_} {
  for (std::size_t i = 0; i < 2; ++i) {
    const std::string name = kSensorNames[i];
    wrench_subs_[i] = topics_.subscribeChecked<geometry_msgs::WrenchStamped>(
        name + "/wrench", [this, i](const geometry_msgs::WrenchStamped& message) {
          Vector6::Map(sensors_[i].wrench.data()) = ros_bridge::fromWrench(message.wrench);
        });
    subs_.push_back(topics_.subscribeChecked<SensorCalibration>(
        name + "/calibration", [this, i](const SensorCalibration& message) {
          sensors_[i].calibration = message.id;
          sensors_[i].limit_known = loadLimits(message, sensors_[i].limit);
        }));
  }
  subs_.push_back(
      topics_.subscribeChecked<LocusEstimate>("locus", [this](const LocusEstimate& locus) {
        reading_ = describe(locus);
        reading_time_ = Clock::now();
      }));
  subs_.push_back(topics_.subscribeChecked<TwinForceState>("twin_force/status",
                                                           [this](const TwinForceState& state) {
                                                             if (state.contacts.empty()) return;
                                                             reading_ = describe(state);
                                                             reading_time_ = Clock::now();
                                                           }));
}

void SensorLink::show(CellView& view) const {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    view.sensors = sensors_;
    if (Clock::now() - reading_time_ <= kReadingAge) view.reading = reading_;
  }
  for (std::size_t i = 0; i < 2; ++i) {
    view.sensors[i].there = wrench_subs_[i].getNumPublishers() > 0;
  }
}

}  // namespace assembly_cell::panel
