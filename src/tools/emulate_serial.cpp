// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A serial six-axis sensor on a pseudo-terminal, to try the driver without one.

#include <algorithm>

#include "assembly_cell/sensor/emulators.h"
#include "emulator_program.h"

namespace {

constexpr const char* kHelp = R"(Usage: emulate_serial [options]

A serial force sensor without the sensor: sends frames through a pseudo-terminal. Prints the driver's parameters
that reach it, runs until Ctrl-C (or --duration), then prints what happened.

  --protocol P       bota or robotiq (default bota)
  --link PATH        link to the terminal (default: in a new folder)
  --rate R           of the frames [Hz] (default 400; robotiq 100)
  --loss P           chance that a frame gets lost (default 0)
  --status S         Bota's status word (default 0: healthy; 4: invalid)
  --outage-period T  unplugged once in T seconds (default 0: never)
  --outage-length T  for T seconds (default 1)
  --duration T       ends after T seconds (default 0: runs on)
  --seed N           of the losses (default 1)
  --help             print this

Exit code: 0 ok, 2 bad input.

Example: emulate_serial --link /tmp/force_sensor
)";

void emulate(assembly_cell::SourceParameters& options) {
  using assembly_cell::SerialEmulator;
  SerialEmulator::Options sensor;
  const std::string protocol = options.choice("protocol", {"bota", "robotiq"}, "bota");
  sensor.robotiq = protocol == "robotiq";
  sensor.link = options.text("link", "");
  sensor.rate = options.number("rate", 1.0, 1e4, sensor.robotiq ? 100.0 : 400.0);
  sensor.device_rate = sensor.rate;
  sensor.faults.loss = options.number("loss", 0.0, 1.0, 0.0);
  const int status = options.integer("status", 0, 65535, 0);
  const double period = options.number("outage_period", 0.0, 1e6, 0.0);
  const double length = options.number("outage_length", 0.001, 1e6, 1.0);
  const double duration = options.number("duration", 0.0, 1e6, 0.0);
  sensor.seed = static_cast<std::uint64_t>(options.integer("seed", 0, 2147483647, 1));
  options.refuseUnknown();

  SerialEmulator emulator(sensor);
  emulator.setStatus(static_cast<std::uint32_t>(status));
  std::cout << "source: {type: serial, protocol: " << protocol << ", port: " << emulator.path()
            << ", rate: " << sensor.rate << "}" << std::endl;

  const auto start = std::chrono::steady_clock::now();
  const auto left = [&] {
    const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - start;
    return std::max(1e-3, duration - gone.count());
  };
  if (period <= 0.0) {
    assembly_cell::waitForEnd(duration > 0.0 ? left() : 0.0);
  } else {
    // on and off until the end
    for (bool on = true; duration <= 0.0 || left() > 1e-3; on = !on) {
      if (on) {
        emulator.plug();
      } else {
        emulator.unplug();
      }
      const double wait = on ? period : length;
      if (!assembly_cell::waitForEnd(duration > 0.0 ? std::min(wait, left()) : wait)) break;
    }
  }
  std::cout << "frames: " << emulator.sample() << "\nstarts: " << emulator.starts()
            << "\nstops: " << emulator.stops() << std::endl;
}

}  // namespace

int main(int argc, char** argv) {
  return assembly_cell::runEmulator("emulate_serial", kHelp, argc, argv, emulate);
}
