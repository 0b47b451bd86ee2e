// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What reading devices costs: two Net F/T boxes on loopback at 7 kHz for a minute. Nothing may get
// lost; CPU time of each reading thread; time from the arrival of a block's last datagram (the
// kernel's note) to the block in the caller's hands.

#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/stamp_filter.h"
#include "assembly_cell/sensor/strain_source.h"
#include "emulators.h"

namespace {

using namespace assembly_cell;
using Clock = std::chrono::steady_clock;

constexpr const char* kUsage =
    "usage: bench_sources [--seconds S] [--rate HZ] [--sensors N] [--block-period S] [--burners "
    "N]\n"
    "                     [--loss P] [--duplication P] [--reordering P]\n";

struct Result {
  SourceCounters counters;
  double cpu = 0.0;      // of the reading thread [s]
  double elapsed = 0.0;  // [s]
  std::uint64_t blocks = 0;
  std::vector<double> latencies;  // of complete blocks [s]
};

double threadTime() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// A box in a process of its own, as on a network; its ports come back through a pipe.
struct Box {
  pid_t process = -1;
  int port = 0, http_port = 0;
  int stop = -1;     // one byte ends the box
  int answers = -1;  // numbers of sent and lost packets
};

Box startBox(const NetftEmulator::Options& options) {
  int ports[2], stop[2];
  if (pipe(ports) != 0 || pipe(stop) != 0) std::exit(1);
  Box box;
  box.process = fork();
  if (box.process == 0) {
    close(ports[0]);
    close(stop[1]);
    NetftEmulator emulator(options);
    const int open_ports[2] = {emulator.port(), emulator.httpPort()};
    if (write(ports[1], open_ports, sizeof open_ports) < 0) _exit(1);
    char end = 0;
    if (read(stop[0], &end, 1) < 0) _exit(1);
    const std::uint64_t counts[2] = {emulator.sent(), emulator.lost()};
    if (write(ports[1], counts, sizeof counts) < 0) _exit(1);
    _exit(0);
  }
  close(ports[1]);
  close(stop[0]);
  int open_ports[2] = {0, 0};
  if (read(ports[0], open_ports, sizeof open_ports) != sizeof open_ports) std::exit(1);
  box.port = open_ports[0];
  box.http_port = open_ports[1];
  box.stop = stop[1];
  box.answers = ports[0];
  return box;
}

// SCHED_FIFO for the calling thread, as of a driver with real-time priority
void raise(double priority) {
  if (priority <= 0.0) return;
  sched_param parameters{};
  parameters.sched_priority = static_cast<int>(priority);
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) != 0) {
    std::puts("no right to real-time priority");
  }
}

// How late a thread wakes that does nothing but sleep: the machine's own share in the latencies.
void sleepFor(double seconds, double period, double priority, std::vector<double>& overshoots) {
  raise(priority);
  const auto nap =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(period));
  const auto count = static_cast<std::size_t>(seconds / period);
  overshoots.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Clock::time_point due = Clock::now() + nap;
    std::this_thread::sleep_until(due);
    overshoots.push_back(std::chrono::duration<double>(Clock::now() - due).count());
  }
}

