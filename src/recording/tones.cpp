// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/recording/tones.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <functional>
#include <limits>
#include <unsupported/Eigen/FFT>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/math/distributions.h"

namespace assembly_cell {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTwoPi = 2.0 * M_PI;
constexpr std::size_t kMinSamples = 64;
constexpr double kFarStart = 1000.0;  // durations of the recording
constexpr double kOneRate = 0.2;      // maximum jitter of stamps over the sampling period
// Minimum of a peak over the median of the bins around it: one bin in 1e10 of white noise exceeds
// it.
constexpr double kOverFloor = 6.0;
constexpr std::size_t kFloorBins = 200;  // on both sides
constexpr std::size_t kLobe = 4;         // bins of a Hann window's main lobe plus one
// Probability of a false step in a recording, over all its positions, ...
constexpr double kStepTail = 1e-3;
// ... and minimum step over the largest amplitude: half of it admits the warming of a shaker, twice
// misses steps by a fifth.
constexpr double kMinStep = 0.1;
constexpr double kMinPeriods =
    20.0;  // minimum number of periods of the slowest tone between two steps

// ---- spectrum

std::vector<double> amplitudes(const VectorXd& values) {
  const auto n = static_cast<std::size_t>(values.size());
  std::vector<double> windowed(n);
  const double mean = values.mean();
  for (std::size_t k = 0; k < n; ++k) {
    const double hann = 1.0 - std::cos(kTwoPi * static_cast<double>(k) / static_cast<double>(n));
    windowed[k] = hann * (values[static_cast<Index>(k)] - mean);
  }
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> spectrum;
  fft.fwd(spectrum, windowed);
  std::vector<double> out(n / 2);
  for (std::size_t k = 0; k < out.size(); ++k) {
    out[k] = 2.0 * std::abs(spectrum[k]) / static_cast<double>(n);
  }
  return out;
}

double floorAt(const std::vector<double>& spectrum, std::size_t bin) {
  const std::size_t first = bin > kFloorBins ? bin - kFloorBins : 1;
  const std::size_t end = std::min(bin + kFloorBins, spectrum.size());
  std::vector<double> around(spectrum.begin() + static_cast<std::ptrdiff_t>(first),
                             spectrum.begin() + static_cast<std::ptrdiff_t>(end));
  return upperMedian(around);
}

// Frequencies [cycles per sample] of the peaks, highest first.
std::vector<double> peaksOf(const VectorXd& values, std::size_t maximum, double smallest) {
  std::vector<double> spectrum = amplitudes(values), out;
  const std::vector<double> whole = spectrum;
  double highest = 0.0;
  while (out.size() < maximum && spectrum.size() > 2 * kLobe) {
    const auto peak = std::max_element(spectrum.begin() + kLobe, spectrum.end());
    const auto bin = static_cast<std::size_t>(peak - spectrum.begin());
    highest = std::max(highest, *peak);
    if (!(*peak > kOverFloor * floorAt(whole, bin)) || *peak < smallest * highest) break;
    // not on the slope of a larger peak
    const bool top =
        whole[bin] >= whole[bin - 1] && (bin + 1 == whole.size() || whole[bin] >= whole[bin + 1]);
    if (top && bin + 1 < whole.size()) {
      const double a = std::log(whole[bin - 1]), b = std::log(whole[bin]),
                   c = std::log(whole[bin + 1]);
      const double shift = 0.5 * (a - c) / (a - 2.0 * b + c);
      out.push_back((static_cast<double>(bin) + (std::isfinite(shift) ? shift : 0.0)) /
                    static_cast<double>(values.size()));
    }
    const std::size_t first = bin - std::min(bin, kLobe);
    for (std::size_t k = first; k <= bin + kLobe && k < spectrum.size(); ++k) spectrum[k] = 0.0;
  }
  return out;
}

// ---- least-squares fit of all tones

// Columns: cosines and sines of the segments, one for each frequency, the offset.
struct Model {
  std::vector<double> frequency;    // [Hz]
  std::vector<std::size_t> starts;  // first sample of each segment
  VectorXd coefficient;             // 2 for each tone of each segment, then the offset
  MatrixXd covariance;              // of these and of the frequencies in between
  double squares = 0.0;

