// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "assembly_cell/align/estimation/twin_contacts.h"
#include "assembly_cell/align/estimation/twin_sensing.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/align/strategies/edge_search.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

// Margins: 30 runs of `align` as in twin_contacts.cpp (30 of 30, 7.8 s in the median), and near
// starts with --offset-max 0.003 --seed 3000.
constexpr double kLift = 2e-3;   // over a touch while moving on: half 7.6 s, twice 8.3 s [m]
constexpr double kHover = 1e-3;  // over the expected touch: half 7.7 s, twice 7.9 s [m]
// Or so many sd of the plane's height there: across two contacts on one line its tilt is unknown
// to 1°, which knocked with 40 N in 2 of 20 runs of level 2.
constexpr double kSure = 2.5;
constexpr int kWindows = 10;  // tried until one is settled: 2 s of a decaying swing
constexpr int kAttempts = 4;  // sides of the hole that can be tried
constexpr int kHigher = 5;    // lifts until the peg hangs free: 10 mm, an edge jams 5 mm deep
// Above where an attempt failed: more than a jammed edge is deep. Of near starts 95 % end within
// 13.1 s, with half of it 12.4 s, with twice 15.0 s. [m]
constexpr double kRetreat = 8e-3;
// A contact that is expected to take less than a tenth off the sd of the worst direction isn't
// made, nor is one after one that did.
constexpr double kGain = 1.23;
// Round the hole, beside its estimate: the whole edge on the plane, as in twin_contacts.cpp. [m]
constexpr double kBeside = 8e-3;
constexpr int kRound = 3;  // touches there, between the contacts' sides
// Of where a move ends, per axis, at least: arms are sold with 20 to 50 µm, stages with less, and
// six touches may leave nothing by chance. With 5 µm for the walls alone the error squared over
// stated was 5.3 in 10 runs of level 1, with this 1.3 in 100. [m]
constexpr double kPlaceSd = 8e-6;
// Of the centre: more is no place to feel round. The edge reaches a hole 6 mm beside. [m]
constexpr double kLost = 4e-3;
// That the peg may have begun with: 3°. The same with half 12.9 s, with twice 13.3 s. [rad]
constexpr double kUnknownTilt = 0.05;

// A contact to make: the undeflected peg over it in S, then a pull sideways.
struct Reach {
  Vec3 p;
  Mat3 R;
  Vec3 pull = Vec3::Zero();  // in S [N]
};

// The strategy `twin_force`: the pose of the peg in the hole from the wrenches that sensor_a and
// sensor_b feel of the same contacts (thesis chapter 10). A is `hole`, B is frame `peg` as it would
// be without deflection, the reference is its pose at the start.
class TwinForce : public EdgeSearch {
 public:
  TwinForce(Plant& plant, const Mechanism& mechanism, const AlignParameters& p,
            const Progress& progress)
      : EdgeSearch(plant, mechanism, p, progress),
        X_CP_{Mat3::Identity(), Vec3(0, 0, -length_)},
        sensing_(plant.twinForce()) {
    // how far the carrier goes sideways for a pull at the peg's edge
    const Vector6& k = mechanism.coupling.stiffness.diagonal;
    compliance_ = 1.0 / k(1) + length_ * length_ / k(4);
  }

 private:
  bool feelsWalls() const override { return !p_.insert.wanted(); }

  // the coupling's own zero counts: the sag under the peg's weight is part of the peg's pose
  Vector6 deflection() const override { return press_.last().displacement_b; }
  Vector6 hangingFree() const override { return sag(press_.target()); }

  double placeVarianceOf(const TouchFit& fit) const override {
    return std::max(fit.place_variance, kPlaceSd * kPlaceSd);
  }

