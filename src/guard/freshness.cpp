// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/guard/freshness.h"

#include <algorithm>

namespace assembly_cell {
namespace {

constexpr double kSteady = 0.9;  // of the stamps' distance: closer together is a burst
constexpr double kJump = 2.0;    // times the previous interval: a freeze, or the plant slows down
constexpr double kMaxInterval = 0.5;  // wall time between two steady messages [s]
constexpr double kFollow = 0.8;       // fraction of the delay's growth that a steady message adds
constexpr int kSettled = 4;           // steady messages until the present delay is taken over
constexpr double kStampStep = 0.1;    // between two blocks; more: blocks were lost [s]

}  // namespace

void CellClock::observe(double wall, double stamp) {
  const double delay = wall - stamp;
  const double passed = wall - wall_, advanced = stamp - stamp_;
  // the cell's clock went back: the plant was restarted
  const bool restarted = !known_ || advanced < 0.0;
  const bool steady =
      !restarted && passed >= kSteady * advanced && passed < kMaxInterval && advanced < kStampStep;
  if (restarted || delay < delay_) {
    delay_ = delay;
  } else if (steady && steady_ > 0 && passed <= kJump * passed_) {
    delay_ += (steady_ < kSettled ? kFollow : 1.0) * (delay - delay_);
  }
  known_ = true;
  steady_ = steady ? std::min(steady_ + 1, kSettled) : 0;
  passed_ = passed;
  wall_ = wall;
  stamp_ = stamp;
}

double CellClock::now(double wall) const {
  if (!known_ || !follows_wall_) return stamp_;
  return std::max(stamp_, wall - delay_);
}

}  // namespace assembly_cell
