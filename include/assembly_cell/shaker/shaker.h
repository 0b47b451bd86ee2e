// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/guard/plant_guard.h"

namespace assembly_cell {

/// State of a shaker.
struct ShakerState {
  bool on = false;
  /// Present force, with its phase at `reference`; frequency 0: at rest.
  ExciterCommand force;
  double reference = 0.0;  ///< [s]
  bool measured =
      false;  ///< the phase is measured by an index pulse; false: it is the commanded one
  double latency = 0.0;    ///< from a command to the start of its force [s]
  std::uint64_t gaps = 0;  ///< number of underruns and clock jumps of the output
};

/// A device that generates the exciter's force, without ROS. Another package adds a shaker by
/// exporting a class with this base class through pluginlib. Called by one thread. Times are those
/// of the computer's clock [s].
class Shaker {
 public:
  Shaker() = default;
  virtual ~Shaker() = default;
  Shaker(const Shaker&) = delete;
  Shaker& operator=(const Shaker&) = delete;

  /// Reads the parameters, a YAML map (the key `type` is ignored), and opens the device. Throws
  /// InputError with key, value and remedy.
  virtual void open(const YAML::Node& parameters, double now) = 0;
  /// Why the command isn't possible; empty: it is. Off always is.
  virtual std::string cannot(const ExciterCommand& command) const = 0;
  /// Starts a command; amplitude 0: off, within one period if possible. reference [s].
  virtual void drive(const ExciterCommand& command, double reference, double now) = 0;
  /// Called every few milliseconds. Throws InputError when the device is lost.
  virtual void work(double now) = 0;
  /// An index pulse of the shaft.
  virtual void index(double time) { (void)time; }
  /// Set point for a motor drive [rad/s]; none: there is no motor.
  virtual std::optional<double> speed() const { return std::nullopt; }
  virtual ShakerState state(double now) const = 0;
};

/// Shakers of this package: audio, unbalance. Null for another name.
std::unique_ptr<Shaker> makeShaker(const std::string& type);
const std::vector<std::string>& shakerTypes();

}  // namespace assembly_cell
