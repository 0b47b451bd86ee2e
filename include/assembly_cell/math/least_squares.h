// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace assembly_cell {

/// What keeps a Gauss–Newton step from raising the cost.
enum class StepControl {
  kNone,     ///< nothing: every step is taken
  kDamping,  ///< Levenberg–Marquardt: a step that fails is recomputed with more damping
  kHalving   ///< a step that fails is halved, down to the tolerance
};

/// λ of Levenberg–Marquardt in (H + λ diag H) δ = −g. A step that succeeds divides λ by 10, one
/// that fails multiplies it by 10.
struct Damping {
  double initial = 0.0;
  double min = 0.0;      ///< lower bound after a success
  double off = 0.0;      ///< below it λ becomes 0: plain Gauss–Newton
  double restart = 0.0;  ///< lower bound after a failure
  double max = std::numeric_limits<double>::infinity();  ///< above it the iteration ends
};

struct LeastSquaresOptions {
  int max_iterations = 30;                                    ///< linearised systems solved
  double max_step = std::numeric_limits<double>::infinity();  ///< norm to which a step is shortened
  double min_decrease = 0.0;  ///< of the cost: the iteration ends after a success that gains less
  bool accept_equal = true;   ///< whether a step that leaves the cost as it is succeeds
  Damping damping;            ///< for StepControl::kDamping
};

struct LeastSquaresResult {
  double cost = 0.0;   ///< at the end; 0 for StepControl::kNone
  int iterations = 0;  ///< completed before the one in which a stopping rule was met
};

namespace least_squares {

inline void limit(double& step, double max) { step = std::clamp(step, -max, max); }
template <typename Derived>
void limit(Eigen::MatrixBase<Derived>& step, double max) {
  step *= std::min(1.0, max / std::max(step.norm(), 1e-12));
}

}  // namespace least_squares

/// Minimises a sum of squares ‖r(x)‖² from x by Gauss–Newton steps δ = −H⁻¹ g, H = JᵀJ, g = Jᵀr
/// (Nocedal & Wright, Numerical Optimization, chapter 10). `Problem` owns residuals, Jacobian and
/// factorisation. A step is a double or an Eigen vector, a state anything with `x + step`:
///
///   void linearise(const State& x);      at the start, and after each step that succeeded and was
///                                        not the last; x is then the one of the last cost()
///   Step step(double damping) const;     δ of the linearised system; λ is 0 but for kDamping
///   bool small(const Step& step) const;  stopping rule: whether this step is the last
///   double cost(const State& x);         not for kNone; NaN is a failure
///
/// Exceptions of the problem pass through.
template <StepControl control, typename Problem, typename State>
LeastSquaresResult minimise(Problem& problem, State& x, const LeastSquaresOptions& options) {
  const Damping& bounds = options.damping;
  LeastSquaresResult result;
  double damping = bounds.initial;
  bool moved = true;
  if constexpr (control != StepControl::kNone) result.cost = problem.cost(x);
  for (; result.iterations < options.max_iterations; ++result.iterations) {
    if (moved) problem.linearise(x);
    auto step = problem.step(damping);
    if (std::isfinite(options.max_step)) least_squares::limit(step, options.max_step);
    State next = x + step;
    if constexpr (control == StepControl::kNone) {
      x = next;
    } else {
      double cost = problem.cost(next);
      if constexpr (control == StepControl::kHalving) {
        for (int k = 0; k < 60 && !(cost <= result.cost || problem.small(step)); ++k) {
          step *= 0.5;
          next = x + step;
          cost = problem.cost(next);
        }
      }
      const double decrease = result.cost - cost;
      moved = options.accept_equal ? decrease >= 0.0 : decrease > 0.0;
      if (moved) {
        x = next;
        result.cost = cost;
        damping = std::max(bounds.min, 0.1 * damping);
        if (damping < bounds.off) damping = 0.0;
        if (decrease < options.min_decrease) break;
      } else {
        damping = std::max(bounds.restart, 10.0 * damping);
        if (control == StepControl::kHalving || damping > bounds.max) break;
      }
    }
    if (problem.small(step)) break;
  }
  return result;
}

}  // namespace assembly_cell
