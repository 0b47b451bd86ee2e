// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/identification_trial.h"

#include <Eigen/LU>
#include <algorithm>
#include <chrono>
#include <cmath>

#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/contact_model.h"

namespace assembly_cell {
namespace {

constexpr int kDirections = 12;
constexpr double kTilt = 0.052, kPress = 15.0;  // as the strategies read [rad], [N]

constexpr int kRamps = 6;            // to and fro, of the chirp's amplitude
constexpr double kEnds = 0.3;        // of each, at either end, that are left out
constexpr double kTransient = 0.15;  // of a prompt carrier after a turn [s]
constexpr double kLags = 4.0;        // of the drive, that it is longer by

// Response of the same cell without noise. In ramps to and fro the force differs by its lag.
ArmResponse trueResponse(const Scenario& truth, const Mechanism& nominal, CellParameters cell,
                         const ArmPlan& plan) {
  CarrierTruth& carrier = cell.truth.carrier;
  cell.noise = 0.0;
  cell.bits = 24;
  cell.truth.sensor_a = cell.truth.sensor_b = SensorTruth();
  carrier.reading_noise.setZero();
  const double latency = cell.arm ? cell.arm->arm.arm.latency : carrier.latency;
  SimulatedPlant plant(truth, nominal, cell);
  const double ramp = (latency + kTransient + kLags * carrier.lag) / kEnds;
  const auto travel = [&](double time) {
    return 1.0 - std::abs(std::fmod(time / ramp, 2.0) - 1.0) * 2.0;
  };
  const ArmRecording recording = recordArm(plant, nominal, plan, travel, kRamps * ramp);
  const double speed = 2.0 * recording.reach / ramp;
  // force = mean + stiffness (command -+ speed delay) + drift
  Eigen::Matrix4d squares = Eigen::Matrix4d::Zero();
  Eigen::Vector4d products = Eigen::Vector4d::Zero();
  for (const ArmSample& sample : recording.samples) {
    const double t = (sample.time - recording.samples.front().time) / ramp;
    if (t < 2.0 || std::abs(t - std::floor(t) - 0.5) > 0.5 - kEnds) continue;
    const double direction = std::fmod(t, 2.0) < 1.0 ? 1.0 : -1.0;
    const Eigen::Vector4d row(1.0, sample.command, -direction * speed, t - 0.5 * kRamps);
    squares += row * row.transpose();
    products += row * sample.force;
  }
  const Eigen::Vector4d found = squares.fullPivLu().solve(products);
  ArmResponse response;
  response.delay = found(2) / found(1);
  response.stiffness = 1.0 / (1.0 / found(1) + recording.upright);
  return response;
}

}  // namespace

MechanismModel trueModel(const Scenario& truth) {
  const ExciterErrors& e = truth.imperfections.exciter;
  const double mean = 1.0 - 0.5 * e.ellipticity;
  MechanismModel model{truth.mechanism, {}};
  model.drive.gain = e.gain * mean;
  model.drive.delay = e.delay;
  model.drive.ellipse =
      e.ellipticity / mean * Eigen::Vector2d(std::cos(2.0 * e.azimuth), std::sin(2.0 * e.azimuth));
  model.drive.compliance = truth.imperfections.compliance.mean();
  return model;
}

double directionBias(const MechanismModel& truth, const KnownMechanism& known) {
  OperatingPoint point;
  point.frequency = operatingFrequency(known.mechanism, kPress);
  point.amplitude = 1.0;
  point.press = kPress;
  point.rolling = true;
  point.ellipse = known.drive.ellipse;
  point.compliance = known.drive.compliance;
  const ExciterParameters wanted{point.amplitude, point.frequency, 0.0, 1};
  // only what was identified can be made up for
  const ExciterParameters asked = known.identified ? compensated(wanted, known.drive) : wanted;
  const Eigen::PartialPivLU<Matrix6> stiffness(couplingStiffness(known.mechanism.coupling));
  double sum = 0.0;
  for (int k = 0; k < kDirections; ++k) {
    const double azimuth = 2.0 * M_PI * k / kDirections;
    // leans toward the contact, no static moment: the press alone, at the sensor's origin
    const Eigen::Vector3d lean(-kTilt * std::sin(azimuth), kTilt * std::cos(azimuth), 0.0);
    PressedState state;
    state.R_HS = rotationFromVector({lean});
    state.contact.head<3>() = state.R_HS.transpose() * Eigen::Vector3d(0.0, 0.0, kPress);
    // the phasors refer to the commanded angle: rotated to that of the force
    const std::complex<double> ahead(0.0, asked.phase);
    const WrenchPhasor wrench = std::exp(ahead) * pressedResponse(truth, asked, state);
    const WrenchPhasor coupling = stiffness.inverse().cast<std::complex<double>>() * wrench;
    Posture posture;
    posture.compliance = point.compliance;
    posture.tilt = posture.sensor_tilt = point.tilt = point.sensor_tilt = lean.head<2>();
    posture.static_force = Eigen::Vector3d(0.0, 0.0, kPress) -
                           known.mechanism.peg.mass * known.mechanism.gravity * known.mechanism.up;
    const Eigen::Vector2cd xy =
        centreOfMassPhasors(known.mechanism, point.frequency, coupling, posture);
    const Locus locus = locusFromPhasors(xy[0], xy[1], 0.0, 0, 1.0);
    const DirectionEstimate found = contactDirection(known.mechanism, point, locus);
    // nearest of both half turns: the reading distinguishes them by other means
    double error = M_PI;
    for (const double alpha : {found.alpha, found.alpha_opposite}) {
      error = std::min(error, std::abs(std::remainder(alpha - azimuth, 2.0 * M_PI)));
    }
    sum += error * error;
  }
  return std::sqrt(sum / kDirections);
}

IdentificationTrial tryIdentification(const Scenario& start, const Mechanism& nominal,
                                      const CellParameters& cell, const IdentificationPlan& plan,
                                      const IdentificationPrior& prior) {
  SimulatedPlant plant(start, nominal, cell);
  IdentificationTrial trial;
  trial.found.unknowns = prior.unknowns;
  trial.truth = unknownsOf(nominal, prior.unknowns, trueModel(start));
  try {
    trial.data = measure(plant, nominal, plan);
    const auto begin = std::chrono::steady_clock::now();
    trial.found = identify(nominal, trial.data, prior);
    trial.fit_time =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  } catch (const AlignError& error) {
    trial.found.verdict = std::string("refused: ") + error.what();
    return trial;
  } catch (const PlantError& error) {
    trial.found.verdict = std::string("refused: ") + error.what();
    return trial;
  }
  trial.direction_bias = directionBias(trueModel(start), knownFrom(trial.found));
  trial.direction_bias_as_drawn = directionBias(trueModel(start), knownAsDrawn(nominal));
  return trial;
}

ArmTrial tryArmIdentification(const Scenario& start, const Mechanism& nominal,
                              const CellParameters& cell, const ArmPlan& plan) {
  ArmTrial trial;
  try {
    SimulatedPlant plant(start, nominal, cell);
    trial.found = identifyArm(plant, nominal, plan);
    trial.truth = trueResponse(start, nominal, cell, plan);
  } catch (const AlignError& error) {
    trial.refusal = error.what();
  } catch (const PlantError& error) {
    trial.refusal = error.what();
  }
  return trial;
}

}  // namespace assembly_cell
