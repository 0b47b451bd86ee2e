// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_joints.h"

namespace assembly_cell {
namespace {

using Names = std::vector<std::string>;
using Share = ArmJoints::Share;
constexpr double kNanValue = std::numeric_limits<double>::quiet_NaN();

// Two joints, and a fixed link beside and at the root.
const char* const kUrdf = R"(<robot name="two">
  <link name="base"/><link name="upper"/><link name="tip"/><link name="same"/><link name="turned"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
  <joint name="elbow_joint" type="revolute"><parent link="upper"/><child link="tip"/>
    <origin xyz="1 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/>
  </joint>
  <joint name="at_root" type="fixed"><parent link="base"/><child link="same"/></joint>
  <joint name="beside" type="fixed"><parent link="base"/><child link="turned"/>
    <origin rpy="0 0 3.14159"/></joint>
</robot>)";

ArmJoints joints() { return ArmJoints(std::make_unique<ArmKinematics>(kUrdf, "tip", "two")); }

TEST(ArmJoints, OnlyTheArmsJointsCount) {
  ArmJoints arm = joints();
  EXPECT_EQ(arm.shareOf({"finger", "thumb"}), Share::kNone);
  EXPECT_EQ(arm.shareOf({}), Share::kNone);
  EXPECT_EQ(arm.shareOf({"finger", "elbow_joint"}), Share::kSome);
  const Names names{"finger", "elbow_joint", "shoulder", "thumb"};
  EXPECT_EQ(arm.shareOf(names), Share::kAll);
  EXPECT_EQ(arm.update(names, {kNanValue, 0.2, 0.1, 1e9}), "");
  EXPECT_EQ(arm.positions(), (JointVector(2) << 0.1, 0.2).finished());
  // positions of the last ones may be missing
  EXPECT_EQ(arm.update(names, {kNanValue, 0.3, 0.1}), "");
}

TEST(ArmJoints, ABadPositionIsRefusedByTheNameOfItsJoint) {
  ArmJoints arm = joints();
  ASSERT_EQ(arm.update({"shoulder", "elbow_joint"}, {0.1, 0.2}), "");
  EXPECT_EQ(arm.update({"shoulder", "elbow_joint"}, {0.5, kNanValue}),
            "position of joint elbow_joint is nan: give -1000 to 1000");
  EXPECT_EQ(arm.update({"shoulder", "elbow_joint"}, {1e4, 0.1}),
            "position of joint shoulder is 10000: give -1000 to 1000");
  EXPECT_EQ(arm.update({"shoulder", "elbow_joint"}, {0.5}), "joint elbow_joint has no position");
  EXPECT_EQ(arm.update({"shoulder", "elbow_joint", "shoulder"}, {0.5, 0.1, 0.2}),
            "joint shoulder is named twice");
  EXPECT_EQ(arm.positions(), (JointVector(2) << 0.1, 0.2).finished());
}

TEST(ArmJoints, MissingAndSimilarNamesAreNamed) {
  const ArmJoints arm = joints();
  EXPECT_EQ(arm.missing({"left_shoulder", "finger", "left/elbow_joint"}),
            "the joints shoulder, elbow_joint of the URDF are missing, similar are left_shoulder, "
            "left/elbow_joint: give the URDF and the driver the same names");
  EXPECT_EQ(arm.missing({"shoulder", "ElbowJoint"}),
            "the joints elbow_joint of the URDF are missing, similar are ElbowJoint: give the URDF "
            "and the driver the same names");
  EXPECT_EQ(arm.missing({"shoulder", "finger"}),
            "the joints elbow_joint of the URDF are missing, it has shoulder, finger: all joints "
            "of the arm have to be in one message");
  EXPECT_EQ(arm.similar({"left_shoulder", "finger", "left/elbow_joint"}), 2U);
  EXPECT_EQ(arm.similar({"finger", ""}), 0U);
}

TEST(ArmJoints, AFrameAwayFromTheRootIsFound) {
  EXPECT_FALSE(isAwayFromRoot(kUrdf, "base"));
  EXPECT_FALSE(isAwayFromRoot(kUrdf, "same"));
  EXPECT_FALSE(isAwayFromRoot(kUrdf, "robot/base"));
  EXPECT_TRUE(isAwayFromRoot(kUrdf, "turned"));
  EXPECT_TRUE(isAwayFromRoot(kUrdf, "upper"));
}

}  // namespace
}  // namespace assembly_cell
