// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <actionlib/client/simple_action_client.h>
#include <assembly_cell/Ack.h>
#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/Exciter.h>
#include <assembly_cell/IdentifyLocusAction.h>
#include <assembly_cell/LocusEstimate.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <sys/wait.h>
#include <xmlrpcpp/XmlRpc.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "../../../benchmark/support/simulated_reading.h"
#include "assembly_cell/cell/simulated_plant.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/estimation/locus_messages.h"
#include "live_client.h"

namespace assembly_cell::ros_bridge::locus_estimator_test {
namespace {

using Complex6 = Eigen::Matrix<std::complex<double>, 6, 1>;
using Client = actionlib::SimpleActionClient<IdentifyLocusAction>;

constexpr double kPatience = 60.0;  // of the wall clock, for a busy machine [s]
constexpr double kPeriod = 2e-4;    // of the samples [s]
constexpr std::size_t kBlock = 100;
constexpr double kNoise = 1e-9;  // of each displacement [m], [rad]

template <class Condition>
bool waitFor(const Condition& condition) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kPatience);
  while (ros::ok() && ros::WallTime::now() < end) {
    if (condition()) return true;
    ros::WallDuration(0.002).sleep();
  }
  return condition();
}

class LocusEstimator : public ::testing::Test {
 protected:
  void SetUp() override {
    mechanism_ = loadMechanism(
        std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml", {"gravity=9.81"});
    blocks_ = nh_.advertise<DisplacementSamples>("sensor_b/displacement_samples", 100);
    exciters_ = nh_.advertise<Exciter>("exciter", 100);
    poses_ = nh_.advertise<geometry_msgs::PoseStamped>("carrier_pose", 100);
    keep("ack", acks_);
    keep("locus", loci_);
    keep("contact_mode", modes_);
    enable_ = nh_.serviceClient<std_srvs::SetBool>("locus_estimator/enable", true);
    ASSERT_TRUE(enable_.waitForExistence(ros::Duration(kPatience)));
    ASSERT_TRUE(client_.waitForServer(ros::Duration(kPatience)));
    ASSERT_TRUE(waitFor([&] {
      for (const ros::Subscriber& sub : subs_) {
        if (sub.getNumPublishers() == 0) return false;
      }
      return blocks_.getNumSubscribers() > 0 && exciters_.getNumSubscribers() > 0 &&
             poses_.getNumSubscribers() > 0;
    }));
    // each test an hour after the one before, so that none sees another's samples
    static double start = 100.0;
    time_ = start;
    start += 3600.0;
    exciter_.on = false;
    exciter_.amplitude = 1.0;
    exciters_.publish(exciter_);
    push(Complex6::Zero());
    clear();
  }

  // ---- input of the estimator ----

  void switchOn(double frequency, int direction) {
    exciter_.header.stamp = ros::Time(time_);
    exciter_.on = true;
    exciter_.frequency = frequency;
    exciter_.phase = 0.6;
    exciter_.direction = static_cast<std::int8_t>(direction);
    exciters_.publish(exciter_);
    // topics have no common order: a block of rest gives it time to arrive
    push(Complex6::Zero());
  }

  // the next block: phasors of the deflection under the exciter, press, noise
  DisplacementSamples block(const Complex6& phasor, double noise = kNoise, double press = 12.0) {
    DisplacementSamples b;
    b.header.stamp = ros::Time(time_ + kPeriod);
    b.header.frame_id = "sensor_b";
    b.period = kPeriod;
    b.sequence = ++sequence_;
    for (std::size_t k = 1; k <= kBlock; ++k) {
      const double t = time_ + kPeriod * static_cast<double>(k);
      const double angle =
          exciter_.direction *
          (exciter_.frequency * (t - exciter_.header.stamp.toSec()) + exciter_.phase);
      for (int j = 0; j < 6; ++j) {
        const double mean = (press - mechanism_.peg.mass * mechanism_.gravity) / 5e4;
        b.displacement.push_back((phasor[j] * std::polar(1.0, angle)).real() +
                                 (j == 2 ? mean : 0.0) + noise * normal_(random_));
      }
    }
    time_ += kPeriod * kBlock;
    return b;
  }

  void pose(double x) {
    geometry_msgs::PoseStamped p;
    p.header.stamp = ros::Time(time_);
    p.header.frame_id = "carrier_base";
    p.pose.position.x = x;
    p.pose.orientation.w = 1.0;
    poses_.publish(p);
  }

  void send(const DisplacementSamples& b) {
    blocks_.publish(b);
    EXPECT_TRUE(waitFor([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      return !acks_.empty() && acks_.back().sequence == b.sequence;
    })) << "no ack of block "
        << b.sequence;
  }

  void push(const Complex6& phasor, int count = 1) {
    for (int k = 0; k < count; ++k) send(block(phasor));
  }

  // deflection of the coupling with the contact in direction alpha
  ContactResponse response(double alpha) const {
    OperatingPoint point;
    point.frequency = exciter_.frequency;
    point.amplitude = exciter_.amplitude;
    point.direction = exciter_.direction;
    point.press = 12.0;
    return contactResponse(mechanism_, point, alpha);
  }

  // ---- its output ----

  template <class M>
  void keep(const std::string& topic, std::vector<M>& messages) {
    boost::function<void(const boost::shared_ptr<const M>&)> callback =
        [this, &messages](const boost::shared_ptr<const M>& m) {
          const std::lock_guard<std::mutex> lock(mutex_);
          messages.push_back(*m);
        };
    subs_.push_back(nh_.subscribe<M>(topic, 1000, callback));
  }
  template <class M>
  std::size_t count(const std::vector<M>& messages) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages.size();
  }
  template <class M>
  M last(const std::vector<M>& messages) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages.empty() ? M() : messages.back();
  }
  void clear() {
    const std::lock_guard<std::mutex> lock(mutex_);
    acks_.clear();
    loci_.clear();
    modes_.clear();
  }

  void expectLocus(const LocusEstimate& e, const ContactResponse& expected, double alpha) {
    // five standard deviations of the fit through the map from deflection to the centre of mass
    const double tolerance = 5 * e.noise_sd * std::sqrt(e.inflation / e.samples);
    const Eigen::Vector2cd xy =
        centreOfMassPhasors(mechanism_, exciter_.direction * exciter_.frequency, expected.coupling);
    const Locus seen = locusFromPhasors(xy.x(), xy.y(), 0.0, 1, 1.0);
    EXPECT_NEAR(e.p[0], seen.P.real(), tolerance);
    EXPECT_NEAR(e.p[1], seen.P.imag(), tolerance);
    EXPECT_NEAR(e.n[0], seen.N.real(), tolerance);
    EXPECT_NEAR(e.n[1], seen.N.imag(), tolerance);
    EXPECT_LT(tolerance, 1e-2 * std::abs(expected.N));
    // the static force's arm, which that map leaves out, is below 2 %
    EXPECT_NEAR(e.semi_major, std::abs(expected.P) + std::abs(expected.N), 0.02 * e.semi_major);
    EXPECT_NEAR(e.semi_minor, seen.semiMinor(), 3 * tolerance);
    EXPECT_GE(e.orientation, 0.0);
    EXPECT_LT(e.orientation, M_PI);
    EXPECT_GT(e.orientation_sd, 0.0);
    EXPECT_EQ(e.frequency, exciter_.frequency);
    EXPECT_EQ(e.header.frame_id, "sensor_b");
    double sum = 0.0;
    for (const double p : e.probabilities) sum += p;
    EXPECT_NEAR(sum, 1.0, 1e-12);
    ASSERT_EQ(e.hypothesis_direction.size(), 2u);
    ASSERT_EQ(e.hypothesis_weight.size(), 2u);
    EXPECT_NEAR(e.hypothesis_weight[0] + e.hypothesis_weight[1], 1.0, 1e-12);
    // vertical motion and yaw determine the half turn
    EXPECT_NEAR(std::remainder(e.hypothesis_direction[0] - alpha, 2 * M_PI), 0.0, 0.02);
    EXPECT_NEAR(std::remainder(e.hypothesis_direction[1] - alpha, M_PI), 0.0, 0.02);
    EXPECT_GT(e.hypothesis_weight[0], 0.99);
    EXPECT_GT(e.direction_sd, 0.0);
    EXPECT_LT(e.direction_sd, 0.05);
    EXPECT_EQ(e.friction, 0.0);
  }

  IdentifyLocusGoal goal(double start, double duration) const {
    IdentifyLocusGoal g;
    g.start = ros::Time(start);
    g.duration = ros::Duration(duration);
    g.exciter = exciter_;
    return g;
  }

  IdentifyLocusResult resultOf(const IdentifyLocusGoal& g) {
    client_.sendGoal(g);
    EXPECT_TRUE(client_.waitForResult(ros::Duration(kPatience)));
    const auto result = client_.getResult();
    return result ? *result : IdentifyLocusResult();
  }

  void refused(const IdentifyLocusGoal& g, const std::string& part) {
    const IdentifyLocusResult result = resultOf(g);
    EXPECT_FALSE(result.success);
    EXPECT_NE(result.message.find(part), std::string::npos) << result.message;
    EXPECT_EQ(client_.getState(), actionlib::SimpleClientGoalState::ABORTED);
  }

  bool enable(bool on) {
    std_srvs::SetBool call;
    call.request.data = on;
    return enable_.call(call) && call.response.success;
  }

  ros::NodeHandle nh_;
  Mechanism mechanism_;
  Exciter exciter_;
  double time_ = 0.0;
  std::uint32_t sequence_ = 0;
  std::mt19937_64 random_{1};
  std::normal_distribution<double> normal_;
  std::mutex mutex_;
  std::vector<Ack> acks_;
  std::vector<LocusEstimate> loci_, modes_;
  ros::Publisher blocks_, exciters_, poses_;
  std::vector<ros::Subscriber> subs_;
  ros::ServiceClient enable_;
  Client client_{"identify_locus", true};
};

