// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/shaker/sample_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace assembly_cell {
namespace {

// A converter 180 ppm fast, measured every 5 ms with 0.3 ms of jitter: after ten seconds the output
// times of samples are within a thirtieth of the jitter, at a kilohertz 4 degrees of phase.
TEST(SampleClock, FollowsAQuartzThatIsOff) {
  std::mt19937 random(1);
  std::normal_distribution<double> jitter(0.0, 3e-4);
  const double truth = 1.0 / (48000.0 * (1.0 + 180e-6));
  SampleClock clock;
  double written = 0.0, worst = 0.0;
  for (int look = 0; look < 12000; ++look) {
    const double now = 100.0 + 5e-3 * look;
    // 20 ms are in the queue, as full frames
    const double n = std::max(0.0, std::ceil((now + 0.02 - 100.0) / truth - written));
    const double sounds = 100.0 + written * truth;
    observe(clock, sounds + std::clamp(jitter(random), -1e-3, 1e-3), look == 0 ? 0.0 : n);
    if (now > 140.0) worst = std::max(worst, std::abs(clock.next - sounds));
    clock.next += n * clock.period;
    written += n;
  }
  EXPECT_EQ(clock.jumps, 0u);
  EXPECT_LT(worst, 1.5e-4);
  EXPECT_NEAR(clock.period / truth, 1.0, 30e-6);
}

TEST(SampleClock, JumpsWhereTheQueueRanEmpty) {
  SampleClock clock;
  observe(clock, 1.0, 0.0);
  EXPECT_EQ(clock.next, 1.0);
  clock.next += 240 * clock.period;
  observe(clock, 1.1, 240.0);
  EXPECT_EQ(clock.next, 1.1);
  EXPECT_EQ(clock.jumps, 1u);
}

}  // namespace
}  // namespace assembly_cell
