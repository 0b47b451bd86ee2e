// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <string>

#include "assembly_cell/align/search/search.h"

namespace assembly_cell {
namespace {

constexpr double kRise = 8e-3;     // before the way back [m]
constexpr int kMaxBlocks = 500;    // for one of both ways
constexpr int kSettleBlocks = 10;  // before the zero is taken anew

// what another strategy would end with, too
bool isFinal(AlignFailure failure) {
  return failure == AlignFailure::kTooUncertain || failure == AlignFailure::kNoReading ||
         failure == AlignFailure::kNoContact || failure == AlignFailure::kNotStill;
}

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

// straight up and to where the peg hung at the start
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

// the peg isn't free, or its carrier goes nowhere
bool isHeld(AlignFailure failure) {
  return failure == AlignFailure::kInContact || failure == AlignFailure::kStuck ||
         failure == AlignFailure::kNotArrived || failure == AlignFailure::kNoContact;
}

// the next where one failed, from the start again
AlignResult another(const AlignResult& failed, Plant& plant, const PlantBlock& first,
                    const char* name, const std::function<void(const AlignProgress&)>& progress,
                    const std::function<AlignResult()>& next) {
  if (progress) progress({name, failed.contacts, failed.time, failed.reason});
  try {
    if (!goBack(plant, first.carrier)) return failed;
    const double before = plant.next({}).time - first.time;
    AlignResult result = next();
    result.contacts += failed.contacts;
    result.time += before;
    result.reference_time = failed.reference_time;
    return result;
  } catch (PlantError& error) {
    error.contacts += failed.contacts;
    throw;
  }
}

}  // namespace

AlignResult vibratory(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const std::function<void(const AlignProgress&)>& progress) {
  const PlantBlock first = plant.next({});
  const AlignResult quick = doubleContact(plant, mechanism, parameters, progress);
  if (quick.success || isFinal(quick.failure)) return quick;
  return another(quick, plant, first, "single_contact", progress,
                 [&] { return singleContact(plant, mechanism, parameters, progress); });
}

AlignResult autoSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                       const std::function<void(const AlignProgress&)>& progress) {
  const PlantBlock first = plant.next({});
  AlignResult result = touchSearch(plant, mechanism, parameters, progress);
  const auto goOn = [&result] {
    return !result.success && !isHeld(result.failure) && !isFinal(result.failure);
  };
  if (goOn() && plant.twinForce() != nullptr) {
    result = another(result, plant, first, "twin_force", progress,
                     [&] { return twinForce(plant, mechanism, parameters, progress); });
  }
  // what ends twin_force for good, a coarse converter, is nothing to the locus
  if (!result.success && !isHeld(result.failure)) {
    result = another(result, plant, first, "vibratory", progress,
                     [&] { return vibratory(plant, mechanism, parameters, progress); });
  }
  return result;
}

}  // namespace assembly_cell
