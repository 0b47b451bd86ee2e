// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/calibration.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <vector>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/ati_calibration.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kLongestId = 200;  // of id, serial_number, date [bytes]
constexpr const char* kFormat = "assembly_cell calibration 1";
constexpr const char* kExtendedFormat = "assembly_cell calibration 2";  // may have kExtensions
constexpr const char* kExtensions[] = {"wrench_products",
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

// rows 0: any square one of coefficients
Eigen::MatrixXd matrix(yaml::Section& in, const char* key, int rows = 0, int cols = 0) {
  yaml::Section m = in.section(key);
  const std::int64_t given_rows = m.integer("rows", 1, 1000),
                     given_cols = m.integer("cols", 1, 1000);
  for (const int size : {6, 27, 36, 162}) {
    if (rows == 0 && given_rows == size) rows = cols = size;
  }
  if (given_rows != rows || given_cols != cols) {
    throw InputError(in.source() + ": " + in.at(key) + " is not " + std::to_string(rows) + " by " +
                     std::to_string(cols) + ": give rows: " + std::to_string(rows) +
                     ", cols: " + std::to_string(cols));
  }
  const auto size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols);
  const std::vector<double> values = m.numbers("data", size);
  m.finish();
  return Eigen::Map<const RowMajor>(values.data(), rows, cols);
}

Vector6 vector(yaml::Section& in, const char* key) { return in.numbers<6>(key, yaml::Range::kAny); }

FitStatistics statistics(yaml::Section in) {
  FitStatistics fit;
  fit.chi2 = in.number("chi2", yaml::Range::kAny);
  fit.dof = static_cast<int>(in.integer("dof", 0, 2147483647));
  fit.p = in.number("p", yaml::Range::kAny);
  fit.residual_rms = vector(in, "residual_rms");
  fit.predicted_sd = vector(in, "predicted_sd");
  in.finish();
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

// and read
void readExtensions(yaml::Section& in, Calibration& c) {
  c.quadratic_wrench = in.optional("wrench_products");
  if (c.quadratic_wrench) c.wrench_products = matrix(in, "wrench_products", 6, kStrainProducts);
  c.quadratic_displacement = in.optional("displacement_products");
  if (c.quadratic_displacement) {
    c.displacement_products = matrix(in, "displacement_products", 6, kStrainProducts);
  }
  c.temperature = in.number("temperature", yaml::Range::kAny, c.temperature);
  if (in.optional("noise")) c.noise = vector(in, "noise");
  if (in.optional("wrench_range")) c.wrench_range = vector(in, "wrench_range");
  if (in.optional("displacement_range")) c.displacement_range = vector(in, "displacement_range");
  if (in.optional("wrench_fit")) c.wrench_fit = statistics(in.section("wrench_fit"));
  if (in.optional("displacement_fit")) {
    c.displacement_fit = statistics(in.section("displacement_fit"));
  }
  if (in.optional("observations")) c.observations_digest = in.text("observations", "give one line");
  if (in.optional("wrench_covariance")) c.wrench_covariance = matrix(in, "wrench_covariance");
  if (in.optional("displacement_covariance")) {
    c.displacement_covariance = matrix(in, "displacement_covariance");
  }
  if (in.optional("displacement_variance")) {
    c.displacement_variance = vector(in, "displacement_variance");
  }
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
  for (const std::string* text : {&c.id, &c.serial_number, &c.date}) {
    if (text->size() <= kLongestId) continue;
    throw InputError(source + ": id, serial_number or date has " + std::to_string(text->size()) +
                     " characters: give at most " + std::to_string(kLongestId));
  }
  if (!isLine(c.id) || !isLine(c.serial_number) || !isLine(c.date)) {
    throw InputError(source +
                     ": id, serial_number or date holds control characters: give one line");
  }
  if (!c.volts_to_wrench.allFinite()) {
    throw InputError(source + ": volts_to_wrench is not finite: calibrate again");
  }
  if (!c.volts_to_displacement.allFinite()) {
    throw InputError(source + ": volts_to_displacement is not finite: calibrate again");
  }
  if (!c.zero_volts.allFinite()) {
    throw InputError(source +
                     ": zero_volts is not finite: give six readings of the unloaded sensor");
  }
  if (!c.wrench_products.allFinite() || !c.displacement_products.allFinite()) {
    throw InputError(source +
                     ": wrench_products or displacement_products is not finite: calibrate "
                     "again");
  }
  if (!isLine(c.observations_digest)) {
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
      throw InputError(source + ": " + key + " is not finite: calibrate again");
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
                     "): a direction of load would be blind; calibrate again");
  }
}

