// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The shakers; the output of audio is read from ALSA's file device.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/shaker/shaker.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

std::string refusal(const std::string& type, const std::string& map) {
  try {
    makeShaker(type)->open(YAML::Load(map), 0.0);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

std::vector<std::int16_t> samplesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  std::vector<std::int16_t> samples(bytes.size() / 2);
  std::copy_n(bytes.begin(), 2 * samples.size(), reinterpret_cast<char*>(samples.data()));
  return samples;
}

class Audio : public testing::Test {
 protected:
  const std::string path_ = test::temporaryFile("shaker.raw");
  ~Audio() override { std::remove(path_.c_str()); }
  std::string map(const std::string& more = "") const {
    return "{type: audio, device: \"file:'" + path_ +
           "',raw\", gain_x: 0.08, gain_y: -0.05, ramp: 0.02" + more + "}";
  }
};

TEST_F(Audio, PlaysAmplitudePhaseAndDirectionInQuadrature) {
  const double delay = 1.2e-3, on = 50.1, off = 50.9, w = 2 * M_PI * 110.0;
  {
    const auto shaker = makeShaker("audio");
    shaker->open(YAML::Load(map(", delay: 1.2e-3")), 50.0);
    for (int i = 0; i <= 240; ++i) {  // work every 5 ms, sometimes 15 ms
      const double now = 50.0 + 5e-3 * i;
      if (i == 20) shaker->drive({7.0, w, 0.4, -1}, 49.0, on);
      if (i == 180) shaker->drive(ExciterCommand(), 0.0, off);
      if (i % 50 < 48) shaker->work(now);
    }
    EXPECT_EQ(shaker->state(51.2).gaps, 0u);
    EXPECT_LE(shaker->state(51.2).latency, 0.03);
  }
  const std::vector<std::int16_t> samples = samplesOf(path_);
  ASSERT_GT(samples.size(), 2u * 48000u);
  // sample n is output at 50 + n / rate, its force follows `delay` later
  std::complex<double> x = 0.0, y = 0.0;
  int n = 0;
  for (int i = 0; i < 48000 / 110 * 55; ++i) {
    const std::size_t k = static_cast<std::size_t>(i) + 48000 / 5;
    const double t = 50.0 + static_cast<double>(k) / 48000.0 + delay;
    const std::complex<double> turn = std::polar(2.0, w * (t - 49.0) + 0.4);
    x += turn * (samples[2 * k] / 32767.0 / 0.08);
    y += turn * (samples[2 * k + 1] / 32767.0 / -0.05);
    ++n;
  }
  // a rounding of half a step of 16 bits averages out; 55 periods are whole but for a sample
  EXPECT_LT(std::abs(x / static_cast<double>(n) - 7.0), 7.0 * 1e-3);
  // clockwise: y is minus the sine
  EXPECT_LT(std::abs(y / static_cast<double>(n) - std::complex<double>(0.0, -7.0)), 7.0 * 1e-3);
  // silence before, and a queue and a period after it was switched off
  for (std::size_t k = 0; k < 4800; ++k) ASSERT_EQ(samples[2 * k], 0) << k;
  const auto silent = static_cast<std::size_t>((0.9 + 0.021 + 1.0 / 110.0) * 48000.0);
  for (std::size_t k = 2 * silent; k < samples.size(); ++k) ASSERT_EQ(samples[k], 0) << k;
}

TEST_F(Audio, RefusesWhatItCannotPlay) {
  const auto shaker = makeShaker("audio");
  shaker->open(YAML::Load(map()), 0.0);
  EXPECT_EQ(shaker->cannot({12.0, 600.0, 0.0, 1}), "");
  EXPECT_NE(shaker->cannot({13.0, 600.0, 0.0, 1}).find("full scale is 12.5 N"), std::string::npos);
  EXPECT_NE(shaker->cannot({1.0, 2e5, 0.0, 1}).find("half the rate"), std::string::npos);
  EXPECT_NE(refusal("audio", "{device: no_such_card, gain_x: 1, gain_y: 1}").find("no_such_card"),
            std::string::npos);
  EXPECT_NE(refusal("audio", "{device: 'null', gain_x: 1}").find("gain_y"), std::string::npos);
  EXPECT_NE(refusal("audio", "{device: 'null', gain_x: 0, gain_y: 1}").find("gain_x"),
            std::string::npos);
  EXPECT_NE(
      refusal("audio", "{device: 'null', gain_x: 1, gain_y: 1, channel_y: 0}").find("channel_y"),
      std::string::npos);
  EXPECT_NE(refusal("audio", "{device: 'null', gain_x: 1, gain_y: 1, volume: 3}").find("volume"),
            std::string::npos);
  EXPECT_EQ(makeShaker("theremin"), nullptr);
}

constexpr const char* kMotor =
    "{type: unbalance, unbalance: 1e-4, acceleration: 500, max_speed: 400, index_angle: 0.3}";

TEST(Unbalance, RunsUpTurnsRoundThroughRestAndRunsDown) {
  const auto motor = makeShaker("unbalance");
  motor->open(YAML::Load(kMotor), 0.0);
  EXPECT_EQ(motor->cannot({9.0, 300.0, 0.0, 1}), "");
  EXPECT_NE(motor->cannot({5.0, 300.0, 0.0, 1}).find("makes 9 N"), std::string::npos);
  EXPECT_NE(motor->cannot({25.0, 500.0, 0.0, 1}).find("max_speed"), std::string::npos);
  motor->drive({9.0, 300.0, 0.0, 1}, 0.0, 1.0);
  motor->work(1.3);
  EXPECT_NEAR(*motor->speed(), 150.0, 1e-9);
  EXPECT_NEAR(motor->state(1.3).latency, 0.3, 1e-9);
  motor->work(1.7);
  EXPECT_NEAR(*motor->speed(), 300.0, 1e-9);
  motor->drive({4.0, 200.0, 0.0, -1}, 0.0, 2.0);
  for (double t = 2.0; t < 2.6; t += 0.01) {
    motor->work(t);
    EXPECT_GE(*motor->speed(), 0.0);
  }
  motor->work(2.8);
  EXPECT_NEAR(*motor->speed(), -100.0, 1e-6);
  motor->work(3.1);
  motor->drive(ExciterCommand(), 0.0, 3.1);
  motor->work(3.3);
  EXPECT_NEAR(*motor->speed(), -100.0, 1e-6);
  motor->work(3.6);
  EXPECT_EQ(*motor->speed(), 0.0);
  EXPECT_FALSE(motor->state(3.6).on);
}

TEST(Unbalance, ItsPhaseIsTheIndexPulses) {
  const auto motor = makeShaker("unbalance");
  motor->open(YAML::Load(kMotor), 0.0);
  motor->drive({9.0, 300.0, 0.0, -1}, 0.0, 0.0);
  motor->work(1.0);
  EXPECT_FALSE(motor->state(1.0).measured);
  const double revolution = 2 * M_PI / 290.0;  // with slip
  for (int i = 0; i < 5; ++i) motor->index(1.0 + i * revolution);
  const double now = 1.0 + 4.5 * revolution;
  const ShakerState state = motor->state(now);
  ASSERT_TRUE(state.measured);
  EXPECT_NEAR(state.force.frequency, 290.0, 1e-6);
  EXPECT_NEAR(state.force.amplitude, 1e-4 * 290.0 * 290.0, 1e-6);
  const double angle =
      state.force.direction * (state.force.frequency * (now - state.reference) + state.force.phase);
  EXPECT_NEAR(std::remainder(angle - (0.3 - M_PI), 2 * M_PI), 0.0, 1e-6);
  // without further pulses
  EXPECT_FALSE(motor->state(1.0 + 6.0 * revolution).measured);
}

}  // namespace
}  // namespace assembly_cell
