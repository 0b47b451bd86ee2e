// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "integrator.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "contact/slow_slip.h"
#include "event_locator.h"
#include "tableaus.h"
#include "zeno.h"

namespace assembly_cell {
namespace {

// Minimum step of hamming, below which one step of dopri5 is taken, and the length of that: below
// the remainder of a step after an event, far above rounding. No result changes at half or twice.
constexpr double kShortestHalf = 1e-9, kBridge = 1e-6;  // [s]
// Rotation of friction per step [rad] above which it is stiff for dopri5 (stable to 3.3), and above
// which slow_slip.h, whose steps cost three explicit ones, is used at once; it is always used where
// slip begins at rest. Half and twice of the first: a vibrated press takes 3 % more and 6 % more;
// of the second: nothing and 2 % more.
constexpr double kStiff = 3.0, kVeryStiff = 100.0;
// It is used, too, after this number of consecutive explicit steps with a rotation above kStiffTurn
// [rad], limited by stability. Twice as many: +1 % of the evaluations of alignments; without: +6 %,
// and 3.7 times as many at a tolerance of 1e-12.
constexpr int kStiffSteps = 8;
constexpr double kStiffTurn = 1.0;
// Number of explicit steps after a failure of slow_slip.h. Half and twice: a vibrated press is the
// same to the last bit.
constexpr int kExplicit = 8;
// Maximum fraction of slip speed lost in a step, as slip that passes rest reverses: of 2000 steps
// with more than 1 all were rejected, of those up to half one in ten.
constexpr double kFallen = 0.6;
// Tolerated error of a slip velocity over its speed; forces of neighbouring points amplify it. Half
// and twice: evaluations of alignments within 0.3 %.
constexpr double kSlipError = 0.1;
// Greatest error of a step whose error stagnates, and the relative difference that counts as none.
constexpr double kStagnant = 10.0, kSame = 0.01;
constexpr double kSafety = 0.9;                 // fraction of the step size that the error allows
using Vector18 = Eigen::Matrix<double, 18, 1>;  // a state, q before v

template <class Row>
constexpr int lastNonZero() {
  int last = 0;
  for (int j = 0; j < Row::kSize; ++j) {
    if (Row::value(j) != 0.0) last = j;
  }
  return last;
}

// Sum of coefficients times slopes from the J-th on; zero coefficients are skipped at compile time.
template <class Row, int J = 0, class Slopes>
auto weighted(const Slopes& slopes) {
  if constexpr (Row::value(J) == 0.0) {
    return weighted<Row, J + 1>(slopes);
  } else if constexpr (lastNonZero<Row>() == J) {
    return Row::value(J) * slopes[J];
  } else {
    return Row::value(J) * slopes[J] + weighted<Row, J + 1>(slopes);
  }
}

template <class T, int I>
struct StageRow {
  static constexpr int kSize = I;
  static constexpr double value(int j) { return T::a[I][j]; }
};
template <class T>
struct ErrorRow {
  static constexpr int kSize = T::kStages + 1;
  static constexpr double value(int j) { return T::e[j]; }
};
template <class T>
struct ThirdErrorRow {
  static constexpr int kSize = T::kStages + 1;
  static constexpr double value(int j) { return T::e3[j]; }
};

template <class T, class = void>
struct HasError : std::false_type {};
template <class T>
struct HasError<T, std::void_t<decltype(T::e)>> : std::true_type {};
template <class T, class = void>
struct HasThirdError : std::false_type {};
template <class T>
struct HasThirdError<T, std::void_t<decltype(T::e3)>> : std::true_type {};

double errorOf(const System& s, const Eigen::Vector3d& deflection) {
  return deflection.lpNorm<Eigen::Infinity>() / s.scenario.solver.tolerance;
}

// Largest component over its tolerance: positions 1, angles 30 rad/m, velocities 30 1/s.
double errorOf(const System& s, const Vector18& error) {
  static constexpr double a = 1 / 30.0, b = a * a;
  static constexpr std::array<double, 18> kScale = {1, 1, 1, a, a, a, 1, 1, a,
                                                    a, a, a, b, b, b, a, a, b};
  const Eigen::Map<const Vector18> scale(kScale.data());
  const double largest = error.cwiseProduct(scale).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
  return std::isfinite(largest) ? largest / s.scenario.solver.tolerance : HUGE_VAL;
}

// Slopes of the stages of a step: of q and v, and of the carrier deflection.
template <class T>
struct Slopes {
  std::array<Vector18, T::kStages + 1> state;
  std::array<Eigen::Vector3d, T::kStages + 1> carrier_deflection;
};

template <class T, int I>
void stages(const System& s, const Context& c, const Vector18& start, Slopes<T>& slopes,
            Trial& step, Evaluation& e) {
  const double h = step.h;
  State& end = step.end;
  const Vector18 y = start + h * weighted<StageRow<T, I>>(slopes.state);
  end.q = y.head<9>();
  end.v = y.tail<9>();
  if (s.compliant)
    end.carrier_deflection =
        c.state.carrier_deflection + h * weighted<StageRow<T, I>>(slopes.carrier_deflection);
  slopes.state[I].template head<9>() = end.v;
  slopes.state[I].template tail<9>() = evaluate(
      s, c, c.time + T::c[I] * h, end, I == T::kStages ? Level::kEvents : Level::kForces, e);
  slopes.carrier_deflection[I] = e.motion.carrier_deflection_rate;
  if constexpr (std::is_same_v<T, Dopri5> && (I == 2 || I == 3)) {
    if (step.stages.recorded) recordStage(s, c, e, I - 2, step.stages);
  }
  if constexpr (I < T::kStages) stages<T, I + 1>(s, c, start, slopes, step, e);
}

// Largest error of the slip velocity of a slipping point over kSlipError times its speed. v: error
// of the velocities; e: of the step's end.
double slipErrorOf(const System& s, const Context& c, const Vector9& v, const Evaluation& e) {
  const double mu = s.scenario.mechanism.friction.sliding_coefficient;
  if (!s.discrete_friction || mu == 0.0 || e.coarse) return 0.0;
  const Eigen::Vector3d linear = v.head<3>(), angular = e.k.Re * v.segment<3>(3);
  double largest = 0.0;
  for (const std::size_t i : Slots(e.active() & ~e.face)) {
    if (c.slots[i].mode != Mode::kSlip) continue;
    const ContactKinematics& at = e.contacts[i];
    const Eigen::Vector3d off = linear + angular.cross(at.r), &normal = e.point(i).normal;
    const double speed = std::max(at.tangential.norm(), slipThreshold(s, e));
    largest = std::max(largest, (off - normal * normal.dot(off)).norm() / speed);
  }
  return largest / kSlipError;
}

// Error of a step: the sum of slopes with the coefficients of Row, over the tolerance.
template <class Row, class T>
double errorBy(const System& s, const Context& c, double h, const Slopes<T>& slopes,
               const Evaluation& e) {
  const Vector18 off = h * weighted<Row>(slopes.state);
  double error = errorOf(s, off);
  if (e.closed) error = std::max(error, slipErrorOf(s, c, off.template tail<9>(), e));
  if (!s.compliant) return error;
  return std::max(error, errorOf(s, Eigen::Vector3d(h * weighted<Row>(slopes.carrier_deflection))));
}

template <class T>
void attemptTableau(const System& s, const Context& c, Trial& step, Evaluation& e) {
  keepNear(c.state, e.near);
  Slopes<T> slopes;
  Vector18 start;
  start.head<9>() = c.state.q;
  start.tail<9>() = c.state.v;
  slopes.state[0].template head<9>() = c.state.v;
  slopes.state[0].template tail<9>() = c.slope;
  slopes.carrier_deflection[0] = c.carrier_deflection_rate;
  stages<T, 1>(s, c, start, slopes, step, e);
  step.slope = slopes.state[T::kStages].template tail<9>();
  step.carrier_deflection_rate = slopes.carrier_deflection[T::kStages];
  step.error = 0.0;
  if constexpr (HasError<T>::value) {
    const double fifth = errorBy<ErrorRow<T>>(s, c, step.h, slopes, e);
    step.error = fifth;
    if constexpr (HasThirdError<T>::value) {
      const double third = errorBy<ThirdErrorRow<T>>(s, c, step.h, slopes, e);
      step.error = fifth > 0.0 ? fifth * fifth / std::hypot(fifth, 0.1 * third) : 0.0;
    }
  }
}

double orderOf(Method method) {
  switch (method) {
    case Method::kDop853:
      return 8.0;
    case Method::kSlowSlip:
      return 3.0;
    default:
      return 5.0;
  }
}

}  // namespace

double errorOf(const System& s, const State& error) {
  Vector18 both;
  both << error.q, error.v;
  return std::max(errorOf(s, both), errorOf(s, error.carrier_deflection));
}

State interpolate(const Context& c, const Trial& step, double tau) {
  const double h = step.h, u = tau / h;
  const Vector9 v0 = h * c.state.v, v1 = h * step.end.v, a0 = h * h * c.slope,
                a1 = h * h * step.slope;
  const Vector9 d = step.end.q - c.state.q;
  const Vector9 c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
  const Vector9 c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
  const Vector9 c5 = 6.0 * d - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1;
  State s;
  s.q = c.state.q + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))));
  if (h > 1e-6) {
    s.v = (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h;
  } else {
    // the derivative of the quintic would cancel: velocities have a cubic of their own
    const Vector9 dv = step.end.v - c.state.v, s0 = h * c.slope, s1 = h * step.slope;
    s.v = c.state.v + u * (s0 + u * (3.0 * dv - 2.0 * s0 - s1 + u * (-2.0 * dv + s0 + s1)));
  }
  const double w = u - u * u;
  s.q += w * w * w * step.sixth;
  s.v += 3.0 * w * w * (1.0 - 2.0 * u) / h * step.sixth;
  const Eigen::Vector3d g = step.end.carrier_deflection - c.state.carrier_deflection,
                        g0 = h * c.carrier_deflection_rate, g1 = h * step.carrier_deflection_rate;
  s.carrier_deflection = c.state.carrier_deflection +
                         u * (g0 + u * (3.0 * g - 2.0 * g0 - g1 + u * (-2.0 * g + g0 + g1)));
  return s;
}

