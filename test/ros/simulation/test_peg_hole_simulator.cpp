// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <chrono>
#include <future>

#include "assembly_cell/ros/bridge/service_call.h"
#include "simulator_fixture.h"

namespace assembly_cell::ros_bridge::peg_hole_simulator_test {
namespace {

TEST_F(Simulator, StepPublishesWholeBlocksInSequence) {
  const auto response = step(3);
  ASSERT_TRUE(response.success) << response.message;
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 3 && synchronous(); }));
  EXPECT_EQ(bridge_a_.size(), 3U);
  EXPECT_EQ(carrier_.size(), 3U);
  EXPECT_EQ(truth_.size(), 3U);
  EXPECT_EQ(clock_.size(), 3U);
  const auto a = bridge_a_.all();
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i]->sequence, a[0]->sequence + i);
    EXPECT_EQ(a[i]->header.frame_id, "sensor_a");
    EXPECT_EQ(a[i]->volts.size(), 600U);
    EXPECT_EQ(a[i]->saturated.size(), 100U);
    EXPECT_TRUE(std::isfinite(a[i]->temperature));
    // the first sample one period after the block's start, the last at its end
    const double from_first = (a[i]->header.stamp - a[0]->header.stamp).toSec();
    EXPECT_NEAR(from_first, kBlock * static_cast<double>(i), kStamp);
    const double to_end = (carrier_.all()[i]->header.stamp - a[i]->header.stamp).toSec();
    EXPECT_NEAR(to_end, kBlock - a[i]->period, kStamp);
    EXPECT_EQ(clock_.all()[i]->clock, carrier_.all()[i]->header.stamp);
    EXPECT_EQ(bridge_b_.all()[i]->header.stamp, a[i]->header.stamp);
  }
  EXPECT_EQ(bridge_b_.last()->header.frame_id, "sensor_b");
  EXPECT_EQ(carrier_.last()->header.frame_id, "carrier_base");
  EXPECT_EQ(truth_.last()->header.frame_id, "hole_truth");
}

TEST_F(Simulator, PausedPublishesNothingAndStepNeedsPause) {
  const std::size_t blocks = bridge_b_.size();
  EXPECT_FALSE(step(0).success);
  // the service comes back between two blocks, so nothing is under way
  ASSERT_TRUE(pause(true).success);
  EXPECT_EQ(bridge_b_.size(), blocks);

  ASSERT_TRUE(pause(false).success);
  ASSERT_TRUE(waitFor([&] { return bridge_b_.size() > blocks + 5; }));
  const auto refused = step(1);
  EXPECT_FALSE(refused.success);
  EXPECT_NE(refused.message.find("~pause"), std::string::npos) << refused.message;
  ASSERT_TRUE(pause(true).success);
}

// However many blocks were asked for, a pause or a restart takes effect at the next one.
TEST_F(Simulator, PauseAndResetEndALongStep) {
  for (const std::string end : {"pause", "reset"}) {
    const std::size_t blocks = bridge_b_.size();
    std::future<Step::Response> stepping =
        std::async(std::launch::async, [this] { return step(100000000); });
    ASSERT_TRUE(waitFor([&] { return bridge_b_.size() > blocks + 5; }));
    ASSERT_TRUE(end == "pause" ? pause(true).success : trigger("reset").success);
    ASSERT_EQ(stepping.wait_for(std::chrono::seconds(60)), std::future_status::ready);
    const Step::Response response = stepping.get();
    EXPECT_FALSE(response.success);
    EXPECT_NE(response.message.find(end == "pause" ? "~pause was called" : "was restarted"),
              std::string::npos)
        << response.message;
    EXPECT_NE(response.message.find(" blocks short"), std::string::npos) << response.message;
    // paused it is: the next block is that of the next step
    const std::uint32_t sequence = bridge_b_.last()->sequence;
    ASSERT_TRUE(step(1).success);
    ASSERT_TRUE(waitFor([&] { return bridge_b_.last()->sequence != sequence; }));
    EXPECT_LE(bridge_b_.last()->sequence, sequence + 2);
  }
}

