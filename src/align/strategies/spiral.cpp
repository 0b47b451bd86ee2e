// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <vector>

#include "assembly_cell/align/estimation/touch_fit.h"
#include "assembly_cell/align/search/search.h"
#include "assembly_cell/align/strategies/strategies.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

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
constexpr double kMinSlide = 0.3;  // force of the search at least [N]
constexpr double kQuarters = 3.0;  // of the peg's period in its coupling, over the hole
constexpr double kPassBlocks = 3.0;
constexpr double kLost = 0.5;        // of the force: less is a drop
constexpr double kFollow = 0.3;      // of the strain that the carrier takes out in a block
constexpr double kTurn = 0.3;        // in a block, in the middle [rad]
constexpr double kFarthest = 0.017;  // from where the search began: starts within 15 mm [m]
constexpr double kLean = 2e-3;  // of the peg on the face, beyond its rotation by the contact [rad]
constexpr double kOver = 3e-4;  // over the plane before the search [m]
constexpr double kDeep = 1e-3;  // below the plane: in the hole; no edge tilts by so much [m]
constexpr double kHeld = 0.8;   // sideways, of the force: no friction, an edge on the rim
constexpr int kDwell = 20;      // blocks on the spot
constexpr int kRest = 5;        // blocks
constexpr int kCatches = 200;   // that the edge may meet the rim before it drops
constexpr double kLift = 2e-3;  // over it then [m]
constexpr double kSkip = 2e-4;  // and behind it [m]
constexpr double kReportStep = 1e-3;  // of the radius, between two reports of progress [m]

// The strategy `spiral`, the usual baseline: level with the face, then along an Archimedean spiral
// under constant force until the peg drops, then down.
class Spiral {
 public:
  explicit Spiral(Search& search) : search_(search), s_(search.state) {}

  void find() {
    if (search_.begin()) return;
    const Vec3 start(0, 0, -s_.frame.length());
    Vec3 place = start;
    for (int k = 1;; ++k) {
      try {
        level(place);
        break;
      } catch (const AlignError& error) {
        // an edge over the hole is held there: levelled aside of it, searched about the start
        const bool held = error.failure == AlignFailure::kWedged ||
                          error.failure == AlignFailure::kForceLimit ||
                          error.failure == AlignFailure::kSensorSaturated ||
                          error.failure == AlignFailure::kNoPlaneReading;
        if (!held || k == kLevels) throw;
        s_.report("recover", error.what());
        search_.retreat.backOut(kFar * s_.scale.travel);
        place = s_.target().p + search_.retreat.nextOffset(s_.p.contact_tilt);
      }
    }
    slideToHole(start);
  }

 private:
  enum End { kDropped, kCaught, kOutside };

  // The tilted edge touches the face all round.
  void level(Vec3 place) {
    std::vector<TouchReading> readings;
    TouchModel model;
    model.peg = s_.mechanism.peg;
    model.hole = s_.mechanism.hole;
    for (int i = 0; i < kTouches; ++i) {
      const double a = 2 * M_PI * (i + (i < 3 ? 0.0 : 0.5)) / 3;
      const Mat3 R = tiltRotation(s_.p.contact_tilt * Vec2(-std::sin(a), std::cos(a)));
      // no point of the edge goes down by more than the radius times the rotation
      place.z() += 2.0 * tipRadius(s_.mechanism.peg) * s_.p.contact_tilt;
      s_.carrier.moveTo(s_.frame.restFor(place, R), Move::kNearly);
      s_.carrier.tare(2);
      const std::optional<Touch> light = search_.touch.lower(-1e9);
      place = s_.target().p;
      if (!light) continue;
      search_.touch.refuseWedge(*light, R);
      TouchReading reading;
      reading.X_SP = light->X_SP;
      reading.sd = kPlaceSd;
      reading.point = light->point;
      readings.push_back(reading);
      ++s_.contacts;
      s_.report("level", text("touch of %.1f N", light->force));
    }
    TouchFit fit;
    try {
      fit = fitTouches(model, readings);
    } catch (const InputError& error) {
      throw AlignError(AlignFailure::kNoPlaneReading, error.what());
    }
    s_.hole.normal = fit.normal;
    s_.hole.height = fit.height;
    s_.hole.height_sd = fit.height_sd;
    s_.hole.normal_sd = fit.normal_sd;
    s_.known.rotation_sd = fit.normal_sd;
    s_.report("level", text("tilt sd %.3f deg", fit.normal_sd * 180 / M_PI));
  }

