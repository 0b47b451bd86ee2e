// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/walking.h"

#include <algorithm>

#include "assembly_cell/math/validity.h"
#include "assembly_cell/vibration/inertia.h"
#include "assembly_cell/vibration/single_dof.h"
#include "numeric.h"

namespace assembly_cell {
namespace {

constexpr int kStepsPerTurn =
    250;  // samples per period of the fastest motion, to find lift and landing
// A minute of computing.
constexpr int kMaxCycles = 100000;
constexpr double kMaxSteps = 3e7;

struct Swing {
  WalkMotion angle, rate;
};

// The peg on both contacts, on A and on B.
class Walker {
 public:
  explicit Walker(const WalkCase& c)
      : c_(c), d_(c.r * c.cos_alpha), s_(std::sqrt((c.r - d_) * (c.r + d_))) {
    inertia_ = contactInertia(c.m, c.r, c.h);
    chord_ = chordInertia(c.m, c.r, c.h, d_);
    const double sb = std::sin(inertia_.beta), cb = std::cos(inertia_.beta);
    const double p = c.r * sb + 2 * c.h * cb, q = c.r * cb - 2 * c.h * sb;
    for (int k = 0; k < 2; ++k) {
      const double sa = (k ? -s_ : s_) / c.r, ca = d_ / c.r;
      Pivot& pivot = pivot_[k];
      pivot.axis[0] = {sa, -ca, 0};
      pivot.axis[1] = {ca * cb, sa * cb, sb};
      pivot.axis[2] = {-ca * sb, -sa * sb, cb};
      const double moment = 2 * c.F * c.h;
      pivot.mode[0] = {inertia_.Ix, c.K, 0, -moment * ca, -moment * sa, c.m * c.g * c.r, c.w,
                       0,           0,   0};
      pivot.mode[1] = {inertia_.Iy, c.K, 0, c.F * p * sa, -c.F * p * ca, 0, c.w, 0, 0, 0};
      pivot.mode[2] = {inertia_.Iz, c.K, 0, c.F * q * sa, -c.F * q * ca, 0, c.w, 0, 0, 0};
    }
  }

  double halfChord() const { return s_; }
  double equilibrium() const { return -c_.m * c_.g * d_ / c_.K; }
  double step() const {
    return 2 * M_PI / std::max(c_.w, std::sqrt(c_.K / inertia_.Iz)) / kStepsPerTurn;
  }

  Swing swing(const WalkSegment& segment, double t) const {
    Swing x;
    if (segment.pivot == 0) {
      const SingleDofState y =
          singleDof({chord_, c_.K, 0, 2 * c_.F * c_.h, 0, -c_.m * c_.g * d_, c_.w, segment.start,
                     segment.theta_Y, segment.theta_Y_dot},
                    t);
      x.angle = {0, y.theta, segment.theta_Z};
      x.rate = {0, y.theta_dot, 0};
      return x;
    }
    const Pivot& pivot = pivot_[segment.pivot > 0 ? 0 : 1];
    for (int k = 0; k < 3; ++k) {
      const WalkMotion& axis = pivot.axis[k];
      SingleDof mode = pivot.mode[k];
      mode.t1 = segment.start;
      mode.th1 = axis.theta_Y * segment.theta_Y + axis.theta_Z * segment.theta_Z;
      mode.thd1 = axis.theta_Y * segment.theta_Y_dot;
      const SingleDofState y = singleDof(mode, t);
      x.angle.theta_X += axis.theta_X * y.theta;
      x.angle.theta_Y += axis.theta_Y * y.theta;
      x.angle.theta_Z += axis.theta_Z * y.theta;
      x.rate.theta_X += axis.theta_X * y.theta_dot;
      x.rate.theta_Y += axis.theta_Y * y.theta_dot;
      x.rate.theta_Z += axis.theta_Z * y.theta_dot;
    }
    return x;
  }

  // normal forces of the double contact: sum and difference A − B
  void load(const WalkSegment& segment, double t, double& sum, double& difference) const {
    const double theta = swing(segment, t).angle.theta_Y;
    const double acceleration =
        (2 * c_.F * c_.h * std::cos(c_.w * t) - c_.m * c_.g * d_ - c_.K * theta) / chord_;
    sum = c_.m * (c_.g + d_ * acceleration);
    difference = 2 * c_.h * c_.F * std::sin(c_.w * t) / s_;
  }
  // a contact opens if its normal force is zero and the peg would rise there without it
  bool leaves(const WalkSegment& segment, double t, int& pivot) const {
    double sum, difference;
    load(segment, t, sum, difference);
    pivot = difference >= 0.0 ? 1 : -1;
    if (sum >= std::abs(difference)) return false;
    const Swing x = swing(segment, t);
    const Pivot& single = pivot_[pivot > 0 ? 0 : 1];
    double acceleration = 0.0;  // of theta_X
    for (int k = 0; k < 3; ++k) {
      const SingleDof& mode = single.mode[k];
      const WalkMotion& axis = single.axis[k];
      const double theta = axis.theta_Y * x.angle.theta_Y + axis.theta_Z * x.angle.theta_Z;
      acceleration +=
          axis.theta_X *
          (mode.A * std::cos(c_.w * t) + mode.B * std::sin(c_.w * t) + mode.C - mode.K * theta) /
          mode.I;
    }
    return pivot * acceleration < 0.0;
  }

