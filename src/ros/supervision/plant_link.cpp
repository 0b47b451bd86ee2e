// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/plant_link.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/serialization.h>

#include <map>
#include <random>
#include <utility>

#include "assembly_cell/Exciter.h"
#include "assembly_cell/Lease.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/publish_shared.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr char kPlantRestarted[] = "the plant was restarted, or reset, during the goal";

std::uint32_t randomNumber() {
  std::random_device random;
  std::uint32_t number = 0;
  while (number == 0) number = random();
  return number;
}

// Owners of plants among the nodes of this process. They share one name, by which the plant's guard
// can't distinguish them.
struct Owners {
  std::mutex mutex;
  std::map<std::string, std::string> nodes;  // by the plant's name
};

Owners& ownersOfThisProcess() {
  static Owners owners;
  return owners;
}

// Owner of the plant in this process: `node`, if there was none.
std::string acquirePlant(const std::string& plant, const std::string& node) {
  Owners& owners = ownersOfThisProcess();
  const std::lock_guard<std::mutex> lock(owners.mutex);
  return owners.nodes.try_emplace(plant, node).first->second;
}

// False if another node of this process owns the plant.
bool releasePlant(const std::string& plant, const std::string& node) {
  Owners& owners = ownersOfThisProcess();
  const std::lock_guard<std::mutex> lock(owners.mutex);
  const auto owner = owners.nodes.find(plant);
  if (owner == owners.nodes.end()) return true;
  if (owner->second != node) return false;
  owners.nodes.erase(owner);
  return true;
}

// All but the header, which changes when the same values are sent again.
template <class Message>
std::string serialized(Message message) {
  message.header = std_msgs::Header();
  const std::uint32_t size = ros::serialization::serializationLength(message);
  std::string bytes(size, '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()), size);
  ros::serialization::serialize(stream, message);
  return bytes;
}

// By the plant's latest state. A session that was stopped owns nothing.
bool isFreeBy(const std::optional<PlantState>& state) {
  return !state || state->held || state->holder.empty() ||
         state->holder == ros::this_node::getName();
}

}  // namespace

// ---- disturbances ----

GoalDisturbances::GoalDisturbances(ros::NodeHandle& nh,
                                   std::function<void(const std::string&)> fault)
    : fault_(std::move(fault)) {
  watchCommands<geometry_msgs::PoseStamped>(nh, "carrier_command");
  watchCommands<Exciter>(nh, "exciter");
  for (const std::string sensor : {"sensor_a", "sensor_b"}) {
    watchConstant<geometry_msgs::WrenchStamped>(nh, sensor + "/bias", "zero of " + sensor);
    watchConstant<SensorCalibration>(nh, sensor + "/calibration", "calibration of " + sensor);
  }
}

template <class Message>
void GoalDisturbances::watchCommands(ros::NodeHandle& nh, const std::string& topic) {
  using Event = ros::MessageEvent<Message const>;
  const boost::function<void(const Event&)> receive = [this, topic](const Event& event) {
    const std::string& node = event.getPublisherName();
    if (node == ros::this_node::getName()) return;
    fault_(node + " published " + topic + " during the goal: no other node may command the plant");
  };
  subs_.push_back(nh.subscribe<Message, const Event&>(topic, kQueue, receive));
}

template <class Message>
void GoalDisturbances::watchConstant(ros::NodeHandle& nh, const std::string& topic,
                                     const std::string& what) {
  const auto receive = [this, what](const boost::shared_ptr<Message const>& message,
                                    const std::string& publisher) {
    {
      const std::string bytes = serialized(*message);
      const std::lock_guard<std::mutex> lock(mutex_);
      const auto [known, first] = constants_.try_emplace(what, bytes);
      if (first || known->second == bytes) return;
      known->second = bytes;
    }
    fault_(what + " changed during the goal, by a message of " + publisher + ": start it again");
  };
  subs_.push_back(subscribeChecked<Message>(nh, topic, kQueue, receive));
}

// ---- the session ----

PlantLink::PlantLink(ros::NodeHandle& nh, const std::string& node, bool lockstep,
                     std::function<void()> changed)
    : node_(node),
      plant_(nh.resolveName("plant_state")),
      lockstep_(lockstep),
      changed_(std::move(changed)),
      disturbances_(nh, [this](const std::string& fault) { setFault(fault); }) {
  if (!lockstep_) lease_pub_ = nh.advertise<Lease>("lease", kQueue);
  state_sub_ = subscribeChecked<PlantState>(
      nh, "plant_state", kQueue,
      [this](const PlantState::ConstPtr& state, const std::string& publisher) {
        onState(state, publisher);
      },
      ros::TransportHints().tcpNoDelay());
}

