// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/cell_player.h"

#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/StrainSamples.h>
#include <assembly_cell/WrenchSamples.h>
#include <rosgraph_msgs/Clock.h>
#include <signal.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>

#include <algorithm>
#include <boost/algorithm/string/predicate.hpp>
#include <boost/algorithm/string/split.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/bag_check.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/process/master_call.h"
#include "assembly_cell/ros/process/participants.h"
#include "assembly_cell/sensor/reception.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr std::uint32_t kPlayQueue = 1000;
constexpr auto kOthersPatience = std::chrono::seconds(5);
constexpr double kCallPatience = 1.0;  // [s]
constexpr auto kRepetitionPatience = std::chrono::seconds(5);

// the sequence of a block of samples, if the message is one
std::optional<std::uint32_t> blockSequence(const rosbag::MessageInstance& message) {
  if (const auto b = message.instantiate<WrenchSamples>()) return b->sequence;
  if (const auto b = message.instantiate<DisplacementSamples>()) return b->sequence;
  if (const auto b = message.instantiate<StrainSamples>()) return b->sequence;
  return std::nullopt;
}

// Bytes as they were recorded. `has_header` stays false, as this constructor sets it (the default
// one doesn't): ROS would read a header from any message and restart its count.
ros::AdvertiseOptions optionsOf(const rosbag::ConnectionInfo& connection,
                                const std::string& topic) {
  ros::AdvertiseOptions options(topic, kPlayQueue, connection.md5sum, connection.datatype,
                                connection.msg_def);
  // who connects late must not miss the first one
  options.latch = true;
  return options;
}

// the name in the bag: relative to the recorded cell, unless it begins with a slash
std::string recordedName(const std::string& space, const std::string& topic) {
  return topic[0] == '/' ? topic : ros::names::append(space, topic);
}

// topic and listener of each connection that `node` has by its own word
std::set<std::pair<std::string, std::string>> connectionsOf(const std::string& node) {
  std::set<std::pair<std::string, std::string>> connections;
  const auto address = callMaster("lookupNode", node, kCallPatience);
  if (!address) return connections;
  if (auto list = callNode(XmlRpc::XmlRpcValue(*address), "getBusInfo", "", kCallPatience)) {
    for (int i = 0; i < list->size(); ++i) connections.emplace((*list)[i][4], (*list)[i][1]);
  }
  return connections;
}

}  // namespace

void fields(FieldList& f, PlayerSettings& s) {
  f.text("bag", s.bag, "Bag file.").required();
  f.text("recorded_namespace", s.recorded_namespace, "Namespace of the cell in the bag.");
  f.choice("rate", s.rate, {"original", "fast"},
           "original: by the recorded stamps; fast: as fast as the participants follow.");
  f.number("factor", s.factor, {1e-3, 1e3},
           "Recorded seconds per second of the wall clock, with the original rate.");
  f.flag("clock", s.clock, "Publishes /clock.");
  f.flag("end_launch", s.end_launch,
         "Ends the roslaunch that has started it, as Ctrl-C does, when the bag is over.");
  f.number("ack_timeout", s.ack_timeout, {0.01, 3600, "s"},
           "Longest wait for an answer, wall clock; then the node ends.");
  f.number("start_timeout", s.start_timeout, {0.01, 3600, "s"},
           "The same for all connections at the start.");
}

CellPlayer::CellPlayer(const ros::NodeHandle& nh, const ros::NodeHandle& pnh) : nh_(nh), pnh_(pnh) {
  readParameters();
  openBag();
  if (settings_.clock) clock_pub_ = nh_.advertise<rosgraph_msgs::Clock>("/clock", kPlayQueue);
  ack_sub_ = nh_.subscribe("ack", kPlayQueue, &CellPlayer::onAck, this,
                           ros::TransportHints().tcpNoDelay());
  thread_ = std::thread([this] { play(); });
}

CellPlayer::~CellPlayer() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  answered_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void CellPlayer::readParameters() {
  Parameters parameters(pnh_);
  parameters.read(fieldsOf(settings_));
  if (settings_.bag.empty()) {
    throw InputError("parameter " + pnh_.resolveName("bag") +
                     " is empty: give the bag to play, for example bag:=/tmp/run.bag");
  }
  settings_.topics = parameters.texts("topics");
  settings_.topics.erase(
      std::remove(settings_.topics.begin(), settings_.topics.end(), std::string()),
      settings_.topics.end());
  for (const std::string& entry : parameters.texts("participants", std::vector<std::string>{})) {
    const std::size_t place = entry.find('=');
    Participant participant;
    participant.name = entry.substr(0, place);
    std::vector<std::string> topics;
    if (place != std::string::npos) {
      boost::split(topics, entry.substr(place + 1), [](char c) { return c == '+'; });
    }
    if (participant.name.empty() || topics.empty() || topics[0].empty()) {
      throw InputError("parameter " + pnh_.resolveName("participants") + " has '" + entry +
                       "': give node=topic whose blocks it acknowledges, or node=topic+topic");
    }
    for (const std::string& topic : topics) {
      if (std::find(settings_.topics.begin(), settings_.topics.end(), topic) ==
          settings_.topics.end()) {
        throw InputError("parameter " + pnh_.resolveName("participants") + " has '" + entry +
                         "': its topic '" + topic + "' is not among ~topics");
      }
      participant.topics.push_back(recordedName(settings_.recorded_namespace, topic));
    }
    participants_.push_back(participant);
  }
  parameters.refuseUnknown();
}

