// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <signal.h>
#include <std_msgs/String.h>
#include <std_srvs/Trigger.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpc.h>

#include <cstdint>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/IdentifyAction.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/align/search/scale.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"
#include "temporary_folder.h"

// The action identify of mechanism_identifier, and the supervisor with an identified mechanism.
namespace assembly_cell::ros_bridge::mechanism_identifier_test {
namespace {

using test::Child;
using test::executable;
using test::Record;
using test::waitFor;
using Client = actionlib::SimpleActionClient<IdentifyAction>;

constexpr double kRunTime = 240.0;  // on a busy machine, wall clock [s]
constexpr double kShort = 5.0;      // of an identification: the hanging peg alone [s]

// Of a node that the launch has started.
pid_t processOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = node;
  std::string host;
  std::uint32_t port = 0;
  const bool known = ros::master::execute("lookupNode", request, response, uri, false) &&
                     ros::network::splitURI(std::string(uri), host, port);
  XmlRpc::XmlRpcValue question, answer;
  question[0] = ros::this_node::getName();
  if (!known || !XmlRpc::XmlRpcClient(host.c_str(), static_cast<int>(port), "/")
                     .execute("getPid", question, answer)) {
    throw std::runtime_error("no node " + node);
  }
  return static_cast<pid_t>(int(answer[2]));
}

// The cell in lockstep; its mechanism_identifier writes to a temporary file.
class Cell {
 public:
  explicit Cell(std::vector<std::string> arguments) : cell_(command(std::move(arguments))) {
    EXPECT_TRUE(waitFor([&] {
      return !cell_.running() || (exciter.connected() && states.connected());
    })) << cell_.output();
    EXPECT_TRUE(cell_.running()) << cell_.output();
  }

  // reason in the supervisor's report; empty if the goal doesn't end in time
  std::string align(
      const std::string& strategy = "auto", const std::function<void()>& meanwhile = [] {}) {
    Child report({executable("report"), "_strategy:=" + strategy});
    meanwhile();
    EXPECT_TRUE(waitFor([&] { return !report.running() || !cell_.running(); }, kRunTime))
        << report.output();
    EXPECT_TRUE(waitFor([&] { return reports.size() > 0; })) << report.output();
    return reports.size() > 0 ? reports.last()->reason : "";
  }
  std::string output() const { return cell_.output(); }

  const std::string file = test::temporaryFile("mechanism.yaml");

 private:
  std::vector<std::string> command(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(),
                     {"roslaunch", "assembly_cell", "cell.launch", "lockstep:=true",
                      "slow_factor:=10", "mechanism_file:=" + file});
    return arguments;
  }

  ros::NodeHandle nh_;

 public:
  Record<Exciter> exciter{nh_, "exciter"};
  Record<SupervisorState> states{nh_, "assembly_supervisor/state"};
  Record<AlignmentReport> reports{nh_, "report"};

 private:
  Child cell_;
};

