// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Closed forms of vibratory assembly, the rig and the design map, from a flat YAML file.

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "assembly_cell/scene/input_error.h"
#include "assembly_cell/scene/yaml_text.h"
#include "assembly_cell/vibration/bounce.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/locus_model.h"
#include "assembly_cell/vibration/rig.h"
#include "assembly_cell/vibration/single_dof.h"
#include "assembly_cell/vibration/sliding.h"
#include "assembly_cell/vibration/steady_state.h"
#include "assembly_cell/vibration/walking.h"

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

constexpr std::size_t kMostPoints = 10000000;

// one named result: a scalar (one cell), a complex number (two), or a list
struct Result {
  std::string name;
  std::vector<std::string> cells;
  bool list = false;
};
using Results = std::vector<Result>;

std::string text(double value) { return yamlNumber(value); }
std::string text(const std::optional<double>& value) { return value ? yamlNumber(*value) : "null"; }
std::string text(bool value) { return value ? "true" : "false"; }
template <typename Value>
Result scalar(const std::string& name, const Value& value) {
  return {name, {text(value)}, false};
}
Result complexNumber(const std::string& name, std::complex<double> value) {
  return {name, {text(value.real()), text(value.imag())}, false};
}

// the flat mapping of a file, each key read by its type or refused
class Parameters {
 public:
  explicit Parameters(const std::string& file) : file_(file) {
    YAML::Node root;
    try {
      root = YAML::LoadFile(file);
    } catch (const YAML::BadFile&) {
      throw InputError(file + ": cannot be read, give a YAML file");
    } catch (const std::ios_base::failure&) {
      throw InputError(file + ": cannot be read, give a YAML file, not a folder");
    } catch (const YAML::Exception& error) {
      throw InputError(file + ": line " + std::to_string(error.mark.line + 1) +
                       ": not YAML: " + error.msg);
    }
    if (root.IsNull()) return;
    if (!root.IsMap()) throw InputError(file + ": not a mapping, give KEY: NUMBER lines");
    for (const auto& item : root) {
      if (!item.first.IsScalar())
        throw InputError(file + ": a key is not a word, give KEY: NUMBER");
      const std::string key = item.first.Scalar();
      if (!nodes_.emplace(key, item.second).second) {
        throw InputError(file + ": " + key + ": given twice, remove one");
      }
    }
  }

  void set(const std::string& key, double value) { values_[key] = value; }
  bool has(const std::string& key) const { return values_.count(key) || nodes_.count(key); }

  // exactly these keys, apart from the optional ones
  void expect(const std::string& model, const Names& required, const Names& optional = {}) const {
    const auto in = [](const Names& names, const std::string& key) {
      return std::find(names.begin(), names.end(), key) != names.end();
    };
    const auto check = [&](const std::string& key) {
      if (in(required, key) || in(optional, key)) return;
      std::string all;
      for (const Names* names : {&required, &optional}) {
        for (const std::string& name : *names) all += " " + name;
      }
      throw InputError(file_ + ": " + key + ": no parameter of " + model + ", which takes" + all);
    };
    for (const auto& item : nodes_) check(item.first);
    for (const auto& item : values_) check(item.first);
    for (const std::string& key : required) {
      if (!has(key)) throw InputError(file_ + ": " + key + ": missing, " + model + " needs it");
    }
  }

