// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "program.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"

namespace assembly_cell {

namespace {

Names words(const std::string& list) {
  std::istringstream stream(list);
  return {std::istream_iterator<std::string>(stream), {}};
}

std::string textOf(const std::string& file) {
  try {
    return yaml::fileText(file, "KEY: NUMBER");
  } catch (const InputError&) {
    throw InputError(file + ": cannot be read, give a YAML file");
  }
}

// an empty file is one without keys
YAML::Node mapping(const YAML::Node& root) {
  return root.IsNull() ? YAML::Node(YAML::NodeType::Map) : root;
}

std::string cellOf(double value) { return yamlNumber(value); }
std::string cellOf(bool value) { return value ? "true" : "false"; }
std::string cellOf(int value) { return std::to_string(value); }
std::string cellOf(const char* value) { return value; }
template <typename Value>
std::string cellOf(const std::optional<Value>& value) {
  return value ? cellOf(*value) : "null";
}

struct CellsOf {
  template <typename Value>
  Names operator()(const Value& value) const {
    return {cellOf(value)};
  }
  Names operator()(const std::complex<double>& value) const {
    return {cellOf(value.real()), cellOf(value.imag())};
  }
  Names operator()(const std::vector<double>& list) const {
    Names cells;
    for (const double value : list) cells.push_back(cellOf(value));
    return cells;
  }
};

std::string joined(const Names& cells) {
  std::string all = "[";
  for (std::size_t i = 0; i < cells.size(); ++i) all += (i ? ", " : "") + cells[i];
  return all + "]";
}

}  // namespace

// ---- parameters ----

Parameters::Parameters(const std::string& file)
    : file_(file), in_(mapping(yaml::loadYaml(textOf(file), file)), "", file_) {}

void Parameters::expect(const ClosedForm& model) const {
  const Names required = words(model.required);
  Names all = required;
  for (const char* more : {model.spare, model.optional}) {
    for (const std::string& name : words(more)) all.push_back(name);
  }
  const auto check = [&](const std::string& key) {
    if (std::find(all.begin(), all.end(), key) != all.end()) return;
    std::string list;
    for (const std::string& name : all) list += " " + name;
    const std::string place = values_.count(key) > 0 ? "--sweep: value " : file_ + ": ";
    throw InputError(place + key + ": no parameter of " + model.name + ", which takes" + list);
  };
  for (const std::string& key : in_.keys()) check(key);
  for (const auto& item : values_) check(item.first);
  for (const std::string& key : required) {
    if (!has(key)) {
      throw InputError(file_ + ": " + key + ": missing, " + model.name + " needs it");
    }
  }
}

ModelParameters Parameters::read(const ClosedForm& model) {
  expect(model);
  ModelParameters parameters;
  for (const char* names : {model.required, model.optional}) {
    for (const std::string& key : words(names)) {
      if (has(key)) parameters.values[key] = valuesOf(key);
    }
  }
  return parameters;
}

std::vector<double> Parameters::valuesOf(const std::string& key) {
  switch (parameterKind(key)) {
    case ParameterKind::kWord:
      return {};
    case ParameterKind::kMatrix:
      return matrix(key);
    case ParameterKind::kFlag:
      return {in_.flag(key, false) ? 1.0 : 0.0};
    case ParameterKind::kWhole:
      return {whole(key)};
    case ParameterKind::kNumber:
      break;
  }
  return {number(key)};
}

double Parameters::number(const std::string& key) {
  const auto swept = values_.find(key);
  return swept != values_.end() ? swept->second : in_.number(key, yaml::Range::kAny);
}

double Parameters::whole(const std::string& key) {
  const double value = number(key);
  if (value != std::floor(value) || std::abs(value) > 1e9) {
    in_.refuse(key, value, "give a whole number");
  }
  return value;
}

std::vector<double> Parameters::matrix(const std::string& key) {
  const char* remedy = "give 36 numbers, row by row";
  const YAML::Node node = in_.required(key, remedy);
  const bool rows = node.IsSequence() && node.size() == 6;
  bool good = node.IsSequence() && (node.size() == 36 || rows);
  for (std::size_t i = 0; good && rows && i < 6; ++i) {
    good = node[i].IsSequence() && node[i].size() == 6;
  }
  std::vector<double> values(36);
  for (std::size_t i = 0; good && i < 36; ++i) {
    good = yaml::readNumber(rows ? node[i / 6][i % 6] : node[i], values[i]);
  }
  if (!good) in_.refuse(key, yaml::shown(node), remedy);
  return values;
}

// ---- options ----

bool parseValues(const std::string& given, std::vector<double>& values) {
  values.clear();
  const char separator = given.find(':') == std::string::npos ? ',' : ':';
  std::string part;
  for (std::istringstream parts(given); std::getline(parts, part, separator);) {
    double value = 0.0;
    if (!parseNumber(part, value)) return false;
    values.push_back(value);
  }
  if (values.empty() || given.back() == separator) return false;
  if (separator == ',') return true;
  if (values.size() != 3 || values[2] != std::floor(values[2]) || values[2] < 1 ||
      values[2] > static_cast<double>(kMaxPoints)) {
    return false;
  }
  const double first = values[0], last = values[1];
  const auto count = static_cast<std::size_t>(values[2]);
  values.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double part_of = count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 0;
    values[i] = first * (1 - part_of) + last * part_of;
  }
  return true;
}

