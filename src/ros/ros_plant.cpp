// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/ros_plant.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>
#include <vector>

#include "assembly_cell/Ack.h"
#include "assembly_cell/align/contact_window.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/ros/conversions.h"
#include "assembly_cell/ros/locus_messages.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kQueue = 100;
constexpr std::size_t kMemory = 50;  // blocks that may be incomplete at a time

constexpr double kConnectionCheck = 5.0;  // wall clock [s]
constexpr char kWrenchA[] = "sensor_a/wrench_samples";
constexpr char kWrenchB[] = "sensor_b/wrench_samples";
constexpr char kDisplacementB[] = "sensor_b/displacement_samples";
constexpr char kCarrier[] = "carrier_pose";

/// Of 6 × n numbers, sample after sample. False when it isn't a block of finite numbers.
bool moments(const std::vector<double>& samples, BlockMoments& out) {
  const std::size_t n = samples.size() / 6;
  if (n == 0 || samples.size() != 6 * n) return false;
  out = momentsOf(samples.data(), n);
  return out.mean.allFinite() && out.covariance.allFinite();
}

/// End of a block: its last sample.
template <class Samples>
ros::Time endOf(const Samples& message, std::size_t values) {
  return message.header.stamp +
         ros::Duration(message.period * (static_cast<double>(values / 6) - 1.0));
}

}  // namespace

RosPlant::RosPlant(ros::NodeHandle& nh, bool lockstep, double timeout, double converter_step)
    : lockstep_(lockstep),
      timeout_(timeout),
      converter_step_(converter_step),
      nh_(nh),
      twin_force_(nh, {timeout, [this](double time) { return stampOf(time); },
                       [this] { return cancelled_ && cancelled_(); }}) {
  // the name that the simulator knows: relative to the cell's namespace
  name_ = ros::this_node::getName();
  const std::string ns = nh.getNamespace() == "/" ? "/" : nh.getNamespace() + "/";
  if (name_.compare(0, ns.size(), ns) == 0) name_ = name_.substr(ns.size());

  // latched, so that who connects late has the state of carrier and exciter
  command_pub_ = nh.advertise<geometry_msgs::PoseStamped>("carrier_command", kQueue, true);
  exciter_pub_ = nh.advertise<Exciter>("exciter", kQueue, true);
  if (lockstep_) ack_pub_ = nh.advertise<Ack>("ack", kQueue, true);
  for (const char* topic : {kWrenchA, kWrenchB, kDisplacementB, kCarrier}) subscribe(topic);
  const auto onCalibration = [this](std::optional<Matrix6>& rounding,
                                    const SensorCalibration& calibration) {
    using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
    const Matrix6 S = Eigen::Map<const RowMajor>(calibration.volts_to_wrench.data());
    std::lock_guard<std::mutex> lock(mutex_);
    rounding = roundingCovariance(S, converter_step_);
    changed_.notify_all();
  };
  calibration_a_sub_ = nh.subscribe<SensorCalibration>(
      "sensor_a/calibration", 1,
      [this, onCalibration](const auto& m) { onCalibration(rounding_a_, *m); });
  calibration_b_sub_ = nh.subscribe<SensorCalibration>(
      "sensor_b/calibration", 1,
      [this, onCalibration](const auto& m) { onCalibration(rounding_b_, *m); });
  if (lockstep_) {
    connection_timer_ = nh.createWallTimer(ros::WallDuration(kConnectionCheck),
                                           [this](const auto&) { checkConnections(); });
  }
  locus_client_ = std::make_unique<LocusClient>(nh, "identify_locus", false);
}

// ---- blocks ----

