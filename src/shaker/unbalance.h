// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>

#include "assembly_cell/shaker/shaker.h"

namespace assembly_cell {

/// A motor that turns an eccentric mass: force = unbalance · speed². Its phase isn't controlled,
/// only measured by index pulses.
class UnbalanceShaker final : public Shaker {
 public:
  void open(const YAML::Node& parameters, double now) override;
  std::string cannot(const ExciterCommand& command) const override;
  void drive(const ExciterCommand& command, double reference, double now) override;
  void work(double now) override;
  void index(double time) override;
  std::optional<double> speed() const override { return direction_ * speed_; }
  ShakerState state(double now) const override;

 private:
  double unbalance_ = 0.0;     // [kg m]
  double acceleration_ = 0.0;  // of run-up and run-down [rad/s2]
  double tolerance_ = 0.2;     // of a commanded amplitude
  double index_angle_ = 0.0;   // of the mass from the peg's x at a pulse [rad]
  double max_speed_ = 0.0;     // [rad/s]
  double wanted_ = 0.0, speed_ = 0.0, time_ = 0.0;
  int direction_ = 1, next_direction_ = 1;
  double pulse_ = 0.0;                // the last one [s]
  std::optional<double> revolution_;  // time between the last two [s]
};

}  // namespace assembly_cell
