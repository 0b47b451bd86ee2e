// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/calibration.h"

#include <fcntl.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/SVD>
#include <algorithm>
#include <boost/crc.hpp>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ios>
#include <set>
#include <sstream>
#include <vector>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {

namespace {

constexpr const char* kFormat = "assembly_cell calibration 1";
constexpr double kSingular = 1e-9;  // smallest over largest singular value; real ones are near 1e-2

// shortest text that reads back to the same bits; −0 is written as 0
std::string number(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof(text), value + 0.0).ptr};
}

std::string list(const double* data, int rows, int cols, const std::string& indent) {
  std::string text = "[";
  for (int i = 0; i < rows * cols; ++i) {
    if (i > 0) text += i % cols == 0 ? ",\n" + indent : ", ";
    text += number(data[i]);
  }
  return text + "]";
}

using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

std::string matrix(const Matrix6& m) {
  const RowMajor rows = m;
  return "\n  rows: 6\n  cols: 6\n  data: " + list(rows.data(), 6, 6, "         ") + "\n";
}

bool printable(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return c >= 0x20 && c != 0x7f; });
}

std::string quoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

std::vector<double> numbers(const YAML::Node& node, std::size_t size, const std::string& where) {
  if (!node.IsSequence() || node.size() != size) {
    throw InputError(where + " has " +
                     (node.IsSequence() ? std::to_string(node.size()) + " entries" : "no list") +
                     ": give a list of " + std::to_string(size) + " numbers");
  }
  std::vector<double> values;
  for (const YAML::Node& entry : node) {
    double value = 0.0;
    if (!YAML::convert<double>::decode(entry, value) || !std::isfinite(value)) {
      throw InputError(where + "[" + std::to_string(values.size()) + "] is '" +
                       (entry.IsScalar() ? entry.Scalar() : "not a scalar") +
                       "': give a finite number");
    }
    values.push_back(value);
  }
  return values;
}

void checkKeys(const YAML::Node& node, const std::set<std::string>& keys,
               const std::string& where) {
  if (!node.IsMap()) throw InputError(where + " is not a mapping: give a calibration file");
  std::set<std::string> seen;
  for (const auto& item : node) {
    const std::string key = item.first.IsScalar() ? item.first.Scalar() : "?";
    if (keys.count(key) == 0) throw InputError(where + ": unknown key '" + key + "': remove it");
    if (!seen.insert(key).second) throw InputError(where + ": key '" + key + "' is there twice");
  }
  for (const std::string& key : keys) {
    if (seen.count(key) == 0) throw InputError(where + ": key '" + key + "' is missing: add it");
  }
}

std::string text(const YAML::Node& root, const std::string& key, const std::string& path) {
  if (!root[key].IsScalar()) throw InputError(path + ": " + key + " is no text: give one line");
  return root[key].Scalar();
}

Matrix6 matrix(const YAML::Node& root, const std::string& key, const std::string& path) {
  const std::string where = path + ": " + key;
  checkKeys(root[key], {"rows", "cols", "data"}, where);
  if (text(root[key], "rows", where) != "6" || text(root[key], "cols", where) != "6") {
    throw InputError(where + " is not 6 by 6: give rows: 6, cols: 6");
  }
  return RowMajor(numbers(root[key]["data"], 36, where + ".data").data());
}

}  // namespace

void checkCalibration(const Calibration& c, const std::string& source) {
  if (c.id.empty()) throw InputError(source + ": id is empty: name the calibration");
  if (c.serial_number.empty())
    throw InputError(source + ": serial_number is empty: name the sensor");
  if (!printable(c.id) || !printable(c.serial_number) || !printable(c.date)) {
    throw InputError(source +
                     ": id, serial_number or date holds control characters: give one line");
  }
  if (!c.volts_to_wrench.allFinite()) {
    throw InputError(source + ": volts_to_wrench is not finite: calibrate anew");
  }
  if (!c.volts_to_displacement.allFinite()) {
    throw InputError(source + ": volts_to_displacement is not finite: calibrate anew");
  }
  if (!c.zero_volts.allFinite()) {
    throw InputError(source +
                     ": zero_volts is not finite: give six readings of the unloaded sensor");
  }
  const auto values = Eigen::JacobiSVD<Matrix6>(c.volts_to_wrench).singularValues();
  if (!(values[5] > kSingular * values[0])) {
    throw InputError(source + ": volts_to_wrench is singular (singular values " +
                     number(values[0]) + " to " + number(values[5]) +
                     "): a direction of load would be blind; calibrate anew");
  }
}

