// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <signal.h>
#include <yaml-cpp/yaml.h>

#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <iostream>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/source_parameters.h"
#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {

/// Options as a map: --http-port 80 is http_port: 80. A list is given with commas.
inline YAML::Node optionMap(const std::string& program, const std::vector<std::string>& arguments) {
  YAML::Node map(YAML::NodeType::Map);
  for (std::size_t i = 0; i < arguments.size(); i += 2) {
    const std::string& name = arguments[i];
    if (name.rfind("--", 0) != 0 || name.size() < 3) {
      throw InputError(program + ": argument '" + printable(name) + "': unknown, see --help");
    }
    if (i + 1 == arguments.size()) {
      throw InputError(program + ": " + printable(name) + ": value missing, see --help");
    }
    std::string key = name.substr(2);
    for (char& c : key) c = c == '-' ? '_' : c;
    const std::string& value = arguments[i + 1];
    if (value.find(',') == std::string::npos) {
      map[key] = value;
      continue;
    }
    YAML::Node list;
    for (std::size_t start = 0; start <= value.size();) {
      const std::size_t end = std::min(value.find(',', start), value.size());
      list.push_back(value.substr(start, end - start));
      start = end + 1;
    }
    map[key] = list;
  }
  return map;
}

inline std::array<double, 6> six(const std::vector<double>& values) {
  std::array<double, 6> array{};
  std::copy_n(values.begin(), 6, array.begin());
  return array;
}

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

/// Runs `emulate(options)` as a program: --help, one line and exit 2 for bad input.
template <typename Emulate>
int runEmulator(const std::string& program, const char* help, int argc, char** argv,
                Emulate emulate) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  for (const std::string& argument : arguments) {
    if (argument == "--help" || argument == "-h") {
      std::cout << help;
      return 0;
    }
  }
  holdSignals();
  try {
    const YAML::Node map = optionMap(program, arguments);
    SourceParameters options(map, program);
    emulate(options);
    return 0;
  } catch (const std::exception& error) {
    std::cerr << error.what() << "\n";
    return 2;
  }
}

}  // namespace assembly_cell
