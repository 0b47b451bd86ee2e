// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/contact_markers_node.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>
#include <type_traits>
#include <utility>

#include "assembly_cell/description/cell_description.h"
#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/ros/bridge/message_guard.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/twin_force/line_of_action.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kCirclePoints = 64;
constexpr double kLineWidth = 0.0008;    // [m]
constexpr double kPointSize = 0.004;     // [m]
constexpr double kArrowShaft = 0.0012;   // diameter [m]
constexpr double kArrowHead = 0.003;     // diameter [m]
constexpr double kNormalLength = 0.015;  // [m]

}  // namespace

ContactMarkersNode::ContactMarkersNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
    : nh_(nh), rim_view_(nh) {
  Parameters parameters(pnh);
  const LiveValues start = readLive(parameters);
  wrench_topic_ = parameters.text("wrench", std::string());
  parameters.refuseUnknown();
  live_ = std::make_unique<LiveSettings>(pnh, start, parameters.known());
  // a wrench's line needs no model of the parts
  if (wrench_topic_.empty() || nh.hasParam("robot_description")) {
    const CellDescription description =
        loadCellDescription(Parameters(nh).text("robot_description"));
    peg_radius_ = description.peg.radius;
    tip_radius_ = tipRadius(description.peg);
    shoulder_ = chamferHeight(description.peg);
    peg_length_ = description.peg.half_height + description.peg.coupling_height;
    hole_radius_ = description.hole.radius;
    mouth_radius_ = mouthRadius(description.hole);
    chamfer_depth_ = chamferDepth(description.hole);
  }

  pub_ = nh.advertise<visualization_msgs::MarkerArray>("markers", 1);
  timer_ = nh.createWallTimer(ros::WallDuration(1.0 / rate_),
                              [this](const ros::WallTimerEvent&) { update(); });
}

LiveValues ContactMarkersNode::readLive(Parameters& parameters) const {
  LiveValues values;
  const auto number = [&](const char* name, const Range& range, double fallback,
                          const char* description) {
    values.push_back(
        liveNumber(name, parameters.number(name, range, fallback), range, description));
  };
  number("rate", {0.1, 30.0}, rate_, "Of the markers, wall clock [Hz]");
  number("lifetime", {1e-3, 1e6}, lifetime_, "Of a marker that isn't renewed, ROS time [s]");
  number("size", {0.01, 100.0}, size_, "Times the width of lines, points and arrows");
  number("force_scale", {1e-9, 1e3}, force_scale_, "Length of a force's arrow [m/N]");
  number("force_threshold", {1e-9, 1e6}, force_threshold_, "Weaker forces get no arrow [N]");
  number("locus_scale", {1e-3, 1e9}, locus_scale_, "Enlargement of the locus");
  number("locus_height", {-100.0, 100.0}, locus_height_,
         "Of the drawn locus above the peg's edge [m]");
  number("ellipsoid_scale", {1e-3, 1e9}, ellipsoid_scale_, "Enlargement of the ellipsoid, 3 sd");
  number("tip_height", {-100.0, 100.0}, tip_height_,
         "Of the tip's plane along z of the wrench's frame [m]");
  number("one_pitch", {1e-9, 1e3}, one_pitch_, "Couple over force of one contact, at most [m]");
  values.push_back(
      liveSwitch("words", parameters.flag("words", words_), "Names, legend and state are shown"));
  return values;
}

void ContactMarkersNode::takeLive() {
  const LiveValues now = live_->now();
  const double rate = std::exchange(rate_, valueOf(now, "rate"));
  if (rate != rate_) timer_.setPeriod(ros::WallDuration(1.0 / rate_));
  lifetime_ = valueOf(now, "lifetime");
  size_ = valueOf(now, "size");
  force_scale_ = valueOf(now, "force_scale");
  force_threshold_ = valueOf(now, "force_threshold");
  locus_scale_ = valueOf(now, "locus_scale");
  locus_height_ = valueOf(now, "locus_height");
  ellipsoid_scale_ = valueOf(now, "ellipsoid_scale");
  tip_height_ = valueOf(now, "tip_height");
  one_pitch_ = valueOf(now, "one_pitch");
  words_ = valueOf(now, "words") > 0.5;
}

