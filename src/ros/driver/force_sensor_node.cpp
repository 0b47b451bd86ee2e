// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/driver/force_sensor_node.h"

#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/DisplacementWithCovariance.h>
#include <assembly_cell/WrenchSamples.h>
#include <assembly_cell/WrenchWithCovariance.h>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mechanism/compliance.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/driver/bag_source.h"
#include "assembly_cell/ros/process/participants.h"
#include "assembly_cell/sensor/wrench_range.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::uint8_t kAllChannels = 0x3f;  // where the source hasn't said which one

using Volts = Eigen::Map<const Vector6>;

bool isIdentity(const Calibration& c) {
  return !c.quadratic_wrench && c.volts_to_wrench.isIdentity(0.0) && c.zero_volts.isZero(0.0);
}

// The displacement of a coupling as its scenario describes it, by the wrench.
Calibration withDisplacement(Calibration c, const CouplingParameters& coupling) {
  const Matrix6 compliance = couplingCompliance(coupling);
  c.volts_to_displacement = compliance * c.volts_to_wrench;
  c.quadratic_displacement = c.quadratic_wrench;
  if (c.quadratic_wrench) c.displacement_products = compliance * c.wrench_products;
  return c;
}

}  // namespace

ForceSensorNode::ForceSensorNode(const ros::NodeHandle& nh, const ros::NodeHandle& pnh)
    : nh_(nh), pnh_(pnh) {
  readParameters();
  started_ = Clock::now();
  advertise();
  subscribe();
}

std::string ForceSensorNode::cellNamespace() const {
  return ros::names::parentNamespace(nh_.getNamespace());
}

ForceSensorNode::~ForceSensorNode() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  zero_changed_.notify_all();
  if (acquisition_) acquisition_->stop();
  if (publisher_.joinable()) publisher_.join();
  service_spinner_.stop();
}

void ForceSensorNode::readParameters() {
  Parameters parameters(pnh_);
  choice_ = chooseSource(pnh_);
  parameters.markKnown("source");
  frame_id_ = parameters.text("frame_id");
  if (frame_id_.empty() || frame_id_[0] == '/') {
    throw InputError("parameter " + pnh_.resolveName("frame_id") + " is '" + frame_id_ +
                     "': give the sensor's frame, without a leading slash");
  }
  // a device that delivers wrenches has its calibration in itself
  const std::string calibration_file = choice_.source
                                           ? parameters.text("calibration_file", std::string())
                                           : parameters.text("calibration_file");
  publish_displacement_ = parameters.flag("publish_displacement", false);
  const std::string scenario = parameters.text("scenario", std::string());
  const auto overrides = parameters.texts("overrides", std::vector<std::string>{});
  lockstep_ = parameters.flag("lockstep", false);
  name_in_lockstep_ =
      parameters.text("name_in_lockstep", participantName(cellNamespace(), pnh_.getNamespace()));
  const Range rates{1e-3, 1e6};
  const double display_rate = parameters.number("display_rate", rates, 50.0);
  rate_tolerance_ = parameters.number("rate_tolerance", kPositive, 0.05);
  zero_samples_ = static_cast<std::size_t>(parameters.integer("zero_samples", 2, 1000000, 200));
  zero_timeout_ = std::chrono::duration<double>(parameters.number("zero_timeout", {0, 3600}, 30.0));
  source_timeout_ =
      std::chrono::duration<double>(parameters.number("source_timeout", {0, 3600}, 2.0));
  diagnostic_period_ = parameters.number("diagnostic_period", {0.01, 3600}, 1.0);

  double rate = 5000.0;
  if (choice_.source) rate = prepareSource(parameters);
  expected_rate_ = rate > 0.0 ? parameters.number("expected_rate", kPositive, rate)
                              : parameters.number("expected_rate", kNotNegative, 0.0);
  parameters.refuseUnknown({"replay"});

  calibrated_ = !calibration_file.empty();
  if (calibrated_) {
    calibration_ = loadCalibration(calibration_file);
    if (!scenario.empty()) {
      calibration_ = withDisplacement(calibration_, loadMechanism(scenario, overrides).coupling);
    }
    checkUse(calibration_, "calibration file '" + calibration_file + "'");
  } else {
    calibration_.id = "in the device";
    calibration_.serial_number = kUnknownSerial;
    calibration_.volts_to_wrench.setIdentity();
    checkUse(calibration_, "calibration_file is not set");
  }
  live_ = std::make_unique<LiveSettings>(
      pnh_,
      LiveValues{liveNumber("display_rate", display_rate, rates,
                            "Of wrench and wrench_raw, from the next block on [Hz]")},
      parameters.known());
}