  void find() override {
    if (sensing_ == nullptr)
      throw PlantError(AlignFailure::kNoData, "the plant has no twin-force sensing");
    if (begin()) {
      found_ = false;  // of the pose in the hole nothing was felt
      return;
    }
    const AveragingWindow free = window(false);
    X_PQ_start_ = deflectedPeg(X_CP_, free.means().displacement());
    X_SC_start_ = carrierPose();
    Vec3 place(0, 0, -length_ + tipRadius(mechanism_.peg) * p_.contact_tilt);
    for (int k = 1;; ++k) {
      try {
        attempt(place);
        return;
      } catch (const AlignError& error) {
        if (k >= kAttempts || !recoverable(error.failure)) throw;
        // out, and beside a hole that is too near to press tilted
        report("recover", error.what());
        backOut(kRetreat * scale_.room);
      }
      found_ = false;
      hole_ = HoleEstimate();
      // across the tilts to come, so that not both edges carry; then to the other sides
      const double travel = trapWidth(p_.contact_tilt + kUnknownTilt);
      const double a = 0.5 * M_PI + 2 * M_PI * (k - 1) / (kAttempts - 1);
      place = travel * Vec3(std::cos(a), std::sin(a), 0.0);
      place.z() = pegPose(press_.target(), Vector6::Zero()).p.z();
      report("aside", text("by %.1f mm", travel * 1e3));
    }
  }

  bool recoverable(AlignFailure failure) const {
    switch (failure) {
      case AlignFailure::kWedged:
      case AlignFailure::kGaveWay:
      case AlignFailure::kBothEdges:
      case AlignFailure::kNotFree:
      case AlignFailure::kNoPose:
      case AlignFailure::kPressNotHeld:
      case AlignFailure::kForceLimit:
      case AlignFailure::kSensorSaturated:
      case AlignFailure::kNotInserted:
      case AlignFailure::kNotStill:
      case AlignFailure::kNoPlaneReading:
        return true;
      case AlignFailure::kNotSettled:
        return pressed_;
      default:
        return false;
    }
  }

  // pose and entry from a place; Failure when it can't be done there
  void attempt(const Vec3& place) {
    sensing_->begin({X_BS_, X_SC_start_, p_.contact_force, p_.contact_tilt, p_.settled_force,
                     p_.required_position, p_.required_rotation,
                     static_cast<std::size_t>(p_.most_contacts)});
    kept_ = 0;
    known_ = false;
    readings_.clear();
    // two sides of the edge, where the peg happens to be
    Reach reach{place, tiltRotation({0.0, p_.contact_tilt})};
    contact(reach);
    reach.p.z() = bottomAt(press_.touchZ()).z();
    reach.R = tiltRotation({0.0, -p_.contact_tilt});
    reach.p.z() += kLift;
    contact(reach);
    solve();
    double before = 0.0;
    while (kept_ < p_.most_contacts) {
      const bool enough = kept_ >= p_.fewest_contacts;
      const double known = solution_.smallest_eigenvalue;
      // more of the same brings nothing where errors of the sensors, common to all, are left
      if (enough && (solution_.status == TwinForceStatus::kOk || known < kGain * before)) break;
      const ReachableContact next = advised();
      if (enough && next.smallest_eigenvalue < kGain * known) break;
      contact(reachOf(next));
      before = known;
      solve();
    }
    if (position_sd_ > kLost * scale_.length) {
      throw AlignError(AlignFailure::kTooUncertain,
                       text("centre known to %.1f mm, %.1f mm can be felt round; ",
                            position_sd_ * 1e3, kLost * scale_.length * 1e3) +
                           "press harder or use a finer converter");
    }
    // without touches: moves end by as much of what was thought possible as the sensors are off
    const double part = std::min(1.0, solution_.chi2 / std::max(1, solution_.dof));
    const double sd = std::max(kPlaceSd, TwinUncertainty().move * std::sqrt(part));
    place_variance_ = sd * sd;
    if (enter(hole_.center, 1)) return;
    // what errors of the sensors hide, touches on the face and the walls tell
    feelRound();
    feelIn();
  }

  // the face round where the hole is expected
  void feelRound() {
    model_.start = hole_.center.head<2>();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> spread(hole_.center_covariance);
    model_.position_sd = std::sqrt(spread.eigenvalues()(1));
    const Eigen::Matrix<double, 3, 2> axes = rotationToAxis(hole_.normal).leftCols<2>();
    const Vec3 centre = hole_.center, normal = hole_.normal;
    for (int i = 0; i < kRound; ++i) {
      const double a = 2 * M_PI * (i + 0.5) / kRound;
      bottom_ = centre + kBeside * scale_.length * (axes * Vec2(std::cos(a), std::sin(a)));
      touch(tilted(normal, a, p_.contact_tilt));
    }
    resolve();
    known_ = true;
  }

