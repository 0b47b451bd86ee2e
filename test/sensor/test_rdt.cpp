// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/rdt.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include "assembly_cell/sensor/reception.h"
#include "device_codecs.h"

namespace assembly_cell {
namespace {

TEST(Rdt, RequestsHaveTheDocumentedBytes) {
  // four distinct bytes of sample_count: a swap of two can't hide
  const auto start = packRdtRequest({static_cast<std::uint16_t>(RdtCommand::kStart), 0x01020304});
  const std::array<std::uint8_t, 8> bytes = {0x12, 0x34, 0x00, 0x02, 0x01, 0x02, 0x03, 0x04};
  EXPECT_EQ(start, bytes);
  const auto bias = packRdtRequest({static_cast<std::uint16_t>(RdtCommand::kBias), 0});
  const std::array<std::uint8_t, 8> bias_bytes = {0x12, 0x34, 0x00, 0x42, 0, 0, 0, 0};
  EXPECT_EQ(bias, bias_bytes);
  RdtRequest request;
  EXPECT_TRUE(unpackRdtRequest(start.data(), start.size(), request));
  EXPECT_EQ(request.sample_count, 0x01020304u);
  for (std::size_t size = 0; size < 8; ++size) {
    EXPECT_FALSE(unpackRdtRequest(start.data(), size, request));
  }
  // little-endian header
  const std::array<std::uint8_t, 8> swapped = {0x34, 0x12, 0x02, 0x00, 4, 3, 2, 1};
  EXPECT_FALSE(unpackRdtRequest(swapped.data(), swapped.size(), request));
}

TEST(Rdt, RecordsHaveTheDocumentedBytes) {
  const std::array<std::uint8_t, 36> bytes = {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x80,
                                              0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x01, 0xff, 0xff,
                                              0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x80, 0x00, 0x00,
                                              0x00, 0x11, 0x22, 0x33, 0x44, 0xff, 0xff, 0xff, 0xfe};
  RdtRecord record;
  ASSERT_TRUE(unpackRdtRecord(bytes.data(), bytes.size(), record));
  EXPECT_EQ(record.rdt_sequence, 0x01020304u);
  EXPECT_EQ(record.ft_sequence, 0x05060708u);
  EXPECT_EQ(record.status, kRdtMonitorCondition);
  const std::array<std::int32_t, 6> counts = {1, -1, 2147483647, -2147483647 - 1, 0x11223344, -2};
  EXPECT_EQ(record.counts, counts);
  EXPECT_EQ(packRdtRecord(record), bytes);
  for (const std::size_t size : {0u, 35u, 37u, 72u}) {
    EXPECT_FALSE(unpackRdtRecord(bytes.data(), size, record));
  }
}

// A stream under a test's control, with a plain model of what should come out.
struct Streamed {
  std::unique_ptr<RdtStream> stream = std::make_unique<RdtStream>();
  std::unique_ptr<SourceBlock> block = std::make_unique<SourceBlock>();
  SourceCounters counters;
  std::vector<double> values;  // of channel 0: the record's number
  std::vector<std::uint64_t> sequences;
  std::vector<std::uint32_t> streams;