TEST_F(LocusEstimator, AcknowledgesEveryBlockByItsName) {
  push(Complex6::Zero(), 3);
  ASSERT_EQ(count(acks_), 3u);
  EXPECT_EQ(last(acks_).node, "locus_estimator");
  EXPECT_EQ(last(acks_).commands, 0u);
  // also a block that it can't use
  DisplacementSamples b = block(Complex6::Zero());
  b.displacement[17] = std::numeric_limits<double>::quiet_NaN();
  send(b);
  b = block(Complex6::Zero());
  b.displacement.pop_back();
  send(b);
  EXPECT_EQ(count(acks_), 5u);
}

TEST_F(LocusEstimator, SlidesOverWholePeriodsWhileTheExciterRuns) {
  push(Complex6::Zero(), 10);
  EXPECT_EQ(count(loci_), 0u);  // off: idle

  for (const int direction : {1, -1}) {
    switchOn(500, direction);
    const double alpha = 2.0 + direction;
    const ContactResponse expected = response(alpha);
    push(expected.coupling, 4);
    const std::size_t before = count(loci_);
    push(expected.coupling, 6);
    ASSERT_TRUE(waitFor([&] { return count(loci_) >= before + 6; }));
    const LocusEstimate e = last(loci_);
    // 0.1 s holds seven periods of 12.6 ms: 440 samples
    EXPECT_EQ(e.samples, 440u);
    EXPECT_NEAR(e.inflation, 1.0, 0.02);
    EXPECT_NEAR(e.header.stamp.toSec(), time_ + kPeriod, 1e-6);
    expectLocus(e, expected, alpha);
    EXPECT_EQ(e.mode, LocusEstimate::SEGMENT);
  }

  // off again: idle again
  exciter_.on = false;
  exciters_.publish(exciter_);
  push(Complex6::Zero(), 2);
  const std::size_t before = count(loci_);
  push(Complex6::Zero(), 5);
  EXPECT_EQ(count(loci_), before);
}

