// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/strategies/edge_search.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "assembly_cell/align/search/free_peg.h"
#include "assembly_cell/align/strategies/search_area.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/mechanism/compliance.h"

namespace assembly_cell {
namespace {

using Vec2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;

// Attempts to put the low edge into the hole.
constexpr int kDrops = 8;
// More attempts for small pegs: a miss rules out a disc of kRuledOut radii around the place, and
// the hole is within kRegion of the start [m]. A peg of 25 mm radius gets none more, one of 3 mm
// 39. Beyond kLocated radii of standard deviation they go where no touch has ruled the hole out:
// estimates from touches of the face alone lead to places far off.
constexpr double kRuledOut = 0.8, kRegion = 0.015, kLocated = 0.5;
// Height of the peg's lowest point above the face before a descent [m].
constexpr double kOver = 3e-4;
// Speed of the approach over that of approach_step. A touch then reaches F_t + K v T + K v²/(2a) =
// 7 N, with F_t = 1.5 N, K = 30 N/mm, T = 20 ms, a = 1 m/s². With 1 a cycle takes 0.8 s longer,
// with twice of it the force is 14 N.
constexpr double kFaster = 1.5;
// Travel up within which a peg lifted out of the hole is expected to be free [m].
constexpr double kPullFree = 5e-4;
// Lateral distance below which two places count as the same [m].
constexpr double kSpot = 1e-4;
// A descent that ends without a touch is measured again at rest where Scale::sink times this
// exceeds Scale::length: a touch of the default cell sinks in by an eighth of kDeep.
constexpr double kSinks = 0.5;
// Depth of the peg's lowest point below the face that counts as inside the hole [m].
constexpr double kDeep = 4e-4;
// Standard deviation of where a move ends [m].
constexpr double kPlaceSd = 5e-5;
// Lateral force that counts as a wall [N].
constexpr double kPush = 0.75;
// Step towards a wall over approach_step. With half of it near starts take 0.35 s longer.
constexpr double kSidestep = 2.0;
// A push above kOverPush times kPush is reduced to kPushAfter times kPush.
constexpr double kOverPush = 2.0, kPushAfter = 1.5;
// Pegs that are stiffer or smaller by up to this factor take the same step towards a wall.
constexpr double kMoreGive = 2.0;
// Corrections of a push by a carrier that answers late.
constexpr int kAdjusts = 4;
// A wall's push decreases by at least this share when half of the travel into it is taken back.
constexpr double kYields = 0.1;
// Distance kept from a wall after it was measured [m].
constexpr double kBack = 3e-4;
// Strain of the coupling that counts as none [m].
constexpr double kSlack = 5e-6;
// Distance of the low edge behind the hole's centre when it is put down, least and greatest [m].
constexpr double kBehind = 2.5e-3, kFarthest = 6e-3;
// Greatest travel to a wall [m]. With two thirds of it, one in 20 of the starts within 15 mm at
// level 2 takes 1 s longer.
constexpr double kLost = 1.2e-2;
// The entry is tried up to this standard deviation of the centre, or up to BoreEntry::reach() if
// that is more [m]. With four times the reach, one in 20 of the starts within 15 mm at level 2
// takes 2.9 s longer.
constexpr double kEntrySd = 2e-4;
// Places without a wall, one after another, after which the touches count as misread.
constexpr int kWithoutWall = 2;
// Where the force at a zero isn't that of a free peg: height of a step up [m], and their number.
constexpr double kRaise = 2e-3;
constexpr int kHigher = 5;
// Touches whose chi2 per residual is greater are not of one plane.
constexpr double kContradict = 2.5;
// Time since the start after which an entry that fails may be refused as too tight, for a carrier
// without delay [s]. At level 2, 60 of 60 starts at 0.3 of a drawn clearance of 0.02 mm were in
// after 46 s. It is below the time limit.
constexpr double kEntryTime = 50.0;
// Standard deviations of the stated bound on an interference.
constexpr double kTightSds = 2.0;
// Entries refused by the hole after which it counts as probably smaller than the peg. Of 24 fits of
// 10 um at level 2 one was refused twice, none more often.
constexpr int kRefused = 5;
// Standard deviation of a clearance that counts as measured, over that of the drawing.
constexpr double kMeasured = 0.6;
// Standard deviations of the margins around the hole's estimated centre and height.
constexpr double kSure = 2.5;
// Lateral share of the force on a chamfer of 45 degrees: (1 - mu) / (1 + mu), 0.54 for mu = 0.3.
constexpr double kChamferPush = 0.5;
// An entry by the chamfer is tried again at this distance from one that failed, in chamfer widths.
constexpr double kElsewhere = 0.2;
// Blocks that a peg rests before a force is averaged, and blocks that are averaged.
constexpr int kRest = 2;
// Standard deviations of the lines of action of touches: of each, and of an offset common to all.
constexpr double kPointSd = 1e-3, kOffsetSd = 4e-3;  // [m]
// Least standard deviation of a line of action, by the sensor's noise [m].
constexpr double kMinPointSd = 2e-4;

// Compliance of the peg's bottom along a direction, the peg's axes along R. [m/N]
double softness(const SearchState& s, const Vec3& direction, const Mat3& R) {
  const Vec3 along = R.transpose() * direction;
  Eigen::Matrix<double, 1, 6> row;
  row << along.transpose(), Vec3(0, 0, -s.frame.length()).cross(along).transpose();
  return (row * couplingStiffness(s.mechanism.coupling).inverse() * row.transpose()).value();
}

// Mean of `value` over the latest block and n - 1 further ones.
template <class Value>
auto meanOver(GuardedCarrier& carrier, int n, const Value& value) {
  auto mean = (value() / n).eval();
  for (int i = 1; i < n; ++i) {
    carrier.wait(1);
    mean += value() / n;
  }
  return mean;
}

// Mean of `push` with the peg's bottom at p, at rest. [N]
template <class Push>
Vec2 pushAt(SearchState& s, const Vec3& p, const Mat3& R, const Push& push) {
  s.carrier.moveTo(s.frame.restFor(p, R), Move::kNearly);
  const int n = s.scale.timed(kRest);
  s.carrier.wait(n + 1);
  return meanOver(s.carrier, n, push);
}

// A touch whose line of action is nearer to the axis than the edge may be on two points of the rim,
// or on one point with a sensor in error. Fits both and returns the one with the smaller chi2 per
// residual.
TouchFit fitReadings(const TouchModel& model, const std::vector<TouchReading>& readings) {
  TouchFit best;
  std::string why;
  const bool ambiguous =
      std::any_of(readings.begin(), readings.end(), [](const auto& r) { return r.on_two; });
  for (const bool on_two : {false, true}) {
    if (on_two && !ambiguous) break;
    std::vector<TouchReading> as = readings;
    for (TouchReading& reading : as) {
      if (reading.on_two && on_two) reading.point.reset();
      reading.on_two = reading.on_two && on_two;
    }
    try {
      const TouchFit fit = fitTouches(model, as);
      if (best.residuals == 0 || fit.chi2 * best.residuals < best.chi2 * fit.residuals) best = fit;
    } catch (const InputError& error) {
      why = error.what();
    }
  }
  if (best.residuals == 0) throw AlignError(AlignFailure::kNoPlaneReading, why);
  return best;
}

// Centre of a hole in the region of starts that no touch has ruled out, in S. [m]
std::optional<Vec3> untouched(const EdgeSearch& edge, const SearchState& s) {
  std::vector<Vec2> touched;
  for (const TouchReading& reading : edge.readings) {
    if (reading.kind != TouchReading::kEdge) continue;
    const Vec3 axis = reading.X_SP.R.col(2);
    const Vec3 low = axis * axis.dot(s.hole.normal) - s.hole.normal;
    const Vec3 tip = reading.X_SP.p + tipRadius(s.mechanism.peg) * low.normalized();
    touched.push_back(tip.head<2>());
  }
  const double reach = kRuledOut * s.mechanism.hole.radius;
  const std::optional<Vec2> place =
      nextPlace(edge.model.start, kRegion, reach, touched, edge.bottom.head<2>());
  if (!place) return std::nullopt;
  const Vec3& n = s.hole.normal;
  return Vec3(place->x(), place->y(), (s.hole.height - n.head<2>().dot(*place)) / n.z());
}

}  // namespace

Mat3 tiltedTo(const Vec3& normal, double a, double tilt) {
  return rotationToAxis(normal) * tiltRotation(tilt * Vec2(-std::sin(a), std::cos(a)));
}

Vec3 toHole(const SearchState& s, const Vec3& bottom) {
  const Vec3 to = s.hole.center - bottom;
  return to - s.hole.normal * s.hole.normal.dot(to);
}

EdgeSearch::EdgeSearch(Search& search) : search_(search), s_(search.state) {
  model.peg = s_.mechanism.peg;
  model.hole = s_.mechanism.hole;
  model.position_sd *= s_.scale.travel;
  model.point_sd = std::max(kMinPointSd, kPointSd * s_.scale.length);
  model.offset_sd = kOffsetSd * s_.scale.length;
}

double moreDrops(const Mechanism& mechanism) {
  const double places = std::pow(kRegion / (kRuledOut * mechanism.peg.radius), 2);
  return 1.0 + std::floor(places) / kDrops;
}

void EdgeSearch::enterByWalls() {
  const int drops = static_cast<int>(std::lround(kDrops * moreDrops(s_.mechanism)));
  bool went_in = false;
  int without_wall = 0;  // one after another
  for (int i = 0; i < drops; ++i) {
    if (isFunnelled()) {
      funnelled_ = s_.hole.center;
      s_.report("enter", "the chamfer leads");
      if (search_.entry.enter(s_.hole.center, 1)) return;
      bottom = s_.target().p;
    }
    if (!drop(i)) {
      resolve();
      continue;
    }
    went_in = true;
    const bool met = walls();
    resolve();
    without_wall = met ? 0 : without_wall + 1;
    if (without_wall == kWithoutWall) {
      known = false;
      throw AlignError(AlignFailure::kNoPlaneReading,
                       text("no wall beside the edge, %d times where it went down without a touch",
                            kWithoutWall));
    }
    if (!met || s_.known.position_sd > std::max(kEntrySd, search_.entry.reach())) continue;
    if (search_.entry.enter(s_.hole.center)) return;
    bottom = s_.target().p;
    const double spent = s_.carrier.last().time - s_.start_time;
    const double slower = moreDrops(s_.mechanism) * s_.scale.time * s_.carrier.delay.longer();
    if (spent > kEntryTime * slower) refuseTooTight();
  }
  if (!went_in) {
    known = false;  // the estimate was wrong: a further attempt surveys again
    throw AlignError(AlignFailure::kNoHoleUnderEdge,
                     text("the edge was put down in %d places where the hole may be, and each time "
                          "touched the face",
                          drops));
  }
  refuseTooTight();
  throw AlignError(AlignFailure::kNotInserted, text("no entry after %d touches", s_.contacts));
}

void EdgeSearch::refuseTooTight() const {
  const Clearance& clearance = s_.known.clearance;
  const bool is_measured = clearance.sd < kMeasured * drawnClearance(s_.mechanism).sd;
  const bool is_refused = is_measured && search_.entry.refused >= kRefused;
  if (!known || clearance.mean > (is_refused ? kTightSds * clearance.sd : 0.0)) return;
  const double interference = kTightSds * clearance.sd - clearance.mean;
  throw AlignError(
      AlignFailure::kTooTight,
      text("no entry after %d touches, ", s_.contacts) +
          text("clearance %.0f +- %.0f um", clearance.mean * 1e6, clearance.sd * 1e6) +
          text(": the peg may be larger than the hole, by %.0f um of radius at most, or the "
               "carrier has as much backlash",
               interference * 1e6));
}

void EdgeSearch::add(const Touch& light) {
  TouchReading reading;
  reading.X_SP = light.X_SP;
  reading.sd = kPlaceSd;
  // on two points its line of action is between them; in a chamfer it always is
  const bool chamfered = s_.mechanism.hole.chamfer_width + s_.mechanism.peg.chamfer_width > 0.0;
  reading.on_two = !chamfered && !light.isSteep() && light.straddles();
  if (!light.isSteep() && !(chamfered && light.straddles())) reading.point = light.point;
  reading.lean = light.lean;
  readings.push_back(reading);
}

// Distance of the edge's lowest point below the bottom's centre, along the normal. [m]
double EdgeSearch::dip(const Mat3& R) const {
  const double up = s_.hole.normal.dot(R.col(2));
  return tipRadius(s_.mechanism.peg) * std::sqrt(std::max(0.0, 1.0 - up * up));
}

// Moves the free peg above a place and rotates it there. Takes the zero again if it is old, if the
// force isn't that of a free peg, or with a carrier that answers late.
void EdgeSearch::hover(const Vec3& place, const Mat3& R) {
  const Mat3 now = s_.frame.carrierPose(s_.carrier.target()).R;
  Vec3 up = s_.target().p;
  Vec3 over = place;
  if (s_.found) {
    const auto raise = [this](Vec3& p, double height) {
      p += s_.hole.normal * std::max(0.0, height - s_.hole.normal.dot(p) + s_.hole.height);
    };
    raise(up, dip(now) + kOver * s_.scale.travel);
    raise(over, dip(R) + kOver * s_.scale.travel);
    raise(up, s_.hole.normal.dot(over) - s_.hole.height);
    // straight up before it goes aside; without a lateral motion it may rotate while it rises
    if ((over - up).norm() > kSpot) s_.carrier.moveTo(s_.frame.restFor(up, now), Move::kFree);
  } else {
    const double turn = std::acos(std::clamp(R.col(2).dot(now.col(2)), -1.0, 1.0));
    over.z() = std::max(over.z(), up.z()) + tipRadius(s_.mechanism.peg) * turn;
  }
  s_.carrier.moveTo(s_.frame.restFor(over, R), Move::kFree);
  const ContactSensor& sensor = s_.carrier.sensor();
  // an arm that is late, or may be before its first descent, is still on its way
  const bool late =
      s_.carrier.delay.slowing() < 1.0 || (readings.empty() && s_.carrier.limits().arm_delay > 0.0);
  if (!late && !search_.touch.isTareOld() && sensor.heldForce() < sensor.freeForce()) return;
  search_.touch.tare();
  // the edge already rests on something
  for (int i = 0; sensor.tareShift() > sensor.freeShift(); ++i) {
    if (i == kHigher) {
      throw AlignError(AlignFailure::kNotFree,
                       text("%.1f N where the zero is taken, %.1f N are allowed",
                            sensor.tareShift(), sensor.freeShift()));
    }
    over.z() += kRaise * s_.scale.travel;
    s_.carrier.moveTo(s_.frame.restFor(over, R), Move::kFree);
    search_.touch.tare();
  }
}

void EdgeSearch::touch(const Mat3& R) {
  hover(bottom, R);
  const std::optional<Touch> light = search_.touch.lower(-1e9, kFaster);
  // a peg isn't rotated while the hole holds its edge
  if (light && light->isContact() && !known) search_.touch.refuseWedge(*light, R);
  if (light) keep(*light);
  bottom = s_.target().p;
  // an edge in the hole wedges there when it rotates or goes aside
  if (light && (light->straddles() || light->isBeyondEdge())) liftOut(R);
}

// Lifts the peg straight up until it is above the contact.
void EdgeSearch::liftOut(const Mat3& R) {
  const double travel = dip(R) + kOver * s_.scale.travel;
  const Pose peg = s_.peg();
  const RestPose up =
      pullUp(s_.carrier, s_.frame.restFor(peg.p, peg.R), kPullFree * s_.scale.travel, travel);
  s_.carrier.moveTo(
      s_.frame.restFor(s_.frame.pegPose(up, Vector6::Zero()).p + travel * s_.hole.normal, R),
      Move::kNearly);
}

void EdgeSearch::keep(const Touch& light) {
  if (!light.isContact()) return;
  add(light);
  ++s_.contacts;
  s_.report("touch", text("%.1f N, line of action %.1f mm from the axis", light.force,
                          light.point.norm() * 1e3));
}

void EdgeSearch::resolve() {
  // clearance measured between the bore's walls, if the peg has been in it
  model.hole.radius = s_.mechanism.peg.radius + search_.entry.clearance_prior.mean;
  model.radius_sd = search_.entry.clearance_prior.sd;
  const TouchFit fit = fitReadings(model, readings);
  if (!known && fit.chi2 > kContradict * fit.residuals) {
    throw AlignError(
        AlignFailure::kNoPlaneReading,
        text("touches contradict one another, chi2 %.0f of %d", fit.chi2, fit.residuals));
  }
  s_.hole.normal = fit.normal;
  s_.hole.height = fit.height;
  s_.hole.height_sd = fit.height_sd;
  s_.hole.normal_sd = fit.normal_sd;
  s_.hole.center = fit.center;
  s_.hole.center_covariance = fit.center_covariance;
  s_.known.clearance = {fit.radius - s_.mechanism.peg.radius, fit.radius_sd};
  search_.entry.place_variance = std::max(fit.place_variance, min_move_sd * min_move_sd);
  s_.found = true;
  s_.known.position_sd = std::sqrt(fit.center_covariance.trace());
  s_.known.rotation_sd = fit.normal_sd;
  s_.report("resolve",
            text("centre %.3f %.3f mm", holeOffset(s_).x() * 1e3, holeOffset(s_).y() * 1e3) +
                text(" +- %.3f mm, tilt sd %.3f deg", s_.known.position_sd * 1e3,
                     s_.known.rotation_sd * 180 / M_PI) +
                text(", clearance %.3f +- %.3f mm", s_.known.clearance.mean * 1e3,
                     s_.known.clearance.sd * 1e3) +
                text(", chi2 %.1f of %d", fit.chi2, fit.residuals));
}

// Whether the chamfers lead an upright peg into the hole: the centre is known to within their
// width, and the coupling yields below the force of a contact with the face. False near a place
// where such an entry has failed.
bool EdgeSearch::isFunnelled() const {
  const double width = s_.mechanism.hole.chamfer_width + s_.mechanism.peg.chamfer_width;
  const double yields = kChamferPush * search_.entry.maxForce() * sidewaysCompliance(s_.mechanism);
  const bool elsewhere = !funnelled_ || (s_.hole.center - *funnelled_).norm() > kElsewhere * width;
  return elsewhere && kSure * s_.known.position_sd < std::min(width, yields);
}

// Puts the low edge into the hole, or where it may be. False where it touches the face; the touch
// becomes a reading.
bool EdgeSearch::drop(int attempt) {
  const Eigen::Matrix<double, 3, 2> axes = planeAxes(s_.hole.normal);
  const double radius = s_.mechanism.hole.radius;
  const bool lost = kRuledOut * radius < kRegion && s_.known.position_sd > kLocated * radius;
  const std::optional<Vec3> unknown = lost ? untouched(*this, s_) : std::nullopt;
  const Vec3 centre = unknown.value_or(s_.hole.center);
  const Vec2 flat = axes.transpose() * (centre - bottom);
  if (attempt == 0 || flat.norm() > kFarthest * s_.scale.length)
    heading_ = std::atan2(flat.y(), flat.x());
  else
    heading_ += 0.5 * M_PI;
  const Vec3 ahead = axes * Vec2(std::cos(heading_), std::sin(heading_));
  const double sd =
      std::sqrt(std::max(0.0, ahead.head<2>().dot(s_.hole.center_covariance * ahead.head<2>())));
  // at a place that isn't an estimate the lowest point itself
  const double behind =
      unknown ? tipRadius(s_.mechanism.peg)
              : std::clamp(kSure * sd, kBehind * s_.scale.length, kFarthest * s_.scale.length);
  const Mat3 R = tiltedTo(s_.hole.normal, heading_, s_.p.contact_tilt);
  const double over = kOver * s_.scale.travel;
  const double deep =
      kDeep * s_.scale.length + chamferDepth(s_.mechanism.hole) + chamferHeight(s_.mechanism.peg);
  const Vec3 place = centre - behind * ahead + (dip(R) + over) * s_.hole.normal;
  hover(place, R);
  const Vec3 lowest = place - (over + deep + kSure * s_.hole.height_sd) * s_.hole.normal;
  std::optional<Touch> light = search_.touch.lower(s_.frame.restFor(lowest, R).z, kFaster);
  // a soft mount may sink in so far without a touch: measure at rest
  if (!light && kSinks * s_.scale.sink > s_.scale.length) {
    const Touch resting = search_.touch.measure();
    if (resting.isContact()) light = resting;
  }
  bottom = s_.target().p;
  if (light) {
    keep(*light);
    return false;
  }
  s_.report("drop", text("the low edge is in, %.1f mm from the centre", behind * 1e3));
  ahead_ = ahead;
  return true;
}

// Measures the wall ahead and those on both sides. False without a wall ahead: then the place where
// the low edge went down without a touch becomes a reading.
bool EdgeSearch::walls() {
  TouchReading free;
  free.kind = TouchReading::kFree;
  free.X_SP = s_.frame.pegPose(s_.carrier.target(), s_.freeDeflection());
  free.sd = kPlaceSd;
  const Vec3 left = s_.hole.normal.cross(ahead_);
  if (!wall(ahead_)) {
    readings.push_back(free);
    return false;
  }
  for (const Vec3& side : {left, Vec3(-left)}) {
    if (!wall(side)) break;
  }
  return true;
}

// Steps sideways until the wall pushes back. The position at zero force is extrapolated from two
// forces, which needs no stiffness. A wall also pushes a closely fitting edge across the direction;
// this deflection is corrected by the nominal stiffness.
bool EdgeSearch::wall(const Vec3& direction) {
  const Mat3 R = s_.frame.carrierPose(s_.carrier.target()).R;
  const Vec3 across = s_.hole.normal.cross(direction);
  const Vec3 from = relaxed(R);
  // of a slow swing one block is no mean
  const auto meanForce = [&] {
    return meanOver(s_.carrier, s_.scale.timed(1), [&] { return s_.carrier.force(); });
  };
  Vec3 zero = meanForce();
  const auto push = [&](const Vec3& axis) {
    return -axis.dot(s_.frame.carrierPose(s_.carrier.last().carrier).R *
                     (s_.carrier.force() - zero));
  };
  const double wanted = kPush * s_.scale.force;
  const double step = kSidestep * s_.p.approach_step * s_.carrier.delay.slowing() *
                      std::min({1.0, s_.scale.give * kMoreGive, s_.scale.length * kMoreGive});
  double moved = 0.0, pushed = 0.0, gentler = 0.0;
  Vec2 less = Vec2::Zero();
  while (pushed < wanted) {
    // in a small hole no wall is farther than its diameter
    if (moved > std::clamp(2.0 * s_.mechanism.hole.radius, kLost * s_.scale.length,
                           kLost * s_.scale.travel)) {
      s_.report("wall", "none within reach");
      bottom = s_.frame.pegPose(s_.carrier.last().carrier, Vector6::Zero()).p;
      s_.carrier.moveTo(s_.frame.restFor(bottom, R), Move::kNearly);
      return false;
    }
    moved += step;
    PlantCommand command;
    command.rest = s_.frame.restFor(from + moved * direction, R);
    s_.carrier.step(command);
    pushed = push(direction);
    if (pushed < wanted) continue;
    // measure at a push that hardly rotates the peg
    const auto isOver = [&] { return pushed > kOverPush * wanted; };
    // a late carrier moves on for a while
    const bool late = awaitEffect(s_.carrier);
    if (late) pushed = push(direction);
    for (int i = 0; i == 0 || (late && i < kAdjusts && (isOver() || pushed < wanted)); ++i) {
      if (isOver() || i > 0) {
        moved -= (pushed - kPushAfter * wanted) * softness(s_, direction, R);
      }
      pushed =
          pushAt(s_, from + moved * direction, R, [&] { return Vec2(push(direction), 0.0); }).x();
    }
    if (pushed < wanted) continue;
    gentler = moved - 0.5 * pushed * softness(s_, direction, R);
    less = pushAt(s_, from + gentler * direction, R,
                  [&] { return Vec2(push(direction), push(across)); });
    // a wall pushes half as much there, unless the peg sticks to it; a peg that swung when its zero
    // was taken seems to be pushed everywhere
    if (pushed - less.x() < kYields * pushed) {
      s_.carrier.moveTo(s_.frame.restFor(from, R), Move::kNearly);
      s_.carrier.wait(s_.scale.timed(kRest));
      zero = meanForce();
      s_.carrier.moveTo(s_.frame.restFor(from + moved * direction, R), Move::kNearly);
      pushed = 0.0;
    }
  }
  const double at = gentler - less.x() * (moved - gentler) / (pushed - less.x());
  const double led = -less.y() * softness(s_, across, R);
  TouchReading reading;
  reading.kind = TouchReading::kWall;
  reading.X_SP = s_.frame.pegPose(s_.frame.restFor(from + at * direction + led * across, R),
                                  s_.freeDeflection());
  reading.sd = kPlaceSd;
  readings.push_back(reading);
  ++s_.contacts;
  s_.report("wall", text("after %.2f mm, %.1f N", at * 1e3, pushed) +
                        text(", led aside by %.3f mm", led * 1e3));
  const Vec3 back = from + (at - kBack * s_.scale.length) * direction + led * across;
  s_.carrier.moveTo(s_.frame.restFor(back, R), Move::kNearly);
  bottom = s_.target().p;
  return true;
}

// Moves the carrier sideways once by the strain of the coupling, so that no wall strains it.
// Returns the bottom's centre there.
Vec3 EdgeSearch::relaxed(const Mat3& R) {
  Vec3 at = s_.target().p;
  s_.carrier.wait(s_.scale.timed(kRest));
  Vec3 strain = softness(s_, ahead_, R) *
                (s_.frame.carrierPose(s_.carrier.last().carrier).R * s_.carrier.force());
  strain -= s_.hole.normal * s_.hole.normal.dot(strain);
  if (strain.norm() < kSlack) return at;
  at += strain;
  s_.carrier.moveTo(s_.frame.restFor(at, R), Move::kNearly);
  s_.carrier.wait(s_.scale.timed(kRest));
  return at;
}

}  // namespace assembly_cell
