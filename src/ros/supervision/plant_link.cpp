// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/plant_link.h"

#include <ros/serialization.h>

#include <map>
#include <random>
#include <utility>

#include "assembly_cell/Lease.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/publish_shared.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr char kAnotherLife[] = "the plant was started anew, or reset, during the goal";

std::uint32_t randomNumber() {
  std::random_device random;
  std::uint32_t number = 0;
  while (number == 0) number = random();
  return number;
}

// Nodes that share a process have one name, by which the plant's guard can't tell them apart. Who
// of them holds a plant is known here.
struct Holders {
  std::mutex mutex;
  std::map<std::string, std::string> nodes;  // by the plant's name
};

Holders& holdersOfThisProcess() {
  static Holders holders;
  return holders;
}

// The node of this process that holds the plant: from now on `node`, if there was none.
std::string hold(const std::string& plant, const std::string& node) {
  Holders& holders = holdersOfThisProcess();
  const std::lock_guard<std::mutex> lock(holders.mutex);
  return holders.nodes.try_emplace(plant, node).first->second;
}

// False when it was another node's to let go.
bool letGo(const std::string& plant, const std::string& node) {
  Holders& holders = holdersOfThisProcess();
  const std::lock_guard<std::mutex> lock(holders.mutex);
  const auto holder = holders.nodes.find(plant);
  if (holder == holders.nodes.end()) return true;
  if (holder->second != node) return false;
  holders.nodes.erase(holder);
  return true;
}

// all but the header: the same values sent again are no change
template <class Message>
std::string bytesOf(Message message) {
  message.header = std_msgs::Header();
  const std::uint32_t size = ros::serialization::serializationLength(message);
  std::string bytes(size, '\0');
  ros::serialization::OStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()), size);
  ros::serialization::serialize(stream, message);
  return bytes;
}

}  // namespace

PlantLink::PlantLink(ros::NodeHandle& nh, const std::string& holder, bool lockstep,
                     std::function<void()> changed)
    : node_(holder),
      plant_(nh.resolveName("plant_state")),
      lockstep_(lockstep),
      changed_(std::move(changed)) {
  if (!lockstep_) lease_pub_ = nh.advertise<Lease>("lease", kQueue);
  state_sub_ = subscribeChecked<PlantState>(
      nh, "plant_state", kQueue,
      [this](const PlantState::ConstPtr& state, const std::string& node) { onState(state, node); },
      ros::TransportHints().tcpNoDelay());
  command_sub_ = watchCommands<geometry_msgs::PoseStamped>(nh, "carrier_command");
  exciter_sub_ = watchCommands<Exciter>(nh, "exciter");
  for (const std::string sensor : {"sensor_a", "sensor_b"}) {
    watchConstant<geometry_msgs::WrenchStamped>(nh, sensor + "/bias", "zero of " + sensor);
    watchConstant<SensorCalibration>(nh, sensor + "/calibration", "calibration of " + sensor);
  }
}

PlantLink::~PlantLink() { letGo(plant_, node_); }

template <class Message>
ros::Subscriber PlantLink::watchCommands(ros::NodeHandle& nh, const std::string& topic) {
  using Event = ros::MessageEvent<Message const>;
  const boost::function<void(const Event&)> look = [this, topic](const Event& event) {
    onCommand(topic, event.getPublisherName());
  };
  return nh.subscribe<Message, const Event&>(topic, kQueue, look);
}

template <class Message>
void PlantLink::watchConstant(ros::NodeHandle& nh, const std::string& topic,
                              const std::string& what) {
  constant_subs_.push_back(subscribeChecked<Message>(
      nh, topic, kQueue,
      [this, what](const auto& message) { onConstant(what, bytesOf(*message)); }));
}

// ---- the session ----

// By the plant's last word. Of one that has been stopped nobody can be said to hold it.
bool PlantLink::freeUnlocked() const {
  return !state_ || state_->held || state_->holder.empty() ||
         state_->holder == ros::this_node::getName();
}

bool PlantLink::isFree() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return freeUnlocked();
}

