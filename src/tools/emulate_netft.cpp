// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A Net F/T box on loopback, to try the driver without one.

#include <algorithm>

#include "assembly_cell/sensor/emulators.h"
#include "emulator_program.h"

namespace {

constexpr const char* kHelp = R"(Usage: emulate_netft [options]

A Net F/T box without the box: streams RDT records over UDP to whoever asks and tells its configuration over
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
  --status S         the records' status word (default 0: healthy; 2147614720 is 0x80020000, a serious fault)
  --outage-period T  without power once in T seconds (default 0: never)
  --outage-length T  for T seconds (default 1)
  --duration T       ends after T seconds (default 0: runs on)
  --seed N           of the link's faults (default 1)
  --help             print this

Exit code: 0 ok, 2 bad input.

Example: emulate_netft --loss 0.1 --duplication 0.05 --reordering 0.05
)";

void emulate(assembly_cell::SourceParameters& options) {
  using assembly_cell::NetftEmulator;
  NetftEmulator::Options box;
  box.bind_address = options.text("bind_address", "127.0.0.1");
  box.port = options.integer("port", 0, 65535, 49152);
  box.http_port = options.integer("http_port", 0, 65535, 0);
  box.rate = options.number("rate", 1.0, 1e5, 7000.0);
  box.configuration.rate = box.rate;
  box.load = assembly_cell::six(options.numbers("load", 6, std::vector<double>(6, 0.0)));
  box.amplitude = options.number("amplitude", 0.0, 50.0, 0.01);
  box.faults.loss = options.number("loss", 0.0, 1.0, 0.0);
  box.faults.duplication = options.number("duplication", 0.0, 1.0, 0.0);
  box.faults.reordering = options.number("reordering", 0.0, 1.0, 0.0);
  const auto status = static_cast<std::uint32_t>(options.number("status", 0.0, 4294967295.0, 0.0));
  const double period = options.number("outage_period", 0.0, 1e6, 0.0);
  const double length = options.number("outage_length", 0.001, 1e6, 1.0);
  const double duration = options.number("duration", 0.0, 1e6, 0.0);
  box.seed = static_cast<std::uint64_t>(options.integer("seed", 0, 2147483647, 1));
  options.refuseUnknown();

  NetftEmulator emulator(box);
  emulator.setStatus(status);
  std::cout << "source: {type: netft, address: " << box.bind_address
            << ", bind_address: " << box.bind_address << ", port: " << emulator.port()
            << ", http_port: " << emulator.httpPort() << "}" << std::endl;

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
      emulator.setDead(!on);
      if (!on) emulator.restart();
      const double wait = on ? period : length;
      if (!assembly_cell::waitForEnd(duration > 0.0 ? std::min(wait, left()) : wait)) break;
    }
  }
  std::cout << "records: " << emulator.sent() << "\nlost: " << emulator.lost()
            << "\nduplicated: " << emulator.duplicated() << "\nreordered: " << emulator.reordered()
            << "\nstarts: " << emulator.starts() << "\nstops: " << emulator.stops()
            << "\nbiases: " << emulator.biases() << std::endl;
}

}  // namespace

int main(int argc, char** argv) {
  return assembly_cell::runEmulator("emulate_netft", kHelp, argc, argv, emulate);
}
