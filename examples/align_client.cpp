// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Requests an alignment from a running cell, prints its status and the result.
// usage: align_client [STRATEGY]    strategies: docs/reference/strategies.md; none: the cell's own
#include <actionlib/client/simple_action_client.h>
#include <assembly_cell/AlignPegAction.h>
#include <ros/ros.h>

#include <cstdio>
#include <cstring>

namespace {

using Client = actionlib::SimpleActionClient<assembly_cell::AlignPegAction>;

void print(const assembly_cell::AlignPegFeedbackConstPtr& feedback) {
  std::printf("%7.2f s  %s, %u contacts", feedback->time, feedback->state.c_str(),
              feedback->contacts);
  if (feedback->position_sd > 0.0) {
    std::printf(", hole known to %.3f mm", 1e3 * feedback->position_sd);
  }
  std::printf("\n");
}

// By the wall clock: a cell in lockstep makes a minute of its own in seconds.
bool serverComes(const Client& client, double patience) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(patience);
  while (!client.isServerConnected()) {
    if (!ros::ok() || ros::WallTime::now() > end) return false;
    ros::WallDuration(0.05).sleep();
  }
  return true;
}

// True with a result. What is sent while ROS makes a connection may be lost: a goal of which the
// server that publishes nothing for 10 s is requested again.
bool request(Client& client, const assembly_cell::AlignPegGoal& goal) {
  while (ros::ok()) {
    client.sendGoal(goal, {}, {}, &print);
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(10.0);
    while (client.getState() != actionlib::SimpleClientGoalState::PENDING ||
           ros::WallTime::now() < end) {
      if (client.waitForResult(ros::Duration(1.0))) return true;
      if (!ros::ok()) return false;
    }
  }
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "align_client", ros::init_options::AnonymousName);
  const bool help = argc == 2 && std::strcmp(argv[1], "--help") == 0;
  if (argc > 2 || help) {
    std::puts(
        "usage: align_client [STRATEGY]    strategies: docs/reference/strategies.md; none: the "
        "cell's own");
    return help ? 0 : 2;
  }
  if (!ros::master::check()) {
    std::fprintf(stderr,
                 "align_client: no ROS master at %s: start the cell first, or set ROS_MASTER_URI\n",
                 ros::master::getURI().c_str());
    return 1;
  }
  Client client("align", true);  // spins a thread of its own
  if (!serverComes(client, 60.0)) {
    std::fprintf(stderr,
                 "align_client: no server of the action 'align' within 60 s: is "
                 "assembly_supervisor running?\n");
    return 1;
  }
  assembly_cell::AlignPegGoal goal;
  if (argc > 1) goal.strategy = argv[1];
  if (!request(client, goal)) return 1;
  const assembly_cell::AlignmentReport report = client.getResult()->report;
  std::printf("%s\n", report.reason.c_str());
  if (!report.success) return 1;
  std::printf("the hole was at x %.3f mm, y %.3f mm from the peg\n",
              1e3 * report.estimated_offset[0], 1e3 * report.estimated_offset[1]);
  return 0;
}
