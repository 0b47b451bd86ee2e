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

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace {

constexpr const char* kFormat = "assembly_cell calibration 1";
constexpr const char* kExtendedFormat = "assembly_cell calibration 2";  // may have kExtensions
const std::set<std::string> kKeys = {
    "format",     "id",      "serial_number", "date", "volts_to_wrench", "volts_to_displacement",
    "zero_volts", "checksum"};
const std::set<std::string> kExtensions = {"wrench_products",
                                           "displacement_products",
                                           "temperature",
                                           "noise",
                                           "wrench_range",
                                           "displacement_range",
                                           "wrench_fit",
                                           "displacement_fit",
                                           "observations",
                                           "wrench_covariance",
                                           "displacement_covariance",
                                           "displacement_variance"};
constexpr double kQueryRange = 1.1;  // beyond the tests that is extrapolation
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

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::string entries(const RowMajor& m, const std::string& indent) {
  return list(m.data(), static_cast<int>(m.rows()), static_cast<int>(m.cols()), indent);
}

std::string matrix(const RowMajor& m) {
  return "\n  rows: " + std::to_string(m.rows()) + "\n  cols: " + std::to_string(m.cols()) +
         "\n  data: " + entries(m, "         ") + "\n";
}

std::string list(const Vector6& v) { return list(v.data(), 1, 6, ""); }

bool printable(const std::string& text) {
  return std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return c >= 0x20 && c != 0x7f; });
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

