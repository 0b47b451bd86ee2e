// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/stamp_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace assembly_cell {
namespace {

using std::chrono::nanoseconds;

constexpr double kPeriod = 1.0 / 7003.0;   // the device's own [s]
constexpr double kNominal = 1.0 / 7000.0;  // what it says [s]
constexpr std::uint64_t kPerBlock = 35;    // 5 ms

nanoseconds ns(double seconds) { return nanoseconds(std::llround(seconds * 1e9)); }

// A device that takes sample n at n·kPeriod, seen through a link with a random delay.
class Link {
 public:
  SourceBlock& next(double delay) {
    block_.count = kPerBlock;
    block_.sequence = sequence_;
    block_.stream = 1;
    block_.period = kNominal;
    taken_ = pause_ + static_cast<double>(sequence_) * kPeriod;
    const double arrival = taken_ + static_cast<double>(kPerBlock - 1) * kPeriod + delay;
    block_.received.steady = epoch_ + ns(arrival);
    block_.received.system = std::chrono::system_clock::time_point() + ns(1e9 + arrival + step_);
    sequence_ += kPerBlock;
    return block_;
  }
  void skip(std::uint64_t samples) { sequence_ += samples; }
  void pause(double seconds) { pause_ += seconds; }
  void stepSystemClock(double seconds) { step_ += seconds; }

  /// Error of a stamp against when the first sample was taken [s].
  double error(const StampFilter::Stamp& stamp) const {
    return std::chrono::duration<double>(stamp.time.steady - epoch_).count() - taken_;
  }
  double systemError(const StampFilter::Stamp& stamp) const {
    const auto since = stamp.time.system - std::chrono::system_clock::time_point() - ns(1e9);
    return std::chrono::duration<double>(since).count() - step_ - taken_;
  }

