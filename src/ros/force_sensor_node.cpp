// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/force_sensor_node.h"

#include <assembly_cell/Ack.h>
#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/DisplacementWithCovariance.h>
#include <assembly_cell/WrenchSamples.h>
#include <assembly_cell/WrenchWithCovariance.h>
#include <diagnostic_msgs/DiagnosticStatus.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "assembly_cell/ros/calibration_messages.h"
#include "assembly_cell/ros/conversions.h"
#include "assembly_cell/ros/parameters.h"
#include "assembly_cell/scene/input_error.h"

namespace assembly_cell::ros_bridge {

namespace {

using diagnostic_msgs::DiagnosticStatus;

constexpr std::uint32_t kQueue = 100;      // wherever every sample counts
constexpr std::size_t kNoiseSamples = 50;  // differences in one estimate of the noise
constexpr double kReplayTick = 2e-3;       // of the wall clock [s]
constexpr std::size_t kUndoSteps = 32;     // biases remembered
constexpr int kMostBlocksPerTick = 256;    // leaves the thread to others in between
constexpr const char* kAxes[6] = {"fx [N]", "fy [N]", "fz [N]", "tx [N m]", "ty [N m]", "tz [N m]"};

using Volts = Eigen::Map<const Vector6>;

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, value);
  return text;
}

double age(const ros::Time& time) { return std::max(0.0, (ros::Time::now() - time).toSec()); }

}  // namespace

ForceSensorNode::ForceSensorNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh) {
  readParameters();
  started_ = Clock::now();
  advertise();
  subscribe();
}

ForceSensorNode::~ForceSensorNode() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  zero_changed_.notify_all();
  service_spinner_.stop();
}

void ForceSensorNode::readParameters() {
  Parameters parameters(pnh_);
  replaying_ = parameters.choice("source", {"simulated", "replay"}, "simulated") == "replay";
  frame_id_ = parameters.text("frame_id");
  if (frame_id_.empty() || frame_id_[0] == '/') {
    throw InputError("parameter " + pnh_.resolveName("frame_id") + " is '" + frame_id_ +
                     "': give the sensor's frame, without a leading slash");
  }
  const std::string calibration_file = parameters.text("calibration_file");
  publish_displacement_ = parameters.flag("publish_displacement", false);
  lockstep_ = parameters.flag("lockstep", false);
  name_in_lockstep_ = parameters.text("name_in_lockstep", ros::this_node::getName().substr(1));
  display_period_ = 1.0 / parameters.number("display_rate", kPositive, 50.0);
  rate_tolerance_ = parameters.number("rate_tolerance", kPositive, 0.05);
  zero_samples_ = static_cast<std::size_t>(parameters.integer("zero_samples", 2, 1000000, 200));
  zero_timeout_ = std::chrono::duration<double>(parameters.number("zero_timeout", {0, 3600}, 30.0));
  source_timeout_ =
      std::chrono::duration<double>(parameters.number("source_timeout", {0, 3600}, 2.0));
  diagnostic_period_ = parameters.number("diagnostic_period", {0.01, 3600}, 1.0);

  if (replaying_) openReplay();
  expected_rate_ = parameters.number("expected_rate", kPositive,
                                     replaying_ ? 1.0 / replay_->recording().period : 5000.0);
  parameters.refuseUnknown({"replay"});

  calibration_ = loadCalibration(calibration_file);
  checkUse(calibration_, "calibration file '" + calibration_file + "'");
}

