// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <vector>

#include "assembly_cell/align/estimation/touch_fit.h"
#include "assembly_cell/align/search/search.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

// Of the default cell, carried over by Scale.
constexpr int kTouches = 6;        // that level the peg: three, and three between them
constexpr int kLevels = 4;         // tries to level it
constexpr double kFar = 8e-3;      // above where one failed [m]
constexpr double kPlaceSd = 5e-5;  // of where a move ends [m]
constexpr double kSlide = 5.0;     // constant force of the search [N]
constexpr double kServo = 0.5;     // of the error of force, taken out in a block
constexpr double kPitch = 1.4;     // between turns, in clearances: a turn passes within 0.7 of one
constexpr double kLag = 0.7;       // of the peg behind its carrier, of the clearance
constexpr double kLeast = 0.3;     // force of the search at least [N]
constexpr double kQuarters = 3.0;  // of the peg's period in its coupling, over the hole
constexpr double kPassBlocks = 3.0;
constexpr double kLost = 0.5;        // of the force: less is a drop
constexpr double kFollow = 0.3;      // of the strain that the carrier takes out in a block
constexpr double kTurn = 0.3;        // in a block, in the middle [rad]
constexpr double kFarthest = 0.017;  // from where the search began: starts within 15 mm [m]
constexpr double kLean =
    2e-3;  // of the peg on the face, beyond what the contact turns it back [rad]
constexpr double kOver = 3e-4;  // over the plane before the search [m]
constexpr double kDeep = 1e-3;  // below the plane: in the hole; no edge tilts by so much [m]
constexpr double kHeld = 0.8;   // sideways, of the force: no friction, an edge on the rim
constexpr int kDwell = 20;      // blocks on the spot
constexpr int kRest = 5;        // blocks
constexpr int kCatches = 200;   // that the edge may meet the rim before it drops
constexpr double kLift = 2e-3;  // over it then [m]
constexpr double kSkip = 2e-4;  // and behind it [m]
constexpr double kWord = 1e-3;  // of the radius, between two words of progress [m]

// The strategy `spiral`, the baseline that people know: level with the face, then along an
// Archimedean spiral under constant force until the peg drops, then down.
class Spiral : public Search {
 public:
  Spiral(Plant& plant, const Mechanism& mechanism, const AlignParameters& parameters,
         const Progress& progress)
      : Search(plant, mechanism, parameters, progress) {}

 private:
  bool feelsWalls() const override { return true; }

  void find() override {
    if (begin()) return;
    const Vec3 start(0, 0, -length_);
    Vec3 place = start;
    for (int k = 1;; ++k) {
      try {
        level(place);
        break;
      } catch (const AlignError& error) {
        // an edge over the hole is held there: levelled beside it, searched about the start
        const bool held = error.failure == AlignFailure::kWedged ||
                          error.failure == AlignFailure::kForceLimit ||
                          error.failure == AlignFailure::kSensorSaturated ||
                          error.failure == AlignFailure::kNoPlaneReading;
        if (!held || k == kLevels) throw;
        report("recover", error.what());
        backOut(kFar * scale_.room);
        place = pegPose(press_.target(), Vector6::Zero()).p + wayAside(p_.contact_tilt);
      }
    }
    search(start);
  }

