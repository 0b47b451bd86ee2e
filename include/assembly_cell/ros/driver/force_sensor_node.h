// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/GetCalibration.h>
#include <assembly_cell/SensorCalibration.h>
#include <assembly_cell/SetBias.h>
#include <assembly_cell/SetCalibration.h>
#include <assembly_cell/StrainSamples.h>
#include <assembly_cell/WrenchSamples.h>
#include <assembly_cell/ZeroTo.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "assembly_cell/Ack.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/bridge/stream_subscriber.h"
#include "assembly_cell/ros/driver/source_choice.h"
#include "assembly_cell/ros/process/ros_clock.h"
#include "assembly_cell/sensor/acquisition.h"
#include "assembly_cell/sensor/calibration.h"
#include "assembly_cell/sensor/stamp_filter.h"
#include "assembly_cell/sensor/statistics.h"

namespace assembly_cell::ros_bridge {

class Parameters;

/// Driver of one six-axis sensor: blocks of samples, from the topic `bridge` or from a StrainSource
/// (device, recording, plug-in), become wrenches and displacements. A source is read by a thread of
/// its own and published by another. Interfaces: docs/reference/interfaces.md.
/// Wrench: exerted by the environment on the part that the sensor carries, about the origin of
/// frame_id; wrench = wrench_raw − bias.
class ForceSensorNode {
 public:
  /// Of its callbacks: of the data path; the services have threads of their own.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for a bad parameter or file.
  ForceSensorNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh);
  ~ForceSensorNode();

 private:
  using Clock = std::chrono::steady_clock;

  /// A zero in progress.
  struct Zero {
    bool active = false;
    bool armed = false;   ///< false until the block that was under way at the call has gone by
    Moments moments;      ///< of wrench_raw
    std::string failure;  ///< why it can't succeed
  };

  /// What arrived since the last report.
  struct Window {
    std::uint64_t samples = 0;
    std::uint64_t saturated_samples = 0;
    std::uint8_t saturated = 0;   ///< bit per channel
    unsigned outside = 0;         ///< bit per channel: displayed means beyond the tests' range
    std::uint64_t malformed = 0;  ///< blocks
  };

  /// What ~undo_bias goes back to.
  struct EarlierBias {
    Vector6 bias;
    std::optional<ros::Time> time;
  };

  void readParameters();
  std::string cellNamespace() const;  ///< one above the sensor's
  /// The nominal rate of a recording [Hz], or 0.
  double prepareSource(Parameters& parameters);
  void advertise();
  void advertiseStrain();
  void subscribe();

  // the data path
  void refuseBlock(const StrainSamples& block, const std::string& why);
  void acknowledge(const StrainSamples& block);
  void process(const StrainSamples::ConstPtr& block);
  void publishBlock(const StrainSamples::ConstPtr& block);
  void publishDisplacement(const StrainSamples& block, const std_msgs::Header& header);
  void repeat();
  void display(const ros::Time& end, double period, const Vector6& sum, const Vector6& volts_sum,
               std::size_t samples);
  void displayCovariance(const geometry_msgs::WrenchStamped& wrench, const Vector6& volts);

  // blocks of a source, in the publishing thread
  void publishBlocks();
  void publishAll();
  void publishSource(const SourceBlock& block);
  void markOutOfRange(StrainSamples& block) const;
  void tellLink();  ///< in the log, what is wrong with it, once
  /// Checks what the configuration can't know before the first block; false if it can't work.
  bool beginStream();
  void stampBlock(const SourceBlock& block, bool first, StrainSamples& message);

  // services
  bool zero(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool zeroTo(ZeroTo::Request& request, ZeroTo::Response& response);
  bool undoBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool setBias(SetBias::Request& request, SetBias::Response& response);
  bool clearBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool getCalibration(GetCalibration::Request&, GetCalibration::Response& response);
  bool deviceBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response);
  bool setCalibration(SetCalibration::Request& request, SetCalibration::Response& response);

  /// Blocking: bias = mean of new samples − load.
  void takeZero(const Vector6& load, const std::string& service, uint8_t& success,
                std::string& message);

  // with mutex_ held
  void changeBias(const Vector6& bias, std::optional<ros::Time> time);
  void publishBias();
  void publishCalibration();

  /// Throws InputError when this node can't work with the calibration.
  void checkUse(const Calibration& calibration, const std::string& source) const;