void CellPlayer::openBag() {
  if (std::filesystem::exists(settings_.bag))
    checkBag(settings_.bag, "bag '" + settings_.bag + "'");
  try {
    bag_.open(settings_.bag, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& error) {
    throw InputError("bag '" + settings_.bag + "' can't be read: " + error.what() +
                     ": give a bag that record.launch made, or mend it with `rosbag reindex`");
  }
  rosbag::View all(bag_);
  for (const std::string& topic : settings_.topics) {
    const std::string recorded = recordedName(settings_.recorded_namespace, topic);
    for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
      if (connection->topic != recorded || publishers_.count(recorded) != 0) continue;
      ros::AdvertiseOptions options = optionsOf(*connection, topic);
      publishers_[recorded] = nh_.advertise(options);
    }
  }
  for (const Participant& participant : participants_) {
    for (const std::string& recorded : participant.topics) {
      if (publishers_.count(recorded) != 0) continue;
      throw InputError("bag '" + settings_.bag + "' has no " + recorded + ", which " +
                       participant.name + " needs: record it, or set recorded_namespace");
    }
  }
  if (publishers_.empty()) {
    throw InputError("bag '" + settings_.bag + "' has none of ~topics: set recorded_namespace");
  }
}

// The roslaunch that has started this node is ended as by Ctrl-C: of a required node that ends by
// itself it would say that it has died. False where there is none.
bool CellPlayer::interruptLaunch() {
  const pid_t parent = getppid();
  std::ifstream file("/proc/" + std::to_string(parent) + "/cmdline");
  const std::string command{std::istreambuf_iterator<char>(file), {}};
  if (command.find("roslaunch") == std::string::npos) return false;
  return kill(parent, SIGINT) == 0;
}

void CellPlayer::play() {
  try {
    playAll();
    if (!stopping_) {
      ROS_INFO_NAMED("player", "the bag is over: %llu messages of its inputs played",
                     static_cast<unsigned long long>(played_));
    }
  } catch (const std::exception& error) {
    ROS_FATAL_NAMED("player", "cell_player: %s", error.what());
    exit_code_ = 1;
  }
  if (stopping_) return;
  if (!(settings_.end_launch && exit_code_ == 0 && interruptLaunch())) ros::requestShutdown();
}

void CellPlayer::playAll() {
  std::vector<std::string> names;
  for (const auto& entry : publishers_) names.push_back(entry.first);
  rosbag::View view(bag_, rosbag::TopicQuery(names));
  awaitConnections();
  const Clock::time_point start = Clock::now();
  const ros::Time first = view.getBeginTime();
  for (const rosbag::MessageInstance& message : view) {
    if (settings_.rate != "fast") {
      const std::chrono::duration<double> since((message.getTime() - first).toSec() /
                                                settings_.factor);
      std::unique_lock<std::mutex> lock(mutex_);
      answered_.wait_until(lock, start + std::chrono::duration_cast<Clock::duration>(since),
                           [this] { return stopping_.load(); });
    }
    if (stopping_) return;
    if (settings_.clock) publishClock(message.getTime());
    publish(message);
    ++played_;
  }
}

void CellPlayer::publish(const rosbag::MessageInstance& message) {
  const std::string& topic = message.getTopic();
  const std::optional<std::uint32_t> sequence = blockSequence(message);
  if (sequence && unsettled_) settle(topic);
  if (const auto frames = message.instantiate<tf2_msgs::TFMessage>();
      frames && boost::algorithm::ends_with(topic, "/tf_static")) {
    // several nodes have sent, this is one: who connects late must get all of it, not the last
    for (const auto& frame : frames->transforms) fixed_frames_[frame.child_frame_id] = frame;
    tf2_msgs::TFMessage all;
    for (const auto& entry : fixed_frames_) all.transforms.push_back(entry.second);
    publishers_[topic].publish(all);
  } else {
    publishers_[topic].publish(message);
  }
  if (sequence) {
    sequences_[topic] = *sequence;
    awaitAnswers(topic, *sequence);
    latest_.erase(topic);
    latest_.emplace(topic, message);
  } else {
    unsettled_ = true;
  }
}

void CellPlayer::publishClock(const ros::Time& time) {
  rosgraph_msgs::Clock clock;
  clock.clock = time;
  clock_pub_.publish(clock);
}

void CellPlayer::onAck(const ros::MessageEvent<Ack const>& event) {
  const Ack::ConstPtr ack = event.getConstMessage();
  const std::string node = participantNode(nh_.getNamespace(), ack->node);
  if (event.getPublisherName() != node) {
    IncomingLog::ofThisProcess().refuse("ack", event.getPublisherName(), "it isn't " + node);
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (Participant& participant : participants_) {
      if (participant.name != ack->node) continue;
      participant.sequence = ack->sequence;
      ++participant.answers;
    }
  }
  answered_.notify_all();
}

