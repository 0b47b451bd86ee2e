// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/base/heartbeat.h"

#include <gtest/gtest.h>

#include <atomic>

namespace assembly_cell {
namespace {

using std::chrono::milliseconds;

TEST(Heartbeat, BeatsWhileItsOwnerWorks) {
  std::atomic<int> beats{0};
  const Heartbeat beat(milliseconds(1), [&](double) { ++beats; });
  while (beats < 3) std::this_thread::sleep_for(milliseconds(1));
}

TEST(Heartbeat, EndsAtOnceAndIsSilentThen) {
  int beats = 0;
  const auto begun = std::chrono::steady_clock::now();
  {
    const Heartbeat beat(std::chrono::hours(1), [&](double) { ++beats; });
  }
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::minutes(1));
  EXPECT_EQ(beats, 0);
}

// a report is not interrupted, and may own the lock that the heartbeat needs
TEST(Heartbeat, RestsAfterOtherWords) {
  std::atomic<int> beats{0};
  std::mutex voice;
  Heartbeat beat(std::chrono::seconds(30), [&](double) {
    const std::lock_guard<std::mutex> lock(voice);
    ++beats;
  });
  for (int i = 0; i < 100; ++i) {
    const std::lock_guard<std::mutex> lock(voice);
    beat.rest();
  }
  EXPECT_EQ(beats, 0);
}

}  // namespace
}  // namespace assembly_cell
