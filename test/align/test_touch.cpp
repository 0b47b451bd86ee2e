// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The hole from touches alone, and the strategy in cells that differ from their files.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "assembly_cell/align/estimation/touch_fit.h"
#include "assembly_cell/base/input_error.h"
#include "mismatched_trial.h"

namespace assembly_cell {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPeg = 0.025, kHole = 0.0251;

// Height at which the edge just touches the face or a chamfer of 45°: by dense sampling in axes of
// the hole, independent of the fit.
struct Sampled {
  double height;   // of the bottom's centre at the touch
  double azimuth;  // of the touch
};
Sampled touchOf(const Eigen::Matrix3d& R_HP, const Vector2d& beside, double chamfer = 0.0) {
  constexpr int kPoints = 40000;
  Sampled touch{-1.0, 0.0};
  for (int i = 0; i < kPoints; ++i) {
    const double a = 2 * M_PI * i / kPoints;
    const Vector3d e = R_HP * (kPeg * Vector3d(std::cos(a), std::sin(a), 0.0));
    const double out = (e.head<2>() + beside).norm() - kHole;
    const double height = -std::max(0.0, chamfer - out) - e.z();
    if (out < 0.0 || height < touch.height) continue;
    touch = {height, a};
  }
  return touch;
}

// seven touches round a hole that lies at `center` of a plane that is tilted in S
std::vector<TouchReading> touches(const Pose& X_SH, double chamfer = 0.0) {
  std::vector<TouchReading> readings;
  for (int i = 0; i < 7; ++i) {
    const double a = 2 * M_PI * i / 7;
    const Eigen::Matrix3d R =
        rotationFromVector({0.052 * Vector3d(-std::sin(a), std::cos(a), 0.0)});
    const Vector2d beside = Vector2d(-0.006, 0.003) + (i % 2) * Vector2d(0.002, 0.004);
    const Sampled touch = touchOf(R, beside, chamfer);
    TouchReading reading;
    reading.sd = 5e-5;
    reading.X_SP = X_SH * Pose{R, Vector3d(beside.x(), beside.y(), touch.height)};
    reading.point = kPeg * Vector2d(std::cos(touch.azimuth), std::sin(touch.azimuth)) +
                    Vector2d(1e-3, -2e-3);  // of a sensor that stands askew
    readings.push_back(reading);
  }
  return readings;
}

TouchModel model(double chamfer = 0.0) {
  TouchModel m;
  m.hole.chamfer_width = chamfer;
  m.peg.radius = kPeg;
  m.hole.radius = kHole;
  return m;
}

const Pose kHoleInS{rotationFromVector({Vector3d(0.01, -0.02, 0.0)}),
                    Vector3d(0.007, 0.004, -0.08)};

TEST(TouchFit, IsThatOfTheSampledEdge) {
  const TouchFit fit = fitTouches(model(), touches(kHoleInS));
  // the prior draws by (5e-5 / its deviation)², sampling moves a touch by 4 µm along the edge
  EXPECT_LT((fit.center - kHoleInS.p).norm(), 4e-5);
  EXPECT_LT((fit.normal - kHoleInS.R.col(2)).norm(), 1e-4);
  EXPECT_NEAR(fit.height, kHoleInS.R.col(2).dot(kHoleInS.p), 2e-6);
}

// 60 draws of noise on the heights alone: the mean of the normalised error squared has a deviation
// of 2/√60 = 0.26 about 2, and less with the points exact
TEST(TouchFit, CovarianceCoversTheError) {
  double sum = 0.0;
  constexpr int kDraws = 60;
  NormalSource normal(5);
  const std::vector<TouchReading> exact = touches(kHoleInS);
  for (int i = 0; i < kDraws; ++i) {
    std::vector<TouchReading> readings = exact;
    for (TouchReading& r : readings) r.X_SP.p.z() += r.sd * normal();
    const TouchFit fit = fitTouches(model(), readings);
    const Vector2d error = (fit.center - kHoleInS.p).head<2>();
    sum += error.dot(fit.center_covariance.inverse() * error) / kDraws;
  }
  EXPECT_LT(sum, 2.0 + 4 * 0.26);
  EXPECT_GT(sum, 0.3);
}

// 14 touches leave 9 degrees of freedom; a variance over its estimate has a mean of 1 and, by
// χ² of 9, a deviation of 0.63: 0.08 of 60 draws
TEST(TouchFit, EstimatesWhereMovesEnd) {
  constexpr int kDraws = 60;
  constexpr double kSd = 3e-5;
  double sum = 0.0;
  NormalSource normal(6);
  std::vector<TouchReading> twice = touches(kHoleInS);
  const std::vector<TouchReading> once = twice;
  twice.insert(twice.end(), once.begin(), once.end());
  for (int i = 0; i < kDraws; ++i) {
    std::vector<TouchReading> readings = twice;
    for (TouchReading& r : readings) r.X_SP.p.z() += kSd * normal();
    sum += kSd * kSd / fitTouches(model(), readings).place_variance / kDraws;
  }
  EXPECT_NEAR(sum, 1.0, 4 * 0.08);
}

TEST(TouchFit, NeedsAPlane) {
  std::vector<TouchReading> two = touches(kHoleInS);
  two.resize(2);
  EXPECT_THROW(fitTouches(model(), two), InputError);
}

// a lowest part below the plane in the middle is free; moved to the wall it reaches it
TEST(TouchFit, WallAndFreeAgreeWithTheGeometry) {
  TouchReading reading;
  const double tilt = 0.052, depth = 4e-4;
  reading.X_SP.R = rotationFromVector({Vector3d(0.0, tilt, 0.0)});  // low side at +x
  const double height = kPeg * std::sin(tilt) - depth;
  reading.kind = TouchReading::kWall;
  const double low = kPeg * std::cos(tilt);
  // along the low side its lowest point meets the wall, exactly
  reading.X_SP.p = Vector3d(kHole - low - 3e-5, 0.0, height);
  EXPECT_NEAR(touchResidual(model(), reading, Vector3d::UnitZ(), Vector3d::Zero()), -3e-5, 1e-9);
  reading.kind = TouchReading::kFree;
  reading.X_SP.p.x() = -2e-3;
  EXPECT_EQ(touchResidual(model(), reading, Vector3d::UnitZ(), Vector3d::Zero()), 0.0);
  reading.X_SP.p.x() = 6e-3;
  EXPECT_LT(touchResidual(model(), reading, Vector3d::UnitZ(), Vector3d::Zero()), -1e-4);
}

// Touches of a chamfered rim, some on its cone, against dense sampling: 8e-5 rad between two
// samples are 2 µm of the edge, which goes down by less than a tenth of that, on the cone by all of
// it.
TEST(TouchFit, ChamferIsThatOfTheSampledEdge) {
  constexpr double kChamfer = 5e-4;
  std::mt19937 random(8);
  std::uniform_real_distribution<double> either(-1.0, 1.0);
  int on_cone = 0;
  for (int i = 0; i < 400; ++i) {
    const Eigen::Matrix3d R =
        rotationFromVector({0.05 * Vector3d(either(random), either(random), 0.0)});
    const double reach = i % 3 == 0 ? 8e-4 : i % 3 == 1 ? 6e-3 : 0.015;
    const double chamfer = i % 2 == 0 ? kChamfer : 1e-4;
    const Vector2d beside(reach * either(random), reach * either(random));
    const Sampled touch = touchOf(R, beside, chamfer);
    if (touch.height < -0.5) continue;  // the whole edge is within the bore
    TouchReading reading;
    reading.X_SP = {R, Vector3d(beside.x(), beside.y(), touch.height)};
    const double a = touch.azimuth;
    const Vector3d at = R * (kPeg * Vector3d(std::cos(a), std::sin(a), 0.0)) + reading.X_SP.p;
    const bool cone = at.z() < -1e-6;
    on_cone += cone ? 1 : 0;
    EXPECT_NEAR(touchResidual(model(chamfer), reading, Vector3d::UnitZ(), Vector3d::Zero()), 0.0,
                cone ? 2e-6 : 2e-7)
        << i;
  }
  EXPECT_GT(on_cone, 20);
  const TouchFit fit = fitTouches(model(kChamfer), touches(kHoleInS, kChamfer));
  EXPECT_LT((fit.center - kHoleInS.p).norm(), 4e-5);
  EXPECT_LT((fit.normal - kHoleInS.R.col(2)).norm(), 1e-4);
  // who takes the rim for a sharp one is wrong by the chamfer's order
  const TouchFit sharp = fitTouches(model(), touches(kHoleInS, kChamfer));
  EXPECT_GT((sharp.center - kHoleInS.p).norm(), 1e-4);
}

// a low edge in the chamfer meets its cone, one below it the bore
TEST(TouchFit, WallsOfAChamferLean) {
  constexpr double kChamfer = 5e-4, kTilt = 0.052;
  TouchReading reading;
  reading.kind = TouchReading::kWall;
  reading.X_SP.R = rotationFromVector({Vector3d(0.0, kTilt, 0.0)});  // low side at +x
  const double low = kPeg * std::cos(kTilt);
  for (const double depth : {2e-4, 4e-4, 9e-4}) {
    const double wall = kHole + std::max(0.0, kChamfer - depth);
    reading.X_SP.p = Vector3d(wall - low - 3e-5, 0.0, kPeg * std::sin(kTilt) - depth);
    EXPECT_NEAR(touchResidual(model(kChamfer), reading, Vector3d::UnitZ(), Vector3d::Zero()), -3e-5,
                1e-9)
        << depth;
  }
}

constexpr double kBlunt = 5e-4;  // of a peg, at 45°

TouchModel bluntModel() {
  TouchModel m = model();
  m.peg.chamfer_width = kBlunt;
  return m;
}

// At this height a chamfered peg would just touch a sharp rim or the face, by its cone's circles,
// sampled: 4e-5 m of an edge between two samples are 2 µm of its height.
struct SampledCone {
  double height = -1.0, azimuth = 0.0;
  double up = 0.0;  // of the touch, over the bottom [m]
  bool found() const { return height > -0.5; }
};
SampledCone coneTouchOf(const Eigen::Matrix3d& R, const Vector2d& beside) {
  constexpr int kCircles = 100, kPoints = 4000;
  SampledCone touch;
  for (int k = 0; k <= kCircles; ++k) {
    const double up = kBlunt * k / kCircles, r = kPeg - kBlunt + up;
    for (int n = 0; n < kPoints; ++n) {
      const double a = 2 * M_PI * n / kPoints;
      const Vector3d e = R * Vector3d(r * std::cos(a), r * std::sin(a), up);
      if ((e.head<2>() + beside).norm() < kHole || -e.z() < touch.height) continue;
      touch = {-e.z(), a, up};
    }
  }
  return touch;
}

TEST(TouchFit, ChamferOfThePegIsThatOfTheSampledCone) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> either(-1.0, 1.0);
  int on_cone = 0, bottom_in_bore = 0;
  for (int i = 0; i < 240; ++i) {
    // the bore holds all of the bottom edge of a peg that is nearly upright
    const double tilt = i % 4 < 2 ? 0.05 : 0.002;
    const Eigen::Matrix3d R =
        rotationFromVector({tilt * Vector3d(either(random), either(random), 0.0)});
    const double reach = i % 2 == 0 ? 8e-4 : 6e-3;
    const Vector2d beside(reach * either(random), reach * either(random));
    const SampledCone touch = coneTouchOf(R, beside);
    if (!touch.found()) continue;  // all of the cone is within the bore
    on_cone += touch.up > 0.0 && touch.up < kBlunt ? 1 : 0;
    bottom_in_bore += touch.height + kPeg * std::hypot(R(2, 0), R(2, 1)) < 0.0 ? 1 : 0;
    TouchReading reading;
    reading.X_SP = {R, Vector3d(beside.x(), beside.y(), touch.height)};
    EXPECT_NEAR(touchResidual(bluntModel(), reading, Vector3d::UnitZ(), Vector3d::Zero()), 0.0,
                6e-6)
        << i << ", met at " << touch.up;
  }
  EXPECT_GT(on_cone, 10);
  EXPECT_GT(bottom_in_bore, 5);
}

