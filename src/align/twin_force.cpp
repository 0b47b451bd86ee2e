// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "assembly_cell/align/contact_window.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/align/search.h"
#include "assembly_cell/scene/input_error.h"
#include "assembly_cell/twin_force/contact_checks.h"
#include "assembly_cell/twin_force/next_contact.h"

namespace assembly_cell {
namespace {

constexpr double kPi = 3.14159265358979323846;
using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using Mat26 = Eigen::Matrix<double, 2, 6>;

constexpr double kLift = 2e-3;          // over a touch while moving on [m]
constexpr double kHover = 1e-3;         // over the expected touch [m]
constexpr int kAzimuths = 8;            // of the tilts to choose from
constexpr double kOverRim = 3e-3;       // peg's centre beside the hole's, low edge inside [m]
constexpr double kOverPlane = 8e-3;     // peg's centre beside the hole's, low edge outside [m]
constexpr double kPull = 0.5;           // sideways, times what friction holds
constexpr double kEncoder = 1e-6;       // sd of the known move [m]
constexpr double kEncoderAngle = 1e-5;  // [rad]
constexpr double kNominal = 0.02;       // sd of the nominal place of the hole [m]
constexpr double kNominalAngle = 0.1;   // of its orientation [rad]
constexpr double kTouchedFirst = 2e-3;  // sd of the hole plane's height from touches, tilt unknown
constexpr double kTouched = 3e-5;       // and known [m]
constexpr int kWindows = 10;            // tried until one is settled

// Φ C Φᵀ, symmetric to the last bit.
Matrix6 transported(const Matrix6& phi, const Matrix6& covariance) {
  const Matrix6 c = phi * covariance * phi.transpose();
  return 0.5 * (c + c.transpose());
}

// A contact that could be made: the peg's bottom centre and axes in S, then a pull sideways.
struct Reach {
  Vec3 p;
  Mat3 R;
  Vec3 pull = Vec3::Zero();  // in S [N]
};

// The strategy `twin_force`: the pose of the peg in the hole from the wrenches that sensor_a and
// sensor_b feel of the same contacts (thesis chapter 10). A is `hole`, B is frame `peg` as it would
// be without deflection, the reference is its pose at the start.
class TwinForce : public Search {
 public:
  TwinForce(Plant& plant, const Scenario& mechanism, const AlignParameters& p,
            const Progress& progress)
      : Search(plant, mechanism, p, progress),
        workspace_(static_cast<std::size_t>(p.rounds * p.most_contacts)),
        X_HA_(inverse(p.X_AH)),
        X_CP_{Mat3::Identity(), Vec3(0, 0, -length_)} {
    options_.required_position = p.required_position;
    options_.required_rotation = p.required_rotation;
    options_.prior = PosePrior{};
    options_.prior->covariance.setZero();
    options_.prior->covariance.diagonal() << Vec3::Constant(kNominal * kNominal),
        Vec3::Constant(kNominalAngle * kNominalAngle);
    // how far the carrier goes sideways for a pull at the peg's edge
    const Vector6& k = mechanism.coupling.stiffness.diagonal;
    compliance_ = 1.0 / k(1) + length_ * length_ / k(4);
  }

 private:
  // the coupling's own zero counts: the sag under the peg's weight is part of the peg's pose
  Vector6 deflection() const override { return hand_.last().displacement_b; }

  void find() override {
    begin();
    const ContactWindow free = window("hanging free");
    X_PQ_start_ = deflected(free.displacement());
    up_ = Vec3::UnitZ();
    if (free.wrenchB().head<3>().norm() > 0.5 * mechanism_.peg.mass * mechanism_.gravity) {
      up_ = -free.wrenchB().head<3>().normalized();
    }
    // two sides of the edge, where the peg happens to be
    Reach reach{Vec3(0, 0, -length_ + mechanism_.peg.radius * p_.contact_tilt),
                tiltRotation({0.0, p_.contact_tilt})};
    touch(reach);
    reach.p.z() = bottomAt(hand_.touchZ()).z();
    reach.R = tiltRotation({0.0, -p_.contact_tilt});
    reach.p.z() += kLift;
    touch(reach);
    for (int round = 0; round < p_.rounds; ++round) {
      const int most = p_.most_contacts * (round + 1);
      solve();
      while (contacts_ < p_.fewest_contacts ||
             (estimate_.status != TwinForceStatus::kOk && contacts_ < most)) {
        touch(advised());
        solve();
      }
      const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
      if (position_sd_ > clearance) {
        throw Failure{text("too_uncertain: centre known to %.3f mm with a clearance of %.3f mm; ",
                           position_sd_ * 1e3, clearance * 1e3) +
                      "press harder or use a finer converter"};
      }
      if (enter(hole_.center)) return;
      // one more at least
      if (contacts_ < most) touch(advised());
    }
    throw Failure{text("not_inserted: no entry after %.0f contacts", contacts_)};
  }

