// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/arm/arm_bridge_node.h"

#include <assembly_cell/Lease.h>
#include <geometry_msgs/WrenchStamped.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr double kConnectionCheck = 5.0;  // wall clock [s]
constexpr int kMaxCallbacks = 100;        // before a point: a flood of messages doesn't delay it

std::uint32_t randomBootId() {
  std::random_device random;
  std::uint32_t id = 0;
  while (id == 0) id = random();
  return id;
}

StampNs nanoseconds(const ros::Time& stamp) { return static_cast<StampNs>(stamp.toNSec()); }

// The drivers announce the blocks here: an answer may be received before its block.
Participants participantsOf(const std::vector<std::string>& names, const ros::NodeHandle& nh) {
  Participants participants(names, nh.getNamespace());
  participants.expect(std::numeric_limits<std::uint32_t>::max());
  return participants;
}

template <class Message, class Callback>
ros::Subscriber subscribeEvents(ros::NodeHandle& nh, const std::string& topic, Callback callback) {
  using Event = ros::MessageEvent<Message const>;
  const std::string name = nh.resolveName(topic);
  const boost::function<void(const Event&)> receive = [callback, name](const Event& event) {
    guarded(name, [&] { callback(event); });
  };
  return nh.subscribe<Message, const Event&>(topic, kQueue, receive, ros::VoidConstPtr(),
                                             ros::TransportHints().tcpNoDelay());
}

}  // namespace

ArmBridgeSettings::ArmBridgeSettings(const ros::NodeHandle& nh, const ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  const Mechanism mechanism = loadMechanism(
      parameters.text("scenario"), parameters.texts("overrides", std::vector<std::string>{}));
  lockstep = parameters.flag("lockstep", false);
  real_time_factor = parameters.number("real_time_factor", Range{1e-3, 1e3}, 1.0);
  participants = parameters.texts("participants", std::vector<std::string>{});
  parameters.read(fieldsOf(bridge));
  guard = bridgeGuard(bridge, mechanism, bridge.lease, lockstep, "parameter ~");
  place = loadCellPlace(parameters.text("place"));
  payload = payloadOf(bridge, mechanism, place);
  const bool reads_joints = bridge.state == ArmStateSource::kJoints;
  if (!reads_joints && bridge.interface == ArmInterface::kJoints) {
    throw InputError(
        "parameter ~state is pose while ~interface is joints: joints need joint_states");
  }
  if (reads_joints) {
    const std::string urdf = Parameters(nh).text(bridge.description);
    kinematics = std::make_unique<ArmKinematics>(urdf, place.flange, bridge.description);
    if (bridge.base_frame.empty()) bridge.base_frame = kinematics->base();
    if (isAwayFromRoot(urdf, bridge.base_frame)) {
      throw InputError("parameter ~base_frame is \"" + bridge.base_frame +
                       "\", a link that is not at the root of the URDF: poses are those in its "
                       "root link " +
                       kinematics->base() + ", give that, or state: pose");
    }
  }
  if (bridge.base_frame.rfind('/', 0) == 0) {
    throw InputError("parameter ~base_frame is \"" + printable(bridge.base_frame) +
                     "\": names of frames have no leading slash, leave it out");
  }
  if (bridge.base_frame.empty()) {
    throw InputError("parameter ~base_frame is empty: give the frame of the arm's base");
  }
  parameters.refuseUnknown();
}

