// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/markers/contact_markers_drawings.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <complex>

#include "assembly_cell/ros/bridge/conversions.h"
#include "assembly_cell/twin_force/line_of_action.h"

namespace assembly_cell::ros_bridge {

namespace {

constexpr int kLocusPoints = 64;
constexpr double kNormalLength = 0.015;  // [m]
// width of the estimated peg's lines: a border round the true ones where the estimate is right
constexpr double kBorder = 3.0;

void drawContacts(MarkerCanvas& canvas, const MarkerSettings& settings, const MarkerInputs& view) {
  for (const Contact& contact : view.contacts->contacts) {
    if (contact.state == Contact::OPEN) continue;
    const Eigen::Vector3d p(contact.position.x, contact.position.y, contact.position.z);
    const Eigen::Vector3d n(contact.normal.x, contact.normal.y, contact.normal.z);
    const Eigen::Vector3d f(contact.force.x, contact.force.y, contact.force.z);
    canvas.addPoint("contact_points", kHoleTruthFrame, p, kContactPointColor);
    canvas.addArrow("contact_normals", kHoleTruthFrame, p, p + kNormalLength * n,
                    kContactNormalColor);
    if (f.norm() > settings.force_threshold) {
      canvas.addArrow("contact_forces", kHoleTruthFrame, p, p + settings.force_scale * f,
                      kContactForceColor);
    }
  }
}

void drawLocus(MarkerCanvas& canvas, const MarkerSettings& settings, const PartShapes& shapes,
               const MarkerInputs& view) {
  // Z = P e^{i a} + N e^{-i a}, enlarged, above the peg
  const std::complex<double> P(view.locus->p[0], view.locus->p[1]);
  const std::complex<double> N(view.locus->n[0], view.locus->n[1]);
  Marker& ellipse = canvas.addLine("locus", kPegFrame, kLocusColor);
  for (int i = 0; i <= kLocusPoints; ++i) {
    const std::complex<double> turn = std::polar(1.0, 2.0 * M_PI * i / kLocusPoints);
    const std::complex<double> Z = settings.locus_scale * (P * turn + N / turn);
    ellipse.points.push_back(toPoint({Z.real(), Z.imag(), settings.locus_height}));
  }
  // where the contact may be, from the peg's axis; the likelier the more solid
  const std::size_t n =
      std::min(view.locus->hypothesis_direction.size(), view.locus->hypothesis_weight.size());
  for (std::size_t i = 0; i < n; ++i) {
    const double alpha = view.locus->hypothesis_direction[i];
    Color color = kHypothesisColor;
    color.a =
        static_cast<float>(0.2 + 0.8 * std::clamp(view.locus->hypothesis_weight[i], 0.0, 1.0));
    canvas.addArrow("hypotheses", kPegFrame, Eigen::Vector3d::Zero(),
                    Eigen::Vector3d(shapes.tip_radius * std::cos(alpha),
                                    shapes.tip_radius * std::sin(alpha), 0.0),
                    color);
  }
}

void drawTwinForce(MarkerCanvas& canvas, const MarkerSettings& settings, const PartShapes& shapes,
                   const MarkerInputs& view) {
  const TwinForceState& state = *view.twin_force;
  if (!state.pose_known || state.contacts.empty()) return;
  const auto pose = [](const geometry_msgs::Pose& p) { return fromPose(p, "twin_force/status"); };
  // the undeflected peg at the first contact, from the one at the last
  const FeltContact& last = state.contacts.back();
  const auto vector6 = [](const auto& values) -> Vector6 { return Vector6::Map(values.data()); };
  const Vector6 d = vector6(last.deflection);
  const Pose X_CP{Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, -shapes.peg_length)};
  const Pose D{rotationFromVector({Eigen::Vector3d(d.tail<3>())}), d.head<3>()};
  const Pose X_HP = pose(state.pose.pose);
  const Pose X_HB = X_HP * inverse(inverse(X_CP) * D * X_CP) * inverse(pose(last.move));
  const auto line = [&](const char* ns, const Vector6& wrench, const Color& color) {
    const auto action = lineOfAction(wrench);
    if (!action || action->force < settings.force_threshold) return;
    // where it passes the hole's plane
    const Eigen::Vector3d& u = action->direction;
    const double way = std::abs(u.z()) > 0.1 ? -action->point.z() / u.z() : 0.0;
    const Eigen::Vector3d at = action->point + way * u;
    const double length = settings.force_scale * action->force;
    canvas.addArrow(ns, kHoleFrame, at - length * u, at + length * u, color);
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
  Marker& ellipsoid = canvas.add("uncertainty", Marker::SPHERE, kHoleFrame, kUncertaintyColor);
  ellipsoid.pose = toPose({R, X_HP.p});
  const auto diameter = [&](int i) {
    const double sd = std::sqrt(std::max(0.0, axes.eigenvalues()(i)));
    return std::clamp(6.0 * settings.ellipsoid_scale * sd, 1e-4, 0.5);
  };
  ellipsoid.scale.x = diameter(0);
  ellipsoid.scale.y = diameter(1);
  ellipsoid.scale.z = diameter(2);
}

void drawWrench(MarkerCanvas& canvas, const MarkerSettings& settings, const MarkerInputs& view) {
  const std::string& frame = view.wrench->header.frame_id;
  const auto contact =
      contactLine(fromWrench(view.wrench->wrench), Matrix6::Identity(), settings.tip_height);
  if (!contact || contact->line.force < settings.force_threshold) return;
  const bool one = std::abs(contact->pitch) < settings.one_pitch;
  const Eigen::Vector3d& u = contact->line.direction;
  Eigen::Vector3d at(contact->cut.x(), contact->cut.y(), settings.tip_height);
  // a force along the plane passes it nowhere near
  if (std::abs(u.z()) < 0.1) at = contact->line.point;
  const double length = settings.force_scale * contact->line.force;
  canvas.addArrow("wrench_line", frame, at - length * u, at + length * u,
                  one ? kActionAColor : kSeveralColor);
  canvas.addPoint("wrench_point", frame, at, one ? kContactPointColor : kSeveralColor);
}

void drawPeg(MarkerCanvas& canvas, const PartShapes& shapes, const geometry_msgs::Pose& pose,
             bool estimated) {
  const char* ns = estimated ? "peg_estimated" : "peg_true";
  const char* frame = estimated ? kHoleEstimatedFrame : kHoleTruthFrame;
  const Color& color = estimated ? kEstimatedPegColor : kTruePegColor;
  const auto put = [&] {
    canvas.last().pose = pose;
    if (estimated) canvas.last().scale.x *= kBorder;
  };
  canvas.addCircle(ns, frame, shapes.tip_radius, color);
  put();
  if (shapes.shoulder > 0.0) {
    canvas.addCircle(ns, frame, shapes.peg_radius, color, shapes.shoulder);
    put();
  }
  Marker& axis = canvas.addLine(ns, frame, color);
  axis.points = {toPoint({0.0, 0.0, 0.0}), toPoint({0.0, 0.0, shapes.peg_length})};
  put();
}

// the edge in the plane, and the one where the wall begins under a chamfer
void drawRim(MarkerCanvas& canvas, const PartShapes& shapes, const std::string& ns,
             const std::string& frame, const Color& color) {
  canvas.addCircle(ns, frame, shapes.mouth_radius, color);
  if (!(shapes.chamfer_depth > 0.0)) return;
  canvas.addCircle(ns, frame, shapes.hole_radius, color, -shapes.chamfer_depth);
}

}  // namespace

void drawParts(MarkerCanvas& canvas, const MarkerSettings& settings, const PartShapes& shapes,
               const MarkerInputs& view) {
  if (shapes.hole_radius > 0.0) {
    drawRim(canvas, shapes, "hole", view.truth ? kHoleTruthFrame : kHoleFrame, kHoleColor);
  }
  if (view.contacts) drawContacts(canvas, settings, view);
  // without the exciter there is no locus any more
  if (view.locus && !(view.exciter && !view.exciter->on)) {
    drawLocus(canvas, settings, shapes, view);
  }
  if (view.twin_force) drawTwinForce(canvas, settings, shapes, view);
  if (view.wrench) drawWrench(canvas, settings, view);
  if (view.truth) {
    drawPeg(canvas, shapes, view.truth->pose, false);
  }
  if (view.report && view.report->estimate_known) {
    drawPeg(canvas, shapes, view.report->estimated_pose, true);
    drawRim(canvas, shapes, "hole_estimated", kHoleEstimatedFrame, kEstimatedHoleColor);
  }
}

}  // namespace assembly_cell::ros_bridge
