// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tests of the panel are one program, as those of nodes are, with a screen in memory.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <QApplication>

int main(int argc, char** argv) {
  qputenv("QT_QPA_PLATFORM", "offscreen");
  ros::init(argc, argv, "panel_tests");
  ::testing::InitGoogleTest(&argc, argv);
  if (::testing::GTEST_FLAG(list_tests)) return RUN_ALL_TESTS();  // without a master, too
  const QApplication application(argc, argv);
  const ros::NodeHandle keep;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
