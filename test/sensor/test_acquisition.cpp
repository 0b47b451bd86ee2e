// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/acquisition.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

#include "allocations.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kWait = 20s;

template <class Condition>
bool waitFor(const Condition& condition) {
  const auto end = Clock::now() + kWait;
  while (Clock::now() < end) {
    if (condition()) return true;
    std::this_thread::sleep_for(1ms);
  }
  return condition();
}

// A source under a test's control; samples are numbered.
class Scripted : public StrainSource {
 public:
  Scripted() {
    info_.type = "scripted";
    info_.device = "nothing";
    configure(YAML::Node());
  }
  ~Scripted() override { close(); }

  std::atomic<int> refusals{0};           // opens to fail
  std::atomic<bool> static_fault{false};  // opens fail for good
  std::atomic<bool> plugged{true};
  std::atomic<bool> silent{false};
  std::atomic<std::uint64_t> limit{UINT64_MAX};  // samples to deliver
  std::atomic<bool> ends{false};                 // at the limit: the end, or a time-out
  std::mutex mutex;
  std::vector<Clock::time_point> attempts;

 protected:
  void doConfigure(const YAML::Node&) override {}
  void doOpen() override {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      attempts.push_back(Clock::now());
    }
    if (static_fault) throw InputError("scripted: key is bad: mend it");
    if (refusals > 0) {
      --refusals;
      throw SourceError("scripted: not there: plug it in");
    }
    if (!plugged) throw SourceError("scripted: not there: plug it in");
    ++stream_;
  }
  ReadResult doRead(SourceBlock& block, Clock::time_point deadline) override {
    if (!plugged) return lost("pulled out");
    if (silent || sequence_ >= limit) {
      if (ends && sequence_ >= limit) return ReadResult::kEnd;
      return wait(-1, deadline) == Wait::kStopped ? ReadResult::kClosed : ReadResult::kTimeout;
    }
    block.count = 10;
    for (std::size_t k = 0; k < block.count; ++k) {
      block.values[6 * k] = static_cast<double>(sequence_ + k);
    }
    block.sequence = sequence_;
    block.stream = stream_;
    block.received = {Clock::now(), std::chrono::system_clock::now()};
    sequence_ += block.count;
    counts_.samples += block.count;
    return ReadResult::kSamples;
  }

 private:
  std::uint64_t sequence_ = 0;
  std::uint32_t stream_ = 0;
};

AcquisitionOptions quick() {
  AcquisitionOptions options;
  options.queue = 8;
  options.read_timeout = 5ms;
  options.silence = 60ms;
  options.first_back_off = 10ms;
  options.longest_back_off = 80ms;
  return options;
}

// A recording loses nothing, whichever side is slower, and ends.
TEST(Acquisition, LosslessDeliversEverySampleInOrder) {
  Scripted source;
  source.limit = 5000;
  source.ends = true;
  AcquisitionOptions options = quick();
  options.lossless = true;
  Acquisition acquisition(source, options);
  acquisition.start();
  std::uint64_t expected = 0;
  while (const SourceBlock* block = acquisition.next(kWait)) {
    ASSERT_EQ(block->sequence, expected);
    ASSERT_EQ(block->values[6], static_cast<double>(expected + 1));
    expected += block->count;
    if (expected % 700 == 0) std::this_thread::sleep_for(2ms);
  }
  EXPECT_EQ(expected, 5000u);
  EXPECT_TRUE(acquisition.done());
  const LinkStatus status = acquisition.status();
  EXPECT_EQ(status.state, LinkState::kEnded);
  EXPECT_EQ(status.dropped_blocks, 0u);
  EXPECT_LE(status.queue_high, options.queue);
}

// A full queue loses its oldest blocks; what came through and what was dropped is all there was.
TEST(Acquisition, FullQueueDropsTheOldestAndCounts) {
  Scripted source;
  source.limit = 1000;
  Acquisition acquisition(source, quick());
  acquisition.start();
  ASSERT_TRUE(waitFor([&] { return acquisition.status().dropped_blocks == 92; }));
  std::uint64_t received = 0, last = 0;
  while (const SourceBlock* block = acquisition.next(20ms)) {
    EXPECT_TRUE(received == 0 || block->sequence > last);
    last = block->sequence;
    received += block->count;
  }
  const LinkStatus status = acquisition.status();
  EXPECT_EQ(last, 990u);     // the newest is there
  EXPECT_EQ(received, 80u);  // as many blocks as the queue holds
  EXPECT_EQ(status.dropped_samples, 920u);
  EXPECT_EQ(status.dropped_blocks, 92u);
  EXPECT_EQ(status.queue_high, 8u);
}

