// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>

#include "assembly_cell/align/search/search.h"
#include "assembly_cell/align/strategies/strategies.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// Of the default cell, carried over by Scale.
constexpr double kShake = 5.0;        // exciter, unless one is given [N]
constexpr double kFrequency = 800.0;  // [rad/s]; both as the studies of success have them
constexpr double kLower = 6e-3;  // starts hang 3 mm over the face, tilted by up to 2 degrees [m]

// [N]
double amplitudeFor(const SearchState& s) {
  const double given = s.p.exciter_amplitude;
  return given > 0.0 ? given : kShake * std::max(1.0, s.scale.force);
}

void shake(SearchState& s, bool on) {
  const AlignParameters& p = s.p;
  const double amplitude = amplitudeFor(s);
  const double frequency = p.exciter_frequency > 0.0 ? p.exciter_frequency : kFrequency;
  PlantCommand command;
  command.exciter = ExciterParameters{on ? amplitude : 0.0, frequency, 0.0, p.exciter_direction};
  s.carrier.step(command);
}

// One more step adds as much again, and a mean over a block doesn't show the shaking.
void refuseNextStep(const SearchState& s, double before) {
  const double force = s.carrier.force().norm(), shaking = amplitudeFor(s);
  const double next = force + std::max(0.0, force - before);
  if (next + shaking <= s.p.force_limit) return;
  throw AlignError(AlignFailure::kForceLimit,
                   text("%.1f N after another step and %.1f N of the exciter are over %.1f N", next,
                        shaking, s.p.force_limit));
}

// Only the force limit is checked on the path; the proof at its end is that of every strategy.
void find(Search& search) {
  SearchState& s = search.state;
  if (search.begin()) return;
  shake(s, true);
  const RestPose start = s.carrier.target();
  RestPose lower = start;
  const double step = s.p.approach_step * s.scale.step;
  const double travel = kLower * s.scale.travel;
  s.report("lower", text("by %.1f mm, shaken", travel * 1e3));
  while (start.z - lower.z < travel) {
    lower.z = std::max(start.z - travel, lower.z - step);
    const double before = s.carrier.force().norm();
    s.carrier.nudge(lower);
    refuseNextStep(s, before);
  }
  s.carrier.wait(s.blocks(s.p.settle));
  shake(s, false);
  s.carrier.wait(s.blocks(s.p.settle));
  ++s.contacts;
  if (!search.entry.isIn()) {
    throw AlignError(AlignFailure::kNotInserted,
                     text("lowered by %.1f mm, and no hole round the peg", travel * 1e3));
  }
}

}  // namespace

AlignResult passiveAssembly(Plant& plant, const Mechanism& mechanism,
                            const AlignParameters& parameters, const ProgressCallback& progress) {
  Search search(plant, mechanism, parameters, progress);
  return search.run([&] { find(search); },
                    [&](AlignResult& result) {
                      summariseHole(search.state, result);
                      result.tilt.setZero();  // the axis isn't measured
                    });
}

}  // namespace assembly_cell
