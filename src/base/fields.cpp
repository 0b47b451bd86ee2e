// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/fields.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

using Kind = Field::Kind;

namespace {

std::string inUnit(const char* unit) { return *unit == '\0' ? "" : std::string(" [") + unit + "]"; }

std::string joined(const std::vector<std::string>& names, const char* between = ", ") {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : between) + name;
  return all;
}

std::string integerText(double value) { return std::to_string(static_cast<std::int64_t>(value)); }

}  // namespace

// ---- ranges

std::string remedy(const Range& range) {
  const std::string unit = inUnit(range.unit), high = yaml::shown(range.high);
  const bool bounded = range.high < Range::kMax;
  if (range.low <= -Range::kMax) {
    return "give a " + (bounded ? "number of at most " + high : std::string("finite number")) +
           unit;
  }
  if (range.low == Range::kMinPositive) {
    return "give a " +
           (bounded ? "number > 0 and at most " + high : std::string("finite number > 0")) + unit;
  }
  const std::string low = yaml::shown(range.low);
  if (!bounded) return "give a finite number >= " + low + unit;
  return "give a number from " + low + " to " + high + unit;
}

std::string outside(double value, const Range& range) {
  if (range.contains(value)) return {};
  // a NaN is printed without its sign
  return (std::isnan(value) ? "nan" : yaml::shown(value)) + ": " + remedy(range);
}

// ---- a field

Field& Field::derived(const char* from) {
  origin = from;
  return *this;
}

Field& Field::required(bool is) {
  is_required = is;
  return *this;
}

Field& Field::requiredUnless(const char* other) {
  unless = other;
  return required();
}

Field& Field::row(const char* of) {
  entries = of;
  return *this;
}

Field& Field::independent() {
  is_independent = true;
  return *this;
}

Field& Field::orVector(double* direction) {
  against = direction;
  return *this;
}

bool Field::setVector(const double* vector) const {
  const double length = std::hypot(vector[0], vector[1], vector[2]);
  if (!range.contains(length)) return false;
  *numbers = length;
  for (int i = 0; length > 0.0 && i < 3; ++i) against[i] = 0.0 - vector[i] / length;
  return true;
}

Field& Field::written(bool is) {
  is_written = is;
  return *this;
}

Field& Field::flow() {
  is_flow = true;
  return *this;
}

Field& Field::live(Change when) {
  change = when;
  return *this;
}

std::string Field::name() const {
  const std::size_t dot = path.rfind('.');
  return dot == std::string::npos ? path : path.substr(dot + 1);
}

std::string Field::value() const {
  switch (kind) {
    case Kind::kNumber:
      if (against != nullptr && against[2] != 1.0) {
        return "[" + yamlNumber(0.0 - *numbers * against[0]) + ", " +
               yamlNumber(0.0 - *numbers * against[1]) + ", " +
               yamlNumber(0.0 - *numbers * against[2]) + "]";
      }
      return yamlNumber(*numbers);
    case Kind::kNumbers: {
      std::string row;
      for (std::size_t i = 0; i < count; ++i) row += (i == 0 ? "[" : ", ") + yamlNumber(numbers[i]);
      return row + "]";
    }
    case Kind::kInteger:
      return std::to_string(get());
    case Kind::kFlag:
      return *flag ? "true" : "false";
    case Kind::kText:
      return yamlQuoted(*text);
    case Kind::kChoice:
      return text != nullptr ? *text : names.at(static_cast<std::size_t>(get()));
    case Kind::kSection:
    case Kind::kOther:
      break;
  }
  return {};
}

std::string Field::remedy() const {
  switch (kind) {
    case Kind::kNumber:
      return assembly_cell::remedy(range);
    case Kind::kNumbers:
      return "give a list of " + std::to_string(count) + " numbers" + inUnit(range.unit);
    case Kind::kInteger:
      return "give a whole number from " + integerText(range.low) + " to " +
             integerText(range.high) + inUnit(range.unit);
    case Kind::kFlag:
      return "give true or false";
    case Kind::kText:
      return "give a text";
    case Kind::kChoice:
      return (names.size() > 2 ? "give one of " : "give ") +
             joined(names, names.size() == 2 ? " or " : ", ");
    case Kind::kSection:
    case Kind::kOther:
      break;
  }
  return "give a text, a list or a mapping in a file";
}

