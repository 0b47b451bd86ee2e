// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/align.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "assembly_cell/align/hole_fit.h"
#include "assembly_cell/align/press.h"
#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {
namespace {

constexpr double kPi = 3.14159265358979323846;
using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kMisfitLimit = 0.15;     // of a reading: beyond, the linear model does not hold
constexpr double kDirectionLimit = 0.05;  // sd of a reading's direction that is of use [rad]
constexpr double kClear = 3e-4;           // over the plane before the last way down [m]
constexpr double kTravel = 2e-3;          // over the plane while moving sideways [m]

// rotation that tilts z by a rotation vector (x, y)
Mat3 tiltRotation(const Vec2& tilt) { return rotationFromVector({Vec3(tilt.x(), tilt.y(), 0.0)}); }

// smallest rotation that takes z to n
Mat3 rotationToAxis(const Vec3& n) {
  const Vec3 axis(-n.y(), n.x(), 0.0);
  const double sine = axis.norm();
  if (sine < 1e-15) return Mat3::Identity();
  return rotationFromVector({axis * (std::atan2(sine, n.z()) / sine)});
}

std::string text(const char* format, double a, double b = 0.0) {
  char buffer[240];
  std::snprintf(buffer, sizeof buffer, format, a, b);
  return buffer;
}

// rotation vector (x, y) of the smallest rotation that takes z to the axis
Vec2 axisTilt(const Vec3& axis) { return vectorFromRotation(rotationToAxis(axis)).value.head<2>(); }

// One reading as it was felt.
struct Felt {
  Locus locus;
  Pose X_SC;   // carrier
  Vec3 force;  // mean contact force, sensor axes [N]
  HoleReading reading;
};

struct Failure {
  std::string reason;
};

// The strategy `single_contact`. Poses are relative to S: the carrier's rest frame at the start
// (origin: coupling point) as its encoders say. Where the hole is in S is the unknown.
class SingleContact {
 public:
  SingleContact(Plant& plant, const Scenario& mechanism, const AlignParameters& p,
                const std::function<void(const AlignProgress&)>& progress)
      : mechanism_(mechanism),
        p_(p),
        progress_(progress),
        hand_(plant, {p.force_limit, p.descent_limit, p.approach_step}),
        length_(mechanism.peg.half_height + mechanism.peg.coupling_height) {
    frequency_ = p.exciter_frequency > 0.0 ? p.exciter_frequency
                                           : operatingFrequency(mechanism, p.press_force);
    start_time_ = hand_.last().time;
    hand_.wait(1);
    block_ = hand_.last().time - start_time_;
    bottom_ = Vec3(0, 0, -length_);
  }

  AlignResult run() {
    AlignResult result;
    try {
      // S is where the peg hangs at rest
      hand_.tare();
      X_WS_ = worldPose(hand_.last().carrier);
      reference_time_ = hand_.last().time;
      report("tare", "hanging free");
      int round = 0;
      do {
        if (round++ == p_.rounds) {
          throw Failure{text("not_inserted: no entry after %.0f sweeps", p_.rounds)};
        }
        // an edge that went in on the way says where the hole is as well as a fit does
        const bool swept = sweep();
        if (swept) {
          resolve();
        } else {
          report("sweep", "the tilted edge went in");
          const Vec3 at = pegPose(hand_.target(), Vector6::Zero()).p;
          hole_.center = at - hole_.normal * (hole_.normal.dot(at) - hole_.height);
        }
      } while (!enter(hole_.center));
      result.success = true;
      result.reason = "aligned";
    } catch (const Failure& failure) {
      result.reason = failure.reason;
    } catch (const PressError& error) {
      result.reason = error.what();
    }
    if (!result.success) release();
    summarise(result);
    return result;
  }

 private:
  Pose worldPose(const RestPose& rest) const {
    return {rotationFromEuler({rest.phi, rest.theta, rest.yaw}), Vec3(rest.x, rest.y, rest.z)};
  }

  // rest pose whose free peg has its bottom centre at p and its axes along R
  RestPose restFor(const Vec3& p, const Mat3& R) const {
    const Pose X_W = X_WS_ * Pose{R, p + length_ * R.col(2)};
    const EulerAngles angles = eulerFromRotation(X_W.R);
    RestPose rest;
    rest.x = X_W.p.x();
    rest.y = X_W.p.y();
    rest.z = X_W.p.z();
    rest.yaw = angles.psi;
    rest.theta = angles.theta;
    rest.phi = angles.phi;
    return rest;
  }

