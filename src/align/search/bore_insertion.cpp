// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/bore_insertion.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

using Vec3 = Eigen::Vector3d;

constexpr double kFollow = 0.3;     // of the coupling's strain that the carrier takes out a block
constexpr double kStuckTime = 0.4;  // without a step down [s]
constexpr double kProgress = 5e-5;  // that is a step down [m]
constexpr double kBackOut = 1e-3;   // the first time, then twice as far each time [m]
// Part of the depth that a jammed peg is pulled up by at most, and that it may spring back by when
// it comes free: it stays in the hole.
constexpr double kStaysIn = 0.5;
// Force down that is allowed at any depth, three touches: more than the drift of the sensor's zero.
constexpr double kLeastForce = 4.5;     // [N]
constexpr double kPullOfLimit = 0.6;    // of the force limit, on the path out
constexpr double kPullFraction = 0.25;  // of that pull, in one block
constexpr double kRelaxTime = 0.2;      // between a motion up and the next one down [s]
constexpr double kOut = 2e-3;           // above the face is out of the hole [m]
constexpr double kSlower = 4.0;         // default time limit over the time without resistance
constexpr int kBackOuts = 6;            // before the insertion is jammed
constexpr double kProfileStep = 1e-3;   // [m]
// Samples of the curve: 82 s of an insertion, whose descent of 40 mm takes 5 s. A longer one has
// every second sample, and so on: half as many would begin with that at 41 s.
constexpr std::size_t kSamples = 4096;

constexpr double kContactForce = 0.3;  // of a bore-wall contact; lengths and forces as Scale's [N]
constexpr double kLeverArm = 5e-3;     // of the mouth, at least, to separate two contacts [m]
constexpr double kFloorForce = 5.0;    // along the axis: perhaps the floor [N]
constexpr double kFloorStep = 2.0;     // force of a block's step near the drawn floor [N]
constexpr double kNear = 2e-3;         // over the drawn floor [m]
constexpr double kDrawn = 1e-3;        // tolerance of the drawn floor [m]
constexpr double kLift = 2e-4;         // off the floor and down again [m]
constexpr double kSlack = 2.0;         // or of the coupling's strain, where that is more
constexpr double kReleased = 0.3;      // of the force, after the lift: less
constexpr double kPressStep = 0.5;     // force of a block's step on the path back [N]
constexpr double kSame = 5e-5;         // the floor twice [m]
constexpr double kFloorStiffness = 0.5;  // of that of a press on the peg's edge, at least
constexpr double kMachine = 1e-5;        // compliance of a carrier of mismatch level 3 [m/N]
constexpr double kRestForce = 1.0;       // on the floor at the end [N]
constexpr int kMeanBlocks = 5;
constexpr int kEaseBlocks = 50;

// Least depth that may be the floor. [m]
double minFloor(const Mechanism& mechanism, const Scale& scale) {
  return mechanism.hole.depth - kDrawn * scale.travel;
}

// Takes samples of the curve until the end of a scope, however it ends.
struct Sampling {
  explicit Sampling(int& every) : every_(every) { every_ = 1; }
  ~Sampling() { every_ = 0; }
  Sampling(const Sampling&) = delete;
  Sampling& operator=(const Sampling&) = delete;
  int& every_;
};

}  // namespace

// One block in the bore: by `down` along the peg's axis, the carrier following the coupling's
// strain sideways and in tilt about the peg's end, so that the walls lead the peg and not the
// estimate of their position. Returns the measurement at the block's end.
BoreReading BoreInsertion::move(double down) {
  const RestPose& carrier = s_.carrier.last().carrier;
  const Vector6 strained = s_.deflection();
  const Vec3 axis = X_SP_.R.col(2);
  Vec3 aside =
      s_.frame.pegPose(carrier, strained).p - s_.frame.pegPose(carrier, s_.hanging.deflection).p;
  aside -= axis * axis.dot(aside);
  Vec3 rotation = s_.frame.carrierPose(carrier).R * (strained - s_.hanging.deflection).tail<3>();
  rotation -= axis * axis.dot(rotation);
  // an integrator whose input is n blocks late is stable below 2 sin(pi / (4 n + 2))
  const double follow = kFollow * s_.carrier.delay.slowing();
  X_SP_.p += follow * aside - down * axis;
  X_SP_.R = rotationFromVector({Vec3(follow * rotation)}) * X_SP_.R;
  PlantCommand command;
  command.rest = s_.frame.restFor(X_SP_.p, X_SP_.R);
  s_.carrier.step(command);

  const Vector6 d = s_.deflection();
  const Vector6 wrench =
      s_.frame.tipWrench(s_.carrier.last().carrier, s_.carrier.sensor().wrench(), d);
  const Pose peg = s_.frame.pegPose(s_.carrier.last().carrier, d);
  BoreReading measured;
  measured.depth = s_.hole.height - s_.hole.normal.dot(peg.p);
  measured.along = wrench(2);
  measured.sideways = wrench.head<2>().norm();
  measured.moment = wrench.segment<2>(3).norm();
  measured.walls = wallContacts(wrench, measured.depth);
  s_.inserted.force = std::max(s_.inserted.force, measured.force());
  s_.inserted.end = measured;
  if (every_ > 0) sample(measured, peg);
  return measured;
}

