// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What the checks of all blocks of the cell cost, as a part of one core: 100 samples every 20 ms
// (5 kHz). Each block is looked at where it comes in: both bridges in the drivers, both wrenches
// and the displacement in the supervisor and the twin-force estimator, the displacement in the
// locus estimator. The fastest of several runs.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "assembly_cell/guard/message_check.h"
#include "marker.h"

int main() {
  using namespace assembly_cell;
  using Clock = std::chrono::steady_clock;
  constexpr int kBlocks = 20000, kRepeats = 9;
  constexpr int kStrains = 2, kWrenches = 4, kDisplacements = 3;
  constexpr std::size_t kValues = 600;
  constexpr double kBlock = 0.02;  // [s]
  std::vector<double> volts(kValues), wrench(kValues), displacement(kValues);
  for (std::size_t k = 0; k < kValues; ++k) {
    volts[k] = 1e-3 * static_cast<double>(k);
    wrench[k] = 0.1 * static_cast<double>(k);
    displacement[k] = 1e-6 * static_cast<double>(k);
  }
  double best = 1e300;
  long refused = 0;
  for (int r = 0; r < kRepeats; ++r) {
    StampWindow window;
    const auto start = Clock::now();
    for (int k = 0; k < kBlocks; ++k) {
      const double stamp = 1.0 + k * kBlock;
      const auto frame = [&] {
        MessageCheck check;
        check.stamp("header.stamp", stamp).number("period", 2e-4, kPeriodField);
        refused += window.accept(stamp) ? 0 : 1;
        return check;
      };
      for (int i = 0; i < kStrains; ++i) {
        MessageCheck check = frame();
        check.block("volts", kValues, 6).numbers("volts", volts.data(), kValues, kVoltsField);
        refused += check.good() ? 0 : 1;
      }
      for (int i = 0; i < kWrenches; ++i) {
        MessageCheck check = frame();
        check.sixes("wrench", wrench.data(), kValues, kForceField, kTorqueField);
        refused += check.good() ? 0 : 1;
      }
      for (int i = 0; i < kDisplacements; ++i) {
        MessageCheck check = frame();
        check.sixes("displacement", displacement.data(), kValues, kDisplacementField,
                    kRotationField);
        refused += check.good() ? 0 : 1;
      }
    }
    const std::chrono::duration<double> time = Clock::now() - start;
    best = std::min(best, time.count() / kBlocks);
  }
  std::printf(
      "checks of messages: %.0f ns for all blocks of 20 ms, %.4f %% of a core (0.5 %% allowed); "
      "marker %.0f ns\n",
      1e9 * best, 100.0 * best / kBlock, markerTime());
  if (refused > 0) {
    std::fprintf(stderr, "bench_messages: %ld refused: none expected\n", refused);
    return 1;
  }
  return best / kBlock <= 5e-3 ? 0 : 1;
}
