// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/harmonic_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "assembly_cell/base/distributions.h"
#include "assembly_cell/base/input_error.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

constexpr std::size_t kMinSamples = 8;
constexpr int kLocusColumns = 4;  // cos, sin, 1, drift
constexpr int kMostHarmonics = 4;
constexpr int kMostColumns = 2 + 2 * kMostHarmonics;  // cos, sin, 1, drift, then each harmonic
constexpr double kTwoPi = 2.0 * M_PI;
constexpr double kHuber = 1.7;              // 1.7 % of efficiency on clean data
constexpr double kRayleighMedian = 1.1774;  // of a planar residual, in units of one axis's noise
constexpr int kReweightings = 50;

using Design = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostColumns, 1>;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostColumns, kMostColumns>;
using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, 6, 0, kMostColumns, 6>;
using Signals = Eigen::Map<const Vector6>;

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

}  // namespace

namespace {

// the columns of a fit
class Columns {
 public:
  Columns(double first, double last, const HarmonicOptions& options)
      : middle_(0.5 * (first + last)), span_(last - first), options_(options) {}
  int count() const { return 2 * options_.harmonics + (options_.drift ? 2 : 1); }
  void row(double angle, Design& a) const {
    a.resize(count());
    int i = 0;
    const double c = std::cos(angle), s = std::sin(angle);
    a[i++] = c;
    a[i++] = s;
    a[i++] = 1.0;
    if (options_.drift) a[i++] = (angle - middle_) * 2.0 / span_;  // -1 to 1
    double ck = c, sk = s;
    for (int k = 2; k <= options_.harmonics; ++k) {
      const double next = ck * c - sk * s;
      sk = sk * c + ck * s;
      ck = next;
      a[i++] = ck;
      a[i++] = sk;
    }
  }

