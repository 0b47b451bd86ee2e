// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The whole alignment without ROS, once or many times from random starts, with statistics.

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/files.h"
#include "assembly_cell/base/heartbeat.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/calibrated_sensors.h"
#include "assembly_cell/cell/first_goal.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/records/align_record.h"
#include "assembly_cell/records/store.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/study/share.h"

namespace {

using assembly_cell::AlignParameters;
using assembly_cell::AlignProgress;
using assembly_cell::AlignTrial;
using assembly_cell::CellParameters;
using assembly_cell::InputError;
using assembly_cell::KnownMechanism;
using assembly_cell::Mismatch;
using assembly_cell::Scenario;
using assembly_cell::Truth;
using assembly_cell::yamlNumber;
using assembly_cell::yamlQuoted;
using Clock = std::chrono::steady_clock;
using Eigen::Vector2d;

constexpr const char* kHelp =
    R"(Usage: align SCENARIO.yaml [options]

Aligns the peg with the hole in simulation, by contact forces alone, and prints the result as YAML. One run starts as
the scenario has it; several start at random: offset uniform in a disc, tilt uniform up to a limit, any direction.

  --strategy S          auto (default), touch, single_contact, double_contact, twin_force, vibratory,
                        or, of the baselines, spiral or passive
  --seed N              of the sensors' noise and the random starts (default 1)
  --runs K              number of runs (default 1)
  --random-start        a single run starts at random, too: that of --seed N in a series, with its progress
  --bits B              of the converters: 10, 16 (default) or 24
  --sensors S           both (default), or b: sensor_b at the wrist alone
  --block-size N        samples a block, 5 to 100 (default): 10 are 2 ms
  --noise V             of every strain channel, rms (default 5e-4)  [V]
  --offset-max D        of random starts (default 0.015)  [m]
  --tilt-max T          of random starts (default 0.0349, 2 degrees)  [rad]
  --mechanism FILE.yaml nominal parts of the strategies instead of the scenario, as identify --out wrote it;
                        checked on the hanging peg before anything is pressed
  --calibrate N         each run calibrates its sensors on the simulated bench first, N readings averaged a test, and
                        the twin-force likelihood takes the covariance, see docs/theory/twin_force.md; adds
                        wrench_error_squared, as offset_error_squared but before touches and walls
  --identify            each run identifies its mechanism first, see docs/theory/identification.md
  --mismatch FILE.yaml  how the ground truth differs from the scenario, which the strategy goes on using; drawn
                        again for each run from its seed, see docs/reference/mismatch.md
  --parameter KEY=VALUE a parameter of the strategy, such as press_force=8, repeatable; see
                        docs/reference/nodes/assembly_supervisor.md
  --insert DEPTH        go on until the edge is so deep, or floor: until it is seated on the hole's floor; success
                        then means seated, also in the ground truth  [m]
  --insert-exciter F    shake the peg during the insertion (default 0: off)  [N]
  --second-goals        before each run another goal pressed with up to 40 N or was cut off at a random moment,
                        every other time without freeing the peg; wants --runs above 1
  --world W             simulator backend: exact (default), mujoco or "{engine: mujoco, facets: 512}",
                        see docs/results/second_world.md; strategies know of it only that
                        its coupling turns with the carrier (coupling.axes=carrier)
  --arm FILE.yaml       an emulated arm carries the carrier, led by the bridge that a real one has, as
                        config/arm/emulated.yaml names them: latency, repeatability and limits, see docs/how_to/arm.md
  --check               read the input and refuse what is bad; run nothing
  --threads N           runs at the same time (default: the machine's cores)
  --set KEY.PATH=VALUE  change a value of the scenario, for ground truth and strategy together; repeatable
  --report FILE.yaml    write the result to a file as well
  --record STORE        store a record of each run, in order of seeds, see docs/reference/records.md
  --program P           of the records (default: the scenario's name)
  --serial-prefix S     of the parts' serials: S and the seed (default: run- and the record's number)
  --help                print this

Exit code: 0 all runs ended aligned, 1 some did not (named in reason), 2 bad input.

Example: align config/scenarios/cell.yaml --runs 20 --seed 7
)";

constexpr double kStartHeight = 0.003;  // height of random starts above the plane [m]

struct Options {
  std::string scenario, report, mismatch, mechanism, insert, arm, world = "exact";
  std::string record, program, serial_prefix;
  bool identify = false;
  std::vector<std::string> overrides, parameters;
  AlignParameters align;
  CellParameters cell;
  int calibrate = 0;  // readings a test; 0: sensors as designed
  long runs = 1;
  long threads = std::max(1L, static_cast<long>(std::thread::hardware_concurrency()));
  double offset_max = 0.015, tilt_max = 0.0349;
  bool second_goals = false;
  bool random_start = false;
  bool check = false;
};

// false after --help
bool parseOptions(const std::vector<std::string>& arguments, Options& o) {
  assembly_cell::OptionParser parser(kHelp);
  parser.file("scenario file", o.scenario);
  const assembly_cell::FieldList parameters = fieldsOf(o.align);
  parser.field("--strategy", *parameters.find("strategy"));
  parser.integer("--seed", o.cell.seed, 0, 1L << 62);
  parser.integer("--runs", o.runs, 1, 10000000);
  parser.integer("--bits", o.cell.bits, 1, 64);
  assembly_cell::FieldList cell;
  parser.field("--sensors",
               cell.choice("sensors", o.cell.sensors, assembly_cell::sensorChoices(), ""));
  parser.integer("--block-size", o.cell.block_size, 5, 100);
  parser.number("--noise", o.cell.noise, 0.0, 5.0);
  parser.number("--offset-max", o.offset_max, 0.0, 0.1);
  parser.number("--tilt-max", o.tilt_max, 0.0, 0.1);
  parser.text("--insert", o.insert);
  parser.field("--insert-exciter", *parameters.find("insert.exciter"));
  parser.flag("--second-goals", o.second_goals);
  parser.flag("--random-start", o.random_start);
  parser.integer("--threads", o.threads, 1, 1024);
  parser.texts("--set", o.overrides);
  parser.texts("--parameter", o.parameters);
  parser.text("--world", o.world);
  parser.text("--arm", o.arm);
  parser.text("--mismatch", o.mismatch);
  parser.text("--mechanism", o.mechanism);
  parser.integer("--calibrate", o.calibrate, 1, 100000);
  parser.flag("--identify", o.identify);
  parser.flag("--check", o.check);
  parser.text("--report", o.report);
  parser.text("--record", o.record);
  parser.text("--program", o.program);
  parser.text("--serial-prefix", o.serial_prefix);
  if (!parser.parse(arguments)) return false;
  parser.onlyWith("--insert", {"--insert-exciter"});
  parser.onlyWith("--record", {"--program", "--serial-prefix"});
  if (o.runs == 1) parser.onlyWith("--random-start", {"--offset-max", "--tilt-max"});
  assembly_cell::checkBits(o.cell.bits, "--bits: value ");
  if (o.calibrate > 0 && o.cell.sensors == assembly_cell::Sensors::kB) {
    throw InputError("--calibrate: value " + std::to_string(o.calibrate) +
                     ": the bench is for two sensors, leave out --sensors b");
  }
  return true;
}

struct Run {
  std::uint64_t seed = 0;
  AlignTrial trial;
  std::string truth;  // drawn model errors; empty: none
  double wall_time = 0.0;
};

Scenario startOf(const Options& o, const Scenario& scenario, std::uint64_t seed) {
  if (o.runs == 1 && !o.random_start) return scenario;
  // bits of the engine itself: the same starts with every standard library
  std::mt19937_64 engine(seed);
  const auto uniform = [&engine] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  const double azimuth = 2 * M_PI * uniform(), offset = o.offset_max * std::sqrt(uniform());
  const double direction = 2 * M_PI * uniform(), tilt = o.tilt_max * uniform();
  return assembly_cell::startAt(scenario, offset * Vector2d(std::cos(azimuth), std::sin(azimuth)),
                                tilt * Vector2d(std::cos(direction), std::sin(direction)),
                                kStartHeight);
}

// What all runs share: the scenario as it is believed to be, and how the truth differs.
struct Task {
  Scenario scenario;
  std::optional<Mismatch> mismatch;
  std::optional<KnownMechanism> known;

