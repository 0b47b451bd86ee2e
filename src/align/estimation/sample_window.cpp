// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/sample_window.h"

namespace assembly_cell {

namespace {

constexpr double kRounding = 0.01;      // of a sample's period, at a window's ends
constexpr double kTimeRounding = 1e-8;  // of stamps in whole nanoseconds [s]

}  // namespace

void SampleWindow::begin(const LocusRequest& window) {
  window_ = window;
  angles_.clear();
  signals_.clear();
}

bool SampleWindow::endsBy(double time) const {
  return window_ && time >= window_->start + window_->duration - kTimeRounding;
}

void SampleWindow::add(const double* values, std::size_t count, double period, double end,
                       const ExciterParameters& exciter, double reference) {
  if (!window_) return;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = end - static_cast<double>(count - 1 - i) * period;
    const double since = t - window_->start + kRounding * period;
    if (since < 0.0 || since >= window_->duration) continue;
    angles_.push_back(exciter.direction * (exciter.frequency * (t - reference) + exciter.phase));
    signals_.insert(signals_.end(), values + 6 * i, values + 6 * i + 6);
  }
}

}  // namespace assembly_cell
