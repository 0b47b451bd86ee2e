// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/align/vibrated_search.h"

namespace assembly_cell {
namespace {

constexpr int kLevelReadings = 6;  // before the plane is first known

// The strategy `single_contact` (thesis Fig 9.14; docs/strategies.md): the low side of the peg
// once round, at a constant tilt against the plane.
class SingleContact : public VibratedSearch {
 public:
  SingleContact(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                const Progress& progress)
      : VibratedSearch(plant, mechanism, parameters, progress) {}

 private:
  enum class State { kLevel, kSweep, kResolve, kEnter, kDone };

  bool attempt() override {
    State state = found_ ? State::kEnter : State::kLevel;
    int sweeps = 0;
    while (state != State::kDone) {
      switch (state) {
        case State::kLevel:
          // a first round with few readings: the tilt that the peg began with adds to each
          state = sweep("level", kLevelReadings, 0.0) ? State::kSweep : State::kEnter;
          if (state == State::kSweep && !level()) {
            throw AlignError(AlignFailure::kNoPlaneReading, "the contacts don't agree on a plane");
          }
          break;
        case State::kSweep:
          ++sweeps;
          // the next round between the places of this one
          state = sweep("sweep", std::max(2, p_.sweep_readings - kLevelReadings), 0.5 * sweeps)
                      ? State::kResolve
                      : State::kEnter;
          break;
        case State::kResolve:
          state = State::kEnter;
          try {
            resolve();
          } catch (const AlignError&) {
            // some of the rim was felt: a closer look will tell
            if (hole_.rim_readings == 0 || sweeps >= p_.rounds) throw;
            state = State::kSweep;
          }
          break;
        case State::kEnter:
          if (enter(hole_.center)) {
            state = State::kDone;
          } else if (sweeps >= p_.rounds) {
            return false;
          } else {
            bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
            goAside();
            state = State::kSweep;
          }
          break;
        case State::kDone:
          break;
      }
    }
    return true;
  }

  // false when the edge went into the hole on the way
  bool sweep(const char* name, int readings, double shift) {
    for (int i = 0; i < readings; ++i) {
      Felt felt;
      if (!read(lowAt(2 * M_PI * (i + shift) / readings), name, felt)) {
        takeEntry();
        return false;
      }
      if (felt.usable) felt_.push_back(felt);
    }
    return true;
  }
};

}  // namespace

AlignResult singleContact(Plant& plant, const Mechanism& mechanism,
                          const AlignParameters& parameters,
                          const std::function<void(const AlignProgress&)>& progress) {
  return SingleContact(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
