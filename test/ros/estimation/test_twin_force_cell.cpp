// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <ros/serialization.h>
#include <rosbag/bag.h>
#include <std_srvs/Trigger.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpc.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/AddContact.h"
#include "assembly_cell/AlignPegActionFeedback.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/BeginTwinForce.h"
#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/SolveTwinForce.h"
#include "assembly_cell/TareTwinForce.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/estimation/twin_sensing.h"
#include "assembly_cell/align/search/search_frame.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "cell_fixture.h"
#include "temporary_folder.h"

// The strategy twin_force of the supervisor with the node twin_force_estimator.
namespace assembly_cell::ros_bridge::twin_force_cell_test {
namespace {

using test::Child;
using test::executable;
using test::Record;
using test::waitFor;

constexpr double kRunTime = 120.0;  // of one alignment on a busy machine, wall clock [s]

// The cell in lockstep, paused until an alignment begins; its messages are recorded.
class TwinCell {
 public:
  explicit TwinCell(std::vector<std::string> arguments) : cell_(command(std::move(arguments))) {
    EXPECT_TRUE(waitFor([&] {
      return !cell_.running() ||
             (a.connected() && b.connected() && displacement.connected() && carrier.connected() &&
              calibration_a.connected() && calibration_b.connected() && reports.connected() &&
              feedback.connected());
    })) << cell_.output();
  }

  // empty if it doesn't end in time; calls `meanwhile` while it waits
  template <class Meanwhile>
  std::string align(const Meanwhile& meanwhile) {
    Child report({executable("report"), "_strategy:=twin_force",
                  "_report_file:=" + test::temporaryFile("report.yaml")});
    meanwhile();
    EXPECT_TRUE(waitFor([&] { return !report.running() || !cell_.running(); }, kRunTime))
        << report.output();
    EXPECT_TRUE(cell_.running()) << cell_.output();
    EXPECT_TRUE(waitFor([&] { return reports.size() > 0; }));
    return reports.size() > 0 ? reports.last()->reason : "";
  }

 private:
  static std::vector<std::string> command(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"roslaunch", "assembly_cell", "cell.launch",
                                         "lockstep:=true", "slow_factor:=10", "paused:=true"});
    return arguments;
  }

  ros::NodeHandle nh_;

 public:
  Record<WrenchSamples> a{nh_, "sensor_a/wrench_samples"}, b{nh_, "sensor_b/wrench_samples"};
  Record<DisplacementSamples> displacement{nh_, "sensor_b/displacement_samples"};
  Record<geometry_msgs::PoseStamped> carrier{nh_, "carrier_pose"};
  Record<SensorCalibration> calibration_a{nh_, "sensor_a/calibration"};
  Record<SensorCalibration> calibration_b{nh_, "sensor_b/calibration"};
  Record<TwinForceState> states{nh_, "twin_force/status"};
  Record<AlignmentReport> reports{nh_, "report"};
  Record<AlignPegActionFeedback> feedback{nh_, "align/feedback"};

 private:
  Child cell_;
};

// As `rosnode kill`, without its delay of seconds in which the alignment would continue.
void endNode(const std::string& name) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = name;
  ASSERT_TRUE(ros::master::execute("lookupNode", request, response, uri, false)) << name;
  std::string host;
  std::uint32_t port = 0;
  ASSERT_TRUE(ros::network::splitURI(std::string(uri), host, port)) << std::string(uri);
  request[1] = "the test's end of a node";
  XmlRpc::XmlRpcClient(host.c_str(), static_cast<int>(port), "/")
      .execute("shutdown", request, response);
}

Pose poseOf(const geometry_msgs::Pose& pose) { return fromPose(pose, "test"); }

TwinForceSolution solutionOf(const TwinForceState& state) {
  TwinForceSolution out;
  out.X_HP = poseOf(state.reference_pose.pose);
  out.covariance = Matrix6::Map(state.reference_pose.covariance.data());
  return out;
}

// All bits except header.seq, which ROS counts by itself.
std::vector<std::uint8_t> bits(TwinForceState state) {
  state.header.seq = 0;
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(state));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, state);
  return bytes;
}

// States of the node after `solve`: a contact alone doesn't change the pose.
std::vector<TwinForceState::ConstPtr> solved(const TwinCell& cell) {
  std::vector<TwinForceState::ConstPtr> out;
  for (const auto& state : cell.states.all()) {
    if (!state->pose_known) continue;
    const auto& covariance = state->reference_pose.covariance;
    if (out.empty() || out.back()->reference_pose.covariance != covariance) out.push_back(state);
  }
  return out;
}