void PlantLink::begin() {
  std::string holder = hold(plant_, node_);
  const std::lock_guard<std::mutex> lock(mutex_);
  // another process: what this goal would send meanwhile would only disturb the other's
  if (holder == node_ && !freeUnlocked()) {
    holder = state_->holder;
    letGo(plant_, node_);
  }
  if (holder != node_) {
    session_ = 0;
    fault_ = holder + " holds the plant";
    return;
  }
  session_ = randomNumber();
  life_ = state_ ? state_->life : 0;
  refused_ = state_ ? state_->refused : 0;
  lost_ = false;
  moving_ = false;
  fault_.clear();
}

void PlantLink::forget() {
  const std::lock_guard<std::mutex> lock(mutex_);
  state_.reset();
  life_ = 0;
  if (moving_ && fault_.empty()) fault_ = kAnotherLife;
}

void PlantLink::move() {
  const std::lock_guard<std::mutex> lock(mutex_);
  moving_ = true;
}

void PlantLink::end() {
  const std::lock_guard<std::mutex> lock(mutex_);
  session_ = 0;
  moving_ = false;
  fault_.clear();
  const bool mine = letGo(plant_, node_);
  if (!lockstep_ && mine) lease_pub_.publish(Lease());
}

std::uint32_t PlantLink::session() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return session_;
}

void PlantLink::renew(const ros::Time& seen) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (lockstep_ || session_ == 0) return;
  Lease lease;
  lease.header.stamp = seen;
  lease.session = session_;
  publishShared(lease_pub_, lease);
}

std::optional<std::string> PlantLink::fault() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (fault_.empty()) return std::nullopt;
  return fault_;
}

bool PlantLink::lapsed() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return lost_;
}

bool PlantLink::followsUnlocked() const {
  return lockstep_ || !state_ || (state_->session == session_ && !state_->held);
}

bool PlantLink::follows() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return followsUnlocked();
}

void PlantLink::repeated() {
  const std::lock_guard<std::mutex> lock(mutex_);
  lost_ = false;
}

// ---- what is heard ----

void PlantLink::isOf(const std::string& node) {
  const std::lock_guard<std::mutex> lock(mutex_);
  plant_node_ = node;
  if (state_node_ != node) state_.reset();
}

std::string PlantLink::judgeUnlocked(const std::string& node) {
  if (plant_node_.empty()) return door_.judgePublisher(node);
  if (node == plant_node_) return {};
  return "the plant is " + plant_node_ + ", which publishes carrier_pose: end the other publisher";
}

void PlantLink::onState(const PlantState::ConstPtr& state, const std::string& node) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string why = judgeUnlocked(node);
    if (!why.empty()) {
      IncomingLog::ofThisProcess().refuse("plant_state", node, why);
      return;
    }
    const bool held_before = state_ && state_->session == session_;
    state_ = *state;
    state_node_ = node;
    const std::string& me = ros::this_node::getName();
    if (session_ != 0 && fault_.empty()) {
      if (life_ == 0 || !moving_) life_ = state->life;
      // a command that is kept from before the plant's start is of no goal
      const bool mine = state->refused != refused_ && state->refused_node == me &&
                        state->refused_reason != "earlier_boot";
      const bool late = state->refused_reason == "stale" ||
                        state->refused_reason == "held_by_another" ||
                        state->refused_reason == "no_lease";
      if (state->life != life_) {
        fault_ = kAnotherLife;
      } else if (!state->holder.empty() && state->holder != me) {
        fault_ = state->holder + " holds the plant";
      } else if (state->overload && state->session == session_) {
        fault_ = "the plant stopped itself: " + state->reason;
      } else if (mine && !late) {
        fault_ = state->refusal;
      }
      // lapsed, let go after a lapse, or a command that came late
      if (!lockstep_ && ((held_before && !followsUnlocked()) || (mine && late))) lost_ = true;
      refused_ = state->refused;
    }
  }
  changed_();
}

void PlantLink::onCommand(const std::string& topic, const std::string& node) {
  if (node == ros::this_node::getName()) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (session_ == 0 || !fault_.empty()) return;
    fault_ = node + " published " + topic + " during the goal: nobody else may command the plant";
  }
  changed_();
}

void PlantLink::onConstant(const std::string& what, const std::string& bytes) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto [known, first] = constants_.try_emplace(what, bytes);
    if (first || known->second == bytes) return;
    known->second = bytes;
    if (session_ == 0 || !fault_.empty()) return;
    fault_ = what + " changed during the goal: start it again";
  }
  changed_();
}

}  // namespace assembly_cell::ros_bridge
