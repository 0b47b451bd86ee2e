// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/ros_plant.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/vibration_fit.h"
#include "assembly_cell/mechanism/compliance.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/estimation/locus_messages.h"
#include "assembly_cell/ros/process/lockstep.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::size_t kMemory = 500;  // blocks that may be incomplete at a time
// Of blocks whose samples a window may begin in: the least number, and beyond it their age [s].
constexpr std::size_t kRecent = 25;
constexpr double kRecentTime = 0.499;
// of the default cell: ±5 V in 16 bit
constexpr double kConverterStep = 10.0 / 65536.0;

constexpr double kThinking =
    2.0;  // a strategy that says nothing for longer holds no plant [s wall]

constexpr const char* kWrenchA = kBlockTopics[0];
constexpr const char* kWrenchB = kBlockTopics[1];
constexpr const char* kDisplacementB = kBlockTopics[2];
constexpr std::size_t kCarrierPart = 3;
constexpr const char* kCarrier = kBlockTopics[kCarrierPart];

/// Of 6 × n numbers, sample after sample. False when it isn't a block of finite numbers.
bool moments(const std::vector<double>& samples, BlockMoments& out) {
  const std::size_t n = samples.size() / 6;
  if (n == 0 || samples.size() != 6 * n) return false;
  out = momentsOf(samples.data(), n);
  return out.mean.allFinite() && out.covariance.allFinite();
}

/// A bit for each channel that was at its limit in one of the samples.
std::uint8_t saturatedChannels(const WrenchSamples& message) {
  return std::accumulate(
      message.saturated.begin(), message.saturated.end(), std::uint8_t{0},
      [](std::uint8_t all, std::uint8_t bits) -> std::uint8_t { return all | bits; });
}

/// End of a block: its last sample.
template <class Samples>
ros::Time endOf(const Samples& message, std::size_t values) {
  return message.header.stamp +
         ros::Duration(message.period * (static_cast<double>(values / 6) - 1.0));
}

}  // namespace

RosPlant::RosPlant(ros::NodeHandle& nh, const Settings& settings)
    : settings_(settings),
      lockstep_(settings.lockstep),
      nh_(nh),
      clock_(!settings.lockstep),
      link_(nh, settings.node, settings.lockstep, [this] { changed_.notify_all(); }),
      twin_force_(
          nh, {settings.timeout, lockstep_ ? kProbe : settings.data_timeout * settings.slow_factor,
               questionTime(), [this](double time) { return stampOf(time); },
               [this] {
                 std::lock_guard<std::mutex> lock(mutex_);
                 alive_ = Steady::now();
                 return stopping_ || (cancelled_ && cancelled_());
               }}) {
  name_ = participantName(nh.getNamespace(), settings.node);

  // latched, so that who connects late has the state of carrier and exciter
  command_pub_ = nh.advertise<geometry_msgs::PoseStamped>("carrier_command", kQueue, true);
  exciter_pub_ = nh.advertise<Exciter>("exciter", kQueue, true);
  if (lockstep_) ack_pub_ = {nh, "ack", kQueue};
  subscribe();
  const auto onCalibration = [this](std::optional<Matrix6>& rounding, std::string& serial,
                                    const SensorCalibration& calibration) {
    using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
    const Matrix6 S = Eigen::Map<const RowMajor>(calibration.volts_to_wrench.data());
    std::lock_guard<std::mutex> lock(mutex_);
    rounding = roundingCovariance(S, settings_.converter_step);
    serial = calibration.serial_number;
    changed_.notify_all();
  };
  calibration_a_sub_ = subscribeChecked<SensorCalibration>(
      nh, "sensor_a/calibration", 1,
      [this, onCalibration](const auto& m) { onCalibration(rounding_a_, serial_a_, *m); });
  calibration_b_sub_ = subscribeChecked<SensorCalibration>(
      nh, "sensor_b/calibration", 1,
      [this, onCalibration](const auto& m) { onCalibration(rounding_b_, serial_b_, *m); });
  using Status = actionlib_msgs::GoalStatusArray;
  const boost::function<void(const ros::MessageEvent<Status const>&)> hear =
      [this](const auto& event) {
        std::lock_guard<std::mutex> lock(mutex_);
        locus_node_ = event.getPublisherName();
      };
  locus_status_sub_ = nh.subscribe<Status, const ros::MessageEvent<Status const>&>(
      "identify_locus/status", 1, hear);
  locus_client_ = std::make_unique<LocusClient>(nh, "identify_locus", false);
}