class TwinForceCell : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    cell_ = std::make_unique<TwinCell>(std::vector<std::string>{"strategy:=twin_force"});
    reason_ = cell_->align([] {});
  }
  static void TearDownTestSuite() { cell_.reset(); }

  // distances of the reported tilt and offset from the node's pose with the sag of the peg as it
  // hung over ten blocks from `first` on
  struct Distance {
    double tilt, offset;
  };
  Distance error(const AlignmentReport& report, const TwinForceState& state, std::size_t first) {
    const auto blocks = cell_->displacement.all();
    ContactWindow window;
    for (std::size_t i = first; i < first + 10; ++i) {
      const auto& values = blocks[i]->displacement;
      const BlockMoments d = momentsOf(values.data(), values.size() / 6);
      window.add({Vector6::Zero(), Matrix6::Zero(), d.count},
                 {Vector6::Zero(), Matrix6::Zero(), d.count}, d.mean);
    }
    std::string urdf;
    EXPECT_TRUE(ros::param::get("/robot_description", urdf));
    const Pose X_CP = loadCellDescription(urdf).X_BP;
    const Pose X_HQ = poseOf(state.reference_pose.pose) * deflectedPeg(X_CP, window.displacement());
    const Eigen::Vector2d tilt = axisTilt(X_HQ.R.col(2));
    return {std::hypot(report.estimated_tilt[0] - tilt.x(), report.estimated_tilt[1] - tilt.y()),
            std::hypot(report.estimated_offset[0] + X_HQ.p.x(),
                       report.estimated_offset[1] + X_HQ.p.y())};
  }

  static std::unique_ptr<TwinCell> cell_;
  static std::string reason_;
};

std::unique_ptr<TwinCell> TwinForceCell::cell_;
std::string TwinForceCell::reason_;

TEST_F(TwinForceCell, ReportsTheEstimateOfTheNode) {
  ASSERT_EQ(reason_, "aligned");
  const AlignmentReport report = *cell_->reports.last();
  const auto states = solved(*cell_);
  ASSERT_FALSE(states.empty());
  const TwinForceState& last = *states.back();
  EXPECT_GE(report.contacts, 3U);
  EXPECT_EQ(last.contacts.size(), report.contacts);

  // each solution in the strategy's messages is that of the node, to the last bit
  std::vector<double> reported;
  for (const auto& f : cell_->feedback.all()) {
    if (f->feedback.state != "solve") continue;
    reported.push_back(f->feedback.position_sd);
    EXPECT_GT(f->feedback.clearance_sd, 0.0);
  }
  std::vector<double> known;
  for (const auto& state : states) {
    known.push_back(std::sqrt(centerCovariance(solutionOf(*state)).topLeftCorner<2, 2>().trace()));
  }
  EXPECT_EQ(reported, known);

  // so is the report's tilt: with the sag of one of the windows in which the peg hung at the start;
  // its offset is that of the walls: from the node's it is less than the clearance, in which the
  // first descent ended
  Distance nearest{std::numeric_limits<double>::infinity(), 0.0};
  for (std::size_t i = 0;
       cell_->displacement.all()[i + 9]->header.stamp < last.contacts[0].zero_window[0]; ++i) {
    const Distance now = error(report, last, i);
    if (now.tilt < nearest.tilt) nearest = now;
  }
  EXPECT_LT(nearest.tilt, 1e-12);
  EXPECT_LT(nearest.offset, 1e-4);
}

TEST_F(TwinForceCell, MovesToTheAdvisedContacts) {
  const auto states = solved(*cell_);
  ASSERT_GE(states.size(), 2U);
  for (std::size_t k = 0; k + 1 < states.size(); ++k) {
    const TwinForceState &before = *states[k], &after = *states[k + 1];
    ASSERT_TRUE(before.advice_known);
    ASSERT_EQ(after.contacts.size(), before.contacts.size() + 1);
    const Pose advised = poseOf(before.advised_pose);
    const auto miss = [&](const FeltContact& contact) {
      const Pose made = poseOf(before.reference_pose.pose) * poseOf(contact.move);
      return std::hypot((made.p - advised.p).head<2>().norm(),
                        0.1 * vectorFromRotation(made.R.transpose() * advised.R).value.norm());
    };
    // except the travel of the lateral pull and of the press; the previous contact is elsewhere
    EXPECT_LT(miss(after.contacts.back()), 5e-4) << k;
    EXPECT_GT(miss(before.contacts.back()), 2e-3) << k;
  }
}

