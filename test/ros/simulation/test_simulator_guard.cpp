// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/Lease.h"
#include "assembly_cell/PlantState.h"
#include "contact_force.h"
#include "simulator_fixture.h"

// Lease, watchdog, limits and boots of the plant, as nodes see them. The guard itself has tests of
// its own, with a clock of its own: test/guard.
namespace assembly_cell::ros_bridge::simulator_guard_test {
namespace {

using test::Child;
using test::executable;

class SimulatorGuard : public Simulator {
 protected:
  SimulatorGuard() : state_(nh_, "plant_state") {}

  void SetUp() override {
    Simulator::SetUp();
    ASSERT_TRUE(waitFor([this] { return state_.last() != nullptr; }));
  }
  void TearDown() override {
    session_ = 0;
    step(2);
  }
  PlantState state() const { return *state_.last(); }
  // what the plant says after some more blocks
  PlantState stateAfter(std::uint32_t blocks) {
    const std::size_t before = carrier_.size();
    EXPECT_TRUE(step(blocks).success);
    EXPECT_TRUE(waitFor([&] { return carrier_.size() >= before + blocks && synchronous(); }));
    return state();
  }
  void shake(double amplitude) {
    Exciter exciter;
    exciter.header.stamp = carrier_.last()->header.stamp;
    exciter.on = true;
    exciter.amplitude = amplitude;
    exciter.frequency = 450.0;
    exciter.direction = 1;
    sendExciter(exciter);
  }
  geometry_msgs::PoseStamped down(double way) const {
    auto command = restCommand(0.0);
    command.pose.position.z = start_.p.z() - way;
    return command;
  }
  Record<PlantState> state_;
};

TEST_F(SimulatorGuard, RefusesWhatIsBeyondItsLimitsByName) {
  stateAfter(1);
  const std::uint32_t before = state().refused;
  shake(1000.0);
  EXPECT_TRUE(waitFor([&] { return stateAfter(1).refused == before + 1; }));
  EXPECT_EQ(state().refused_reason, "max_amplitude");
  EXPECT_EQ(state().refused_node, ros::this_node::getName());
  EXPECT_NE(state().refusal.find("amplitude is 1000 N, allowed are 0 to 50 N"), std::string::npos)
      << state().refusal;
  EXPECT_FALSE(state().exciter);
  sendCommand(down(0.2));
  EXPECT_TRUE(waitFor([&] { return stateAfter(1).refused == before + 2; }));
  EXPECT_EQ(state().refused_reason, "workspace");
  EXPECT_TRUE(waitFor([&] {
    return diagnostic("Last refusal").find("workspace") != std::string::npos;
  })) << diagnostic("Last refusal");
}

// 20 mm into the face, from where the carrier comes at full speed: without a limit 12.9 kN
TEST_F(SimulatorGuard, StopsAtItsLoadAndLetsItBeTakenOff) {
  stateAfter(1);
  sendCommand(down(-0.015));
  ASSERT_TRUE(waitFor([&] {
    stateAfter(10);
    return std::abs(carrier_.last()->pose.position.z - start_.p.z() - 0.015) < 1e-6;
  }));
  sendCommand(down(0.02));
  ASSERT_TRUE(waitFor([&] { return stateAfter(10).overload; }));
  EXPECT_TRUE(state().held);
  EXPECT_EQ(state().reason.rfind("max_force: load of the coupling is ", 0), 0U) << state().reason;
  EXPECT_NE(state().reason.find("when the carrier has stopped"), std::string::npos)
      << state().reason;
  stateAfter(50);
  double peak = 0.0;
  for (const auto& contacts : contacts_.all()) {
    peak = std::max(peak, test::liftingForce(*contacts));
  }
  // stopped ahead: a tenth of the limit is where contact is sensed, the rest is what a stop costs
  EXPECT_GT(peak, 60.0);
  EXPECT_LT(peak, 110.0);
  const double pressed = carrier_.last()->pose.position.z;
  const std::uint32_t refused = state().refused;
  sendCommand(down(0.02));
  EXPECT_TRUE(waitFor([&] { return stateAfter(5).refused > refused; }));
  EXPECT_EQ(state().refused_reason, "overloaded");
  EXPECT_NEAR(carrier_.last()->pose.position.z, pressed, 1e-6);
  sendCommand(restCommand(0.0));
  EXPECT_TRUE(waitFor([&] { return !stateAfter(20).overload; }));
  EXPECT_TRUE(waitFor([&] {
    stateAfter(20);
    return std::abs(carrier_.last()->pose.position.z - start_.p.z()) < 1e-6;
  }));
}

TEST_F(SimulatorGuard, WhileASessionHoldsThePlantOthersAreRefused) {
  stateAfter(1);
  shake(1.0);
  ASSERT_TRUE(waitFor([&] { return stateAfter(1).exciter; }));
  session_ = 41;
  ASSERT_TRUE(waitFor([&] { return stateAfter(1).session == 41; }));
  EXPECT_EQ(state().holder, ros::this_node::getName());
  EXPECT_FALSE(state().exciter) << "a session begins with the exciter off";

  const std::uint32_t refused = state().refused;
  Child other_node({"/proc/self/exe", "--other-node"});
  EXPECT_TRUE(waitFor([&] { return stateAfter(1).refused > refused; }));
  EXPECT_EQ(state().refused_reason, "held_by_another");
  EXPECT_EQ(state().refused_node, "/other_node");
  EXPECT_FALSE(state().exciter);

  // the holder itself may
  shake(1.0);
  EXPECT_TRUE(waitFor([&] { return stateAfter(1).exciter; }));
  // and switches off when it releases the plant
  session_ = 0;
  EXPECT_TRUE(waitFor([&] { return stateAfter(1).session == 0; }));
  EXPECT_FALSE(state().exciter);
}

TEST_F(SimulatorGuard, AHolderThatFallsSilentIsADeadMan) {
  // paced by the wall clock: a lease once a block, then none
  Record<PlantState> state(nh_, "paced/plant_state");
  Record<geometry_msgs::PoseStamped> carrier(nh_, "paced/carrier_pose");
  ros::Publisher leases = nh_.advertise<Lease>("paced/lease", 100);
  ros::Publisher moves = nh_.advertise<geometry_msgs::PoseStamped>("paced/carrier_command", 100);
  ASSERT_TRUE(waitFor([&] {
    return state.last() && carrier.size() > 1 && leases.getNumSubscribers() > 0 &&
           moves.getNumSubscribers() > 0;
  }));
  ros::Time seen;
  const auto lease = [&] {
    Lease message;
    message.session = 77;
    message.header.stamp = seen = carrier.last()->header.stamp;
    leases.publish(message);
  };
  const auto held = [&] { return state.last()->session == 77 && state.last()->held; };
  ASSERT_TRUE(waitFor([&] {
    lease();
    return state.last()->session == 77 && !state.last()->held;
  }));
  // a long way, under way when the holder dies
  const double from = carrier.last()->pose.position.x;
  auto command = restCommand(0.0);
  command.pose.position.x += 0.09;
  ASSERT_TRUE(waitFor([&] {
    lease();
    command.header.stamp = seen;
    moves.publish(command);
    return std::abs(carrier.last()->pose.position.x - from) > 0.001;
  }));
  ASSERT_TRUE(waitFor(held));
  EXPECT_EQ(state.last()->reason.rfind("expired: no sign of life of ", 0), 0U);
  EXPECT_LE((state.last()->header.stamp - seen).toSec(), 0.1 + kStamp);
  // it stops, short of the goal, and stays
  const std::size_t n = carrier.size();
  ASSERT_TRUE(waitFor([&] { return carrier.size() > n + 20; }));
  const double at = carrier.all()[n + 10]->pose.position.x;
  EXPECT_LT(at - from, 0.08);
  EXPECT_NEAR(carrier.last()->pose.position.x, at, 1e-5);
  // who fell silent holds nothing a second later
  EXPECT_TRUE(waitFor([&] { return state.last()->session == 0; }));
}

// What is kept for a plant from before it came to life does not move it.
TEST_F(SimulatorGuard, ARestartedPlantDoesNotMoveByItself) {
  const std::string ns = "/again/";
  std::string description;
  ASSERT_TRUE(ros::param::get("/robot_description", description));
  ros::param::set(ns + "robot_description", description);
  ros::Publisher moves =
      nh_.advertise<geometry_msgs::PoseStamped>(ns + "carrier_command", 100, true);
  ros::Publisher shakes = nh_.advertise<Exciter>(ns + "exciter", 100, true);
  auto command = restCommand(5e-3);
  command.header.stamp = ros::Time::now();
  moves.publish(command);
  Exciter exciter;  // without a stamp, as from a command line
  exciter.on = true;
  exciter.amplitude = 1.0;
  exciter.frequency = 450.0;
  exciter.direction = 1;
  shakes.publish(exciter);

  Child plant({executable("peg_hole_simulator"), "__ns:=/again", "/tf:=tf", "/tf_static:=tf_static",
               "_scenario:=" + sourceFile("config/scenarios/cell.yaml"), "_publish_truth:=false"});
  Record<PlantState> state(nh_, ns + "plant_state");
  Record<geometry_msgs::PoseStamped> carrier(nh_, ns + "carrier_pose");
  ASSERT_TRUE(waitFor([&] { return state.last() && state.last()->refused >= 2; }))
      << plant.output();
  EXPECT_EQ(state.last()->refused_reason, "earlier_boot");
  ASSERT_TRUE(waitFor([&] { return carrier.size() > 20; }));
  EXPECT_FALSE(state.last()->exciter);
  EXPECT_NEAR(carrier.last()->pose.position.x, start_.p.x(), 1e-4);
  // sent again it does
  command.header.stamp = carrier.last()->header.stamp;
  moves.publish(command);
  EXPECT_TRUE(waitFor([&] { return carrier.last()->pose.position.x > start_.p.x() + 4e-3; }))
      << plant.output();
  EXPECT_NE(state.last()->life, this->state().life);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::simulator_guard_test