// 10, 20, 40, 80, 80 ms between attempts, and from the start again once samples have come.
TEST(Acquisition, BacksOffDoublingAndComesBack) {
  Scripted source;
  source.refusals = 5;
  Acquisition acquisition(source, quick());
  acquisition.start();
  ASSERT_TRUE(waitFor([&] { return acquisition.next(1ms) != nullptr; }));
  EXPECT_EQ(acquisition.status().failed_opens, 5u);
  EXPECT_EQ(acquisition.status().reconnects, 0u);
  EXPECT_EQ(acquisition.status().back_off, quick().first_back_off);
  {
    const std::lock_guard<std::mutex> lock(source.mutex);
    ASSERT_EQ(source.attempts.size(), 6u);
    const std::vector<std::chrono::milliseconds> waits = {10ms, 20ms, 40ms, 80ms, 80ms};
    for (std::size_t i = 0; i < waits.size(); ++i) {
      EXPECT_GE(source.attempts[i + 1] - source.attempts[i], waits[i]);
    }
  }
  source.plugged = false;
  ASSERT_TRUE(waitFor([&] { return acquisition.status().state == LinkState::kBackingOff; }));
  EXPECT_NE(acquisition.status().dynamic_cause, "");
  EXPECT_EQ(acquisition.status().last_loss, "source scripted: pulled out");
  EXPECT_EQ(acquisition.status().static_cause, "");
  EXPECT_TRUE(acquisition.status().ever_sampled);
  source.plugged = true;
  ASSERT_TRUE(waitFor([&] { return acquisition.status().reconnects == 1; }));
  EXPECT_EQ(acquisition.status().dynamic_cause, "");
}

// A device that answers but sends nothing is opened again.
TEST(Acquisition, OpensASilentDeviceAgain) {
  Scripted source;
  Acquisition acquisition(source, quick());
  acquisition.start();
  ASSERT_TRUE(waitFor([&] { return acquisition.next(1ms) != nullptr; }));
  source.silent = true;
  ASSERT_TRUE(waitFor([&] { return acquisition.status().opens >= 2; }));
  EXPECT_NE(acquisition.status().last_loss.find("no samples for"), std::string::npos);
  source.silent = false;
  ASSERT_TRUE(waitFor([&] { return acquisition.status().reconnects == 1; }));
}

// What can't work by configuration is a static cause, tried at leisure.
TEST(Acquisition, DistinguishesStaticCauses) {
  Scripted source;
  source.static_fault = true;
  Acquisition acquisition(source, quick());
  acquisition.start();
  ASSERT_TRUE(waitFor([&] { return acquisition.status().state == LinkState::kMisconfigured; }));
  EXPECT_EQ(acquisition.status().static_cause, "scripted: key is bad: mend it");
  EXPECT_EQ(acquisition.status().dynamic_cause, "");
  EXPECT_FALSE(acquisition.done());
  source.static_fault = false;
  ASSERT_TRUE(waitFor([&] { return acquisition.next(1ms) != nullptr; }));
  EXPECT_EQ(acquisition.status().static_cause, "");

  // and the reader of the blocks may have the last word
  acquisition.misconfigured("volts without a calibration");
  EXPECT_TRUE(acquisition.done());
  EXPECT_EQ(acquisition.next(1ms), nullptr);
  EXPECT_EQ(acquisition.status().state, LinkState::kMisconfigured);
  EXPECT_TRUE(waitFor([&] { return !source.isOpen(); }));
}

// What its owner has opened already is read as it is.
TEST(Acquisition, TakesASourceThatIsOpen) {
  Scripted source;
  source.open();
  Acquisition acquisition(source, quick());
  acquisition.start();
  ASSERT_NE(acquisition.next(kWait), nullptr);
  EXPECT_EQ(acquisition.status().failed_opens, 0u);
  EXPECT_EQ(source.attempts.size(), 1u);
}

TEST(Acquisition, NeitherSamplesNorBlocksAllocate) {
  Scripted source;
  Acquisition acquisition(source, quick());
  acquisition.start();
  ASSERT_NE(acquisition.next(kWait), nullptr);
  const std::uint64_t before = test::allocationsOfAll();
  for (int i = 0; i < 2000; ++i) {
    if (acquisition.next(kWait) == nullptr) break;
  }
  EXPECT_EQ(test::allocationsOfAll(), before);
}

// Stopping ends a read under way at once, and stopping twice does no harm.
TEST(Acquisition, StopsAtOnce) {
  Scripted source;
  source.silent = true;
  AcquisitionOptions options = quick();
  options.read_timeout = 1h;
  options.silence = 0ns;
  Acquisition acquisition(source, options);
  acquisition.start();
  ASSERT_TRUE(waitFor([&] { return acquisition.status().state == LinkState::kConnected; }));
  const auto start = Clock::now();
  acquisition.stop();
  EXPECT_LT(Clock::now() - start, kWait);
  EXPECT_FALSE(source.isOpen());
  acquisition.stop();
  EXPECT_EQ(acquisition.next(1ms), nullptr);
}

}  // namespace
}  // namespace assembly_cell