// ---- blocks ----

void RosPlant::subscribe() {
  // who sent it is asked for when it stays out
  const auto heard = [this](auto on, std::size_t part) {
    return [this, on, part](const auto& message, const std::string& node) {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (part == kCarrierPart && publishers_[part] != node) link_.isOf(node);
        publishers_[part] = node;
      }
      (this->*on)(message);
    };
  };
  block_subs_[0] = subscribeStream<WrenchSamples>(
      nh_, kWrenchA, kQueue, heard(&RosPlant::onWrenchA, 0), nullptr, lockstep_);
  block_subs_[1] = subscribeStream<WrenchSamples>(
      nh_, kWrenchB, kQueue, heard(&RosPlant::onWrenchB, 1), nullptr, lockstep_);
  block_subs_[2] = subscribeStream<DisplacementSamples>(
      nh_, kDisplacementB, kQueue, heard(&RosPlant::onDisplacementB, 2), nullptr, lockstep_);
  block_subs_[3] = subscribeStream<geometry_msgs::PoseStamped>(
      nh_, kCarrier, kQueue, heard(&RosPlant::onCarrierPose, 3), nullptr, lockstep_);
}

// Of the newest block, if it has begun to come in.
std::vector<std::string> RosPlant::missingParts() const {
  const bool part_of_block = !parts_.empty() && (!done_ || parts_.rbegin()->first != *done_);
  const Parts parts = part_of_block ? parts_.rbegin()->second : Parts{};
  const bool carrier_ahead =
      parts.wrench_b ? carrierAtEndOf(*parts.wrench_b) != nullptr
                     : !carrier_poses_.empty() && carrier_poses_.back()->header.stamp > done_end_;
  if (!part_of_block && !carrier_ahead) return {};
  std::vector<std::string> missing;
  if (!parts.wrench_a) missing.emplace_back(kWrenchA);
  if (!parts.wrench_b) missing.emplace_back(kWrenchB);
  if (!parts.displacement_b) missing.emplace_back(kDisplacementB);
  if (!carrier_ahead) missing.emplace_back(kCarrier);
  return missing;
}

void RosPlant::onWrenchA(const WrenchSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  seen(0);
  partsOf(message->sequence).wrench_a = message;
  assemble();
}

void RosPlant::onWrenchB(const WrenchSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  seen(1);
  partsOf(message->sequence).wrench_b = message;
  assemble();
}

void RosPlant::onDisplacementB(const DisplacementSamples::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  seen(2);
  partsOf(message->sequence).displacement_b = message;
  assemble();
}

void RosPlant::onCarrierPose(const geometry_msgs::PoseStamped::ConstPtr& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  seen(3);
  // another life of the plant in lockstep: its clock and the count of commands begin anew
  if (lockstep_ && message->header.stamp < done_end_) {
    commands_ = 0;
    done_.reset();
    done_end_ = ros::Time();
    carrier_poses_.clear();
    // what is commanded from now on is of this life: the plant counts it
    last_.end = message->header.stamp;
    link_.forget();
  }
  clock_.observe(wallTime(arrived_[3]), message->header.stamp.toSec());
  carrier_poses_.push_back(message);
  if (carrier_poses_.size() > kMemory) carrier_poses_.pop_front();
  assemble();
}

// In the order in which blocks begin to come in, whatever their numbers: what stays incomplete, a
// stranger's or one of a source that began anew, makes room in its turn.
RosPlant::Parts& RosPlant::partsOf(std::uint32_t sequence) {
  const auto known = std::find_if(parts_.begin(), parts_.end(), [sequence](const auto& entry) {
    return entry.first == sequence;
  });
  if (known != parts_.end()) return known->second;
  if (parts_.size() == kMemory) parts_.pop_front();
  return parts_.emplace_back(sequence, Parts{}).second;
}

geometry_msgs::PoseStamped::ConstPtr RosPlant::carrierAtEndOf(const WrenchSamples& block) const {
  const ros::Time end = endOf(block, block.wrench.size());
  const ros::Duration tolerance(0.5 * block.period);
  geometry_msgs::PoseStamped::ConstPtr carrier;
  for (const auto& pose : carrier_poses_) {
    if (pose->header.stamp >= end - tolerance && pose->header.stamp <= end + tolerance) {
      carrier = pose;
    }
  }
  return carrier;
}

