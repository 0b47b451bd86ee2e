// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/common/drift.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

namespace {

constexpr std::size_t kMinWindow = 8;
constexpr double kLargestCorrelation = 0.98;  // clamp: beyond it the noise cannot be estimated

}  // namespace

const char* toString(Settling verdict) {
  return std::array{"filling", "spread", "trend", "settled"}[static_cast<std::size_t>(verdict)];
}

SettledWindow::SettledWindow(const SettlingLimits& limits) : limits_(limits) {
  const auto refuse = [](const char* name, double value, const char* remedy) {
    throw InputError(std::string("settling: ") + name + " is " + std::to_string(value) + ": " +
                     remedy);
  };
  if (limits.window < kMinWindow) {
    refuse("window", static_cast<double>(limits.window), "give at least 8 samples");
  }
  for (const double noise : limits.noise) {
    if (!(noise >= 0.0) || !std::isfinite(noise)) {
      refuse("noise", noise, "give a finite sd, at least 0");
    }
  }
  const auto positive = [&](const char* name, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) refuse(name, value, "give a positive number");
  };
  positive("spread", limits.spread);
  positive("trend", limits.trend);
  positive("significance", limits.significance);
  samples_.resize(limits.window);
  tails_.resize(limits.window + 1);
}

SettledWindow::Run SettledWindow::runOf(const Vector6& x) {
  Run run;
  run.count = 1.0;
  run.sum = run.low = run.high = run.first = run.last = x;
  run.squares = x.cwiseAbs2();
  return run;
}

SettledWindow::Run SettledWindow::join(const Run& early, const Run& late) {
  if (early.count == 0.0) return late;
  if (late.count == 0.0) return early;
  Run run;
  run.count = early.count + late.count;
  run.sum = early.sum + late.sum;
  run.squares = early.squares + late.squares;
  run.moment = early.moment + late.moment + early.count * late.sum;
  run.steps = early.steps + late.steps + (late.first - early.last).cwiseAbs2();
  run.low = early.low.cwiseMin(late.low);
  run.high = early.high.cwiseMax(late.high);
  run.first = early.first;
  run.last = late.last;
  return run;
}

void SettledWindow::add(const Vector6& sample) {
  if (!sample.allFinite()) {
    clear();
    return;
  }
  if (position_ == 0 && !full_) reference_ = sample;
  samples_[position_] = sample;
  head_ = join(head_, runOf(sample - reference_));
  if (++position_ < limits_.window) return;

  // end of a lap: its tails are the older part of the next windows
  full_ = true;
  position_ = 0;
  reference_ = sample;
  head_ = Run();
  for (std::size_t k = limits_.window; k-- > 0;) {
    tails_[k] = join(runOf(samples_[k] - reference_), tails_[k + 1]);
  }
}

void SettledWindow::clear() {
  position_ = 0;
  full_ = false;
  head_ = Run();
}

SettledWindow::Run SettledWindow::window() const {
  return full_ ? join(tails_[position_], head_) : head_;
}

SettlingReport SettledWindow::report() const {
  SettlingReport report;
  const Run run = window();
  report.samples = static_cast<std::size_t>(run.count);
  if (run.count < 1.0) return report;
  const double n = run.count;
  const Vector6 mean = run.sum / n;
  report.mean = reference_ + mean;
  if (report.samples < kMinWindow) return report;

  // straight line, scatter about it, and the correlation of its noise
  const double moment = n * (n * n - 1.0) / 12.0;
  const Vector6 slope = (run.moment - 0.5 * (n - 1.0) * run.sum) / moment;
  const Vector6 squares =
      (run.squares - n * mean.cwiseAbs2() - moment * slope.cwiseAbs2()).cwiseMax(0.0);
  const Vector6 white = (run.steps / (2.0 * (n - 1.0))).cwiseMax(0.0);
  double worst = -1.0;
  for (int a = 0; a < 6; ++a) {
    const double sd = std::sqrt(squares[a] / (n - 2.0));
    const double yardstick = limits_.noise[a] > 0.0 ? limits_.noise[a] : std::sqrt(white[a]);
    const double rough = std::max(white[a] - 0.5 * slope[a] * slope[a], 0.0);  // off the line
    const double memory =
        sd > 0.0 ? std::clamp(1.0 - rough / (sd * sd), 0.0, kLargestCorrelation) : 0.0;
    const double inflation = (1.0 + memory) / (1.0 - memory);
    const double scatter = std::max(sd, limits_.noise[a]) * std::sqrt(inflation);
    report.sd[a] = sd;
    report.variance[a] = scatter * scatter / n;
    report.change[a] = slope[a] * (n - 1.0);
    report.change_sd[a] = scatter / std::sqrt(moment) * (n - 1.0);

    // a signal that never changes is settled whatever its yardstick
    const double reach = std::max(run.high[a] - mean[a], mean[a] - run.low[a]);
    if (yardstick <= 0.0) continue;
    report.deviation[a] = reach / yardstick;
    const double spread_ratio = report.deviation[a] / limits_.spread;
    const double size_ratio = std::abs(report.change[a]) / (limits_.trend * yardstick);
    const double sure_ratio =
        report.change_sd[a] > 0.0
            ? std::abs(report.change[a]) / (limits_.significance * report.change_sd[a])
            : size_ratio;
    const double trend_ratio = std::min(size_ratio, sure_ratio);
    const double ratio = std::max(spread_ratio, trend_ratio);
    if (ratio <= worst) continue;
    worst = ratio;
    report.axis = a;
    report.verdict = ratio <= 1.0                 ? Settling::kSettled
                     : trend_ratio > spread_ratio ? Settling::kTrend
                                                  : Settling::kSpread;
  }
  if (worst < 0.0) report.verdict = Settling::kSettled;
  if (report.samples < limits_.window) report.verdict = Settling::kFilling;
  return report;
}

}  // namespace assembly_cell
