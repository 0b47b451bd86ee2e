// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/Ack.h>
#include <assembly_cell/CarrierMotion.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/PlantState.h>
#include <assembly_cell/WrenchSamples.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Bool.h>
#include <std_srvs/Trigger.h>
#include <trajectory_msgs/JointTrajectory.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "assembly_cell/arm/arm_kinematics.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"
#include "temporary_folder.h"

namespace assembly_cell::ros_bridge::arm_test {
namespace {

using test::Child;
using test::executable;
using test::Record;
using test::sourceFile;
using test::waitFor;

constexpr double kRunTime = 240.0;  // of one alignment on a busy machine, wall clock [s]
constexpr double kBlock = 0.02;     // of samples [s]
constexpr int kSamples = 100;       // in a block

std::string armUrdf() {
  std::ifstream in(sourceFile("urdf/arm.urdf"));
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// A bridge in lockstep by itself: the test is its sensors, its supervisor and its arm, which
/// follows the points exactly.
class Bridge : public ::testing::Test {
 protected:
  Bridge()
      : nh_("bridge"),
        place_(loadCellPlace(sourceFile("config/arm/cell_place.yaml"))),
        kinematics_(armUrdf(), "tool0", "arm"),
        points_(nh_, "arm/command"),
        exciter_(nh_, "arm/exciter"),
        acks_(nh_, "arm/ack"),
        state_(nh_, "plant_state"),
        diagnostics_(nh_, "/diagnostics"),
        poses_(nh_, "carrier_pose") {
    wrench_pubs_[0] = nh_.advertise<WrenchSamples>("sensor_a/wrench_samples", 100, true);
    wrench_pubs_[1] = nh_.advertise<WrenchSamples>("sensor_b/wrench_samples", 100, true);
    joints_pub_ = nh_.advertise<sensor_msgs::JointState>("arm/joint_states", 100, true);
    command_pub_ = nh_.advertise<geometry_msgs::PoseStamped>("carrier_command", 100, true);
    exciter_pub_ = nh_.advertise<Exciter>("exciter", 100, true);
    ack_pub_ = nh_.advertise<Ack>("ack", 100, true);
    stop_pub_ = nh_.advertise<std_msgs::Bool>("arm_bridge/stop", 1, true);
    waitsFor({"tester"});
    q_ = JointVector(6);
    q_ << -0.2, 0.07, 2.1, -0.6, -1.57, 0.0;
    kinematics_.solve(place_.flangeOf(start_), q_);
  }

  void SetUp() override {
    nh_.setParam("arm_description", armUrdf());
    start({});
  }
  void waitsFor(const std::vector<std::string>& nodes) {
    nh_.setParam("arm_bridge/participants", nodes);
  }
  void start(const std::vector<std::string>& more) {
    launch(more);
    block();
  }
  void launch(const std::vector<std::string>& more) {
    std::vector<std::string> command = {executable("arm_bridge"), "__ns:=/bridge",
                                        "_lockstep:=true",
                                        "_scenario:=" + sourceFile("config/scenarios/cell.yaml"),
                                        "_place:=" + sourceFile("config/arm/cell_place.yaml")};
    command.insert(command.end(), more.begin(), more.end());
    bridge_ = std::make_unique<Child>(command);
    ASSERT_TRUE(waitFor([&] {
      return !bridge_->running() ||
             (state_.connected() && ack_pub_.getNumSubscribers() > 0 &&
              joints_pub_.getNumSubscribers() > 0 && command_pub_.getNumSubscribers() > 0 &&
              exciter_pub_.getNumSubscribers() > 0 && stop_pub_.getNumSubscribers() > 0 &&
              points_.connected() && exciter_.connected() && acks_.connected());
    })) << bridge_->output();
    ASSERT_TRUE(bridge_->running()) << bridge_->output();
  }

  ros::Time time(int later = 0) const {
    return ros::Time(100.0) + ros::Duration((blocks_ + later) * kBlock);
  }

  /// State of the arm at the end of a block: 0: the present one.
  void publishJoints(int later = 0) {
    sensor_msgs::JointState joints;
    joints.header.stamp = time(later);
    joints.name = kinematics_.names();
    joints.position.assign(q_.begin(), q_.end());
    joints_pub_.publish(joints);
  }
  /// A block of samples, the arm's state, the answer with all commands; waits for the bridge's.
  void publishBlock() {
    publishJoints(1);
    ASSERT_NO_FATAL_FAILURE(publishSamples());
    ASSERT_TRUE(waitFor([&] {
      const auto last = acks_.last();
      return last && last->sequence == static_cast<std::uint32_t>(blocks_);
    })) << bridge_->output();
  }
  /// The next block without the arm's state.
  void publishSamples() {
    ++blocks_;
    for (std::size_t i = 0; i < 2; ++i) {
      WrenchSamples samples;
      samples.header.stamp = time() - ros::Duration((kSamples - 1) * kBlock / kSamples);
      samples.header.frame_id = i == 0 ? "sensor_a" : "sensor_b";
      samples.period = kBlock / kSamples;
      samples.sequence = static_cast<std::uint32_t>(blocks_);
      for (int k = 0; k < kSamples; ++k) {
        samples.wrench.insert(samples.wrench.end(), wrench_[i].begin(), wrench_[i].end());
      }
      samples.saturated.assign(kSamples, 0);
      wrench_pubs_[i].publish(samples);
    }
    Ack ack;
    ack.node = "tester";
    ack.sequence = static_cast<std::uint32_t>(blocks_);
    ack.commands = commands_;
    ack.session = session_;
    ack_pub_.publish(ack);
  }
  /// The same; waits for the block's points, and the arm follows them.
  void block() {
    ASSERT_NO_FATAL_FAILURE(publishBlock());
    const ros::Time end = time() + ros::Duration(kBlock - 1e-6);
    ASSERT_TRUE(waitFor([&] {
      const auto last = points_.last();
      return last && last->header.stamp >= end;
    })) << bridge_->output();
    if (!follows_) return;
    const auto& positions = points_.last()->points.at(0).positions;
    q_ = JointVector::Map(positions.data(), 6);
  }
  void blocks(int count) {
    for (int i = 0; i < count && !HasFatalFailure(); ++i) block();
  }

  void go(const Pose& X, const std::string& frame = "carrier_base") {
    command_pub_.publish(poseStamped(frame, X, time()));
    ++commands_;
  }
  void shake(bool on) {
    Exciter exciter;
    exciter.header.stamp = time();
    exciter.on = on;
    exciter.amplitude = on ? 2.0 : 0.0;
    exciter.frequency = 770.0;
    exciter.direction = 1;
    exciter_pub_.publish(exciter);
    ++commands_;
  }
  Pose carrier() const { return place_.carrierOf(kinematics_.forward(q_)); }
  bool call(const std::string& name, std::string* message = nullptr) {
    std_srvs::Trigger trigger;
    EXPECT_TRUE(callService(nh_.resolveName("arm_bridge/" + name), trigger));
    if (message != nullptr) *message = trigger.response.message;
    return trigger.response.success;
  }
  bool waitForReason(const std::string& text) {
    return waitFor([&] {
      const auto state = state_.last();
      return state && state->held && state->reason.find(text) != std::string::npos;
    });
  }

  /// The bridge's status with this text in its message.
  std::optional<diagnostic_msgs::DiagnosticStatus> waitForStatus(const std::string& text) {
    std::optional<diagnostic_msgs::DiagnosticStatus> found;
    waitFor([&] {
      for (const auto& array : diagnostics_.all()) {
        for (const auto& status : array->status) {
          if (status.name != "bridge/arm_bridge: arm") continue;
          if (status.message.find(text) != std::string::npos) found = status;
        }
      }
      return found.has_value();
    });
    return found;
  }

  ros::NodeHandle nh_;
  CellPlace place_;
  ArmKinematics kinematics_;
  Record<trajectory_msgs::JointTrajectory> points_;
  Record<Exciter> exciter_;
  Record<Ack> acks_;
  Record<PlantState> state_;
  Record<diagnostic_msgs::DiagnosticArray> diagnostics_;
  Record<geometry_msgs::PoseStamped> poses_;
  std::array<ros::Publisher, 2> wrench_pubs_;
  ros::Publisher joints_pub_, command_pub_, exciter_pub_, ack_pub_, stop_pub_;
  std::unique_ptr<Child> bridge_;
  Pose start_{Eigen::Matrix3d::Identity(), {0.004, -0.003, 0.002}};
  JointVector q_;
  std::array<Vector6, 2> wrench_{Vector6::Zero(), Vector6::Zero()};
  int blocks_ = 0;
  std::uint32_t commands_ = 0, session_ = 0;
  bool follows_ = true;
};

Pose at(double x, double y, double z) { return {Eigen::Matrix3d::Identity(), {x, y, z}}; }

TEST_F(Bridge, BeginsWhereTheArmIsAndMovesToWhereItIsSent) {
  const Pose before = carrier();
  blocks(3);
  // the first points are where the arm is
  for (const auto& point : points_.all()) {
    const auto& p = point->points.at(0).positions;
    const Pose X = place_.carrierOf(kinematics_.forward(JointVector::Map(p.data(), 6)));
    ASSERT_LT((X.p - before.p).norm(), 1e-5);
  }
  go(at(0.01, 0.005, -0.002));
  blocks(40);
  EXPECT_LT((carrier().p - Eigen::Vector3d(0.01, 0.005, -0.002)).norm(), 1e-6);
  // its pose has the stamp of the samples
  const auto pose = poses_.last();
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->header.stamp, time());
  EXPECT_EQ(pose->header.frame_id, "carrier_base");
  EXPECT_NEAR(pose->pose.position.x, 0.01, 1e-6);
}

TEST_F(Bridge, RefusesWhatIsBadByName) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Pose before = carrier();
  const auto refused = [&](const std::string& name) {
    return waitFor([&] {
      const auto state = state_.last();
      return state && state->refused_reason == name;
    });
  };
  go(at(0.01, 0, 0), "world");
  block();
  EXPECT_TRUE(refused("frame_id"));
  go(at(0.11, 0, 0));
  block();
  EXPECT_TRUE(refused("workspace"));
  go(at(0, kNan, 0));
  block();
  EXPECT_TRUE(refused("not_finite"));
  go({rotationFromVector({Eigen::Vector3d(0.4, 0, 0)}), {0, 0, 0}});
  block();
  EXPECT_TRUE(refused("max_rotation"));
  command_pub_.publish(poseStamped("carrier_base", at(0.01, 0, 0), ros::Time()));
  ++commands_;
  block();
  EXPECT_TRUE(refused("stale"));
  blocks(3);
  EXPECT_LT((carrier().p - before.p).norm(), 1e-6);
}

TEST_F(Bridge, AForceHoldsItUntilAPersonResumes) {
  session_ = 5;
  blocks(2);
  shake(true);
  go(at(0.05, 0, 0));
  blocks(10);
  wrench_[0](1) = 120.0;
  blocks(1);
  EXPECT_TRUE(waitForReason("max_force: contact force of sensor_a is 120 N"));
  ASSERT_TRUE(waitFor([&] { return exciter_.last() && !exciter_.last()->on; }));
  blocks(10);
  const Pose held = carrier();
  go(at(0.02, 0, 0));
  blocks(3);
  EXPECT_LT((carrier().p - held.p).norm(), 1e-9);
  wrench_[0](1) = 0.0;
  blocks(3);
  EXPECT_TRUE(state_.last()->held);
  EXPECT_TRUE(call("resume"));
  blocks(2);
  go(at(0.02, 0, 0));
  blocks(30);
  EXPECT_LT((carrier().p - Eigen::Vector3d(0.02, 0, 0)).norm(), 1e-6);
}

TEST_F(Bridge, AStopIsForGoodByServiceAndByTopic) {
  go(at(0.05, 0, 0));
  blocks(5);
  EXPECT_TRUE(call("stop"));
  EXPECT_TRUE(waitForReason("stop: the service stop was called"));
  blocks(10);
  std::string why;
  EXPECT_FALSE(call("resume", &why));
  EXPECT_NE(why.find("start the bridge again"), std::string::npos) << why;
  session_ = 9;
  const Pose stopped = carrier();
  go(at(0.02, 0, 0));
  blocks(5);
  EXPECT_LT((carrier().p - stopped.p).norm(), 1e-9);
  // a restarted bridge receives a latched stop
  bridge_->stop();
  std_msgs::Bool stop;
  stop.data = true;
  stop_pub_.publish(stop);
  session_ = commands_ = 0;
  start_ = stopped;
  start({});
  EXPECT_TRUE(waitForReason("published stop"));
  EXPECT_FALSE(call("resume"));
}

TEST_F(Bridge, AnArmThatStaysBehindIsHeldAndNotSentBack) {
  go(at(0.05, 0, 0));
  blocks(4);
  follows_ = false;
  blocks(12);
  EXPECT_TRUE(waitForReason("following: the arm is"));
  const JointVector stuck = q_;
  blocks(5);
  EXPECT_TRUE(call("resume"));
  blocks(1);
  const auto& positions = points_.last()->points.at(0).positions;
  EXPECT_LT((JointVector::Map(positions.data(), 6) - stuck).cwiseAbs().maxCoeff(), 1e-5);
}

TEST_F(Bridge, AnotherSessionsCommandsAreRefused) {
  session_ = 3;
  blocks(2);
  ros::NodeHandle other;
  Child publisher({"rostopic", "pub", "-l", "/bridge/carrier_command", "geometry_msgs/PoseStamped",
                   "{header: {stamp: {secs: 100, nsecs: 50000000}, frame_id: carrier_base}, "
                   "pose: {orientation: {w: 1.0}}}"});
  EXPECT_TRUE(waitFor([&] {
    block();
    const auto state = state_.last();
    return state && state->refused_reason == "held_by_another";
  }));
}

/// The same arm with one limit of one joint changed, as the bridge reads it.
std::string withLimit(const std::string& joint, const std::string& limit, double value) {
  std::string urdf = armUrdf();
  const std::size_t from =
      urdf.find(limit + "=\"", urdf.find("<limit", urdf.find("name=\"" + joint)));
  const std::size_t begin = from + limit.size() + 2;
  return urdf.replace(begin, urdf.find('"', begin) - begin, std::to_string(value));
}

/// A bridge whose limits are wide except those of the joints.
class Joints : public Bridge {
 protected:
  void SetUp() override {}
  // from the arm's first pose
  void begin(const std::string& urdf) {
    if (bridge_) bridge_->stop();
    nh_.setParam("arm_description", urdf);
    session_ = commands_ = 0;
    blocks_ += 100;  // a later time, so that nothing of the last run counts
    q_ = first_;
    publishJoints();  // latched: the next bridge doesn't start where the last one ended
    points_.clear();
    start({"_max_speed:=0.25", "_max_acceleration:=10", "_delay:=0", "_max_force:=1e5",
           "_max_torque:=1e5", "_max_raw_force:=1e6", "_max_raw_torque:=1e6", "_max_following:=1",
           "_max_following_turn:=10"});
    session_ = 2;
    blocks(2);
  }
  // after the move: how far each joint went, and how fast at most [rad], [rad/s]
  void goThere() {
    go(there_);
    for (int i = 0; i < 200 && !there() && !state_.last()->held; ++i) blocks(1);
    blocks(10);
    ASSERT_FALSE(HasFatalFailure());
    low_ = high_ = first_;
    fastest_ = JointVector::Zero(6);
    for (const auto& point : points_.all()) {
      const auto& p = point->points.at(0);
      const JointVector q = JointVector::Map(p.positions.data(), 6);
      low_ = low_.cwiseMin(q);
      high_ = high_.cwiseMax(q);
      fastest_ = fastest_.cwiseMax(JointVector::Map(p.velocities.data(), 6).cwiseAbs());
    }
  }
  bool there() const { return (carrier().p - there_.p).norm() < 1e-4; }
  bool heldBy(const std::string& joint) {
    return waitForReason("unreachable: ") && state_.last()->reason.find(joint) != std::string::npos;
  }