TEST_F(Simulator, CarrierPoseAndTruthStartAsTheScenarioSays) {
  ASSERT_TRUE(trigger("reset").success);
  const Pose start = poseFromRest(scenario_.rest);
  ASSERT_TRUE(waitFor([this] { return truth_.last() != nullptr; }));
  const Pose X_HP = fromPose(truth_.last()->pose, "truth");
  const Eigen::Vector3d center = X_HP.p + scenario_.mechanism.peg.half_height * X_HP.R.col(2);
  EXPECT_LT((center - scenario_.initial.position).norm(), kQuaternion);
  EXPECT_LT((X_HP.R - rotationFromEuler(scenario_.initial.euler)).norm(), kQuaternion);

  ASSERT_TRUE(step(1).success);
  ASSERT_TRUE(waitFor([this] { return carrier_.size() == 1; }));
  const Pose X_HC = X_HB_ * fromPose(carrier_.last()->pose, "carrier");
  // z and tilt are prescribed; x, y and yaw yield by less than 0.1 mm and 1 mrad to the hanging
  // peg
  EXPECT_NEAR(X_HC.p.z(), start.p.z(), kQuaternion);
  EXPECT_LT((X_HC.p - start.p).norm(), 1e-4);
  EXPECT_LT((X_HC.R - start.R).norm(), 1e-3);
}

TEST_F(Simulator, ResetGoesBackToTheStartWhileTheClockGoesOn) {
  ASSERT_TRUE(step(1).success);
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 1; }));
  sendCommand(restCommand(1e-3));
  ASSERT_TRUE(step(10).success);
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 11 && synchronous(); }));
  EXPECT_NEAR(carrier_.last()->pose.position.x, start_.p.x() + 1e-3, 2e-4);
  const ros::Time before = carrier_.last()->header.stamp;
  const std::uint32_t sequence = bridge_b_.last()->sequence;

  ASSERT_TRUE(trigger("reset").success);
  ASSERT_TRUE(step(1).success);
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 12 && synchronous(); }));
  EXPECT_NEAR((carrier_.last()->header.stamp - before).toSec(), kBlock, kStamp);
  EXPECT_EQ(bridge_b_.last()->sequence, sequence + 1);
  EXPECT_NEAR(carrier_.last()->pose.position.x, start_.p.x(), 1e-5);
  // the same seed from the same start gives the same samples
  const auto again = bridge_b_.last()->volts;
  ASSERT_TRUE(trigger("reset").success);
  ASSERT_TRUE(step(1).success);
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 13; }));
  EXPECT_EQ(bridge_b_.last()->volts, again);
}

TEST_F(Simulator, CommandMovesTheRestSmoothlyToItsTarget) {
  sendCommand(restCommand(2e-3));
  ASSERT_TRUE(step(30).success);
  ASSERT_TRUE(waitFor([this] { return carrier_.size() == 30; }));
  double last = start_.p.x();
  double farthest = 0.0;
  for (const auto& pose : carrier_.all()) {
    farthest = std::max(farthest, std::abs(pose->pose.position.x - last));
    last = pose->pose.position.x;
  }
  // never faster than the carrier may be, and a little for the spring that carries it
  EXPECT_LT(farthest, scenario_.mechanism.carrier.max_speed * kBlock + 1e-4);
  EXPECT_GT(farthest, 0.0);
  // the springs yield by the swinging peg's few tenths of a newton over 2e5 N/m
  EXPECT_NEAR(last, start_.p.x() + 2e-3, 1e-5);
}

TEST_F(Simulator, RefusesCommandsThatCannotBeMeant) {
  const auto refusedSoFar = [this] { return std::atoi(diagnostic("Commands refused").c_str()); };
  ASSERT_TRUE(waitFor([this] { return !diagnostic("Commands refused").empty(); }));
  const int before = refusedSoFar();
  auto command = restCommand(1e-3);
  for (const char* frame : {"world", "hole"}) {
    command.header.frame_id = frame;
    sendCommand(command);
  }
  command = restCommand(kNaN);
  sendCommand(command);
  command = restCommand(5.0);  // millimetres taken for metres
  sendCommand(command);
  command = restCommand(1e-3);
  command.pose.orientation.w = 2.0;
  sendCommand(command);
  command.pose.orientation.x = 1.0;  // upside down
  command.pose.orientation.y = command.pose.orientation.z = command.pose.orientation.w = 0.0;
  sendCommand(command);
  Exciter exciter;
  exciter.on = true;
  exciter.amplitude = kNaN;
  exciter.frequency = 770.0;
  exciter.direction = 1;
  sendExciter(exciter);
  exciter.amplitude = 1.0;
  exciter.direction = 3;
  sendExciter(exciter);

  ASSERT_TRUE(step(10).success);
  ASSERT_TRUE(waitFor([&] { return refusedSoFar() == before + 8; }))
      << diagnostic("Commands refused");
  ASSERT_TRUE(waitFor([this] { return carrier_.size() == 10; }));
  EXPECT_NEAR(carrier_.last()->pose.position.x, start_.p.x(), 1e-5);
}

