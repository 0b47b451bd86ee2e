// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/search_state.h"

#include <algorithm>
#include <cmath>

namespace assembly_cell {
namespace {

PressLimits limitsFor(const Mechanism& mechanism, const AlignParameters& p) {
  PressLimits limits = pressLimits(mechanism);
  limits.force = p.force_limit;
  limits.descent = p.descent_limit * limits.scale.travel;
  limits.time = TimeLimit::of(p.time_limit, p.default_time, p.spent);
  limits.arm_delay = p.arm_delay;
  limits.approach_step = p.approach_step * limits.scale.step;
  limits.arm = mechanism.arm;
  return limits;
}

}  // namespace

SearchState::SearchState(Plant& plant, const Mechanism& nominal, const AlignParameters& parameters,
                         const ProgressCallback& callback)
    : mechanism(nominal),
      p(parameters),
      progress(callback),
      scale(scaleOf(nominal)),
      carrier(plant, limitsFor(nominal, parameters)),
      press(carrier),
      frame(nominal),
      start_time(carrier.last().time),
      block(carrier.wait(1).time - start_time) {
  known.clearance = drawnClearance(nominal);
}

Vector6 SearchState::deflection() const {
  if (absolute_deflection) return carrier.last().displacement_b;
  return carrier.sensor().deflection() + frame.sag(carrier.sensor().tare().pose) -
         frame.sag(frame.start());
}

Vector6 SearchState::freeDeflection() const {
  const Vector6 sag = frame.sag(carrier.target());
  return absolute_deflection ? sag : Vector6(sag - frame.sag(frame.start()));
}

void SearchState::setHanging(const Eigen::Vector3d& bottom) {
  hanging.deflection = deflection();
  hanging.sag = peg().p - bottom;
}

int SearchState::blocks(double duration) const {
  return std::max(1, static_cast<int>(std::ceil(duration * scale.time / block - 1e-6)));
}

void SearchState::report(const char* state, const std::string& message) const {
  if (!progress) return;
  progress({state, contacts, carrier.last().time - start_time, message, known.position_sd,
            known.rotation_sd, inserted.end.depth, inserted.end.force(), inserted.end.walls,
            inserted.end.along, known.clearance.mean, known.clearance.sd});
}

}  // namespace assembly_cell