  Streamed() {
    RdtPolicy policy;
    policy.scale.fill(1.0);
    stream->setPolicy(policy);
  }
  static RdtRecord record(std::uint32_t rdt, std::uint32_t ft, std::int32_t value) {
    RdtRecord made;
    made.rdt_sequence = rdt;
    made.ft_sequence = ft;
    made.counts.fill(value);
    return made;
  }
  void push(const RdtRecord& record) {
    while (!stream->push(record, Reception(), counters)) take(true);
  }
  void take(bool flush) {
    while (true) {
      const ReadResult result = stream->take(*block, 35, flush, counters);
      for (std::size_t i = 0; i < block->count; ++i) {
        values.push_back(block->values[6 * i]);
        sequences.push_back(block->sequence + i);
        streams.push_back(block->stream);
      }
      if (result == ReadResult::kTimeout && (!flush || stream->pending() == 0)) return;
    }
  }
};

// Requirement: 10 % loss, 5 % duplication, 5 % reordering.
TEST(RdtStream, CountsEveryLossExactlyUnderLossDuplicationAndReordering) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    std::mt19937_64 random(seed);
    const auto chance = [&] { return static_cast<double>(random() >> 11) * 0x1p-53; };
    // the numbers cross the end of 32 bits in the middle
    const std::uint32_t first = 0u - 50000u;
    std::uint64_t lost = 0;
    std::multimap<double, std::uint32_t> arrivals;
    std::uint64_t duplicated = 0;
    constexpr std::uint32_t kRecords = 100000;
    for (std::uint32_t n = 0; n < kRecords; ++n) {
      const bool edge = n == 0 || n + 1 == kRecords;
      if (!edge && chance() < 0.10) {
        ++lost;
        continue;
      }
      const double late = !edge && chance() < 0.05 ? 1.0 + 20.0 * chance() : 0.0;
      arrivals.emplace(n + late, n);
      if (!edge && chance() < 0.05) {
        ++duplicated;
        arrivals.emplace(n + late + 5.0 * chance(), n);
      }
    }
    Streamed streamed;
    std::size_t count = 0;
    for (const auto& [when, n] : arrivals) {
      streamed.push(Streamed::record(first + n, 7 + n, static_cast<std::int32_t>(n)));
      if (++count % 30 == 0) streamed.take(false);
    }
    streamed.take(true);
    const SourceCounters& c = streamed.counters;
    EXPECT_EQ(c.lost, lost);
    EXPECT_EQ(c.duplicates, duplicated);
    EXPECT_EQ(c.restarts, 0u);
    EXPECT_EQ(c.samples + c.lost + c.late, kRecords);
    EXPECT_EQ(c.samples, streamed.values.size());
    // most of those out of order found their place
    EXPECT_GT(c.reordered, c.late / 4);
    for (std::size_t i = 1; i < streamed.values.size(); ++i) {
      ASSERT_EQ(streamed.values[i] - streamed.values[i - 1],
                static_cast<double>(streamed.sequences[i] - streamed.sequences[i - 1]));
    }
  }
}

TEST(RdtStream, AStreamThatRestartsIsNoDuplicate) {
  Streamed streamed;
  for (std::uint32_t n = 1; n <= 50; ++n) streamed.push(Streamed::record(n, 1000 + n, 0));
  // a start request: the device goes on counting measurements
  for (std::uint32_t n = 1; n <= 50; ++n) streamed.push(Streamed::record(n, 2000 + n, 0));
  // a device that lost power: both restart
  for (std::uint32_t n = 1; n <= 50; ++n) streamed.push(Streamed::record(n, n, 0));
  streamed.take(true);
  EXPECT_EQ(streamed.counters.restarts, 2u);
  EXPECT_EQ(streamed.counters.samples, 150u);
  EXPECT_EQ(streamed.counters.lost, 0u);
  EXPECT_EQ(streamed.counters.duplicates, 0u);
  EXPECT_EQ((std::set<std::uint32_t>(streamed.streams.begin(), streamed.streams.end()).size()), 3u);
  EXPECT_TRUE(std::is_sorted(streamed.sequences.begin(), streamed.sequences.end()));
}

TEST(RdtStream, ADeviceThatRepeatsItsBootIsReceivedAfterAStart) {
  // power back within a fraction of a second: the same numbers again
  Streamed streamed;
  for (std::uint32_t n = 1; n <= 50; ++n) streamed.push(Streamed::record(n, n, 1));
  streamed.stream->expectRestart();
  for (std::uint32_t n = 1; n <= 50; ++n) streamed.push(Streamed::record(n, n, 2));
  streamed.take(true);
  EXPECT_EQ(streamed.counters.restarts, 1u);
  EXPECT_EQ(streamed.counters.duplicates, 0u);
  EXPECT_EQ(streamed.counters.samples, 100u);
}

