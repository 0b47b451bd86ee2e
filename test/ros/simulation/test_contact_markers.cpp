// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegActionFeedback.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblePegActionFeedback.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/LocusEstimate.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/description/urdf_text.h"
#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/simulation/markers/marker_colors.h"
#include "cell_fixture.h"
#include "live_client.h"

namespace assembly_cell::ros_bridge::contact_markers_test {
namespace {

using test::Child;
using test::executable;
using test::Record;
using test::waitFor;
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

constexpr double kExact = 1e-12;  // sums and products of double precision near 1 m

class Markers : public ::testing::Test {
 protected:
  Markers() {
    contacts_pub_ = nh_.advertise<ContactArray>("truth/contacts", 10);
    truth_pub_ = nh_.advertise<geometry_msgs::PoseStamped>("truth/pose", 10, true);
    locus_pub_ = nh_.advertise<LocusEstimate>("locus", 10);
    report_pub_ = nh_.advertise<AlignmentReport>("report", 10, true);
  }

  void watch() {
    markers_ = std::make_unique<Record<MarkerArray>>(nh_, "markers");
    ASSERT_TRUE(waitFor([this] {
      return markers_->size() > 0 && contacts_pub_.getNumSubscribers() > 0 &&
             truth_pub_.getNumSubscribers() > 0 && locus_pub_.getNumSubscribers() > 0 &&
             report_pub_.getNumSubscribers() > 0;
    })) << "no markers";
  }

  // markers of a namespace in the newest array that has `count` of them with the action
  std::vector<Marker> find(const std::string& ns, std::size_t count, int action = Marker::ADD) {
    std::vector<Marker> found;
    EXPECT_TRUE(waitFor([&] {
      for (const auto& array : markers_->all()) {
        std::vector<Marker> here;
        for (const auto& marker : array->markers) {
          if (marker.ns == ns && marker.action == action) here.push_back(marker);
        }
        if (here.size() == count) found = here;
      }
      return found.size() == count;
    })) << count
        << " markers " << ns;
    return found;
  }

  static Contact contact(double x, std::uint8_t state) {
    Contact c;
    c.position.x = x;
    c.normal.z = 1.0;
    c.force.z = 10.0;
    c.state = state;
    return c;
  }

