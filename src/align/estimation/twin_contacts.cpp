// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/twin_contacts.h"

#include <Eigen/LU>
#include <cmath>
#include <string>

#include "assembly_cell/align/search/search_frame.h"
#include "assembly_cell/twin_force/next_contact.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

// Margins: median error and time at half and twice, of `align config/scenarios/cell.yaml --strategy
// twin_force --runs 30 --seed 1000` (3.8 µm, 7.8 s as it is); all succeed, with 3 contacts each.
constexpr int kAzimuths = 8;  // of the tilts to choose from
// Peg's centre beside the hole's, low edge inside: more than √(R² − r²)
// (docs/reference/strategies.md, "Near starts"). The first advice never takes the rim there: half
// and twice are the same runs. [m]
constexpr double kOverRim = 3e-3;
// The same, low edge outside: the whole edge on the plane. Half 4.2 µm, 7.4 s; twice 4.1 µm, 8.2 s.
constexpr double kOverPlane = 8e-3;
// Sideways, times the limit of friction: half of it can't slip. Half or twice 3.7 to 3.8 µm, but at
// twice it slips.
constexpr double kPullOfFriction = 0.5;
// Sd of a touched point's height: the edge of a peg whose tilt isn't known yet (0.1 rad over its
// radius); then where a move ends, 30 µm, and the effect at 3° of a point of the rim measured 1 mm
// off. [m]
constexpr double kTouchedFirst = 2e-3, kTouched = 6e-5;
// Distance of the line of action from the axis, over the radius, from which on one point of the
// edge carries.
constexpr double kOnEdge = 0.8;

// Φ C Φᵀ, symmetric to the last bit.
Matrix6 transported(const Matrix6& phi, const Matrix6& covariance) {
  const Matrix6 c = phi * covariance * phi.transpose();
  return 0.5 * (c + c.transpose());
}

// Variance of a wrench: the same force on each axis with torques at the sensors' arm.
Matrix6 wrenchVariance(double force_sd, double arm) {
  Vector6 sd;
  sd << Vec3::Constant(force_sd), Vec3::Constant(arm * force_sd);
  return sd.cwiseAbs2().asDiagonal();
}

// Signs of the sensors with one more contact, the last of all. Pressed against a plane each sensor
// has a side of its own; elsewhere only one is checked against the other.
SignVerdict signsWith(const TwinContact& contact, const std::vector<TwinContact>& contacts,
                      const TwinForceSetup& setup, SignVerdict before) {
  const Mat3 nominal = setup.options.prior ? setup.options.prior->pose.R : Mat3::Identity();
  const SignCheck now =
      checkSigns(contact, nominal, setup.on_plane ? Vec3(0, 0, 1) : Vec3(0, 0, 0));
  const SignVerdict all =
      setup.on_plane || contacts.size() < 3 ? SignVerdict::kUndecided : checkSigns(contacts);
  for (const SignVerdict verdict : {now.pair, now.a, now.b, all}) {
    if (verdict == SignVerdict::kReversed) return SignVerdict::kReversed;
  }
  return now.pair == SignVerdict::kRight && before == SignVerdict::kUndecided ? now.pair : before;
}

// The nominal prior with the touched points in the hole's plane, to first order about a pose: they
// determine height and tilt.
PosePrior touchedPrior(const PosePrior& nominal, const std::vector<Vec3>& points, const Pose& about,
                       double sd) {
  Vector6 away;
  away << about.p - nominal.pose.p, vectorFromRotation(about.R * nominal.pose.R.transpose()).value;
  Matrix6 information = nominal.covariance.inverse();
  Vector6 pull = information * away;
  for (const Vec3& point : points) {
    const Vec3 p = about.R * point;
    Vector6 slope;
    slope << 0.0, 0.0, 1.0, p.y(), -p.x(), 0.0;
    information += slope * slope.transpose() / (sd * sd);
    pull += slope * (p.z() + about.p.z()) / (sd * sd);
  }
  PosePrior prior;
  prior.covariance = information.inverse();
  prior.covariance = (0.5 * (prior.covariance + prior.covariance.transpose())).eval();
  const Vector6 step = -prior.covariance * pull;
  prior.pose = {rotationFromVector({Vec3(step.tail<3>())}) * about.R, about.p + step.head<3>()};
  return prior;
}