TEST(RdtStream, AnAbsurdNumberCountsNoBillions) {
  Streamed streamed;
  for (std::uint32_t n = 1; n <= 50; ++n) streamed.push(Streamed::record(n, n, 0));
  streamed.push(Streamed::record(0x70000000, 51, 0));
  streamed.push(Streamed::record(0x70000001, 52, 0));
  streamed.take(true);
  EXPECT_EQ(streamed.counters.lost, 0u);
  EXPECT_EQ(streamed.counters.restarts, 1u);
}

TEST(RdtStream, DropsWhatWasMeasuredBeforeAndWhatTheDeviceDisowns) {
  Streamed streamed;
  for (std::uint32_t n = 1; n <= 60; ++n) {
    RdtRecord record = Streamed::record(n, n <= 20 ? n : n <= 40 ? 20 : n, 1);
    if (n > 50) record.status = 0x80020000;
    if (n == 45) record.status = kRdtMonitorCondition;
    streamed.push(record);
  }
  streamed.take(true);
  EXPECT_EQ(streamed.counters.samples, 30u);
  EXPECT_EQ(streamed.counters.stale, 20u);
  EXPECT_EQ(streamed.counters.faulty, 10u);
  EXPECT_EQ(streamed.counters.fault, 0x80020000u);
}

TEST(RdtStream, NewReadingsUnderAnOldNumberAreCountedApartFromRepeatedOnes) {
  Streamed streamed;
  for (std::uint32_t n = 1; n <= 30; ++n) {
    streamed.push(Streamed::record(n, 7, static_cast<std::int32_t>(n <= 10 ? 1 : n)));
  }
  streamed.take(true);
  EXPECT_EQ(streamed.counters.samples, 1u);
  EXPECT_EQ(streamed.counters.stale, 9u);
  EXPECT_EQ(streamed.counters.unnumbered, 20u);
}

TEST(RdtStream, CountsAtTheirEndAreMarkedSaturated) {
  Streamed streamed;
  for (const std::int32_t end :
       {std::numeric_limits<std::int32_t>::max(), std::numeric_limits<std::int32_t>::min()}) {
    RdtRecord record = Streamed::record(1, 1, 7);
    record.counts[4] = end;
    RdtStream stream;
    ASSERT_TRUE(stream.push(record, Reception(), streamed.counters));
    stream.take(*streamed.block, 35, true, streamed.counters);
    ASSERT_EQ(streamed.block->count, 1u);
    EXPECT_EQ(streamed.block->saturated[0], 1u << 4);
  }
}

TEST(RdtStream, ARecordBehindByEightStillFindsItsPlace) {
  for (std::uint32_t behind = 1; behind <= 12; ++behind) {
    Streamed streamed;
    for (std::uint32_t n = 1; n <= 40; ++n) {
      if (n != 20) streamed.push(Streamed::record(n, n, static_cast<std::int32_t>(n)));
      streamed.take(false);
      if (n == 20 + behind) streamed.push(Streamed::record(20, 20, 20));
    }
    streamed.take(true);
    const bool in_time = behind < RdtStream::kDepth;
    EXPECT_EQ(streamed.counters.reordered, in_time ? 1u : 0u) << behind;
    EXPECT_EQ(streamed.counters.late, in_time ? 0u : 1u) << behind;
    EXPECT_EQ(streamed.counters.lost, 0u) << behind;
  }
}

TEST(Reception, AStepOfTheSystemClockSpoilsNoArrival) {
  using std::chrono::milliseconds;
  const Reception now = {std::chrono::steady_clock::time_point(std::chrono::hours(10)),
                         std::chrono::system_clock::time_point(std::chrono::hours(500000))};
  const auto drained = now.steady - milliseconds(7);
  EXPECT_EQ(arrivalOf(now.system - milliseconds(3), now, drained).steady,
            now.steady - milliseconds(3));
  // set forward and back between the note and now
  for (const auto step : {std::chrono::hours(1), std::chrono::hours(-1)}) {
    const Reception arrival = arrivalOf(now.system - milliseconds(3) - step, now, drained);
    EXPECT_EQ(arrival.steady, now.steady);
    EXPECT_EQ(arrival.system, now.system);
  }
}

}  // namespace
}  // namespace assembly_cell