void ContactMarkersNode::update() {
  takeLive();
  const bool wanted = pub_.getNumSubscribers() > 0;
  if (wanted && !active_) {
    subscribe();
    // whatever an earlier life of this node has left
    Marker all;
    all.action = Marker::DELETEALL;
    all.pose.orientation.w = 1.0;
    array_.markers.push_back(all);
    drawn_.clear();
  } else if (!wanted && active_) {
    forget();
  }
  active_ = wanted;
  if (active_) publish();
  rim_view_.update(hole_radius_);
}

void ContactMarkersNode::subscribe() {
  // the newest message of a topic is kept
  const auto keep = [this](const std::string& topic, auto& newest) {
    using Pointer = std::decay_t<decltype(newest)>;
    subs_.push_back(subscribeChecked<std::remove_const_t<typename Pointer::element_type>>(
        nh_, topic, 1, [&newest](const Pointer& message) { newest = message; }));
  };
  keep("truth/contacts", contacts_);
  keep("locus", locus_);
  keep("truth/pose", truth_);
  subs_.push_back(subscribeChecked<AlignmentReport>(nh_, "report", 1,
                                                    [this](const AlignmentReport::ConstPtr& m) {
                                                      report_ = m;
                                                      truth_at_report_ = truth_;
                                                    }));
  keep("exciter", exciter_);
  keep("twin_force/status", twin_force_);
  if (!wrench_topic_.empty()) keep(wrench_topic_, wrench_);
  subs_.push_back(subscribeChecked<AlignPegActionFeedback>(
      nh_, "align/feedback", 1, [this](const AlignPegActionFeedback::ConstPtr& m) {
        hear(m->status, m->feedback.state, m->feedback.message);
      }));
  subs_.push_back(subscribeChecked<AssemblePegActionFeedback>(
      nh_, "assemble/feedback", 1, [this](const AssemblePegActionFeedback::ConstPtr& m) {
        hear(m->status, m->feedback.state, m->feedback.message);
      }));
}

void ContactMarkersNode::forget() {
  subs_.clear();
  contacts_.reset();
  locus_.reset();
  truth_.reset();
  report_.reset();
  truth_at_report_.reset();
  exciter_.reset();
  twin_force_.reset();
  wrench_.reset();
  goal_id_.clear();
  telling_.clear();
}

void ContactMarkersNode::publish() {
  drawn_before_.swap(drawn_);
  drawn_.clear();
  if (hole_radius_ > 0.0) drawRim("hole", truth_ ? kHoleTruthFrame : kHoleFrame, kHoleColor);
  if (contacts_) drawContacts();
  // without the exciter there is no locus any more
  if (locus_ && !(exciter_ && !exciter_->on)) drawLocus();
  if (twin_force_) drawTwinForce();
  if (wrench_) drawWrench();
  if (truth_) drawPeg("peg_true", kHoleTruthFrame, truth_->pose, kTruePegColor);
  if (report_ && report_->estimate_known) {
    drawPeg("peg_estimated", kHoleEstimatedFrame, report_->estimated_pose, kEstimatedPegColor);
    drawRim("hole_estimated", kHoleEstimatedFrame, kEstimatedHoleColor);
  }
  if (words_) drawState();
  if (words_ && hole_radius_ > 0.0) {
    drawNames();
    drawLegend();
  }

  // what was there before and has ended
  for (const auto& [ns, count] : drawn_before_) {
    for (int id = drawn_[ns]; id < count; ++id) {
      Marker gone;
      gone.ns = ns;
      gone.id = id;
      gone.action = Marker::DELETE;
      gone.pose.orientation.w = 1.0;
      array_.markers.push_back(gone);
    }
  }
  pub_.publish(array_);
  array_.markers.clear();
}

