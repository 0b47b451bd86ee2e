// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <ros/ros.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>

namespace assembly_cell::ros_bridge {

/// The subscription of a stream. In lockstep it is made anew while nothing comes in. ROS connects
/// to a publisher once: one that is started anew at its predecessor's address, as a port may be
/// given out twice, is taken for that one and never heard. Blocks are latched and said again until
/// they are answered, so nothing gets lost meanwhile.
class StreamSubscriber {
 public:
  using Subscribe = std::function<ros::Subscriber()>;

  StreamSubscriber() = default;
  /// heard: set by the subscription's callback, by what is of the stream's publisher.
  StreamSubscriber(ros::NodeHandle& nh, Subscribe subscribe,
                   std::shared_ptr<std::atomic<bool>> heard, bool lockstep);
  void shutdown() { connection_.reset(); }
  /// Its resolved name; empty after shutdown().
  std::string topic() const { return connection_ ? connection_->sub.getTopic() : std::string(); }

 private:
  struct Connection {
    ~Connection();
    void look();

    Subscribe subscribe;
    std::shared_ptr<std::atomic<bool>> heard;
    int silent = 0, patience = 0;  // looks
    ros::Subscriber sub;
    ros::WallTimer timer;
  };
  std::unique_ptr<Connection> connection_;
};

}  // namespace assembly_cell::ros_bridge