double refine(const System& s, const Context& c, Trial& step, Evaluation& e) {
  const double h = step.h;
  const Vector9 slope =
      evaluate(s, c, c.time + 0.5 * h, interpolate(c, step, 0.5 * h), Level::kEvents, e);
  // second derivative of the quintic there; that of (u - u^2)^3 is -3/8
  const Vector9 of_ends = 1.5 / h * (step.end.v - c.state.v) - 0.25 * (c.slope + step.slope);
  step.sixth = -8.0 / 3.0 * h * h * (slope - of_ends);
  // maxima of (u - u^2)^3 and of its derivative
  constexpr double maximum = 1.0 / 64, fastest = 0.0537;
  const double change =
      errorOf(s, {maximum * step.sixth, fastest / h * step.sixth, Eigen::Vector3d::Zero()});
  if (std::isinf(change)) step.sixth.setZero();
  return change;
}

void attemptStep(const System& s, const Context& c, Method method, Trial& step, Evaluation& e) {
  step.method = method;
  step.stages.recorded = step.stages.complete =
      method == Method::kDopri5 && e.closed && !s.fixed_step && !c.face.on;
  switch (method) {
    case Method::kRk4:
      return attemptTableau<Classical4>(s, c, step, e);
    case Method::kDopri5:
      return attemptTableau<Dopri5>(s, c, step, e);
    case Method::kDop853:
      return attemptTableau<Dop853>(s, c, step, e);
    case Method::kSlowSlip:
      return attemptSlowSlip(s, c, step, e);
    case Method::kHamming:
      break;
  }
  attemptTableau<Ralston4>(s, c, step, e);
}

