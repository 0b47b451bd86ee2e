// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <string>

#include "assembly_cell/align/estimation/twin_contacts.h"
#include "assembly_cell/align/estimation/twin_sensing.h"
#include "assembly_cell/align/outcome.h"
#include "assembly_cell/align/strategies/edge_search.h"
#include "assembly_cell/align/strategies/strategies.h"
#include "assembly_cell/base/text.h"

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
// Of the centre: more is no place for touches round it. The edge reaches a hole 6 mm beside. [m]
constexpr double kLost = 4e-3;
// Of the peg at the start, at most: 3°. The same with half 12.9 s, with twice 13.3 s. [rad]
constexpr double kUnknownTilt = 0.05;

// A contact to make: the undeflected peg over it in S, then a pull sideways.
struct Reach {
  Vec3 p;
  Mat3 R;
  Vec3 pull = Vec3::Zero();  // in S [N]
};

// The strategy `twin_force`: the pose of the peg in the hole from the wrenches of the same contacts
// at sensor_a and sensor_b (thesis chapter 10). A is `hole`, B is frame `peg` as it would
// be without deflection, the reference is its pose at the start.
class TwinForce {
 public:
  TwinForce(Search& search, TwinForceSensing* sensing)
      : search_(search),
        s_(search.state),
        edge_(search),
        X_CP_{Mat3::Identity(), Vec3(0, 0, -s_.frame.length())},
        sensing_(sensing) {
    // the coupling's own zero counts: the sag under the peg's weight is part of the peg's pose
    s_.absolute_deflection = true;
    search.entry.needs_walls = !s_.p.insert.wanted();
    edge_.min_move_sd = kPlaceSd;
    // how far the carrier goes sideways for a pull at the peg's edge
    const Vector6& k = s_.mechanism.coupling.stiffness.diagonal;
    compliance_ = 1.0 / k(1) + s_.frame.length() * s_.frame.length() / k(4);
  }

  void find() {
    if (search_.begin()) {
      s_.found = false;  // the pose in the hole wasn't measured
      return;
    }
    const AveragingWindow free = window(false);
    X_PQ_start_ = deflectedPeg(X_CP_, free.means().displacement());
    X_SC_start_ = s_.frame.carrierPose(s_.carrier.last().carrier);
    Vec3 place(0, 0, -s_.frame.length() + tipRadius(s_.mechanism.peg) * s_.p.contact_tilt);
    for (int k = 1;; ++k) {
      try {
        attempt(place);
        return;
      } catch (const AlignError& error) {
        if (k >= kAttempts || !isRecoverable(error.failure)) throw;
        // out, and beside a hole that is too near to press tilted
        s_.report("recover", error.what());
        search_.retreat.backOut(kRetreat * s_.scale.travel);
      }
      s_.found = false;
      s_.hole = HoleEstimate();
      // across the tilts to come, so that not both edges carry; then to the other sides
      const double travel = search_.retreat.trapWidth(s_.p.contact_tilt + kUnknownTilt);
      const double a = 0.5 * M_PI + 2 * M_PI * (k - 1) / (kAttempts - 1);
      place = travel * Vec3(std::cos(a), std::sin(a), 0.0);
      place.z() = s_.target().p.z();
      s_.report("aside", text("by %.1f mm", travel * 1e3));
    }
  }

  void summarise(AlignResult& result) const {
    const Pose X_SQ = X_CP_ * X_PQ_start_;
    const Mat3 upright = rotationToAxis(s_.hole.normal);
    result.known = true;
    // the centre is that of the contacts, or of the walls where they were measured since; the
    // rotation about the axis, wrong by the error of a sensor's frame, would shift it
    result.offset = (upright.transpose() * (s_.hole.center - X_SQ.p)).head<2>();
    result.offset_covariance = s_.hole.center_covariance;
    result.wrench_offset = -(solution_.X_HP * X_PQ_start_).p.head<2>();
    result.wrench_covariance = centerCovariance(solution_).topLeftCorner<2, 2>();
    result.tilt = tiltOf(edge_.known ? Pose{upright.transpose() * X_SQ.R, Vec3::Zero()}
                                     : solution_.X_HP * X_PQ_start_);
    result.tilt_sd = s_.hole.normal_sd;
  }

 private:
  // a force that doesn't settle without a press is the sensor's own drift
  bool isRecoverable(AlignFailure failure) const {
    return traitsOf(failure).twin_force_again && (failure != AlignFailure::kNotSettled || pressed_);
  }

