// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/observations/observation.h"

#include <Eigen/LU>
#include <cmath>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/sensor/bridge.h"
#include "assembly_cell/sensor/statistics.h"
#include "observation_text.h"

namespace assembly_cell {

namespace {

constexpr std::array<const char*, 6> kKinds = {"unloaded",    "reacting",     "weight",
                                               "indentation", "displacement", "linearity"};
constexpr double kUnsettled = 5.0;       // spread over noise of one sample
constexpr int kEnoughForNoise = 30;      // samples from which noise is estimated
constexpr double kLargestMass = 1e4;     // of a weight [kg]
constexpr std::size_t kLongestId = 200;  // [bytes]

bool covarianceIsSound(const Matrix6& m) {
  return m.allFinite() && m.diagonal().minCoeff() >= 0.0 &&
         (m - m.transpose()).cwiseAbs().maxCoeff() <= 1e-9 * m.cwiseAbs().maxCoeff();
}

bool isPrintable(const std::string& text) {
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return false;
  }
  return true;
}

}  // namespace

const char* toString(ObservationKind kind) { return kKinds[static_cast<std::size_t>(kind)]; }

const char* toString(Side side) { return side == Side::kA ? "a" : "b"; }

std::optional<ObservationKind> observationKind(const std::string& name) {
  for (std::size_t k = 0; k < kKinds.size(); ++k) {
    if (name == kKinds[k]) return static_cast<ObservationKind>(k);
  }
  return std::nullopt;
}

std::string sensorName(Side side) { return std::string("sensor_") + toString(side); }

SensorDescription::SensorDescription() : nominal(strainMatrix(nominalBridge()).inverse()) {}

void fields(FieldList& f, SensorDescription& sensor) {
  f.text("serial_number", sensor.serial_number,
         "Serial number as in the calibration of its driver.")
      .required();
  f.integer("bits", sensor.bits, 2, 32, "Bits of the converter.");
  f.number("full_scale", sensor.full_scale, positive("V"), "Largest voltage of the converter.");
  f.number("noise", sensor.noise, notNegative("V"), "Noise of a sample, rms.");
}

void fields(FieldList& f, ReferenceAccuracy& accuracy) {
  f.number("direction", accuracy.direction, positive("rad"), "Sd of the direction of a weight.");
  f.number("mass", accuracy.mass, positive("1"), "Relative sd of the mass of a weight.");
  f.number("point", accuracy.point, positive("m"), "Sd of the point of a load, each axis.");
  f.number("position", accuracy.position, positive("m"), "Sd of a relative pose, each axis.");
  f.number("rotation", accuracy.rotation, positive("rad"), "Sd of a relative pose, each axis.");
  f.number("gauge", accuracy.gauge, positive("m"), "Sd of a dial gauge.");
}

double SensorDescription::lsb() const { return 2.0 * full_scale * std::ldexp(1.0, -bits); }

double SensorDescription::quantisation() const {
  const double q = lsb();
  return q * q / 12.0;
}

double SensorDescription::variance(double sd, int samples) const {
  const double one = sd * sd + quantisation();
  return sd >= 0.5 * lsb() ? one / samples : one;
}

Reading averageReading(const std::vector<Vector6>& volts,
                       const std::vector<std::uint8_t>& saturated,
                       const SensorDescription& sensor) {
  if (volts.empty() || volts.size() != saturated.size()) {
    throw InputError("reading: " + std::to_string(volts.size()) + " samples with " +
                     std::to_string(saturated.size()) + " flags: give at least one, as many each");
  }
  Moments moments;
  DifferenceNoise noise;
  Reading r;
  for (std::size_t i = 0; i < volts.size(); ++i) {
    if (!volts[i].allFinite()) throw InputError("reading: a sample is not finite: read it again");
    moments.add(volts[i]);
    noise.add(volts[i]);
    r.saturated = static_cast<std::uint8_t>(r.saturated | saturated[i]);
  }
  r.volts = moments.mean();
  r.spread = moments.sd();
  r.samples = static_cast<int>(volts.size());
  const bool enough = r.samples >= kEnoughForNoise;
  if (enough) r.noise = noise.rms();
  for (int k = 0; k < 6; ++k) {
    // differences of codes hold the quantisation already
    const double own =
        enough ? std::sqrt(std::max(r.noise[k] * r.noise[k] - sensor.quantisation(), 0.0))
               : sensor.noise;
    r.covariance(k, k) = sensor.variance(own, r.samples);
  }
  return r;
}