bool Integrator::needsSlowSlip(const System& s, const Context& c, double h) const {
  return !s.fixed_step && pace_.explicit_left == 0 &&
         h * c.slip_turning > (pace_.slow                   ? kStiff
                               : pace_.stiff >= kStiffSteps ? kStiffTurn
                                                            : kVeryStiff);
}

double Integrator::nextStep(const System& s, const Context& c) const {
  const double h = std::min(pace_.next_step, s.scenario.solver.max_step);
  const bool bound = s.method != Method::kHamming && h * c.slip_falling > kFallen;
  return bound && !needsSlowSlip(s, c, h) ? kFallen / c.slip_falling : h;
}

bool Integrator::plan(const System& s, const Context& c, const Evaluation& e, double t_end,
                      Trial& step) {
  if (pace_.decisions != c.decisions) {
    past_.count = 0;
    pace_.last = {};
  }
  pace_.decisions = c.decisions;
  const double left = t_end - c.time;
  step.h = s.fixed_step ? s.scenario.solver.step : nextStep(s, c);
  if (c.time < c.zeno_until) step.h = zenoStep(s, e, step.h);
  if (s.method == Method::kHamming && !bridging_ && left > step.h) {
    // equal steps to the end, so that the history stays valid
    const bool same = past_.count > 0 && past_.h <= step.h * (1 + 1e-6);
    const double wanted = same ? past_.h : step.h;
    step.h = left / std::max(1.0, std::ceil(left / wanted - 1e-6));
  }
  const double resolution = 4e-16 * std::max(1.0, std::abs(t_end));
  const bool last = c.time + step.h >= t_end - resolution;
  if (last) step.h = left;
  return last;
}