TEST_F(Simulator, ExciterShakesThePeg) {
  const auto spread = [](const StrainSamples& block) {
    double largest = 0.0;
    for (std::size_t channel = 0; channel < 6; ++channel) {
      double sum = 0.0, squares = 0.0;
      for (std::size_t i = channel; i < block.volts.size(); i += 6) {
        sum += block.volts[i];
        squares += block.volts[i] * block.volts[i];
      }
      const double n = static_cast<double>(block.volts.size()) / 6.0;
      largest = std::max(largest, std::sqrt(std::max(0.0, squares / n - sum * sum / n / n)));
    }
    return largest;
  };
  ASSERT_TRUE(step(1).success);
  ASSERT_TRUE(waitFor([this] { return synchronous(); }));
  const double quiet = spread(*bridge_b_.last());
  Exciter exciter;
  exciter.header.stamp = carrier_.last()->header.stamp;
  exciter.on = true;
  exciter.amplitude = 1.0;
  exciter.frequency = 770.0;
  exciter.direction = 1;
  sendExciter(exciter);
  ASSERT_TRUE(step(5).success);
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 6; }));
  const double shaken = spread(*bridge_b_.last());
  EXPECT_GT(shaken, 10.0 * quiet);

  exciter.on = false;
  sendExciter(exciter);
  ASSERT_TRUE(step(50).success);
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 56; }));
  EXPECT_LT(spread(*bridge_b_.last()), 0.1 * shaken);
}

// the peg's accelerometers: sampled only with a subscriber, with the bridges' stamps
TEST_F(Simulator, AccelerometersForWhoListens) {
  ASSERT_TRUE(step(1).success);
  ASSERT_TRUE(waitFor([this] { return synchronous(); }));
  Exciter exciter;
  exciter.header.stamp = carrier_.last()->header.stamp;
  exciter.on = true;
  exciter.amplitude = 1.0;
  exciter.frequency = 770.0;
  exciter.direction = 1;
  sendExciter(exciter);
  const Record<AccelerometerSamples> accelerations(nh_, "accelerometers");
  ASSERT_TRUE(waitFor([&] { return accelerations.connected(); }));
  ASSERT_TRUE(step(10).success);
  ASSERT_TRUE(waitFor([&] { return accelerations.size() == 10 && synchronous(); }));
  const auto block = accelerations.last();
  ASSERT_EQ(block->acceleration.size(), 200u);
  EXPECT_EQ(block->header.stamp, bridge_b_.last()->header.stamp);
  EXPECT_EQ(block->sequence, bridge_b_.last()->sequence);
  EXPECT_EQ(block->header.frame_id, "peg");
  double largest = 0.0;
  for (const double a : block->acceleration) largest = std::max(largest, std::abs(a));
  // 1 N on 0.4 kg and what the coupling adds
  EXPECT_GT(largest, 0.5);
  EXPECT_LT(largest, 50.0);
}

TEST_F(Simulator, WaitsForTheCommandsThatAnAnswerClaims) {
  // one more than has been sent
  ++commands_;
  std::atomic<bool> done{false};
  std::thread stepping([&] {
    step(2);
    done = true;
  });
  ASSERT_TRUE(waitFor([this] { return bridge_b_.size() == 1; }));
  // the answer to block 1 is out, its command isn't: there is no block 2, however long one looks
  EXPECT_FALSE(waitFor([&] { return done || bridge_b_.size() > 1; }, 0.5));
  command_pub_.publish(restCommand(1e-3));
  stepping.join();
  EXPECT_TRUE(waitFor([this] { return bridge_b_.size() == 2; }));
}

