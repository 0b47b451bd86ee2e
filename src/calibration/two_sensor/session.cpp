// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/session.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/calibration/common/store.h"

namespace assembly_cell {

namespace fs = std::filesystem;

namespace {

std::string displacementKey(Side side) { return sensorName(side) + "_displacement"; }

bool hasDisplacement(const Calibration& c) { return !c.volts_to_displacement.isZero(0.0); }

void copyDisplacement(const Calibration& from, Calibration& to) {
  to.volts_to_displacement = from.volts_to_displacement;
  to.quadratic_displacement = from.quadratic_displacement;
  to.displacement_products = from.displacement_products;
  to.displacement_covariance = from.displacement_covariance;
  to.displacement_variance = from.displacement_variance;
  to.displacement_range = from.displacement_range;
  to.displacement_fit = from.displacement_fit;
}

}  // namespace

SolveSettings solveSettings(const ObservationSet& set) {
  SolveSettings settings;
  settings.wrench = false;
  for (const Observation& o : set.observations) {
    settings.wrench = settings.wrench || isForceTest(o.kind);
    if (o.kind == ObservationKind::kDisplacement) settings.displacement[o.side] = true;
  }
  return settings;
}

CalibrationSession::CalibrationSession(std::string store, ObservationSet set)
    : store_(std::move(store)), set_(std::move(set)) {
  if (!store_.empty()) readActive();
}

// ---- observations ----

bool CalibrationSession::openJournal() {
  const std::string path = store_ + "/observations.yaml";
  for (const Side side : kSides) makeCalibrationFolder(store_, sensorName(side));
  journal_ = std::make_unique<ObservationLog>(path, observationHeader(set_));
  if (journal_->lost() > 0) {
    const std::size_t kept = journal_->records().size();
    warnings_.push_back("journal '" + path + "' was cut: " + std::to_string(journal_->lost()) +
                        " of " + std::to_string(kept + journal_->lost()) +
                        " observations are lost, the first " + std::to_string(kept) +
                        " are kept: restore the file, or measure the others again");
  }
  removeLeftovers(store_);
  for (const Side side : kSides) removeLeftovers(store_ + "/" + sensorName(side));
  for (std::size_t i = 0; i < journal_->records().size(); ++i) {
    set_.observations.push_back(parseObservation(
        journal_->records()[i], set_, "journal '" + path + "', record " + std::to_string(i + 1)));
  }
  return journal_->torn();
}

void CalibrationSession::add(const Observation& observation) {
  checkObservation(observation, set_, "observation");
  const std::string line = observationLine(observation);
  // as it will be after a restart, to the last bit
  const Observation kept = parseObservation(line, set_, "observation");
  if (journal_) journal_->append(line);
  solution_.reset();
  const std::lock_guard<std::mutex> lock(mutex_);
  set_.observations.push_back(kept);
}

Observation CalibrationSession::removeLast() {
  if (journal_) journal_->removeLast();
  solution_.reset();
  const std::lock_guard<std::mutex> lock(mutex_);
  const Observation last = set_.observations.back();
  set_.observations.pop_back();
  return last;
}

void CalibrationSession::clear() {
  ObservationSet empty = set_;
  empty.observations.clear();
  if (journal_) journal_->clear(observationHeader(empty));
  solution_.reset();
  const std::lock_guard<std::mutex> lock(mutex_);
  set_.observations.clear();
}

ObservationSet CalibrationSession::observations() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return set_;
}

// ---- solution ----