std::string channelText(unsigned channels) {
  std::string numbers;
  for (unsigned k = 0; k < 6; ++k) {
    if (channels >> k & 1u) numbers += (numbers.empty() ? "" : ", ") + std::to_string(k + 1);
  }
  return numbers.empty() ? "none" : numbers;
}

Calibration withDisplacement(Calibration c, const Matrix6& stiffness) {
  const Eigen::FullPivLU<Matrix6> lu(stiffness);
  if (!lu.isInvertible()) {
    throw InputError(
        "coupling.stiffness: singular, so the coupling can't serve as a displacement sensor; give "
        "every direction a stiffness");
  }
  c.volts_to_displacement = lu.solve(c.volts_to_wrench);
  c.quadratic_displacement = c.quadratic_wrench;
  if (c.quadratic_displacement) c.displacement_products = lu.solve(c.wrench_products);
  return c;
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

Eigen::MatrixXd gainCovariance(const Calibration& c) {
  const Eigen::Index terms = c.quadratic_wrench ? 6 + kStrainProducts : 6;
  if (c.wrench_covariance.rows() != 6 * terms) return {};
  // E = dS S⁻¹, row by row
  const Matrix6 strain = c.volts_to_wrench.inverse();
  Eigen::MatrixXd out(36, 36);
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = 0; j < 6; ++j) {
      out.block<6, 6>(6 * i, 6 * j) =
          strain.transpose() * c.wrench_covariance.block<6, 6>(terms * i, terms * j) * strain;
    }
  }
  return 0.5 * (out + out.transpose());
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

std::string calibrationChecksum(const Calibration& c) {
  std::string content = c.id + "\n" + c.serial_number + "\n" + c.date + "\n" +
                        entries(c.volts_to_wrench, "") + "\n" +
                        entries(c.volts_to_displacement, "") + "\n" + list(c.zero_volts);
  const std::string more = extensions(c);
  if (!more.empty()) content += "\n" + more;
  return crcText(content);
}

Calibration loadCalibration(const std::string& path) {
  const std::string where = "calibration file '" + path + "'";
  // 162 by 162 numbers of a covariance
  constexpr std::size_t kLargestFile = 4 << 20;
  const std::string content = yaml::fileText(path, "a calibration", kLargestFile);
  if (isXml(content)) return parseAtiCalibration(content, where);
  const YAML::Node root = yaml::loadYaml(content, where, yaml::FileKind::kCalibration);
  const std::string format =
      root.IsMap() && root["format"] && root["format"].IsScalar() ? root["format"].Scalar() : "";
  if (format != kFormat && format != kExtendedFormat) {
    throw InputError(where + " is no calibration: its format must be '" + kFormat + "' or '" +
                     kExtendedFormat + "'");
  }
  yaml::Section in(root, "", where, yaml::Wording::kIs);
  if (format == kExtendedFormat) {
    for (const char* key : kExtensions) in.optional(key);
  }
  in.only({"format", "id", "serial_number", "date", "volts_to_wrench", "volts_to_displacement",
           "zero_volts", "checksum"});

  Calibration c;
  const char* line = "give one line";
  c.id = in.text("id", line);
  c.serial_number = in.text("serial_number", line);
  c.date = in.text("date", line);
  c.volts_to_wrench = matrix(in, "volts_to_wrench", 6, 6);
  c.volts_to_displacement = matrix(in, "volts_to_displacement", 6, 6);
  c.zero_volts = vector(in, "zero_volts");
  const std::string stored = in.text("checksum", line);
  if (format == kExtendedFormat) readExtensions(in, c);
  checkCalibration(c, where);

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

}  // namespace assembly_cell
