// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/recording/tones.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

struct Line {
  double frequency, before, after, phase;
};

struct Signal {
  std::vector<double> t, values;
};

// 10 s at 3.2 kHz; the amplitudes step at 4.321 s
Signal signal(const std::vector<Line>& lines, double noise, double step = 4.321) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  Signal out;
  for (int k = 0; k < 32000; ++k) {
    const double t = k / 3200.0;
    double y = 0.2 + noise * normal(random);
    for (const Line& l : lines) {
      y += (t < step ? l.before : l.after) * std::cos(2.0 * M_PI * l.frequency * t + l.phase);
    }
    out.t.push_back(t);
    out.values.push_back(y);
  }
  return out;
}

TEST(Tones, FrequenciesAndAmplitudesWithTheirSd) {
  const std::vector<Line> lines = {
      {97.3217, 0.5, 0.5, 0.3}, {123.4561, 0.4, 0.4, 1.1}, {151.0007, 0.02, 0.02, 2.0}};
  const Signal s = signal(lines, 0.05);
  const ToneAnalysis a = findTones(s.t, s.values);
  ASSERT_EQ(a.tones.size(), 3u);
  EXPECT_TRUE(a.steps.empty());
  EXPECT_NEAR(a.noise, 0.05, 0.002);
  EXPECT_NEAR(a.offset, 0.2, 5.0 * a.offset_sd);
  for (std::size_t k = 0; k < 3; ++k) {
    const Tone& tone = a.tones[k];
    EXPECT_NEAR(tone.frequency, lines[k].frequency, 4.0 * tone.frequency_sd) << k;
    EXPECT_NEAR(tone.amplitude[0], lines[k].before, 4.0 * tone.amplitude_sd[0]) << k;
    EXPECT_NEAR(tone.phase[0], lines[k].phase, 0.05) << k;
  }
  EXPECT_LT(a.tones[0].frequency_sd, 1e-4);
}

TEST(Tones, AStepIsFoundToASample) {
  const Signal s = signal(
      {{100.0, 0.25, 0.375, 0.0}, {120.0, 0.25, 0.375, 1.0}, {150.0, 0.25, 0.375, 2.0}}, 0.01);
  const ToneAnalysis a = findTones(s.t, s.values);
  ASSERT_EQ(a.steps.size(), 1u);
  EXPECT_NEAR(a.steps[0].time, 4.321, 0.005);
  ASSERT_EQ(a.tones.size(), 3u);
  for (const Tone& tone : a.tones) {
    EXPECT_NEAR(tone.amplitude[0], 0.25, 0.00125);
    EXPECT_NEAR(tone.amplitude[1], 0.375, 0.001875);
  }
}

TEST(Tones, OriginsAreCombinationsOfTheExciter) {
  const auto tone = [](double f) {
    Tone out;
    out.frequency = f;
    out.frequency_sd = 1e-5;
    out.amplitude = {1.0};
    return out;
  };
  const std::vector<Tone> exciter = {tone(101.0), tone(127.3)};
  EXPECT_EQ(originOf(tone(127.3), exciter, 0.05).kind, ToneOrigin::Kind::kExciter);
  EXPECT_EQ(originOf(tone(202.0), exciter, 0.05).kind, ToneOrigin::Kind::kHarmonic);
  const ToneOrigin mixed = originOf(tone(74.7), exciter, 0.05);
  EXPECT_EQ(mixed.kind, ToneOrigin::Kind::kIntermodulation);
  EXPECT_EQ(mixed.factors, (std::vector<int>{2, -1}));
  EXPECT_EQ(originOf(tone(50.0), exciter, 0.05).kind, ToneOrigin::Kind::kForeign);
}

TEST(Tones, NoiseAloneHasNone) {
  const Signal s = signal({}, 1.0);
  EXPECT_THROW(findTones(s.t, s.values), InputError);
}

}  // namespace
}  // namespace assembly_cell
