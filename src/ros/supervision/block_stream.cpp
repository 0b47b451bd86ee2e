// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/supervision/block_stream.h"

#include <algorithm>
#include <vector>

#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/process/node_watch.h"
#include "assembly_cell/ros/process/participants.h"

namespace assembly_cell::ros_bridge {

namespace {

// Participants that a lockstep may have beside the publishers of blocks: time waits for them, too.
constexpr const char* kOptional[] = {"twin_force/status", "align/status", "identify/status"};

std::string topicOf(const ros::NodeHandle& nh, BlockPart part) {
  return nh.resolveName(kBlockTopics[part]);
}

}  // namespace

BlockStream::BlockStream(ros::NodeHandle& nh, const PlantSettings& settings, PlantMonitor& monitor,
                         const Events& events)
    : settings_(settings),
      nh_(nh),
      monitor_(monitor),
      events_(events),
      assembly_(settings.sensors),
      arrivals_(settings.lockstep, settings.sensors),
      decoder_(nh, settings.converter_step, settings.sensors, monitor) {
  if (settings_.lockstep) ack_.publisher = {nh, "ack", kQueue};
  const auto receive = [this](BlockPart part, auto add) {
    return [this, part, add](const auto& message, const std::string& node) {
      const PlantMonitor::Lock lock = monitor_.lock();
      if (arrivals_.onMessage(part, node) && part == kCarrier) events_.plant_node(node);
      add(message);
      onMessage();
    };
  };
  for (const BlockPart part : {kWrenchA, kWrenchB}) {
    if (part == kWrenchA && settings_.sensors == Sensors::kB) continue;
    const auto add = [this, part](const WrenchSamples::ConstPtr& message) {
      assembly_.addWrench(part, message);
    };
    subs_[part] = subscribeStream<WrenchSamples>(nh, kBlockTopics[part], kQueue, receive(part, add),
                                                 nullptr, settings_.lockstep);
  }
  subs_[kDisplacementB] = subscribeStream<DisplacementSamples>(
      nh, kBlockTopics[kDisplacementB], kQueue,
      receive(kDisplacementB,
              [this](const DisplacementSamples::ConstPtr& m) { assembly_.addDisplacement(m); }),
      nullptr, settings_.lockstep);
  const auto add_carrier = [this](const geometry_msgs::PoseStamped::ConstPtr& message) {
    const ros::Time& stamp = message->header.stamp;
    if (settings_.lockstep && stamp < assembly_.lastEnd()) {
      assembly_.onPlantRestart();
      // commands from now on belong to the restarted plant, which counts them
      last_.end = stamp;
      events_.plant_restart();
    }
    arrivals_.onCarrierStamp(stamp);
    assembly_.addCarrier(message);
  };
  subs_[kCarrier] = subscribeStream<geometry_msgs::PoseStamped>(nh, kBlockTopics[kCarrier], kQueue,
                                                                receive(kCarrier, add_carrier),
                                                                nullptr, settings_.lockstep);
}

void BlockStream::begin(PlantMonitor::Lock& lock) {
  std::vector<std::string> topics = {nh_.resolveName("identify_locus/status")};
  for (const BlockPart part : partsOf(settings_.sensors)) topics.push_back(topicOf(nh_, part));
  for (const char* topic : kOptional) topics.push_back(nh_.resolveName(topic));
  drop();
  last_ = StreamBlock{};
  // from now on blocks wait, so that the time of the request is no cell time
  active_ = true;
  monitor_.runUnlocked(lock, [&] { rememberPublishers(topics); });
}

void BlockStream::take() {
  last_ = *ready_;
  drop();
}

void BlockStream::onMessage() {
  const std::optional<BlockMessages> messages = assembly_.take();
  if (!messages) return;
  arrivals_.onBlock();
  ack_.pending = messages->sequence;
  const std::optional<StreamBlock> block =
      active_ ? decoder_.decode(*messages) : std::optional<StreamBlock>();
  if (block) {
    ready_ = block;
    events_.block(*block, messages->wrench[kWrenchB]);
  } else {
    if (active_) {
      ROS_ERROR_THROTTLE(1.0, "block %u is not one of finite samples: ignored", messages->sequence);
    }
    acknowledge();
  }
  monitor_.notify();
}

void BlockStream::acknowledge() {
  if (ack_.pending && settings_.lockstep) {
    Ack ack;
    ack.node = participantName(nh_.getNamespace(), settings_.node);
    ack.sequence = *ack_.pending;
    events_.acknowledge(ack);
    ack_.publisher.publish(ack);
  }
  ack_.pending.reset();
}

std::string BlockStream::publisherOf(PlantMonitor::Lock& lock, BlockPart part) {
  TopicPublisher found;
  monitor_.runUnlocked(lock, [&] { found = publishersOf({topicOf(nh_, part)}).front(); });
  return found.topic + " of " + found.node;
}

std::string BlockStream::describeMissing(PlantMonitor::Lock& lock, const Silence& silence) {
  std::vector<std::string> topics, optional;
  for (const char* topic : kOptional) optional.push_back(nh_.resolveName(topic));
  const std::vector<BlockPart> missing =
      settings_.lockstep ? assembly_.missing() : arrivals_.silent(0.5 * silence.patience);
  for (const BlockPart part : missing) topics.push_back(topicOf(nh_, part));
  const bool any = topics.empty();  // which one is missing isn't known
  if (any) {
    for (const BlockPart part : partsOf(settings_.sensors)) topics.push_back(topicOf(nh_, part));
    topics.push_back(nh_.resolveName("identify_locus/status"));
    if (settings_.lockstep) topics.insert(topics.end(), optional.begin(), optional.end());
  }
  std::vector<TopicPublisher> found;
  monitor_.runUnlocked(lock, [&] {
    found = publishersOf(topics, settings_.lockstep || any ? silence.answer_within : 0.0);
  });
  if (!silence.is_over || any) {
    const auto is_unsuspicious = [&](const TopicPublisher& publisher) {
      if (publisher.presence != NodePresence::kUnknown &&
          publisher.presence != NodePresence::kNoMaster) {
        return publisher.presence == NodePresence::kListening;
      }
      const bool is_optional =
          std::find(optional.begin(), optional.end(), publisher.topic) != optional.end();
      return !silence.has_begun || is_optional;
    };
    found.erase(std::remove_if(found.begin(), found.end(), is_unsuspicious), found.end());
  }
  // nodes that shut down in order have unregistered at the master
  for (TopicPublisher& publisher : found) {
    for (const BlockPart part : partsOf(settings_.sensors)) {
      const std::string& node = arrivals_.publisher(part);
      if (!publisher.node.empty()) break;
      if (node.empty() || publisher.topic != topicOf(nh_, part)) continue;
      publisher.node = node;
      publisher.presence =
          publisher.presence == NodePresence::kNoMaster ? NodePresence::kMute : NodePresence::kGone;
    }
  }
  return describe(found);
}

}  // namespace assembly_cell::ros_bridge
