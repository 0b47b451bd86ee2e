// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/study/run.h"

#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>

#include "assembly_cell/align/outcome.h"
#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/dynamics/simulation.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// empty for what is undefined
std::string textOf(double value) { return std::isfinite(value) ? yamlNumber(value) : ""; }
std::string textOf(std::int64_t value) { return std::to_string(value); }
std::string textOf(bool value) { return value ? "1" : "0"; }

// What a run came to. Outcomes by name; those that never were set are undefined.
struct Result {
  std::string status, reason;
  bool failed = false;
  bool assembled = false;
  std::vector<std::string> names, values;
  std::string history;

  template <class Value>
  void set(const char* name, const Value& value) {
    names.emplace_back(name);
    values.push_back(textOf(value));
  }
  void setText(const char* name, const std::string& text) {
    names.emplace_back(name);
    values.push_back(text);
  }
  std::string get(const std::string& name) const {
    const auto found = std::find(names.begin(), names.end(), name);
    return found == names.end() ? "" : values[static_cast<std::size_t>(found - names.begin())];
  }
};

// contact slots in the order of simulate's column `mode`
std::string modeOf(const Scenario& scenario, const std::array<ContactReport, kSlots>& contacts) {
  const ContactSlotMask shown = kEdgeEdgeSlots | kEdgePlaneSlots | scenario.contact.features;
  ContactShapes shapes;
  shapes.chamfer.width = scenario.mechanism.hole.chamfer_width;
  shapes.peg_chamfer.width = scenario.mechanism.peg.chamfer_width;
  const ContactSlotMask known = possibleSlots(shapes);
  std::string mode;
  for (std::size_t i = 0; i < kSlots; ++i) {
    if (shown & known & 1u << i) mode += "-sS"[contacts[i].state];
  }
  return mode;
}

// Looks at a simulation from time to time.
class Observer {
 public:
  Observer(Simulation& simulation, const StudyJob& job, std::int64_t run, bool history)
      : simulation_(simulation), job_(job), run_(run), history_(history) {}

  // true when a rule ends the run here
  bool look(Result& result) {
    const auto& contacts = simulation_.contacts();
    double force = 0.0;
    for (const ContactReport& contact : contacts) {
      if (contact.state != ContactReport::kOpen) force = std::max(force, contact.force.norm());
    }
    peak_ = std::max(peak_, force);
    const std::string mode = modeOf(simulation_.scenario(), contacts);
    if (mode != mode_) {
      mode_ = mode;
      ++changes_;
      modes_ += (modes_.empty() ? "" : " ") + text("%.6g:", simulation_.time()) + mode;
    }
    if (history_) writeRow(force, mode, result.history);

    if (!result.assembled && assembled()) {
      result.assembled = true;
      time_to_assemble_ = simulation_.time();
    }
    if (result.assembled && job_.stop_assembled) {
      result.status = "assembled";
    } else if (force > job_.stop_force) {
      result.status = "force_limit";
    } else if (static_cast<double>(simulation_.counts().evaluations) > job_.stop_evaluations) {
      result.status = "evaluation_limit";
    }
    return !result.status.empty();
  }

  void summarise(Result& result) {
    const Pose X_HP = simulation_.pegPose();
    const State& state = simulation_.state();
    const RunCounts& counts = simulation_.counts();
    result.set("stopped_at", simulation_.time());
    const bool evaluated =
        std::isfinite(job_.assembled_depth) || std::isfinite(job_.assembled_offset);
    if (evaluated) result.set("assembled", result.assembled);
    if (result.assembled) result.set("time_to_assemble", time_to_assemble_);
    result.set("final_offset", X_HP.p.head<2>().norm());
    result.set("final_depth", depth(X_HP));
    result.set("final_tilt", tiltOf(X_HP).norm());
    result.set("final_distance", std::hypot(state.q[1], state.q[2]));
    result.set("final_x", state.q[1]);
    result.set("final_y", state.q[2]);
    result.set("final_z", state.q[0]);
    result.set("final_theta", state.q[4]);
    result.set("final_psi", state.q[5]);
    result.set("peak_force", peak_);
    result.set("mode_changes", std::max<std::int64_t>(0, changes_ - 1));
    result.setText("modes", modes_);
    result.set("events", counts.events);
    result.set("impacts", counts.impacts);
    result.set("evaluations", counts.evaluations);
    // nothing that isn't a number leaves as one
    result.failed = result.failed || !std::isfinite(X_HP.p.norm());
  }