  ros::NodeHandle nh_;
  ros::Publisher contacts_pub_, truth_pub_, locus_pub_, report_pub_;
  std::unique_ptr<Record<MarkerArray>> markers_;
};

TEST_F(Markers, WorkOnlyWithASubscriber) {
  // no subscriber: no inputs either
  ASSERT_TRUE(waitFor([this] { return contacts_pub_.getNumSubscribers() == 0; }));
  watch();
  EXPECT_GT(contacts_pub_.getNumSubscribers(), 0U);
  markers_.reset();
  EXPECT_TRUE(waitFor([this] {
    return contacts_pub_.getNumSubscribers() == 0 && truth_pub_.getNumSubscribers() == 0 &&
           locus_pub_.getNumSubscribers() == 0 && report_pub_.getNumSubscribers() == 0;
  }));
}

TEST_F(Markers, RestartAndKeepTheirRate) {
  watch();
  // the first array clears what was there
  EXPECT_EQ(markers_->all().front()->markers.front().action, Marker::DELETEALL);
  const auto start = ros::WallTime::now();
  const std::size_t n = markers_->size();
  ASSERT_TRUE(waitFor([&] { return markers_->size() >= n + 30; }));
  // 15 Hz; at most a few can have queued up before
  EXPECT_GT((ros::WallTime::now() - start).toSec(), 20.0 / 30.0);
}

TEST_F(Markers, DrawTheHole) {
  watch();
  const Marker hole = find("hole", 1).front();
  std::string urdf;
  ASSERT_TRUE(nh_.getParam("robot_description", urdf));
  const double radius = loadCellDescription(urdf).hole.radius;
  EXPECT_EQ(hole.header.frame_id, "hole");
  EXPECT_GT(hole.lifetime.toSec(), 0.0);
  EXPECT_EQ(hole.color.r, kHoleColor.r);
  for (const auto& p : hole.points) {
    EXPECT_NEAR(std::hypot(p.x, p.y), radius, kExact);
    EXPECT_EQ(p.z, 0.0);
  }
}

// a point contact's line passes the point; a couple beside it makes it grey
TEST_F(Markers, DrawALiveWrenchAsLineAndPoint) {
  ros::Publisher pub = nh_.advertise<geometry_msgs::WrenchStamped>("sensor_b/wrench", 10, true);
  watch();
  const Eigen::Vector3d at(0.003, 0.0075, -0.02), force(2.0, -1.0, 10.0);
  const auto publish = [&](double couple) {
    Vector6 w;
    w << force, at.cross(force) + couple * force;
    geometry_msgs::WrenchStamped message;
    message.header.frame_id = "sensor_b";
    message.wrench = toWrench(w);
    pub.publish(message);
  };
  publish(0.0);
  const Marker point = find("wrench_point", 1).front();
  EXPECT_EQ(point.header.frame_id, "sensor_b");
  EXPECT_NEAR(point.pose.position.x, at.x(), kExact);
  EXPECT_NEAR(point.pose.position.y, at.y(), kExact);
  EXPECT_NEAR(point.pose.position.z, at.z(), kExact);
  EXPECT_EQ(point.color.r, kContactPointColor.r);
  const Marker line = find("wrench_line", 1).front();
  ASSERT_EQ(line.points.size(), 2u);
  publish(0.02);
  ASSERT_TRUE(waitFor([&] { return find("wrench_point", 1).front().color.r == kSeveralColor.r; }));
}

TEST_F(Markers, DrawTouchingContactsAndDeleteThoseThatEnded) {
  watch();
  ContactArray contacts;
  contacts.contacts = {contact(0.01, Contact::SLIP), contact(0.02, Contact::STICK),
                       contact(0.03, Contact::OPEN)};
  contacts_pub_.publish(contacts);
  const auto points = find("contact_points", 2);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_NEAR(points[0].pose.position.x, 0.01, kExact);
  EXPECT_NE(points[0].id, points[1].id);
  EXPECT_EQ(points[0].color.r, kContactPointColor.r);
  const auto forces = find("contact_forces", 2);
  ASSERT_EQ(forces.size(), 2U);
  // 10 N at 2 mm per newton
  EXPECT_NEAR(forces[1].points[1].z - forces[1].points[0].z, 0.02, kExact);
  EXPECT_EQ(find("contact_normals", 2).size(), 2U);

  contacts.contacts.resize(1);
  contacts_pub_.publish(contacts);
  const auto gone = find("contact_points", 1, Marker::DELETE);
  ASSERT_EQ(gone.size(), 1U);
  EXPECT_EQ(gone[0].id, points[1].id);
}

// What is set while the node runs holds from the next picture on; what is refused changes nothing.
TEST_F(Markers, DrawAsSetWhileTheyRun) {
  const std::string node = "contact_markers";
  watch();
  ContactArray contacts;
  contacts.contacts = {contact(0.01, Contact::SLIP)};
  contacts_pub_.publish(contacts);
  const double diameter = find("contact_points", 1).front().scale.x;
  find("legend", 9);
  // those after this one are drawn with the active settings
  const auto drawn = [&](const std::string& ns, std::size_t count, int action = Marker::ADD) {
    markers_->clear();
    EXPECT_TRUE(waitFor([&] { return markers_->size() >= 2; }));
    contacts_pub_.publish(contacts);
    return find(ns, count, action);
  };

  ASSERT_TRUE(test::setLive(node, "size", 2.0));
  ASSERT_TRUE(test::setLive(node, "force_scale", 0.004));
  ASSERT_TRUE(waitFor([&] { return drawn("contact_points", 1).front().scale.x != diameter; }));
  EXPECT_NEAR(drawn("contact_points", 1).front().scale.x, 2.0 * diameter, kExact);
  EXPECT_NEAR(drawn("contact_forces", 1).front().points[1].z, 0.04, kExact);

  EXPECT_FALSE(test::setLive(node, "size", std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(test::setLive(node, "size", 0.0));
  EXPECT_FALSE(test::setLive(node, "wrench", 1.0));
  EXPECT_NEAR(drawn("contact_points", 1).front().scale.x, 2.0 * diameter, kExact);

  ASSERT_TRUE(test::setLive(node, "words", false));
  find("legend", 9, Marker::DELETE);
  EXPECT_EQ(drawn("legend", 0).size(), 0U);

  // one in two seconds instead of 15 in one: the next picture comes, the one after it is late
  ASSERT_TRUE(test::setLive(node, "rate", 0.5));
  std::size_t n = markers_->size();
  ASSERT_TRUE(waitFor([&] { return markers_->size() > n; }));
  n = markers_->size();
  const auto start = ros::WallTime::now();
  ASSERT_TRUE(waitFor([&] { return markers_->size() >= n + 2; }));
  EXPECT_GT((ros::WallTime::now() - start).toSec(), 1.9);

  ASSERT_TRUE(test::setLive(node, "rate", 15.0));
  ASSERT_TRUE(test::setLive(node, "words", true));
  ASSERT_TRUE(test::setLive(node, "force_scale", 0.002));
  ASSERT_TRUE(test::setLive(node, "size", 1.0));
}

TEST_F(Markers, DrawTheLocusEnlargedAndItsHypotheses) {
  watch();
  LocusEstimate locus;
  locus.p = {3e-6, 0.0};
  locus.n = {1e-6, 0.0};
  locus.hypothesis_direction = {0.0, 3.14159265358979};
  locus.hypothesis_weight = {0.9, 0.1};
  locus_pub_.publish(locus);
  const auto ellipse = find("locus", 1);
  ASSERT_EQ(ellipse.size(), 1U);
  EXPECT_EQ(ellipse[0].header.frame_id, "peg");
  double x = 0.0, y = 0.0;
  for (const auto& p : ellipse[0].points) {
    x = std::max(x, std::abs(p.x));
    y = std::max(y, std::abs(p.y));
  }
  // semi-axes |P| + |N| and |P| − |N|, a thousand times
  EXPECT_NEAR(x, 4e-3, kExact);
  EXPECT_NEAR(y, 2e-3, kExact);
  const auto hypotheses = find("hypotheses", 2);
  ASSERT_EQ(hypotheses.size(), 2U);
  EXPECT_GT(hypotheses[0].points[1].x, 0.0);
  EXPECT_LT(hypotheses[1].points[1].x, 0.0);
  EXPECT_GT(hypotheses[0].color.a, hypotheses[1].color.a);
}

TEST_F(Markers, DrawTheTrueAndTheEstimatedPeg) {
  watch();
  geometry_msgs::PoseStamped truth;
  truth.pose = toPose({Eigen::Matrix3d::Identity(), Eigen::Vector3d(1e-3, 2e-3, 3e-3)});
  truth_pub_.publish(truth);
  AlignmentReport report;
  report.estimate_known = true;
  report.estimated_pose = toPose({Eigen::Matrix3d::Identity(), Eigen::Vector3d(4e-3, 5e-3, 0.0)});
  report_pub_.publish(report);
  for (const auto& marker : find("peg_true", 2)) {
    EXPECT_EQ(marker.header.frame_id, "hole_truth");
    EXPECT_EQ(marker.pose.position.x, 1e-3);
    EXPECT_EQ(marker.color.g, kTruePegColor.g);
  }
  EXPECT_EQ(find("hole", 1).front().header.frame_id, "hole_truth");
  // where the alignment found the hole, and the peg in it
  const Marker hole = find("hole_estimated", 1).front();
  EXPECT_EQ(hole.header.frame_id, "hole_estimated");
  EXPECT_EQ(toPoint(Eigen::Vector3d::Zero()), hole.pose.position);
  for (const auto& marker : find("peg_estimated", 2)) {
    EXPECT_EQ(marker.header.frame_id, "hole_estimated");
    EXPECT_EQ(marker.pose.position.x, 4e-3);
    EXPECT_EQ(marker.color.b, kEstimatedPegColor.b);
    EXPECT_GT(marker.scale.x, 2.0 * hole.scale.x) << "not seen beside the true peg";
  }
}

// the locus ends with the shaking, not with the next reading
TEST_F(Markers, DropTheLocusWhenTheExciterIsOff) {
  auto exciter_pub = nh_.advertise<Exciter>("exciter", 10, true);
  watch();
  LocusEstimate locus;
  locus.p = {3e-6, 0.0};
  locus_pub_.publish(locus);
  ASSERT_EQ(find("locus", 1).size(), 1U);
  exciter_pub.publish(Exciter());
  EXPECT_EQ(find("locus", 1, Marker::DELETE).size(), 1U);
}

// what the goal does, then how it ended and how far the estimate is off; a new goal ends that
TEST_F(Markers, SayStateAndResult) {
  auto feedback_pub = nh_.advertise<AlignPegActionFeedback>("align/feedback", 10);
  watch();
  ASSERT_TRUE(waitFor([&] { return feedback_pub.getNumSubscribers() > 0; }));
  const auto says = [&](const std::string& words) {
    return waitFor([&] { return find("state", 1).front().text == words; });
  };
  AlignPegActionFeedback feedback;
  feedback.status.goal_id.id = "first";
  feedback.feedback.state = "search";
  feedback.feedback.message = "0.21 mm between walls";
  feedback_pub.publish(feedback);
  EXPECT_TRUE(says("search: 0.21 mm\nbetween walls"));

  // 0.03 and 0.04 mm off, and a degree
  geometry_msgs::PoseStamped truth;
  truth.pose = toPose({Eigen::Matrix3d::Identity(), Eigen::Vector3d(1e-3, 2e-3, 3e-3)});
  truth_pub_.publish(truth);
  ASSERT_EQ(find("peg_true", 2).size(), 2U);
  AlignmentReport report;
  report.success = report.estimate_known = true;
  report.reason = "aligned";
  const Eigen::AngleAxisd degree(M_PI / 180.0, Eigen::Vector3d::UnitY());
  report.estimated_pose = toPose({degree.toRotationMatrix(), {1.03e-3, 2.04e-3, 0.0}});
  report_pub_.publish(report);
  EXPECT_TRUE(says("aligned\noffset wrong by 0.050 mm\ntilt wrong by 1.000 deg"));
  EXPECT_EQ(find("state", 1).front().color.g, kSuccessColor.g);
  ASSERT_EQ(find("peg_estimated", 2).size(), 2U);

  report.success = report.estimate_known = false;
  report.reason = "no_contact";
  report_pub_.publish(report);
  EXPECT_TRUE(says("no_contact"));
  EXPECT_EQ(find("state", 1).front().color.r, kFailureColor.r);

  feedback.status.goal_id.id = "second";
  feedback_pub.publish(feedback);
  EXPECT_TRUE(says("search: 0.21 mm\nbetween walls"));
  EXPECT_EQ(find("peg_estimated", 2, Marker::DELETE).size(), 2U);
}

// the report of a goal that went on to an insertion is of its alignment
TEST_F(Markers, NameAnInsertionSeatedWithItsDepth) {
  auto feedback_pub = nh_.advertise<AssemblePegActionFeedback>("assemble/feedback", 10);
  watch();
  ASSERT_TRUE(waitFor([&] { return feedback_pub.getNumSubscribers() > 0; }));
  const auto shows = [&](const std::string& words) {
    return waitFor([&] { return find("state", 1).front().text == words; });
  };
  AssemblePegActionFeedback feedback;
  feedback.status.goal_id.id = "assembly";
  feedback.feedback.state = "insert";
  feedback_pub.publish(feedback);
  EXPECT_TRUE(shows("insert"));
  AlignmentReport report;
  report.success = true;
  report.reason = "aligned";
  report_pub_.publish(report);
  EXPECT_TRUE(shows("seated"));
  feedback.feedback.state = "seated";
  feedback.feedback.message = "40.00 mm deep, largest force 3.1 N";
  feedback_pub.publish(feedback);
  EXPECT_TRUE(shows("seated: 40.00 mm\ndeep, largest force\n3.1 N"));
  report.success = false;
  report.reason = "jammed";
  report_pub_.publish(report);
  EXPECT_TRUE(shows("jammed"));
}

TEST_F(Markers, NameThePartsAndWhatTheColoursMean) {
  watch();
  EXPECT_EQ(find("names", 4).size(), 4U);
  std::map<std::string, float> blue;
  for (const auto& entry : find("legend", 9)) blue[entry.text] = entry.color.b;
  ASSERT_EQ(blue.count("locus, 1000 times"), 1U);
  EXPECT_EQ(blue["locus, 1000 times"], kLocusColor.b);
  EXPECT_EQ(blue["its normal"], kContactNormalColor.b);
}

// a point of the rim comes where the camera's numbers say; nothing is sent without a subscriber
TEST_F(Markers, OfferAViewOfTheRimFromAbove) {
  tf2_ros::Buffer frames;
  tf2_ros::TransformListener listener(frames);
  watch();
  EXPECT_FALSE(frames._frameExists("rim_camera"));
  Record<sensor_msgs::CameraInfo> infos(nh_, "rim_view/camera_info");
  Record<sensor_msgs::Image> images(nh_, "rim_view/image");
  ASSERT_TRUE(waitFor([&] { return infos.size() > 0 && images.size() > 0; }));
  ASSERT_TRUE(waitFor([&] { return frames.canTransform("rim_camera", "hole", ros::Time()); }));
  const auto& info = *infos.all().back();
  EXPECT_EQ(info.header.frame_id, "rim_camera");
  EXPECT_EQ(images.all().back()->data.size(), info.width * info.height);
  const double radius =
      loadCellDescription(nh_.param("robot_description", std::string())).hole.radius;
  const auto& X = frames.lookupTransform("rim_camera", "hole", ros::Time()).transform;
  const Eigen::Quaterniond R(X.rotation.w, X.rotation.x, X.rotation.y, X.rotation.z);
  const Eigen::Vector3d p(X.translation.x, X.translation.y, X.translation.z);
  const Eigen::Vector3d seen = R * Eigen::Vector3d(0.0, radius, 0.0) + p;
  // x right, y up: the point on y is above the middle, two thirds of the way to the edge
  EXPECT_NEAR(info.K[2] + info.K[0] * seen.x() / seen.z(), 0.5 * info.width, 1e-9);
  EXPECT_NEAR(info.K[5] + info.K[4] * seen.y() / seen.z(), info.height * (0.5 - 0.5 / 1.5), 1e-9);
  // an inserted edge three radii deep looks as large as the rim, to a thirtieth
  const Eigen::Vector3d deep = R * Eigen::Vector3d(0.0, radius, -3.0 * radius) + p;
  EXPECT_NEAR(deep.y() / deep.z() * p.z(), seen.y() / seen.z() * p.z(), radius / 30.0);
  // where rim and peg are drawn in the true hole's frame, the camera looks along its axis
  geometry_msgs::PoseStamped truth;
  truth.pose = toPose(Pose());
  truth_pub_.publish(truth);
  EXPECT_TRUE(waitFor([&] {
    std::string parent;
    return frames._getParent("rim_camera", ros::Time(), parent) && parent == "hole_truth";
  }));
}

// rviz's first view is as far from a small peg as from a large one
TEST(MarkersOfASmallPeg, HaveWordsToReadAndThinLines) {
  Mechanism mechanism = loadMechanism(test::sourceFile("config/scenarios/cell.yaml"));
  mechanism.peg.radius = 0.005;
  mechanism.hole.radius = 0.00502;
  ros::NodeHandle nh("/small");
  nh.setParam("robot_description", cellUrdf(mechanism));
  Child node({executable("contact_markers"), "__ns:=/small"});
  Record<MarkerArray> markers(nh, "markers");
  ASSERT_TRUE(waitFor([&] { return markers.size() > 0; })) << node.output();
  float letters = 0.0F;
  double width = 1.0;
  for (const auto& marker : markers.last()->markers) {
    if (marker.ns == "legend") letters = static_cast<float>(marker.scale.z);
    if (marker.ns == "hole") width = marker.scale.x;
  }
  EXPECT_GE(letters, 0.005F);  // four fifths of those beside the default peg
  EXPECT_LT(width, 0.0004);    // half of the default peg's
}

TEST(MarkersBadInput, GivesOneLine) {
  Child fast({executable("contact_markers"), "__ns:=/bad", "_rate:=100"});
  EXPECT_EQ(fast.wait(), 1) << fast.output();
  EXPECT_EQ(fast.lines("/bad/contact_markers/rate is 100").size(), 1U) << fast.output();
  ros::param::del("/bad/contact_markers");
  Child blind({executable("contact_markers"), "__ns:=/bad"});
  EXPECT_EQ(blind.wait(), 1) << blind.output();
  EXPECT_EQ(blind.lines("/bad/robot_description is missing").size(), 1U) << blind.output();
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::contact_markers_test
