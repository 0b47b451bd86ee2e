// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/IdentifyLocusAction.h>
#include <assembly_cell/LocusEstimate.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "assembly_cell/Ack.h"
#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/estimation/locus_history.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

struct LocusSettings {
  std::string scenario;          ///< file of the cell
  double window = 0.2;           ///< longest window of the sliding estimate [s]
  double history = 10.0;         ///< of samples that are kept, at least the window [s]
  ReadingLimits limits;          ///< of a measurement
  double carrier_motion = 1e-3;  ///< largest motion of the peg's tip by the carrier [m]
  double data_timeout = 10.0;    ///< wall clock [s]
  bool lockstep = false;         ///< acknowledge blocks
  std::string name_in_lockstep;  ///< in the simulator's ~participants
};
void fields(FieldList& f, LocusSettings& s);

/// Node locus_estimator: locus of the peg from the coupling's displacement
/// while the exciter runs: a sliding estimate on `locus`, the contact mode on
/// `contact_mode`, single measurements by the action `identify_locus`. All in
/// sensor axes. Interfaces: docs/reference/nodes/locus_estimator.md.
class LocusNode {
 public:
  /// Threads of the callbacks. One keeps exciter and blocks in order; the action has a thread of
  /// its own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or file.
  LocusNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~LocusNode();

 private:
  using Server = CheckedActionServer<IdentifyLocusAction>;

  void onBlock(const DisplacementSamples::ConstPtr& block);
  void onExciter(const Exciter::ConstPtr& exciter);
  void acknowledge(std::uint32_t sequence);
  /// Updates and publishes the sliding estimate. With mutex_ locked.
  void publishLocus();

  /// Executes a goal of the action, in its own thread.
  void identify(const IdentifyLocusGoal::ConstPtr& goal);
  /// Fills the result and returns its message; throws InputError with the
  /// reason of a refusal.
  std::string identifyInto(const IdentifyLocusGoal& goal, IdentifyLocusResult& result);
  /// Waits until samples cover the window. Throws InputError with the reason if
  /// they won't.
  void waitForWindow(const ros::Time& start, const ros::Time& end, const Exciter& exciter);

  LocusSettings settings_;
  Mechanism mechanism_;
  std::unique_ptr<LiveSettings> live_;

  std::mutex mutex_;
  std::condition_variable arrived_;
  bool enabled_ = true;
  LocusHistory history_;
  std::optional<Exciter> exciter_;
  SlidingLocus sliding_;

  struct {
    ros::Publisher locus, mode;
    std::optional<std::uint8_t> last_mode;
  } output_;
  LatestPublisher<Ack> ack_pub_;
  StreamSubscriber block_sub_, carrier_sub_;
  ros::Subscriber exciter_sub_;
  ros::ServiceServer enable_srv_;
  Server server_;
};

}  // namespace assembly_cell::ros_bridge