  // peg with the coupling deflected, relative to the undeflected one
  Pose deflected(const Vector6& d) const {
    const Pose D{rotationFromVector({Vec3(d.tail<3>())}), d.head<3>()};
    return inverse(X_CP_) * D * X_CP_;
  }

  // bottom centre of the undeflected peg in S with the carrier's target at a height
  Vec3 bottomAt(double z) const {
    RestPose rest = hand_.target();
    rest.z = z;
    return pegPose(rest, Vector6::Zero()).p;
  }

  // mean of both sensors once nothing moves
  ContactWindow window(const char* what) {
    ContactWindow w;
    for (int tried = 0; tried < kWindows; ++tried) {
      w.clear();
      for (int i = 0; i < std::max(2, blocks(p_.contact_window)); ++i) {
        const PlantBlock& b = hand_.step({});
        w.add({b.wrench_a, b.covariance_a, b.samples}, {b.wrench_b, b.covariance_b, b.samples},
              b.displacement_b);
      }
      if (w.settled(p_.settled_force)) return w;
    }
    throw Failure{std::string("not_settled: ") + what +
                  text(", halves of a window differ by more than %.3f N", p_.settled_force)};
  }

  // one contact: hang free there, take the zero, lower, press, pull, average, leave
  void touch(const Reach& reach) {
    RestPose above = hand_.target();
    above.z += kLift;
    if (contacts_ > 0) hand_.moveTo(above);
    const RestPose hover = restFor(reach.p, reach.R);
    RestPose higher = hover;
    higher.z = std::max(hover.z, above.z);
    if (contacts_ > 0) hand_.moveTo(higher);
    hand_.moveTo(hover);
    hand_.tare(2);
    const ContactWindow free = window("hanging free");

    hand_.approach(-1e9);
    hand_.hold(p_.contact_force, p_.press_tolerance);
    if (!reach.pull.isZero()) {
      RestPose pulled = hand_.target();
      const Vec3 shift = X_WS_.R * reach.pull * compliance_;
      pulled.x -= shift.x();
      pulled.y -= shift.y();
      hand_.moveTo(pulled);
      hand_.hold(p_.contact_force, p_.press_tolerance);
    }
    hand_.wait(blocks(p_.settle));
    const ContactWindow pressed = window("pressed");
    ++contacts_;
    keep(free, pressed);
    // clear of it again
    RestPose clear = hand_.target();
    clear.z = std::max(clear.z, hand_.touchZ());
    hand_.moveTo(clear);
  }

