// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "assembly_cell/ContactTask.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/align/estimation/twin_sensing.h"

namespace assembly_cell::ros_bridge {

/// On the wire.
ContactTask contactTask(const TwinForceTask& task);

/// The running twin_force_estimator, as a strategy asks for it. Windows go to it as times of the
/// cell: it averages the blocks that the strategy means from its own streams. Every call ends
/// within a timeout, and is said once more when the connection was lost before the answer: said
/// twice counts once. PlantError names the node when there is no answer, and when it doesn't know
/// of what it was told before (it was started anew, or somebody else uses it).
class TwinForceClient : public TwinForceSensing {
 public:
  struct Settings {
    double timeout = 10.0;                      ///< of every call, wall clock [s]
    double patience = 0.3;                      ///< then the node is looked for [s wall]
    double answer_within = 0.2;                 ///< of the node to that question [s wall]
    std::function<ros::Time(double)> stamp_of;  ///< of a time on the plant's clock [s]
    std::function<bool()> cancelled;            ///< the call is given up
  };
  TwinForceClient(const ros::NodeHandle& nh, const Settings& settings)
      : nh_(nh), settings_(settings) {}

  void begin(const TwinForceTask& task) override;
  WindowAnswer tare(const AveragingWindow& free) override;
  WindowAnswer add(const AveragingWindow& pressed) override;
  TwinForceSolution solve() override;
  ReachableContact advise() override;

  /// The node that is being asked and isn't there any more: " (no service ...: is it running?)";
  /// else empty. For whoever waits for blocks in vain.
  std::string complaint() const;
  void release() { begun_ = false; }  ///< the strategy is through

 private:
  template <class Service>
  typename Service::Response call(const std::string& name,
                                  const typename Service::Request& request);
  /// One attempt; nothing when the connection was lost before the answer.
  template <class Service>
  std::optional<typename Service::Response> attempt(const std::string& service,
                                                    const typename Service::Request& request);
  template <class Request>
  void fill(Request& request, const AveragingWindow& window) const;
  bool wait(double limit, const std::function<bool(double patience)>& ready);
  bool waitUntilFree(double limit);
  void lookForNode(const std::string& service, bool may_be_starting = false) const;
  void checkMemory(const TwinForceState& state) const;

  ros::NodeHandle nh_;
  Settings settings_;
  bool begun_ = false;
  // what the node was told since begin()
  ContactTask task_;
  std::uint32_t zero_blocks_ = 0;  ///< of the latest zero
  std::size_t contacts_ = 0;
  TwinForceState state_;         ///< as of the last solve()
  std::future<void> under_way_;  ///< a call that may still be waiting for its answer
};

}  // namespace assembly_cell::ros_bridge