void CellPlayer::awaitConnections() {
  const Clock::time_point limit = Clock::now() + nanoseconds(settings_.start_timeout);
  const Clock::time_point others = Clock::now() + kOthersPatience;
  std::string missing;
  std::map<std::string, std::vector<std::string>> listeners, known;
  do {
    missing.clear();
    // subscriptions and acknowledging nodes by the master
    known.swap(listeners);
    Registrations state = registrations().value_or(Registrations());
    listeners = state.subscribers;
    const std::vector<std::string>& acknowledging = state.publishers[ack_sub_.getTopic()];
    for (const Participant& participant : participants_) {
      const std::string node = ros::names::append(nh_.getNamespace(), participant.name);
      if (std::count(acknowledging.begin(), acknowledging.end(), node) == 0) missing = node;
    }
    // a node that is just starting may want more
    if (missing.empty() && listeners != known) missing = "all nodes: they keep on subscribing";
    for (const auto& [name, publisher] : publishers_) {
      const auto all = listeners.find(publisher.getTopic());
      // a listener that is no participant may have died without unregistering
      if (Clock::now() < others && all != listeners.end() &&
          publisher.getNumSubscribers() < all->second.size()) {
        missing = "a listener of " + publisher.getTopic();
      }
    }
    // estimates of the first blocks must reach who waits for them
    for (const Participant& participant : participants_) {
      if (!missing.empty() || Clock::now() >= others) break;
      const std::string node = ros::names::append(nh_.getNamespace(), participant.name);
      const auto connections = connectionsOf(node);
      for (const auto& [topic, publishers] : state.publishers) {
        if (std::count(publishers.begin(), publishers.end(), node) == 0) continue;
        for (const std::string& listener : listeners[topic]) {
          if (connections.count({topic, listener}) == 0) missing = listener + " to " + topic;
        }
      }
    }
    if (missing.empty() && ack_sub_.getNumPublishers() < participants_.size()) {
      missing = "all who acknowledge";
    }
    if (missing.empty()) return;
    std::unique_lock<std::mutex> lock(mutex_);
    answered_.wait_for(lock, std::chrono::milliseconds(20), [this] { return stopping_.load(); });
  } while (!stopping_ && Clock::now() < limit);
  if (!stopping_) {
    throw InputError("no connection to " + missing + " in " +
                     text("%g s", settings_.start_timeout) +
                     ": start it, in lockstep, or take it out of ~participants");
  }
}

bool CellPlayer::listens(const Participant& participant, const std::string& topic) {
  const auto& topics = participant.topics;
  return std::find(topics.begin(), topics.end(), topic) != topics.end();
}

void CellPlayer::awaitAnswers(const std::string& topic, std::uint32_t sequence) {
  std::unique_lock<std::mutex> lock(mutex_);
  const Clock::time_point limit = Clock::now() + nanoseconds(settings_.ack_timeout);
  for (Participant& participant : participants_) {
    if (!listens(participant, topic)) continue;
    // it answers once it has the block of all its topics
    const bool complete = std::all_of(
        participant.topics.begin(), participant.topics.end(), [&](const std::string& other) {
          const auto latest = sequences_.find(other);
          return latest != sequences_.end() && latest->second == sequence;
        });
    if (!complete) continue;
    const auto answered = [&] {
      return stopping_ || (participant.answers > 0 && participant.sequence == sequence);
    };
    if (!answered_.wait_until(lock, limit, answered)) {
      throw InputError(participant.name + " didn't acknowledge block " + std::to_string(sequence) +
                       " of " + topic + " in " + text("%g s", settings_.ack_timeout) +
                       ": is it in lockstep?");
    }
  }
}

// A message that went out before a repeated block has arrived at the latest when that
// block is repeated once more: topics have no common order, but each round trip has.
void CellPlayer::settle(const std::string& topic) {
  const auto block = latest_.find(topic);
  if (block == latest_.end()) return;
  for (int round = 0; round < 2; ++round) {
    std::map<std::string, std::uint64_t> before;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (const Participant& participant : participants_) {
        before[participant.name] = participant.answers;
      }
    }
    bool subscribed = false;
    for (const Participant& participant : participants_) {
      subscribed = subscribed || (listens(participant, topic) && participant.answers_repetition);
    }
    if (!subscribed) return;
    publishers_[topic].publish(block->second);
    std::unique_lock<std::mutex> lock(mutex_);
    const Clock::time_point limit = Clock::now() + kRepetitionPatience;
    for (Participant& participant : participants_) {
      if (!listens(participant, topic) || !participant.answers_repetition) continue;
      participant.answers_repetition = answered_.wait_until(
          lock, limit, [&] { return stopping_ || participant.answers > before[participant.name]; });
    }
  }
  unsettled_ = false;
}

}  // namespace assembly_cell::ros_bridge