  // frame `peg` in S from a carrier pose and a deflection of the coupling since the tare
  Pose pegPose(const RestPose& carrier, const Vector6& d) const {
    const Pose deflected{rotationFromVector({Vec3(d.tail<3>())}), d.head<3>()};
    const Pose bottom{Mat3::Identity(), Vec3(0, 0, -length_)};
    return inverse(X_WS_) * worldPose(carrier) * deflected * bottom;
  }

  void report(const char* state, const std::string& message) {
    if (progress_) progress_({state, contacts_, hand_.last().time - start_time_, message});
  }

  void exciter(double amplitude) {
    PlantCommand command;
    command.exciter = ExciterParameters{amplitude, frequency_, 0.0, p_.exciter_direction};
    hand_.step(command);
  }

  int blocks(double duration) const {
    return std::max(1, static_cast<int>(std::ceil(duration / block_ - 1e-6)));
  }

  // rest height at which a peg tilted by R must have touched unless its edge is in the hole:
  // outside, the bottom's centre stays above the plane
  double entryHeight(const Mat3& R) const {
    if (!found_) return -1e9;
    const double drop = hole_.normal.dot(bottom_) - hole_.height + p_.insertion_depth;
    return restFor(bottom_ - drop * hole_.normal, R).z;
  }

  // one reading with the peg tilted by R about its bottom centre; the exciter runs only meanwhile.
  // False when the edge went into the hole instead
  bool read(const Mat3& R) {
    hand_.moveTo(restFor(bottom_, R));
    if (!hand_.approach(entryHeight(R))) return false;
    RestPose touch = hand_.target();
    touch.z = hand_.touchZ();

    // shake harder than the reading will, so that friction keeps no preload near its limit
    hand_.hold(p_.press_force, p_.press_tolerance);
    exciter(p_.shake * p_.exciter_amplitude);
    hand_.wait(blocks(p_.settle));
    exciter(p_.exciter_amplitude);
    hand_.hold(p_.press_force, p_.press_tolerance);
    hand_.wait(blocks(p_.settle));
    PlantCommand measure;
    measure.locus = LocusRequest{hand_.last().time, p_.window};
    hand_.step(measure);
    Vector6 deflection = hand_.deflection();
    Vec3 force = hand_.force();
    int taken = 1;
    for (; !hand_.last().locus; ++taken) {
      if (taken > blocks(p_.window) + 2) throw Failure{"no_reading: the estimator gave none"};
      hand_.step({});
      deflection += hand_.deflection();
      force += hand_.force();
    }
    deflection /= taken;
    force /= taken;
    const LocusReading reading = *hand_.last().locus;
    ++contacts_;
    use(reading, deflection, force);
    exciter(0.0);

    // clear of the plane for the next tilt
    touch.z += p_.lift;
    hand_.moveTo(touch);
    bottom_ = pegPose(touch, Vector6::Zero()).p;
    return true;
  }

  // what a reading is kept for: its direction depends on the tilt, which is known better later
  void use(const LocusReading& reading, const Vector6& deflection, const Vec3& force) {
    std::string note = toString(reading.mode.mode);
    if (reading.mode.mode == LocusMode::kEllipse || reading.mode.mode == LocusMode::kCircle) {
      Felt felt;
      felt.locus = reading.locus;
      felt.force = force;
      felt.X_SC = inverse(X_WS_) * worldPose(hand_.last().carrier);
      felt.reading.X_SP = pegPose(hand_.last().carrier, deflection);
      const DirectionEstimate direction = invert(felt);
      note += text(", direction %.2f deg, sd %.2f", felt.reading.alpha * 180 / kPi,
                   felt.reading.sd * 180 / kPi);
      if (direction.misfit < kMisfitLimit && direction.sd < kDirectionLimit) {
        felt_.push_back(felt);
      } else {
        note += text(": left out, misfit %.2f", direction.misfit);
      }
    }
    report("sweep", note);
  }

  // from the locus to a direction on the peg's edge, with the tilts against the plane as known now
  DirectionEstimate invert(Felt& felt) const {
    const Mat3 R_HS = rotationToAxis(hole_.normal).transpose();
    const Mat3 R_HP = R_HS * felt.reading.X_SP.R;
    OperatingPoint point;
    point.frequency = frequency_;
    point.amplitude = p_.exciter_amplitude;
    point.direction = p_.exciter_direction;
    const Vec3 force = R_HS * felt.X_SC.R * felt.force;
    point.press = std::max(0.0, force.z());
    point.friction = force.head<2>();
    point.rolling = felt.reading.kind == HoleReading::kPlane;
    point.tilt = axisTilt(R_HP.col(2));
    point.sensor_tilt = axisTilt((R_HS * felt.X_SC.R).col(2));
    const DirectionEstimate direction =
        contactDirection(mechanism_, point, felt.locus, LocusAxes::kSensor);
    // horizontal direction from the bottom centre -> azimuth on the edge
    const Vec2 horizontal(std::cos(direction.alpha), std::sin(direction.alpha));
    const Vec2 body = R_HP.topLeftCorner<2, 2>().inverse() * horizontal;
    felt.reading.alpha = std::atan2(body.y(), body.x());
    felt.reading.sd = direction.sd;
    return direction;
  }

