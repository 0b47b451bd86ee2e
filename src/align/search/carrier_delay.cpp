// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/search/carrier_delay.h"

#include <algorithm>

namespace assembly_cell {
namespace {

constexpr double kSameDelay = 0.01;  // largest difference of a settled one, in its steps [s]
constexpr double kNoiseReach = 4.0;  // sd of a reported height that are no motion
constexpr double kMinMotion = 5e-6;  // [m]

}  // namespace

void DelayMeter::begin(double height, double time) {
  commands_[0] = {height, time};
  count_ = 1;
  delay_count_ = 0;
  still_ = 0.0;
}

void DelayMeter::command(double height, double time) {
  commands_[count_ % kKept] = {height, time};
  ++count_;
}

void DelayMeter::report(double height, double time, double noise) {
  if (count_ < 2) return;
  const std::size_t oldest = count_ > kKept ? count_ - kKept : 0;
  // the height that was commanded lasts until the next command
  std::size_t next = count_ - 1;
  while (next > oldest && commands_[(next - 1) % kKept].height < height) --next;
  if (next == oldest) return;  // above all that are kept
  const Command &from = commands_[(next - 1) % kKept], &to = commands_[next % kKept];
  if (oldest == 0 && commands_[0].height - height < kMinMotion + kNoiseReach * noise) {
    still_ = time - commands_[1].time;
    return;
  }
  const double way = from.height - to.height;
  const double fraction = way > 0.0 ? std::min(1.0, (from.height - height) / way) : 1.0;
  delays_[delay_count_++ % kSteps] = time - (from.time + fraction * (to.time - from.time));
}

std::optional<double> DelayMeter::settled() const {
  if (delay_count_ < kSteps) return {};
  const auto [low, high] = std::minmax_element(delays_.begin(), delays_.end());
  if (*high - *low > kSameDelay) return {};
  double sum = 0.0;
  for (const double delay : delays_) sum += delay / kSteps;
  return sum;
}

}  // namespace assembly_cell