void ContactMarkersNode::drawContacts() {
  for (const Contact& contact : contacts_->contacts) {
    if (contact.state == Contact::OPEN) continue;
    const Eigen::Vector3d p(contact.position.x, contact.position.y, contact.position.z);
    const Eigen::Vector3d n(contact.normal.x, contact.normal.y, contact.normal.z);
    const Eigen::Vector3d f(contact.force.x, contact.force.y, contact.force.z);
    Marker& point = add("contact_points", Marker::SPHERE, kHoleTruthFrame, kContactPointColor);
    point.pose.position = contact.position;
    point.scale.x = point.scale.y = point.scale.z = size_ * kPointSize;
    addArrow("contact_normals", kHoleTruthFrame, p, p + kNormalLength * n, kContactNormalColor);
    if (f.norm() > force_threshold_) {
      addArrow("contact_forces", kHoleTruthFrame, p, p + force_scale_ * f, kContactForceColor);
    }
  }
}

void ContactMarkersNode::drawLocus() {
  // Z = P e^{i a} + N e^{-i a}, enlarged, above the peg
  const std::complex<double> P(locus_->p[0], locus_->p[1]);
  const std::complex<double> N(locus_->n[0], locus_->n[1]);
  Marker& ellipse = add("locus", Marker::LINE_STRIP, kPegFrame, kLocusColor);
  ellipse.scale.x = size_ * kLineWidth;
  for (int i = 0; i <= kCirclePoints; ++i) {
    const std::complex<double> turn = std::polar(1.0, 2.0 * M_PI * i / kCirclePoints);
    const std::complex<double> Z = locus_scale_ * (P * turn + N / turn);
    ellipse.points.push_back(toPoint({Z.real(), Z.imag(), locus_height_}));
  }
  // where the contact may be, from the peg's axis; the likelier the more solid
  const std::size_t n =
      std::min(locus_->hypothesis_direction.size(), locus_->hypothesis_weight.size());
  for (std::size_t i = 0; i < n; ++i) {
    const double alpha = locus_->hypothesis_direction[i];
    Color color = kHypothesisColor;
    color.a = static_cast<float>(0.2 + 0.8 * std::clamp(locus_->hypothesis_weight[i], 0.0, 1.0));
    addArrow("hypotheses", kPegFrame, Eigen::Vector3d::Zero(),
             Eigen::Vector3d(tip_radius_ * std::cos(alpha), tip_radius_ * std::sin(alpha), 0.0),
             color);
  }
}

void ContactMarkersNode::drawTwinForce() {
  const TwinForceState& state = *twin_force_;
  if (!state.pose_known || state.contacts.empty()) return;
  const auto pose = [](const geometry_msgs::Pose& p) { return fromPose(p, "twin_force/status"); };
  // the undeflected peg at the first contact, from the one at the last
  const FeltContact& last = state.contacts.back();
  const auto vector6 = [](const auto& values) -> Vector6 { return Vector6::Map(values.data()); };
  const Vector6 d = vector6(last.deflection);
  const Pose X_CP{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, -peg_length_)};
  const Pose D{rotationFromVector({Eigen::Vector3d(d.tail<3>())}), d.head<3>()};
  const Pose X_HP = pose(state.pose.pose);
  const Pose X_HB = X_HP * inverse(inverse(X_CP) * D * X_CP) * inverse(pose(last.move));
  const auto line = [this](const char* ns, const Vector6& wrench, const Color& color) {
    const auto action = lineOfAction(wrench);
    if (!action || action->force < force_threshold_) return;
    // where it passes the hole's plane
    const Eigen::Vector3d& u = action->direction;
    const double way = std::abs(u.z()) > 0.1 ? -action->point.z() / u.z() : 0.0;
    const Eigen::Vector3d at = action->point + way * u;
    const double length = force_scale_ * action->force;
    addArrow(ns, kHoleFrame, at - length * u, at + length * u, color);
  };
  for (const FeltContact& contact : state.contacts) {
    // both as they act on the peg
    line("action_a", -vector6(contact.wrench_a), kActionAColor);
    line("action_b", transformWrench(X_HB * pose(contact.move), vector6(contact.wrench_b)),
         kActionBColor);
  }
  using RowMajor = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  const Eigen::Matrix3d covariance =
      Eigen::Map<const RowMajor>(state.pose.covariance.data()).topLeftCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
  Eigen::Matrix3d R = axes.eigenvectors();
  if (R.determinant() < 0.0) R.col(0) = -R.col(0);
  Marker& ellipsoid = add("uncertainty", Marker::SPHERE, kHoleFrame, kUncertaintyColor);
  ellipsoid.pose = toPose({R, X_HP.p});
  const auto diameter = [&](int i) {
    const double sd = std::sqrt(std::max(0.0, axes.eigenvalues()(i)));
    return std::clamp(6.0 * ellipsoid_scale_ * sd, 1e-4, 0.5);
  };
  ellipsoid.scale.x = diameter(0);
  ellipsoid.scale.y = diameter(1);
  ellipsoid.scale.z = diameter(2);
}