  Scenario truthOf(const Options& o, std::uint64_t seed, Truth& truth) const {
    const Scenario start = startOf(o, scenario, seed);
    if (!mismatch) return start;
    truth = drawTruth(*mismatch, seed);
    return trueScenario(start, truth, mismatch->source + " (seed " + std::to_string(seed) + ")");
  }
};

Run runOnce(const Options& o, const Task& task, std::uint64_t seed,
            const std::function<void(const AlignProgress&)>& progress) {
  const Clock::time_point start = Clock::now();
  CellParameters cell = o.cell;
  cell.seed = seed;
  Run run;
  run.seed = seed;
  Truth truth;
  const Scenario scenario = task.truthOf(o, seed, truth);
  cell.truth = truth.cell;
  if (o.calibrate > 0) {
    const assembly_cell::PerSide<assembly_cell::Calibration> sensors =
        assembly_cell::calibratedSensors(cell, o.calibrate);
    cell.calibration_a = sensors.a;
    cell.calibration_b = sensors.b;
  }
  run.truth = truthText(truth);
  if (run.truth == "{}") run.truth.clear();
  const assembly_cell::Mechanism& drawn = task.scenario.mechanism;
  std::function<void(assembly_cell::Plant&)> before;
  if (o.second_goals) {
    before = [&](assembly_cell::Plant& plant) {
      assembly_cell::leaveFirstGoal(plant, drawn, o.align, seed);
    };
  }
  run.trial = o.identify   ? identifyAndAlign(scenario, drawn, cell, o.align, progress)
              : task.known ? tryAlignment(scenario, *task.known, cell, o.align, progress)
                           : tryAlignment(scenario, drawn, cell, o.align, progress, before);
  run.wall_time = std::chrono::duration<double>(Clock::now() - start).count();
  return run;
}

std::string pair(const Vector2d& v) {
  return "[" + yamlNumber(v.x()) + ", " + yamlNumber(v.y()) + "]";
}

std::string rms(const std::vector<double>& values) {
  if (values.empty()) return "null";
  double sum = 0.0;
  for (const double v : values) sum += v * v;
  return yamlNumber(std::sqrt(sum / static_cast<double>(values.size())));
}

std::string mean(const std::vector<double>& values) {
  if (values.empty()) return "null";
  double sum = 0.0;
  for (const double v : values) sum += v;
  return yamlNumber(sum / static_cast<double>(values.size()));
}

// median and 95 % of what is sorted here
std::string spread(std::vector<double> values) {
  if (values.empty()) return "null";
  std::sort(values.begin(), values.end());
  const auto at = [&](double p) {
    const auto last = static_cast<double>(values.size() - 1);
    return yamlNumber(values[static_cast<std::size_t>(std::lround(p * last))]);
  };
  return "{median: " + at(0.5) + ", p95: " + at(0.95) + ", max: " + at(1.0) + "}";
}

// Runs whose strategy reported aligned with the peg outside, printed where there may be one
std::string falseSuccesses(std::ptrdiff_t wrong, const std::vector<Run>& runs, const Options& o) {
  const bool drawn = o.second_goals || (!runs.empty() && !runs.front().truth.empty());
  if (wrong == 0 && !drawn) return "";
  const assembly_cell::ShareInterval share =
      assembly_cell::shareInterval(wrong, static_cast<std::int64_t>(runs.size()));
  return "false_successes: " + std::to_string(wrong) + "\nfalse_success_interval: [" +
         yamlNumber(share.low) + ", " + yamlNumber(share.high) + "]\n";
}

// The insertion of one run.
std::string insertion(const AlignTrial& trial) {
  const assembly_cell::InsertResult& r = trial.result.insert;
  std::ostringstream out;
  out << "    insertion: {seated: " << (r.seated ? "true" : "false")
      << ", depth: " << yamlNumber(r.end.depth) << ", true_depth: " << yamlNumber(trial.depth)
      << ", time: " << yamlNumber(r.time) << ", force: " << yamlNumber(r.force)
      << ", backed_out: " << r.backed_out << ", profile: [";
  for (std::size_t i = 0; i < r.profile.size(); ++i) {
    const assembly_cell::BoreReading& measured = r.profile[i];
    out << (i == 0 ? "[" : ", [") << yamlNumber(measured.depth) << ", "
        << yamlNumber(measured.along) << ", " << yamlNumber(measured.sideways) << ", "
        << yamlNumber(measured.moment) << "]";
  }
  out << "]}\n";
  return out.str();
}

std::string yaml(const std::vector<Run>& runs, const Options& o) {
  std::ostringstream out;
  const auto wrong =
      std::count_if(runs.begin(), runs.end(), [](const Run& r) { return r.trial.false_success; });
  const auto good =
      std::count_if(runs.begin(), runs.end(), [](const Run& r) { return r.trial.success; });
  const assembly_cell::ShareInterval share =
      assembly_cell::shareInterval(good, static_cast<std::int64_t>(runs.size()));
  std::vector<double> normalised, wrench, offset, tilt, simulated, wall, direction, force;
  for (const auto& [seed, trial, truth, wall_time] : runs) {
    simulated.push_back(trial.result.time);
    wall.push_back(wall_time);
    force.push_back(trial.force);
    direction.insert(direction.end(), trial.direction_errors.begin(), trial.direction_errors.end());
    if (!trial.result.known) continue;
    const Vector2d error = trial.result.offset - trial.true_offset;
    offset.push_back(error.norm());
    normalised.push_back(error.dot(trial.result.offset_covariance.inverse() * error));
    if (trial.result.wrench_offset) {
      const Vector2d error_b = *trial.result.wrench_offset - trial.true_offset;
      wrench.push_back(error_b.dot(trial.result.wrench_covariance.inverse() * error_b));
    }
    tilt.push_back((trial.result.tilt - trial.true_tilt).norm());
  }
  out << "strategy: " << o.align.strategy << "\n"
      << "runs: " << runs.size() << "\n"
      << "succeeded: " << good << "\n"
      << "success_rate: " << yamlNumber(share.share) << "\n"
      << "success_interval: [" << yamlNumber(share.low) << ", " << yamlNumber(share.high) << "]\n"
      << falseSuccesses(wrong, runs, o) << "offset_error: " << spread(offset) << "\n"
      << "offset_error_squared: " << mean(normalised) << "\n"
      << (o.calibrate > 0 ? "wrench_error_squared: " + mean(wrench) + "\n" : "")
      << "tilt_error: " << spread(tilt) << "\n"
      << "direction_error_rms: " << rms(direction) << "\n"
      << "direction_error: " << spread(direction) << "\n"
      << "simulated_time: " << spread(simulated) << "\n"
      << "contact_force: " << spread(force) << "\n"
      << "wall_time: " << spread(wall) << "\n"
      << "results:\n";
  for (const auto& [seed, trial, truth, wall_time] : runs) {
    out << "  - seed: " << seed << "\n"
        << "    success: " << (trial.success ? "true" : "false") << "\n"
        << "    reason: " << yamlQuoted(trial.result.reason) << "\n"
        << "    true_offset: " << pair(trial.true_offset) << "\n"
        << "    estimated_offset: " << (trial.result.known ? pair(trial.result.offset) : "null")
        << "\n"
        << "    offset_sd: "
        << (trial.result.known ? yamlNumber(std::sqrt(0.5 * trial.result.offset_covariance.trace()))
                               : "null")
        << "\n"
        << "    true_tilt: " << pair(trial.true_tilt) << "\n"
        << "    estimated_tilt: " << (trial.result.known ? pair(trial.result.tilt) : "null") << "\n"
        << "    tilt_sd: " << (trial.result.known ? yamlNumber(trial.result.tilt_sd) : "null")
        << "\n"
        << "    estimated_clearance: "
        << (trial.result.known ? yamlNumber(trial.result.clearance.mean) : "null") << "\n"
        << "    clearance_sd: "
        << (trial.result.known ? yamlNumber(trial.result.clearance.sd) : "null") << "\n"
        << "    final_offset: " << yamlNumber(trial.X_HP.p.head<2>().norm()) << "\n"
        << "    direction_error_rms: " << rms(trial.direction_errors) << "\n"
        << "    contacts: " << trial.result.contacts << "\n"
        << "    simulated_time: " << yamlNumber(trial.result.time) << "\n"
        << "    contact_force: " << yamlNumber(trial.force) << "\n"
        << "    wall_time: " << yamlNumber(wall_time) << "\n";
    if (o.align.insert.wanted()) out << insertion(trial);
    if (trial.identification_time > 0.0) {
      out << "    identification_time: " << yamlNumber(trial.identification_time) << "\n";
    }
    if (!truth.empty()) out << "    mismatch: " << truth << "\n";
  }
  return out.str();
}

// the goal's end, or the reason of a failure
std::string endOf(const Options& o, const AlignTrial& trial) {
  return trial.success && o.align.insert.wanted() ? "seated" : trial.result.reason;
}

KnownMechanism knownMechanism(const Options& o) {
  if (o.identify) {
    throw InputError("--identify: value true: the runs have " + o.mechanism +
                     " of --mechanism already, leave one of them out");
  }
  const KnownMechanism known = assembly_cell::loadKnownMechanism(o.mechanism);
  if (!known.accepted) {
    throw InputError("--mechanism: value " + o.mechanism + ": its identification reports " +
                     known.verdict + "; identify the mechanism again");
  }
  return known;
}

void readInsert(const std::string& text, assembly_cell::InsertParameters& insert) {
  insert.floor = text == "floor";
  if (insert.floor || text.empty()) return;
  if (!assembly_cell::parseNumber(text, insert.depth) || insert.depth < 1e-3 ||
      insert.depth > 1.0) {
    throw InputError("--insert: value " + text + ": give a depth of 0.001 to 1 m, or floor");
  }
}

// Refusals of what `change` does to the parameters name the option.
template <class Change>
void ofParameters(const Change& change) {
  try {
    change();
  } catch (const InputError& error) {
    throw InputError(std::string("--parameter: ") + error.what());
  }
}

// The file that a run's refusal concerns.
const std::string& sourceOf(const Options& o) {
  return o.mechanism.empty() ? o.scenario : o.mechanism;
}

double secondsSince1970() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

// Where records of the runs go, if anywhere: in the order of their seeds, however many threads run.
class Recorder {
 public:
  Recorder(const Options& o, const Task& task) : o_(o), task_(task) {
    if (o.record.empty()) return;
    store_.emplace(o.record, assembly_cell::RunStore::Access::kWrite);
    store_->checkWritable();
    hash_ = assembly_cell::crcText(assembly_cell::yaml::fileText(o.scenario, "a scenario"));
  }
  // Run number i; `record` has the start and the events. It is written once all runs before it are
  void store(std::size_t i, const Run& run, assembly_cell::Run record) {
    if (!store_) return;
    describe(run.trial.result, o_.align, record);
    record.program = o_.program.empty() ? task_.scenario.name : o_.program;
    record.program_hash = hash_;
    record.station = "simulation";
    const std::string seed = std::to_string(run.seed);
    if (!o_.serial_prefix.empty()) record.serial = o_.serial_prefix + seed;
    record.versions["package"] = assembly_cell::packageBuild();
    record.simulation = {{"seed", seed}, {"world", o_.world}};
    if (!run.truth.empty()) record.simulation["mismatch"] = run.truth;
    if (run.trial.false_success) record.simulation["false_success"] = "true";
    for (const std::string& one : o_.overrides) {
      record.settings["scenario." + one.substr(0, one.find('='))] = one.substr(one.find('=') + 1);
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    waiting_.emplace(i, std::move(record));
    for (auto next = waiting_.begin(); next != waiting_.end() && next->first == stored_;
         ++stored_) {
      store_->append(next->second);
      next = waiting_.erase(next);
    }
  }

 private:
  const Options& o_;
  const Task& task_;
  std::string hash_;
  std::mutex mutex_;
  std::map<std::size_t, assembly_cell::Run> waiting_;
  std::size_t stored_ = 0;
  std::optional<assembly_cell::RunStore> store_;
};

std::vector<Run> runAll(const Options& o, const Task& task, Recorder& recorder) {
  std::vector<Run> runs(static_cast<std::size_t>(o.runs));
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::size_t done = 0;
  std::string bad_input;
  assembly_cell::Heartbeat beat(std::chrono::seconds(5), [&](double seconds) {
    const std::lock_guard<std::mutex> lock(mutex);
    std::cerr << "align: " << done << " of " << o.runs << " done, at work for "
              << std::lround(seconds) << " s\n";
  });
  const auto show = [&](const AlignProgress& p) {
    beat.rest();
    std::cerr << "align: " << assembly_cell::text("%.2f", p.time) << " s, " << p.state << ": "
              << p.message << "\n";
  };
  const auto work = [&] {
    for (std::size_t i = next++; i < runs.size(); i = next++) {
      const auto refused = [&](const std::string& why) {
        const std::lock_guard<std::mutex> lock(mutex);
        bad_input = why;
        next = runs.size();
      };
      assembly_cell::Run record;
      record.start = secondsSince1970();
      const auto progress = [&](const AlignProgress& p) {
        if (o.runs == 1) show(p);
        addEvent(p, record);
      };
      try {
        runs[i] = runOnce(o, task, o.cell.seed + i, progress);
      } catch (const InputError& error) {
        return refused(sourceOf(o) + ": " + error.what());
      }
      try {
        recorder.store(i, runs[i], std::move(record));
      } catch (const InputError& error) {
        return refused(error.what());
      }
      runs[i].trial.result.insert.curve = {};  // not printed
      const std::lock_guard<std::mutex> lock(mutex);
      ++done;
      beat.rest();
      if (o.runs > 1) {
        std::cerr << "align: " << done << " of " << o.runs << ", seed " << runs[i].seed << ": "
                  << endOf(o, runs[i].trial) << "\n";
      }
    }
  };
  std::vector<std::thread> threads;
  for (long i = 1; i < std::min(o.threads, o.runs); ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  if (!bad_input.empty()) throw InputError(bad_input);
  return runs;
}

// Refusals of a built cell: an integrator without its step, a coupling without
// stiffness, a place that the arm can't reach
void checkFirstRun(const Options& o, const Task& task) {
  Truth truth;
  const Scenario scenario = task.truthOf(o, o.cell.seed, truth);
  CellParameters cell = o.cell;
  cell.truth = truth.cell;
  try {
    assembly_cell::SimulatedPlant(
        scenario, task.known ? task.known->mechanism : task.scenario.mechanism, cell);
  } catch (const InputError& error) {
    throw InputError(sourceOf(o) + ": " + error.what());
  }
}

// What an arm's first touch is expected to reach.
std::string yamlOfArm(const Options& o, const Task& task) {
  if (!o.cell.arm && task.scenario.mechanism.arm.delay == 0.0) return "";
  const assembly_cell::ArmTouch touch = assembly_cell::armTouch(task.scenario.mechanism, o.align);
  return "arm_touch: {speed: " + yamlNumber(touch.speed) + ", force: " + yamlNumber(touch.force) +
         "}\n";
}

int run(const std::vector<std::string>& arguments) {
  Options o;
  if (!parseOptions(arguments, o)) return 0;
  o.cell.world = assembly_cell::parseWorld(o.world, "--world");
  // the engine's coupling is bolted to the carrier
  if (o.cell.world.mujoco) o.overrides.insert(o.overrides.begin(), "coupling.axes=carrier");
  readInsert(o.insert, o.align.insert);
  ofParameters([&] {
    const assembly_cell::FieldList fields = fieldsOf(o.align);
    for (const std::string& one : o.parameters) setField(fields, one);
  });
  if (!o.arm.empty()) {
    o.cell.arm = std::make_shared<assembly_cell::ArmSetup>(assembly_cell::loadArmSetup(o.arm));
  }
  Task task{assembly_cell::loadScenario(o.scenario, o.overrides), {}, {}};
  if (o.cell.arm && o.align.arm_delay == 0.0 && task.scenario.mechanism.arm.delay == 0.0) {
    o.align.arm_delay = o.cell.arm->bridge.limits.delay;
  }
  ofParameters([&] { assembly_cell::checkParameters(o.align); });
  try {
    assembly_cell::checkGoal(task.scenario.mechanism, o.align, o.cell.sensors);
  } catch (const InputError& error) {
    throw InputError(o.scenario + ": " + error.what());
  }
  if (o.second_goals && o.runs == 1) throw InputError("--second-goals: give --runs above 1, too");
  if (o.second_goals && (o.identify || !o.mechanism.empty())) {
    throw InputError("--second-goals: leave out --identify and --mechanism, it begins in contact");
  }
  if (!o.mechanism.empty()) task.known = knownMechanism(o);
  if (!o.mismatch.empty()) {
    task.mismatch = assembly_cell::loadMismatch(o.mismatch);
    if (!o.arm.empty()) {
      assembly_cell::refuseCarrierDrive(*task.mismatch);
      const std::string unused = unusedWithArm(*task.mismatch);
      if (!unused.empty()) std::cerr << "align: note: " << unused << "\n";
    }
    // a draw that can't be is refused before the first run
    Truth unused;
    for (long i = 0; i < o.runs; ++i) {
      task.truthOf(o, o.cell.seed + static_cast<std::uint64_t>(i), unused);
    }
  }
  if (o.check) checkFirstRun(o, task);
  std::unique_ptr<assembly_cell::NewFile> file;
  if (!o.report.empty()) {
    file = std::make_unique<assembly_cell::NewFile>(o.report, "--report: value " + o.report,
                                                    "give a file that can be written");
  }
  if (o.check) {
    if (!o.record.empty()) assembly_cell::checkWritable(o.record, "--record: value " + o.record);
    return 0;
  }

  Recorder recorder(o, task);
  const std::vector<Run> runs = runAll(o, task, recorder);
  const std::string text = yamlOfArm(o, task) + yaml(runs, o);
  std::cout << text << std::flush;
  if (file) {
    file->write(text);
    file->finish();
  }
  return std::all_of(runs.begin(), runs.end(), [](const Run& r) { return r.trial.success; }) ? 0
                                                                                             : 1;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("align", argc, argv, run); }
