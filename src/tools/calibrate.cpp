// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "assembly_cell/calibration/displacement.h"
#include "assembly_cell/calibration/force.h"
#include "assembly_cell/calibration/linearity.h"
#include "assembly_cell/calibration/payload_command.h"
#include "assembly_cell/calibration/plan.h"
#include "assembly_cell/calibration/rig.h"
#include "assembly_cell/calibration/store.h"
#include "assembly_cell/scene/bag.h"
#include "assembly_cell/scene/input_error.h"
#include "assembly_cell/scene/yaml_text.h"
#include "assembly_cell/sensor/calibration.h"

using namespace assembly_cell;

namespace {

constexpr const char* kHelp =
    R"(usage: calibrate plan NAME [--seed N] [--observations FILE] [--next K] [--simulate FILE] [--bits B] [--nonlinearity X]
       calibrate solve FILE [--procedure P] [--model M] [--displacement] [--save FOLDER] [--id ID]
       calibrate check FILE [--observations FILE]
       calibrate payload POSES.csv WRENCHES.csv [options]   see calibrate payload --help

plan   the tests of a plan, judged before anything is measured: rank, condition, degrees of freedom, predicted
       standard deviation. NAME: recommended, quadratic, displacement, thesis_fixed, thesis_shifted.
       --observations FILE --next K   instead of a plan: the K tests that add most to these observations (NAME: next)
       --simulate FILE                carries the plan out on the simulated bench and writes an observation file
       --bits 10|16|24, --nonlinearity 0..1, --samples N   of the simulated sensors (16, 1, 20)
solve  both sensors from an observation file (.yaml, or .csv by named columns) or a .bag of the server's ~observations
       --procedure all_rows|force_rows|thesis   (all_rows; the others are for comparison and refused for use)
       --model automatic|linear|quadratic       --rated FORCE,TORQUE [N],[N m] (50,2)
       --displacement                           identifies the displacement from its tests as well
       --save FOLDER [--id ID]                  writes FOLDER/<serial number>/<ID>.yaml of each sensor
check  a calibration file (its checksum, what it says), or an observation file (what is in it, what would be dropped,
       linearity tests); with --observations: a calibration file against observations it was not made from
Example: calibrate plan recommended --nonlinearity 0 --simulate tests.yaml && calibrate solve tests.yaml --save .
Exit: 0 ok, 1 refused by a check, 2 bad input. Format of the files: docs/calibration.md
)";

using Arguments = std::map<std::string, std::string>;

// An observation file, or a bag of the server's ~observations, whose last message is one.
ObservationSet readRecorded(const std::string& path) {
  namespace fs = std::filesystem;
  if (fs::path(path).extension() != ".bag") return readObservations(path);
  const std::string text = textFromBag("observations", path);
  std::string file = (fs::temp_directory_path() / "observations_XXXXXX.yaml").string();
  const int opened = mkstemps(file.data(), 5);
  if (opened < 0) throw InputError(file + ": can't be written: free space in the temporary folder");
  close(opened);
  std::ofstream(file) << text;
  try {
    const ObservationSet set = readObservations(file);
    fs::remove(file);
    return set;
  } catch (const InputError&) {
    fs::remove(file);
    throw;
  }
}

Arguments parse(const std::vector<std::string>& given, std::vector<std::string>& positional,
                const std::map<std::string, bool>& known) {
  Arguments out;
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (given[i].rfind("--", 0) != 0) {
      positional.push_back(given[i]);
      continue;
    }
    const auto option = known.find(given[i]);
    if (option == known.end()) {
      throw InputError(given[i] + ": no known option: see --help");
    }
    if (out.count(given[i]) > 0) throw InputError(given[i] + ": is there twice: give it once");
    if (!option->second) {
      out[given[i]] = "";
    } else if (i + 1 < given.size()) {
      const std::string key = given[i];
      out[key] = given[++i];
    } else {
      throw InputError(given[i] + ": value missing: see --help");
    }
  }
  return out;
}

double number(const Arguments& arguments, const char* key, double fallback) {
  const auto found = arguments.find(key);
  if (found == arguments.end()) return fallback;
  double value = 0.0;
  if (!parseNumber(found->second, value)) {
    throw InputError(std::string(key) + ": value is '" + found->second + "': give a number");
  }
  return value;
}

