// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/source_parameters.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdio>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kLongestText = 1024;

std::string shown(const YAML::Node& node) {
  if (!node.IsDefined()) return "missing";
  if (node.IsNull()) return "empty";
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  return "'" + printable(node.Scalar()) + "'";
}

std::string shown(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

// YAML tags a quoted scalar with "!"
bool isPlain(const YAML::Node& node) { return node.IsScalar() && node.Tag() != "!"; }

}  // namespace

std::string printable(const std::string& text, std::size_t longest) {
  std::string line = text.substr(0, longest);
  for (char& c : line) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) {
      c = ' ';
    } else if (byte > 0x7f) {
      c = '?';
    }
  }
  return text.size() > longest ? line + "..." : line;
}

SourceParameters::SourceParameters(const YAML::Node& map, std::string subject)
    : map_(map), subject_(std::move(subject)) {
  if (map_.IsDefined() && !map_.IsNull() && !map_.IsMap()) {
    throw InputError(subject_ + ": the parameters are " + shown(map_) + ": give a map of keys");
  }
}

void SourceParameters::refuse(const std::string& key, const std::string& value,
                              const std::string& remedy) const {
  throw InputError(subject_ + ": " + key + " is " + value + ": " + remedy);
}

bool SourceParameters::has(const std::string& key) const {
  if (!map_.IsDefined() || !map_.IsMap()) return false;
  return map_[key].IsDefined();
}

YAML::Node SourceParameters::find(const std::string& key, bool required) {
  if (std::find(asked_.begin(), asked_.end(), key) == asked_.end()) asked_.push_back(key);
  if (has(key)) return map_[key];
  if (required) refuse(key, "missing", "set it");
  return YAML::Node(YAML::NodeType::Undefined);
}

double SourceParameters::number(const std::string& key, double min, double max,
                                std::optional<double> fallback) {
  const YAML::Node node = find(key, !fallback);
  if (!node.IsDefined()) return *fallback;
  double value = 0.0;
  if (!isPlain(node) || !parseNumber(node.Scalar(), value) || value < min || value > max) {
    refuse(key, shown(node), "give a number from " + shown(min) + " to " + shown(max));
  }
  return value;
}

int SourceParameters::integer(const std::string& key, int min, int max,
                              std::optional<int> fallback) {
  const YAML::Node node = find(key, !fallback);
  if (!node.IsDefined()) return *fallback;
  long value = 0;
  if (!isPlain(node) || !parseInteger(node.Scalar(), value) || value < min || value > max) {
    refuse(key, shown(node),
           "give an integer from " + std::to_string(min) + " to " + std::to_string(max));
  }
  return static_cast<int>(value);
}

bool SourceParameters::flag(const std::string& key, std::optional<bool> fallback) {
  const YAML::Node node = find(key, !fallback);
  if (!node.IsDefined()) return *fallback;
  if (isPlain(node) && node.Scalar() == "true") return true;
  if (!isPlain(node) || node.Scalar() != "false") refuse(key, shown(node), "give true or false");
  return false;
}

std::string SourceParameters::text(const std::string& key, std::optional<std::string> fallback) {
  const YAML::Node node = find(key, !fallback);
  if (!node.IsDefined()) return *fallback;
  if (!node.IsScalar()) refuse(key, shown(node), "give a text");
  const std::string& value = node.Scalar();
  const bool controls = std::any_of(value.begin(), value.end(), [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
  });
  if (value.size() > kLongestText || controls) {
    refuse(key, shown(node),
           "give at most " + std::to_string(kLongestText) + " characters, a line");
  }
  return value;
}

std::string SourceParameters::choice(const std::string& key,
                                     const std::vector<std::string>& choices,
                                     std::optional<std::string> fallback) {
  const std::string value = text(key, std::move(fallback));
  if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
    refuse(key, "'" + printable(value) + "'", "give one of " + join(choices));
  }
  return value;
}

std::vector<std::string> SourceParameters::texts(const std::string& key,
                                                 std::optional<std::vector<std::string>> fallback) {
  const YAML::Node node = find(key, !fallback);
  if (!node.IsDefined()) return *fallback;
  std::vector<std::string> values;
  if (!node.IsSequence() || node.size() > kLongestText)
    refuse(key, shown(node), "give a list of texts");
  for (const YAML::Node& entry : node) {
    if (!entry.IsScalar() || entry.Scalar().size() > kLongestText) {
      refuse(key, "a list with " + shown(entry), "give a list of texts");
    }
    values.push_back(entry.Scalar());
  }
  return values;
}

std::vector<double> SourceParameters::numbers(const std::string& key, std::size_t size,
                                              std::optional<std::vector<double>> fallback) {
  const YAML::Node node = find(key, !fallback);
  if (!node.IsDefined()) return *fallback;
  const std::string remedy = "give a list of " + std::to_string(size) + " numbers";
  if (!node.IsSequence() || node.size() != size) refuse(key, shown(node), remedy);
  std::vector<double> values;
  for (const YAML::Node& entry : node) {
    double value = 0.0;
    if (!isPlain(entry) || !parseNumber(entry.Scalar(), value)) {
      refuse(key, "a list with " + shown(entry), remedy);
    }
    values.push_back(value);
  }
  return values;
}

void SourceParameters::refuseUnknown() const {
  if (!map_.IsDefined() || !map_.IsMap()) return;
  for (const auto& entry : map_) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : shown(entry.first);
    if (key != "type" && std::find(asked_.begin(), asked_.end(), key) == asked_.end()) {
      throw InputError(subject_ + ": key '" + printable(key) + "' is unknown: there are " +
                       join(asked_));
    }
  }
}

}  // namespace assembly_cell
