// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario_numbers.h"

namespace assembly_cell {
namespace {

using yaml::Range;
using yaml::Section;
using yaml::shown;

constexpr double kLargest = 1e9;
constexpr double kMaxTilt = 0.1;      // beyond this an oblique bore is no bore any more [rad]
constexpr double kMaxFaceTilt = 0.3;  // a start stays a start [rad]
constexpr double kMaxTurn = M_PI;     // of frames [rad]
constexpr double kMaxDelay = 1.0;     // of the exciter: drives answer within tens of ms [s]
constexpr double kMaxLatency = 0.1;   // samples are kept so long [s]
constexpr double kMaxScale = 0.5;     // of encoders
constexpr const char* kForms =
    "give a number, {normal: SD}, {uniform: [LOW, HIGH]} or {log_uniform: [LOW, HIGH]}";

// What a drawn number may be.
struct Limits {
  double mean = 0.0;  // of a normal draw
  double low = -kLargest, high = kLargest;
  bool above = false;  // low itself is not allowed
};
constexpr Limits kAnySize{};
constexpr Limits kNotNegative{0.0, 0.0, kLargest, false};

[[noreturn]] void refuseRange(const Section& in, const std::string& path, const std::string& value,
                              const Limits& limits) {
  std::string range =
      limits.above ? "above " + shown(limits.low) : "of at least " + shown(limits.low);
  if (limits.high < kLargest) range += " and at most " + shown(limits.high);
  in.refuse(path, value,
            "can draw what is not possible (normal draws within 5 SD), give draws " + range);
}

std::string shownDraw(const Draw& draw) {
  const std::string pair = "[" + shown(draw.first) + ", " + shown(draw.second) + "]";
  switch (draw.kind) {
    case Draw::Kind::kNormal:
      return "{normal: " + shown(draw.first) + "}";
    case Draw::Kind::kUniform:
      return "{uniform: " + pair + "}";
    case Draw::Kind::kLogUniform:
      return "{log_uniform: " + pair + "}";
    case Draw::Kind::kNumber:
      break;
  }
  return shown(draw.first);
}

void checkRange(const Section& in, const std::string& path, const Draw& draw,
                const Limits& limits) {
  const auto [low, high] = draw.reach(limits.mean);
  const bool low_enough = limits.above ? low > limits.low : low >= limits.low;
  if (!low_enough || high > limits.high) refuseRange(in, path, shownDraw(draw), limits);
}

Draw readBounds(Section& in, const std::string& kind) {
  const Eigen::Vector2d pair = in.numbers<2>(kind, Range::kAny);
  const bool logarithmic = kind == "log_uniform";
  if (!(pair[0] <= pair[1]) || (logarithmic && !(pair[0] > 0.0))) {
    in.refuse(in.at(kind), "[" + shown(pair[0]) + ", " + shown(pair[1]) + "]",
              logarithmic ? "give [LOW, HIGH] with 0 < LOW <= HIGH"
                          : "give [LOW, HIGH] with LOW <= HIGH");
  }
  return {logarithmic ? Draw::Kind::kLogUniform : Draw::Kind::kUniform, pair[0], pair[1]};
}

Draw readDraw(Section& in, const std::string& key, const Limits& limits) {
  const YAML::Node node = in.required(key, kForms);
  const std::string path = in.at(key);
  Draw draw;
  if (node.IsMap()) {
    Section form(node, path, in.source());
    const std::vector<std::string> keys = form.keys();
    std::string names;
    for (const std::string& name : keys) names += (names.empty() ? "" : ", ") + name;
    if (keys.size() != 1) in.refuse(path, "{" + names + "}", kForms);
    if (keys[0] == "normal") {
      draw = {Draw::Kind::kNormal, form.number("normal", Range::kNotNegative), 0.0};
    } else if (keys[0] == "uniform" || keys[0] == "log_uniform") {
      draw = readBounds(form, keys[0]);
    } else {
      in.refuse(in.at(key) + "." + names, shown(node[names]), kForms);
    }
  } else if (!yaml::readNumber(node, draw.first)) {
    in.refuse(path, shown(node), kForms);
  }
  checkRange(in, path, draw, limits);
  return draw;
}

std::optional<Draw> readOptional(Section& in, const std::string& key,
                                 const Limits& limits = kAnySize) {
  if (!in.optional(key)) return {};
  return readDraw(in, key, limits);
}

// ---- scale and add

// the range of what a key names: that of its narrowest number
Range rangeOf(const std::vector<ScenarioNumber>& numbers) {
  Range range = Range::kAny;
  for (const ScenarioNumber& number : numbers) {
    if (number.range.low > range.low) range = number.range;
  }
  return range;
}

ScenarioChange readChange(Section& in, const std::string& key, bool scales) {
  static const std::string kEach = ".each";
  ScenarioChange change;
  change.key = change.path = key;
  if (key.size() > kEach.size() &&
      key.compare(key.size() - kEach.size(), kEach.size(), kEach) == 0) {
    change.each = true;
    change.path.resize(key.size() - kEach.size());
  }
  const bool matrix = change.path == "coupling.stiffness" || change.path == "coupling.damping";
  Scenario any;
  const auto numbers = scenarioNumbers(any, matrix ? change.path + ".diagonal" : change.path);
  const bool friction = change.path == "friction";
  const std::string value = shown(in.required(key, kForms));
  if (numbers.empty() && !friction) {
    in.refuse(
        in.at(key), value,
        "no number of a scenario, known are friction, coupling.stiffness, coupling.damping, " +
            scenarioNumberNames());
  }
  if (change.each && numbers.size() < 2) {
    in.refuse(in.at(key), value, "no list and no matrix, leave out .each");
  }
  if (matrix && !scales) {
    in.refuse(in.at(key), value,
              "its entries have several units, name one of them: " + change.path + ".diagonal[0]");
  }
  Limits limits;
  const Range range = friction ? Range::kNotNegative : rangeOf(numbers);
  if (scales) {
    limits.mean = 1.0;
    if (range.low >= 0.0) limits.low = 0.0;
    limits.above = range.low == Range::kMinPositive;
  }
  change.draw = readDraw(in, key, limits);
  return change;
}

std::vector<ScenarioChange> readChanges(Section& root, const std::string& name, bool scales) {
  std::vector<ScenarioChange> changes;
  if (!root.optional(name)) return changes;
  Section in = root.section(name);
  for (const std::string& key : in.keys()) changes.push_back(readChange(in, key, scales));
  return changes;
}

// ---- the rest

Mismatch::Exciter readExciter(Section in) {
  Mismatch::Exciter exciter;
  exciter.amplitude = readOptional(in, "amplitude", {1.0, 0.0, kLargest, false});
  exciter.delay = readOptional(in, "delay", {0.0, 0.0, kMaxDelay, false});
  exciter.ellipticity = readOptional(in, "ellipticity", {0.0, 0.0, 1.0, false});
  exciter.harmonic = readOptional(in, "harmonic");
  in.finish();
  return exciter;
}

Mismatch::Sensor readSensor(Section in) {
  Mismatch::Sensor sensor;
  sensor.matrix = readOptional(in, "matrix");
  if (in.optional("frame")) {
    Section frame = in.section("frame");
    sensor.rotation = readOptional(frame, "rotation", {0.0, -kMaxTurn, kMaxTurn, false});
    sensor.offset = readOptional(frame, "offset", {0.0, -1.0, 1.0, false});
    frame.finish();
  }
  if (in.optional("drift")) {
    Section drift = in.section("drift");
    sensor.drift_force = readOptional(drift, "force");
    sensor.drift_torque = readOptional(drift, "torque");
    sensor.walk = readOptional(drift, "walk", kNotNegative);
    drift.finish();
  }
  if (in.optional("hum")) {
    Section hum = in.section("hum");
    sensor.hum_force = readDraw(hum, "force", kAnySize);
    sensor.hum_frequency = readDraw(hum, "frequency", {0.0, 0.0, kLargest, true});
    hum.finish();
  }
  sensor.latency = readOptional(in, "latency", {0.0, 0.0, kMaxLatency, false});
  in.finish();
  return sensor;
}

Mismatch::Carrier readCarrier(Section in) {
  Mismatch::Carrier carrier;
  carrier.reading_noise = readOptional(in, "reading_noise", kNotNegative);
  carrier.repeatability = readOptional(in, "repeatability", kNotNegative);
  carrier.compliance = readOptional(in, "compliance", kNotNegative);
  if (in.optional("frame")) {
    Section frame = in.section("frame");
    carrier.rotation = readOptional(frame, "rotation", {0.0, -kMaxTurn, kMaxTurn, false});
    carrier.scale = readOptional(frame, "scale", {0.0, -kMaxScale, kMaxScale, false});
    carrier.offset = readOptional(frame, "offset", {0.0, -100.0, 100.0, false});
    frame.finish();
  }
  in.finish();
  return carrier;
}

}  // namespace

Mismatch parseMismatch(const std::string& text, const std::string& source) {
  YAML::Node root = yaml::loadYaml(text, source, yaml::FileKind::kMismatch);
  if (!root.IsDefined() || root.IsNull()) root = YAML::Node(YAML::NodeType::Map);
  if (!root.IsMap()) {
    yaml::refuse(source, "file", shown(root),
                 "give a mapping of keys, see docs/reference/mismatch.md");
  }
  Section in(root, "", source);
  Mismatch mismatch;
  mismatch.source = source;
  mismatch.scale = readChanges(in, "scale", true);
  mismatch.add = readChanges(in, "add", false);
  if (in.optional("exciter")) mismatch.exciter = readExciter(in.section("exciter"));
  if (in.optional("sensor_a")) mismatch.sensor_a = readSensor(in.section("sensor_a"));
  if (in.optional("sensor_b")) mismatch.sensor_b = readSensor(in.section("sensor_b"));
  if (in.optional("carrier")) mismatch.carrier = readCarrier(in.section("carrier"));
  if (in.optional("hole")) {
    Section hole = in.section("hole");
    mismatch.bore_tilt = readOptional(hole, "bore_tilt", {0.0, -kMaxTilt, kMaxTilt, false});
    mismatch.face_tilt = readOptional(hole, "face_tilt", {0.0, -kMaxFaceTilt, kMaxFaceTilt, false});
    hole.finish();
  }
  in.finish();
  return mismatch;
}

Mismatch loadMismatch(const std::string& path) {
  return parseMismatch(yaml::fileText(path, "mismatch"), path);
}

}  // namespace assembly_cell
