// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Reads observation files, YAML and CSV. Every refusal names file, line and key.
#include <yaml-cpp/yaml.h>

#include <Eigen/LU>
#include <cmath>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/file_kind.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "observation_text.h"

namespace assembly_cell {

namespace {

class Reader {
 public:
  Reader(const YAML::Node& node, std::string source, std::string path)
      : node_(node), source_(std::move(source)), path_(std::move(path)) {}

  [[noreturn]] void refuse(const std::string& key, const std::string& what) const {
    // a node that was not parsed has no line
    const int line = node_.IsDefined() ? node_.Mark().line + 1 : 0;
    throw InputError(source_ + (line > 0 && !single_ ? ":" + std::to_string(line) : "") + ": " +
                     path_ + (path_.empty() || key.empty() ? "" : ".") + key + " " + what);
  }

  /// at the key's own line, with its value
  [[noreturn]] void refuseValue(const std::string& key, const std::string& what) const {
    const Reader entry = at(key);
    const YAML::Node& node = entry.node_;
    std::string value = node.IsScalar() ? node.Scalar() : "";
    for (std::size_t i = 0; node.IsSequence() && i < node.size(); ++i) {
      value += (i == 0 ? "" : ", ") + (node[i].IsScalar() ? node[i].Scalar() : std::string("?"));
    }
    entry.refuse("", "is '" + value + "': " + what);
  }

  void keys(const std::set<std::string>& allowed) const {
    if (!node_.IsMap())
      refuse("", "is not a mapping: see docs/how_to/calibration.md for the format");
    std::set<std::string> seen;
    for (const auto& item : node_) {
      const std::string key = item.first.IsScalar() ? item.first.Scalar() : "?";
      if (allowed.count(key) == 0) refuse(key, "is no known key: remove or correct it");
      if (!seen.insert(key).second) refuse(key, "is there twice: remove one");
    }
  }

