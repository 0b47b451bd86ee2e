// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// One reading of the locus in the simulated cell, for tests and studies: the peg is pressed on at a
// given lean, vibrated and measured by the sensor; the ground truth is stored, too.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

struct SimulatedReading {
  Scenario scenario;
  OperatingPoint point;  // with the true tilts and the measured static force
  HarmonicFit fit;       // of the six displacements
  Locus locus;           // LocusAxes::kSensor
  std::vector<ContactReport> closed;
  double contact =
      0.0;  // direction of the (first) contact from the peg's bottom centre, mean [rad]
};

struct SimulatedReadingOptions {
  double lean = 0.0;             // direction of the lowest edge point [rad]
  double tilt = 0.02;            // [rad]
  Eigen::Vector2d offset{0, 0};  // of the peg's bottom centre from the hole [m]
  double frequency = 770;        // of the exciter [rad/s]
  double amplitude = 0.1;        // [N]
  int direction = 1;             // of the exciter
  double press = 12.0;           // [N]
  double window = 0.2;           // [s]
  int bits = 24;                 // of the converter
  double noise = 1e-5;           // of its channels [V]
  std::vector<std::string> overrides;
};

inline SimulatedReading readSimulated(const SimulatedReadingOptions& o) {
  SimulatedReading r;
  Scenario& s = r.scenario;
  s = loadScenario(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml",
                   o.overrides);
  const Eigen::Vector3d axis(std::sin(o.tilt) * std::cos(o.lean),
                             std::sin(o.tilt) * std::sin(o.lean), std::cos(o.tilt));
  s.rest.theta = std::acos(axis.y());
  s.rest.phi = std::atan2(axis.x(), axis.z());
  const double length = s.mechanism.peg.half_height + s.mechanism.peg.coupling_height;
  s.rest.x = o.offset.x() + length * axis.x();
  s.rest.y = o.offset.y() + length * axis.y();
  s.initial.euler = {s.rest.phi, s.rest.theta, 0.0};
  s.initial.carrier_x = s.rest.x;
  s.initial.carrier_y = s.rest.y;
  s.initial.position =
      Eigen::Vector3d(s.rest.x, s.rest.y, s.rest.z) - s.mechanism.peg.coupling_height * axis;

  CellParameters parameters;
  parameters.bits = o.bits;
  parameters.noise = o.noise;
  SimulatedCell cell(s, parameters);
  const Calibration calibration = designCalibration(bridgeB(o.bits, o.noise), s.mechanism.coupling);
  StrainBlock block;
  const auto displacement = [&](std::size_t k) -> Vector6 {
    return displacementFromVolts(calibration, Vector6::Map(block.volts_b.data() + 6 * k));
  };
  const auto step = [&] {
    const StopReason reason = cell.next(block);
    if (reason != StopReason::kOk) {
      throw InputError(std::string("simulation stopped: ") + toString(reason));
    }
    Vector6 mean = Vector6::Zero();
    const std::size_t n = block.saturated_b.size();
    for (std::size_t k = 0; k < n; ++k) mean += displacement(k) / static_cast<double>(n);
    return mean;
  };

  // down to the press force
  RestPose rest = s.rest;
  Vector6 mean = step();
  for (int k = 0; k < 150; ++k) {
    const double force = contactForceFromDeflection(s.mechanism, mean).z();
    rest.z -= force < 0.5 ? 2e-4 : std::clamp((o.press - force) / 1.6e5, -5e-4, 5e-4);
    cell.world().setRestTarget(rest);
    mean = step();
  }
  const double start = cell.world().time();
  cell.world().setExciter({o.amplitude, o.frequency, 0.4, o.direction}, start);
  for (int k = 0; k < 26; ++k) step();

  std::vector<double> angle, signals;
  mean.setZero();
  int blocks = 0;
  SimulatorBackend& truth = cell.world();
  // the contact rolls to and fro with the vibration: its mean direction over the blocks' ends
  std::complex<double> contact = 0.0;
  while (static_cast<double>(angle.size()) * parameters.sample_period < o.window) {
    mean += step();
    ++blocks;
    for (const ContactReport& c : truth.contacts()) {
      if (!c.valid || c.state == ContactReport::kOpen) continue;
      const Eigen::Vector3d arm = c.point - truth.pegPose().p;
      contact += std::polar(1.0, std::atan2(arm.y(), arm.x()));
      break;
    }
    for (std::size_t k = 0; k < block.saturated_b.size(); ++k) {
      const double t = block.time + static_cast<double>(k) * block.period;
      angle.push_back(o.direction * (o.frequency * (t - start) + 0.4));
      const Vector6 d = displacement(k);
      signals.insert(signals.end(), d.data(), d.data() + 6);
    }
  }
  mean /= blocks;
  r.fit = fitHarmonic(angle, signals);
  r.locus = centreOfMassLocus(s.mechanism, o.direction * o.frequency, r.fit);

  // rotation vector (x, y) that tilts an upright axis to R's
  const auto tiltOf = [](const Eigen::Matrix3d& R) -> Eigen::Vector2d {
    const Eigen::Vector3d a = R.col(2);
    return std::acos(std::min(1.0, a.z())) * Eigen::Vector2d(-a.y(), a.x()).normalized();
  };
  // what the sensor carries, turned upright, and the weight that it doesn't feel
  const Eigen::Vector3d weight(0, 0, s.mechanism.peg.mass * s.mechanism.gravity);
  const Eigen::Vector3d force =
      truth.carrierPose().R * (contactForceFromDeflection(s.mechanism, mean) - weight) + weight;
  r.point.frequency = o.frequency;
  r.point.amplitude = o.amplitude;
  r.point.direction = o.direction;
  r.point.press = force.z();
  r.point.friction = force.head<2>();
  r.point.tilt = tiltOf(truth.pegPose().R);
  r.point.sensor_tilt = tiltOf(truth.carrierPose().R);
  for (const ContactReport& c : truth.contacts()) {
    if (c.valid && c.state != ContactReport::kOpen) r.closed.push_back(c);
  }
  if (!r.closed.empty()) {
    r.contact = std::arg(contact);
    r.point.rolling = r.closed[0].feature == ContactFeature::kEdgePlane;
  }
  return r;
}

}  // namespace assembly_cell
