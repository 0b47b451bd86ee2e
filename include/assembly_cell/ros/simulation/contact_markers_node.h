// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/WrenchStamped.h>
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "assembly_cell/AlignPegActionFeedback.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblePegActionFeedback.h"
#include "assembly_cell/ContactArray.h"
#include "assembly_cell/Exciter.h"
#include "assembly_cell/LocusEstimate.h"
#include "assembly_cell/TwinForceState.h"
#include "assembly_cell/geometry/spatial.h"
#include "assembly_cell/ros/bridge/live_settings.h"
#include "assembly_cell/ros/simulation/marker_colors.h"
#include "assembly_cell/ros/simulation/rim_view.h"

namespace assembly_cell::ros_bridge {

/// Node contact_markers: contacts, locus, hypotheses, estimated hole and peg, true peg, lines of
/// action and uncertainty of the twin-force estimate, the hole's rim, of a sensor's live wrench the
/// line of action and its point, and in words state, result, names and legend, for rviz. Subscribes
/// and works only while `markers` has a subscriber. To be spun by one thread.
class ContactMarkersNode {
 public:
  /// Of its callbacks.
  static constexpr unsigned kThreads = 1;

  /// Throws InputError for bad parameters or robot description.
  ContactMarkersNode(ros::NodeHandle& nh, ros::NodeHandle& pnh);

 private:
  using Marker = visualization_msgs::Marker;

  /// The parameters that may change while the node runs, and what they are at the start.
  LiveValues readLive(Parameters& parameters) const;
  /// What is in force from this picture on.
  void takeLive();
  void update();
  void subscribe();
  void forget();
  void publish();
  void drawContacts();
  void drawLocus();
  void drawTwinForce();
  void drawWrench();
  void drawState();
  void drawNames();
  void drawLegend();

  /// What a goal tells while it runs. The first of a goal ends what the last goal has left.
  void hear(const actionlib_msgs::GoalStatus& status, const std::string& strategy_state,
            const std::string& message);
  void drawPeg(const std::string& ns, const std::string& frame, const geometry_msgs::Pose& pose,
               const Color& color);

  /// Adds a marker with all that is common; its id is the next free one of its namespace.
  Marker& add(const std::string& ns, int type, const std::string& frame, const Color& color);
  void addArrow(const std::string& ns, const std::string& frame, const Eigen::Vector3d& from,
                const Eigen::Vector3d& to, const Color& color);
  void drawRim(const std::string& ns, const std::string& frame, const Color& color);
  void addCircle(const std::string& ns, const std::string& frame, double radius, const Color& color,
                 double height = 0.0);
  void addText(const std::string& ns, const std::string& frame, const Eigen::Vector3d& at,
               double height, const std::string& words, const Color& color);

  ros::NodeHandle nh_;
  std::unique_ptr<LiveSettings> live_;
  // of the picture that is being drawn
  double rate_ = 15.0;             // of the pictures, wall clock [Hz]
  double lifetime_ = 5.0;          // [s]
  double size_ = 1.0;              // times the width of lines, points and arrows
  double force_scale_ = 0.002;     // [m/N]
  double force_threshold_ = 0.05;  // [N]
  double locus_scale_ = 1000.0;
  double ellipsoid_scale_ = 100.0;
  double tip_height_ = 0.0;     // of the tip's plane along z of the wrench's frame [m]
  double one_pitch_ = 0.006;    // couple over force of one contact, at most [m]
  double locus_height_ = 0.15;  // above the peg's edge [m]
  bool words_ = true;           // names, legend and state
  std::string wrench_topic_;    // empty: none
  double peg_radius_ = 0.0, peg_length_ = 0.0, hole_radius_ = 0.0;  // [m]
  double tip_radius_ = 0.0, shoulder_ = 0.0;                        // of the peg's chamfer [m]
  double mouth_radius_ = 0.0, chamfer_depth_ = 0.0;                 // [m]; 0: sharp

  ContactArray::ConstPtr contacts_;
  LocusEstimate::ConstPtr locus_;
  geometry_msgs::PoseStamped::ConstPtr truth_;
  AlignmentReport::ConstPtr report_;
  geometry_msgs::PoseStamped::ConstPtr truth_at_report_;  // the peg moves on
  Exciter::ConstPtr exciter_;
  std::string goal_id_, telling_;  // of the goal that runs or ran last, and what it told last
  TwinForceState::ConstPtr twin_force_;
  geometry_msgs::WrenchStamped::ConstPtr wrench_;
  visualization_msgs::MarkerArray array_;
  std::map<std::string, int> drawn_, drawn_before_;  // markers by namespace

  bool active_ = false;
  std::vector<ros::Subscriber> subs_;
  RimView rim_view_;
  ros::Publisher pub_;
  ros::WallTimer timer_;
};

}  // namespace assembly_cell::ros_bridge
