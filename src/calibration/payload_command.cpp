// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/payload_command.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <limits>
#include <optional>
#include <sstream>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/calibration/payload.h"

namespace assembly_cell {

namespace {

constexpr const char* kHelp =
    R"(Usage: calibrate payload POSES.csv WRENCHES.csv [options]

Weight, centre of mass and bias from static poses under gravity, with drift, breaks and outliers found by tests.
POSES.csv: x,y,z,qx,qy,qz,qw of the sensor in the base [m, unit quaternion], one row a pose in the order recorded; optional
columns order (also: index, time, t; rising) and temperature. WRENCHES.csv: fx,fy,fz,tx,ty,tz [N, N m] about the sensor's origin.
A header row is optional; without one the columns are those above, an eighth of the poses is the order.

  --axes A             in which the wrenches are given: base, sensor or auto (default: the reading that fits)
  --predict FILE       poses of further readings; without an order column row k lies between poses k and k+1
  --output FILE        where the predicted wrenches go as CSV, axes and header as in WRENCHES.csv (default: only into the YAML)
  --holdout            print the leave-one-out error of every pose besides its rms
  --trace FILE         bias, its sd and the residual at every pose as CSV (scripts/plot_payload.py)
  --in-situ            correction matrix of the sensor, if the data support it
  --weight W           known weight [N]: fixes the scale of the correction matrix
  --no-drift, --no-breaks, --keep-outliers    leave a part out, to see what it changes
  --help               print this

Exit code: 0 ok, 1 the data do not determine the payload (the YAML says why), 2 bad input.

Example: calibrate payload poses.csv wrenches.csv --predict new_poses.csv --output predicted.csv --holdout
)";

struct Options {
  std::string poses, wrenches, predict, output, trace;
  PayloadOptions payload;
  bool holdout = false, help = false;
};

Options parseOptions(const std::vector<std::string>& arguments) {
  Options options;
  std::vector<std::string> files;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& name = arguments[i];
    const auto value = [&]() -> const std::string& {
      if (i + 1 == arguments.size() || arguments[i + 1].empty()) {
        throw InputError(name + ": value missing: see --help");
      }
      return arguments[++i];
    };
    if (name == "--help" || name == "-h") {
      options.help = true;
      return options;
    }
    if (name == "--predict") {
      options.predict = value();
    } else if (name == "--output") {
      options.output = value();
    } else if (name == "--trace") {
      options.trace = value();
    } else if (name == "--axes") {
      const std::string& axes = value();
      if (axes != "base" && axes != "sensor" && axes != "auto") {
        throw InputError("--axes: value " + axes + ": give base, sensor or auto");
      }
      options.payload.axes = axes == "base"     ? WrenchAxes::kBase
                             : axes == "sensor" ? WrenchAxes::kSensor
                                                : WrenchAxes::kAuto;
    } else if (name == "--weight") {
      const std::string& text = value();
      double weight = 0.0;
      if (!parseNumber(text, weight) || !(weight > 0.0)) {
        throw InputError("--weight: value " + text + ": give a positive number of N");
      }
      options.payload.known_weight = weight;
    } else if (name == "--holdout") {
      options.holdout = true;
    } else if (name == "--in-situ") {
      options.payload.in_situ = true;
    } else if (name == "--no-drift") {
      options.payload.drift = false;
    } else if (name == "--no-breaks") {
      options.payload.breaks = false;
    } else if (name == "--keep-outliers") {
      options.payload.outliers = false;
    } else if (name.rfind("-", 0) == 0) {
      throw InputError("argument: value " + name + ": unknown option, see --help");
    } else {
      files.push_back(name);
    }
  }
  if (files.size() != 2) {
    throw InputError("argument: " + std::to_string(files.size()) +
                     " files: give POSES.csv and WRENCHES.csv, see --help");
  }
  if (!options.output.empty() && options.predict.empty()) {
    throw InputError("--output: nothing to write: give --predict FILE too");
  }
  if (options.payload.known_weight && !options.payload.in_situ) {
    throw InputError("--weight: serves the correction matrix: give --in-situ too");
  }
  options.poses = files[0];
  options.wrenches = files[1];
  return options;
}

// ---- CSV with optional header

struct Table {
  bool header = false;
  std::vector<std::string> names;  // lower case
  std::vector<std::vector<double>> rows;
  std::vector<std::size_t> line;  // of each row
};