// The node's state has the windows: the same services with a bag lead to the same state.
TEST_F(TwinForceCell, ReplayHasTheSameEstimateToTheLastBit) {
  const auto states = solved(*cell_);
  ASSERT_FALSE(states.empty());
  const TwinForceState& live = *states.back();
  const std::string file = test::temporaryFile("blocks.bag");
  {
    rosbag::Bag bag(file, rosbag::bagmode::Write);
    const ros::Time start = cell_->a.all().front()->header.stamp;
    bag.write("/sensor_a/calibration", start, *cell_->calibration_a.last());
    bag.write("/sensor_b/calibration", start, *cell_->calibration_b.last());
    for (const auto& m : cell_->a.all()) bag.write("/sensor_a/wrench_samples", m->header.stamp, *m);
    for (const auto& m : cell_->b.all()) bag.write("/sensor_b/wrench_samples", m->header.stamp, *m);
    for (const auto& m : cell_->displacement.all()) {
      bag.write("/sensor_b/displacement_samples", m->header.stamp, *m);
    }
    for (const auto& m : cell_->carrier.all()) bag.write("/carrier_pose", m->header.stamp, *m);
  }

  ros::NodeHandle nh("replay");
  std::string urdf;
  ASSERT_TRUE(ros::param::get("/robot_description", urdf));
  nh.setParam("robot_description", urdf);
  ros::param::set("/replay/cell_player/topics",
                  std::vector<std::string>{"sensor_a/wrench_samples", "sensor_b/wrench_samples",
                                           "sensor_b/displacement_samples", "sensor_a/calibration",
                                           "sensor_b/calibration", "carrier_pose"});
  ros::param::set("/replay/cell_player/participants",
                  std::vector<std::string>{"twin_force_estimator=sensor_a/wrench_samples+sensor_b/"
                                           "wrench_samples+sensor_b/displacement_samples"});
  Child node({executable("twin_force_estimator"), "__ns:=/replay", "__name:=twin_force_estimator",
              "_scenario:=" + test::sourceFile("config/scenarios/cell.yaml"), "_lockstep:=true"});
  Child player({executable("cell_player"), "__ns:=/replay", "__name:=cell_player", "_bag:=" + file,
                "_rate:=fast"});
  EXPECT_EQ(player.wait(), 0) << player.output();
  EXPECT_EQ(player.lines("the bag is over").size(), 1U) << player.output();
  // as users play it, with the locus estimator in lockstep, too
  Child launch({"roslaunch", "assembly_cell", "replay.launch", "bag:=" + file, "ns:=/both",
                "rate:=fast", "clock:=false", "twin_force:=true"});
  EXPECT_EQ(launch.wait(), 0) << launch.output();
  EXPECT_EQ(launch.lines("the bag is over").size(), 1U) << launch.output();
  EXPECT_EQ(launch.lines("died").size(), 0U) << launch.output();

  // as the supervisor requested
  const std::string space = "/replay/twin_force_estimator/";
  BeginTwinForce begin;
  begin.request.task = live.task;
  ASSERT_TRUE(callService(space + "begin", begin));
  ASSERT_TRUE(begin.response.success) << begin.response.message;
  for (const FeltContact& contact : live.contacts) {
    TareTwinForce tare;
    tare.request.first = contact.zero_window[0];
    tare.request.last = contact.zero_window[1];
    tare.request.blocks = contact.zero_blocks;
    ASSERT_TRUE(callService(space + "tare_window", tare));
    ASSERT_TRUE(tare.response.success) << tare.response.message;
    AddContact add;
    add.request.first = contact.window[0];
    add.request.last = contact.window[1];
    add.request.blocks = contact.blocks;
    ASSERT_TRUE(callService(space + "add_contact", add));
    ASSERT_TRUE(add.response.success) << add.response.message;
  }
  SolveTwinForce solve;
  ASSERT_TRUE(callService(space + "solve", solve));
  EXPECT_TRUE(solve.response.success) << solve.response.message;
  EXPECT_EQ(bits(solve.response.status), bits(live));
}

// The carrier's encoders scatter by 10 um in this cell, the estimator's limit of motion.
TEST(TwinForceCellUnknown, AlignsWhereEncodersScatter) {
  TwinCell cell({"strategy:=twin_force", "mismatch:=" + std::string(ASSEMBLY_CELL_SOURCE_DIR) +
                                             "/config/mismatch/level_2.yaml"});
  EXPECT_EQ(cell.align([] {}), "aligned");
}

// Without the node, or if it dies, the alignment ends and names it.
TEST(TwinForceCellWithout, NamesAMissingNode) {
  TwinCell cell({"strategy:=twin_force", "twin_force:=false"});
  const std::string reason = cell.align([] {});
  EXPECT_EQ(reason.find("no service twin_force_estimator/begin within"), 0U) << reason;
  EXPECT_EQ(reason.find('\n'), std::string::npos);
}

TEST(TwinForceCellWithout, NamesANodeThatDies) {
  TwinCell cell({"strategy:=twin_force"});
  const std::string reason = cell.align([&] {
    ASSERT_TRUE(
        waitFor([&] { return cell.states.last() && !cell.states.last()->contacts.empty(); }));
    endNode("/twin_force_estimator");
  });
  // its service fails or its status stays out, whichever is noticed first
  EXPECT_TRUE(test::has(reason, " service twin_force_estimator/") ||
              test::has(reason, "twin_force/status of /twin_force_estimator (gone)"))
      << reason;
  EXPECT_EQ(reason.find('\n'), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::twin_force_cell_test