TEST(MechanismIdentifier, StoresTheResultAndCanBeCancelled) {
  Cell cell({"identification:=true"});
  Client client("identify", false);
  ASSERT_TRUE(waitFor([&] { return client.isServerConnected(); })) << cell.output();

  IdentifyGoal goal;
  ros::NodeHandle nh;
  const Record<geometry_msgs::PoseStamped> commands(nh, "carrier_command");
  const auto refused = [&](const std::string& words) {
    client.sendGoal(goal);
    ASSERT_TRUE(waitFor([&] { return client.getState().isDone(); }, kRunTime));
    EXPECT_EQ(client.getState(), actionlib::SimpleClientGoalState::ABORTED);
    EXPECT_EQ(client.getState().getText().rfind(words, 0), 0u) << client.getState().getText();
  };
  goal.time_limit = 2.0;
  refused("time_limit is 2 s");
  goal.time_limit = std::numeric_limits<double>::quiet_NaN();
  refused("time_limit is nan s");
  // before anything moves
  goal.time_limit = 0.0;
  goal.file = "/nowhere/mechanism.yaml";
  refused("file '/nowhere/mechanism.yaml' can't be written (open: No such file or directory)");
  EXPECT_EQ(commands.size(), 0u);
  goal.file.clear();

  Record<IdentifyActionFeedback> feedback(nh, "identify/feedback");
  ASSERT_TRUE(waitFor([&] { return feedback.connected(); }));
  client.sendGoal(goal);
  ASSERT_TRUE(waitFor([&] {
    const auto last = feedback.last();
    return last && last->feedback.readings > 0;
  })) << cell.output();
  client.cancelGoal();
  ASSERT_TRUE(waitFor([&] { return client.getState().isDone(); }, kRunTime));
  EXPECT_EQ(client.getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  ASSERT_TRUE(waitFor([&] {
    const auto last = cell.exciter.last();
    return last && !last->on;
  }));

  // a reset of the plant ends the goal with this reason
  feedback.clear();
  client.sendGoal(goal);
  ASSERT_TRUE(waitFor([&] {
    const auto last = feedback.last();
    return last && last->feedback.readings > 0;
  })) << cell.output();
  std_srvs::Trigger reset;
  ASSERT_TRUE(callService("peg_hole_simulator/reset", reset));
  ASSERT_TRUE(waitFor([&] { return client.getState().isDone(); }, kRunTime));
  EXPECT_EQ(client.getState().getText(), "the plant was restarted, or reset, during the goal");

  // the identifier frees a peg that the supervisor has left pressed; both report that
  actionlib::SimpleActionClient<MoveToContactAction> press("move_to_contact", false);
  ASSERT_TRUE(waitFor([&] { return press.isServerConnected(); }));
  MoveToContactGoal force;
  force.force = 5.0;
  press.sendGoal(force);
  ASSERT_TRUE(waitFor([&] { return press.getState().isDone(); }, kRunTime));
  ASSERT_EQ(press.getState(), actionlib::SimpleClientGoalState::SUCCEEDED)
      << press.getResult()->message;
  ASSERT_TRUE(waitFor([&] { return cell.states.last()->in_contact; }));

  goal.time_limit = 2 * kShort;  // freeing the peg takes some
  feedback.clear();
  client.sendGoal(goal);
  ASSERT_TRUE(waitFor([&] { return client.getState().isDone(); }, kRunTime)) << cell.output();
  EXPECT_TRUE(waitFor([&] { return !cell.states.last()->in_contact; }))
      << cell.states.last()->reason;
  const IdentifyResultConstPtr result = client.getResult();
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->accepted) << result->verdict << " " << result->message;
  EXPECT_EQ(result->file, cell.file);
  EXPECT_GT(result->readings, 4u);
  ASSERT_EQ(result->parameters.size(), result->values.size());
  const KnownMechanism known = loadKnownMechanism(cell.file);
  EXPECT_TRUE(known.identified);
  // the cell is as drawn, 5e4 N/m; the prior's standard deviation is 10 %
  EXPECT_NEAR(known.mechanism.coupling.stiffness.diagonal[1], 5e4, 2e3);
  // latched
  Record<std_msgs::String> news(nh, "mechanism");
  ASSERT_TRUE(waitFor([&] { return news.size() > 0; }));
  std::ifstream stored(cell.file);
  EXPECT_EQ(news.last()->data, std::string(std::istreambuf_iterator<char>(stored), {}));
  unlink(cell.file.c_str());
}