// A new window is valid from the next block on.
TEST_F(LocusEstimator, AppliesAChangedWindowToTheNextBlock) {
  switchOn(500, 1);
  const ContactResponse expected = response(1.0);
  const auto samples = [&] {
    const std::size_t before = count(loci_);
    push(expected.coupling);
    EXPECT_TRUE(waitFor([&] { return count(loci_) > before; }));
    return last(loci_).samples;
  };
  push(expected.coupling, 6);
  EXPECT_EQ(samples(), 440u);
  // 0.05 s holds three periods of 12.6 ms: 189 samples
  ASSERT_TRUE(test::setLive("locus_estimator", "window", 0.05));
  EXPECT_EQ(samples(), 189u);
  expectLocus(last(loci_), expected, 1.0);

  EXPECT_FALSE(test::setLive("locus_estimator", "window", std::nan("")));
  EXPECT_FALSE(test::setLive("locus_estimator", "window", 2.5));  // longer than ~history
  EXPECT_FALSE(test::setLive("locus_estimator", "history", 3.0));
  EXPECT_EQ(samples(), 189u);

  ASSERT_TRUE(test::setLive("locus_estimator", "window", 0.1));
  EXPECT_EQ(samples(), 440u);
}

TEST_F(LocusEstimator, ModeIsLatchedAndOnlySentWhenItChanges) {
  switchOn(770, 1);
  push(response(1.0).coupling, 15);
  ASSERT_TRUE(waitFor([&] { return last(modes_).mode == LocusEstimate::ELLIPSE; }));
  const std::size_t ellipses = count(modes_);
  push(response(2.0).coupling, 15);
  EXPECT_LE(count(modes_), ellipses + 2);  // at most while one locus turns into the other
  push(Complex6::Zero(), 15);
  ASSERT_TRUE(waitFor([&] { return last(modes_).mode == LocusEstimate::NONE; }));
  const LocusEstimate none = last(modes_);
  EXPECT_EQ(none.orientation, 0.0);
  EXPECT_NEAR(none.orientation_sd, M_PI / std::sqrt(12.0), 1e-12);
  EXPECT_TRUE(none.hypothesis_direction.empty());

  // latched
  std::vector<LocusEstimate> late;
  keep("contact_mode", late);
  ASSERT_TRUE(waitFor([&] { return count(late) > 0; }));
  EXPECT_EQ(last(late).mode, LocusEstimate::NONE);
  subs_.pop_back();
}

