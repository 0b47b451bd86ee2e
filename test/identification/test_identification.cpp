// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The linear model against closed form and simulation, and the fit against cells that were drawn.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/align_trial.h"
#include "assembly_cell/cell/identification_trial.h"
#include "assembly_cell/identification/mechanism_check.h"
#include "assembly_cell/locus/vibration_fit.h"
#include "assembly_cell/mismatch/mismatch.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

Scenario cell() { return loadScenario(ASSEMBLY_CELL_SOURCE_DIR "/config/scenarios/cell.yaml"); }

Truth drawn(const std::string& mismatch, std::uint64_t seed) {
  return drawTruth(parseMismatch(mismatch, "test"), seed);
}

// of a cell whose parts differ and whose sensors are exact
constexpr const char* kParts = R"(
scale:
  coupling.stiffness.each: {uniform: [0.9, 1.1]}
  coupling.damping.each: {log_uniform: [0.7, 1.4]}
  carrier.stiffness.each: {uniform: [0.8, 1.2]}
  peg.mass: {uniform: [0.95, 1.05]}
  carrier.mass: {uniform: [0.95, 1.05]}
  friction: {uniform: [0.7, 1.4]}
add:
  peg.coupling_height: {uniform: [-5.0e-4, 5.0e-4]}
  peg.exciter_height: {uniform: [-5.0e-4, 5.0e-4]}
exciter: {amplitude: {uniform: [0.8, 1.2]}, delay: {uniform: [0, 1.0e-3]}, ellipticity: 0.05}
carrier: {compliance: 5.0e-6}
)";

IdentificationTrial tryLevel2(std::uint64_t seed) {
  const Scenario nominal = cell();
  const Mismatch mismatch = loadMismatch(ASSEMBLY_CELL_SOURCE_DIR "/config/mismatch/level_2.yaml");
  const Truth ground_truth = drawTruth(mismatch, seed);
  CellParameters parameters;
  parameters.seed = seed;
  parameters.truth = ground_truth.cell;
  return tryIdentification(trueScenario(nominal, ground_truth, "test"), nominal.mechanism,
                           parameters, planFor(nominal.mechanism), {});
}

// one identification for all tests that look at one
const IdentificationTrial& level2() {
  static const IdentificationTrial trial = tryLevel2(5);
  return trial;
}

// A point mass in a spring and a damper, the carrier as good as fixed: F (k + iωc) / (k - mω² +
// iωc).
TEST(Response, OfAPointMassIsTheClosedForm) {
  Mechanism m = cell().mechanism;
  m.peg.coupling_height = m.peg.exciter_height = 0.0;
  m.coupling.stiffness.k26 = m.coupling.stiffness.k35 = 0.0;
  m.carrier.stiffness = {1e14, 1e14, 1e14};
  m.gravity = 0.0;  // the weight's arm moves with the peg
  // the carrier yields by 5e-10 of the coupling, five times that at resonance
  constexpr double kRounding = 1e-8;
  for (const double frequency : {100.0, 356.0, 1200.0}) {
    for (const int direction : {1, -1}) {
      const ExciterParameters exciter{2.0, frequency, 0.0, direction};
      const WrenchPhasor wrench = hangingResponse({m, {}}, exciter, {0.0, 0.0});
      const Complex spring(m.coupling.stiffness.diagonal[1],
                           direction * frequency * m.coupling.damping.diagonal[1]);
      const Complex force = 2.0 * spring / (spring - m.peg.mass * frequency * frequency);
      EXPECT_LT(std::abs(wrench[0] - force), kRounding * std::abs(force));
      // a quarter of a turn behind along y, whichever way it turns
      EXPECT_LT(std::abs(wrench[1] - Complex(0, -1) * force), kRounding * std::abs(force));
      EXPECT_LT(std::abs(wrench[2]) + wrench.tail<3>().norm(), kRounding * std::abs(force));
    }
  }
}

// Largest difference of a part of a reading from the model with what is true, torques at 30 mm, of
// the reading's force.
struct Misfit {
  double hanging = 0.0, pressed = 0.0;
};