void RosPlant::subscribe(const std::string& topic) {
  const auto hints = ros::TransportHints().tcpNoDelay();
  ros::Subscriber& sub = subs_[topic];
  if (topic == kWrenchA) sub = nh_.subscribe(topic, kQueue, &RosPlant::onWrenchA, this, hints);
  if (topic == kWrenchB) sub = nh_.subscribe(topic, kQueue, &RosPlant::onWrenchB, this, hints);
  if (topic == kCarrier) sub = nh_.subscribe(topic, kQueue, &RosPlant::onCarrierPose, this, hints);
  if (topic == kDisplacementB) {
    sub = nh_.subscribe(topic, kQueue, &RosPlant::onDisplacementB, this, hints);
  }
}

// A block that stays incomplete stops the lockstep: a connection was never made, or a message got
// lost with it. ROS doesn't try again; to subscribe anew does, and what is latched comes again.
void RosPlant::checkConnections() {
  std::vector<std::string> missing;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    const bool part_of_block = !parts_.empty() && (!done_ || parts_.rbegin()->first != *done_);
    const bool carrier_ahead =
        !carrier_poses_.empty() && carrier_poses_.back()->header.stamp > done_end_;
    const bool incomplete = part_of_block || carrier_ahead;
    const bool stuck = incomplete && incomplete_ && done_ == checked_;
    incomplete_ = incomplete;
    checked_ = done_;
    if (!stuck) return;
    const Parts parts = part_of_block ? parts_.rbegin()->second : Parts{};
    if (!parts.wrench_a) missing.emplace_back(kWrenchA);
    if (!parts.wrench_b) missing.emplace_back(kWrenchB);
    if (!parts.displacement_b) missing.emplace_back(kDisplacementB);
    if (!carrier_ahead) missing.emplace_back(kCarrier);
  }
  // without the lock: callbacks under way take it
  for (const std::string& topic : missing) {
    ROS_WARN("block incomplete: subscribing to %s anew", topic.c_str());
    subs_[topic].shutdown();
    subscribe(topic);
  }
}

void RosPlant::onWrenchA(const WrenchSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  parts_[message->sequence].wrench_a = message;
  assemble();
}

void RosPlant::onWrenchB(const WrenchSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  parts_[message->sequence].wrench_b = message;
  assemble();
}

void RosPlant::onDisplacementB(const DisplacementSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  parts_[message->sequence].displacement_b = message;
  assemble();
}

void RosPlant::onCarrierPose(const geometry_msgs::PoseStamped::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  carrier_poses_.push_back(message);
  if (carrier_poses_.size() > kMemory) carrier_poses_.pop_front();
  assemble();
}

void RosPlant::assemble() {
  while (parts_.size() > kMemory) parts_.erase(parts_.begin());
  for (auto it = parts_.begin(); it != parts_.end(); ++it) {
    const Parts& parts = it->second;
    if (!parts.wrench_a || !parts.wrench_b || !parts.displacement_b) continue;

    // the carrier's pose at the block's end
    const ros::Time end = endOf(*parts.wrench_b, parts.wrench_b->wrench.size());
    const ros::Duration tolerance(0.5 * parts.wrench_b->period);
    geometry_msgs::PoseStamped::ConstPtr carrier;
    for (const auto& pose : carrier_poses_) {
      if (pose->header.stamp >= end - tolerance && pose->header.stamp <= end + tolerance) {
        carrier = pose;
      }
    }
    if (!carrier) continue;

    Block block;
    block.sequence = it->first;
    block.end = carrier->header.stamp;
    BlockMoments a, b, d;
    bool good = moments(parts.wrench_a->wrench, a) && moments(parts.wrench_b->wrench, b) &&
                moments(parts.displacement_b->displacement, d);
    block.means.wrench_a = a.mean;
    block.means.wrench_b = b.mean;
    block.means.displacement_b = d.mean;
    block.means.covariance_a = a.covariance;
    block.means.covariance_b = b.covariance;
    block.means.samples = std::min(a.count, b.count);
    for (const auto* wrench : {&parts.wrench_a, &parts.wrench_b}) {
      for (const auto bits : (*wrench)->saturated) block.means.saturated |= bits != 0;
    }
    try {
      block.X_BC = fromPose(carrier->pose, "carrier_pose");
    } catch (const InputError& error) {
      good = false;
    }
    // a repetition of a latched message makes no new block
    const bool repeated = done_ && *done_ == block.sequence;
    parts_.erase(parts_.begin(), std::next(it));
    while (!carrier_poses_.empty() && carrier_poses_.front()->header.stamp <= block.end) {
      carrier_poses_.pop_front();
    }
    if (repeated) return;
    done_ = block.sequence;
    done_end_ = block.end;
    pending_ack_ = block.sequence;
    if (good) {
      fresh_ = block;
    } else {
      ROS_ERROR_THROTTLE(1.0, "block %u is not one of finite samples: ignored", block.sequence);
    }
    if (!active_ || !good) acknowledge();
    changed_.notify_all();
    return;
  }
}

