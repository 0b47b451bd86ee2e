// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Studies of the locus estimator, as CSV on standard output. study_locus accuracy: rms error of the
// direction against the Cramér–Rao bound over the noise, beside principal components and a direct
// ellipse fit. study_locus modes: how often each mode is decided for each true one. study_locus
// cost: one update of the sliding estimate, beside a fit of its window.

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/locus/harmonic_fit.h"
#include "assembly_cell/locus/sliding_locus.h"

namespace {

using namespace assembly_cell;
using Complex = std::complex<double>;
constexpr std::size_t kSamples = 400;  // ten periods
constexpr double kStep = 2 * M_PI / 40, kDegree = M_PI / 180;

struct Recording {
  std::vector<double> angle, signals;
};

// ellipse of half axes a along psi, b across (negative: against the exciter)
void record(double a, double b, double psi, double sigma, std::mt19937_64& random, Recording& r) {
  std::normal_distribution<double> noise(0.0, 1.0);
  r.angle.resize(kSamples);
  r.signals.assign(6 * kSamples, 0.0);
  for (std::size_t k = 0; k < kSamples; ++k) {
    r.angle[k] = kStep * static_cast<double>(k);
    const Complex z = std::polar(1.0, psi) *
                      Complex(a * std::cos(r.angle[k] - psi), b * std::sin(r.angle[k] - psi));
    r.signals[6 * k] = z.real() + sigma * noise(random);
    r.signals[6 * k + 1] = z.imag() + sigma * noise(random);
  }
}

Locus locusOf(const Recording& r) {
  const HarmonicFit fit = fitHarmonic(r.angle, r.signals, {false});
  return locusFromFit(fit);
}

// major axis by the covariance of the points
double principalAxis(const Recording& r) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (std::size_t k = 0; k < kSamples; ++k) {
    const Eigen::Vector2d p(r.signals[6 * k], r.signals[6 * k + 1]);
    mean += p / kSamples;
    squares += p * p.transpose() / kSamples;
  }
  squares -= mean * mean.transpose();
  return 0.5 * std::atan2(2 * squares(0, 1), squares(0, 0) - squares(1, 1));
}

// major axis of the direct least-squares ellipse (Fitzgibbon's constraint in Halir and Flusser's
// form)
double ellipseAxis(const Recording& r) {
  Eigen::Matrix3d S1 = Eigen::Matrix3d::Zero(), S2 = S1, S3 = S1;
  for (std::size_t k = 0; k < kSamples; ++k) {
    const double x = r.signals[6 * k], y = r.signals[6 * k + 1];
    const Eigen::Vector3d quadratic(x * x, x * y, y * y), linear(x, y, 1);
    S1 += quadratic * quadratic.transpose();
    S2 += quadratic * linear.transpose();
    S3 += linear * linear.transpose();
  }
  const Eigen::Matrix3d reduced = S1 - S2 * S3.inverse() * S2.transpose();
  Eigen::Matrix3d constraint;
  constraint << 0, 0, 0.5, 0, -1, 0, 0.5, 0, 0;
  const Eigen::EigenSolver<Eigen::Matrix3d> solver(constraint * reduced);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d q = solver.eigenvectors().col(i).real();
    if (4 * q[0] * q[2] - q[1] * q[1] > 0) {
      // the major axis has the smaller curvature
      const double sign = q[0] + q[2] > 0 ? 1 : -1;
      return 0.5 * std::atan2(-sign * q[1], -sign * (q[0] - q[2]));
    }
  }
  return 0.0;
}

