// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/frozen_readings.h"

#include <algorithm>

#include "assembly_cell/base/text.h"

namespace assembly_cell {

void FrozenReadings::add(const double* sample, double period) {
  if (run_ > 0 && std::equal(last_.begin(), last_.end(), sample)) {
    ++run_;
    time_ += period;
  } else {
    std::copy_n(sample, last_.size(), last_.begin());
    run_ = 1;
    time_ = 0.0;
  }
  longest_ = std::max(longest_, run_);
}

std::string FrozenReadings::describe() const {
  const bool zero = std::all_of(last_.begin(), last_.end(), [](double x) { return x == 0.0; });
  return std::string(zero ? "all six channels have read exactly zero"
                          : "all six channels have had exactly the same reading") +
         text(" for %.2g s (%zu samples)", time_, run_);
}

std::string FrozenReadings::report() {
  const std::size_t longest = longest_;
  longest_ = run_;
  if (limit_ <= 0.0 || longest < kReported) return {};
  if (run_ >= kReported) return describe();
  return text("%zu samples in a row with exactly the same reading in all six channels", longest);
}

}  // namespace assembly_cell