// Forces that lean cross the bottom beside the point that they come from, a part up the cone.
TEST(TouchFit, LinesOfActionGoThroughTheCone) {
  std::vector<TouchReading> readings;
  int above = 0;
  for (int i = 0; i < 12; ++i) {
    const double a = 2 * M_PI * i / 12;
    const Eigen::Matrix3d R = rotationFromVector({0.03 * Vector3d(-std::sin(a), std::cos(a), 0.0)});
    const double off = i % 2 == 0 ? 0.006 : 4e-4;
    const Vector2d beside = off * Vector2d(std::cos(2.4 * i), std::sin(2.4 * i));
    const SampledCone touch = coneTouchOf(R, beside);
    ASSERT_TRUE(touch.found());
    above += touch.up > 0.5 * kBlunt ? 1 : 0;
    TouchReading reading;
    reading.sd = 5e-5;
    reading.X_SP = {R, Vector3d(beside.x(), beside.y(), touch.height)};
    reading.lean = 0.7 * Vector2d(-std::cos(touch.azimuth), -std::sin(touch.azimuth));
    reading.point =
        (kPeg - kBlunt + touch.up) * Vector2d(std::cos(touch.azimuth), std::sin(touch.azimuth)) -
        touch.up * reading.lean;
    readings.push_back(reading);
  }
  EXPECT_GT(above, 2);
  TouchModel m = bluntModel();
  m.point_sd = 2e-4;  // samples are 4e-5 m apart
  const TouchFit fit = fitTouches(m, readings);
  EXPECT_LT(fit.chi2, 8.0);  // of 43: places that are nearly as low
  EXPECT_LT(fit.center.head<2>().norm(), 2e-5);
  for (TouchReading& reading : readings) reading.lean.setZero();
  EXPECT_GT(fitTouches(m, readings).chi2, 3.0 * fit.chi2);
}