  double number(const std::string& key) const {
    const auto swept = values_.find(key);
    if (swept != values_.end()) return swept->second;
    return numberOf(key, nodes_.at(key));
  }
  double number(const std::string& key, double otherwise) const {
    return has(key) ? number(key) : otherwise;
  }
  int integer(const std::string& key) const {
    const double value = number(key);
    if (value != std::floor(value) || std::abs(value) > 1e9) {
      throw InputError(file_ + ": " + key + ": value " + yamlNumber(value) +
                       ": give a whole number");
    }
    return static_cast<int>(value);
  }
  std::string word(const std::string& key) const {
    const YAML::Node& node = nodes_.at(key);
    if (!node.IsScalar()) throw InputError(file_ + ": " + key + ": give a word");
    return node.Scalar();
  }
  bool boolean(const std::string& key, bool otherwise) const {
    if (!nodes_.count(key)) return otherwise;
    const std::string value = word(key);
    if (value != "true" && value != "false") {
      throw InputError(file_ + ": " + key + ": value " + value + ": give true or false");
    }
    return value == "true";
  }
  SupportMatrix matrix(const std::string& key) const {
    SupportMatrix m = SupportMatrix::Zero();
    if (!has(key)) return m;
    const YAML::Node node = nodes_.at(key);
    const bool rows = node.IsSequence() && node.size() == 6;
    bool good = node.IsSequence() && (node.size() == 36 || rows);
    for (std::size_t i = 0; good && rows && i < 6; ++i) {
      good = node[i].IsSequence() && node[i].size() == 6;
    }
    if (!good) throw InputError(file_ + ": " + key + ": give 36 numbers, row by row");
    for (int i = 0; i < 36; ++i) {
      m(i / 6, i % 6) = numberOf(key, rows ? node[i / 6][i % 6] : node[i]);
    }
    return m;
  }

 private:
  double numberOf(const std::string& key, const YAML::Node& node) const {
    double value = 0.0;
    if (!node.IsScalar() || !parseNumber(node.Scalar(), value)) {
      const std::string given = node.IsScalar() ? node.Scalar() : "not a number";
      throw InputError(file_ + ": " + key + ": value " + given + ": give a finite number");
    }
    return value;
  }

  std::string file_;
  std::map<std::string, YAML::Node> nodes_;
  std::map<std::string, double> values_;
};

// ---- models ----

Results inertia(const Parameters& p) {
  const ContactInertia i = contactInertia(p.number("m"), p.number("r"), p.number("h"));
  return {scalar("Ix", i.Ix), scalar("Iy", i.Iy), scalar("Iz", i.Iz), scalar("beta", i.beta)};
}

Results chordInertiaModel(const Parameters& p) {
  return {scalar("I", chordInertia(p.number("m"), p.number("r"), p.number("h"), p.number("d")))};
}

Results chordStiffnessModel(const Parameters& p) {
  return {scalar("K", chordStiffness(p.number("kx"), p.number("kz"), p.number("KY"), p.number("h"),
                                     p.number("l"), p.number("d")))};
}

Results sdof(const Parameters& p) {
  SingleDof s;
  s.I = p.number("I");
  s.K = p.number("K");
  s.c = p.number("c", 0.0);
  s.A = p.number("A");
  s.B = p.number("B");
  s.C = p.number("C");
  s.w = p.number("w");
  s.t1 = p.number("t1");
  s.th1 = p.number("th1");
  s.thd1 = p.number("thd1");
  const SingleDofState x = singleDof(s, p.number("t"));
  return {scalar("theta", x.theta), scalar("theta_dot", x.theta_dot)};
}

Results singleContactModel(const Parameters& p) {
  const ContactRotation x =
      singleContact(p.number("m"), p.number("r"), p.number("h"), p.number("K"), p.number("F"),
                    p.number("w"), p.number("alpha"), p.number("t"));
  return {scalar("theta_x", x.theta_x), scalar("theta_y", x.theta_y), scalar("theta_z", x.theta_z)};
}

Results slidingRatioModel(const Parameters& p) {
  SlidingCase s;
  s.K = p.number("K");
  s.I = p.number("I");
  s.w = p.number("w");
  s.h = p.number("h");
  s.kx = p.number("kx");
  s.l = p.number("l");
  s.m = p.number("m");
  s.g = p.number("g");
  s.phi = p.number("phi");
  s.theta = p.number("theta");
  s.d = p.number("d");
  const SlidingRatio x = slidingRatio(s);
  return {{"band", {toString(x.band)}, false},
          scalar("w_lower", x.w_lower),
          scalar("w_upper", x.w_upper),
          scalar("D", x.D),
          scalar("p1", x.p1),
          scalar("p2", x.p2),
          scalar("p1_inertia", x.p1_inertia),
          scalar("p2_inertia", x.p2_inertia)};
}

