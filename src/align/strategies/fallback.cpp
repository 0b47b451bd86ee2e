// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Strategies that try others, one after another from the start.
#include <algorithm>
#include <initializer_list>

#include "assembly_cell/align/search/report_noise.h"
#include "assembly_cell/align/strategies/strategies.h"

namespace assembly_cell {
namespace {

constexpr double kRise = 8e-3;     // before the motion back [m]
constexpr int kMaxBlocks = 500;    // for one of both motions
constexpr int kSettleBlocks = 10;  // before the next zero

bool goTo(Plant& plant, const RestPose& rest, const ReportNoise& noise) {
  PlantCommand command;
  command.rest = rest;
  RestPose before = plant.next({}).carrier;
  for (int i = 0; i < kMaxBlocks; ++i) {
    const RestPose at = plant.next(command).carrier;
    if (arrived(before, at, rest, noise)) {
      for (int k = 0; k < blocksToEnd(noise); ++k) plant.next({});
      return true;
    }
    before = at;
    command.rest.reset();
  }
  return false;
}

// Straight up and to the start, where the peg hung.
bool goBack(Plant& plant, const RestPose& start) {
  ReportNoiseMeter meter;
  for (int i = 0; i < kSettleBlocks; ++i) meter.add(plant.next({}).carrier);
  const ReportNoise noise = meter.noise();
  RestPose up = plant.next({}).carrier;
  up.z = std::max(start.z, up.z + kRise);
  RestPose over = start;
  over.z = up.z;
  if (!goTo(plant, up, noise) || !goTo(plant, over, noise) || !goTo(plant, start, noise)) {
    return false;
  }
  for (int i = 0; i < kSettleBlocks; ++i) plant.next({});
  return true;
}

// A strategy that follows a failed one.
struct Fallback {
  const char* name;
  AlignResult (*run)(Plant&, const Mechanism&, const AlignParameters&, const ProgressCallback&);
  bool FailureTraits::*follows;  // failures that it follows
};

// An estimate that a later strategy doesn't have.
void keepEstimate(const AlignResult& earlier, AlignResult& result) {
  if (result.known || !earlier.known) return;
  result.known = true;
  result.offset = earlier.offset;
  result.offset_covariance = earlier.offset_covariance;
  result.tilt = earlier.tilt;
  result.tilt_sd = earlier.tilt_sd;
  result.clearance = earlier.clearance;
}

// The first strategy, and where it fails the others in turn, each from the start again, in the time
// that is left. The result is that of the last one, with the contacts and the time of all.
AlignResult tryInTurn(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const ProgressCallback& progress, decltype(Fallback::run) first,
                      std::initializer_list<Fallback> others) {
  const PlantBlock start = plant.next({});
  AlignResult result = first(plant, mechanism, parameters, progress);
  for (const Fallback& other : others) {
    if (result.success || !(traitsOf(result.failure).*other.follows)) continue;
    if (progress) progress({other.name, result.contacts, result.time, result.reason});
    try {
      if (!goBack(plant, start.carrier)) continue;
      const double before = plant.next({}).time - start.time;
      AlignParameters rest = parameters;
      rest.spent = before;
      AlignResult next = other.run(plant, mechanism, rest, progress);
      next.contacts += result.contacts;
      next.time += before;
      next.reference_time = result.reference_time;
      if (!next.success) keepEstimate(result, next);
      if (next.failure == AlignFailure::kTimeLimit) {
        // what the earlier one met is the reason
        next.failure = result.failure;
        next.reason = result.reason + "; then " + next.reason;
      }
      result = next;
    } catch (PlantError& error) {
      error.contacts += result.contacts;
      throw;
    }
  }
  return result;
}

}  // namespace

AlignResult vibratory(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const ProgressCallback& progress) {
  return tryInTurn(plant, mechanism, parameters, progress, doubleContact,
                   {{"single_contact", singleContact, &FailureTraits::single_contact_next}});
}

AlignResult autoSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                       const ProgressCallback& progress) {
  const Fallback last{"vibratory", vibratory, &FailureTraits::vibratory_next};
  if (plant.twinForce() == nullptr) {
    return tryInTurn(plant, mechanism, parameters, progress, touchSearch, {last});
  }
  return tryInTurn(plant, mechanism, parameters, progress, touchSearch,
                   {{"twin_force", twinForce, &FailureTraits::twin_force_next}, last});
}

}  // namespace assembly_cell