  // Pose and entry from a place; AlignError when it fails there.
  void attempt(const Vec3& place) {
    sensing_->begin({s_.frame.X_BS(), X_SC_start_, s_.p.contact_force, s_.p.contact_tilt,
                     s_.p.settled_force, s_.p.required_position, s_.p.required_rotation,
                     static_cast<std::size_t>(s_.p.most_contacts)});
    kept_ = 0;
    edge_.known = false;
    edge_.readings.clear();
    // two sides of the edge, where the peg happens to be
    Reach reach{place, tiltRotation({0.0, s_.p.contact_tilt})};
    contact(reach);
    RestPose touched = s_.carrier.target();
    touched.z = s_.press.touchZ();
    reach.p.z() = s_.frame.pegPose(touched, Vector6::Zero()).p.z();
    reach.R = tiltRotation({0.0, -s_.p.contact_tilt});
    reach.p.z() += kLift;
    contact(reach);
    solve();
    double before = 0.0;
    while (kept_ < s_.p.most_contacts) {
      const bool enough = kept_ >= s_.p.fewest_contacts;
      const double known = solution_.smallest_eigenvalue;
      // more of the same brings nothing where errors of the sensors, common to all, are left
      if (enough && (solution_.status == TwinForceStatus::kOk || known < kGain * before)) break;
      const ReachableContact next = advised();
      if (enough && next.smallest_eigenvalue < kGain * known) break;
      contact(reachOf(next));
      before = known;
      solve();
    }
    if (s_.known.position_sd > kLost * s_.scale.length) {
      throw AlignError(AlignFailure::kTooUncertain,
                       text("centre known to %.1f mm, touches round it need %.1f mm; ",
                            s_.known.position_sd * 1e3, kLost * s_.scale.length * 1e3) +
                           "press harder or use a finer converter");
    }
    // without touches: the error of moves, by the ratio of the residuals to the expected ones
    const double part = std::min(1.0, solution_.chi2 / std::max(1, solution_.dof));
    const double sd = std::max(kPlaceSd, TwinUncertainty().move * std::sqrt(part));
    search_.entry.place_variance = sd * sd;
    if (search_.entry.enter(s_.hole.center, 1)) return;
    // touches on the face and the walls don't depend on the sensors' errors
    touchRound();
    edge_.enterByWalls();
  }

  // Touches on the face round the expected hole.
  void touchRound() {
    edge_.model.start = s_.hole.center.head<2>();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> spread(s_.hole.center_covariance);
    edge_.model.position_sd = std::sqrt(spread.eigenvalues()(1));
    const Eigen::Matrix<double, 3, 2> axes = rotationToAxis(s_.hole.normal).leftCols<2>();
    const Vec3 centre = s_.hole.center, normal = s_.hole.normal;
    for (int i = 0; i < kRound; ++i) {
      const double a = 2 * M_PI * (i + 0.5) / kRound;
      edge_.bottom = centre + kBeside * s_.scale.length * (axes * Vec2(std::cos(a), std::sin(a)));
      edge_.touch(tiltedTo(normal, a, s_.p.contact_tilt));
    }
    edge_.resolve();
    edge_.known = true;
  }

  // Mean of both sensors at rest.
  AveragingWindow window(bool pressed) {
    using State = AveragingWindow::State;
    pressed_ = pressed;
    AveragingLimits limits{std::max(2, s_.blocks(s_.p.contact_window)), s_.p.settled_force};
    limits.tries = kWindows;
    AveragingWindow w(limits);
    State state = State::kFilling;
    while (state == State::kFilling) state = w.add(s_.carrier.step({}));
    if (state != State::kSettled) {
      notSettled(text("halves of a window differ by more than %.3f N", s_.p.settled_force));
    }
    return w;
  }

