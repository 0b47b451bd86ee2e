// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The ellipse of a fit, its covariance, and which mode it is.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/locus/harmonic_fit.h"
#include "assembly_cell/math/distributions.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

constexpr int kLocusColumns = 4;  // cos, sin, 1, drift
// Hysteresis: factors on the false-alarm rate for leaving a decided mode, and for leaving an
// ellipse.
constexpr double kKeep = 0.1, kEnter = 10.0;

}  // namespace

double Locus::semiMajor() const { return std::abs(P) + std::abs(N); }

double Locus::semiMinor() const { return std::abs(P) - std::abs(N); }

double Locus::orientation() const {
  if (P == 0.0 || N == 0.0) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double half = 0.5 * (std::arg(P) + std::arg(N));
  const double turned = half - M_PI * std::floor(half / M_PI);
  return turned < M_PI ? turned : 0.0;
}

double Locus::orientationSd() const {
  if (P == 0.0 || N == 0.0) {
    return std::numeric_limits<double>::infinity();
  }
  return std::sqrt(0.25 * variance() * (1.0 / std::norm(P) + 1.0 / std::norm(N)));
}

double Locus::variance() const { return inflation * sigma * sigma / static_cast<double>(samples); }

Locus locusFromPhasors(Complex x, Complex y, double sigma, std::size_t samples, double inflation) {
  const Complex i(0.0, 1.0);
  Locus locus;
  locus.P = 0.5 * (x + i * y);
  locus.N = 0.5 * std::conj(x - i * y);
  locus.sigma = sigma;
  locus.samples = samples;
  locus.inflation = inflation;
  return locus;
}

Locus locusFromFit(const HarmonicFit& fit) {
  return locusFromPhasors(fit.phasor[0], fit.phasor[1],
                          std::sqrt(0.5 * (fit.noise(0, 0) + fit.noise(1, 1))), fit.samples,
                          fit.inflation);
}

LocusCovariance locusCovariance(const HarmonicFit& fit) {
  // coefficients of cos and sin of x, then of y
  Eigen::Matrix4d coefficients;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      coefficients.block<2, 2>(2 * i, 2 * j) = fit.noise(i, j) * fit.scatter;
    }
  }
  Eigen::Matrix4d turned;
  turned << 1, 0, 0, 1, 0, -1, 1, 0, 1, 0, 0, -1, 0, 1, 1, 0;
  turned *= 0.5;
  LocusCovariance covariance;
  covariance.amplitudes = turned * coefficients * turned.transpose();

  const Locus locus = locusFromFit(fit);
  const double p = std::abs(locus.P), n = std::abs(locus.N);
  const Complex up = locus.P / p, un = locus.N / n;
  Eigen::Matrix4d slopes;
  slopes << up.real(), up.imag(), un.real(), un.imag(),  //
      up.real(), up.imag(), -un.real(), -un.imag(),      //
      -up.imag() / (2 * p), up.real() / (2 * p), -un.imag() / (2 * n), un.real() / (2 * n),
      -up.imag() / (2 * p), up.real() / (2 * p), un.imag() / (2 * n), -un.real() / (2 * n);
  covariance.ellipse = slopes * covariance.amplitudes * slopes.transpose();
  return covariance;
}

const char* toString(LocusMode mode) {
  switch (mode) {
    case LocusMode::kNone:
      return "none";
    case LocusMode::kSegment:
      return "segment";
    case LocusMode::kEllipse:
      return "ellipse";
    case LocusMode::kCircle:
      return "circle";
    case LocusMode::kUndecided:
      break;
  }
  return "undecided";
}