const CalibrationSolution& CalibrationSession::solve(const SolveSettings& settings) {
  CalibrationSolution out;
  out.set = set_;
  out.accepted = true;
  ForceSettings force = settings.force;
  PerSide<Calibration> maps;
  for (const Side side : kSides) {
    if (active_[side]) maps[side] = active_[side]->calibration;
    if (settings.displacement[side]) {
      const DisplacementSolution& found =
          out.displacement[side].emplace(solveDisplacement(out.set, side));
      if (found.accepted) applyDisplacement(found, maps[side]);
      out.accepted = out.accepted && found.accepted;
      out.message += (out.message.empty() ? "" : "; ") + sensorName(side) + ": " + found.message;
    }
    if (hasDisplacement(maps[side])) force.displacement[side] = &maps[side];
  }
  if (settings.wrench) {
    out.force = solveForce(out.set, force);
    out.accepted = out.accepted && out.force->accepted;
    out.message = out.force->message + (out.message.empty() ? "" : "; ") + out.message;
  }
  if (out.message.empty()) {
    throw CalibrationError(
        CalibrationFailure::kNothingToSolve,
        std::to_string(out.set.observations.size()) +
            " observations, no loaded one: add reacting tests and weights (see plan)");
  }
  return solution_.emplace(std::move(out));
}

// ---- the store ----

std::vector<std::string> CalibrationSession::folders(Side side) const {
  const std::string name = sensorName(side), &serial = set_.sensor[side].serial_number;
  if (serial == name || !isCalibrationName(serial)) return {name};
  return {name, serial};
}

std::vector<std::string> CalibrationSession::stored(Side side) const {
  std::vector<std::string> ids;
  for (const std::string& folder : folders(side)) {
    const std::vector<std::string> more = storedCalibrations(store_, folder);
    ids.insert(ids.end(), more.begin(), more.end());
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

MaybePerSide<Calibration> CalibrationSession::save(const std::string& wanted,
                                                   const PerSide<Calibration>& fallback) {
  if (!solution_) {
    throw CalibrationError(CalibrationFailure::kNotSolved,
                           "nothing solved since the last observation: call solve");
  }
  const CalibrationSolution& solution = *solution_;
  if (!solution.accepted) {
    throw CalibrationError(CalibrationFailure::kNotAccepted, "not accepted: " + solution.message);
  }
  std::vector<std::string> taken = stored(Side::kA), others = stored(Side::kB);
  taken.insert(taken.end(), others.begin(), others.end());
  const std::string id = wanted.empty() ? newCalibrationId(taken) : wanted;
  MaybePerSide<Calibration> out;
  for (const Side side : kSides) {
    const std::string name = sensorName(side);
    calibrationPath(store_, name, id);  // refuses what is no name
    if (std::find(taken.begin(), taken.end(), id) != taken.end()) {
      throw CalibrationError(
          CalibrationFailure::kIdTaken,
          "id '" + id + "' is taken: give another; stored ones are never overwritten");
    }
    if (!solution.force && !solution.displacement[side]) continue;
    // maps that this solution doesn't determine are kept
    Calibration& c = out[side].emplace(active_[side] ? active_[side]->calibration : fallback[side]);
    if (!hasDisplacement(c)) copyDisplacement(fallback[side], c);
    if (!solution.force && c.volts_to_wrench.isZero(0.0)) {
      throw CalibrationError(
          CalibrationFailure::kNoWrench,
          name + " has a displacement but no wrench yet: calibrate the force, or load");
    }
    const std::string& serial = set_.sensor[side].serial_number;
    c.id = id;
    c.serial_number = serial.empty() ? name : serial;
    c.date = calibrationDate();
    if (solution.force) applyForce(*solution.force, solution.set, side, c);
    if (solution.displacement[side]) applyDisplacement(*solution.displacement[side], c);
  }
  for (const Side side : kSides) {
    if (!out[side]) continue;
    makeCalibrationFolder(store_, sensorName(side));
    saveCalibration(*out[side], calibrationPath(store_, sensorName(side), id));
  }
  return out;
}

Calibration CalibrationSession::loadStored(Side side, const std::string& id) const {
  const std::string name = sensorName(side), serial = set_.sensor[side].serial_number;
  std::string path;
  for (const std::string& folder : folders(side)) {
    const std::string candidate = calibrationPath(store_, folder, id);
    if (path.empty() && fs::exists(candidate)) path = candidate;
  }
  if (path.empty()) {
    std::string known;
    for (const std::string& there : stored(side)) known += (known.empty() ? "" : ", ") + there;
    throw CalibrationError(CalibrationFailure::kUnknownId,
                           name + " has no calibration '" + id +
                               "' stored: give one of: " + (known.empty() ? "(none)" : known));
  }
  Calibration c = loadCalibration(path);
  if (c.serial_number != (serial.empty() ? name : serial)) {
    throw CalibrationError(CalibrationFailure::kForeign,
                           "calibration file '" + path + "' is of sensor '" + c.serial_number +
                               "', " + name + " is '" + serial + "': give one of its own");
  }
  if (c.id != id) {
    throw CalibrationError(CalibrationFailure::kRenamed,
                           "calibration file '" + path + "' holds calibration '" + c.id +
                               "': a file that was copied or renamed; give the original");
  }
  return c;
}

MaybePerSide<ActiveCalibration> CalibrationSession::load(
    const std::string& id, const PerSide<bool>& wanted,
    const PerSide<Calibration>& fallback) const {
  MaybePerSide<ActiveCalibration> out;
  for (const Side side : kSides) {
    if (!wanted[side]) continue;
    ActiveCalibration& loaded = out[side].emplace(ActiveCalibration{loadStored(side, id), ""});
    if (hasDisplacement(loaded.calibration)) continue;
    if (active_[side] && hasDisplacement(active_[side]->calibration)) {
      const ActiveCalibration& now = *active_[side];
      copyDisplacement(now.calibration, loaded.calibration);
      loaded.displacement_of =
          now.displacement_of.empty() ? now.calibration.id : now.displacement_of;
    } else {
      copyDisplacement(fallback[side], loaded.calibration);
    }
  }
  return out;
}

void CalibrationSession::activate(const MaybePerSide<ActiveCalibration>& calibrations) {
  std::string text;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const Side side : kSides) {
      if (calibrations[side]) active_[side] = calibrations[side];
      const ActiveCalibration now = active_[side].value_or(ActiveCalibration());
      if (!now.displacement_of.empty()) {
        text += displacementKey(side) + ": " + yamlQuoted(now.displacement_of) + "\n";
      }
      // the last line of each sensor, also without a calibration: a file that was cut lacks one
      text +=
          sensorName(side) + ": " + (active_[side] ? yamlQuoted(now.calibration.id) : "~") + "\n";
    }
  }
  const std::string path = store_ + "/in_force.yaml";
  writeFileAtomically(path, text, "file '" + path + "'");
}