long integer(const Arguments& arguments, const char* key, long fallback, long least, long most) {
  const auto found = arguments.find(key);
  if (found == arguments.end()) return fallback;
  long value = 0;
  if (!parseInteger(found->second, value) || value < least || value > most) {
    throw InputError(std::string(key) + ": value is '" + found->second + "': give a whole number " +
                     std::to_string(least) + " to " + std::to_string(most));
  }
  return value;
}

template <typename Value>
Value choice(const std::string& key, const std::string& given,
             const std::vector<std::pair<std::string, Value>>& values) {
  std::string names;
  for (const auto& [name, value] : values) {
    if (name == given) return value;
    names += (names.empty() ? "" : ", ") + name;
  }
  throw InputError(key + ": value is '" + given + "': give one of " + names);
}

std::string list(const Eigen::VectorXd& v) {
  std::string out = "[";
  for (Eigen::Index i = 0; i < v.size(); ++i) out += (i > 0 ? ", " : "") + yamlNumber(v[i]);
  return out + "]";
}

void line(const std::string& key, const std::string& value) {
  std::cout << key << ": " << value << "\n";
}

void printMatrix(const std::string& key, const Eigen::MatrixXd& m) {
  if (m.size() == 0) return line(key, "null");
  std::cout << key << ":\n  rows: " << m.rows() << "\n  cols: " << m.cols() << "\n  data: [";
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) {
      std::cout << (i + j > 0 ? ", " : "") << yamlNumber(m(i, j));
    }
  }
  std::cout << "]\n";
}

void printGates(const std::vector<Gate>& gates, const std::string& indent = "") {
  std::cout << indent << "gates:\n";
  for (const Gate& gate : gates) {
    std::cout << indent << "  - {name: " << gate.name << ", verdict: "
              << (gate.verdict == Verdict::kPass   ? "pass"
                  : gate.verdict == Verdict::kWarn ? "warn"
                                                   : "refuse")
              << ", value: " << yamlNumber(gate.value) << ", limit: " << yamlNumber(gate.limit);
    if (!gate.text.empty()) std::cout << ", text: " << yamlQuoted(gate.text);
    std::cout << "}\n";
  }
}

void printForce(const ForceSolution& s, bool matrices) {
  line("accepted", s.accepted ? "true" : "false");
  line("message", yamlQuoted(s.message));
  line("model", s.quadratic ? "quadratic" : "linear");
  line("rank", std::to_string(s.rank));
  line("unknowns", std::to_string(s.unknowns));
  line("equations", std::to_string(s.equations));
  line("condition", yamlNumber(s.condition));
  line("dof", std::to_string(s.dof));
  line("weak_direction", yamlQuoted(s.weak_direction));
  const bool predicted = s.covariance.size() > 0;
  line("predicted_sd_a", predicted ? list(s.predicted_sd_a) : "null");
  line("predicted_sd_b", predicted ? list(s.predicted_sd_b) : "null");
  if (matrices) {
    line("chi2", yamlNumber(s.chi2));
    line("chi2_per_dof", yamlNumber(s.dof > 0 ? s.chi2 / s.dof : std::nan("")));
    line("p", yamlNumber(s.p));
    line("residual_rms", list(s.residual_rms));
    line("hold_out_rms", yamlNumber(s.hold_out_rms));
    line("hold_out_tests", std::to_string(s.hold_out_tests));
    const bool none = std::all_of(s.tests.begin(), s.tests.end(),
                                  [](const TestResult& test) { return test.dropped.empty(); });
    std::cout << "dropped:" << (none ? " []" : "") << "\n";
    for (const TestResult& test : s.tests) {
      if (!test.dropped.empty()) {
        std::cout << "  - {observation: " << test.observation
                  << ", reason: " << yamlQuoted(test.dropped)
                  << ", normalised: " << yamlNumber(test.normalised) << "}\n";
      }
    }
    printMatrix("S_a", s.S_a);
    printMatrix("S_b", s.S_b);
  }
  printGates(s.gates);
}

