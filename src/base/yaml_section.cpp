// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/yaml_section.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell::yaml {

namespace {

// one line, whatever the file holds
[[noreturn]] void throwLine(std::string line) {
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  }
  throw InputError(line);
}

}  // namespace

void refuse(const std::string& source, const std::string& path, const std::string& value,
            const std::string& remedy) {
  throwLine(source + ": " + path + ": value " + value + ": " + remedy);
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
  // a node made by hand has none
  if (tag != "?" && !tag.empty() && tag != "tag:yaml.org,2002:float" &&
      tag != "tag:yaml.org,2002:int") {
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

Section::Section(const YAML::Node& node, std::string path, std::string source, Wording wording)
    : path_(std::move(path)), source_(std::move(source)), wording_(wording) {
  if (!node.IsDefined() || !node.IsMap()) {
    refuse(at(""), shown(node), "give a mapping of keys, see docs/reference/files.md");
  }
  for (const auto& entry : node) {
    if (!entry.first.IsScalar()) {
      refuse(at(""), shown(entry.first), "a key must be a plain word");
    }
    const std::string& key = entry.first.Scalar();
    if (has(key)) {
      refuseKey(key, shown(entry.second), "duplicate key, keep one of them",
                "key '" + at(key) + "' is there twice: keep one of them");
    }
    entries_.emplace_back(key, entry.second);
  }
}

std::string Section::at(const std::string& key) const {
  if (key.empty()) return path_.empty() ? "file" : path_;
  return path_.empty() ? key : path_ + "." + key;
}

std::vector<std::string> Section::keys() const {
  std::vector<std::string> all;
  for (const auto& entry : entries_) all.push_back(entry.first);
  return all;
}

void Section::refuse(const std::string& path, const std::string& value,
                     const std::string& what_to_do) const {
  if (wording_ == Wording::kValue) yaml::refuse(source_, path, value, what_to_do);
  throwLine(source_ + ": " + path + " is '" + value + "': " + what_to_do);
}

// Refuses the key, not its value.
void Section::refuseKey(const std::string& key, const std::string& value,
                        const std::string& what_to_do, const std::string& is) const {
  if (wording_ == Wording::kValue) refuse(at(key), value, what_to_do);
  throwLine(source_ + ": " + is);
}

void Section::refuse(const std::string& path, double value, const std::string& what_to_do) const {
  refuse(path, shown(value), what_to_do);
}

YAML::Node Section::required(const std::string& key, const std::string& what_to_do) {
  know(key);
  const YAML::Node* node = find(key);
  if (node == nullptr) {
    refuseKey(key, "missing", what_to_do, "key '" + at(key) + "' is missing: add it");
  }
  return *node;
}

void Section::know(const std::string& key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
}

bool Section::optional(const std::string& key) {
  know(key);
  return has(key);
}

Section Section::section(const std::string& key) {
  return Section(required(key, "add this mapping, see docs/reference/files.md"), at(key), source_,
                 wording_);
}

std::vector<Section> Section::sections(const std::string& key) {
  const YAML::Node list = required(key, "give a list");
  if (!list.IsSequence()) refuse(at(key), shown(list), "give a list");
  std::vector<Section> all;
  for (std::size_t i = 0; i < list.size(); ++i) {
    all.emplace_back(list[i], at(key) + "[" + std::to_string(i) + "]", source_, wording_);
  }
  return all;
}

double Section::number(const std::string& key, const Range& range,
                       std::optional<double> otherwise) {
  if (otherwise && !optional(key)) return *otherwise;
  const std::string what = remedy(range);
  const YAML::Node node = required(key, what);
  double value = 0.0;
  if (!readNumber(node, value) || !range.contains(value)) refuse(at(key), shown(node), what);
  return value;
}

double Section::number(const std::string& key, double low, double high,
                       std::optional<double> otherwise) {
  return number(key, Range{low, high}, otherwise);
}

std::int64_t Section::integer(const std::string& key, std::int64_t low, std::int64_t high,
                              std::optional<std::int64_t> otherwise) {
  if (otherwise && !optional(key)) return *otherwise;
  const std::string what =
      "give a whole number from " + std::to_string(low) + " to " + std::to_string(high);
  const YAML::Node node = required(key, what);
  double value = 0.0;
  if (!readNumber(node, value) || value != std::round(value) || value < static_cast<double>(low) ||
      value > static_cast<double>(high)) {
    refuse(at(key), shown(node), what);
  }
  return static_cast<std::int64_t>(value);
}

std::vector<double> Section::numbers(const std::string& key, std::size_t count) {
  std::vector<double> values(count);
  readNumbers(key, Range::kAny, static_cast<int>(count), values.data());
  return values;
}

void Section::readNumbers(const std::string& key, const Range& range, int count, double* values,
                          const char* of) {
  const std::string size = "give a list of " + std::to_string(count) + " numbers" +
                           (of != nullptr ? std::string(", ") + of : "");
  const YAML::Node node = required(key, size);
  if (!node.IsSequence() || node.size() != static_cast<std::size_t>(count)) {
    refuseKey(key, shown(node), size,
              at(key) + " has " + std::to_string(node.size()) + " entries: " + size);
  }
  for (int i = 0; i < count; ++i) {
    const YAML::Node entry = node[static_cast<std::size_t>(i)];
    if (!readNumber(entry, values[i]) || !range.contains(values[i])) {
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

std::string Section::choice(const std::string& key, const std::vector<std::string>& choices,
                            const std::optional<std::string>& otherwise) {
  if (otherwise && !optional(key)) return *otherwise;
  Field field;
  field.kind = Field::Kind::kChoice;
  field.names = choices;
  const std::string what = field.remedy();
  const std::string value = text(key, what);
  if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
    refuse(at(key), value, what);
  }
  return value;
}

std::vector<std::string> Section::texts(const std::string& key) {
  const char* what = "give a list of texts";
  const YAML::Node node = required(key, what);
  if (!node.IsSequence()) refuse(at(key), shown(node), what);
  std::vector<std::string> values;
  for (const YAML::Node& entry : node) {
    if (!entry.IsScalar()) refuse(at(key), "a list with " + shown(entry), what);
    values.push_back(entry.Scalar());
  }
  return values;
}

bool Section::flag(const std::string& key, bool otherwise) {
  if (!optional(key)) return otherwise;
  const YAML::Node node = *find(key);
  const std::string value = node.IsScalar() && node.Tag() != "!" ? node.Scalar() : "";
  if (value != "true" && value != "false") refuse(at(key), shown(node), "give true or false");
  return value == "true";
}

void Section::only(std::initializer_list<const char*> keys) {
  for (const char* key : keys) know(key);
  finish();
}

void Section::readField(const Field& field) {
  const std::string name = field.name();
  switch (field.kind) {
    case Field::Kind::kNumber:
      if (const YAML::Node* node = field.against != nullptr ? find(name) : nullptr;
          node != nullptr && node->IsSequence()) {
        double vector[3];
        readNumbers(name, {-field.range.high, field.range.high, field.range.unit}, 3, vector);
        if (!field.setVector(vector)) refuse(at(name), shown(*node), field.remedy());
        return;
      }
      *field.numbers = number(name, field.range);
      return;
    case Field::Kind::kNumbers:
      readNumbers(name, field.range, static_cast<int>(field.count), field.numbers, field.entries);
      return;
    case Field::Kind::kInteger:
      field.set(integer(name, static_cast<std::int64_t>(field.range.low),
                        static_cast<std::int64_t>(field.range.high)));
      return;
    case Field::Kind::kFlag:
      *field.flag = flag(name, *field.flag);
      return;
    case Field::Kind::kText:
      *field.text = text(name, field.remedy());
      return;
    case Field::Kind::kChoice:
      field.parse(choice(name, field.names));
      return;
    case Field::Kind::kOther:
      field.read(*this);
      return;
    case Field::Kind::kSection:
      return;
  }
}

void Section::readFields(std::deque<Field>::const_iterator at,
                         std::deque<Field>::const_iterator end) {
  while (at != end) {
    const Field& field = *at++;
    const bool is_section = field.kind == Field::Kind::kSection;
    const auto after = is_section ? at + static_cast<std::ptrdiff_t>(field.count) : at;
    const bool replaced = field.unless != nullptr && optional(field.unless);
    if (optional(field.name()) || (field.is_required && !replaced)) {
      if (is_section) {
        Section inner = section(field.name());
        inner.readFields(at, after);
        inner.finish();
      } else {
        readField(field);
      }
    }
    at = after;
  }
}

void Section::read(const FieldList& fields) { readFields(fields.begin(), fields.end()); }

void Section::finish() const {
  for (const auto& [key, node] : entries_) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    std::string names;
    for (const std::string& name : known_) names += (names.empty() ? " " : ", ") + name;
    try {
      refuseKey(key, shown(node), "unknown key, known here:" + names,
                "unknown key '" + at(key) + "': known are" + names);
    } catch (const InputError& e) {
      throw KeyError(e.what());
    }
  }
}

const YAML::Node* Section::find(const std::string& key) const {
  for (const auto& entry : entries_) {
    if (entry.first == key) return &entry.second;
  }
  return nullptr;
}

namespace {

// A node's folder isn't the one that its launch was started in.
std::string lookedForIn(const std::string& path) {
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::current_path(error);
  if (error || std::filesystem::path(path).is_absolute()) return "";
  return "; it was looked for in " + folder.string() + ", give a path from / on";
}

}  // namespace

std::string fileText(const std::string& path, const std::string& what, std::size_t largest) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string text(largest + 1, '\0');
  if (file) file.read(&text[0], static_cast<std::streamsize>(text.size()));
  if (!file.is_open() || file.bad()) {
    const std::string reason = errno != 0 ? std::strerror(errno) : "read error";
    refuse(path, "file", "unreadable",
           "file missing or unreadable (" + reason + "), check the path and its permissions" +
               lookedForIn(path));
  }
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > largest) {
    refuse(path, "file", "more than " + std::to_string(largest >> 20) + " MiB",
           "this is too much, give a YAML file with " + what);
  }
  return text;
}

YAML::Node loadYaml(const std::string& text, const std::string& source, FileKind wanted) {
  refuseXml(text, wanted, source);
  if (const std::string why = tooDeep(text); !why.empty()) {
    refuse(source, "file", "not readable", why);
  }
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.size() > 1) {
      refuse(source, "file", std::to_string(documents.size()) + " documents", "keep one of them");
    }
    const YAML::Node root = documents.empty() ? YAML::Node() : documents.front();
    refuseOtherKind(root, wanted, source);
    return root;
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

YAML::Node withOverride(const YAML::Node& root, const std::string& text) try {
  const std::size_t equals = text.find('=');
  const std::vector<std::string> keys =
      equals == std::string::npos ? std::vector<std::string>{} : splitPath(text.substr(0, equals));
  if (keys.empty()) {
    refuse("--set", "override", text, "write key.path=value, such as peg.radius=0.025");
  }
  const YAML::Node value = loadYaml(text.substr(equals + 1), "--set " + text);
  return withValue(root, keys, 0, value, text);
} catch (const InputError& e) {
  throw KeyError(e.what());
}

YAML::Node loadMapping(const std::string& text, const std::string& source,
                       const std::vector<std::string>& overrides, FileKind wanted) {
  YAML::Node root = loadYaml(text, source, wanted);
  if (!root.IsMap()) {
    refuse(source, "file", shown(root), "give a mapping of keys, see docs/reference/files.md");
  }
  for (const std::string& change : overrides) root.reset(withOverride(root, change));
  return root;
}

}  // namespace assembly_cell::yaml
