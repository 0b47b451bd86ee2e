// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "assembly_cell/align/plant.h"

namespace assembly_cell {

/// Samples of six signals in a requested window, and the exciter's angle at each of them.
class SampleWindow {
 public:
  /// Starts a window, plant clock. Samples of an earlier one are dropped.
  void begin(const LocusRequest& window);
  void cancel() { window_.reset(); }

  /// The window that is being filled.
  const std::optional<LocusRequest>& window() const { return window_; }
  /// Samples up to `time` [s] may lie in the window.
  bool beginsBy(double time) const { return window_ && window_->start <= time; }
  /// All samples of the window have been added once those up to `time` [s] have.
  bool endsBy(double time) const;

  /// Keeps those of a block's samples that lie in the window. values: 6 × count, `period` apart,
  /// the last one at `end`, plant clock [s]. exciter: as commanded; its phase refers to
  /// `reference`, plant clock [s].
  void add(const double* values, std::size_t count, double period, double end,
           const ExciterParameters& exciter, double reference);

  const std::vector<double>& angles() const { return angles_; }    ///< of the exciter [rad]
  const std::vector<double>& signals() const { return signals_; }  ///< 6 × n

 private:
  std::optional<LocusRequest> window_;
  std::vector<double> angles_, signals_;
};

}  // namespace assembly_cell