// a comma at the end of a row makes no cell
std::vector<std::string> cellsOf(const std::string& text) {
  auto cells = csvCells(text, " \t\r\"");
  if (!text.empty() && text.back() == ',') cells.pop_back();
  return {cells.begin(), cells.end()};
}

Table readTable(const std::string& path, const std::vector<std::string>& columns,
                const std::vector<std::string>& further) {
  std::ifstream file(path);
  if (!file) throw InputError(path + ": file missing or unreadable: give a CSV file");
  Table table;
  std::string text;
  for (std::size_t line = 1; std::getline(file, text); ++line) {
    if (line == 1 && text.rfind("\xEF\xBB\xBF", 0) == 0) text.erase(0, 3);
    if (text.find_first_not_of(" \t\r") == std::string::npos || text[0] == '#') continue;
    const std::vector<std::string> cells = cellsOf(text);
    double value = 0.0;
    if (table.names.empty()) {
      table.header = !cells.empty() && !parseNumber(cells[0], value) && !cells[0].empty() &&
                     std::isalpha(static_cast<unsigned char>(cells[0][0])) != 0 &&
                     cells[0] != "nan" && cells[0] != "NaN" && cells[0] != "inf";
      if (table.header) {
        for (std::string name : cells) {
          std::transform(name.begin(), name.end(), name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
          table.names.push_back(name);
        }
        continue;
      }
      table.names = columns;
      for (const std::string& name : further) {
        if (table.names.size() < cells.size()) table.names.push_back(name);
      }
    }
    const std::string place = path + ":" + std::to_string(line) + ": ";
    if (cells.size() != table.names.size()) {
      throw InputError(place + std::to_string(cells.size()) + " columns: give " +
                       std::to_string(table.names.size()) + " as in the first row");
    }
    std::vector<double> row;
    for (std::size_t c = 0; c < cells.size(); ++c) {
      if (!parseNumber(cells[c], value)) {
        throw InputError(place + "column " + table.names[c] + " is '" + cells[c] +
                         "': give a finite number");
      }
      row.push_back(value);
    }
    table.rows.push_back(std::move(row));
    table.line.push_back(line);
  }
  if (table.rows.empty()) throw InputError(path + ": no rows: give one row a pose");
  return table;
}

// index of the one column with one of these names; none if absent
std::optional<std::size_t> columnOf(const Table& table, const std::string& path,
                                    const std::vector<std::string>& names) {
  std::optional<std::size_t> found;
  for (std::size_t c = 0; c < table.names.size(); ++c) {
    if (std::find(names.begin(), names.end(), table.names[c]) == names.end()) continue;
    if (found) throw InputError(path + ":1: column " + table.names[c] + ": there are two such");
    found = c;
  }
  return found;
}

std::size_t needColumn(const Table& table, const std::string& path, const std::string& name) {
  const auto column = columnOf(table, path, {name});
  if (!column) throw InputError(path + ":1: column " + name + " is missing: add it");
  return *column;
}

struct Poses {
  std::vector<StaticPose> values;
  bool ordered = false;
};

Poses readPoses(const std::string& path) {
  const Table table = readTable(path, {"x", "y", "z", "qx", "qy", "qz", "qw"}, {"order"});
  std::array<std::size_t, 4> q{};
  const std::array<const char*, 4> names = {"qx", "qy", "qz", "qw"};
  for (std::size_t k = 0; k < 4; ++k) q[k] = needColumn(table, path, names[k]);
  const auto order = columnOf(table, path, {"order", "index", "time", "t"});
  const auto temperature = columnOf(table, path, {"temperature"});
  Poses out;
  out.ordered = order.has_value();
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::vector<double>& row = table.rows[i];
    Eigen::Quaterniond rotation(row[q[3]], row[q[0]], row[q[1]], row[q[2]]);
    const double norm = rotation.norm();
    if (!(std::abs(norm - 1.0) < 0.01)) {
      throw InputError(path + ":" + std::to_string(table.line[i]) + ": quaternion has length " +
                       yamlNumber(norm) + ": give a unit quaternion qx,qy,qz,qw");
    }
    StaticPose pose;
    pose.R = rotation.normalized().toRotationMatrix();
    pose.order = order ? row[*order] : static_cast<double>(i);
    if (temperature) pose.temperature = row[*temperature];
    out.values.push_back(pose);
  }
  return out;
}

