// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <signal.h>
#include <std_srvs/Trigger.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/GetCalibration.h"
#include "assembly_cell/Lease.h"
#include "assembly_cell/MoveToContactAction.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/RetreatAction.h"
#include "assembly_cell/SetBias.h"
#include "assembly_cell/SetCalibration.h"
#include "assembly_cell/SetState.h"
#include "assembly_cell/SupervisorState.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/scene/scenario.h"
#include "cell_fixture.h"
#include "contact_force.h"

// A slowed-down cell without lockstep whose nodes die, freeze and are disturbed during goals. Times
// are cell time, from stamps.
namespace assembly_cell::ros_bridge::supervisor_faults_test {
namespace {

using actionlib::SimpleClientGoalState;
using test::Child;
using test::executable;
using test::Record;
using test::waitFor;

constexpr double kStamp = 1e-6;  // rounding of stamps [s]

class Faults : public ::testing::Test {
 protected:
  Faults()
      : plant_(nh_, "plant_state"),
        leases_(nh_, "lease"),
        state_(nh_, "assembly_supervisor/state"),
        carrier_(nh_, "carrier_pose"),
        contacts_(nh_, "truth/contacts"),
        align_(nh_, "align", false),
        press_(nh_, "move_to_contact", false),
        retreat_(nh_, "retreat", false) {}

  void SetUp() override {
    start("peg_hole_simulator", "peg_hole_simulator", "/faults");
    for (const std::string sensor : {"sensor_a", "sensor_b"}) {
      start("driver of " + sensor, "force_sensor_driver", "/faults/" + sensor, "driver");
    }
    start("locus_estimator", "locus_estimator", "/faults");
    start("assembly_supervisor", "assembly_supervisor", "/faults");
    ASSERT_TRUE(waitForCell());
  }
  void TearDown() override { nh_.deleteParam("peg_hole_simulator/noise"); }
  void start(const std::string& what, const std::string& program, const std::string& ns,
             const std::string& name = "") {
    nodes_[what] = std::make_unique<Child>(std::vector<std::string>{
        executable(program), "__ns:=" + ns, "__name:=" + (name.empty() ? program : name)});
  }
  bool waitForCell() {
    return waitFor([this] {
      return align_.isServerConnected() && press_.isServerConnected() &&
             retreat_.isServerConnected() && plant_.last() && state_.last() &&
             carrier_.size() > 0 && contacts_.connected() && leases_.connected();
    });
  }
  Child& node(const std::string& name) { return *nodes_.at(name); }

  void startAlign() {
    AlignPegGoal goal;
    goal.strategy = "single_contact";
    align_.sendGoal(goal);
  }
  // during a locus measurement: pressed, with the exciter on
  bool shaking() { return plant_.last()->session != 0 && plant_.last()->exciter; }
  template <class Client>
  SimpleClientGoalState finish(Client& client) {
    EXPECT_TRUE(waitFor([&] { return client.getState().isDone(); }, 120.0))
        << "the goal doesn't end";
    return client.getState();
  }
  SimpleClientGoalState press(double force) {
    MoveToContactGoal goal;
    goal.force = force;
    press_.sendGoal(goal);
    return finish(press_);
  }
  // contact force now, ground truth [N]
  double force() {
    const std::size_t n = contacts_.size();
    EXPECT_TRUE(waitFor([&] { return contacts_.size() > n + 2; }));
    return test::liftingForce(*contacts_.last());
  }
  // first state of the plant from `from` on in which it has stopped
  PlantState::ConstPtr held(std::size_t from) const {
    const auto all = plant_.all();
    for (std::size_t i = from; i < all.size(); ++i) {
      if (all[i]->held) return all[i];
    }
    return nullptr;
  }
  std::string reason() { return align_.getResult()->report.reason; }