 private:
  // depth of the highest point of the peg's bottom edge below the hole's plane
  double depth(const Pose& X_HP) const {
    return -(X_HP.p.z() + tipRadius(simulation_.scenario().mechanism.peg) *
                              std::hypot(X_HP.R(2, 0), X_HP.R(2, 1)));
  }

  bool assembled() const {
    const bool by_depth = std::isfinite(job_.assembled_depth);
    const bool by_offset = std::isfinite(job_.assembled_offset);
    if (!by_depth && !by_offset) return false;
    const Pose X_HP = simulation_.pegPose();
    const double offset = X_HP.p.head<2>().norm();
    if (by_depth && !(depth(X_HP) >= job_.assembled_depth &&
                      offset < simulation_.scenario().mechanism.hole.radius)) {
      return false;
    }
    return !by_offset || offset <= job_.assembled_offset;
  }

  void writeRow(double force, const std::string& mode, std::string& out) const {
    const State& s = simulation_.state();
    out += std::to_string(run_) + "," + textOf(simulation_.time());
    for (const int i : {1, 2, 0, 3, 4, 5, 6, 7, 8}) out += "," + textOf(s.q[i]);
    for (const int i : {1, 2, 0}) out += "," + textOf(s.v[i]);
    out += "," + textOf(force) + "," + mode + "\n";
  }

  Simulation& simulation_;
  const StudyJob& job_;
  const std::int64_t run_;
  const bool history_;
  double peak_ = 0.0, time_to_assemble_ = kStudyNone;
  std::string mode_, modes_;
  std::int64_t changes_ = 0;
};

void simulateRun(const Scenario& scenario, const StudyJob& job, std::int64_t run, bool history,
                 Result& result) {
  Simulation simulation(scenario);
  Observer observer(simulation, job, run, history);
  const double duration = scenario.duration;
  const auto looks = static_cast<std::int64_t>(
      std::max(1.0, std::ceil(std::min(1e7, duration / job.look) - 1e-9)));
  bool moved = !job.move.given;
  StopReason reason = simulation.advance(0.0);
  bool ended = reason == StopReason::kOk && observer.look(result);
  for (std::int64_t i = 1; i <= looks && !ended && reason == StopReason::kOk; ++i) {
    const double time =
        i == looks ? duration : duration * static_cast<double>(i) / static_cast<double>(looks);
    if (!moved && job.move.delay <= time) {
      reason = simulation.advance(job.move.delay);
      if (reason != StopReason::kOk) break;
      RestPose rest = simulation.rest();
      rest.x += job.move.x;
      rest.y += job.move.y;
      rest.z += job.move.z;
      simulation.setRestTarget(rest);
      moved = true;
    }
    reason = simulation.advance(time);
    if (reason == StopReason::kOk) ended = observer.look(result);
  }
  if (reason != StopReason::kOk) {
    result.status = toString(reason);
    result.failed = true;
    result.reason = "stopped at " + textOf(simulation.time()) + " s of " + textOf(duration) + " s";
    // the last state belongs to the history and the peak, but no success is late
    Result at_end;
    if (reason != StopReason::kNonFinite) observer.look(at_end);
    result.history += at_end.history;
  } else if (result.status == "force_limit" || result.status == "evaluation_limit") {
    result.failed = true;
    result.reason = (result.status == "force_limit" ? "stop.force" : "stop.evaluations") +
                    std::string(" reached at ") + textOf(simulation.time()) + " s";
  } else if (result.status.empty()) {
    result.status = "ok";
  }
  observer.summarise(result);
}

