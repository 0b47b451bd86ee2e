// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "assembly_cell/align/align.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

class Parameters;

/// Topic, latched: text of the mechanism.yaml that mechanism_identifier has written.
constexpr const char* kMechanismTopic = "mechanism";

/// Subscribes to kMechanismTopic. `callback` gets each mechanism whose identification was accepted;
/// others, and what can't be read, are refused with a line in the log.
ros::Subscriber subscribeMechanism(ros::NodeHandle& nh,
                                   const std::function<void(const KnownMechanism&)>& callback);

struct MechanismSettings {
  std::string mechanism;        ///< file of an identified mechanism; empty: as drawn
  bool identify = false;        ///< by mechanism_identifier, where one is needed or contradicted
  double identify_time = 60.0;  ///< for that [s]
};
void fields(FieldList& f, MechanismSettings& s);

/// The mechanism that the supervisor's strategies use: the drawing or an identified one, checked on
/// the hanging peg before each alignment and identified again where that is allowed.
class MechanismKeeper {
 public:
  /// Reads ~scenario, ~overrides and MechanismSettings. Throws InputError.
  explicit MechanismKeeper(Parameters& parameters);
  /// Subscribes to mechanisms of mechanism_identifier. `plant` must outlive it.
  void connect(ros::NodeHandle& nh, RosPlant& plant, double slow_factor);

  /// The nominal parts, or as identified.
  const Mechanism& mechanism() const { return mechanism_; }
  /// "drawn" or "identified", and a digest of its numbers.
  std::string identity() const;
  /// Name of the scenario, and a digest of its file with the overrides.
  const std::string& scenario() const { return scenario_; }
  const std::string& scenarioDigest() const { return scenario_digest_; }
  /// Pose of the peg in the carrier at rest.
  Pose pegInCarrier() const;

  /// Begins a goal of the plant with a mechanism that the hanging peg doesn't contradict.
  /// is_inserted: the peg is in the hole and doesn't hang. Returns null for the drawing. Throws
  /// AlignError `wrong_mechanism`, PlantError.
  const KnownMechanism* begin(const std::string& strategy, const std::function<bool()>& cancelled,
                              const std::function<void(const AlignProgress&)>& progress,
                              const std::function<bool()>& is_inserted);

 private:
  /// How the hanging peg contradicts the identified mechanism; empty if it doesn't.
  std::string contradiction(bool is_inserted);
  /// By the node mechanism_identifier, which owns the plant meanwhile. Throws PlantError.
  void identify(const std::function<bool()>& cancelled);
  void adopt(KnownMechanism known);
  void adoptLatest();

  MechanismSettings settings_;
  std::string scenario_, scenario_digest_;
  Mechanism mechanism_;
  std::optional<KnownMechanism> known_;
  std::mutex mutex_;
  std::optional<KnownMechanism> latest_;  // by mutex_: received since the last goal began
  ros::NodeHandle nh_;
  RosPlant* plant_ = nullptr;
  double slow_factor_ = 1.0;  // of waits for other nodes
  ros::Subscriber sub_;
};

}  // namespace assembly_cell::ros_bridge