namespace {

void requireDecidable(const Locus& locus, double false_alarm, double indifference) {
  if (!(false_alarm > 0.0 && false_alarm < 0.5)) {
    throw InputError("false_alarm is " + std::to_string(false_alarm) +
                     ": give a rate between 0 and 0.5");
  }
  if (!(indifference >= 0.0 && indifference < 1.0)) {
    throw InputError("indifference is " + std::to_string(indifference) +
                     ": give a ratio of axes from 0 to below 1");
  }
  if (locus.samples < kMinLocusSamples) {
    throw InputError("locus has " + std::to_string(locus.samples) + " samples: at least " +
                     std::to_string(kMinLocusSamples) + " are needed");
  }
}

// squared distances of the measurement from each mode, in units of its variance
struct Distances {
  explicit Distances(const Locus& locus)
      : radius_p(std::abs(locus.P)),
        radius_n(std::abs(locus.N)),
        size(radius_p * radius_p + radius_n * radius_n),
        // noise below rounding counts as rounding
        v(std::max(locus.variance(), 1e-26 * size)),
        n2(2.0 * static_cast<double>(locus.samples)),
        nu(n2 - 2.0 * kLocusColumns),
        minor(radius_p - radius_n),
        from_none(size / v),
        from_circle(radius_n * radius_n / v),
        from_segment(0.5 * minor * minor / v) {}
  double radius_p, radius_n, size, v, n2, nu, minor;
  double from_none, from_circle, from_segment;
};

// F tests (docs/theory/thesis.md, "Locus")
LocusMode modeByTests(const Distances& d, double false_alarm, double eps2,
                      std::optional<LocusMode> previous) {
  const double lambda = d.from_none * eps2 / (1.0 + eps2);
  // the previous mode has a lower threshold
  const auto passes = [&](LocusMode mode, double tail) {
    const double rate = previous == mode                  ? kKeep * false_alarm
                        : previous == LocusMode::kEllipse ? std::min(0.5, kEnter * false_alarm)
                                                          : false_alarm;
    return tail >= rate;
  };
  if (passes(LocusMode::kNone, fTail(d.from_none / 4.0, 4.0, d.nu, 0.0))) return LocusMode::kNone;
  const bool circle = passes(LocusMode::kCircle, fTail(d.from_circle / 2.0, 2.0, d.nu, lambda));
  const bool segment = passes(LocusMode::kSegment, fTail(d.from_segment, 1.0, d.nu, lambda));
  if (circle && segment) return LocusMode::kUndecided;
  return circle ? LocusMode::kCircle : segment ? LocusMode::kSegment : LocusMode::kEllipse;
}

// BIC weights with 0, 3, 4, 2 parameters; what lies in the indifference zone costs nothing. Half of
// them goes to undecided where the tests disagree.
std::array<double, 5> modeProbabilities(const Distances& d, LocusMode by_tests, double indifference,
                                        double eps2) {
  const auto outside = [&](double distance, double allowed) {
    const double rest = std::max(0.0, distance - indifference * allowed);
    return rest * rest / (1.0 + eps2) / d.v;
  };
  const std::array<double, 4> extra = {d.from_none,
                                       0.5 * outside(std::abs(d.minor), d.radius_p + d.radius_n),
                                       0.0, outside(d.radius_n, d.radius_p)};
  const std::array<double, 4> parameters = {0.0, 3.0, 4.0, 2.0};
  std::array<double, 4> bic{};
  for (std::size_t m = 0; m < 4; ++m) {
    bic[m] = d.n2 * std::log1p(extra[m] / d.nu) + parameters[m] * std::log(d.n2);
  }
  const auto likeliest = std::min_element(bic.begin(), bic.end());
  std::array<double, 5> p{};
  double sum = 0.0;
  for (std::size_t m = 0; m < 4; ++m) {
    p[m] = std::exp(-0.5 * (bic[m] - *likeliest));
    sum += p[m];
  }
  const bool agree = likeliest - bic.begin() == static_cast<std::ptrdiff_t>(by_tests);
  for (std::size_t m = 0; m < 4; ++m) {
    p[m] *= (agree ? 1.0 : 0.5) / sum;
  }
  p[4] = agree ? 0.0 : 0.5;
  return p;
}

}  // namespace

ModeDecision decideMode(const Locus& locus, double false_alarm, double indifference,
                        std::optional<LocusMode> previous) {
  requireDecidable(locus, false_alarm, indifference);
  const Distances distances(locus);
  if (distances.size == 0.0) return {LocusMode::kNone, {1.0, 0.0, 0.0, 0.0, 0.0}};
  const double eps2 = indifference * indifference;
  ModeDecision decision;
  decision.mode = modeByTests(distances, false_alarm, eps2, previous);
  decision.probabilities = modeProbabilities(distances, decision.mode, indifference, eps2);
  return decision;
}

}  // namespace assembly_cell