Results walkingLimitModel(const Parameters& p) {
  const WalkingLimit x = walkingLimit(p.number("mu"), p.number("r"), p.number("h"));
  return {scalar("alpha", x.alpha), scalar("overlap", x.overlap)};
}

WalkCase walkCase(const Parameters& p) {
  return {p.number("m"), p.number("g"), p.number("r"),         p.number("h"),      p.number("K"),
          p.number("F"), p.number("w"), p.number("cos_alpha"), p.integer("cycles")};
}

Results walkModel(const Parameters& p) {
  const WalkCase c = walkCase(p);
  const Walk w = walk(c);
  Results results = {
      {"t_lift", {}, true}, {"duration", {}, true}, {"dZ", {}, true}, {"outward_step", {}, true}};
  for (const WalkPhase& phase : w.phases) {
    results[0].cells.push_back(text(phase.t_lift));
    results[1].cells.push_back(text(phase.duration));
    results[2].cells.push_back(text(phase.dZ));
    results[3].cells.push_back(text(phase.outward_step));
  }
  results.push_back(scalar("mean_step", w.dx / c.cycles));
  results.push_back(scalar("tension", w.tension));
  return results;
}

Results tipBounceModel(const Parameters& p) {
  TipCase c;
  c.m = p.number("m");
  c.g = p.number("g");
  c.r = p.number("r");
  c.h = p.number("h");
  c.l = p.number("l");
  c.kx = p.number("kx");
  c.K_chord = p.number("K_chord");
  c.F = p.number("F");
  c.w = p.number("w");
  c.alpha = p.number("alpha");
  c.restitution = p.number("restitution");
  const TipResult x = tipBounce(c);
  return {scalar("t_tip", x.t_tip),
          scalar("t_impact", x.t_impact),
          scalar("omega_impact", x.omega_impact),
          scalar("impulse", x.impulse),
          scalar("t_flight", x.t_flight),
          scalar("X_end", x.X_end)};
}

Results freeFlightModel(const Parameters& p) {
  FreeFlight f;
  f.m = p.number("m");
  f.I = p.number("I");
  f.kx = p.number("kx");
  f.Krot = p.number("Krot");
  f.h = p.number("h");
  f.l = p.number("l");
  f.r = p.number("r");
  f.J = p.number("J");
  f.g = p.number("g");
  const FreeFlightState x = freeFlight(f, p.number("t"));
  return {scalar("w_hi", x.w_hi), scalar("w_lo", x.w_lo), scalar("X", x.X), scalar("Z", x.Z),
          scalar("theta", x.theta)};
}

Results rig(const Parameters& p) {
  const RigResult x = rigAssembly(
      {p.number("x0"), p.number("M_over_L"), p.number("f_hz"), p.number("K"), p.number("g")});
  return {{"time", {x.never ? "null" : text(x.time)}, false},
          {"cycles", {x.never ? "null" : std::to_string(x.cycles)}, false},
          scalar("never", x.never)};
}