void Integrator::attempt(const System& s, const Context& c, Trial& step, Evaluation& e) {
  if (bridging_) {
    attemptStep(s, c, Method::kDopri5, step, e);
  } else if (s.method == Method::kHamming) {
    step.method = Method::kHamming;
    attemptHamming(s, c, step, e);
  } else {
    attemptStep(s, c, needsSlowSlip(s, c, step.h) ? Method::kSlowSlip : s.method, step, e);
  }
}

double Integrator::shrinkBy(const Trial& step) {
  if (!std::isfinite(step.error) || !step.finite()) return 0.1;
  return std::max(0.2, kSafety * std::pow(step.error, -1.0 / orderOf(step.method)));
}

bool Integrator::fallBackToExplicit(const Trial& step) {
  if (step.method != Method::kSlowSlip || !std::isinf(step.error)) return false;
  pace_.explicit_left = kExplicit;
  pace_.next_step = step.h;
  return true;
}

bool Integrator::stagnates(const Trial& step) const {
  return step.method == Method::kSlowSlip && step.error < kStagnant &&
         std::abs(step.error - pace_.refused) < kSame * step.error;
}

void Integrator::refuse(const System& s, const Context& c, const Trial& step, Evaluation& e) {
  pace_.next_step = step.h * shrinkBy(step);
  pace_.refused = step.error;
  if (s.method != Method::kHamming || bridging_) return;
  if (step.h < kShortestHalf) {
    // no smooth history after halving: one step of dopri5, then a restart
    bridging_ = true;
    past_.count = 0;
    pace_.next_step = kBridge;
    return;
  }
  pace_.next_step = 0.5 * step.h;
  if (past_.count >= 4) {
    halvePast(s, c, e);
  } else {
    past_.count = 0;
  }
}

// Records what the method of the next step depends on.
void Integrator::note(const Context& c, const Trial& step) {
  pace_.slow = step.method == Method::kSlowSlip;
  pace_.refused = 0.0;
  pace_.stiff = !pace_.slow && step.h * c.slip_turning > kStiffTurn ? pace_.stiff + 1 : 0;
  if (pace_.explicit_left > 0) --pace_.explicit_left;
}

void Integrator::accept(const System& s, const Context& c, const Trial& step, bool last,
                        double t_end) {
  if (bridging_) {
    note(c, step);
    bridging_ = false;
    pace_.next_step = std::max(pace_.next_step, kBridge);
    return;
  }
  if (s.method == Method::kHamming) remember(c, step.h);
  lengthen(s, c, step, last, t_end);
}

void Integrator::lengthen(const System& s, const Context& c, const Trial& step, bool last,
                          double t_end) {
  note(c, step);
  if (s.fixed_step) return;
  if (s.method == Method::kHamming) {
    // HPCG: doubles below a fiftieth of the tolerance with an even number of remaining steps
    const double steps = std::round((t_end - c.time) / step.h);
    if (past_.count == Past::kMaxRows && step.error < 0.02 && std::fmod(steps, 2.0) == 0.0 &&
        2.0 * step.h <= s.scenario.solver.max_step * (1 + 1e-9)) {
      doublePast();
      pace_.next_step = 2.0 * step.h;
    }
    return;
  }
  if (last && step.error <= 0.5) return;
  const double right = std::pow(std::max(step.error, 1e-10), -1.0 / orderOf(step.method));
  double change = kSafety * right;
  // Gustafsson's predictive control: extrapolates a decrease of the optimal step size; without it
  // half of the steps are rejected while slip comes to rest
  const Accepted before = pace_.last;
  if (before.right > 0.0 && before.method == step.method) {
    change *= std::min(1.0, step.h * right / before.right);
  }
  pace_.last = {step.h * right, step.method};
  pace_.next_step = step.h * std::clamp(change, 0.2, 5.0);
}

}  // namespace assembly_cell
