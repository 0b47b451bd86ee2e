// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/strategies/edge_search.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

constexpr int kDrops = 8;  // tries to put the low edge into the hole
// And one for every place that a miss rules out, a disc of 0.8 radii, as far as the hole may be:
// none more for 25 mm, 39 for 3 mm.
constexpr double kRuledOut = 0.8, kMayBe = 0.015;  // [m]
constexpr double kOver = 3e-4;       // lowest point over the plane before a descent [m]
constexpr double kPullFree = 5e-4;   // of a peg that nothing holds [m]
constexpr double kSpot = 1e-4;       // aside that is on the spot [m]
constexpr double kSinks = 0.5;       // of scale: a light touch's travel is a quarter of kDeep
constexpr double kDeep = 4e-4;       // lowest point below the plane, inside [m]
constexpr double kPlaceSd = 5e-5;    // of where a move ends [m]
constexpr double kPush = 0.75;       // sideways: a wall [N]
constexpr double kSidestep = 1e-4;   // of the way to a wall, in one block [m]
constexpr double kMoreGive = 2.0;    // harder or smaller by that, it is the same
constexpr double kYields = 0.1;      // of a push, when half of the way into it is taken back
constexpr double kBack = 3e-4;       // off a wall again [m]
constexpr double kSlack = 5e-6;      // strain that is none [m]
constexpr int kRelaxes = 3;          // ways that the carrier follows
constexpr double kBehind = 2.5e-3;   // low edge inside by so much at least when put down [m]
constexpr double kFarthest = 6e-3;   // and at most [m]
constexpr double kLost = 8e-3;       // way to a wall at most [m]
constexpr double kHopeless = 4.0;    // sd over what an entry looks through: one in thirty gets in
constexpr double kRaise = 2e-3;      // where the zero isn't that of a free peg [m]
constexpr int kHigher = 5;           // times
constexpr double kContradict = 2.5;  // chi2 per residual of touches that are of no plane
constexpr double kSure = 2.5;        // deviations
// A chamfer of 45 degrees pushes aside by (1 - mu) / (1 + mu) of the force on it, 0.54 at 0.3.
constexpr double kGives = 0.5;
constexpr double kElsewhere = 0.2;  // of the chamfer, from where it was tried in vain
constexpr int kRest = 2;            // blocks
constexpr double kPointSd = 1e-3, kOffsetSd = 4e-3;  // of the lines of action [m]
constexpr double kLeastPointSd = 2e-4;               // by the sensor's noise [m]

}  // namespace

EdgeSearch::EdgeSearch(Plant& plant, const Mechanism& mechanism, const AlignParameters& p,
                       const Progress& progress)
    : Search(plant, mechanism, p, progress) {
  model_.peg = mechanism.peg;
  model_.hole = mechanism.hole;
  model_.position_sd *= scale_.room;
  model_.point_sd = std::max(kLeastPointSd, kPointSd * scale_.length);
  model_.offset_sd = kOffsetSd * scale_.length;
}

void EdgeSearch::feelIn() {
  const double places = std::pow(kMayBe / (kRuledOut * mechanism_.peg.radius), 2);
  const int drops = kDrops + static_cast<int>(places);
  for (int i = 0; i < drops; ++i) {
    if (isFunnelled()) {
      funnelled_ = hole_.center;
      report("enter", "the chamfer leads");
      if (enter(hole_.center, 1)) return;
      bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
    }
    if (!drop(i)) {
      resolve();
      continue;
    }
    const bool met = walls();
    resolve();
    if (!met || position_sd_ > kHopeless * std::max(kPlaceSd, enterReach())) continue;
    if (enter(hole_.center)) return;
    bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
  }
  throw AlignError(AlignFailure::kNotInserted,
                   text("no entry after %.0f touches", static_cast<double>(contacts_)));
}

void EdgeSearch::remember(const Touch& light) {
  TouchReading reading;
  reading.X_SP = light.X_SP;
  reading.sd = kPlaceSd;
  // on two points, as in a cone, its line of action is between them
  const bool chamfered = mechanism_.hole.chamfer_width + mechanism_.peg.chamfer_width > 0.0;
  if (!light.steep() && !(chamfered && light.straddles())) reading.point = light.point;
  reading.lean = light.lean;
  readings_.push_back(reading);
}