Results locus(const Parameters& p) {
  if (!p.has("model")) p.expect("locus", {"model"});
  const std::string model = p.word("model"), name = "locus " + model;
  // geometry that a model does not need may stay in its file
  Names required = {"model", "m", "r", "h", "F", "alpha", "w"}, optional = {"l", "d"};
  const auto take = [&](const Names& needed, const Names& extra) {
    required.insert(required.end(), needed.begin(), needed.end());
    optional.insert(optional.end(), extra.begin(), extra.end());
    p.expect(name, required, optional);
  };
  const auto body = [&] {
    return LocusCase{p.number("m"), p.number("r"), p.number("h"),
                     p.number("F"), p.number("w"), p.number("alpha")};
  };
  PlanarLocus x;
  if (model == "isotropic") {
    take({"K"}, {"c"});
    x = isotropicLocus(body(), p.number("K"), p.number("c", 0.0));
  } else if (model == "vertical") {
    take({"K"}, {"c"});
    x = verticalLocus(body(), p.number("K"), p.number("c", 0.0));
  } else if (model == "transverse") {
    take({"Kx", "Ky"}, {"cx", "cy"});
    x = transverseLocus(body(), p.number("Kx"), p.number("Ky"), p.number("cx", 0.0),
                        p.number("cy", 0.0));
  } else if (model == "double") {
    take({"d", "K"}, {"c"});
    x = doubleContactLocus(body(), p.number("d"), p.number("K"), p.number("c", 0.0));
  } else if (model == "sliding") {
    required = {"model", "m", "k", "F", "w", "mu_N"};
    take({}, {"r", "h", "alpha"});
    x = slidingLocus(p.number("m"), p.number("k"), p.number("F"), p.number("mu_N"), p.number("w"));
  } else if (model == "general") {
    take({"l", "K6"}, {"C6", "hF", "g"});
    const LocusCase s = body();
    x = generalLocus(s, p.number("l"), p.number("hF", 2 * s.h), p.number("g", 0.0), p.matrix("K6"),
                     p.matrix("C6"));
  } else {
    throw InputError("model: value " + model +
                     ": give isotropic, transverse, vertical, double, general or sliding");
  }
  return {complexNumber("P", x.P),
          complexNumber("N", x.N),
          scalar("a", x.a),
          scalar("b", x.b),
          {"psi", {x.has_direction ? text(x.psi) : "null"}, false}};
}

struct Model {
  Names required, optional;
  Results (*evaluate)(const Parameters&);
};

const std::map<std::string, Model>& models() {
  static const std::map<std::string, Model> kModels = {
      {"inertia", {{"m", "r", "h"}, {}, inertia}},
      {"chord_inertia", {{"m", "r", "h", "d"}, {}, chordInertiaModel}},
      {"chord_stiffness", {{"kx", "kz", "KY", "h", "l", "d"}, {}, chordStiffnessModel}},
      {"sdof", {{"I", "K", "t", "t1", "th1", "thd1", "A", "B", "C", "w"}, {"c"}, sdof}},
      {"single_contact", {{"m", "r", "h", "K", "F", "w", "alpha", "t"}, {}, singleContactModel}},
      {"sliding_ratio",
       {{"K", "I", "w", "h", "kx", "l", "m", "g", "phi", "theta", "d"}, {}, slidingRatioModel}},
      {"walking_limit", {{"mu", "r", "h"}, {}, walkingLimitModel}},
      {"walk", {{"m", "g", "r", "h", "K", "F", "w", "cos_alpha", "cycles"}, {}, walkModel}},
      {"tip_bounce",
       {{"m", "g", "r", "h", "l", "kx", "K_chord", "F", "w", "alpha", "restitution"},
        {},
        tipBounceModel}},
      {"free_flight",
       {{"m", "I", "kx", "Krot", "h", "l", "r", "J", "t", "g"}, {}, freeFlightModel}},
      {"rig", {{"x0", "M_over_L", "f_hz", "K", "g"}, {}, rig}},
      {"locus", {{}, {}, locus}},
  };
  return kModels;
}

// ---- options ----

struct Options {
  std::string model, file, output, sweep_key;
  std::vector<double> sweep, frequency, force;
  bool help = false;
};