void alignRun(const Scenario& scenario, const Mechanism& mechanism, const StudyJob& job,
              Result& result) {
  const AlignTrial trial = tryAlignment(scenario, mechanism, job.cell, job.align);
  const AlignResult& aligned = trial.result;
  result.assembled = trial.success;
  result.failed = !result.assembled;
  result.status = trial.status;
  result.reason = result.assembled ? "" : aligned.reason;
  result.set("assembled", result.assembled);
  if (result.assembled) result.set("time_to_assemble", aligned.time);
  result.set("stopped_at", aligned.time);
  result.set("final_offset", trial.X_HP.p.head<2>().norm());
  result.set("final_tilt", tiltOf(trial.X_HP).norm());
  result.set("start_offset", trial.true_offset.norm());
  result.set("start_tilt", trial.true_tilt.norm());
  if (aligned.known) {
    result.set("offset_error", (aligned.offset - trial.true_offset).norm());
    result.set("tilt_error", (aligned.tilt - trial.true_tilt).norm());
    result.set("offset_sd", std::sqrt(std::max(0.0, aligned.offset_covariance.trace())));
    result.set("tilt_sd", aligned.tilt_sd);
    result.set("clearance", aligned.clearance.mean);
    result.set("clearance_sd", aligned.clearance.sd);
  }
  if (!trial.direction_errors.empty()) {
    double sum = 0.0;
    for (const double error : trial.direction_errors) sum += error * error;
    result.set("direction_error",
               std::sqrt(sum / static_cast<double>(trial.direction_errors.size())));
  }
  result.set("contacts", static_cast<std::int64_t>(aligned.contacts));
}

}  // namespace

const std::vector<std::string>& outcomeNames(StudyJob::Kind kind) {
  static const std::vector<std::string> simulate = {
      "stopped_at",  "assembled",      "time_to_assemble", "final_offset", "final_depth",
      "final_tilt",  "final_distance", "final_x",          "final_y",      "final_z",
      "final_theta", "final_psi",      "peak_force",       "mode_changes", "modes",
      "events",      "impacts",        "evaluations"};
  static const std::vector<std::string> align = {
      "stopped_at",   "assembled",  "time_to_assemble", "final_offset",    "final_tilt",
      "start_offset", "start_tilt", "offset_error",     "tilt_error",      "offset_sd",
      "tilt_sd",      "clearance",  "clearance_sd",     "direction_error", "contacts"};
  return kind == StudyJob::Kind::kAlign ? align : simulate;
}

std::string resultsHeader(const Study& study) {
  std::string header = "run,seed";
  for (const StudyAxis& axis : study.axes) header += "," + axis.name;
  header += ",status,reason";
  for (const std::string& name : study.outcomes) header += "," + name;
  if (study.mismatch) header += ",mismatch";
  return header;
}

std::string historyHeader() {
  return "run,t,x,y,z,phi,theta,psi,carrier_x,carrier_y,carrier_yaw,x_rate,y_rate,z_rate,force,"
         "mode";
}

Scenario StudyRunner::scenarioOf(const std::vector<StudySetting>& settings, StudyJob& job) {
  std::size_t file = 0;
  std::vector<std::string> overrides;
  std::vector<const StudySetting*> numbers;
  for (const StudySetting& s : study_.set) {
    if (!setStudyJob(job, s)) overrides.push_back(s.key + "=" + s.value);
  }
  for (const StudySetting& s : settings) {
    if (s.key == "scenario") {
      file = static_cast<std::size_t>(
          std::find(study_.scenarios.begin(), study_.scenarios.end(), s.value) -
          study_.scenarios.begin());
    } else if (!setStudyJob(job, s)) {
      const bool direct =
          std::find(study_.direct.begin(), study_.direct.end(), s.key) != study_.direct.end();
      if (direct) {
        numbers.push_back(&s);
      } else {
        overrides.push_back(s.key + "=" + s.value);
      }
    }
  }
  std::string key = std::to_string(file);
  for (const std::string& text : overrides) key += "\n" + text;
  if (key != parsed_key_) {
    parsed_key_.clear();
    parsed_ = parseScenario(study_.texts[file], study_.scenarios[file], overrides);
    parsed_key_ = key;
  }
  Scenario scenario = parsed_;
  for (const StudySetting* s : numbers) {
    parseNumber(s->value, *scenarioNumber(scenario, s->key));
  }
  return scenario;
}

