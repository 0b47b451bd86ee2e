// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/parameters.h"

#include <ros/names.h>
#include <ros/this_node.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell::ros_bridge {

namespace {

using XmlRpc::XmlRpcValue;

// names of parameters that are also names of topics or services, which may be renamed
const std::set<std::string> kTopicsToo = {"bridge", "carrier_motion", "clock", "lease", "load",
                                          "plan",   "state",          "store", "wrench"};

std::string print(const XmlRpcValue& value) {
  std::ostringstream out;
  XmlRpcValue copy = value;
  copy.write(out);
  return out.str();
}

bool isNumber(const XmlRpcValue& value) {
  return value.getType() == XmlRpcValue::TypeDouble || value.getType() == XmlRpcValue::TypeInt;
}

double toDouble(XmlRpcValue value) {
  return value.getType() == XmlRpcValue::TypeInt ? static_cast<int>(value)
                                                 : static_cast<double>(value);
}

YAML::Node toYaml(XmlRpcValue& value) {
  YAML::Node node;
  switch (value.getType()) {
    case XmlRpcValue::TypeStruct:
      node = YAML::Node(YAML::NodeType::Map);
      for (auto& entry : value) node[entry.first] = toYaml(entry.second);
      break;
    case XmlRpcValue::TypeArray:
      node = YAML::Node(YAML::NodeType::Sequence);
      for (int i = 0; i < value.size(); ++i) node.push_back(toYaml(value[i]));
      break;
    case XmlRpcValue::TypeBoolean:
      node = static_cast<bool>(value);
      break;
    case XmlRpcValue::TypeInt:
      node = static_cast<int>(value);
      break;
    case XmlRpcValue::TypeDouble:
      node = static_cast<double>(value);
      break;
    case XmlRpcValue::TypeString:
      node = static_cast<std::string>(value);
      break;
    default:
      node = print(value);
  }
  return node;
}

[[noreturn]] void refuse(const ros::NodeHandle& nh, const std::string& name,
                         const std::string& value, const std::string& remedy) {
  throw InputError("parameter " + nh.resolveName(name) + " is " + value + ": " + remedy);
}

// rosparam reads YAML 1.1, where a number without a point or its exponent without a sign is text
std::string numberAsText(const XmlRpcValue& value, const std::string& remedy) {
  double number = 0.0;
  XmlRpcValue copy = value;
  if (copy.getType() != XmlRpcValue::TypeString ||
      !parseNumber(static_cast<std::string>(copy), number)) {
    return remedy;
  }
  const bool whole = number == std::nearbyint(number) && std::abs(number) < 1e9;
  return "to rosparam this is text, not a number: write " +
         (whole ? std::to_string(std::lround(number)) : yamlNumber(number)) + "; " + remedy;
}

}  // namespace

std::optional<XmlRpcValue> Parameters::find(const std::string& name, bool required) {
  known_.insert(name.substr(0, name.find('/')));
  XmlRpcValue value;
  if (nh_.getParam(name, value)) return value;
  if (required) refuse(nh_, name, "missing", "set it, see docs/reference/interfaces.md");
  return std::nullopt;
}

double Parameters::number(const std::string& name, const Range& range,
                          std::optional<double> fallback) {
  const auto value = find(name, !fallback);
  if (!value) return *fallback;
  if (!isNumber(*value)) {
    refuse(nh_, name, print(*value), numberAsText(*value, remedy(range)));
  }
  const double number = toDouble(*value);
  if (const std::string wrong = outside(number, range); !wrong.empty()) {
    throw InputError("parameter " + nh_.resolveName(name) + " is " + wrong);
  }
  return number;
}

int Parameters::integer(const std::string& name, int min, int max, std::optional<int> fallback) {
  const auto value = find(name, !fallback);
  if (!value) return *fallback;
  const std::string remedy =
      "give a whole number from " + std::to_string(min) + " to " + std::to_string(max);
  if (value->getType() != XmlRpcValue::TypeInt) {
    refuse(nh_, name, print(*value), numberAsText(*value, remedy));
  }
  const int number = static_cast<int>(*value);
  if (number < min || number > max) refuse(nh_, name, std::to_string(number), remedy);
  return number;
}

bool Parameters::flag(const std::string& name, std::optional<bool> fallback) {
  const auto value = find(name, !fallback);
  if (!value) return *fallback;
  if (value->getType() != XmlRpcValue::TypeBoolean) {
    refuse(nh_, name, print(*value), "give true or false");
  }
  return static_cast<bool>(*value);
}

std::string Parameters::text(const std::string& name, std::optional<std::string> fallback) {
  const auto value = find(name, !fallback);
  if (!value) return *fallback;
  if (value->getType() != XmlRpcValue::TypeString) {
    refuse(nh_, name, print(*value), "give a string");
  }
  return static_cast<std::string>(*value);
}