double ForceSensorNode::prepareSource(Parameters& parameters) {
  StrainSource& source = *choice_.source;
  const auto seconds = [&](const char* name, const Range& range, double fallback) {
    return std::chrono::nanoseconds(
        static_cast<std::int64_t>(1e9 * parameters.number(name, range, fallback)));
  };
  if (lockstep_) {
    throw InputError("parameter " + pnh_.resolveName("lockstep") + " is true with source " +
                     choice_.type + ": only the simulator has a lockstep");
  }
  AcquisitionOptions options;
  options.queue = static_cast<std::size_t>(parameters.integer("queue_size", 2, 10000, 100));
  options.read_timeout = seconds("read_timeout", {1e-3, 10.0}, 0.1);
  options.first_back_off = seconds("back_off", {1e-3, 60.0}, 0.25);
  options.longest_back_off =
      std::max(options.first_back_off, seconds("longest_back_off", {1e-3, 600.0}, 5.0));
  options.priority = priority_ = parameters.integer("realtime_priority", 0, 99, 0);
  device_bias_timeout_ =
      std::chrono::duration<double>(parameters.number("device_bias_timeout", {0.01, 3600}, 5.0));

  range_force_ = parameters.number("range_force", kPositive, kLargestForce);
  range_torque_ = parameters.number("range_torque", kPositive, kLargestTorque);

  // a recording must be right at once; a device may come later
  if (source.info().recorded) source.open();
  const SourceInfo& info = source.info();
  recorded_ = info.recorded;
  paced_ = info.paced;
  quantity_ = info.quantity;
  quantity_known_ = recorded_;
  source_ = choice_.type + " " + info.device;
  if (recorded_) source_ = "replay of " + info.device;
  if (paced_ && ros::Time::isSimTime()) {
    throw InputError("parameter " + pnh_.resolveName("source") + " is " + choice_.type +
                     ", which keeps to the wall clock, with use_sim_time: set use_sim_time false" +
                     (recorded_ ? ", or rate fast" : ""));
  }
  // a recording may pause, and loses nothing
  options.silence = recorded_ ? std::chrono::nanoseconds(0)
                              : std::chrono::duration_cast<std::chrono::nanoseconds>(
                                    std::max(source_timeout_, std::chrono::duration<double>(0.1)));
  options.lossless = recorded_ || !paced_;
  acquisition_ = std::make_unique<Acquisition>(source, options);
  if (const auto* bag = dynamic_cast<const BagSource*>(&source)) recording_start_ = bag->start();
  return recorded_ ? info.rate : 0.0;
}

void ForceSensorNode::checkUse(const Calibration& c, const std::string& source) const {
  if (publish_displacement_ && c.volts_to_displacement.isZero(0.0)) {
    throw InputError(source +
                     ": volts_to_displacement is zero but publish_displacement is true: "
                     "identify the displacement, set publish_displacement false, or give the "
                     "calibration of this sensor (this one is of '" +
                     c.serial_number + "')");
  }
  if (!quantity_known_) return;
  if (quantity_ == SampleQuantity::kWrench && !isIdentity(c)) {
    throw InputError(source +
                     ": volts_to_wrench is not the identity but the source delivers "
                     "wrenches: leave calibration_file out");
  }
  if (quantity_ != SampleQuantity::kWrench && !calibrated_) {
    throw InputError(source + " but the source delivers volts: set calibration_file");
  }
}

void ForceSensorNode::advertise() {
  // a replay as fast as possible outruns every queue of fixed size
  const std::uint32_t queue = recorded_ && !paced_ ? 0 : kQueue;
  // a device that delivers wrenches has no strain: what it delivers shows with its first block
  if (recorded_ ? quantity_ != SampleQuantity::kWrench : calibrated_ && !isIdentity(calibration_)) {
    advertiseStrain();
  }
  // in lockstep who connects late must not miss the first block
  wrench_samples_pub_ = {nh_, "wrench_samples", queue, lockstep_};
  if (publish_displacement_) {
    displacement_samples_pub_ = {nh_, "displacement_samples", queue, lockstep_};
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
    ack_pub_ = {nh_, ros::names::append(cellNamespace(), "ack"), kQueue};
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
  if (choice_.source && !recorded_) {
    device_bias_srv_ =
        service_nh.advertiseService("device_bias", &ForceSensorNode::deviceBias, this);
  }
  service_spinner_.start();

  // on the wall clock: a simulator that is paused must not silence the diagnostics
  diagnostics_ = std::make_unique<diagnostic_updater::Updater>(nh_, pnh_, pnh_.getNamespace());
  diagnostics_->setHardwareID(calibration_.serial_number);
  diagnostics_->add("samples", this, &ForceSensorNode::diagnoseSamples);
  if (choice_.source) diagnostics_->add("device", this, &ForceSensorNode::diagnoseDevice);
  diagnostics_->add("calibration", this, &ForceSensorNode::diagnoseCalibration);
  diagnostics_timer_ =
      nh_.createWallTimer(ros::WallDuration(diagnostic_period_),
                          [this](const ros::WallTimerEvent&) { diagnostics_->force_update(); });
}

void ForceSensorNode::advertiseStrain() {
  strain_pub_ = nh_.advertise<StrainSamples>("strain", recorded_ && !paced_ ? 0 : kQueue);
}

void ForceSensorNode::subscribe() {
  if (choice_.source) {
    publisher_ = std::thread([this] { publishBlocks(); });
    return;
  }
  source_ = nh_.resolveName("bridge");
  bridge_sub_ = subscribeStream<StrainSamples>(
      nh_, "bridge", kQueue,
      [this](const StrainSamples::ConstPtr& block) {
        process(block);
        acknowledge(*block);
      },
      [this](const StrainSamples& block, const std::string& why) { refuseBlock(block, why); },
      lockstep_);
}

// ---- data path ----

// What comes from the wire. What a source of our own reads needs no such door.
void ForceSensorNode::refuseBlock(const StrainSamples& block, const std::string& why) {
  const std::lock_guard<std::mutex> lock(mutex_);
  ++window_.malformed;
  fault_ = "block " + std::to_string(block.sequence) + ": " + why;
  acknowledge(block);
}

void ForceSensorNode::acknowledge(const StrainSamples& block) {
  if (!lockstep_) return;
  Ack ack;
  ack.node = name_in_lockstep_;
  ack.sequence = block.sequence;
  ack_pub_.publish(ack);
}

void ForceSensorNode::process(const StrainSamples::ConstPtr& block) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    last_block_ = Clock::now();
    publishBlock(block);
  }
  zero_changed_.notify_all();
}

