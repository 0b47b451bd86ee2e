// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/locus/harmonic_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/math/least_squares.h"

namespace assembly_cell {
namespace {

using Complex = std::complex<double>;

constexpr int kMaxHarmonics = 4;
constexpr int kMaxColumns = 2 + 2 * kMaxHarmonics;  // cos, sin, 1, drift, then each harmonic
constexpr double kTwoPi = 2.0 * M_PI;
constexpr double kHuber = 1.7;              // 1.7 % of efficiency on clean data
constexpr double kRayleighMedian = 1.1774;  // of a planar residual, in units of one axis's noise
constexpr int kReweightings = 50;
constexpr double kSettled = 1e-9;
constexpr double kWorstInflation = 1e6;

using Design = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxColumns, 1>;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxColumns, kMaxColumns>;
using Coefficients = Eigen::Matrix<double, Eigen::Dynamic, 6, 0, kMaxColumns, 6>;
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
  if (options.harmonics < 1 || options.harmonics > kMaxHarmonics) {
    throw InputError("harmonics is " + std::to_string(options.harmonics) +
                     ": give a number from 1 to " + std::to_string(kMaxHarmonics));
  }
  if (signals.size() != 6 * n) {
    throw InputError("signals have " + std::to_string(signals.size()) + " values for " +
                     std::to_string(n) + " samples: six a sample are needed");
  }
  const std::size_t needed =
      std::max(kMinLocusSamples, static_cast<std::size_t>(4 * options.harmonics));
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

// Least squares on the columns with weights of the samples: `given` (mean 1, or empty: all 1) times
// those of a robust fit.
class WeightedFit {
 public:
  WeightedFit(const std::vector<double>& angle, const std::vector<double>& signals,
              const HarmonicOptions& options, const std::vector<double>& given)
      : angle_(angle),
        signals_(signals),
        given_(given),
        n_(angle.size()),
        samples_(static_cast<double>(n_)),
        columns_(angle.front(), angle.back(), options),
        origin_(Signals(signals.data())),
        q_(columns_.count()),
        weights_(given),
        inverse_(q_, q_),
        fit_(q_, 6) {
    solve();
    scatter_ = inverse_.topLeftCorner<2, 2>();
    inflation_ = scatter_.trace() * samples_ / 4.0;
    if (!(inflation_ > 0.0 && inflation_ < kWorstInflation)) {
      throw InputError(
          "the samples do not resolve the exciter's angle: use a sampling rate that is no multiple "
          "or fraction of its frequency");
    }
    if (options.robust) reweigh();
  }

  // given times robust weights; empty where all are 1
  const std::vector<double>& weights() const { return weights_; }

  // residuals give the noise and one step of refinement
  HarmonicFit result() {
    Coefficients rest = Coefficients::Zero(q_, 6);
    Matrix6 sum_squares = Matrix6::Zero();
    for (std::size_t k = 0; k < n_; ++k) {
      const Vector6 residual = weight(k) * residualOf(k);
      sum_squares.noalias() += residual * residual.transpose() / given(k);
      rest.noalias() += row_ * residual.transpose();
    }
    fit_ += inverse_ * rest;

    HarmonicFit result;
    result.samples = n_;
    result.inflation = inflation_;
    result.scatter = scatter_;
    result.offset = origin_ + fit_.row(2).transpose();
    result.noise = sum_squares / (samples_ - q_) / (efficiency_ * efficiency_);
    // c cos a + s sin a = Re((c - i s) e^{ia})
    result.phasor.real() = fit_.row(0).transpose();
    result.phasor.imag() = -fit_.row(1).transpose();
    return result;
  }

 private:
  double given(std::size_t k) const { return given_.empty() ? 1.0 : given_[k]; }
  double weight(std::size_t k) const { return weights_.empty() ? 1.0 : weights_[k]; }
  // relative to the first sample, so that a large offset costs no digits
  Vector6 signalsOf(std::size_t k) const { return Signals(&signals_[6 * k]) - origin_; }
  // leaves the sample's columns in row_
  Vector6 residualOf(std::size_t k) {
    columns_.row(angle_[k], row_);
    return signalsOf(k) - fit_.transpose() * row_;
  }

