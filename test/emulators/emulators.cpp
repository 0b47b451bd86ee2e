// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "emulators.h"

#include <stdlib.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <limits>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

double emulatedValue(std::uint64_t n, std::size_t channel) {
  const auto code = static_cast<double>((n * 7919 + channel * 1013) % 4001) - 2000.0;
  return code / (channel < 3 ? 100.0 : 1000.0);
}

std::string makeTemporaryFolder() {
  std::string path = (std::filesystem::temp_directory_path() / "assembly_cell_XXXXXX").string();
  if (mkdtemp(path.data()) == nullptr) {
    throw SourceError("emulator: no temporary folder '" + path + "': " + strerror(errno));
  }
  return path;
}

double chance(std::mt19937_64& random) {
  return std::generate_canonical<double, std::numeric_limits<double>::digits>(random);
}

void emitAtRate(double rate, const std::atomic<bool>& stop,
                const std::function<void(std::size_t)>& emit) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  std::uint64_t done = 0;
  for (Clock::time_point next = start; !stop;) {
    next += std::chrono::milliseconds(1);
    std::this_thread::sleep_until(next);
    const double elapsed = std::chrono::duration<double>(Clock::now() - start).count();
    const auto due = static_cast<std::uint64_t>(elapsed * rate);
    emit(due - done);
    done = due;
  }
}

}  // namespace assembly_cell
