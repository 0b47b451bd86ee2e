// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Identification of the mechanism, or of the arm's response, without ROS: one simulated cell, or
// many drawn ones with the statistics of what is stated.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <thread>

#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/base/date.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/heartbeat.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/cell/identification_trial.h"
#include "assembly_cell/cell/world_choice.h"
#include "assembly_cell/identification/arm_response.h"
#include "assembly_cell/identification/readings_file.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/study/share.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: identify SCENARIO.yaml [options]

Identifies the mechanism of a simulated cell from contact forces: the hanging peg is shaken and turned, then pressed on the
face beside the hole, pushed and shaken there. Prints what was found as YAML; --out writes it for align and cell.launch.

  --target T            mechanism (default), or arm: delay and stiffness by a chirp in light contact, see docs/how_to/arm.md
  --arm FILE.yaml       with --target arm, as of align
  --world W             with --target arm, as of align
  --mismatch FILE.yaml  how the truth differs from the scenario, see docs/reference/mismatch.md
  --seed N              of the sensors' noise and of what the mismatch draws (default 1)
  --runs K              that many cells, seeds from --seed on: how often the intervals contain the ground truth (default 1)
  --bits B              of the converters: 10, 16 (default) or 24
  --noise V             of every strain channel, rms (default 5e-4)  [V]
  --prior-scale F       times the spreads of a cell as drawn that the fit begins with (default 1)
  --time-limit T        no step begins later than this, cell time (default 60)  [s]
  --threads N           runs at the same time (default: the machine's cores)
  --set KEY.PATH=VALUE  change a value of the scenario, for truth and drawing together; repeatable
  --out FILE.yaml       write the mechanism that was found, with its covariance
  --readings FILE.csv   write the readings and their residuals
  --help                print this

Exit code: 0 accepted, 1 refused by the data that were left out (named in verdict), 2 bad input.

Example: identify config/scenarios/cell.yaml --mismatch config/mismatch/level_2.yaml --out mechanism.yaml
)";

struct Options {
  std::string scenario, mismatch, out, readings;
  std::vector<std::string> overrides;
  CellParameters cell;
  double prior_scale = 1.0, time_limit = 60.0;
  std::string target = "mechanism", arm, world = "exact";
  long runs = 1;
  long threads = std::max(1L, static_cast<long>(std::thread::hardware_concurrency()));
};

bool parseOptions(const std::vector<std::string>& arguments, Options& o) {
  OptionParser parser(kHelp);
  parser.file("scenario file", o.scenario);
  FieldList target;
  parser.field("--target", target.choice("target", o.target, {"mechanism", "arm"}, ""));
  parser.text("--arm", o.arm);
  parser.text("--world", o.world);
  parser.text("--mismatch", o.mismatch);
  parser.integer("--seed", o.cell.seed, 0, 1L << 62);
  parser.integer("--runs", o.runs, 1, 1000000);
  parser.integer("--bits", o.cell.bits, 1, 64);
  parser.number("--noise", o.cell.noise, 0.0, 5.0);
  parser.number("--prior-scale", o.prior_scale, 0.1, 10.0);
  parser.number("--time-limit", o.time_limit, 5.0, 60.0);
  parser.integer("--threads", o.threads, 1, 1024);
  parser.texts("--set", o.overrides);
  parser.text("--out", o.out);
  parser.text("--readings", o.readings);
  if (!parser.parse(arguments)) return false;
  if (o.target == "arm") {
    parser.notWith("--target arm", {"--prior-scale", "--time-limit", "--readings"});
  } else {
    parser.notWith("--target mechanism", {"--arm", "--world"});
  }
  assembly_cell::checkBits(o.cell.bits, "--bits: value ");
  return true;
}

struct Task {
  Scenario scenario;
  std::optional<Mismatch> mismatch;
  IdentificationPrior prior;
  IdentificationPlan plan;

  // The cell that the seed draws; its sensors and carrier go into `cell`.
  Scenario truthOf(std::uint64_t seed, CellParameters& cell) const {
    cell.seed = seed;
    if (!mismatch) return scenario;
    const Truth drawn = drawTruth(*mismatch, seed);
    cell.truth = drawn.cell;
    return trueScenario(scenario, drawn, mismatch->source);
  }
};

IdentificationTrial runMechanism(const Options& o, const Task& task, std::uint64_t seed) {
  CellParameters cell = o.cell;
  const Scenario truth = task.truthOf(seed, cell);
  return tryIdentification(truth, task.scenario.mechanism, cell, task.plan, task.prior);
}