  // both wrenches without zero and weight, in frames A and b
  void keep(const ContactWindow& free, const ContactWindow& pressed) {
    const PlantBlock& now = hand_.last();
    const Pose X_SC = carrierPose();
    const Vec3 up = X_SC.R.transpose() * up_;
    const auto weight = [&](const ContactWindow& w) {
      return pegWeight(mechanism_.peg, mechanism_.gravity, up, w.displacement());
    };
    const Pose X_PC = inverse(X_CP_);
    const Matrix6 phi_a = wrenchTransform(X_HA_), phi_b = wrenchTransform(X_PC);
    TwinContact c;
    c.wrench_a = phi_a * (pressed.wrenchA() - free.wrenchA());
    c.wrench_b = phi_b * (pressed.wrenchB() - free.wrenchB() - weight(pressed) + weight(free));
    c.covariance_a =
        transported(phi_a, pressed.covarianceA() + free.covarianceA() + now.rounding_a);
    c.covariance_b =
        transported(phi_b, pressed.covarianceB() + free.covarianceB() + now.rounding_b);
    // hanging free the load is the same each time, and so is its rounding
    options_.tare_covariance = Matrix12::Zero();
    options_.tare_covariance->topLeftCorner<6, 6>() = transported(phi_a, now.rounding_a);
    options_.tare_covariance->bottomRightCorner<6, 6>() = transported(phi_b, now.rounding_b);
    c.move = X_PC * X_SC * X_CP_;
    Matrix6 move_covariance = Matrix6::Zero();
    move_covariance.diagonal() << Vec3::Constant(kEncoder * kEncoder),
        Vec3::Constant(kEncoderAngle * kEncoderAngle);
    c.move_covariance = move_covariance;
    contacts_kept_.push_back(c);

    // where on the bottom the line of action passes: in the hole's plane, whatever is touched
    const Pose X_PQ = deflected(pressed.displacement());
    const Vector6 w = transformWrench(inverse(X_PQ), c.wrench_b);
    const Vec3 q(-w(4) / w(2), w(3) / w(2), 0.0);
    const Pose X_0Q = c.move * X_PQ;
    points_.push_back(X_0Q.R * q + X_0Q.p);

    const SignCheck signs = checkSigns(c, Mat3::Identity(), Vec3::UnitZ());
    if (signs.pair == SignVerdict::kReversed || signs.a == SignVerdict::kReversed ||
        signs.b == SignVerdict::kReversed) {
      throw Failure{
          "sensor_signs: one sensor reports the opposite sign; check its calibration and mounting"};
    }
    report("contact", text("pressed with %.2f N, edge felt at %.1f mm", c.wrench_b.head<3>().norm(),
                           q.norm() * 1e3));
  }

  // pose of the peg from all contacts; the height of the hole's plane from where they are
  void solve() {
    double height_sd = kTouchedFirst;
    Pose start;
    for (int pass = 0; pass < 3; ++pass) {
      double height = 0.0;
      for (const Vec3& point : points_) height += (start.R * point + start.p).z();
      options_.prior->pose = Pose{};
      options_.prior->pose.p.z() = start.p.z() - height / static_cast<double>(points_.size());
      options_.prior->covariance(2, 2) = height_sd * height_sd;
      estimate_ = estimatePose(contacts_kept_, options_, workspace_);
      if (!hasPose(estimate_.status)) {
        throw Failure{std::string("no_pose: ") + toString(estimate_.status) + ": " +
                      estimate_.reason};
      }
      start = estimate_.pose;
      height_sd = kTouched;
    }
    const Pose X_SH = X_CP_ * inverse(estimate_.pose);
    hole_.normal = X_SH.R.col(2);
    hole_.center = X_SH.p;
    hole_.height = hole_.normal.dot(hole_.center);
    // of the hole's centre, not of the peg's at the reference
    Mat26 J = Mat26::Zero();
    J.leftCols<2>().setIdentity();
    J.rightCols<3>() = skew(estimate_.pose.p).topRows<2>();
    hole_.center_covariance = J * estimate_.covariance * J.transpose();
    hole_.normal_sd = std::sqrt(estimate_.covariance(3, 3) + estimate_.covariance(4, 4));
    Eigen::Matrix<double, 1, 6> Jz = Eigen::Matrix<double, 1, 6>::Zero();
    Jz(2) = 1.0;
    Jz.rightCols<3>() = skew(estimate_.pose.p).row(2);
    hole_.height_sd = std::sqrt((Jz * estimate_.covariance * Jz.transpose()).value());
    found_ = true;
    position_sd_ = std::sqrt(hole_.center_covariance.trace());
    rotation_sd_ = hole_.normal_sd;
    const Vec2 offset = -(estimate_.pose * X_PQ_start_).p.head<2>();
    report("solve",
           std::string(toString(estimate_.status)) +
               text(", centre %.3f %.3f mm", offset.x() * 1e3, offset.y() * 1e3) +
               text(" +- %.4f mm, tilt sd %.4f deg", position_sd_ * 1e3, rotation_sd_ * 180 / kPi) +
               text(", chi2 %.1f of %.0f", estimate_.chi2, estimate_.dof) +
               text(", smallest eigenvalue %.3g", estimate_.eigenvalues(0)));
  }

