// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/align_trial.h"

#include "assembly_cell/identification/mechanism_check.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/outcome.h"

namespace assembly_cell {
namespace {

constexpr double kCarries = 0.5;  // [N]
constexpr int kMinRecords = 4;    // records for a constant and a harmonic

}  // namespace

PlantBlock TruthRecorder::next(const PlantCommand& command) {
  SimulatorBackend& truth = plant_.truth();
  if (command.exciter) {
    frequency_ = command.exciter->frequency;
    since_ = truth.time();
  }
  const PlantBlock block = plant_.next(command);
  Record record{block.time, truth.pegPose(), 0.0, frequency_ * (block.time - since_), 0};
  double most = kCarries;
  for (const ContactReport& contact : truth.contacts()) {
    if (!contact.valid) continue;
    const double force = contact.force.norm();
    if (force < kCarries) continue;
    ++record.contacts;
    if (force < most) continue;
    most = force;
    const Eigen::Vector3d p = record.X_HP.R.transpose() * (contact.point - record.X_HP.p);
    record.direction = std::atan2(p.y(), p.x());
  }
  force_ = std::max(force_, truth.holeWrench().head<3>().norm());
  records_.push_back(record);
  return block;
}

Pose TruthRecorder::startPose(const AlignResult& result) const {
  for (const Record& record : records_) {
    if (record.time >= result.reference_time) return record.X_HP;
  }
  return plant_.truth().pegPose();
}

std::optional<double> TruthRecorder::directionError(const DirectionReading& reading) const {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  int n = 0;
  for (const Record& record : records_) {
    if (record.time <= reading.start + 1e-9 || record.time > reading.end + 1e-9) continue;
    if (record.contacts != 1) continue;
    const Eigen::Vector3d row(1.0, std::cos(record.angle), std::sin(record.angle));
    A += row * row.transpose();
    b += row * std::remainder(reading.direction - record.direction, 2 * M_PI);
    ++n;
  }
  if (n < kMinRecords) return {};
  return Eigen::Vector3d(A.ldlt().solve(b)).x();
}

void evaluateEnd(const Scenario& truth, const InsertParameters& insert, AlignTrial& trial) {
  const PegParameters& peg = truth.mechanism.peg;
  const HoleParameters& hole = truth.mechanism.hole;
  const double reach = edgeReach(shoulderPose(trial.X_HP, chamferHeight(peg)), peg.radius,
                                 truth.imperfections.bore_lean);
  trial.depth = -trial.X_HP.p.z();
  trial.success =
      trial.result.success && inPlace(trial.X_HP, chamferHeight(peg) + chamferDepth(hole), reach,
                                      peg.radius, hole.radius, insert.goal(hole.depth));
  trial.false_success = trial.result.success && !trial.success;
  if (!trial.false_success) return;
  const AlignError outside = insert.wanted()
                                 ? AlignError(AlignFailure::kNotSeated, "not in the hole so deep")
                                 : AlignError(AlignFailure::kEdgeOutside, "not inside the hole");
  trial.result.failure = outside.failure;
  trial.result.reason = outside.what();
  trial.status = toString(outside.failure);
}

namespace {

AlignResult alignChecked(SimulatedPlant& plant, TruthRecorder& recorder,
                         const KnownMechanism& known, const AlignParameters& parameters,
                         const std::function<void(const AlignProgress&)>& progress) {
  AlignResult refused;
  try {
    const MechanismCheck check = checkMechanism(recorder, known);
    if (check.agrees) {
      plant.setMechanism(known);
      return align(recorder, known.mechanism, withDrive(parameters, known.drive), progress);
    }
    const AlignError error(AlignFailure::kWrongMechanism, check.message);
    refused.failure = error.failure;
    refused.reason = error.what();
  } catch (const AlignError& error) {
    refused.failure = error.failure;
    refused.reason = error.what();
  }
  refused.time = plant.truth().time();
  return refused;
}

// carries out a run and evaluates its end
AlignTrial evaluated(const Scenario& start, SimulatedPlant& plant, const InsertParameters& insert,
                     const std::function<AlignResult(TruthRecorder&, AlignTrial&)>& run) {
  TruthRecorder recorder(plant);
  AlignTrial trial;
  try {
    trial.result = run(recorder, trial);
    trial.status = toString(trial.result.failure);
  } catch (const PlantError& error) {
    trial.result.failure = error.failure;
    trial.result.reason = error.what();
    trial.result.contacts = error.contacts;
    trial.status = error.status;
    trial.result.time = plant.truth().time();
  }
  const Pose X_start = recorder.startPose(trial.result);
  trial.true_offset = -X_start.p.head<2>();
  trial.true_tilt = tiltOf(X_start);
  for (const DirectionReading& reading : trial.result.readings) {
    const auto error = recorder.directionError(reading);
    if (error) trial.direction_errors.push_back(std::abs(*error));
  }
  trial.X_HP = plant.truth().pegPose();
  trial.force = recorder.force();
  evaluateEnd(start, insert, trial);
  return trial;
}

}  // namespace

AlignTrial tryAlignment(const Scenario& start, const Mechanism& mechanism,
                        const CellParameters& cell, const AlignParameters& parameters,
                        const std::function<void(const AlignProgress&)>& progress,
                        const std::function<void(Plant&)>& before) {
  SimulatedPlant plant(start, mechanism, cell);
  return evaluated(start, plant, parameters.insert, [&](TruthRecorder& recorder, AlignTrial&) {
    if (before) before(plant);
    return align(recorder, mechanism, parameters, progress);
  });
}

AlignTrial tryAlignment(const Scenario& start, const KnownMechanism& known,
                        const CellParameters& cell, const AlignParameters& parameters,
                        const std::function<void(const AlignProgress&)>& progress) {
  SimulatedPlant plant(start, known.mechanism, cell);
  return evaluated(start, plant, parameters.insert, [&](TruthRecorder& recorder, AlignTrial&) {
    return known.identified ? alignChecked(plant, recorder, known, parameters, progress)
                            : align(recorder, known.mechanism, parameters, progress);
  });
}

AlignTrial identifyAndAlign(const Scenario& start, const Mechanism& nominal,
                            const CellParameters& cell, const AlignParameters& parameters,
                            const std::function<void(const AlignProgress&)>& progress) {
  SimulatedPlant plant(start, nominal, cell);
  return evaluated(
      start, plant, parameters.insert, [&](TruthRecorder& recorder, AlignTrial& trial) {
        KnownMechanism known = knownAsDrawn(nominal);
        try {
          const Identification found =
              identify(nominal, measure(recorder, nominal, planFor(nominal)));
          if (found.accepted) known = knownFrom(found);
        } catch (const AlignError&) {
          // the nominal mechanism stays; the alignment finds the obstacle
        }
        trial.identification_time = plant.truth().time();
        if (!known.identified) return align(recorder, nominal, parameters, progress);
        plant.setMechanism(known);
        return align(recorder, known.mechanism, withDrive(parameters, known.drive), progress);
      });
}

}  // namespace assembly_cell
