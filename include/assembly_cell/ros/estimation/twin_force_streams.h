// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/Ack.h"
#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/estimation/averaging_window.h"
#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"

namespace assembly_cell::ros_bridge {

/// What twin_force_estimator listens to: both wrenches, the displacement of sensor_b, the carrier.
/// Keeps the last minute of them, acknowledges blocks in lockstep and averages windows.
class TwinForceStreams {
 public:
  struct Settings {
    double time_limit = 1e-3;     ///< between the wrenches of both sensors [s]
    double data_timeout = 10.0;   ///< for the samples of a window, wall clock [s]
    double converter_step = 0.0;  ///< of both sensors [V]
    bool use_displacement = true;
    bool lockstep = false;
    std::string name;  ///< in the simulator's ~participants
  };
  /// Which blocks are averaged.
  struct Window {
    double duration = 0.0;     ///< the coming ones [s], or those that
    ros::Time first, last;     ///< end from first to last, if last is not 0
    std::uint32_t blocks = 0;  ///< as many as these are
  };
  /// A settled window.
  struct Reading {
    AveragingWindow window{AveragingLimits{}};
    ros::Time first, last;         ///< ends of its first and last block
    ros::Time middle;              ///< of its samples
    double time_difference = 0.0;  ///< largest, between the two wrenches [s]
  };
  static constexpr double kHistory = 60.0;  ///< of blocks kept [s]

  /// on_carrier: called for each pose of the carrier.
  TwinForceStreams(ros::NodeHandle& nh, const Settings& settings, std::function<void()> on_carrier);

  /// Waits for the window's samples. limits: its number of blocks is the window's. Throws
  /// InputError with the reason of a refusal.
  Reading read(const Window& window, AveragingLimits limits);
  /// Until both calibrations have come in; false after data_timeout.
  bool waitForCalibrations();
  /// What the calibration in force says of its matrix, see gainCovariance(); 0 × 0: nothing.
  PerSide<Eigen::MatrixXd> gainCovariances() const;

  /// The carrier now.
  struct Now {
    ros::Time stamp;
    RestPose carrier;
    Vector6 displacement = Vector6::Zero();
  };
  std::optional<Now> now() const;

 private:
  using Lock = std::unique_lock<std::mutex>;
  using Wrench = WrenchSamples::ConstPtr;
  using Displacement = DisplacementSamples::ConstPtr;

  template <class Message>
  void onBlock(std::deque<typename Message::ConstPtr>& list, const typename Message::ConstPtr& m);
  template <class Message>
  void onUnusable(std::deque<boost::shared_ptr<Message const>>& list, const Message& m);
  void onCarrier(const geometry_msgs::PoseStamped::ConstPtr& message);
  void acknowledge();
  bool wait(Lock& lock, const std::function<bool()>& ready);
  std::vector<Wrench> collect(Lock& lock, const Window& window);
  std::vector<Wrench> select(const Window& window, const ros::Time& after) const;
  void awaitPartners(Lock& lock, const Wrench& last);
  PlantBlock blockOf(const Wrench& b, const ros::Time& origin, double& time_difference) const;
  Vector6 displacementOf(const Wrench& b) const;

  const Settings settings_;
  const std::function<void()> on_carrier_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::deque<Wrench> a_, b_;
  std::deque<Displacement> d_;
  std::deque<geometry_msgs::PoseStamped::ConstPtr> carrier_;
  std::optional<Matrix6> S_a_, S_b_;  ///< volts to wrench, for the rounding
  PerSide<Eigen::MatrixXd> gains_;    ///< of their errors

  LatestPublisher<Ack> ack_pub_;
  StreamSubscriber a_sub_, b_sub_, d_sub_, carrier_sub_;
  ros::Subscriber calibration_a_sub_, calibration_b_sub_;
};

}  // namespace assembly_cell::ros_bridge