  // landing on both contacts: angular momentum about the chord is conserved
  double rateAfterLanding(int pivot, const WalkMotion& rate) const {
    const double side = pivot > 0 ? 1.0 : -1.0;
    return rate.theta_Y + side * c_.m * s_ * (c_.h * rate.theta_Z - d_ * rate.theta_X) / chord_;
  }

 private:
  struct Pivot {
    WalkMotion axis[3];  // principal axes in main axes
    SingleDof mode[3];
  };
  WalkCase c_;
  double d_, s_, chord_ = 0.0;
  ContactInertia inertia_;
  Pivot pivot_[2];
};

void requireWalk(const WalkCase& c) {
  requirePositive({{"m", c.m}, {"g", c.g}, {"r", c.r}, {"h", c.h}, {"K", c.K}, {"w", c.w}});
  requireNotNegative("F", c.F);
  if (!(c.cos_alpha >= 0.0 && c.cos_alpha < 1.0)) {
    refuse("cos_alpha", c.cos_alpha, "give d/r, from 0 to below 1: two contacts apart");
  }
  if (c.cycles < 1 || c.cycles > kMaxCycles) {
    refuse("cycles", c.cycles, "give a whole number from 1 to 100000");
  }
}

}  // namespace

WalkingLimit walkingLimit(double mu, double r, double h) {
  requireNotNegative("mu", mu);
  requirePositive({{"r", r}, {"h", h}});
  const double sine = std::min(1.0, 2 * h * (mu / r));
  const double cosine = std::sqrt((1 - sine) * (1 + sine));
  return {std::asin(sine), finiteResult("overlap", 2 * r * sine * sine / (1 + cosine))};
}

Walk walk(const WalkCase& c) {
  requireWalk(c);
  const Walker walker(c);
  const double end = 2 * M_PI * c.cycles / c.w, step = walker.step();
  if (!(end / step < kMaxSteps))
    refuse("w", c.w, "give a frequency nearer to the peg's resonances");
  const std::size_t max_phases = 1000 * static_cast<std::size_t>(c.cycles);
  Walk walk;
  WalkSegment now{0.0, 0, walker.equilibrium(), 0.0, 0.0};
  walk.segments.push_back(now);
  for (double t = 0.0; t < end;) {
    // double contact until a normal force is zero
    double lift = t;
    int pivot = 0;
    if (!walker.leaves(now, t, pivot)) {
      const double next = t + step;
      if (!walker.leaves(now, next, pivot)) {
        t = next;
        continue;
      }
      lift = vibration::lastOf(t, next, [&](double x) { return !walker.leaves(now, x, pivot); });
      if (lift >= end) break;
    }
    double sum, difference;
    walker.load(now, lift, sum, difference);
    walk.tension = walk.tension || sum < 0.0;
    const Swing start = walker.swing(now, lift);
    const WalkSegment single{lift, difference >= 0.0 ? 1 : -1, start.angle.theta_Y,
                             start.rate.theta_Y, start.angle.theta_Z};
    // the free contact rises with −theta_X on pivot A, +theta_X on B
    const auto up = [&](double x) {
      return single.pivot * walker.swing(single, x).angle.theta_X < 0.0;
    };
    double high = lift + step, low = high;
    for (int k = 0; k < 5 && !up(low); ++k) {
      high = low;
      low = lift + (low - lift) / 4;
    }
    if (!up(low)) {  // a phase shorter than the samples
      t = lift + step / 64;
      continue;
    }
    while (up(high)) {
      low = high;
      high += step;
      if (high - lift > end + 1e4 * step) {
        refuse("F", c.F, "the peg does not come back to both contacts, give less force");
      }
    }
    const double landing = vibration::lastOf(low, high, up);
    const Swing stop = walker.swing(single, landing);
    WalkPhase phase;
    phase.t_lift = lift;
    phase.duration = landing - lift;
    phase.dZ = stop.angle.theta_Z - single.theta_Z;
    phase.outward_step = single.pivot * walker.halfChord() * phase.dZ;
    phase.on_a = single.pivot > 0;
    walk.dx += phase.outward_step;
    walk.phases.push_back(phase);
    walk.segments.push_back(single);
    now = {landing, 0, stop.angle.theta_Y, walker.rateAfterLanding(single.pivot, stop.rate),
           stop.angle.theta_Z};
    walk.segments.push_back(now);
    if (walk.phases.size() > max_phases) {
      refuse("F", c.F, "more than a thousand contacts a cycle, give another F or w");
    }
    t = landing;
  }
  return walk;
}

WalkMotion walkMotion(const WalkCase& c, const Walk& walk, double t) {
  requireWalk(c);
  requireNotNegative("t", t);
  if (walk.segments.empty()) refuse("walk", 0.0, "give the result of walk()");
  const auto next = std::upper_bound(
      walk.segments.begin() + 1, walk.segments.end(), t,
      [](double time, const WalkSegment& segment) { return time < segment.start; });
  return Walker(c).swing(*(next - 1), t).angle;
}

}  // namespace assembly_cell