  // Over a place of the search, free; takes the zero again.
  void hover(const Vec3& place, const Mat3& R) {
    s_.carrier.moveTo(s_.frame.restFor(place + kOver * s_.scale.travel * s_.hole.normal, R),
                      Move::kNearly);
    s_.carrier.tare(kRest);
  }

  // Along the spiral on the face until the peg drops.
  void slideToHole(const Vec3& start) {
    // on one point of the edge: a face that lies flat rocks
    const Mat3 R = rotationToAxis(s_.hole.normal) * tiltRotation({lean(), 0.0});
    const Vec3 foot = start - s_.hole.normal * (s_.hole.normal.dot(start) - s_.hole.height);
    Vec3 up = s_.target().p;
    up.z() += 2.0 * tipRadius(s_.mechanism.peg) * s_.p.contact_tilt;
    s_.carrier.moveTo(s_.frame.restFor(up, s_.frame.carrierPose(s_.carrier.target()).R),
                      Move::kNearly);
    s_.carrier.moveTo(s_.frame.restFor({foot.x(), foot.y(), std::max(up.z(), foot.z())}, R),
                      Move::kNearly);
    for (int caught = 0; caught <= kCatches; ++caught) {
      hover(placeAt(foot), R);
      const End end = slide(foot, R);
      if (end == kOutside) {
        throw AlignError(AlignFailure::kNoHoleUnderEdge,
                         text("the peg didn't drop within %.0f mm, caught %d times",
                              1e3 * kFarthest * s_.scale.travel, caught));
      }
      if (end == kDropped && dropped()) return;
      // an edge on the rim, which chamfers are for: over it, and on behind it
      s_.report("caught", text("%.2f mm from the start", 1e3 * pitch() * azimuth_));
      search_.retreat.backOut(kLift * s_.scale.travel);
      advance(kSkip);
    }
    throw AlignError(AlignFailure::kNotInserted,
                     text("the edge is caught everywhere, %d times", kCatches));
  }

  // Force of the search [N]. The face drags the peg behind its carrier and rotates it; once it
  // drops it springs back. More than the clearance would carry it over the hole.
  double force() const {
    const auto& stiffness = s_.mechanism.coupling.stiffness.diagonal;
    const double lag =
        s_.mechanism.friction.sliding_coefficient * sidewaysCompliance(s_.mechanism) +
        s_.mechanism.peg.radius * s_.frame.length() / std::min(stiffness(4), stiffness(5));
    const double clearance = s_.mechanism.hole.radius - s_.mechanism.peg.radius;
    return std::clamp(kLag * clearance / lag, kMinSlide * s_.scale.force,
                      kSlide * std::max(1.0, s_.scale.force));
  }
  // Speed along the spiral [m/s]. The turn that passes farthest from the hole's centre is over it
  // for as long as the peg needs to drop, some quarters of its period in the coupling, and for as
  // long as the carrier needs to stop.
  double speed() const {
    const double clearance = s_.mechanism.hole.radius - s_.mechanism.peg.radius;
    const double chord = 2.0 * clearance * std::sqrt(1.0 - 0.25 * kPitch * kPitch);
    const double quarter =
        0.5 * M_PI * std::sqrt(s_.mechanism.peg.mass / s_.mechanism.coupling.stiffness.diagonal(0));
    return chord / std::max(kQuarters * quarter, kPassBlocks * s_.block);
  }
  // Tilt of the peg [rad]: more than edge and friction rotate it back in its coupling.
  double lean() const {
    const double arm =
        s_.mechanism.peg.radius + s_.mechanism.friction.sliding_coefficient * s_.frame.length();
    const auto& stiffness = s_.mechanism.coupling.stiffness.diagonal;
    return kLean + force() * arm / std::min(stiffness(4), stiffness(5));
  }
  // Radius gained per radian. [m]
  double pitch() const {
    return kPitch * (s_.mechanism.hole.radius - s_.mechanism.peg.radius) / (2 * M_PI);
  }
  Vec3 placeAt(const Vec3& foot) const {
    const Vec2 at = pitch() * azimuth_ * Vec2(std::cos(azimuth_), std::sin(azimuth_));
    return foot + planeAxes(s_.hole.normal) * at;
  }
  void advance(double travel) {
    azimuth_ += std::min(kTurn, travel / (pitch() * std::hypot(1.0, azimuth_)));
  }
  // Depth of the peg's bottom under the face. [m]
  double below() const { return s_.hole.height - s_.hole.normal.dot(s_.peg().p); }