  ros::NodeHandle nh_{"/faults"};
  std::map<std::string, std::unique_ptr<Child>> nodes_;
  Record<PlantState> plant_;
  Record<Lease> leases_;
  Record<SupervisorState> state_;
  Record<geometry_msgs::PoseStamped> carrier_;
  Record<ContactArray> contacts_;
  actionlib::SimpleActionClient<AlignPegAction> align_;
  actionlib::SimpleActionClient<MoveToContactAction> press_;
  actionlib::SimpleActionClient<RetreatAction> retreat_;
};

TEST_F(Faults, AKilledSupervisorStopsThePlantAndAnotherOneContinues) {
  Child report(
      {executable("report"), "__ns:=/faults", "_unpause:=false", "_strategy:=single_contact"});
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  const std::size_t before = plant_.size();
  node("assembly_supervisor").signal(SIGKILL);
  ASSERT_TRUE(waitFor([&] { return held(before) != nullptr; }));
  EXPECT_FALSE(held(before)->exciter);
  EXPECT_EQ(held(before)->reason.rfind("expired", 0), 0U) << held(before)->reason;
  // plant clock, from the last block that the supervisor has received; killed between two
  // connections, it may have sent the lease of one block more to the plant alone
  constexpr double kBlock = 0.02;
  EXPECT_LE((held(before)->header.stamp - leases_.last()->header.stamp).toSec(),
            0.1 + kBlock + kStamp);
  // the client is notified
  EXPECT_EQ(report.wait(), 1) << report.output();
  EXPECT_EQ(report.lines("server lost").size(), 1U) << report.output();

  // the next supervisor frees the pressed peg first
  const std::uint32_t session = plant_.last()->session;
  start("assembly_supervisor", "assembly_supervisor", "/faults");
  ASSERT_TRUE(waitFor([&] { return state_.connected(); }));
  ASSERT_TRUE(waitForCell());
  ASSERT_EQ(press(8.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  EXPECT_NEAR(force(), 8.0, 0.1 * 8.0);
  EXPECT_NE(plant_.last()->session, session);
  // nor does Ctrl-C leave anything running
  node("assembly_supervisor").stop();
  EXPECT_FALSE(plant_.last()->exciter);
}

TEST_F(Faults, CtrlCEndsAGoalWithTheExciterOffAndThePegFree) {
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  node("assembly_supervisor").signal(SIGTERM);
  EXPECT_EQ(node("assembly_supervisor").wait(), 0) << node("assembly_supervisor").output();
  ASSERT_TRUE(waitFor([this] { return plant_.last()->session == 0; }));
  EXPECT_FALSE(plant_.last()->exciter);
  EXPECT_NEAR(force(), 0.0, 1e-9);
  ASSERT_TRUE(waitFor([this] { return align_.getState().isDone(); }));
  EXPECT_NE(reason().find("shutting down"), std::string::npos) << reason();
}

TEST_F(Faults, ASupervisorOfTheSameNameEndsTheGoalOfTheFirstWithAResult) {
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  const auto first = std::move(nodes_.at("assembly_supervisor"));
  start("assembly_supervisor", "assembly_supervisor", "/faults");
  EXPECT_EQ(first->wait(), 0) << first->output();
  ASSERT_TRUE(waitFor([this] { return align_.getState().isDone(); }));
  ASSERT_TRUE(align_.getResult());
  EXPECT_NE(reason().find("shutting down"), std::string::npos) << reason();
  ASSERT_TRUE(waitForCell());
  EXPECT_EQ(press(8.0).state_, SimpleClientGoalState::SUCCEEDED);
}

TEST_F(Faults, ASecondSupervisorIsRefusedAndNamesTheFirst) {
  XmlRpc::XmlRpcValue parameters;
  ASSERT_TRUE(nh_.getParam("assembly_supervisor", parameters));
  nh_.setParam("other_supervisor", parameters);
  Child other({executable("assembly_supervisor"), "__ns:=/faults", "__name:=other_supervisor"});
  EXPECT_EQ(other.wait(), 1) << other.output();
  EXPECT_EQ(other.lines("action /faults/align is served by /faults/assembly_supervisor").size(), 1U)
      << other.output();
}

TEST_F(Faults, AFrozenSupervisorOnlyDelaysTheGoal) {
  MoveToContactGoal goal;
  goal.force = 12.0;
  const double from = carrier_.last()->pose.position.z;
  press_.sendGoal(goal);
  // during the descent
  ASSERT_TRUE(waitFor([&] { return carrier_.last()->pose.position.z < from - 1e-3; }));
  const std::size_t before = plant_.size();
  node("assembly_supervisor").signal(SIGSTOP);
  ASSERT_TRUE(waitFor([&] { return held(before) != nullptr; }));
  // old blocks queue up meanwhile
  const std::size_t n = carrier_.size();
  ASSERT_TRUE(waitFor([&] { return carrier_.size() > n + 60; }));
  node("assembly_supervisor").signal(SIGCONT);
  EXPECT_EQ(finish(press_).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  double peak = 0.0;
  for (const auto& contacts : contacts_.all()) {
    peak = std::max(peak, test::liftingForce(*contacts));
  }
  EXPECT_LT(peak, 1.1 * 40.0);
  EXPECT_NEAR(force(), 12.0, 0.1 * 12.0);

  // the contact is reported; retreat frees the peg
  EXPECT_TRUE(waitFor([this] { return state_.last()->in_contact; }));
  retreat_.sendGoal(RetreatGoal());
  EXPECT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED)
      << retreat_.getResult()->message;
  EXPECT_TRUE(waitFor([this] { return !state_.last()->in_contact; }));
  EXPECT_NEAR(force(), 0.0, 1e-9);
}

// The measurement is restarted, and the alignment is as accurate as any.
TEST_F(Faults, AFrozenSupervisorRestartsTheMeasurement) {
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  // half a second of cell time later, in the window of the measurement
  const ros::Time on = plant_.last()->header.stamp;
  ASSERT_TRUE(waitFor([&] { return carrier_.last()->header.stamp > on + ros::Duration(0.35); }));
  const std::size_t before = plant_.size();
  node("assembly_supervisor").signal(SIGSTOP);
  ASSERT_TRUE(waitFor([&] { return held(before) != nullptr; }));
  node("assembly_supervisor").signal(SIGCONT);
  // it continues with the next contact
  ASSERT_TRUE(waitFor([&] { return !plant_.last()->held && plant_.last()->exciter; }));
  ASSERT_TRUE(waitFor([&] { return !plant_.last()->exciter; }));
  ASSERT_TRUE(waitFor([&] { return align_.getState().isDone() || shaking(); }));
  EXPECT_FALSE(align_.getState().isDone()) << reason();
  align_.cancelGoal();
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::PREEMPTED) << reason();
}

TEST_F(Faults, AFrozenOrDeadDriverIsNamedAndTheNextGoalWorks) {
  for (const int signal : {SIGSTOP, SIGKILL}) {
    startAlign();
    ASSERT_TRUE(waitFor([this] { return shaking(); }));
    const std::size_t before = plant_.size();
    node("driver of sensor_b").signal(signal);
    EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
    EXPECT_NE(reason().find("sensor_b/wrench_samples of /faults/sensor_b/driver"),
              std::string::npos)
        << reason();
    EXPECT_NE(reason().find(signal == SIGKILL ? "(gone)" : "(silent)"), std::string::npos)
        << reason();
    ASSERT_TRUE(waitFor([&] { return held(before) != nullptr; }));
    ASSERT_TRUE(waitFor([this] { return plant_.last()->session == 0; }));
    EXPECT_FALSE(plant_.last()->exciter);
    EXPECT_TRUE(waitFor([this] { return state_.last()->in_contact && !state_.last()->stuck; }))
        << "not named";
    if (signal == SIGSTOP) {
      node("driver of sensor_b").signal(SIGCONT);
    } else {
      start("driver of sensor_b", "force_sensor_driver", "/faults/sensor_b", "driver");
    }
    ASSERT_EQ(press(8.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
    EXPECT_NEAR(force(), 8.0, 0.1 * 8.0);
  }
}

// A measurement that the estimator didn't finish is requested once more. If the node starts too
// slowly, the goal ends and names it.
TEST_F(Faults, AMeasurementIsRepeatedAfterARestartOfTheEstimator) {
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  const ros::Time on = plant_.last()->header.stamp;
  ASSERT_TRUE(waitFor([&] { return carrier_.last()->header.stamp > on + ros::Duration(0.35); }));
  node("locus_estimator").signal(SIGKILL);
  start("locus_estimator", "locus_estimator", "/faults");
  const auto done = [this] { return align_.getState().isDone(); };
  ASSERT_TRUE(waitFor([&] { return done() || !plant_.last()->exciter; }));
  // it continues with the next contact
  ASSERT_TRUE(waitFor([&] { return done() || shaking(); }));
  if (done()) {
    EXPECT_NE(reason().find("locus_estimator"), std::string::npos) << reason();
  } else {
    align_.cancelGoal();
    EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::PREEMPTED) << reason();
  }
}

// The clock of the restarted plant is far ahead: this cell runs at a third of the wall clock.
TEST_F(Faults, ARestartedPlantIsNamedAndTheNextGoalWorks) {
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  const std::uint32_t life = plant_.last()->life;
  node("peg_hole_simulator").signal(SIGKILL);
  start("peg_hole_simulator", "peg_hole_simulator", "/faults");
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  const bool named = reason().find("restarted") != std::string::npos ||
                     reason().find("peg_hole_simulator") != std::string::npos;
  EXPECT_TRUE(named) << reason();
  ASSERT_TRUE(waitFor([&] { return plant_.last()->life != life; }));
  const std::size_t n = carrier_.size();
  ASSERT_TRUE(waitFor([&] { return carrier_.size() > n + 10; }));
  ASSERT_EQ(press(8.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  EXPECT_NEAR(force(), 8.0, 0.1 * 8.0);
}

TEST_F(Faults, ASensorThatSaturatesByItselfIsNamed) {
  const std::uint32_t life = plant_.last()->life;
  nh_.setParam("peg_hole_simulator/noise", 2.0);
  node("peg_hole_simulator").signal(SIGKILL);
  start("peg_hole_simulator", "peg_hole_simulator", "/faults");
  ASSERT_TRUE(waitFor([&] { return plant_.last()->life != life; }));
  const std::size_t n = carrier_.size();
  ASSERT_TRUE(waitFor([&] { return carrier_.size() > n + 10; }));
  EXPECT_EQ(press(8.0).state_, SimpleClientGoalState::ABORTED);
  const std::string said = press_.getResult()->message;
  EXPECT_EQ(said.rfind("sensor_saturated: sensor_a: channels 1, 2, 3, 4, 5, 6 at their limit", 0),
            0U)
      << said;
  EXPECT_NE(said.find(": /faults/sensor_a/wrench_samples of /faults/sensor_a/driver;"),
            std::string::npos)
      << said;
}

// A supervisor that is started again doesn't know what it has left: pressed, or deep in the hole.
TEST_F(Faults, ARestartedSupervisorDoesNotKnowThePegUntilAGoalShows) {
  const auto restart = [this] {
    node("assembly_supervisor").signal(SIGKILL);
    const std::size_t n = state_.size();
    start("assembly_supervisor", "assembly_supervisor", "/faults");
    ASSERT_TRUE(waitFor([&] {
      return state_.size() > n && state_.last()->reason.rfind("not known: ", 0) == 0;
    })) << state_.last()->reason;
    ASSERT_TRUE(waitForCell());
    EXPECT_TRUE(state_.last()->in_contact);
  };
  const auto retreats = [this] {
    retreat_.sendGoal(RetreatGoal());
    EXPECT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED)
        << retreat_.getResult()->message;
    EXPECT_TRUE(waitFor([this] { return !state_.last()->in_contact; }));
    EXPECT_NEAR(force(), 0.0, 1e-9);
  };
  ASSERT_EQ(press(11.0).state_, SimpleClientGoalState::SUCCEEDED) << press_.getResult()->message;
  restart();
  // a force that can't be held is refused before anything moves
  const double pressed = carrier_.last()->pose.position.z;
  EXPECT_EQ(press(0.01).state_, SimpleClientGoalState::ABORTED);
  EXPECT_NE(press_.getResult()->message.find("give at least"), std::string::npos)
      << press_.getResult()->message;
  EXPECT_NEAR(carrier_.last()->pose.position.z, pressed, 1e-6);
  EXPECT_TRUE(state_.last()->in_contact);
  retreats();
  startAlign();
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::SUCCEEDED) << reason();

  const Scenario scenario =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  const PegParameters& peg = scenario.mechanism.peg;
  constexpr double kDeep = 0.0147;  // [m]
  SetState service;
  service.request.peg.position.z = -kDeep;
  service.request.peg.orientation.w = 1.0;
  service.request.carrier.position.z = peg.half_height + peg.coupling_height - kDeep;
  service.request.carrier.orientation.w = 1.0;
  ASSERT_TRUE(ros::service::call(nh_.resolveName("peg_hole_simulator/set_state"), service));
  ASSERT_TRUE(service.response.success) << service.response.message;
  restart();
  const double from = carrier_.last()->pose.position.z;
  retreats();
  EXPECT_GT(carrier_.last()->pose.position.z - from, kDeep);
}

// Without data the identifier can't free the peg. The supervisor reports the contact until it is
// resolved.
TEST_F(Faults, AContactLeftByTheIdentifierIsReported) {
  ros::Publisher identifier = nh_.advertise<SupervisorState>("mechanism_identifier/state", 1, true);
  SupervisorState left;
  left.in_contact = true;
  left.reason = "no block of samples";
  identifier.publish(left);
  ASSERT_TRUE(waitFor([this] { return state_.last()->reason == "identify: no block of samples"; }));
  EXPECT_TRUE(state_.last()->in_contact);
  EXPECT_FALSE(state_.last()->stuck);
  retreat_.sendGoal(RetreatGoal());
  EXPECT_EQ(finish(retreat_).state_, SimpleClientGoalState::SUCCEEDED);
  EXPECT_TRUE(waitFor([this] { return !state_.last()->in_contact; }));
}

TEST_F(Faults, ACancelledGoalLeavesAFreePeg) {
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  EXPECT_GT(force(), 1.0);
  align_.cancelGoal();
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::PREEMPTED);
  EXPECT_EQ(reason(), "cancelled");
  EXPECT_NEAR(force(), 0.0, 1e-9);
  ASSERT_TRUE(waitFor([this] { return state_.last()->goal.empty(); }));
  EXPECT_FALSE(state_.last()->in_contact);
  EXPECT_FALSE(plant_.last()->exciter);
}

TEST_F(Faults, CommandsAndZeroesOfOthersEndTheGoalAndAreNamed) {
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  {
    Child other_node({"/proc/self/exe", "--other-node", "__ns:=/faults"});
    EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
    EXPECT_EQ(reason().rfind("/faults/other_node published exciter", 0), 0U) << reason();
  }
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  SetBias zero;
  zero.request.bias[2] = 20.0;
  ASSERT_TRUE(callService("/faults/sensor_b/driver/set_bias", zero));
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  EXPECT_EQ(reason().rfind("zero of sensor_b changed", 0), 0U) << reason();
  std_srvs::Trigger clear;
  ASSERT_TRUE(callService("/faults/sensor_b/driver/clear_bias", clear));

  GetCalibration own;
  ASSERT_TRUE(callService("/faults/sensor_b/driver/get_calibration", own));
  SetCalibration other;
  other.request.calibration = own.response.calibration;
  other.request.calibration.volts_to_wrench[0] *= 1.001;
  startAlign();
  ASSERT_TRUE(waitFor([this] { return shaking(); }));
  ASSERT_TRUE(callService("/faults/sensor_b/driver/set_calibration", other));
  EXPECT_EQ(finish(align_).state_, SimpleClientGoalState::ABORTED);
  EXPECT_EQ(reason().rfind("calibration of sensor_b changed", 0), 0U) << reason();
}

}  // namespace

}  // namespace assembly_cell::ros_bridge::supervisor_faults_test
