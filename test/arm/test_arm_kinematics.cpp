// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>
#include <sstream>

#include "assembly_cell/arm/arm_kinematics.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/description/joint_chain.h"

namespace assembly_cell {
namespace {

const std::string kSource = ASSEMBLY_CELL_SOURCE_DIR;

std::string armUrdf() {
  std::ifstream in(kSource + "/urdf/arm.urdf");
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

// an arm of two joints in a plane, links of 1 m and 0.5 m
constexpr char kPlanar[] = R"(<robot name="planar"><link name="base"/>
  <joint name="one" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" velocity="1" effort="1"/></joint><link name="a"/>
  <joint name="two" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" velocity="2" effort="1"/></joint><link name="b"/>
  <joint name="end" type="fixed"><parent link="b"/><child link="tip"/><origin xyz="0.5 0 0"/></joint><link name="tip"/>
</robot>)";

TEST(ArmKinematics, PlanarArmInClosedForm) {
  const ArmKinematics arm(kPlanar, "tip", "planar");
  ASSERT_EQ(arm.joints(), 2);
  EXPECT_EQ(arm.base(), "base");
  EXPECT_EQ(arm.names()[1], "two");
  EXPECT_EQ(arm.limits().upper(1), 2.0);
  EXPECT_EQ(arm.limits().speed(1), 2.0);
  JointVector q(2);
  q << 0.3, -0.8;
  const Pose X = arm.forward(q);
  EXPECT_NEAR(X.p.x(), std::cos(0.3) + 0.5 * std::cos(-0.5), 1e-12);
  EXPECT_NEAR(X.p.y(), std::sin(0.3) + 0.5 * std::sin(-0.5), 1e-12);
  EXPECT_NEAR(vectorFromRotation(X.R).value.z(), -0.5, 1e-12);
  const auto& J = arm.jacobian(q);
  EXPECT_NEAR(J(0, 0), -X.p.y(), 1e-12);
  EXPECT_NEAR(J(1, 1), 0.5 * std::cos(-0.5), 1e-12);
  EXPECT_NEAR(J(5, 0), 1.0, 1e-12);
}

// The product of transforms of the module description is the reference.
TEST(ArmKinematics, ForwardIsTheProductOfTheUrdfsTransforms) {
  const std::string urdf = armUrdf();
  const ArmKinematics arm(urdf, "tool0", "arm");
  const JointChain chain = loadJointChain(urdf, "tool0", "arm");
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> angle(-3.0, 3.0);
  for (int i = 0; i < 100; ++i) {
    JointVector q(6);
    for (double& value : q) value = angle(random);
    const Pose X = arm.forward(q), Y = linkPose(chain, {q.data(), q.data() + 6});
    ASSERT_LT((X.p - Y.p).norm(), 1e-12);
    ASSERT_LT((X.R - Y.R).norm(), 1e-12);
  }
}

TEST(ArmKinematics, SolvesForPosesOfItsOwn) {
  const ArmKinematics arm(armUrdf(), "tool0", "arm");
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> angle(-1.2, 1.2), little(-0.1, 0.1);
  JointVector home(6);
  home << 0.0, 0.1, 1.8, -0.4, -1.4, 0.0;
  for (int i = 0; i < 200; ++i) {
    JointVector reference = home, q(6);
    for (double& value : reference) value += 0.4 * angle(random);
    for (Eigen::Index k = 0; k < 6; ++k) q(k) = reference(k) + little(random);
    const Pose X = arm.forward(reference);
    const JointSolution solution = arm.solve(X, q);
    ASSERT_TRUE(solution.reached) << i << ": " << solution.distance << " " << solution.turn;
    const Pose Y = arm.forward(q);
    ASSERT_LT((X.p - Y.p).norm(), 1e-7);
    ASSERT_LT((X.R - Y.R).norm(), 1e-6);
    // the nearest solution
    ASSERT_LT((q - reference).cwiseAbs().maxCoeff(), 0.5);
  }
}

// Stretched out, the arm is singular: damped rates stay finite, an unreachable pose is reported.
TEST(ArmKinematics, IsDampedWhereItIsSingular) {
  const ArmKinematics arm(armUrdf(), "tool0", "arm");
  for (const double elbow : {0.0, 1e-9, 1e-6, 1e-3}) {
    JointVector q(6);
    q << 0.0, 0.0, elbow, 0.0, -1.4, 0.0;
    Vector6 up;
    up << 0.0, 0.0, 0.1, 0.0, 0.0, 0.0;
    const JointVector rates = arm.rates(q, up);
    ASSERT_TRUE(rates.allFinite());
    // at most |v| / (2 λ), λ the damping there
    ASSERT_LT(rates.norm(), 0.1 / (2.0 * 0.05) + 1e-9) << elbow;
    Pose X = arm.forward(q);
    X.p.z() += 0.05;
    const JointSolution solution = arm.solve(X, q);
    EXPECT_FALSE(solution.reached);
    EXPECT_GT(solution.distance, 0.01);
    EXPECT_TRUE(q.allFinite());
  }
}

TEST(ArmKinematics, KeepsJointLimits) {
  const ArmKinematics arm(armUrdf(), "tool0", "arm");
  const JointLimits& limits = arm.limits();
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> angle(-8.0, 8.0);
  for (int i = 0; i < 100; ++i) {
    JointVector q(6), beyond(6);
    for (double& value : q) value = angle(random);
    for (double& value : beyond) value = angle(random);
    arm.solve(arm.forward(beyond), q);
    ASSERT_TRUE(((q - limits.lower).array() >= 0.0).all());
    ASSERT_TRUE(((limits.upper - q).array() >= 0.0).all());
  }
  // a joint at its limit doesn't move beyond
  JointVector q(6);
  q << 0.0, 0.1, limits.upper(2), -0.4, -1.4, 0.0;
  const auto inward = arm.jacobian(q).col(2);
  EXPECT_EQ(arm.rates(q, inward)(2), 0.0);
}

// Its inverse kinematics would send the arm to the limit, millimetres away.
TEST(ArmKinematics, NamesAJointBeyondItsLimit) {
  const ArmKinematics arm(armUrdf(), "tool0", "arm");
  JointVector q(6);
  q << -0.2, 0.07, 2.1, -0.6, -1.57, 6.28 + 1e-6;
  EXPECT_EQ(arm.beyondLimit(q), "");
  for (const double position : {6.9, 6.30, -6.2801}) {
    q(5) = position;
    const std::string line = arm.beyondLimit(q);
    EXPECT_EQ(line.rfind("joint " + arm.names()[5] +
                             text(" is at %g rad, its limits are -6.28 to "
                                  "6.28 rad",
                                  position),
                         0),
              0U)
        << line;
  }
  q(5) = 6.30;
  const Pose before = arm.forward(q);
  JointVector moved = q;
  arm.solve(before, moved);
  EXPECT_GT((moved - q).cwiseAbs().maxCoeff(), 0.01);
  EXPECT_GT((arm.forward(moved).p - before.p).norm() + (arm.forward(moved).R - before.R).norm(),
            1e-4);
}

TEST(ArmKinematics, SelectsItsJointsFromAMessage) {
  const ArmKinematics arm(kPlanar, "tip", "planar");
  JointVector q;
  std::string missing;
  EXPECT_TRUE(arm.select({"gripper", "two", "one"}, {9.0, 0.2, 0.1}, q, missing));
  EXPECT_EQ(q(0), 0.1);
  EXPECT_EQ(q(1), 0.2);
  EXPECT_FALSE(arm.select({"two", "gripper"}, {0.2, 9.0}, q, missing));
  EXPECT_EQ(missing, "one");
}

TEST(ArmKinematics, RefusesWhatIsNoArm) {
  const auto why = [](const std::string& urdf, const std::string& tip) -> std::string {
    try {
      const ArmKinematics arm(urdf, tip, "robot");
    } catch (const InputError& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_NE(why("<robot", "tip").find("is no URDF"), std::string::npos);
  EXPECT_NE(why(kPlanar, "hand").find("link hand"), std::string::npos);
  EXPECT_NE(why(kPlanar, "base").find("no joint moves it"), std::string::npos);
  std::string loose = kPlanar;
  loose.replace(loose.find("velocity=\"2\""), 12, "velocity=\"0\"");
  EXPECT_NE(why(loose, "tip").find("joint two"), std::string::npos);
}

TEST(CellPlace, RelatesCarrierAndFlange) {
  const CellPlace place = loadCellPlace(kSource + "/config/arm/cell_place.yaml");
  EXPECT_EQ(place.flange, "tool0");
  const Pose carrier{rotationFromVector({Eigen::Vector3d(0.01, 0.02, 0.03)}),
                     {0.001, 0.002, 0.003}};
  const Pose back = place.carrierOf(place.flangeOf(carrier));
  EXPECT_LT((back.p - carrier.p).norm(), 1e-12);
  EXPECT_LT((back.R - carrier.R).norm(), 1e-12);
  // upright, 0.1 m of tool above the coupling point
  const Pose flange = place.flangeOf(Pose());
  EXPECT_LT((flange.p - Eigen::Vector3d(0.45, 0.0, 0.1 + 0.0835 + 0.1)).norm(), 1e-12);
  EXPECT_LT((flange.R.col(2) + Eigen::Vector3d::UnitZ()).norm(), 1e-12);
}

}  // namespace
}  // namespace assembly_cell