void checkKeys(const YAML::Node& node, const std::set<std::string>& keys, const std::string& where,
               const std::set<std::string>& optional = {}) {
  if (!node.IsMap()) throw InputError(where + " is not a mapping: give a calibration file");
  std::set<std::string> seen;
  for (const auto& item : node) {
    const std::string key = item.first.IsScalar() ? item.first.Scalar() : "?";
    if (keys.count(key) == 0 && optional.count(key) == 0) {
      throw InputError(where + ": unknown key '" + key + "': remove it");
    }
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

// size 0: any square one
Eigen::MatrixXd matrix(const YAML::Node& root, const std::string& key, const std::string& path,
                       int rows = 0, int cols = 0) {
  const std::string where = path + ": " + key;
  checkKeys(root[key], {"rows", "cols", "data"}, where);
  const std::string given_rows = text(root[key], "rows", where);
  const std::string given_cols = text(root[key], "cols", where);
  if (rows == 0) {
    for (const int size : {6, 27, 36, 162}) {
      if (given_rows == std::to_string(size)) rows = cols = size;
    }
  }
  if (given_rows != std::to_string(rows) || given_cols != std::to_string(cols)) {
    throw InputError(where + " is not " + std::to_string(rows) + " by " + std::to_string(cols) +
                     ": give rows: " + std::to_string(rows) + ", cols: " + std::to_string(cols));
  }
  const auto size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols);
  return Eigen::Map<const RowMajor>(numbers(root[key]["data"], size, where + ".data").data(), rows,
                                    cols);
}

Vector6 vector(const YAML::Node& root, const std::string& key, const std::string& path) {
  return Vector6(numbers(root[key], 6, path + ": " + key).data());
}

double scalar(const YAML::Node& root, const std::string& key, const std::string& path) {
  double value = 0.0;
  const std::string given = text(root, key, path);
  if (!YAML::convert<double>::decode(root[key], value) || !std::isfinite(value)) {
    throw InputError(path + ": " + key + " is '" + given + "': give a finite number");
  }
  return value;
}

FitStatistics statistics(const YAML::Node& root, const std::string& key, const std::string& path) {
  const std::string where = path + ": " + key;
  checkKeys(root[key], {"chi2", "dof", "p", "residual_rms", "predicted_sd"}, where);
  FitStatistics fit;
  fit.chi2 = scalar(root[key], "chi2", where);
  if (!YAML::convert<int>::decode(root[key]["dof"], fit.dof) || fit.dof < 0) {
    throw InputError(where + ": dof is no count: give a whole number");
  }
  fit.p = scalar(root[key], "p", where);
  fit.residual_rms = vector(root[key], "residual_rms", where);
  fit.predicted_sd = vector(root[key], "predicted_sd", where);
  return fit;
}

std::string statistics(const FitStatistics& fit) {
  return "{chi2: " + number(fit.chi2) + ", dof: " + std::to_string(fit.dof) +
         ", p: " + number(fit.p) + ",\n  residual_rms: " + list(fit.residual_rms) +
         ",\n  predicted_sd: " + list(fit.predicted_sd) + "}\n";
}

bool known(const FitStatistics& fit) { return fit.dof > 0 || fit.chi2 > 0.0; }

// what a file of format 2 has beyond format 1, as it is written; empty for a plain calibration
std::string extensions(const Calibration& c) {
  std::string out;
  if (c.quadratic_wrench) {
    out += "wrench_products:        # [N/V2], [N m/V2]: v1v1 v1v2 ... v1v6 v2v2 ... v6v6" +
           matrix(c.wrench_products);
  }
  if (c.quadratic_displacement) {
    out += "displacement_products:  # [m/V2], [rad/V2], likewise" + matrix(c.displacement_products);
  }
  if (std::isfinite(c.temperature)) out += "temperature: " + number(c.temperature) + "  # [degC]\n";
  if (!c.noise.isZero(0.0)) out += "noise: " + list(c.noise) + "  # of one sample, rms [V]\n";
  if (!c.wrench_range.isZero(0.0)) {
    out += "wrench_range: " + list(c.wrench_range) + "  # largest strain of the tests [V]\n";
  }
  if (!c.displacement_range.isZero(0.0)) {
    out += "displacement_range: " + list(c.displacement_range) + "  # likewise\n";
  }
  if (known(c.wrench_fit)) out += "wrench_fit: " + statistics(c.wrench_fit);
  if (known(c.displacement_fit)) out += "displacement_fit: " + statistics(c.displacement_fit);
  if (!c.observations_digest.empty())
    out += "observations: " + yamlQuoted(c.observations_digest) + "\n";
  if (c.wrench_covariance.size() > 0) {
    out += "wrench_covariance:      # of the coefficients, row after row" +
           matrix(c.wrench_covariance);
  }
  if (c.displacement_covariance.size() > 0) {
    out += "displacement_covariance:  # of the coefficients of a row, for an output of variance 1" +
           matrix(c.displacement_covariance) +
           "displacement_variance: " + list(c.displacement_variance) + "  # [m2], [rad2]\n";
  }
  return out;
}

void checkCovariance(const Eigen::MatrixXd& covariance, int size, const std::string& where) {
  if (covariance.size() == 0) return;
  if (covariance.rows() != size || covariance.cols() != size) {
    throw InputError(where + " is not " + std::to_string(size) + " by " + std::to_string(size) +
                     ": it must have all coefficients");
  }
  if (!covariance.allFinite() || covariance.diagonal().minCoeff() < 0.0 ||
      (covariance - covariance.transpose()).cwiseAbs().maxCoeff() >
          1e-9 * covariance.cwiseAbs().maxCoeff()) {
    throw InputError(where + " is no covariance: it must be finite, symmetric, not negative");
  }
}

// covariance of outputs that are rows of coefficients times b
template <int n>
Matrix6 mapCovariance(const Eigen::MatrixXd& P, const Eigen::Matrix<double, n, 1>& b) {
  Matrix6 out;
  Eigen::Matrix<double, 6 * n, 1> Pb;
  const Eigen::Map<const Eigen::Matrix<double, 6 * n, 6 * n>> P_fixed(P.data());
  for (int j = 0; j < 6; ++j) {
    Pb.head((j + 1) * n).noalias() = P_fixed.block(0, j * n, (j + 1) * n, n) * b;
    for (int i = 0; i <= j; ++i) {
      out(i, j) = out(j, i) = b.dot(Pb.template segment<n>(i * n));
    }
  }
  return out;
}

Eigen::Matrix<double, 27, 1> allTerms(const Vector6& s) {
  Eigen::Matrix<double, 27, 1> b;
  b << s, strainProducts(s);
  return b;
}

// d(linear s + products · strainProducts(s))/ds
Matrix6 jacobian(const Matrix6& linear, const Matrix6x21& products, const Vector6& s) {
  Matrix6 J = linear;
  for (int i = 0, k = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j, ++k) {
      J.col(i) += products.col(k) * s[j];
      J.col(j) += products.col(k) * s[i];
    }
  }
  return J;
}

