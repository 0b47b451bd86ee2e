// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the plant's guard and the freshness of blocks cost, as a part of one core: a block of
// 100 samples every 20 ms, each with a look at the load; a lease, a move, an exciter command and
// the watchdog once a block. The fastest of several runs.

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "assembly_cell/guard/freshness.h"
#include "assembly_cell/guard/plant_guard.h"
#include "marker.h"

int main() {
  using namespace assembly_cell;
  using Clock = std::chrono::steady_clock;
  constexpr int kBlocks = 20000, kRepeats = 9, kSamples = 100;
  constexpr double kBlock = 0.02;  // [s]
  double best = 1e300;
  long stopped = 0, refused = 0, stale = 0, slow = 0;
  for (int r = 0; r < kRepeats; ++r) {
    PlantGuard guard = plantGuard({}, LeaseMode::kRequired, false);
    CellClock clock(true);
    Sender sender{"/assembly_supervisor", 0.0, true, false};
    guard.braking.stiffness.diagonal().setConstant(5e4);
    const Load detection = detectionThreshold(guard.limits);
    const Vector6 way = Vector6::Constant(1e-5);
    Vector6 load = Vector6::Constant(1.0);
    load(0) = 20.0;
    Pose X;
    const auto start = Clock::now();
    for (int k = 0; k < kBlocks; ++k) {
      const double now = k * kBlock;
      GuardAction action;
      sender.stamp = now;
      refused += renewLease(guard, sender, 7, now, action).good() ? 0 : 1;
      X.p.z() = 1e-6 * (k % 100);
      slow += speedLimit(guard, load, way) < 1e-3 ? 1 : 0;
      refused += checkMove(guard, sender, X, now).good() ? 0 : 1;
      refused += checkExciter(guard, sender, {1.0, 450.0, 0.0, 1}, now).good() ? 0 : 1;
      for (int i = 0; i < kSamples; ++i) {
        load(2) = 1e-3 * i;
        if (exceeds(load, detection)) stopped += mustStop(guard.braking, load, way, guard.allowed);
      }
      stopped += watch(guard, load, X.p.z(), now).hold ? 1 : 0;
      clock.observe(now + 1e-3, now);
      stale += isFresh(now, clock.now(now + 2e-3)) ? 0 : 1;
    }
    const std::chrono::duration<double> time = Clock::now() - start;
    best = std::min(best, time.count() / kBlocks);
  }
  std::printf(
      "guard and freshness: %.0f ns a block, %.5f %% of a core (0.03 %% allowed); marker %.0f ns\n",
      1e9 * best, 100.0 * best / kBlock, markerTime());
  if (stopped + refused + stale + slow > 0) {
    std::fprintf(stderr, "bench_guard: %ld stops, %ld refusals, %ld stale blocks: none expected\n",
                 stopped, refused, stale);
    return 1;
  }
  return best / kBlock <= 3e-4 ? 0 : 1;
}