  bool has(const std::string& key) const { return node_[key].IsDefined(); }
  Reader at(const std::string& key) const {
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

  std::string text(const std::string& key) const {
    const Reader entry = at(key);
    if (!entry.node_.IsScalar()) refuse(key, "is no text: give one line");
    return entry.node_.Scalar();
  }
  double number(const std::string& key) const { return at(key).value(); }
  double number(const std::string& key, double fallback) const {
    return has(key) ? number(key) : fallback;
  }
  long integer(const std::string& key) const {
    long value = 0;
    if (!parseInteger(text(key), value)) {
      refuse(key, "is '" + text(key) + "': give a whole number");
    }
    return value;
  }
  bool flag(const std::string& key) const {
    bool value = false;
    if (!YAML::convert<bool>::decode(at(key).node_, value))
      refuse(key, "is neither true nor false");
    return value;
  }
  std::vector<double> numbers(const std::string& key) const {
    const Reader entry = at(key);
    std::vector<double> values;
    for (std::size_t i = 0; i < entry.size(); ++i) values.push_back(entry.at(i).value());
    return values;
  }
  template <int rows, int cols = 1>
  Eigen::Matrix<double, rows, cols> matrix(const std::string& key) const {
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

Reading readReading(const Reader& in, const SensorDescription& sensor) {
  in.keys({"volts", "variance", "covariance", "samples", "saturated", "noise", "spread",
           "temperature"});
  Reading r;
  r.volts = in.matrix<6>("volts");
  if (in.has("samples")) {
    const long samples = in.integer("samples");
    if (samples < 1 || samples > 1000000000) in.refuseValue("samples", "give 1 at least");
    r.samples = static_cast<int>(samples);
  }
  if (in.has("saturated")) {
    const long bits = in.integer("saturated");
    if (bits < 0 || bits > 63) in.refuseValue("saturated", "a bit per channel: give 0 to 63");
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
    r.covariance.diagonal().setConstant(sensor.variance(sensor.noise, r.samples));
  }
  return r;
}

Pose readPose(const Reader& in) {
  Pose X;
  X.p = in.matrix<3>("position");
  const Eigen::Vector4d q = in.matrix<4>("quaternion");
  if (!(std::abs(q.norm() - 1.0) < 1e-3)) {
    in.refuseValue("quaternion", "give a unit quaternion x, y, z, w");
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
    if (bits < 4 || bits > 32) in.refuseValue("bits", "no converter's: give 10, 16 or 24");
    sensor.bits = static_cast<int>(bits);
  }
  sensor.full_scale = in.number("full_scale", sensor.full_scale);
  if (!(sensor.full_scale > 0.0)) in.refuseValue("full_scale", "give V above 0");
  sensor.noise = in.number("noise", sensor.noise);
  if (!(sensor.noise >= 0.0)) in.refuseValue("noise", "give V rms, at least 0");
  if (in.has("nominal")) {
    sensor.nominal = in.matrix<6, 6>("nominal");
    const Eigen::FullPivLU<Matrix6> lu(sensor.nominal);
    if (!lu.isInvertible()) in.refuse("nominal", "is singular: give volts to wrench, 36 numbers");
  }
  return sensor;
}

ReferenceAccuracy readAccuracy(const Reader& in) {
  ReferenceAccuracy accuracy;
  const FieldList list = fieldsOf(accuracy);
  std::set<std::string> names;
  for (const Field& field : list) names.insert(field.path);
  in.keys(names);
  for (const Field& field : list) {
    *field.numbers = in.number(field.path, *field.numbers);
    if (!(*field.numbers >= 0.0)) {
      in.refuseValue(field.path, "give a standard deviation, at least 0");
    }
  }
  if (!(accuracy.gauge > 0.0)) in.refuse("gauge", "is 0: give a standard deviation in m");
  return accuracy;
}

GaugeLayout readLayout(const Reader& in) {
  in.keys({"half_distance", "gauges", "faces"});
  if (in.has("half_distance")) {
    if (in.has("gauges")) in.refuse("gauges", "is there besides half_distance: give one of them");
    const double D = in.number("half_distance");
    if (!(D > 0.0)) in.refuseValue("half_distance", "give a distance above 0 in m");
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
      g.refuseValue("axis", "give a unit vector");
    const long face = g.integer("face");
    if (face < 0 || face > 2) g.refuseValue("face", "give 0, 1 or 2");
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
        f.refuseValue("normal", "give a unit vector");
      }
    }
  }
  return layout;
}

Observation readObservation(const Reader& in, const ObservationSet& set) {
  if (!in.has("kind")) in.refuse("kind", "is missing: say what was done");
  const auto kind = observationKind(in.text("kind"));
  if (!kind) in.refuse("kind", "is '" + in.text("kind") + "': give " + kObservationKinds);
  Observation o;
  o.kind = *kind;
  const std::set<std::string>& fields = keysOf(o.kind);
  std::set<std::string> keys = {"kind", "id", "stamp", "a", "b"};
  keys.insert(fields.begin(), fields.end());
  in.keys(keys);
  const auto needs = [&](const char* key) { return fields.count(key) > 0; };
  if (in.has("id")) o.id = in.text("id");
  o.stamp = in.number("stamp", 0.0);
  if (needs("sensor")) {
    const std::string side = in.text("sensor");
    if (side != "a" && side != "b") in.refuse("sensor", "is '" + side + "': give a or b");
    o.side = side == "a" ? Side::kA : Side::kB;
  }
  for (const Side side : kSides) {
    const std::string key = toString(side);
    if (in.has(key)) o.reading[side] = readReading(in.at(key), set.sensor[side]);
  }
  if (needs("position")) o.X_AB = readPose(in);
  if (in.has("pose_covariance")) o.X_covariance = in.matrix<6, 6>("pose_covariance");
  if (needs("mass")) o.mass = in.number("mass");
  if (needs("direction")) {
    o.direction = in.matrix<3>("direction");
    if (!(std::abs(o.direction.norm() - 1.0) < kUnitTolerance)) {
      in.refuseValue("direction", "give the unit vector of gravity in sensor axes");
    }
  }
  if (needs("point")) o.point = in.matrix<3>("point");
  if (in.has("gauges")) o.gauges = in.numbers("gauges");
  if (in.has("displacement")) o.displacement = in.matrix<6>("displacement");
  if (needs("load")) o.load = in.number("load");
  if (needs("channel")) {
    const long channel = in.integer("channel");
    if (channel < 0 || channel > 5) in.refuseValue("channel", "give 0 to 5");
    o.channel = static_cast<int>(channel);
  }
  if (in.has("point_at_rest")) o.point_at_rest = in.flag("point_at_rest");
  return o;
}

// `more`: further keys that are allowed
void readHeader(const Reader& in, std::set<std::string> more, ObservationSet& set) {
  more.insert({"sensor_a", "sensor_b", "gravity", "accuracy", "gauges_a", "gauges_b"});
  in.keys(more);
  for (const Side side : kSides) {
    if (in.has(sensorName(side))) set.sensor[side] = readSensor(in.at(sensorName(side)));
  }
  set.gravity = in.number("gravity", set.gravity);
  if (!(set.gravity > 0.0)) in.refuseValue("gravity", "give m/s2 above 0");
  if (in.has("accuracy")) set.accuracy = readAccuracy(in.at("accuracy"));
  for (const Side side : kSides) {
    const std::string key = std::string("gauges_") + toString(side);
    if (in.has(key)) set.gauges[side] = readLayout(in.at(key));
  }
}

YAML::Node parse(const std::string& content, const std::string& source) {
  if (const std::string why = tooDeep(content); !why.empty()) throw InputError(source + ": " + why);
  try {
    return YAML::Load(content);
  } catch (const YAML::Exception& error) {
    throw InputError(source + ":" + std::to_string(error.mark.line + 1) + ": " + error.msg +
                     ": mend the YAML");
  }
}

ObservationSet readYaml(const std::string& content, const std::string& path) {
  yaml::refuseXml(content, yaml::FileKind::kObservations, path);
  const YAML::Node root = parse(content, path);
  yaml::refuseOtherKind(root, yaml::FileKind::kObservations, path);
  const Reader in(root, path, "");
  if (!root.IsMap() || !in.has("format") || in.text("format") != kObservationFormat) {
    throw InputError(path + ": no observation file: its format must be '" + kObservationFormat +
                     "'");
  }
  ObservationSet set;
  readHeader(in, {"format", "observations"}, set);
  if (in.has("observations") && root["observations"].IsNull()) return set;
  const Reader list = in.at("observations");
  for (std::size_t i = 0; i < list.size(); ++i) {
    set.observations.push_back(readObservation(list.at(i), set));
    const std::string place = path + ": observations[" + std::to_string(i) + "]";
    checkObservation(set.observations.back(), set, place);
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
          throw InputError(place + ": column '" + name +
                           "' is not known: see docs/how_to/calibration.md");
        }
      }
      if (std::set<std::string>(header.begin(), header.end()).size() != header.size()) {
        throw InputError(place + ": a column is there twice: remove one");
      }
      // comments above the header carry the sensors, as in YAML
      const YAML::Node top = parse(head, path);
      if (top.IsMap()) {
        readHeader(Reader(top, path, ""), {}, set);
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

std::string contentOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream buffer;
  if (!file || !(buffer << file.rdbuf())) {
    throw InputError("observation file '" + path + "' can't be read or is empty: give a file");
  }
  return buffer.str();
}

bool endsWith(const std::string& path, const std::string& ending) {
  return path.size() > ending.size() &&
         path.compare(path.size() - ending.size(), ending.size(), ending) == 0;
}

}  // namespace

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

ObservationSet readObservations(const std::string& path) {
  std::string content =
      endsWith(path, ".bag") ? textFromBag("observations", path) : contentOf(path);
  if (content.rfind("\xEF\xBB\xBF", 0) == 0) content.erase(0, 3);
  return endsWith(path, ".csv") ? readCsv(content, path) : readYaml(content, path);
}

}  // namespace assembly_cell
