// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/observation.h"

#include <yaml-cpp/yaml.h>

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include "assembly_cell/scene/csv_text.h"
#include "assembly_cell/scene/input_error.h"
#include "assembly_cell/scene/yaml_text.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/calibration.h"
#include "assembly_cell/sensor/statistics.h"

namespace assembly_cell {

namespace {

constexpr const char* kFormat = "assembly_cell observations 1";
constexpr std::array<const char*, 6> kKinds = {"unloaded",    "reacting",     "weight",
                                               "indentation", "displacement", "linearity"};
constexpr double kUnitTolerance = 1e-6;  // of directions and quaternions as written by people
constexpr double kUnsettled = 5.0;       // spread over noise of one sample
constexpr int kEnoughForNoise = 30;      // samples from which noise is estimated

// ---- text out ----

template <typename Derived>
std::string list(const Eigen::MatrixBase<Derived>& m) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      out += (i + j > 0 ? ", " : "") + yamlNumber(m(i, j));
    }
  }
  return out + "]";
}

std::string readingText(const Reading& r) {
  const Vector6 diagonal = r.covariance.diagonal();
  const bool independent = r.covariance == Matrix6(diagonal.asDiagonal());
  std::string out =
      "{volts: " + list(r.volts) +
      (independent ? ", variance: " + list(diagonal) : ", covariance: " + list(r.covariance)) +
      ", samples: " + std::to_string(r.samples) + ", saturated: " + std::to_string(r.saturated);
  if (!r.noise.isZero(0.0)) out += ", noise: " + list(r.noise);
  if (!r.spread.isZero(0.0)) out += ", spread: " + list(r.spread);
  if (std::isfinite(r.temperature)) out += ", temperature: " + yamlNumber(r.temperature);
  return out + "}";
}

std::string layoutText(const GaugeLayout& layout) {
  std::string out = "{gauges: [";
  for (std::size_t k = 0; k < layout.gauges.size(); ++k) {
    const DialGauge& g = layout.gauges[k];
    out += std::string(k > 0 ? ", " : "") + "{point: " + list(g.point.transpose()) +
           ", axis: " + list(g.axis.transpose()) + ", face: " + std::to_string(g.face) + "}";
  }
  out += "], faces: [";
  for (std::size_t k = 0; k < 3; ++k) {
    out += std::string(k > 0 ? ", " : "") + "{normal: " + list(layout.faces[k].normal.transpose()) +
           ", offset: " + yamlNumber(layout.faces[k].offset) + "}";
  }
  return out + "]}";
}

// ---- text in: every refusal names file, line and key ----

class Reader {
 public:
  Reader(const YAML::Node& node, std::string source, std::string path)
      : node_(node), source_(std::move(source)), path_(std::move(path)) {}

  [[noreturn]] void refuse(const std::string& key, const std::string& what) const {
    // a node made by hand has no place in the file
    const int line = node_.IsDefined() ? node_.Mark().line + 1 : 0;
    throw InputError(source_ + (line > 0 && !single_ ? ":" + std::to_string(line) : "") + ": " +
                     path_ + (path_.empty() || key.empty() ? "" : ".") + key + " " + what);
  }

  void keys(const std::set<std::string>& allowed) const {
    if (!node_.IsMap()) refuse("", "is not a mapping: see docs/calibration.md for the format");
    std::set<std::string> seen;
    for (const auto& item : node_) {
      const std::string key = item.first.IsScalar() ? item.first.Scalar() : "?";
      if (allowed.count(key) == 0) refuse(key, "is no known key: remove or correct it");
      if (!seen.insert(key).second) refuse(key, "is there twice: remove one");
    }
  }

  bool has(const char* key) const { return node_[key].IsDefined(); }
  Reader at(const char* key) const {
    if (!has(key)) refuse(key, "is missing: add it");
    return {node_[key], source_, join(key), single_};
  }
  Reader at(std::size_t i) const {
    return {node_[i], source_, path_ + "[" + std::to_string(i) + "]", single_};
  }
  std::size_t size() const {
    if (!node_.IsSequence()) refuse("", "is no list: give one");
    return node_.size();
  }