void ForceSensorNode::openReplay() {
  if (lockstep_) {
    throw InputError("parameter " + pnh_.resolveName("lockstep") +
                     " is true with source replay: only the simulator has a lockstep");
  }
  Parameters parameters(ros::NodeHandle(pnh_, "replay"));
  ReplayFormat replay_format;
  const std::string quantity =
      parameters.choice("quantity", {"wrench", "volts", "counts"}, "wrench");
  quantity_ = quantity == "wrench"  ? SampleQuantity::kWrench
              : quantity == "volts" ? SampleQuantity::kVolts
                                    : SampleQuantity::kCounts;
  replay_format.quantity = quantity_;
  replay_format.columns = parameters.texts("columns", defaultColumns(quantity_));
  replay_format.bits = parameters.integer("bits", 2, 32, 16);
  replay_format.full_scale = parameters.number("full_scale", kPositive, 5.0);
  const std::string file = parameters.text("file");
  replay_fast_ = parameters.choice("rate", {"original", "fast"}, "original") == "fast";
  const bool loop = parameters.flag("loop", false);
  const int block_size = parameters.integer("block_size", 1, 100000, 1);
  parameters.refuseUnknown();
  if (replay_fast_ && loop) {
    throw InputError("parameter " + pnh_.resolveName("replay/loop") +
                     " is true with replay/rate fast: it would flood for ever; loop at original");
  }
  if (!replay_fast_ && ros::Time::isSimTime()) {
    throw InputError("parameter " + pnh_.resolveName("replay/rate") +
                     " is original with use_sim_time: set use_sim_time false, or rate fast");
  }
  replay_ = std::make_unique<Replay>(loadRecording(file, replay_format),
                                     static_cast<std::size_t>(block_size), loop);
}

void ForceSensorNode::checkUse(const Calibration& c, const std::string& source) const {
  if (publish_displacement_ && c.volts_to_displacement.isZero(0.0)) {
    throw InputError(source +
                     ": volts_to_displacement is zero but publish_displacement is true: "
                     "identify the displacement, or set publish_displacement false");
  }
  if (quantity_ == SampleQuantity::kWrench &&
      !(c.volts_to_wrench.isIdentity(0.0) && c.zero_volts.isZero(0.0))) {
    throw InputError(source +
                     ": volts_to_wrench is not the identity but the recording holds "
                     "wrenches: use config/calibration/sensor_replay.yaml");
  }
}

void ForceSensorNode::advertise() {
  // a replay as fast as possible outruns every queue of fixed size
  const std::uint32_t queue = replay_fast_ ? 0 : kQueue;
  if (quantity_ != SampleQuantity::kWrench) {
    strain_pub_ = nh_.advertise<StrainSamples>("strain", queue);
  }
  // in lockstep latched: who connects late must not miss the first block
  wrench_samples_pub_ = nh_.advertise<WrenchSamples>("wrench_samples", queue, lockstep_);
  if (publish_displacement_) {
    displacement_samples_pub_ =
        nh_.advertise<DisplacementSamples>("displacement_samples", queue, lockstep_);
  }
  wrench_raw_pub_ = nh_.advertise<geometry_msgs::WrenchStamped>("wrench_raw", queue);
  wrench_pub_ = nh_.advertise<geometry_msgs::WrenchStamped>("wrench", queue);
  wrench_covariance_pub_ = nh_.advertise<WrenchWithCovariance>("wrench_with_covariance", queue);
  if (publish_displacement_) {
    displacement_pub_ = nh_.advertise<DisplacementWithCovariance>("displacement", queue);
  }
  bias_pub_ = nh_.advertise<geometry_msgs::WrenchStamped>("bias", 1, true);
  calibration_pub_ = nh_.advertise<SensorCalibration>("calibration", 1, true);
  // all participants answer at the cell's root, one above the sensor's group
  if (lockstep_) {
    ack_pub_ = nh_.advertise<Ack>(
        ros::names::append(ros::names::parentNamespace(nh_.getNamespace()), "ack"), kQueue, true);
  }
  calibration_time_ = ros::Time::now();
  publishBias();
  publishCalibration();

  // services wait in threads of their own, so that the data path never waits for them
  ros::NodeHandle service_nh(pnh_);
  service_nh.setCallbackQueue(&service_queue_);
  zero_srv_ = service_nh.advertiseService("zero", &ForceSensorNode::zero, this);
  zero_to_srv_ = service_nh.advertiseService("zero_to", &ForceSensorNode::zeroTo, this);
  undo_bias_srv_ = service_nh.advertiseService("undo_bias", &ForceSensorNode::undoBias, this);
  set_bias_srv_ = service_nh.advertiseService("set_bias", &ForceSensorNode::setBias, this);
  clear_bias_srv_ = service_nh.advertiseService("clear_bias", &ForceSensorNode::clearBias, this);
  get_calibration_srv_ =
      service_nh.advertiseService("get_calibration", &ForceSensorNode::getCalibration, this);
  set_calibration_srv_ =
      service_nh.advertiseService("set_calibration", &ForceSensorNode::setCalibration, this);
  service_spinner_.start();

  // on the wall clock: a simulator that is paused must not silence the diagnostics
  diagnostics_ = std::make_unique<diagnostic_updater::Updater>(nh_, pnh_);
  diagnostics_->setHardwareID(calibration_.serial_number);
  diagnostics_->add("samples", this, &ForceSensorNode::diagnoseSamples);
  diagnostics_->add("calibration", this, &ForceSensorNode::diagnoseCalibration);
  diagnostics_timer_ =
      nh_.createWallTimer(ros::WallDuration(diagnostic_period_),
                          [this](const ros::WallTimerEvent&) { diagnostics_->force_update(); });
}

