// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/arm/arm_bridge_node.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"

// What comes in at the bridge: commands, leases, answers, samples, and the arm's own word.
namespace assembly_cell::ros_bridge {

namespace {

constexpr double kMemory = 1.0;  // of the arm's states [s]
constexpr double kStamp = 1e-6;  // rounding of stamps [s]

template <class Message, class Owner>
ros::Subscriber subscribeEvents(ros::NodeHandle& nh, const std::string& topic, Owner* owner,
                                void (Owner::*on)(const ros::MessageEvent<Message const>&)) {
  using Event = ros::MessageEvent<Message const>;
  const std::string name = nh.resolveName(topic);
  const boost::function<void(const Event&)> receive = [owner, on, name](const Event& event) {
    guarded(name, [&] { (owner->*on)(event); });
  };
  return nh.subscribe<Message, const Event&>(topic, kQueue, receive, ros::VoidConstPtr(),
                                             ros::TransportHints().tcpNoDelay());
}

}  // namespace

// At the start, and anew where a lockstep stands still.
void ArmBridgeNode::subscribe() {
  const char* const sensors[] = {"sensor_a", "sensor_b"};
  for (std::size_t i = 0; i < 2; ++i) {
    wrench_subs_[i].shutdown();
    wrench_subs_[i] =
        subscribeStream<WrenchSamples>(nh_, std::string(sensors[i]) + "/wrench_samples", kQueue,
                                       [this, i](const auto& m) { onWrench(i, *m); });
    bias_subs_[i].shutdown();
    bias_subs_[i] = subscribeChecked<geometry_msgs::WrenchStamped>(
        nh_, std::string(sensors[i]) + "/bias", kQueue,
        [this, i](const auto& m) { onBias(i, *m); });
  }
  state_sub_.shutdown();
  if (joint_state_) {
    state_sub_ = subscribeStream<sensor_msgs::JointState>(arm_nh_, "joint_states", kQueue,
                                                          [this](const auto& m) { onJoints(*m); });
  } else {
    state_sub_ = subscribeStream<geometry_msgs::PoseStamped>(
        arm_nh_, "current_pose", kQueue, [this](const auto& m) {
          const std::lock_guard<std::mutex> lock(mutex_);
          onState(fromPose(m->pose, "current_pose"), m->header.stamp);
        });
  }
  command_sub_.shutdown();
  command_sub_ = subscribeEvents(nh_, "carrier_command", this, &ArmBridgeNode::onCarrierCommand);
  exciter_sub_.shutdown();
  exciter_sub_ = subscribeEvents(nh_, "exciter", this, &ArmBridgeNode::onExciter);
  if (lockstep_) {
    ack_sub_.shutdown();
    ack_sub_ = subscribeEvents(nh_, "ack", this, &ArmBridgeNode::onAck);
  } else {
    lease_sub_ = subscribeEvents(nh_, "lease", this, &ArmBridgeNode::onLease);
  }
}

// ---- commands ----

template <class Message>
Sender ArmBridgeNode::senderOf(const ros::MessageEvent<Message const>& event) const {
  const ros::Time& stamp = event.getConstMessage()->header.stamp;
  return {event.getPublisherName(), nodeTime(stamp), !stamp.isZero(), false};
}

// What publishers keep comes in before the first sample and the arm's first word.
bool ArmBridgeNode::isFromEarlierBoot(const Sender& sender) const {
  return epoch_.isZero() || !arm_.begun || sender.stamp < -kStamp;
}

void ArmBridgeNode::act(const std::function<void()>& task) {
  if (lockstep_) {
    waiting_.push_back(task);
    endBlock();
  } else {
    task();
  }
}

void ArmBridgeNode::refuse(const std::string& what, const std::string& node,
                           const GuardVerdict& why) {
  ++refused_;
  refused_node_ = node;
  refusal_ = {why.reason, what + " of " + node + " refused: " + why.text};
  ROS_WARN_THROTTLE(1.0, "%s", refusal_.text.c_str());
  publishState();
}

void ArmBridgeNode::onCarrierCommand(
    const ros::MessageEvent<geometry_msgs::PoseStamped const>& event) {
  const geometry_msgs::PoseStamped command = *event.getConstMessage();
  const std::lock_guard<std::mutex> lock(mutex_);
  const Sender sender = senderOf(event);
  if (!participants_.count(sender.node, "carrier_command", command.header)) return;
  act([this, sender, command] { take(sender, command); });
}

void ArmBridgeNode::take(const Sender& sender, const geometry_msgs::PoseStamped& command) {
  const auto no = [&](GuardReason reason, const std::string& why) {
    refuse("carrier_command", sender.node, {reason, std::string(toString(reason)) + ": " + why});
  };
  if (command.header.frame_id != kCarrierBaseFrame) {
    no(GuardReason::kFrame,
       "frame_id is \"" + printable(command.header.frame_id) + "\": give " + kCarrierBaseFrame);
    return;
  }
  if (!sender.stamped) {
    no(GuardReason::kStale, "it has no stamp: give header.stamp");
    return;
  }
  if (isFromEarlierBoot(sender)) {
    no(GuardReason::kEarlierBoot, "it is older than this run of the bridge: send it anew");
    return;
  }
  try {
    const GuardVerdict verdict = move(arm_, sender, fromPose(command.pose, "pose"), now());
    if (!verdict.good()) refuse("carrier_command", sender.node, verdict);
  } catch (const InputError& error) {
    no(GuardReason::kNotFinite, error.what());
  }
}

void ArmBridgeNode::onExciter(const ros::MessageEvent<Exciter const>& event) {
  const Exciter exciter = *event.getConstMessage();
  const std::lock_guard<std::mutex> lock(mutex_);
  const Sender sender = senderOf(event);
  if (!participants_.count(sender.node, "exciter", exciter.header)) return;
  act([this, sender, exciter] { take(sender, exciter); });
}

void ArmBridgeNode::take(const Sender& sender, const Exciter& exciter) {
  ExciterCommand drive_command{exciter.amplitude, exciter.frequency, exciter.phase,
                               exciter.direction};
  // what is off may have any direction
  const bool off = !exciter.on && std::isfinite(exciter.amplitude);
  if (off) drive_command = ExciterCommand();
  GuardVerdict verdict;
  if (!sender.stamped && !off) {
    verdict = {GuardReason::kStale, "stale: it has no stamp: give header.stamp"};
  } else if (isFromEarlierBoot(sender) && !off) {
    verdict = {GuardReason::kEarlierBoot,
               "earlier_life: it is older than this run of the bridge: send it anew"};
  } else {
    verdict = drive(arm_, sender, drive_command, now());
  }
  if (verdict.good()) {
    Exciter passed = exciter;
    // whatever else it said
    if (off) passed.amplitude = passed.frequency = passed.phase = 0.0;
    publishExciter(passed);
    publishState();
  } else {
    refuse("exciter", sender.node, verdict);
  }
}

void ArmBridgeNode::renewFor(const Sender& sender, std::uint32_t session) {
  const GuardVerdict verdict = renew(arm_, sender, session, now());
  // late ones come in heaps; others once a block
  if (!verdict.good() && verdict.reason != GuardReason::kStale) {
    refused_node_ = sender.node;
    refusal_ = {verdict.reason, "lease of " + sender.node + " refused: " + verdict.text};
    ROS_WARN_THROTTLE(1.0, "%s", refusal_.text.c_str());
  }
  watchExciter();
  publishState();
}

void ArmBridgeNode::onLease(const ros::MessageEvent<Lease const>& event) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!arm_.begun) return;
  renewFor(senderOf(event), event.getConstMessage()->session);
}

