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

/// Publishes a message that subscribers in this process get as it is, not written to bytes and read
/// again. Nobody may change it any more. Its header.seq is what it says there: ROS counts only what
/// it writes to bytes.
template <class Message>
void publishShared(const ros::Publisher& publisher, Message message) {
  publisher.publish(boost::make_shared<Message>(std::move(message)));
}

/// The same for a topic that gives the latest message to who connects, as a latched one does. ROS
/// writes each message of a latched topic to bytes, whether anybody outside of the process wants it
/// or not; this one does so where somebody connects. It may come to that one twice. A process
/// connects to a topic once: its second subscription hears what comes from then on, so whatever it
/// can't do without must be said again until it answers.
template <class Message>
class LatestPublisher {
 public:
  using ConstPtr = boost::shared_ptr<Message const>;

  /// Of no topic: there is nobody to publish to.
  LatestPublisher() = default;

  /// latest: false for a topic that gives only what comes.
  LatestPublisher(ros::NodeHandle nh, const std::string& topic, std::uint32_t queue,
                  bool latest = true)
      : state_(std::make_shared<State>()) {
    if (!latest) {
      publisher_ = nh.advertise<Message>(topic, queue);
      return;
    }
    const std::weak_ptr<State> of_this = state_;
    const auto greet = [of_this](const ros::SingleSubscriberPublisher& who) {
      const std::shared_ptr<State> state = of_this.lock();
      if (!state) return;
      // an older one never comes after a newer one
      const std::lock_guard<std::mutex> lock(state->mutex);
      if (state->message) who.publish(*state->message);
    };
    publisher_ = nh.advertise<Message>(topic, queue, greet);
  }

  void publish(ConstPtr message) {
    if (!state_) return;
    const std::lock_guard<std::mutex> lock(state_->mutex);
    state_->message = std::move(message);
    publisher_.publish(state_->message);
  }
  void publish(Message message) { publish(boost::make_shared<Message>(std::move(message))); }

  std::uint32_t getNumSubscribers() const { return publisher_.getNumSubscribers(); }

 private:
  struct State {
    std::mutex mutex;
    ConstPtr message;  // the latest
  };
  std::shared_ptr<State> state_;
  ros::Publisher publisher_;
};

}  // namespace assembly_cell::ros_bridge
