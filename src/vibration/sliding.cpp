// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/vibration/sliding.h"

#include <algorithm>

#include "assembly_cell/math/validity.h"
#include "assembly_cell/vibration/inertia.h"

namespace assembly_cell {
namespace {

constexpr double kMaxSwing = 0.5;  // [rad]; limit of small motion

void requireCase(const SlidingCase& s) {
  requirePositive({{"K", s.K}, {"I", s.I}, {"h", s.h}, {"m", s.m}, {"g", s.g}});
  requireNotNegative({{"w", s.w}, {"kx", s.kx}, {"l", s.l}, {"d", s.d}});
  if (!(std::abs(s.phi) < M_PI / 2)) refuse("phi", s.phi, "give a tilt below a right angle");
  if (!(s.theta >= 0.0 && s.theta < M_PI / 2)) {
    refuse("theta", s.theta, "give an amplitude from 0 to a right angle");
  }
  const double arm = 2 * s.h + s.l;
  // margin for rounding: kx (2h + l)² may equal K
  if (s.kx * arm * arm > s.K * (1 + 1e-9)) {
    refuse("K", s.K, "give at least kx (2h + l)^2, a part of the chord's stiffness (4.17)");
  }
}

// Force into the hole per rotation: exciter − transverse spring, plus inertia forces if `inertia`.
double forcePerRotation(const SlidingCase& s, bool inertia) {
  const double D = (s.K - s.I * s.w * s.w) / (2 * s.h) - s.kx * (2 * s.h + s.l);
  return inertia ? D + s.m * s.h * s.w * s.w : D;
}

// p(x) = F_S/F_N at rotation x.
std::optional<double> ratioAt(const SlidingCase& s, double D, bool inertia, double x) {
  const double weight = s.m * (inertia ? s.g - s.d * s.w * s.w * x : s.g);
  const double mean = (s.phi + x) / 2, lag = (s.phi - x) / 2;
  const double normal = weight * std::cos(mean) + D * x * std::sin(lag);
  if (!(normal > 0.0)) return std::nullopt;
  return finiteResult("p", (weight * std::sin(mean) + D * x * std::cos(lag)) / normal);
}

// p1 and p2 with or without inertia forces.
struct SlidingPair {
  std::optional<double> p1, p2;
};

SlidingPair pairOf(const SlidingCase& s, bool inertia) {
  const double D = finiteResult("D", forcePerRotation(s, inertia));
  const double x = D < 0.0 ? -s.theta : s.theta;
  SlidingPair pair{ratioAt(s, D, inertia, x), ratioAt(s, D, inertia, -x)};
  if (pair.p2) *pair.p2 = -*pair.p2;
  return pair;
}

}  // namespace

const char* toString(SlidingBand band) {
  constexpr const char* kNames[] = {"low", "intermediate", "high"};
  return kNames[static_cast<int>(band)];
}

const char* toString(VibrationOutcome outcome) {
  constexpr const char* kNames[] = {"sticks",     "assembles", "slides_both",
                                    "slides_out", "lifts",     "walks_out"};
  return kNames[static_cast<int>(outcome)];
}

SlidingRatio slidingRatio(const SlidingCase& s) {
  requireCase(s);
  SlidingRatio x;
  x.D = finiteResult("D", forcePerRotation(s, false));
  x.w_lower = std::sqrt(std::max(0.0, s.K - 2 * s.h * s.kx * (2 * s.h + s.l)) / s.I);
  x.w_upper = finiteResult("w_upper", std::sqrt(s.K / s.I));
  x.band = x.D >= 0.0        ? SlidingBand::kLow
           : s.w < x.w_upper ? SlidingBand::kIntermediate
                             : SlidingBand::kHigh;
  const SlidingPair thesis = pairOf(s, false), complete = pairOf(s, true);
  x.p1 = thesis.p1;
  x.p2 = thesis.p2;
  x.p1_inertia = complete.p1;
  x.p2_inertia = complete.p2;
  return x;
}

DesignPoint designPoint(const DesignCase& c, double w, double F) {
  requireNotNegative({{"F", F}, {"mu", c.mu}});
  requirePositive({{"m", c.m}, {"g", c.g}});
  if (!(c.d >= 0.0 && c.d < c.r)) refuse("d", c.d, "give the chord's distance, from 0 to below r");
  SlidingCase s{c.K, chordInertia(c.m, c.r, c.h, c.d), w, c.h, c.kx, c.l, c.m, c.g, c.phi, 0.0,
                c.d};
  requireCase(s);
  DesignPoint point;
  const double stiffness = std::abs(s.K - s.I * w * w), moment = 2 * F * c.h;
  const double half_chord = std::sqrt((c.r - c.d) * (c.r + c.d));
  // 4.31 over a whole period: weight − inertia cos wt against exciter sin wt
  const bool swings = moment < kMaxSwing * stiffness;
  point.theta = swings ? moment / stiffness : kMaxSwing;
  const bool lifts =
      !swings || std::hypot(c.d * w * w * point.theta, moment / (c.m * half_chord)) > c.g;
  if (swings) {
    s.theta = point.theta;
    const SlidingPair pair = pairOf(s, c.inertia);
    point.p1 = pair.p1;
    point.p2 = pair.p2;
  }
  if (lifts || !point.p1 || !point.p2) {
    point.outcome =
        2 * c.h * c.mu > half_chord ? VibrationOutcome::kWalksOut : VibrationOutcome::kLifts;
  } else if (*point.p2 > c.mu) {
    point.outcome =
        *point.p1 > *point.p2 ? VibrationOutcome::kSlidesBoth : VibrationOutcome::kSlidesOut;
  } else {
    point.outcome = *point.p1 > c.mu ? VibrationOutcome::kAssembles : VibrationOutcome::kSticks;
  }
  return point;
}

}  // namespace assembly_cell
