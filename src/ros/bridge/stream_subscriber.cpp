// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/bridge/stream_subscriber.h"

#include <algorithm>
#include <utility>

namespace assembly_cell::ros_bridge {

namespace {

// Two of them are shorter than a simulator's ~ack_timeout; wall clock [s].
constexpr double kCheckPeriod = 2.0;
// Silent checks before a subscription is renewed: at first, and at most, as a plant may be paused.
constexpr int kMinChecks = 2, kMaxChecks = 32;

}  // namespace

StreamSubscriber::StreamSubscriber(ros::NodeHandle& nh, Subscribe subscribe,
                                   std::shared_ptr<std::atomic<bool>> received, bool lockstep)
    : connection_(std::make_unique<Connection>()) {
  Connection& connection = *connection_;
  connection.subscribe = std::move(subscribe);
  connection.received = std::move(received);
  connection.patience = kMinChecks;
  connection.sub = connection.subscribe();
  if (!lockstep) return;
  connection.timer = nh.createWallTimer(ros::WallDuration(kCheckPeriod),
                                        [&connection](const auto&) { connection.check(); });
}

StreamSubscriber::Connection::~Connection() {
  timer.stop();
  sub.shutdown();
}

void StreamSubscriber::Connection::check() {
  if (received->exchange(false)) {
    silent = 0;
    patience = kMinChecks;
    return;
  }
  if (++silent < patience) return;
  ROS_DEBUG("nothing on %s for %g s: subscribing again", sub.getTopic().c_str(),
            silent * kCheckPeriod);
  silent = 0;
  patience = std::min(2 * patience, kMaxChecks);
  sub.shutdown();
  sub = subscribe();
}

}  // namespace assembly_cell::ros_bridge