void RosPlant::acknowledge() {
  if (!pending_ack_) return;
  if (lockstep_) {
    Ack ack;
    ack.node = name_;
    ack.sequence = *pending_ack_;
    ack.commands = commands_;
    ack_pub_.publish(ack);
  }
  pending_ack_.reset();
}

// ---- the plant ----

void RosPlant::waitFor(std::unique_lock<std::mutex>& lock, const std::string& what,
                       const std::function<bool()>& ready) {
  const auto deadline = std::chrono::steady_clock::now() +
                        std::chrono::milliseconds(static_cast<std::int64_t>(timeout_ * 1e3));
  while (true) {
    if (!ros::ok()) throw PlantError(AlignFailure::kStopped, "the supervisor is shutting down");
    if (cancelled_ && cancelled_()) throw PlantError(AlignFailure::kCancelled, "cancelled");
    if (ready()) return;
    if (std::chrono::steady_clock::now() >= deadline) {
      throw PlantError(AlignFailure::kNoData, "no " + what + " within " +
                                                  std::to_string(static_cast<int>(timeout_)) +
                                                  " s of wall time" + twin_force_.complaint());
    }
    changed_.wait_for(lock, std::chrono::milliseconds(20));
  }
}

void RosPlant::begin(const std::function<bool()>& cancelled) {
  std::unique_lock<std::mutex> lock(mutex_);
  cancelled_ = cancelled;
  active_ = true;
  locus_wanted_ = false;
  fresh_.reset();
  last_ = Block{};
  origin_ = ros::Time();
  start_ = Pose{};
  waitFor(lock, "block of samples (is the simulator paused, or a driver missing?)",
          [this] { return fresh_.has_value(); });
  waitFor(lock, "calibration of sensor_a and sensor_b",
          [this] { return rounding_a_ && rounding_b_; });
  last_ = *fresh_;
  fresh_.reset();
  origin_ = last_.end;
  start_ = last_.X_BC;
}

PlantBlock RosPlant::next(const PlantCommand& command) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (cancelled_ && cancelled_()) throw PlantError(AlignFailure::kCancelled, "cancelled");
  if (command.rest) publishCarrier(poseFromRest(*command.rest));
  if (command.exciter) publishExciter(*command.exciter);
  if (command.locus) sendLocusGoal(lock, *command.locus);

  // blocks from before the commands are of no interest
  fresh_.reset();
  acknowledge();
  waitFor(lock, "block of samples (is the simulator paused, or a driver missing?)",
          [this] { return fresh_.has_value(); });
  last_ = *fresh_;
  fresh_.reset();
  PlantBlock block = plantBlock(last_);

  // the window of a reading has ended: its result comes with this block
  if (locus_wanted_ && block.time >= locus_end_) {
    waitFor(lock, "result of identify_locus", [this] { return locus_done_; });
    locus_wanted_ = false;
    if (!locus_error_.empty()) {
      throw PlantError(AlignFailure::kNoReading, "identify_locus: " + locus_error_);
    }
    block.locus = fromLocusEstimate(locus_result_->locus);
    if (!locus_result_->success) block.locus->refusal = locus_result_->message;
  }
  return block;
}

