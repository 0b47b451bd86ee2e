// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <ros/ros.h>

#include <atomic>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "assembly_cell/AddContact.h"
#include "assembly_cell/BeginTwinForce.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/estimation/twin_force_client.h"
#include "assembly_cell/ros/records/record_messages.h"

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

TEST(Conversions, PosesAreConvertedBack) {
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

TEST(Conversions, InvalidPosesAreRefused) {
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

TEST(Conversions, RestPosesHaveTheAnglesOfTheThesis) {
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

AssemblyRecord goodRecord() {
  AssemblyRecord record;
  for (auto* row : {&record.curve_time, &record.curve_depth, &record.curve_axial,
                    &record.curve_lateral, &record.curve_moment, &record.curve_tilt}) {
    *row = {0.0, 0.02, 0.04};
  }
  record.estimates = {"hole_x"};
  record.estimate_values = record.estimate_sds = {1e-3};
  record.events = {"retry"};
  record.event_times = {1.0};
  record.event_texts = {"jam"};
  return record;
}

TEST(RecordMessages, HostileOnesAreRefused) {
  EXPECT_EQ(check(goodRecord()).text(), "");
  const auto refuse = [](const std::function<void(AssemblyRecord&)>& edit,
                         const std::string& expected) {
    AssemblyRecord record = goodRecord();
    edit(record);
    EXPECT_EQ(check(record).text(), expected);
  };
  refuse([](auto& r) { r.curve_axial.pop_back(); }, "curve_axial has 2 entries: give 3");
  refuse([](auto& r) { r.curve_axial[1] = kNaN; },
         "curve_axial[1] is nan N: give -100000 to 100000");
  refuse([](auto& r) { r.curve_tilt[2] = 4.0; }, "curve_tilt[2] is 4 rad: give -3.2 to 3.2");
  refuse([](auto& r) { r.duration = -1.0; }, "duration is -1 s: give 0 to 1e+09");
  refuse([](auto& r) { r.curve_time.resize(1000001); },
         "size of curve_time is 1e+06: give 0 to 1e+06");
  refuse([](auto& r) { r.serial.assign(201, 'x'); }, "serial has 201 characters: give at most 200");
  refuse([](auto& r) { r.program = "a\nb"; },
         "program has a control character at position 2: give printable ones");
  refuse([](auto& r) { r.text.assign(20000, 'x'); }, "size of text is 20000: give 0 to 10000");
  refuse([](auto& r) { r.estimate_sds.clear(); }, "estimate_sds has 0 entries: give 1");
  refuse([](auto& r) { r.event_texts.clear(); }, "event_texts has 0 entries: give 1");
  refuse([](auto& r) { r.event_times[0] = kNaN; }, "event_times[0] is nan: give -1e+18 to 1e+18");

  AssemblyVerdict verdict;
  verdict.verdicts.resize(1);
  EXPECT_EQ(check(verdict).text(), "");
  verdict.verdicts[0].margin = kNaN;
  EXPECT_EQ(check(verdict).text(), "verdicts.margin is nan: give -1e+18 to 1e+18");
  RecorderState state;
  state.band_depth = {0.0};
  EXPECT_EQ(check(state).text(), "band_low has 0 entries: give 1");
  AssemblePegGoal goal;
  goal.serial.assign(300, 'x');
  EXPECT_EQ(check(goal).text(), "serial has 300 characters: give at most 200");
}

TEST(RecordMessages, RunsAreConvertedBack) {
  assembly_cell::Run run;
  run.serial = "A-117";
  run.program = "gearbox";
  run.program_hash = "crc32:0123abcd";
  run.start = 1.7e9;
  run.duration = 12.5;
  run.strategy = "touch";
  run.result = "failed";
  run.failure = "jammed";
  run.text = "jammed: stuck";
  run.versions = {{"package", "1"}};
  run.calibrations = {{"mechanism", "drawn crc32:0"}};
  run.settings = {{"insert.depth", "0.04"}, {"strategy", "touch"}};
  run.curve = {{0.0, 0.02}, {1e-3, 2e-3}, {1.0, 2.0}, {0.1, 0.2}, {0.01, 0.02}, {1e-4, 2e-4}};
  run.estimates = {{"hole_x", 1e-3, 1e-5}};
  run.events = {{3.5, "retry", "stuck"}};
  const assembly_cell::Run back = fromMessage(toMessage(run));
  EXPECT_EQ(back.serial + back.program + back.program_hash,
            run.serial + run.program + run.program_hash);
  EXPECT_EQ(back.start, run.start);
  EXPECT_EQ(back.duration, run.duration);
  EXPECT_EQ(back.strategy + back.result + back.failure + back.text,
            run.strategy + run.result + run.failure + run.text);
  EXPECT_EQ(back.versions, run.versions);
  EXPECT_EQ(back.calibrations, run.calibrations);
  EXPECT_EQ(back.settings, run.settings);
  EXPECT_EQ(back.curve.time, run.curve.time);
  EXPECT_EQ(back.curve.depth, run.curve.depth);
  EXPECT_EQ(back.curve.axial, run.curve.axial);
  EXPECT_EQ(back.curve.lateral, run.curve.lateral);
  EXPECT_EQ(back.curve.moment, run.curve.moment);
  EXPECT_EQ(back.curve.tilt, run.curve.tilt);
  ASSERT_EQ(back.estimates.size(), 1U);
  EXPECT_EQ(back.estimates[0].name, "hole_x");
  EXPECT_EQ(back.estimates[0].value, 1e-3);
  EXPECT_EQ(back.estimates[0].sd, 1e-5);
  ASSERT_EQ(back.events.size(), 1U);
  EXPECT_EQ(back.events[0].time, 3.5);
  EXPECT_EQ(back.events[0].kind + back.events[0].text, "retrystuck");
}

// rosparam reads off as false
TEST(ParametersTest, TakesOffFromRosparam) {
  ros::NodeHandle nh("~good");
  nh.setParam("mode", false);
  EXPECT_EQ(Parameters(nh).choice("mode", {"off", "required"}), "off");
  expectRefusal([&] { Parameters(nh).choice("mode", {"on", "required"}); }, "give a string");
  nh.deleteParam("mode");
}

TEST(ParametersTest, ReadsParametersAndDefaults) {
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
  expectRefusal([&] { p.choice("text", {"a", "b"}); }, "give a or b");
  expectRefusal([&] { p.texts("mixed"); }, name + "mixed is");
  expectRefusal([&] { p.numbers("three", 3); }, name + "three is");
  expectRefusal([&] { p.numbers("three", 2); }, "list of 2");
}

// rosparam, a reader of YAML 1.1, makes text of 5e-2 and 1e3.
TEST(ParametersTest, NamesNumbersThatRosparamTakesForText) {
  const ros::NodeHandle nh("~text_numbers");
  nh.setParam("limit", "5e-2");
  nh.setParam("count", "1e3");
  Parameters p(nh);
  expectRefusal([&] { p.number("limit", kNotNegative); }, "text, not a number: write 0.05; ");
  expectRefusal([&] { p.integer("count", 1, 2000); }, "text, not a number: write 1000; ");
}

TEST(ParametersTest, RefusesUnknownParameters) {
  Parameters p(ros::NodeHandle("~good"));
  p.number("number", kAny);
  expectRefusal(
      [&] {
        p.refuseUnknown({"flag", "text", "list", "three"});
      },
      "parameter /ros_bridge_test/good/integer is unknown");
  EXPECT_NO_THROW(p.refuseUnknown({"flag", "text", "list", "three", "integer"}));
}

// An estimator that loses calls: the connection is closed without an answer.
class ForgetfulEstimator {
 public:
  explicit ForgetfulEstimator(int lost) : lost_(lost) {
    using Handle = ros::NodeHandle;
    Handle nh, pnh("twin_force_estimator");
    // its publisher is checked to be running
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

// The client's error after two contacts.
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

TEST(TwinForceClientTest, ACallWithoutAnAnswerIsRepeatedOnce) {
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

TEST(TwinForceClientTest, AnEstimatorWithoutItsContactsIsNamed) {
  ros::AsyncSpinner spinner(1);
  spinner.start();
  ForgetfulEstimator estimator(0);
  const std::string reason = addTwo(estimator, true);
  EXPECT_EQ(reason.rfind("twin_force_estimator keeps 1 contacts of 2", 0), 0U) << reason;
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::ros_bridge_test