void ForceSensorNode::subscribe() {
  if (replaying_) {
    source_ = "replay of " + pnh_.param<std::string>("replay/file", "");
    replay_timer_ = nh_.createWallTimer(ros::WallDuration(kReplayTick),
                                        [this](const ros::WallTimerEvent&) { playDueBlocks(); });
  } else {
    source_ = nh_.resolveName("bridge");
    bridge_sub_ = nh_.subscribe("bridge", kQueue, &ForceSensorNode::process, this,
                                ros::TransportHints().tcpNoDelay());
  }
}

// ---- data path ----

void ForceSensorNode::process(const StrainSamples::ConstPtr& block) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_block_ = Clock::now();
    const std::string fault = faultOf(*block);
    if (fault.empty()) {
      publishBlock(block);
    } else {
      ++window_.malformed;
      fault_ = "block " + std::to_string(block->sequence) + ": " + fault;
      ROS_WARN_THROTTLE_NAMED(10.0, "driver", "dropped %s", fault_.c_str());
    }
  }
  zero_changed_.notify_all();
  if (lockstep_) {
    Ack ack;
    ack.node = name_in_lockstep_;
    ack.sequence = block->sequence;
    ack_pub_.publish(ack);
  }
}

void ForceSensorNode::publishBlock(const StrainSamples::ConstPtr& block) {
  const Arrival arrival = sequence_.accept(block->sequence);
  if (arrival == Arrival::kDuplicate) return;
  const std::size_t samples = block->saturated.size();
  const double start = block->header.stamp.toSec();
  const double end = start + static_cast<double>(samples - 1) * block->period;
  if (block->header.frame_id != frame_id_) foreign_frame_ = block->header.frame_id;
  temperature_ = block->temperature;

  // rate on the time base of the samples; a clock that went back starts it anew
  if (arrival != Arrival::kNext) noise_.breakRun();
  if (arrival == Arrival::kRestart || !rate_started_ || start <= last_time_) {
    rate_started_ = true;
    rate_from_ = start;
    rate_samples_ = samples - 1;
    display_sum_.setZero();
    display_volts_.setZero();
    display_count_ = 0;
    displayed_ = -1.0;
  } else {
    rate_samples_ += samples;
  }
  last_time_ = end;

  // one pass: raw wrench, bias, statistics
  auto wrench = boost::make_shared<WrenchSamples>();
  wrench->header.stamp = block->header.stamp;
  wrench->header.frame_id = frame_id_;
  wrench->period = block->period;
  wrench->sequence = block->sequence;
  wrench->saturated = block->saturated;
  wrench->wrench.resize(6 * samples);
  Vector6 sum = Vector6::Zero(), volts_sum = Vector6::Zero();
  std::uint8_t saturated = 0;
  for (std::size_t k = 0; k < samples; ++k) {
    const Vector6 raw = wrenchFromVolts(calibration_, Volts(&block->volts[6 * k]));
    Vector6::Map(&wrench->wrench[6 * k]) = raw - bias_;
    sum += raw;
    volts_sum += Volts(&block->volts[6 * k]);
    noise_.add(raw);
    if (zero_.active && zero_.armed) zero_.moments.add(raw);
    saturated = static_cast<std::uint8_t>(saturated | block->saturated[k]);
    if (block->saturated[k] != 0) ++window_.saturated_samples;
  }
  window_.samples += samples;
  window_.saturated = static_cast<std::uint8_t>(window_.saturated | saturated);
  // volts beyond all measure overflow; nothing of such a block is told
  if (!sum.allFinite()) {
    ++window_.malformed;
    fault_ = "block " + std::to_string(block->sequence) + ": wrench is not finite";
    noise_ = DifferenceNoise();
    if (zero_.active) zero_.failure = "the wrench is not finite: look at the source";
    return;
  }

  if (zero_.active && zero_.failure.empty()) {
    if (arrival == Arrival::kRestart) zero_.failure = "the source started anew: try again";
    if (zero_.armed && saturated != 0) {
      zero_.failure = "channel " + channelText(saturated) + " saturated in block " +
                      std::to_string(block->sequence) + ": unload the sensor or look at its bridge";
    }
    zero_.armed = true;
  }

  if (strain_pub_) strain_pub_.publish(block);
  wrench_samples_pub_.publish(wrench);
  if (publish_displacement_ && (lockstep_ || displacement_samples_pub_.getNumSubscribers() > 0)) {
    auto displacement = boost::make_shared<DisplacementSamples>();
    displacement->header = wrench->header;
    displacement->period = block->period;
    displacement->sequence = block->sequence;
    displacement->displacement.resize(6 * samples);
    for (std::size_t k = 0; k < samples; ++k) {
      Vector6::Map(&displacement->displacement[6 * k]) =
          displacementFromVolts(calibration_, Volts(&block->volts[6 * k]));
    }
    displacement_samples_pub_.publish(displacement);
  }
  display(block->header.stamp + ros::Duration(end - start), block->period, sum, volts_sum, samples);
}

