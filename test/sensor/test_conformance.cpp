// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// One suite for every source: what the driver relies on, whatever the device does.

#include <gtest/gtest.h>

#include <atomic>
#include <random>
#include <thread>

#include "allocations.h"
#include "assembly_cell/base/input_error.h"
#include "source_bench.h"

namespace assembly_cell {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

std::size_t openDescriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

std::string lineOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    const std::string line = error.what();
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
    return line;
  }
  return "";
}

class Conformance : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Sources, Conformance,
                         testing::Values("simulated", "replay", "netft", "bota", "robotiq", "iio"),
                         [](const auto& source) { return std::string(source.param); });

TEST_P(Conformance, DeliversTheDevicesSamples) {
  Rig rig(GetParam());
  const auto before = Clock::now();
  rig.open();
  const SourceInfo& info = rig.source->info();
  EXPECT_FALSE(info.device.empty());
  EXPECT_GT(info.rate, 0.0);
  EXPECT_NE(info.quantity, SampleQuantity::kCounts);
  rig.collect(300);
  rig.expectTrue();
  EXPECT_EQ(rig.source->counters().lost, rig.bench->numbered() ? 0 : rig.source->counters().lost);
  EXPECT_EQ(rig.source->counters().samples, rig.samples.size());
  EXPECT_GT(rig.block->period, 0.0);
  // the latest block is of this test, and both clocks say the same
  EXPECT_GE(rig.block->received.steady, before);
  EXPECT_LE(rig.block->received.steady, Clock::now());
  const auto age = std::chrono::system_clock::now() - rig.block->received.system;
  EXPECT_NEAR(std::chrono::duration<double>(age).count(),
              std::chrono::duration<double>(Clock::now() - rig.block->received.steady).count(),
              0.5);  // the two lines above may be apart on a busy machine
}

TEST_P(Conformance, RefusesMissingKeys) {
  Rig rig(GetParam());
  YAML::Node parameters = rig.bench->parameters();
  parameters["adress"] = "1";
  const std::string line = lineOf([&] { rig.source->configure(parameters); });
  EXPECT_NE(line.find("'adress' is unknown: there are "), std::string::npos) << line;
  EXPECT_THROW(rig.source->configure(YAML::Load("[1, 2]")), InputError);
  EXPECT_THROW(rig.source->configure(YAML::Load("just text")), InputError);
  // nothing was configured now
  EXPECT_THROW(rig.source->open(), std::logic_error);
  EXPECT_THROW(makeSource(rig.source->info().type)->open(), std::logic_error);
  for (const auto& entry : rig.bench->parameters()) {
    for (const char* bad : {"[]", "{a: 1}", ".nan", "-1e99", "\"\\x01\"", "~"}) {
      YAML::Node changed = rig.bench->parameters();
      const auto key = entry.first.as<std::string>();
      if (key == "type" || key == "columns") continue;
      // folders and files have any name
      if ((key == "file" || key == "iio_root" || key == "port" || key == "device") &&
          YAML::Load(bad).IsScalar()) {
        continue;
      }
      changed[key] = YAML::Load(bad);
      EXPECT_THROW(rig.source->configure(changed), InputError) << key << ": " << bad;
    }
  }
}

TEST_P(Conformance, OpenTwiceIsRefusedAndHarmless) {
  Rig rig(GetParam());
  rig.open();
  EXPECT_TRUE(rig.source->isOpen());
  const std::string line = lineOf([&] { rig.source->open(); });
  EXPECT_NE(line.find("open already"), std::string::npos);
  EXPECT_THROW(rig.source->open(), std::logic_error);
  EXPECT_THROW(rig.source->configure(rig.bench->parameters()), InputError);
  rig.collect(20);
  rig.expectTrue();
}