void RosPlant::end(bool hold) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (locus_wanted_) {
    // actionlib's locks come before ours
    lock.unlock();
    locus_client_->cancelGoal();
    lock.lock();
    locus_wanted_ = false;
  }
  if (exciter_.on) publishExciter(ExciterParameters{});
  if (hold && !last_.end.isZero()) publishCarrier(last_.X_BC);
  active_ = false;
  cancelled_ = nullptr;
  twin_force_.release();
  acknowledge();
}

ros::Time RosPlant::stamp() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return last_.end;
}

ros::Time RosPlant::stampOf(double time) const {
  std::lock_guard<std::mutex> lock(mutex_);
  return origin_ + ros::Duration(time);
}

double RosPlant::time() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return (last_.end - origin_).toSec();
}

Pose RosPlant::carrierMotion() const { return inverse(start_) * carrierPose(); }

Pose RosPlant::carrierPose() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return last_.X_BC;
}

PlantBlock RosPlant::plantBlock(const Block& block) const {
  PlantBlock out = block.means;
  out.rounding_a = rounding_a_.value_or(Matrix6::Zero());
  out.rounding_b = rounding_b_.value_or(Matrix6::Zero());
  out.time = (block.end - origin_).toSec();
  out.carrier = restFromPose(block.X_BC);
  return out;
}

// ---- commands ----

void RosPlant::publishCarrier(const Pose& X_BC) {
  ++commands_;
  command_pub_.publish(poseStamped(kCarrierBaseFrame, X_BC, last_.end));
}

void RosPlant::publishExciter(const ExciterParameters& drive) {
  exciter_ = Exciter();
  exciter_.header.stamp = last_.end;
  exciter_.header.frame_id = "peg";
  exciter_.on = drive.amplitude > 0.0;
  exciter_.amplitude = drive.amplitude;
  exciter_.frequency = drive.frequency;
  exciter_.phase = drive.phase;
  exciter_.direction = static_cast<std::int8_t>(drive.direction);
  ++commands_;
  exciter_pub_.publish(exciter_);
}

void RosPlant::sendLocusGoal(std::unique_lock<std::mutex>& lock, const LocusRequest& request) {
  waitFor(lock, "action server identify_locus (is the locus estimator running?)",
          [this] { return locus_client_->isServerConnected(); });
  IdentifyLocusGoal goal;
  goal.start = origin_ + ros::Duration(request.start);
  goal.duration = ros::Duration(request.duration);
  goal.exciter = exciter_;
  locus_wanted_ = true;
  locus_active_ = false;
  locus_done_ = false;
  locus_error_.clear();
  locus_end_ = request.start + request.duration - 1e-6;  // stamps are rounded to 1 ns
  // callbacks lock mutex_; actionlib has locks of its own
  lock.unlock();
  locus_client_->sendGoal(
      goal,
      [this](const actionlib::SimpleClientGoalState& state,
             const IdentifyLocusResult::ConstPtr& result) {
        std::lock_guard<std::mutex> guard(mutex_);
        locus_result_ = result;
        // one that is refused for its noise is a reading, too
        if (!result || (!result->success && result->locus.samples == 0)) {
          locus_error_ =
              result && !result->message.empty() ? result->message : "ended as " + state.toString();
        }
        locus_done_ = true;
        changed_.notify_all();
      },
      [this] {
        std::lock_guard<std::mutex> guard(mutex_);
        locus_active_ = true;
        changed_.notify_all();
      });
  lock.lock();
  // the estimator must know of the window before its first sample comes
  waitFor(lock, "acceptance of identify_locus", [this] { return locus_active_ || locus_done_; });
}

}  // namespace assembly_cell::ros_bridge