void ForceSensorNode::display(const ros::Time& end, double period, const Vector6& sum,
                              const Vector6& volts_sum, std::size_t samples) {
  display_sum_ += sum;
  display_volts_ += volts_sum;
  display_count_ += samples;
  // half a sample of slack: blocks as long as the display's period all show
  if (displayed_ >= 0.0 && end.toSec() - displayed_ < display_period_ - 0.5 * period) return;
  displayed_ = end.toSec();

  const Vector6 raw = display_sum_ / static_cast<double>(display_count_);
  geometry_msgs::WrenchStamped message;
  message.header.stamp = end;
  message.header.frame_id = frame_id_;
  message.wrench = toWrench(raw);
  wrench_raw_pub_.publish(message);
  message.wrench = toWrench(raw - bias_);
  wrench_pub_.publish(message);
  displayCovariance(message, display_volts_ / static_cast<double>(display_count_));
  display_sum_.setZero();
  display_volts_.setZero();
  display_count_ = 0;
}

void ForceSensorNode::displayCovariance(const geometry_msgs::WrenchStamped& wrench,
                                        const Vector6& volts) {
  window_.outside |= outsideWrenchRange(calibration_, volts);
  // of one sample: an average doesn't reduce what the converter rounds
  const Matrix6 strain = calibration_.noise.cwiseAbs2().asDiagonal();
  // a covariance that overflows is not told
  if (wrench_covariance_pub_.getNumSubscribers() > 0) {
    const Matrix6 covariance = wrenchCovariance(calibration_, volts, strain);
    WrenchWithCovariance message;
    message.header = wrench.header;
    message.wrench = wrench.wrench;
    Matrix6::Map(message.covariance.data()) = covariance;
    if (covariance.allFinite()) wrench_covariance_pub_.publish(message);
  }
  if (publish_displacement_ && displacement_pub_.getNumSubscribers() > 0) {
    const Vector6 displacement = displacementFromVolts(calibration_, volts);
    const Matrix6 covariance = displacementCovariance(calibration_, volts, strain);
    DisplacementWithCovariance message;
    message.header = wrench.header;
    Vector6::Map(message.displacement.data()) = displacement;
    Matrix6::Map(message.covariance.data()) = covariance;
    if (displacement.allFinite() && covariance.allFinite()) displacement_pub_.publish(message);
  }
}