  void solve() {
    Normal normal = Normal::Zero(q_, q_);
    Coefficients moment = Coefficients::Zero(q_, 6);
    for (std::size_t k = 0; k < n_; ++k) {
      columns_.row(angle_[k], row_);
      const double w = weight(k);
      normal.noalias() += w * row_ * row_.transpose();
      moment.noalias() += w * row_ * signalsOf(k).transpose();
    }
    if (!normal.allFinite() || !moment.allFinite()) throwNonFinite(angle_, signals_);
    inverse_ = normal.ldlt().solve(Normal::Identity(q_, q_));
    fit_ = inverse_ * moment;
  }

  // Huber: weights from the planar residual, its scale from the median
  void reweigh() {
    std::vector<double> radius(n_), sorted(n_);
    double before = 0.0;
    for (int pass = 0; pass < kReweightings; ++pass) {
      for (std::size_t k = 0; k < n_; ++k) {
        radius[k] = std::sqrt(given(k)) * residualOf(k).head<2>().norm();
      }
      sorted = radius;
      const double limit = kHuber * upperMedian(sorted) / kRayleighMedian;
      if (!(limit > 0.0) || std::abs(limit - before) <= kSettled * limit) break;
      before = limit;
      weights_.assign(n_, 1.0);
      efficiency_ = 0.0;
      for (std::size_t k = 0; k < n_; ++k) {
        const bool inside = radius[k] <= limit;
        weights_[k] = given(k) * (inside ? 1.0 : limit / radius[k]);
        efficiency_ += (inside ? 1.0 : 0.5 * limit / radius[k]) / samples_;
      }
      solve();
    }
  }

  const std::vector<double>&angle_, &signals_, &given_;
  std::size_t n_;
  double samples_;
  Columns columns_;
  Vector6 origin_;
  int q_;
  std::vector<double> weights_;
  Normal inverse_;
  Coefficients fit_;
  Design row_;
  Eigen::Matrix2d scatter_;
  double inflation_ = 1.0;
  double efficiency_ = 1.0;  // mean slope of the influence function
};

// Search for the frequency: the motion fitted at trial frequencies, about the window's middle. One
// unknown for minimise(); the linear coefficients are eliminated (variable projection).
class FrequencySearch {
 public:
  FrequencySearch(const std::vector<double>& t, const std::vector<double>& signals, double start,
                  double range, const HarmonicOptions& options, const std::vector<double>& sd)
      : t_(t),
        signals_(signals),
        start_(start),
        range_(range),
        options_(options),
        sample_sd_(sd),
        n_(t.size()),
        angle_(n_),
        middle_(n_ > 0 ? 0.5 * (t.front() + t.back()) : 0.0) {}

  // Best of a scan in steps of a quarter of the line's width.
  double coarse() {
    anglesAt(start_);
    requireWindow(angle_, signals_, options_);
    const double duration = t_.back() - t_.front();
    const int steps = std::max(1, static_cast<int>(std::ceil(range_ * duration / (kTwoPi / 8))));
    double best = start_, largest = powerAt(start_);
    for (int k = -steps; k <= steps; ++k) {
      const double w = start_ + range_ * k / steps;
      const double power = k == 0 ? 0.0 : powerAt(w);
      if (power > largest) {
        largest = power;
        best = w;
      }
    }
    return best;
  }