TEST_P(Conformance, AnAbsentDeviceIsNamed) {
  Rig rig(GetParam());
  rig.bench->unplug();
  if (std::string(GetParam()) == "simulated") {
    EXPECT_NO_THROW(rig.source->open());
    GTEST_SKIP() << GetParam() << ": it is always there";
  }
  rig.giveUpAfter(0.02, 3);
  const std::size_t descriptors = openDescriptors();
  for (int i = 0; i < 3; ++i) {
    const std::string line = lineOf([&] { rig.source->open(); });
    EXPECT_EQ(line.rfind(std::string(GetParam()) == "replay" ? "recording" : "source ", 0), 0u)
        << line;
    EXPECT_FALSE(rig.source->isOpen());
    EXPECT_EQ(rig.source->read(*rig.block, milliseconds(1)), ReadResult::kClosed);
  }
  EXPECT_EQ(openDescriptors(), descriptors);
  rig.bench->plug();
  rig.open();
  rig.collect(20);
  rig.expectTrue();
}

TEST_P(Conformance, ComesBackWheneverTheDeviceDoes) {
  Rig rig(GetParam());
  rig.giveUpAfter(0.01, 2);  // for a hundred losses
  rig.open();
  std::mt19937_64 random(3);
  for (int i = 0; i < (rig.bench->hasDevice() ? 100 : 5); ++i) {
    rig.collect(1 + random() % 5);
    const bool short_break = random() % 2 == 0;
    rig.bench->unplug();
    const auto pulled = rig.bench->fed();
    if (short_break || !rig.bench->hasDevice()) {
      rig.read(milliseconds(random() % 5));
    } else {
      ASSERT_TRUE(rig.readUntil(ReadResult::kLost)) << i;
      EXPECT_EQ(rig.source->lostReason().rfind("source ", 0), 0u);
    }
    rig.bench->plug();
    // what was measured before must not come out as new
    const std::size_t before = rig.samples.size();
    const std::uint32_t stream = rig.block->stream;
    if (!short_break || !rig.bench->hasDevice()) {
      rig.source->close();
      rig.open();
      rig.collect(1);
      ASSERT_NE(rig.samples.back().stream, stream);
      if (rig.bench->exact() && rig.bench->hasDevice()) {
        for (std::size_t k = before; k < rig.samples.size(); ++k) {
          const auto n = rig.identify(rig.samples[k].values);
          ASSERT_LT((n + 4001 - pulled % 4001) % 4001, 2000u) << "stale after return " << i;
        }
      }
    } else {
      // a short break may have cost the port: then it's lost, and open again helps
      rig.collect(1);
    }
  }
  rig.expectTrue();
}

TEST_P(Conformance, ASilentDeviceTimesOut) {
  Rig rig(GetParam());
  rig.giveUpAfter(0.5, 1);
  rig.open();
  rig.collect(5);
  if (!rig.bench->silence(true)) GTEST_SKIP() << GetParam() << ": it cannot fall silent";
  rig.drain();
  rig.source->close();
  rig.bench->silence(false);
  rig.open();
  rig.collect(1);
  rig.drain();
  // at once, and not before its time
  const auto start = Clock::now();
  EXPECT_EQ(rig.source->read(*rig.block, milliseconds(0)), ReadResult::kTimeout);
  EXPECT_EQ(rig.source->read(*rig.block, milliseconds(-5)), ReadResult::kTimeout);
  ReadResult result = rig.source->read(*rig.block, milliseconds(15));
  EXPECT_GE(Clock::now() - start, milliseconds(result == ReadResult::kTimeout ? 15 : 0));
  EXPECT_EQ(rig.block->count, 0u);
  // a silence that lasts is a loss
  EXPECT_TRUE(rig.readUntil(ReadResult::kLost, false));
}

TEST_P(Conformance, GarbageIsCountedAndNothingElse) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(5);
  rig.drain();
  std::mt19937_64 random(11);
  bool any = false;
  for (int i = 0; i < 60; ++i) {
    Bytes bytes(random() % 100);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    if (bytes.size() == kRdtRecordSize && std::string(GetParam()) == "netft") bytes.pop_back();
    any = rig.bench->send(bytes) || any;
    rig.read(milliseconds(1));
    rig.collect(2);
  }
  rig.expectTrue();
  const SourceCounters counters = rig.source->counters();
  EXPECT_EQ(counters.garbage + counters.malformed > 0, any);
}

