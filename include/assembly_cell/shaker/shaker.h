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

/// What a shaker does, as far as it knows.
struct ShakerState {
  bool on = false;
  /// The force now and its phase at `reference`, as of ExciterCommand; frequency 0: standing still.
  ExciterCommand force;
  double reference = 0.0;  ///< [s]
  bool measured = false;   ///< the phase is, as by an index pulse; false: it is what was played
  double latency = 0.0;    ///< from a command to the force that begins [s]
  std::uint64_t gaps = 0;  ///< times that the output ran dry, or that its clock jumped
};

/// A device that makes the exciter's force, without ROS. A class in another package becomes a
/// shaker by exporting it through pluginlib with this base class. One thread calls it. Times are of
/// the computer's clock [s].
class Shaker {
 public:
  Shaker() = default;
  virtual ~Shaker() = default;
  Shaker(const Shaker&) = delete;
  Shaker& operator=(const Shaker&) = delete;

  /// Takes the parameters, a YAML map (the key `type` is passed over), and opens the device. Throws
  /// InputError with the key, its value and what to do.
  virtual void open(const YAML::Node& parameters, double now) = 0;
  /// Why it can't do this; empty: it can. Off is always possible.
  virtual std::string cannot(const ExciterCommand& command) const = 0;
  /// From now on; amplitude 0: off, within one period where the device can. reference [s].
  virtual void drive(const ExciterCommand& command, double reference, double now) = 0;
  /// Called every few milliseconds. Throws InputError when the device is lost.
  virtual void work(double now) = 0;
  /// An index pulse came from the shaft.
  virtual void index(double time) { (void)time; }
  /// Speed that a motor drive shall keep now [rad/s]; nothing: there is none.
  virtual std::optional<double> speed() const { return std::nullopt; }
  virtual ShakerState state(double now) const = 0;
};

/// Those of this package: audio, unbalance. Null for another name.
std::unique_ptr<Shaker> makeShaker(const std::string& type);
const std::vector<std::string>& shakerTypes();

}  // namespace assembly_cell
