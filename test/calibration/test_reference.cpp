// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/reference/reference.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

// A sensor of known map that lags, in series with a reference, pushed by hand: bursts of 15 samples
// 0.37 ms apart with gaps of 0.35 s, counts in steps of 0.2, its own tare.
struct Bench {
  Eigen::MatrixXd map = Eigen::MatrixXd::Zero(6, 6);  // raw = map · wrench
  double lag = 0.008, square = 0.0, step = 3.7e-4;
  std::mt19937 random{7};

  Bench() {
    std::normal_distribution<double> normal;
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) map(i, j) = (i == j ? 20.0 : 3.0 * normal(random));
      map.row(i).tail<3>() *= 10.0;
    }
  }
  ReferenceRun run(const std::string& name, double phase, int bursts = 150) {
    std::normal_distribution<double> normal;
    const auto load = [&](double t) {
      Vector6 w = Vector6::Zero();
      const double grow = std::min(t / 2.0, 1.0) * (t > 1.0);
      for (int k = 0; k < 6; ++k) {
        w[k] = grow * (k < 3 ? 60.0 : 4.0) * std::sin((1.1 + 0.37 * k) * t + phase * (k + 1));
      }
      return w;
    };
    ReferenceRun out;
    out.name = name;
    out.raw.resize(15 * bursts, 6);
    out.wrench.resize(15 * bursts, 6);
    const Vector6 raw_tare = 10.0 * Vector6::Random(), tare = 0.3 * Vector6::Random();
    for (int b = 0, i = 0; b < bursts; ++b) {
      for (int k = 0; k < 15; ++k, ++i) {
        const double t = 0.35 * b + step * k;
        out.t.push_back(t);
        Vector6 raw = map * load(t - lag);
        raw += square * raw.cwiseAbs2() / 1000.0 + raw_tare;
        for (int c = 0; c < 6; ++c) {
          out.raw(i, c) = 0.2 * std::round((raw[c] + 0.5 * normal(random)) / 0.2);
          out.wrench(i, c) = load(t)[c] + tare[c] + (c < 3 ? 0.1 : 0.004) * normal(random);
        }
      }
    }
    return out;
  }
};

TEST(Reference, FindsMapLagAndTareOfEachRun) {
  Bench bench;
  const std::vector<ReferenceRun> runs = {bench.run("a", 0.3), bench.run("b", 1.7)};
  const ReferenceRun held = bench.run("c", 2.9);
  const ReferenceSolution s = solveReference(runs, &held, {});
  EXPECT_TRUE(s.accepted);
  EXPECT_EQ(s.model, ReferenceModel::kLinear);
  EXPECT_NEAR(s.lag, bench.lag, 3e-4);  // a burst is a line, the load is not
  EXPECT_LT(s.lag_sd, 1e-4);
  const Eigen::MatrixXd ground_truth = bench.map.inverse();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double sd = std::sqrt(s.covariance(6 * i + j, 6 * i + j));
      EXPECT_NEAR(s.map(i, j), ground_truth(i, j), 5.0 * sd) << i << " " << j;
    }
  }
  EXPECT_LT(s.hold_out->error.force, 0.5 * s.plain.force);
  EXPECT_EQ(s.runs[0].bursts, 150u);
}

TEST(Reference, TheRunLeftOutSelectsTheModel) {
  Bench bench;
  bench.square = 0.05;
  const std::vector<ReferenceRun> runs = {bench.run("a", 0.3), bench.run("b", 1.7),
                                          bench.run("c", 2.9)};
  const ReferenceSolution s = solveReference(runs, nullptr, {});
  EXPECT_NE(s.model, ReferenceModel::kLinear);
  EXPECT_LT(s.left_out[1].force, 0.8 * s.left_out[0].force);
  EXPECT_LE(s.left_out[1].force, s.plain.force);
}

TEST(Reference, StoredMapReadsTheHeldRun) {
  Bench bench;
  const std::vector<ReferenceRun> runs = {bench.run("a", 0.3), bench.run("b", 1.7)};
  Calibration c = referenceCalibration(solveReference(runs, nullptr, {}), runs);
  c.id = c.serial_number = "x";
  checkCalibration(c, "test");
  const ReferenceRun held = bench.run("c", 2.9);
  const Vector6 unloaded = held.raw.row(0);
  c.zero_volts = unloaded;
  Vector6 rms = Vector6::Zero();
  for (Eigen::Index i = 0; i < held.raw.rows(); ++i) {
    const Vector6 raw = held.raw.row(i);
    const Vector6 e =
        wrenchFromVolts(c, raw) - (held.wrench.row(i) - held.wrench.row(0)).transpose();
    rms += e.cwiseAbs2() / static_cast<double>(held.raw.rows());
  }
  EXPECT_LT(std::sqrt(rms.head<3>().mean()), 2.0);  // the lag is 1 N of it
}

