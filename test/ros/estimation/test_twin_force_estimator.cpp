// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/Ack.h"
#include "assembly_cell/AddContact.h"
#include "assembly_cell/DisplacementSamples.h"
#include "assembly_cell/SensorCalibration.h"
#include "assembly_cell/SolveTwinForce.h"
#include "assembly_cell/TareTwinForce.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/WrenchSamples.h"
#include "assembly_cell/ros/bridge/calibration_messages.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "assembly_cell/twin_force/contacts_file.h"
#include "cell_fixture.h"

namespace assembly_cell::ros_bridge::twin_force_estimator_test {
namespace {

using Eigen::Vector3d;
using test::Record;
using test::waitFor;

constexpr double kPeriod = 2e-4;   // of the samples [s]
constexpr int kBlock = 100;        // samples
constexpr double kNoise = 5e-3;    // of a force [N]; of a torque a tenth of it [N m]
constexpr double kLength = 0.080;  // coupling to bottom edge, as in urdf/cell.urdf [m]

// Faults of the blocks that the test publishes.
struct Feed {
  double late = 0.0;       // stamp of sensor_a's blocks against sensor_b's [s]
  double drift = 0.0;      // of both forces [N/s]
  double sign = 1.0;       // of sensor_b
  bool saturated = false;  // sensor_b
  bool finite = true;      // sensor_a
  double speed = 0.0;      // of the carrier [m/s]
};

class TwinForceEstimator : public ::testing::Test {
 protected:
  TwinForceEstimator() : acks_(nh_, "ack"), status_(nh_, "twin_force/status"), pose_(nh_, "pose") {}

  void SetUp() override {
    a_ = nh_.advertise<WrenchSamples>("sensor_a/wrench_samples", 100);
    b_ = nh_.advertise<WrenchSamples>("sensor_b/wrench_samples", 100);
    d_ = nh_.advertise<DisplacementSamples>("sensor_b/displacement_samples", 100);
    carrier_ = nh_.advertise<geometry_msgs::PoseStamped>("carrier_pose", 100);
    ASSERT_TRUE(waitFor([this] {
      return a_.getNumSubscribers() > 0 && b_.getNumSubscribers() > 0 &&
             d_.getNumSubscribers() > 0 && carrier_.getNumSubscribers() > 0 && acks_.connected() &&
             status_.connected() && pose_.connected() &&
             ros::service::exists("twin_force_estimator/solve", false);
    })) << "the estimator is not running";
    // each test an hour after the one before
    static double start = 100.0;
    time_ = start;
    start += 3600.0;
    std_srvs::Trigger reset;
    ASSERT_TRUE(callService("twin_force_estimator/reset", reset));
    ASSERT_TRUE(reset.response.success);
    status_.clear();
    pose_.clear();
    // offset and tilted; to be estimated
    X_HP_ = {rotationFromVector({Vector3d(0.02, -0.03, 0.05)}), Vector3d(0.006, -0.004, 0.003)};
  }

  // a block of both sensors, of the displacement and of the carrier, with the peg moved by `move`
  // and pressed by a force through a point, axes of the hole
  void push(const Pose& move, const Vector3d& force, const Vector3d& point, const Feed& feed = {}) {
    const Pose X_CP{Eigen::Matrix3d::Identity(), Vector3d(0, 0, -kLength)};
    const Pose X_HC = X_HP_ * move * inverse(X_CP);
    Vector6 on_peg;
    on_peg << force, point.cross(force);
    const Vector6 w_c = feed.sign * transformWrench(inverse(X_HC), on_peg);
    // frame hole is 60 mm over sensor_a
    const Vector6 w_a =
        transformWrench({Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.06)}, Vector6(-on_peg));
    WrenchSamples a, b;
    DisplacementSamples d;
    b.header.stamp = d.header.stamp = ros::Time(time_ + kPeriod);
    a.header.stamp = b.header.stamp + ros::Duration(feed.late);
    a.period = b.period = d.period = kPeriod;
    a.sequence = b.sequence = d.sequence = ++sequence_;
    for (int k = 0; k < kBlock; ++k) {
      const double t = time_ + kPeriod * k;
      for (int i = 0; i < 6; ++i) {
        const double sd = i < 3 ? kNoise : 0.1 * kNoise;
        a.wrench.push_back(w_a(i) + sd * normal_(random_) - (i == 2) * feed.drift * t);
        b.wrench.push_back(w_c(i) + sd * normal_(random_) + (i == 2) * feed.drift * t);
        d.displacement.push_back(0.0);
      }
      a.saturated.push_back(0);
      b.saturated.push_back(feed.saturated ? 4 : 0);
    }
    if (!feed.finite) a.wrench[7] = std::numeric_limits<double>::quiet_NaN();
    time_ += kPeriod * kBlock;
    geometry_msgs::PoseStamped carrier;
    carrier.header.stamp = ros::Time(time_);
    carrier.header.frame_id = "carrier_base";
    // only differences may count: everything shifted together
    Pose X = elsewhere_ * move * inverse(X_CP);
    X.p.x() += feed.speed * time_;
    carrier.pose = toPose(X);
    a_.publish(a);
    b_.publish(b);
    d_.publish(d);
    carrier_.publish(carrier);
    EXPECT_TRUE(waitFor([&] { return acks_.last() && acks_.last()->sequence == sequence_; }))
        << "no ack of block " << sequence_;
  }