MaybePerSide<ActiveCalibration> CalibrationSession::active() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return active_;
}

// A damaged file adds a warning; its sensor then has no active calibration.
void CalibrationSession::readActive() {
  const std::string path = store_ + "/in_force.yaml";
  if (!fs::exists(path)) return;
  for (const Side side : kSides) {
    const std::string name = sensorName(side);
    const std::string damaged = "file '" + path + "' is damaged: ";
    try {
      std::ifstream in(path);
      std::string text{std::istreambuf_iterator<char>(in), {}};
      // a line that is cut, maybe within an id
      text.resize(text.rfind('\n') + 1);
      if (const std::string why = tooDeep(text); !why.empty()) throw InputError(damaged + why);
      const YAML::Node root = YAML::Load(text);
      if (!root.IsMap() || !root[name]) {
        throw InputError(damaged + "it has no line '" + name + ": ID': load a calibration");
      }
      if (root[name].IsNull()) continue;
      ActiveCalibration found{loadStored(side, root[name].as<std::string>()), ""};
      if (const YAML::Node other = root[displacementKey(side)]) {
        found.displacement_of = other.as<std::string>();
        copyDisplacement(loadStored(side, found.displacement_of), found.calibration);
      }
      active_[side] = found;
    } catch (const YAML::Exception& error) {
      warnings_.push_back("no active calibration for " + name + ": " + damaged + error.msg +
                          ": load a calibration");
    } catch (const InputError& error) {
      warnings_.push_back("no active calibration for " + name + ": " + error.what());
    }
  }
}

}  // namespace assembly_cell
