// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>

namespace assembly_cell::ros_bridge {

/// Subscription of a stream. In lockstep it is renewed while no message arrives: ROS connects to a
/// publisher's address once, and doesn't connect again to a restarted publisher that got the same
/// port. Blocks are latched and repeated until they are acknowledged, so none is lost meanwhile.
class StreamSubscriber {
 public:
  using Subscribe = std::function<ros::Subscriber()>;

  StreamSubscriber() = default;
  /// received: set by the subscription's callback for messages of the stream's publisher.
  StreamSubscriber(ros::NodeHandle& nh, Subscribe subscribe,
                   std::shared_ptr<std::atomic<bool>> received, bool lockstep);
  void shutdown() { connection_.reset(); }
  /// Its resolved name; empty after shutdown().
  std::string topic() const { return connection_ ? connection_->sub.getTopic() : std::string(); }

 private:
  struct Connection {
    ~Connection();
    void check();

    Subscribe subscribe;
    std::shared_ptr<std::atomic<bool>> received;
    int silent = 0, patience = 0;  // checks
    ros::Subscriber sub;
    ros::WallTimer timer;
  };
  std::unique_ptr<Connection> connection_;
};

}  // namespace assembly_cell::ros_bridge
