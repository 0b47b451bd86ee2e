// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/calibration/common/store.h"
#include "assembly_cell/calibration/two_sensor/linearity.h"
#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/rig.h"
#include "assembly_cell/calibration/two_sensor/session.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/calibration.h"
#include "calibrate/commands.h"
#include "calibrate/print.h"

using namespace assembly_cell;

namespace {

constexpr const char* kHelp =
    R"(usage: calibrate plan NAME [--seed N] [--observations FILE] [--next K] [--simulate FILE] [--bits B] [--nonlinearity X]
       calibrate solve FILE [--procedure P] [--model M] [--displacement] [--save FOLDER] [--id ID]
       calibrate check FILE [--observations FILE]
       calibrate reference RUN... [--holdout RUN] [options]     a sensor against a reference in series
       calibrate deadweights FILE.csv [options]                 known loads and readings
       calibrate payload POSES.csv WRENCHES.csv [options]       weight, centre of mass and bias; each has a --help

plan   the tests of a plan, checked before anything is measured: rank, condition, degrees of freedom, predicted
       standard deviation. NAME: recommended, quadratic, displacement, thesis_fixed, thesis_shifted.
       --observations FILE --next K   instead of a plan: the K tests that add most to these observations (NAME: next)
       --simulate FILE                carries the plan out on the simulated bench and writes an observation file
       --bits 10|16|24, --nonlinearity 0..1, --samples N   of the simulated sensors (16, 1, 20)
solve  both sensors from an observation file (.yaml, or .csv by named columns) or a .bag of the server's ~observations
       --procedure all_rows|force_rows|thesis   (all_rows; the others are for comparison and refused for use)
       --model automatic|linear|quadratic       --rated FORCE,TORQUE [N],[N m] (50,2)
       --displacement                           identifies the displacement from its tests as well
       --save FOLDER [--id ID]                  writes FOLDER/sensor_a/<ID>.yaml and FOLDER/sensor_b/<ID>.yaml
check  a calibration file (its checksum, its content), or an observation file (what is in it, what would be dropped,
       linearity tests); with --observations: a calibration file against observations it was not made from
Example: calibrate plan recommended --nonlinearity 0 --simulate tests.yaml && calibrate solve tests.yaml --save .
Exit: 0 ok, 1 refused by a check, 2 bad input. Format of the files: docs/how_to/calibration.md
)";

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
  for (const Side side : kSides) {
    line(std::string("predicted_sd_") + toString(side),
         s.covariance.size() > 0 ? list(s.predicted_sd[side]) : "null");
  }
  if (matrices) {
    line("chi2", yamlNumber(s.chi2));
    line("chi2_per_dof", yamlNumber(s.dof > 0 ? s.chi2 / s.dof : std::nan("")));
    line("p", yamlNumber(s.p));
    line("residual_rms", list(s.residual_rms));
    line("hold_out_rms", yamlNumber(s.hold_out_rms));
    line("hold_out_tests", std::to_string(s.hold_out_tests));
    const bool any = std::any_of(s.tests.begin(), s.tests.end(),
                                 [](const TestResult& test) { return bool(test.dropped); });
    std::cout << "dropped:" << (any ? "" : " []") << "\n";
    for (const TestResult& test : s.tests) {
      if (!test.dropped) continue;
      std::cout << "  - {observation: " << test.observation
                << ", reason: " << yamlQuoted(test.dropped.text)
                << ", normalised: " << yamlNumber(test.normalised) << "}\n";
    }
    printMatrix("S_a", s.S.a);
    printMatrix("S_b", s.S.b);
  }
  printGates(s.gates);
}

// the reason of a refusal, for users who don't read the YAML
int codeOf(bool accepted, const std::string& message) {
  if (!accepted) std::cerr << "calibrate: " << message << "\n";
  return accepted ? 0 : 1;
}

