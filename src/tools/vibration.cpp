// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Closed forms of vibratory assembly, the rig and the design map, from a flat YAML file.

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/vibration/models.h"

namespace {

using namespace assembly_cell;
using Names = std::vector<std::string>;

constexpr const char* kHelp =
    R"(Usage: vibration MODEL PARAMETERS.yaml [options]

Evaluates a closed form of vibratory assembly and prints the result as YAML. PARAMETERS.yaml is a flat mapping of
numbers in any coherent units (SI; or kg, mm, s with mN); nothing is converted. docs/vibration.md has the equations.

MODEL             parameters -> results
  inertia           m r h -> Ix Iy Iz beta
  chord_inertia     m r h d -> I
  chord_stiffness   kx kz KY h l d -> K
  sdof              I K t t1 th1 thd1 A B C w [c] -> theta theta_dot
  single_contact    m r h K F w alpha t -> theta_x theta_y theta_z
  sliding_ratio     K I w h kx l m g phi theta d -> band w_lower w_upper D p1 p2 p1_inertia p2_inertia
  walking_limit     mu r h -> alpha (half contact angle) overlap
  walk              m g r h K F w cos_alpha cycles -> per single contact: t_lift duration dZ outward_step
                    (along X toward the hole: negative is out of it); mean_step per cycle, tension
  tip_bounce        m g r h l kx K_chord F w alpha (half contact angle) restitution
                    -> t_tip t_impact omega_impact impulse t_flight X_end
  free_flight       m I kx Krot h l r J t g -> w_hi w_lo X Z theta
  rig               x0 M_over_L f_hz K g -> time cycles never
  locus             model m r h F alpha w [l d], and for model -> P N a b psi
                      isotropic, vertical: K [c];  transverse: Kx Ky [cx cy];  double: d K [c]
                      sliding: m k F w mu_N;  general: l K6 [C6 hF g], K6 and C6 36 numbers by rows, order x y z and
                      rotations about x y z, at l above the top; the force at hF above the contact (2h)
  map               m r h g K kx l d phi mu [inertia: true] with --frequency and --force -> one CSV row per point:
                      w,F,theta,p1,p2,outcome; outcome: sticks, assembles (p1 > mu >= p2), slides_both, slides_out,
                      lifts, walks_out

  --sweep KEY=VALUES  repeat for these values of one parameter, which the file may leave out; results become lists
  --times VALUES      the same for t; walk: adds t theta_X theta_Y theta_Z
  --frequency VALUES, --force VALUES    axes of the map [rad/s], [force]
  --output FILE.csv   lists and the map as CSV; standard output then has the map's counts
  --help              print this
VALUES: a list 1,2,5 or FIRST:LAST:COUNT. --map is map.

An undefined result inside valid input is null (an empty cell in CSV).
Exit code: 0 ok, 2 bad input.

Examples: vibration rig rig.yaml --sweep f_hz=0.5,1,4
          vibration map peg.yaml --frequency 1:200:500 --force 0:3000:500 --output map.csv
)";

constexpr std::size_t kMaxPoints = 10000000;  // of a map or a list of values: 1 GB of CSV

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

// the flat mapping of a file, each key read by its type or refused
class Parameters {
 public:
  explicit Parameters(const std::string& file)
      : file_(file), in_(mapping(yaml::loadYaml(textOf(file), file)), "", file_) {}

  void set(const std::string& key, double value) { values_[key] = value; }
  bool has(const std::string& key) const { return values_.count(key) || in_.has(key); }

  // exactly the keys of a model, apart from those that it can do without
  void expect(const VibrationModel& model) const {
    const Names required = words(model.required);
    Names all = required;
    for (const char* more : {model.spare, model.optional}) {
      for (const std::string& name : words(more)) all.push_back(name);
    }
    const auto check = [&](const std::string& key) {
      if (std::find(all.begin(), all.end(), key) != all.end()) return;
      std::string list;
      for (const std::string& name : all) list += " " + name;
      throw InputError(file_ + ": " + key + ": no parameter of " + model.name + ", which takes" +
                       list);
    };
    for (const std::string& key : in_.keys()) check(key);
    for (const auto& item : values_) check(item.first);
    for (const std::string& key : required) {
      if (!has(key)) {
        throw InputError(file_ + ": " + key + ": missing, " + model.name + " needs it");
      }
    }
  }

  // what a model reads, each by its kind
  ModelParameters read(const VibrationModel& model) {
    expect(model);
    ModelParameters parameters;
    for (const char* names : {model.required, model.optional}) {
      for (const std::string& key : words(names)) {
        if (has(key)) parameters.values[key] = valuesOf(key);
      }
    }
    return parameters;
  }

  std::string word(const std::string& key) { return in_.text(key, "give a word"); }