ArmTrial runArm(const Options& o, const Task& task, std::uint64_t seed) {
  CellParameters cell = o.cell;
  const Scenario truth = task.truthOf(seed, cell);
  return tryArmIdentification(truth, task.scenario.mechanism, cell, ArmPlan());
}

std::string names(const std::vector<int>& places, const Identification& found) {
  std::string list;
  for (const int i : places) {
    list +=
        (list.empty() ? "" : ", ") + yamlQuoted(found.unknowns[static_cast<std::size_t>(i)].name);
  }
  return "[" + list + "]";
}

std::string pairs(const Identification& found) {
  std::string list;
  for (const CorrelatedPair& pair : found.correlated) {
    const auto name = [&](int i) {
      return yamlQuoted(found.unknowns[static_cast<std::size_t>(i)].name);
    };
    list += (list.empty() ? "[" : ", [") + name(pair.first) + ", " + name(pair.second) + ", " +
            yamlNumber(std::round(1e3 * pair.correlation) / 1e3) + "]";
  }
  return "[" + list + "]";
}

std::string oneResult(const Mechanism& nominal, const IdentificationTrial& trial) {
  const Identification& found = trial.found;
  std::ostringstream out;
  out << "verdict: " << yamlQuoted(found.verdict) << "\n"
      << "accepted: " << (found.accepted ? "true" : "false") << "\n"
      << "cell_time: " << yamlNumber(trial.data.time) << "\n"
      << "fit_time: " << yamlNumber(trial.fit_time) << "\n"
      << "left_out: {chi2: " << yamlNumber(found.chi2) << ", dof: " << found.dof
      << ", p: " << yamlNumber(found.p) << "}\n"
      << "fit: {chi2: " << yamlNumber(found.fit_chi2) << ", data: " << found.fit_dof
      << ", condition: " << yamlNumber(found.condition) << "}\n"
      << "unseen: " << names(found.unseen, found) << "\n"
      << "correlated: " << pairs(found) << "\n"
      << "notes: [";
  for (std::size_t i = 0; i < found.notes.size(); ++i) {
    out << (i > 0 ? ", " : "") << yamlQuoted(found.notes[i]);
  }
  out << "]\nparameters:\n";
  for (int i = 0; i < kUnknowns; ++i) {
    out << "  - {name: " << yamlQuoted(found.unknowns[static_cast<std::size_t>(i)].name)
        << ", drawn: " << yamlNumber(valueAt(nominal, found.unknowns, i, 0.0))
        << ", value: " << yamlNumber(valueAt(nominal, found.unknowns, i, found.z[i]))
        << ", sd: " << yamlNumber(sdAt(nominal, found.unknowns, i, found.z[i], found.sd(i)))
        << ", of_prior: " << yamlNumber(found.sd(i)) << "}\n";
  }
  out << "truth:           # of the simulation\n"
      << "  direction_bias: " << yamlNumber(trial.direction_bias) << "\n"
      << "  direction_bias_as_drawn: " << yamlNumber(trial.direction_bias_as_drawn) << "\n";
  for (int i = 0; i < kUnknowns; ++i) {
    out << "  " << yamlQuoted(found.unknowns[static_cast<std::size_t>(i)].name) << ": "
        << yamlNumber(valueAt(nominal, found.unknowns, i, trial.truth[i])) << "\n";
  }
  return out.str();
}

std::string spread(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const auto at = [&](double p) {
    const auto last = static_cast<double>(values.size() - 1);
    return yamlNumber(values[static_cast<std::size_t>(std::lround(p * last))]);
  };
  return "{median: " + at(0.5) + ", p95: " + at(0.95) + ", max: " + at(1.0) + "}";
}

// Statistics of one unknown, or of all observable ones, over the accepted runs.
struct Coverage {
  std::int64_t inside = 0, count = 0;
  double squares = 0.0, errors = 0.0, variances = 0.0;

  void add(double error, double sd) {
    constexpr double kTwoSided = 1.959963984540054;  // 95 % of a normal distribution
    ++count;
    inside += std::abs(error) <= kTwoSided * sd ? 1 : 0;
    squares += error * error / (sd * sd);
    errors += error * error;
    variances += sd * sd;
  }
  std::string text() const {
    const ShareInterval share = shareInterval(inside, count);
    return "{coverage: " + yamlNumber(share.share) + ", interval: [" + yamlNumber(share.low) +
           ", " + yamlNumber(share.high) +
           "], error_squared: " + yamlNumber(squares / static_cast<double>(count)) +
           ", variance_ratio: " + yamlNumber(errors / variances) + "}";
  }
};

double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