  // lowest point of the bottom edge that isn't over the hole, for a peg in H
  Vec3 touchPoint(const Pose& X_HP) const {
    Vec3 lowest(0, 0, 1e9);
    for (int i = 0; i < 360; ++i) {
      const double a = 2 * kPi * i / 360;
      const Vec3 p =
          X_HP.R * (mechanism_.peg.radius * Vec3(std::cos(a), std::sin(a), 0.0)) + X_HP.p;
      if (p.head<2>().norm() > mechanism_.hole.radius && p.z() < lowest.z()) lowest = p;
    }
    return lowest;
  }

  // of the contacts within reach the one that the information matrix asks for
  Reach advised() {
    const Pose& X_H0 = estimate_.pose;
    const Pose X_SH = X_CP_ * inverse(X_H0);
    const double pull = kPull * mechanism_.friction.static_coefficient * p_.contact_force;
    std::vector<ContactCandidate> candidates;
    std::vector<Reach> reaches;
    for (int k = 0; k < kAzimuths; ++k) {
      const double a = 2 * kPi * k / kAzimuths;
      const Vec2 down(std::cos(a), std::sin(a));
      for (const double beside : {-kOverRim, kOverPlane}) {
        Pose X_HP{tiltRotation(p_.contact_tilt * Vec2(-down.y(), down.x())), Vec3::Zero()};
        X_HP.p.head<2>() = beside * down;
        const Vec3 touch = touchPoint(X_HP);
        X_HP.p.z() -= touch.z();
        for (int side = 0; side < (pull > 0.0 ? 5 : 1); ++side) {
          const double s = a + 0.5 * kPi * side;
          const Vec3 drag =
              side == 0 ? Vec3(Vec3::Zero()) : Vec3(pull * std::cos(s), pull * std::sin(s), 0.0);
          ContactCandidate c;
          c.move = inverse(X_H0) * X_HP;
          const Pose X_PH = inverse(X_HP);
          c.point = X_PH.R * Vec3(touch.x(), touch.y(), 0.0) + X_PH.p;
          c.force = X_PH.R * (Vec3(0, 0, p_.contact_force) + drag);
          c.covariance_a = contacts_kept_.back().covariance_a;
          c.covariance_b = contacts_kept_.back().covariance_b;
          c.move_covariance = contacts_kept_.back().move_covariance;
          candidates.push_back(c);
          Pose X_HR = X_HP;
          X_HR.p.z() += kHover;
          const Pose X_SR = X_SH * X_HR;
          reaches.push_back({X_SR.p, X_SR.R, X_SH.R * drag});
        }
      }
    }
    const ContactAdvice advice = adviseNextContact(estimate_, candidates, options_);
    if (advice.candidate < 0) throw Failure{"no_advice: no contact within reach tells more"};
    const auto best = static_cast<std::size_t>(advice.candidate);
    report("advice",
           text("contact %.0f of %.0f", advice.candidate, static_cast<double>(reaches.size())) +
               text(" within reach, expected: smallest eigenvalue %.3g, sd %.4f mm",
                    advice.smallest_eigenvalue, advice.position_sd * 1e3));
    return reaches[best];
  }

  void summarise(AlignResult& result) const override {
    const Pose X_HQ = estimate_.pose * X_PQ_start_;
    result.known = true;
    result.offset = -X_HQ.p.head<2>();
    result.offset_covariance = hole_.center_covariance;
    result.tilt = tiltOf(X_HQ);
    result.tilt_sd = hole_.normal_sd;
  }

  TwinForceOptions options_;
  TwinForceWorkspace workspace_;
  Pose X_HA_, X_CP_;
  Pose X_PQ_start_;          // hanging peg at the start, relative to the undeflected one
  Vec3 up_;                  // against gravity, in S
  double compliance_ = 0.0;  // sideways, at the peg's edge [m/N]
  std::vector<TwinContact> contacts_kept_;
  std::vector<Vec3> points_;  // of the lines of action on the peg's bottom, reference peg axes
  TwinForceEstimate estimate_;
};

}  // namespace

AlignResult twinForce(Plant& plant, const Scenario& mechanism, const AlignParameters& parameters,
                      const std::function<void(const AlignProgress&)>& progress) {
  return TwinForce(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
