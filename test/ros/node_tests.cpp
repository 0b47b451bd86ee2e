// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tests of nodes, one program. A .test file starts the nodes that its tests need and names
// their suites.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <string>

#include "assembly_cell/Exciter.h"

namespace {

// Another node, which commands the exciter.
int runOtherNode() {
  ros::NodeHandle nh;
  const ros::Publisher pub = nh.advertise<assembly_cell::Exciter>("exciter", 1, true);
  assembly_cell::Exciter exciter;
  exciter.on = true;
  exciter.amplitude = 1.0;
  exciter.frequency = 450.0;
  exciter.direction = 1;
  pub.publish(exciter);
  ros::spin();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const bool is_other = argc > 1 && std::string(argv[1]) == "--other-node";
  ros::init(argc, argv, is_other ? "other_node" : "node_tests");
  if (is_other) return runOtherNode();
  ::testing::InitGoogleTest(&argc, argv);
  if (::testing::GTEST_FLAG(list_tests)) return RUN_ALL_TESTS();  // without a master, too
  const ros::NodeHandle keep;
  ros::AsyncSpinner spinner(4);
  spinner.start();
  return RUN_ALL_TESTS();
}