// The nonlinear simulation of a cell with other parts, by sensors without noise, after a swing has
// died away.
Misfit misfitOf(const std::string& mismatch, int places) {
  const Scenario nominal = cell();
  const Truth ground_truth = drawn(mismatch, 3);
  const Scenario start = trueScenario(nominal, ground_truth, "test");
  CellParameters parameters;
  parameters.noise = 1e-7;
  parameters.bits = 24;
  parameters.truth = ground_truth.cell;
  SimulatedPlant plant(start, nominal.mechanism, parameters);
  IdentificationPlan plan = planFor(nominal.mechanism);
  plan.places = places;
  plan.swing = 3.0;
  plan.time_limit = 200.0;
  const IdentificationData data = measure(plant, nominal.mechanism, plan);
  EXPECT_EQ(data.vibrations.size(), 2 * (plan.hanging.size() + places * plan.pressed.size()));
  EXPECT_TRUE(data.friction);
  if (data.friction) {
    const double friction = start.mechanism.friction.sliding_coefficient;
    EXPECT_NEAR(data.friction->coefficient, friction, 0.01 * friction);
  }
  const MechanismModel model = trueModel(start);
  const Pose rest = poseFromRest(start.rest);
  Misfit misfit;
  for (const VibrationReading& reading : data.vibrations) {
    WrenchPhasor expected;
    if (reading.place) {
      expected = pressedResponse(model, reading.exciter, {rest.R * reading.R_BS, reading.contact});
    } else {
      const RotationVector lean = vectorFromRotation(rest.R);
      expected = hangingResponse(model, reading.exciter, lean.value.head<2>());
    }
    WrenchPhasor difference = reading.phasor - expected;
    difference.tail<3>() /= 0.03;
    double& largest = reading.place ? misfit.pressed : misfit.hanging;
    largest = std::max(largest, difference.cwiseAbs().maxCoeff() / reading.phasor.head<3>().norm());
  }
  return misfit;
}

// The readings' own: noise 2e-4 to 5e-4. Pressed, friction creeps a little in a window.
TEST(Response, IsThatOfTheSimulation) {
  const Misfit misfit = misfitOf("{}", 3);
  EXPECT_LT(misfit.hanging, 3e-6);
  EXPECT_LT(misfit.pressed, 1e-4);
}

TEST(Response, IsThatOfTheSimulationWithOtherPartsAndACompliantCarrier) {
  const Misfit misfit = misfitOf(kParts, 1);
  EXPECT_LT(misfit.hanging, 3e-6);
  EXPECT_LT(misfit.pressed, 1e-4);
}

// With gain and delay compensated in the command the exciter gives the wanted force.
TEST(Response, OfACompensatedExciterIsThatOfAnExactOne) {
  const Mechanism m = cell().mechanism;
  MechanismModel real{m, {}};
  real.drive.gain = 0.8;
  real.drive.delay = 7e-4;
  for (const int direction : {1, -1}) {
    const ExciterParameters wanted{2.0, 500.0, 0.3, direction};
    const ExciterParameters command = compensated(wanted, real.drive);
    const WrenchPhasor exact = hangingResponse({m, {}}, wanted, {0.0, 0.0});
    // phasors refer to the commanded angle, which leads by direction · (phases'
    // difference)
    const Complex ahead = std::polar(1.0, direction * (command.phase - wanted.phase));
    EXPECT_LT((ahead * hangingResponse(real, command, {0.0, 0.0}) - exact).norm(),
              1e-12 * exact.norm());
  }
}