 private:
  double middle_, span_;
  HarmonicOptions options_;
};

void requireWindow(const std::vector<double>& angle, const std::vector<double>& signals,
                   const HarmonicOptions& options) {
  const std::size_t n = angle.size();
  if (options.harmonics < 1 || options.harmonics > kMostHarmonics) {
    throw InputError("harmonics is " + std::to_string(options.harmonics) +
                     ": give a number from 1 to " + std::to_string(kMostHarmonics));
  }
  if (signals.size() != 6 * n) {
    throw InputError("signals have " + std::to_string(signals.size()) + " values for " +
                     std::to_string(n) + " samples: six a sample are needed");
  }
  const std::size_t needed = std::max(kMinSamples, static_cast<std::size_t>(4 * options.harmonics));
  if (n < needed) {
    throw InputError("window has " + std::to_string(n) + " samples: at least " +
                     std::to_string(needed) + " are needed");
  }
  const double samples = static_cast<double>(n);
  const double span = angle.back() - angle.front();
  const double periods = std::abs(span) * samples / (samples - 1.0) / kTwoPi;
  if (!std::isfinite(span)) throwNonFinite(angle, signals);
  if (periods < 1.0 - 1e-6) {
    throw InputError("window covers " + std::to_string(periods) +
                     " periods of the exciter: at least one is needed");
  }
  if (samples <= 2.0 * options.harmonics * periods) {
    throw InputError("window has " + std::to_string(samples / periods) +
                     " samples a period of the exciter: more than " +
                     (options.harmonics == 1 ? "two" : std::to_string(2 * options.harmonics)) +
                     " are needed");
  }
}

// 1/sd², mean 1
std::vector<double> weightsOf(const std::vector<double>& sd, std::size_t n) {
  if (sd.empty()) return {};
  if (sd.size() != n) {
    throw InputError("uncertainty has " + std::to_string(sd.size()) + " values for " +
                     std::to_string(n) + " samples: give one a sample");
  }
  for (std::size_t k = 0; k < n; ++k) {
    if (!(sd[k] > 0.0 && std::isfinite(sd[k]))) {
      throw InputError("uncertainty of sample " + std::to_string(k) + " is " +
                       std::to_string(sd[k]) + ": give a positive one");
    }
  }
  const double smallest = *std::min_element(sd.begin(), sd.end());
  std::vector<double> weights(n);
  double sum = 0.0;
  for (std::size_t k = 0; k < n; ++k) sum += weights[k] = std::pow(smallest / sd[k], 2);
  for (double& w : weights) w *= static_cast<double>(n) / sum;
  return weights;
}

// given: weights of the samples, mean 1, or empty. weights: these times the robust ones on return;
// empty where all are 1
HarmonicFit fitWeighted(const std::vector<double>& angle, const std::vector<double>& signals,
                        const HarmonicOptions& options, const std::vector<double>& given,
                        std::vector<double>& weights) {
  requireWindow(angle, signals, options);
  const std::size_t n = angle.size();
  const double samples = static_cast<double>(n);
  const Columns columns(angle.front(), angle.back(), options);
  const int q = columns.count();

  // normal equations relative to the first sample, so that a large offset costs no digits
  const Vector6 origin = Signals(signals.data());
  const auto signalsOf = [&](std::size_t k) -> Vector6 {
    return Signals(&signals[6 * k]) - origin;
  };
  weights = given;
  const auto givenOf = [&](std::size_t k) { return given.empty() ? 1.0 : given[k]; };
  const auto weightOf = [&](std::size_t k) { return weights.empty() ? 1.0 : weights[k]; };
  Normal normal(q, q), inverse(q, q);
  Coefficients moment(q, 6), fit(q, 6);
  Design a;
  const auto solve = [&] {
    normal.setZero();
    moment.setZero();
    for (std::size_t k = 0; k < n; ++k) {
      columns.row(angle[k], a);
      const double w = weightOf(k);
      normal.noalias() += w * a * a.transpose();
      moment.noalias() += w * a * signalsOf(k).transpose();
    }
    if (!normal.allFinite() || !moment.allFinite()) throwNonFinite(angle, signals);
    inverse = normal.ldlt().solve(Normal::Identity(q, q));
    fit = inverse * moment;
  };
  solve();
  const Eigen::Matrix2d scatter = inverse.topLeftCorner<2, 2>();
  const double inflation = scatter.trace() * samples / 4.0;
  if (!(inflation > 0.0 && inflation < 1e6)) {
    throw InputError(
        "the samples do not resolve the exciter's angle: use a sampling rate that is no multiple "
        "or fraction of its frequency");
  }
  const auto residualOf = [&](std::size_t k) -> Vector6 {
    columns.row(angle[k], a);
    return signalsOf(k) - fit.transpose() * a;
  };

  // Huber: weights from the planar residual, its scale from the median
  double efficiency = 1.0;  // mean slope of the influence function
  if (options.robust) {
    std::vector<double> radius(n), sorted(n);
    double before = 0.0;
    for (int pass = 0; pass < kReweightings; ++pass) {
      for (std::size_t k = 0; k < n; ++k) {
        radius[k] = std::sqrt(givenOf(k)) * residualOf(k).head<2>().norm();
      }
      sorted = radius;
      const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(n / 2);
      std::nth_element(sorted.begin(), middle, sorted.end());
      const double limit = kHuber * *middle / kRayleighMedian;
      if (!(limit > 0.0) || std::abs(limit - before) <= 1e-9 * limit) break;
      before = limit;
      weights.assign(n, 1.0);
      efficiency = 0.0;
      for (std::size_t k = 0; k < n; ++k) {
        const bool inside = radius[k] <= limit;
        weights[k] = givenOf(k) * (inside ? 1.0 : limit / radius[k]);
        efficiency += (inside ? 1.0 : 0.5 * limit / radius[k]) / samples;
      }
      solve();
    }
  }

  // residuals give the noise and one step of refinement
  Coefficients rest = Coefficients::Zero(q, 6);
  Matrix6 sum_squares = Matrix6::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    const Vector6 residual = weightOf(k) * residualOf(k);
    sum_squares.noalias() += residual * residual.transpose() / givenOf(k);
    rest.noalias() += a * residual.transpose();
  }
  fit += inverse * rest;

  HarmonicFit result;
  result.samples = n;
  result.inflation = inflation;
  result.scatter = scatter;
  result.offset = origin + fit.row(2).transpose();
  result.noise = sum_squares / (samples - q) / (efficiency * efficiency);
  // c cos a + s sin a = Re((c - i s) e^{ia})
  result.phasor.real() = fit.row(0).transpose();
  result.phasor.imag() = -fit.row(1).transpose();
  return result;
}

}  // namespace

HarmonicFit fitHarmonic(const std::vector<double>& angle, const std::vector<double>& signals,
                        const HarmonicOptions& options, const std::vector<double>& sd) {
  std::vector<double> weights;
  return fitWeighted(angle, signals, options, weightsOf(sd, angle.size()), weights);
}

