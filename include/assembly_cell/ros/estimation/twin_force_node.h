// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <tf2_ros/transform_broadcaster.h>

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/estimation/twin_force_session.h"
#include "assembly_cell/ros/estimation/twin_force_streams.h"

namespace assembly_cell {
class FieldList;
}

namespace assembly_cell::ros_bridge {

struct TwinForceNodeSettings {
  /// With converters of 16 bit over ±5 V.
  TwinForceNodeSettings() { streams.history.converter_step = 10.0 / 65536; }

  std::string scenario;  ///< file of the cell
  double smallest_p = 1e-3;
  std::array<double, 3> prior_position{};
  double prior_position_sd = kNominalPositionSd, prior_rotation_sd = kNominalRotationSd;
  bool on_plane = true;
  TwinUncertainty uncertainty;
  TwinForceTask task;            ///< until `begin` is called
  double carrier_motion = 1e-5;  ///< within a window [m]
  double window = 0.2;           ///< where a call names none [s]
  TwinForceStreams::Settings streams;
};
void fields(FieldList& f, TwinForceNodeSettings& s);

/// Node twin_force_estimator: pose of the peg in the hole from contacts that both force sensors
/// measure. Keeps contacts and advises the next one; never moves anything. Computes only in service
/// calls; once a pose is known it follows the carrier. Interfaces:
/// docs/reference/nodes/twin_force_estimator.md.
class TwinForceNode {
 public:
  /// Threads of the data's callbacks; services, which wait for data, have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, file or robot description.
  TwinForceNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  /// Advertises ~name, by `call`, whose InputError is the answer of a failure.
  template <class Service, class Call>
  void advertise(ros::NodeHandle& pnh, const std::string& name, const Call& call);
  void begin(const TwinForceTask& task, const ContactTask& message);
  /// Averages a window and takes it as the zero or a contact by `add`; one that `answer` knows
  /// isn't taken again. Returns the answer.
  std::string take(const BlockWindow& window,
                   std::optional<std::string> (TwinForceSession::*answer)(const BlockWindow&) const,
                   std::string (TwinForceSession::*add)(const BlockWindow&,
                                                        const TwinForceStreams::Average&));
  TwinForceStreams::Average average(BlockWindow window);
  void publishPose();

  TwinForceNodeSettings settings_;
  std::mutex mutex_;        ///< of session_ and limits_
  std::mutex coming_;       ///< owned by the call that waits for coming samples
  AveragingLimits limits_;  ///< of a window
  std::unique_ptr<TwinForceSession> session_;
  ros::Publisher pose_pub_, state_pub_;
  tf2_ros::TransformBroadcaster tf_;
  ros::CallbackQueue service_queue_;
  std::vector<ros::ServiceServer> services_;
  std::unique_ptr<TwinForceStreams> streams_;           ///< its callbacks use the rest
  GuardedSpinner service_spinner_{3, &service_queue_};  ///< last: uses the rest, too
};

}  // namespace assembly_cell::ros_bridge
