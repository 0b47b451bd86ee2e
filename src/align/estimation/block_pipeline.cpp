// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/align/estimation/block_pipeline.h"

#include <algorithm>

#include "assembly_cell/mechanism/compliance.h"

namespace assembly_cell {

namespace {

// Mean and covariance under the linear part of a calibration.
BlockMoments wrenchMoments(const Calibration& c, const BlockMoments& volts) {
  BlockMoments out;
  const Matrix6& S = c.volts_to_wrench;
  out.mean = wrenchFromVolts(c, volts.mean);
  out.covariance = S * volts.covariance * S.transpose();
  out.count = volts.count;
  return out;
}

bool isFinite(const BlockMoments& m) {
  return m.count > 0 && m.mean.allFinite() && m.covariance.allFinite();
}

}  // namespace

void BlockPipeline::setCalibration(std::size_t sensor, const Calibration& calibration) {
  sensors_[sensor].calibration = calibration;
  sensors_[sensor].rounding = roundingCovariance(calibration.volts_to_wrench, converter_step_);
  if (sensor == 1) updateDisplacementMap();
}

bool BlockPipeline::calibrated() const {
  return sensors_[1].calibration && (sensors_of_cell_ == Sensors::kB || sensors_[0].calibration);
}

void BlockPipeline::setCoupling(const CouplingParameters* coupling) {
  coupling_.reset();
  if (coupling != nullptr) {
    compliance_ = couplingCompliance(*coupling);
    coupling_ = *coupling;
  }
  updateDisplacementMap();
}

void BlockPipeline::updateDisplacementMap() {
  const std::optional<Calibration>& b = sensors_[1].calibration;
  if (!b) return;
  displacement_map_ = coupling_ ? withDisplacement(*b, couplingStiffness(*coupling_)) : *b;
}

PlantBlock BlockPipeline::join(const BlockMoments& a, const BlockMoments& b, double period) const {
  PlantBlock out;
  out.wrench_b = b.mean;
  out.covariance_b = b.covariance;
  out.rounding_b = sensors_[1].rounding;
  out.samples = b.count;
  out.length = b.count * period;
  if (sensors_of_cell_ == Sensors::kB) return out;
  out.wrench_a = a.mean;
  out.covariance_a = a.covariance;
  out.rounding_a = sensors_[0].rounding;
  out.samples = std::min(a.count, b.count);
  return out;
}

PlantBlock BlockPipeline::fromStrain(const BlockMoments& a, const BlockMoments& b, bool saturated,
                                     double period) const {
  const bool has_a = sensors_of_cell_ == Sensors::kBoth;
  PlantBlock out = join(has_a ? wrenchMoments(*sensors_[0].calibration, a) : BlockMoments(),
                        wrenchMoments(*sensors_[1].calibration, b), period);
  out.displacement_b = displacement(b.mean);
  out.saturated = saturated;
  return out;
}

std::optional<PlantBlock> BlockPipeline::fromWrenches(const SensorSamples& a,
                                                      const SensorSamples& b,
                                                      const SensorSamples& displacements,
                                                      double period) const {
  const bool has_a = sensors_of_cell_ == Sensors::kBoth;
  const BlockMoments moments_a = has_a ? momentsOf(a.values, a.count) : BlockMoments();
  const BlockMoments moments_b = momentsOf(b.values, b.count);
  const BlockMoments d = momentsOf(displacements.values, displacements.count);
  if ((has_a && !isFinite(moments_a)) || !isFinite(moments_b) || !isFinite(d)) return std::nullopt;
  PlantBlock out = join(moments_a, moments_b, period);
  out.displacement_b = coupling_ ? Vector6(compliance_ * moments_b.mean) : d.mean;
  out.saturated = b.saturatedChannels() != 0 || (has_a && a.saturatedChannels() != 0);
  return out;
}

}  // namespace assembly_cell