StudyRecord StudyRunner::run(const StudyTask& task) {
  const StudyRun plan = studyRun(study_, task);
  Result result;
  std::string drawn;
  try {
    StudyJob job = study_.job;
    const Scenario nominal = scenarioOf(plan.settings, job);
    job.cell.seed = plan.seed;
    Scenario scenario = nominal;
    if (job.start.given) {
      const StudyStart& s = job.start;
      const Vector2d offset =
          Vector2d(s.x, s.y) + s.offset * Vector2d(std::cos(s.azimuth), std::sin(s.azimuth));
      const Vector2d tilt = Vector2d(s.tilt_x, s.tilt_y) +
                            s.tilt * Vector2d(std::cos(s.tilt_azimuth), std::sin(s.tilt_azimuth));
      scenario = startAt(nominal, offset, tilt, s.height);
    }
    if (study_.mismatch) {
      const Truth truth = drawTruth(*study_.mismatch, plan.seed);
      drawn = truthText(truth);
      scenario = trueScenario(scenario, truth, study_.mismatch->source);
      job.cell.truth = truth.cell;
    }
    if (job.kind == StudyJob::Kind::kAlign) {
      alignRun(scenario, nominal.mechanism, job, result);
    } else {
      simulateRun(scenario, job, task.run, study_.history, result);
    }
  } catch (const InputError& e) {
    result = Result();
    result.failed = true;
    result.status = "bad_input";
    result.reason = e.what();
  } catch (const std::exception& e) {
    result = Result();
    result.failed = true;
    result.status = "error";
    result.reason = e.what();
  }

  StudyRecord record;
  record.run = task.run;
  record.failed = result.failed;
  record.assembled = result.assembled;
  record.row = std::to_string(task.run) + "," + std::to_string(plan.seed);
  for (const std::string& label : plan.labels) record.row += "," + label;
  record.row += "," + csvCell(result.status) + "," + csvCell(result.reason);
  for (const std::string& name : study_.outcomes) record.row += "," + result.get(name);
  if (study_.mismatch) record.row += "," + csvCell(drawn);
  record.history = std::move(result.history);
  double objective = 0.0;
  if (!study_.search.outcome.empty() && parseNumber(result.get(study_.search.outcome), objective)) {
    record.objective = objective;
  }
  return record;
}

std::string encodeRecord(const StudyRecord& record) {
  const std::string payload = record.row + "\n" + record.history;
  const std::string head =
      text("%" PRId64 " %d %d %a %zu %zu ", record.run, record.failed ? 1 : 0,
           record.assembled ? 1 : 0, record.objective, record.row.size(), record.history.size());
  return head + crcText(head + payload) + "\n" + payload + "\n";
}

std::size_t decodeRecord(const char* text, std::size_t size, StudyRecord& record) {
  const std::string head(text, std::find(text, text + std::min<std::size_t>(size, 160), '\n'));
  int failed = 0, assembled = 0, length = 0;
  std::size_t row = 0, history = 0;
  const int read = std::sscanf(head.c_str(), "%" SCNd64 " %d %d %la %zu %zu %n", &record.run,
                               &failed, &assembled, &record.objective, &row, &history, &length);
  const std::size_t whole = head.size() + 1 + row + 1 + history + 1;
  if (read != 6 || length == 0 || row > size || history > size || whole > size) return 0;
  const std::string payload(text + head.size() + 1, row + 1 + history);
  const std::string seal = head.substr(static_cast<std::size_t>(length));
  if (seal != crcText(head.substr(0, static_cast<std::size_t>(length)) + payload)) return 0;
  record.failed = failed != 0;
  record.assembled = assembled != 0;
  record.row = payload.substr(0, row);
  record.history = payload.substr(row + 1);
  return whole;
}

}  // namespace assembly_cell