bool Field::parse(const std::string& given) const {
  switch (kind) {
    case Kind::kNumber: {
      double number = 0.0;
      if (!parseNumber(given, number) || !range.contains(number)) return false;
      *numbers = number;
      return true;
    }
    case Kind::kNumbers: {
      const YAML::Node row = yaml::loadYaml(given, path);
      std::vector<double> all(count);
      bool good = row.IsSequence() && row.size() == count;
      for (std::size_t i = 0; good && i < count; ++i) {
        good = yaml::readNumber(row[i], all[i]) && range.contains(all[i]);
      }
      if (good) std::copy(all.begin(), all.end(), numbers);
      return good;
    }
    case Kind::kInteger: {
      double number = 0.0;
      if (!parseNumber(given, number) || number != std::round(number) || !range.contains(number)) {
        return false;
      }
      set(static_cast<std::int64_t>(number));
      return true;
    }
    case Kind::kFlag:
      if (given != "true" && given != "false") return false;
      *flag = given == "true";
      return true;
    case Kind::kText:
      *text = given;
      return true;
    case Kind::kChoice: {
      const auto found = std::find(names.begin(), names.end(), given);
      if (found == names.end()) return false;
      if (text != nullptr) {
        *text = given;
      } else {
        set(std::distance(names.begin(), found));
      }
      return true;
    }
    case Kind::kSection:
    case Kind::kOther:
      break;
  }
  return false;
}

// ---- the list

Field& FieldList::add(const char* name, Kind kind, const Range& range, const char* description) {
  Field field;
  field.path = prefix_ + name;
  field.kind = kind;
  field.range = range;
  field.description = description;
  fields_.push_back(std::move(field));
  return fields_.back();
}

Field& FieldList::number(const char* name, double& value, const Range& range,
                         const char* description) {
  Field& field = add(name, Kind::kNumber, range, description);
  field.numbers = &value;
  return field;
}

Field& FieldList::numbers(const char* name, double* values, std::size_t count, const Range& range,
                          const char* description) {
  Field& field = add(name, Kind::kNumbers, range, description);
  field.numbers = values;
  field.count = count;
  return field;
}

Field& FieldList::flag(const char* name, bool& value, const char* description) {
  Field& field = add(name, Kind::kFlag, {}, description);
  field.flag = &value;
  return field;
}

Field& FieldList::text(const char* name, std::string& value, const char* description) {
  Field& field = add(name, Kind::kText, {}, description);
  field.text = &value;
  return field;
}

Field& FieldList::choice(const char* name, std::string& value, std::vector<std::string> names,
                         const char* description) {
  Field& field = add(name, Kind::kChoice, {}, description);
  field.text = &value;
  field.names = std::move(names);
  return field;
}

Field& FieldList::indexed(const char* name, Kind kind, std::function<std::int64_t()> get,
                          std::function<void(std::int64_t)> set, const char* description) {
  Field& field = add(name, kind, {}, description);
  field.get = std::move(get);
  field.set = std::move(set);
  return field;
}

Field& FieldList::other(const char* name, std::function<void(yaml::Section&)> read,
                        const char* description) {
  Field& field = add(name, Kind::kOther, {}, description);
  field.read = std::move(read);
  field.is_written = false;
  return field;
}

Field& FieldList::group(const char* name, const std::function<void(FieldList&)>& list,
                        const char* description) {
  Field& section = add(name, Kind::kSection, {}, description);
  const std::size_t first = fields_.size();
  const std::string outer = prefix_;
  prefix_ = section.path + ".";
  list(*this);
  prefix_ = outer;
  section.count = fields_.size() - first;
  return section;
}

const Field* FieldList::find(const std::string& path) const {
  const auto found =
      std::find_if(begin(), end(), [&](const Field& field) { return field.path == path; });
  return found == end() ? nullptr : &*found;
}

std::string FieldList::names() const {
  std::vector<std::string> all;
  for (const Field& field : *this) {
    if (field.kind != Kind::kSection) all.push_back(field.path);
  }
  return joined(all);
}

// ---- from texts

void setField(const FieldList& fields, const std::string& path, const std::string& text) {
  const Field* field = fields.find(path);
  const std::string item = path + ": value " + text + ": ";
  if (field == nullptr || field->kind == Kind::kSection) {
    throw KeyError(item + "unknown key, known here: " + fields.names());
  }
  if (!field->parse(text)) throw InputError(item + field->remedy());
}