ArmBridgeNode::ArmBridgeNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh),
      settings_(nh, pnh),
      bridge_(settings_.guard, settings_.place, settings_.payload,
              NodeTime(settings_.lockstep, settings_.real_time_factor), randomBootId()),
      input_(
          ros::NodeHandle(nh, "arm").resolveName(
              settings_.bridge.state == ArmStateSource::kJoints ? "joint_states" : "current_pose"),
          settings_.bridge.base_frame, std::move(settings_.kinematics)),
      barrier_(settings_.bridge.limits.sensors),
      participants_(participantsOf(settings_.participants, nh)) {
  if (!settings_.lockstep) {
    for (ros::NodeHandle* handle : {&nh_, &pnh}) handle->setCallbackQueue(&queue_);
  }
  const BridgeSettings& bridge = settings_.bridge;
  output_ = std::make_unique<ArmOutput>(ros::NodeHandle(nh_, "arm"), bridge, settings_.place,
                                        input_.joints().kinematics());
  publisher_ = std::make_unique<ArmBridgePublisher>(nh_, pnh, settings_.lockstep);
  advertise(pnh);
  subscribe();
  if (bridge.publish_frames) publisher_->publishFrames(settings_.place, bridge.base_frame);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    publisher_->changes(bridge_);
  }
  ROS_INFO("%s: %.0f points a second, %s", pnh.getNamespace().c_str(), bridge.rate,
           settings_.lockstep ? "lockstep" : "by the wall clock");
  if (settings_.lockstep) return;
  // Messages are handled just before a point: none has an effect earlier. A service or timer that
  // throws doesn't cost the point.
  thread_.start(1.0 / (bridge.rate * settings_.real_time_factor), [this] {
    const ros::WallDuration at_once(0.0);
    guarded("callback", [&] {
      for (int i = 0; i < kMaxCallbacks; ++i) {
        if (queue_.callOne(at_once) != ros::CallbackQueue::Called) break;
      }
    });
    const std::lock_guard<std::mutex> lock(mutex_);
    if (bridge_.time().started()) point(bridge_.time().now());
  });
}

void ArmBridgeNode::advertise(ros::NodeHandle& pnh) {
  using Request = std_srvs::Trigger::Request;
  using Response = std_srvs::Trigger::Response;
  const auto stop = [this](const std::string& why) {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopForGood(bridge_.guard(), why);
    publisher_->changes(bridge_);
  };
  connections_.servers.push_back(
      pnh.advertiseService<Request, Response>("resume", [this](Request&, Response& response) {
        const std::lock_guard<std::mutex> lock(mutex_);
        const std::string why = resume(bridge_.guard(), bridge_.time().now());
        response.success = why.empty();
        response.message = why.empty() ? "the arm follows from where it is" : why;
        publisher_->changes(bridge_);
        return true;
      }));
  connections_.servers.push_back(
      pnh.advertiseService<Request, Response>("stop", [stop](Request&, Response& response) {
        stop("the service stop was called");
        response.success = true;
        response.message = "stopped: start the bridge again to move, in lockstep the whole cell";
        return true;
      }));
  connections_.subscribers.push_back(
      subscribeEvents<std_msgs::Bool>(pnh, "stop", [stop](const auto& event) {
        if (event.getConstMessage()->data) stop(event.getPublisherName() + " published stop");
      }));
  connections_.timers.push_back(nh_.createWallTimer(ros::WallDuration(0.5), [this](const auto&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    publisher_->diagnostics(bridge_, settings_.place.flange, output_->sent(), connections_.stuck);
  }));
  if (!settings_.lockstep) return;
  // ROS doesn't retry a connection that failed or was lost; latched messages are received again.
  connections_.timers.push_back(
      nh_.createWallTimer(ros::WallDuration(kConnectionCheck), [this](const auto&) {
        {
          const std::lock_guard<std::mutex> lock(mutex_);
          if (!barrier_.isStuck()) return;
          connections_.stuck = awaited();
        }
        ROS_WARN("block incomplete, it waits for %s: subscribing again",
                 connections_.stuck.c_str());
        subscribe();
      }));
}