unsigned outside(const Vector6& range, const Vector6& s) {
  unsigned bits = 0;
  for (int k = 0; k < 6; ++k) {
    if (range[k] > 0.0 && !(std::abs(s[k]) <= kQueryRange * range[k])) bits |= 1u << k;
  }
  return bits;
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
  if (!c.wrench_products.allFinite() || !c.displacement_products.allFinite()) {
    throw InputError(source +
                     ": wrench_products or displacement_products is not finite: calibrate "
                     "anew");
  }
  if (!printable(c.observations_digest)) {
    throw InputError(source + ": observations holds control characters: give one line");
  }
  for (const auto& [values, key] : {std::pair{&c.noise, "noise"},
                                    {&c.wrench_range, "wrench_range"},
                                    {&c.displacement_range, "displacement_range"},
                                    {&c.displacement_variance, "displacement_variance"}}) {
    if (!values->allFinite() || values->minCoeff() < 0.0) {
      throw InputError(source + ": " + key + " is negative or not finite: give six sizes");
    }
  }
  for (const auto& [fit, key] :
       {std::pair{&c.wrench_fit, "wrench_fit"}, {&c.displacement_fit, "displacement_fit"}}) {
    if (!std::isfinite(fit->chi2) || !std::isfinite(fit->p) || !fit->residual_rms.allFinite() ||
        !fit->predicted_sd.allFinite()) {
      throw InputError(source + ": " + key + " is not finite: calibrate anew");
    }
  }
  checkCovariance(c.wrench_covariance, c.quadratic_wrench ? 162 : 36,
                  source + ": wrench_covariance");
  checkCovariance(c.displacement_covariance, c.quadratic_displacement ? 27 : 6,
                  source + ": displacement_covariance");
  const auto values = Eigen::JacobiSVD<Matrix6>(c.volts_to_wrench).singularValues();
  if (!(values[5] > kSingular * values[0])) {
    throw InputError(source + ": volts_to_wrench is singular (singular values " +
                     number(values[0]) + " to " + number(values[5]) +
                     "): a direction of load would be blind; calibrate anew");
  }
}

Matrix6 wrenchCovariance(const Calibration& c, const Vector6& volts,
                         const Matrix6& volts_covariance) {
  const Vector6 s = volts - c.zero_volts;
  Matrix6 J = c.volts_to_wrench;
  Matrix6 map = Matrix6::Zero();
  if (c.quadratic_wrench) {
    J = jacobian(c.volts_to_wrench, c.wrench_products, s);
    if (c.wrench_covariance.rows() == 162)
      map = mapCovariance<27>(c.wrench_covariance, allTerms(s));
  } else if (c.wrench_covariance.rows() == 36) {
    map = mapCovariance<6>(c.wrench_covariance, s);
  }
  return map + J * volts_covariance * J.transpose();
}

Matrix6 displacementCovariance(const Calibration& c, const Vector6& volts,
                               const Matrix6& volts_covariance) {
  const Vector6 s = volts - c.zero_volts;
  Matrix6 J = c.volts_to_displacement;
  double unit = 0.0;
  if (c.quadratic_displacement) {
    J = jacobian(c.volts_to_displacement, c.displacement_products, s);
    if (c.displacement_covariance.rows() == 27) {
      const Eigen::Matrix<double, 27, 1> b = allTerms(s);
      unit = b.dot(c.displacement_covariance * b);
    }
  } else if (c.displacement_covariance.rows() == 6) {
    unit = s.dot(c.displacement_covariance * s);
  }
  Matrix6 out = J * volts_covariance * J.transpose();
  out.diagonal() += unit * c.displacement_variance;
  return out;
}

unsigned outsideWrenchRange(const Calibration& c, const Vector6& volts) {
  return outside(c.wrench_range, volts - c.zero_volts);
}

