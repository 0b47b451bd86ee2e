// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <nodelet/nodelet.h>
#include <ros/callback_queue.h>

#include <exception>
#include <memory>
#include <string>

#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/process/hosted_nodes.h"
#include "assembly_cell/ros/process/node_main.h"
#include "assembly_cell/ros/process/shared_spinner.h"

namespace assembly_cell::ros_bridge {

/// Callback queue of a nodelet with threads of its own.
template <unsigned kThreads>
class OwnThreads {
 public:
  ros::CallbackQueue& queue() { return queue_; }
  void start() { spinner_.start(); }
  void stop() { spinner_.stop(); }

 private:
  ros::CallbackQueue queue_;
  GuardedSpinner spinner_{kThreads, &queue_};
};

/// Callback queue of a nodelet, called by the thread that such nodelets share.
class SharedThread {
 public:
  ~SharedThread() { stop(); }
  ros::CallbackQueue& queue() { return queue_; }
  void start() { SharedSpinner::ofThisProcess().add(&queue_); }
  void stop() { SharedSpinner::ofThisProcess().remove(&queue_); }

 private:
  SharedSpinner::Queue queue_;
};

/// A node's class as a nodelet with a callback queue of its own.
template <class Node, class Threads = OwnThreads<Node::kThreads>>
class HostedNodelet : public nodelet::Nodelet {
 public:
  ~HostedNodelet() override {
    HostedNodes::ofThisProcess().stop(stop_);
    threads_.stop();
    if constexpr (HasExitCode<Node>::value) {
      if (node_) HostedNodes::ofThisProcess().ended(node_->exitCode());
    }
    // before its queue is destroyed
    node_.reset();
  }

 private:
  void onInit() override {
    try {
      ros::NodeHandle nh = getNodeHandle(), pnh = getPrivateNodeHandle();
      nh.setCallbackQueue(&threads_.queue());
      pnh.setCallbackQueue(&threads_.queue());
      node_ = std::make_unique<Node>(nh, pnh);
    } catch (const std::exception& error) {
      HostedNodes::ofThisProcess().fail(getName().substr(1), error.what());
      return;
    }
    if constexpr (HasStop<Node>::value) {
      stop_ = HostedNodes::ofThisProcess().add([this] { node_->stop(); });
    }
    threads_.start();
  }

  Threads threads_;
  std::unique_ptr<Node> node_;
  int stop_ = 0;  // number of its stop
};

/// The same for a node whose callbacks never wait and are called by one thread.
template <class Node>
class TogetherNodelet : public HostedNodelet<Node, SharedThread> {
  static_assert(Node::kThreads == 1);
};

}  // namespace assembly_cell::ros_bridge