int plan(const std::vector<std::string>& given) {
  std::vector<std::string> positional;
  const Arguments arguments = parse(given, positional,
                                    {{"--seed", true},
                                     {"--observations", true},
                                     {"--next", true},
                                     {"--simulate", true},
                                     {"--bits", true},
                                     {"--nonlinearity", true},
                                     {"--samples", true}});
  if (positional.size() != 1) {
    throw InputError(
        "plan: give one NAME: recommended, quadratic, displacement, thesis_fixed, "
        "thesis_shifted or next");
  }
  const auto seed = static_cast<std::uint64_t>(integer(arguments, "--seed", 1, 0, 1000000000));
  RigSettings settings;
  settings.seed = seed + 1000;
  settings.bits = static_cast<int>(integer(arguments, "--bits", 16, 10, 24));
  settings.nonlinearity = number(arguments, "--nonlinearity", 1.0);
  settings.samples = static_cast<int>(integer(arguments, "--samples", 20, 1, 100000));
  CalibrationRig rig(settings);
  ObservationSet set = rig.description();
  if (arguments.count("--observations") > 0) {
    set = readRecorded(arguments.at("--observations"));
  }
  std::vector<LoadRequest> requests;
  if (positional[0] == "next") {
    const auto count = static_cast<std::size_t>(integer(arguments, "--next", 6, 1, 1000));
    const std::vector<LoadRequest> candidates = standardCandidates({}, seed);
    const NextTests next = nextTests(set, candidates, count);
    line("weak_direction_before", yamlQuoted(next.weak_direction_before));
    line("weak_direction_after", yamlQuoted(next.weak_direction_after));
    std::cout << "tests:\n";
    for (std::size_t i = 0; i < next.chosen.size(); ++i) {
      std::cout << "  - {gain: " << yamlNumber(next.gain[i])
                << ", do: " << yamlQuoted(describe(candidates[next.chosen[i]])) << "}\n";
    }
    printForce(next.after, false);
    return next.after.accepted ? 0 : 1;
  }
  const PlanName name = choice<PlanName>("plan", positional[0],
                                         {{"recommended", PlanName::kRecommended},
                                          {"quadratic", PlanName::kQuadratic},
                                          {"displacement", PlanName::kDisplacement},
                                          {"thesis_fixed", PlanName::kThesisFixed},
                                          {"thesis_shifted", PlanName::kThesisShifted}});
  requests = makePlan(name, set, {}, seed);
  std::cout << "tests:\n";
  for (const LoadRequest& request : requests) {
    std::cout << "  - " << yamlQuoted(describe(request)) << "\n";
  }
  bool good = true;
  if (name != PlanName::kDisplacement) {
    ForceSettings force;
    if (name == PlanName::kQuadratic) force.model = StrainModel::kQuadratic;
    const ForceSolution judged = judgeDesign(predictPlan(requests, set), force);
    printForce(judged, false);
    good = judged.accepted;
  }
  if (arguments.count("--simulate") > 0) {
    for (const LoadRequest& request : requests) set.observations.push_back(rig.measure(request));
    writeObservations(set, arguments.at("--simulate"));
    std::cerr << "calibrate: " << set.observations.size() << " observations written\n";
  }
  return good ? 0 : 1;
}

