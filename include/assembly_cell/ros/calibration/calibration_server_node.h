// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/AddObservation.h>
#include <assembly_cell/CalibrateSensorsAction.h>
#include <assembly_cell/ConfirmLoad.h>
#include <assembly_cell/GetCalibrations.h>
#include <assembly_cell/LoadCalibration.h>
#include <assembly_cell/PlanCalibration.h>
#include <assembly_cell/SaveCalibration.h>
#include <assembly_cell/SensorCalibration.h>
#include <assembly_cell/SolveCalibration.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/session.h"
#include "assembly_cell/ros/bridge/checked_action.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/calibration/strain_windows.h"

namespace assembly_cell::ros_bridge {

/// Calibrates two sensors: plans tests, averages their strain, keeps every observation on disk,
/// solves, stores and puts in force. Interfaces: docs/reference/interfaces.md.
class CalibrationServerNode {
 public:
  /// Of its callbacks: of the data; services and the action have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or a damaged journal.
  CalibrationServerNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~CalibrationServerNode();

 private:
  using Seconds = StrainWindows::Seconds;

  struct Sensor {
    ros::Time in_force_since;
    ros::Publisher calibration_pub;
  };

  /// A step of an action that waits for a person.
  enum class Waiting { kNo, kOpen, kReading, kDone };

  StrainWindows::Settings readParameters();
  void advertise();

  // services
  bool plan(PlanCalibration::Request& request, PlanCalibration::Response& response);
  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool addObservation(AddObservation::Request& request, AddObservation::Response& response);
  bool removeLast(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool confirm(ConfirmLoad::Request& request, ConfirmLoad::Response& response);
  bool solve(SolveCalibration::Request& request, SolveCalibration::Response& response);
  bool save(SaveCalibration::Request& request, SaveCalibration::Response& response);
  bool load(LoadCalibration::Request& request, LoadCalibration::Response& response);
  bool getCalibrations(GetCalibrations::Request&, GetCalibrations::Response& response);

  // the action
  void calibrate(const CalibrateSensorsGoalConstPtr& goal);
  std::vector<LoadRequest> openPlan(const CalibrateSensorsGoal& goal, std::set<std::string>& there);
  CalibrateSensorsResult runPlan(const CalibrateSensorsGoal& goal);
  /// Loads, reads, keeps; or why the step has no observation. Throws InputError when the plan
  /// can't go on.
  CalibrationRefusal stepByRig(const LoadRequest& step);
  CalibrationRefusal stepByPerson(const LoadRequest& step);
  bool cancelled();
  void tell(const std::string& state, const std::string& message);

  /// The right to change observations and calibrations. Throws InputError when another has it.
  std::unique_lock<std::mutex> acquire();
  // with that right held
  void keep(const Observation& observation);
  /// Attaches readings and keeps it. Throws InputError when that can't be.
  void read(Observation& observation, const PerSide<bool>& wanted);
  void startAnew();
  struct Stored {
    std::string id, message;
  };
  Stored saveSolution(const std::string& id);

  /// What the drivers of these sensors have, empty where they have none of ours.
  PerSide<Calibration> inDrivers(const PerSide<bool>& wanted) const;
  /// Hands calibrations to the drivers; returns a line about those that aren't there or refuse.
  /// With `before` a refusal is an error, and the drivers have again what they had.
  std::string handOver(const MaybePerSide<CalibrationInForce>& calibrations,
                       const PerSide<Calibration>* before);
  void putInForce(const MaybePerSide<CalibrationInForce>& calibrations);

  std::vector<LoadRequest> makeSteps(const std::string& plan, std::uint32_t seed) const;
  CalibrationResult solveAll(const ForceSettings& force);
  SensorCalibration messageOf(Side side, const Calibration& calibration) const;
  std::uint32_t observationCount() const;
  void publishCalibrations(const PerSide<bool>& wanted);
  void publishStatus();
  std_msgs::String observationsMessage() const;

  ros::NodeHandle nh_, pnh_;
  RatedLoad rated_;
  Seconds source_timeout_{0.0};
  std::string rig_;  ///< service that applies loads; empty: a person does
  std::string default_plan_;
  std::size_t window_ = 0;
  int zero_every_ = 0;
  double max_dropped_ = 0.0;
  bool set_drivers_ = true;

  std::unique_ptr<CalibrationSession> session_;
  std::unique_ptr<StrainWindows> windows_;

  /// Held by whoever changes observations or calibrations: one at a time, others are refused.
  std::mutex busy_;
  /// Guards the step that is waited for and the feedback, briefly.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<bool> stopping_{false};
  PerSide<Sensor> sensors_;
  Waiting waiting_ = Waiting::kNo;
  Observation awaited_;  ///< of the step that a person brings about
  CalibrateSensorsFeedback feedback_;
  std::atomic<bool> in_action_{false};

  ros::CallbackQueue service_queue_;
  ros::Publisher status_pub_, observations_pub_;
  std::vector<ros::ServiceServer> services_;
  std::unique_ptr<CheckedActionServer<CalibrateSensorsAction>> action_;
  GuardedSpinner service_spinner_{4, &service_queue_};
};

/// What a service answers: `work`, or why it was refused.
template <class Response, class Work>
bool answer(Response& response, const char* service, const Work& work) {
  try {
    work();
  } catch (const InputError& error) {
    response.success = false;
    response.message = std::string(service) + " refused: " + error.what();
  }
  return true;
}

}  // namespace assembly_cell::ros_bridge