  void diagnoseSamples(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseDevice(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseCalibration(diagnostic_updater::DiagnosticStatusWrapper& status);

  // parameters
  ros::NodeHandle nh_, pnh_;
  std::string frame_id_;
  bool publish_displacement_ = false;
  bool lockstep_ = false;
  std::string name_in_lockstep_;
  std::unique_ptr<LiveSettings> live_;
  double expected_rate_ = 0.0;   // [Hz]
  double rate_tolerance_ = 0.0;  // fraction
  std::size_t zero_samples_ = 0;
  std::chrono::duration<double> zero_timeout_{0.0};
  std::chrono::duration<double> source_timeout_{0.0};
  double diagnostic_period_ = 0.0;  // [s]
  std::string source_;              // for people

  // the source, unless blocks come on a topic
  SourceChoice choice_;
  bool recorded_ = false, paced_ = true;
  bool calibrated_ = true;                         // a calibration file was given
  double range_force_ = 0.0, range_torque_ = 0.0;  // of a device that delivers wrenches [N] [N m]
  std::chrono::duration<double> device_bias_timeout_{0.0};
  int priority_ = 0;
  std::unique_ptr<Acquisition> acquisition_;

  // state of the publishing thread
  StampFilter stamp_filter_;
  std::string told_;  // of the link, in the log
  Clock::time_point last_sample_{};
  ros::Time recording_start_;
  std::optional<std::uint32_t> stream_;
  std::uint64_t next_sample_ = 0;               // sequence of the sample that should follow
  std::uint32_t block_sequence_ = 0xffffffffu;  // of the latest block; the first one is 0

  // state shared by the data path and the services
  std::mutex mutex_;
  std::condition_variable zero_changed_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> replay_ended_{false};
  Calibration calibration_;
  ros::Time calibration_time_;  // since when it's in force
  Vector6 bias_ = Vector6::Zero();
  std::optional<ros::Time> bias_time_;
  std::deque<EarlierBias> earlier_biases_;  // the newest last, all of the same calibration
  Zero zero_;
  std::optional<Clock::time_point> last_block_;
  SampleQuantity quantity_ = SampleQuantity::kVolts;
  bool quantity_known_ = false;  // a device tells it when it's open
  RosClock ros_clock_;
  Delays delays_;  // from the arrival of a block's last sample to its publication

  // state of the data path
  Clock::time_point started_;
  SequenceMonitor sequence_;
  Window window_;
  DifferenceNoise noise_;
  bool rate_started_ = false;
  double last_time_ = 0.0;          // of the newest sample [s]
  double rate_from_ = 0.0;          // time of the sample that the rate is counted from [s]
  std::uint64_t rate_samples_ = 0;  // since then
  double temperature_ = std::numeric_limits<double>::quiet_NaN();  // [degC]
  std::string fault_;                                              // of the last malformed block
  std::string foreign_frame_;              // of blocks that say they're from another sensor
  Vector6 display_sum_ = Vector6::Zero();  // of wrench_raw
  Vector6 display_volts_ = Vector6::Zero();
  std::size_t display_count_ = 0;
  double displayed_ = -1.0;                          // time of the last display [s], −1: none
  WrenchSamples::ConstPtr last_wrench_;              // published
  DisplacementSamples::ConstPtr last_displacement_;  // published
  int repetitions_ = 0;                              // of the last block

  // state of the diagnostics
  double rate_ = 0.0;  // as last measured [Hz]
  Vector6 noise_rms_ = Vector6::Zero();
  std::size_t noise_samples_ = 0;  // differences it rests on
  std::uint64_t total_samples_ = 0, total_saturated_ = 0, total_malformed_ = 0;
  SourceCounters reported_counters_;
  LinkStatus reported_link_;
  std::uint64_t reported_steps_ = 0;
  std::uint64_t reported_lost_ = 0, reported_duplicates_ = 0, reported_restarts_ = 0;

  ros::CallbackQueue service_queue_;
  StreamSubscriber bridge_sub_;
  ros::Publisher strain_pub_, wrench_raw_pub_, wrench_pub_, wrench_covariance_pub_,
      displacement_pub_, bias_pub_, calibration_pub_;
  LatestPublisher<WrenchSamples> wrench_samples_pub_;
  LatestPublisher<DisplacementSamples> displacement_samples_pub_;
  LatestPublisher<Ack> ack_pub_;
  ros::ServiceServer zero_srv_, zero_to_srv_, undo_bias_srv_, set_bias_srv_, clear_bias_srv_,
      get_calibration_srv_, set_calibration_srv_, device_bias_srv_;
  ros::WallTimer diagnostics_timer_;
  std::unique_ptr<diagnostic_updater::Updater> diagnostics_;
  GuardedSpinner service_spinner_{2, &service_queue_};
  std::thread publisher_;
};

}  // namespace assembly_cell::ros_bridge