void ArmBridgeNode::onAck(const ros::MessageEvent<Ack const>& event) {
  const Ack& ack = *event.getConstMessage();
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string why = participants_.answer(ack, event.getPublisherName());
  if (!why.empty()) {
    IncomingLog::ofThisProcess().refuse("ack", event.getPublisherName(), why);
    return;
  }
  // the answer is the holder's sign of life, before what it commanded
  if (participants_.speaksOfSession(ack) && (!done_ || ack.sequence != *done_)) {
    const std::string node = event.getPublisherName();
    const std::uint32_t session = ack.session;
    waiting_.insert(waiting_.begin(), [this, node, session] {
      renewFor({node, now(), true, false}, session);
    });
  }
  endBlock();
}

bool ArmBridgeNode::onResume(std_srvs::Trigger::Response& response) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string why = resume(arm_, now());
  response.success = why.empty();
  response.message = why.empty() ? "the arm follows from where it is" : why;
  publishState();
  return true;
}

void ArmBridgeNode::onStop(const std::string& who) {
  const std::lock_guard<std::mutex> lock(mutex_);
  stopForGood(arm_, who);
  watchExciter();
  publishState();
}

// ---- samples and states ----

// The sensors' clock went back: a cell that began anew.
void ArmBridgeNode::anotherLife(const ros::Time& stamp) {
  const bool stopped = arm_.mode == ArmMode::kStopped;
  const std::string why = arm_.text;
  arm_ = new_arm_;
  if (stopped) stopForGood(arm_, why);
  ++life_;
  epoch_ = stamp;
  states_.clear();
  poses_wanted_.clear();
  waiting_.clear();
  pose_told_ = ros::Time();
  done_.reset();
  sequence_[1].reset();
  participants_ = Participants(participant_names_, nh_.getNamespace());
  participants_.expect(std::numeric_limits<std::uint32_t>::max());
  drives_ = 0;
  driving_ = false;
}