 private:
  // an empty file is one without keys
  static YAML::Node mapping(const YAML::Node& root) {
    return root.IsNull() ? YAML::Node(YAML::NodeType::Map) : root;
  }

  std::vector<double> valuesOf(const std::string& key) {
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

  double number(const std::string& key) {
    const auto swept = values_.find(key);
    return swept != values_.end() ? swept->second : in_.number(key, yaml::Range::kAny);
  }
  double whole(const std::string& key) {
    const double value = number(key);
    if (value != std::floor(value) || std::abs(value) > 1e9) {
      in_.refuse(key, value, "give a whole number");
    }
    return value;
  }
  std::vector<double> matrix(const std::string& key) {
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

  std::string file_;
  yaml::Section in_;
  std::map<std::string, double> values_;
};

// ---- options ----

struct Options {
  std::string model, file, output, sweep_key;
  std::vector<double> sweep, frequency, force;
};

constexpr const char* kValues = "give a list 1,2,5 or FIRST:LAST:COUNT";

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

// false after --help
bool parseOptions(const Names& arguments, Options& o) {
  bool map = false;
  OptionParser parser(kHelp);
  parser.file("model", o.model, false);
  parser.file("file", o.file, false);
  parser.flag("--map", map);
  parser.text("--output", o.output);
  const auto values = [&parser](const std::string& name, std::vector<double>& to) {
    parser.value(name, kValues, [&to](const std::string& value) { return parseValues(value, to); });
  };
  values("--frequency", o.frequency);
  values("--force", o.force);
  const auto sweep = [&o](const std::string& key, const std::string& list) {
    if (!o.sweep_key.empty()) throw InputError("--sweep: value " + key + ": sweep one key only");
    o.sweep_key = key;
    return !key.empty() && parseValues(list, o.sweep);
  };
  parser.value("--times", kValues, [&](const std::string& value) { return sweep("t", value); });
  parser.value("--sweep", "give KEY=VALUES, the values as a list 1,2,5 or FIRST:LAST:COUNT",
               [&](const std::string& value) {
                 const std::size_t equals = std::min(value.find('='), value.size());
                 return sweep(value.substr(0, equals),
                              value.substr(std::min(equals + 1, value.size())));
               });
  if (!parser.parse(arguments)) return false;
  if (map) o.file = std::exchange(o.model, "map");
  if (o.model.empty()) throw InputError("MODEL: value missing: see --help");
  if (!vibrationModel(o.model)) {
    throw InputError("MODEL: value " + o.model + ": unknown, see --help");
  }
  if (o.file.empty()) throw InputError("PARAMETERS.yaml: value missing: see --help");
  if (o.model == "map") {
    if (o.frequency.empty()) throw InputError("--frequency: value missing: map needs it");
    if (o.force.empty()) throw InputError("--force: value missing: map needs it");
    if (!o.sweep_key.empty()) throw InputError("--sweep: value " + o.sweep_key + ": not for map");
    if (o.frequency.size() * o.force.size() > kMaxPoints) {
      throw InputError("--force: value " + std::to_string(o.force.size()) +
                       " points: give at most ten million in all");
    }
  } else if (!o.frequency.empty() || !o.force.empty()) {
    throw InputError("--frequency, --force: value given: only for map");
  }
  return true;
}

// ---- output ----

std::string cellOf(double value) { return yamlNumber(value); }
std::string cellOf(bool value) { return value ? "true" : "false"; }
std::string cellOf(int value) { return std::to_string(value); }
std::string cellOf(const char* value) { return value; }
template <typename Value>
std::string cellOf(const std::optional<Value>& value) {
  return value ? cellOf(*value) : "null";
}

// a result as cells: one, two of a complex number, or those of a list
struct Column {
  std::string name;
  std::vector<std::string> cells;
  bool list = false;
};
using Columns = std::vector<Column>;

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

Columns evaluate(const VibrationModel& model, const ModelParameters& parameters) {
  const std::vector<ModelValue> values = model.evaluate(parameters);
  const Names names = words(model.results);
  Columns results;
  for (std::size_t i = 0; i < values.size(); ++i) {
    results.push_back({names.at(i), std::visit(CellsOf(), values[i]),
                       std::holds_alternative<std::vector<double>>(values[i])});
  }
  return results;
}

std::string joined(const Names& cells) {
  std::string all = "[";
  for (std::size_t i = 0; i < cells.size(); ++i) all += (i ? ", " : "") + cells[i];
  return all + "]";
}

void writeFile(const std::string& file, const std::string& content) {
  std::ofstream stream(file, std::ios::binary);
  stream << content;
  stream.flush();
  if (!stream) throw InputError("--output: value " + file + ": cannot be written, give another");
}

// columns of equal length, header first; null is an empty cell
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

// results of every value of the sweep: lists for YAML, with complex numbers as pairs, and columns
// for CSV, with complex numbers as two
void sweep(const Options& o, Parameters& p, const VibrationModel& model, Columns& lists,
           Columns& columns) {
  lists = columns = {{o.sweep_key, {}, true}};
  for (const double value : o.sweep) {
    p.set(o.sweep_key, value);
    lists[0].cells.push_back(cellOf(value));
    columns[0].cells.push_back(cellOf(value));
    std::size_t column = 1, list = 1;
    for (const Column& result : evaluate(model, p.read(model))) {
      if (result.list) throw InputError("--sweep: value " + o.sweep_key + ": not for this model");
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

Columns walkMotionAt(const std::vector<double>& times, const ModelParameters& parameters) {
  const WalkCase c = walkCase(parameters);
  const Walk w = walk(c);
  Columns columns = {
      {"t", {}, true}, {"theta_X", {}, true}, {"theta_Y", {}, true}, {"theta_Z", {}, true}};
  for (const double t : times) {
    if (t * c.w > 2 * M_PI * c.cycles * (1 + 1e-12)) {
      throw InputError("--times: value " + cellOf(t) + ": give times within the cycles");
    }
    const WalkMotion x = walkMotion(c, w, t);
    const double row[] = {t, x.theta_X, x.theta_Y, x.theta_Z};
    for (std::size_t k = 0; k < 4; ++k) columns[k].cells.push_back(cellOf(row[k]));
  }
  return columns;
}

// the model that a file is for: `locus` names one of several in the file
const VibrationModel& modelOf(const Options& o, Parameters& p) {
  const VibrationModel& model = *vibrationModel(o.model);
  if (o.model != "locus") return model;
  if (!p.has("model")) p.expect(model);
  const VibrationModel* locus = locusModel(p.word("model"));
  if (locus) return *locus;
  throw InputError("model: value " + p.word("model") +
                   ": give isotropic, transverse, vertical, double, general or sliding");
}

void runModel(const Options& o) {
  Parameters p(o.file);
  const bool motion = o.model == "walk" && o.sweep_key == "t";
  const bool swept = !o.sweep_key.empty() && !motion;
  if (swept) p.set(o.sweep_key, o.sweep.front());
  const VibrationModel& model = modelOf(o, p);
  Columns results, columns;
  if (swept) {
    sweep(o, p, model, results, columns);
  } else {
    const ModelParameters parameters = p.read(model);
    results = evaluate(model, parameters);
    if (motion) {
      columns = walkMotionAt(o.sweep, parameters);
      results.insert(results.end(), columns.begin(), columns.end());
    } else {
      std::copy_if(results.begin(), results.end(), std::back_inserter(columns),
                   [](const Column& result) { return result.list; });
    }
    if (!o.output.empty() && columns.empty()) {
      throw InputError("--output: value " + o.output + ": nothing to list, add --sweep or --times");
    }
  }
  std::string yaml;
  for (const Column& result : results) {
    const bool single = !result.list && result.cells.size() == 1;
    yaml += result.name + ": " + (single ? result.cells[0] : joined(result.cells)) + '\n';
  }
  if (!o.output.empty()) writeFile(o.output, csvOf(columns));
  std::cout << yaml;
}

void runMap(const Options& o) {
  const DesignCase c = designCase(Parameters(o.file).read(*vibrationModel("map")));
  std::array<std::size_t, 6> counts{};
  std::string csv = "w,F,theta,p1,p2,outcome\n";
  csv.reserve(o.frequency.size() * o.force.size() * 100);
  Names forces;
  for (const double F : o.force) forces.push_back(cellOf(F));
  for (const double w : o.frequency) {
    const std::string start = cellOf(w) + ',';
    for (std::size_t i = 0; i < o.force.size(); ++i) {
      const DesignPoint x = designPoint(c, w, o.force[i]);
      csv += start;
      csv += forces[i];
      for (const std::optional<double>& value : {std::optional<double>(x.theta), x.p1, x.p2}) {
        csv += ',';
        if (value) csv += cellOf(*value);
      }
      csv += ',';
      csv += toString(x.outcome);
      csv += '\n';
      ++counts[static_cast<std::size_t>(x.outcome)];
    }
  }
  if (o.output.empty()) {
    std::cout << csv;
    return;
  }
  writeFile(o.output, csv);
  for (std::size_t k = 0; k < counts.size(); ++k) {
    std::cout << toString(static_cast<VibrationOutcome>(k)) << ": " << counts[k] << '\n';
  }
}

int run(const Names& arguments) {
  Options o;
  if (!parseOptions(arguments, o)) return 0;
  if (o.model == "map") {
    runMap(o);
  } else {
    runModel(o);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return runTool("vibration", argc, argv, run); }