int accuracy(int runs, std::uint64_t seed) {
  std::printf("a,b,sigma,bound_shape,fit,principal_axes,ellipse_fit,bound_phase,fit_phase\n");
  const std::array<std::array<double, 2>, 4> ellipses = {{{1, .4}, {1, .8}, {1, -.4}, {1, .05}}};
  for (const auto& [a, b] : ellipses) {
    for (const double sigma : {.01, .02, .05, .1, .2, .3, .5, .7, 1.0}) {
      std::mt19937_64 random(seed);
      std::uniform_real_distribution<double> any(0.0, M_PI);
      std::array<double, 4> squares{};
      Recording r;
      for (int run = 0; run < runs; ++run) {
        const double psi = any(random);
        record(a, b, psi, sigma, random, r);
        const Locus locus = locusOf(r);
        // with the phase of the exciter known, arg N alone tells the direction
        const std::array<double, 4> found = {locus.orientation(), principalAxis(r), ellipseAxis(r),
                                             0.5 * std::arg(a > std::abs(b) ? locus.N : -locus.N)};
        for (std::size_t m = 0; m < found.size(); ++m) {
          squares[m] += std::pow(std::remainder(found[m] - psi, M_PI) / kDegree, 2) / runs;
        }
      }
      const double shape = std::sqrt(2 * sigma * sigma / kSamples * (a * a + b * b)) /
                           std::abs(a * a - b * b) / kDegree,
                   phase = sigma / std::sqrt(kSamples) / (a - b) / kDegree;
      std::printf("%g,%g,%g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", a, b, sigma, shape,
                  std::sqrt(squares[0]), std::sqrt(squares[1]), std::sqrt(squares[2]), phase,
                  std::sqrt(squares[3]));
    }
  }
  return 0;
}

int modes(int runs, std::uint64_t seed) {
  std::printf("true,b_over_a,sigma_over_a,none,segment,ellipse,circle,undecided\n");
  struct Truth {
    const char* name;
    double a, b;
  };
  for (const Truth& truth :
       {Truth{"none", 0, 0}, Truth{"segment", 1, 0}, Truth{"circle", 1, 1}, Truth{"ellipse", 1, .5},
        Truth{"ellipse", 1, .2}, Truth{"ellipse", 1, -.2}, Truth{"ellipse", 1, -.5}}) {
    for (const double sigma : {.05, .2, .5, 1.0, 2.0}) {
      std::mt19937_64 random(seed);
      std::uniform_real_distribution<double> any(0.0, M_PI);
      std::array<int, 5> count{};
      Recording r;
      for (int run = 0; run < runs; ++run) {
        record(truth.a, truth.b, any(random), sigma, random, r);
        ++count[static_cast<std::size_t>(decideMode(locusOf(r), 0.01, 0.0).mode)];
      }
      std::printf("%s,%g,%g", truth.name, truth.b, sigma);
      for (const int c : count) std::printf(",%.4f", static_cast<double>(c) / runs);
      std::printf("\n");
    }
  }
  return 0;
}

int cost() {
  std::printf("window,update_ns,update_and_locus_ns,fit_of_window_ns\n");
  for (const std::size_t window : {200u, 1000u, 5000u}) {
    const auto nanoseconds = [](int calls, const auto& call) {
      double best = 1e300;
      for (int round = 0; round < 9; ++round) {
        const auto start = std::chrono::steady_clock::now();
        for (int k = 0; k < calls; ++k) call(k);
        const std::chrono::duration<double, std::nano> time =
            std::chrono::steady_clock::now() - start;
        best = std::min(best, time.count() / calls);
      }
      return best;
    };
    volatile double sink = 0.0;
    SlidingLocus sliding(window);
    Recording r;
    const auto add = [&](int k) {
      const double a = 0.1542 * k;
      sliding.add(a, 1e-6 * (k % 7), 1e-6 * (k % 5));
    };
    for (int k = 0; k < static_cast<int>(window); ++k) {
      add(k);
      r.angle.push_back(0.1542 * k);
      r.signals.insert(r.signals.end(), {1e-6 * (k % 7), 1e-6 * (k % 5), 0, 0, 0, 0});
    }
    const double update = nanoseconds(200000, add);
    const double both = nanoseconds(200000, [&](int k) {
      add(k);
      sink = sink + sliding.locus().P.real();
    });
    const double fit = nanoseconds(
        20, [&](int) { sink = sink + fitHarmonic(r.angle, r.signals, {false}).phasor[0].real(); });
    std::printf("%zu,%.1f,%.1f,%.0f\n", window, update, both, fit);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string study = argc > 1 ? argv[1] : "";
  const int runs = argc > 2 ? std::atoi(argv[2]) : 4000;
  const auto seed = static_cast<std::uint64_t>(argc > 3 ? std::atoll(argv[3]) : 1);
  if (runs > 0 && study == "accuracy") return accuracy(runs, seed);
  if (runs > 0 && study == "modes") return modes(runs, seed);
  if (study == "cost") return cost();
  std::fprintf(stderr, "usage: study_locus accuracy|modes [RUNS [SEED]] | cost\n");
  return 2;
}