// low side at azimuth a
Mat3 EdgeSearch::tilted(const Vec3& normal, double a, double tilt) {
  return rotationToAxis(normal) * tiltRotation(tilt * Vec2(-std::sin(a), std::cos(a)));
}

// lowest point of the edge under the bottom's centre, along the normal [m]
double EdgeSearch::dip(const Mat3& R) const {
  const double up = hole_.normal.dot(R.col(2));
  return tipRadius(mechanism_.peg) * std::sqrt(std::max(0.0, 1.0 - up * up));
}

// over a place and turned there, free; the zero taken anew
void EdgeSearch::hover(const Vec3& place, const Mat3& R) {
  const Mat3 now = (inverse(X_BS_) * poseFromRest(press_.target())).R;
  Vec3 up = pegPose(press_.target(), Vector6::Zero()).p;
  Vec3 over = place;
  if (found_) {
    const auto raise = [this](Vec3& p, double height) {
      p += hole_.normal * std::max(0.0, height - hole_.normal.dot(p) + hole_.height);
    };
    raise(up, dip(now) + kOver * scale_.room);
    raise(over, dip(R) + kOver * scale_.room);
    raise(up, hole_.normal.dot(over) - hole_.height);
    // straight up before it goes aside; on the spot it may turn while it rises
    if ((over - up).norm() > kSpot) press_.moveTo(restFor(up, now), false);
  } else {
    const double turn = std::acos(std::clamp(R.col(2).dot(now.col(2)), -1.0, 1.0));
    over.z() = std::max(over.z(), up.z()) + tipRadius(mechanism_.peg) * turn;
  }
  press_.moveTo(restFor(over, R), false);
  press_.tare(2);
  // the edge already rests on something
  for (int i = 0; press_.tareShift() > press_.freeShift(); ++i) {
    if (i == kHigher) {
      throw AlignError(AlignFailure::kNotFree,
                       text("%.1f N where the zero is taken, %.1f N are allowed",
                            press_.tareShift(), press_.freeShift()));
    }
    over.z() += kRaise * scale_.room;
    press_.moveTo(restFor(over, R), false);
    press_.tare(2);
  }
}

// one touch from above at the present place
void EdgeSearch::touch(const Mat3& R) {
  hover(bottom_, R);
  const std::optional<Touch> light = lightTouch(-1e9);
  // nothing is turned in a hole that holds the edge
  if (light && light->felt() && !known_) refuseWedge(*light, R);
  if (light) keep(*light);
  bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
  // an edge that both sides of the hole carry wedges there when it turns
  if (light && light->straddles()) liftOut(R);
}

// straight up until it is over what it has touched
void EdgeSearch::liftOut(const Mat3& R) {
  const double travel = dip(R) + kOver * scale_.room;
  const Pose peg = pegPose(press_.last().carrier, deflection());
  const RestPose up = press_.pull(restFor(peg.p, peg.R), kPullFree * scale_.room, travel);
  press_.moveTo(restFor(pegPose(up, Vector6::Zero()).p + travel * hole_.normal, R), false);
}

void EdgeSearch::keep(const Touch& light) {
  if (!light.felt()) return;
  remember(light);
  ++contacts_;
  report("touch", text("%.1f N, line of action %.1f mm from the axis", light.force,
                       light.point.norm() * 1e3));
}

