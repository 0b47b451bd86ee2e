// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/yaml_section.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell::yaml {

void refuse(const std::string& source, const std::string& path, const std::string& value,
            const std::string& remedy) {
  // one line, whatever the file holds
  std::string line = source + ": " + path + ": value " + value + ": " + remedy;
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  }
  throw InputError(line);
}

std::string shown(double value) {
  std::ostringstream out;
  out.precision(12);
  out << value;
  return out.str();
}

std::string shown(const YAML::Node& node) {
  constexpr std::size_t kLongest = 60;
  if (!node.IsDefined()) return "missing";
  if (node.IsNull()) return "empty";
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  std::string text = node.Scalar();
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text.empty() ? "\"\"" : text;
}

bool readNumber(const YAML::Node& node, double& value) {
  if (!node.IsDefined() || !node.IsScalar()) return false;
  const std::string& tag = node.Tag();
  if (tag != "?" && tag != "tag:yaml.org,2002:float" && tag != "tag:yaml.org,2002:int") {
    return false;
  }
  const std::string& text = node.Scalar();
  const char* first = text.data();
  const char* last = first + text.size();
  if (first != last && *first == '+') ++first;
  // from_chars also knows "inf" and "nan", and a second sign after the plus
  const char* digits = first != last && *first == '-' && first == text.data() ? first + 1 : first;
  if (digits == last || !(std::isdigit(static_cast<unsigned char>(*digits)) || *digits == '.')) {
    return false;
  }
  const auto [end, error] = std::from_chars(first, last, value);
  return error == std::errc() && end == last && std::isfinite(value);
}

const char* remedy(Range range) {
  switch (range) {
    case Range::kPositive:
      return "give a finite number > 0";
    case Range::kNotNegative:
      return "give a finite number >= 0";
    case Range::kAny:
      break;
  }
  return "give a finite number";
}

bool inRange(double value, Range range) {
  return range == Range::kAny || value > 0.0 || (range == Range::kNotNegative && value == 0.0);
}

Section::Section(const YAML::Node& node, std::string path, const std::string& source)
    : path_(std::move(path)), source_(source) {
  if (!node.IsDefined() || !node.IsMap()) {
    refuse(at(""), shown(node), "give a mapping of keys, see docs/interfaces.md");
  }
  for (const auto& entry : node) {
    if (!entry.first.IsScalar()) {
      refuse(at(""), shown(entry.first), "a key must be a plain word");
    }
    const std::string& key = entry.first.Scalar();
    if (has(key)) refuse(at(key), shown(entry.second), "duplicate key, keep one of them");
    entries_.emplace_back(key, entry.second);
  }
}

std::string Section::at(const std::string& key) const {
  if (key.empty()) return path_.empty() ? "file" : path_;
  return path_.empty() ? key : path_ + "." + key;
}

void Section::refuse(const std::string& path, const std::string& value,
                     const std::string& what_to_do) const {
  yaml::refuse(source_, path, value, what_to_do);
}

void Section::refuse(const std::string& path, double value, const std::string& what_to_do) const {
  refuse(path, shown(value), what_to_do);
}

YAML::Node Section::required(const std::string& key, const std::string& what_to_do) {
  known_.push_back(key);
  const YAML::Node* node = find(key);
  if (node == nullptr) refuse(at(key), "missing", what_to_do);
  return *node;
}

bool Section::optional(const std::string& key) {
  known_.push_back(key);
  return has(key);
}

Section Section::section(const std::string& key) {
  return Section(required(key, "add this mapping, see docs/interfaces.md"), at(key), source_);
}

double Section::number(const std::string& key, Range range) {
  const YAML::Node node = required(key, std::string(remedy(range)));
  double value = 0.0;
  if (!readNumber(node, value) || !inRange(value, range)) {
    refuse(at(key), shown(node), remedy(range));
  }
  return value;
}

double Section::number(const std::string& key, Range range, double otherwise) {
  return optional(key) ? number(key, range) : otherwise;
}

void Section::readNumbers(const std::string& key, Range range, int count, double* values) {
  const std::string size = "give a list of " + std::to_string(count) + " numbers";
  const YAML::Node node = required(key, size);
  if (!node.IsSequence() || node.size() != static_cast<std::size_t>(count)) {
    refuse(at(key), shown(node), size);
  }
  for (int i = 0; i < count; ++i) {
    const YAML::Node entry = node[static_cast<std::size_t>(i)];
    if (!readNumber(entry, values[i]) || !inRange(values[i], range)) {
      refuse(at(key) + "[" + std::to_string(i) + "]", shown(entry), remedy(range));
    }
  }
}

Eigen::Vector3d Section::vector(const std::string& key) {
  return optional(key) ? numbers<3>(key, Range::kAny) : Eigen::Vector3d(Eigen::Vector3d::Zero());
}

std::string Section::text(const std::string& key, const std::string& what_to_do) {
  const YAML::Node node = required(key, what_to_do);
  if (!node.IsScalar()) refuse(at(key), shown(node), what_to_do);
  return node.Scalar();
}

bool Section::flag(const std::string& key, bool otherwise) {
  if (!optional(key)) return otherwise;
  const YAML::Node node = *find(key);
  const std::string value = node.IsScalar() && node.Tag() == "?" ? node.Scalar() : "";
  if (value != "true" && value != "false") refuse(at(key), shown(node), "give true or false");
  return value == "true";
}