bool parseSweep(const std::string& key, const std::string& list, Sweep& to) {
  if (!to.key.empty()) throw InputError("--sweep: value " + key + ": sweep one key only");
  to.key = key;
  return !key.empty() && parseValues(list, to.values);
}

void addSweep(OptionParser& parser, Sweep& to) {
  parser.value("--sweep", "give KEY=VALUES, the values as a list 1,2,5 or FIRST:LAST:COUNT",
               [&to](const std::string& value) {
                 const std::size_t equals = std::min(value.find('='), value.size());
                 return parseSweep(value.substr(0, equals),
                                   value.substr(std::min(equals + 1, value.size())), to);
               });
}

// ---- results ----

Columns evaluate(const ClosedForm& model, const ModelParameters& parameters) {
  const std::vector<ModelValue> values = model.evaluate(parameters);
  const Names names = words(model.results);
  Columns results;
  for (std::size_t i = 0; i < values.size(); ++i) {
    results.push_back({names.at(i), std::visit(CellsOf(), values[i]),
                       std::holds_alternative<std::vector<double>>(values[i])});
  }
  return results;
}

void evaluate(const ClosedForm& model, Parameters& p, const Sweep& sweep, Columns& lists,
              Columns& columns) {
  lists = columns = {{sweep.key, {}, true}};
  for (const double value : sweep.values) {
    p.set(sweep.key, value);
    lists[0].cells.push_back(cellOf(value));
    columns[0].cells.push_back(cellOf(value));
    std::size_t column = 1, list = 1;
    for (const Column& result : evaluate(model, p.read(model))) {
      if (result.list) throw InputError("--sweep: value " + sweep.key + ": not for this model");
      if (lists.size() <= list) lists.push_back({result.name, {}, true});
      const bool pair = result.cells.size() == 2;
      lists[list++].cells.push_back(pair ? joined(result.cells) : result.cells[0]);
      for (std::size_t k = 0; k < result.cells.size(); ++k) {
        const char* part = !pair ? "" : k ? "_im" : "_re";
        if (columns.size() <= column) columns.push_back({result.name + part, {}, true});
        columns[column++].cells.push_back(result.cells[k]);
      }
    }
  }
}

std::string yamlOf(const Columns& results) {
  std::string yaml;
  for (const Column& result : results) {
    const bool single = !result.list && result.cells.size() == 1;
    yaml += result.name + ": " + (single ? result.cells[0] : joined(result.cells)) + '\n';
  }
  return yaml;
}

std::string csvOf(const Columns& columns) {
  std::string csv;
  for (const Column& column : columns) csv += (csv.empty() ? "" : ",") + column.name;
  csv += '\n';
  const std::size_t rows = columns.empty() ? 0 : columns.front().cells.size();
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const std::string& cell = columns[i].cells[row];
      if (i) csv += ',';
      if (cell != "null") csv += cell;
    }
    csv += '\n';
  }
  return csv;
}

void writeOutput(const std::string& file, const std::string& content) {
  std::ofstream stream(file, std::ios::binary);
  stream << content;
  stream.flush();
  if (!stream) throw InputError("--output: value " + file + ": cannot be written, give another");
}

}  // namespace assembly_cell
