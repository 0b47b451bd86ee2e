// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/stamp_filter.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/sensor/reception.h"

namespace assembly_cell {

namespace {

constexpr double kLongestDelay = 0.25;    // beyond the minimum; more is a pause of the device [s]
constexpr double kLongestBase = 1e3;      // keeps times exact to 1e-13 s [s]
constexpr std::size_t kMinArrivals = 16;  // for a period of one's own

double seconds(std::chrono::nanoseconds duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

StampFilter::Line StampFilter::fit(double nominal) const {
  const std::size_t oldest = size_ < kWindow ? 0 : next_;
  const auto at = [&](std::size_t i) -> const Arrival& {
    return arrivals_[(oldest + i) % kWindow];
  };
  // few arrivals, or one sample only: the nominal period under all of them
  if ((size_ < kMinArrivals && nominal > 0.0) || at(0).sample == at(size_ - 1).sample) {
    double time = at(0).time - nominal * at(0).sample;
    for (std::size_t i = 1; i < size_; ++i) {
      time = std::min(time, at(i).time - nominal * at(i).sample);
    }
    return {time, nominal};
  }

  // lower hull from left to right
  std::array<Arrival, kWindow> hull;
  std::size_t corners = 0;
  double mean = 0.0;
  for (std::size_t i = 0; i < size_; ++i) {
    const Arrival& c = at(i);
    mean += c.sample / static_cast<double>(size_);
    while (corners >= 2) {
      const Arrival& a = hull[corners - 2];
      const Arrival& b = hull[corners - 1];
      const double turn =
          (b.sample - a.sample) * (c.time - a.time) - (b.time - a.time) * (c.sample - a.sample);
      if (turn > 0.0) break;
      --corners;
    }
    hull[corners++] = c;
  }
  // the edge over the arrivals' mean is the supporting line with the minimal sum of delays
  std::size_t right = 1;
  while (right + 1 < corners && hull[right].sample < mean) ++right;
  const Arrival& a = hull[right - 1];
  const Arrival& b = hull[right];
  const double period = (b.time - a.time) / (b.sample - a.sample);
  return {a.time - period * a.sample, period};
}

void StampFilter::rebase() {
  const std::size_t newest = (next_ + kWindow - 1) % kWindow;
  const auto shift_samples = static_cast<std::uint64_t>(arrivals_[newest].sample);
  const auto shift_time = nanoseconds(std::floor(arrivals_[newest].time));
  for (Arrival& arrival : arrivals_) {
    arrival.sample -= static_cast<double>(shift_samples);
    arrival.time -= seconds(shift_time);
  }
  last_ -= seconds(shift_time);
  base_sequence_ += shift_samples;
  base_time_ += shift_time;
}

StampFilter::Stamp StampFilter::update(const SourceBlock& block) {
  const std::size_t count = std::max<std::size_t>(block.count, 1);
  const std::uint64_t newest = block.sequence + count - 1;
  if (block.stream != stream_ || newest <= base_sequence_) reset();
  for (int attempt = 0;; ++attempt) {
    const bool restarted = size_ == 0;
    if (restarted) {
      next_ = 0;
      stream_ = block.stream;
      base_sequence_ = newest;
      base_time_ = block.received.steady;
    } else if (seconds(block.received.steady - base_time_) > kLongestBase) {
      rebase();
    }
    const double sample = static_cast<double>(newest - base_sequence_);
    const double arrived = seconds(block.received.steady - base_time_);
    arrivals_[next_] = {sample, arrived};
    next_ = (next_ + 1) % kWindow;
    size_ = std::min(size_ + 1, kWindow);

    const Line line = fit(block.period);
    double time = line.time + line.period * sample;
    // what had no number while the device was silent lets the line end long before the arrival
    if (arrived - time > kLongestDelay && attempt == 0) {
      reset();
      continue;
    }
    // no stamp is after its arrival; as far as that goes, stamps follow one another
    const double first = line.period * static_cast<double>(count - 1);
    if (!restarted) time = std::max(time, last_ + line.period * static_cast<double>(count));
    time = std::min(time, arrived);
    last_ = time;

    Stamp stamp;
    stamp.time.steady = base_time_ + nanoseconds(time - first);
    stamp.time.system =
        block.received.system - std::chrono::duration_cast<std::chrono::system_clock::duration>(
                                    block.received.steady - stamp.time.steady);
    stamp.period = line.period;
    stamp.delay = arrived - time;
    stamp.restarted = restarted;
    return stamp;
  }
}

}  // namespace assembly_cell
