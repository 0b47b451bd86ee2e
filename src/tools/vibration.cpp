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
#include "closed_forms/program.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: vibration MODEL PARAMETERS.yaml [options]

Evaluates a closed form of vibratory assembly and prints the result as YAML. PARAMETERS.yaml is a flat mapping of
numbers in any coherent units (SI; or kg, mm, s with mN); nothing is converted. docs/theory/vibration.md has the equations.

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

// ---- options ----

struct Options {
  std::string model, file, output;
  Sweep sweep;
  std::vector<double> frequency, force;
};

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
  parser.value("--times", kValues,
               [&o](const std::string& value) { return parseSweep("t", value, o.sweep); });
  addSweep(parser, o.sweep);
  if (!parser.parse(arguments)) return false;
  if (map) o.file = std::exchange(o.model, "map");
  if (o.model.empty()) throw InputError("MODEL: value missing: see --help");
  if (!vibrationModel(o.model)) {
    throw InputError("MODEL: value " + o.model + ": unknown: vibration --help lists the models");
  }
  if (o.file.empty()) throw InputError("PARAMETERS.yaml: value missing: see --help");
  if (o.model == "map") {
    if (o.frequency.empty()) throw InputError("--frequency: value missing: map needs it");
    if (o.force.empty()) throw InputError("--force: value missing: map needs it");
    if (!o.sweep.key.empty()) throw InputError("--sweep: value " + o.sweep.key + ": not for map");
    if (o.frequency.size() * o.force.size() > kMaxPoints) {
      throw InputError("--force: value " + std::to_string(o.force.size()) +
                       " points: give at most ten million in all");
    }
  } else if (!o.frequency.empty() || !o.force.empty()) {
    throw InputError("--frequency, --force: value given: only for map");
  }
  return true;
}

Columns walkMotionAt(const std::vector<double>& times, const ModelParameters& parameters) {
  const WalkCase c = walkCase(parameters);
  const Walk w = walk(c);
  Columns columns = {
      {"t", {}, true}, {"theta_X", {}, true}, {"theta_Y", {}, true}, {"theta_Z", {}, true}};
  for (const double t : times) {
    if (t * c.w > 2 * M_PI * c.cycles * (1 + 1e-12)) {
      throw InputError("--times: value " + yamlNumber(t) + ": give times within the cycles");
    }
    const WalkMotion x = walkMotion(c, w, t);
    const double row[] = {t, x.theta_X, x.theta_Y, x.theta_Z};
    for (std::size_t k = 0; k < 4; ++k) columns[k].cells.push_back(yamlNumber(row[k]));
  }
  return columns;
}

// the model that a file is for: `locus` names one of several in the file
const ClosedForm& modelOf(const Options& o, Parameters& p) {
  const ClosedForm& model = *vibrationModel(o.model);
  if (o.model != "locus") return model;
  const std::string name = p.has("model") ? p.word("model") : "missing";
  const ClosedForm* locus = locusModel(name);
  if (locus) return *locus;
  throw InputError(o.file + ": model: value " + name +
                   ": give isotropic, transverse, vertical, double, general or sliding");
}

void runModel(const Options& o) {
  Parameters p(o.file);
  const bool motion = o.model == "walk" && o.sweep.key == "t";
  const bool swept = !o.sweep.key.empty() && !motion;
  if (swept) p.set(o.sweep.key, o.sweep.values.front());
  const ClosedForm& model = modelOf(o, p);
  Columns results, columns;
  if (swept) {
    evaluate(model, p, o.sweep, results, columns);
  } else {
    const ModelParameters parameters = p.read(model);
    results = evaluate(model, parameters);
    if (motion) {
      columns = walkMotionAt(o.sweep.values, parameters);
      results.insert(results.end(), columns.begin(), columns.end());
    } else {
      std::copy_if(results.begin(), results.end(), std::back_inserter(columns),
                   [](const Column& result) { return result.list; });
    }
    if (!o.output.empty() && columns.empty()) {
      throw InputError("--output: value " + o.output + ": nothing to list, add --sweep or --times");
    }
  }
  if (!o.output.empty()) writeOutput(o.output, csvOf(columns));
  std::cout << yamlOf(results);
}

void runMap(const Options& o) {
  const DesignCase c = designCase(Parameters(o.file).read(*vibrationModel("map")));
  std::array<std::size_t, 6> counts{};
  std::string csv = "w,F,theta,p1,p2,outcome\n";
  csv.reserve(o.frequency.size() * o.force.size() * 100);
  Names forces;
  for (const double F : o.force) forces.push_back(yamlNumber(F));
  for (const double w : o.frequency) {
    const std::string start = yamlNumber(w) + ',';
    for (std::size_t i = 0; i < o.force.size(); ++i) {
      const DesignPoint x = designPoint(c, w, o.force[i]);
      csv += start;
      csv += forces[i];
      for (const std::optional<double>& value : {std::optional<double>(x.theta), x.p1, x.p2}) {
        csv += ',';
        if (value) csv += yamlNumber(*value);
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
  writeOutput(o.output, csv);
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
