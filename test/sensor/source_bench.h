// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/sensor/strain_source.h"
#include "emulators.h"

namespace assembly_cell {

using Bytes = std::vector<std::uint8_t>;

/// A source with the device that it reads, under a test's control. What a device can't do, it
/// refuses with false.
class SourceBench {
 public:
  virtual ~SourceBench() = default;

  virtual YAML::Node parameters() const = 0;
  virtual void feed(std::size_t samples) = 0;  ///< the device's next samples
  virtual std::uint64_t fed() const = 0;       ///< number of the next one

  // what kind of source it is
  virtual bool hasDevice() const { return true; }  ///< that can go away
  virtual bool numbered() const { return true; }   ///< sequences follow the device's samples
  virtual bool exact() const { return true; }      ///< its samples are emulatedValue()
  virtual double unit() const { return 1.0; }      ///< a block's value per emulatedValue()

  virtual void unplug() {}
  virtual void plug() {}
  virtual bool silence(bool) { return false; }       ///< there, but says nothing
  virtual bool stall(bool) { return false; }         ///< old measurements as new ones
  virtual bool lose(std::size_t) { return false; }   ///< the next samples, on their way
  virtual bool repeat() { return false; }            ///< the last sample again
  virtual bool swap() { return false; }              ///< the next two in the wrong order
  virtual bool send(const Bytes&) { return false; }  ///< whatever bytes as a message
  virtual Bytes message() { return {}; }  ///< the next sample's message, which isn't sent
  virtual bool fault(bool) { return false; }
};

/// No device: a generator, paced.
class SimulatedBench : public SourceBench {
 public:
  YAML::Node parameters() const override {
    return YAML::Load("{type: simulated, rate: 20000, block_size: 20, load: [1, 2, 3, 0, 0, 0]}");
  }
  void feed(std::size_t samples) override { fed_ += samples; }
  std::uint64_t fed() const override { return fed_; }
  bool hasDevice() const override { return false; }
  bool numbered() const override { return false; }
  bool exact() const override { return false; }

 private:
  std::uint64_t fed_ = 0;
};

class ReplayBench : public SourceBench {
 public:
  ReplayBench() : folder_(makeTemporaryFolder()) { plug(); }
  ~ReplayBench() override { std::filesystem::remove_all(folder_); }
  YAML::Node parameters() const override {
    return YAML::Load(
        "{type: replay, quantity: wrench, columns: [t, fx, fy, fz, tx, ty, tz], "
        "block_size: 10, loop: true, file: " +
        path() + "}");
  }
  void feed(std::size_t samples) override { fed_ += samples; }
  std::uint64_t fed() const override { return fed_; }
  bool hasDevice() const override { return false; }
  void unplug() override { std::filesystem::remove(path()); }
  void plug() override {
    std::ofstream file(path());
    file.precision(17);
    // 4001 samples: emulatedValue restarts there, and so does the loop
    for (std::uint64_t n = 0; n < 4001; ++n) {
      file << static_cast<double>(n) * 1e-4;
      for (std::size_t k = 0; k < 6; ++k) file << ',' << emulatedValue(n, k);
      file << '\n';
    }
  }

 private:
  std::string path() const { return folder_ + "/recording.csv"; }
  std::string folder_;
  std::uint64_t fed_ = 0;
};

class NetftBench : public SourceBench {
 public:
  NetftBench() : emulator_(options()) {}
  static NetftEmulator::Options options() {
    NetftEmulator::Options options;
    // a stream across the end of 32 bits
    options.first_sequence = 0xffffff00;
    return options;
  }
  YAML::Node parameters() const override {
    YAML::Node node = YAML::Load(
        "{type: netft, address: 127.0.0.1, block_period: 0.002, "
        "receive_timeout: 5, start_retries: 3}");
    node["port"] = emulator_.port();
    node["http_port"] = emulator_.httpPort();
    return node;
  }
  void feed(std::size_t samples) override {
    if (emulator_.emit(samples)) fed_ += samples;
  }
  std::uint64_t fed() const override { return fed_; }
  void unplug() override { emulator_.setDead(true); }
  void plug() override {
    emulator_.restart();
    emulator_.setDead(false);
  }
  bool silence(bool on) override {
    emulator_.setDead(on);
    return true;
  }
  bool stall(bool on) override {
    emulator_.setStalled(on);
    return true;
  }
  bool lose(std::size_t samples) override {
    emulator_.setFaults({1.0, 0.0, 0.0});
    feed(samples);
    emulator_.setFaults({});
    return true;
  }
  bool repeat() override {
    emulator_.setFaults({0.0, 1.0, 0.0});
    feed(1);
    emulator_.flush();
    emulator_.setFaults({});
    return true;
  }
  bool swap() override {
    emulator_.setFaults({0.0, 0.0, 1.0});
    feed(1);
    emulator_.setFaults({});
    feed(1);
    emulator_.flush();
    return true;
  }
  bool send(const Bytes& bytes) override { return emulator_.sendRaw(bytes); }
  Bytes message() override {
    // far from any stream's numbers, if it were taken
    const auto data = packRdtRecord(emulator_.record(0x40000000, 0));
    return {data.begin(), data.end()};
  }
  bool fault(bool on) override {
    emulator_.setStatus(on ? 0x80020000u : 0u);
    return true;
  }
  NetftEmulator& emulator() { return emulator_; }