void ArmBridgeNode::subscribe() {
  connections_.subscribers.resize(1);  // that of ~stop
  connections_.streams.clear();
  for (std::size_t sensor = firstSensor(settings_.bridge.limits.sensors); sensor < 2; ++sensor) {
    const std::string name = sensor == 0 ? "sensor_a" : "sensor_b";
    connections_.streams.push_back(
        subscribeStream<WrenchSamples>(nh_, name + "/wrench_samples", kQueue,
                                       [this, sensor](const auto& m) { onWrench(sensor, *m); }));
    connections_.subscribers.push_back(subscribeChecked<geometry_msgs::WrenchStamped>(
        nh_, name + "/bias", kQueue, [this, sensor](const auto& m) {
          const std::lock_guard<std::mutex> lock(mutex_);
          bridge_.setZero(sensor, fromWrench(m->wrench));
        }));
  }
  ros::NodeHandle arm_nh(nh_, "arm");
  if (settings_.bridge.state == ArmStateSource::kJoints) {
    connections_.subscribers.push_back(subscribeEvents<sensor_msgs::JointState>(
        arm_nh, "joint_states", [this](const auto& event) { onState(event); }));
  } else {
    connections_.subscribers.push_back(subscribeEvents<geometry_msgs::PoseStamped>(
        arm_nh, "current_pose", [this](const auto& event) { onState(event); }));
  }
  connections_.subscribers.push_back(subscribeEvents<geometry_msgs::PoseStamped>(
      nh_, "carrier_command", [this](const auto& event) { onCarrierCommand(event); }));
  connections_.subscribers.push_back(
      subscribeEvents<Exciter>(nh_, "exciter", [this](const auto& event) { onExciter(event); }));
  if (settings_.lockstep) {
    connections_.subscribers.push_back(
        subscribeEvents<Ack>(nh_, "ack", [this](const auto& event) { onAck(event); }));
  } else {
    connections_.subscribers.push_back(
        subscribeEvents<Lease>(nh_, "lease", [this](const auto& event) {
          const Lease& lease = *event.getConstMessage();
          const std::lock_guard<std::mutex> lock(mutex_);
          renew(event.getPublisherName(), nanoseconds(lease.header.stamp), lease.session);
        }));
  }
}

// ---- commands ----

void ArmBridgeNode::take(BlockBarrier::Task task) {
  const auto run = [this, command = std::move(task)] {
    command();
    publisher_->changes(bridge_);
  };
  if (!settings_.lockstep) {
    run();
    return;
  }
  barrier_.defer(run);
  endBlock();
}

void ArmBridgeNode::onCarrierCommand(
    const ros::MessageEvent<geometry_msgs::PoseStamped const>& event) {
  const geometry_msgs::PoseStamped command = *event.getConstMessage();
  const std::string node = event.getPublisherName();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!participants_.count(node, "carrier_command", command.header)) return;
  take([this, node, command] {
    GuardVerdict verdict;
    if (command.header.frame_id != kCarrierBaseFrame) {
      verdict = {GuardReason::kFrame, "frame_id: frame_id is \"" +
                                          printable(command.header.frame_id) + "\": give " +
                                          kCarrierBaseFrame};
    } else {
      try {
        verdict =
            bridge_.move(node, nanoseconds(command.header.stamp), fromPose(command.pose, "pose"));
      } catch (const InputError& error) {
        verdict = {GuardReason::kNotFinite, std::string("not_finite: ") + error.what()};
      }
    }
    if (!verdict.good()) publisher_->refuse("carrier_command", node, verdict);
  });
}

void ArmBridgeNode::onExciter(const ros::MessageEvent<Exciter const>& event) {
  Exciter command = *event.getConstMessage();
  const std::string node = event.getPublisherName();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!participants_.count(node, "exciter", command.header)) return;
  // off has no direction, frequency and phase
  if (!command.on && std::isfinite(command.amplitude)) {
    command.amplitude = command.frequency = command.phase = 0.0;
  }
  take([this, node, command] {
    const ExciterCommand wanted{command.amplitude, command.frequency, command.phase,
                                command.on ? command.direction : 1};
    const GuardVerdict verdict = bridge_.drive(node, nanoseconds(command.header.stamp), wanted);
    if (verdict.good()) {
      publisher_->exciter(command);
    } else {
      publisher_->refuse("exciter", node, verdict);
    }
  });
}

void ArmBridgeNode::renew(const std::string& node, StampNs stamp, std::uint32_t session) {
  const GuardVerdict verdict = bridge_.renew(node, stamp, session);
  // stale leases are received in bursts
  if (!verdict.good() && verdict.reason != GuardReason::kStale) {
    publisher_->refuse("lease", node, verdict);
  }
  publisher_->changes(bridge_);
}