std::vector<double> parseValues(const std::string& option, const std::string& given) {
  const auto refused = [&]() -> InputError {
    return InputError(option + ": value " + given + ": give a list 1,2,5 or FIRST:LAST:COUNT");
  };
  std::vector<double> values;
  const char separator = given.find(':') == std::string::npos ? ',' : ':';
  std::string part;
  for (std::istringstream parts(given); std::getline(parts, part, separator);) {
    double value = 0.0;
    if (!parseNumber(part, value)) throw refused();
    values.push_back(value);
  }
  if (values.empty() || given.back() == separator) throw refused();
  if (separator == ',') return values;
  if (values.size() != 3 || values[2] != std::floor(values[2]) || values[2] < 1 ||
      values[2] > static_cast<double>(kMostPoints)) {
    throw refused();
  }
  const double first = values[0], last = values[1];
  const auto count = static_cast<std::size_t>(values[2]);
  values.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double part_of = count > 1 ? static_cast<double>(i) / static_cast<double>(count - 1) : 0;
    values[i] = first * (1 - part_of) + last * part_of;
  }
  return values;
}

Options parseOptions(const Names& arguments) {
  Options o;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& name = arguments[i];
    if (name == "--help" || name == "-h") {
      o.help = true;
      return o;
    }
    if (name.rfind("--", 0) != 0 || (name == "--map" && o.model.empty())) {
      std::string& place = o.model.empty() ? o.model : o.file;
      if (!place.empty()) throw InputError("argument: value " + name + ": too many, see --help");
      place = name == "--map" ? "map" : name;
      continue;
    }
    if (name != "--sweep" && name != "--times" && name != "--frequency" && name != "--force" &&
        name != "--output") {
      throw InputError("argument: value " + name + ": unknown option, see --help");
    }
    if (i + 1 == arguments.size()) throw InputError(name + ": value missing: see --help");
    const std::string& value = arguments[++i];
    if (name == "--output") {
      if (value.empty()) throw InputError(name + ": value empty: give a file");
      o.output = value;
    } else if (name == "--frequency") {
      o.frequency = parseValues(name, value);
    } else if (name == "--force") {
      o.force = parseValues(name, value);
    } else {
      if (!o.sweep_key.empty())
        throw InputError(name + ": value " + value + ": sweep one key only");
      const std::size_t equals = value.find('=');
      if (name == "--sweep" && (equals == std::string::npos || equals == 0)) {
        throw InputError(name + ": value " + value + ": give KEY=VALUES");
      }
      o.sweep_key = name == "--times" ? "t" : value.substr(0, equals);
      o.sweep = parseValues(name, name == "--times" ? value : value.substr(equals + 1));
    }
  }
  if (o.model.empty()) throw InputError("MODEL: value missing: see --help");
  if (o.model != "map" && !models().count(o.model)) {
    throw InputError("MODEL: value " + o.model + ": unknown, see --help");
  }
  if (o.file.empty()) throw InputError("PARAMETERS.yaml: value missing: see --help");
  if (o.model == "map") {
    if (o.frequency.empty()) throw InputError("--frequency: value missing: map needs it");
    if (o.force.empty()) throw InputError("--force: value missing: map needs it");
    if (!o.sweep_key.empty()) throw InputError("--sweep: value " + o.sweep_key + ": not for map");
    if (o.frequency.size() * o.force.size() > kMostPoints) {
      throw InputError("--force: value " + std::to_string(o.force.size()) +
                       " points: give at most ten million in all");
    }
  } else if (!o.frequency.empty() || !o.force.empty()) {
    throw InputError("--frequency, --force: value given: only for map");
  }
  return o;
}

// ---- output ----