int plan(const std::vector<std::string>& arguments) {
  std::string wanted, observations, simulate;
  std::uint64_t seed = 1;
  std::size_t count = 6;
  RigSettings settings;
  OptionParser parser(kHelp);
  parser.file("NAME of a plan", wanted);
  parser.integer("--seed", seed, 0, 1000000000);
  parser.text("--observations", observations);
  parser.integer("--next", count, 1, 1000);
  parser.text("--simulate", simulate);
  parser.integer("--bits", settings.bits, 1, 64);
  parser.number("--nonlinearity", settings.nonlinearity, 0.0, 1.0);
  parser.integer("--samples", settings.samples, 1, 100000);
  if (!parser.parse(arguments)) return 0;
  if (wanted == "next") parser.notWith("next", {"--simulate"});
  if (wanted != "next") parser.notWith("a plan of " + wanted, {"--next"});
  checkBits(settings.bits, "--bits: value ");
  settings.seed = seed + 1000;
  CalibrationRig rig(settings);
  ObservationSet set = rig.description();
  if (!observations.empty()) set = readObservations(observations);
  if (wanted == "next") {
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
    return codeOf(next.after.accepted, next.after.message);
  }
  const auto name = planName(wanted);
  if (!name) {
    throw InputError("plan: value is '" + wanted + "': give one of " + kPlanNames);
  }
  const std::vector<LoadRequest> requests = makePlan(*name, set, {}, seed);
  std::cout << "tests:\n";
  for (const LoadRequest& request : requests) {
    std::cout << "  - " << yamlQuoted(describe(request)) << "\n";
  }
  int code = 0;
  if (*name != PlanName::kDisplacement) {
    ForceSettings force;
    if (*name == PlanName::kQuadratic) force.model = StrainModel::kQuadratic;
    const ForceSolution predicted = evaluateDesign(predictPlan(requests, set), force);
    printForce(predicted, false);
    code = codeOf(predicted.accepted, predicted.message);
  }
  if (!simulate.empty()) {
    for (const LoadRequest& request : requests) set.observations.push_back(rig.measure(request));
    writeObservations(set, simulate);
    std::cerr << "calibrate: " << set.observations.size() << " observations written\n";
  }
  return code;
}