TEST_F(LocusEstimator, CanBeDisabledAndEnabled) {
  switchOn(500, 1);
  ASSERT_TRUE(enable(false));
  push(response(1.0).coupling, 10);
  EXPECT_EQ(count(loci_), 0u);
  refused(goal(time_ - 0.1, 0.1), "disabled");
  ASSERT_TRUE(enable(true));
  push(response(1.0).coupling);
  EXPECT_TRUE(waitFor([&] { return count(loci_) > 0; }));
}

TEST_F(LocusEstimator, IdentifiesAComingWindow) {
  switchOn(500, 1);
  const ContactResponse expected = response(0.7);
  push(expected.coupling);
  std::vector<IdentifyLocusFeedback> feedback;
  client_.sendGoal(goal(time_, 0.2), Client::SimpleDoneCallback(), Client::SimpleActiveCallback(),
                   [&](const IdentifyLocusFeedback::ConstPtr& f) {
                     const std::lock_guard<std::mutex> lock(mutex_);
                     feedback.push_back(*f);
                   });
  ASSERT_TRUE(waitFor([&] { return count(feedback) > 0; }));
  for (int k = 0; k < 10; ++k) {
    EXPECT_FALSE(client_.getState().isDone()) << k;
    pose(0.001);
    const std::size_t before = count(feedback);
    push(expected.coupling);
    if (k < 9) {
      ASSERT_TRUE(waitFor([&] { return count(feedback) > before; })) << k;
    }
  }
  ASSERT_TRUE(client_.waitForResult(ros::Duration(kPatience)));
  const IdentifyLocusResult result = *client_.getResult();
  EXPECT_EQ(client_.getState(), actionlib::SimpleClientGoalState::SUCCEEDED);
  EXPECT_TRUE(result.success) << result.message;
  EXPECT_EQ(result.locus.samples, 1000u);
  EXPECT_NEAR(result.locus.header.stamp.toSec(), time_, 1e-6);
  expectLocus(result.locus, expected, 0.7);
  // progress in cycles of the exciter, then probabilities
  const IdentifyLocusFeedback f = last(feedback);
  EXPECT_NEAR(f.cycles, 0.18 * 500 / (2 * M_PI), 0.1);
  EXPECT_GT(f.probabilities[LocusEstimate::SEGMENT], 0.5);
}

