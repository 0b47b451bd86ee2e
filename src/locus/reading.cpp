// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/reading.h"

#include <cmath>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/locus/linear_motion.h"
#include "assembly_cell/locus/operating_point.h"

namespace assembly_cell {
namespace {

OperatingPoint pointOf(const ExciterParameters& exciter, const Eigen::Vector3d& force) {
  OperatingPoint point;
  point.frequency = exciter.frequency;
  point.amplitude = exciter.amplitude;
  point.direction = exciter.direction;
  point.press = force.z();
  point.friction = force.head<2>();
  return point;
}

bool looksDouble(LocusMode mode) {
  return mode == LocusMode::kSegment || mode == LocusMode::kUndecided;
}

ReadingAdvice adviceOf(const LocusReading& reading) {
  const LocusMode mode = reading.mode.mode;
  // where noise hides the direction, it may also look like sliding
  if (!reading.refusal.empty()) return ReadingAdvice::kReadLonger;
  // two contacts that stick make a segment, a slide turns with the exciter
  const bool slides = reading.friction && !reading.direction && mode != LocusMode::kSegment;
  if (mode == LocusMode::kCircle || slides) return ReadingAdvice::kPressMore;
  return mode == LocusMode::kUndecided ? ReadingAdvice::kReadLonger : ReadingAdvice::kNone;
}

// Refuses an operating point where the direction is not observable, and finds a better frequency.
void checkOperatingPoint(const Mechanism& mechanism, const OperatingPoint& point,
                         const HarmonicFit& fit, double duration, const ReadingLimits& limits,
                         LocusReading& reading) {
  ForecastLimits useful;
  useful.direction_sd = limits.direction_sd;
  // slip and double contacts follow from the measurement itself
  useful.friction_demand = std::numeric_limits<double>::infinity();
  useful.axes_ratio = 0.0;
  const auto samples = static_cast<double>(fit.samples);
  const DirectionForecast forecast = forecastDirection(mechanism, point, fit.noise, samples);
  reading.refusal = refusalOf(forecast, useful);
  reading.advice = adviceOf(reading);
  useful.axes_ratio = limits.axes_ratio;
  if (reading.refusal.empty() &&
      !(looksDouble(reading.mode.mode) && forecast.axes_ratio < limits.axes_ratio)) {
    return;
  }
  try {
    const DirectionForecast best =
        chooseFrequency(mechanism, point, fit.noise, samples / duration, duration, useful);
    if (refusalOf(best, useful).empty()) reading.better_frequency = best.frequency;
  } catch (const InputError&) {
    // no other frequency is sampled fast enough or damped little enough
  }
}

}  // namespace

const char* toString(ReadingAdvice advice) {
  switch (advice) {
    case ReadingAdvice::kReadLonger:
      return "read longer";
    case ReadingAdvice::kPressMore:
      return "press more or shake less";
    case ReadingAdvice::kNone:
      break;
  }
  return "";
}

void explain(const Mechanism& mechanism, const OperatingPoint& point, const ReadingLimits& limits,
             LocusReading& reading, LocusAxes axes) {
  reading.misfit = 0.0;
  reading.direction.reset();
  reading.advice = ReadingAdvice::kNone;
  const LocusMode mode = reading.mode.mode;
  if (mode == LocusMode::kNone) return;
  // the direction follows from N alone: a circle against the exciter has one, one with it has none
  if (mode != LocusMode::kCircle) {
    const linear_motion::SeenMotion seen(mechanism, point, axes);
    const DirectionEstimate found = contactDirection(seen, reading.locus);
    reading.misfit = found.misfit;
    if (found.misfit <= limits.misfit && found.sd <= limits.direction_sd) {
      reading.direction = resolveHalfTurn(seen, reading.evidence, found);
    }
  }
  reading.advice = adviceOf(reading);
}

LocusReading readLocus(const Mechanism& mechanism, const ExciterParameters& exciter,
                       const MeasuredMotion& motion, const ReadingLimits& limits,
                       std::optional<LocusMode> previous) {
  const double rate = exciter.direction * exciter.frequency;
  LocusReading reading;
  reading.locus =
      motion.plane ? locusFromFit(motion.fit) : centreOfMassLocus(mechanism, rate, motion.fit);
  if (!std::isfinite(reading.locus.semiMajor()) || !std::isfinite(reading.locus.sigma)) {
    throw InputError(text("the mechanism's model has no answer at %g rad/s: change the frequency",
                          exciter.frequency));
  }
  reading.mode = decideMode(reading.locus, limits.false_alarm, limits.indifference, previous);
  const bool moves = reading.mode.mode != LocusMode::kNone;
  if (!motion.plane) reading.force = contactForceFromDeflection(mechanism, motion.fit.offset);
  if (!motion.plane && moves) reading.evidence = halfTurnEvidence(mechanism, rate, motion.fit);
  if (motion.press) reading.force.z() = *motion.press;
  // without excitation the model gives no direction
  if (!(exciter.amplitude > 0.0)) return reading;

  const OperatingPoint point = pointOf(exciter, reading.force);
  explain(mechanism, point, limits, reading, motion.plane ? LocusAxes::kHole : LocusAxes::kSensor);
  // without a sticking contact, check for a sliding one
  if (!motion.plane && moves && !reading.direction && point.press > 0.0) {
    const SlidingFriction friction = slidingFriction(mechanism, point, motion.fit);
    if (friction.coefficient > limits.friction_sds * friction.sd &&
        friction.across <= limits.friction_across) {
      reading.friction = friction;
      reading.advice = adviceOf(reading);
    }
  }
  return reading;
}

LocusReading readLocus(const Mechanism& mechanism, const ExciterParameters& exciter,
                       const std::vector<double>& angle, const std::vector<double>& displacements,
                       const ReadingLimits& limits) {
  MeasuredMotion motion;
  motion.fit = fitHarmonic(angle, displacements);
  LocusReading reading = readLocus(mechanism, exciter, motion, limits);
  if (!(exciter.amplitude > 0.0)) return reading;
  const auto n = static_cast<double>(angle.size());
  const double duration =
      std::abs(angle.back() - angle.front()) / exciter.frequency * n / (n - 1.0);
  checkOperatingPoint(mechanism, pointOf(exciter, {0.0, 0.0, reading.force.z()}), motion.fit,
                      duration, limits, reading);
  return reading;
}

}  // namespace assembly_cell