  // Down to the face and along the spiral. Where the force is gone, or the peg is held, it is
  // pushed on the spot, the carrier following the strain sideways: into the hole, or a tilted edge
  // dips.
  End slide(const Vec3& foot, const Mat3& R) {
    const double sink = kServo * pressCompliance(s_.mechanism);
    const double max_step = s_.p.approach_step * s_.scale.step;
    const int dwell = s_.scale.timed(kDwell);
    double height = kOver * s_.scale.travel;
    bool down = false, held = false;
    Vec3 aside = Vec3::Zero();
    for (int stays = 0; pitch() * azimuth_ < kFarthest * s_.scale.travel;) {
      const double measured = s_.hole.normal.dot(s_.frame.carrierPose(s_.carrier.last().carrier).R *
                                                 s_.carrier.force());
      const double lost = force() - measured;
      height -= lost > kLost * force() ? max_step : std::max(-max_step, sink * lost);
      if (down && stays == 0) advance(speed() * s_.block);
      s_.carrier.nudge(s_.frame.restFor(placeAt(foot) + aside + height * s_.hole.normal, R));
      down = down || measured > kLost * force();
      if (!down) continue;
      if (below() > kDeep * s_.scale.length) return kDropped;
      if (stays == 0) {
        held = s_.carrier.force().head<2>().norm() > kHeld * force();
        if (held || s_.hole.normal.dot(s_.frame.carrierPose(s_.carrier.last().carrier).R *
                                       s_.carrier.force()) < kLost * force()) {
          stays = dwell;
        }
      } else {
        aside += kFollow * strain();
        if (--stays == 0) {
          if (held) return kCaught;
          aside.setZero();
        }
      }
      reportProgress();
    }
    return kOutside;
  }

  // Strain of the coupling at the peg's bottom, along the face. [m]
  Vec3 strain() const {
    const RestPose& carrier = s_.carrier.last().carrier;
    const Vec3 strain =
        s_.frame.pegPose(carrier, s_.deflection()).p - s_.frame.pegPose(carrier, Vector6::Zero()).p;
    return strain - s_.hole.normal * s_.hole.normal.dot(strain);
  }

  void reportProgress() {
    if (pitch() * azimuth_ < kReportStep * (reports_ + 1)) return;
    ++reports_;
    s_.report("search", text("%.0f mm from the start, %.1f N", 1e3 * pitch() * azimuth_,
                             s_.carrier.force().z()));
  }

  // Whether the peg is in after a drop, or its edge has only tilted over the rim: upright over the
  // place and down, as in every strategy.
  bool dropped() {
    s_.carrier.wait(s_.scale.timed(kRest));
    const Vec3 peg = s_.peg().p;
    ++s_.contacts;
    s_.report("drop", text("%.2f mm below the face", below() * 1e3));
    return search_.entry.enter(peg + below() * s_.hole.normal);
  }

  Search& search_;
  SearchState& s_;
  double azimuth_ = 0.0;  // on the spiral [rad]
  int reports_ = 0;       // of progress
};

}  // namespace

AlignResult spiralSearch(Plant& plant, const Mechanism& mechanism,
                         const AlignParameters& parameters, const ProgressCallback& progress) {
  Search search(plant, mechanism, parameters, progress);
  Spiral spiral(search);
  return search.run([&] { spiral.find(); },
                    [&](AlignResult& result) { summariseHole(search.state, result); });
}

}  // namespace assembly_cell