void RosPlant::assemble() {
  for (auto it = parts_.begin(); it != parts_.end(); ++it) {
    const Parts& parts = it->second;
    if (!parts.wrench_a || !parts.wrench_b || !parts.displacement_b) continue;

    const geometry_msgs::PoseStamped::ConstPtr carrier = carrierAtEndOf(*parts.wrench_b);
    if (!carrier) continue;

    const std::uint32_t sequence = it->first;
    const ros::Time end = carrier->header.stamp;
    const Parts whole = parts;
    // a repetition of a latched message makes no new block
    const bool repeated = done_ && *done_ == sequence;
    parts_.erase(parts_.begin(), std::next(it));
    while (!carrier_poses_.empty() && carrier_poses_.front()->header.stamp <= end) {
      carrier_poses_.pop_front();
    }
    if (repeated) return;
    const auto now = Steady::now();
    const double interval = std::chrono::duration<double>(now - block_arrived_).count();
    block_interval_ = std::min(interval, last_interval_);
    last_interval_ = interval;
    block_arrived_ = now;
    done_ = sequence;
    done_end_ = end;
    pending_ack_ = sequence;
    if (!active_ || !take(whole, *carrier)) acknowledge();
    changed_.notify_all();
    return;
  }
}

// Of a block that somebody waits for. False where it isn't one of finite samples.
bool RosPlant::take(const Parts& parts, const geometry_msgs::PoseStamped& carrier) {
  Block block;
  block.sequence = parts.wrench_b->sequence;
  block.end = carrier.header.stamp;
  BlockMoments a, b, d;
  bool good = moments(parts.wrench_a->wrench, a) && moments(parts.wrench_b->wrench, b) &&
              moments(parts.displacement_b->displacement, d);
  block.means.wrench_a = a.mean;
  block.means.wrench_b = b.mean;
  block.means.displacement_b = compliance_ ? Vector6(*compliance_ * b.mean) : d.mean;
  block.means.covariance_a = a.covariance;
  block.means.covariance_b = b.covariance;
  block.means.samples = std::min(a.count, b.count);
  block.means.length = b.count * parts.wrench_b->period;
  block.saturated = {saturatedChannels(*parts.wrench_a), saturatedChannels(*parts.wrench_b)};
  block.means.saturated = block.saturated[0] != 0 || block.saturated[1] != 0;
  try {
    block.X_BC = fromPose(carrier.pose, "carrier_pose");
  } catch (const InputError& error) {
    good = false;
  }
  if (!good) {
    ROS_ERROR_THROTTLE(1.0, "block %u is not one of finite samples: ignored", block.sequence);
    return false;
  }
  const WrenchSamples::ConstPtr& samples = parts.wrench_b;
  recent_.push_back(samples);
  while (recent_.size() > kRecent &&
         (samples->header.stamp - recent_.front()->header.stamp).toSec() > kRecentTime) {
    recent_.pop_front();
  }
  if (vibration_.request) collect(*samples);
  fresh_ = block;
  // a strategy that hangs holds nothing
  const std::chrono::duration<double> silent = block_arrived_ - alive_;
  if (silent.count() < kThinking) link_.renew(block.end);
  return true;
}

void RosPlant::acknowledge() {
  if (!pending_ack_) return;
  if (lockstep_) {
    Ack ack;
    ack.node = name_;
    ack.sequence = *pending_ack_;
    ack.commands = commands_;
    ack.session = link_.session();
    ack_pub_.publish(ack);
  }
  pending_ack_.reset();
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
  return origin_.isZero() ? 0.0 : (last_.end - origin_).toSec();
}

bool RosPlant::hasMoved() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return moved_;
}

Pose RosPlant::carrierMotion() const { return inverse(start_) * carrierPose(); }

RestPose RosPlant::startPose() const { return restFromPose(start_); }

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
  if (locus_wanted_ || vibration_.request) out.reading_start = locus_start_;
  return out;
}

