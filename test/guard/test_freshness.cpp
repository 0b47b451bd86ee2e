// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>

#include "assembly_cell/guard/freshness.h"

namespace assembly_cell {
namespace {

constexpr double kFreshBlock = 0.02;  // [s]
constexpr double kDelay = 0.004;      // of a message that is not late [s]

// A plant whose clock starts at 100 s, and the cell time from its messages.
struct Feed {
  CellClock clock{true};
  double wall = 0.0, stamp = 100.0;
  double late = 0.0;  // length of the queue [s]

  // blocks received as the plant sends them, `rate` cell seconds per second
  void run(int blocks, double rate = 1.0) {
    for (int i = 0; i < blocks; ++i) {
      wall += kFreshBlock / rate;
      stamp += kFreshBlock;
      clock.observe(wall + kDelay, stamp);
    }
  }
  double age() const { return clock.now(wall + kDelay) - stamp; }
};

TEST(Freshness, BlocksAsTheyComeAreFresh) {
  Feed feed;
  feed.run(1);
  EXPECT_TRUE(isFresh(feed.stamp, feed.clock.now(feed.wall + kDelay)));
  for (int i = 0; i < 1000; ++i) {
    feed.run(1);
    ASSERT_NEAR(feed.age(), 0.0, 1e-9);
  }
}

TEST(Freshness, TimeGoesOnWhileNothingComes) {
  Feed feed;
  feed.run(50);
  EXPECT_NEAR(feed.clock.now(feed.wall + kDelay + 0.3) - feed.stamp, 0.3, 1e-9);
  CellClock lockstep(false);
  lockstep.observe(1.0, 100.0);
  EXPECT_EQ(lockstep.now(50.0), 100.0);
}

// Frozen for 0.2 to 10 s, with a queue of all or only of the last two seconds: no block of the
// burst is fresh, and the first one after it is.
TEST(Freshness, NoMessageOfABurstIsFreshAfterAFreeze) {
  for (const double frozen : {0.2, 1.0, 3.0, 10.0}) {
    for (const double queue : {2.0, 100.0}) {
      Feed feed;
      feed.run(100);
      // the plant ran meanwhile; now the burst, a millisecond per message
      const double end = feed.wall + frozen;
      const int missed = static_cast<int>(frozen / kFreshBlock + 0.5);
      const int kept = std::min(missed, static_cast<int>(queue / kFreshBlock + 0.5));
      feed.wall = end;
      feed.stamp += (missed - kept) * kFreshBlock;
      const double plant = feed.stamp + kept * kFreshBlock;
      for (int i = 0; i < kept; ++i) {
        feed.stamp += kFreshBlock;
        feed.clock.observe(feed.wall + kDelay, feed.stamp);
        const bool fresh = isFresh(feed.stamp, feed.clock.now(feed.wall + kDelay));
        EXPECT_EQ(fresh, plant - feed.stamp + 1e-3 * i <= kFreshAge)
            << frozen << " s, " << plant - feed.stamp << " s old";
        feed.wall += 1e-3;
      }
      feed.wall = end + kFreshBlock * 20;
      feed.stamp = plant + kFreshBlock * 20;
      feed.run(1);
      EXPECT_LT(feed.age(), 1e-3) << frozen;
    }
  }
}

TEST(Freshness, APauseOfThePlantIsNoQueue) {
  for (const double pause : {0.1, 1.0, 10.0, 1000.0}) {
    Feed feed;
    feed.run(100);
    feed.wall += pause;
    feed.run(6);
    EXPECT_LT(feed.age(), kFreshAge) << pause;
    feed.run(50);
    EXPECT_LT(feed.age(), 1e-3) << pause;
  }
}

TEST(Freshness, ASlowOrQuickPlantIsFresh) {
  for (const double rate : {0.1, 0.25, 0.5, 0.9, 1.1, 2.0, 10.0}) {
    Feed feed;
    feed.run(100);
    feed.run(20, rate);
    for (int i = 0; i < 200; ++i) {
      feed.run(1, rate);
      ASSERT_LT(feed.age(), kFreshAge) << rate;
    }
  }
}

TEST(Freshness, ARestartedPlantResetsTheClock) {
  Feed feed;
  feed.run(500);
  feed.stamp = 1.0;
  feed.wall += 2.0;
  feed.run(1);
  EXPECT_NEAR(feed.age(), 0.0, 1e-9);
  EXPECT_EQ(feed.clock.newest(), feed.stamp);
}

}  // namespace
}  // namespace assembly_cell