// Into the curve, without allocation.
void BoreInsertion::sample(const BoreReading& measured, const Pose& X_SP) {
  if (++sampled_ < every_) return;
  sampled_ = 0;
  Curve& curve = s_.inserted.curve;
  if (curve.size() == kSamples) {
    curve.thin();
    every_ *= 2;
  }
  const Vec3 axis = X_SP.R.col(2);
  curve.add({s_.carrier.last().time - s_.start_time, measured.depth, measured.along,
             measured.sideways, measured.moment,
             std::atan2(axis.cross(s_.hole.normal).norm(), axis.dot(s_.hole.normal))});
}

// Contacts of the bore at the peg's end, at the mouth or at both: at the mouth the moment about the
// end over the depth, at the end the rest of the force.
int BoreInsertion::wallContacts(const Vector6& wrench, double depth) const {
  const double min_force = kContactForce * s_.scale.force;
  if (depth < kLeverArm * s_.scale.length) return wrench.head<2>().norm() > min_force ? 1 : 0;
  const Eigen::Vector2d mouth = Eigen::Vector2d(wrench(4), -wrench(3)) / depth;
  const Eigen::Vector2d end = wrench.head<2>() - mouth;
  return (mouth.norm() > min_force ? 1 : 0) + (end.norm() > min_force ? 1 : 0);
}

// Last measured force against a motion down (1) or up (-1), sideways included. [N]
double BoreInsertion::opposing(double direction) const {
  return std::hypot(std::max(0.0, direction * s_.inserted.end.along), s_.inserted.end.sideways);
}

// As many as the carrier needs to follow for that time, see move().
int BoreInsertion::blocksToFollow(double time) const {
  return static_cast<int>(std::lround(s_.blocks(time) / s_.carrier.delay.slowing()));
}

void BoreInsertion::backOut(double travel) { pullUp(travel, kPullOfLimit * s_.p.force_limit); }

// Up by `travel` [m], or as far as `pull` [N] takes the peg, then until the walls relax.
void BoreInsertion::pullUp(double travel, double pull) {
  // a measurement is a block and a half late
  const double slow = s_.carrier.delay.slowing();
  const double step =
      std::min(s_.p.insert.speed * s_.block,
               slow * kPullFraction * pull / s_.mechanism.coupling.stiffness.diagonal(0));
  const double from = s_.inserted.end.depth;
  double min_depth = from;
  for (int waited = 0; from - s_.inserted.end.depth < travel && waited < blocksToFollow(kStuckTime);
       ++waited) {
    move(-step * std::clamp(1.0 - opposing(-1.0) / pull, -0.5, 1.0));
    if (s_.inserted.end.depth > min_depth - kProgress) continue;
    min_depth = s_.inserted.end.depth;
    waited = 0;
  }
  for (int i = 0; i < blocksToFollow(kRelaxTime); ++i) move(0.0);
}

// slow: CarrierDelay::slowing(), 1 for a prompt carrier
BoreInsertion::Descent BoreInsertion::descent(double slow) const {
  const InsertParameters& p = s_.p.insert;
  // against a floor no more in one block than the force that stops the peg
  const double step =
      std::min(p.speed * s_.block, slow * p.force / s_.mechanism.coupling.stiffness.diagonal(0));
  const double careful =
      std::min(step, slow * kFloorStep * s_.scale.force * pressCompliance(s_.mechanism));
  const double near = s_.mechanism.hole.depth - kNear * s_.scale.travel;
  return {step, p.floor ? careful : step, near};
}

double BoreInsertion::defaultTime() const {
  const Descent down = descent(1.0);
  const double goal = s_.p.insert.goal(s_.mechanism.hole.depth);
  const double far = std::clamp(down.near, 0.0, goal);
  const double blocks = far / down.step + (goal - far) / down.careful;
  return std::max(s_.p.default_insert_time, kSlower * blocks * s_.block);
}

// Force against the motion down at this depth. [N]
double BoreInsertion::maxForce() const {
  const double strained =
      kStaysIn * s_.inserted.end.depth * s_.mechanism.coupling.stiffness.diagonal(0);
  return std::min(s_.p.insert.force, std::max(kLeastForce * s_.scale.force, strained));
}

