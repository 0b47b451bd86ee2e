// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/two_sensor/rig.h"

#include <cmath>

#include "assembly_cell/base/input_error.h"

namespace assembly_cell {

namespace {

constexpr int kUnloadedSamples = 100;
constexpr int kPointIterations = 20;      // of a point that moves with the carrier
constexpr double kRequestedStrain = 4.0;  // strain of a requested movement of 1 [V]
constexpr double kAmbient = 20.0;         // [°C]

Eigen::Vector3d errors(NormalSource& normal, double sd) {
  const double z = normal(), y = normal(), x = normal();
  return sd * Eigen::Vector3d(x, y, z);
}

}  // namespace

CalibrationRig::CalibrationRig(const RigSettings& settings)
    : settings_(settings),
      bridge_{bridgeA(settings.bits, settings.noise), bridgeB(settings.bits, settings.noise)},
      normal_(settings.seed) {
  if (!(settings.nonlinearity >= 0.0) || !std::isfinite(settings.nonlinearity) ||
      !std::isfinite(settings.drift) || settings.samples < 1 || !(settings.sample_period > 0.0) ||
      !(settings.test_time >= 0.0) || !(settings.gravity > 0.0)) {
    throw InputError(
        "calibration rig: nonlinearity, drift, samples, sample_period, test_time or gravity is out "
        "of range: give sizes above 0");
  }
  if (settings.coupling_compliance && !settings.coupling_compliance->allFinite()) {
    throw InputError("calibration rig: the coupling's compliance is not finite: correct it");
  }
  if (!settings.gain.a.allFinite() || !settings.gain.b.allFinite()) {
    throw InputError("calibration rig: a bridge's gain is not finite: correct it");
  }
  bridge_.a.nonlinearity = bridge_.b.nonlinearity = settings.nonlinearity;
}

double CalibrationRig::temperature() const { return kAmbient + settings_.drift * time_ / 3600.0; }

// Readings of the dial gauges under a wrench, with their noise.
std::vector<double> CalibrationRig::gauges(Side side, const Vector6& wrench) {
  Pose X;
  if (side == Side::kB && settings_.coupling_compliance) {
    const Vector6 d = *settings_.coupling_compliance * wrench;
    X = {rotationFromVector({d.tail<3>()}), d.head<3>()};
  } else {
    X = deflect(bridge_[side], wrench).X_DC;
    X.p -= kCarrierAtRest;
  }
  std::vector<double> readings = gaugeReadings(thesisGauges(), X);
  for (double& s : readings) s += settings_.accuracy.gauge * normal_();
  return readings;
}

Observation CalibrationRig::apply(const LoadRequest& request) {
  Observation o = request.target;
  o.reading = {};
  const double sd = settings_.reference_errors ? 1.0 : 0.0;
  const ReferenceAccuracy& accuracy = settings_.accuracy;
  const Bridge& bridge = bridge_[o.side];
  PerSide<Vector6> wrench = {Vector6::Zero(), Vector6::Zero()};
  Vector6& w = wrench[o.side];

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
      wrench.a = request.wrench;
      wrench.b = -transformWrench(inverse(X), wrench.a);
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
      w = SensorDescription().nominal * (kRequestedStrain * request.strain);
      o.displacement.reset();
      o.gauges = gauges(o.side, w);
      break;
    }
    case ObservationKind::kLinearity:
      w = request.wrench;
      break;
  }
  if (!wrench.a.allFinite() || !wrench.b.allFinite()) {
    throw InputError("calibration rig: a load is not finite: correct the request");
  }
  for (const Side side : kSides) {
    volts_[side] = deflect(bridge_[side], settings_.gain[side] * wrench[side]).volts;
  }
  time_ += settings_.test_time;
  o.stamp = time_;
  return o;
}

PerSide<StrainSample> CalibrationRig::sample() {
  bridge_.a.temperature = bridge_.b.temperature = temperature();
  time_ += settings_.sample_period;
  // in this order: both draw from one source of noise
  PerSide<StrainSample> out;
  for (const Side side : kSides) out[side] = convertVolts(bridge_[side], volts_[side], normal_);
  return out;
}

Observation CalibrationRig::measure(const LoadRequest& request) {
  Observation o = apply(request);
  const ObservationSet header = description();
  const int n = o.kind == ObservationKind::kUnloaded ? std::max(settings_.samples, kUnloadedSamples)
                                                     : settings_.samples;
  PerSide<std::vector<Vector6>> volts;
  PerSide<std::vector<std::uint8_t>> saturated;
  for (int i = 0; i < n; ++i) {
    const PerSide<StrainSample> both = sample();
    for (const Side side : kSides) {
      volts[side].push_back(both[side].volts);
      saturated[side].push_back(both[side].saturated);
    }
  }
  for (const Side side : kSides) {
    if (!o.concerns(side)) continue;
    o.reading[side] = averageReading(volts[side], saturated[side], header.sensor[side]);
    o.reading[side]->temperature = temperature();
  }
  o.stamp = time_;
  return o;
}

ObservationSet CalibrationRig::description() const {
  ObservationSet set;
  for (const Side side : kSides) {
    set.sensor[side].serial_number = std::string("simulated-") + toString(side);
    set.sensor[side].bits = settings_.bits;
    set.sensor[side].noise = settings_.noise;
    set.gauges[side] = thesisGauges();
  }
  set.gravity = settings_.gravity;
  set.accuracy = settings_.accuracy;
  return set;
}

}  // namespace assembly_cell