  std::string text(const char* key) const {
    const Reader entry = at(key);
    if (!entry.node_.IsScalar()) refuse(key, "is no text: give one line");
    return entry.node_.Scalar();
  }
  double number(const char* key) const { return at(key).value(); }
  double number(const char* key, double fallback) const {
    return has(key) ? number(key) : fallback;
  }
  long integer(const char* key) const {
    long value = 0;
    if (!parseInteger(text(key), value)) {
      refuse(key, "is '" + text(key) + "': give a whole number");
    }
    return value;
  }
  bool flag(const char* key) const {
    bool value = false;
    if (!YAML::convert<bool>::decode(at(key).node_, value))
      refuse(key, "is neither true nor false");
    return value;
  }
  std::vector<double> numbers(const char* key) const {
    const Reader entry = at(key);
    std::vector<double> values;
    for (std::size_t i = 0; i < entry.size(); ++i) values.push_back(entry.at(i).value());
    return values;
  }
  template <int rows, int cols = 1>
  Eigen::Matrix<double, rows, cols> matrix(const char* key) const {
    const std::vector<double> values = numbers(key);
    if (values.size() != rows * cols) {
      refuse(key, "has " + std::to_string(values.size()) + " entries: give " +
                      std::to_string(rows * cols));
    }
    return Eigen::Map<const Eigen::Matrix<double, cols, rows>>(values.data()).transpose();
  }

  void single() { single_ = true; }

 private:
  Reader(const YAML::Node& node, std::string source, std::string path, bool single)
      : node_(node), source_(std::move(source)), path_(std::move(path)), single_(single) {}