TEST_F(LocusEstimator, IdentifiesAPastWindow) {
  switchOn(770, -1);
  const ContactResponse expected = response(5.0);
  const double start = time_ + kPeriod;  // the sample at time_ was at rest
  push(expected.coupling, 15);
  const IdentifyLocusResult result = resultOf(goal(start, 0.3));
  ASSERT_TRUE(result.success) << result.message;
  expectLocus(result.locus, expected, 5.0);
  // the last exciter on the topic
  IdentifyLocusGoal g = goal(start, 0.3);
  g.exciter = Exciter();
  const IdentifyLocusResult same = resultOf(g);
  ASSERT_TRUE(same.success) << same.message;
  EXPECT_EQ(same.locus.p, result.locus.p);
  EXPECT_EQ(same.locus.hypothesis_direction, result.locus.hypothesis_direction);
}

TEST_F(LocusEstimator, RefusesWithAReason) {
  switchOn(500, 1);
  const double start = time_;
  push(response(1.0).coupling, 12);
  refused(goal(start, 0.0), "duration is 0");
  refused(goal(start, 1000.0), "duration is 1000");
  refused(goal(start - 50.0, 0.2), "samples are kept from");
  refused(goal(start, 0.005), "at least one is needed");
  IdentifyLocusGoal g = goal(start, 0.2);
  g.exciter.on = false;
  refused(g, "the exciter is off");
  g = goal(start, 0.2);
  g.exciter.frequency = std::numeric_limits<double>::quiet_NaN();
  refused(g, "exciter frequency is nan");
  g = goal(start, 0.2);
  g.exciter.direction = 0;
  refused(g, "exciter direction is 0");
  // no samples to come
  refused(goal(time_, 0.2), "no displacement samples for 2 s");

  // missing samples
  const double hole = time_;
  push(response(1.0).coupling, 2);
  block(response(1.0).coupling);
  push(response(1.0).coupling, 4);
  refused(goal(hole, 0.1), "100 of the window's 500 samples are missing");
  // the carrier must be at rest
  const double moving = time_;
  for (int k = 0; k < 5; ++k) {
    push(response(1.0).coupling);
    pose(0.001 * k);
  }
  push(response(1.0).coupling);
  ASSERT_TRUE(waitFor([&] {
    const IdentifyLocusResult result = resultOf(goal(moving, 0.1));
    return result.message.find("the carrier moved the peg by 0.00") != std::string::npos;
  }));
}

TEST_F(LocusEstimator, RefusesANoisyMeasurement) {
  switchOn(770, 1);
  const ContactResponse expected = response(1.0);
  const double start = time_ + kPeriod;
  for (int k = 0; k < 15; ++k) send(block(expected.coupling, 3e-5));
  refused(goal(start, 0.25), "too_uncertain: the direction would have a sd of ");
}

// Missing samples empty the window, which fills again.
TEST_F(LocusEstimator, RestartsTheWindowAfterALostBlock) {
  switchOn(500, 1);
  const ContactResponse expected = response(1.0);
  push(expected.coupling, 8);
  ASSERT_TRUE(waitFor([&] { return count(loci_) > 0; }));
  block(expected.coupling);  // lost
  push(expected.coupling, 1);
  const std::size_t before = count(loci_);
  push(expected.coupling, 3);
  EXPECT_EQ(count(loci_), before);
  push(expected.coupling, 3);
  ASSERT_TRUE(waitFor([&] { return count(loci_) > before; }));
  expectLocus(last(loci_), expected, 1.0);
}

// Simulated cell with a peg that slides on the plane: friction instead of the contact's direction.
TEST_F(LocusEstimator, FrictionOfASlidingPeg) {
  SimulatedReadingOptions o;
  o.lean = 0.7;
  o.tilt = 0.02;
  o.offset = 0.03 * Eigen::Vector2d(std::cos(o.lean), std::sin(o.lean));
  o.frequency = 500;
  o.amplitude = 15;
  o.press = 8;
  const SimulatedReading expected = readSimulated(o);
  exciter_.amplitude = o.amplitude;
  switchOn(o.frequency, 1);
  const double start = time_ + kPeriod;
  for (int k = 0; k < 15; ++k) send(block(expected.fit.phasor, kNoise, expected.point.press));
  const IdentifyLocusResult result = resultOf(goal(start, 0.25));
  ASSERT_TRUE(result.success) << result.message;
  EXPECT_TRUE(result.locus.hypothesis_direction.empty());
  // 0.2 in the scenario; without the tilt it is known to a tenth
  EXPECT_NEAR(result.locus.friction, 0.2, 0.02);
  EXPECT_GT(result.locus.friction_sd, 0.0);
}

