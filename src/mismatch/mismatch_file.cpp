// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario_numbers.h"
#include "draw_keys.h"

namespace assembly_cell {
namespace {

using yaml::Range;
using yaml::Section;
using yaml::shown;

constexpr const char* kForms =
    "give a number, {normal: SD}, {uniform: [LOW, HIGH]} or {log_uniform: [LOW, HIGH]}";

// Limits of scale.clearance. A hole that much wider than the peg doesn't guide it, and without
// clearance the contacts of a run can't be separated.
constexpr double kMostClearances = 100.0, kLeastClearances = 1e-3;

std::string shownDraw(const Draw& draw);

[[noreturn]] void refuseRange(const Section& in, const std::string& path, const Draw& draw,
                              const Range& range) {
  std::string what =
      range.low == Range::kMinPositive ? "above 0" : "of at least " + shown(range.low);
  if (range.high < kLargestDraw) what += " and at most " + shown(range.high);
  if (*range.unit != '\0') what += std::string(" [") + range.unit + "]";
  in.refuse(path, shownDraw(draw),
            draw.kind == Draw::Kind::kNumber
                ? "give a number " + what
                : "can draw what is not possible (normal draws within 5 SD), give draws " + what);
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

// `mean` of a normal draw.
Draw readDraw(Section& in, const std::string& key, const Range& range, double mean) {
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
  const auto [low, high] = draw.reach(mean);
  if (!range.contains(low) || !range.contains(high)) refuseRange(in, path, draw, range);
  return draw;
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
  const bool friction = change.path == "friction", clearance = change.path == "clearance";
  const std::string value = shown(in.required(key, kForms));
  if (clearance && !scales) {
    in.refuse(in.at(key), value, "a clearance is only scaled, name add.hole.radius");
  }
  if (numbers.empty() && !friction && !clearance) {
    in.refuse(in.at(key), value,
              "no number of a scenario, known are clearance, friction, coupling.stiffness, "
              "coupling.damping, " +
                  scenarioNumberNames());
  }
  if (change.each && numbers.size() < 2) {
    in.refuse(in.at(key), value, "no list and no matrix, leave out .each");
  }
  if (matrix && !scales) {
    in.refuse(in.at(key), value,
              "its entries have several units, name one of them: " + change.path + ".diagonal[0]");
  }
  const Range range = friction ? Range::kNotNegative : rangeOf(numbers);
  Range factor{-kLargestDraw, kLargestDraw};
  if (clearance) factor = {-kMostClearances, kMostClearances};
  if (scales && range.low >= 0.0) factor.low = std::min(range.low, Range::kMinPositive);
  change.draw = readDraw(in, key, factor, scales ? 1.0 : 0.0);
  const auto [low, high] = change.draw.reach(1.0);
  if (clearance && low == high && std::abs(low) < kLeastClearances) {
    in.refuse(in.at(key), value,
              "a peg as wide as its hole is in contact along all of its length, give at least " +
                  shown(kLeastClearances) + " or at most -" + shown(kLeastClearances));
  }
  return change;
}

// The clearance determines the true hole's radius.
void checkClearance(const Mismatch& mismatch) {
  const auto changes = [](const std::vector<ScenarioChange>& all, const std::string& path) {
    return std::any_of(all.begin(), all.end(),
                       [&](const ScenarioChange& one) { return one.path == path; });
  };
  if (!changes(mismatch.scale, "clearance")) return;
  for (const auto* all : {&mismatch.scale, &mismatch.add}) {
    if (!changes(*all, "hole.radius")) continue;
    yaml::refuse(mismatch.source, all == &mismatch.scale ? "scale.hole.radius" : "add.hole.radius",
                 "given",
                 "scale.clearance determines the hole's true radius, leave one of them out");
  }
}

std::vector<ScenarioChange> readChanges(Section& root, const std::string& name) {
  std::vector<ScenarioChange> changes;
  Section in = root.section(name);
  for (const std::string& key : in.keys()) changes.push_back(readChange(in, key, name == "scale"));
  return changes;
}

// Keys [at, end), whose paths begin with the same `depth` characters.
void addFields(FieldList& f, const DrawKey* at, const DrawKey* end, std::size_t depth,
               Mismatch& mismatch) {
  while (at != end) {
    const std::size_t dot = at->path.find('.', depth);
    const std::string name = at->path.substr(depth, dot - depth);
    if (dot == std::string::npos) {
      const DrawKey& key = *at++;
      f.other(name.c_str(), [&key, &mismatch, name](Section& in) {
         mismatch.draws[key.path] = readDraw(in, name, key.range, key.mean);
       }).required(key.required);
      continue;
    }
    const DrawKey* const first = at;
    while (at != end && at->path.compare(0, dot + 1, first->path, 0, dot + 1) == 0) ++at;
    f.group(name.c_str(), [&](FieldList& g) { addFields(g, first, at, dot + 1, mismatch); });
  }
}

}  // namespace

Mismatch parseMismatch(const std::string& text, const std::string& source) {
  YAML::Node node = yaml::loadYaml(text, source, yaml::FileKind::kMismatch);
  if (!node.IsDefined() || node.IsNull()) node = YAML::Node(YAML::NodeType::Map);
  if (!node.IsMap()) {
    yaml::refuse(source, "file", shown(node),
                 "give a mapping of keys, see docs/reference/mismatch.md");
  }
  Section in(node, "", source);
  Mismatch mismatch;
  mismatch.source = source;
  Truth unused;
  const std::vector<DrawKey> keys = drawKeys(unused);
  FieldList list;
  list.other("scale", [&](Section& root) { mismatch.scale = readChanges(root, "scale"); });
  list.other("add", [&](Section& root) { mismatch.add = readChanges(root, "add"); });
  addFields(list, keys.data(), keys.data() + keys.size(), 0, mismatch);
  in.read(list);
  in.finish();
  checkClearance(mismatch);
  return mismatch;
}

Mismatch loadMismatch(const std::string& path) {
  return parseMismatch(yaml::fileText(path, "mismatch"), path);
}

void refuseCarrierDrive(const Mismatch& mismatch) {
  for (const char* key : {"carrier.latency", "carrier.jitter", "carrier.lag", "carrier.backlash"}) {
    const auto draw = mismatch.draws.find(key);
    if (draw == mismatch.draws.end()) continue;
    yaml::refuse(mismatch.source, key, shownDraw(draw->second),
                 "an arm carries the carrier, leave it out and set latency, jitter, bandwidth or "
                 "backlash of emulate_arm");
  }
}

std::string unusedWithArm(const Mismatch& mismatch) {
  if (mismatch.draws.count("carrier.reading_noise") == 0) return "";
  return mismatch.source +
         ": carrier.reading_noise: has no effect where an arm carries the carrier; its encoders "
         "are "
         "those of emulate_arm, see encoder_step";
}

}  // namespace assembly_cell