  // Change of the fitted motion with the frequency, less what the columns explain. Throws
  // InputError where there is no motion.
  void linearise(double frequency) {
    frequency_ = frequency;
    anglesAt(frequency);
    requireWindow(angle_, signals_, options_);
    const std::vector<double> given = weightsOf(sample_sd_, n_);
    WeightedFit weighted(angle_, signals_, options_, given);
    const HarmonicFit fit = weighted.result();
    const std::vector<double>& weights = weighted.weights();
    const Columns columns(angle_.front(), angle_.back(), options_);
    const int q = columns.count();
    double weight_sum = 0.0;
    Normal normal = Normal::Zero(q, q);
    Eigen::Matrix<double, Eigen::Dynamic, 4, 0, kMaxColumns, 4> moment(q, 4);
    moment.setZero();
    Eigen::Vector4d squares = Eigen::Vector4d::Zero(), row;  // slopes of x, y; x, y
    Eigen::Vector2d products = Eigen::Vector2d::Zero();
    Design a;
    const Vector6 origin = Signals(signals_.data());
    for (std::size_t k = 0; k < n_; ++k) {
      columns.row(angle_[k], a);
      const Complex turn = Complex(0, t_[k] - middle_) * Complex(a[0], a[1]);
      row << (fit.phasor[0] * turn).real(), (fit.phasor[1] * turn).real(),
          signals_[6 * k] - origin[0], signals_[6 * k + 1] - origin[1];
      const double w = weights.empty() ? 1.0 : weights[k];
      weight_sum += w;
      normal.noalias() += w * a * a.transpose();
      moment.noalias() += w * a * row.transpose();
      squares += w * row.cwiseAbs2();
      products += w * row.head<2>().cwiseProduct(row.tail<2>());
    }
    const Eigen::Matrix<double, Eigen::Dynamic, 4, 0, kMaxColumns, 4> explained =
        normal.ldlt().solve(moment);
    double slope2 = 0.0, along = 0.0;
    for (int i = 0; i < 2; ++i) {
      slope2 += squares[i] - moment.col(i).dot(explained.col(i));
      along += products[i] - moment.col(i).dot(explained.col(i + 2));
    }
    if (!(slope2 > 0.0)) throw InputError("there is no motion whose frequency could be fitted");
    const double spread = slope2 * static_cast<double>(n_) / weight_sum;
    sd_ = std::sqrt(0.5 * (fit.noise(0, 0) + fit.noise(1, 1)) / spread);
    step_ = along / slope2;
  }
  // throws InputError where it leaves the range
  double step(double /*damping*/) const {
    if (!(std::abs(frequency_ + step_ - start_) <= range_)) {
      throw InputError("the best frequency is not within " + std::to_string(range_) +
                       " rad/s of the given one: give a better one or a wider range");
    }
    return step_;
  }
  bool small(double step) const {
    return std::abs(step) <= 1e-13 * (frequency_ + step) || std::abs(step) <= 1e-6 * sd_;
  }

  double sd() const { return sd_; }  // at the last linearisation [rad/s]

 private:
  void anglesAt(double w) {
    for (std::size_t k = 0; k < n_; ++k) angle_[k] = w * (t_[k] - middle_);
  }
  double powerAt(double w) {
    anglesAt(w);
    const HarmonicFit fit = fitHarmonic(angle_, signals_, options_, sample_sd_);
    return std::norm(fit.phasor[0]) + std::norm(fit.phasor[1]);
  }

  const std::vector<double>&t_, &signals_;
  double start_, range_;  // [rad/s]
  const HarmonicOptions& options_;
  const std::vector<double>& sample_sd_;
  std::size_t n_;
  std::vector<double> angle_;
  double middle_;
  double frequency_ = 0.0, step_ = 0.0, sd_ = 0.0;
};

}  // namespace

HarmonicFit fitHarmonic(const std::vector<double>& angle, const std::vector<double>& signals,
                        const HarmonicOptions& options, const std::vector<double>& sd) {
  const std::vector<double> given = weightsOf(sd, angle.size());
  requireWindow(angle, signals, options);
  return WeightedFit(angle, signals, options, given).result();
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
  FrequencySearch search(t, signals, frequency, range, options, sd);
  FrequencyFit result;
  result.frequency = search.coarse();
  minimise<StepControl::kNone>(search, result.frequency, LeastSquaresOptions());
  result.sd = search.sd();
  return result;
}

}  // namespace assembly_cell