void ForceSensorNode::playDueBlocks() {
  // as fast as possible: nobody would see the beginning without someone listening
  if (!replay_origin_) {
    if (replay_fast_ && wrench_samples_pub_.getNumSubscribers() == 0 &&
        wrench_pub_.getNumSubscribers() == 0 && wrench_raw_pub_.getNumSubscribers() == 0) {
      return;
    }
    replay_origin_ = ros::Time::now();
    replay_start_ = Clock::now();
  }
  const Recording& recording = replay_->recording();
  for (int i = 0; i < kMostBlocksPerTick; ++i) {
    ReplayBlock block;
    if (!due_ && !replay_->next(block)) {
      replay_ended_ = true;
      replay_timer_.stop();
      ROS_INFO_NAMED("driver", "the recording has ended");
      return;
    }
    if (!due_) due_ = block;

    // a block is due at its last sample
    const double since_start = due_->time - recording.time.front();
    const double length = static_cast<double>(due_->size - 1) * recording.period;
    const std::chrono::duration<double> age = Clock::now() - replay_start_;
    if (!replay_fast_ && age.count() < since_start + length) return;

    auto message = boost::make_shared<StrainSamples>();
    message->header.stamp =
        replay_fast_ ? ros::Time(due_->time) : *replay_origin_ + ros::Duration(since_start);
    message->header.frame_id = frame_id_;
    message->period = recording.period;
    message->sequence = due_->sequence;
    message->temperature = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t k = due_->first; k < due_->first + due_->size; ++k) {
      const Vector6& value = recording.values[k];
      message->volts.insert(message->volts.end(), value.data(), value.data() + 6);
      message->saturated.push_back(recording.saturated[k]);
    }
    // the seam of a loop is no noise
    if (due_->first == 0) {
      const std::lock_guard<std::mutex> lock(mutex_);
      noise_.breakRun();
    }
    due_.reset();
    process(message);
  }
}

// ---- services ----

void ForceSensorNode::publishBias() {
  geometry_msgs::WrenchStamped message;
  message.header.stamp = bias_time_.value_or(ros::Time());
  message.header.frame_id = frame_id_;
  message.wrench = toWrench(bias_);
  bias_pub_.publish(message);
}

void ForceSensorNode::publishCalibration() {
  SensorCalibration message = toMessage(calibration_);
  message.header.stamp = calibration_time_;
  message.header.frame_id = frame_id_;
  calibration_pub_.publish(message);
}

void ForceSensorNode::changeBias(const Vector6& bias, std::optional<ros::Time> time) {
  if (earlier_biases_.size() == kUndoSteps) earlier_biases_.pop_front();
  earlier_biases_.push_back({bias_, bias_time_});
  bias_ = bias;
  bias_time_ = time;
  publishBias();
}

bool ForceSensorNode::zero(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  takeZero(Vector6::Zero(), "zero", response.success, response.message);
  return true;
}

bool ForceSensorNode::zeroTo(ZeroTo::Request& request, ZeroTo::Response& response) {
  const Vector6 load = Vector6::Map(request.wrench.data());
  if (load.allFinite()) {
    takeZero(load, "zero_to", response.success, response.message);
  } else {
    response.success = false;
    response.message = "zero_to refused: wrench is not finite: give six numbers";
  }
  return true;
}

void ForceSensorNode::takeZero(const Vector6& load, const std::string& service, uint8_t& success,
                               std::string& message) {
  std::unique_lock<std::mutex> lock(mutex_);
  success = false;
  if (zero_.active) {
    message = service + " refused: another one is under way: wait for it";
    return;
  }
  zero_ = Zero();
  zero_.active = true;

  // wait for samples that were all taken after the call; a silent source ends it early
  const Clock::time_point called = Clock::now();
  const auto later = [](Clock::time_point from, std::chrono::duration<double> wait) {
    return from + std::chrono::duration_cast<Clock::duration>(wait);
  };
  while (zero_.failure.empty() && zero_.moments.count() < zero_samples_) {
    const Clock::time_point silent =
        later(std::max(called, last_block_.value_or(called)), source_timeout_);
    const Clock::time_point limit = std::min(later(called, zero_timeout_), silent);
    if (stopping_) {
      zero_.failure = "the driver shuts down";
    } else if (Clock::now() < limit) {
      zero_changed_.wait_until(lock, limit);
    } else if (limit == silent) {
      zero_.failure = "no samples for " + format("%g s", source_timeout_.count()) +
                      ": start the source, or let the simulator run";
    } else {
      zero_.failure = "only " + std::to_string(zero_.moments.count()) + " of " +
                      std::to_string(zero_samples_) + " samples came in " +
                      format("%g s", zero_timeout_.count()) + ": raise zero_timeout";
    }
  }
  zero_.active = false;
  if (!zero_.failure.empty()) {
    message = service + " refused: " + zero_.failure;
    return;
  }

  changeBias(zero_.moments.mean() - load, ros::Time::now());
  success = true;
  message = "bias = mean of " + std::to_string(zero_.moments.count()) + " samples" +
            (load.isZero(0.0) ? "" : " - load (" + wrenchText(load, "%.5g") + ")") + ": " +
            wrenchText(bias_, "%.5g") +
            "; sigma of a sample: " + wrenchText(zero_.moments.sd(), "%.3g") + "; it was " +
            wrenchText(earlier_biases_.back().bias, "%.5g");
}