std::string manyResults(const std::vector<IdentificationTrial>& trials) {
  std::ostringstream out;
  std::vector<double> cell, fit, bias, drawn;
  std::vector<Coverage> each(kUnknowns);
  Coverage seen;
  std::int64_t accepted = 0;
  for (const IdentificationTrial& trial : trials) {
    cell.push_back(trial.data.time);
    fit.push_back(trial.fit_time);
    if (!trial.found.accepted) continue;
    ++accepted;
    bias.push_back(trial.direction_bias);
    drawn.push_back(trial.direction_bias_as_drawn);
    for (int i = 0; i < kUnknowns; ++i) {
      const double error = trial.found.z[i] - trial.truth[i], sd = trial.found.sd(i);
      each[static_cast<std::size_t>(i)].add(error, sd);
      if (sd < kUnseen) seen.add(error, sd);
    }
  }
  const ShareInterval share = shareInterval(accepted, static_cast<std::int64_t>(trials.size()));
  out << "runs: " << trials.size() << "\naccepted: " << accepted << "\naccepted_interval: ["
      << yamlNumber(share.low) << ", " << yamlNumber(share.high) << "]\ncell_time: " << spread(cell)
      << "\nfit_time: " << spread(fit) << "\n";
  if (accepted == 0) return out.str();
  out << "direction_bias_rms: " << yamlNumber(rms(bias)) << "\ndirection_bias: " << spread(bias)
      << "\ndirection_bias_as_drawn_rms: " << yamlNumber(rms(drawn)) << "\nseen: " << seen.text()
      << "\nparameters:\n";
  for (int i = 0; i < kUnknowns; ++i) {
    out << "  " << yamlQuoted(trials.front().found.unknowns[static_cast<std::size_t>(i)].name)
        << ": " << each[static_cast<std::size_t>(i)].text() << "\n";
  }
  return out.str();
}

std::string verdictOf(const IdentificationTrial& trial) { return trial.found.verdict; }
std::string verdictOf(const ArmTrial& trial) {
  return trial.refusal.empty() ? "measured" : trial.refusal;
}

