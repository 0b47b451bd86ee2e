// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/Int32.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "assembly_cell/Ack.h"
#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/PlantState.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/align/search/step.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/publish_shared.h"
#include "assembly_cell/ros/process/shared_spinner.h"
#include "assembly_cell/ros/supervision/ros_plant.h"

namespace assembly_cell::ros_bridge::ros_plant_test {
namespace {

// ---- a latched topic ----

// The first `count` messages of a new subscription to /latest.
std::vector<int> received(std::size_t count) {
  ros::NodeHandle nh;
  ros::CallbackQueue queue;
  nh.setCallbackQueue(&queue);
  std::vector<int> values;
  const ros::Subscriber sub = nh.subscribe<std_msgs::Int32>(
      "/latest", 10, [&](const auto& message) { values.push_back(message->data); });
  const ros::WallTime limit = ros::WallTime::now() + ros::WallDuration(10.0);
  while (values.size() < count && ros::WallTime::now() < limit) {
    ros::getGlobalCallbackQueue()->callAvailable();
    queue.callAvailable(ros::WallDuration(0.01));
  }
  return values;
}

TEST(LatestPublisherTest, ALaterSubscriberReceivesTheLatestMessage) {
  ros::NodeHandle nh;
  LatestPublisher<std_msgs::Int32> publisher(nh, "/latest", 10);
  for (const int value : {1, 2, 3}) {
    std_msgs::Int32 message;
    message.data = value;
    publisher.publish(message);
  }
  EXPECT_EQ(received(1), std::vector<int>{3});
  EXPECT_EQ(received(1), std::vector<int>{3});
}

TEST(LatestPublisherTest, WithoutLatchingOnlyNewMessagesArrive) {
  ros::NodeHandle nh;
  LatestPublisher<std_msgs::Int32> publisher(nh, "/latest", 10, false);
  publisher.publish(std_msgs::Int32());
  ros::CallbackQueue queue;
  nh.setCallbackQueue(&queue);
  std::vector<int> values;
  const ros::Subscriber sub = nh.subscribe<std_msgs::Int32>(
      "/latest", 10, [&](const auto& message) { values.push_back(message->data); });
  while (publisher.getNumSubscribers() == 0) ros::WallDuration(0.001).sleep();
  std_msgs::Int32 message;
  message.data = 7;
  publisher.publish(message);
  while (values.empty()) queue.callAvailable(ros::WallDuration(0.01));
  EXPECT_EQ(values, std::vector<int>{7});
}

TEST(LatestPublisherTest, WithoutATopicItPublishesNothing) {
  LatestPublisher<std_msgs::Int32> unconnected;
  unconnected.publish(std_msgs::Int32());
  EXPECT_EQ(unconnected.getNumSubscribers(), 0u);
}

// ---- one thread for several queues ----

constexpr std::chrono::seconds kLong(10);

void addTo(SharedSpinner::Queue& queue, std::function<void()> what) {
  queue.addCallback(callbackOf(std::move(what)), 1);
}

bool soon(const std::atomic<bool>& flag) {
  for (int i = 0; i < 10000 && !flag; ++i) ros::WallDuration(0.001).sleep();
  return flag;
}

TEST(SharedSpinnerTest, CallsAllQueuesAlsoAfterAnException) {
  SharedSpinner::Queue first, second;
  SharedSpinner& spinner = SharedSpinner::ofThisProcess();
  spinner.add(&first);
  spinner.add(&second);
  std::atomic<bool> after{false}, other{false};
  addTo(first, [] { throw std::runtime_error("on purpose"); });
  addTo(first, [&] { after = true; });
  addTo(second, [&] { other = true; });
  EXPECT_TRUE(soon(after));
  EXPECT_TRUE(soon(other));
  spinner.remove(&first);
  spinner.remove(&second);
  EXPECT_FALSE(spinner.works());
}

TEST(SharedSpinnerTest, AWaitingThreadCallsTheCallbacks) {
  SharedSpinner::Queue queue;
  SharedSpinner& spinner = SharedSpinner::ofThisProcess();
  spinner.add(&queue);
  {
    SharedSpinner::Helper helper;
    std::thread::id by;
    bool done = false;
    // the first callback adds the second, as an answer to a message does
    addTo(queue, [&] {
      addTo(queue, [&] {
        by = std::this_thread::get_id();
        done = true;
      });
    });
    EXPECT_TRUE(helper.callUntil([&] { return done; }, std::chrono::steady_clock::now() + kLong));
    EXPECT_EQ(by, std::this_thread::get_id());
    EXPECT_FALSE(helper.callUntil([] { return false; },
                                  std::chrono::steady_clock::now() + std::chrono::milliseconds(5)));
  }
  // afterwards the spinner's thread does
  std::atomic<bool> later{false};
  addTo(queue, [&] { later = true; });
  EXPECT_TRUE(soon(later));
  spinner.remove(&queue);
}

// The thread of the spinner calls what helpers have left, however often these come.
TEST(SharedSpinnerTest, CallsWhatShortHelpersLeave) {
  SharedSpinner::Queue queue;
  SharedSpinner& spinner = SharedSpinner::ofThisProcess();
  spinner.add(&queue);
  for (int round = 0; round < 5; ++round) {
    std::atomic<bool> left{false};
    for (int i = 0; i < 100; ++i) {
      SharedSpinner::Helper helper;
      if (i == 99) addTo(queue, [&] { left = true; });
    }
    EXPECT_TRUE(soon(left)) << round;
  }
  spinner.remove(&queue);
}

// A cell without lockstep adds callbacks for ever.
TEST(SharedSpinnerTest, EndlessCallbacksDelayNoOtherThread) {
  SharedSpinner::Queue queue, other;
  SharedSpinner& spinner = SharedSpinner::ofThisProcess();
  spinner.add(&queue);
  std::atomic<long> count{0};
  std::function<void()> again = [&] {
    ++count;
    addTo(queue, again);
  };
  addTo(queue, again);
  while (count < 1000) std::this_thread::yield();
  spinner.add(&other);
  const long before = count;
  EXPECT_TRUE(SharedSpinner::Helper().callUntil([&] { return count > before + 1000; },
                                                std::chrono::steady_clock::now() + kLong));
  EXPECT_FALSE(SharedSpinner::Helper().callUntil(
      [] { return false; }, std::chrono::steady_clock::now() + std::chrono::milliseconds(5)));
  spinner.remove(&queue);
  const long at_the_end = count;
  ros::WallDuration(0.01).sleep();
  EXPECT_EQ(count, at_the_end);
  spinner.remove(&other);
}

// ---- the cell as a strategy's plant ----

// Publishes the topics of a cell in lockstep: the next block follows an acknowledgement.
class FakeCell {
 public:
  explicit FakeCell(const std::string& space) : nh_(space) {
    nh_.setCallbackQueue(&queue_);
    a_ = nh_.advertise<WrenchSamples>("sensor_a/wrench_samples", 10, true);
    b_ = nh_.advertise<WrenchSamples>("sensor_b/wrench_samples", 10, true);
    d_ = nh_.advertise<DisplacementSamples>("sensor_b/displacement_samples", 10, true);
    carrier_ = nh_.advertise<geometry_msgs::PoseStamped>("carrier_pose", 10, true);
    for (const std::string sensor : {"sensor_a", "sensor_b"}) {
      Calibration calibration;
      calibration.volts_to_wrench.setIdentity();
      calibration.serial_number = sensor;
      pubs_.push_back(nh_.advertise<SensorCalibration>(sensor + "/calibration", 1, true));
      pubs_.back().publish(toMessage(calibration));
    }
    state_ = nh_.advertise<PlantState>("plant_state", 10, true);
    publishState(1, ros::Time(1.0));
    ack_ = nh_.subscribe<Ack>("ack", 10, [this](const auto& ack) {
      if (ack->sequence == sequence_) next();
    });
    next();
    spinner_.start();
  }
  ~FakeCell() { spinner_.stop(); }

