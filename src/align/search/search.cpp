// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/search.h"

#include <algorithm>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr double kLeave = 8e-3;  // travel up after a failure [m]
constexpr double kOver = 6e-3;   // over the face, before the offset aside from the hole [m]

}  // namespace

Search::Search(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
               const ProgressCallback& progress)
    : state(plant, mechanism, parameters, progress),
      retreat(state),
      touch(state, retreat),
      insertion(state),
      entry(state, insertion) {}

bool Search::begin() {
  const bool deep = entry.startsDeep();
  if (deep) {
    state.carrier.tare();
  } else {
    tareFreePeg(state.carrier, state.mechanism);
  }
  state.startHere();
  state.report("tare",
               deep ? text("%.1f mm deep in the hole", state.p.inserted * 1e3) : "hanging free");
  if (!deep && state.p.insert.wanted() && !(state.p.inserted > 0.0)) {
    // a depth counts from the face, which a peg that is in the hole already hasn't touched
    if (entry.takeOut(retreat)) {
      tareFreePeg(state.carrier, state.mechanism);
      state.startHere();
    }
  } else if (deep) {
    entry.requireStillIn();
    return true;
  } else if (entry.isIn()) {
    return true;
  }
  state.report(AlignProgress::kOutside, "no wall beside the peg");
  return false;
}

AlignResult Search::run(const std::function<void()>& find,
                        const std::function<void(AlignResult&)>& summarise) {
  try {
    AlignResult result = findAndLeave(find);
    if (state.found) summarise(result);
    result.clearance = state.known.clearance;
    return result;
  } catch (PlantError& error) {
    error.contacts += state.contacts;
    throw;
  }
}

AlignResult Search::findAndLeave(const std::function<void()>& find) {
  AlignResult result;
  bool inserting = false;
  try {
    state.carrier.limitTime(state.carrier.limits().time);
    find();
    if (state.p.insert.wanted()) {
      inserting = true;
      state.carrier.limitTime(TimeLimit::of(state.p.insert.time_limit, insertion.defaultTime()));
      insertion.insert();
    }
    result.success = true;
    result.reason = toString(result.failure);
    if (state.found && entry.height_known) {
      result.depth = std::max(0.0, state.hole.height - state.hole.normal.dot(state.peg().p));
    }
  } catch (const AlignError& error) {
    result.failure = error.failure;
    result.reason = error.what();
    if (error.failure == AlignFailure::kTimeLimit || error.failure == AlignFailure::kStuck) {
      const bool late = error.failure == AlignFailure::kTimeLimit;
      if (late && inserting) result.reason += " of insertion";
      result.reason += text(", clearance %.0f +- %.0f um", state.known.clearance.mean * 1e6,
                            state.known.clearance.sd * 1e6);
      if (entry.refused > 0) {
        result.reason += text(", resistance all round the hole %d times", entry.refused);
      }
    }
  }
  if (!result.success) {
    try {
      leave();
    } catch (const AlignError& error) {
      // the first failure is the reason; but from a stuck peg no other strategy can go on
      if (error.failure == AlignFailure::kStuck) {
        result.failure = error.failure;
        result.reason = std::string(error.what()) + "; before: " + result.reason;
      }
    }
  }
  result.insert = state.inserted;
  result.contacts = state.contacts;
  result.time = state.carrier.last().time - state.start_time;
  result.reference_time = state.frame.time();
  return result;
}

// Exciter off, and the peg free.
void Search::leave() {
  GuardedCarrier& carrier = state.carrier;
  carrier.limitTime({});
  try {
    if (state.inserted.end.depth > 0.0) insertion.backOut(state.inserted.end.depth);
  } catch (const AlignError&) {
    // a peg that a pull along the bore doesn't free may come free upright
  }
  const double up = carrier.last().carrier.z - state.frame.start().z;
  // at or above the start it hangs free: goals that fail in the air don't raise it each time
  const bool hangs = !entry.startsDeep() && up > -kHeightNoise &&
                     carrier.force().norm() < carrier.sensor().freeForce();
  const double travel = kLeave * state.scale.travel;
  if (state.frame.isStarted() && !hangs && up < travel) {
    retreat.backOut(travel);
  } else {
    exciterOff(carrier, state.p.exciter_direction);
  }
}

Eigen::Vector2d holeOffset(const SearchState& state) {
  const Eigen::Vector3d start(0, 0, -state.frame.length());
  return (rotationToAxis(state.hole.normal).transpose() * (state.hole.center - start)).head<2>();
}

void summariseHole(const SearchState& state, AlignResult& result) {
  result.known = true;
  result.offset = holeOffset(state);
  result.offset_covariance = state.hole.center_covariance;
  result.tilt = -axisTilt(state.hole.normal);
  result.tilt_sd = state.hole.normal_sd;
}

bool withdraw(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
              const ProgressCallback& progress) {
  checkParameters(parameters);
  Search search(plant, mechanism, parameters, progress);
  SearchState& state = search.state;
  if (!(parameters.inserted > 0.0)) {
    state.carrier.tare();
    state.startHere();
    return search.entry.takeOut(search.retreat);
  }
  const Pose peg = search.insertion.leave();
  // beside the hole the next goal has a face to touch: a tilted edge over the hole wedges in it
  Eigen::Vector3d beside = peg.p + kOver * state.scale.travel * Eigen::Vector3d::UnitZ();
  state.carrier.moveTo(state.frame.restFor(beside, peg.R));
  beside += search.retreat.nextOffset(parameters.contact_tilt);
  state.carrier.moveTo(state.frame.restFor(beside, peg.R));
  return true;
}

}  // namespace assembly_cell