template <class Trial>
std::vector<Trial> runAll(const Options& o, const Task& task,
                          Trial (*run_one)(const Options&, const Task&, std::uint64_t)) {
  std::vector<Trial> trials(static_cast<std::size_t>(o.runs));
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::size_t done = 0;
  std::string bad_input;
  Heartbeat beat(std::chrono::seconds(5), [&](double seconds) {
    const std::lock_guard<std::mutex> lock(mutex);
    std::cerr << "identify: " << done << " of " << o.runs << " done, at work for "
              << std::lround(seconds) << " s\n";
  });
  const auto work = [&] {
    for (std::size_t i = next++; i < trials.size(); i = next++) {
      try {
        trials[i] = run_one(o, task, o.cell.seed + i);
      } catch (const InputError& error) {
        const std::lock_guard<std::mutex> lock(mutex);
        bad_input = error.what();
        next = trials.size();
        return;
      }
      const std::lock_guard<std::mutex> lock(mutex);
      ++done;
      beat.rest();
      std::cerr << "identify: " << done << " of " << o.runs << ", seed " << o.cell.seed + i << ": "
                << verdictOf(trials[i]) << "\n";
    }
  };
  std::vector<std::thread> threads;
  for (long i = 1; i < std::min(o.threads, o.runs); ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  if (!bad_input.empty()) throw InputError(o.scenario + ": " + bad_input);
  return trials;
}

std::string oneArm(const ArmTrial& trial) {
  if (!trial.refusal.empty()) return "refusal: " + yamlQuoted(trial.refusal) + "\n";
  const ArmIdentification& found = trial.found;
  YamlMapping truth;
  truth.number("delay", trial.truth.delay).number("stiffness", trial.truth.stiffness);
  std::ostringstream out;
  out << armLine(found.arm) << "\n"
      << "drawn_stiffness: " << yamlNumber(found.drawn_stiffness) << "\n"
      << "force: " << yamlNumber(found.force) << "\n"
      << "cell_time: " << yamlNumber(found.time) << "\n"
      << "response:\n";
  for (const ArmResponsePoint& point : found.points) {
    YamlMapping row;
    row.number("frequency", point.frequency).number("gain", point.gain);
    row.number("phase", point.phase).number("sd", point.sd);
    out << "  - " << row.text() << "\n";
  }
  out << "truth: " << truth.text() << "   # of the simulation\n";
  return out.str();
}

// Statistics of one number of the response over the runs in which it was measured.
std::string armNumber(const std::vector<ArmTrial>& trials, double ArmResponse::*value,
                      double ArmResponse::*sd) {
  double found = 0.0, truth = 0.0, stated = 0.0, within = 0.0;
  std::vector<double> errors;
  Coverage coverage;
  for (const ArmTrial& trial : trials) {
    if (!trial.refusal.empty()) continue;
    const double error = trial.found.arm.*value - trial.truth.*value, own = trial.found.arm.*sd;
    found += trial.found.arm.*value;
    truth += trial.truth.*value;
    stated += own;
    within += std::abs(error) <= 3.0 * own ? 1.0 : 0.0;
    errors.push_back(error);
    coverage.add(error, own);
  }
  const auto count = static_cast<double>(errors.size());
  YamlMapping out;
  out.number("mean", found / count).number("truth", truth / count);
  out.number("error_rms", rms(errors)).number("stated_sd", stated / count);
  out.number("within_3_sd", within).add("of", coverage.text());
  return out.text();
}

std::string manyArms(const std::vector<ArmTrial>& trials) {
  std::ostringstream out;
  std::vector<double> time, force;
  for (const ArmTrial& trial : trials) {
    if (!trial.refusal.empty()) continue;
    time.push_back(trial.found.time);
    force.push_back(trial.found.force);
  }
  out << "runs: " << trials.size() << "\nmeasured: " << time.size() << "\n";
  if (time.empty()) return out.str();
  out << "cell_time: " << spread(time) << "\nforce: " << spread(force)
      << "\ndelay: " << armNumber(trials, &ArmResponse::delay, &ArmResponse::delay_sd)
      << "\nstiffness: " << armNumber(trials, &ArmResponse::stiffness, &ArmResponse::stiffness_sd)
      << "\n";
  return out.str();
}

int reportArm(const Options& o, const Task& task) {
  try {
    checkArmPlan(task.scenario.mechanism, ArmPlan());
  } catch (const InputError& error) {
    throw InputError(o.scenario + ": " + error.what());
  }
  const std::vector<ArmTrial> trials = runAll(o, task, runArm);
  const ArmTrial& first = trials.front();
  std::cout << (o.runs > 1 ? manyArms(trials) : oneArm(first));
  if (!o.out.empty() && first.refusal.empty()) {
    Mechanism mechanism = task.scenario.mechanism;
    mechanism.arm = first.found.arm;
    writeFileAtomically(o.out, mechanismText(mechanism), o.out);
  }
  return std::all_of(trials.begin(), trials.end(),
                     [](const ArmTrial& t) { return t.refusal.empty(); })
             ? 0
             : 1;
}

int run(const std::vector<std::string>& arguments) {
  Options o;
  if (!parseOptions(arguments, o)) return 0;
  o.cell.world = parseWorld(o.world, "--world");
  // the engine's coupling is bolted to the carrier
  if (o.cell.world.mujoco) o.overrides.insert(o.overrides.begin(), "coupling.axes=carrier");
  if (!o.arm.empty()) o.cell.arm = std::make_shared<ArmSetup>(loadArmSetup(o.arm));
  if (o.runs > 1 && !(o.out.empty() && o.readings.empty())) {
    throw InputError("--runs: value " + std::to_string(o.runs) +
                     ": --out and --readings are of one cell, leave it out");
  }
  // before the run, which takes a while
  if (!o.out.empty()) checkWritable(o.out, "--out: value " + o.out);
  if (!o.readings.empty()) checkWritable(o.readings, "--readings: value " + o.readings);
  Task task{loadScenario(o.scenario, o.overrides), {}, {}, {}};
  if (!o.mismatch.empty()) task.mismatch = loadMismatch(o.mismatch);
  if (task.mismatch && o.cell.arm) refuseCarrierDrive(*task.mismatch);
  if (o.target == "arm") return reportArm(o, task);
  task.prior.unknowns = unknownsAsDrawn(o.prior_scale);
  task.plan = planFor(task.scenario.mechanism);
  task.plan.time_limit = o.time_limit;
  const std::vector<IdentificationTrial> trials = runAll(o, task, runMechanism);
  const Mechanism& nominal = task.scenario.mechanism;
  if (o.runs > 1) {
    std::cout << manyResults(trials);
    return std::all_of(trials.begin(), trials.end(),
                       [](const IdentificationTrial& t) { return t.found.accepted; })
               ? 0
               : 1;
  }
  const IdentificationTrial& trial = trials.front();
  std::cout << oneResult(nominal, trial);
  if (!o.out.empty()) {
    saveMechanism(nominal, trial.found,
                  "identify, " + o.scenario + ", seed " + std::to_string(o.cell.seed), utcNow(),
                  o.out);
  }
  if (!o.readings.empty()) saveReadings(trial.data, trial.found, o.readings);
  return trial.found.accepted ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("identify", argc, argv, run); }