void ForceSensorNode::publishBlock(const StrainSamples::ConstPtr& block) {
  if (lockstep_ && last_wrench_ && last_wrench_->sequence == block->sequence &&
      last_wrench_->header.stamp == block->header.stamp) {
    if (++repetitions_ > 1) repeat();
    return;
  }
  repetitions_ = 0;
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
    const Vector6 told = cutWrench(raw - bias_);
    Vector6::Map(&wrench->wrench[6 * k]) = told;
    if (wrench->saturated[k] == 0 && told != raw - bias_) wrench->saturated[k] = kAllChannels;
    sum += raw;
    volts_sum += Volts(&block->volts[6 * k]);
    noise_.add(raw);
    if (zero_.active && zero_.armed) zero_.moments.add(raw);
    saturated = static_cast<std::uint8_t>(saturated | block->saturated[k]);
    if (wrench->saturated[k] != 0) ++window_.saturated_samples;
    window_.saturated = static_cast<std::uint8_t>(window_.saturated | wrench->saturated[k]);
  }
  window_.samples += samples;
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
  last_wrench_ = wrench;
  if (publish_displacement_ && (lockstep_ || displacement_samples_pub_.getNumSubscribers() > 0)) {
    publishDisplacement(*block, wrench->header);
  }
  display(block->header.stamp + ros::Duration(end - start), block->period, sum, volts_sum, samples);
}

void ForceSensorNode::publishDisplacement(const StrainSamples& block,
                                          const std_msgs::Header& header) {
  const std::size_t samples = block.saturated.size();
  auto message = boost::make_shared<DisplacementSamples>();
  message->header = header;
  message->period = block.period;
  message->sequence = block.sequence;
  message->displacement.resize(6 * samples);
  for (std::size_t k = 0; k < samples; ++k) {
    Vector6::Map(&message->displacement[6 * k]) =
        cutDisplacement(displacementFromVolts(calibration_, Volts(&block.volts[6 * k])));
  }
  displacement_samples_pub_.publish(message);
  last_displacement_ = message;
}

// The plant asks again, and again: somebody after this node hasn't answered.
void ForceSensorNode::repeat() {
  wrench_samples_pub_.publish(last_wrench_);
  if (last_displacement_) displacement_samples_pub_.publish(last_displacement_);
}

void ForceSensorNode::display(const ros::Time& end, double period, const Vector6& sum,
                              const Vector6& volts_sum, std::size_t samples) {
  display_sum_ += sum;
  display_volts_ += volts_sum;
  display_count_ += samples;
  // half a sample of slack: blocks as long as the display's period all show
  if (displayed_ >= 0.0 &&
      end.toSec() - displayed_ < 1.0 / live_->number("display_rate") - 0.5 * period)
    return;
  displayed_ = end.toSec();

  const Vector6 raw = display_sum_ / static_cast<double>(display_count_);
  geometry_msgs::WrenchStamped message;
  message.header.stamp = end;
  message.header.frame_id = frame_id_;
  message.wrench = toWrench(cutWrench(raw));
  wrench_raw_pub_.publish(message);
  message.wrench = toWrench(cutWrench(raw - bias_));
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
    const Vector6 displacement = cutDisplacement(displacementFromVolts(calibration_, volts));
    const Matrix6 covariance = displacementCovariance(calibration_, volts, strain);
    DisplacementWithCovariance message;
    message.header = wrench.header;
    Vector6::Map(message.displacement.data()) = displacement;
    Matrix6::Map(message.covariance.data()) = covariance;
    if (displacement.allFinite() && covariance.allFinite()) displacement_pub_.publish(message);
  }
}

}  // namespace assembly_cell::ros_bridge
