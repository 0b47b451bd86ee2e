// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "draw_keys.h"

#include <cmath>

namespace assembly_cell {
namespace {

using Shape = DrawKey::Shape;

constexpr Range kAnySize{-kLargestDraw, kLargestDraw}, kSize{0.0, kLargestDraw};
constexpr Range kFrameTurn{-M_PI, M_PI, "rad"};
constexpr Range kBoreTilt{-0.1, 0.1, "rad"};  // beyond this an oblique bore is no bore any more
constexpr Range kFaceTilt{-0.3, 0.3, "rad"};  // a start stays a start
constexpr Range kBurr{0.0, 10.0, "m"};
constexpr Range kDelay{0.0, 1.0, "s"};    // drives respond within tens of ms
constexpr Range kLatency{0.0, 0.1, "s"};  // samples are kept so long
constexpr Range kScale{-0.5, 0.5};        // scale error of encoders

void addSensor(const std::string& name, SensorTruth& s, std::vector<DrawKey>& keys) {
  double* const drift = s.drift.data();
  const std::vector<DrawKey> own = {
      {".matrix", Shape::kMatrix, s.matrix.data(), kAnySize},
      {".frame.rotation", Shape::kDirection, s.rotation.data(), kFrameTurn},
      {".frame.offset", Shape::kDirection, s.offset.data(), {-1.0, 1.0, "m"}},
      {".drift.force", Shape::kAxes, drift, kAnySize},
      {".drift.torque", Shape::kAxes, drift + 3, kAnySize},
      {".drift.walk", Shape::kNumber, &s.walk, kSize},
      {".hum.force", Shape::kDirection, s.hum.data(), kAnySize, 0.0, nullptr, nullptr, true},
      {".hum.frequency", Shape::kNumber, &s.hum_frequency, positive("Hz", kLargestDraw), 0.0,
       "phase", &s.hum_phase, true},
      {".latency", Shape::kNumber, &s.latency, kLatency},
  };
  for (DrawKey key : own) {
    key.path = name + key.path;
    keys.push_back(key);
  }
}

}  // namespace

std::vector<DrawKey> drawKeys(Truth& truth) {
  ExciterErrors& e = truth.imperfections.exciter;
  CarrierTruth& c = truth.cell.carrier;
  std::vector<DrawKey> keys = {
      {"exciter.amplitude", Shape::kNumber, &e.gain, kSize, 1.0},
      {"exciter.delay", Shape::kNumber, &e.delay, kDelay},
      {"exciter.ellipticity",
       Shape::kNumber,
       &e.ellipticity,
       {0.0, 1.0},
       0.0,
       "azimuth",
       &e.azimuth},
      {"exciter.harmonic", Shape::kNumber, &e.harmonic, kAnySize},
  };
  addSensor("sensor_a", truth.cell.sensor_a, keys);
  addSensor("sensor_b", truth.cell.sensor_b, keys);
  const DrawKey others[] = {
      {"carrier.reading_noise", Shape::kAxes, c.reading_noise.data(), kSize},
      {"carrier.repeatability", Shape::kAxes, c.repeatability.data(), kSize},
      {"carrier.compliance", Shape::kAxes, truth.imperfections.compliance.data(), kSize},
      {"carrier.latency", Shape::kNumber, &c.latency, {0.0, 0.25, "s"}},
      {"carrier.jitter", Shape::kNumber, &c.jitter, {0.0, 0.05, "s"}},
      {"carrier.lag", Shape::kNumber, &c.lag, {0.0, 0.25, "s"}},
      {"carrier.backlash", Shape::kAxes, c.backlash.data(), {0.0, 1e-3, "m"}},
      {"carrier.frame.rotation", Shape::kDirection, c.rotation.data(), kFrameTurn},
      {"carrier.frame.scale", Shape::kAxes, c.scale.data(), kScale},
      {"carrier.frame.offset", Shape::kDirection, c.offset.data(), {-100.0, 100.0, "m"}},
      {"hole.burr.friction", Shape::kNumber, &truth.cell.burr.friction, kSize, 1.0},
      {"hole.burr.depth", Shape::kNumber, &truth.cell.burr.depth, kBurr},
      {"hole.burr.length", Shape::kNumber, &truth.cell.burr.length, kBurr},
      {"hole.bore_tilt", Shape::kTilt, truth.bore_tilt.data(), kBoreTilt},
      {"hole.face_tilt", Shape::kTilt, truth.face_tilt.data(), kFaceTilt},
  };
  keys.insert(keys.end(), std::begin(others), std::end(others));
  return keys;
}

}  // namespace assembly_cell