  Index tones() const { return static_cast<Index>(frequency.size()); }
  Index amplitudes() const { return 2 * tones() * static_cast<Index>(starts.size()); }
};

// Gauss–Newton step; returns the largest change of a frequency over the line width. Not a
// problem for math/least_squares.h: amplitudes are solved again at each step, each frequency has
// its own bound, and the phases follow the frequencies.
double improve(const VectorXd& t, const VectorXd& y, Model& m) {
  const Index K = m.tones(), q = m.amplitudes() + K + 1;
  MatrixXd normal = MatrixXd::Zero(q, q);
  VectorXd moment = VectorXd::Zero(q);
  double squares = 0.0;
  const double middle = t.mean();
  std::size_t segment = 0;
  // in blocks, as each segment has few columns
  constexpr Index kBlock = 512;
  for (Index begin = 0; begin < t.size();) {
    while (segment + 1 < m.starts.size() && static_cast<Index>(m.starts[segment + 1]) <= begin) {
      ++segment;
    }
    Index end = std::min(begin + kBlock, t.size());
    if (segment + 1 < m.starts.size()) {
      end = std::min(end, static_cast<Index>(m.starts[segment + 1]));
    }
    const Index first = 2 * K * static_cast<Index>(segment);
    MatrixXd A(end - begin, 3 * K + 1);
    for (Index k = 0; k < K; ++k) {
      const double a = m.coefficient[first + 2 * k], b = m.coefficient[first + 2 * k + 1];
      for (Index i = begin; i < end; ++i) {
        const double angle = kTwoPi * m.frequency[static_cast<std::size_t>(k)] * t[i];
        const double c = std::cos(angle), s = std::sin(angle);
        A(i - begin, 2 * k) = c;
        A(i - begin, 2 * k + 1) = s;
        A(i - begin, 2 * K + k) = kTwoPi * (t[i] - middle) * (b * c - a * s);
      }
    }
    A.col(3 * K).setOnes();
    const VectorXd values = y.segment(begin, end - begin);
    const MatrixXd own = A.transpose() * A;
    const VectorXd along = A.transpose() * values;
    const auto place = [&](Index k) {
      return k < 2 * K ? first + k : m.amplitudes() + (k - 2 * K);
    };
    for (Index i = 0; i < own.rows(); ++i) {
      for (Index j = 0; j < own.cols(); ++j) normal(place(i), place(j)) += own(i, j);
      moment[place(i)] += along[i];
    }
    squares += values.squaredNorm();
    begin = end;
  }
  // without amplitudes in the first pass, derivatives by frequency are zero
  const bool first_pass = m.coefficient.isZero(0.0);
  VectorXd scale = normal.diagonal().cwiseSqrt();
  if (first_pass) scale.segment(m.amplitudes(), K).setConstant(1.0);
  MatrixXd scaled = scale.cwiseInverse().asDiagonal() * normal * scale.cwiseInverse().asDiagonal();
  if (first_pass) scaled.diagonal().segment(m.amplitudes(), K).setOnes();
  const Eigen::LDLT<MatrixXd> solver(scaled);
  const VectorXd solution =
      scale.cwiseInverse().asDiagonal() * solver.solve(scale.cwiseInverse().asDiagonal() * moment);
  m.coefficient.head(m.amplitudes()) = solution.head(m.amplitudes());
  m.coefficient[m.amplitudes()] = solution[q - 1];
  m.squares = std::max(squares - solution.dot(moment), 0.0);
  const double width = 1.0 / (t[t.size() - 1] - t[0]);
  double change = 0.0;
  for (Index k = 0; k < K && !first_pass; ++k) {
    const double step = std::clamp(solution[m.amplitudes() + k], -0.3 * width, 0.3 * width);
    m.frequency[static_cast<std::size_t>(k)] += step;
    // phases change with frequencies about the middle of the recording
    for (std::size_t s = 0; s < m.starts.size(); ++s) {
      const Index at = 2 * K * static_cast<Index>(s) + 2 * k;
      const std::complex<double> turned =
          std::complex<double>(m.coefficient[at], -m.coefficient[at + 1]) *
          std::polar(1.0, -kTwoPi * step * middle);
      m.coefficient[at] = turned.real();
      m.coefficient[at + 1] = -turned.imag();
    }
    change = std::max(change, std::abs(step) / width);
  }
  m.covariance = scale.cwiseInverse().asDiagonal() * solver.solve(MatrixXd::Identity(q, q)) *
                 scale.cwiseInverse().asDiagonal();
  return first_pass ? 1.0 : change;
}

void settle(const VectorXd& t, const VectorXd& y, Model& m) {
  m.coefficient = VectorXd::Zero(m.amplitudes() + 1);
  constexpr int kPasses = 20;
  for (int pass = 0; pass < kPasses && improve(t, y, m) > 1e-7; ++pass) {
  }
}

// ---- steps

// Cumulative normal equations of one segment, to fit its two parts for each position of a step.
struct Prefix {
  Index columns;
  std::vector<double> sums;  // of the upper triangle, the moments and the squares