void Section::finish() const {
  for (const auto& [key, node] : entries_) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    std::string names;
    for (const std::string& name : known_) {
      if (names.find(" " + name + ",") == std::string::npos) names += " " + name + ",";
    }
    names.pop_back();
    refuse(at(key), shown(node), "unknown key, known here:" + names);
  }
}

const YAML::Node* Section::find(const std::string& key) const {
  for (const auto& entry : entries_) {
    if (entry.first == key) return &entry.second;
  }
  return nullptr;
}

std::string fileText(const std::string& path, const std::string& what) {
  // a page of text; more than this is another kind of file
  constexpr std::size_t kLargestFile = 1 << 20;
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string text(kLargestFile + 1, '\0');
  if (file) file.read(&text[0], static_cast<std::streamsize>(text.size()));
  if (!file.is_open() || file.bad()) {
    const std::string reason = errno != 0 ? std::strerror(errno) : "read error";
    refuse(path, "file", "unreadable", reason + ", check the path and its permissions");
  }
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > kLargestFile) {
    refuse(path, "file", "more than 1 MiB", "this is no " + what + ", check the path");
  }
  return text;
}

YAML::Node loadYaml(const std::string& text, const std::string& source) {
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.size() > 1) {
      refuse(source, "file", std::to_string(documents.size()) + " documents", "keep one of them");
    }
    return documents.empty() ? YAML::Node() : documents.front();
  } catch (const YAML::Exception& e) {
    refuse(source, "line " + std::to_string(e.mark.line + 1),
           "column " + std::to_string(e.mark.column + 1),
           "not YAML (" + e.msg + "), correct the syntax");
  }
}

namespace {

// "a.b[1]" or "a.b.1" as a, b, 1; empty when it is no such path.
std::vector<std::string> splitPath(const std::string& path) {
  std::vector<std::string> keys(1);
  bool in_index = false;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const char c = path[i];
    // an index is closed and followed by the next key, the next index or nothing
    const bool last_of_index = i + 1 == path.size() || path[i + 1] == '.' || path[i + 1] == '[';
    if ((c == ']') != in_index && (c == ']' || c == '[' || c == '.')) return {};
    if (c == ']' && !last_of_index) return {};
    if (c == '.' || c == '[') keys.emplace_back();
    if (c == '[' || c == ']') in_index = c == '[';
    if (c != '.' && c != '[' && c != ']') keys.back() += c;
  }
  const bool gap = std::any_of(keys.begin(), keys.end(), [](const auto& k) { return k.empty(); });
  return gap || in_index ? std::vector<std::string>{} : keys;
}

// The tree with the value at keys[depth...] replaced or added.
YAML::Node withValue(const YAML::Node& node, const std::vector<std::string>& keys,
                     std::size_t depth, const YAML::Node& value, const std::string& override_text) {
  if (depth == keys.size()) return value;
  const std::string& key = keys[depth];
  const std::string source = "--set " + override_text;
  if (node.IsDefined() && node.IsSequence()) {
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), index);
    if (error != std::errc() || end != key.data() + key.size() || index >= node.size()) {
      refuse(source, "index", key,
             node.size() == 0 ? std::string("the list is empty")
                              : "give an index from 0 to " + std::to_string(node.size() - 1));
    }
    YAML::Node list(YAML::NodeType::Sequence);
    for (std::size_t i = 0; i < node.size(); ++i) {
      list.push_back(i == index ? withValue(node[i], keys, depth + 1, value, override_text)
                                : YAML::Node(node[i]));
    }
    return list;
  }
  if (node.IsDefined() && node.IsScalar()) {
    refuse(source, "key", key, "there is nothing below " + shown(node) + ", correct the path");
  }
  const bool is_map = node.IsDefined() && node.IsMap();
  if (!is_map && std::isdigit(static_cast<unsigned char>(key[0]))) {
    refuse(source, "index", key, "there is no list here, give the whole list");
  }
  YAML::Node map(YAML::NodeType::Map);
  bool found = false;
  if (is_map) {
    for (const auto& entry : node) {
      const bool here = !found && entry.first.IsScalar() && entry.first.Scalar() == key;
      found = found || here;
      map.force_insert(entry.first,
                       here ? withValue(entry.second, keys, depth + 1, value, override_text)
                            : YAML::Node(entry.second));
    }
  }
  if (!found) {
    const YAML::Node nothing(YAML::NodeType::Null);
    map.force_insert(key, withValue(nothing, keys, depth + 1, value, override_text));
  }
  return map;
}

}  // namespace

YAML::Node withOverride(const YAML::Node& root, const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::vector<std::string> keys =
      equals == std::string::npos ? std::vector<std::string>{} : splitPath(text.substr(0, equals));
  if (keys.empty()) {
    refuse("--set", "override", text, "write key.path=value, such as peg.radius=0.025");
  }
  const YAML::Node value = loadYaml(text.substr(equals + 1), "--set " + text);
  return withValue(root, keys, 0, value, text);
}

YAML::Node loadMapping(const std::string& text, const std::string& source,
                       const std::vector<std::string>& overrides) {
  YAML::Node root = loadYaml(text, source);
  if (!root.IsMap()) {
    refuse(source, "file", shown(root), "give a mapping of keys, see docs/interfaces.md");
  }
  for (const std::string& change : overrides) root.reset(withOverride(root, change));
  return root;
}

}  // namespace assembly_cell::yaml