void ContactMarkersNode::drawWrench() {
  const std::string& frame = wrench_->header.frame_id;
  const auto contact = contactLine(fromWrench(wrench_->wrench), Matrix6::Identity(), tip_height_);
  if (!contact || contact->line.force < force_threshold_) return;
  const bool one = std::abs(contact->pitch) < one_pitch_;
  const Eigen::Vector3d& u = contact->line.direction;
  Eigen::Vector3d at(contact->cut.x(), contact->cut.y(), tip_height_);
  // a force along the plane passes it nowhere near
  if (std::abs(u.z()) < 0.1) at = contact->line.point;
  const double length = force_scale_ * contact->line.force;
  addArrow("wrench_line", frame, at - length * u, at + length * u,
           one ? kActionAColor : kSeveralColor);
  Marker& point =
      add("wrench_point", Marker::SPHERE, frame, one ? kContactPointColor : kSeveralColor);
  point.pose.position = toPoint(at);
  point.scale.x = point.scale.y = point.scale.z = size_ * kPointSize;
}

void ContactMarkersNode::drawPeg(const std::string& ns, const std::string& frame,
                                 const geometry_msgs::Pose& pose, const Color& color) {
  addCircle(ns, frame, tip_radius_, color);
  array_.markers.back().pose = pose;
  if (shoulder_ > 0.0) {
    addCircle(ns, frame, peg_radius_, color, shoulder_);
    array_.markers.back().pose = pose;
  }
  Marker& axis = add(ns, Marker::LINE_STRIP, frame, color);
  axis.pose = pose;
  axis.scale.x = size_ * kLineWidth;
  axis.points = {toPoint({0.0, 0.0, 0.0}), toPoint({0.0, 0.0, peg_length_})};
}

ContactMarkersNode::Marker& ContactMarkersNode::add(const std::string& ns, int type,
                                                    const std::string& frame, const Color& color) {
  Marker marker;
  marker.header.frame_id = frame;  // no stamp: with the latest transform
  marker.ns = ns;
  marker.id = drawn_[ns]++;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.color = color;
  marker.lifetime = ros::Duration(lifetime_);
  array_.markers.push_back(marker);
  return array_.markers.back();
}

void ContactMarkersNode::addArrow(const std::string& ns, const std::string& frame,
                                  const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                  const Color& color) {
  Marker& arrow = add(ns, Marker::ARROW, frame, color);
  arrow.scale.x = size_ * kArrowShaft;
  arrow.scale.y = size_ * kArrowHead;
  arrow.points = {toPoint(from), toPoint(to)};
}

// the edge in the plane, and the one where the wall begins under a chamfer
void ContactMarkersNode::drawRim(const std::string& ns, const std::string& frame,
                                 const Color& color) {
  addCircle(ns, frame, mouth_radius_, color);
  if (!(chamfer_depth_ > 0.0)) return;
  addCircle(ns, frame, hole_radius_, color, -chamfer_depth_);
}

void ContactMarkersNode::addCircle(const std::string& ns, const std::string& frame, double radius,
                                   const Color& color, double height) {
  Marker& circle = add(ns, Marker::LINE_STRIP, frame, color);
  circle.scale.x = size_ * kLineWidth;
  for (int i = 0; i <= kCirclePoints; ++i) {
    const double a = 2.0 * M_PI * i / kCirclePoints;
    circle.points.push_back(toPoint({radius * std::cos(a), radius * std::sin(a), height}));
  }
}

}  // namespace assembly_cell::ros_bridge
