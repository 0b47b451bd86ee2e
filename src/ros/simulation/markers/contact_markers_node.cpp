// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/markers/contact_markers_node.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "assembly_cell/AlignPegActionFeedback.h"
#include "assembly_cell/AssemblePegActionFeedback.h"
#include "assembly_cell/base/fields.h"
#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/ros/simulation/markers/contact_markers_drawings.h"

namespace assembly_cell::ros_bridge {

namespace {

// Widths are those of a peg of 25 mm; of a small one thinner, but still seen from rviz's first
// view.
double widthFor(double peg_radius) {
  return peg_radius > 0.0 ? std::clamp(peg_radius / 0.025, 0.4, 2.0) : 1.0;
}

}  // namespace

ContactMarkersNode::ContactMarkersNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh), rim_view_(nh) {
  Parameters parameters(pnh);
  parameters.read(fieldsOf(settings_));
  parameters.refuseUnknown();
  live_ = std::make_unique<LiveSettings>(
      pnh, liveValues(fieldsOf(settings_), "from the next picture on"), parameters.known());
  // a wrench's line needs no model of the parts
  if (settings_.wrench.empty() || nh.hasParam("robot_description")) {
    shapes_ = partShapes(loadCellDescription(Parameters(nh).text("robot_description")));
  }

  pub_ = nh.advertise<visualization_msgs::MarkerArray>("markers", 1);
  timer_ = nh.createWallTimer(ros::WallDuration(1.0 / settings_.rate),
                              [this](const ros::WallTimerEvent&) { update(); });
}

void ContactMarkersNode::update() {
  const double rate = settings_.rate;
  put(live_->now(), fieldsOf(settings_));
  if (rate != settings_.rate) timer_.setPeriod(ros::WallDuration(1.0 / settings_.rate));
  const bool wanted = pub_.getNumSubscribers() > 0;
  if (wanted && !active_) {
    subscribe();
    canvas_.clear();
  } else if (!wanted && active_) {
    subs_.clear();
    view_ = MarkerInputs();
  }
  active_ = wanted;
  if (active_) publish();
  rim_view_.update(view_.truth ? kHoleTruthFrame : kHoleFrame, shapes_.hole_radius);
}

void ContactMarkersNode::subscribe() {
  // the newest message of a topic is kept
  const auto keep = [this](const std::string& topic, auto& newest) {
    using Pointer = std::decay_t<decltype(newest)>;
    subs_.push_back(subscribeChecked<std::remove_const_t<typename Pointer::element_type>>(
        nh_, topic, 1, [&newest](const Pointer& message) { newest = message; }));
  };
  keep("truth/contacts", view_.contacts);
  keep("locus", view_.locus);
  keep("truth/pose", view_.truth);
  subs_.push_back(subscribeChecked<AlignmentReport>(nh_, "report", 1,
                                                    [this](const AlignmentReport::ConstPtr& m) {
                                                      view_.report = m;
                                                      view_.truth_at_report = view_.truth;
                                                    }));
  keep("exciter", view_.exciter);
  keep("twin_force/status", view_.twin_force);
  if (!settings_.wrench.empty()) keep(settings_.wrench, view_.wrench);
  subs_.push_back(subscribeChecked<AlignPegActionFeedback>(
      nh_, "align/feedback", 1, [this](const AlignPegActionFeedback::ConstPtr& m) {
        onFeedback(*m);
        view_.inserts = false;
      }));
  subs_.push_back(subscribeChecked<AssemblePegActionFeedback>(
      nh_, "assemble/feedback", 1, [this](const AssemblePegActionFeedback::ConstPtr& m) {
        onFeedback(*m);
        view_.inserts = true;
      }));
}

template <class Feedback>
void ContactMarkersNode::onFeedback(const Feedback& feedback) {
  if (view_.goal_id != feedback.status.goal_id.id) {
    view_.goal_id = feedback.status.goal_id.id;
    view_.report.reset();
    view_.locus.reset();
  }
  const std::string &state = feedback.feedback.state, &message = feedback.feedback.message;
  view_.feedback = message.empty() ? state : state + ": " + message;
}

void ContactMarkersNode::publish() {
  canvas_.begin(settings_.size * widthFor(shapes_.peg_radius), settings_.lifetime);
  drawParts(canvas_, settings_, shapes_, view_);
  if (settings_.words) drawWords(canvas_, settings_, shapes_, view_);
  pub_.publish(canvas_.finish());
}

}  // namespace assembly_cell::ros_bridge