  // One contact: hang free there, take the zero, lower, press, pull, average, leave.
  void contact(const Reach& reach) {
    RestPose above = s_.carrier.target();
    above.z += kLift;
    if (s_.contacts > 0) s_.carrier.moveTo(above);
    const RestPose hover = s_.frame.restFor(reach.p, reach.R);
    RestPose over = hover;
    over.z = std::max(hover.z, above.z);
    if (s_.contacts > 0) s_.carrier.moveTo(over);
    s_.carrier.moveTo(hover);
    s_.carrier.tare(2);
    for (int higher = 0; s_.carrier.sensor().tareShift() > s_.carrier.sensor().freeShift();
         ++higher) {
      // the edge already rests on something
      if (higher == kHigher)
        throw AlignError(AlignFailure::kNotFree, "the peg doesn't come free over the contact");
      RestPose up = s_.carrier.target();
      up.z += kLift;
      s_.carrier.moveTo(up);
      s_.carrier.tare(2);
    }
    const WindowAnswer zero = sensing_->tare(window(false));
    if (!zero.refusal.empty()) notSettled(zero.refusal);

    // light first: a wedge is never pressed, nor are both edges while the hole may be anywhere
    const Touch light = *search_.touch.lower(-1e9);
    search_.touch.refuseWedge(light, reach.R);
    if (light.straddles() && !s_.found) {
      throw AlignError(AlignFailure::kBothEdges, text("the line of action is %.1f mm from the axis",
                                                      light.reach * s_.mechanism.peg.radius * 1e3));
    }
    edge_.add(light);
    s_.press.hold(s_.p.contact_force, s_.p.press_tolerance);
    if (!reach.pull.isZero()) {
      RestPose pulled = s_.carrier.target();
      const Vec3 shift = s_.frame.X_BS().R * reach.pull * compliance_;
      pulled.x -= shift.x();
      pulled.y -= shift.y();
      s_.carrier.moveTo(pulled);
      s_.press.hold(s_.p.contact_force, s_.p.press_tolerance);
    }
    s_.carrier.wait(s_.blocks(s_.p.settle));
    const AveragingWindow pressed = window(true);
    ++s_.contacts;
    keep(pressed);
    // clear of it again
    RestPose clear = s_.carrier.target();
    clear.z = std::max(clear.z, s_.press.touchZ());
    s_.carrier.moveTo(clear);
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
    s_.report("contact", text("pressed with %.2f N, deflection %.3f mm", contact.force,
                              pressed.means().displacement().head<3>().norm() * 1e3));
  }

  // The hole from all contacts.
  void solve() {
    solution_ = sensing_->solve();
    const TwinForceSolution& e = solution_;
    if (!hasPose(e.status)) {
      throw AlignError(AlignFailure::kNoPose, std::string(toString(e.status)) + ": " + e.reason);
    }
    const Pose X_SH = X_CP_ * inverse(e.X_HP);
    s_.hole.normal = X_SH.R.col(2);
    s_.hole.center = X_SH.p;
    s_.hole.height = s_.hole.normal.dot(s_.hole.center);
    const Mat3 covariance = centerCovariance(e);
    s_.hole.center_covariance = covariance.topLeftCorner<2, 2>();
    s_.hole.height_sd = std::sqrt(covariance(2, 2));
    s_.hole.normal_sd = std::sqrt(e.covariance(3, 3) + e.covariance(4, 4));
    s_.found = true;
    s_.known.position_sd = std::sqrt(s_.hole.center_covariance.trace());
    s_.known.rotation_sd = s_.hole.normal_sd;
    const Vec2 offset = -(e.X_HP * X_PQ_start_).p.head<2>();
    s_.report("solve", std::string(toString(solution_.status)) +
                           text(", centre %.3f %.3f mm", offset.x() * 1e3, offset.y() * 1e3) +
                           text(" +- %.4f mm, tilt sd %.4f deg", s_.known.position_sd * 1e3,
                                s_.known.rotation_sd * 180 / M_PI) +
                           text(", chi2 %.1f of %d", e.chi2, e.dof) +
                           text(", smallest eigenvalue %.3g", e.smallest_eigenvalue));
  }

  // The contact that adds most information.
  ReachableContact advised() {
    const ReachableContact best = sensing_->advise();
    s_.report("advice", text("beside the hole by %.1f mm", best.X_HP.p.head<2>().norm() * 1e3) +
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

  // Standard deviation of the plane's height under the low side of a peg put down there. [m]
  double heightSd(const Pose& X_HP) const {
    const Vec2 low = -X_HP.R.row(2).head<2>().transpose().normalized();
    const Vec3 from = X_HP.p + tipRadius(s_.mechanism.peg) * (X_HP.R.leftCols<2>() * low);
    const Vec3 arm = from - solution_.X_HP.p;
    Vector6 slope;
    slope << 0.0, 0.0, 1.0, arm.y(), -arm.x(), 0.0;
    return std::sqrt(slope.dot(solution_.covariance * slope));
  }

  Search& search_;
  SearchState& s_;
  EdgeSearch edge_;
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
                      const ProgressCallback& progress) {
  Search search(plant, mechanism, parameters, progress);
  TwinForce strategy(search, plant.twinForce());
  return search.run([&] { strategy.find(); },
                    [&](AlignResult& result) { strategy.summarise(result); });
}

}  // namespace assembly_cell