  void publishState(std::uint32_t boot_id, const ros::Time& stamp,
                    const std::string& refusal = "") {
    PlantState state;
    state.header.stamp = stamp;
    state.life = boot_id;
    state.refusal = refusal;
    if (!refusal.empty()) {
      state.refused = 1;
      state.refused_node = ros::this_node::getName();
      state.refused_reason = "too_fast";
    }
    state_.publish(state);
  }

 private:
  void next() {
    constexpr double period = 2e-4;
    constexpr std::size_t samples = 100;
    ++sequence_;
    const ros::Time start(1.0 + samples * period * sequence_);
    WrenchSamples wrench;
    wrench.header.stamp = start;
    wrench.period = period;
    wrench.sequence = sequence_;
    wrench.wrench.assign(6 * samples, 0.5);
    wrench.saturated.assign(samples, 0);
    a_.publish(wrench);
    b_.publish(wrench);
    DisplacementSamples displacement;
    displacement.header = wrench.header;
    displacement.period = period;
    displacement.sequence = sequence_;
    displacement.displacement.assign(6 * samples, 0.0);
    d_.publish(displacement);
    carrier_.publish(
        poseStamped(kCarrierBaseFrame, Pose(), start + ros::Duration((samples - 1) * period)));
  }

  ros::NodeHandle nh_;
  ros::CallbackQueue queue_;
  ros::Publisher a_, b_, d_, carrier_, state_;
  std::vector<ros::Publisher> pubs_;
  std::uint32_t sequence_ = 0;
  ros::Subscriber ack_;
  GuardedSpinner spinner_{1, &queue_};
};

// A RosPlant that is connected to a FakeCell.
class RosPlantTest : public ::testing::Test {
 protected:
  RosPlantTest() {
    nh_.setCallbackQueue(&queue_);
    PlantSettings settings;
    settings.node = "/plant_test/strategy";
    settings.lockstep = true;
    settings.timeout = 5.0;
    plant_ = std::make_unique<RosPlant>(nh_, settings);
    spinner_.start();
  }
  ~RosPlantTest() override { spinner_.stop(); }

