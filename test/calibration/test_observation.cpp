// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/observations/observation.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/common/store.h"
#include "assembly_cell/calibration/two_sensor/linearity.h"
#include "assembly_cell/calibration/two_sensor/plan.h"
#include "assembly_cell/calibration/two_sensor/rig.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

class Files : public ::testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& content) {
    std::ofstream(folder_ / name) << content;
    return folder_ / name;
  }
  static std::string refusalOf(const std::string& path) {
    try {
      readObservations(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  }
  const test::TemporaryFolder folder_;
};

ObservationSet sample() {
  CalibrationRig rig({});
  ObservationSet set = rig.description();
  for (const PlanName name : {PlanName::kQuadratic, PlanName::kDisplacement}) {
    const auto plan = makePlan(name, set);
    for (std::size_t k = 0; k < plan.size(); k += 13) {
      set.observations.push_back(rig.measure(plan[k]));
    }
  }
  return set;
}

TEST_F(Files, KeepEverything) {
  const ObservationSet set = sample();
  const std::string path = folder_ / "o.yaml";
  writeObservations(set, path);
  const ObservationSet back = readObservations(path);
  ASSERT_EQ(back.observations.size(), set.observations.size());
  EXPECT_EQ(observationHeader(back), observationHeader(set));
  for (std::size_t i = 0; i < set.observations.size(); ++i) {
    const Observation &x = set.observations[i], &y = back.observations[i];
    EXPECT_EQ(x.kind, y.kind);
    ASSERT_EQ(x.reading.a.has_value(), y.reading.a.has_value());
    if (x.reading.a) {
      EXPECT_EQ(x.reading.a->volts, y.reading.a->volts);
      EXPECT_EQ(x.reading.a->covariance, y.reading.a->covariance);
    }
    EXPECT_EQ(x.point, y.point);
    EXPECT_EQ(x.gauges, y.gauges);
    EXPECT_LT((x.X_AB.R - y.X_AB.R).cwiseAbs().maxCoeff(), 1e-15);
    EXPECT_EQ(parseObservation(observationLine(x), set, "line").point, x.point);
  }
}

TEST_F(Files, ACutOffLastLineIsRefused) {
  const ObservationSet set = sample();
  const std::string line = observationLine(set.observations[1]);
  const std::string whole = observationHeader(set) + observationLine(set.observations[0]) + "\n";
  for (const std::size_t cut : {line.size() / 4, line.size() / 2, line.size() - 1}) {
    EXPECT_NE(refusalOf(write("torn.yaml", whole + line.substr(0, cut))), "accepted");
  }
}

TEST_F(Files, RefuseByFileLineAndKey) {
  const std::string head = "format: assembly_cell observations 1\nobservations:\n";
  const auto expect = [&](const std::string& content, const std::string& part) {
    const std::string what = refusalOf(write("o.yaml", content));
    EXPECT_NE(what.find(part), std::string::npos) << what;
    EXPECT_NE(what.find("o.yaml"), std::string::npos) << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  };
  expect("", "empty");
  expect("format: other\n", "no observation file");
  expect(head + "- {kind: push}\n", "'push'");
  expect(head + "- {kind: weight, a: {volts: [1, 2, 3, 4, 5, 6]}}\n", "o.yaml:3");
  expect(head + "- {kind: unloaded}\n", "no reading");
  expect(head + "- {kind: unloaded, a: {volts: [1, 2, .nan, 4, 5, 6]}}\n", "volts[2] is '.nan'");
  expect(head + "- {kind: unloaded, a: {volts: [1, 2]}}\n", "has 2 entries");
  expect(head + "- {kind: unloaded, mass: 3, a: {volts: [1, 2, 3, 4, 5, 6]}}\n", "no known key");
  expect(head +
             "- {kind: weight, sensor: a, mass: -1, direction: [0, 0, 1], point: [0, 0, 0], "
             "a: {volts: [1, 2, 3, 4, 5, 6]}}\n",
         "mass is -1");
  expect(head +
             "- {kind: weight, sensor: a, mass: 1.0e+300, direction: [0, 0, 1], point: [0, 0, 0], "
             "a: {volts: [1, 2, 3, 4, 5, 6]}}\n",
         "mass is 1.0e+300");
  expect(head + "- {kind: unloaded, id: " + std::string(2000000, 'x') +
             ", a: {volts: [1, 2, 3, 4, 5, 6]}}\n",
         "id has 2000000 characters");
  expect(head +
             "- {kind: weight, sensor: a, mass: 1, direction: [0, 0, 2], point: [0, 0, 0], "
             "a: {volts: [1, 2, 3, 4, 5, 6]}}\n",
         "o.yaml:3: observations[0].direction is '0, 0, 2': give the unit vector");
  expect("format: assembly_cell observations 1\ngravity: -9\nobservations:\n",
         "o.yaml:2: gravity is '-9'");
  expect(head + "- {kind: reacting, position: [0, 0, 0], quaternion: [0, 0, 0, 2]}\n",
         "quaternion is '0, 0, 0, 2'");
  EXPECT_NE(refusalOf(folder_ / "none.yaml"), "accepted");
}

TEST_F(Files, CsvGivesTheSame) {
  const std::string csv =
      write("o.csv",
            "# sensor_a: {bits: "
            "10}\nkind,stamp,sensor,mass,gx,gy,gz,px,py,pz,a1,a2,a3,a4,a5,a6,a_samples\n"
            "unloaded,1,,,,,,,,,0,0,0,0,0,0,10\nweight,2,a,3,0,0,-1,0.01,0,0.03,1,2,3,4,5,6,1\n");
  const ObservationSet set = readObservations(csv);
  ASSERT_EQ(set.observations.size(), 2u);
  EXPECT_EQ(set.sensor.a.bits, 10);
  EXPECT_EQ(set.observations[1].mass, 3.0);
  EXPECT_EQ(set.observations[1].point.z(), 0.03);
  // 10 bits: the noise does not dither, averages do not help
  const double lsb = 10.0 / 1024;
  EXPECT_NEAR(set.observations[0].reading.a->covariance(0, 0), 0.25e-6 + lsb * lsb / 12, 1e-12);
  EXPECT_NE(refusalOf(write("bad.csv", "kind,volts\nunloaded,1\n")).find("'volts'"),
            std::string::npos);
  EXPECT_NE(refusalOf(write("bad.csv", "kind,a1\nunloaded,1,2\n")).find("bad.csv:2"),
            std::string::npos);
}

// Noise over the number of samples where it dithers the converter, and only there.
TEST(Averaging, CovarianceOfTheMean) {
  for (const int bits : {10, 16}) {
    SensorDescription sensor;
    sensor.bits = bits;
    NormalSource normal(1);
    std::vector<Vector6> volts;
    const Bridge bridge = bridgeA(bits, 0.5e-3);
    for (int i = 0; i < 1000; ++i) {
      volts.push_back(convertVolts(bridge, Vector6::Zero(), normal).volts);
    }
    const Reading r = averageReading(volts, std::vector<std::uint8_t>(1000, 0), sensor);
    const double q = sensor.lsb() * sensor.lsb() / 12.0;
    if (bits == 16) {
      EXPECT_NEAR(r.covariance(0, 0), (0.25e-6 + q) / 1000, 0.15 * 0.25e-9);
    } else {
      EXPECT_GE(r.covariance(0, 0), q);
    }
    EXPECT_FALSE(unusable(r, sensor));
  }
}

// A parabola of known size with a loop of known size.
TEST(Linearity, FindsWhatIsThere) {
  const auto run = [](double bend, double loop, double noise) {
    NormalSource normal(7);
    std::vector<LinearityStep> steps;
    for (int cycle = 0; cycle < 2; ++cycle) {
      for (int k = 0; k <= 20; ++k) {
        const double x = (k <= 10 ? k : 20 - k) / 10.0;
        const double branch = k > 10 && k < 20 ? loop : 0.0;
        steps.push_back({50 * x, 0.1 + 4 * (x + bend * x * x + branch) + noise * normal()});
      }
    }
    return testLinearity(steps);
  };
  const LinearityResult straight = run(0.0, 0.0, 1e-4);
  EXPECT_TRUE(straight.linear_model_allowed);
  EXPECT_NEAR(straight.slope, 0.08, 1e-5);
  EXPECT_LT(straight.nonlinearity, 1e-4);
  EXPECT_GT(straight.lack_of_fit_p, 1e-3);
  EXPECT_LT(std::abs(straight.quadratic_t), 4.0);
  // x² about the middle: a quarter of the coefficient over the half range
  const LinearityResult bent = run(0.06, 0.0, 1e-4);
  EXPECT_FALSE(bent.linear_model_allowed);
  EXPECT_NEAR(bent.quadratic, 0.06 / 4 / 1.06, 2e-4);
  EXPECT_GT(bent.quadratic_t, 10.0);
  EXPECT_LT(bent.lack_of_fit_p, 1e-6);
  const LinearityResult loop = run(0.0, 0.003, 1e-5);
  EXPECT_NEAR(loop.hysteresis, 0.003, 1e-4);
  EXPECT_FALSE(loop.linear_model_allowed);
  EXPECT_THROW(testLinearity({}), InputError);
  EXPECT_THROW(testLinearity({{0, 0}, {1, 1}, {2, 2}}), InputError);
}

TEST_F(Files, StoreTakesNamesOnly) {
  const std::string store = folder_ / "store";
  for (const std::string bad : {"", "..", "../x", "a/b", ".hidden", "a b", "a\nb"}) {
    EXPECT_THROW(calibrationPath(store, "sensor_a", bad), InputError) << bad;
    EXPECT_THROW(calibrationPath(store, bad, "x"), InputError) << bad;
  }
  EXPECT_THROW(calibrationPath(store, "a", std::string(101, 'x')), InputError);
  makeCalibrationFolder(store, "sensor_a");
  EXPECT_TRUE(storedCalibrations(store, "sensor_a").empty());
  std::ofstream(calibrationPath(store, "sensor_a", "one")) << "x";
  EXPECT_EQ(storedCalibrations(store, "sensor_a"), std::vector<std::string>{"one"});
}

}  // namespace
}  // namespace assembly_cell