  // the tilted edge touches the face all round
  void level(Vec3 place) {
    std::vector<TouchReading> readings;
    TouchModel model;
    model.peg = mechanism_.peg;
    model.hole = mechanism_.hole;
    for (int i = 0; i < kTouches; ++i) {
      const double a = 2 * M_PI * (i + (i < 3 ? 0.0 : 0.5)) / 3;
      const Mat3 R = tiltRotation(p_.contact_tilt * Vec2(-std::sin(a), std::cos(a)));
      // no point of the edge goes down by more than the radius times the turn
      place.z() += 2.0 * tipRadius(mechanism_.peg) * p_.contact_tilt;
      press_.moveTo(restFor(place, R), false);
      press_.tare(2);
      const std::optional<Touch> light = lightTouch(-1e9);
      place = pegPose(press_.target(), Vector6::Zero()).p;
      if (!light) continue;
      refuseWedge(*light, R);
      TouchReading reading;
      reading.X_SP = light->X_SP;
      reading.sd = kPlaceSd;
      reading.point = light->point;
      readings.push_back(reading);
      ++contacts_;
      report("level", text("touch of %.1f N", light->force));
    }
    TouchFit fit;
    try {
      fit = fitTouches(model, readings);
    } catch (const InputError& error) {
      throw AlignError(AlignFailure::kNoPlaneReading, error.what());
    }
    hole_.normal = fit.normal;
    hole_.height = fit.height;
    hole_.height_sd = fit.height_sd;
    hole_.normal_sd = fit.normal_sd;
    rotation_sd_ = fit.normal_sd;
    report("level", text("tilt sd %.3f deg", fit.normal_sd * 180 / M_PI));
  }

  // over a place of the search, free; the zero taken anew
  void hover(const Vec3& place, const Mat3& R) {
    press_.moveTo(restFor(place + kOver * scale_.room * hole_.normal, R), false);
    press_.tare(kRest);
  }

  // round and round on the face until the peg drops
  void search(const Vec3& start) {
    // on one point of the edge: a face that lies flat rocks
    const Mat3 R = rotationToAxis(hole_.normal) * tiltRotation({lean(), 0.0});
    const Vec3 foot = start - hole_.normal * (hole_.normal.dot(start) - hole_.height);
    Vec3 up = pegPose(press_.target(), Vector6::Zero()).p;
    up.z() += 2.0 * tipRadius(mechanism_.peg) * p_.contact_tilt;
    press_.moveTo(restFor(up, (inverse(X_BS_) * poseFromRest(press_.target())).R), false);
    press_.moveTo(restFor({foot.x(), foot.y(), std::max(up.z(), foot.z())}, R), false);
    for (int caught = 0; caught <= kCatches; ++caught) {
      hover(placeAt(foot), R);
      const End end = slide(foot, R);
      if (end == kOutside) {
        throw AlignError(AlignFailure::kNoHoleUnderEdge,
                         text("the peg didn't drop within %.0f mm, caught %.0f times",
                              1e3 * kFarthest * scale_.room, caught));
      }
      if (end == kDropped && dropped()) return;
      // an edge on the rim, which chamfers are for: over it, and on behind it
      report("caught", text("%.2f mm from the start", 1e3 * pitch() * azimuth_));
      backOut(kLift * scale_.room);
      ahead(kSkip);
    }
    throw AlignError(AlignFailure::kNotInserted,
                     text("the edge is caught everywhere, %.0f times", kCatches));
  }

  // The face drags the peg behind its carrier and turns it; once it drops it springs back. More
  // than the clearance would carry it over the hole.
  double force() const {
    const auto& stiffness = mechanism_.coupling.stiffness.diagonal;
    const double lag = mechanism_.friction.sliding_coefficient * sidewaysCompliance(mechanism_) +
                       mechanism_.peg.radius * length_ / std::min(stiffness(4), stiffness(5));
    const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
    return std::clamp(kLag * clearance / lag, kLeast * scale_.force,
                      kSlide * std::max(1.0, scale_.force));
  }
  // The turn that passes farthest from the hole's middle is over it for as long as the peg needs to
  // drop, some quarters of its period in the coupling, and for as long as the carrier to stop.
  double speed() const {
    const double clearance = mechanism_.hole.radius - mechanism_.peg.radius;
    const double chord = 2.0 * clearance * std::sqrt(1.0 - 0.25 * kPitch * kPitch);
    const double quarter =
        0.5 * M_PI * std::sqrt(mechanism_.peg.mass / mechanism_.coupling.stiffness.diagonal(0));
    return chord / std::max(kQuarters * quarter, kPassBlocks * block_);
  }
  // More than edge and friction turn the peg back in its coupling.
  double lean() const {
    const double arm = mechanism_.peg.radius + mechanism_.friction.sliding_coefficient * length_;
    const auto& stiffness = mechanism_.coupling.stiffness.diagonal;
    return kLean + force() * arm / std::min(stiffness(4), stiffness(5));
  }
  // outward per radian
  double pitch() const {
    return kPitch * (mechanism_.hole.radius - mechanism_.peg.radius) / (2 * M_PI);
  }
  Vec3 placeAt(const Vec3& foot) const {
    const Vec2 at = pitch() * azimuth_ * Vec2(std::cos(azimuth_), std::sin(azimuth_));
    return foot + planeAxes(hole_.normal) * at;
  }
  void ahead(double way) {
    azimuth_ += std::min(kTurn, way / (pitch() * std::hypot(1.0, azimuth_)));
  }
  // of the peg's bottom under the face
  double below() const {
    return hole_.height - hole_.normal.dot(pegPose(press_.last().carrier, deflection()).p);
  }

