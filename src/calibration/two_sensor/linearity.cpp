// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/linearity.h"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/special_functions/beta.hpp>
#include <cmath>
#include <map>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {

namespace {

constexpr double kWarnNonlinearity = 0.002, kRefuseNonlinearity = 0.005, kHysteresis = 0.001;

// P(F > f)
double fTail(double f, int d1, int d2) {
  if (d1 <= 0 || d2 <= 0 || !(f > 0.0)) return 1.0;
  if (!std::isfinite(f)) return 0.0;
  return boost::math::ibeta(0.5 * d2, 0.5 * d1, d2 / (d2 + d1 * f));
}

struct Group {
  double sum = 0.0, squares = 0.0;
  int count = 0;
  void add(double x) {
    sum += x;
    squares += x * x;
    ++count;
  }
  double mean() const { return count > 0 ? sum / count : 0.0; }
};

// Distinct loads in rising order, merged within rounding.
struct Loads {
  double low = HUGE_VAL, high = -HUGE_VAL, tolerance = 0.0;
  std::vector<double> values;

  std::size_t index(double load) const {
    return static_cast<std::size_t>(
        std::lower_bound(values.begin(), values.end(), load - tolerance) - values.begin());
  }
};

Loads loadsOf(const std::vector<LinearityStep>& steps) {
  Loads loads;
  for (const LinearityStep& step : steps) {
    if (!std::isfinite(step.load) || !std::isfinite(step.reading)) {
      throw InputError("linearity test: a load or reading is not finite: read it again");
    }
    loads.low = std::min(loads.low, step.load);
    loads.high = std::max(loads.high, step.load);
    loads.values.push_back(step.load);
  }
  loads.tolerance = 1e-6 * (loads.high - loads.low);
  std::vector<double>& values = loads.values;
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end(),
                           [&](double a, double b) { return b - a <= loads.tolerance; }),
               values.end());
  if (values.size() < 3) {
    throw InputError(
        "linearity test: " + std::to_string(values.size()) +
        " different loads: give three or more, 11 steps from 0 to full load are usual");
  }
  return loads;
}

// Groups the residuals of the line by load, and by load and direction; returns the sum of squares
// of the pure error.
double evaluateRepeats(const std::vector<LinearityStep>& steps, const Loads& loads,
                       const Eigen::VectorXd& residual, LinearityResult& out) {
  std::map<std::size_t, Group> by_load;
  std::map<std::pair<std::size_t, bool>, Group> by_direction;
  bool up = true;  // the turning points belong to both directions' ends
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (i > 0 && std::abs(steps[i].load - steps[i - 1].load) > loads.tolerance) {
      up = steps[i].load > steps[i - 1].load;
    } else if (i == 0 && steps.size() > 1) {
      up = steps[1].load >= steps[0].load;
    }
    const std::size_t k = loads.index(steps[i].load);
    by_load[k].add(residual[i]);
    by_direction[{k, up}].add(residual[i]);
  }
  for (const auto& [k, group] : by_load) {
    out.nonlinearity = std::max(out.nonlinearity, std::abs(group.mean()));
    const auto rising = by_direction.find({k, true}), falling = by_direction.find({k, false});
    if (rising == by_direction.end() || falling == by_direction.end()) continue;
    out.hysteresis =
        std::max(out.hysteresis, std::abs(rising->second.mean() - falling->second.mean()));
  }
  out.nonlinearity /= out.span;
  out.hysteresis /= out.span;
  double pure = 0.0;
  for (const auto& [key, group] : by_direction) {
    pure += std::max(group.squares - group.count * group.mean() * group.mean(), 0.0);
    out.pure_error_dof += group.count - 1;
  }
  out.lack_of_fit_dof = static_cast<int>(by_direction.size()) - 2;
  return pure;
}

}  // namespace

LinearityResult testLinearity(const std::vector<LinearityStep>& steps) {
  const auto n = static_cast<Eigen::Index>(steps.size());
  const Loads loads = loadsOf(steps);

  // straight line and parabola about the middle, in parts of the half range
  const double middle = 0.5 * (loads.low + loads.high), half = 0.5 * (loads.high - loads.low);
  Eigen::MatrixXd A(n, 3);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double x = (steps[i].load - middle) / half;
    A.row(i) << 1.0, x, x * x;
    y[i] = steps[i].reading;
  }
  const Eigen::MatrixXd straight = A.leftCols(2);
  const Eigen::VectorXd line = straight.householderQr().solve(y);
  const Eigen::VectorXd residual = y - straight * line;
  const Eigen::VectorXd parabola = A.householderQr().solve(y);
  LinearityResult out;
  out.slope = line[1] / half;
  out.intercept = line[0] - out.slope * middle;
  out.span = std::abs(out.slope) * (loads.high - loads.low);
  if (!(out.span > 0.0)) {
    throw InputError("linearity test: the channel does not react to the load: check the wiring");
  }

  // lack of fit of the line against repeats in the same direction
  const double pure = evaluateRepeats(steps, loads, residual, out);
  if (out.pure_error_dof < 1) {
    throw InputError("linearity test: no load is repeated in the same direction: run two cycles");
  }
  const double lack = std::max(residual.squaredNorm() - pure, 0.0) / out.lack_of_fit_dof;
  const double noise = pure / out.pure_error_dof;
  out.lack_of_fit_f = noise > 0.0 ? lack / noise : (lack > 0.0 ? HUGE_VAL : 0.0);
  out.lack_of_fit_p = fTail(out.lack_of_fit_f, out.lack_of_fit_dof, out.pure_error_dof);

  // quadratic coefficient: reading = … + q · span · (load/half range)²
  const double rest =
      (y - A * parabola).squaredNorm() / static_cast<double>(std::max<Eigen::Index>(n - 3, 1));
  const double variance = rest * (A.transpose() * A).inverse()(2, 2);
  out.quadratic = parabola[2] / out.span;
  out.quadratic_t = variance > 0.0 ? parabola[2] / std::sqrt(variance) : 0.0;

  const bool bent = out.nonlinearity > kRefuseNonlinearity;
  const double limit = bent ? kRefuseNonlinearity : kWarnNonlinearity;
  addGate(
      out.gates, out.nonlinearity > kWarnNonlinearity,
      {"nonlinearity", bent ? Verdict::kRefuse : Verdict::kWarn, out.nonlinearity,
       kRefuseNonlinearity,
       text("nonlinearity %.3g %% of span is above %.3g %%", 100 * out.nonlinearity, 100 * limit) +
           (bent ? ": no linear model" : "")});
  addGate(out.gates, out.hysteresis > kHysteresis,
          {"hysteresis", Verdict::kRefuse, out.hysteresis, kHysteresis,
           text("hysteresis %.3g %% of span is above %.3g %%: check gauges and clamping",
                100 * out.hysteresis, 100 * kHysteresis)});
  out.linear_model_allowed = !refused(out.gates);
  return out;
}

std::vector<LinearityStep> linearitySteps(const ObservationSet& set, Side side, int channel) {
  std::vector<LinearityStep> steps;
  for (const Observation& o : set.observations) {
    const auto& reading = o.reading[side];
    if (o.kind == ObservationKind::kLinearity && o.side == side && o.channel == channel &&
        reading && !unusable(*reading, set.sensor[side])) {
      steps.push_back({o.load, reading->volts[channel]});
    }
  }
  return steps;
}

}  // namespace assembly_cell
