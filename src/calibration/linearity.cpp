// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/linearity.h"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/special_functions/beta.hpp>
#include <cmath>
#include <cstdio>
#include <map>

#include "assembly_cell/scene/input_error.h"

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

std::string percent(const char* pattern, double value, double limit) {
  char text[160];
  std::snprintf(text, sizeof text, pattern, 100 * value, 100 * limit);
  return text;
}

}  // namespace

LinearityResult testLinearity(const std::vector<LinearityStep>& steps) {
  const auto n = static_cast<Eigen::Index>(steps.size());
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const LinearityStep& step : steps) {
    if (!std::isfinite(step.load) || !std::isfinite(step.reading)) {
      throw InputError("linearity test: a load or reading is not finite: read it again");
    }
    low = std::min(low, step.load);
    high = std::max(high, step.load);
  }
  // loads that are one but for rounding
  const double tolerance = 1e-6 * (high - low);
  std::vector<double> loads;
  for (const LinearityStep& step : steps) loads.push_back(step.load);
  std::sort(loads.begin(), loads.end());
  loads.erase(std::unique(loads.begin(), loads.end(),
                          [&](double a, double b) { return b - a <= tolerance; }),
              loads.end());
  if (loads.size() < 3) {
    throw InputError(
        "linearity test: " + std::to_string(loads.size()) +
        " different loads: give three or more, 11 steps from 0 to full load are usual");
  }
  const auto index = [&](double load) {
    return static_cast<std::size_t>(std::lower_bound(loads.begin(), loads.end(), load - tolerance) -
                                    loads.begin());
  };

  // straight line and parabola about the middle, in parts of the half range
  const double middle = 0.5 * (low + high), half = 0.5 * (high - low);
  Eigen::MatrixXd A(n, 3);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const LinearityStep& step = steps[static_cast<std::size_t>(i)];
    const double x = (step.load - middle) / half;
    A.row(i) << 1.0, x, x * x;
    y[i] = step.reading;
  }
  const Eigen::VectorXd line = A.leftCols<2>().householderQr().solve(y);
  const Eigen::VectorXd residual = y - A.leftCols<2>() * line;
  const Eigen::VectorXd parabola = A.householderQr().solve(y);
  LinearityResult out;
  out.slope = line[1] / half;
  out.intercept = line[0] - out.slope * middle;
  out.span = std::abs(out.slope) * (high - low);
  if (!(out.span > 0.0)) {
    throw InputError("linearity test: the channel does not react to the load: check the wiring");
  }

  // by load, and by load and direction; the turning points belong to both directions' ends
  std::map<std::size_t, Group> by_load;
  std::map<std::pair<std::size_t, bool>, Group> by_direction;
  bool up = true;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (i > 0 && std::abs(steps[i].load - steps[i - 1].load) > tolerance) {
      up = steps[i].load > steps[i - 1].load;
    } else if (i == 0 && steps.size() > 1) {
      up = steps[1].load >= steps[0].load;
    }
    const std::size_t k = index(steps[i].load);
    const double r = residual[static_cast<Eigen::Index>(i)];
    by_load[k].add(r);
    by_direction[{k, up}].add(r);
  }
  double nonlinearity = 0.0, hysteresis = 0.0;
  for (const auto& [k, group] : by_load) {
    nonlinearity = std::max(nonlinearity, std::abs(group.mean()));
    const auto rising = by_direction.find({k, true}), falling = by_direction.find({k, false});
    if (rising != by_direction.end() && falling != by_direction.end()) {
      hysteresis = std::max(hysteresis, std::abs(rising->second.mean() - falling->second.mean()));
    }
  }
  out.nonlinearity = nonlinearity / out.span;
  out.hysteresis = hysteresis / out.span;

  // lack of fit of the line against repeats in the same direction
  double pure = 0.0;
  for (const auto& [key, group] : by_direction) {
    pure += std::max(group.squares - group.count * group.mean() * group.mean(), 0.0);
    out.pure_error_dof += group.count - 1;
  }
  if (out.pure_error_dof < 1) {
    throw InputError("linearity test: no load is repeated in the same direction: run two cycles");
  }
  out.lack_of_fit_dof = static_cast<int>(by_direction.size()) - 2;
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

  Gate line_gate{"nonlinearity", Verdict::kPass, out.nonlinearity, kRefuseNonlinearity, ""};
  if (out.nonlinearity > kRefuseNonlinearity) {
    line_gate.verdict = Verdict::kRefuse;
    line_gate.text = percent("nonlinearity %.3g %% of span is above %.3g %%: no linear model",
                             out.nonlinearity, kRefuseNonlinearity);
  } else if (out.nonlinearity > kWarnNonlinearity) {
    line_gate.verdict = Verdict::kWarn;
    line_gate.text = percent("nonlinearity %.3g %% of span is above %.3g %%", out.nonlinearity,
                             kWarnNonlinearity);
  }
  Gate loop{"hysteresis", Verdict::kPass, out.hysteresis, kHysteresis, ""};
  if (out.hysteresis > kHysteresis) {
    loop.verdict = Verdict::kRefuse;
    loop.text = percent("hysteresis %.3g %% of span is above %.3g %%: check gauges and clamping",
                        out.hysteresis, kHysteresis);
  }
  out.gates = {line_gate, loop};
  out.linear_model_allowed = !refused(out.gates);
  return out;
}

std::vector<LinearityStep> linearitySteps(const ObservationSet& set, Side side, int channel) {
  std::vector<LinearityStep> steps;
  for (const Observation& o : set.observations) {
    const auto& reading = side == Side::kA ? o.a : o.b;
    if (o.kind == ObservationKind::kLinearity && o.side == side && o.channel == channel &&
        reading && unusable(*reading, side == Side::kA ? set.a : set.b).empty()) {
      steps.push_back({o.load, reading->volts[channel]});
    }
  }
  return steps;
}

}  // namespace assembly_cell