  // the low side of the peg once round, at a constant tilt against what is known of the plane
  // false when the edge went into the hole on the way
  bool sweep() {
    const Mat3 R_SH = rotationToAxis(hole_.normal);
    for (int i = 0; i < p_.sweep_readings; ++i) {
      const double a = 2 * kPi * i / p_.sweep_readings;
      // the rotation vector is a right angle ahead of the low side
      const Vec2 tilt = p_.sweep_tilt * Vec2(-std::sin(a), std::cos(a));
      if (!read(R_SH * tiltRotation(tilt))) return false;
    }
    return true;
  }

  // directions need the plane's normal, the plane needs directions: a few turns settle both
  void resolve() {
    std::vector<HoleReading> readings(felt_.size());
    for (int turn = 0; turn < 4; ++turn) {
      for (std::size_t i = 0; i < felt_.size(); ++i) {
        invert(felt_[i]);
        readings[i] = felt_[i].reading;
      }
      const std::string reason =
          fitHole(mechanism_.peg.radius, mechanism_.hole.radius, readings, hole_);
      if (!reason.empty()) throw Failure{reason};
      for (std::size_t i = 0; i < felt_.size(); ++i) felt_[i].reading.kind = readings[i].kind;
    }
    found_ = true;
    report("resolve",
           text("%.0f contacts on the plane, %.0f on the rim", hole_.plane_readings,
                hole_.rim_readings) +
               text(", centre %.3f %.3f mm", offset().x() * 1e3, offset().y() * 1e3) +
               text(" +- %.3f mm, tilt sd %.4f deg",
                    std::sqrt(hole_.center_covariance.trace()) * 1e3, hole_.normal_sd * 180 / kPi));
  }

  // upright over the estimated hole and down; around it where the estimate is not good enough. True
  // when the edge went in without resistance
  bool enter(const Vec3& estimate) {
    const Mat3 R = rotationToAxis(hole_.normal);
    const Eigen::Matrix<double, 3, 2> axes = planeAxes(hole_.normal);
    const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
    // up along the normal before sideways and straight
    Vec3 above = pegPose(hand_.target(), Vector6::Zero()).p;
    above += hole_.normal * std::max(0.0, kTravel - hole_.normal.dot(above) + hole_.height);
    hand_.moveTo(restFor(above, (inverse(X_WS_) * worldPose(hand_.target())).R));
    // the hanging peg sags differently in this pose
    Vec3 target = estimate + kClear * hole_.normal;
    hand_.moveTo(restFor(target + kTravel * hole_.normal, R));
    hand_.wait(blocks(p_.settle));
    const Vec3 sag = pegPose(hand_.last().carrier, hand_.deflection()).p -
                     pegPose(hand_.target(), Vector6::Zero()).p;
    target -= sag - hole_.normal * hole_.normal.dot(sag);

    // centre, then rings a little closer than the clearance
    for (int ring = 0; ring < 3; ++ring) {
      const int places = ring == 0 ? 1 : 6 * ring;
      for (int i = 0; i < places; ++i) {
        const double a = 2 * kPi * i / places;
        const Vec2 shift = 0.9 * clearance * ring * Vec2(std::cos(a), std::sin(a));
        if (lower(target + axes * shift, R)) return true;
      }
    }
    report("enter", "resistance everywhere, measuring again");
    bottom_ = target + kTravel * hole_.normal;
    hand_.moveTo(restFor(bottom_, R));
    return false;
  }

  // down from `from`, just over the plane; back up at the first resistance
  bool lower(const Vec3& from, const Mat3& R) {
    hand_.moveTo(restFor(from, R));
    const double way = kClear + p_.insertion_depth;
    double down = 0.0;
    while (down < way && hand_.forceZ() < p_.insertion_force) {
      down = std::min(way, down + p_.approach_step);
      PlantCommand command;
      command.rest = restFor(from - down * hole_.normal, R);
      hand_.step(command);
    }
    if (down >= way) {
      hand_.moveTo(restFor(from - way * hole_.normal, R));
      hand_.wait(blocks(p_.settle));
    }
    const double force = hand_.forceZ();
    const bool in = force < p_.insertion_force;
    report("enter", text(in ? "in, contact force %.2f N" : "resistance of %.2f N", force));
    if (!in) hand_.moveTo(restFor(from, R));
    return in;
  }