std::string Parameters::choice(const std::string& name, const std::vector<std::string>& choices,
                               std::optional<std::string> fallback) {
  const auto has = [&choices](const std::string& word) {
    return std::find(choices.begin(), choices.end(), word) != choices.end();
  };
  // rosparam reads YAML 1.1, where off is false
  auto given = find(name, !fallback);
  if (has("off") && given && given->getType() == XmlRpcValue::TypeBoolean &&
      !static_cast<bool>(*given)) {
    return "off";
  }
  const std::string value = text(name, fallback);
  if (!has(value)) {
    Field field;
    field.kind = Field::Kind::kChoice;
    field.names = choices;
    refuse(nh_, name, "\"" + value + "\"", field.remedy());
  }
  return value;
}

std::vector<std::string> Parameters::texts(const std::string& name,
                                           std::optional<std::vector<std::string>> fallback) {
  auto value = find(name, !fallback);
  if (!value) return *fallback;
  if (value->getType() == XmlRpcValue::TypeString) {
    const auto single = static_cast<std::string>(*value);
    return single.empty() ? std::vector<std::string>{} : std::vector<std::string>{single};
  }
  if (value->getType() != XmlRpcValue::TypeArray) {
    refuse(nh_, name, print(*value), "give a list of strings");
  }
  std::vector<std::string> out;
  for (int i = 0; i < value->size(); ++i) {
    if ((*value)[i].getType() != XmlRpcValue::TypeString) {
      refuse(nh_, name, print(*value), "give a list of strings");
    }
    out.push_back(static_cast<std::string>((*value)[i]));
  }
  return out;
}

std::vector<double> Parameters::numbers(const std::string& name, std::size_t size,
                                        std::optional<std::vector<double>> fallback) {
  auto value = find(name, !fallback);
  if (!value) return *fallback;
  const std::string remedy = "give a list of " + std::to_string(size) + " finite numbers";
  if (value->getType() != XmlRpcValue::TypeArray || value->size() != static_cast<int>(size)) {
    refuse(nh_, name, print(*value), remedy);
  }
  std::vector<double> out;
  for (int i = 0; i < value->size(); ++i) {
    if (!isNumber((*value)[i]) || !std::isfinite(toDouble((*value)[i]))) {
      refuse(nh_, name, print(*value), numberAsText((*value)[i], remedy));
    }
    out.push_back(toDouble((*value)[i]));
  }
  return out;
}

void Parameters::read(const FieldList& fields) {
  for (const Field& field : fields) {
    if (field.kind == Field::Kind::kSection) continue;
    const std::string name = parameterName(field.path);
    if (!find(name, field.is_required)) continue;
    switch (field.kind) {
      case Field::Kind::kNumber:
        *field.numbers = number(name, field.range);
        break;
      case Field::Kind::kNumbers: {
        const std::vector<double> row = numbers(name, field.count);
        for (const double value : row) {
          if (!field.range.contains(value)) refuse(nh_, name, print(value), remedy(field.range));
        }
        std::copy(row.begin(), row.end(), field.numbers);
        break;
      }
      case Field::Kind::kInteger:
        field.set(
            integer(name, static_cast<int>(field.range.low), static_cast<int>(field.range.high)));
        break;
      case Field::Kind::kFlag:
        *field.flag = flag(name);
        break;
      case Field::Kind::kText:
        *field.text = text(name);
        break;
      case Field::Kind::kChoice:
        field.parse(choice(name, field.names));
        break;
      case Field::Kind::kSection:
      case Field::Kind::kOther:
        break;
    }
  }
}

YAML::Node Parameters::tree(const std::string& name) {
  auto value = find(name, false);
  if (!value) return YAML::Node(YAML::NodeType::Map);
  if (value->getType() != XmlRpcValue::TypeStruct) refuse(nh_, name, print(*value), "give a map");
  return toYaml(*value);
}

bool Parameters::isTree(const std::string& name) const {
  XmlRpcValue value;
  return nh_.getParam(name, value) && value.getType() == XmlRpcValue::TypeStruct;
}

void Parameters::refuseRenamed() const {
  // only of the node itself: on the command line of a nodelet manager such a name is a topic
  if (nh_.getNamespace() != ros::this_node::getName()) return;
  for (const auto& [from, to] : ros::names::getUnresolvedRemappings()) {
    const std::string name = from.substr(from[0] == '~' ? 1 : 0);
    if (known_.count(name) == 0 || kTopicsToo.count(name) != 0) continue;
    throw InputError("'" + from + ":=" + to +
                     "' would rename a topic: a parameter has an underscore before it, _" + name +
                     ":=" + to);
  }
}

void Parameters::refuseUnknown(const std::set<std::string>& others) const {
  refuseRenamed();
  XmlRpcValue all;
  if (!nh_.getParam(nh_.getNamespace(), all) || all.getType() != XmlRpcValue::TypeStruct) return;
  for (const auto& entry : all) {
    if (known_.count(entry.first) != 0 || others.count(entry.first) != 0) continue;
    std::string known;
    for (const auto& name : known_) known += (known.empty() ? "" : ", ") + name;
    throw InputError("parameter " + nh_.resolveName(entry.first) +
                     " is unknown: remove it or correct its name, known are " + known);
  }
}

}  // namespace assembly_cell::ros_bridge
