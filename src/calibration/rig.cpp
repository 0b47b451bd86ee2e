// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/rig.h"

#include <cmath>
#include <vector>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {

namespace {

constexpr int kUnloadedSamples = 100;
constexpr int kPointIterations = 20;       // of a point that moves with the carrier
constexpr double kStrainRange = 4.0;       // of a movement wanted as 1 [V]
constexpr double kRoomTemperature = 20.0;  // [°C]

Eigen::Vector3d errors(NormalSource& normal, double sd) {
  return sd * Eigen::Vector3d(normal(), normal(), normal());
}

}  // namespace

CalibrationRig::CalibrationRig(const RigSettings& settings)
    : settings_(settings),
      a_(bridgeA(settings.bits, settings.noise)),
      b_(bridgeB(settings.bits, settings.noise)),
      normal_(settings.seed) {
  if (!(settings.nonlinearity >= 0.0) || !std::isfinite(settings.nonlinearity) ||
      !std::isfinite(settings.drift) || settings.samples < 1 || !(settings.sample_period > 0.0) ||
      !(settings.test_time >= 0.0) || !(settings.gravity > 0.0)) {
    throw InputError(
        "calibration rig: nonlinearity, drift, samples, sample_period, test_time or gravity is out "
        "of range: give sizes above 0");
  }
  a_.nonlinearity = b_.nonlinearity = settings.nonlinearity;
}

double CalibrationRig::temperature() const {
  return kRoomTemperature + settings_.drift * time_ / 3600.0;
}

Observation CalibrationRig::apply(const LoadRequest& request) {
  Observation o = request.target;
  o.a.reset();
  o.b.reset();
  const double sd = settings_.reference_errors ? 1.0 : 0.0;
  const ReferenceAccuracy& accuracy = settings_.accuracy;
  const bool on_a = o.side == Side::kA;
  const Bridge& bridge = on_a ? a_ : b_;
  Vector6 w_a = Vector6::Zero(), w_b = Vector6::Zero();
  Vector6& w = on_a ? w_a : w_b;

  // a force at a point, the point displaced where it is given at rest
  const auto press = [&](const Eigen::Vector3d& F) {
    const Eigen::Vector3d point = o.point + errors(normal_, sd * accuracy.point);
    const Pose at_rest{Eigen::Matrix3d::Identity(), kCarrierAtRest - bridge.reference_point};
    Eigen::Vector3d loaded = point;
    for (int i = 0; i < (o.point_at_rest ? kPointIterations : 1); ++i) {
      w << F, loaded.cross(F);
      if (!o.point_at_rest) break;
      Pose X = deflect(bridge, w).X_DC;
      X.p -= bridge.reference_point;
      loaded = X.R * (inverse(at_rest).p + point) + X.p;
    }
  };

  switch (o.kind) {
    case ObservationKind::kUnloaded:
      break;
    case ObservationKind::kReacting: {
      Pose X = o.X_AB;
      X.p += errors(normal_, sd * accuracy.position);
      X.R = rotationFromVector({errors(normal_, sd * accuracy.rotation)}) * X.R;
      w_a = request.wrench;
      w_b = -transformWrench(inverse(X), w_a);
      break;
    }
    case ObservationKind::kWeight: {
      const double mass = o.mass * (1.0 + sd * accuracy.mass * normal_());
      const Eigen::Vector3d direction =
          rotationFromVector({errors(normal_, sd * accuracy.direction)}) * o.direction;
      press(mass * settings_.gravity * direction);
      break;
    }
    case ObservationKind::kIndentation:
      press(request.wrench.head<3>());
      break;
    case ObservationKind::kDisplacement: {
      w = SensorDescription().nominal * (kStrainRange * request.strain);
      Pose X = deflect(bridge, w).X_DC;
      X.p -= kCarrierAtRest;
      o.displacement.reset();
      o.gauges = gaugeReadings(thesisGauges(), X);
      for (double& s : o.gauges) s += accuracy.gauge * normal_();
      break;
    }
    case ObservationKind::kLinearity:
      w = request.wrench;
      break;
  }
  if (!w_a.allFinite() || !w_b.allFinite()) {
    throw InputError("calibration rig: a load is not finite: correct the request");
  }
  volts_a_ = deflect(a_, w_a).volts;
  volts_b_ = deflect(b_, w_b).volts;
  time_ += settings_.test_time;
  o.stamp = time_;
  return o;
}

std::pair<StrainSample, StrainSample> CalibrationRig::sample() {
  a_.temperature = b_.temperature = temperature();
  time_ += settings_.sample_period;
  return {convertVolts(a_, volts_a_, normal_), convertVolts(b_, volts_b_, normal_)};
}

Observation CalibrationRig::measure(const LoadRequest& request) {
  Observation o = apply(request);
  const ObservationSet header = description();
  const int n = o.kind == ObservationKind::kUnloaded ? std::max(settings_.samples, kUnloadedSamples)
                                                     : settings_.samples;
  std::vector<Vector6> a, b;
  std::vector<std::uint8_t> saturated_a, saturated_b;
  for (int i = 0; i < n; ++i) {
    const auto [sample_a, sample_b] = sample();
    a.push_back(sample_a.volts);
    b.push_back(sample_b.volts);
    saturated_a.push_back(sample_a.saturated);
    saturated_b.push_back(sample_b.saturated);
  }
  const bool both = o.kind == ObservationKind::kUnloaded || o.kind == ObservationKind::kReacting;
  if (both || o.side == Side::kA) {
    o.a = averageReading(a, saturated_a, header.a);
    o.a->temperature = temperature();
  }
  if (both || o.side == Side::kB) {
    o.b = averageReading(b, saturated_b, header.b);
    o.b->temperature = temperature();
  }
  o.stamp = time_;
  return o;
}

ObservationSet CalibrationRig::description() const {
  ObservationSet set;
  set.a.serial_number = "simulated-a";
  set.b.serial_number = "simulated-b";
  set.a.bits = set.b.bits = settings_.bits;
  set.a.noise = set.b.noise = settings_.noise;
  set.gravity = settings_.gravity;
  set.accuracy = settings_.accuracy;
  set.gauges_a = set.gauges_b = thesisGauges();
  return set;
}

}  // namespace assembly_cell
