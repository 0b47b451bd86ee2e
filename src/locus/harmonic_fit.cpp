// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/harmonic_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/non_central_f.hpp>
#include <cmath>
#include <limits>

#include "assembly_cell/scene/input_error.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t kMinSamples = 8;
constexpr int kColumns = 4;  // cos, sin, 1, drift
constexpr double kTwoPi = 6.283185307179586;

using Design = Eigen::Matrix<double, kColumns, 1>;
using Normal = Eigen::Matrix<double, kColumns, kColumns>;
using Coefficients = Eigen::Matrix<double, kColumns, 6>;

// names the first value that isn't finite
[[noreturn]] void throwNonFinite(const std::vector<double>& angle,
                                 const std::vector<double>& signals) {
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (!std::isfinite(angle[k])) {
      throw InputError("exciter angle of sample " + std::to_string(k) +
                       " is not finite: leave the sample out");
    }
  }
  for (std::size_t k = 0; k < signals.size(); ++k) {
    if (!std::isfinite(signals[k])) {
      throw InputError("signal " + std::to_string(k % 6) + " of sample " + std::to_string(k / 6) +
                       " is not finite: leave the sample out");
    }
  }
  throw InputError("signals are too large to be summed: give them in SI units");
}

// P(F > f) for F(k, nu) with non-centrality lambda
double tailOfF(double f, double k, double nu, double lambda) {
  // far out the root of a non-central chi-square is normal, and so is its ratio to sigma
  constexpr double kLarge = 1e4;
  if (lambda > kLarge || k * f > 1e8) {
    const double z = (std::sqrt(k * f) - std::sqrt(lambda)) / std::sqrt(1.0 + lambda / (2.0 * nu));
    return 0.5 * std::erfc(z / std::sqrt(2.0));
  }
  if (lambda <= 0.0) {
    return boost::math::cdf(boost::math::complement(boost::math::fisher_f(k, nu), f));
  }
  return boost::math::cdf(boost::math::complement(boost::math::non_central_f(k, nu, lambda), f));
}

}  // namespace

HarmonicFit fitHarmonic(const std::vector<double>& angle, const std::vector<double>& signals,
                        bool drift) {
  const std::size_t n = angle.size();
  if (signals.size() != 6 * n) {
    throw InputError("signals have " + std::to_string(signals.size()) + " values for " +
                     std::to_string(n) + " samples: six a sample are needed");
  }
  if (n < kMinSamples) {
    throw InputError("window has " + std::to_string(n) + " samples: at least " +
                     std::to_string(kMinSamples) + " are needed");
  }
  const double samples = static_cast<double>(n);
  const double span = angle.back() - angle.front();
  const double periods = std::abs(span) * samples / (samples - 1.0) / kTwoPi;
  if (!std::isfinite(span)) {
    throwNonFinite(angle, signals);
  }
  if (periods < 1.0 - 1e-6) {
    throw InputError("window covers " + std::to_string(periods) +
                     " periods of the exciter: at least one is needed");
  }
  if (samples <= 2.0 * periods) {
    throw InputError("window has " + std::to_string(samples / periods) +
                     " samples a period of the exciter: more than two are needed");
  }

  // drift runs from -1 to 1; without it the column is dropped by a unit pivot
  const double middle = 0.5 * (angle.front() + angle.back());
  const auto row = [&](std::size_t k) {
    const double a = angle[k];
    return Design(std::cos(a), std::sin(a), 1.0, drift ? (a - middle) * 2.0 / span : 0.0);
  };

  // normal equations relative to the first sample, so that a large offset costs no digits
  const Vector6 origin = Eigen::Map<const Vector6>(signals.data());
  Normal normal = Normal::Zero();
  Coefficients moment = Coefficients::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Design a = row(k);
    normal += a * a.transpose();
    moment += a * (Eigen::Map<const Vector6>(&signals[6 * k]) - origin).transpose();
  }
  if (!normal.allFinite() || !moment.allFinite()) {
    throwNonFinite(angle, signals);
  }
  if (!drift) {
    normal(3, 3) = samples;
  }
  const Normal inverse = normal.inverse();
  const double inflation = inverse.topLeftCorner<2, 2>().trace() * samples / 4.0;
  if (!(inflation > 0.0 && inflation < 1e6)) {
    throw InputError(
        "the samples do not resolve the exciter's angle: use a sampling rate that is no multiple "
        "or fraction of its frequency");
  }

  // residuals give the noise and one step of refinement
  Coefficients fit = inverse * moment;
  Coefficients rest = Coefficients::Zero();
  Vector6 sum_squares = Vector6::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Design a = row(k);
    const Vector6 residual =
        Eigen::Map<const Vector6>(&signals[6 * k]) - origin - fit.transpose() * a;
    sum_squares += residual.cwiseAbs2();
    rest += a * residual.transpose();
  }
  fit += inverse * rest;

  HarmonicFit result;
  result.samples = n;
  result.inflation = inflation;
  result.offset = origin + fit.row(2).transpose();
  result.variance = sum_squares / (samples - (drift ? 4.0 : 3.0));
  // c cos a + s sin a = Re((c - i s) e^{ia})
  result.phasor.real() = fit.row(0).transpose();
  result.phasor.imag() = -fit.row(1).transpose();
  return result;
}

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