  // calls the service while blocks arrive
  AddContact::Response add(const Pose& move, const Vector3d& force, const Vector3d& point,
                           const Feed& feed = {}, double window = 0.0) {
    push(move, force, point, feed);
    AddContact call;
    call.request.window = window;
    std::atomic<bool> answered{false};
    std::thread caller([&] {
      EXPECT_TRUE(callService("twin_force_estimator/add_contact", call));
      answered = true;
    });
    for (int i = 0; i < 2000 && !answered; ++i) push(move, force, point, feed);
    caller.join();
    return call.response;
  }

  SolveTwinForce::Response solve() {
    SolveTwinForce call;
    EXPECT_TRUE(callService("twin_force_estimator/solve", call));
    return call.response;
  }

  // contacts in different directions, the peg translated and rotated between them
  void addThree(double sign = 1.0) {
    Feed feed;
    feed.sign = sign;
    const Pose turned{rotationFromVector({Vector3d(0.0, 0.04, 0.0)}), Vector3d(0.002, 0, 0.001)};
    EXPECT_TRUE(add(Pose{}, {2, 1, 15}, {0.02, 0.01, 0}, feed).success);
    EXPECT_TRUE(add(turned, {-6, 3, 12}, {-0.02, 0.015, 0}, feed).success);
    const auto last = add(turned, {4, -9, 10}, {0.005, -0.024, 0}, feed);
    EXPECT_TRUE(last.success) << last.message;
    EXPECT_EQ(last.status.contacts.size(), 3U);
    X_HP_last_ = X_HP_ * turned;
  }

  ros::NodeHandle nh_;
  ros::Publisher a_, b_, d_, carrier_;
  Record<Ack> acks_;
  Record<TwinForceState> status_;
  Record<geometry_msgs::PoseWithCovarianceStamped> pose_;
  Pose X_HP_, X_HP_last_;
  const Pose elsewhere_{rotationFromVector({Vector3d(0.0, 0.0, 0.3)}), Vector3d(0.1, 0.2, 0.1)};
  double time_ = 0.0;
  std::uint32_t sequence_ = 0;
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
};

TEST_F(TwinForceEstimator, FindsAKnownPose) {
  addThree();
  const auto answer = solve();
  ASSERT_TRUE(answer.success) << answer.message;
  const TwinForceState& s = answer.status;
  EXPECT_TRUE(s.pose_known);
  EXPECT_EQ(s.signs, "right");
  EXPECT_TRUE(s.rejected.empty());
  // 6 sd per axis by its own covariance
  const Pose X = fromPose(s.pose.pose, "pose");
  const Vector3d dT = X_HP_last_.p - X.p;
  const Vector3d turn = vectorFromRotation(X_HP_last_.R * X.R.transpose()).value;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    EXPECT_LT(std::abs(dT(k)), 6 * std::sqrt(s.pose.covariance[7 * i])) << i;
    EXPECT_LT(std::abs(turn(k)), 6 * std::sqrt(s.pose.covariance[7 * (i + 3)])) << i;
  }
  // and small: noise of 5 mN averaged over 500 samples
  EXPECT_LT(dT.norm(), 5e-4);
  EXPECT_LT(turn.norm(), 5e-3);
  // the advised contact improves the estimate
  EXPECT_TRUE(s.advice_known);
  EXPECT_GT(s.advised_force.z, 0.0);
  EXPECT_GE(s.advised_eigenvalue, s.eigenvalues[0]);
  // the contacts can be written and solved elsewhere
  EXPECT_EQ(parseContacts(answer.contacts, "answer").contacts.size(), 3U);
  // the pose follows the carrier
  const Pose up{Eigen::Matrix3d::Identity(), Vector3d(0, 0, 0.01)};
  pose_.clear();
  push(up, Vector3d::Zero(), Vector3d::Zero());
  ASSERT_TRUE(waitFor(
      [&] { return pose_.last() && pose_.last()->header.stamp >= ros::Time(time_ - 1e-6); }));
  EXPECT_EQ(pose_.last()->header.frame_id, "hole");
  const Vector3d now = fromPose(pose_.last()->pose.pose, "pose").p;
  EXPECT_LT((now - (X_HP_ * up).p).norm(), 5e-4);
}

