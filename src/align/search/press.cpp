// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/press.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "assembly_cell/align/estimation/contact_window.h"

namespace assembly_cell {
namespace {

// Lengths, forces and times of the default cell; limits_.scale carries them over.
constexpr double kTouchNoise = 5.0;  // and so many sd of a block's force, all axes
// Of that, sideways. An edge that slides down the bore's wall pushes with 0.3 to 0.5 N before it
// wedges. Half: near starts take 0.5 s longer. Twice: one of 80 of them is held with 200 N.
constexpr double kSidewaysTouch = 0.2;
constexpr double kSoftest = 2e3, kStiffest = 2e5;  // bounds of the secant's stiffness [N/m]
constexpr double kFirstStiffness = 3e4;            // [N/m]
constexpr double kMostChange = 3e-4;               // of height in one step of a press [m]
constexpr int kHoldSteps = 30;
// From a command to the end of what it does: a block may be 60 ms old when it is given, the command
// as old when it is taken, and an arm needs 50 ms [s]. The force of before says nothing.
constexpr double kOnTheWay = 0.2;
// So often a force may have gone on and is held anew: an arm's end of a move does so once.
constexpr int kHolds = 5;
constexpr double kPullStep = 2.5e-4;  // of travel on the way out [m]
constexpr double kPullTravel = 2e-3;  // in such steps [m]
// Of a coupling that is twice as stiff as the default one it may take as much force: 16 N, less
// than half of the limit. Stiffer ones are pulled in smaller steps.
constexpr double kPullSofter = 2.0;
// What holds a peg against a quarter of the limit is a wedge. Half: the peg is turned where it
// would have come free anyway. Twice: 20 N have tightened the wedge, and it takes twice the torque.
constexpr double kWedged = 0.25;
// Turned by so much about its axis the coupling makes 3 N m: more than friction of 200 N on both
// sides of a peg of 25 mm. Half: wedges of 100 N. Twice: a longer way.
constexpr double kTwist = 0.06;                     // [rad]
constexpr double kTwisted = 0.01;                   // of it, which gives way
constexpr int kFreeSteps = 4, kMaxFreeSteps = 100;  // of kPullStep: a millimetre, and 25
// Of a touch. Less is lost again in the steps of a press: of six from 0.15 to 0.4 N two were.
constexpr double kLeastPress = 0.33;
constexpr double kLifts = 3e-3;         // ways of some begin(), up and aside [m], of tilt [rad]
constexpr double kLifted = 1e-4;        // of a millimetre up, what may be missing [m]
constexpr double kFreeSide = 3e-4;      // against a wall 2 N [m]
constexpr double kMaxCompliance = 3.0;  // travel of a press, times the coupling's compliance
// Of the force over a step of a free peg [N]. Contact changes it by the coupling's stiffness times
// the step, 12 N; noise of 20 mV a channel, forty times the cell's, by 0.12 N rms. Half: a peg
// with such noise is lifted farther. Twice: a contact softer by a factor of 12 is a free peg.
constexpr double kFreeChange = 0.5;
// Noise beyond so many times that leaves no six steps in a row without a change, however free: of
// its largest changes, so one step in seven passes.
constexpr double kNoisy = 4.0;
constexpr int kSettleBlocks = 3;
constexpr double kStillForce = 0.03;  // change from block to block of what is at rest [N]
constexpr int kStillBlocks = 3;
constexpr int kStillLimit = 200;  // blocks that a settling may take
// After so many blocks a swing has died away, and what is left of change may be noise: the norm of
// a change in three axes is below 2.5 times its rms in 999 of 1000 (chi distribution).
constexpr int kSwingBlocks = 50;
constexpr double kNoiseRms = 2.5;

std::string line(const char* format, double a, double b) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

// Stiff parts that touch make a knock of a few samples, at or over the ends of the bridges' range;
// a block may end in the middle of it. Three saturated blocks in a row are a press.
constexpr int kKnockBlocks = 2;
// At rest so many in a row are a sensor that tells nothing: its own noise, an offset, a broken
// wire.
constexpr int kDeafBlocks = 50;

constexpr double kThere = 1e-7;   // of height [m] and tilt [rad], as commanded
constexpr double kNear = 2e-5;    // of the same where they give way a little
constexpr double kRest = 2e-6;    // their change in a block once the move has ended
constexpr double kBeside = 5e-4;  // of x and y, which give way [m]

constexpr double kLeastNoise = 1e-6;  // of the reported pose that counts as such [m], [rad]
// One pose in 5000 lies farther off; it costs one block more.
constexpr double kNoiseReach = 4.0;
// A quintic at the carrier's default limits is 60 um from its end at most 32 ms before it.
constexpr int kBlocksToEnd = 3;

// difference of height and tilt, the greatest, less what `reach` deviations of the noise explain
double apart(const RestPose& a, const RestPose& b, const ReportNoise& noise, double reach) {
  const double height = std::abs(a.z - b.z) - reach * noise.position;
  const double tilt = std::max(std::abs(a.theta - b.theta), std::abs(a.phi - b.phi));
  return std::max(height, tilt - reach * noise.rotation);
}

}  // namespace

PressLimits pressLimits(const Mechanism& mechanism) {
  PressLimits limits;
  limits.scale = scaleOf(mechanism);
  limits.approach_step *= limits.scale.step;
  limits.compliance = kMaxCompliance * pressCompliance(mechanism);
  limits.peg = mechanism.peg;
  limits.gravity = mechanism.gravity;
  return limits;
}

void ReportNoiseMeter::add(const RestPose& at) {
  if (last_) {
    height2_ += std::pow(at.z - last_->z, 2);
    tilt2_ += 0.5 * (std::pow(at.theta - last_->theta, 2) + std::pow(at.phi - last_->phi, 2));
    ++pairs_;
  }
  last_ = at;
}

ReportNoise ReportNoiseMeter::noise() const {
  if (pairs_ == 0) return {};
  // a difference has twice the variance
  const ReportNoise measured{std::sqrt(0.5 * height2_ / pairs_), std::sqrt(0.5 * tilt2_ / pairs_)};
  return {measured.position < kLeastNoise ? 0.0 : measured.position,
          measured.rotation < kLeastNoise ? 0.0 : measured.rotation};
}

bool arrived(const RestPose& before, const RestPose& at, const RestPose& target,
             const ReportNoise& noise) {
  if (std::hypot(at.x - target.x, at.y - target.y) >= kBeside) return false;
  const double off = apart(at, target, noise, kNoiseReach);
  return off < kThere ||
         (off < kNear && apart(at, before, noise, std::sqrt(2.0) * kNoiseReach) < kRest);
}

int blocksToEnd(const ReportNoise& noise) {
  return noise.position > 0.0 || noise.rotation > 0.0 ? kBlocksToEnd : 0;
}

PressController::PressController(Plant& plant, const PressLimits& limits)
    : plant_(plant),
      limits_(limits),
      touch_(kTouchForce * limits.scale.force),
      stiffness_(kFirstStiffness * limits.scale.force / limits.scale.sink) {
  wait(1);
  target_ = last_.carrier;
}

// change of the weight since the carrier had another pose
Vector6 PressController::weightSince(const RestPose& pose) const {
  if (limits_.peg.mass == 0.0) return Vector6::Zero();
  const auto weight = [this](const RestPose& carrier) {
    // the base stands upright to a few degrees, which changes the difference by as much of itself
    const Eigen::Vector3d up = poseFromRest(carrier).R.transpose() * Eigen::Vector3d::UnitZ();
    return pegWeight(limits_.peg, limits_.gravity, up, Vector6::Zero());
  };
  return weight(last_.carrier) - weight(pose);
}

ForceAlarm PressController::alarmAt(double force, double sideways) const {
  return {(last_.wrench_b - wrench()).head<3>(), force, sideways};
}

double PressController::tareShift() const {
  return (tare_ - zero_ - weightSince(zero_pose_)).head<3>().norm();
}

int PressController::timed(int blocks) const {
  return static_cast<int>(std::ceil(blocks * limits_.scale.time - 1e-9));
}

const PlantBlock& PressController::step(const PlantCommand& command) {
  PlantCommand all = command;
  if (exciter_ && !all.exciter) all.exciter = exciter_;
  exciter_.reset();
  if (tared_ && guarded_ && !all.alarm) {
    all.alarm = alarmAt(limits_.force, std::numeric_limits<double>::infinity());
  }
  last_ = plant_.next(all);
  to_end_ = std::max(0, to_end_ - 1);
  saturated_ = last_.saturated ? saturated_ + 1 : 0;
  // before the tare the peg may still swing
  if (tared_ && guarded_ && saturated_ > kKnockBlocks) {
    throw AlignError(AlignFailure::kSensorSaturated,
                     "a channel is at its limit; lower the press force");
  }
  if (tared_ && guarded_ && force().norm() > limits_.force) {
    throw AlignError(AlignFailure::kForceLimit,
                     line("%.1f N is over %.1f N", force().norm(), limits_.force));
  }
  return last_;
}

const PlantBlock& PressController::wait(int blocks) {
  for (int i = 0; i < blocks; ++i) step({});
  return last_;
}

// that a block's force may have changed by since the block before, of noise alone
double PressController::changeOfNoise() const {
  const Matrix6 of_mean = last_.covariance_b / std::max(1, last_.samples) + last_.rounding_b;
  return kNoiseRms * std::sqrt(2 * of_mean.topLeftCorner<3, 3>().trace());
}

bool PressController::settle() {
  int still = 0;
  for (int i = 0; still < kStillBlocks; ++i) {
    if (i == timed(kStillLimit)) return false;
    const Vector6 before = last_.wrench_b;
    wait(1);
    if (saturated_ >= timed(kDeafBlocks)) {
      throw AlignError(AlignFailure::kSensorSaturated,
                       "a channel stays at its limit with the peg at rest; look at both sensors, "
                       "their offsets and their noise");
    }
    double limit = kStillForce * limits_.scale.still;
    if (i >= timed(kSwingBlocks) && last_.samples > 0) {
      limit = std::max(limit, changeOfNoise());
    }
    const bool agrees = (last_.wrench_b - before).head<3>().norm() < limit;
    still = agrees && !last_.saturated ? still + 1 : 0;
  }
  return true;
}

void PressController::tare(int blocks) {
  // hanging free: wait until some blocks in a row agree, then average
  if (!settle()) {
    throw AlignError(AlignFailure::kNotStill,
                     "the hanging peg doesn't come to rest; check for contact");
  }
  Vector6 wrench = Vector6::Zero(), displacement = Vector6::Zero();
  Matrix6 scatter = Matrix6::Zero();
  meter_.interrupt();
  for (int i = 0; i < blocks; ++i) {
    wait(1);
    meter_.add(last_.carrier);
    wrench += last_.wrench_b;
    displacement += last_.displacement_b;
    scatter += last_.covariance_b;
  }
  scatter_ = scatter / blocks;
  tare_ = wrench / blocks;
  if (!tared_) {
    zero_ = tare_;
    zero_pose_ = last_.carrier;
    zero_time_ = last_.time;
    const Matrix6 of_mean = scatter_ / std::max(1, last_.samples) + last_.rounding_b;
    touch_ = std::max(touch_, kTouchNoise * std::sqrt(of_mean.topLeftCorner<3, 3>().trace()));
  }
  tare_displacement_ = displacement / blocks;
  tared_ = true;
  target_ = tare_pose_ = last_.carrier;
}

void PressController::begin(const Mechanism& mechanism) {
  tare();
  const Eigen::Vector3d up = poseFromRest(last_.carrier).R.transpose() * Eigen::Vector3d::UnitZ();
  const Vector6 weight = pegWeight(mechanism.peg, mechanism.gravity, up, last_.displacement_b);
  if ((tare_ - weight).head<3>().norm() < freeForce()) return;
  // in contact, or the sensor's zero is another one: up until nothing changes any more
  const double free_change = kFreeChange * limits_.scale.force;
  if (changeOfNoise() > kNoisy * free_change) {
    throw AlignError(AlignFailure::kNotStill,
                     line("sensor_b's own noise changes its force by up to %.1f N from block to "
                          "block, contact shows where %.1f N are something; look at its bridge",
                          changeOfNoise(), free_change));
  }
  guarded_ = false;
  PlantCommand off;
  off.exciter = ExciterParameters{0.0, 0.0, 0.0, 1};
  step(off);
  RestPose higher = last_.carrier;
  int same = 0;
  for (int i = 0; same < kFreeSteps + 2; ++i) {
    const Vector6 before = last_.wrench_b;
    // sideways at the end, along x and y: a peg slides up along a wall without a change
    RestPose next = higher;
    if (same < kFreeSteps) next.z = higher.z += kPullStep;
    const double side = kFreeSide * std::max(limits_.scale.give, limits_.scale.length);
    if (same >= kFreeSteps) next.x += side;
    if (same > kFreeSteps) next.y += side;
    moveTo(next);
    if (i == kMaxFreeSteps || !settle() || force().norm() > 2 * limits_.force) {
      throw AlignError(
          AlignFailure::kInContact,
          line("the peg doesn't come free: %.1f N of change after %.1f mm of travel up; take it "
               "out by the action retreat or by hand, or reset the simulation",
               force().norm(), (higher.z - tare_pose_.z) * 1e3));
    }
    const double change = (last_.wrench_b - before).head<3>().norm();
    same = change < free_change ? same + 1 : 0;
  }
  guarded_ = true;
  tared_ = false;
  tare();
}

void PressController::release(const Mechanism& mechanism, const std::optional<RestPose>& hung) {
  guarded_ = false;
  PlantCommand off;
  off.exciter = ExciterParameters{0.0, 0.0, 0.0, 1};
  step(off);
  const bool low = !hung || last_.carrier.z < hung->z - kHeightNoise;
  if (low) {
    RestPose up = last_.carrier;
    up.z += kFreeSteps * kPullStep;
    nudge(up);
    // about there is enough: how far a reported pose scatters is not known before the tare
    for (int i = 0; i < kStillLimit && std::abs(last_.carrier.z - up.z) > kLifted; ++i) wait(1);
  }
  guarded_ = true;
  begin(mechanism);
  if (!low) goBack(*hung, mechanism);
}

// From where begin() has lifted it, in this goal and the one that failed. Felt there, it hung on
// nothing but what was believed.
void PressController::goBack(const RestPose& hung, const Mechanism& mechanism) {
  const RestPose& at = last_.carrier;
  const double up = at.z - hung.z, turned = std::hypot(at.theta - hung.theta, at.phi - hung.phi);
  const bool there = std::hypot(at.x - hung.x, at.y - hung.y) < kLifts && turned < kLifts;
  if (!there || up < kHeightNoise || up > kLifts) return;
  moveTo(hung);
  if (settle() && force().norm() < freeForce()) return;
  tared_ = false;
  begin(mechanism);
}

void PressController::moveTo(const RestPose& target, bool to_the_end) {
  wait(to_end_);
  target_ = target;
  PlantCommand command;
  command.rest = target;
  for (int i = 0; i <= kStillLimit; ++i) {
    const RestPose before = last_.carrier;
    step(command);
    if (arrived(before, last_.carrier, target, reportNoise())) {
      to_end_ = blocksToEnd(reportNoise());
      if (to_the_end) wait(to_end_);
      return;
    }
    command.rest.reset();
  }
  const RestPose& at = last_.carrier;
  const double away = std::hypot(at.x - target.x, at.y - target.y, at.z - target.z);
  throw AlignError(
      AlignFailure::kNotArrived,
      line("the carrier comes no nearer than %.3f mm to where it was sent, %.1f N on the peg",
           away * 1e3, force().norm()));
}

void PressController::nudge(const RestPose& target) {
  target_ = target;
  PlantCommand command;
  command.rest = target;
  step(command);
}

// of the force since the first zero, of a peg that should be free
double PressController::held() const {
  return (last_.wrench_b - zero_ - weightSince(zero_pose_)).head<3>().norm();
}

// Gently, for a wedge only tightens when it is pulled: `least` far, and then until the peg is free.
RestPose PressController::pull(const RestPose& from, double least, double most) {
  const double step =
      kPullStep * std::min(1.0, limits_.scale.sink / limits_.scale.force * kPullSofter);
  RestPose up = from;
  for (double pulled = 0.0;
       pulled < least - 0.5 * step || (pulled < most - 0.5 * step && held() > touch_);
       pulled += step) {
    up.z += step;
    moveTo(up);
    if (held() > kWedged * limits_.force) twist(up);
    if (held() > limits_.force) {
      throw AlignError(AlignFailure::kStuck, "the peg doesn't come free");
    }
  }
  return up;
}

// About the peg's axis to both sides, until it lets go: friction that has to hold it against the
// turn holds it against no pull.
void PressController::twist(const RestPose& at) {
  const Pose X = poseFromRest(at);
  for (const double angle : {kTwist, -kTwist, 0.0}) {
    const Pose turned{X.R * rotationFromVector({Eigen::Vector3d(0, 0, angle)}), X.p};
    PlantCommand command;
    command.rest = restFromPose(turned);
    const double yaw = command.rest->yaw;
    bool there = false;
    for (int i = 0; !there && i < kStillLimit && (angle == 0.0 || held() > touch_); ++i) {
      step(command);
      command.rest.reset();
      there = std::abs(last_.carrier.yaw - yaw) < kTwisted;
    }
  }
}

void PressController::retreat(const RestPose& relaxed, double travel) {
  guarded_ = false;
  PlantCommand off;
  off.exciter = ExciterParameters{0.0, 0.0, 0.0, 1};
  step(off);
  moveTo(relaxed);
  // a soft coupling pulls hardly in so short a way: on until the peg is free or held by the limit
  const double end = std::max(travel, kPullTravel);
  RestPose up = pull(relaxed, kPullTravel, end);
  up.z = std::max(up.z, relaxed.z + end);
  moveTo(up);
  if (!settle()) throw AlignError(AlignFailure::kStuck, "the peg doesn't come free");
  guarded_ = true;
  const double shift = held();
  if (shift > freeShift()) {
    throw AlignError(AlignFailure::kZeroShifted,
                     line("%.2f N with the peg free, %.2f N are allowed", shift, freeShift()));
  }
}

bool PressController::approach(double floor) {
  // descend a little every block until the first touch; a steep one hardly pushes up
  const double start = target_.z;
  RestPose target = target_;
  while (force().norm() < touch_ && force().head<2>().norm() < kSidewaysTouch * touch_) {
    if (target.z <= floor) {
      target_ = target;
      return false;
    }
    if (start - target.z > limits_.descent) {
      throw AlignError(
          AlignFailure::kNoContact,
          line("none within %.1f mm of descent from z %.4f m", limits_.descent * 1e3, start));
    }
    target.z -= limits_.approach_step;
    target_ = target;
    PlantCommand down;
    down.rest = target;
    down.alarm = alarmAt(touch_, kSidewaysTouch * touch_);
    step(down);
  }
  touch_z_ = last_.carrier.z;
  target.z = touch_z_;
  moveTo(target);
  return true;
}

// a press that has gone so far down for a force
void PressController::limitWay(double down, double force) const {
  if (down <= limits_.compliance * force) return;
  throw AlignError(AlignFailure::kGaveWay, line("%.1f mm down for %.1f N", down * 1e3, forceZ()));
}

double PressController::leastForce(double tolerance) const {
  const Matrix6 of_mean = scatter_ / std::max(1, last_.samples) + last_.rounding_b;
  const double scatter = kNoiseRms * std::sqrt(of_mean(2, 2));
  return std::max(kLeastPress * touch_, scatter / tolerance);
}

void PressController::hold(double force, double tolerance, bool settled) {
  // secant steps to the force
  RestPose target = target_;
  const double start = target.z;
  const Scale& scale = limits_.scale;
  const double stiffer = scale.force / scale.sink;
  if (!settled) wait(timed(kSettleBlocks));
  for (int i = 0; i < kHoldSteps; ++i) {
    const double before = forceZ();
    if (std::abs(before - force) <= tolerance * force) return;
    const double most = kMostChange * scale.sink;
    const double change = std::clamp((force - before) / stiffness_, -most, most);
    target.z -= change;
    limitWay(start - target.z, force);
    moveTo(target);
    wait(timed(kSettleBlocks));
    // slip makes single secants unreliable: change the estimate by no more than threefold
    const double measured = (forceZ() - before) / change;
    stiffness_ = std::clamp(measured, stiffness_ / 3, stiffness_ * 3);
    stiffness_ = std::clamp(stiffness_, kSoftest * stiffer, kStiffest * stiffer);
  }
  throw AlignError(AlignFailure::kPressNotHeld, line("%.4g N instead of %.4g N", forceZ(), force));
}

void PressController::holdStill(double force, double tolerance) {
  const double start = target_.z;
  for (int i = 0; i < kHolds; ++i) {
    hold(force, tolerance, i > 0);
    for (double passed = 0.0; passed < kOnTheWay; passed += last_.length) wait(1);
    settle();  // or it swings within the tolerance
    limitWay(start - target_.z, force);
    if (std::abs(forceZ() - force) <= tolerance * force) return;
  }
  throw AlignError(AlignFailure::kPressNotHeld,
                   line("%.4g N instead of %.4g N, or it doesn't stay", forceZ(), force));
}

}  // namespace assembly_cell