Vector6 ArmBridgeNode::weightChange() const {
  const Eigen::Vector3d down =
      -gravity_ * payload_mass_ * output_settings_.place.carrierBase().R.row(2).transpose();
  const Eigen::Matrix3d now = poseOfCoordinates(arm_.measured).R;
  Vector6 change;
  change.head<3>() = now.transpose() * down - zero_turn_.transpose() * down;
  change.tail<3>() = payload_centre_.cross(change.head<3>());
  return change;
}

void ArmBridgeNode::onBias(std::size_t sensor, const geometry_msgs::WrenchStamped& bias) {
  const std::lock_guard<std::mutex> lock(mutex_);
  zeros_[sensor] = fromWrench(bias.wrench);
  if (sensor == 1 && arm_.state_known) zero_turn_ = poseOfCoordinates(arm_.measured).R;
}

void ArmBridgeNode::onWrench(std::size_t sensor, const WrenchSamples& samples) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::size_t count = samples.wrench.size() / 6;
  const ros::Time end =
      samples.header.stamp + ros::Duration(samples.period * (static_cast<double>(count) - 1.0));
  if (epoch_.isZero()) {
    // A cell isn't led before both sensors are heard: the watchdog would end its goal at once.
    heard_[sensor] = true;
    if (!lockstep_ && !(heard_[0] && heard_[1])) return;
    epoch_ = end;
  }
  if (sensor == 1 && nodeTime(end) < block_end_ - kStamp) anotherLife(end);
  if (sequence_[sensor] == samples.sequence && lockstep_) return;  // latched, again
  sequence_[sensor] = samples.sequence;
  ContactSamples felt;
  felt.sensor = static_cast<int>(sensor);
  felt.values = samples.wrench.data();
  felt.count = count;
  felt.period = samples.period;
  felt.end = nodeTime(end);
  felt.zero = zeros_[sensor];
  if (samples.saturated.size() == count) felt.saturated = samples.saturated.data();
  if (sensor == 1 && payload_mass_ > 0.0) {
    const Vector6 change = weightChange();
    felt_ = samples.wrench;
    for (std::size_t i = 0; i < felt_.size(); ++i) {
      felt_[i] -= change(static_cast<Eigen::Index>(i % 6));
    }
    felt.values = felt_.data();
    felt.zero += change;
  }
  addSamples(arm_, felt);
  if (sensor == 1) {
    clock_.observe(wall(), end.toSec());
    block_end_ = felt.end;
    block_length_ = static_cast<double>(count) * samples.period;
    poses_wanted_.push_back(end);
    if (poses_wanted_.size() > kQueue) poses_wanted_.pop_front();
    if (wrench_pub_.getNumSubscribers() > 0) {
      geometry_msgs::WrenchStamped contact;
      contact.header.stamp = end;
      contact.header.frame_id = samples.header.frame_id;
      contact.wrench = toWrench(arm_.wrench[1]);
      wrench_pub_.publish(contact);
    }
    if (!lockstep_) showLife(end);
    tellPoses();
  }
  watchExciter();
  publishState();
  endBlock();
}