TEST_P(Conformance, TruncatedMessagesGiveNoSample) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(5);
  const std::size_t size = rig.bench->message().size();
  for (std::size_t cut = 0; cut < size; ++cut) {
    Bytes part = rig.bench->message();
    part.resize(cut);
    ASSERT_TRUE(rig.bench->send(part));
    // frames out of step need the header of the next one
    rig.collect(3);
    rig.expectTrue();
  }
  // longer ones
  if (std::string(GetParam()) == "netft") {
    for (const std::size_t longer : {37u, 72u, 1400u, 60000u}) {
      Bytes whole = rig.bench->message();
      whole.resize(longer);
      ASSERT_TRUE(rig.bench->send(whole));
      rig.collect(3);
      rig.expectTrue();
    }
    EXPECT_EQ(rig.source->counters().malformed, size + 4);
  }
}

TEST_P(Conformance, MessagesInPiecesAreWhole) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(5);
  auto* serial = dynamic_cast<SerialBench*>(rig.bench.get());
  if (serial == nullptr) GTEST_SKIP() << GetParam() << ": no serial line";
  const std::size_t size = rig.bench->message().size();
  for (std::size_t cut = 1; cut < size; ++cut) {
    rig.drain();
    const Bytes whole = rig.bench->message();
    const auto middle = whole.begin() + static_cast<std::ptrdiff_t>(cut);
    const std::size_t before = rig.samples.size();
    ASSERT_TRUE(rig.bench->send({whole.begin(), middle}));
    rig.read(milliseconds(1));
    ASSERT_EQ(rig.bench->numbered() ? rig.samples.size() : before, before);
    ASSERT_TRUE(rig.bench->send({middle, whole.end()}));
    serial->emulator().skip(1);
    rig.collect(1);
  }
  rig.expectTrue();
  EXPECT_EQ(rig.source->counters().garbage, 0u);
  EXPECT_EQ(rig.source->counters().crc_errors, 0u);
  EXPECT_EQ(rig.source->counters().lost, 0u);
}

TEST_P(Conformance, FalseHeadersLeadNowhere) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(5);
  const Bytes whole = rig.bench->message();
  for (std::size_t length = 1; length < whole.size(); length += 3) {
    // headers alone, headers before a frame, a frame's beginning before a frame
    Bytes bytes;
    for (std::size_t i = 0; i < length; ++i) bytes.push_back(whole[i % 2]);
    if (std::string(GetParam()) == "netft" && bytes.size() == kRdtRecordSize) continue;
    rig.bench->send(bytes);
    rig.collect(3);
  }
  rig.expectTrue();
}

TEST_P(Conformance, CountsEveryLoss) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(20);
  std::uint64_t lost = 0;
  for (const std::size_t gap : {1u, 2u, 7u, 8u, 9u, 100u, 1500u, 20000u}) {
    if (!rig.bench->lose(gap)) GTEST_SKIP() << GetParam() << ": it cannot lose a message";
    lost += gap;
    rig.collect(20);
  }
  rig.drain();
  rig.expectTrue();
  EXPECT_EQ(rig.source->counters().lost, lost);
  EXPECT_EQ(rig.source->counters().restarts, 0u);
}

TEST_P(Conformance, ARepeatedMessageCountsOnce) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(20);
  for (int i = 0; i < 10; ++i) {
    if (!rig.bench->repeat()) GTEST_SKIP() << GetParam() << ": it cannot repeat a message";
    rig.collect(3);
  }
  rig.drain();
  rig.expectTrue();
  EXPECT_EQ(rig.source->counters().duplicates, 10u);
  EXPECT_EQ(rig.source->counters().lost, 0u);
}

