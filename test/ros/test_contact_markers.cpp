// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/LocusEstimate.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/ros/conversions.h"
#include "assembly_cell/ros/marker_colors.h"
#include "cell_fixture.h"

namespace assembly_cell::ros_bridge {
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

TEST_F(Markers, WorkOnlyWhileSomebodyLooks) {
  // nobody looks: no inputs either
  ASSERT_TRUE(waitFor([this] { return contacts_pub_.getNumSubscribers() == 0; }));
  watch();
  EXPECT_GT(contacts_pub_.getNumSubscribers(), 0U);
  markers_.reset();
  EXPECT_TRUE(waitFor([this] {
    return contacts_pub_.getNumSubscribers() == 0 && truth_pub_.getNumSubscribers() == 0 &&
           locus_pub_.getNumSubscribers() == 0 && report_pub_.getNumSubscribers() == 0;
  }));
}

TEST_F(Markers, StartAnewAndKeepTheirRate) {
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
  }
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
}  // namespace assembly_cell::ros_bridge

int main(int argc, char** argv) {
  ros::init(argc, argv, "contact_markers_test");
  ::testing::InitGoogleTest(&argc, argv);
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