FrequencyFit fitFrequency(const std::vector<double>& t, const std::vector<double>& signals,
                          double frequency, double range, const HarmonicOptions& options,
                          const std::vector<double>& sd) {
  if (!(frequency > 0.0 && std::isfinite(frequency))) {
    throw InputError("frequency is " + std::to_string(frequency) +
                     ": give a positive one in rad/s");
  }
  if (!(range > 0.0 && range < frequency)) {
    throw InputError("range is " + std::to_string(range) +
                     ": give a positive one in rad/s, below the frequency");
  }
  const std::size_t n = t.size();
  std::vector<double> angle(n);
  const double middle = n > 0 ? 0.5 * (t.front() + t.back()) : 0.0;
  const auto anglesAt = [&](double w) {
    for (std::size_t k = 0; k < n; ++k) angle[k] = w * (t[k] - middle);
  };
  const auto powerAt = [&](double w) {
    anglesAt(w);
    const HarmonicFit fit = fitHarmonic(angle, signals, options, sd);
    return std::norm(fit.phasor[0]) + std::norm(fit.phasor[1]);
  };

  // a quarter of the line's width a step
  anglesAt(frequency);
  requireWindow(angle, signals, options);
  const double duration = t.back() - t.front();
  const int steps = std::max(1, static_cast<int>(std::ceil(range * duration / (kTwoPi / 8))));
  double best = frequency, most = powerAt(frequency);
  for (int k = -steps; k <= steps; ++k) {
    const double w = frequency + range * k / steps;
    const double power = k == 0 ? 0.0 : powerAt(w);
    if (power > most) {
      most = power;
      best = w;
    }
  }

  // Gauss–Newton: how the fitted motion changes with the frequency, less what the columns explain
  FrequencyFit result{best, 0.0};
  const std::vector<double> given = weightsOf(sd, n);
  std::vector<double> weights;
  for (int pass = 0; pass < 30; ++pass) {
    anglesAt(result.frequency);
    const Columns columns(angle.front(), angle.back(), options);
    const int q = columns.count();
    const HarmonicFit fit = fitWeighted(angle, signals, options, given, weights);
    double weight_sum = 0.0;
    Normal normal = Normal::Zero(q, q);
    Eigen::Matrix<double, Eigen::Dynamic, 4, 0, kMostColumns, 4> moment(q, 4);
    moment.setZero();
    Eigen::Vector4d squares = Eigen::Vector4d::Zero(), row;  // slopes of x, y; x, y
    Eigen::Vector2d products = Eigen::Vector2d::Zero();
    Design a;
    const Vector6 origin = Signals(signals.data());
    for (std::size_t k = 0; k < n; ++k) {
      columns.row(angle[k], a);
      const Complex turn = Complex(0, t[k] - middle) * Complex(a[0], a[1]);
      row << (fit.phasor[0] * turn).real(), (fit.phasor[1] * turn).real(),
          signals[6 * k] - origin[0], signals[6 * k + 1] - origin[1];
      const double w = weights.empty() ? 1.0 : weights[k];
      weight_sum += w;
      normal.noalias() += w * a * a.transpose();
      moment.noalias() += w * a * row.transpose();
      squares += w * row.cwiseAbs2();
      products += w * row.head<2>().cwiseProduct(row.tail<2>());
    }
    const Eigen::Matrix<double, Eigen::Dynamic, 4, 0, kMostColumns, 4> explained =
        normal.ldlt().solve(moment);
    double slope2 = 0.0, along = 0.0;
    for (int i = 0; i < 2; ++i) {
      slope2 += squares[i] - moment.col(i).dot(explained.col(i));
      along += products[i] - moment.col(i).dot(explained.col(i + 2));
    }
    if (!(slope2 > 0.0)) throw InputError("there is no motion whose frequency could be fitted");
    const double step = along / slope2;
    const double spread = slope2 * static_cast<double>(n) / weight_sum;
    result.sd = std::sqrt(0.5 * (fit.noise(0, 0) + fit.noise(1, 1)) / spread);
    result.frequency += step;
    if (!(std::abs(result.frequency - frequency) <= range)) {
      throw InputError("the best frequency is not within " + std::to_string(range) +
                       " rad/s of the given one: give a better one or a wider range");
    }
    if (std::abs(step) <= 1e-13 * result.frequency || std::abs(step) <= 1e-6 * result.sd) break;
  }
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

ModeDecision decideMode(const Locus& locus, double false_alarm, double indifference,
                        std::optional<LocusMode> previous) {
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
  const double nu = n2 - 2.0 * kLocusColumns;
  const double minor = radius_p - radius_n;
  const double from_none = size / v;
  const double from_circle = radius_n * radius_n / v;
  const double from_segment = 0.5 * minor * minor / v;

  // F tests, vibration_and_locus section 6.5
  const double eps2 = indifference * indifference;
  const double lambda = from_none * eps2 / (1.0 + eps2);
  // whether a mode's own test lets it pass; the previous one has it easier
  const auto passes = [&](LocusMode mode, double tail) {
    const double rate = previous == mode                  ? 0.1 * false_alarm
                        : previous == LocusMode::kEllipse ? std::min(0.5, 10.0 * false_alarm)
                                                          : false_alarm;
    return tail >= rate;
  };
  if (passes(LocusMode::kNone, fTail(from_none / 4.0, 4.0, nu, 0.0))) {
    decision.mode = LocusMode::kNone;
  } else {
    const bool circle = passes(LocusMode::kCircle, fTail(from_circle / 2.0, 2.0, nu, lambda));
    const bool segment = passes(LocusMode::kSegment, fTail(from_segment, 1.0, nu, lambda));
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
