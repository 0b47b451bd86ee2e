// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The forecast of a reading against the scatter of readings, the choice of the frequency, refusals.
#include "assembly_cell/locus/operating_point.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

OperatingPoint point(double frequency, double amplitude = 1.0) {
  OperatingPoint p;
  p.frequency = frequency;
  p.amplitude = amplitude;
  p.press = 12.0;
  return p;
}

// of one sample of the displacements through the bridge of sensor_b
Matrix6 noiseOf(int bits) {
  const Bridge bridge = bridgeB(bits, 0.5e-3);
  const Matrix6 T = designCalibration(bridge, cell().mechanism.coupling).volts_to_displacement;
  const double step = 2 * bridge.full_scale / std::ldexp(1.0, bits);
  return (bridge.noise * bridge.noise + step * step / 12) * T * T.transpose();
}

// the forecast at the worst direction is the scatter of inverted readings there
TEST(OperatingPoint, ForecastIsTheScatterOfReadings) {
  const Scenario s = cell();
  const OperatingPoint p = point(770);
  const Matrix6 noise = noiseOf(16);
  const Matrix6 root = noise.llt().matrixL();
  const DirectionForecast forecast = forecastDirection(s.mechanism, p, noise, 1000);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr int kRuns = 4000;
  // the upright cell is the same in all directions
  constexpr double alpha = 1.0;
  HarmonicFit fit;
  fit.samples = 1000;
  fit.noise = noise;
  const ContactResponse r = contactResponse(s.mechanism, p, alpha);
  double squares = 0.0, mean = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Eigen::Matrix<std::complex<double>, 6, 1> white;
    for (auto& w : white) w = {normal(random), normal(random)};
    fit.phasor = r.coupling + std::sqrt(2.0 / 1000) * root.cast<std::complex<double>>() * white;
    const DirectionEstimate e = contactDirection(
        s.mechanism, p, centreOfMassLocus(s.mechanism, p.frequency, fit), LocusAxes::kSensor);
    const double error = std::remainder(e.alpha - alpha, M_PI);
    mean += error / kRuns;
    squares += error * error / kRuns;
  }
  const double scatter = std::sqrt(squares - mean * mean);
  // 3 standard errors of an rms, and noise that differs a little between P and N; the static
  // force's arm, which the map leaves out, is a bias
  EXPECT_NEAR(scatter / forecast.direction_sd, 1.0, 0.055);
}

// sd falls with the root of the samples and with the force
TEST(OperatingPoint, ForecastScales) {
  const Scenario s = cell();
  const Matrix6 noise = noiseOf(16);
  const double once = forecastDirection(s.mechanism, point(770), noise, 1000).direction_sd;
  EXPECT_NEAR(forecastDirection(s.mechanism, point(770), noise, 4000).direction_sd, once / 2, 1e-9);
  EXPECT_NEAR(forecastDirection(s.mechanism, point(770, 2.0), noise, 1000).direction_sd, once / 2,
              1e-9);
  // ten bits: steps 64 times as large, the noise of the amplifier stays
  EXPECT_NEAR(forecastDirection(s.mechanism, point(770), noiseOf(10), 1000).direction_sd / once,
              std::sqrt((0.25e-6 + std::pow(10.0 / 1024, 2) / 12) /
                        (0.25e-6 + std::pow(10.0 / 65536, 2) / 12)),
              1e-6);
}

TEST(OperatingPoint, ChoosesNearTheMiddleOfTheResonances) {
  const Scenario s = cell();
  const Matrix6 noise = noiseOf(16);
  const ForecastLimits limits;
  const DirectionForecast best = chooseFrequency(s.mechanism, point(1), noise, 5000, 0.2, limits);
  const double middle = operatingFrequency(s.mechanism, 12.0);
  EXPECT_GT(best.frequency, middle / 2);
  EXPECT_LT(best.frequency, middle * 2);
  EXPECT_EQ(refusalOf(best, limits), "");
  // no other one that is not refused is better
  for (double w = middle / 2; w < 2 * middle; w *= 1.03) {
    const DirectionForecast f = forecastDirection(s.mechanism, point(w), noise, 1000);
    if (refusalOf(f, limits).empty()) {
      EXPECT_GT(f.direction_sd, 0.99 * best.direction_sd) << w;
    }
  }
  // where |P| is smallest the damped cell's single contact is all but a segment
  const DirectionForecast there = forecastDirection(s.mechanism, point(middle), noise, 1000);
  EXPECT_EQ(refusalOf(there, limits).rfind("looks_double: ", 0), 0u);
}

TEST(OperatingPoint, RefusesByName) {
  const Scenario s = cell();
  const ForecastLimits limits;
  EXPECT_EQ(refusalOf(forecastDirection(s.mechanism, point(770), noiseOf(16), 1000), limits), "");
  const std::string weak =
      refusalOf(forecastDirection(s.mechanism, point(770, 0.01), noiseOf(10), 1000), limits);
  EXPECT_EQ(weak.rfind("too_uncertain: ", 0), 0u) << weak;
  const std::string strong =
      refusalOf(forecastDirection(s.mechanism, point(770, 6.0), noiseOf(16), 1000), limits);
  EXPECT_EQ(strong.rfind("would_slip: ", 0), 0u) << strong;
  // the chosen frequency is refused, too
  const DirectionForecast none =
      chooseFrequency(s.mechanism, point(1, 1e-3), noiseOf(10), 5000, 0.2);
  EXPECT_EQ(refusalOf(none, limits).rfind("too_uncertain: ", 0), 0u);
}

TEST(OperatingPoint, BadInput) {
  const Scenario s = cell();
  EXPECT_THROW(forecastDirection(s.mechanism, point(770), noiseOf(16), 3), InputError);
  EXPECT_THROW(forecastDirection(s.mechanism, point(0), noiseOf(16), 1000), InputError);
  Matrix6 bad = noiseOf(16);
  bad(2, 2) = std::nan("");
  EXPECT_THROW(forecastDirection(s.mechanism, point(770), bad, 1000), InputError);
  EXPECT_THROW(chooseFrequency(s.mechanism, point(1), noiseOf(16), 50, 0.2), InputError);
}

}  // namespace
}  // namespace assembly_cell