// Down until the depth is reached, the peg is stuck or a force resists where the floor may be.
BoreInsertion::End BoreInsertion::lower() {
  const InsertParameters& p = s_.p.insert;
  const Descent down = descent(s_.carrier.delay.slowing());
  const int patience = blocksToFollow(kStuckTime);
  if (!p.floor && s_.inserted.end.depth >= p.depth) return End::kDeep;  // from the start
  double deepest = -1e9;
  for (int waited = 0; waited < patience; ++waited) {
    const double fraction = std::clamp(1.0 - opposing(1.0) / maxForce(), -0.5, 1.0);
    const BoreReading measured =
        move((s_.inserted.end.depth > down.near ? down.careful : down.step) * fraction);
    if (measured.depth > deepest + kProgress) {
      deepest = measured.depth;
      waited = 0;
    }
    const double mark = kProfileStep * static_cast<double>(s_.inserted.profile.size());
    if (measured.depth >= mark) {
      s_.inserted.profile.push_back(measured);
      s_.report("insert", text("%.1f mm deep, %.1f N", measured.depth * 1e3, measured.force()));
    }
    // farther up it's the swing of a heavy peg, or walls
    if (p.floor && measured.depth > minFloor(s_.mechanism, s_.scale) &&
        measured.along > std::min(kFloorForce * s_.scale.force, 0.5 * p.force)) {
      return End::kResisted;
    }
    if (!p.floor && measured.depth >= p.depth) return End::kDeep;
    if (p.floor && measured.depth > s_.mechanism.hole.depth + kDrawn * s_.scale.travel) {
      throw AlignError(AlignFailure::kNotSeated,
                       text("no floor detected down to %.2f mm, the drawing has it at %.2f mm",
                            measured.depth * 1e3, s_.mechanism.hole.depth * 1e3));
    }
  }
  return End::kStuck;
}

// Mean over some blocks, at rest.
BoreReading BoreInsertion::measure() {
  for (int i = 0; i < blocksToFollow(kRelaxTime); ++i) move(0.0);
  BoreReading mean;
  for (int i = 0; i < kMeanBlocks; ++i) {
    const BoreReading measured = move(0.0);
    mean.depth += measured.depth / kMeanBlocks;
    mean.along += measured.along / kMeanBlocks;
    mean.sideways += measured.sideways / kMeanBlocks;
    mean.moment += measured.moment / kMeanBlocks;
  }
  return mean;
}

// Off the resistance and on it again: whether it is as high as before, and as stiff as a press on
// the peg's edge. Friction of walls holds a peg on the path up, too, and yields on the path down.
bool BoreInsertion::pressAgain(const BoreReading& pressed) {
  const double compliance = pressCompliance(s_.mechanism);
  const double lift = std::max(kLift * s_.scale.travel, kSlack * pressed.along * compliance);
  const double step = kPressStep * s_.scale.force * compliance * s_.carrier.delay.slowing();
  for (double up = 0.0; up < lift; up += step) move(-step);
  const BoreReading free = measure();
  if (std::abs(free.along) > kReleased * pressed.along) return false;
  const double touches = free.along + kReleased * (pressed.along - free.along);
  double down = 0.0, before = 0.0, rise = 0.0, travel = 0.0;
  for (const double max_travel = 2.0 * lift + pressed.along * compliance;
       s_.inserted.end.along < pressed.along;) {
    if (down > max_travel) return false;
    before = s_.inserted.end.along;
    move(step);
    down += step;
    if (before < touches) continue;
    rise += s_.inserted.end.along - before;
    travel += step;
  }
  s_.report("floor", text("again at %.3f mm after %.3f mm", s_.inserted.end.depth * 1e3,
                          pressed.depth * 1e3) +
                         text(", %.0f N/mm of %.0f", travel > 0.0 ? 1e-3 * rise / travel : 0.0,
                              1e-3 / compliance));
  if (!(travel > 0.0 && rise * (compliance + kMachine) > kFloorStiffness * travel)) return false;
  const auto same = [&](const BoreReading& reading) {
    return std::abs(reading.depth - pressed.depth) < kSame * s_.scale.travel;
  };
  // a soft coupling's step is more than that, and a measurement is a block and a half late
  return same(s_.inserted.end) || same(measure());
}

