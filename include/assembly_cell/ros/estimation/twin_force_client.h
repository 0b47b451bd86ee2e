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

/// Message of a task.
ContactTask contactTask(const TwinForceTask& task);

/// Client of twin_force_estimator, for strategies. A window is sent as cell time: the node averages
/// the same blocks of its own streams. Every call ends within a timeout; it is repeated once if the
/// connection was lost before the answer, which the node recognizes. PlantError names the node if
/// there is no answer, or if its contacts, task or zero are not those of the earlier calls (it was
/// restarted, or another client uses it).
class TwinForceClient : public TwinForceSensing {
 public:
  struct Settings {
    double timeout = 10.0;                      ///< of every call, wall clock [s]
    double patience = 0.3;                      ///< before the node is looked for [s wall]
    double answer_within = 0.2;                 ///< for the node to respond then [s wall]
    std::function<ros::Time(double)> stamp_of;  ///< of a time on the plant's clock [s]
    std::function<bool()> cancelled;            ///< ends a call
  };
  TwinForceClient(const ros::NodeHandle& nh, const Settings& settings)
      : nh_(nh), settings_(settings) {}

  void begin(const TwinForceTask& task) override;
  WindowAnswer tare(const AveragingWindow& free) override;
  WindowAnswer add(const AveragingWindow& pressed) override;
  TwinForceSolution solve() override;
  ReachableContact advise() override;

  /// " (no service ...: is it running?)" if the node that is in use has ended; else empty.
  std::string complaint() const;
  void release() { begun_ = false; }  ///< the strategy has ended

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
  void checkState(const TwinForceState& state) const;

  ros::NodeHandle nh_;
  Settings settings_;
  bool begun_ = false;
  // what the node has, by the calls since begin()
  ContactTask task_;
  std::uint32_t zero_blocks_ = 0;  ///< of the latest zero
  std::size_t contacts_ = 0;
  TwinForceState state_;    ///< as of the last solve()
  std::future<void> call_;  ///< that may still be waiting for its answer
};

}  // namespace assembly_cell::ros_bridge
