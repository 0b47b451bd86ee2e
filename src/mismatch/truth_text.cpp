// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <map>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/mismatch/mismatch.h"

namespace assembly_cell {
namespace {

template <class Numbers>
std::string list(const Numbers& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : ", ") + yamlNumber(number);
  return "[" + text + "]";
}

std::string matrix(const Matrix6& m) {
  std::string text;
  for (int i = 0; i < 6; ++i) text += (i > 0 ? ", " : "") + list(Vector6(m.row(i).transpose()));
  return "[" + text + "]";
}

std::string changes(const std::vector<DrawnChange>& drawn) {
  std::string text;
  for (const DrawnChange& change : drawn) {
    const std::string key =
        change.key.find('[') == std::string::npos ? change.key : yamlQuoted(change.key);
    text += (text.empty() ? "" : ", ") + key + ": " +
            (change.each ? list(change.values) : yamlNumber(change.values.front()));
  }
  return "{" + text + "}";
}

using Texts = std::map<std::string, std::string>;

void addSensor(const std::string& name, const SensorTruth& s, Texts& texts) {
  texts[name + ".matrix"] = matrix(s.matrix);
  texts[name + ".frame.rotation"] = list(s.rotation);
  texts[name + ".frame.offset"] = list(s.offset);
  texts[name + ".drift.force"] = list(Eigen::Vector3d(s.drift.head<3>()));
  texts[name + ".drift.torque"] = list(Eigen::Vector3d(s.drift.tail<3>()));
  texts[name + ".drift.walk"] = yamlNumber(s.walk);
  texts[name + ".hum.force"] = list(s.hum);
  texts[name + ".hum.frequency"] =
      yamlNumber(s.hum_frequency) + ", phase: " + yamlNumber(s.hum_phase);
  texts[name + ".latency"] = yamlNumber(s.latency);
}

// what stands behind each key path of the file
Texts textsOf(const Truth& truth) {
  const ExciterErrors& e = truth.imperfections.exciter;
  const CarrierTruth& c = truth.cell.carrier;
  Texts texts = {
      {"exciter.amplitude", yamlNumber(e.gain)},
      {"exciter.delay", yamlNumber(e.delay)},
      {"exciter.ellipticity", yamlNumber(e.ellipticity) + ", azimuth: " + yamlNumber(e.azimuth)},
      {"exciter.harmonic", yamlNumber(e.harmonic)},
      {"carrier.reading_noise", list(c.reading_noise)},
      {"carrier.repeatability", list(c.repeatability)},
      {"carrier.compliance", list(truth.imperfections.compliance)},
      {"carrier.frame.rotation", list(c.rotation)},
      {"carrier.frame.scale", list(c.scale)},
      {"carrier.frame.offset", list(c.offset)},
      {"hole.bore_tilt", list(truth.bore_tilt)},
      {"hole.face_tilt", list(truth.face_tilt)},
  };
  addSensor("sensor_a", truth.cell.sensor_a, texts);
  addSensor("sensor_b", truth.cell.sensor_b, texts);
  return texts;
}

// keys [first, last) of one mapping, whose path ends before `depth`
std::string mapping(const std::vector<std::string>& keys, std::size_t first, std::size_t last,
                    std::size_t depth, const Texts& texts) {
  std::string text;
  while (first < last) {
    const std::size_t dot = keys[first].find('.', depth);
    const std::string name = keys[first].substr(depth, dot - depth);
    text += (text.empty() ? "" : ", ") + name + ": ";
    if (dot == std::string::npos) {
      text += texts.at(keys[first++]);
      continue;
    }
    std::size_t end = first;
    while (end < last && keys[end].compare(0, dot + 1, keys[first], 0, dot + 1) == 0) ++end;
    text += "{" + mapping(keys, first, end, dot + 1, texts) + "}";
    first = end;
  }
  return text;
}

}  // namespace

std::string truthText(const Truth& truth) {
  std::string text;
  const auto join = [&text](const std::string& part) {
    if (!part.empty()) text += (text.empty() ? "" : ", ") + part;
  };
  if (!truth.scale.empty()) join("scale: " + changes(truth.scale));
  if (!truth.add.empty()) join("add: " + changes(truth.add));
  join(mapping(truth.drawn, 0, truth.drawn.size(), 0, textsOf(truth)));
  return "{" + text + "}";
}

}  // namespace assembly_cell