  enum End { kDropped, kCaught, kOutside };

  // Down to the face and along the spiral. Where the force is gone, or the peg is held, it is
  // pushed on the spot, the carrier following the strain sideways: into the hole, or a tilted edge
  // dips.
  End slide(const Vec3& foot, const Mat3& R) {
    const double sink = kServo * pressCompliance(mechanism_);
    const double most = p_.approach_step * scale_.step;
    const int dwell = timed(kDwell);
    double height = kOver * scale_.room;
    bool down = false, held = false;
    Vec3 aside = Vec3::Zero();
    for (int stays = 0; pitch() * azimuth_ < kFarthest * scale_.room;) {
      const double felt = hole_.normal.dot(carrierPose().R * press_.force());
      const double lost = force() - felt;
      height -= lost > kLost * force() ? most : std::max(-most, sink * lost);
      if (down && stays == 0) ahead(speed() * block_);
      press_.nudge(restFor(placeAt(foot) + aside + height * hole_.normal, R));
      down = down || felt > kLost * force();
      if (!down) continue;
      if (below() > kDeep * scale_.length) return kDropped;
      if (stays == 0) {
        held = press_.force().head<2>().norm() > kHeld * force();
        if (held || hole_.normal.dot(carrierPose().R * press_.force()) < kLost * force()) {
          stays = dwell;
        }
      } else {
        aside += kFollow * strain();
        if (--stays == 0) {
          if (held) return kCaught;
          aside.setZero();
        }
      }
      tell();
    }
    return kOutside;
  }

  // of the coupling, along the face
  Vec3 strain() const {
    const RestPose& carrier = press_.last().carrier;
    const Vec3 way = pegPose(carrier, deflection()).p - pegPose(carrier, Vector6::Zero()).p;
    return way - hole_.normal * hole_.normal.dot(way);
  }

  void tell() {
    if (pitch() * azimuth_ < kWord * (told_ + 1)) return;
    ++told_;
    report("search",
           text("%.0f mm from the start, %.1f N", 1e3 * pitch() * azimuth_, press_.forceZ()));
  }

  // Where it dropped is the hole, or the edge has only tilted over the rim: upright over it and
  // down as every strategy, which says so.
  bool dropped() {
    press_.wait(timed(kRest));
    const Vec3 peg = pegPose(press_.last().carrier, deflection()).p;
    ++contacts_;
    report("drop", text("%.2f mm below the face", below() * 1e3));
    return enter(peg + below() * hole_.normal);
  }

  void summarise(AlignResult& result) const override {
    result.known = true;
    result.offset =
        (rotationToAxis(hole_.normal).transpose() * (hole_.center - Vec3(0, 0, -length_)))
            .head<2>();
    result.offset_covariance = hole_.center_covariance;
    result.tilt = -axisTilt(hole_.normal);
    result.tilt_sd = hole_.normal_sd;
  }

  double azimuth_ = 0.0;  // on the spiral [rad]
  int told_ = 0;          // words of progress
};

}  // namespace

AlignResult spiralSearch(Plant& plant, const Mechanism& mechanism,
                         const AlignParameters& parameters,
                         const std::function<void(const AlignProgress&)>& progress) {
  return Spiral(plant, mechanism, parameters, progress).run();
}

}  // namespace assembly_cell