 private:
  NetftEmulator emulator_;
  std::uint64_t fed_ = 0;
};

class SerialBench : public SourceBench {
 public:
  explicit SerialBench(bool robotiq) : robotiq_(robotiq), emulator_(options(robotiq)) {}
  static SerialEmulator::Options options(bool robotiq) {
    SerialEmulator::Options options;
    options.robotiq = robotiq;
    return options;
  }
  YAML::Node parameters() const override {
    YAML::Node node = YAML::Load("{type: serial, block_period: 0.002, receive_timeout: 5}");
    node["protocol"] = robotiq_ ? "robotiq" : "bota";
    node["port"] = emulator_.path();
    return node;
  }
  void feed(std::size_t samples) override { emulator_.emit(samples); }
  std::uint64_t fed() const override { return emulator_.sample(); }
  bool numbered() const override { return !robotiq_; }
  void unplug() override { emulator_.unplug(); }
  void plug() override { emulator_.plug(); }
  bool silence(bool on) override {
    emulator_.setDead(on);
    return true;
  }
  bool stall(bool on) override {
    if (!robotiq_) emulator_.setStalled(on);
    return !robotiq_;
  }
  bool lose(std::size_t samples) override {
    if (!robotiq_) emulator_.skip(samples);
    return !robotiq_;
  }
  bool repeat() override {
    return !robotiq_ && emulator_.sendRaw(emulator_.frame(emulator_.sample() - 2));
  }
  bool swap() override {
    if (robotiq_) return false;
    const std::uint64_t next = emulator_.sample();
    emulator_.skip(2);
    return emulator_.sendRaw(emulator_.frame(next + 1)) && emulator_.sendRaw(emulator_.frame(next));
  }
  bool send(const Bytes& bytes) override { return emulator_.sendRaw(bytes); }
  Bytes message() override { return emulator_.frame(emulator_.sample()); }
  bool fault(bool on) override {
    emulator_.setStatus(on ? kBotaInvalid : 0u);
    return !robotiq_;
  }
  SerialEmulator& emulator() { return emulator_; }

 private:
  bool robotiq_;
  SerialEmulator emulator_;
};

class IioBench : public SourceBench {
 public:
  YAML::Node parameters() const override {
    YAML::Node node = YAML::Load("{type: iio, device: ad7124-8, rate: 2000, block_period: 0}");
    node["iio_root"] = emulator_.root();
    return node;
  }
  void feed(std::size_t samples) override {
    fed_ += samples;
    std::array<std::int64_t, 6> codes;
    for (std::size_t k = 0; k < 6; ++k) {
      codes[k] = 8388608 + std::llround(1000.0 * emulatedValue(fed_, k));
    }
    emulator_.set(codes);
  }
  std::uint64_t fed() const override { return fed_; }
  bool numbered() const override { return false; }
  double unit() const override { return 1000.0 * 0.000298023e-3; }
  void unplug() override { emulator_.unplug(); }
  void plug() override {
    emulator_.plug();
    feed(1);
  }
  bool send(const Bytes& bytes) override {
    emulator_.setText(3, 'x' + std::string(bytes.begin(), bytes.end()));
    return true;
  }
  IioEmulator& emulator() { return emulator_; }

 private:
  IioEmulator emulator_{IioEmulator::Options()};
  std::uint64_t fed_ = 0;
};

inline std::unique_ptr<SourceBench> makeBench(const std::string& name) {
  if (name == "simulated") return std::make_unique<SimulatedBench>();
  if (name == "replay") return std::make_unique<ReplayBench>();
  if (name == "netft") return std::make_unique<NetftBench>();
  if (name == "iio") return std::make_unique<IioBench>();
  return std::make_unique<SerialBench>(name == "robotiq");
}

/// A sample as a source delivered it.
struct Delivered {
  std::uint64_t sequence;
  std::uint32_t stream;
  std::array<double, 6> values;
};

constexpr auto kPatience = std::chrono::seconds(20);  // with a busy machine

/// Numbers that passed.
inline std::uint64_t passed(const SourceCounters& c) {
  return c.samples + c.lost + c.late + c.faulty + c.stale;
}

/// A configured source with its bench. A silence is a loss after many seconds: with a busy machine
/// any thread may stand still for a second.
struct Rig {
  std::unique_ptr<SourceBench> bench;
  std::unique_ptr<StrainSource> source;
  std::unique_ptr<SourceBlock> block = std::make_unique<SourceBlock>();
  std::vector<Delivered> samples;
  bool hasty = false;