  void begin() {
    plant_->begin([] { return false; });
  }
  // Takes blocks until the goal ends with an error, and returns its text.
  std::string fault() {
    try {
      for (int i = 0; i < 100000; ++i) plant_->next({});
    } catch (const PlantError& error) {
      return error.what();
    }
    return "none";
  }

  FakeCell cell_{"plant_test"};
  ros::NodeHandle nh_{"plant_test"};
  ros::CallbackQueue queue_;
  std::unique_ptr<RosPlant> plant_;
  GuardedSpinner spinner_{1, &queue_};
};

// A goal may be followed by a recovery, and by the next goal.
TEST_F(RosPlantTest, ReturnsBlocksInEachGoalAndRecovery) {
  begin();
  const PlantBlock first = plant_->next({});
  EXPECT_EQ(first.wrench_a, Vector6::Constant(0.5));
  EXPECT_NEAR(plant_->next({}).time, first.time + kStepTime, 1e-9);
  plant_->end(false);
  plant_->recover(1.0);
  EXPECT_GT(plant_->next({}).time, first.time);
  plant_->end(false);
  begin();
  EXPECT_EQ(plant_->next({}).samples, 100);
  plant_->end(false);
}

// Topics have connections of their own: blocks after a restart may overtake the plant's state.
TEST_F(RosPlantTest, ARestartBeforeTheGoalsFirstBlockIsNoFault) {
  begin();
  const ros::Time origin = plant_->state().stamp;
  cell_.publishState(2, origin - ros::Duration(1e-3));
  cell_.publishState(2, origin + ros::Duration(1.0), "the second state");
  EXPECT_EQ(fault(), "the second state");
}

TEST_F(RosPlantTest, ARestartDuringTheGoalEndsIt) {
  begin();
  cell_.publishState(2, plant_->state().stamp);
  EXPECT_EQ(fault(), "the plant was restarted, or reset, during the goal");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::ros_plant_test