// The covariance of a calibration is the prior of its sensor's matrix in tasks that begin after it.
TEST_F(TwinForceEstimator, UsesTheCovarianceOfACalibration) {
  ros::Publisher publisher = nh_.advertise<SensorCalibration>("sensor_a/calibration", 1, true);
  const auto priors = [&] {
    std_srvs::Trigger reset;
    EXPECT_TRUE(callService("twin_force_estimator/reset", reset));
    addThree();
    const auto errors = parseContacts(solve().contacts, "answer").errors;
    EXPECT_TRUE(errors && errors->b.gain_covariance.size() == 0);
    return errors ? errors->a.gain_covariance : Eigen::MatrixXd();
  };
  EXPECT_EQ(priors().size(), 0);
  Calibration c;
  c.volts_to_wrench = 6.0 * Matrix6::Identity();
  c.wrench_covariance = 0.012 * 0.012 * Eigen::MatrixXd::Identity(36, 36);
  publisher.publish(toMessage(c));
  Eigen::MatrixXd prior;
  EXPECT_TRUE(waitFor([&] {
    prior = priors();
    return prior.size() > 0;
  }));
  ASSERT_EQ(prior.rows(), 36);
  EXPECT_LT((prior - 0.002 * 0.002 * Eigen::MatrixXd::Identity(36, 36)).norm(), 1e-12);
  // a calibration without a covariance
  c.wrench_covariance.resize(0, 0);
  publisher.publish(toMessage(c));
  EXPECT_TRUE(waitFor([&] { return priors().size() == 0; }));
}

TEST_F(TwinForceEstimator, RefusesByName) {
  const Vector3d force(1, 2, 15), point(0.02, 0, 0);
  const auto refusal = [&](const Feed& feed) {
    const auto answer = add(Pose{}, force, point, feed);
    EXPECT_FALSE(answer.success);
    EXPECT_TRUE(answer.status.contacts.empty());
    return answer.message;
  };
  Feed feed;
  feed.late = 0.003;
  EXPECT_EQ(refusal(feed).rfind("not simultaneous", 0), 0U);
  feed = {};
  feed.saturated = true;
  EXPECT_EQ(refusal(feed).rfind("saturated", 0), 0U);
  feed = {};
  feed.finite = false;
  EXPECT_EQ(refusal(feed).rfind("sensor_a: a block is not", 0), 0U);
  feed = {};
  feed.drift = 2.0;
  EXPECT_EQ(refusal(feed).rfind("not settled", 0), 0U);
  feed = {};
  feed.speed = 0.01;
  EXPECT_EQ(refusal(feed).rfind("moving", 0), 0U);
  const auto bad = add(Pose{}, force, point, {}, -1.0);
  EXPECT_FALSE(bad.success);
  EXPECT_EQ(bad.message.rfind("window is -1", 0), 0U) << bad.message;
}

TEST_F(TwinForceEstimator, HasNoPoseFromTooFewContacts) {
  auto answer = solve();
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.status.status, "REFUSE_TOO_FEW");
  EXPECT_TRUE(add(Pose{}, {1, 2, 15}, {0.02, 0, 0}).success);
  answer = solve();
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.status.status, "REFUSE_TOO_FEW");
  EXPECT_FALSE(answer.status.pose_known);
  EXPECT_EQ(answer.status.pose.pose.orientation.w, 1.0);
  // no force: kept, but no pose
  EXPECT_TRUE(add(Pose{}, Vector3d::Zero(), Vector3d::Zero()).success);
  EXPECT_EQ(solve().status.status, "REFUSE_TOO_FEW");
}

TEST_F(TwinForceEstimator, ReportsAReversedSensor) {
  addThree(-1.0);
  const auto answer = solve();
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.status.signs, "reversed");
  EXPECT_NE(answer.message.find("opposite sign"), std::string::npos);
}

