// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Contacts in a recording of a wrench and the tool's pose, without a model of the tool.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/base/table.h"
#include "assembly_cell/calibration/payload/payload.h"
#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/twin_force/line_of_action.h"

namespace assembly_cell {

struct WrenchRecording {
  std::string time_unit;           ///< of the file, and why
  std::vector<std::string> notes;  ///< conversions and corrections made in reading, in words
  std::vector<double> t;           ///< rising [s]
  std::vector<Vector6> wrench;     ///< in sensor axes, about the sensor's origin
  std::vector<Pose> pose;  ///< pose of the tool in the base; its axes are used as the sensor's
};

struct RecordingOptions {
  std::string topic, pose_topic;  ///< of a bag; empty: its only ones
  TimeUnit time_unit = TimeUnit::kFound;
};

/// Reads a table with t (readTimes()), fx fy fz tx ty tz, x y z and rotations (readRotations()), in
/// this order (with a quaternion) if it has no header; or a bag with a wrench and a pose. Throws
/// InputError naming file, line and column, also for positions and speeds that no arm has.
WrenchRecording readWrenchRecording(const std::string& path, const RecordingOptions& options = {});

struct ContactSettings {
  std::optional<double> lever;      ///< height of the tip's plane along z [m]; empty: estimated
  std::optional<double> footprint;  ///< radius of the tip about z [m]; empty: estimated
  double force = 1.0;               ///< minimum force of a classified contact [N]
};

/// kLight: contact detected below the minimum force.
enum class ContactKind { kFree, kLight, kOne, kSeveral };
const char* toString(ContactKind kind);  ///< free, light, one, several

struct ContactSample {
  ContactKind kind = ContactKind::kFree;
  Vector6 wrench = Vector6::Zero();  ///< bias and payload subtracted
  ContactLine line;  ///< intersection with the plane of the lever; of kOne and kSeveral
};

struct ContactSegment {
  std::size_t first = 0, end = 0;  ///< range of samples
  ContactKind kind = ContactKind::kFree;
  double force = 0.0;                                 ///< mean [N]
  double pitch = 0.0;                                 ///< median |F·M|/F² [m]
  Eigen::Vector2d cut = Eigen::Vector2d::Zero();      ///< weighted mean, of kOne
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();  ///< covariance of the samples' cuts
};

struct ContactAnalysis {
  PayloadModel payload;  ///< if refused, only `bias` was estimated
  Vector6 bias = Vector6::Zero(), bias_sd = Vector6::Zero();
  Matrix6 noise = Matrix6::Zero();     ///< covariance of a sample without contact, drift included
  std::size_t free_windows = 0;        ///< a quarter of a second each
  double lever = 0.0, lever_sd = 0.0;  ///< [m]
  std::size_t lever_windows = 0;
  double footprint = 0.0;  ///< radius [m]
  std::vector<ContactSample> samples;
  std::vector<ContactSegment> segments;
};

/// Estimates bias and payload from intervals in which the tool moves under a constant wrench, lever
/// and footprint from windows with the wrench of one point, and classifies each sample: one contact
/// if its couple over force is small and its line of action passes the footprint, by majority over
/// two fifths of a second. Throws InputError for a recording that is too short, has no interval
/// without contact, or no single contact for the lever.
ContactAnalysis findContacts(const WrenchRecording& recording, const ContactSettings& settings);

}  // namespace assembly_cell