bool ForceSensorNode::setBias(SetBias::Request& request, SetBias::Response& response) {
  const Vector6 bias = Vector6::Map(request.bias.data());
  response.success = bias.allFinite();
  if (!response.success) {
    response.message = "set_bias refused: bias is not finite: give six numbers";
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  changeBias(bias, ros::Time::now());
  response.message = "bias = " + wrenchText(bias_, "%.5g");
  return true;
}

bool ForceSensorNode::clearBias(std_srvs::Trigger::Request&,
                                std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.message = "cleared; it was " + wrenchText(bias_, "%.5g");
  changeBias(Vector6::Zero(), std::nullopt);
  response.success = true;
  return true;
}

bool ForceSensorNode::undoBias(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.success = !earlier_biases_.empty();
  if (!response.success) {
    response.message = "undo_bias refused: nothing to undo since the calibration came in force";
    return true;
  }
  response.message = "bias was " + wrenchText(bias_, "%.5g");
  bias_ = earlier_biases_.back().bias;
  bias_time_ = earlier_biases_.back().time;
  earlier_biases_.pop_back();
  publishBias();
  response.message +=
      "; it is " + wrenchText(bias_, "%.5g") + ", " +
      (bias_time_ ? "taken " + format("%.0f s ago", age(*bias_time_)) : "never set");
  return true;
}

bool ForceSensorNode::getCalibration(GetCalibration::Request&, GetCalibration::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  response.calibration = toMessage(calibration_);
  response.calibration.header.stamp = calibration_time_;
  response.calibration.header.frame_id = frame_id_;
  response.success = true;
  response.message = calibration_.id + " of " + calibration_.date + ", in force for " +
                     format("%.0f s", age(calibration_time_));
  return true;
}

bool ForceSensorNode::setCalibration(SetCalibration::Request& request,
                                     SetCalibration::Response& response) {
  Calibration calibration;
  response.success = false;
  try {
    calibration = fromMessage(request.calibration, "set_calibration refused");
    checkCalibration(calibration, "set_calibration refused");
    checkUse(calibration, "set_calibration refused");
  } catch (const InputError& error) {
    response.message = error.what();
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (calibration.serial_number != calibration_.serial_number) {
    response.message = "set_calibration refused: serial_number is '" + calibration.serial_number +
                       "' but this sensor is '" + calibration_.serial_number +
                       "': send the calibration to its own sensor";
    return true;
  }
  // the bias was read through the old calibration, and so was a zero under way
  calibration_ = calibration;
  calibration_time_ = ros::Time::now();
  bias_.setZero();
  bias_time_.reset();
  earlier_biases_.clear();
  noise_ = DifferenceNoise();
  noise_samples_ = 0;
  display_sum_.setZero();
  display_volts_.setZero();
  display_count_ = 0;
  if (zero_.active) zero_.failure = "the calibration changed meanwhile: try again";
  zero_changed_.notify_all();
  publishCalibration();
  publishBias();
  response.success = true;
  response.message = "calibration '" + calibration_.id + "' in force, bias cleared: call zero";
  return true;
}

// ---- diagnostics ----

void ForceSensorNode::diagnoseSamples(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::chrono::duration<double> silence = Clock::now() - last_block_.value_or(started_);
  if (rate_samples_ > 0 && last_time_ > rate_from_) {
    rate_ = static_cast<double>(rate_samples_) / (last_time_ - rate_from_);
    rate_from_ = last_time_;
    rate_samples_ = 0;
  }
  // the first estimate grows with its samples; then each one is complete
  if (noise_.count() >= kNoiseSamples || noise_.count() > noise_samples_) {
    noise_rms_ = noise_.rms();
    noise_samples_ = noise_.count();
    if (noise_samples_ >= kNoiseSamples) noise_.clear();
  }
  const std::uint64_t lost = sequence_.lost() - reported_lost_;
  const std::uint64_t duplicates = sequence_.duplicates() - reported_duplicates_;
  const std::uint64_t restarts = sequence_.restarts() - reported_restarts_;
  reported_lost_ = sequence_.lost();
  reported_duplicates_ = sequence_.duplicates();
  reported_restarts_ = sequence_.restarts();

  // causes since the last report, the worst last
  const auto warn = [&](const std::string& text) {
    status.mergeSummary(DiagnosticStatus::WARN, text);
  };
  const auto fail = [&](const std::string& text) {
    status.mergeSummary(DiagnosticStatus::ERROR, text);
  };
  status.summary(DiagnosticStatus::OK, "");
  if (replay_ended_) {
    status.summary(DiagnosticStatus::OK, "the recording has ended");
  } else if (silence > source_timeout_) {
    // the simulator may be paused in lockstep
    status.summary(lockstep_ ? DiagnosticStatus::WARN : DiagnosticStatus::ERROR,
                   last_block_ ? "no samples for " + format("%.1f s", silence.count())
                               : "no samples yet from " + source_);
  }
  if (window_.malformed > 0) fail("malformed: " + fault_);
  if (window_.saturated != 0) fail("saturated channels: " + channelText(window_.saturated));
  if (window_.outside != 0) {
    warn("load beyond the tests of the calibration, channels: " + channelText(window_.outside));
  }
  if (lost > 0) warn(std::to_string(lost) + " blocks lost");
  if (duplicates > 0) warn(std::to_string(duplicates) + " blocks twice or out of order");
  if (restarts > 0) warn("the source started anew");
  if (!foreign_frame_.empty()) {
    warn("blocks say they're from '" + foreign_frame_ + "', frame_id is '" + frame_id_ + "'");
  }
  if (rate_ > 0.0 && std::abs(rate_ - expected_rate_) > rate_tolerance_ * expected_rate_) {
    warn("rate " + format("%.4g Hz", rate_) + " instead of " + format("%.4g Hz", expected_rate_));
  }
  if (status.message.empty()) {
    status.summary(DiagnosticStatus::OK, "sampling at " + format("%.4g Hz", rate_));
  }
  total_samples_ += window_.samples;
  total_saturated_ += window_.saturated_samples;
  total_malformed_ += window_.malformed;

  status.add("source", source_);
  status.add("rate [Hz]", rate_);
  status.add("expected rate [Hz]", expected_rate_);
  status.add("age of last block [s]", last_block_ ? silence.count() : -1.0);
  status.add("samples", total_samples_);
  status.add("lost blocks", sequence_.lost());
  status.add("duplicate blocks", sequence_.duplicates());
  status.add("source restarts", sequence_.restarts());
  status.add("malformed blocks", total_malformed_);
  status.add("saturated channels", channelText(window_.saturated));
  status.add("saturated samples", total_saturated_);
  if (std::isfinite(temperature_)) status.add("temperature [degC]", temperature_);
  for (int k = 0; k < 6; ++k) status.add(std::string("noise rms ") + kAxes[k], noise_rms_[k]);
  status.add("samples in noise rms", noise_samples_);
  window_ = Window();
  foreign_frame_.clear();
}

void ForceSensorNode::diagnoseCalibration(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const std::lock_guard<std::mutex> lock(mutex_);
  status.summary(DiagnosticStatus::OK,
                 "calibration " + calibration_.id + (bias_time_ ? ", zeroed" : ", not zeroed"));
  status.add("serial number", calibration_.serial_number);
  status.add("calibration id", calibration_.id);
  status.add("calibration date", calibration_.date);
  status.add("calibration in force [s]", age(calibration_time_));
  status.add("model", calibration_.quadratic_wrench ? "quadratic" : "linear");
  if (bias_time_) {
    status.add("bias age [s]", age(*bias_time_));
  } else {
    status.add("bias age [s]", "never set");
  }
  for (int k = 0; k < 6; ++k) status.add(std::string("bias ") + kAxes[k], bias_[k]);
}

}  // namespace assembly_cell::ros_bridge