void EdgeSearch::resolve() {
  TouchFit fit;
  try {
    fit = fitTouches(model_, readings_);
  } catch (const InputError& error) {
    throw AlignError(AlignFailure::kNoPlaneReading, error.what());
  }
  if (!known_ && fit.chi2 > kContradict * fit.residuals) {
    throw AlignError(
        AlignFailure::kNoPlaneReading,
        text("touches contradict one another, chi2 %.0f of %.0f", fit.chi2, fit.residuals));
  }
  hole_.normal = fit.normal;
  hole_.height = fit.height;
  hole_.height_sd = fit.height_sd;
  hole_.normal_sd = fit.normal_sd;
  hole_.center = fit.center;
  hole_.center_covariance = fit.center_covariance;
  place_variance_ = placeVarianceOf(fit);
  found_ = true;
  position_sd_ = std::sqrt(fit.center_covariance.trace());
  rotation_sd_ = fit.normal_sd;
  report("resolve",
         text("centre %.3f %.3f mm", offset().x() * 1e3, offset().y() * 1e3) +
             text(" +- %.3f mm, tilt sd %.3f deg", position_sd_ * 1e3, rotation_sd_ * 180 / M_PI) +
             text(", chi2 %.1f of %.0f", fit.chi2, fit.residuals));
}

// The hole is known so well that chamfers lead an upright peg into it, and the coupling gives way
// before that feels like a face; and not where that was tried in vain.
bool EdgeSearch::isFunnelled() const {
  const double width = mechanism_.hole.chamfer_width + mechanism_.peg.chamfer_width;
  const double gives = kGives * insertionForce() * sidewaysCompliance(mechanism_);
  const bool elsewhere = !funnelled_ || (hole_.center - *funnelled_).norm() > kElsewhere * width;
  return elsewhere && kSure * position_sd_ < std::min(width, gives);
}

// the low edge into the hole; what is touched instead is kept
bool EdgeSearch::drop(int turn) {
  Vec3 to = hole_.center - bottom_;
  to -= hole_.normal * hole_.normal.dot(to);
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(hole_.normal);
  const Vec2 flat = axes.transpose() * to;
  if (turn == 0 || flat.norm() > kFarthest * scale_.length)
    heading_ = std::atan2(flat.y(), flat.x());
  else
    heading_ += 0.5 * M_PI;
  const Vec3 ahead = axes * Vec2(std::cos(heading_), std::sin(heading_));
  const double sd =
      std::sqrt(std::max(0.0, ahead.head<2>().dot(hole_.center_covariance * ahead.head<2>())));
  const double behind = std::clamp(kSure * sd, kBehind * scale_.length, kFarthest * scale_.length);
  const Mat3 R = tilted(hole_.normal, heading_, p_.contact_tilt);
  const double over = kOver * scale_.room;
  const double deep =
      kDeep * scale_.length + chamferDepth(mechanism_.hole) + chamferHeight(mechanism_.peg);
  const Vec3 place = hole_.center - behind * ahead + (dip(R) + over) * hole_.normal;
  hover(place, R);
  const Vec3 lowest = place - (over + deep + kSure * hole_.height_sd) * hole_.normal;
  std::optional<Touch> light = lightTouch(restFor(lowest, R).z);
  // what sinks in by about so much before it is a touch may rest on the face: felt at rest
  if (!light && kSinks * scale_.sink > scale_.length) {
    const Touch resting = feel();
    if (resting.felt()) light = resting;
  }
  bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
  if (light) {
    keep(*light);
    return false;
  }
  report("drop", text("the low edge is in, %.1f mm from the centre", behind * 1e3));
  ahead_ = ahead;
  return true;
}

// Against the wall ahead and on both sides; false: not even one ahead, so that the place where
// the low edge went down is all that was learnt.
bool EdgeSearch::walls() {
  TouchReading free;
  free.kind = TouchReading::kFree;
  free.X_SP = pegPose(press_.target(), hangingFree());
  free.sd = kPlaceSd;
  const Vec3 left = hole_.normal.cross(ahead_);
  if (!wall(ahead_)) {
    readings_.push_back(free);
    return false;
  }
  for (const Vec3& way : {left, Vec3(-left)}) {
    if (!wall(way)) break;
  }
  return true;
}