unsigned outsideDisplacementRange(const Calibration& c, const Vector6& volts) {
  return outside(c.displacement_range, volts - c.zero_volts);
}

std::string crcText(const std::string& bytes) {
  boost::crc_32_type crc;
  crc.process_bytes(bytes.data(), bytes.size());
  char digits[9];
  std::snprintf(digits, sizeof(digits), "%08x", static_cast<unsigned>(crc.checksum()));
  return std::string("crc32:") + digits;
}

std::string calibrationChecksum(const Calibration& c) {
  std::string content = c.id + "\n" + c.serial_number + "\n" + c.date + "\n" +
                        entries(c.volts_to_wrench, "") + "\n" +
                        entries(c.volts_to_displacement, "") + "\n" + list(c.zero_volts);
  const std::string more = extensions(c);
  if (!more.empty()) content += "\n" + more;
  return crcText(content);
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
      (root["format"].Scalar() != kFormat && root["format"].Scalar() != kExtendedFormat)) {
    throw InputError(where + " is no calibration: its format must be '" + kFormat + "' or '" +
                     kExtendedFormat + "'");
  }
  checkKeys(root, kKeys, where,
            root["format"].Scalar() == kFormat ? std::set<std::string>{} : kExtensions);

  Calibration c;
  c.id = text(root, "id", where);
  c.serial_number = text(root, "serial_number", where);
  c.date = text(root, "date", where);
  c.volts_to_wrench = matrix(root, "volts_to_wrench", where, 6, 6);
  c.volts_to_displacement = matrix(root, "volts_to_displacement", where, 6, 6);
  c.zero_volts = vector(root, "zero_volts", where);
  c.quadratic_wrench = root["wrench_products"].IsDefined();
  if (c.quadratic_wrench) {
    c.wrench_products = matrix(root, "wrench_products", where, 6, kStrainProducts);
  }
  c.quadratic_displacement = root["displacement_products"].IsDefined();
  if (c.quadratic_displacement) {
    c.displacement_products = matrix(root, "displacement_products", where, 6, kStrainProducts);
  }
  if (root["temperature"]) c.temperature = scalar(root, "temperature", where);
  if (root["noise"]) c.noise = vector(root, "noise", where);
  if (root["wrench_range"]) c.wrench_range = vector(root, "wrench_range", where);
  if (root["displacement_range"]) {
    c.displacement_range = vector(root, "displacement_range", where);
  }
  if (root["wrench_fit"]) c.wrench_fit = statistics(root, "wrench_fit", where);
  if (root["displacement_fit"]) c.displacement_fit = statistics(root, "displacement_fit", where);
  if (root["observations"]) c.observations_digest = text(root, "observations", where);
  if (root["wrench_covariance"]) c.wrench_covariance = matrix(root, "wrench_covariance", where);
  if (root["displacement_covariance"]) {
    c.displacement_covariance = matrix(root, "displacement_covariance", where);
  }
  if (root["displacement_variance"]) {
    c.displacement_variance = vector(root, "displacement_variance", where);
  }
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
  const std::string more = extensions(c);
  std::ostringstream out;
  out << "# wrench = volts_to_wrench (volts - zero_volts), force before torque, sensor frame\n"
      << "# displacement = volts_to_displacement (volts - zero_volts), x y z, rotation vector\n"
      << "format: " << (more.empty() ? kFormat : kExtendedFormat) << "\n"
      << "id: " << yamlQuoted(c.id) << "\n"
      << "serial_number: " << yamlQuoted(c.serial_number) << "\n"
      << "date: " << yamlQuoted(c.date) << "\n"
      << "volts_to_wrench:        # [N/V], [N m/V], row after row" << matrix(c.volts_to_wrench)
      << "volts_to_displacement:  # [m/V], [rad/V]; zero where the sensor is rigid"
      << matrix(c.volts_to_displacement) << "zero_volts: " << list(c.zero_volts)
      << "  # unloaded [V]\n"
      << more << "checksum: \"" << calibrationChecksum(c) << "\"  # of all the above\n";
  writeFileAtomically(path, out.str(), where);
}

void writeFileAtomically(const std::string& path, const std::string& content,
                         const std::string& where) {
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
