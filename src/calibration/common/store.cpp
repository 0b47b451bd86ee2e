// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/common/store.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "assembly_cell/base/date.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kLongestName = 100;
constexpr const char* kEnding = ".yaml";

void checkName(const std::string& text, const std::string& what) {
  if (isCalibrationName(text)) return;
  // a bad name is shown without what could break the line
  std::string shown = text.substr(0, kLongestName);
  std::replace_if(
      shown.begin(), shown.end(), [](unsigned char c) { return c < 0x20 || c >= 0x7f; }, '?');
  throw InputError(what + " is '" + shown +
                   "': give letters, digits, '.', '_' and '-', not beginning with '.', at most " +
                   std::to_string(kLongestName) + " of them");
}

}  // namespace

bool isCalibrationName(const std::string& text) {
  return !text.empty() && text.size() <= kLongestName && text[0] != '.' &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '.' || c == '_' || c == '-';
         });
}

std::string calibrationStore() { return dataFolder("calibration store") + "/calibrations"; }

std::string calibrationPath(const std::string& store, const std::string& sensor,
                            const std::string& id) {
  checkName(sensor, "sensor");
  checkName(id, "calibration id");
  return (fs::path(store) / sensor / (id + kEnding)).string();
}

void makeCalibrationFolder(const std::string& store, const std::string& sensor) {
  checkName(sensor, "sensor");
  std::error_code error;
  fs::create_directories(fs::path(store) / sensor, error);
  if (error) {
    throw InputError("calibration folder '" + (fs::path(store) / sensor).string() +
                     "' can't be made (" + error.message() + "): give a writable store");
  }
}

std::vector<std::string> storedCalibrations(const std::string& store, const std::string& sensor) {
  checkName(sensor, "sensor");
  std::vector<std::string> ids;
  std::error_code error;
  for (fs::directory_iterator entry(fs::path(store) / sensor, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string id = entry->path().stem().string();
    if (entry->path().extension() == kEnding && isCalibrationName(id)) ids.push_back(id);
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

void removeLeftovers(const std::string& folder) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    const std::size_t mark = name.rfind(".yaml.tmp");
    if (mark == std::string::npos || mark == 0) continue;
    const std::string digits = name.substr(mark + 9);
    if (!digits.empty() && digits.find_first_not_of("0123456789") == std::string::npos) {
      std::error_code ignored;
      fs::remove(entry->path(), ignored);
    }
  }
}

std::string newCalibrationId(const std::vector<std::string>& taken) {
  const std::string now = utcNow("%Y-%m-%dT%H-%M-%S");
  std::string id = now;
  for (int n = 2; std::find(taken.begin(), taken.end(), id) != taken.end(); ++n) {
    id = now + "_" + std::to_string(n);
  }
  return id;
}

std::string calibrationDate() { return utcNow("%Y-%m-%dT%H:%M:%SZ"); }

}  // namespace assembly_cell