int solve(const std::vector<std::string>& given) {
  std::vector<std::string> positional;
  const Arguments arguments = parse(given, positional,
                                    {{"--procedure", true},
                                     {"--model", true},
                                     {"--rated", true},
                                     {"--displacement", false},
                                     {"--save", true},
                                     {"--id", true}});
  if (positional.size() != 1) throw InputError("solve: give one observation file");
  ForceSettings settings;
  if (arguments.count("--procedure") > 0) {
    settings.procedure = choice<ForceProcedure>("--procedure", arguments.at("--procedure"),
                                                {{"all_rows", ForceProcedure::kAllRows},
                                                 {"force_rows", ForceProcedure::kForceRows},
                                                 {"thesis", ForceProcedure::kThesis}});
  }
  if (arguments.count("--model") > 0) {
    settings.model = choice<StrainModel>("--model", arguments.at("--model"),
                                         {{"automatic", StrainModel::kAutomatic},
                                          {"linear", StrainModel::kLinear},
                                          {"quadratic", StrainModel::kQuadratic}});
  }
  if (arguments.count("--rated") > 0) {
    const std::string& text = arguments.at("--rated");
    const std::size_t comma = std::min(text.find(','), text.size());
    if (comma == text.size() || !parseNumber(text.substr(0, comma), settings.rated.force) ||
        !parseNumber(text.substr(comma + 1), settings.rated.torque) ||
        !(settings.rated.force > 0.0) || !(settings.rated.torque > 0.0)) {
      throw InputError("--rated: value is '" + text + "': give FORCE,TORQUE above 0");
    }
  }
  const ObservationSet set = readRecorded(positional[0]);
  const bool displacement = arguments.count("--displacement") > 0;
  std::array<Calibration, 2> calibrations;
  bool good = true;
  if (displacement) {
    for (const Side side : {Side::kA, Side::kB}) {
      const DisplacementSolution d = solveDisplacement(set, side);
      std::cout << "displacement_" << toString(side)
                << ": {accepted: " << (d.accepted ? "true" : "false")
                << ", message: " << yamlQuoted(d.message) << ", tests: " << d.tests
                << ", rank: " << d.rank << ", condition: " << yamlNumber(d.condition)
                << ", residual_sd: " << list(d.residual_sd) << "}\n";
      good = good && d.accepted;
      if (d.accepted) applyDisplacement(d, calibrations[side == Side::kA ? 0 : 1]);
    }
    if (good) {
      settings.displacement_a = &calibrations[0];
      settings.displacement_b = &calibrations[1];
    }
  }
  const bool forces =
      std::any_of(set.observations.begin(), set.observations.end(), [](const Observation& o) {
        return o.kind == ObservationKind::kReacting || o.kind == ObservationKind::kWeight ||
               o.kind == ObservationKind::kIndentation;
      });
  if (displacement && !forces && arguments.count("--save") == 0) return good ? 0 : 1;
  const ForceSolution solution = solveForce(set, settings);
  printForce(solution, true);
  good = good && solution.accepted;
  if (!good) {
    std::cerr << "calibrate: " << solution.message << "\n";
    return 1;
  }
  if (arguments.count("--save") > 0) {
    const std::string& folder = arguments.at("--save");
    for (const Side side : {Side::kA, Side::kB}) {
      Calibration& c = calibrations[side == Side::kA ? 0 : 1];
      applyForce(solution, set, side, c);
      if (c.serial_number.empty()) c.serial_number = std::string("sensor_") + toString(side);
      c.id = arguments.count("--id") > 0 ? arguments.at("--id")
                                         : newCalibrationId(folder, c.serial_number);
      c.date = newCalibrationId(folder, c.serial_number).substr(0, 10);
      const std::string path = calibrationPath(folder, c.serial_number, c.id);
      makeCalibrationFolder(folder, c.serial_number);
      saveCalibration(c, path);
      line(std::string("saved_") + toString(side), yamlQuoted(path));
    }
  }
  return 0;
}

bool isObservationFile(const std::string& path) {
  if (path.size() > 4 && path.compare(path.size() - 4, 4, ".csv") == 0) return true;
  std::ifstream file(path);
  if (!file) throw InputError(path + ": file can't be read: give an existing file");
  for (std::string text; std::getline(file, text);) {
    if (text.rfind("format:", 0) == 0) return text.find("observations") != std::string::npos;
  }
  return false;
}

