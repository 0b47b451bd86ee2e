// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/single_subscriber_publisher.h>
#include <boost/make_shared.hpp>

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

namespace assembly_cell::ros_bridge {

/// Publishes a message that subscribers in this process share, without serialization; it must not
/// be changed any more. Its header.seq stays: ROS sets that of serialized messages only.
template <class Message>
void publishShared(const ros::Publisher& publisher, Message message) {
  publisher.publish(boost::make_shared<Message>(std::move(message)));
}

/// Publisher of a latched topic, whose latest message new subscribers receive. ROS serializes each
/// message of a latched topic, even without subscribers in other processes; this class does so when
/// one connects, which may receive the message twice. A process connects to a topic once: its
/// second subscription receives only later messages, so what it needs must be repeated until it
/// answers.
template <class Message>
class LatestPublisher {
 public:
  using ConstPtr = boost::shared_ptr<Message const>;

  /// Without a topic: publish() does nothing.
  LatestPublisher() = default;

  /// latest: false for a topic that isn't latched.
  LatestPublisher(ros::NodeHandle nh, const std::string& topic, std::uint32_t queue,
                  bool latest = true)
      : state_(std::make_shared<State>()) {
    if (!latest) {
      publisher_ = nh.advertise<Message>(topic, queue);
      return;
    }
    const std::weak_ptr<State> of_this = state_;
    const auto on_connect = [of_this](const ros::SingleSubscriberPublisher& subscriber) {
      const std::shared_ptr<State> state = of_this.lock();
      if (!state) return;
      // no older message arrives after a newer one
      const std::lock_guard<std::mutex> lock(state->mutex);
      if (state->message) subscriber.publish(*state->message);
    };
    publisher_ = nh.advertise<Message>(topic, queue, on_connect);
  }

  void publish(ConstPtr message) {
    if (!state_) return;
    const std::lock_guard<std::mutex> lock(state_->mutex);
    state_->message = std::move(message);
    publisher_.publish(state_->message);
  }
  void publish(Message message) { publish(boost::make_shared<Message>(std::move(message))); }

  std::uint32_t getNumSubscribers() const { return publisher_.getNumSubscribers(); }
  std::string getTopic() const { return publisher_.getTopic(); }

 private:
  struct State {
    std::mutex mutex;
    ConstPtr message;  // the latest
  };
  std::shared_ptr<State> state_;
  ros::Publisher publisher_;
};

}  // namespace assembly_cell::ros_bridge