  Index width() const { return columns * (columns + 1) / 2 + columns + 1; }
};

Prefix prefixOf(const VectorXd& t, const VectorXd& y, const std::vector<double>& frequency,
                std::size_t first, std::size_t end) {
  Prefix out{2 * static_cast<Index>(frequency.size()) + 1, {}};
  const auto width = static_cast<std::size_t>(out.width());
  out.sums.assign((end - first + 1) * width, 0.0);
  VectorXd row(out.columns);
  for (std::size_t i = first; i < end; ++i) {
    const auto k = static_cast<Index>(i);
    for (std::size_t f = 0; f < frequency.size(); ++f) {
      const double angle = kTwoPi * frequency[f] * t[k];
      row[2 * static_cast<Index>(f)] = std::cos(angle);
      row[2 * static_cast<Index>(f) + 1] = std::sin(angle);
    }
    row[out.columns - 1] = 1.0;
    const double* before = &out.sums[(i - first) * width];
    double* after = &out.sums[(i - first + 1) * width];
    std::size_t at = 0;
    for (Index a = 0; a < out.columns; ++a) {
      for (Index b = a; b < out.columns; ++b, ++at) after[at] = before[at] + row[a] * row[b];
    }
    for (Index a = 0; a < out.columns; ++a, ++at) after[at] = before[at] + row[a] * y[k];
    after[at] = before[at] + y[k] * y[k];
  }
  return out;
}

// Least squares over samples [from, to) of the prefix; returns the residual sum of squares.
double residualOf(const Prefix& p, std::size_t from, std::size_t to, VectorXd* coefficients) {
  const auto width = static_cast<std::size_t>(p.width());
  const double *low = &p.sums[from * width], *high = &p.sums[to * width];
  MatrixXd normal(p.columns, p.columns);
  VectorXd moment(p.columns);
  std::size_t at = 0;
  for (Index a = 0; a < p.columns; ++a) {
    for (Index b = a; b < p.columns; ++b, ++at) normal(a, b) = normal(b, a) = high[at] - low[at];
  }
  for (Index a = 0; a < p.columns; ++a, ++at) moment[a] = high[at] - low[at];
  const VectorXd solution = normal.ldlt().solve(moment);
  if (coefficients != nullptr) *coefficients = solution;
  return std::max(high[at] - low[at] - solution.dot(moment), 0.0);
}

struct Split {
  std::size_t place = 0;  // first sample after it
  double f = 0.0, sd = 0.0;
};

// Best step within samples [first, end); f = 0 if there is none.
Split splitOf(const VectorXd& t, const VectorXd& y, const std::vector<double>& frequency,
              std::size_t first, std::size_t end) {
  const Prefix prefix = prefixOf(t, y, frequency, first, end);
  const std::size_t n = end - first;
  const double spacing = (t[t.size() - 1] - t[0]) / static_cast<double>(t.size() - 1);
  const double slowest = *std::min_element(frequency.begin(), frequency.end());
  const auto margin = static_cast<std::size_t>(
      std::max(kMinPeriods / slowest / spacing, 4.0 * static_cast<double>(prefix.columns)));
  Split out;
  if (n <= 2 * margin) return out;
  const double whole = residualOf(prefix, 0, n, nullptr);
  std::vector<double> left(n, std::numeric_limits<double>::infinity());
  const auto look = [&](std::size_t k) {
    if (std::isinf(left[k])) {
      left[k] = residualOf(prefix, 0, k, nullptr) + residualOf(prefix, k, n, nullptr);
    }
  };
  // every quarter of the slowest period, then each sample around the best
  const auto coarse = std::max<std::size_t>(1, static_cast<std::size_t>(0.25 / slowest / spacing));
  for (std::size_t k = margin; k <= n - margin; k += coarse) look(k);
  const auto best_of = [&] {
    return static_cast<std::size_t>(std::min_element(left.begin(), left.end()) - left.begin());
  };
  const std::size_t about = best_of();
  for (std::size_t k = std::max(margin, about - std::min(about, 4 * coarse));
       k <= std::min(n - margin, about + 4 * coarse); ++k) {
    look(k);
  }
  const std::size_t best = best_of();
  const auto q = static_cast<double>(prefix.columns);
  const double dof = static_cast<double>(n) - 2.0 * q;
  const double variance = left[best] / dof;
  out.f = (whole - left[best]) / q / variance;
  VectorXd before, after;
  residualOf(prefix, 0, best, &before);
  residualOf(prefix, best, n, &after);
  double change = 0.0, largest = 0.0;
  for (Index k = 0; k + 1 < prefix.columns; k += 2) {
    change = std::max(change, (after - before).segment<2>(k).norm());
    largest = std::max({largest, after.segment<2>(k).norm(), before.segment<2>(k).norm()});
  }
  if (fTail(out.f, q, dof) * static_cast<double>(n) > kStepTail || change < kMinStep * largest) {
    return out;
  }
  out.place = first + best;
  // interval in which the residual increases by one variance
  std::size_t low = best, high = best;
  while (low > margin && left[low] < left[best] + variance) --low;
  while (high + margin < n && left[high] < left[best] + variance) ++high;
  out.sd = std::max(0.5 * static_cast<double>(high - low), 1.0) * spacing;
  return out;
}

void findSteps(const VectorXd& t, const VectorXd& y, const ToneOptions& options, Model& m,
               std::vector<ToneStep>& steps) {
  // steps are searched in the strongest tones only
  std::vector<double> strong(
      m.frequency.begin(), m.frequency.begin() + static_cast<std::ptrdiff_t>(
                                                     std::min<std::size_t>(m.frequency.size(), 4)));
  const std::function<void(std::size_t, std::size_t)> look = [&](std::size_t first,
                                                                 std::size_t end) {
    if (steps.size() >= options.max_steps) return;
    const Split split = splitOf(t, y, strong, first, end);
    if (split.place == 0) return;
    steps.push_back(
        {0.5 * (t[static_cast<Index>(split.place)] + t[static_cast<Index>(split.place) - 1]),
         split.sd, split.f});
    m.starts.push_back(split.place);
    look(first, split.place);
    look(split.place, end);
  };
  look(0, static_cast<std::size_t>(t.size()));
  std::sort(m.starts.begin(), m.starts.end());
  std::sort(steps.begin(), steps.end(),
            [](const ToneStep& a, const ToneStep& b) { return a.time < b.time; });
}

ToneAnalysis resultOf(const VectorXd& t, const Model& m, std::vector<ToneStep> steps) {
  ToneAnalysis out;
  out.steps = std::move(steps);
  const Index K = m.tones(), q = m.amplitudes() + K + 1;
  const double variance = m.squares / std::max<double>(static_cast<double>(t.size() - q), 1.0);
  out.noise = std::sqrt(variance);
  out.offset = m.coefficient[m.amplitudes()];
  out.offset_sd = std::sqrt(variance * m.covariance(q - 1, q - 1));
  for (Index k = 0; k < K; ++k) {
    Tone tone;
    tone.frequency = m.frequency[static_cast<std::size_t>(k)];
    tone.frequency_sd = std::sqrt(variance * m.covariance(m.amplitudes() + k, m.amplitudes() + k));
    for (std::size_t s = 0; s < m.starts.size(); ++s) {
      const Index at = 2 * K * static_cast<Index>(s) + 2 * k;
      const Eigen::Vector2d ab = m.coefficient.segment<2>(at);
      const double size = ab.norm();
      const Eigen::Vector2d slope = ab / std::max(size, 1e-300);
      tone.amplitude.push_back(size);
      tone.amplitude_sd.push_back(
          std::sqrt(variance * slope.dot(m.covariance.block<2, 2>(at, at) * slope)));
      tone.phase.push_back(std::atan2(-ab[1], ab[0]));
    }
    out.tones.push_back(tone);
  }
  const auto largest = [](const Tone& tone) {
    return *std::max_element(tone.amplitude.begin(), tone.amplitude.end());
  };
  std::sort(out.tones.begin(), out.tones.end(),
            [&](const Tone& a, const Tone& b) { return largest(a) > largest(b); });
  return out;
}

}  // namespace

