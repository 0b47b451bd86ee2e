// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "assembly_cell/cell/command_gate.h"
#include "assembly_cell/cell/simulated_cell.h"

namespace assembly_cell {

/// A simulated cell behind its guard: carries out the commands of a CommandGate block by block, and
/// stops the mechanism at the sample at which its coupling's load becomes too much. Its clock goes
/// on when the cell is replaced.
class GuardedCell {
 public:
  /// follows: an arm moves the carrier, the guard can't stop it. mutex: guards `gate`, which other
  /// threads fill. log: receives lines of the gate, with the mutex locked.
  GuardedCell(std::unique_ptr<SimulatedCell> cell, bool follows, CommandGate& gate,
              std::mutex& mutex, std::function<void(const std::string&)> log);

  const SimulatedCell& cell() const { return *cell_; }
  SimulatorBackend& world() { return cell_->world(); }
  /// Time 0 of the present cell [s].
  double base() const { return base_; }
  double time() { return base_ + world().time(); }

  /// Another cell at the present time.
  void replace(std::unique_ptr<SimulatedCell> cell);

  /// Before a block: watchdog and commands.
  void begin();
  /// The block, see SimulatedCell::next().
  StopReason next(StrainBlock& block, bool accelerations);

 private:
  void apply(const CommandGate::Commands& commands);
  /// Largest speed of a move that begins now, to `target` in the carrier's base [m/s].
  double speedOf(const Pose& target);
  /// At every sample.
  void checkLoad(const Vector6& load);

  std::unique_ptr<SimulatedCell> cell_;
  const Braking braking_;
  const Load sensed_;  // below it no contact is sensed
  const bool follows_;
  CommandGate& gate_;
  std::mutex& mutex_;
  const std::function<void(const std::string&)> log_;
  double base_ = 0.0;
  Load allowed_;         // of the coupling during this block
  bool watched_ = true;  // its load is checked, until the plant has been stopped
};

}  // namespace assembly_cell
