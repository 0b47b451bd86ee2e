// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "unbalance.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {

namespace {

constexpr double kMissed = 1.5;  // revolutions without a pulse until the phase is unknown

}  // namespace

void UnbalanceShaker::open(const YAML::Node& parameters, double now) {
  yaml::Section in(parameters, "", "shaker", yaml::Wording::kIs);
  in.optional("type");
  unbalance_ = in.number("unbalance", yaml::Range::kPositive);
  acceleration_ = in.number("acceleration", yaml::Range::kPositive);
  max_speed_ = in.number("max_speed", yaml::Range::kPositive);
  tolerance_ = in.number("amplitude_tolerance", 0.0, 10.0, tolerance_);
  index_angle_ = in.number("index_angle", -2.0 * M_PI, 2.0 * M_PI, 0.0);
  in.finish();
  time_ = now;
}

std::string UnbalanceShaker::cannot(const ExciterCommand& command) const {
  if (!(command.amplitude > 0.0)) return {};
  if (command.frequency > max_speed_) {
    return text("frequency is %g rad/s: give at most %g (max_speed)", command.frequency,
                max_speed_);
  }
  const double force = unbalance_ * command.frequency * command.frequency;
  if (std::abs(command.amplitude - force) <= tolerance_ * force) return {};
  return text(
      "amplitude is %g N: at %g rad/s this unbalance makes %g N; give that, or another "
      "frequency",
      command.amplitude, command.frequency, force);
}

void UnbalanceShaker::drive(const ExciterCommand& command, double reference, double now) {
  (void)reference;  // the phase isn't controlled
  work(now);
  wanted_ = command.amplitude > 0.0 ? command.frequency : 0.0;
  if (wanted_ > 0.0) next_direction_ = command.direction;
}

void UnbalanceShaker::work(double now) {
  double left = acceleration_ * std::max(0.0, now - time_);
  time_ = now;
  if (direction_ != next_direction_) {  // decelerate to rest first
    const double down = std::min(left, speed_);
    speed_ -= down;
    left -= down;
    if (speed_ > 0.0) return;
    direction_ = next_direction_;
  }
  speed_ += std::clamp(wanted_ - speed_, -left, left);
}

void UnbalanceShaker::index(double time) {
  if (time > pulse_ && pulse_ > 0.0) revolution_ = time - pulse_;
  pulse_ = time;
}

ShakerState UnbalanceShaker::state(double now) const {
  ShakerState state;
  state.on = wanted_ > 0.0 || speed_ > 0.0;
  state.latency = std::abs(wanted_ - speed_) / acceleration_;
  state.force.direction = direction_;
  double turning = speed_;
  if (revolution_ && now - pulse_ < kMissed * *revolution_) {
    turning = 2.0 * M_PI / *revolution_;
    state.measured = true;
    state.reference = pulse_;
    state.force.phase = direction_ * index_angle_;
  }
  state.force.frequency = turning;
  state.force.amplitude = unbalance_ * turning * turning;
  return state;
}

}  // namespace assembly_cell
