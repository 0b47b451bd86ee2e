// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/truth_output.h"

#include <geometry_msgs/PoseStamped.h>
#include <std_msgs/String.h>

#include <utility>

#include "assembly_cell/ContactArray.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/publish_shared.h"

namespace assembly_cell::ros_bridge {

namespace {

// A report looks for the ground truth at a certain time; a lockstep of short blocks doesn't wait.
constexpr int kTruthQueue = 5000;

}  // namespace

TruthOutput::TruthOutput(ros::NodeHandle& nh, const SimulatorSetup& setup) {
  pose_pub_ = nh.advertise<geometry_msgs::PoseStamped>("truth/pose", kTruthQueue, true);
  contacts_pub_ = nh.advertise<ContactArray>("truth/contacts", 10);
  if (setup.mismatch.empty()) return;
  mismatch_pub_ = nh.advertise<std_msgs::String>("truth/mismatch", 1, true);
  std_msgs::String drawn;
  drawn.data = setup.mismatch;
  mismatch_pub_.publish(drawn);
  ROS_INFO("the ground truth differs from the files by %s", setup.mismatch.c_str());
}

void TruthOutput::publish(const SimulatorBackend& world, const ros::Time& stamp) {
  publishShared(pose_pub_, poseStamped(kHoleTruthFrame, world.pegPose(), stamp));
  if (contacts_pub_.getNumSubscribers() == 0) return;
  ContactArray contacts;
  contacts.header.stamp = stamp;
  contacts.header.frame_id = kHoleTruthFrame;
  for (const auto& report : world.contacts()) {
    if (!report.valid || !report.force.allFinite() || !report.normal.allFinite()) continue;
    Contact contact;
    contact.feature = static_cast<std::uint8_t>(report.feature);
    contact.position = toPoint(report.point);
    contact.normal = toVector3(report.normal);
    contact.force = toVector3(report.force);
    contact.gap = report.gap;
    contact.state = report.state;
    contacts.contacts.push_back(contact);
  }
  publishShared(contacts_pub_, std::move(contacts));
}

}  // namespace assembly_cell::ros_bridge
