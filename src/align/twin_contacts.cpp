// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/twin_contacts.h"

#include <cmath>

#include "assembly_cell/align/search.h"

namespace assembly_cell {
namespace {

constexpr double kPi = 3.14159265358979323846;
using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr int kAzimuths = 8;            // of the tilts to choose from
constexpr double kOverRim = 3e-3;       // peg's centre beside the hole's, low edge inside [m]
constexpr double kOverPlane = 8e-3;     // peg's centre beside the hole's, low edge outside [m]
constexpr double kPull = 0.5;           // sideways, times what friction holds
constexpr double kTouchedFirst = 2e-3;  // sd of the plane's height from touches, tilt unknown [m]
constexpr double kTouched = 3e-5;       // and known

// Φ C Φᵀ, symmetric to the last bit.
Matrix6 transported(const Matrix6& phi, const Matrix6& covariance) {
  const Matrix6 c = phi * covariance * phi.transpose();
  return 0.5 * (c + c.transpose());
}

}  // namespace

PosePrior nominalPrior(const Pose& X_HP, double position_sd, double rotation_sd) {
  PosePrior prior;
  prior.pose = X_HP;
  prior.covariance.setZero();
  prior.covariance.diagonal() << Vec3::Constant(position_sd * position_sd),
      Vec3::Constant(rotation_sd * rotation_sd);
  return prior;
}

TwinForceContacts::TwinForceContacts(const TwinForceSetup& setup)
    : setup_(setup),
      X_HA_(inverse(setup.X_AH)),
      X_PC_(inverse(setup.X_CP)),
      workspace_(setup.capacity) {}

void TwinForceContacts::clear() {
  referenced_ = tared_ = false;
  contacts_.clear();
  points_.clear();
  setup_.options.tare_covariance.reset();
  estimate_ = TwinForceEstimate();
}

void TwinForceContacts::setReference(const Pose& X_SC) {
  X_SP_ = X_SC * setup_.X_CP;
  referenced_ = true;
}

void TwinForceContacts::tare(const ContactWindow& free, const Pose& X_SC) {
  free_ = free;
  X_SC_free_ = X_SC;
  tared_ = true;
  // a driver may have taken the weight out already: then upright counts
  const Vec3 force = free.wrenchB().head<3>();
  const bool weighed = force.norm() > 0.5 * setup_.mechanism.peg.mass * setup_.mechanism.gravity;
  up_ = weighed ? Vec3(-(X_SC.R * force).normalized()) : Vec3(X_SC.R.col(2));
}

Pose TwinForceContacts::moveOf(const Pose& X_SC) const {
  return inverse(X_SP_) * X_SC * setup_.X_CP;
}

Pose TwinForceContacts::deflected(const Vector6& d) const {
  const Pose D{rotationFromVector({Vec3(d.tail<3>())}), d.head<3>()};
  return X_PC_ * D * setup_.X_CP;
}

Pose TwinForceContacts::pegPose(const Pose& X_SC, const Vector6& displacement) const {
  return estimate_.pose * moveOf(X_SC) * deflected(displacement);
}

const TwinContact& TwinForceContacts::add(const ContactWindow& pressed, const Pose& X_SC,
                                          const Matrix6& rounding_a, const Matrix6& rounding_b) {
  if (!referenced_) setReference(X_SC);
  const Matrix6 phi_a = wrenchTransform(X_HA_), phi_b = wrenchTransform(X_PC_);
  TwinContact c;
  Vector6 zero_a = Vector6::Zero(), zero_b = Vector6::Zero();
  Matrix6 scatter_a = pressed.covarianceA(), scatter_b = pressed.covarianceB();
  if (tared_) {
    // the weight turns with the carrier and shifts with the deflection
    const auto weight = [this](const Pose& X, const ContactWindow& window) {
      return pegWeight(setup_.mechanism.peg, setup_.mechanism.gravity, X.R.transpose() * up_,
                       window.displacement());
    };
    zero_a = free_.wrenchA();
    zero_b = free_.wrenchB() + weight(X_SC, pressed) - weight(X_SC_free_, free_);
    scatter_a += free_.covarianceA();
    scatter_b += free_.covarianceB();
    setup_.options.tare_covariance = Matrix12::Zero();
    setup_.options.tare_covariance->topLeftCorner<6, 6>() = transported(phi_a, rounding_a);
    setup_.options.tare_covariance->bottomRightCorner<6, 6>() = transported(phi_b, rounding_b);
  }
  c.wrench_a = phi_a * (pressed.wrenchA() - zero_a);
  c.wrench_b = phi_b * (pressed.wrenchB() - zero_b);
  c.covariance_a = transported(phi_a, scatter_a + rounding_a);
  c.covariance_b = transported(phi_b, scatter_b + rounding_b);
  c.move = moveOf(X_SC);
  c.move_covariance = nominalPrior({}, setup_.move_sd, setup_.move_angle_sd).covariance;
  contacts_.push_back(c);

  // where on the bottom the line of action passes: in the hole's plane, whatever is touched
  const Pose X_PQ = deflected(pressed.displacement());
  const Vector6 w = transformWrench(inverse(X_PQ), c.wrench_b);
  const Pose X_0Q = c.move * X_PQ;
  const double force = w(2) == 0.0 ? 1.0 : w(2);
  points_.push_back(X_0Q.R * Vec3(-w(4) / force, w(3) / force, 0.0) + X_0Q.p);
  return contacts_.back();
}

const TwinForceEstimate& TwinForceContacts::solve() {
  TwinForceOptions options = setup_.options;
  Pose start = options.prior ? options.prior->pose : Pose{};
  const bool on_plane = setup_.on_plane && options.prior && !points_.empty();
  for (int pass = 0; pass < (on_plane ? 3 : 1); ++pass) {
    if (on_plane) {
      double height = 0.0;
      for (const Vec3& point : points_) height += (start.R * point + start.p).z();
      options.prior->pose.p.z() = start.p.z() - height / static_cast<double>(points_.size());
      options.prior->covariance(2, 2) = std::pow(pass == 0 ? kTouchedFirst : kTouched, 2);
    }
    estimate_ = estimatePose(contacts_, options, workspace_);
    if (!hasPose(estimate_.status)) break;
    start = estimate_.pose;
  }
  return estimate_;
}

Mat3 TwinForceContacts::centerCovariance() const {
  // the point of the peg's frame that is the hole's centre
  Eigen::Matrix<double, 3, 6> J;
  J << Mat3::Identity(), skew(estimate_.pose.p);
  return J * estimate_.covariance * J.transpose();
}

// lowest point of the bottom edge that isn't over the hole
Vec3 TwinForceContacts::touchPoint(const Pose& X_HP) const {
  Vec3 lowest(0, 0, 1e9);
  for (int i = 0; i < 360; ++i) {
    const double a = 2 * kPi * i / 360;
    const Vec3 edge = setup_.mechanism.peg.radius * Vec3(std::cos(a), std::sin(a), 0.0);
    const Vec3 p = X_HP.R * edge + X_HP.p;
    if (p.head<2>().norm() > setup_.mechanism.hole.radius && p.z() < lowest.z()) lowest = p;
  }
  return lowest;
}

ContactAdvice TwinForceContacts::advise(ReachableContact& best) const {
  const double pull = kPull * setup_.mechanism.friction.static_coefficient * setup_.contact_force;
  std::vector<ContactCandidate> candidates;
  std::vector<ReachableContact> reachable;
  for (int k = 0; k < kAzimuths; ++k) {
    const double a = 2 * kPi * k / kAzimuths;
    const Vec2 down(std::cos(a), std::sin(a));
    for (const double beside : {-kOverRim, kOverPlane}) {
      Pose X_HP{tiltRotation(setup_.contact_tilt * Vec2(-down.y(), down.x())), Vec3::Zero()};
      X_HP.p.head<2>() = beside * down;
      const Vec3 touch = touchPoint(X_HP);
      X_HP.p.z() -= touch.z();
      const Pose X_PH = inverse(X_HP);
      ContactCandidate c;
      c.move = inverse(estimate_.pose) * X_HP;
      c.point = X_PH.R * Vec3(touch.x(), touch.y(), 0.0) + X_PH.p;
      c.covariance_a = contacts_.back().covariance_a;
      c.covariance_b = contacts_.back().covariance_b;
      c.move_covariance = contacts_.back().move_covariance;
      for (int side = 0; side < (pull > 0.0 ? 5 : 1); ++side) {
        const double s = a + 0.5 * kPi * side;
        ReachableContact r;
        r.X_HP = X_HP;
        if (side > 0) r.pull = pull * Vec3(std::cos(s), std::sin(s), 0.0);
        r.force = Vec3(0, 0, setup_.contact_force) + r.pull;
        c.force = X_PH.R * r.force;
        candidates.push_back(c);
        reachable.push_back(r);
      }
    }
  }
  const ContactAdvice advice = adviseNextContact(estimate_, candidates, setup_.options);
  if (advice.candidate >= 0) best = reachable[static_cast<std::size_t>(advice.candidate)];
  return advice;
}

}  // namespace assembly_cell