void ArmBridgeNode::onAck(const ros::MessageEvent<Ack const>& event) {
  const Ack& ack = *event.getConstMessage();
  const std::string node = event.getPublisherName();
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string why = participants_.answer(ack, node);
  if (!why.empty()) {
    IncomingLog::ofThisProcess().refuse("ack", node, why);
    return;
  }
  // the answer renews the lease before the owner's commands are handled
  if (participants_.reportsSession(ack) && !barrier_.isFinished(ack.sequence)) {
    barrier_.deferFirst([this, node, session = ack.session] {
      renew(node, bridge_.time().stampAt(bridge_.time().now()), session);
    });
  }
  endBlock();
}

// ---- samples and states ----

void ArmBridgeNode::onWrench(std::size_t sensor, const WrenchSamples& samples) {
  const std::lock_guard<std::mutex> lock(mutex_);
  SensorBlock block;
  block.sensor = sensor;
  block.values = samples.wrench.data();
  block.count = samples.wrench.size() / 6;
  block.period = samples.period;
  block.end = nanoseconds(samples.header.stamp +
                          ros::Duration(samples.period * (static_cast<double>(block.count) - 1.0)));
  if (samples.saturated.size() == block.count) block.saturated = samples.saturated.data();
  const ArmBridge::Start start = bridge_.start(sensor, block.end);
  if (start == ArmBridge::Start::kWaiting) return;
  if (start == ArmBridge::Start::kRestarted) {
    barrier_.restart();
    participants_ = participantsOf(settings_.participants, nh_);
    publisher_->restart();
  }
  // a latched block may be received twice
  if (!barrier_.add(sensor, samples.sequence) && settings_.lockstep) return;
  bridge_.addBlock(block);
  if (sensor == 1) publisher_->block(samples.header, bridge_);
  publisher_->changes(bridge_);
  endBlock();
}

template <class Message>
void ArmBridgeNode::onState(const ros::MessageEvent<Message const>& event) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto state = input_.take(event);
  if (!state) {
    bridge_.guard().refusal = input_.refusal();
    return;
  }
  const ArmJoints& joints = input_.joints();
  const bool starts =
      bridge_.setState(state->X_base_flange, nanoseconds(state->stamp), joints.beyondLimit());
  // Not while it follows: a lagging arm would make the next point a jump of the joints.
  if (joints.kinematics() != nullptr && (starts || isHalted(bridge_.guard()))) {
    output_->setJoints(joints.positions());
  }
  publisher_->changes(bridge_);
  endBlock();
}

// ---- points ----

void ArmBridgeNode::point(double time) {
  ArmGuard& arm = bridge_.guard();
  tick(arm, time);
  if (arm.begun) {
    ros::Time stamp;
    stamp.fromNSec(static_cast<std::uint64_t>(bridge_.time().stampAt(time)));
    const std::string why = output_->send(arm.motion, arm.measured, stamp);
    if (!why.empty()) hold(arm, ArmReason::kUnreachable, why);
  }
  publisher_->changes(bridge_);
}

void ArmBridgeNode::endBlock() {
  const auto sequence = barrier_.complete();
  if (!settings_.lockstep || !sequence || bridge_.poses().pending()) return;
  if (!participants_.missing(*sequence).empty()) return;
  connections_.stuck.clear();
  for (const BlockBarrier::Task& task : barrier_.finish()) task();
  const double period = 1.0 / settings_.bridge.rate, length = bridge_.block().length;
  const auto count = static_cast<int>(std::ceil(length / period - 1e-6));
  for (int i = 1; i <= count; ++i) point(bridge_.block().end + std::min(i * period, length));
  publisher_->acknowledge(*sequence, bridge_);
}

std::string ArmBridgeNode::awaited() {
  const auto sequence = barrier_.complete();
  if (!sequence) return "the samples of sensor_a";
  if (bridge_.poses().pending()) {
    const std::string& why = input_.refusal();
    return "the arm's state at its end" + (why.empty() ? why : ": " + why);
  }
  const std::string nodes = participants_.missing(*sequence);
  if (nodes.empty()) return {};
  return "the answer of " + nodes + ": start it by that name, or give ~participants the names";
}

}  // namespace assembly_cell::ros_bridge