TEST(VibrationFit, HumDoesNotCountAsNoise) {
  std::vector<double> angle, wrench;
  for (int k = 0; k < 1000; ++k) {
    const double t = k * 2e-4;
    angle.push_back(440.0 / 2 * M_PI / 7 * t + 0.4);  // not whole periods either
    for (int axis = 0; axis < 6; ++axis) {
      wrench.push_back((axis + 1) * std::cos(angle.back() + axis) +
                       0.2 * std::sin(100.0 * M_PI * t));
    }
  }
  const HarmonicFit fit = fitVibration(angle, wrench);
  // differences of a sine of 0.2 at 50 Hz: 0.2 · 2π 50 · 2e-4, rms over √2, as noise over √2 again
  EXPECT_LT(std::sqrt(fit.noise.diagonal().maxCoeff()), 2.0 * 0.2 * 100.0 * M_PI * 2e-4 / 2.0);
  EXPECT_LT(std::abs(fit.phasor[2] - std::polar(3.0, 2.0)), 0.02);
}

TEST(Unknowns, ComeBackFromTheModel) {
  const Mechanism nominal = cell().mechanism;
  const std::vector<Unknown> unknowns = unknownsAsDrawn();
  UnknownVector z;
  for (int i = 0; i < kUnknowns; ++i) z[i] = std::sin(1.0 + i);
  EXPECT_LT((unknownsOf(nominal, unknowns, modelAt(nominal, unknowns, z)) - z).norm(), 1e-12);
}

TEST(Identification, OfACellAsDrawnFindsIt) {
  const IdentificationTrial& trial = level2();
  EXPECT_TRUE(trial.found.accepted) << trial.found.verdict;
  for (int i = 0; i < kUnknowns; ++i) {
    const std::string& name = trial.found.unknowns[static_cast<std::size_t>(i)].name;
    // 4 sd: one of 15 000
    EXPECT_LT(std::abs(trial.found.z[i] - trial.truth[i]), 4.0 * trial.found.sd(i)) << name;
    // all are observed, friction with the largest sd
    EXPECT_LT(trial.found.sd(i), i == kFriction ? 0.5 : 0.35) << name;
  }
  // stiffness to 1 %, where the drawing was off by up to 10 %
  for (int row = 0; row < 6; ++row) {
    EXPECT_NEAR(trial.found.model.mechanism.coupling.stiffness.diagonal[row],
                valueAt(cell().mechanism, trial.found.unknowns, row, trial.truth[row]),
                0.01 * cell().mechanism.coupling.stiffness.diagonal[row]);
  }
  EXPECT_LE(trial.data.time, 60.0);
  EXPECT_LT(trial.direction_bias, 0.2 * trial.direction_bias_as_drawn);
}

// A short version of `identify --runs 1000`: six cells of other seeds.
TEST(Identification, StatesHowWellItKnows) {
  constexpr int kRuns = 6;
  int inside = 0;
  double squares = 0.0, bias2 = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    const IdentificationTrial trial = tryLevel2(static_cast<std::uint64_t>(8200 + run));
    ASSERT_TRUE(trial.found.accepted) << trial.found.verdict;
    for (int i = 0; i < kUnknowns; ++i) {
      const double z = (trial.found.z[i] - trial.truth[i]) / trial.found.sd(i);
      inside += std::abs(z) < 1.96 ? 1 : 0;
      squares += z * z;
    }
    bias2 += trial.direction_bias * trial.direction_bias;
  }
  constexpr double kCount{kRuns * int{kUnknowns}};
  // of 150 that share much: a quarter as many, 3 sd about 0.95 and 1
  EXPECT_GT(inside, 0.85 * kCount);
  EXPECT_LT(squares, 1.7 * kCount);
  EXPECT_GT(squares, 0.3 * kCount);
  EXPECT_LT(std::sqrt(bias2 / kRuns), 0.1 * M_PI / 180.0);
}

// A sensor that drifts another newton a minute, in the gravity's poses and in the contact
// force of the pressed peg: the drift follows from the poses, the other unknowns are the same.
TEST(Identification, DriftIsFoundAndChangesNothing) {
  IdentificationData data = level2().data;
  Vector6 drift;
  drift << 1.0, -0.7, 0.8, 0.02, -0.02, 0.02;  // a minute
  for (PoseReading& reading : data.poses) reading.wrench += reading.time / 60.0 * drift;
  for (VibrationReading& reading : data.vibrations) {
    if (!reading.place) continue;
    EXPECT_GT(reading.since_zero, 0.5);
    reading.contact += reading.since_zero / 60.0 * drift;
  }
  const Identification& before = level2().found;
  const Identification found = identify(cell().mechanism, data);
  EXPECT_TRUE(found.accepted) << found.verdict;
  for (int i = 0; i < kUnknowns; ++i) {
    EXPECT_LT(std::abs(found.z[i] - before.z[i]), 0.1 * before.sd(i))
        << found.unknowns[static_cast<std::size_t>(i)].name;
  }
}