PlantLink::~PlantLink() { releasePlant(plant_, node_); }

void PlantLink::acquire() {
  std::string owner = acquirePlant(plant_, node_);
  const std::lock_guard<std::mutex> lock(mutex_);
  // commands of this goal would disturb the owner in another process
  if (owner == node_ && !isFreeBy(state_)) {
    owner = state_->holder;
    releasePlant(plant_, node_);
  }
  session_ = Session();
  if (owner != node_) {
    session_.fault = owner + " holds the plant";
    return;
  }
  session_.number = randomNumber();
  session_.boot_id = state_ ? state_->life : 0;
  session_.refused = state_ ? state_->refused : 0;
}

void PlantLink::beginMotion(const ros::Time& origin) {
  const std::lock_guard<std::mutex> lock(mutex_);
  session_.origin = origin;
}

void PlantLink::release() {
  const std::lock_guard<std::mutex> lock(mutex_);
  session_ = Session();
  const bool owned = releasePlant(plant_, node_);
  if (!lockstep_ && owned) lease_pub_.publish(Lease());
}

void PlantLink::renew(const ros::Time& stamp) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (lockstep_ || session_.number == 0) return;
  Lease lease;
  lease.header.stamp = stamp;
  lease.session = session_.number;
  publishShared(lease_pub_, lease);
}

PlantLink::Status PlantLink::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool is_obeyed =
      lockstep_ || !state_ || (state_->session == session_.number && !state_->held);
  return {session_.number, isFreeBy(state_), is_obeyed, session_.interrupted, session_.fault};
}

void PlantLink::setFault(const std::string& fault) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (session_.number == 0 || !session_.fault.empty()) return;
    session_.fault = fault;
  }
  changed_();
}

void PlantLink::clearInterruption() {
  const std::lock_guard<std::mutex> lock(mutex_);
  session_.interrupted = false;
}

// ---- the plant's state ----

void PlantLink::setPlantNode(const std::string& node) {
  const std::lock_guard<std::mutex> lock(mutex_);
  publishers_.carrier_pose = node;
  if (publishers_.state != node) state_.reset();
}

void PlantLink::onPlantRestart() {
  const std::lock_guard<std::mutex> lock(mutex_);
  state_.reset();
  session_.boot_id = 0;
  if (session_.origin && session_.fault.empty()) session_.fault = kPlantRestarted;
}

void PlantLink::onState(const PlantState::ConstPtr& state, const std::string& publisher) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::string why;
    if (publishers_.carrier_pose.empty()) {
      why = filter_.checkPublisher(publisher);
    } else if (publisher != publishers_.carrier_pose) {
      why = "the plant is " + publishers_.carrier_pose +
            ", which publishes carrier_pose: end the other publisher";
    }
    if (!why.empty()) {
      IncomingLog::ofThisProcess().refuse("plant_state", publisher, why);
      return;
    }
    const bool had_session = state_ && state_->session == session_.number;
    state_ = *state;
    publishers_.state = publisher;
    if (session_.number != 0 && session_.fault.empty()) checkSession(had_session);
  }
  changed_();
}

void PlantLink::checkSession(bool had_session) {
  const std::string& me = ros::this_node::getName();
  const std::string& reason = state_->refused_reason;
  // The state of a restart before the origin may arrive later than the blocks that followed it. A
  // plant that knows no time yet has just started.
  const ros::Time& stamp = state_->header.stamp;
  const bool is_early = !session_.origin || (!stamp.isZero() && stamp < *session_.origin);
  if (session_.boot_id == 0 || is_early) session_.boot_id = state_->life;
  // latched commands from before the plant's start belong to no goal
  const bool refused =
      state_->refused != session_.refused && state_->refused_node == me && reason != "earlier_boot";
  const bool late = reason == "stale" || reason == "held_by_another" || reason == "no_lease";
  const bool has_session = state_->session == session_.number;
  if (state_->life != session_.boot_id) {
    session_.fault = kPlantRestarted;
  } else if (!state_->holder.empty() && state_->holder != me) {
    session_.fault = state_->holder + " holds the plant";
  } else if (state_->overload && has_session) {
    session_.fault = "the plant stopped itself: " + state_->reason;
  } else if (refused && !late) {
    session_.fault = state_->refusal;
  }
  // the lease expired, or a command came too late
  const bool stopped = had_session && (!has_session || state_->held);
  if (!lockstep_ && (stopped || (refused && late))) session_.interrupted = true;
  session_.refused = state_->refused;
}

}  // namespace assembly_cell::ros_bridge