TEST_F(Simulator, SetStatePutsThePegAndReportsContacts) {
  SetState service;
  // upright, its edge 1 mm over the plane and beside the hole
  const double length =
      scenario_.mechanism.peg.half_height + scenario_.mechanism.peg.coupling_height;
  service.request.peg.position = toPoint({0.010, 0.0, 0.001});
  service.request.peg.orientation.w = 1.0;
  service.request.carrier.position = toPoint({0.010, 0.0, 0.001 + length});
  service.request.carrier.orientation.w = 1.0;
  ASSERT_TRUE(callService("peg_hole_simulator/set_state", service));
  ASSERT_TRUE(service.response.success) << service.response.message;
  ASSERT_TRUE(waitFor([this] {
    return truth_.last() && std::abs(truth_.last()->pose.position.x - 0.010) < kQuaternion &&
           std::abs(truth_.last()->pose.position.z - 0.001) < kQuaternion;
  }));

  // tilted and pressed into the plane: contacts carry what the coupling presses
  const double tilt = 0.02;
  const Pose X_HC{rotationFromVector({Eigen::Vector3d(0.0, tilt, 0.0)}),
                  Eigen::Vector3d(0.010, 0.0, length)};
  service.request.carrier = toPose(X_HC);
  service.request.peg =
      toPose(X_HC * Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, -length)});
  service.request.peg.position.z = scenario_.mechanism.peg.radius * std::sin(tilt) + 1e-6;
  ASSERT_TRUE(callService("peg_hole_simulator/set_state", service));
  ASSERT_TRUE(service.response.success) << service.response.message;
  ASSERT_TRUE(step(50).success);
  ASSERT_TRUE(waitFor([this] { return contacts_.size() >= 50; }));
  double force = 0.0;
  for (const auto& contact : contacts_.last()->contacts) {
    EXPECT_TRUE(std::isfinite(contact.gap));
    EXPECT_NEAR(Eigen::Vector3d(contact.normal.x, contact.normal.y, contact.normal.z).norm(), 1.0,
                1e-9);
    if (contact.state != Contact::OPEN) force += contact.force.z;
  }
  EXPECT_EQ(contacts_.last()->header.frame_id, "hole_truth");
  EXPECT_GT(force, 1.0);

  // what no start can be, by depth and place; what is there stays
  const auto refused = [&](const Pose& X_HP, const std::string& words) {
    service.request.peg = toPose(X_HP);
    service.request.carrier =
        toPose(X_HP * Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, length)});
    ASSERT_TRUE(callService("peg_hole_simulator/set_state", service));
    EXPECT_FALSE(service.response.success) << words;
    EXPECT_EQ(service.response.message.rfind("set_state refused: " + words, 0), 0U)
        << service.response.message;
  };
  const auto upright = [](double x, double z) {
    return Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d(x, 0.0, z)};
  };
  refused(upright(0.010, -0.003), "peg is 3 mm deep in the block (");
  refused(upright(0.005, -0.020), "peg is 4.9 mm deep in the block (edge_wall), at x 30");
  refused(upright(0.0, -0.070), "peg is 10 mm deep in the block (edge_plane), at x ");
  refused(upright(0.7, 0.010), "peg.position is 0.7 m from the hole's mouth: give at most 0.5 m");
  service.request.peg = toPose(upright(0.0, 0.010));
  service.request.carrier = toPose(upright(0.010, 0.010 + length));
  ASSERT_TRUE(callService("peg_hole_simulator/set_state", service));
  EXPECT_FALSE(service.response.success);
  EXPECT_EQ(service.response.message.find(
                "set_state refused: between peg and carrier the coupling has a load of "),
            0U)
      << service.response.message;
  ASSERT_TRUE(step(1).success);

  service.request.peg.position.x = kNaN;
  ASSERT_TRUE(callService("peg_hole_simulator/set_state", service));
  EXPECT_FALSE(service.response.success);
  EXPECT_EQ(service.response.message.find("peg: position.x is nan: give metres"), 0U)
      << service.response.message;
  service.request.peg.position.x = 1e9;
  ASSERT_TRUE(callService("peg_hole_simulator/set_state", service));
  EXPECT_FALSE(service.response.success);
  EXPECT_EQ(service.response.message.find("peg: position.x is 1000000000"), 0U)
      << service.response.message;
}

TEST_F(Simulator, PublishesPosesOfCarrierAndPeg) {
  ASSERT_TRUE(step(1).success);
  ASSERT_TRUE(waitFor([this] { return truth_.size() == 1; }));
  std::set<std::string> edges;
  ASSERT_TRUE(waitFor([&] {
    for (const auto& message : tf_.all()) {
      for (const auto& transform : message->transforms) {
        edges.insert(transform.header.frame_id + " " + transform.child_frame_id);
        if (transform.child_frame_id == "peg_truth" &&
            transform.header.stamp == truth_.last()->header.stamp) {
          EXPECT_EQ(transform.transform.translation.x, truth_.last()->pose.position.x);
        }
      }
    }
    return edges.count("carrier_base carrier") == 1 && edges.count("hole_truth peg_truth") == 1;
  }));
  EXPECT_EQ(edges.size(), 2U);

  // where a person believes the carrier's base to be, and where the hole is
  std::map<std::string, geometry_msgs::TransformStamped> fixed;
  ASSERT_TRUE(waitFor([&] {
    for (const auto& message : tf_static_.all()) {
      for (const auto& transform : message->transforms) fixed[transform.child_frame_id] = transform;
    }
    return fixed.count("carrier_base") == 1 && fixed.count("hole_truth") == 1;
  }));
  const auto& base = fixed["carrier_base"];
  EXPECT_EQ(base.header.frame_id, "world");
  EXPECT_EQ(base.transform.translation.x, 0.0);
  EXPECT_EQ(base.transform.translation.y, 0.0);
  EXPECT_NEAR(base.transform.translation.z, 0.09 + scenario_.rest.z, kQuaternion);
  EXPECT_EQ(base.transform.rotation.w, 1.0);
  const auto& hole = fixed["hole_truth"];
  EXPECT_EQ(hole.header.frame_id, "carrier_base");
  const Pose expected = inverse(X_HB_);
  EXPECT_EQ(toPoint(expected.p).x, hole.transform.translation.x);
  EXPECT_EQ(toPose(expected).orientation, hole.transform.rotation);
}