ChannelRecording readChannels(const std::string& path, const std::vector<std::string>& channels,
                              TimeUnit unit) {
  const Table table = readTable(path, {"t"});
  const TableTimes times = readTimes(table, unit);
  ChannelRecording out;
  out.path = path;
  out.time_unit = times.unit + ", " + times.reason;
  out.t = times.t;
  // far from t = 0 phases would have no digit left
  if (std::abs(out.t.front()) > kFarStart * (out.t.back() - out.t.front())) {
    out.time_unit += text("; t = 0 at the first sample, %.6f s", times.t.front());
    for (double& t : out.t) t -= times.t.front();
  }
  std::vector<std::size_t> columns;
  for (const std::string& name : channels) columns.push_back(table.need({name}));
  for (std::size_t c = 0; c < table.names.size() && channels.empty(); ++c) {
    if (c == times.column || table.isText(c)) continue;
    if (!table.faults[c].empty()) throw InputError(table.faults[c]);
    columns.push_back(c);
  }
  if (columns.empty()) throw InputError(path + ": no channel beside t: add one");
  const std::size_t n = out.t.size();
  const double spacing = n > 1 ? (out.t.back() - out.t.front()) / static_cast<double>(n - 1) : 0.0;
  for (std::size_t i = 1; i < n; ++i) {
    const double step = out.t[i] - out.t[i - 1];
    if (std::abs(step - spacing) <= kOneRate * spacing) continue;
    throw InputError(
        table.place(i) +
        text("column t: %.6g s after the row before, %.6g s in the mean: ", step, spacing) +
        "give one rate without gaps");
  }
  for (const std::size_t c : columns) {
    out.names.push_back(table.names[c]);
    out.values.emplace_back();
    for (const std::vector<double>& row : table.rows) out.values.back().push_back(row[c]);
  }
  return out;
}