// Through the bridge and an emulated arm with a latency of 0.1 s.
TEST(MechanismIdentifier, MeasuresDelayAndStiffnessOfAnArm) {
  Cell cell({"identification:=true", "arm:=true", "arm_latency:=0.1"});
  Client client("identify", false);
  ASSERT_TRUE(waitFor([&] { return client.isServerConnected(); })) << cell.output();
  IdentifyGoal goal;
  const auto done = [&] {
    client.sendGoal(goal);
    ASSERT_TRUE(waitFor([&] { return client.getState().isDone(); }, kRunTime)) << cell.output();
  };
  goal.target = "leg";
  done();
  EXPECT_EQ(client.getState().getText(), "target is 'leg': give mechanism or arm");
  goal.target = "arm";
  goal.time_limit = 10.0;
  done();
  EXPECT_EQ(client.getState().getText().rfind("time_limit is 10 s: target arm", 0), 0u);
  goal.time_limit = 0.0;
  goal.file = test::temporaryFile("arm.yaml");
  done();
  const IdentifyResultConstPtr result = client.getResult();
  ASSERT_TRUE(result);
  ASSERT_TRUE(result->accepted) << result->message;
  EXPECT_EQ(result->parameters, (std::vector<std::string>{"arm.delay", "arm.stiffness"}));
  EXPECT_EQ(result->message.rfind("arm: {delay: 0.1", 0), 0u) << result->message;
  const Mechanism drawn = loadMechanism(test::sourceFile("config/scenarios/cell.yaml"));
  const Mechanism stored = loadMechanism(goal.file);
  ASSERT_EQ(result->values.size(), 2u);
  EXPECT_EQ(stored.arm.delay, result->values[0]);
  // 0.1 s of latency, what the arm's drive, the bridge and two blocks take besides
  EXPECT_GT(stored.arm.delay, 0.12);
  EXPECT_LT(stored.arm.delay, 0.18);
  EXPECT_LT(stored.arm.delay_sd, 0.003);
  EXPECT_NEAR(stored.arm.stiffness * (pressCompliance(drawn) + 5e-7), 1.0, 0.03);
  EXPECT_EQ(result->file, goal.file);
  unlink(goal.file.c_str());
}

// The file of another cell is refused by name before anything is pressed. With ~identify the
// supervisor has this cell identified, and aligns.
TEST(MechanismIdentifier, AWrongFileIsRefusedOrReplaced) {
  const std::string wrong = test::temporaryFile("wrong.yaml");
  Child identify({executable("identify"), test::sourceFile("config/scenarios/cell.yaml"),
                  "--time-limit", "5", "--set", "peg.mass=0.45", "--set", "carrier.mass=0.6",
                  "--out", wrong});
  ASSERT_EQ(identify.wait(kRunTime), 0) << identify.output();
  {
    Cell cell({"paused:=true", "mechanism:=" + wrong});
    const std::string reason = cell.align();
    EXPECT_EQ(reason.find("wrong_mechanism: "), 0u) << reason;
    ASSERT_GT(cell.reports.size(), 0u);
    EXPECT_EQ(cell.reports.last()->contacts, 0u);
    // until a matching mechanism is published
    ros::NodeHandle nh;
    ros::Publisher identifier = nh.advertise<std_msgs::String>("mechanism", 1, true);
    std_msgs::String text;
    text.data = "peg: {mass: .nan}";
    identifier.publish(text);
    text.data = mechanismText(loadMechanism(test::sourceFile("config/scenarios/cell.yaml")));
    ASSERT_TRUE(waitFor([&] { return identifier.getNumSubscribers() > 0; }));
    identifier.publish(text);
    std::string then;  // a message may come after the next goal has begun
    for (int i = 0; i < 3 && then != "aligned"; ++i) {
      cell.reports.clear();
      then = cell.align();
    }
    EXPECT_EQ(then, "aligned") << cell.output();
  }
  Cell cell({"paused:=true", "mechanism:=" + wrong, "identify:=true", "identify_time:=5"});
  EXPECT_EQ(cell.align(), "aligned") << cell.output();
  EXPECT_EQ(access(cell.file.c_str(), R_OK), 0);
  unlink(cell.file.c_str());
  unlink(wrong.c_str());
}

// The supervisor waits for the identifier as long as that is running.
TEST(MechanismIdentifier, TheSupervisorNamesAnIdentifierThatDies) {
  Cell cell({"paused:=true", "identify:=true"});
  ros::NodeHandle nh;
  Record<IdentifyActionFeedback> feedback(nh, "identify/feedback");
  const std::string reason = cell.align("single_contact", [&] {
    EXPECT_TRUE(waitFor([&] { return feedback.size() > 0; }, kRunTime)) << cell.output();
    kill(processOf("/mechanism_identifier"), SIGKILL);
  });
  EXPECT_NE(reason.find("identify/status of /mechanism_identifier (gone)"), std::string::npos)
      << reason;
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::mechanism_identifier_test