TEST_P(Conformance, MessagesOutOfOrderAreInOrderOrLate) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(20);
  for (int i = 0; i < 10; ++i) {
    if (!rig.bench->swap()) GTEST_SKIP() << GetParam() << ": it cannot swap messages";
    rig.collect(3);
  }
  rig.drain();
  rig.expectTrue();
  const SourceCounters counters = rig.source->counters();
  EXPECT_EQ(counters.reordered + counters.late, 10u);
  EXPECT_EQ(counters.lost, 0u);
}

TEST_P(Conformance, AStalledDeviceGivesNoSample) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(20);
  rig.drain();
  if (!rig.bench->stall(true)) GTEST_SKIP() << GetParam() << ": it cannot stall";
  rig.bench->feed(50);
  const std::size_t before = rig.samples.size();
  while (rig.source->counters().stale < 50) {
    ASSERT_NE(rig.read(), ReadResult::kSamples);
  }
  EXPECT_EQ(rig.samples.size(), before);
  rig.bench->stall(false);
  rig.collect(20);
  rig.expectTrue(before);
}

TEST_P(Conformance, ADeviceThatFaultsGivesNoSampleUnlessAsked) {
  for (const bool asked : {false, true}) {
    Rig rig(GetParam());
    if (!rig.bench->fault(false)) GTEST_SKIP() << GetParam() << ": it reports no fault";
    YAML::Node parameters = rig.bench->parameters();
    parameters["publish_on_error"] = asked;
    rig.source->configure(parameters);
    rig.open();
    rig.collect(5);
    rig.drain();
    rig.bench->fault(true);
    rig.bench->feed(10);
    EXPECT_TRUE(rig.readUntil(asked ? ReadResult::kSamples : ReadResult::kFault));
    EXPECT_NE(rig.block->fault, 0u);
    rig.drain();
    EXPECT_EQ(rig.source->counters().faulty, asked ? 0u : 10u);
    EXPECT_NE(rig.source->counters().fault, 0u);
    rig.bench->fault(false);
    rig.collect(5);
    EXPECT_EQ(rig.block->fault, 0u);
    rig.expectTrue();
  }
}

TEST_P(Conformance, CloseEndsAReadAndAnOpen) {
  const std::size_t descriptors = openDescriptors();
  {
    Rig rig(GetParam());
    rig.source->close();
    rig.open();
    rig.collect(5);
    rig.bench->silence(true);
    // a read that would last an hour
    std::atomic<bool> ended{false};
    std::thread reader([&] {
      while (rig.source->read(*rig.block, std::chrono::hours(1)) != ReadResult::kClosed) {
      }
      ended = true;
    });
    rig.source->close();
    reader.join();
    EXPECT_TRUE(ended);
    EXPECT_FALSE(rig.source->isOpen());
    EXPECT_EQ(rig.source->read(*rig.block, milliseconds(1)), ReadResult::kClosed);
    rig.source->close();
    // an open that finds no device
    for (int i = 0; i < 3; ++i) {
      auto opener = std::async(std::launch::async, [&] {
        try {
          rig.source->open();
        } catch (const SourceError&) {
        }
      });
      // the first may come before the open
      do {
        rig.source->close();
      } while (opener.wait_for(milliseconds(1)) != std::future_status::ready);
      rig.source->close();
      EXPECT_FALSE(rig.source->isOpen());
    }
    rig.bench->silence(false);
    rig.open();
    rig.collect(5);
  }
  EXPECT_EQ(openDescriptors(), descriptors);
}

TEST_P(Conformance, ReadsWithoutAllocating) {
  Rig rig(GetParam());
  rig.open();
  rig.collect(20);
  rig.samples.reserve(rig.samples.size() + 4000);
  std::uint64_t allocations = 0;
  for (int i = 0; i < 100; ++i) {
    rig.bench->feed(5);
    const std::uint64_t before = test::allocationsOfThisThread();
    rig.source->read(*rig.block, milliseconds(5));
    allocations += test::allocationsOfThisThread() - before;
  }
  EXPECT_EQ(allocations, 0u);
}

}  // namespace
}  // namespace assembly_cell
