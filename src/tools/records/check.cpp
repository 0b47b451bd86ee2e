// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <atomic>
#include <chrono>
#include <cmath>
#include <iostream>

#include "assembly_cell/base/heartbeat.h"
#include "commands.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp = R"(Usage: records check [options]

Integrity of the store: its pages and indexes, that each row belongs to a run, that each curve can be read. Prints
what is wrong, a line each; 1 is returned then. Long work is reported every 5 s on standard error.

  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Example: records check
)";

}  // namespace

int checkStore(const std::vector<std::string>& arguments) {
  OptionParser parser(kHelp);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;
  const RunStore runs = store.open();
  std::atomic<double> done{0.0};
  const Heartbeat beat(std::chrono::seconds(5), [&](double seconds) {
    std::cerr << "records: " << std::lround(100.0 * done) << " % checked, at work for "
              << std::lround(seconds) << " s\n";
  });
  const std::vector<std::string> wrong = runs.check([&](double fraction) { done = fraction; });
  for (const std::string& line : wrong) std::cout << store.path() << ": " << line << "\n";
  if (wrong.empty()) std::cout << store.path() << ": ok\n";
  return wrong.empty() ? 0 : 1;
}

}  // namespace assembly_cell