void setField(const FieldList& fields, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) {
    throw InputError("value " + assignment + ": write KEY=VALUE, known keys are " + fields.names());
  }
  setField(fields, assignment.substr(0, equals), assignment.substr(equals + 1));
}

void checkFields(const FieldList& fields) {
  for (const Field& field : fields) {
    bool good = true;
    if (field.kind == Kind::kNumber || field.kind == Kind::kNumbers) {
      good = std::all_of(field.numbers, field.numbers + field.count,
                         [&](double value) { return field.range.contains(value); });
    } else if (field.kind == Kind::kInteger) {
      good = field.range.contains(static_cast<double>(field.get()));
    } else if (field.kind == Kind::kChoice && field.text != nullptr) {
      good = std::find(field.names.begin(), field.names.end(), *field.text) != field.names.end();
    }
    if (good) continue;
    const bool number = field.kind == Kind::kNumber;
    throw InputError(field.path + ": value " +
                     (number ? yaml::shown(*field.numbers) : field.value()) + ": " +
                     field.remedy());
  }
}

// ---- to texts

namespace {

using Fields = std::deque<Field>::const_iterator;

// Inline from `at` to `end`: "{diagonal: [1.0, 2.0], k26: 0.0}".
std::string flowText(Fields at, Fields end) {
  std::string text;
  for (; at != end; ++at) {
    if (!at->is_written) continue;
    text += (text.empty() ? "{" : ", ") + at->name() + ": " + at->value();
  }
  return text + "}";
}

void blockText(Fields at, Fields end, std::size_t indent, std::string& text) {
  while (at != end) {
    const Field& field = *at++;
    const bool section = field.kind == Kind::kSection;
    const Fields after = section ? at + static_cast<std::ptrdiff_t>(field.count) : at;
    if (field.is_written) {
      text += std::string(indent, ' ') + field.name() + ":";
      if (!section) {
        text += " " + field.value() + "\n";
      } else if (field.is_flow) {
        text += " " + flowText(at, after) + "\n";
      } else {
        text += "\n";
        blockText(at, after, indent + 2, text);
      }
    }
    at = after;
  }
}

// What a value may be: "number from 0 to 60 [s]".
std::string rangeText(const Field& field) {
  const std::string text = field.remedy();
  return text.substr(text.compare(0, 7, "give a ") == 0 ? 7 : 5);
}

std::string defaultText(const Field& field) {
  if (field.is_required) return "required";
  if (field.origin != nullptr) return field.origin;
  if (field.kind == Kind::kNumber) {
    return std::isfinite(*field.numbers) ? yaml::shown(*field.numbers) : "none";
  }
  if (field.kind == Kind::kText && field.text->empty()) return "\"\"";
  return field.kind == Kind::kText ? *field.text : field.value();
}

}  // namespace

std::string yamlText(const FieldList& fields, std::size_t indent) {
  std::string text;
  blockText(fields.begin(), fields.end(), indent, text);
  return text;
}

std::string parameterName(const std::string& path) {
  std::string name = path;
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

std::string commentedParameters(const FieldList& fields, std::size_t indent) {
  constexpr std::size_t kColumn = 26;  // where comments begin
  std::ostringstream text;
  for (const Field& field : fields) {
    if (field.kind == Kind::kSection) continue;
    const bool has_default = !field.is_required && field.origin == nullptr;
    std::string line = (has_default ? "" : "# ") + parameterName(field.path) + ": " +
                       (has_default ? field.value() : defaultText(field));
    line.resize(std::max(line.size() + 1, kColumn), ' ');
    text << std::string(indent, ' ') << line << "# " << field.description << " ("
         << rangeText(field) << ")\n";
  }
  return text.str();
}

std::string fieldTable(const FieldList& fields, bool parameters) {
  std::ostringstream text;
  text << (parameters ? "| parameter" : "| key") << " | default | range | |\n|---|---|---|---|\n";
  for (const Field& field : fields) {
    if (field.kind == Kind::kSection) continue;
    text << "| `" << (parameters ? "~" + parameterName(field.path) : field.path) << "` | "
         << defaultText(field) << " | " << rangeText(field) << " | " << field.description
         << (field.change == Field::Change::kRestart ? ""
             : field.change == Field::Change::kLive  ? " Live."
                                                     : " Live, lower values only.")
         << " |\n";
  }
  return text.str();
}

}  // namespace assembly_cell
