// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <std_msgs/Int32.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <functional>
#include <limits>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/AddContact.h"
#include "assembly_cell/BeginTwinForce.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/guarded_spinner.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/estimation/twin_force_client.h"
#include "assembly_cell/ros/process/poll_beat.h"

namespace assembly_cell::ros_bridge::ros_bridge_test {
namespace {

constexpr double kRounding = 1e-14;  // a few roundings near 1
const double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

void expectRefusal(const std::function<void()>& call, const std::string& expected) {
  const std::string line = refusal(call);
  EXPECT_NE(line.find(expected), std::string::npos)
      << "'" << line << "' has no '" << expected << "'";
  EXPECT_EQ(line.find('\n'), std::string::npos) << line;
}

TEST(Conversions, PosesComeBack) {
  for (const double angle : {0.0, 1e-8, 0.3, 3.1, 3.14159265358979 - 1e-8}) {
    const Eigen::Vector3d axis = Eigen::Vector3d(1.0, -2.0, 0.5).normalized();
    const Pose X{rotationFromVector({angle * axis}), Eigen::Vector3d(0.1, -0.2, 0.3)};
    const geometry_msgs::Pose message = toPose(X);
    EXPECT_GE(message.orientation.w, 0.0);
    const Pose back = fromPose(message, "pose");
    EXPECT_LT((back.R - X.R).norm(), kRounding) << angle;
    EXPECT_EQ(back.p, X.p);
    const auto frame = transformStamped("a", "b", X, ros::Time(2.0));
    EXPECT_EQ(frame.transform.rotation, message.orientation);
    EXPECT_EQ(frame.transform.translation.z, 0.3);
    EXPECT_EQ(frame.header.frame_id + frame.child_frame_id, "ab");
  }
}

TEST(Conversions, PosesThatAreNoneAreRefused) {
  geometry_msgs::Pose pose = toPose(Pose{});
  pose.position.y = kNaN;
  expectRefusal([&] { fromPose(pose, "the source"); }, "the source: position");
  pose = toPose(Pose{});
  pose.orientation.w = 0.0;
  expectRefusal([&] { fromPose(pose, "the source"); }, "the source: orientation");
  pose.orientation.w = kNaN;
  expectRefusal([&] { fromPose(pose, "the source"); }, "the source: orientation");
}

TEST(Conversions, WrenchesKeepForceBeforeTorque) {
  Vector6 w;
  w << 1, 2, 3, 4, 5, 6;
  const geometry_msgs::Wrench message = toWrench(w);
  EXPECT_EQ(message.force.y, 2.0);
  EXPECT_EQ(message.torque.x, 4.0);
  EXPECT_EQ(fromWrench(message), w);
}

TEST(Conversions, RestPosesAreThoseOfTheThesisAngles) {
  const RestPose rest{0.01, -0.02, 0.08, 0.1, 1.6, -0.05};
  const Pose X = poseFromRest(rest);
  EXPECT_EQ(X.p, Eigen::Vector3d(0.01, -0.02, 0.08));
  EXPECT_LT((X.R - rotationFromEuler({-0.05, 1.6, 0.1})).norm(), kRounding);
  const RestPose back = restFromPose(X);
  EXPECT_NEAR(back.yaw, rest.yaw, kRounding);
  EXPECT_NEAR(back.theta, rest.theta, kRounding);
  EXPECT_NEAR(back.phi, rest.phi, kRounding);
  // upright is no rotation
  EXPECT_LT((poseFromRest(RestPose{}).R - Eigen::Matrix3d::Identity()).norm(), kRounding);
}

TEST(ParametersTest, ReadsWhatIsThereAndFallsBack) {
  Parameters p(ros::NodeHandle("~good"));
  EXPECT_EQ(p.number("number", kPositive), 0.5);
  EXPECT_EQ(p.number("integer", kAny), 3.0);
  EXPECT_EQ(p.integer("integer", 0, 10), 3);
  EXPECT_TRUE(p.flag("flag"));
  EXPECT_EQ(p.text("text"), "word");
  EXPECT_EQ(p.choice("text", {"another", "word"}), "word");
  EXPECT_EQ(p.texts("list"), (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(p.texts("text"), std::vector<std::string>{"word"});
  EXPECT_EQ(p.numbers("three", 3), (std::vector<double>{1.0, 2.5, 3.0}));
  EXPECT_EQ(p.number("absent", kAny, 7.0), 7.0);
  EXPECT_EQ(p.text("absent", "x"), "x");
  EXPECT_NO_THROW(p.refuseUnknown());
}

TEST(ParametersTest, RefusesInOneLineWithNameAndValue) {
  Parameters p(ros::NodeHandle("~bad"));
  const std::string name = "parameter /ros_bridge_test/bad/";
  expectRefusal([&] { p.number("absent", kAny); }, name + "absent is missing");
  expectRefusal([&] { p.number("nan", kAny); }, name + "nan is nan");
  expectRefusal([&] { p.number("infinite", kAny, 1.0); }, name + "infinite is inf");
  expectRefusal([&] { p.number("text", kAny); }, name + "text is word");
  expectRefusal([&] { p.number("low", kNotNegative); }, name + "low is -1");
  expectRefusal([&] { p.number("low", {1.0, 2.0}); }, "from 1 to 2");
  expectRefusal([&] { p.integer("low", 0, 1); }, name + "low is");
  expectRefusal([&] { p.flag("text"); }, "true or false");
  expectRefusal([&] { p.text("low"); }, "string");
  expectRefusal([&] { p.choice("text", {"a", "b"}); }, "one of a, b");
  expectRefusal([&] { p.texts("mixed"); }, name + "mixed is");
  expectRefusal([&] { p.numbers("three", 3); }, name + "three is");
  expectRefusal([&] { p.numbers("three", 2); }, "list of 2");
}

TEST(ParametersTest, RefusesWhatNobodyAskedFor) {
  Parameters p(ros::NodeHandle("~good"));
  p.number("number", kAny);
  expectRefusal(
      [&] {
        p.refuseUnknown({"flag", "text", "list", "three"});
      },
      "parameter /ros_bridge_test/good/integer is unknown");
  EXPECT_NO_THROW(p.refuseUnknown({"flag", "text", "list", "three", "integer"}));
}

// An estimator that loses calls: the connection ends without an answer.
class ForgetfulEstimator {
 public:
  explicit ForgetfulEstimator(int lost) : lost_(lost) {
    using Handle = ros::NodeHandle;
    Handle nh, pnh("twin_force_estimator");
    // who publishes it is asked whether it is alive
    status_ = nh.advertise<TwinForceState>("twin_force/status", 1, true);
    services_ = {pnh.advertiseService("begin", &ForgetfulEstimator::onBegin, this),
                 pnh.advertiseService("add_contact", &ForgetfulEstimator::onAdd, this)};
  }
  int asked() const { return asked_; }
  void forget() { state_.contacts.clear(); }

 private:
  bool onBegin(BeginTwinForce::Request& request, BeginTwinForce::Response& response) {
    state_.task = request.task;
    response.success = true;
    return true;
  }
  bool onAdd(AddContact::Request& request, AddContact::Response& response) {
    ++asked_;
    if (lost_-- > 0) return false;
    FeltContact contact;
    contact.blocks = request.blocks;
    contact.move = toPose(Pose{});
    state_.contacts.push_back(contact);
    response.success = true;
    response.status = state_;
    return true;
  }

  int lost_;
  std::atomic<int> asked_{0};
  TwinForceState state_;
  ros::Publisher status_;
  std::vector<ros::ServiceServer> services_;
};

// What the client says of two contacts.
std::string addTwo(ForgetfulEstimator& estimator, bool forgets) {
  TwinForceClient::Settings settings;
  settings.stamp_of = [](double time) { return ros::Time(100.0 + time); };
  settings.cancelled = [] { return false; };
  settings.answer_within = 5.0;
  TwinForceClient client(ros::NodeHandle(), settings);
  try {
    client.begin(TwinForceTask{});
    AveragingWindow window({1});
    window.add(PlantBlock{});
    EXPECT_EQ(client.add(window).refusal, "");
    if (forgets) estimator.forget();
    return client.add(window).refusal;
  } catch (const PlantError& error) {
    return error.what();
  }
}

TEST(TwinForceClientTest, ACallWithoutAnAnswerIsSaidOnceMore) {
  ros::AsyncSpinner spinner(1);
  spinner.start();
  {
    ForgetfulEstimator estimator(1);
    EXPECT_EQ(addTwo(estimator, false), "");
    EXPECT_EQ(estimator.asked(), 3);
  }
  {
    ForgetfulEstimator estimator(2);
    EXPECT_EQ(addTwo(estimator, false),
              "service twin_force_estimator/add_contact ended without an answer: is it running?");
    EXPECT_EQ(estimator.asked(), 2);
  }
}

TEST(TwinForceClientTest, AnEstimatorThatForgotIsNamed) {
  ros::AsyncSpinner spinner(1);
  spinner.start();
  ForgetfulEstimator estimator(0);
  const std::string reason = addTwo(estimator, true);
  EXPECT_EQ(reason.rfind("twin_force_estimator keeps 1 contacts of 2", 0), 0U) << reason;
}

// ---- the network thread's beat ----

double wallSeconds() { return ros::WallTime::now().toSec(); }

// What a beat publishes is heard at the next one, and all of it is in one thread.
TEST(PollBeatTest, HearsBeforeEachBeatAndSendsAfterIt) {
  ros::NodeHandle nh;
  ros::CallbackQueue queue;
  nh.setCallbackQueue(&queue);
  std::atomic<int> beats{0}, heard{0}, late{0};
  std::set<std::thread::id> threads;
  ros::Publisher pub = nh.advertise<std_msgs::Int32>("poll_beat/number", 100);
  ros::Subscriber sub = nh.subscribe<std_msgs::Int32>("poll_beat/number", 100,
                                                      [&](const std_msgs::Int32ConstPtr& number) {
                                                        threads.insert(std::this_thread::get_id());
                                                        heard = number->data;
                                                        if (number->data != beats) ++late;
                                                      });
  {
    const PollBeat beat(0.002, [&] {
      threads.insert(std::this_thread::get_id());
      queue.callAvailable(ros::WallDuration(0.0));
      std_msgs::Int32 number;
      number.data = ++beats;
      pub.publish(number);
    });
    const double end = wallSeconds() + 60.0;
    while (heard < 1000 && wallSeconds() < end) ros::WallDuration(0.01).sleep();
    EXPECT_GE(heard, 1000);
    EXPECT_EQ(late, 0);
  }
  EXPECT_EQ(threads.size(), 1U);
  const int last = beats;
  ros::WallDuration(0.05).sleep();
  EXPECT_EQ(beats, last) << "a beat after the end";
}

TEST(PollBeatTest, KeepsThePeriodAndMakesUpForWhatWasLate) {
  std::atomic<int> beats{0};
  const double begin = wallSeconds();
  const PollBeat beat(0.005, [&] {
    // one beat takes as long as ten
    if (++beats == 20) ros::WallDuration(0.05).sleep();
  });
  const double end = begin + 60.0;
  while (beats < 200 && wallSeconds() < end) ros::WallDuration(0.005).sleep();
  const double took = wallSeconds() - begin;
  EXPECT_GE(beats, 200);
  // never ahead of the clock by more than the beat that is looked at
  EXPECT_GT(took, 198 * 0.005);
}

TEST(PollBeatTest, ServicesAnswerBetweenSlowBeats) {
  ros::NodeHandle nh;
  ros::CallbackQueue queue;
  nh.setCallbackQueue(&queue);
  using Request = std_srvs::Trigger::Request;
  using Response = std_srvs::Trigger::Response;
  const ros::ServiceServer server = nh.advertiseService<Request, Response>(
      "poll_beat/ask", [](Request&, Response& response) { return response.success = true; });
  GuardedSpinner spinner(1, &queue);
  spinner.start();
  std::atomic<int> beats{0};
  const double begin = wallSeconds();
  const PollBeat beat(3600.0, [&] { ++beats; });
  std_srvs::Trigger trigger;
  EXPECT_TRUE(ros::service::call("poll_beat/ask", trigger));
  EXPECT_TRUE(trigger.response.success);
  // the beat of an hour holds up nothing
  EXPECT_LT(wallSeconds() - begin, 60.0);
  EXPECT_EQ(beats, 0);
  spinner.stop();
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::ros_bridge_test