  // bottom centre of the undeflected peg in S with the carrier's target at a height
  Vec3 bottomAt(double z) const {
    RestPose rest = press_.target();
    rest.z = z;
    return pegPose(rest, Vector6::Zero()).p;
  }

  // mean of both sensors once nothing moves
  AveragingWindow window(bool pressed) {
    using State = AveragingWindow::State;
    pressed_ = pressed;
    AveragingLimits limits{std::max(2, blocks(p_.contact_window)), p_.settled_force};
    limits.tries = kWindows;
    AveragingWindow w(limits);
    State state = State::kFilling;
    while (state == State::kFilling) state = w.add(press_.step({}));
    if (state != State::kSettled) {
      notSettled(text("halves of a window differ by more than %.3f N", p_.settled_force));
    }
    return w;
  }

  // one contact: hang free there, take the zero, lower, press, pull, average, leave
  void contact(const Reach& reach) {
    RestPose above = press_.target();
    above.z += kLift;
    if (contacts_ > 0) press_.moveTo(above);
    const RestPose hover = restFor(reach.p, reach.R);
    RestPose over = hover;
    over.z = std::max(hover.z, above.z);
    if (contacts_ > 0) press_.moveTo(over);
    press_.moveTo(hover);
    press_.tare(2);
    for (int higher = 0; press_.tareShift() > press_.freeShift(); ++higher) {
      // the edge already rests on something
      if (higher == kHigher)
        throw AlignError(AlignFailure::kNotFree, "the peg doesn't come free over the contact");
      RestPose up = press_.target();
      up.z += kLift;
      press_.moveTo(up);
      press_.tare(2);
    }
    const WindowAnswer zero = sensing_->tare(window(false));
    if (!zero.refusal.empty()) notSettled(zero.refusal);

    // light first: a wedge is never pressed, nor are both edges while the hole may be anywhere
    const Touch light = *lightTouch(-1e9);
    refuseWedge(light, reach.R);
    if (light.straddles() && !found_) {
      throw AlignError(AlignFailure::kBothEdges, text("the line of action is %.1f mm from the axis",
                                                      light.reach * mechanism_.peg.radius * 1e3));
    }
    remember(light);
    press_.hold(p_.contact_force, p_.press_tolerance);
    if (!reach.pull.isZero()) {
      RestPose pulled = press_.target();
      const Vec3 shift = X_BS_.R * reach.pull * compliance_;
      pulled.x -= shift.x();
      pulled.y -= shift.y();
      press_.moveTo(pulled);
      press_.hold(p_.contact_force, p_.press_tolerance);
    }
    press_.wait(blocks(p_.settle));
    const AveragingWindow pressed = window(true);
    ++contacts_;
    keep(pressed);
    // clear of it again
    RestPose clear = press_.target();
    clear.z = std::max(clear.z, press_.touchZ());
    press_.moveTo(clear);
  }

  [[noreturn]] void notSettled(const std::string& reason) const {
    throw AlignError(AlignFailure::kNotSettled,
                     (pressed_ ? "pressed, " : "hanging free, ") + reason);
  }

  void keep(const AveragingWindow& pressed) {
    const WindowAnswer contact = sensing_->add(pressed);
    if (!contact.refusal.empty()) notSettled(contact.refusal);
    ++kept_;
    if (contact.signs_reversed) {
      throw AlignError(AlignFailure::kSensorSigns,
                       "one sensor reports the opposite sign; check its calibration and mounting");
    }
    report("contact", text("pressed with %.2f N, deflection %.3f mm", contact.force,
                           pressed.means().displacement().head<3>().norm() * 1e3));
  }