// Steps sideways until the wall pushes back; the place without force by two forces, which needs
// no stiffness. Across the way the wall leads a low edge that fits it closely: what that strains
// the coupling by counts, by the drawn stiffness.
bool EdgeSearch::wall(const Vec3& way) {
  const Mat3 R = (inverse(X_BS_) * poseFromRest(press_.target())).R;
  const Vec3 across = hole_.normal.cross(way);
  const Vec3 from = relaxed(R);
  const Vec3 zero = press_.force();
  const auto push = [&](const Vec3& axis) {
    return -axis.dot(carrierPose().R * (press_.force() - zero));
  };
  const double wanted = kPush * scale_.force;
  const double step =
      kSidestep * std::min({1.0, scale_.give * kMoreGive, scale_.length * kMoreGive});
  double moved = 0.0, felt = 0.0, gentler = 0.0;
  Vec2 less = Vec2::Zero();
  while (felt < wanted) {
    // no wall of a small hole is farther than across it
    if (moved >
        std::clamp(2.0 * mechanism_.hole.radius, kLost * scale_.length, kLost * scale_.room)) {
      report("wall", "none within reach");
      bottom_ = pegPose(press_.last().carrier, Vector6::Zero()).p;
      press_.moveTo(restFor(bottom_, R), false);
      return false;
    }
    moved += step;
    PlantCommand command;
    command.rest = restFor(from + moved * way, R);
    press_.step(command);
    felt = push(way);
    if (felt < wanted) continue;
    felt = pushedAt(from + moved * way, R, [&] { return Vec2(push(way), 0.0); }).x();
    if (felt < wanted) continue;
    gentler = moved - 0.5 * felt * softness(way, R);
    less = pushedAt(from + gentler * way, R, [&] { return Vec2(push(way), push(across)); });
    // a wall pushes half as much there; a swing of the peg doesn't know where it is
    if (felt - less.x() < kYields * felt) felt = 0.0;
  }
  const double at = gentler - less.x() * (moved - gentler) / (felt - less.x());
  const double led = -less.y() * softness(across, R);
  TouchReading reading;
  reading.kind = TouchReading::kWall;
  reading.X_SP = pegPose(restFor(from + at * way + led * across, R), hangingFree());
  reading.sd = kPlaceSd;
  readings_.push_back(reading);
  ++contacts_;
  report("wall",
         text("after %.2f mm, %.1f N", at * 1e3, felt) + text(", led aside by %.3f mm", led * 1e3));
  const Vec3 back = from + (at - kBack * scale_.length) * way + led * across;
  press_.moveTo(restFor(back, R), false);
  bottom_ = pegPose(press_.target(), Vector6::Zero()).p;
  return true;
}

// Where the carrier has followed the peg sideways, so that no wall strains the coupling.
Vec3 EdgeSearch::relaxed(const Mat3& R) {
  Vec3 at = pegPose(press_.target(), Vector6::Zero()).p;
  press_.wait(timed(kRest));
  for (int i = 0; i < kRelaxes; ++i) {
    Vec3 strain = softness(ahead_, R) * (carrierPose().R * press_.force());
    strain -= hole_.normal * hole_.normal.dot(strain);
    if (strain.norm() < kSlack) break;
    at += strain;
    press_.moveTo(restFor(at, R), false);
    press_.wait(timed(kRest));
  }
  return at;
}

Vec2 EdgeSearch::pushedAt(const Vec3& p, const Mat3& R, const std::function<Vec2()>& push) {
  press_.moveTo(restFor(p, R));
  const int n = timed(kRest);
  press_.wait(n);
  Vec2 sum = Vec2::Zero();
  for (int i = 0; i < n; ++i) {
    press_.wait(1);
    sum += push() / n;
  }
  return sum;
}

// travel of the peg's bottom for a force on it [m/N]
double EdgeSearch::softness(const Vec3& way, const Mat3& R) const {
  const Vec3 along = R.transpose() * way;
  Eigen::Matrix<double, 1, 6> row;
  row << along.transpose(), Vec3(0, 0, -length_).cross(along).transpose();
  return (row * couplingStiffness(mechanism_.coupling).inverse() * row.transpose()).value();
}

Vec2 EdgeSearch::offset() const {
  return (rotationToAxis(hole_.normal).transpose() * (hole_.center - Vec3(0, 0, -length_)))
      .head<2>();
}

}  // namespace assembly_cell