  std::string join(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

  double value() const {
    double number = 0.0;
    if (!node_.IsScalar() || !parseNumber(node_.Scalar(), number)) {
      refuse("", "is '" + (node_.IsScalar() ? node_.Scalar() : std::string("no scalar")) +
                     "': give a finite number");
    }
    return number;
  }

  const YAML::Node node_;
  std::string source_, path_;
  bool single_ = false;
};

double quantum(const SensorDescription& sensor) {
  const double q = sensor.lsb();
  return q * q / 12.0;
}

// of the mean of n samples
double varianceOfMean(double noise, int samples, const SensorDescription& sensor) {
  const double one = noise * noise + quantum(sensor);
  return noise >= 0.5 * sensor.lsb() ? one / samples : one;
}

Reading readReading(const Reader& in, const SensorDescription& sensor) {
  in.keys({"volts", "variance", "covariance", "samples", "saturated", "noise", "spread",
           "temperature"});
  Reading r;
  r.volts = in.matrix<6>("volts");
  if (in.has("samples")) {
    const long samples = in.integer("samples");
    if (samples < 1 || samples > 1000000000) in.refuse("samples", "is not at least 1");
    r.samples = static_cast<int>(samples);
  }
  if (in.has("saturated")) {
    const long bits = in.integer("saturated");
    if (bits < 0 || bits > 63) in.refuse("saturated", "is no bit per channel: give 0 to 63");
    r.saturated = static_cast<std::uint8_t>(bits);
  }
  if (in.has("noise")) r.noise = in.matrix<6>("noise");
  if (in.has("spread")) r.spread = in.matrix<6>("spread");
  if (in.has("temperature")) r.temperature = in.number("temperature");
  if (in.has("variance") && in.has("covariance")) {
    in.refuse("variance", "is there besides covariance: give one of them");
  }
  if (in.has("covariance")) {
    r.covariance = in.matrix<6, 6>("covariance");
  } else if (in.has("variance")) {
    r.covariance = in.matrix<6>("variance").asDiagonal();
  } else {
    r.covariance.diagonal().setConstant(varianceOfMean(sensor.noise, r.samples, sensor));
  }
  return r;
}

Pose readPose(const Reader& in) {
  Pose X;
  X.p = in.matrix<3>("position");
  const Eigen::Vector4d q = in.matrix<4>("quaternion");
  if (!(std::abs(q.norm() - 1.0) < 1e-3)) {
    in.refuse("quaternion", "is not a unit quaternion x y z w");
  }
  X.R = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized().toRotationMatrix();
  return X;
}

SensorDescription readSensor(const Reader& in) {
  in.keys({"serial_number", "bits", "full_scale", "noise", "nominal"});
  SensorDescription sensor;
  if (in.has("serial_number")) sensor.serial_number = in.text("serial_number");
  if (in.has("bits")) {
    const long bits = in.integer("bits");
    if (bits < 4 || bits > 32) in.refuse("bits", "is no converter's: give 10, 16 or 24");
    sensor.bits = static_cast<int>(bits);
  }
  sensor.full_scale = in.number("full_scale", sensor.full_scale);
  if (!(sensor.full_scale > 0.0)) in.refuse("full_scale", "is not positive: give volts");
  sensor.noise = in.number("noise", sensor.noise);
  if (!(sensor.noise >= 0.0)) in.refuse("noise", "is negative: give volts rms");
  if (in.has("nominal")) {
    sensor.nominal = in.matrix<6, 6>("nominal");
    const Eigen::FullPivLU<Matrix6> lu(sensor.nominal);
    if (!lu.isInvertible()) in.refuse("nominal", "is singular: give volts to wrench, 36 numbers");
  }
  return sensor;
}

ReferenceAccuracy readAccuracy(const Reader& in) {
  in.keys({"direction", "mass", "point", "position", "rotation", "gauge"});
  ReferenceAccuracy accuracy;
  for (const auto& [key, value] : {std::pair{"direction", &accuracy.direction},
                                   {"mass", &accuracy.mass},
                                   {"point", &accuracy.point},
                                   {"position", &accuracy.position},
                                   {"rotation", &accuracy.rotation},
                                   {"gauge", &accuracy.gauge}}) {
    *value = in.number(key, *value);
    if (!(*value >= 0.0)) in.refuse(key, "is negative: give a standard deviation");
  }
  if (!(accuracy.gauge > 0.0)) in.refuse("gauge", "is 0: give a standard deviation in m");
  return accuracy;
}

GaugeLayout readLayout(const Reader& in) {
  in.keys({"half_distance", "gauges", "faces"});
  if (in.has("half_distance")) {
    if (in.has("gauges")) in.refuse("gauges", "is there besides half_distance: give one of them");
    const double D = in.number("half_distance");
    if (!(D > 0.0)) in.refuse("half_distance", "is not positive: give a distance in m");
    return thesisGauges(D);
  }
  GaugeLayout layout = thesisGauges();
  layout.gauges.clear();
  const Reader gauges = in.at("gauges");
  for (std::size_t k = 0; k < gauges.size(); ++k) {
    const Reader g = gauges.at(k);
    g.keys({"point", "axis", "face"});
    DialGauge gauge{g.matrix<3>("point"), g.matrix<3>("axis"), 0};
    if (!(std::abs(gauge.axis.norm() - 1.0) < kUnitTolerance))
      g.refuse("axis", "is no unit vector");
    const long face = g.integer("face");
    if (face < 0 || face > 2) g.refuse("face", "is none of 0, 1, 2");
    gauge.face = static_cast<int>(face);
    layout.gauges.push_back(gauge);
  }
  if (in.has("faces")) {
    const Reader faces = in.at("faces");
    if (faces.size() != 3) in.refuse("faces", "are not three");
    for (std::size_t k = 0; k < 3; ++k) {
      const Reader f = faces.at(k);
      f.keys({"normal", "offset"});
      layout.faces[k] = {f.matrix<3>("normal"), f.number("offset")};
      if (!(std::abs(layout.faces[k].normal.norm() - 1.0) < kUnitTolerance)) {
        f.refuse("normal", "is no unit vector");
      }
    }
  }
  return layout;
}

Observation readObservation(const Reader& in, const ObservationSet& set) {
  if (!in.has("kind")) in.refuse("kind", "is missing: say what was done");
  const std::string kind = in.text("kind");
  Observation o;
  std::size_t k = 0;
  while (k < kKinds.size() && kind != kKinds[k]) ++k;
  if (k == kKinds.size()) {
    in.refuse("kind", "is '" + kind +
                          "': give unloaded, reacting, weight, indentation, "
                          "displacement or linearity");
  }
  o.kind = static_cast<ObservationKind>(k);
  std::set<std::string> keys = {"kind", "id", "stamp", "a", "b"};
  const bool one_sided =
      o.kind != ObservationKind::kUnloaded && o.kind != ObservationKind::kReacting;
  if (one_sided) keys.insert("sensor");
  switch (o.kind) {
    case ObservationKind::kUnloaded:
      break;
    case ObservationKind::kReacting:
      keys.insert({"position", "quaternion", "pose_covariance"});
      break;
    case ObservationKind::kWeight:
      keys.insert({"mass", "direction", "point", "point_at_rest"});
      break;
    case ObservationKind::kIndentation:
      keys.insert({"point", "point_at_rest"});
      break;
    case ObservationKind::kDisplacement:
      keys.insert({"gauges", "displacement"});
      break;
    case ObservationKind::kLinearity:
      keys.insert({"load", "channel"});
      break;
  }
  in.keys(keys);
  if (in.has("id")) o.id = in.text("id");
  o.stamp = in.number("stamp", 0.0);
  if (one_sided) {
    const std::string side = in.text("sensor");
    if (side != "a" && side != "b") in.refuse("sensor", "is '" + side + "': give a or b");
    o.side = side == "a" ? Side::kA : Side::kB;
  }
  if (in.has("a")) o.a = readReading(in.at("a"), set.a);
  if (in.has("b")) o.b = readReading(in.at("b"), set.b);
  switch (o.kind) {
    case ObservationKind::kUnloaded:
      break;
    case ObservationKind::kReacting:
      o.X_AB = readPose(in);
      if (in.has("pose_covariance")) o.X_covariance = in.matrix<6, 6>("pose_covariance");
      break;
    case ObservationKind::kWeight:
      o.mass = in.number("mass");
      o.direction = in.matrix<3>("direction");
      o.point = in.matrix<3>("point");
      break;
    case ObservationKind::kIndentation:
      o.point = in.matrix<3>("point");
      break;
    case ObservationKind::kDisplacement:
      if (in.has("gauges")) o.gauges = in.numbers("gauges");
      if (in.has("displacement")) o.displacement = in.matrix<6>("displacement");
      break;
    case ObservationKind::kLinearity: {
      o.load = in.number("load");
      const long channel = in.integer("channel");
      if (channel < 0 || channel > 5) in.refuse("channel", "is none of 0 to 5");
      o.channel = static_cast<int>(channel);
      break;
    }
  }
  if (in.has("point_at_rest")) o.point_at_rest = in.flag("point_at_rest");
  return o;
}

void readHeader(const Reader& in, ObservationSet& set) {
  if (in.has("sensor_a")) set.a = readSensor(in.at("sensor_a"));
  if (in.has("sensor_b")) set.b = readSensor(in.at("sensor_b"));
  set.gravity = in.number("gravity", set.gravity);
  if (!(set.gravity > 0.0)) in.refuse("gravity", "is not positive: give m/s2");
  if (in.has("accuracy")) set.accuracy = readAccuracy(in.at("accuracy"));
  if (in.has("gauges_a")) set.gauges_a = readLayout(in.at("gauges_a"));
  if (in.has("gauges_b")) set.gauges_b = readLayout(in.at("gauges_b"));
}

YAML::Node parse(const std::string& content, const std::string& source) {
  try {
    return YAML::Load(content);
  } catch (const YAML::Exception& error) {
    throw InputError(source + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg +
                     ": mend the YAML");
  }
}

ObservationSet readYaml(const std::string& content, const std::string& path) {
  const YAML::Node root = parse(content, path);
  const Reader in(root, path, "");
  if (!root.IsMap() || !in.has("format") || in.text("format") != kFormat) {
    throw InputError(path + ": no observation file: its format must be '" + kFormat + "'");
  }
  in.keys({"format", "sensor_a", "sensor_b", "gravity", "accuracy", "gauges_a", "gauges_b",
           "observations"});
  ObservationSet set;
  readHeader(in, set);
  if (in.has("observations") && root["observations"].IsNull()) return set;
  const Reader list = in.at("observations");
  for (std::size_t i = 0; i < list.size(); ++i) {
    set.observations.push_back(readObservation(list.at(i), set));
    checkObservation(set.observations.back(), set,
                     path + ": observations[" + std::to_string(i) + "]");
  }
  return set;
}

// ---- CSV: a row becomes the same mapping ----

const std::set<std::string>& csvColumns() {
  static const std::set<std::string> columns = [] {
    std::set<std::string> names = {
        "kind", "id", "sensor", "stamp", "x",  "y",  "z",  "qx",   "qy",      "qz",           "qw",
        "mass", "gx", "gy",     "gz",    "px", "py", "pz", "load", "channel", "point_at_rest"};
    for (const std::string side : {"a", "b"}) {
      for (int k = 1; k <= 6; ++k) {
        names.insert(side + std::to_string(k));
        names.insert(side + std::to_string(k) + "_variance");
      }
      names.insert({side + "_samples", side + "_saturated", side + "_temperature"});
    }
    for (int k = 1; k <= 12; ++k) names.insert("gauge" + std::to_string(k));
    return names;
  }();
  return columns;
}

YAML::Node csvRow(const std::vector<std::string>& header, const std::vector<std::string>& row) {
  std::map<std::string, std::string> value;
  for (std::size_t k = 0; k < header.size(); ++k) {
    if (!row[k].empty()) value[header[k]] = row[k];
  }
  YAML::Node out(YAML::NodeType::Map);
  for (const char* key :
       {"kind", "id", "stamp", "sensor", "mass", "load", "channel", "point_at_rest"}) {
    if (value.count(key) > 0) out[key] = value[key];
  }
  const auto take = [&](YAML::Node node, const char* key, const std::vector<std::string>& names) {
    if (value.count(names.front()) == 0) return;
    for (const std::string& name : names) {
      node[key].push_back(value.count(name) > 0 ? value[name] : std::string());
    }
  };
  take(out, "position", {"x", "y", "z"});
  take(out, "quaternion", {"qx", "qy", "qz", "qw"});
  take(out, "direction", {"gx", "gy", "gz"});
  take(out, "point", {"px", "py", "pz"});
  for (int k = 1; value.count("gauge" + std::to_string(k)) > 0; ++k) {
    out["gauges"].push_back(value["gauge" + std::to_string(k)]);
  }
  for (const std::string side : {"a", "b"}) {
    if (value.count(side + "1") == 0) continue;
    YAML::Node reading(YAML::NodeType::Map);
    std::vector<std::string> volts, variance;
    for (int k = 1; k <= 6; ++k) {
      volts.push_back(side + std::to_string(k));
      variance.push_back(volts.back() + "_variance");
    }
    take(reading, "volts", volts);
    take(reading, "variance", variance);
    for (const char* key : {"samples", "saturated", "temperature"}) {
      if (value.count(side + "_" + key) > 0) reading[key] = value[side + "_" + key];
    }
    out[side] = reading;
  }
  return out;
}

ObservationSet readCsv(const std::string& content, const std::string& path) {
  ObservationSet set;
  std::vector<std::string> header;
  std::string head;
  std::stringstream in(content);
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    const std::string place = path + ":" + std::to_string(number);
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    if (line[0] == '#') {
      head += line.substr(1, line.find('\r') - 1) + "\n";
      continue;
    }
    const auto cells = csvCells(line, " \t\r\"");
    const std::vector<std::string> row(cells.begin(), cells.end());
    if (header.empty()) {
      header = row;
      for (const std::string& name : header) {
        if (csvColumns().count(name) == 0) {
          throw InputError(place + ": column '" + name + "' is not known: see docs/calibration.md");
        }
      }
      if (std::set<std::string>(header.begin(), header.end()).size() != header.size()) {
        throw InputError(place + ": a column is there twice: remove one");
      }
      // comments above the header carry the sensors, as in YAML
      const YAML::Node top = parse(head, path);
      if (top.IsMap()) {
        const Reader reader(top, path, "");
        reader.keys({"sensor_a", "sensor_b", "gravity", "accuracy", "gauges_a", "gauges_b"});
        readHeader(reader, set);
      } else if (!top.IsNull() && !top.IsScalar()) {
        throw InputError(path + ": comments above the header are no YAML mapping: give key: value");
      }
      continue;
    }
    if (row.size() != header.size()) {
      throw InputError(place + ": " + std::to_string(row.size()) + " columns: give " +
                       std::to_string(header.size()) + " as in the header");
    }
    const YAML::Node node = csvRow(header, row);
    Reader reader(node, place, "");
    reader.single();
    set.observations.push_back(readObservation(reader, set));
    checkObservation(set.observations.back(), set, place);
  }
  if (header.empty()) throw InputError(path + ": no header line: name the columns");
  return set;
}

