// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/shaker/drive_signal.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace assembly_cell {

namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

// Smooth step from 0 to 1 for u from 0 to 1.
double fade(double u) {
  if (u <= 0.0) return 0.0;
  return u >= 1.0 ? 1.0 : u * u * (3.0 - 2.0 * u);
}

double levelAt(const DriveSignal::Voice& voice, double time) {
  double level = voice.rise > 0.0 ? fade((time - voice.begin) / voice.rise)
                                  : (time >= voice.begin ? 1.0 : 0.0);
  if (time > voice.end) {
    level *= voice.fall > 0.0 ? 1.0 - fade((time - voice.end) / voice.fall) : 0.0;
  }
  return level;
}

}  // namespace

void drive(DriveSignal& signal, const ExciterCommand& command, double reference, double time) {
  removeFaded(signal, time);
  for (std::size_t i = 0; i < signal.count; ++i) {
    DriveSignal::Voice& voice = signal.voices[i];
    if (voice.end < kUnlimited) continue;
    voice.end = time;
    voice.fall = std::min(signal.ramp, 2.0 * M_PI / voice.drive.frequency);
  }
  if (!(command.amplitude > 0.0)) return;
  if (signal.count == signal.voices.size()) {
    std::move(signal.voices.begin() + 1, signal.voices.end(), signal.voices.begin());
    --signal.count;
  }
  signal.voices[signal.count++] = {command, reference, time, kUnlimited, signal.ramp, 0.0};
}

void removeFaded(DriveSignal& signal, double time) {
  const auto last = signal.voices.begin() + static_cast<std::ptrdiff_t>(signal.count);
  const auto kept =
      std::remove_if(signal.voices.begin(), last,
                     [time](const DriveSignal::Voice& v) { return time >= v.end + v.fall; });
  signal.count = static_cast<std::size_t>(kept - signal.voices.begin());
}

Eigen::Vector2d forceAt(const DriveSignal& signal, double time) {
  Eigen::Vector2d force = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < signal.count; ++i) {
    const DriveSignal::Voice& voice = signal.voices[i];
    const ExciterCommand& d = voice.drive;
    const double size = d.amplitude * levelAt(voice, time);
    if (size == 0.0) continue;
    const double angle = d.direction * (d.frequency * (time - voice.reference) + d.phase);
    force += size * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  }
  return force;
}

}  // namespace assembly_cell
