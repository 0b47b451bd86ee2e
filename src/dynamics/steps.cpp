// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// One step of each integrator, with the modes of the contacts frozen.
#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "assembly_cell/dynamics/simulation.h"
#include "tableaus.h"

namespace assembly_cell {
namespace {

template <class Row>
constexpr int lastNonZero() {
  int last = 0;
  for (int j = 0; j < Row::kSize; ++j) {
    if (Row::value(j) != 0.0) last = j;
  }
  return last;
}

// sum of coefficient times slope from the J-th on, zero coefficients left out at compile time
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

}  // namespace

// the largest component over its tolerance: positions 1, angles 30 rad/m, velocities 30 1/s
double Simulation::errorOf(const Vector18& error) const {
  static constexpr double a = 1 / 30.0, b = a * a;
  static constexpr std::array<double, 18> kScale = {1, 1, 1, a, a, a, 1, 1, a,
                                                    a, a, a, b, b, b, a, a, b};
  const Eigen::Map<const Vector18> scale(kScale.data());
  const double largest = error.cwiseProduct(scale).cwiseAbs().maxCoeff<Eigen::PropagateNaN>();
  return std::isfinite(largest) ? largest / scenario_.solver.tolerance : HUGE_VAL;
}

double Simulation::errorOf(const State& error) const {
  Vector18 both;
  both << error.q, error.v;
  return errorOf(both);
}

template <class T, int I, class Slopes, class Evaluate>
void stages(const Eigen::Matrix<double, 18, 1>& start, double h, Slopes& slopes, State& end,
            const Evaluate& evaluate) {
  const Eigen::Matrix<double, 18, 1> y = start + h * weighted<StageRow<T, I>>(slopes);
  end.q = y.head<9>();
  end.v = y.tail<9>();
  constexpr auto i = static_cast<std::size_t>(I);
  slopes[i].template head<9>() = end.v;
  slopes[i].template tail<9>() = evaluate(T::c[I] * h, end, I == T::kStages);
  if constexpr (I < T::kStages) stages<T, I + 1>(start, h, slopes, end, evaluate);
}

template <class T>
double Simulation::tryTableau(double h, State& end, Vector9& slope) {
  near_ = directionsOf(state_);
  std::array<Vector18, T::kStages + 1> slopes;
  Vector18 start;
  start.head<9>() = state_.q;
  start.tail<9>() = state_.v;
  slopes[0].template head<9>() = state_.v;
  slopes[0].template tail<9>() = slope_v_;
  stages<T, 1>(start, h, slopes, end, [&](double dt, const State& s, bool last) {
    return evaluate(time_ + dt, s, last ? Look::kEvents : Look::kForces);
  });
  slope = slopes[T::kStages].template tail<9>();
  if constexpr (HasError<T>::value) {
    const double e = errorOf(Vector18(h * weighted<ErrorRow<T>>(slopes)));
    if constexpr (HasThirdError<T>::value) {
      const double e3 = errorOf(Vector18(h * weighted<ThirdErrorRow<T>>(slopes)));
      return e > 0.0 ? e * e / std::hypot(e, 0.1 * e3) : 0.0;
    }
    return e;
  }
  return 0.0;
}

double Simulation::tryOneStep(Method method, double h, State& end, Vector9& slope) {
  switch (method) {
    case Method::kRk4:
      return tryTableau<Classical4>(h, end, slope);
    case Method::kDopri5:
      return tryTableau<Dopri5>(h, end, slope);
    case Method::kDop853:
      return tryTableau<Dop853>(h, end, slope);
    case Method::kHamming:
      break;
  }
  return tryTableau<Ralston4>(h, end, slope);
}

double Simulation::tryStep(double h, State& end, Vector9& slope) {
  return method_ == Method::kHamming ? tryHamming(h, end, slope)
                                     : tryOneStep(method_, h, end, slope);
}

// Hamming's modified predictor–corrector as IBM's HPCG has it: Ralston's method for the first three
// steps, predictor, modifier, corrector, final value; the slope is evaluated at the modified
// predictor and at the final value.
double Simulation::tryHamming(double h, State& end, Vector9& slope) {
  History& past = history_;
  if (past.count == 0 || std::abs(h - past.h) > 1e-6 * past.h) {
    past.y[0] = state_;
    past.slope[0] = {state_.v, slope_v_};
    past.count = 1;
    past.h = h;
    past.defect = {Vector9::Zero(), Vector9::Zero()};
  }
  if (past.count < 4) {
    double error = 0.0;
    if (!fixed_step_ && past.count == 1) {
      // the first step against two of half its size
      State whole, half;
      Vector9 at;
      tryTableau<Ralston4>(h, whole, slope);
      const State start = state_;
      const Vector9 slope_start = slope_v_;
      const double time = time_;
      tryTableau<Ralston4>(0.5 * h, half, at);
      state_ = half;
      slope_v_ = at;
      time_ += 0.5 * h;
      tryTableau<Ralston4>(0.5 * h, half, at);
      state_ = start;
      slope_v_ = slope_start;
      time_ = time;
      error = errorOf(State{(half.q - whole.q) / 15.0, (half.v - whole.v) / 15.0});
    }
    tryTableau<Ralston4>(h, end, slope);
    return error;
  }
  const auto n = static_cast<std::size_t>(past.count) - 1;
  const State &y0 = past.y[n], &y2 = past.y[n - 2], &y3 = past.y[n - 3];
  const State &f0 = past.slope[n], &f1 = past.slope[n - 1], &f2 = past.slope[n - 2];
  const double part = 112.0 / 121.0, last = 9.0 / 121.0;
  State predicted, modified, corrected, change;
  predicted.q = y3.q + (4.0 / 3.0 * h) * (2.0 * f0.q - f1.q + 2.0 * f2.q);
  predicted.v = y3.v + (4.0 / 3.0 * h) * (2.0 * f0.v - f1.v + 2.0 * f2.v);
  modified.q = predicted.q - part * past.defect.q;
  modified.v = predicted.v - part * past.defect.v;
  const Vector9 at = evaluate(time_ + h, modified, Look::kForces);
  corrected.q = (9.0 * y0.q - y2.q + (3.0 * h) * (modified.v + 2.0 * f0.q - f1.q)) / 8.0;
  corrected.v = (9.0 * y0.v - y2.v + (3.0 * h) * (at + 2.0 * f0.v - f1.v)) / 8.0;
  change.q = predicted.q - corrected.q;
  change.v = predicted.v - corrected.v;
  end.q = corrected.q + last * change.q;
  end.v = corrected.v + last * change.v;
  slope = evaluate(time_ + h, end, Look::kEvents);
  trial_defect_ = change;
  return fixed_step_ ? 0.0 : errorOf(State{last * change.q, last * change.v});
}

// the accepted step becomes the newest row of the past
void Simulation::remember(double h) {
  History& past = history_;
  if (past.count == 0 || std::abs(h - past.h) > 1e-6 * past.h) {
    past.count = 0;
    return;
  }
  if (past.count >= 4) past.defect = trial_defect_;
  if (past.count == History::kMost) {
    std::move(past.y.begin() + 1, past.y.end(), past.y.begin());
    std::move(past.slope.begin() + 1, past.slope.end(), past.slope.begin());
    --past.count;
  }
  const auto n = static_cast<std::size_t>(past.count++);
  past.y[n] = state_;
  past.slope[n] = {state_.v, slope_v_};
}

// what HPCG does after each change of the step: predictor less corrector from the past
void Simulation::resetDefect() {
  History& past = history_;
  const auto n = static_cast<std::size_t>(past.count) - 1;
  const auto defect = [&](auto part) -> Vector9 {
    return 242.0 / 27.0 * (past.y[n].*part - past.y[n - 3].*part) -
           121.0 / 36.0 * past.h *
               (past.slope[n].*part + 3.0 * (past.slope[n - 1].*part + past.slope[n - 2].*part) +
                past.slope[n - 3].*part);
  };
  past.defect = {defect(&State::q), defect(&State::v)};
}

// half the step: values between the last three from a formula of order six
void Simulation::halveHistory() {
  History& past = history_;
  const auto n = static_cast<std::size_t>(past.count) - 1;
  const double h = past.h / 256.0;
  State near, far;
  const auto between = [&](auto part) {
    const Vector9 &y0 = past.y[n].*part, &y1 = past.y[n - 1].*part, &y2 = past.y[n - 2].*part,
                  &y3 = past.y[n - 3].*part;
    const Vector9 &f0 = past.slope[n].*part, &f1 = past.slope[n - 1].*part,
                  &f2 = past.slope[n - 2].*part;
    near.*part = (80.0 * y0 + 135.0 * y1 + 40.0 * y2 + y3) / 256.0 +
                 h * (-15.0 * f0 + 90.0 * f1 + 15.0 * f2);
    far.*part = (12.0 * y0 + 135.0 * y1 + 108.0 * y2 + y3) / 256.0 +
                h * (-3.0 * f0 - 54.0 * f1 + 27.0 * f2);
  };
  between(&State::q);
  between(&State::v);
  const State y0 = past.y[n], f0 = past.slope[n], y1 = past.y[n - 1], f1 = past.slope[n - 1];
  past.h *= 0.5;
  past.y[0] = far;
  past.slope[0] = {far.v, evaluate(time_ - 3.0 * past.h, far, Look::kForces)};
  past.y[1] = y1;
  past.slope[1] = f1;
  past.y[2] = near;
  past.slope[2] = {near.v, evaluate(time_ - past.h, near, Look::kForces)};
  past.y[3] = y0;
  past.slope[3] = f0;
  past.count = 4;
  resetDefect();
}

// twice the step: every other row
void Simulation::doubleHistory() {
  History& past = history_;
  for (std::size_t i = 1; i < 4; ++i) {
    past.y[i] = past.y[2 * i];
    past.slope[i] = past.slope[2 * i];
  }
  past.count = 4;
  past.h *= 2.0;
  resetDefect();
}

}  // namespace assembly_cell