// A client whose answer was lost repeats the call: that is the same contact, not another one.
TEST_F(TwinForceEstimator, ARepeatedWindowCountsOnce) {
  const auto window = [this](auto& request) {
    const double first = time_ + kPeriod * kBlock;
    for (int k = 0; k < 5; ++k) push(Pose{}, {2, 1, 15}, {0.02, 0.01, 0});
    request.first = ros::Time(first);
    request.last = ros::Time(time_);
    request.blocks = 5;
  };
  TareTwinForce tare;
  window(tare.request);
  AddContact call, other;
  window(call.request);
  const auto add = [](AddContact& asked) {
    EXPECT_TRUE(callService("twin_force_estimator/add_contact", asked));
    EXPECT_TRUE(asked.response.success) << asked.response.message;
    return asked.response;
  };
  const auto first_answer = add(call);
  const auto again = add(call);
  EXPECT_EQ(again.message, first_answer.message);
  EXPECT_EQ(again.status.contacts.size(), 1U);
  EXPECT_EQ(again.status.contacts.back().wrench_b, first_answer.status.contacts.back().wrench_b);
  // another window is another contact
  window(other.request);
  EXPECT_EQ(add(other).status.contacts.size(), 2U);
  // so is the same window with another zero
  std::string zero;
  for (int k = 0; k < 2; ++k) {
    ASSERT_TRUE(callService("twin_force_estimator/tare_window", tare));
    ASSERT_TRUE(tare.response.success) << tare.response.message;
    EXPECT_TRUE(k == 0 || tare.response.message == zero) << tare.response.message;
    zero = tare.response.message;
    EXPECT_EQ(add(call).status.contacts.size(), 3U);
  }
}

// Also while its blocks are still to come.
TEST_F(TwinForceEstimator, ARepeatedComingWindowCountsOnce) {
  const Vector3d force(2, 1, 15), at(0.02, 0.01, 0);
  push(Pose{}, force, at);
  AddContact calls[2];
  double end = time_;
  for (int k = 0; k < 5; ++k) {
    end += kPeriod * kBlock;
    if (k == 0) calls[0].request.first = ros::Time(end);
  }
  calls[0].request.last = ros::Time(end);
  calls[0].request.blocks = 5;
  calls[1] = calls[0];
  std::atomic<int> answered{0};
  std::vector<std::thread> callers;
  for (AddContact& call : calls) {
    callers.emplace_back([&] {
      EXPECT_TRUE(callService("twin_force_estimator/add_contact", call));
      ++answered;
    });
  }
  for (int i = 0; i < 2000 && answered < 2; ++i) push(Pose{}, force, at);
  for (std::thread& caller : callers) caller.join();
  for (const AddContact& call : calls) {
    EXPECT_TRUE(call.response.success) << call.response.message;
    EXPECT_EQ(call.response.message, calls[0].response.message);
    EXPECT_EQ(call.response.status.contacts.size(), 1U);
  }
}

// In lockstep a call that waits for samples must not block the calls of the strategy.
TEST_F(TwinForceEstimator, ACallThatWaitsForSamplesBlocksNoOther) {
  const Vector3d force(0.5, -0.3, 0.4), at(0.01, 0.02, 0);
  push(Pose{}, force, at);
  std_srvs::Trigger tare;
  std::atomic<bool> answered{false};
  // until this call waits and the other one is the second
  std::thread caller([&] {
    EXPECT_TRUE(waitFor([&] {
      return callService("twin_force_estimator/tare", tare) &&
             tare.response.message.find("another call waits") != 0;
    }));
    answered = true;
  });
  // half of its window has arrived at the next call
  push(Pose{}, force, at);
  AddContact second;
  EXPECT_TRUE(waitFor([&] {
    return callService("twin_force_estimator/add_contact", second) &&
           second.response.message.find("another call waits") == 0;
  })) << second.response.message;
  std_srvs::Trigger reset;
  ASSERT_TRUE(callService("twin_force_estimator/reset", reset));
  EXPECT_TRUE(reset.response.success) << reset.response.message;
  EXPECT_FALSE(answered);
  for (int i = 0; i < 2000 && !answered; ++i) push(Pose{}, force, at);
  caller.join();
  EXPECT_TRUE(tare.response.success) << tare.response.message;
}

TEST_F(TwinForceEstimator, SubtractsTheZero) {
  // both sensors have the offset of the hanging peg
  const Vector3d offset(0.5, -0.3, 0.4), at(0.01, 0.02, 0);
  push(Pose{}, offset, at);
  std_srvs::Trigger tare;
  std::atomic<bool> answered{false};
  std::thread caller([&] {
    EXPECT_TRUE(callService("twin_force_estimator/tare", tare));
    answered = true;
  });
  for (int i = 0; i < 2000 && !answered; ++i) push(Pose{}, offset, at);
  caller.join();
  ASSERT_TRUE(tare.response.success) << tare.response.message;
  const auto answer = add(Pose{}, offset, at);
  ASSERT_TRUE(answer.success) << answer.message;
  // the rest is noise: 6 sd of 500 samples, twice
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(answer.status.contacts[0].wrench_a[i]), 6 * kNoise / std::sqrt(250.0));
    EXPECT_LT(std::abs(answer.status.contacts[0].wrench_b[i]), 6 * kNoise / std::sqrt(250.0));
  }
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::twin_force_estimator_test