ModeDecision decideMode(const Locus& locus, double false_alarm, double indifference) {
  if (!(false_alarm > 0.0 && false_alarm < 0.5)) {
    throw InputError("false_alarm is " + std::to_string(false_alarm) +
                     ": give a rate between 0 and 0.5");
  }
  if (!(indifference >= 0.0 && indifference < 1.0)) {
    throw InputError("indifference is " + std::to_string(indifference) +
                     ": give a ratio of axes from 0 to below 1");
  }
  if (locus.samples < kMinSamples) {
    throw InputError("locus has " + std::to_string(locus.samples) + " samples: at least " +
                     std::to_string(kMinSamples) + " are needed");
  }

  ModeDecision decision;
  auto& p = decision.probabilities;
  const double radius_p = std::abs(locus.P);
  const double radius_n = std::abs(locus.N);
  const double size = radius_p * radius_p + radius_n * radius_n;
  if (size == 0.0) {
    decision.mode = LocusMode::kNone;
    p[0] = 1.0;
    return decision;
  }

  // squared distances of the measurement from each mode, in units of its variance; noise below
  // rounding counts as rounding
  const double v = std::max(locus.variance(), 1e-26 * size);
  const double n2 = 2.0 * static_cast<double>(locus.samples);
  const double nu = n2 - 2.0 * kColumns;
  const double minor = radius_p - radius_n;
  const double from_none = size / v;
  const double from_circle = radius_n * radius_n / v;
  const double from_segment = 0.5 * minor * minor / v;

  // F tests, vibration_and_locus section 6.5
  const double eps2 = indifference * indifference;
  const double lambda = from_none * eps2 / (1.0 + eps2);
  if (tailOfF(from_none / 4.0, 4.0, nu, 0.0) >= false_alarm) {
    decision.mode = LocusMode::kNone;
  } else {
    const bool circle = tailOfF(from_circle / 2.0, 2.0, nu, lambda) >= false_alarm;
    const bool segment = tailOfF(from_segment, 1.0, nu, lambda) >= false_alarm;
    decision.mode = circle && segment ? LocusMode::kUndecided
                    : circle          ? LocusMode::kCircle
                    : segment         ? LocusMode::kSegment
                                      : LocusMode::kEllipse;
  }

  // BIC weights with 0, 3, 4, 2 parameters; what lies in the indifference zone costs nothing
  const auto outside = [&](double distance, double allowed) {
    const double rest = std::max(0.0, distance - indifference * allowed);
    return rest * rest / (1.0 + eps2) / v;
  };
  const std::array<double, 4> extra = {from_none,
                                       0.5 * outside(std::abs(minor), radius_p + radius_n), 0.0,
                                       outside(radius_n, radius_p)};
  const std::array<double, 4> parameters = {0.0, 3.0, 4.0, 2.0};
  std::array<double, 4> bic{};
  for (std::size_t m = 0; m < 4; ++m) {
    bic[m] = n2 * std::log1p(extra[m] / nu) + parameters[m] * std::log(n2);
  }
  const double best = *std::min_element(bic.begin(), bic.end());
  double sum = 0.0;
  for (std::size_t m = 0; m < 4; ++m) {
    p[m] = std::exp(-0.5 * (bic[m] - best));
    sum += p[m];
  }
  const std::size_t likeliest =
      static_cast<std::size_t>(std::min_element(bic.begin(), bic.end()) - bic.begin());
  const bool agree = likeliest == static_cast<std::size_t>(decision.mode);
  for (std::size_t m = 0; m < 4; ++m) {
    p[m] *= (agree ? 1.0 : 0.5) / sum;
  }
  p[4] = agree ? 0.0 : 0.5;
  return decision;
}

}  // namespace assembly_cell
