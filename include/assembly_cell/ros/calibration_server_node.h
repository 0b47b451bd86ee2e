// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/server/simple_action_server.h>
#include <assembly_cell/AddObservation.h>
#include <assembly_cell/CalibrateSensorsAction.h>
#include <assembly_cell/ConfirmLoad.h>
#include <assembly_cell/GetCalibrations.h>
#include <assembly_cell/LoadCalibration.h>
#include <assembly_cell/PlanCalibration.h>
#include <assembly_cell/SaveCalibration.h>
#include <assembly_cell/SolveCalibration.h>
#include <assembly_cell/StrainSamples.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/calibration/displacement.h"
#include "assembly_cell/calibration/force.h"
#include "assembly_cell/calibration/observation.h"
#include "assembly_cell/calibration/observation_log.h"
#include "assembly_cell/calibration/plan.h"
#include "assembly_cell/sensor/calibration.h"
#include "assembly_cell/sensor/statistics.h"

namespace assembly_cell::ros_bridge {

/// Calibrates two sensors: plans tests, averages their strain, keeps every observation on disk,
/// solves, stores and puts in force. Interfaces: docs/interfaces.md.
class CalibrationServerNode {
 public:
  /// Throws InputError for a bad parameter or a damaged journal.
  CalibrationServerNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~CalibrationServerNode();

 private:
  using Clock = std::chrono::steady_clock;
  using Seconds = std::chrono::duration<double>;

  /// Samples of one sensor while somebody waits for them.
  struct Collector {
    bool active = false;
    bool armed = false;  ///< the block that was under way at the call has gone by
    ros::Time from;      ///< of the first sample that counts
    std::vector<Vector6> volts;
    std::vector<std::uint8_t> saturated;
    double first = 0.0, last = 0.0;  ///< stamps [s]
    double temperature = 0.0;        ///< of the last block [degC]
    std::optional<Clock::time_point> heard;
    SequenceMonitor sequence;
    std::string failure;
  };

  struct Sensor {
    std::string name;  ///< sensor_a, sensor_b: topics, frame and folder of the store
    Side side = Side::kA;
    Collector collector;
    std::optional<Calibration> in_force;
    ros::Time in_force_since;
    ros::Subscriber strain_sub;
    ros::Publisher calibration_pub;
    std::string driver_service;  ///< set_calibration of its driver
  };

  /// What was found from the observations as they are.
  struct Solution {
    ForceSolution force;
    std::array<std::optional<DisplacementSolution>, 2> displacement;
    ObservationSet set;  ///< solved
    CalibrationResult result;
  };

  /// Why a window can't be used; `again` when a repetition may help.
  struct Refusal {
    std::string reason;
    bool again = false;
  };

  /// A step of an action that waits for a person.
  enum class Waiting { kNo, kOpen, kReading, kDone };

  void readParameters();
  void openStore();
  void advertise();

  // data
  void collect(Sensor& sensor, const StrainSamples::ConstPtr& block);
  /// Attaches readings of a settled window of the sensors `wanted`. Samples count from `from` on,
  /// or (zero) those that were all taken after the call.
  std::optional<Refusal> read(Observation& observation, const std::array<bool, 2>& wanted,
                              const ros::Time& from);
  std::string unsettled(const Reading& reading, const Sensor& sensor) const;

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
  CalibrateSensorsResult runPlan(const CalibrateSensorsGoal& goal);
  /// Loads, reads, keeps. Empty, or why the step has no observation; throws InputError when the
  /// plan can't go on.
  std::string stepByRig(const LoadRequest& step);
  std::string stepByPerson(const LoadRequest& step);
  bool cancelled();
  void tell(const std::string& state, const std::string& message);

  /// The right to change observations and calibrations. Throws InputError when another has it.
  std::unique_lock<std::mutex> acquire();
  // with that right held
  void keep(const Observation& observation);
  void startAnew();
  std::string saveSolution(const std::string& id);  ///< returns the id

  /// The calibration in force, here or in the sensor's driver; empty when there is none.
  Calibration before(const Sensor& sensor) const;
  /// Puts calibrations in force here and in the drivers; a line about drivers that didn't take it.
  std::string putInForce(const std::array<std::optional<Calibration>, 2>& calibrations);
  Calibration loadStored(const Sensor& sensor, const std::string& id) const;
  void writeInForce() const;
  void readInForce();

  std::vector<LoadRequest> makeSteps(const std::string& plan, std::uint32_t seed) const;
  Solution solveAll(ForceSettings settings) const;
  void publishCalibration(Sensor& sensor);
  void publishStatus();
  void publishObservations();
  std_msgs::String observationsMessage();
  ObservationSet observations() const;

  // parameters
  ros::NodeHandle nh_, pnh_;
  std::string store_;
  ObservationSet set_;  ///< of the header, and all observations
  RatedLoad rated_;
  std::size_t window_ = 0;
  Seconds settle_timeout_{0.0}, source_timeout_{0.0};
  std::string rig_;  ///< service that applies loads; empty: a person does
  std::string default_plan_;
  int zero_every_ = 0;
  double max_dropped_ = 0.0;
  bool set_drivers_ = true;

  std::unique_ptr<ObservationLog> journal_;

  /// Held by whoever changes observations or calibrations: one at a time, others are refused.
  std::mutex busy_;
  /// Guards what follows, briefly.
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<bool> stopping_{false};
  std::array<Sensor, 2> sensors_;
  std::optional<Solution> solution_;
  std::string state_ = "idle";
  std::string last_id_;
  Waiting waiting_ = Waiting::kNo;
  Observation awaited_;  ///< of the step that a person brings about
  CalibrateSensorsFeedback feedback_;
  bool in_action_ = false;

  ros::CallbackQueue service_queue_;
  ros::Publisher status_pub_, observations_pub_;
  std::vector<ros::ServiceServer> services_;
  std::unique_ptr<actionlib::SimpleActionServer<CalibrateSensorsAction>> action_;
  ros::AsyncSpinner service_spinner_{4, &service_queue_};
};

}  // namespace assembly_cell::ros_bridge
