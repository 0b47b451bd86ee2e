// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/stream_subscriber.h"

#include <algorithm>
#include <utility>

namespace assembly_cell::ros_bridge {

namespace {

// twice, before a simulator gives up waiting (~ack_timeout); wall clock [s]
constexpr double kLook = 2.0;
// Of silence, before a subscription is made anew: at first, and at most, as a plant may stand.
constexpr int kFewLooks = 2, kManyLooks = 32;

}  // namespace

StreamSubscriber::StreamSubscriber(ros::NodeHandle& nh, Subscribe subscribe,
                                   std::shared_ptr<std::atomic<bool>> heard, bool lockstep)
    : connection_(std::make_unique<Connection>()) {
  Connection& connection = *connection_;
  connection.subscribe = std::move(subscribe);
  connection.heard = std::move(heard);
  connection.patience = kFewLooks;
  connection.sub = connection.subscribe();
  if (!lockstep) return;
  connection.timer = nh.createWallTimer(ros::WallDuration(kLook),
                                        [&connection](const auto&) { connection.look(); });
}

StreamSubscriber::Connection::~Connection() {
  timer.stop();
  sub.shutdown();
}

void StreamSubscriber::Connection::look() {
  if (heard->exchange(false)) {
    silent = 0;
    patience = kFewLooks;
    return;
  }
  if (++silent < patience) return;
  ROS_DEBUG("nothing on %s for %g s: subscribing anew", sub.getTopic().c_str(), silent * kLook);
  silent = 0;
  patience = std::min(2 * patience, kManyLooks);
  sub.shutdown();
  sub = subscribe();
}

}  // namespace assembly_cell::ros_bridge