TEST(Reference, RefusesDataThatCannotBeEvaluated) {
  Bench bench;
  const ReferenceRun run = bench.run("a", 0.3);
  EXPECT_THROW(solveReference({run}, nullptr, {}), InputError);
  bench.step = 3.7e-3;
  const ReferenceRun slow = bench.run("slow", 0.3);
  try {
    solveReference({run}, &slow, {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("slow: a sample every"), std::string::npos);
  }
  // the same recording again is refused
  ReferenceRun again = run;
  again.name = "again";
  EXPECT_THROW(solveReference({run, again}, nullptr, {}), InputError);
  EXPECT_THROW(solveReference({run}, &again, {}), InputError);
  // pushed along one axis only
  ReferenceRun one = bench.run("one", 0.3), two = bench.run("two", 1.0);
  one.wrench.rightCols<4>().setZero();
  two.wrench.rightCols<4>().setZero();
  EXPECT_FALSE(solveReference({one}, &two, {}).accepted);
}

// without or with noise, or a combination of other channels
TEST(Reference, RefusesAChannelThatSaysNothing) {
  Bench bench;
  const ReferenceRun first = bench.run("a", 0.3), second = bench.run("b", 1.7);
  const auto refusal = [&](const auto& spoil) {
    std::vector<ReferenceRun> runs = {first, second};
    for (ReferenceRun& run : runs) spoil(run);
    const ReferenceSolution s = solveReference(runs, nullptr, {});
    return s.accepted ? std::string("accepted") : gateTexts(s.gates, Verdict::kRefuse);
  };
  EXPECT_EQ(refusal([](ReferenceRun&) {}), "accepted");
  EXPECT_NE(refusal([](ReferenceRun& run) {
              run.raw.col(3).setConstant(7.0);
            }).find("raw channel 4 doesn't follow the load"),
            std::string::npos);
  EXPECT_NE(refusal([&](ReferenceRun& run) {
              std::normal_distribution<double> normal;
              for (double& raw : run.raw.col(2)) raw = normal(bench.random);
            }).find("raw channel 3 doesn't follow the load"),
            std::string::npos);
  EXPECT_NE(refusal([](ReferenceRun& run) {
              run.raw.col(5) = 2.0 * run.raw.col(4);
            }).find("combination of the others"),
            std::string::npos);
}

TEST(Reference, AModelWithoutARunLeftOutIsRefused) {
  Bench bench;
  const std::vector<ReferenceRun> runs = {bench.run("a", 0.3, 10), bench.run("b", 1.7, 10)};
  ReferenceOptions options;
  options.model = ReferenceModel::kQuadratic;
  const ReferenceSolution s = solveReference(runs, nullptr, options);
  EXPECT_FALSE(s.accepted);
  EXPECT_NE(gateTexts(s.gates, Verdict::kRefuse).find("no run left out can check"),
            std::string::npos);
}

TEST(Reference, FrozenReadingsUnitsAndOtherTimesAreNamed) {
  Bench bench;
  const ReferenceRun first = bench.run("a", 0.3), second = bench.run("b", 1.7);
  const auto expectRefused = [&](const std::function<void(ReferenceRun&)>& change,
                                 const std::string& words) {
    std::vector<ReferenceRun> runs = {first, second};
    for (ReferenceRun& run : runs) change(run);
    const ReferenceSolution s = solveReference(runs, nullptr, {});
    EXPECT_FALSE(s.accepted) << words;
    const std::string text = gateTexts(s.gates, Verdict::kRefuse);
    EXPECT_NE(text.find(words), std::string::npos) << words << ": " << text;
  };
  expectRefused([](ReferenceRun& run) { run.wrench.col(1).setConstant(0.5); },
                "fy of the reference is 0.5 in all rows");
  expectRefused(
      [](ReferenceRun& run) {
        for (int i = 900; i < 1200; ++i) run.raw.row(i) = run.raw.row(900);
      },
      "a: the raw channels stay the same to the last digit from 21 to ");
  expectRefused(
      [](ReferenceRun& run) {
        for (int i = 900; i < 1200; ++i) run.wrench.row(i) = run.wrench.row(900);
      },
      "a: the reference's six values stay the same");
  expectRefused([](ReferenceRun& run) { run.wrench.rightCols(3) *= 1e3; }, "in N mm?");
  expectRefused(
      [](ReferenceRun& run) {
        const Eigen::MatrixXd wrench = run.wrench;
        const Eigen::Index n = wrench.rows(), later = n / 3;
        run.wrench << wrench.bottomRows(n - later), wrench.topRows(later);
      },
      "don't follow the reference");
}

}  // namespace
}  // namespace assembly_cell
