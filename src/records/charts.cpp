// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/charts.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/math/distributions.h"

namespace assembly_cell {
namespace {

struct Sample {
  double mean = 0.0, sd = 0.0;
};

Sample sampleOf(const std::vector<double>& values, std::size_t count) {
  Sample s;
  for (std::size_t i = 0; i < count; ++i) s.mean += values[i];
  s.mean /= static_cast<double>(count);
  for (std::size_t i = 0; i < count; ++i) s.sd += std::pow(values[i] - s.mean, 2);
  s.sd = std::sqrt(s.sd / static_cast<double>(count - 1));
  return s;
}

void checkFinite(const std::vector<double>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) throw InputError(text("value %zu isn't a number", i + 1));
  }
}

}  // namespace

EwmaChart ewmaChart(const std::vector<double>& values, const EwmaSettings& settings) {
  const double lambda = settings.lambda;
  if (!(lambda > 0.0 && lambda <= 1.0)) {
    throw InputError(text("lambda: value %g: give a number above 0, at most 1", lambda));
  }
  if (!(settings.L > 0.0) || std::isinf(settings.L)) {
    throw InputError(text("L: value %g: give a number above 0", settings.L));
  }
  checkFinite(values);
  if (settings.baseline == 1) {
    throw InputError("baseline: value 1: give at least 2, or 0 with mean and sd");
  }
  if (values.size() < settings.baseline + 1) {
    throw InputError(
        text("baseline: value %zu: there are %zu values: give fewer, or wait for %zu "
             "values",
             settings.baseline, values.size(), settings.baseline + 1));
  }
  EwmaChart chart;
  chart.baseline = settings.baseline;
  chart.mean = settings.mean;
  chart.sd = settings.sd;
  if (settings.baseline > 0) {
    const Sample base = sampleOf(values, settings.baseline);
    chart.mean = base.mean;
    chart.sd = base.sd;
  }
  if (!(chart.sd > 0.0) || !std::isfinite(chart.sd)) {
    throw InputError(settings.baseline > 0
                         ? text("baseline: the first %zu values are all %g: without spread there "
                                "are no limits",
                                settings.baseline, chart.mean)
                         : text("sd: value %g: give a number above 0", settings.sd));
  }
  double z = chart.mean, rest = 1.0;
  chart.first_outside = values.size();
  for (std::size_t i = settings.baseline; i < values.size(); ++i) {
    z += lambda * (values[i] - z);
    rest *= (1.0 - lambda) * (1.0 - lambda);
    const double half = settings.L * chart.sd * std::sqrt(lambda / (2.0 - lambda) * (1.0 - rest));
    chart.points.push_back({z, chart.mean - half, chart.mean + half});
    if (chart.points.back().inside()) continue;
    if (chart.outside++ == 0) chart.first_outside = i;
  }
  return chart;
}

Capability capability(const std::vector<double>& values, double lower, double upper, double level) {
  if (values.size() < 2) {
    throw InputError(text("capability: %zu values: at least 2 are needed", values.size()));
  }
  checkFinite(values);
  if (!(lower < upper) || (std::isinf(lower) && std::isinf(upper))) {
    throw InputError(
        text("limits: value %g, %g: give a lower and an upper one that rise, one of "
             "them finite",
             lower, upper));
  }
  if (!(level > 0.0 && level < 1.0)) {
    throw InputError(text("level: value %g: give a number between 0 and 1", level));
  }
  Capability c;
  c.n = values.size();
  const Sample s = sampleOf(values, c.n);
  c.mean = s.mean;
  c.sd = s.sd;
  if (!(s.sd > 0.0)) {
    throw InputError(
        text("capability: all %zu values are %g: without spread there is none", c.n, c.mean));
  }
  const double nu = static_cast<double>(c.n - 1), miss = 0.5 * (1.0 - level);
  c.cp.estimate = std::isinf(upper - lower) ? std::nan("") : (upper - lower) / (6.0 * s.sd);
  const int dof = static_cast<int>(c.n - 1);
  c.cp.low = c.cp.estimate * std::sqrt(chiSquareLimit(1.0 - miss, dof) / nu);
  c.cp.high = c.cp.estimate * std::sqrt(chiSquareLimit(miss, dof) / nu);
  c.cpk.estimate = std::min(upper - s.mean, s.mean - lower) / (3.0 * s.sd);
  const double z = std::sqrt(chiSquareLimit(1.0 - level, 1));
  const double half = z * std::sqrt(1.0 / (9.0 * static_cast<double>(c.n)) +
                                    c.cpk.estimate * c.cpk.estimate / (2.0 * nu));
  c.cpk.low = c.cpk.estimate - half;
  c.cpk.high = c.cpk.estimate + half;
  return c;
}

}  // namespace assembly_cell