  explicit Rig(const std::string& name) : bench(makeBench(name)) {
    const YAML::Node parameters = bench->parameters();
    source = makeSource(parameters["type"].as<std::string>());
    source->configure(parameters);
  }

  /// A silence so long [s] is asked about, so many times.
  void askAfter(double receive_timeout, int start_retries = 3) {
    YAML::Node parameters = bench->parameters();
    if (!parameters["receive_timeout"]) return;
    parameters["receive_timeout"] = receive_timeout;
    parameters["start_retries"] = start_retries;
    source->configure(parameters);
  }

  /// For losses that a test waits for. What is lost because the machine was late is opened again.
  void giveUpAfter(double receive_timeout, int start_retries) {
    hasty = true;
    askAfter(receive_timeout, start_retries);
  }

  /// Opens while the device delivers.
  void open() {
    const auto limit = std::chrono::steady_clock::now() + kPatience;
    while (true) {
      auto opened = std::async(std::launch::async, [&] { source->open(); });
      while (opened.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
        bench->feed(1);
      }
      try {
        return opened.get();
      } catch (const SourceError&) {
        if (!hasty || std::chrono::steady_clock::now() > limit) throw;
      }
    }
  }

  ReadResult read(std::chrono::milliseconds timeout = std::chrono::milliseconds(20)) {
    const ReadResult result = source->read(*block, timeout);
    EXPECT_EQ(result == ReadResult::kSamples, block->count > 0);
    EXPECT_LE(block->count, kBlockCapacity);
    for (std::size_t i = 0; i < block->count; ++i) {
      Delivered sample{block->sequence + i, block->stream, {}};
      for (std::size_t k = 0; k < 6; ++k) sample.values[k] = block->values[6 * i + k];
      samples.push_back(sample);
    }
    return result;
  }

  /// Feeds and reads until `count` more samples have come.
  void collect(std::size_t count) {
    const std::size_t wanted = samples.size() + count;
    const auto limit = std::chrono::steady_clock::now() + kPatience;
    while (samples.size() < wanted && std::chrono::steady_clock::now() < limit) {
      bench->feed(1);
      if (read() == ReadResult::kLost && hasty) {
        source->close();
        open();
      }
    }
    ASSERT_GE(samples.size(), wanted);
  }

  /// Reads what is under way: until nothing comes any more.
  void drain() {
    if (!bench->numbered()) return;
    if (!bench->hasDevice()) return;
    const auto limit = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < limit) {
      const ReadResult result = read();
      if (result == ReadResult::kTimeout || result == ReadResult::kLost) return;
    }
    FAIL() << "it never ends";
  }

  bool readUntil(ReadResult wanted, bool feeding = false) {
    const auto limit = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < limit) {
      if (feeding) bench->feed(1);
      if (read() == wanted) return true;
    }
    return false;
  }

  /// Number of the device's sample (modulo 4001), from channel 0; 4001 if it's none.
  std::uint64_t identify(const std::array<double, 6>& values) const {
    static const std::vector<std::uint64_t> numbers = [] {
      std::vector<std::uint64_t> list(4001);
      for (std::uint64_t n = 0; n < 4001; ++n) {
        list[static_cast<std::size_t>(std::llround(100.0 * emulatedValue(n, 0)) + 2000)] = n;
      }
      return list;
    }();
    const double code = 100.0 * values[0] / bench->unit() + 2000.0;
    if (!(code > -0.5 && code < 4000.5)) return 4001;
    const std::uint64_t n = numbers[static_cast<std::size_t>(std::llround(code))];
    for (std::size_t k = 0; k < 6; ++k) {
      // float32 of ±20 is good to 1e-6
      if (!(std::abs(values[k] / bench->unit() - emulatedValue(n, k)) < 2e-6)) return 4001;
    }
    return n;
  }

  /// Every sample from `first` on is one that the device measured, and stands in its place.
  void expectTrue(std::size_t first = 0) const {
    if (!bench->exact()) return;
    for (std::size_t i = first; i < samples.size(); ++i) {
      const std::uint64_t n = identify(samples[i].values);
      ASSERT_LT(n, 4001u) << "sample " << i << " was never measured: " << samples[i].values[0];
      if (i == first) continue;
      ASSERT_GT(samples[i].sequence, samples[i - 1].sequence);
      if (!bench->numbered() || samples[i].stream != samples[i - 1].stream) continue;
      const std::uint64_t step = samples[i].sequence - samples[i - 1].sequence;
      ASSERT_EQ(n, (identify(samples[i - 1].values) + step) % 4001) << "sample " << i;
    }
  }
};

}  // namespace assembly_cell
