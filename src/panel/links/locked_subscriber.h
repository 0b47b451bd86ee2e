// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <mutex>
#include <string>

#include "assembly_cell/ros/bridge/message_guard.h"

namespace assembly_cell::panel {

/// Subscriptions of a link: their callbacks run with the link's mutex locked; exceptions are
/// logged.
struct LockedSubscriber {
  ros::NodeHandle nh;
  std::mutex& mutex;

  template <class Message, class Callback>
  ros::Subscriber subscribe(const std::string& topic, Callback callback) {
    constexpr std::uint32_t kQueue = 50;
    const auto receive = [this, topic, callback](const boost::shared_ptr<const Message>& message) {
      ros_bridge::guarded(topic, [&] {
        const std::lock_guard<std::mutex> lock(mutex);
        callback(*message);
      });
    };
    return nh.subscribe<Message>(
        topic, kQueue, boost::function<void(const boost::shared_ptr<const Message>&)>(receive));
  }
  /// Only messages that pass check().
  template <class Message, class Callback>
  ros::Subscriber subscribeChecked(const std::string& topic, Callback callback) {
    constexpr std::uint32_t kQueue = 50;
    const auto receive = [this, callback](const boost::shared_ptr<const Message>& message) {
      const std::lock_guard<std::mutex> lock(mutex);
      callback(*message);
    };
    return ros_bridge::subscribeChecked<Message>(nh, topic, kQueue, receive);
  }
};

}  // namespace assembly_cell::panel