// Whether the resistance along the axis is the floor: at `min_depth` [m] or below, more than the
// friction of all bore-wall contacts, and there again after a lift.
bool BoreInsertion::isOnFloor(double min_depth) {
  const BoreReading pressed = measure();
  s_.report("floor", text("%.2f mm deep, %.1f N along", pressed.depth * 1e3, pressed.along) +
                         text(", %.1f N sideways, %.3f N m", pressed.sideways, pressed.moment));
  if (pressed.depth < min_depth) return false;
  // the floor's own moment is that of a force on the peg's edge at most
  const double arm = std::max(0.0, pressed.moment - s_.mechanism.peg.radius * pressed.along);
  const double walls = pressed.sideways + 2.0 * arm / pressed.depth;
  if (pressed.along < 2.0 * s_.mechanism.friction.static_coefficient * walls) return false;
  if (!pressAgain(pressed)) return false;
  const double step = kPressStep * s_.scale.force * pressCompliance(s_.mechanism);
  for (int i = 0; i < kEaseBlocks && s_.inserted.end.along > kRestForce * s_.scale.force; ++i) {
    move(-step);
  }
  return true;
}

// A hole that is shallower than drawn, or than requested: the peg is stuck at one depth twice, and
// what holds it is a floor. A jam is elsewhere after the peg was pulled up.
void BoreInsertion::refuseFloor(double depth, const std::optional<double>& before) {
  if (!before || std::abs(depth - *before) > kSame * s_.scale.travel || !isOnFloor(0.0)) return;
  const InsertParameters& p = s_.p.insert;
  throw AlignError(AlignFailure::kNotSeated,
                   text("floor at %.2f mm, ", depth * 1e3) +
                       text(p.floor ? "the drawing has it at %.2f mm" : "%.2f mm are requested",
                            p.goal(s_.mechanism.hole.depth) * 1e3));
}

// Shaken at the peg's own swing sideways in its coupling, where a newton moves it most; friction
// then points along the shaking rather than against the path down.
void BoreInsertion::shake(double amplitude) {
  const double stiffness = std::min(s_.mechanism.coupling.stiffness.diagonal(1),
                                    s_.mechanism.coupling.stiffness.diagonal(2));
  const double frequency = s_.p.exciter_frequency > 0.0
                               ? s_.p.exciter_frequency
                               : std::sqrt(stiffness / s_.mechanism.peg.mass);
  s_.carrier.exciterNext({amplitude, frequency, 0.0, s_.p.exciter_direction});
}

void BoreInsertion::insert() {
  const double start = s_.carrier.last().time;
  s_.inserted.curve.reserve(kSamples);
  const Sampling sampling(every_);
  X_SP_ = s_.target();
  if (s_.p.insert.exciter > 0.0) shake(s_.p.insert.exciter);
  move(0.0);
  double travel = kBackOut;
  std::optional<double> before;  // depth where it was stuck the last time
  for (;;) {
    const End end = lower();
    if (end == End::kDeep ||
        (end == End::kResisted && isOnFloor(minFloor(s_.mechanism, s_.scale)))) {
      break;
    }
    const BoreReading stuck = s_.inserted.end;
    refuseFloor(stuck.depth, before);
    before = stuck.depth;
    s_.report("jam", text("stuck %.2f mm deep", stuck.depth * 1e3) +
                         text(", %.1f N along, %.1f N sideways", stuck.along, stuck.sideways));
    if (s_.inserted.backed_out == kBackOuts) {
      s_.inserted.time = s_.carrier.last().time - start;
      throw AlignError(AlignFailure::kJammed, text("stuck %.2f mm deep, pulled up %d times",
                                                   stuck.depth * 1e3, kBackOuts));
    }
    ++s_.inserted.backed_out;
    pullUp(std::min(travel, kStaysIn * stuck.depth),
           std::min(s_.p.insert.force, kPullOfLimit * s_.p.force_limit));
    travel *= 2.0;
  }
  if (s_.p.insert.exciter > 0.0) shake(0.0);
  for (int i = 0; i < s_.blocks(kRelaxTime); ++i) move(0.0);
  s_.inserted.seated = true;
  s_.inserted.time = s_.carrier.last().time - start;
  s_.report("seated", text("%.2f mm deep, largest force %.1f N", s_.inserted.end.depth * 1e3,
                           s_.inserted.force));
}

void BoreInsertion::startInBore() {
  X_SP_ = s_.target();
  s_.hole.height = X_SP_.p.z() + s_.p.inserted;
  s_.setHanging(X_SP_.p);
  s_.inserted.end.depth = s_.p.inserted;
}

Pose BoreInsertion::leave() {
  s_.carrier.tare();
  s_.startHere();
  startInBore();
  move(0.0);
  const double above = kOut * s_.scale.travel;
  backOut(s_.p.inserted + above);
  s_.report("retreat", text("%.2f mm above the face", -1e3 * s_.inserted.end.depth));
  if (s_.inserted.end.depth > 0.0) {
    throw AlignError(AlignFailure::kStuck, text("%.2f mm deep still, pulled with %.1f N",
                                                1e3 * s_.inserted.end.depth, opposing(-1.0)));
  }
  return X_SP_;
}

}  // namespace assembly_cell