TEST_F(Simulator, StopsWithANamedReasonAndResetHelps) {
  SetState service;
  // far beyond any tilt that the mechanism has: nearly horizontal
  const Pose X_HP{rotationFromEuler({0.0, 0.05, 0.0}), Eigen::Vector3d(0.0, 0.0, 0.2)};
  const double length =
      scenario_.mechanism.peg.half_height + scenario_.mechanism.peg.coupling_height;
  service.request.peg = toPose(X_HP);
  service.request.carrier =
      toPose(X_HP * Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, length)});
  ASSERT_TRUE(callService("peg_hole_simulator/set_state", service));
  ASSERT_TRUE(service.response.success) << service.response.message;
  Step::Response response = step(5);
  EXPECT_FALSE(response.success);
  EXPECT_NE(response.message.find("stopped"), std::string::npos) << response.message;
  EXPECT_TRUE(waitFor([this] { return diagnostic("message").rfind("stopped: ", 0) == 0; }));
  ASSERT_TRUE(trigger("reset").success);
  response = step(1);
  EXPECT_TRUE(response.success) << response.message;
}

TEST_F(Simulator, PublishesABlockAgainWithoutAnswer) {
  pause(false);
  answering_ = false;
  // the one without an answer, thrice
  ASSERT_TRUE(waitFor([this] {
    const auto all = bridge_b_.all();
    return all.size() >= 3 && all[all.size() - 3]->sequence == all.back()->sequence;
  }));
  const auto blocks = bridge_b_.all();
  EXPECT_EQ(blocks[blocks.size() - 2]->header.stamp, blocks.back()->header.stamp);
  EXPECT_EQ(blocks[blocks.size() - 2]->volts, blocks.back()->volts);
  const std::uint32_t stood_at = blocks.back()->sequence;
  answering_ = true;
  ASSERT_TRUE(waitFor([&] { return bridge_b_.last()->sequence > stood_at + 5; }));
  // none left out
  const auto after = bridge_b_.all();
  for (std::size_t i = 1; i < after.size(); ++i) {
    EXPECT_LE(after[i]->sequence - after[i - 1]->sequence, 1U);
  }
}

TEST_F(Simulator, PacedKeepsToTheWallClockAndTruthCanBeWithheld) {
  Record<StrainSamples> block(nh_, "paced/sensor_a/bridge");
  ASSERT_TRUE(waitFor([&] { return block.size() >= 2; }));
  // 0.5 s simulated at half the speed; at most one block was under way at either end. On a busy
  // machine queued messages arrive at once, so that not every window shows the pace.
  bool paced = false;
  for (int window = 0; window < 20 && !paced; ++window) {
    const auto wall = ros::WallTime::now();
    const std::size_t n = block.size();
    ASSERT_TRUE(waitFor([&] { return block.size() >= n + 25; }));
    paced = (ros::WallTime::now() - wall).toSec() > 2.0 * 23 * kBlock;
  }
  EXPECT_TRUE(paced);
  const auto all = block.all();
  EXPECT_NEAR((all.back()->header.stamp - all.front()->header.stamp).toSec(),
              kBlock * static_cast<double>(all.size() - 1), 1e-6);
  ros::master::V_TopicInfo topics;
  ASSERT_TRUE(ros::master::getTopics(topics));
  for (const auto& topic : topics) {
    EXPECT_TRUE(topic.name.rfind("/paced/truth", 0) != 0) << topic.name;
  }
  const Record<tf2_msgs::TFMessage> frames(nh_, "paced/tf_static");
  ASSERT_TRUE(waitFor([&] { return frames.size() == 1; }));
  ASSERT_EQ(frames.last()->transforms.size(), 1U);
  EXPECT_EQ(frames.last()->transforms[0].child_frame_id, "carrier_base");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::peg_hole_simulator_test