// what of the cone is below the plane meets the wall, at the shoulder or where the cone crosses it
TEST(TouchFit, ConeOfThePegMeetsTheWall) {
  constexpr double kTilt = 0.052;
  const double s = std::sin(kTilt), c = std::cos(kTilt);
  TouchReading reading;
  reading.kind = TouchReading::kWall;
  reading.X_SP.R = rotationFromVector({Vector3d(0.0, kTilt, 0.0)});  // low side at +x
  for (const double depth : {1e-4, 3e-4, 9e-4}) {
    const double up = std::min(1.0, depth / (kBlunt * (c - s)));
    const double r = kPeg - kBlunt * (1.0 - up), outermost = r * c + up * kBlunt * s;
    reading.X_SP.p = Vector3d(kHole - outermost - 3e-5, 0.0, (kPeg - kBlunt) * s - depth);
    EXPECT_NEAR(touchResidual(bluntModel(), reading, Vector3d::UnitZ(), Vector3d::Zero()), -3e-5,
                1e-6)
        << depth;
  }
}

AlignTrial tried(const char* strategy, int level, std::uint64_t seed) {
  const double a = 2.4 * static_cast<double>(seed);  // [rad]
  const double off = 0.003 + 0.0015 * static_cast<double>(seed % 9);
  return tryMismatched(loadMismatch(std::string(ASSEMBLY_CELL_SOURCE_DIR) +
                                    "/config/mismatch/level_" + std::to_string(level) + ".yaml"),
                       off * Vector2d(std::cos(a), std::sin(a)),
                       0.03 * Vector2d(std::sin(2.0 * a), std::cos(3.0 * a)), strategy, seed);
}

