// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <array>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "assembly_cell/Ack.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/estimation/twin_force_history.h"

namespace assembly_cell::ros_bridge {

/// Subscriptions of twin_force_estimator: both wrenches, the displacement of sensor_b, the carrier
/// and the calibrations. Acknowledges blocks in lockstep and averages windows. Thread-safe.
class TwinForceStreams {
 public:
  struct Settings {
    TwinForceHistory::Settings history;
    double data_timeout = 10.0;  ///< for the samples of a window, wall clock [s]
    bool lockstep = false;
    std::string name;  ///< in the simulator's ~participants
  };
  /// The average of a window.
  struct Average {
    AveragingWindow window{AveragingLimits{}};
    ros::Time first, last;         ///< ends of its first and last block
    ros::Time middle;              ///< of its samples
    double time_difference = 0.0;  ///< largest, between the two wrenches [s]
  };

  /// on_carrier: called for each pose of the carrier.
  TwinForceStreams(ros::NodeHandle& nh, const Settings& settings, std::function<void()> on_carrier);

  /// Waits for the window's samples. limits: its number of blocks is the window's. Throws
  /// InputError with the reason of a refusal.
  Average average(const BlockWindow& window, AveragingLimits limits);
  /// Waits until both calibrations have arrived; false after data_timeout.
  bool waitForCalibrations();
  /// Covariances of the active calibrations, see TwinForceHistory.
  PerSide<Eigen::MatrixXd> gainCovariances() const;
  std::optional<TwinForceHistory::Now> now() const;

 private:
  using Lock = std::unique_lock<std::mutex>;

  template <class Message, class Add>
  StreamSubscriber subscribe(ros::NodeHandle& nh, const std::string& topic, const Add& add);
  void acknowledge();
  bool wait(Lock& lock, const std::function<bool()>& ready);
  std::vector<TwinForceHistory::Wrench> collect(Lock& lock, const BlockWindow& window);

  const Settings settings_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  TwinForceHistory history_;
  LatestPublisher<Ack> ack_pub_;
  std::array<StreamSubscriber, 4> subs_;  // wrenches, displacement, carrier
  PerSide<ros::Subscriber> calibration_subs_;
};

}  // namespace assembly_cell::ros_bridge
