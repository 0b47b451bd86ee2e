// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A Net F/T box on loopback, to try the driver without one.

#include <iostream>

#include "assembly_cell/base/options.h"
#include "emulator_program.h"
#include "emulators.h"

namespace {

constexpr const char* kHelp = R"(Usage: emulate_netft [options]

A Net F/T box without the box: streams RDT records over UDP to each client and serves its configuration over
HTTP. Prints the driver's parameters that reach it, runs until Ctrl-C (or --duration), then prints what happened.

  --bind-address A   this computer's address (default 127.0.0.1)
  --port P           of RDT (default 49152; 0: any free one)
  --http-port P      of the configuration (default 0: any free one)
  --rate R           of the records [Hz] (default 7000)
  --load L           fx,fy,fz,tx,ty,tz [N], [N m] (default 0,0,0,0,0,0)
  --amplitude A      of what varies around the load: up to 20 A newtons, 2 A newton metres (default 0.01)
  --loss P           chance that a record gets lost (default 0)
  --duplication P    that it arrives twice (default 0)
  --reordering P     that it arrives after the next 1 to 4 (default 0)
  --onrobot          an OnRobot HEX box: the bias is taken with a sample count of 255, removed with 0
  --status S         the records' status word (default 0: healthy; 2147614720 is 0x80020000, a serious fault)
  --outage-period T  without power once in T seconds (default 0: never)
  --outage-length T  for T seconds (default 1)
  --duration T       ends after T seconds (default 0: runs on)
  --seed N           of the link's faults (default 1)
  --help             print this

Exit code: 0 ok, 2 bad input.

Example: emulate_netft --loss 0.1 --duplication 0.05 --reordering 0.05
)";

int run(const std::vector<std::string>& arguments) {
  using assembly_cell::NetftEmulator;
  NetftEmulator::Options box;
  box.port = 49152;
  box.rate = 7000.0;
  box.amplitude = 0.01;
  double status = 0.0, period = 0.0, length = 1.0, duration = 0.0;
  assembly_cell::OptionParser parser(kHelp);
  parser.text("--bind-address", box.bind_address);
  parser.integer("--port", box.port, 0, 65535);
  parser.integer("--http-port", box.http_port, 0, 65535);
  parser.number("--rate", box.rate, 1.0, 1e5);
  parser.numbers("--load", box.load.data(), box.load.size());
  parser.number("--amplitude", box.amplitude, 0.0, 50.0);
  parser.number("--loss", box.faults.loss, 0.0, 1.0);
  parser.number("--duplication", box.faults.duplication, 0.0, 1.0);
  parser.number("--reordering", box.faults.reordering, 0.0, 1.0);
  parser.flag("--onrobot", box.onrobot);
  parser.number("--status", status, 0.0, 4294967295.0);
  parser.number("--outage-period", period, 0.0, 1e6);
  parser.number("--outage-length", length, 0.001, 1e6);
  parser.number("--duration", duration, 0.0, 1e6);
  parser.integer("--seed", box.seed, 0, 2147483647);
  if (!parser.parse(arguments)) return 0;
  box.configuration.rate = box.rate;

  assembly_cell::holdSignals();
  NetftEmulator emulator(box);
  emulator.setStatus(static_cast<std::uint32_t>(status));
  std::cout << "source: {type: netft, address: " << box.bind_address
            << ", bind_address: " << box.bind_address << ", port: " << emulator.port()
            << ", http_port: " << emulator.httpPort() << "}" << std::endl;

  assembly_cell::runWithOutages(duration, period, length, [&](bool on) {
    emulator.setDead(!on);
    if (!on) emulator.restart();
  });
  std::cout << "records: " << emulator.sent() << "\nlost: " << emulator.lost()
            << "\nduplicated: " << emulator.duplicated() << "\nreordered: " << emulator.reordered()
            << "\nstarts: " << emulator.starts() << "\nstops: " << emulator.stops()
            << "\nbiases: " << emulator.biases() << std::endl;
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("emulate_netft", argc, argv, run); }