struct Wrenches {
  std::vector<Vector6> values;
  std::vector<double> temperature;
  bool header = false;
};

Wrenches readWrenches(const std::string& path) {
  const std::vector<std::string> names = {"fx", "fy", "fz", "tx", "ty", "tz"};
  const Table table = readTable(path, names, {});
  Wrenches out;
  out.header = table.header;
  const auto temperature = columnOf(table, path, {"temperature"});
  for (const std::vector<double>& row : table.rows) {
    Vector6 w;
    for (std::size_t k = 0; k < 6; ++k) {
      w[static_cast<Eigen::Index>(k)] = row[needColumn(table, path, names[k])];
    }
    out.values.push_back(w);
    if (temperature) out.temperature.push_back(row[*temperature]);
  }
  return out;
}

// ---- YAML

template <typename Values>
std::string list(const Values& values) {
  std::string text;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    text += (i == 0 ? "" : ", ") + yamlNumber(values[i]);
  }
  return "[" + text + "]";
}

template <typename Items, typename Text>
std::string items(const Items& values, Text text_of) {
  std::string text;
  for (const auto& value : values) text += (text.empty() ? "" : ", ") + text_of(value);
  return "[" + text + "]";
}

std::string rowMajor(const Eigen::MatrixXd& m) {
  std::string data;
  for (Eigen::Index r = 0; r < m.rows(); ++r) {
    for (Eigen::Index c = 0; c < m.cols(); ++c) {
      data += (data.empty() ? "" : ", ") + yamlNumber(m(r, c));
    }
  }
  return "{rows: " + std::to_string(m.rows()) + ", cols: " + std::to_string(m.cols()) +
         ", data: [" + data + "]}";
}

const std::array<const char*, 6> kAxisNames = {"fx", "fy", "fz", "tx", "ty", "tz"};

void printTests(std::ostream& out, const char* name, const std::array<SequenceTest, 6>& tests) {
  const auto column = [&](auto member) {
    return items(tests, [&](const SequenceTest& t) { return yamlNumber(t.*member); });
  };
  out << "  " << name << ": {lag1: " << column(&SequenceTest::lag1)
      << ", lag1_p: " << column(&SequenceTest::lag1_p)
      << ", runs_p: " << column(&SequenceTest::runs_p) << "}\n";
}

std::string number(double value) {
  std::ostringstream text;
  text.precision(3);
  text << value;
  return text.str();
}

// what was found, in words
std::vector<std::string> findings(const PayloadModel& m) {
  std::vector<std::string> out;
  if (!m.structure_tested) {
    out.push_back("too few poses to test for drift and breaks (16 needed): bias taken as constant");
    return out;
  }
  for (const BiasBreak& b : m.breaks) {
    out.push_back("bias breaks before pose " + std::to_string(b.pose) + ": a new recording begins");
  }
  for (std::size_t a = 0; a < 6; ++a) {
    const DriftShape shape = m.group[a / 3].component[a % 3].shape;
    if (shape == DriftShape::kNone) continue;
    std::string text =
        std::string("bias drifts in sensor ") + kAxisNames[a] + " (" + toString(shape) + "):";
    for (std::size_t r = 0; r < m.drift[a].size(); ++r) {
      text += (r == 0 ? " " : ", then ") + number(m.drift[a][r].change) + " +- " +
              number(m.drift[a][r].sd);
    }
    out.push_back(text + (a < 3 ? " N" : " N m"));
  }
  for (std::size_t a = 0; a < 6; ++a) {
    if (!m.group[a / 3].component[a % 3].temperature) continue;
    const auto k = static_cast<Eigen::Index>(a);
    out.push_back(std::string("bias follows temperature in sensor ") + kAxisNames[a] + ": " +
                  number(m.temperature_coefficient[k]) + " +- " + number(m.temperature_sd[k]) +
                  " per K");
  }
  if (!m.rejected.empty()) {
    out.push_back(std::to_string(m.rejected.size()) +
                  " poses do not fit the others and were left out");
  }
  if (out.empty()) out.push_back("no drift, no break, no outlier");
  return out;
}