  // where the hole is, from all contacts
  void solve() {
    solution_ = sensing_->solve();
    const TwinForceSolution& e = solution_;
    if (!hasPose(e.status)) {
      throw AlignError(AlignFailure::kNoPose, std::string(toString(e.status)) + ": " + e.reason);
    }
    const Pose X_SH = X_CP_ * inverse(e.X_HP);
    hole_.normal = X_SH.R.col(2);
    hole_.center = X_SH.p;
    hole_.height = hole_.normal.dot(hole_.center);
    const Mat3 covariance = centerCovariance(e);
    hole_.center_covariance = covariance.topLeftCorner<2, 2>();
    hole_.height_sd = std::sqrt(covariance(2, 2));
    hole_.normal_sd = std::sqrt(e.covariance(3, 3) + e.covariance(4, 4));
    found_ = true;
    position_sd_ = std::sqrt(hole_.center_covariance.trace());
    rotation_sd_ = hole_.normal_sd;
    const Vec2 offset = -(e.X_HP * X_PQ_start_).p.head<2>();
    report("solve", std::string(toString(solution_.status)) +
                        text(", centre %.3f %.3f mm", offset.x() * 1e3, offset.y() * 1e3) +
                        text(" +- %.4f mm, tilt sd %.4f deg", position_sd_ * 1e3,
                             rotation_sd_ * 180 / M_PI) +
                        text(", chi2 %.1f of %.0f", e.chi2, e.dof) +
                        text(", smallest eigenvalue %.3g", e.smallest_eigenvalue));
  }

  // the contact that the information matrix asks for
  ReachableContact advised() {
    const ReachableContact best = sensing_->advise();
    report("advice", text("beside the hole by %.1f mm", best.X_HP.p.head<2>().norm() * 1e3) +
                         text(", expected: smallest eigenvalue %.3g, sd %.4f mm",
                              best.smallest_eigenvalue, best.position_sd * 1e3));
    return best;
  }

  Reach reachOf(ReachableContact contact) const {
    contact.X_HP.p.z() += std::max(kHover, kSure * heightSd(contact.X_HP));
    const Pose X_SH = X_CP_ * inverse(solution_.X_HP);
    const Pose X_SP = X_SH * contact.X_HP;
    return {X_SP.p, X_SP.R, X_SH.R * contact.pull};
  }

  // of the plane under the low side of a peg put down there [m]
  double heightSd(const Pose& X_HP) const {
    const Vec2 low = -X_HP.R.row(2).head<2>().transpose().normalized();
    const Vec3 from = X_HP.p + tipRadius(mechanism_.peg) * (X_HP.R.leftCols<2>() * low);
    const Vec3 arm = from - solution_.X_HP.p;
    Vector6 slope;
    slope << 0.0, 0.0, 1.0, arm.y(), -arm.x(), 0.0;
    return std::sqrt(slope.dot(solution_.covariance * slope));
  }

  void summarise(AlignResult& result) const override {
    const Pose X_SQ = X_CP_ * X_PQ_start_;
    const Mat3 upright = rotationToAxis(hole_.normal);
    result.known = true;
    // the centre is the contacts', or the walls' where they were felt since; a turn about the axis
    // by what a sensor's frame is off would shift it
    result.offset = (upright.transpose() * (hole_.center - X_SQ.p)).head<2>();
    result.offset_covariance = hole_.center_covariance;
    result.wrench_offset = -(solution_.X_HP * X_PQ_start_).p.head<2>();
    result.wrench_covariance = centerCovariance(solution_).topLeftCorner<2, 2>();
    result.tilt = tiltOf(known_ ? Pose{upright.transpose() * X_SQ.R, Vec3::Zero()}
                                : solution_.X_HP * X_PQ_start_);
    result.tilt_sd = hole_.normal_sd;
  }

  bool pressed_ = false;  // in the latest window
  Pose X_CP_;
  TwinForceSensing* sensing_;
  TwinForceSolution solution_;
  int kept_ = 0;             // contacts
  Pose X_SC_start_;          // carrier at the start
  Pose X_PQ_start_;          // hanging peg at the start, relative to the undeflected one
  double compliance_ = 0.0;  // sideways, at the peg's edge [m/N]
};

}  // namespace

AlignResult twinForce(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
                      const std::function<void(const AlignProgress&)>& progress) {
  return TwinForce(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