// Strategies have the same data in core and through ROS: with the samples of a cell the node's
// estimate is that of the simulated plant of the same cell.
TEST_F(LocusEstimator, AgreesWithTheSimulatedPlant) {
  const Scenario scenario = loadScenario(
      std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml", {"gravity=9.81"});
  CellParameters parameters;
  // so little noise that the codes show: the plant computes every sample with the same noise
  parameters.noise = 5e-5;
  SimulatedPlant plant(scenario, mechanism_, parameters);
  SimulatedCell cell(scenario, parameters);
  const Calibration calibration =
      designCalibration(bridgeB(parameters.bits, parameters.noise), mechanism_.coupling);
  const Pose X_HB = carrierBase(scenario);
  StrainBlock volts;
  const auto step = [&](const PlantCommand& command) {
    if (command.rest) {
      cell.world().setRestTarget(restFromPose(X_HB * poseFromRest(*command.rest)));
    }
    if (command.exciter) cell.world().setExciter(*command.exciter, cell.world().time());
    EXPECT_EQ(cell.next(volts), StopReason::kOk);
    return plant.next(command);
  };
  PlantBlock seen = step({});
  PlantCommand down;
  down.rest = seen.carrier;
  for (int k = 0; k < 150; ++k) {
    const double force = contactForceFromDeflection(mechanism_, seen.displacement_b).z();
    down.rest->z -= force < 0.5 ? 2e-4 : std::clamp((12.0 - force) / 1.6e5, -5e-4, 5e-4);
    seen = step(down);
  }

  // from here on the node receives blocks
  const double base = time_ - cell.world().time();
  exciter_.header.stamp = ros::Time(time_);
  exciter_.on = true;
  exciter_.frequency = 450.0;
  exciter_.phase = 0.6;
  exciter_.direction = 1;
  exciters_.publish(exciter_);
  const auto feed = [&](const PlantCommand& command) {
    const PlantBlock out = step(command);
    DisplacementSamples b;
    b.header.stamp = ros::Time(base + volts.time);
    b.header.frame_id = "sensor_b";
    b.period = volts.period;
    b.sequence = ++sequence_;
    for (std::size_t k = 0; k < volts.saturated_b.size(); ++k) {
      const Vector6 d = displacementFromVolts(calibration, Vector6::Map(&volts.volts_b[6 * k]));
      b.displacement.insert(b.displacement.end(), d.data(), d.data() + 6);
    }
    time_ = base + cell.world().time();
    send(b);
    return out;
  };
  PlantCommand shake;
  shake.exciter = ExciterParameters{exciter_.amplitude, 450.0, 0.6, 1};
  feed(shake);
  for (int k = 0; k < 10; ++k) seen = feed({});
  PlantCommand read;
  read.locus = LocusRequest{seen.time, 0.2};
  const IdentifyLocusGoal g = goal(base + seen.time, 0.2);
  for (seen = feed(read); !seen.locus;) seen = feed({});

  const IdentifyLocusResult result = resultOf(g);
  ASSERT_TRUE(result.success) << result.message;
  const LocusReading node = fromLocusEstimate(result.locus);
  const LocusReading& core = *seen.locus;
  // stamps are rounded to 1 ns, in which the exciter rotates by 4.5e-7 rad
  const double tolerance = 1e-6 * core.locus.semiMajor();
  EXPECT_EQ(node.locus.samples, core.locus.samples);
  EXPECT_LT(std::abs(node.locus.P - core.locus.P), tolerance);
  EXPECT_LT(std::abs(node.locus.N - core.locus.N), tolerance);
  EXPECT_NEAR(node.locus.sigma, core.locus.sigma, 1e-5 * core.locus.sigma);
  EXPECT_EQ(node.mode.mode, core.mode.mode);
  EXPECT_EQ(node.mode.mode, LocusMode::kEllipse);
  EXPECT_LT((node.force - core.force).norm(), 1e-6);
  EXPECT_NEAR(node.misfit, core.misfit, 1e-5);
  ASSERT_TRUE(node.direction && core.direction);
  EXPECT_NEAR(node.direction->alpha, core.direction->alpha, 1e-5);
  EXPECT_NEAR(node.direction->weight, core.direction->weight, 1e-5);
  EXPECT_NEAR(node.direction->sd, core.direction->sd, 1e-4 * core.direction->sd);
  ASSERT_TRUE(node.evidence.vertical && node.evidence.yaw);
  EXPECT_LT(std::abs(node.evidence.vertical->value - core.evidence.vertical->value), tolerance);
  EXPECT_LT(std::abs(node.evidence.yaw->value - core.evidence.yaw->value),
            1e-6 * std::abs(core.evidence.yaw->value) + 1e-9);
  EXPECT_EQ(node.friction.has_value(), core.friction.has_value());
  EXPECT_EQ(node.advice, core.advice);
  EXPECT_EQ(node.refusal, core.refusal);
}

TEST_F(LocusEstimator, IsPreempted) {
  switchOn(500, 1);
  push(response(1.0).coupling);
  client_.sendGoal(goal(time_, 0.2));
  push(response(1.0).coupling, 2);
  client_.cancelGoal();
  ASSERT_TRUE(client_.waitForResult(ros::Duration(kPatience)));
  EXPECT_EQ(client_.getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  EXPECT_FALSE(client_.getResult()->success);
  EXPECT_EQ(client_.getResult()->message, "cancelled");
  // another client's goal
  Client other("identify_locus", true);
  ASSERT_TRUE(other.waitForServer(ros::Duration(kPatience)));
  client_.sendGoal(goal(time_, 0.2));
  push(response(1.0).coupling, 2);
  other.sendGoal(goal(time_, 0.2));
  ASSERT_TRUE(client_.waitForResult(ros::Duration(kPatience)));
  EXPECT_EQ(client_.getResult()->message.find("replaced by the goal " + ros::this_node::getName()),
            0U)
      << client_.getResult()->message;
  other.cancelGoal();
  ASSERT_TRUE(other.waitForResult(ros::Duration(kPatience)));
  // the next goal works
  const double start = time_;
  push(response(1.0).coupling, 10);
  EXPECT_TRUE(resultOf(goal(start, 0.2)).success);
}

TEST_F(LocusEstimator, AClockThatJumpsBackClearsTheSamples) {
  switchOn(500, 1);
  const double later = time_;
  push(response(1.0).coupling, 10);
  time_ -= 1800.0;
  push(Complex6::Zero(), 3);
  refused(goal(later - 1801.0, 0.2), "samples are kept from");
  clear();
  switchOn(500, 1);
  const ContactResponse expected = response(3.0);
  push(expected.coupling, 8);
  ASSERT_TRUE(waitFor([&] { return count(loci_) > 0; }));
  expectLocus(last(loci_), expected, 3.0);
}

// One line that names the parameter, exit code 1.
TEST_F(LocusEstimator, BadParametersEndTheNode) {
  const std::string node = std::string(ASSEMBLY_CELL_BIN_DIR) + "/locus_estimator __name:=bad ";
  const std::string scenario =
      "_scenario:=" + std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml ";
  const auto expectEnd = [&](const std::string& arguments, const std::string& part) {
    FILE* pipe = popen(("timeout 60 " + node + arguments + " 2>&1").c_str(), "r");
    std::string out;
    std::array<char, 512> buffer{};
    while (fgets(buffer.data(), buffer.size(), pipe)) out += buffer.data();
    const int status = pclose(pipe);
    EXPECT_EQ(WEXITSTATUS(status), 1) << arguments << out;
    EXPECT_NE(out.find(part), std::string::npos) << out;
    ros::param::del("/bad");
  };
  expectEnd("", "scenario");
  expectEnd("_scenario:=/nowhere.yaml", "/nowhere.yaml");
  expectEnd(scenario + "_window:=-1", "window");
  expectEnd(scenario + "_windwo:=0.1", "windwo");
  expectEnd(scenario + "_false_alarm:=abc", "false_alarm");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::locus_estimator_test