int solve(const std::vector<std::string>& arguments) {
  SolveSettings settings;
  ForceSettings& force = settings.force;
  std::string file, store, id;
  bool displacement = false;
  OptionParser parser(kHelp);
  parser.file("file of observations", file);
  parser.choice("--procedure", force.procedure,
                {{"all_rows", ForceProcedure::kAllRows},
                 {"force_rows", ForceProcedure::kForceRows},
                 {"thesis", ForceProcedure::kThesis}});
  parser.choice("--model", force.model,
                {{"automatic", StrainModel::kAutomatic},
                 {"linear", StrainModel::kLinear},
                 {"quadratic", StrainModel::kQuadratic}});
  parser.value("--rated", "give FORCE,TORQUE above 0", [&](const std::string& text) {
    const auto cells = csvCells(text);
    return cells.size() == 2 && parseNumber(std::string(cells[0]), force.rated.force) &&
           parseNumber(std::string(cells[1]), force.rated.torque) && force.rated.force > 0.0 &&
           force.rated.torque > 0.0;
  });
  parser.flag("--displacement", displacement);
  parser.text("--save", store);
  parser.text("--id", id);
  if (!parser.parse(arguments)) return 0;
  parser.onlyWith("--save", {"--id"});
  const bool save = !store.empty();
  CalibrationSession session(store, readObservations(file));
  for (const std::string& text : session.warnings()) std::cerr << "calibrate: " << text << "\n";
  settings.displacement = {displacement, displacement};
  settings.wrench = !displacement || save || solveSettings(session.observations()).wrench;
  const CalibrationSolution& solution = session.solve(settings);
  for (const Side side : kSides) {
    if (!displacement) continue;
    const DisplacementSolution& d = *solution.displacement[side];
    std::cout << "displacement_" << toString(side)
              << ": {accepted: " << (d.accepted ? "true" : "false")
              << ", message: " << yamlQuoted(d.message) << ", tests: " << d.tests
              << ", rank: " << d.rank << ", condition: " << yamlNumber(d.condition)
              << ", residual_sd: " << list(d.residual_sd) << "}\n";
  }
  if (solution.force) printForce(*solution.force, true);
  const int code = codeOf(solution.accepted, solution.message);
  if (!solution.force || code != 0 || !save) return code;
  const auto saved = session.save(id);
  for (const Side side : kSides) {
    line(std::string("saved_") + toString(side),
         yamlQuoted(calibrationPath(session.store(), sensorName(side), saved[side]->id)));
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

// weights that a calibration was not made from; false where there is none to compare with
bool compareWithWeights(const Calibration& c, const std::string& path) {
  const ObservationSet set = readObservations(path);
  // a sensor without a serial number is saved under its name
  const auto serial = [&](Side side) {
    const std::string& given = set.sensor[side].serial_number;
    return given.empty() ? sensorName(side) : given;
  };
  const Side side = c.serial_number == serial(Side::kB) ? Side::kB : Side::kA;
  if (c.serial_number != serial(side)) {
    throw InputError("--observations: value " + path + ": its sensors are '" + serial(Side::kA) +
                     "' and '" + serial(Side::kB) + "', the calibration is of '" + c.serial_number +
                     "': give tests of this one");
  }
  double force = 0.0, torque = 0.0;
  int count = 0, dropped = 0;
  Calibration zeroed = c;
  for (const Observation& o : set.observations) {
    const auto& reading = o.reading[side];
    if (!reading) continue;
    if (unusable(*reading, set.sensor[side])) {
      ++dropped;
      continue;
    }
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
  line("dropped", std::to_string(dropped));
  line("force_error_rms", yamlNumber(count > 0 ? std::sqrt(force / 3 / count) : std::nan("")));
  line("torque_error_rms", yamlNumber(count > 0 ? std::sqrt(torque / 3 / count) : std::nan("")));
  return count > 0;
}

int checkCalibrationFile(const std::string& path, const std::string& observations) {
  const Calibration c = loadCalibration(path);
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
  if (observations.empty() || compareWithWeights(c, observations)) return 0;
  return codeOf(false, observations + ": no weight on this sensor, nothing was compared");
}

// false where a channel refuses the linear model
bool printLinearity(const ObservationSet& set) {
  bool good = true;
  for (const Side side : kSides) {
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
  return good;
}

int checkObservationFile(const std::string& path) {
  const ObservationSet set = readObservations(path);
  std::map<std::string, int> counts;
  std::string bad, kinds;
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation& o = set.observations[i];
    ++counts[toString(o.kind)];
    for (const Side side : kSides) {
      if (!o.reading[side]) continue;
      const CalibrationRefusal why = unusable(*o.reading[side], set.sensor[side]);
      if (!why) continue;
      bad += "  - {observation: " + std::to_string(i) + ", sensor: " + toString(side) +
             ", reason: " + yamlQuoted(why.text) + "}\n";
    }
  }
  for (const auto& [kind, count] : counts) {
    kinds += (kinds.empty() ? "" : ", ") + kind + ": " + std::to_string(count);
  }
  std::cout << (bad.empty() ? "unusable: []\n" : "unusable:\n" + bad) << "counts: {" << kinds
            << "}\nlinearity:" << (counts.count("linearity") > 0 ? "" : " []") << "\n";
  const bool linear = printLinearity(set);
  line("digest", yamlQuoted(observationsDigest(set)));
  return bad.empty() && linear ? 0 : 1;
}

int check(const std::vector<std::string>& arguments) {
  std::string file, observations;
  OptionParser parser(kHelp);
  parser.file("file", file);
  parser.text("--observations", observations);
  if (!parser.parse(arguments)) return 0;
  if (!isObservationFile(file)) return checkCalibrationFile(file, observations);
  parser.notWith("a file of observations", {"--observations"});
  return checkObservationFile(file);
}

const std::map<std::string, int (*)(const std::vector<std::string>&)> kCommands = {
    {"plan", plan},       {"solve", solve},         {"check", check},
    {"payload", payload}, {"reference", reference}, {"deadweights", deadWeights}};

int run(const std::vector<std::string>& arguments) {
  std::string names;
  for (const auto& [name, command] : kCommands) names += (names.empty() ? "" : ", ") + name;
  if (arguments.empty()) throw InputError("command missing: give one of " + names + ", see --help");
  if (arguments[0] == "--help" || arguments[0] == "-h") {
    std::cout << kHelp;
    return 0;
  }
  const auto command = kCommands.find(arguments[0]);
  if (command == kCommands.end()) {
    throw InputError("command is '" + arguments[0] + "': give one of " + names + ", see --help");
  }
  return command->second({arguments.begin() + 1, arguments.end()});
}

}  // namespace

int main(int argc, char** argv) { return runTool("calibrate", argc, argv, run); }