 private:
  SourceBlock block_;
  std::uint64_t sequence_ = 0;
  double taken_ = 0.0, step_ = 0.0, pause_ = 0.0;
  std::chrono::steady_clock::time_point epoch_{std::chrono::hours(1000)};
};

// Exponential delays as of a busy computer: mean 1 ms, now and then 30 ms.
struct Delays {
  std::mt19937_64 engine{7};
  double operator()() {
    std::exponential_distribution<double> usual(1e3), rare(1.0 / 0.03);
    std::uniform_real_distribution<double> chance;
    return usual(engine) + (chance(engine) < 0.02 ? std::min(0.2, rare(engine)) : 0.0);
  }
};

TEST(StampFilter, TakesTheJitterOut) {
  Link link;
  Delays delays;
  StampFilter filter;
  double worst = 0.0, sum = 0.0, raw = 0.0;
  int blocks = 0;
  for (int i = 0; i < 20000; ++i) {
    const double delay = delays();
    const auto stamp = filter.update(link.next(delay));
    if (i < 256) continue;
    const double error = link.error(stamp);
    worst = std::max(worst, std::abs(error));
    sum += error * error;
    raw += delay * delay;
    ++blocks;
    // a hull of 256 exponential delays rests on some of the smallest: 1 ms/256 each; over 1.3 s
    EXPECT_NEAR(stamp.period, kPeriod, 1e-3 * kPeriod);
  }
  // measured 20 us and 0.2 ms; the arrivals' own rms is 5 ms and the worst 0.2 s
  EXPECT_LT(std::sqrt(sum / blocks), 50e-6);
  EXPECT_LT(worst, 0.5e-3);
  EXPECT_GT(std::sqrt(raw / blocks), 1e-3);
}

TEST(StampFilter, FindsThePeriodOfAQuietLinkExactly) {
  Link link;
  StampFilter filter;
  StampFilter::Stamp stamp;
  for (int i = 0; i < 300; ++i) {
    stamp = filter.update(link.next(0.0));
    EXPECT_NEAR(link.error(stamp), 0.0, i < 16 ? 1e-4 : 2e-9)
        << i;  // nominal period; then rounding to ns
  }
  EXPECT_NEAR(stamp.period, kPeriod, 1e-9 * kPeriod * 100);
}

TEST(StampFilter, SystemClockStepsMoveStampsByTheStepAlone) {
  for (const double step : {3600.0, -3600.0, 0.5, -0.5}) {
    Link link;
    Delays delays;
    StampFilter filter;
    for (int i = 0; i < 600; ++i) {
      if (i == 300) link.stepSystemClock(step);
      const auto stamp = filter.update(link.next(delays()));
      EXPECT_NEAR(link.systemError(stamp), link.error(stamp), 1e-6) << i;
      EXPECT_EQ(stamp.restarted, i == 0);
    }
  }
}

TEST(StampFilter, GapsInTheSequenceAreGapsInTime) {
  Link link;
  StampFilter filter;
  for (int i = 0; i < 600; ++i) {
    if (i % 7 == 0) link.skip(1 + static_cast<std::uint64_t>(i));
    EXPECT_NEAR(link.error(filter.update(link.next(0.0))), 0.0, i < 16 ? 1e-3 : 2e-9);
  }
}

TEST(StampFilter, NeverAfterArrivalAndNeverBackwards) {
  Link link;
  Delays delays;
  StampFilter filter;
  auto last = std::chrono::steady_clock::time_point::min();
  for (int i = 0; i < 5000; ++i) {
    // a delay that shrinks or grows for good by less than a block
    const SourceBlock& block = link.next(delays() + (i / 1000 % 2 == 0 ? 0.004 : 0.0));
    const auto stamp = filter.update(block);
    EXPECT_LE(stamp.time.steady + ns(stamp.period * (kPerBlock - 1)),
              block.received.steady + nanoseconds(2));
    EXPECT_GE(stamp.time.steady + nanoseconds(2), last) << i;
    last = stamp.time.steady;
  }
}

// The line moves with every arrival; no sample is stamped twice for that.
TEST(StampFilter, SamplesAreAPeriodApartAsFarAsArrivalsAllow) {
  Link link;
  Delays delays;
  StampFilter filter;
  auto last = std::chrono::steady_clock::time_point::min();
  int free = 0;
  for (int i = 0; i < 5000; ++i) {
    // grows for good by less than a block, then shrinks
    const SourceBlock& block = link.next(delays() + (i / 1000 % 2 == 0 ? 0.0 : 0.004));
    const auto stamp = filter.update(block);
    const auto end = stamp.time.steady + ns(stamp.period * (kPerBlock - 1));
    if (i > 0 && end + nanoseconds(2) < block.received.steady) {
      EXPECT_GE(stamp.time.steady, last + ns(0.99 * stamp.period)) << i;
      ++free;
    }
    last = end;
  }
  EXPECT_GT(free, 1000);
}

TEST(StampFilter, RestartsAfterAPauseWithoutNumbersAndForAnotherStream) {
  Link link;
  StampFilter filter;
  for (int i = 0; i < 300; ++i) filter.update(link.next(0.0));
  link.pause(3.0);
  auto stamp = filter.update(link.next(0.0));
  EXPECT_TRUE(stamp.restarted);
  EXPECT_NEAR(link.error(stamp), 0.0, 1e-4);
  SourceBlock& block = link.next(0.0);
  block.stream = 2;
  EXPECT_TRUE(filter.update(block).restarted);
}

TEST(StampFilter, WorksWithoutANominalPeriodAndForSingleSamples) {
  StampFilter filter;
  SourceBlock block;
  block.count = 1;
  for (int i = 0; i < 400; ++i) {
    block.sequence = static_cast<std::uint64_t>(i);
    block.received.steady =
        std::chrono::steady_clock::time_point(std::chrono::hours(1)) + ns(i * 0.01);
    const auto stamp = filter.update(block);
    EXPECT_NEAR(std::chrono::duration<double>(block.received.steady - stamp.time.steady).count(),
                0.0, 2e-9);
    if (i < 2) continue;
    EXPECT_NEAR(stamp.period, 0.01, 1e-9);
  }
}

TEST(StampFilter, StaysExactForDays) {
  Link link;
  StampFilter filter;
  for (int i = 0; i < 3000; ++i) {
    link.skip(7003ull * 100);
    EXPECT_NEAR(link.error(filter.update(link.next(0.0))), 0.0, i < 16 ? 1.0 : 1e-8) << i;
  }
}

}  // namespace
}  // namespace assembly_cell
