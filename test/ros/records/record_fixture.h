// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>
#include <stdlib.h>

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/AssemblePegAction.h"
#include "assembly_cell/AssemblyVerdict.h"
#include "assembly_cell/RecorderState.h"
#include "assembly_cell/SetPart.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/records/store.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"

// A cell whose supervisor and recorder the test starts, kills and freezes.
namespace assembly_cell::ros_bridge {

class RecordCell : public ::testing::Test {
 protected:
  using Child = test::Child;
  using State = actionlib::SimpleClientGoalState;
  using Client = actionlib::SimpleActionClient<AssemblePegAction>;

  explicit RecordCell(const std::string& ns)
      : ns_(ns),
        nh_(ns),
        state_(nh_, "assembly_supervisor/state"),
        recorder_state_(nh_, "recorder_state"),
        verdicts_(nh_, "run_verdict"),
        commands_(nh_, "carrier_command"),
        carrier_(nh_, "carrier_pose") {}

  void SetUp() override {
    std::string name = ::testing::TempDir() + "records_XXXXXX";
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    store_ = folder_ + "/records.db";
    start("peg_hole_simulator", "peg_hole_simulator");
    for (const std::string sensor : {"sensor_a", "sensor_b"}) {
      start("driver of " + sensor, "force_sensor_driver", {}, "/" + sensor, "driver");
    }
    // in lockstep it waits for the simulator's clock
    assemble_ = std::make_unique<Client>(nh_, "assemble", false);
  }
  void TearDown() override {
    // before the simulator, whose lockstep needs it
    nodes_.erase("assembly_supervisor");
    nodes_.clear();
    std::filesystem::remove_all(folder_);
  }

  void start(const std::string& what, const std::string& program,
             std::vector<std::string> arguments = {}, const std::string& ns = "",
             const std::string& name = "") {
    std::vector<std::string> command = {test::executable(program), "__ns:=" + ns_ + ns,
                                        "__name:=" + (name.empty() ? program : name)};
    command.insert(command.end(), arguments.begin(), arguments.end());
    nodes_.erase(what);
    nodes_[what] = std::make_unique<Child>(command);
  }
  Child& node(const std::string& name) { return *nodes_.at(name); }
  Child& supervisor() { return node("assembly_supervisor"); }
  Child& recorder() { return node("assembly_recorder"); }

  void startSupervisor(const std::string& mode) {
    state_.clear();
    start("assembly_supervisor", "assembly_supervisor", {"_record:=" + mode});
    ASSERT_TRUE(test::waitFor([this] {
      return assemble_->isServerConnected() && state_.last() && carrier_.size() > 0;
    })) << supervisor().output();
  }
  void startRecorder(std::vector<std::string> arguments = {}) {
    recorder_state_.clear();
    arguments.push_back("_store:=" + store_);
    start("assembly_recorder", "assembly_recorder", arguments);
    ASSERT_TRUE(test::waitFor([this] { return recorder_state_.last() != nullptr; }))
        << recorder().output();
  }
  // the supervisor has the state of a recorder that it can reach
  void waitForRecorder() {
    ASSERT_TRUE(test::waitFor([this] {
      const auto state = recorder_state_.last();
      return state && state->writable && subscribers("run_record") > 0 &&
             subscribers("run_verdict") > 1;
    })) << recorder().output();
    // the next state reaches the supervisor as well
    const std::size_t n = recorder_state_.size();
    ASSERT_TRUE(test::waitFor([&] { return recorder_state_.size() > n + 1; }));
  }
  // nodes that subscribe to a topic, as the master has them
  std::size_t subscribers(const std::string& topic) { return registered(1, topic); }
  std::size_t publishers(const std::string& topic) { return registered(0, topic); }

  void resetCell() {
    std_srvs::Trigger reset;
    ASSERT_TRUE(callService(ns_ + "/peg_hole_simulator/reset", reset));
    ASSERT_TRUE(reset.response.success) << reset.response.message;
  }
  void send(double depth, const std::string& serial = "", const std::string& program = "") {
    AssemblePegGoal goal;
    goal.strategy = "touch";
    goal.depth = depth;
    goal.serial = serial;
    goal.program = program;
    assemble_->sendGoal(goal);
  }
  State finish() {
    EXPECT_TRUE(test::waitFor([&] { return assemble_->getState().isDone(); }, 120.0))
        << "the goal doesn't end";
    return assemble_->getState();
  }
  State assemble(double depth, const std::string& serial = "", const std::string& program = "") {
    send(depth, serial, program);
    return finish();
  }
  AlignmentReport report() { return assemble_->getResult()->report; }
  SetPart::Response setPart(const std::string& serial, const std::string& program) {
    SetPart call;
    call.request.serial = serial;
    call.request.program = program;
    EXPECT_TRUE(callService(ns_ + "/assembly_recorder/set_part", call));
    return call.response;
  }
  assembly_cell::Run read(std::int64_t id) {
    return RunStore(store_, RunStore::Access::kRead).read(id);
  }

  const std::string ns_;
  std::string folder_, store_;
  ros::NodeHandle nh_;
  test::Record<SupervisorState> state_;
  test::Record<RecorderState> recorder_state_;
  test::Record<AssemblyVerdict> verdicts_;
  test::Record<geometry_msgs::PoseStamped> commands_, carrier_;
  std::unique_ptr<Client> assemble_;
  std::map<std::string, std::unique_ptr<Child>> nodes_;

 private:
  std::size_t registered(int kind, const std::string& topic) {
    XmlRpc::XmlRpcValue request, response, state;
    request[0] = ros::this_node::getName();
    if (!ros::master::execute("getSystemState", request, response, state, false)) return 0;
    for (int i = 0; i < state[kind].size(); ++i) {
      if (std::string(state[kind][i][0]) == ns_ + "/" + topic) {
        return static_cast<std::size_t>(state[kind][i][1].size());
      }
    }
    return 0;
  }
};

}  // namespace assembly_cell::ros_bridge