void ArmBridgeNode::onJoints(const sensor_msgs::JointState& joints) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::vector<std::string>& names = kinematics_->names();
  JointVector q(kinematics_->joints());
  for (std::size_t k = 0; k < names.size(); ++k) {
    const auto found = std::find(joints.name.begin(), joints.name.end(), names[k]);
    // other joints of the same robot may come in messages of their own
    if (found == joints.name.end()) return;
    q(static_cast<Eigen::Index>(k)) =
        joints.position[static_cast<std::size_t>(found - joints.name.begin())];
  }
  // What follows begins where it stands. Not while it is led: an arm that lags behind its last
  // point would make the next one a jump of the joints.
  if (!arm_.begun || isHalted(arm_)) output_->setJoints(q);
  // an arm at rest reads the same again
  if (!joints_seen_ || q != *joints_seen_) {
    joints_seen_ = q;
    X_base_flange_ = kinematics_->forward(q);
  }
  onState(X_base_flange_, joints.header.stamp);
}

void ArmBridgeNode::onState(const Pose& X_base_flange, const ros::Time& stamp) {
  // without a clock of the cell there is no time to compare with
  if (epoch_.isZero() || !(lockstep_ || (arm_.wrench_known[0] && arm_.wrench_known[1]))) return;
  const Pose X = output_settings_.place.carrierOf(X_base_flange);
  setState(arm_, X, nodeTime(stamp));
  states_.push_back({stamp, arm_.measured});
  while (nodeTime(stamp) - nodeTime(states_.front().stamp) > kMemory) states_.pop_front();
  tellPoses();
  publishState();
  endBlock();
}

// A simulator whose carrier goes through an arm takes its exciter from here: off without this.
void ArmBridgeNode::showLife(const ros::Time& seen) {
  Lease lease;
  lease.header.stamp = seen;
  lease.session = life_;
  lease_pub_.publish(lease);
}

// Between the two states of the arm round a block's end. A block waits for the second.
void ArmBridgeNode::tellPoses() {
  while (!poses_wanted_.empty() && !states_.empty()) {
    const ros::Time wanted = poses_wanted_.front();
    const double time = nodeTime(wanted);
    if (nodeTime(states_.back().stamp) < time - kStamp) return;
    poses_wanted_.pop_front();
    const auto after = std::find_if(states_.begin(), states_.end(), [&](const State& state) {
      return nodeTime(state.stamp) >= time - kStamp;
    });
    Vector6 x = after->carrier;
    const double ahead = nodeTime(after->stamp) - time;
    if (after != states_.begin() && ahead > kStamp) {
      const State& before = *std::prev(after);
      const double between = nodeTime(after->stamp) - nodeTime(before.stamp);
      x += ahead / between * (before.carrier - after->carrier);
    }
    const Pose X = poseOfCoordinates(x);
    carrier_pub_.publish(poseStamped(kCarrierBaseFrame, X, wanted));
    if (publish_frames_) {
      tf_.sendTransform(transformStamped(kCarrierBaseFrame, kCarrierFrame, X, wanted));
    }
    pose_told_ = wanted;
  }
}

}  // namespace assembly_cell::ros_bridge
