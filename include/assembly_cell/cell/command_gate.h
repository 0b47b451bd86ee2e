// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "assembly_cell/arm/emulated_arm.h"
#include "assembly_cell/guard/plant_guard.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// A command of the exciter.
struct DriveCommand {
  ExciterParameters drive;          ///< amplitude 0: off
  std::optional<double> reference;  ///< time of the phase [s]; none: start of the coming block
};

/// Commands to a plant between two blocks: each passes the plant's guard, and those that are
/// accepted wait for the next block. Times are the plant's [s]. Functions that return a text return
/// a line for the log; empty: nothing to report. Not thread-safe.
class CommandGate {
 public:
  /// For the next block. `stop` comes before the others.
  struct Commands {
    GuardAction stop;
    std::optional<Pose> carrier;  ///< in its base
    std::optional<DriveCommand> exciter;
    std::optional<CarrierPoses> motion;  ///< of a carrier that is moved by an arm
  };
  struct Refusals {
    std::uint32_t commands = 0;  ///< refused so far, leases not counted
    std::string node;            ///< sender of the last one
    GuardVerdict last;
  };

  explicit CommandGate(const PlantGuard& guard) : guard_(guard) {}

  const PlantGuard& guard() const { return guard_; }
  const Refusals& refusals() const { return refusals_; }
  /// Why the plant was stopped in this session; empty: it wasn't.
  const std::string& stopReason() const { return stop_reason_; }

  std::string move(const Sender& sender, const Pose& X, double now);
  /// checked: what the guard evaluates of the command.
  std::string drive(const Sender& sender, const ExciterCommand& checked,
                    const DriveCommand& command, double now);
  std::string renew(const Sender& sender, std::uint32_t session, double now);
  std::string refuse(const std::string& what, const std::string& node, const GuardVerdict& why);
  void follow(const CarrierPoses& motion) { commands_.motion = motion; }

  /// Takes the commands for a block.
  Commands take();
  /// Once a block, before its commands are taken: watchdog of the lease and of the exciter. load:
  /// of the coupling; height: of the carrier in its base [m].
  std::string watch(const Vector6& load, double height, double now);
  /// The plant has been stopped for its load; way: of the stop.
  std::string overload(const Vector6& load, const Vector6& way);
  /// The plant is another one now: no command and no stop is left.
  void onPlantRestart();

 private:
  PlantGuard guard_;
  Commands commands_;
  std::string stop_reason_;
  Refusals refusals_;
};

}  // namespace assembly_cell