void printModel(std::ostream& out, const PayloadModel& m, bool holdout) {
  out << "status: ok\n";
  out << "axes: " << toString(m.axes) << "\n";
  out << "axes_residual: {base: " << yamlNumber(m.base_residual)
      << ", sensor: " << yamlNumber(m.sensor_residual) << "}\n";
  out << "poses: " << m.used.size() << "\n";
  out << "rejected: " << items(m.rejected, [](std::size_t i) { return std::to_string(i); }) << "\n";
  out << "weight: " << yamlNumber(m.weight) << "\n";
  out << "weight_sd: " << yamlNumber(m.weight_sd) << "\n";
  out << "weight_vector: " << list(m.gravity) << "\n";
  out << "weight_covariance: " << rowMajor(m.gravity_covariance) << "\n";
  out << "gravity_direction: " << list(Eigen::Vector3d(m.gravity / m.weight)) << "\n";
  out << "center_of_mass: " << list(m.center_of_mass) << "\n";
  out << "center_of_mass_sd: " << list(Eigen::Vector3d(m.center_covariance.diagonal().cwiseSqrt()))
      << "\n";
  out << "center_of_mass_covariance: " << rowMajor(m.center_covariance) << "\n";
  out << "bias: " << list(m.bias) << "\n";
  out << "bias_sd: " << list(m.bias_sd) << "\n";
  out << "bias_last: " << list(m.last_bias) << "\n";
  out << "bias_last_sd: " << list(m.last_bias_sd) << "\n";

  out << "drift:\n";
  bool significant = false;
  for (std::size_t a = 0; a < 6; ++a) {
    const BiasComponent& c = m.group[a / 3].component[a % 3];
    significant = significant || c.shape != DriftShape::kNone;
  }
  out << "  significant: " << (significant ? "true" : "false") << "\n";
  for (std::size_t a = 0; a < 6; ++a) {
    const BiasComponent& c = m.group[a / 3].component[a % 3];
    out << "  " << kAxisNames[a] << ": {shape: " << toString(c.shape) << ", change: "
        << items(m.drift[a], [](const DriftSize& d) { return yamlNumber(d.change); })
        << ", change_sd: " << items(m.drift[a], [](const DriftSize& d) { return yamlNumber(d.sd); })
        << ", likelihood_ratio: " << yamlNumber(c.drift_gain) << ", noise: " << yamlNumber(c.noise)
        << "}\n";
  }
  if (m.breaks.empty()) {
    out << "breaks: []\n";
  } else {
    out << "breaks:\n";
    for (const BiasBreak& b : m.breaks) {
      out << "  - {pose: " << b.pose << ", order: " << yamlNumber(b.order)
          << ", jump: " << list(b.jump) << ", jump_sd: " << list(b.jump_sd)
          << ", criterion_gain: " << yamlNumber(b.gain) << "}\n";
    }
  }
  if (m.has_temperature) {
    out << "temperature: {mean: " << yamlNumber(m.temperature_mean)
        << ", coefficient: " << list(m.temperature_coefficient)
        << ", sd: " << list(m.temperature_sd) << "}\n";
  } else {
    out << "temperature: null\n";
  }
  out << "residual_rms: {force: " << yamlNumber(m.force_rms)
      << ", torque: " << yamlNumber(m.torque_rms) << "}\n";
  out << "plain_rms: {force: " << yamlNumber(m.plain_force_rms)
      << ", torque: " << yamlNumber(m.plain_torque_rms) << "}\n";
  out << "held_out_rms: {force: " << yamlNumber(m.held_out_force_rms)
      << ", torque: " << yamlNumber(m.held_out_torque_rms) << "}\n";
  if (holdout) {
    out << "held_out:\n";
    for (std::size_t i = 0; i < m.used.size(); ++i) {
      out << "  - {pose: " << m.used[i] << ", error: " << list(m.held_out[i]) << "}\n";
    }
  }
  out << "tests:\n  structure: " << (m.structure_tested ? "true" : "false") << "\n";
  printTests(out, "plain", m.plain_test);
  printTests(out, "final", m.final_test);
  out << "findings:\n";
  for (const std::string& text : findings(m)) out << "  - \"" << text << "\"\n";
}

