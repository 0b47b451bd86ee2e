// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/transform_broadcaster.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/AddContact.h"
#include "assembly_cell/BeginTwinForce.h"
#include "assembly_cell/SolveTwinForce.h"
#include "assembly_cell/TareTwinForce.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/align/estimation/twin_contacts.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/estimation/twin_force_streams.h"

namespace assembly_cell::ros_bridge {

/// Node twin_force_estimator: pose of the peg in the hole from contacts that both force sensors
/// feel. Keeps contacts and advises the next one; never moves anything. Idle but for the services;
/// once a pose is known it follows the carrier. Interfaces:
/// docs/reference/interfaces.md.
class TwinForceNode {
 public:
  /// Of the data; services, which wait for it, have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter, file or robot description.
  TwinForceNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  using Reading = TwinForceStreams::Reading;
  /// What a contact kept came from.
  struct Origin {
    Reading pressed;
    std::optional<Reading> free;
    TwinForceStreams::Window asked;  ///< the window as it was named
    std::string message;             ///< the answer
  };

  TwinForceSetup readSetup(Parameters& parameters);
  TwinForceStreams::Settings readSettings(Parameters& parameters, const std::string& name);

  bool onBegin(BeginTwinForce::Request& request, BeginTwinForce::Response& response);
  bool onTare(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onTareWindow(TareTwinForce::Request& request, TareTwinForce::Response& response);
  bool onAdd(AddContact::Request& request, AddContact::Response& response);
  bool onReset(std_srvs::Trigger::Request& request, std_srvs::Trigger::Response& response);
  bool onSolve(SolveTwinForce::Request& request, SolveTwinForce::Response& response);

  void begin(const TwinForceTask& task);
  Reading read(TwinForceStreams::Window window);
  /// The contact from a window that was asked for before, with the same zero; end(): none. A call
  /// whose answer got lost is said again.
  std::vector<Origin>::const_iterator known(const TwinForceStreams::Window& window) const;
  /// Keeps a contact; throws InputError with the reason when it is refused.
  std::vector<Origin>::const_iterator add(const TwinForceStreams::Window& window,
                                          const Reading& reading);
  /// The same of a window that is read first, with the answer; without services_.
  std::string keep(const TwinForceStreams::Window& window);
  /// Takes the zero from a window; true and what from, or why not.
  std::pair<bool, std::string> tare(const TwinForceStreams::Window& window);
  void publishPose();
  TwinForceState status() const;
  FeltContact feltContact(std::size_t i) const;
  void tellPose(TwinForceState& out) const;

  double window_ = 0.2;     // [s]
  AveragingLimits limits_;  // of a window
  TwinForceTask own_task_;  ///< by parameters

  mutable std::mutex services_;  ///< one at a time
  std::mutex coming_;            ///< one that waits for samples to come
  std::unique_ptr<TwinForceContacts> contacts_;
  std::vector<Origin> origins_;          ///< of the contacts
  std::optional<Reading> free_;          ///< the latest zero
  TwinForceStreams::Window free_asked_;  ///< where it was asked for
  ContactTask told_;                     ///< the present task, as it came
  bool pose_known_ = false;
  std::optional<ReachableContact> advised_;

  ros::Publisher pose_pub_, status_pub_;
  ros::CallbackQueue service_queue_;
  ros::ServiceServer begin_srv_, tare_srv_, tare_window_srv_, add_srv_, reset_srv_, solve_srv_;
  tf2_ros::TransformBroadcaster tf_;
  std::unique_ptr<TwinForceStreams> streams_;           ///< its callbacks use the rest
  GuardedSpinner service_spinner_{3, &service_queue_};  ///< last: it uses the rest, too
};

}  // namespace assembly_cell::ros_bridge