std::string calibrationChecksum(const Calibration& c) {
  const RowMajor S = c.volts_to_wrench, T = c.volts_to_displacement;
  const std::string content = c.id + "\n" + c.serial_number + "\n" + c.date + "\n" +
                              list(S.data(), 6, 6, "") + "\n" + list(T.data(), 6, 6, "") + "\n" +
                              list(c.zero_volts.data(), 1, 6, "");
  boost::crc_32_type crc;
  crc.process_bytes(content.data(), content.size());
  char digits[9];
  std::snprintf(digits, sizeof(digits), "%08x", static_cast<unsigned>(crc.checksum()));
  return std::string("crc32:") + digits;
}

Calibration loadCalibration(const std::string& path) {
  YAML::Node root;
  try {
    root = YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw InputError("calibration file '" + path + "' can't be read: give an existing file");
  } catch (const YAML::Exception& error) {
    throw InputError("calibration file '" + path + "', line " +
                     std::to_string(error.mark.line + 1) + ": " + error.msg + ": mend the YAML");
  } catch (const std::ios_base::failure&) {
    throw InputError("calibration file '" + path + "' can't be read: give a file, not a folder");
  }
  const std::string where = "calibration file '" + path + "'";
  if (!root.IsMap() || !root["format"] || !root["format"].IsScalar() ||
      root["format"].Scalar() != kFormat) {
    throw InputError(where + " is no calibration: its format must be '" + kFormat + "'");
  }
  checkKeys(root,
            {"format", "id", "serial_number", "date", "volts_to_wrench", "volts_to_displacement",
             "zero_volts", "checksum"},
            where);

  Calibration c;
  c.id = text(root, "id", where);
  c.serial_number = text(root, "serial_number", where);
  c.date = text(root, "date", where);
  c.volts_to_wrench = matrix(root, "volts_to_wrench", where);
  c.volts_to_displacement = matrix(root, "volts_to_displacement", where);
  c.zero_volts = Vector6(numbers(root["zero_volts"], 6, where + ": zero_volts").data());
  checkCalibration(c, where);

  const std::string stored = text(root, "checksum", where);
  const std::string computed = calibrationChecksum(c);
  if (stored != computed) {
    throw InputError(where + ": checksum is '" + stored + "' but the content has '" + computed +
                     "': damaged or edited; restore the file, or write the latter if you meant it");
  }
  return c;
}

void saveCalibration(const Calibration& c, const std::string& path) {
  const std::string where = "calibration file '" + path + "'";
  checkCalibration(c, where);
  std::ostringstream out;
  out << "# wrench = volts_to_wrench (volts - zero_volts), force before torque, sensor frame\n"
      << "# displacement = volts_to_displacement (volts - zero_volts), x y z, rotation vector\n"
      << "format: " << kFormat << "\n"
      << "id: " << quoted(c.id) << "\n"
      << "serial_number: " << quoted(c.serial_number) << "\n"
      << "date: " << quoted(c.date) << "\n"
      << "volts_to_wrench:        # [N/V], [N m/V], row after row" << matrix(c.volts_to_wrench)
      << "volts_to_displacement:  # [m/V], [rad/V]; zero where the sensor is rigid"
      << matrix(c.volts_to_displacement) << "zero_volts: " << list(c.zero_volts.data(), 1, 6, "")
      << "  # unloaded [V]\n"
      << "checksum: \"" << calibrationChecksum(c) << "\"  # of all the above\n";
  const std::string content = out.str();

  // a reader sees the old file or the new one, whatever happens in between
  const std::string temporary = path + ".tmp" + std::to_string(::getpid());
  const auto fail = [&](const char* what) {
    const std::string reason = std::strerror(errno);
    ::unlink(temporary.c_str());
    throw InputError(where + " can't be written (" + what + ": " + reason +
                     "): give a writable folder");
  };
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) fail("open");
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t n = ::write(file, content.data() + done, content.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      const int error = errno;
      ::close(file);
      errno = error;
      fail("write");
    }
    done += static_cast<std::size_t>(n);
  }
  const bool synced = ::fsync(file) == 0;
  const bool closed = ::close(file) == 0;
  if (!synced || !closed) fail("fsync");
  if (std::rename(temporary.c_str(), path.c_str()) != 0) fail("rename");
  const std::size_t slash = path.rfind('/');
  const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory >= 0) {
    ::fsync(directory);
    ::close(directory);
  }
}

}  // namespace assembly_cell