// Counts of docs/results/robustness.md: more than 99 of 100. Errors: five deviations of where a
// carrier comes to rest, 10, 30 and 50 µm an axis.
TEST(Touch, AlignsInCellsThatAreNotInTheirFiles) {
  for (int level = 1; level <= 3; ++level) {
    const double rests = level == 1 ? 1e-5 : level == 2 ? 3e-5 : 5e-5;
    for (std::uint64_t seed = 21; seed <= 22; ++seed) {
      const AlignTrial trial = tried(seed % 2 == 0 ? "auto" : "touch", level, seed);
      EXPECT_TRUE(trial.success) << "level " << level << " seed " << seed << ": "
                                 << trial.result.reason;
      EXPECT_FALSE(trial.false_success);
      EXPECT_LT((trial.result.offset - trial.true_offset).norm(), 5 * std::sqrt(2.0) * rests);
    }
  }
}

// The times count from the goal's start and from the insertion's; freeing the peg takes some more.
TEST(Touch, ATimeLimitEndsAGoalWithWhatIsKnown) {
  const Scenario cell =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  for (const char* strategy : {"touch", "auto"}) {
    AlignParameters parameters;
    parameters.strategy = strategy;
    parameters.time_limit = 6.0;
    const AlignTrial trial = tryAlignment(cell, cell.mechanism, CellParameters(), parameters);
    EXPECT_EQ(trial.result.failure, AlignFailure::kTimeLimit) << trial.result.reason;
    EXPECT_EQ(trial.result.reason.rfind("time_limit: not done within 6 s, clearance ", 0), 0u)
        << trial.result.reason;
    EXPECT_GT(trial.result.time, 6.0);
    EXPECT_LT(trial.result.time, 9.0);
    ASSERT_TRUE(trial.result.known);
    const Vector2d error = trial.result.offset - trial.true_offset;
    EXPECT_GT(trial.result.offset_covariance.determinant(), 0.0);
    // 5 deviations in the plane
    EXPECT_LT(error.dot(trial.result.offset_covariance.inverse() * error), 25.0);
    EXPECT_GT(trial.X_HP.p.z(), 0.0);
  }
}

TEST(Touch, TheInsertionHasATimeLimitOfItsOwn) {
  const Scenario cell =
      loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml");
  AlignParameters parameters;
  parameters.insert.depth = 0.04;
  parameters.insert.time_limit = 1.0;
  const AlignTrial trial = tryAlignment(cell, cell.mechanism, CellParameters(), parameters);
  EXPECT_EQ(trial.result.reason.rfind("time_limit: not done within 1 s of insertion, ", 0), 0u)
      << trial.result.reason;
  EXPECT_GT(trial.result.insert.profile.size(), 2u);  // of readings a millimetre apart
  EXPECT_GT(trial.X_HP.p.z(), 0.0);                   // out of the hole
}

}  // namespace
}  // namespace assembly_cell
