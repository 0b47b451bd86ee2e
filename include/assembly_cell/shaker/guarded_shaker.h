// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "assembly_cell/shaker/shaker.h"

namespace assembly_cell {

class FieldList;

struct ShakerLimits {
  double timeout = 0.1;            ///< without a sign of life of the bridge [s]
  double max_amplitude = 50.0;     ///< [N]
  double max_frequency = 20000.0;  ///< [rad/s]
};
void fields(FieldList& f, ShakerLimits& limits);

/// A shaker behind limits and a watchdog: it is off without a sign of life of its bridge, and stays
/// off until a new command. Times are those of the shaker [s]. Not thread-safe.
class GuardedShaker {
 public:
  GuardedShaker(std::shared_ptr<Shaker> shaker, const ShakerLimits& limits);

  /// A sign of life of the bridge.
  void keepAlive(double now) { alive_ = now; }
  /// A command with its stamp; amplitude 0: off, which is always accepted. Empty, or why it is
  /// refused.
  std::string drive(const ExciterCommand& command, double stamp, double now);
  /// Switches the shaker off. reason: for reason(); empty: by command.
  void switchOff(const std::string& reason, double now);
  /// Every few milliseconds: watchdog, then Shaker::work(). True if the watchdog switched it off.
  /// Throws InputError when the device is lost.
  bool work(double now);

  Shaker& shaker() { return *shaker_; }
  const std::string& reason() const { return reason_; }  ///< why it is off; empty: by command
  std::uint64_t refused() const { return refused_; }     ///< number of commands

 private:
  std::string check(const ExciterCommand& command, double stamp, double now) const;

  std::shared_ptr<Shaker> shaker_;
  const ShakerLimits limits_;
  double alive_ = -std::numeric_limits<double>::infinity();
  bool on_ = false;  // by the last command
  std::uint64_t refused_ = 0;
  std::string reason_;
};

}  // namespace assembly_cell