int check(const std::vector<std::string>& given) {
  std::vector<std::string> positional;
  const Arguments arguments = parse(given, positional, {{"--observations", true}});
  if (positional.size() != 1) throw InputError("check: give one file");
  if (!isObservationFile(positional[0])) {
    const Calibration c = loadCalibration(positional[0]);
    line("id", yamlQuoted(c.id));
    line("serial_number", yamlQuoted(c.serial_number));
    line("date", yamlQuoted(c.date));
    line("checksum", yamlQuoted(calibrationChecksum(c)));
    line("model", c.quadratic_wrench ? "quadratic" : "linear");
    line("temperature", yamlNumber(c.temperature));
    line("chi2_per_dof",
         yamlNumber(c.wrench_fit.dof > 0 ? c.wrench_fit.chi2 / c.wrench_fit.dof : std::nan("")));
    line("predicted_sd", list(c.wrench_fit.predicted_sd));
    line("observations", yamlQuoted(c.observations_digest));
    if (arguments.count("--observations") == 0) return 0;

    // weights that it was not made from
    const ObservationSet set = readRecorded(arguments.at("--observations"));
    double force = 0.0, torque = 0.0;
    int count = 0;
    Calibration zeroed = c;
    for (const Observation& o : set.observations) {
      const Side side = c.serial_number == set.b.serial_number ? Side::kB : Side::kA;
      const auto& reading = side == Side::kA ? o.a : o.b;
      if (!reading) continue;
      if (o.kind == ObservationKind::kUnloaded) zeroed.zero_volts = reading->volts;
      if (o.kind != ObservationKind::kWeight || o.side != side) continue;
      const Eigen::Vector3d F = o.mass * set.gravity * o.direction;
      Vector6 error = wrenchFromVolts(zeroed, reading->volts);
      error.head<3>() -= F;
      error.tail<3>() -= o.point.cross(F);
      force += error.head<3>().squaredNorm();
      torque += error.tail<3>().squaredNorm();
      ++count;
    }
    line("weights", std::to_string(count));
    line("force_error_rms", yamlNumber(count > 0 ? std::sqrt(force / 3 / count) : std::nan("")));
    line("torque_error_rms", yamlNumber(count > 0 ? std::sqrt(torque / 3 / count) : std::nan("")));
    return 0;
  }
  const ObservationSet set = readRecorded(positional[0]);
  std::map<std::string, int> counts;
  bool good = true;
  std::string bad;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    ++counts[toString(o.kind)];
    for (const auto& [reading, sensor, side] :
         {std::tuple{&o.a, &set.a, "a"}, std::tuple{&o.b, &set.b, "b"}}) {
      if (!*reading) continue;
      const std::string why = unusable(**reading, *sensor);
      if (why.empty()) continue;
      good = false;
      bad += "  - {observation: " + std::to_string(i) + ", sensor: " + side +
             ", reason: " + yamlQuoted(why) + "}\n";
    }
  }
  std::cout << (bad.empty() ? "unusable: []\n" : "unusable:\n" + bad) << "counts: {";
  bool first = true;
  for (const auto& [kind, count] : counts) {
    std::cout << (first ? "" : ", ") << kind << ": " << count;
    first = false;
  }
  std::cout << "}\nlinearity:" << (counts.count("linearity") > 0 ? "" : " []") << "\n";
  for (const Side side : {Side::kA, Side::kB}) {
    for (int channel = 0; channel < 6; ++channel) {
      const auto steps = linearitySteps(set, side, channel);
      if (steps.empty()) continue;
      const LinearityResult r = testLinearity(steps);
      std::cout << "  - {sensor: " << toString(side) << ", channel: " << channel
                << ", slope: " << yamlNumber(r.slope)
                << ", nonlinearity: " << yamlNumber(r.nonlinearity)
                << ", hysteresis: " << yamlNumber(r.hysteresis)
                << ", quadratic: " << yamlNumber(r.quadratic)
                << ", quadratic_t: " << yamlNumber(r.quadratic_t)
                << ", lack_of_fit_f: " << yamlNumber(r.lack_of_fit_f)
                << ", lack_of_fit_p: " << yamlNumber(r.lack_of_fit_p)
                << ", linear_model_allowed: " << (r.linear_model_allowed ? "true" : "false")
                << "}\n";
      good = good && r.linear_model_allowed;
    }
  }
  line("digest", yamlQuoted(observationsDigest(set)));
  return good ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  try {
    // has a help of its own
    if (!arguments.empty() && arguments[0] == "payload") {
      return assembly_cell::payloadCommand(argc - 1, argv + 1);
    }
    if (arguments.empty()) {
      throw InputError("command missing: give plan, solve, check or payload, see --help");
    }
    if (arguments[0] == "--help" || (arguments.size() > 1 && arguments[1] == "--help")) {
      std::cout << kHelp;
      return 0;
    }
    const std::vector<std::string> rest(arguments.begin() + 1, arguments.end());
    if (arguments[0] == "plan") return plan(rest);
    if (arguments[0] == "solve") return solve(rest);
    if (arguments[0] == "check") return check(rest);
    throw InputError("command is '" + arguments[0] +
                     "': give plan, solve, check or payload, see --help");
  } catch (const InputError& error) {
    std::cerr << "calibrate: " << error.what() << "\n";
    return 2;
  }
}
