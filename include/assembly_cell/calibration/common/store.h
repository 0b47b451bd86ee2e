// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <string>
#include <vector>

namespace assembly_cell {

/// ~/.ros/assembly_cell/calibrations, or below ROS_HOME where that is set. Throws InputError when
/// neither HOME nor ROS_HOME is.
std::string calibrationStore();

/// STORE/SENSOR/ID.yaml. Names are letters, digits, '.', '_' and '-', not beginning with a
/// dot, at most 100 characters: never a path. Throws InputError naming what is wrong.
bool isCalibrationName(const std::string& text);
std::string calibrationPath(const std::string& store, const std::string& sensor,
                            const std::string& id);

/// Makes STORE/SENSOR with parents. Throws InputError when it can't.
void makeCalibrationFolder(const std::string& store, const std::string& sensor);

/// Ids stored in a folder, sorted; temporary files left out.
std::vector<std::string> storedCalibrations(const std::string& store, const std::string& sensor);

/// Removes temporary files of an interrupted write; only the process that writes may call it.
void removeLeftovers(const std::string& folder);

/// An id that isn't taken: the date and time, "2026-01-12T15-04-05", with a number when needed.
std::string newCalibrationId(const std::vector<std::string>& taken);

/// Date and time in UTC, "2026-01-12T15:04:05Z".
std::string calibrationDate();

}  // namespace assembly_cell
