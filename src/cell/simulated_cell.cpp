// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/simulated_cell.h"

#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/start.h"

namespace assembly_cell {
namespace {

// Between two times at which a block's wrench is computed: in time, and in phase of a vibration.
// With half of it the residual of a vibration falls to a sixteenth.
constexpr double kSpacing = 1e-3;   // [s]
constexpr double kPhaseStep = 0.8;  // [rad]

}  // namespace

Calibration designCalibration(const Bridge& bridge) {
  Calibration c;
  c.volts_to_wrench = strainMatrix(bridge).inverse();
  for (int i = 0; i < 6; ++i) c.zero_volts(i) = bridge.hinges[static_cast<std::size_t>(i)].offset;
  return c;
}

Calibration designCalibration(const Bridge& bridge, const CouplingParameters& coupling) {
  return withDisplacement(designCalibration(bridge), couplingStiffness(coupling));
}

void meansOf(const StrainBlock& block, StrainMeans& means) {
  const std::size_t n = block.saturated_a.size();
  means.a = momentsOf(block.volts_a.data(), n);
  means.b = momentsOf(block.volts_b.data(), n);
  means.end = block.time + static_cast<double>(n - 1) * block.period;
  means.saturated = false;
  for (std::size_t i = 0; i < n; ++i) {
    means.saturated = means.saturated || block.saturated_a[i] || block.saturated_b[i];
  }
  means.volts_b = block.volts_b;
}

SimulatedCell::SimulatedCell(const Scenario& scenario, const CellParameters& parameters)
    : SimulatedCell(scenario, parameters, carrierBase(scenario)) {}

SimulatedCell::SimulatedCell(const Scenario& scenario, const CellParameters& parameters,
                             const Pose& X_HB)
    : parameters_(parameters),
      world_(makeWorld(scenario, parameters.world)),
      carrier_(X_HB, scenario, parameters.truth.carrier),
      reported_(carrier_.report(*world_)),
      measured_a_(parameters.truth.sensor_a, parameters.sample_period),
      measured_b_(parameters.truth.sensor_b, parameters.sample_period),
      bridge_a_(bridgeA(parameters.bits, parameters.noise)),
      bridge_b_(bridgeB(parameters.bits, parameters.noise)),
      strain_matrix_a_(strainMatrix(bridge_a_)),
      strain_matrix_b_(strainMatrix(bridge_b_)),
      normal_a_(2 * parameters.seed),
      normal_b_(2 * parameters.seed + 1),
      normal_accelerometers_(~parameters.seed),
      friction_(scenario.mechanism.friction) {
  const double nonlinearity = parameters.bridge_nonlinearity;
  if (!(nonlinearity >= 0.0 && nonlinearity <= 1.0) || !std::isfinite(parameters.bridge_drift)) {
    throw InputError("cell: bridge_nonlinearity or bridge_drift is out of range: give 0 to 1, K/h");
  }
  bridge_a_.nonlinearity = bridge_b_.nonlinearity = nonlinearity;
  Vector6 weight = Vector6::Zero();
  weight.head<3>() -=
      parameters.hole_block_mass * scenario.mechanism.gravity * scenario.mechanism.up;
  const Pose X_block{Eigen::Matrix3d::Identity(), parameters.hole_block_center};
  block_weight_ = transformWrench(parameters.X_AH * X_block, weight);
}

Eigen::Vector2d SimulatedCell::accelerometers() {
  Eigen::Vector2d reading = world_->specificForce(parameters_.accelerometer_height);
  for (double& axis : reading) axis += parameters_.accelerometer_noise * normal_accelerometers_();
  return reading;
}

Vector6 SimulatedCell::voltsOf(const Bridge& bridge, const Matrix6& strain_matrix,
                               const Vector6& w) const {
  return bridge.nonlinearity == 0.0 ? Vector6(strain_matrix * w) : deflect(bridge, w).volts;
}

void SimulatedCell::warm(double time) {
  bridge_a_.temperature = bridge_b_.temperature =
      Bridge{}.temperature + parameters_.bridge_drift * time / 3600.0;
}

void SimulatedCell::meetBurr() {
  const BurrTruth& burr = parameters_.truth.burr;
  if (burr.length == 0.0) return;
  const double in = -world_->pegPose().p.z() - burr.depth;
  const bool meets = in >= 0.0 && in <= burr.length;
  if (meets == in_burr_) return;
  in_burr_ = meets;
  FrictionParameters friction = friction_;
  if (meets) {
    friction.static_coefficient *= burr.friction;
    friction.sliding_coefficient *= burr.friction;
  }
  world_->setFriction(friction);
}

Vector6 SimulatedCell::voltsA(double time) {
  const Vector6 wrench = transformWrench(parameters_.X_AH, world_->holeWrench()) + block_weight_;
  return voltsOf(bridge_a_, strain_matrix_a_, measured_a_(wrench, time));
}

Vector6 SimulatedCell::voltsB(const Vector6& load, double time) {
  return voltsOf(bridge_b_, strain_matrix_b_, measured_b_(load, time));
}

StopReason SimulatedCell::next(StrainBlock& block, bool accelerations,
                               const std::function<void(const Vector6& load)>& watch) {
  meetBurr();
  carrier_.lead(*world_, nextEnd());
  const auto n = static_cast<std::size_t>(parameters_.block_size);
  block.period = parameters_.sample_period;
  block.sequence = sequence_++;
  block.volts_a.resize(6 * n);
  block.volts_b.resize(6 * n);
  block.saturated_a.resize(n);
  block.saturated_b.resize(n);
  block.accelerations.resize(accelerations ? 2 * n : 0);
  block.time = static_cast<double>(samples_ + 1) * parameters_.sample_period;
  const double end = nextEnd();
  for (std::size_t i = 0; i < n; ++i) {
    ++samples_;
    // times from the count of samples, so that rounding does not add up
    const double time = static_cast<double>(samples_) * parameters_.sample_period;
    const StopReason reason = world_->sampleAt(time, end);
    if (reason != StopReason::kOk) return reason;
    warm(time);
    const StrainSample a = parameters_.sensors == Sensors::kBoth
                               ? convertVolts(bridge_a_, voltsA(time), normal_a_)
                               : StrainSample();
    const Vector6 load = world_->couplingWrench();
    const StrainSample b = convertVolts(bridge_b_, voltsB(load, time), normal_b_);
    Vector6::Map(block.volts_a.data() + 6 * i) = a.volts;
    Vector6::Map(block.volts_b.data() + 6 * i) = b.volts;
    block.saturated_a[i] = a.saturated;
    block.saturated_b[i] = b.saturated;
    if (accelerations) Eigen::Vector2d::Map(block.accelerations.data() + 2 * i) = accelerometers();
    if (watch) watch(load);
  }
  block.temperature = bridge_a_.temperature;
  reported_ = carrier_.report(*world_);
  carrier_.settle(*world_);
  return StopReason::kOk;
}

StopReason SimulatedCell::average(StrainMeans& means, double fastest, bool samples_b) {
  const int n = parameters_.block_size;
  const double period = parameters_.sample_period;
  if (measured_a_.remembers() || measured_b_.remembers() || !BlockMeans::serves(bridge_a_, n) ||
      !BlockMeans::serves(bridge_b_, n)) {
    const StopReason reason = next(whole_);
    if (reason == StopReason::kOk) meansOf(whole_, means);
    return reason;
  }
  meetBurr();
  carrier_.lead(*world_, nextEnd());
  const double rate = std::max({fastest, measured_a_.humRate(), measured_b_.humRate(), 1e-9});
  const double apart = std::min(kSpacing, kPhaseStep / rate);
  const SampleSum sum(n, static_cast<int>(apart / period * (1.0 + 1e-9)));
  const double end = nextEnd();
  const auto timeOf = [&](int i) { return static_cast<double>(samples_ + i) * period; };
  const bool has_a = parameters_.sensors == Sensors::kBoth;
  BlockMeans a, b;
  means.saturated = false;
  means.volts_b.resize(samples_b ? 6 * static_cast<std::size_t>(n) : 6);
  const int step = samples_b ? 1 : sum.spacing();
  for (int i = 0; i <= n; i += step) {
    const double time = timeOf(i);
    const StopReason reason = world_->sampleAt(time, end);
    if (reason != StopReason::kOk) return reason;
    warm(time);
    if (has_a && i % sum.spacing() == 0) {
      a.add(bridge_a_, voltsA(time), sum.weight(i / sum.spacing()));
    }
    if (i == 0 && samples_b) continue;
    const Vector6 volts = voltsB(world_->couplingWrench(), time);
    if (!samples_b) b.add(bridge_b_, volts, sum.weight(i / sum.spacing()));
    if (!samples_b && i < n) continue;
    const StrainSample sample = convertVolts(bridge_b_, volts, normal_b_);
    means.saturated = means.saturated || sample.saturated;
    const int at = samples_b ? i - 1 : 0;
    Vector6::Map(means.volts_b.data() + 6 * at) = sample.volts;
  }
  samples_ += static_cast<std::uint64_t>(n);
  ++sequence_;
  means.end = end;
  means.a = has_a ? a.end(bridge_a_, n, normal_a_) : BlockMoments();
  means.b = samples_b ? momentsOf(means.volts_b.data(), static_cast<std::size_t>(n))
                      : b.end(bridge_b_, n, normal_b_);
  means.saturated = means.saturated || a.saturated() || b.saturated();
  reported_ = carrier_.report(*world_);
  carrier_.settle(*world_);
  return StopReason::kOk;
}

}  // namespace assembly_cell
