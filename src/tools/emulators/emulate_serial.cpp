// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A serial six-axis sensor on a pseudo-terminal, to try the driver without one.

#include <iostream>

#include "assembly_cell/base/options.h"
#include "emulator_program.h"
#include "emulators.h"

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

int run(const std::vector<std::string>& arguments) {
  using assembly_cell::SerialEmulator;
  SerialEmulator::Options sensor;
  int status = 0;
  double period = 0.0, length = 1.0, duration = 0.0;
  assembly_cell::OptionParser parser(kHelp);
  parser.choice("--protocol", sensor.robotiq, {{"bota", false}, {"robotiq", true}});
  parser.text("--link", sensor.link);
  parser.number("--rate", sensor.rate, 1.0, 1e4);
  parser.number("--loss", sensor.faults.loss, 0.0, 1.0);
  parser.integer("--status", status, 0, 65535);
  parser.number("--outage-period", period, 0.0, 1e6);
  parser.number("--outage-length", length, 0.001, 1e6);
  parser.number("--duration", duration, 0.0, 1e6);
  parser.integer("--seed", sensor.seed, 0, 2147483647);
  if (!parser.parse(arguments)) return 0;
  if (sensor.rate == 0.0) sensor.rate = sensor.robotiq ? 100.0 : 400.0;
  sensor.device_rate = sensor.rate;

  assembly_cell::holdSignals();
  SerialEmulator emulator(sensor);
  emulator.setStatus(static_cast<std::uint32_t>(status));
  std::cout << "source: {type: serial, protocol: " << (sensor.robotiq ? "robotiq" : "bota")
            << ", port: " << emulator.path() << ", rate: " << sensor.rate << "}" << std::endl;

  assembly_cell::runWithOutages(duration, period, length, [&](bool on) {
    if (on) {
      emulator.plug();
    } else {
      emulator.unplug();
    }
  });
  std::cout << "frames: " << emulator.sample() << "\nstarts: " << emulator.starts()
            << "\nstops: " << emulator.stops() << std::endl;
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return assembly_cell::runTool("emulate_serial", argc, argv, run);
}