bool covarianceIsSound(const Matrix6& m) {
  return m.allFinite() && m.diagonal().minCoeff() >= 0.0 &&
         (m - m.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * m.cwiseAbs().maxCoeff();
}

bool printable(const std::string& text) {
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return false;
  }
  return true;
}

}  // namespace

const char* toString(ObservationKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

const char* toString(Side side) { return side == Side::kA ? "a" : "b"; }

SensorDescription::SensorDescription() : nominal(strainMatrix(nominalBridge()).inverse()) {}

double SensorDescription::lsb() const { return 2.0 * full_scale * std::ldexp(1.0, -bits); }

Reading averageReading(const std::vector<Vector6>& volts,
                       const std::vector<std::uint8_t>& saturated,
                       const SensorDescription& sensor) {
  if (volts.empty() || volts.size() != saturated.size()) {
    throw InputError("reading: " + std::to_string(volts.size()) + " samples with " +
                     std::to_string(saturated.size()) + " flags: give at least one, as many each");
  }
  Moments moments;
  DifferenceNoise noise;
  Reading r;
  for (std::size_t i = 0; i < volts.size(); ++i) {
    if (!volts[i].allFinite()) throw InputError("reading: a sample is not finite: read it again");
    moments.add(volts[i]);
    noise.add(volts[i]);
    r.saturated = static_cast<std::uint8_t>(r.saturated | saturated[i]);
  }
  r.volts = moments.mean();
  r.spread = moments.sd();
  r.samples = static_cast<int>(volts.size());
  const bool enough = r.samples >= kEnoughForNoise;
  if (enough) r.noise = noise.rms();
  for (int k = 0; k < 6; ++k) {
    // differences of codes hold the quantisation already
    const double own =
        enough ? std::sqrt(std::max(r.noise[k] * r.noise[k] - quantum(sensor), 0.0)) : sensor.noise;
    r.covariance(k, k) = varianceOfMean(own, r.samples, sensor);
  }
  return r;
}

std::string unusable(const Reading& reading, const SensorDescription& sensor) {
  for (int k = 0; k < 6; ++k) {
    if ((reading.saturated >> k & 1) != 0) return "channel " + std::to_string(k) + " saturated";
    const double sample =
        std::sqrt(std::max(sensor.noise * sensor.noise, reading.noise[k] * reading.noise[k]) +
                  quantum(sensor));
    if (reading.spread[k] > kUnsettled * sample) {
      return "channel " + std::to_string(k) + " unsettled (spread " +
             yamlNumber(reading.spread[k]) + " V, noise " + yamlNumber(sample) + " V)";
    }
  }
  return "";
}

void checkObservation(const Observation& o, const ObservationSet& set, const std::string& source) {
  const auto refuse = [&](const std::string& what) { throw InputError(source + ": " + what); };
  const bool both = o.kind == ObservationKind::kReacting;
  const bool unloaded = o.kind == ObservationKind::kUnloaded;
  if (!printable(o.id)) refuse("id holds control characters: give one line");
  if (!std::isfinite(o.stamp)) refuse("stamp is not finite: give s");
  if (both && (!o.a || !o.b)) refuse("a reading of a sensor is missing: reacting needs a and b");
  if (unloaded && !o.a && !o.b) refuse("no reading: give a, b or both");
  if (!both && !unloaded && !(o.side == Side::kA ? o.a : o.b)) {
    refuse(std::string("reading ") + toString(o.side) + " is missing: add it");
  }
  for (const auto& reading : {o.a, o.b}) {
    if (!reading) continue;
    if (!reading->volts.allFinite()) refuse("volts are not finite: read again");
    if (!covarianceIsSound(reading->covariance)) refuse("covariance of volts is none");
    if (!(reading->noise.minCoeff() >= 0.0) || !(reading->spread.minCoeff() >= 0.0) ||
        !reading->noise.allFinite() || !reading->spread.allFinite() || reading->samples < 1) {
      refuse("noise, spread or samples of a reading is not sound: give sizes and a count");
    }
  }
  if (both) {
    if (!o.X_AB.p.allFinite() || !o.X_AB.R.allFinite() ||
        !(o.X_AB.R.transpose() * o.X_AB.R).isIdentity(kUnitTolerance) ||
        !(o.X_AB.R.determinant() > 0.0)) {
      refuse("relative pose is no pose: give a position in m and a rotation");
    }
    if (o.X_covariance && !covarianceIsSound(*o.X_covariance)) refuse("pose covariance is none");
  }
  if (o.kind == ObservationKind::kWeight) {
    if (!(o.mass > 0.0) || !std::isfinite(o.mass)) {
      refuse("mass is " + yamlNumber(o.mass) + ": give kg, above 0");
    }
    if (!(std::abs(o.direction.norm() - 1.0) < kUnitTolerance)) {
      refuse("direction is no unit vector: give that of gravity in sensor axes");
    }
  }
  if (!o.point.allFinite()) refuse("point is not finite: give m");
  if (o.kind == ObservationKind::kDisplacement) {
    if (o.displacement.has_value() == !o.gauges.empty()) {
      refuse("give either gauges or displacement");
    }
    if (o.displacement && !o.displacement->allFinite()) refuse("displacement is not finite");
    const GaugeLayout& layout = o.side == Side::kA ? set.gauges_a : set.gauges_b;
    if (!o.gauges.empty() && o.gauges.size() != layout.gauges.size()) {
      refuse(std::to_string(o.gauges.size()) + " gauge readings but gauges_" + toString(o.side) +
             " has " + std::to_string(layout.gauges.size()) + ": give one of each");
    }
    for (const double s : o.gauges) {
      if (!std::isfinite(s)) refuse("a gauge reading is not finite: give m");
    }
  }
  if (o.kind == ObservationKind::kLinearity &&
      (!std::isfinite(o.load) || o.channel < 0 || o.channel > 5)) {
    refuse("load is not finite or channel none of 0 to 5");
  }
}

std::string observationLine(const Observation& o) {
  std::string out = std::string("- {kind: ") + toString(o.kind);
  if (!o.id.empty()) out += ", id: " + yamlQuoted(o.id);
  out += ", stamp: " + yamlNumber(o.stamp);
  if (o.kind != ObservationKind::kUnloaded && o.kind != ObservationKind::kReacting) {
    out += std::string(", sensor: ") + toString(o.side);
  }
  switch (o.kind) {
    case ObservationKind::kUnloaded:
      break;
    case ObservationKind::kReacting: {
      Eigen::Quaterniond q(o.X_AB.R);
      q.normalize();
      if (q.w() < 0.0) q.coeffs() = -q.coeffs();
      out += ", position: " + list(o.X_AB.p.transpose()) +
             ", quaternion: " + list(q.coeffs().transpose());
      if (o.X_covariance) out += ", pose_covariance: " + list(*o.X_covariance);
      break;
    }
    case ObservationKind::kWeight:
      out += ", mass: " + yamlNumber(o.mass) + ", direction: " + list(o.direction.transpose()) +
             ", point: " + list(o.point.transpose());
      break;
    case ObservationKind::kIndentation:
      out += ", point: " + list(o.point.transpose());
      break;
    case ObservationKind::kDisplacement:
      if (o.displacement) out += ", displacement: " + list(o.displacement->transpose());
      if (!o.gauges.empty()) {
        out += ", gauges: " + list(Eigen::Map<const Eigen::RowVectorXd>(
                                  o.gauges.data(), static_cast<Eigen::Index>(o.gauges.size())));
      }
      break;
    case ObservationKind::kLinearity:
      out += ", load: " + yamlNumber(o.load) + ", channel: " + std::to_string(o.channel);
      break;
  }
  if (o.point_at_rest) out += ", point_at_rest: true";
  if (o.a) out += ", a: " + readingText(*o.a);
  if (o.b) out += ", b: " + readingText(*o.b);
  return out + "}";
}

std::string observationHeader(const ObservationSet& set) {
  const auto sensor = [](const SensorDescription& s) {
    return "{serial_number: " + yamlQuoted(s.serial_number) + ", bits: " + std::to_string(s.bits) +
           ", full_scale: " + yamlNumber(s.full_scale) + ", noise: " + yamlNumber(s.noise) +
           ",\n  nominal: " + list(s.nominal) + "}\n";
  };
  const ReferenceAccuracy& r = set.accuracy;
  std::string out =
      std::string("format: ") + kFormat + "\nsensor_a: " + sensor(set.a) +
      "sensor_b: " + sensor(set.b) + "gravity: " + yamlNumber(set.gravity) +
      "\naccuracy: {direction: " + yamlNumber(r.direction) + ", mass: " + yamlNumber(r.mass) +
      ", point: " + yamlNumber(r.point) + ", position: " + yamlNumber(r.position) +
      ", rotation: " + yamlNumber(r.rotation) + ", gauge: " + yamlNumber(r.gauge) + "}\n";
  if (!set.gauges_a.gauges.empty()) out += "gauges_a: " + layoutText(set.gauges_a) + "\n";
  if (!set.gauges_b.gauges.empty()) out += "gauges_b: " + layoutText(set.gauges_b) + "\n";
  return out + "observations:\n";
}

Observation parseObservation(const std::string& line, const ObservationSet& set,
                             const std::string& source) {
  const YAML::Node root = parse(line, source);
  if (!root.IsSequence() || root.size() != 1) {
    throw InputError(source + ": no observation: give one line '- {kind: ...}'");
  }
  Reader reader(root[0], source, "");
  reader.single();
  Observation o = readObservation(reader, set);
  checkObservation(o, set, source);
  return o;
}

ObservationSet readObservations(const std::string& path, bool* torn) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream buffer;
  if (!file || !(buffer << file.rdbuf())) {
    throw InputError("observation file '" + path + "' can't be read or is empty: give a file");
  }
  std::string content = buffer.str();
  if (content.rfind("\xEF\xBB\xBF", 0) == 0) content.erase(0, 3);
  if (torn != nullptr) *torn = false;
  const bool csv = path.size() > 4 && path.compare(path.size() - 4, 4, ".csv") == 0;
  const auto read = [&](const std::string& text) {
    return csv ? readCsv(text, path) : readYaml(text, path);
  };
  if (content.back() == '\n' || torn == nullptr) return read(content);
  // a whole last line may lack its end; one cut off is left out
  try {
    return read(content);
  } catch (const InputError&) {
    const std::size_t end = content.rfind('\n');
    if (end == std::string::npos) throw;
    ObservationSet set = read(content.substr(0, end + 1));
    *torn = true;
    return set;
  }
}

std::string observationsText(const ObservationSet& set) {
  std::string content = observationHeader(set);
  for (const Observation& o : set.observations) content += observationLine(o) + "\n";
  return content;
}

void writeObservations(const ObservationSet& set, const std::string& path) {
  writeFileAtomically(path, observationsText(set), "observation file '" + path + "'");
}

std::string observationsDigest(const ObservationSet& set) { return crcText(observationsText(set)); }

}  // namespace assembly_cell
