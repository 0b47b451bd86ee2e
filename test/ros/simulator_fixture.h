// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_msgs/TFMessage.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <thread>

#include "assembly_cell/AccelerometerSamples.h"
#include "assembly_cell/Ack.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/SetState.h"
#include "assembly_cell/Step.h"
#include "assembly_cell/StrainSamples.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/scene/scenario.h"
#include "cell_fixture.h"

namespace assembly_cell::ros_bridge {

using test::Record;
using test::sourceFile;
using test::waitFor;

const double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kBlock = 0.02;        // 100 samples at 5 kHz [s]
constexpr double kStamp = 2e-9;        // stamps are rounded to 1 ns [s]
constexpr double kQuaternion = 1e-12;  // rounding through a quaternion

// Everything the simulator offers, and the only participant of its lockstep.
class Simulator : public ::testing::Test {
 protected:
  Simulator()
      : bridge_a_(nh_, "sensor_a/bridge"),
        bridge_b_(nh_, "sensor_b/bridge"),
        carrier_(nh_, "carrier_pose"),
        truth_(nh_, "truth/pose"),
        contacts_(nh_, "truth/contacts"),
        clock_(nh_, "/clock"),
        tf_(nh_, "/tf"),
        diagnostics_(nh_, "/diagnostics"),
        tf_static_(nh_, "/tf_static"),
        scenario_(loadScenario(sourceFile("config/scenarios/cell.yaml"))),
        X_HB_(carrierBase(scenario_)),
        start_(inverse(X_HB_) * poseFromRest(scenario_.rest)) {
    ack_sub_ = nh_.subscribe<StrainSamples>("sensor_b/bridge", 100,
                                            [this](const StrainSamples::ConstPtr& block) {
                                              if (answering_) acknowledge(block->sequence);
                                            });
  }

  // one life for all tests, as the supervisor's: messages are counted
  static void SetUpTestSuite() {
    ros::NodeHandle nh;
    command_pub_ = nh.advertise<geometry_msgs::PoseStamped>("carrier_command", 100);
    exciter_pub_ = nh.advertise<Exciter>("exciter", 100);
    ack_pub_ = nh.advertise<Ack>("ack", 100);
  }
  static void TearDownTestSuite() {
    for (auto* pub : {&command_pub_, &exciter_pub_, &ack_pub_}) pub->shutdown();
  }

  void SetUp() override {
    ASSERT_TRUE(waitFor([this] {
      return bridge_a_.connected() && bridge_b_.connected() && carrier_.connected() &&
             truth_.last() && contacts_.connected() && clock_.last() && tf_.connected() &&
             diagnostics_.connected() && command_pub_.getNumSubscribers() > 0 &&
             exciter_pub_.getNumSubscribers() > 0 && ack_pub_.getNumSubscribers() > 0;
    })) << "the simulator isn't there";
    pause(true);
    ASSERT_TRUE(trigger("reset").success);
    // what earlier tests have left, also under way
    ASSERT_TRUE(step(1).success);
    ASSERT_TRUE(waitFor([this] { return synchronous(); }));
    for (auto* record : {&bridge_a_, &bridge_b_}) record->clear();
    carrier_.clear();
    truth_.clear();
    clock_.clear();
    contacts_.clear();
  }

  // all topics have come to the same block
  bool synchronous() const {
    const auto a = bridge_a_.last();
    const auto b = bridge_b_.last();
    const auto c = carrier_.last();
    const auto t = truth_.last();
    const auto clock = clock_.last();
    if (!a || !b || !c || !t || !clock || a->sequence != b->sequence) return false;
    const ros::Time end = b->header.stamp + ros::Duration(kBlock - b->period);
    return std::abs((c->header.stamp - end).toSec()) < kStamp &&
           t->header.stamp == c->header.stamp && clock->clock == c->header.stamp;
  }

  void acknowledge(std::uint32_t sequence) {
    Ack ack;
    ack.node = "tester";
    ack.sequence = sequence;
    ack.commands = commands_;
    ack.session = session_;
    ack_pub_.publish(ack);
  }
  std_srvs::SetBool::Response pause(bool data) {
    std_srvs::SetBool service;
    service.request.data = data;
    EXPECT_TRUE(callService("peg_hole_simulator/pause", service));
    return service.response;
  }
  Step::Response step(std::uint32_t blocks) {
    Step service;
    service.request.blocks = blocks;
    EXPECT_TRUE(callService("peg_hole_simulator/step", service));
    return service.response;
  }
  std_srvs::Trigger::Response trigger(const std::string& name) {
    std_srvs::Trigger service;
    EXPECT_TRUE(callService("peg_hole_simulator/" + name, service));
    return service.response;
  }
  void sendCommand(const geometry_msgs::PoseStamped& command) {
    ++commands_;
    command_pub_.publish(command);
  }
  void sendExciter(const Exciter& exciter) {
    ++commands_;
    exciter_pub_.publish(exciter);
  }
  geometry_msgs::PoseStamped restCommand(double dx) const {
    geometry_msgs::PoseStamped command;
    command.header.frame_id = "carrier_base";
    command.pose = toPose({start_.R, start_.p + Eigen::Vector3d(dx, 0.0, 0.0)});
    return command;
  }
  // value of a key in the simulator's diagnostics
  std::string diagnostic(const std::string& key) const {
    const auto all = diagnostics_.all();
    for (auto it = all.rbegin(); it != all.rend(); ++it) {
      for (const auto& status : (*it)->status) {
        if (status.name != "peg_hole_simulator: simulation") continue;
        if (key == "message") return status.message;
        for (const auto& value : status.values) {
          if (value.key == key) return value.value;
        }
      }
    }
    return "";
  }

  ros::NodeHandle nh_;
  Record<StrainSamples> bridge_a_, bridge_b_;
  Record<geometry_msgs::PoseStamped> carrier_, truth_;
  Record<ContactArray> contacts_;
  Record<rosgraph_msgs::Clock> clock_;
  Record<tf2_msgs::TFMessage> tf_;
  Record<diagnostic_msgs::DiagnosticArray> diagnostics_;
  Record<tf2_msgs::TFMessage> tf_static_;
  Scenario scenario_;
  Pose X_HB_;   // the carrier's base, true
  Pose start_;  // of the carrier in it
  ros::Subscriber ack_sub_;
  std::atomic<bool> answering_{true};
  static ros::Publisher command_pub_, exciter_pub_, ack_pub_;
  static std::atomic<std::uint32_t> commands_;  // published by this node
  std::atomic<std::uint32_t> session_{0};       // with which it holds the plant
};
inline ros::Publisher Simulator::command_pub_, Simulator::exciter_pub_, Simulator::ack_pub_;
inline std::atomic<std::uint32_t> Simulator::commands_{0};

}  // namespace assembly_cell::ros_bridge