void printInSitu(std::ostream& out, const InSituCorrection& c) {
  out << "in_situ:\n  given: " << (c.given ? "true" : "false") << "\n  reason: \"" << c.reason
      << "\"\n  p: " << yamlNumber(c.p) << "\n  largest_sd: " << yamlNumber(c.largest_sd)
      << "\n  matrix: " << (c.given ? rowMajor(c.matrix) : "null") << "\n";
}

void writeFile(const std::string& path, const std::string& text) {
  std::ofstream file(path);
  file << text;
  file.close();
  if (!file) throw InputError(path + ": cannot be written: give a place that can");
}

std::string csvRow(const Vector6& w) {
  std::string text;
  for (int k = 0; k < 6; ++k) text += (k == 0 ? "" : ",") + yamlNumber(w[k]);
  return text;
}

void traceTo(const std::string& path, const PayloadModel& m, const std::vector<StaticPose>& poses) {
  std::string text = "pose,order";
  for (const char* kind : {"bias_", "sd_", "residual_"}) {
    for (const char* axis : kAxisNames) text += std::string(",") + kind + axis;
  }
  text += "\n";
  for (std::size_t i = 0; i < m.used.size(); ++i) {
    const PredictedWrench b = predictBias(m, m.order[i], poses[m.used[i]].temperature);
    text += std::to_string(m.used[i]) + "," + yamlNumber(m.order[i]) + "," + csvRow(b.wrench) +
            "," + csvRow(b.sd) + "," + csvRow(m.residual[i]) + "\n";
  }
  writeFile(path, text);
}

int run(const Options& options, std::ostream& out) {
  Poses poses = readPoses(options.poses);
  const Wrenches wrenches = readWrenches(options.wrenches);
  if (poses.values.size() != wrenches.values.size()) {
    throw InputError(options.wrenches + ": " + std::to_string(wrenches.values.size()) +
                     " rows for " + std::to_string(poses.values.size()) + " poses of " +
                     options.poses + ": give one wrench a pose");
  }
  for (std::size_t i = 0; i < wrenches.temperature.size(); ++i) {
    poses.values[i].temperature = wrenches.temperature[i];
  }
  Poses further;
  if (!options.predict.empty()) further = readPoses(options.predict);

  const PayloadModel model = identifyPayload(poses.values, wrenches.values, options.payload);
  if (!model.refusal.empty()) {
    out << "status: refused\nreason: \"" << model.refusal << "\"\n";
    return 1;
  }
  printModel(out, model, options.holdout);
  if (options.payload.in_situ) printInSitu(out, model.in_situ);
  if (!options.trace.empty()) traceTo(options.trace, model, poses.values);
  if (options.predict.empty()) return 0;

  // without an order row k lies between poses k and k + 1
  const std::vector<StaticPose>& given = poses.values;
  const double step = (given.back().order - given.front().order) /
                      static_cast<double>(std::max<std::size_t>(given.size() - 1, 1));
  std::string csv = wrenches.header ? "fx,fy,fz,tx,ty,tz\n" : "";
  out << "prediction:\n";
  for (std::size_t k = 0; k < further.values.size(); ++k) {
    StaticPose pose = further.values[k];
    if (!further.ordered) {
      pose.order =
          k + 1 < given.size()
              ? 0.5 * (given[k].order + given[k + 1].order)
              : given.back().order +
                    (static_cast<double>(k + 1) + 0.5 - static_cast<double>(given.size())) * step;
    }
    const PredictedWrench w = predictWrench(model, pose);
    out << "  - {order: " << yamlNumber(pose.order) << ", wrench: " << list(w.wrench)
        << ", sd: " << list(w.sd) << "}\n";
    csv += csvRow(w.wrench) + "\n";
  }
  if (!options.output.empty()) writeFile(options.output, csv);
  return 0;
}

}  // namespace

int payloadCommand(const std::vector<std::string>& arguments, std::ostream& out,
                   std::ostream& messages) {
  try {
    const Options options = parseOptions(arguments);
    if (options.help) {
      out << kHelp;
      return 0;
    }
    std::ostringstream text;
    const int code = run(options, text);
    out << text.str();
    return code;
  } catch (const InputError& error) {
    messages << "calibrate payload: " << error.what() << "\n";
    return 2;
  }
}

int payloadCommand(int argc, char** argv) {
  return payloadCommand({argv + std::min(argc, 1), argv + argc}, std::cout, std::cerr);
}

}  // namespace assembly_cell
