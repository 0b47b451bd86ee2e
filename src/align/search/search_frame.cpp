// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/search_frame.h"

#include <cmath>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/mechanism/compliance.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

}  // namespace

Mat3 tiltRotation(const Vec2& tilt) { return rotationFromVector({Vec3(tilt.x(), tilt.y(), 0.0)}); }

Mat3 rotationToAxis(const Vec3& n) {
  const Vec3 axis(-n.y(), n.x(), 0.0);
  const double sine = axis.norm();
  if (sine < 1e-15) return Mat3::Identity();
  return rotationFromVector({axis * (std::atan2(sine, n.z()) / sine)});
}

Vec2 axisTilt(const Vec3& axis) { return vectorFromRotation(rotationToAxis(axis)).value.head<2>(); }

SearchFrame::SearchFrame(const Mechanism& mechanism)
    : mechanism_(mechanism), length_(mechanism.peg.half_height + mechanism.peg.coupling_height) {}

void SearchFrame::startAt(const RestPose& carrier, double time) {
  X_BS_ = poseFromRest(carrier);
  start_ = carrier;
  time_ = time;
  started_ = true;
}

Pose SearchFrame::pegPose(const RestPose& carrier, const Vector6& d) const {
  const Pose deflected{rotationFromVector({Vec3(d.tail<3>())}), d.head<3>()};
  const Pose bottom{Mat3::Identity(), Vec3(0, 0, -length_)};
  return inverse(X_BS_) * poseFromRest(carrier) * deflected * bottom;
}

RestPose SearchFrame::restFor(const Vec3& p, const Mat3& R) const {
  const Pose X_B = X_BS_ * Pose{R, p + length_ * R.col(2)};
  return restFromPose(X_B);
}

Vector6 SearchFrame::sag(const RestPose& carrier) const {
  const Vec3 up = poseFromRest(carrier).R.transpose() * mechanism_.up;
  return couplingStiffness(mechanism_.coupling).inverse() *
         pegWeight(mechanism_.peg, mechanism_.gravity, up, Vector6::Zero());
}

Vector6 SearchFrame::tipWrench(const RestPose& carrier, const Vector6& wrench,
                               const Vector6& deflection) const {
  const Vec3 up = poseFromRest(carrier).R.transpose() * mechanism_.up;
  const auto weight = [&](const Vector6& d) {
    return pegWeight(mechanism_.peg, mechanism_.gravity, up, d);
  };
  const Vector6 turned = weight(deflection) - weight(Vector6::Zero());
  const Pose X_CQ = Pose{rotationFromVector({Vec3(deflection.tail<3>())}), deflection.head<3>()} *
                    Pose{Mat3::Identity(), Vec3(0, 0, -length_)};
  return transformWrench(inverse(X_CQ), wrench - turned);
}

}  // namespace assembly_cell
