// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Processor time of a minimal roscpp node with arm_bridge's traffic: receives the arm's joints and
// sends 500 points a second, as the bridge does, and does nothing else. A command moves the next
// point. usage: bridge_floor [--reader]: the reader only receives the points.
#include <geometry_msgs/PoseStamped.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <chrono>
#include <string>
#include <thread>

namespace {

const ros::TransportHints kHints = ros::TransportHints().tcpNoDelay();
constexpr int kQueue = 100;

void listen(ros::NodeHandle& nh) {
  const ros::Subscriber points = nh.subscribe<trajectory_msgs::JointTrajectory>(
      "bridge_floor/command", kQueue, [](const auto&) {}, ros::VoidConstPtr(), kHints);
  ros::spin();
}

void say(ros::NodeHandle& nh) {
  trajectory_msgs::JointTrajectory point;
  point.points.resize(1);
  ros::CallbackQueue queue;
  nh.setCallbackQueue(&queue);
  const ros::Subscriber joints = nh.subscribe<sensor_msgs::JointState>(
      "arm/joint_states", kQueue,
      [&](const auto& state) {
        if (!point.joint_names.empty()) return;
        point.joint_names = state->name;
        point.points[0].positions = point.points[0].velocities = state->position;
      },
      ros::VoidConstPtr(), kHints);
  const ros::Subscriber commands = nh.subscribe<geometry_msgs::PoseStamped>(
      "bridge_floor/carrier_command", kQueue,
      [&](const auto&) {
        for (double& q : point.points[0].positions) q += 1e-6;
      },
      ros::VoidConstPtr(), kHints);
  const ros::Publisher pub =
      nh.advertise<trajectory_msgs::JointTrajectory>("bridge_floor/command", kQueue);
  auto next = std::chrono::steady_clock::now();
  while (ros::ok()) {
    next += std::chrono::milliseconds(2);
    std::this_thread::sleep_until(next);
    queue.callAvailable(ros::WallDuration(0.0));
    point.header.stamp = ros::Time::now();
    if (!point.joint_names.empty()) pub.publish(point);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const bool reader = argc > 1 && std::string(argv[1]) == "--reader";
  ros::init(argc, argv, reader ? "bridge_floor_reader" : "bridge_floor");
  ros::NodeHandle nh;
  reader ? listen(nh) : say(nh);
  return 0;
}