  const JointVector first_ = q_;
  const Pose there_{rotationFromVector({Eigen::Vector3d(0.15, -0.1, 0.2)}), {0.05, 0.04, 0.02}};
  JointVector low_, high_, fastest_;
};

// The same command with the URDF's own limits and with one of them tight: each limit by itself
// stops the motion. No point passes it.
TEST_F(Joints, EachPositionLimitHoldsByItself) {
  begin(armUrdf());
  goThere();
  ASSERT_TRUE(there()) << bridge_->output();
  ASSERT_FALSE(state_.last()->held) << state_.last()->reason;
  const JointVector way = q_ - first_;
  for (Eigen::Index k = 0; k < 6; ++k) {
    const std::string& joint = kinematics_.names()[static_cast<std::size_t>(k)];
    ASSERT_GT(std::abs(way(k)), 0.01) << joint;
    const double limit = first_(k) + 0.5 * way(k);
    begin(withLimit(joint, way(k) > 0.0 ? "upper" : "lower", limit));
    goThere();
    EXPECT_TRUE(heldBy(joint)) << joint << ": " << state_.last()->reason;
    EXPECT_FALSE(there()) << joint;
    // std::to_string has six digits
    EXPECT_LE(way(k) > 0.0 ? high_(k) - limit : limit - low_(k), 1e-6) << joint;
  }
}

TEST_F(Joints, EachSpeedLimitHoldsByItself) {
  begin(armUrdf());
  goThere();
  ASSERT_TRUE(there()) << bridge_->output();
  const JointVector free = fastest_;
  for (Eigen::Index k = 0; k < 6; ++k) {
    const std::string& joint = kinematics_.names()[static_cast<std::size_t>(k)];
    const double limit = 0.5 * free(k);
    begin(withLimit(joint, "velocity", limit));
    goThere();
    EXPECT_TRUE(heldBy(joint)) << joint << ": " << state_.last()->reason;
    EXPECT_FALSE(there()) << joint;
    EXPECT_LE(fastest_(k), limit + 1e-6) << joint;
  }
}

// The inverse kinematics moves such a joint to its limit: the first point would be millimetres
// away.
TEST_F(Joints, AJointBeyondItsLimitHoldsTheArmWithoutAPoint) {
  const std::string& joint = kinematics_.names()[5];
  for (const double beyond : {0.62, 0.02}) {
    const double limit = 0.01 * std::round(100.0 * (first_(5) - beyond));
    session_ = commands_ = 0;
    blocks_ += 100;
    q_ = first_;
    publishJoints();
    points_.clear();
    state_.clear();
    if (bridge_) bridge_->stop();
    nh_.setParam("arm_description", withLimit(joint, "upper", limit));
    ASSERT_NO_FATAL_FAILURE(launch({}));
    for (int i = 0; i < 3; ++i) ASSERT_NO_FATAL_FAILURE(publishBlock());
    const std::string reason =
        "unreachable: joint " + joint + text(" is at %.7g rad, its limits are ", first_(5));
    ASSERT_TRUE(waitForReason(reason)) << state_.last()->reason;
    EXPECT_NE(state_.last()->reason.find(text(" to %g rad", limit)), std::string::npos);
    EXPECT_TRUE(waitFor([&] { return bridge_->running() && !bridge_->lines(reason).empty(); }))
        << bridge_->output();
    std::string why;
    EXPECT_FALSE(call("resume", &why));
    EXPECT_EQ(why, state_.last()->reason);
    // neither does a new session, nor a command
    session_ = 7;
    go(at(0.01, 0, 0));
    for (int i = 0; i < 3; ++i) ASSERT_NO_FATAL_FAILURE(publishBlock());
    EXPECT_TRUE(state_.last()->held);
    // moved back by hand it is still held, until a person resumes it
    q_(5) = limit - 0.1;
    for (int i = 0; i < 3; ++i) ASSERT_NO_FATAL_FAILURE(publishBlock());
    EXPECT_EQ(points_.size(), 0U);
    EXPECT_TRUE(call("resume"));
    const Pose before = carrier();
    blocks(3);
    EXPECT_EQ(bridge_->lines(reason).size(), 1U) << bridge_->output();
    for (const auto& point : points_.all()) {
      const auto& p = point->points.at(0).positions;
      const Pose X = place_.carrierOf(kinematics_.forward(JointVector::Map(p.data(), 6)));
      ASSERT_LT((X.p - before.p).norm(), 1e-5);
    }
  }
}

/// Whose bridge is started by the test.
class SharedStates : public Bridge {
 protected:
  void SetUp() override { nh_.setParam("arm_description", armUrdf()); }
  // another device on the arm's topic
  static std::unique_ptr<Child> device(const std::string& topic, const std::string& type,
                                       const std::string& message) {
    return std::make_unique<Child>(std::vector<std::string>{"rostopic", "pub", "-r", "50",
                                                            "/bridge/arm/" + topic, type, message});
  }
};

TEST_F(SharedStates, AGripperOnTheArmsTopicIsPassedOver) {
  const auto gripper = device("joint_states", "sensor_msgs/JointState",
                              "{header: {stamp: {secs: 1}}, name: [finger, thumb], "
                              "position: [.nan, 1.0e+9]}");
  ASSERT_NO_FATAL_FAILURE(launch({}));
  const std::string lack = "the joints " + kinematics_.names()[0];
  // before the arm's first state the only message is named
  ASSERT_NO_FATAL_FAILURE(publishSamples());
  const auto status = waitForStatus(lack);
  ASSERT_TRUE(status) << bridge_->output();
  EXPECT_NE(status->message.find("has finger, thumb"), std::string::npos) << status->message;
  EXPECT_EQ(status->level, diagnostic_msgs::DiagnosticStatus::WARN);
  diagnostics_.clear();
  blocks(5);
  ASSERT_FALSE(HasFatalFailure());
  go(at(0.01, 0, 0));
  blocks(30);
  EXPECT_LT((carrier().p - Eigen::Vector3d(0.01, 0, 0)).norm(), 1e-6);
  EXPECT_TRUE(bridge_->lines("the stream is that of").empty()) << bridge_->output();
  const auto following = waitForStatus("following");
  ASSERT_TRUE(following);
  EXPECT_EQ(following->message, "following");
}

TEST_F(SharedStates, JointsWithAPrefixAreNamed) {
  ASSERT_NO_FATAL_FAILURE(launch({}));
  sensor_msgs::JointState joints;
  joints.header.stamp = time();
  for (const std::string& name : kinematics_.names()) joints.name.push_back("left_" + name);
  joints.position.assign(6, 0.0);
  joints_pub_.publish(joints);
  ASSERT_NO_FATAL_FAILURE(publishSamples());
  const auto status = waitForStatus("similar are left_" + kinematics_.names()[0]);
  ASSERT_TRUE(status) << bridge_->output();
  EXPECT_TRUE(waitFor([&] {
    return bridge_->running() && !bridge_->lines("similar are left_").empty();
  })) << bridge_->output();
  EXPECT_EQ(points_.size(), 0U);
}

TEST_F(SharedStates, ANodeThatDoesNotAnswerIsNamed) {
  waitsFor({"tester", "emulate_arm"});
  ASSERT_NO_FATAL_FAILURE(launch({}));
  publishJoints(1);
  ASSERT_NO_FATAL_FAILURE(publishSamples());
  const auto status = waitForStatus("a block waits for the answer of emulate_arm (never answered)");
  ASSERT_TRUE(status) << bridge_->output();
  EXPECT_TRUE(waitFor([&] {
    return bridge_->running() && !bridge_->lines("waits for the answer of emulate_arm").empty();
  })) << bridge_->output();
}

TEST_F(SharedStates, ThePointsThatAreCountedWereSent) {
  ASSERT_NO_FATAL_FAILURE(launch({}));
  blocks(3);
  ASSERT_TRUE(waitFor([&] {
    diagnostics_.clear();
    const auto status = waitForStatus("following");
    if (!status) return false;
    for (const auto& value : status->values) {
      if (value.key == "Points sent") return value.value == std::to_string(points_.size());
    }
    return false;
  })) << points_.size();
}

// Poses in another frame are refused by name, and take nothing over.
TEST_F(SharedStates, PosesInAnotherFrameAreRefusedByName) {
  ros::Publisher pose_pub = nh_.advertise<geometry_msgs::PoseStamped>("arm/current_pose", 10, true);
  for (const std::string frame : {"world", "", "/arm_base"}) {
    if (bridge_) bridge_->stop();
    blocks_ += 100;
    session_ = commands_ = 0;
    pose_pub.publish(poseStamped(frame, kinematics_.forward(q_), time()));
    diagnostics_.clear();
    bridge_ = std::make_unique<Child>(
        std::vector<std::string>{executable("arm_bridge"), "__ns:=/bridge", "_lockstep:=true",
                                 "_scenario:=" + sourceFile("config/scenarios/cell.yaml"),
                                 "_place:=" + sourceFile("config/arm/cell_place.yaml"),
                                 "_state:=pose", "_interface:=pose", "_base_frame:=arm_base"});
    ASSERT_TRUE(waitFor([&] {
      return acks_.connected() && pose_pub.getNumSubscribers() > 0 &&
             ack_pub_.getNumSubscribers() > 0;
    })) << bridge_->output();
    ASSERT_NO_FATAL_FAILURE(publishSamples());
    const auto status = waitForStatus("frame_id is \"" + frame + "\": give \"arm_base\"");
    ASSERT_TRUE(status) << bridge_->output();
    pose_pub.publish(poseStamped("arm_base", kinematics_.forward(q_), time()));
    ASSERT_TRUE(waitFor([&] {
      const auto last = poses_.last();
      return last && last->header.stamp == time();
    })) << bridge_->output();
  }
}

TEST(BadParameters, EndTheNodeWithALine) {
  ros::NodeHandle nh("bad");
  nh.setParam("arm_description", armUrdf());
  const auto refusal = [](const std::vector<std::string>& more) {
    std::vector<std::string> command = {executable("arm_bridge"), "__ns:=/bad",
                                        "_scenario:=" + sourceFile("config/scenarios/cell.yaml")};
    command.insert(command.end(), more.begin(), more.end());
    Child node(command);
    EXPECT_EQ(node.wait(), 1);
    return node.output();
  };
  const std::string place = "_place:=" + sourceFile("config/arm/cell_place.yaml");
  EXPECT_NE(refusal({"_place:=nowhere.yaml"}).find("nowhere.yaml"), std::string::npos);
  EXPECT_NE(refusal({place, "_max_force:=-1"}).find("max_force"), std::string::npos);
  const std::string unknown = refusal({place, "_max_force:=60", "_slow:=1"});
  EXPECT_NE(unknown.find("slow"), std::string::npos) << unknown;
  const std::string slash = refusal({place, "_base_frame:=/arm_base"});
  EXPECT_NE(slash.find("parameter ~base_frame is \"/arm_base\""), std::string::npos) << slash;
  const std::string link = refusal({place, "_base_frame:=tool0"});
  EXPECT_NE(link.find("parameter ~base_frame is \"tool0\", a link that is not at the root"),
            std::string::npos)
      << link;
}

// The whole cell through bridge and arm: in lockstep, independent of the load of the machine.
TEST(ArmCell, AlignsThroughBridgeAndArm) {
  const std::string file = test::temporaryFile("arm_report.yaml");
  ros::NodeHandle nh;
  const Record<geometry_msgs::PoseStamped> poses(nh, "carrier_pose");
  const Record<CarrierMotion> motion(nh, "carrier_motion");
  Child cell({"roslaunch", "assembly_cell", "cell.launch", "lockstep:=true", "slow_factor:=10",
              "paused:=true", "arm:=true", "twin_force:=false"});
  ASSERT_TRUE(waitFor([&] { return !cell.running() || (poses.connected() && motion.connected()); }))
      << cell.output();
  Child report({executable("report"), "_report_file:=" + file, "_strategy:=touch"});
  EXPECT_TRUE(waitFor([&] { return !report.running() || !cell.running(); }, kRunTime))
      << report.output();
  EXPECT_TRUE(cell.running()) << cell.output();
  EXPECT_EQ(report.wait(), 0) << report.output() << cell.output();
  std_srvs::Trigger reset;
  ASSERT_TRUE(ros::service::call("peg_hole_simulator/reset", reset));
  EXPECT_FALSE(reset.response.success);
  EXPECT_EQ(reset.response.message.rfind("reset refused: an arm", 0), 0U) << reset.response.message;
  cell.stop();
  ASSERT_EQ(access(file.c_str(), R_OK), 0);
  const YAML::Node read = YAML::LoadFile(file);
  unlink(file.c_str());
  EXPECT_TRUE(read["success"].as<bool>());
  EXPECT_TRUE(read["truth_known"].as<bool>());
  EXPECT_LT(read["edge_reach"].as<double>(), read["hole_radius"].as<double>());
  // reported and actual pose differ by sag and repeatability only
  ASSERT_GT(poses.size(), 100u);
  ASSERT_GT(motion.size(), 1000u);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::arm_test