std::string joined(const std::vector<std::string>& cells) {
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
std::string csvOf(const Results& columns) {
  std::string csv;
  for (const Result& column : columns) csv += (csv.empty() ? "" : ",") + column.name;
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

// results of every value of the sweep, as columns of cells; complex numbers as pairs for YAML
void sweep(const Options& o, Parameters& p, const std::function<Results()>& evaluate,
           std::string& yaml, std::string& csv) {
  Results columns = {{o.sweep_key, {}, true}}, lists = columns;
  for (const double value : o.sweep) {
    p.set(o.sweep_key, value);
    const Results results = evaluate();
    columns[0].cells.push_back(text(value));
    lists[0].cells.push_back(text(value));
    std::size_t column = 1, list = 1;
    for (const Result& result : results) {
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
  for (const Result& list : lists) yaml += list.name + ": " + joined(list.cells) + '\n';
  csv = csvOf(columns);
}

void runModel(const Options& o) {
  Parameters p(o.file);
  const Model& model = models().at(o.model);
  const bool motion = o.model == "walk" && o.sweep_key == "t";
  if (!o.sweep_key.empty() && !motion) p.set(o.sweep_key, o.sweep.front());
  if (o.model != "locus") p.expect(o.model, model.required, model.optional);
  std::string yaml, csv;
  if (!o.sweep_key.empty() && !motion) {
    sweep(
        o, p, [&] { return model.evaluate(p); }, yaml, csv);
  } else {
    Results results = model.evaluate(p), columns;
    if (motion) {
      const WalkCase c = walkCase(p);
      const Walk w = walk(c);
      columns = {
          {"t", {}, true}, {"theta_X", {}, true}, {"theta_Y", {}, true}, {"theta_Z", {}, true}};
      for (const double t : o.sweep) {
        if (t * c.w > 2 * 3.141592653589793 * c.cycles * (1 + 1e-12)) {
          throw InputError("--times: value " + text(t) + ": give times within the cycles");
        }
        const WalkMotion x = walkMotion(c, w, t);
        columns[0].cells.push_back(text(t));
        columns[1].cells.push_back(text(x.theta_X));
        columns[2].cells.push_back(text(x.theta_Y));
        columns[3].cells.push_back(text(x.theta_Z));
      }
      results.insert(results.end(), columns.begin(), columns.end());
    } else {
      std::copy_if(results.begin(), results.end(), std::back_inserter(columns),
                   [](const Result& result) { return result.list; });
    }
    if (!o.output.empty() && columns.empty()) {
      throw InputError("--output: value " + o.output + ": nothing to list, add --sweep or --times");
    }
    for (const Result& result : results) {
      const bool single = !result.list && result.cells.size() == 1;
      yaml += result.name + ": " + (single ? result.cells[0] : joined(result.cells)) + '\n';
    }
    csv = csvOf(columns);
  }
  if (!o.output.empty()) writeFile(o.output, csv);
  std::cout << yaml;
}

void runMap(const Options& o) {
  const Parameters p(o.file);
  p.expect("map", {"m", "r", "h", "g", "K", "kx", "l", "d", "phi", "mu"}, {"inertia"});
  DesignCase c;
  c.m = p.number("m");
  c.r = p.number("r");
  c.h = p.number("h");
  c.g = p.number("g");
  c.K = p.number("K");
  c.kx = p.number("kx");
  c.l = p.number("l");
  c.d = p.number("d");
  c.phi = p.number("phi");
  c.mu = p.number("mu");
  c.inertia = p.boolean("inertia", true);
  std::array<std::size_t, 6> counts{};
  std::string csv = "w,F,theta,p1,p2,outcome\n";
  csv.reserve(o.frequency.size() * o.force.size() * 100);
  std::vector<std::string> forces;
  for (const double F : o.force) forces.push_back(text(F));
  for (const double w : o.frequency) {
    const std::string start = text(w) + ',';
    for (std::size_t i = 0; i < o.force.size(); ++i) {
      const DesignPoint x = designPoint(c, w, o.force[i]);
      csv += start;
      csv += forces[i];
      for (const std::optional<double>& value : {std::optional<double>(x.theta), x.p1, x.p2}) {
        csv += ',';
        if (value) csv += text(*value);
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

}  // namespace

int main(int argc, char** argv) {
  try {
    const Options options = parseOptions(Names(argv + 1, argv + argc));
    if (options.help) {
      std::cout << kHelp;
    } else if (options.model == "map") {
      runMap(options);
    } else {
      runModel(options);
    }
    return 0;
  } catch (const InputError& error) {
    std::cerr << "vibration: " << error.what() << '\n';
  } catch (const std::exception& error) {
    std::cerr << "vibration: " << error.what() << '\n';
  }
  return 2;
}
