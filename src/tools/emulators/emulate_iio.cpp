// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A converter of six bridge channels as sysfs shows it, to try the driver without one.

#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>

#include "assembly_cell/base/options.h"
#include "emulator_program.h"
#include "emulators.h"

namespace {

constexpr const char* kHelp = R"(Usage: emulate_iio [options]

A converter of six bridge channels without the converter: a folder like /sys/bus/iio/devices whose raw codes
change. Prints the driver's parameters that reach it, runs until Ctrl-C (or --duration).

  --root PATH        folder to make (default: a new one)
  --rate R           of new codes [Hz] (default 100)
  --load V           six voltages [V] (default 0,0,0,0,0,0)
  --amplitude A      of what varies around them [mV] (default 1)
  --duration T       ends after T seconds (default 0: runs on)
  --help             print this

Exit code: 0 ok, 2 bad input.

Example: emulate_iio --load 0.1,0,0,0,0,0
)";

int run(const std::vector<std::string>& arguments) {
  using assembly_cell::IioEmulator;
  IioEmulator::Options converter;
  double rate = 100.0, amplitude = 1.0, duration = 0.0;
  std::array<double, 6> load{};
  assembly_cell::OptionParser parser(kHelp);
  parser.text("--root", converter.root);
  parser.number("--rate", rate, 0.1, 1000.0);
  parser.numbers("--load", load.data(), load.size());
  parser.number("--amplitude", amplitude, 0.0, 1000.0);
  parser.number("--duration", duration, 0.0, 1e6);
  if (!parser.parse(arguments)) return 0;

  assembly_cell::holdSignals();
  IioEmulator emulator(converter);
  std::cout << "source: {type: iio, iio_root: " << emulator.root() << ", device: " << converter.name
            << ", rate: " << rate << "}" << std::endl;
  const double steps = duration > 0.0 ? std::max(1.0, duration * rate) : 1e18;
  std::uint64_t n = 0;
  do {
    std::array<std::int64_t, 6> codes;
    for (std::size_t k = 0; k < 6; ++k) {
      const double varying = amplitude * assembly_cell::emulatedValue(n, k) / (k < 3 ? 20.0 : 2.0);
      const double millivolts = 1e3 * load[k] + varying;
      const double code = std::nearbyint(millivolts / converter.scale - converter.offset);
      codes[k] = static_cast<std::int64_t>(std::clamp(code, 0.0, 16777215.0));
    }
    emulator.set(codes);
  } while (static_cast<double>(++n) < steps && assembly_cell::waitForEnd(1.0 / rate));
  std::cout << "codes: " << n << std::endl;
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("emulate_iio", argc, argv, run); }
