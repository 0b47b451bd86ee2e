// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "assembly_cell/align/search.h"
#include "assembly_cell/locus/contact_model.h"

namespace assembly_cell {
namespace {

constexpr double kPi = 3.14159265358979323846;
using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr double kMisfitLimit = 0.15;     // of a reading: beyond, the linear model does not hold
constexpr double kDirectionLimit = 0.05;  // sd of a reading's direction that is of use [rad]

// One reading as it was felt.
struct Felt {
  Locus locus;
  Pose X_SC;   // carrier
  Vec3 force;  // mean contact force, sensor axes [N]
  HoleReading reading;
};

// The strategy `single_contact`: directions of contact from the locus of the vibrated peg.
class SingleContact : public Search {
 public:
  SingleContact(Plant& plant, const Scenario& mechanism, const AlignParameters& p,
                const Progress& progress)
      : Search(plant, mechanism, p, progress) {
    frequency_ = p.exciter_frequency > 0.0 ? p.exciter_frequency
                                           : operatingFrequency(mechanism, p.press_force);
    bottom_ = Vec3(0, 0, -length_);
  }

 private:
  // where the hanging peg was at the start counts as undeflected
  Vector6 deflection() const override { return hand_.deflection(); }

  void find() override {
    begin();
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
      if (enter(hole_.center)) return;
      bottom_ = pegPose(hand_.target(), Vector6::Zero()).p;
    } while (true);
  }

  void exciter(double amplitude) {
    PlantCommand command;
    command.exciter = ExciterParameters{amplitude, frequency_, 0.0, p_.exciter_direction};
    hand_.step(command);
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

  // hole centre relative to the start's bottom centre, along the hole plane
  Vec2 offset() const {
    return (rotationToAxis(hole_.normal).transpose() * (hole_.center - Vec3(0, 0, -length_)))
        .head<2>();
  }

  void summarise(AlignResult& result) const override {
    result.known = true;
    result.offset = offset();
    result.offset_covariance = hole_.center_covariance;
    result.tilt = -axisTilt(hole_.normal);
    result.tilt_sd = hole_.normal_sd;
  }

  double frequency_ = 0.0;
  Vec3 bottom_;  // where the peg is turned: its bottom centre in S
  std::vector<Felt> felt_;
};

}  // namespace

AlignResult singleContact(Plant& plant, const Scenario& mechanism,
                          const AlignParameters& parameters,
                          const std::function<void(const AlignProgress&)>& progress) {
  return SingleContact(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