ToneAnalysis findTones(const std::vector<double>& t, const std::vector<double>& values,
                       const ToneOptions& options) {
  if (values.size() < kMinSamples) {
    throw InputError(std::to_string(values.size()) + " samples: give at least " +
                     std::to_string(kMinSamples));
  }
  const auto n = static_cast<Index>(values.size());
  const VectorXd y = Eigen::Map<const VectorXd>(values.data(), n);
  const VectorXd time = Eigen::Map<const VectorXd>(t.data(), n);
  const double rate = static_cast<double>(n - 1) / (t.back() - t.front());
  Model model;
  for (const double f : peaksOf(y, options.max_tones, options.smallest)) {
    model.frequency.push_back(f * rate);
  }
  if (model.frequency.empty()) {
    throw InputError("no tone stands out of the noise: record the exciter while it runs");
  }
  model.starts = {0};
  settle(time, y, model);
  std::vector<ToneStep> steps;
  findSteps(time, y, options, model, steps);
  if (!steps.empty()) settle(time, y, model);
  return resultOf(time, model, steps);
}

const char* toString(ToneOrigin::Kind kind) {
  return std::array{"exciter", "harmonic", "intermodulation",
                    "foreign"}[static_cast<std::size_t>(kind)];
}

ToneOrigin originOf(const Tone& tone, const std::vector<Tone>& exciter, double resolution,
                    int order) {
  ToneOrigin out;
  const std::size_t K = std::min<std::size_t>(exciter.size(), 4);
  std::vector<int> factors(K, 0);
  int minimum = order + 1;
  const std::function<void(std::size_t, int)> look = [&](std::size_t k, int used) {
    if (k == K) {
      double sum = 0.0, variance = tone.frequency_sd * tone.frequency_sd;
      for (std::size_t i = 0; i < K; ++i) {
        sum += factors[i] * exciter[i].frequency;
        variance += std::pow(factors[i] * exciter[i].frequency_sd, 2);
      }
      const double allowed = std::max(4.0 * std::sqrt(variance), 0.1 * resolution * used);
      if (used == 0 || used >= minimum || !(std::abs(sum - tone.frequency) <= allowed)) return;
      minimum = used;
      out.factors = factors;
      return;
    }
    for (int factor = -(order - used); factor <= order - used; ++factor) {
      factors[k] = factor;
      look(k + 1, used + std::abs(factor));
    }
    factors[k] = 0;
  };
  look(0, 0);
  if (out.factors.empty()) return out;
  const auto involved =
      std::count_if(out.factors.begin(), out.factors.end(), [](int f) { return f != 0; });
  out.kind = minimum == 1    ? ToneOrigin::Kind::kExciter
             : involved == 1 ? ToneOrigin::Kind::kHarmonic
                             : ToneOrigin::Kind::kIntermodulation;
  return out;
}

}  // namespace assembly_cell