// Lowest point of the bottom edge that isn't over the hole, axes of hole.
std::optional<Vec3> touchPoint(const Mechanism& mechanism, const Pose& X_HP) {
  std::optional<Vec3> lowest;
  for (int i = 0; i < 360; ++i) {
    const double a = 2 * M_PI * i / 360;
    const Vec3 edge = tipRadius(mechanism.peg) * Vec3(std::cos(a), std::sin(a), 0.0);
    const Vec3 p = X_HP.R * edge + X_HP.p;
    if (p.head<2>().norm() > mouthRadius(mechanism.hole) && (!lowest || p.z() < lowest->z())) {
      lowest = p;
    }
  }
  return lowest;
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

Pose deflectedPeg(const Pose& X_CP, const Vector6& d) {
  const Pose D{rotationFromVector({Vec3(d.tail<3>())}), d.head<3>()};
  return inverse(X_CP) * D * X_CP;
}

Mat3 centerCovariance(const TwinForceSolution& solution) {
  // the point of the peg's frame that is the hole's centre
  Eigen::Matrix<double, 3, 6> J;
  J << Mat3::Identity(), skew(solution.X_HP.p);
  return J * solution.covariance * J.transpose();
}

TwinForceContacts::TwinForceContacts(const TwinForceSetup& setup) : setup_(setup), workspace_(0) {}

void TwinForceContacts::setGainCovariances(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  setup_.gain_covariance_a = a;
  setup_.gain_covariance_b = b;
}

void TwinForceContacts::begin(const TwinForceTask& task) {
  if (task.capacity != task_.capacity || contacts_.capacity() == 0) {
    workspace_ = TwinForceWorkspace(task.capacity);
    contacts_.reserve(task.capacity);
  }
  task_ = task;
  setup_.options.required_position = task.required_position;
  setup_.options.required_rotation = task.required_rotation;
  setup_.options.tare_covariance.reset();
  X_SP_.reset();
  if (task.reference) X_SP_ = *task.reference * setup_.X_CP;
  zero_.reset();
  zero_age_ = 0.0;
  const TwinUncertainty& known = setup_.uncertainty;
  TwinErrors errors;
  errors.a.gain = errors.b.gain = known.gain;
  errors.a.rotation = errors.b.rotation = known.rotation;
  errors.a.offset = errors.b.offset = known.offset;
  errors.a.frame = inverse(setup_.X_AH);
  errors.b.frame = inverse(setup_.X_CP);
  errors.a.gain_covariance = setup_.gain_covariance_a;
  errors.b.gain_covariance = setup_.gain_covariance_b;
  setup_.options.errors = errors;
  contacts_.clear();
  points_.clear();
  signs_ = SignVerdict::kUndecided;
  estimate_ = TwinForceEstimate();
}

WindowAnswer TwinForceContacts::tare(const AveragingWindow& free) {
  Zero zero;
  zero.free = free.means();
  zero.end = free.lastEnd();
  zero.X_SC = carrierPose(free.carrier());
  // a driver may have removed the weight already: then the carrier counts as upright
  const Vec3 force = zero.free.wrenchB().head<3>();
  const bool weighed = force.norm() > 0.5 * setup_.mechanism.peg.mass * setup_.mechanism.gravity;
  zero.up =
      weighed ? Vec3(-(zero.X_SC.R * force).normalized()) : Vec3(zero.X_SC.R * setup_.mechanism.up);
  zero_ = zero;
  return {};
}

Pose TwinForceContacts::carrierPose(const RestPose& carrier) const {
  return inverse(task_.X_BS) * poseFromRest(carrier);
}

Pose TwinForceContacts::moveOf(const Pose& X_SC) const {
  return inverse(*X_SP_) * X_SC * setup_.X_CP;
}

Pose TwinForceContacts::pegPose(const Pose& X_SC, const Vector6& displacement) const {
  return estimate_.pose * moveOf(X_SC) * deflectedPeg(setup_.X_CP, displacement);
}

WindowAnswer TwinForceContacts::add(const AveragingWindow& window) {
  if (contacts_.size() >= task_.capacity) {
    return {std::to_string(contacts_.size()) +
            " contacts are kept, which is the capacity of the task"};
  }
  const ContactWindow& pressed = window.means();
  const Matrix6 &rounding_a = window.last().rounding_a, &rounding_b = window.last().rounding_b;
  const Pose X_SC = carrierPose(window.carrier());
  if (!X_SP_) X_SP_ = X_SC * setup_.X_CP;
  const Matrix6 phi_a = wrenchTransform(inverse(setup_.X_AH)),
                phi_b = wrenchTransform(inverse(setup_.X_CP));
  TwinContact c;
  Vector6 zero_a = Vector6::Zero(), zero_b = Vector6::Zero();
  Matrix6 scatter_a = pressed.covarianceA(), scatter_b = pressed.covarianceB();
  if (zero_) {
    // the weight turns with the carrier and shifts with the deflection
    const auto weight = [this](const Pose& X, const ContactWindow& means) {
      return pegWeight(setup_.mechanism.peg, setup_.mechanism.gravity, X.R.transpose() * zero_->up,
                       means.displacement());
    };
    zero_a = zero_->free.wrenchA();
    zero_b = zero_->free.wrenchB() + weight(X_SC, pressed) - weight(zero_->X_SC, zero_->free);
    scatter_a += zero_->free.covarianceA();
    scatter_b += zero_->free.covarianceB();
    // the walk since the zero is this contact's own, a steady drift is common to all
    const TwinUncertainty& known = setup_.uncertainty;
    const double arm = setup_.options.errors->a.arm;
    const double age = std::max(0.0, window.lastEnd() - zero_->end);
    zero_age_ = std::max(zero_age_, age);
    const Matrix6 walked = wrenchVariance(known.walk * std::sqrt(age), arm);
    const Matrix6 drifted = wrenchVariance(known.drift * zero_age_, arm);
    scatter_a += walked;
    scatter_b += walked;
    setup_.options.tare_covariance = Matrix12::Zero();
    setup_.options.tare_covariance->topLeftCorner<6, 6>() =
        transported(phi_a, rounding_a + drifted);
    setup_.options.tare_covariance->bottomRightCorner<6, 6>() =
        transported(phi_b, rounding_b + drifted);
  }
  c.wrench_a = phi_a * (pressed.wrenchA() - zero_a);
  c.wrench_b = phi_b * (pressed.wrenchB() - zero_b);
  c.covariance_a = transported(phi_a, scatter_a + rounding_a);
  c.covariance_b = transported(phi_b, scatter_b + rounding_b);
  c.move = moveOf(X_SC);
  // of this pose and of the one that the moves refer to
  c.move_covariance =
      nominalPrior(
          {}, std::sqrt(std::pow(setup_.uncertainty.move, 2) + 2 * window.positionVariance()),
          std::sqrt(std::pow(setup_.uncertainty.move_angle, 2) + 2 * window.rotationVariance()))
          .covariance;
  contacts_.push_back(c);

  // point of the line of action on the bottom: in the hole's plane, for any contact
  const Pose X_PQ = deflectedPeg(setup_.X_CP, pressed.displacement());
  const Vector6 w = transformWrench(inverse(X_PQ), c.wrench_b);
  const Pose X_0Q = c.move * X_PQ;
  const double force = w(2) == 0.0 ? 1.0 : w(2);
  Vec3 point(-w(4) / force, w(3) / force, 0.0);
  // one point carries: it is on the edge, whatever the sensor's error
  const double radius = tipRadius(setup_.mechanism.peg);
  if (point.norm() > kOnEdge * radius) point *= radius / point.norm();
  points_.push_back(X_0Q.R * point + X_0Q.p);
  signs_ = signsWith(c, contacts_, setup_, signs_);
  return {"", signs_ == SignVerdict::kReversed, c.wrench_b.head<3>().norm()};
}

TwinForceSolution TwinForceContacts::solve() {
  fit();
  // a matrix that has changed since its calibration: from here on as an uncalibrated one
  const bool contradicted =
      estimate_.status == TwinForceStatus::kRefuseInconsistent || !estimate_.rejected.empty();
  TwinErrors& errors = *setup_.options.errors;
  if (contradicted && errors.a.gain_covariance.size() + errors.b.gain_covariance.size() > 0) {
    errors.a.gain_covariance.resize(0, 0);
    errors.b.gain_covariance.resize(0, 0);
    fit();
  }
  return {estimate_.status, estimate_.reason, estimate_.pose,          estimate_.covariance,
          estimate_.chi2,   estimate_.dof,    estimate_.eigenvalues(0)};
}

void TwinForceContacts::fit() {
  TwinForceOptions options = setup_.options;
  Pose start = options.prior ? options.prior->pose : Pose{};
  const bool on_plane = setup_.on_plane && options.prior && !points_.empty();
  for (int pass = 0; pass < (on_plane ? 3 : 1); ++pass) {
    if (on_plane)
      options.prior =
          touchedPrior(*setup_.options.prior, points_, start, pass == 0 ? kTouchedFirst : kTouched);
    estimate_ = estimatePose(contacts_, options, workspace_);
    if (!hasPose(estimate_.status)) break;
    start = estimate_.pose;
  }
}

ReachableContact TwinForceContacts::advise() {
  const double pull =
      kPullOfFriction * setup_.mechanism.friction.static_coefficient * task_.contact_force;
  std::vector<ContactCandidate> candidates;
  std::vector<ReachableContact> reachable;
  // chamfers may leave the edge far inside the mouth
  const double gap = mouthRadius(setup_.mechanism.hole) - tipRadius(setup_.mechanism.peg);
  const double over_plane = std::max(kOverPlane, gap + kOverRim);
  for (int k = 0; k < kAzimuths; ++k) {
    const double a = 2 * M_PI * k / kAzimuths;
    const Vec2 down(std::cos(a), std::sin(a));
    for (const double beside : {-kOverRim, over_plane}) {
      Pose X_HP{tiltRotation(task_.contact_tilt * Vec2(-down.y(), down.x())), Vec3::Zero()};
      X_HP.p.head<2>() = beside * down;
      const std::optional<Vec3> touch = touchPoint(setup_.mechanism, X_HP);
      if (!touch) continue;  // the edge hangs in the mouth
      X_HP.p.z() -= touch->z();
      const Pose X_PH = inverse(X_HP);
      ContactCandidate c;
      c.move = inverse(estimate_.pose) * X_HP;
      c.point = X_PH.R * Vec3(touch->x(), touch->y(), 0.0) + X_PH.p;
      c.covariance_a = contacts_.back().covariance_a;
      c.covariance_b = contacts_.back().covariance_b;
      c.move_covariance = contacts_.back().move_covariance;
      for (int side = 0; side < (pull > 0.0 ? 5 : 1); ++side) {
        const double s = a + 0.5 * M_PI * side;
        ReachableContact r;
        r.X_HP = X_HP;
        if (side > 0) r.pull = pull * Vec3(std::cos(s), std::sin(s), 0.0);
        r.force = Vec3(0, 0, task_.contact_force) + r.pull;
        c.force = X_PH.R * r.force;
        candidates.push_back(c);
        reachable.push_back(r);
      }
    }
  }
  const ContactAdvice advice = adviseNextContact(estimate_, candidates, setup_.options);
  ReachableContact& best = reachable[static_cast<std::size_t>(advice.candidate)];
  best.smallest_eigenvalue = advice.smallest_eigenvalue;
  best.position_sd = advice.position_sd;
  best.rotation_sd = advice.rotation_sd;
  return best;
}

}  // namespace assembly_cell