RosPlant::Settings plantSettings(Parameters& parameters, const std::string& node) {
  RosPlant::Settings s;
  s.node = node;
  s.converter_step = parameters.number("converter_step", kNotNegative, kConverterStep);
  s.lockstep = parameters.flag("lockstep", false);
  s.timeout = parameters.number("block_timeout", Range{0.1, 3600.0}, s.timeout);
  s.data_timeout = parameters.number("data_timeout", Range{0.05, 3600.0}, s.data_timeout);
  s.slow_factor = parameters.number("slow_factor", Range{1.0, 1000.0}, s.slow_factor);
  s.goal_time = parameters.number("goal_time", Range{1.0, 1e6}, s.goal_time);
  return s;
}

// ---- commands ----

void RosPlant::publishCarrier(const Pose& X_BC) {
  commanded_ = X_BC;
  moved_ = true;
  ++commands_;
  geometry_msgs::PoseStamped command = poseStamped(kCarrierBaseFrame, X_BC, last_.end);
  command.header.seq = commands_;
  publishShared(command_pub_, command);
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
  moved_ = true;
  ++commands_;
  const ExciterParameters asked = compensated(drive, drive_);
  Exciter command = exciter_;
  command.header.seq = commands_;
  command.amplitude = asked.amplitude;
  command.phase = asked.phase;
  publishShared(exciter_pub_, command);
}

// ---- vibrations ----

void RosPlant::know(const KnownMechanism* known) {
  std::lock_guard<std::mutex> lock(mutex_);
  drive_ = known != nullptr ? known->drive : DriveErrors();
  compliance_.reset();
  if (known != nullptr) compliance_ = couplingCompliance(known->mechanism.coupling);
}

void RosPlant::beginVibration(const LocusRequest& request) {
  vibration_ = {request, {}, {}};
  locus_duration_ = request.duration;
  locus_start_ = request.start;
  locus_end_ = request.start + request.duration - 1e-6;  // stamps are rounded to 1 ns
  for (const auto& samples : recent_) collect(*samples);
}

void RosPlant::collect(const WrenchSamples& samples) {
  const double start = (samples.header.stamp - origin_).toSec();
  const double reference = (exciter_.header.stamp - origin_).toSec();
  const LocusRequest& window = *vibration_.request;
  for (std::size_t i = 0; 6 * i < samples.wrench.size(); ++i) {
    const double t = start + static_cast<double>(i) * samples.period;
    const double since = t - window.start + kSampleRounding * samples.period;
    if (since < 0.0 || since >= window.duration) continue;
    vibration_.angles.push_back(exciter_.direction *
                                (exciter_.frequency * (t - reference) + exciter_.phase));
    const auto first = samples.wrench.begin() + static_cast<std::ptrdiff_t>(6 * i);
    vibration_.wrenches.insert(vibration_.wrenches.end(), first, first + 6);
  }
}

void RosPlant::sendLocusGoal(std::unique_lock<std::mutex>& lock, const LocusRequest& request) {
  waitFor(lock,
          "action server identify_locus" +
              (locus_node_.empty() ? " (is the locus estimator running?)" : " of " + locus_node_),
          [this] { return locus_client_->isServerConnected(); });
  IdentifyLocusGoal goal;
  // not before what is known of the cell
  const double start = std::max(request.start, (last_.end - origin_).toSec());
  goal.start = origin_ + ros::Duration(start);
  goal.duration = ros::Duration(request.duration);
  goal.exciter = exciter_;
  locus_wanted_ = true;
  locus_active_ = false;
  locus_done_ = false;
  locus_error_.clear();
  locus_duration_ = request.duration;
  locus_start_ = start;
  locus_end_ = start + request.duration - 1e-6;  // stamps are rounded to 1 ns
  // callbacks lock mutex_; actionlib has locks of its own
  lock.unlock();
  locus_client_->sendGoal(
      goal,
      [this](const actionlib::SimpleClientGoalState& state,
             const IdentifyLocusResult::ConstPtr& result) {
        std::lock_guard<std::mutex> guard(mutex_);
        locus_result_ = result;
        const std::string fault = result ? check(result->locus).text() : std::string();
        // one that is refused for its noise is a reading, too
        if (!result || (!result->success && result->locus.samples == 0)) {
          locus_error_ =
              result && !result->message.empty() ? result->message : "ended as " + state.toString();
        }
        if (!fault.empty()) locus_error_ = "locus: " + fault;
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
  waitFor(lock, "acceptance of identify_locus of " + locus_node_,
          [this] { return locus_active_ || locus_done_; });
}

}  // namespace assembly_cell::ros_bridge
