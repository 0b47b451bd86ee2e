// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>

namespace assembly_cell {

/// Blocks the signals that end a program, for this thread and those it starts.
inline void holdSignals() {
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &ends, nullptr);
}

/// Waits for one of them, at most `seconds` (0: for ever). True at the end of the time.
inline bool waitForEnd(double seconds) {
  sigset_t ends;
  sigemptyset(&ends);
  sigaddset(&ends, SIGINT);
  sigaddset(&ends, SIGTERM);
  if (seconds <= 0.0) {
    int caught = 0;
    sigwait(&ends, &caught);
    return false;
  }
  const timespec limit{static_cast<time_t>(seconds),
                       static_cast<long>((seconds - std::floor(seconds)) * 1e9)};
  return sigtimedwait(&ends, nullptr, &limit) < 0;
}

/// Runs for `duration` [s] or (0) until a signal; once in `period` (0: never) the device is off for
/// `length`: power(on) switches it.
template <typename Power>
void runWithOutages(double duration, double period, double length, Power power) {
  const auto start = std::chrono::steady_clock::now();
  const auto left = [&] {
    const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - start;
    return std::max(1e-3, duration - gone.count());
  };
  if (period <= 0.0) {
    waitForEnd(duration > 0.0 ? left() : 0.0);
    return;
  }
  for (bool on = true; duration <= 0.0 || left() > 1e-3; on = !on) {
    power(on);
    const double wait = on ? period : length;
    if (!waitForEnd(duration > 0.0 ? std::min(wait, left()) : wait)) break;
  }
}

}  // namespace assembly_cell