void readFor(StrainSource& source, double seconds, double period, double priority, Result& result) {
  raise(priority);
  const auto block = std::make_unique<SourceBlock>();
  const auto filter = std::make_unique<StampFilter>();
  source.open();
  const Clock::time_point start = Clock::now();
  const auto end =
      start + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  const double cpu = threadTime();
  while (Clock::now() < end) {
    if (source.read(*block, std::chrono::milliseconds(100)) != ReadResult::kSamples) continue;
    const std::chrono::duration<double> latency = Clock::now() - block->received.steady;
    filter->update(*block);
    ++result.blocks;
    // others weren't complete in time: the box paused, or the caller
    if (static_cast<double>(block->count) + 1.0 > period * source.info().rate) {
      result.latencies.push_back(latency.count());
    }
  }
  result.cpu = threadTime() - cpu;
  result.elapsed = std::chrono::duration<double>(Clock::now() - start).count();
  result.counters = source.counters();
  source.close();
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = 60.0, rate = 7000.0, period = 0.005;
  double sensors = 2.0, burners = 0.0, priority = 0.0;
  LinkFaults faults;
  const std::array<std::pair<const char*, double*>, 9> options = {
      {{"--seconds", &seconds},
       {"--rate", &rate},
       {"--sensors", &sensors},
       {"--block-period", &period},
       {"--burners", &burners},
       {"--priority", &priority},
       {"--loss", &faults.loss},
       {"--duplication", &faults.duplication},
       {"--reordering", &faults.reordering}}};
  for (int i = 1; i < argc; i += 2) {
    const auto option = std::find_if(options.begin(), options.end(), [&](const auto& o) {
      return std::strcmp(o.first, argv[i]) == 0;
    });
    if (option == options.end() || i + 1 == argc || !parseNumber(argv[i + 1], *option->second)) {
      std::fputs(kUsage, stderr);
      return 2;
    }
  }

  const auto n = static_cast<std::size_t>(sensors);
  std::vector<Box> boxes;
  std::vector<std::unique_ptr<StrainSource>> sources;
  for (std::size_t i = 0; i < n; ++i) {
    NetftEmulator::Options box;
    box.rate = rate;
    box.configuration.rate = rate;
    box.faults = faults;
    box.seed = i + 1;
    boxes.push_back(startBox(box));
    YAML::Node parameters;
    parameters["address"] = "127.0.0.1";
    parameters["port"] = boxes.back().port;
    parameters["http_port"] = boxes.back().http_port;
    parameters["block_period"] = period;
    sources.push_back(makeSource("netft"));
    sources.back()->configure(parameters);
  }
  // other work on the machine
  std::atomic<bool> burning{true};
  std::vector<std::thread> others;
  for (int i = 0; i < static_cast<int>(burners); ++i) {
    others.emplace_back([&] {
      volatile double x = 1.0;
      while (burning) x = x * 1.0000001;
    });
  }

  std::vector<Result> results(n);
  std::vector<std::thread> readers;
  for (std::size_t i = 0; i < n; ++i) {
    results[i].latencies.reserve(static_cast<std::size_t>(2.0 * seconds / period) + 1000);
    readers.emplace_back([&, i] { readFor(*sources[i], seconds, period, priority, results[i]); });
  }
  std::vector<double> overshoots;
  readers.emplace_back([&] { sleepFor(seconds, period, priority, overshoots); });
  for (std::thread& reader : readers) reader.join();
  burning = false;
  for (std::thread& other : others) other.join();

  std::printf(
      "sensor  samples    rate_Hz  lost  late  dup  reord  cpu_%%  blocks  complete  latency_ms: "
      "p50  p99    "
      "max\n");
  bool good = true;
  for (std::size_t i = 0; i < n; ++i) {
    const Result& r = results[i];
    const SourceCounters& c = r.counters;
    std::printf(
        "%6zu %8llu %10.1f %5llu %5llu %4llu %6llu %6.2f %7llu %9zu %16.3f %6.3f %6.3f\n", i,
        static_cast<unsigned long long>(c.samples), static_cast<double>(c.samples) / r.elapsed,
        static_cast<unsigned long long>(c.lost), static_cast<unsigned long long>(c.late),
        static_cast<unsigned long long>(c.duplicates), static_cast<unsigned long long>(c.reordered),
        100.0 * r.cpu / r.elapsed, static_cast<unsigned long long>(r.blocks), r.latencies.size(),
        1e3 * quantile(r.latencies, 0.5), 1e3 * quantile(r.latencies, 0.99),
        1e3 * quantile(r.latencies, 1.0));
    if (write(boxes[i].stop, "e", 1) != 1) return 1;
    std::uint64_t counts[2] = {0, 0};
    const bool answered = read(boxes[i].answers, counts, sizeof counts) == sizeof counts;
    std::printf("        box: sent %llu, lost on purpose %llu\n",
                static_cast<unsigned long long>(counts[0]),
                static_cast<unsigned long long>(counts[1]));
    int status = 0;
    waitpid(boxes[i].process, &status, 0);
    good = good && answered && (faults.loss > 0.0 || c.lost == 0);
  }
  std::printf("a thread that only sleeps wakes late by %48.3f %6.3f %6.3f\n",
              1e3 * quantile(overshoots, 0.5), 1e3 * quantile(overshoots, 0.99),
              1e3 * quantile(overshoots, 1.0));
  return good ? 0 : 1;
}