TEST(Identification, NamesTheReadingThatDisagrees) {
  IdentificationData data = level2().data;
  int spoilt = -1;
  for (std::size_t k = 0; k < data.vibrations.size(); ++k) {
    if (data.vibrations[k].held_out && data.vibrations[k].place) spoilt = static_cast<int>(k);
  }
  ASSERT_GE(spoilt, 0);
  VibrationReading& reading = data.vibrations[static_cast<std::size_t>(spoilt)];
  reading.phasor *= 1.2;
  const Identification found = identify(cell().mechanism, data);
  EXPECT_FALSE(found.accepted);
  EXPECT_NE(found.verdict.find("pressed at place " + std::to_string(*reading.place + 1)),
            std::string::npos)
      << found.verdict;
}

// Without contact friction is not seen, and the rows that only a leaning peg moves less well.
TEST(Identification, SaysWhatTheHangingPegAloneDoesNotShow) {
  IdentificationData data = level2().data;
  std::vector<VibrationReading> hanging;
  for (const VibrationReading& reading : data.vibrations) {
    if (!reading.place) hanging.push_back(reading);
  }
  data.vibrations = hanging;
  data.friction.reset();
  const Identification found = identify(cell().mechanism, data);
  EXPECT_TRUE(found.accepted) << found.verdict;
  EXPECT_EQ(found.unseen, std::vector<int>{kFriction});
  for (const int row : {kStiffness + 0, kStiffness + 3}) {
    EXPECT_GT(found.sd(row), 1.2 * level2().found.sd(row)) << row;
  }
}

TEST(Identification, OfNothingIsRefused) {
  EXPECT_THROW(identify(cell().mechanism, {}), InputError);
}

TEST(Check, AgreesWithItsOwnCellAndRefusesAnother) {
  const Scenario nominal = cell();
  const KnownMechanism known = knownFrom(level2().found);
  const Mismatch mismatch = loadMismatch(ASSEMBLY_CELL_SOURCE_DIR "/config/mismatch/level_2.yaml");
  for (const std::uint64_t seed : {5, 6, 7}) {
    const Truth ground_truth = drawTruth(mismatch, seed);
    CellParameters parameters;
    parameters.seed = 100 + seed;
    parameters.truth = ground_truth.cell;
    const Scenario start = trueScenario(nominal, ground_truth, "test");
    if (seed == 5) {
      SimulatedPlant plant(start, known.mechanism, parameters);
      const MechanismCheck check = checkMechanism(plant, known);
      EXPECT_TRUE(check.agrees) << check.message;
      EXPECT_LT(plant.truth().time(), 2.0);
      continue;
    }
    const AlignTrial trial = tryAlignment(start, known, parameters, {});
    EXPECT_EQ(trial.status, "wrong_mechanism");
    EXPECT_NE(trial.result.reason.find(" alone would explain most of it"), std::string::npos);
    EXPECT_EQ(trial.result.contacts, 0);
    EXPECT_EQ(trial.force, 0.0);  // nothing was touched
    EXPECT_LT(trial.result.time, 2.0);
  }
}

// What is drawn has the drawing's spreads: a cell within them does not contradict it.
TEST(Check, OfADrawingIsWide) {
  std::vector<VibrationReading> readings;
  for (const VibrationReading& reading : level2().data.vibrations) {
    if (!reading.place && readings.size() < 2) readings.push_back(reading);
  }
  EXPECT_TRUE(evaluateMechanism(knownAsDrawn(cell().mechanism), readings).agrees);
}

}  // namespace
}  // namespace assembly_cell