CalibrationRefusal unusable(const Reading& reading, const SensorDescription& sensor) {
  for (int k = 0; k < 6; ++k) {
    const std::string channel = "channel " + std::to_string(k);
    if ((reading.saturated >> k & 1) != 0) {
      return {CalibrationFailure::kSaturated, channel + " saturated"};
    }
    if (std::abs(reading.volts[k]) > sensor.full_scale) {
      return {CalibrationFailure::kSaturated, channel + " reads " + yamlNumber(reading.volts[k]) +
                                                  " V, beyond the full scale of " +
                                                  yamlNumber(sensor.full_scale) + " V"};
    }
    const double sample =
        std::sqrt(std::max(sensor.noise * sensor.noise, reading.noise[k] * reading.noise[k]) +
                  sensor.quantisation());
    if (reading.spread[k] > kUnsettled * sample) {
      return {CalibrationFailure::kUnsettled, channel + " unsettled (spread " +
                                                  yamlNumber(reading.spread[k]) + " V, noise " +
                                                  yamlNumber(sample) + " V)"};
    }
  }
  return {};
}

void checkObservation(const Observation& o, const ObservationSet& set, const std::string& source) {
  const auto refuse = [&](const std::string& what) { throw InputError(source + ": " + what); };
  const bool both = o.kind == ObservationKind::kReacting;
  const bool unloaded = o.kind == ObservationKind::kUnloaded;
  if (o.id.size() > kLongestId) {
    refuse("id has " + std::to_string(o.id.size()) + " characters: give at most " +
           std::to_string(kLongestId));
  }
  if (!isPrintable(o.id)) refuse("id holds control characters: give one line");
  if (!std::isfinite(o.stamp)) refuse("stamp is not finite: give s");
  if (both && (!o.reading.a || !o.reading.b))
    refuse("a reading of a sensor is missing: reacting needs a and b");
  if (unloaded && !o.reading.a && !o.reading.b) refuse("no reading: give a, b or both");
  if (!both && !unloaded && !o.reading[o.side]) {
    refuse(std::string("reading ") + toString(o.side) + " is missing: add it");
  }
  for (const Side side : kSides) {
    const std::optional<Reading>& reading = o.reading[side];
    if (!reading) continue;
    if (!reading->volts.allFinite()) refuse("volts are not finite: read again");
    if (!covarianceIsSound(reading->covariance)) refuse("covariance of volts is none");
    if (!(reading->noise.minCoeff() >= 0.0) || !(reading->spread.minCoeff() >= 0.0) ||
        !reading->noise.allFinite() || !reading->spread.allFinite() || reading->samples < 1) {
      refuse("noise, spread or samples of a reading is not sound: give sizes and a count");
    }
  }
  if (both) {
    if (!o.X_AB.p.allFinite() || !o.X_AB.R.allFinite() ||
        !(o.X_AB.R.transpose() * o.X_AB.R).isIdentity(kUnitTolerance) ||
        !(o.X_AB.R.determinant() > 0.0)) {
      refuse("relative pose is no pose: give a position in m and a rotation");
    }
    if (o.X_covariance && !covarianceIsSound(*o.X_covariance)) refuse("pose covariance is none");
  }
  if (o.kind == ObservationKind::kWeight) {
    if (!(o.mass > 0.0 && o.mass <= kLargestMass)) {
      refuse("mass is " + yamlNumber(o.mass) + ": give kg, above 0, at most 10000");
    }
    if (!(std::abs(o.direction.norm() - 1.0) < kUnitTolerance)) {
      refuse("direction is no unit vector: give that of gravity in sensor axes");
    }
  }
  if (!o.point.allFinite()) refuse("point is not finite: give m");
  if (o.kind == ObservationKind::kDisplacement) {
    if (o.displacement.has_value() == !o.gauges.empty()) {
      refuse("give either gauges or displacement");
    }
    if (o.displacement && !o.displacement->allFinite()) refuse("displacement is not finite");
    const GaugeLayout& layout = set.gauges[o.side];
    if (!o.gauges.empty() && o.gauges.size() != layout.gauges.size()) {
      refuse(std::to_string(o.gauges.size()) + " gauge readings but gauges_" + toString(o.side) +
             " has " + std::to_string(layout.gauges.size()) + ": give one of each");
    }
    for (const double s : o.gauges) {
      if (!std::isfinite(s)) refuse("a gauge reading is not finite: give m");
    }
  }
  if (o.kind == ObservationKind::kLinearity &&
      (!std::isfinite(o.load) || o.channel < 0 || o.channel > 5)) {
    refuse("load is not finite or channel none of 0 to 5");
  }
}

}  // namespace assembly_cell