  // exciter off; what went wrong is already known
  void release() {
    try {
      exciter(0.0);
    } catch (const PressError&) {
    }
  }

  // hole centre relative to the start's bottom centre, along the hole plane
  Vec2 offset() const {
    return (rotationToAxis(hole_.normal).transpose() * (hole_.center - Vec3(0, 0, -length_)))
        .head<2>();
  }

  void summarise(AlignResult& result) const {
    result.contacts = contacts_;
    result.time = hand_.last().time - start_time_;
    result.reference_time = reference_time_;
    if (!found_) return;
    result.known = true;
    result.offset = offset();
    result.offset_covariance = hole_.center_covariance;
    result.tilt = -axisTilt(hole_.normal);
    result.tilt_sd = hole_.normal_sd;
  }

  const Scenario& mechanism_;
  const AlignParameters& p_;
  const std::function<void(const AlignProgress&)>& progress_;
  Hand hand_;
  double length_;
  double frequency_ = 0.0;
  double start_time_ = 0.0, reference_time_ = 0.0;  // plant clock [s]
  double block_ = 0.0;                              // duration of a block [s]
  Pose X_WS_;
  Vec3 bottom_;  // where the peg is turned: its bottom centre in S
  int contacts_ = 0;
  std::vector<Felt> felt_;
  HoleEstimate hole_;
  bool found_ = false;
};

void check(bool good, const char* name, double value, const char* remedy) {
  if (!good) throw InputError(std::string("align: ") + name + text(": %g: ", value) + remedy);
}

}  // namespace

void checkParameters(const AlignParameters& p) {
  if (p.strategy != "single_contact") {
    throw InputError("align: strategy: " + p.strategy + " is not available; use single_contact");
  }
  check(p.press_force >= 2.0 && p.press_force < p.force_limit, "press_force", p.press_force,
        "must be at least 2 N and below force_limit");
  check(p.press_tolerance > 0 && p.press_tolerance <= 0.5, "press_tolerance", p.press_tolerance,
        "must lie in (0, 0.5]");
  check(p.force_limit > 0 && p.force_limit <= 1000, "force_limit", p.force_limit,
        "must lie in (0, 1000] N");
  check(p.descent_limit > 0 && p.descent_limit <= 1, "descent_limit", p.descent_limit,
        "must lie in (0, 1] m");
  check(p.approach_step > 0 && p.approach_step <= 1e-2, "approach_step", p.approach_step,
        "must lie in (0, 0.01] m");
  check(p.exciter_amplitude > 0 && p.exciter_amplitude <= 1000, "exciter_amplitude",
        p.exciter_amplitude, "must lie in (0, 1000] N");
  check(p.exciter_frequency >= 0 && p.exciter_frequency <= 1e5, "exciter_frequency",
        p.exciter_frequency, "must lie in [0, 1e5] rad/s; 0 chooses it");
  check(p.exciter_direction == 1 || p.exciter_direction == -1, "exciter_direction",
        p.exciter_direction, "must be 1 or -1");
  check(p.shake >= 1 && p.shake <= 5, "shake", p.shake, "must lie in 1 to 5");
  check(p.settle >= 0 && p.settle <= 60, "settle", p.settle, "must lie in [0, 60] s");
  check(p.window > 0 && p.window <= 60, "window", p.window, "must lie in (0, 60] s");
  check(p.sweep_tilt > 0 && p.sweep_tilt <= 0.14, "sweep_tilt", p.sweep_tilt,
        "must lie in (0, 0.14] rad");
  check(p.sweep_readings >= 8 && p.sweep_readings <= 360, "sweep_readings", p.sweep_readings,
        "must lie in 8 to 360");
  check(p.lift > 0 && p.lift <= 0.01, "lift", p.lift, "must lie in (0, 0.01] m");
  check(p.insertion_depth > 0 && p.insertion_depth <= 0.01, "insertion_depth", p.insertion_depth,
        "must lie in (0, 0.01] m");
  check(p.insertion_force > 0 && p.insertion_force < p.force_limit, "insertion_force",
        p.insertion_force, "must be above 0 and below force_limit");
  check(p.rounds >= 1 && p.rounds <= 10, "rounds", p.rounds, "must lie in 1 to 10");
}

AlignResult align(Plant& plant, const Scenario& mechanism, const AlignParameters& parameters,
                  const std::function<void(const AlignProgress&)>& progress) {
  checkParameters(parameters);
  if (!(mechanism.hole.radius > mechanism.peg.radius)) {
    throw InputError("align: hole.radius: " + text("%g m", mechanism.hole.radius) +
                     " is not larger than the peg's; the peg can't enter");
  }
  return SingleContact(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
