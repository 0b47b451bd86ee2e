// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What is a Net F/T box's own: requests that get lost, configuration over HTTP, bias, other
// senders.

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <thread>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/descriptor.h"
#include "assembly_cell/sensor/devices/netft_page.h"
#include "source_bench.h"

namespace assembly_cell {
namespace {

using std::chrono::milliseconds;

NetftEmulator& box(Rig& rig) { return dynamic_cast<NetftBench&>(*rig.bench).emulator(); }

std::string refusal(Rig& rig) {
  try {
    rig.source->open();
  } catch (const SourceError& error) {
    return error.what();
  }
  return "";
}

std::string response(const std::string& body) {
  return "HTTP/1.0 200 OK\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
}

TEST(NetftSource, RepeatsRequestsUntilTheFirstRecord) {
  Rig rig("netft");
  rig.askAfter(1.0);
  box(rig).ignoreStarts(2);
  rig.open();
  EXPECT_EQ(box(rig).starts(), 3);
  rig.source->close();
  // three are allowed
  box(rig).ignoreStarts(3);
  const std::string line = refusal(rig);
  EXPECT_NE(line.find("sends no records after 3 requests"), std::string::npos) << line;
  EXPECT_EQ(box(rig).starts(), 6);
}

TEST(NetftSource, SaysStopWhenClosed) {
  Rig rig("netft");
  rig.open();
  rig.source->close();
  const auto limit = std::chrono::steady_clock::now() + kPatience;
  while (box(rig).stops() == 0 && std::chrono::steady_clock::now() < limit) {
    std::this_thread::yield();
  }
  EXPECT_EQ(box(rig).stops(), 1);
  EXPECT_FALSE(box(rig).streaming());
}

TEST(NetftSource, NamesWhatIsWrongWithTheConfiguration) {
  Rig rig("netft");
  const std::string good =
      "<cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt><scfgfu>N</scfgfu><scfgtu>Nm</scfgtu>";
  const std::pair<std::string, std::string> cases[] = {
      {"HTTP/1.0 404 Not Found\r\n\r\n", "404"},
      {response("<html>a printer</html>"), "cfgcpf"},
      {response(good + "<comrdte>0</comrdte>"), "RDT is off"},
      {response("<cfgcpf>1</cfgcpf><cfgcpt>1</cfgcpt><scfgfu>stone</scfgfu><scfgtu>Nm</scfgtu>"),
       "stone"},
      {response(good).substr(0, 60), "breaks off"},
      {response(std::string(100000, 'x')), "more than 65536 bytes"},
      {"", "breaks off"},
      {std::string(3000, '\n'), "instead of HTTP"},
  };
  for (const auto& [answer, words] : cases) {
    box(rig).setHttpResponse(answer);
    const std::string line = refusal(rig);
    EXPECT_NE(line.find(answer.empty() ? "instead of HTTP" : words), std::string::npos) << line;
    EXPECT_EQ(line.find('\n'), std::string::npos);
    EXPECT_LT(line.size(), 300u);
  }
  EXPECT_EQ(box(rig).starts(), 0);
  box(rig).setHttpResponse(response(good));
  rig.open();
  EXPECT_EQ(rig.source->info().rate, 0.0);
  // blocks by time, without a rate
  rig.collect(30);
  rig.expectTrue();
}

TEST(NetftSource, ReadsTheBoxesUnitsIntoSi) {
  NetftEmulator::Options options;
  options.configuration = {1000.0, 2000.0, "lbf", "lbf-in", true, 7000.0, "FT9", "2"};
  options.load = {10.0, -20.0, 30.0, 1.0, -2.0, 3.0};
  options.amplitude = 0.0;
  options.rate = 1000.0;
  NetftEmulator emulator(options);
  const auto source = makeSource("netft");
  YAML::Node parameters = YAML::Load("{address: 127.0.0.1}");
  parameters["port"] = emulator.port();
  parameters["http_port"] = emulator.httpPort();
  source->configure(parameters);
  source->open();
  EXPECT_EQ(source->info().serial_number, "FT9");
  SourceBlock block;
  ASSERT_EQ(source->read(block, kPatience), ReadResult::kSamples);
  for (std::size_t k = 0; k < 6; ++k) {
    // half a count: 1/1000 lbf, 1/2000 lbf·in
    EXPECT_NEAR(block.values[k], options.load[k], k < 3 ? 2.3e-3 : 2.9e-5);
  }
  // the same by parameters, with a box that has no HTTP
  source->close();
  YAML::Node given = YAML::Load(
      "{address: 127.0.0.1, configuration: parameters, counts_per_force: 1000, counts_per_torque: "
      "2000, force_unit: lbf, torque_unit: lbf-in, rate: 1000}");
  given["port"] = emulator.port();
  source->configure(given);
  source->open();
  ASSERT_EQ(source->read(block, kPatience), ReadResult::kSamples);
  EXPECT_NEAR(block.values[0], options.load[0], 2.3e-3);
  given["force_unit"] = "stone";
  source->close();
  EXPECT_THROW(source->configure(given), InputError);
}

TEST(NetftSource, RefusesAddressesThatCantWork) {
  for (const char* parameters :
       {"{}", "{address: box.local}", "{address: 300.1.1.1}", "{address: ''}",
        "{address: 127.0.0.1, bind_address: here}", "{address: 192.168.1.1}",
        "{address: 127.0.0.1, port: 0}", "{address: 127.0.0.1, port: 65536}",
        "{address: 127.0.0.1, counts_per_force: 1}",
        "{address: 127.0.0.1, configuration: guess}"}) {
    EXPECT_THROW(makeSource("netft")->configure(YAML::Load(parameters)), InputError) << parameters;
  }
  // an address that isn't this computer's, named with and without the box's own configuration
  for (const char* configuration :
       {"parameters, counts_per_force: 1, counts_per_torque: 1", "http"}) {
    const auto source = makeSource("netft");
    source->configure(YAML::Load(std::string("{address: 192.0.2.1, bind_address: 192.0.2.7, ") +
                                 "configuration: " + configuration + "}"));
    try {
      source->open();
      ADD_FAILURE() << "opened with " << configuration;
    } catch (const SourceError& error) {
      EXPECT_NE(std::string(error.what()).find("bind:= of the launch file) 192.0.2.7"),
                std::string::npos)
          << error.what();
    }
  }
}

TEST(NetftSource, TakesRecordsFromTheBoxAlone) {
  NetftEmulator emulator(NetftBench::options());
  const auto source = makeSource("netft");
  YAML::Node parameters = YAML::Load(
      "{address: 127.0.0.1, configuration: parameters, counts_per_force: 1000000, "
      "counts_per_torque: 1000000, block_period: 0.001, receive_timeout: 5}");
  parameters["port"] = emulator.port();
  source->configure(parameters);

  auto opened = std::async(std::launch::async, [&] { source->open(); });
  while (opened.wait_for(milliseconds(1)) != std::future_status::ready) emulator.emit(1);
  opened.get();
  const int port = emulator.clientPort();
  ASSERT_GT(port, 0);
  const Descriptor intruder(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in target{};
  target.sin_family = AF_INET;
  target.sin_port = htons(static_cast<std::uint16_t>(port));
  target.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  RdtRecord forged;
  forged.counts.fill(999999999);
  for (std::uint32_t i = 0; i < 50; ++i) {
    forged.rdt_sequence = 0xffffff00 + i;
    forged.ft_sequence = 1000000 + i;
    const auto data = packRdtRecord(forged);
    ASSERT_EQ(sendto(intruder.get(), data.data(), data.size(), 0,
                     reinterpret_cast<const sockaddr*>(&target), sizeof target),
              static_cast<ssize_t>(data.size()));
  }
  SourceBlock block;
  const auto limit = std::chrono::steady_clock::now() + kPatience;
  std::uint64_t samples = 0;
  while ((samples < 50 || source->counters().foreign < 50) &&
         std::chrono::steady_clock::now() < limit) {
    emulator.emit(1);
    if (source->read(block, milliseconds(20)) != ReadResult::kSamples) continue;
    samples += block.count;
    for (std::size_t i = 0; i < 6 * block.count; ++i) ASSERT_LT(std::abs(block.values[i]), 21.0);
  }
  EXPECT_EQ(source->counters().foreign, 50u);
  EXPECT_EQ(source->counters().restarts, 0u);
}

TEST(NetftSource, LosesNothingMoreThanTheLinkDoes) {
  Rig rig("netft");
  rig.open();
  rig.collect(5);
  const std::uint64_t before = box(rig).lost();
  box(rig).setFaults({0.10, 0.05, 0.05});
  for (int i = 0; i < 600; ++i) {
    box(rig).emit(20);
    rig.read(milliseconds(i % 3));
  }
  box(rig).setFaults({});
  box(rig).flush();
  box(rig).emit(20);
  rig.drain();
  const SourceCounters counters = rig.source->counters();
  EXPECT_EQ(counters.lost, box(rig).lost() - before);
  EXPECT_EQ(counters.duplicates, box(rig).duplicated());
  EXPECT_EQ(counters.restarts, 0u);
  EXPECT_EQ(box(rig).starts(), 1);
  EXPECT_GT(counters.lost, 1000u);  // 1200 expected
  EXPECT_LT(counters.late, box(rig).reordered());
  // each sample is the device's, in its place
  rig.expectTrue();
}

TEST(NetftSource, ABoxThatRestartsIsRequestedAgain) {
  Rig rig("netft");
  rig.askAfter(1.0);
  rig.open();
  rig.collect(10);
  for (int i = 0; i < 3; ++i) {
    box(rig).restart();
    const std::uint32_t stream = rig.block->stream;
    const auto limit = std::chrono::steady_clock::now() + kPatience;
    while (rig.block->stream == stream && std::chrono::steady_clock::now() < limit) {
      rig.bench->feed(1);
      ASSERT_NE(rig.read(), ReadResult::kLost);
    }
    EXPECT_NE(rig.block->stream, stream);
  }
  EXPECT_GE(rig.source->counters().restarts, 3u);
  rig.expectTrue();
}

DeviceBias biasOf(int ignored, bool onrobot = false) {
  NetftEmulator::Options options;
  options.load = {10.0, -20.0, 30.0, 1.0, -2.0, 3.0};
  options.amplitude = 0.001;
  options.rate = 2000.0;
  options.onrobot = onrobot;
  NetftEmulator emulator(options);
  emulator.ignoreBiases(ignored);
  const auto source = makeSource("netft");
  YAML::Node parameters = YAML::Load("{address: 127.0.0.1}");
  parameters["port"] = emulator.port();
  parameters["http_port"] = emulator.httpPort();
  source->configure(parameters);
  EXPECT_THROW(source->requestDeviceBias(), SourceError);
  source->open();
  EXPECT_EQ(source->deviceBias().state, DeviceBias::State::kNone);
  source->requestDeviceBias();
  EXPECT_EQ(source->deviceBias().state, DeviceBias::State::kPending);
  SourceBlock block;
  const auto limit = std::chrono::steady_clock::now() + kPatience;
  while (source->deviceBias().state == DeviceBias::State::kPending &&
         std::chrono::steady_clock::now() < limit) {
    source->read(block, milliseconds(50));
  }
  // a busy emulator sees a request late: it's asked once more, and may still have some to see
  const int requests = std::min(3, ignored + 1);
  while (emulator.biases() < requests && std::chrono::steady_clock::now() < limit) {
    std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_GE(emulator.biases(), requests);
  EXPECT_LE(emulator.biases(), 3);
  return source->deviceBias();
}

TEST(NetftSource, ABiasIsVerifiedFromFreshSamples) {
  // taken at once, and at the second try
  for (const int ignored : {0, 1}) {
    DeviceBias taken = biasOf(ignored);
    // an emulator that stands still for longer than it's asked has no chance
    for (int tries = 1; taken.state != DeviceBias::State::kVerified && tries < 5; ++tries) {
      taken = biasOf(ignored);
    }
    EXPECT_EQ(taken.state, DeviceBias::State::kVerified);
    EXPECT_EQ(taken.samples, 100u);
    // 20 mN, 2 mN·m of variation
    for (std::size_t k = 0; k < 6; ++k) EXPECT_LT(std::abs(taken.residual[k]), 0.02);
  }
  const DeviceBias refused = biasOf(5);
  EXPECT_EQ(refused.state, DeviceBias::State::kFailed);
  EXPECT_NEAR(refused.residual[2], 30.0, 0.02);
}

// Its sample count of 0 would take a bias off.
TEST(NetftSource, AnOnRobotBoxTakesTheBias) {
  DeviceBias taken = biasOf(0, true);
  for (int tries = 1; taken.state != DeviceBias::State::kVerified && tries < 5; ++tries) {
    taken = biasOf(0, true);
  }
  EXPECT_EQ(taken.state, DeviceBias::State::kVerified);
  EXPECT_LT(std::abs(taken.residual[2]), 0.02);
}

NetftEmulator::Options streamingOptions() {
  NetftEmulator::Options options;
  options.load = {10.0, -20.0, 30.0, 1.0, -2.0, 3.0};
  options.amplitude = 0.001;
  options.rate = 2000.0;
  return options;
}

std::unique_ptr<StrainSource> sourceOf(const NetftEmulator& emulator, const std::string& more) {
  auto source = makeSource("netft");
  YAML::Node parameters = YAML::Load("{address: 127.0.0.1" + more + "}");
  parameters["port"] = emulator.port();
  parameters["http_port"] = emulator.httpPort();
  source->configure(parameters);
  return source;
}

// Reads until the condition holds, or the link is lost.
template <class Condition>
ReadResult readUntil(StrainSource& source, SourceBlock& block, const Condition& condition) {
  const auto limit = std::chrono::steady_clock::now() + kPatience;
  ReadResult result = ReadResult::kTimeout;
  while (!condition() && std::chrono::steady_clock::now() < limit) {
    result = source.read(block, milliseconds(20));
    if (result == ReadResult::kLost) return result;
  }
  return result;
}

TEST(NetftSource, CountsChangedOnItsPageAreNoticedWhileItStreams) {
  NetftEmulator emulator(streamingOptions());
  const auto source = sourceOf(emulator, ", configuration_period: 0.02");
  source->open();
  SourceBlock block;
  ASSERT_EQ(source->read(block, kPatience), ReadResult::kSamples);
  EXPECT_NEAR(block.values[2], 30.0, 0.03);
  NetftConfiguration changed = streamingOptions().configuration;
  changed.counts_per_force = 1000.0;
  changed.torque_unit = "lbf-in";
  emulator.setConfiguration(changed);
  EXPECT_EQ(readUntil(*source, block, [] { return false; }), ReadResult::kLost);
  const std::string reason = source->lostReason();
  EXPECT_NE(reason.find("counts per force (cfgcpf) from 1000000 to 1000, unit of torque (scfgtu) "
                        "from Nm to lbf-in"),
            std::string::npos)
      << reason;
  source->close();
  source->open();
  ASSERT_EQ(source->read(block, kPatience), ReadResult::kSamples);
  EXPECT_NEAR(block.values[2], 30.0, 0.03);
  EXPECT_NEAR(block.values[5], 3.0, 0.003);
  // a page that can't be read is counted, and ends nothing
  emulator.setHttpResponse("HTTP/1.0 500 Busy\r\n\r\n");
  readUntil(*source, block, [&] { return source->counters().unread > 0; });
  EXPECT_GT(source->counters().unread, 0u);
  EXPECT_EQ(source->read(block, kPatience), ReadResult::kSamples);
}

TEST(NetftSource, TwoDriversOfOneBoxAreNamed) {
  NetftEmulator emulator(streamingOptions());
  const auto one = sourceOf(emulator, ", receive_timeout: 0.02, start_retries: 100");
  const auto other = sourceOf(emulator, ", receive_timeout: 0.02, start_retries: 100");
  one->open();
  SourceBlock block;
  ASSERT_EQ(one->read(block, kPatience), ReadResult::kSamples);
  EXPECT_EQ(one->counters().takeovers, 0u);
  other->open();
  const auto both = [&] {
    return one->counters().takeovers > 0 && other->counters().takeovers > 0;
  };
  auto reading = std::async(std::launch::async, [&] {
    SourceBlock own;
    readUntil(*other, own, both);
  });
  readUntil(*one, block, both);
  reading.get();
  EXPECT_TRUE(both());
}

TEST(NetftSource, ABoxThatDoesNotNumberItsMeasurementsIsNamed) {
  NetftEmulator emulator(streamingOptions());
  emulator.setUnnumbered(true);
  SourceBlock block;
  {
    const auto source = sourceOf(emulator, "");
    source->open();
    EXPECT_EQ(readUntil(*source, block, [] { return false; }), ReadResult::kLost);
    EXPECT_NE(source->lostReason().find("set drop_stale: false"), std::string::npos)
        << source->lostReason();
    EXPECT_EQ(source->counters().stale, 0u);
  }
  const auto source = sourceOf(emulator, ", drop_stale: false");
  source->open();
  readUntil(*source, block, [&] { return source->counters().samples > 100; });
  EXPECT_GT(source->counters().samples, 100u);
}

// What a page is like when another client reads it, too.
TEST(NetftSource, ASlowPageIsReadAndAHangingOneNamed) {
  NetftEmulator emulator(streamingOptions());
  const auto source = sourceOf(emulator, ", configuration_period: 0");
  emulator.setHttpPace(100, milliseconds(5));
  source->open();
  EXPECT_EQ(source->info().serial_number, "EMU-1");
  source->close();
  // no length, and the connection stays open for longer than the source would wait
  emulator.setHttpResponse(
      "HTTP/1.0 200 OK\r\n\r\n<netft><cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt>"
      "<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><calsn>kept</calsn></netft>");
  emulator.setHttpPace(1000, milliseconds(1000), true);
  source->open();
  EXPECT_EQ(source->info().serial_number, "kept");
  source->close();

  const auto failure = [](const NetftEmulator& box) {
    try {
      // a patience of its own: 50 ms
      readNetftPage({"127.0.0.1", box.httpPort(), "127.0.0.1"},
                    [](int descriptor, auto, bool for_writing) {
                      const short events = for_writing ? POLLOUT : POLLIN;
                      pollfd watched{descriptor, events, 0};
                      return poll(&watched, 1, 50) > 0;
                    });
    } catch (const SourceError& error) {
      return std::string(error.what());
    }
    return std::string("read");
  };
  NetftEmulator silent(streamingOptions());
  silent.setHttpPace(0, milliseconds(60000));
  EXPECT_NE(failure(silent).find("accepts the connection but sends no page: close browsers"),
            std::string::npos)
      << failure(silent);
  NetftEmulator stopping(streamingOptions());
  stopping.setHttpResponse("HTTP/1.0 200 OK\r\n\r\n<netft>");
  stopping.setHttpPace(0, milliseconds(10), true);
  EXPECT_NE(failure(stopping).find("stops after 26 bytes of its page"), std::string::npos)
      << failure(stopping);
}

TEST(NetftSource, NamesTheBitsOfAStatusWord) {
  EXPECT_EQ(makeSource("netft")->faultText(0x80020000),
            "transducer saturated or A/D converter fails, 0x80020000");
  EXPECT_EQ(makeSource("netft")->faultText(0x80010000), "monitor condition latched, 0x80010000");
  EXPECT_EQ(makeSource("netft")->faultText(0xc0000001), "CPU or RAM error, 0xc0000001");
  EXPECT_EQ(makeSource("serial")->faultText(6), "overrange, invalid measurements, 0x00000006");
  EXPECT_EQ(makeSource("iio")->faultText(2), "fault 0x00000002");
}

TEST(StrainSource, OnlyANetftBoxHasABiasOfItsOwn) {
  for (const char* name : {"simulated", "replay", "bota", "iio"}) {
    Rig rig(name);
    EXPECT_THROW(rig.source->requestDeviceBias(), SourceError) << name;
  }
}

}  // namespace
}  // namespace assembly_cell
