// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The multistep method and its history.
#include <algorithm>
#include <cmath>

#include "integrator.h"

namespace assembly_cell {
namespace {

// Error of the first step against two of half its size, over the tolerance.
double firstError(const System& s, const Context& c, double h, Evaluation& e) {
  Trial whole, half;
  whole.h = h;
  half.h = 0.5 * h;
  attemptStep(s, c, Method::kHamming, whole, e);
  attemptStep(s, c, Method::kHamming, half, e);
  Context middle = c;
  middle.time += half.h;
  middle.state = half.end;
  middle.slope = half.slope;
  middle.carrier_deflection_rate = half.carrier_deflection_rate;
  attemptStep(s, middle, Method::kHamming, half, e);
  return errorOf(s, {(half.end.q - whole.end.q) / 15.0, (half.end.v - whole.end.v) / 15.0,
                     (half.end.carrier_deflection - whole.end.carrier_deflection) / 15.0});
}

}  // namespace

// Hamming's modified predictor–corrector as in IBM's HPCG: Ralston's method for the first three
// steps; then predictor, modifier, corrector, final value; the slope is evaluated at the modified
// predictor and at the final value.
void Integrator::attemptHamming(const System& s, const Context& c, Trial& step, Evaluation& e) {
  Past& past = past_;
  const double h = step.h;
  if (past.count == 0 || std::abs(h - past.h) > 1e-6 * past.h) {
    past.y[0] = c.state;
    past.slope[0] = {c.state.v, c.slope, c.carrier_deflection_rate};
    past.count = 1;
    past.h = h;
    past.defect = {};
  }
  if (past.count < 4) {
    const double error = !s.fixed_step && past.count == 1 ? firstError(s, c, h, e) : 0.0;
    attemptStep(s, c, Method::kHamming, step, e);
    step.error = error;
    return;
  }
  const int n = past.count - 1;
  const State &y0 = past.y[n], &y2 = past.y[n - 2], &y3 = past.y[n - 3];
  const State &f0 = past.slope[n], &f1 = past.slope[n - 1], &f2 = past.slope[n - 2];
  const double part = 112.0 / 121.0, last = 9.0 / 121.0;
  State modified, at, change;
  const auto predict = [&](auto part_of) {
    const auto predicted =
        (y3.*part_of + (4.0 / 3.0 * h) * (2.0 * f0.*part_of - f1.*part_of + 2.0 * f2.*part_of))
            .eval();
    modified.*part_of = predicted - part * past.defect.*part_of;
    change.*part_of = predicted;
  };
  predict(&State::q);
  predict(&State::v);
  predict(&State::carrier_deflection);
  at.v = evaluate(s, c, c.time + h, modified, Level::kForces, e);
  at.q = modified.v;
  at.carrier_deflection = e.motion.carrier_deflection_rate;
  const auto correct = [&](auto part_of) {
    const auto corrected = ((9.0 * y0.*part_of - y2.*part_of +
                             (3.0 * h) * (at.*part_of + 2.0 * f0.*part_of - f1.*part_of)) /
                            8.0)
                               .eval();
    change.*part_of -= corrected;
    step.end.*part_of = corrected + last * change.*part_of;
  };
  correct(&State::q);
  correct(&State::v);
  correct(&State::carrier_deflection);
  step.slope = evaluate(s, c, c.time + h, step.end, Level::kEvents, e);
  step.carrier_deflection_rate = e.motion.carrier_deflection_rate;
  trial_defect_ = change;
  step.error =
      s.fixed_step
          ? 0.0
          : errorOf(s, {last * change.q, last * change.v, last * change.carrier_deflection});
}

// Appends the accepted step to the history.
void Integrator::remember(const Context& c, double h) {
  Past& past = past_;
  if (past.count == 0 || std::abs(h - past.h) > 1e-6 * past.h) {
    past.count = 0;
    return;
  }
  if (past.count >= 4) past.defect = trial_defect_;
  if (past.count == Past::kMaxRows) {
    std::move(past.y.begin() + 1, past.y.end(), past.y.begin());
    std::move(past.slope.begin() + 1, past.slope.end(), past.slope.begin());
    --past.count;
  }
  const int n = past.count++;
  past.y[n] = c.state;
  past.slope[n] = {c.state.v, c.slope, c.carrier_deflection_rate};
}

// Difference of predictor and corrector from the history, as in HPCG after a change of step size.
void Integrator::resetDefect() {
  Past& past = past_;
  const int n = past.count - 1;
  const auto defect = [&](auto part) {
    past.defect.*part =
        242.0 / 27.0 * (past.y[n].*part - past.y[n - 3].*part) -
        121.0 / 36.0 * past.h *
            (past.slope[n].*part + 3.0 * (past.slope[n - 1].*part + past.slope[n - 2].*part) +
             past.slope[n - 3].*part);
  };
  defect(&State::q);
  defect(&State::v);
  defect(&State::carrier_deflection);
}

// Halves the step size; values between the last three rows by a formula of order six.
void Integrator::halvePast(const System& s, const Context& c, Evaluation& e) {
  Past& past = past_;
  const int n = past.count - 1;
  const double h = past.h / 256.0;
  State near, far;
  const auto between = [&](auto part) {
    const auto &y0 = past.y[n].*part, &y1 = past.y[n - 1].*part, &y2 = past.y[n - 2].*part,
               &y3 = past.y[n - 3].*part;
    const auto &f0 = past.slope[n].*part, &f1 = past.slope[n - 1].*part,
               &f2 = past.slope[n - 2].*part;
    near.*part = (80.0 * y0 + 135.0 * y1 + 40.0 * y2 + y3) / 256.0 +
                 h * (-15.0 * f0 + 90.0 * f1 + 15.0 * f2);
    far.*part = (12.0 * y0 + 135.0 * y1 + 108.0 * y2 + y3) / 256.0 +
                h * (-3.0 * f0 - 54.0 * f1 + 27.0 * f2);
  };
  between(&State::q);
  between(&State::v);
  between(&State::carrier_deflection);
  const State y0 = past.y[n], f0 = past.slope[n], y1 = past.y[n - 1], f1 = past.slope[n - 1];
  past.h *= 0.5;
  past.y[0] = far;
  past.slope[0].v = evaluate(s, c, c.time - 3.0 * past.h, far, Level::kForces, e);
  past.slope[0].q = far.v;
  past.slope[0].carrier_deflection = e.motion.carrier_deflection_rate;
  past.y[1] = y1;
  past.slope[1] = f1;
  past.y[2] = near;
  past.slope[2].v = evaluate(s, c, c.time - past.h, near, Level::kForces, e);
  past.slope[2].q = near.v;
  past.slope[2].carrier_deflection = e.motion.carrier_deflection_rate;
  past.y[3] = y0;
  past.slope[3] = f0;
  past.count = 4;
  resetDefect();
}

// Doubles the step size: keeps every other row.
void Integrator::doublePast() {
  Past& past = past_;
  for (int i = 1; i < 4; ++i) {
    past.y[i] = past.y[2 * i];
    past.slope[i] = past.slope[2 * i];
  }
  past.count = 4;
  past.h *= 2.0;
  resetDefect();
}

}  // namespace assembly_cell
