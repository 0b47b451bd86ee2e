// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Studies of the locus estimator, as CSV on standard output. study_locus accuracy: rms error of the
// direction against the Cramér–Rao bound over the noise, beside principal components and a direct
// ellipse fit. study_locus modes: how often each mode is decided for each true one. study_locus
// alarms: how often a true mode is refused, beside the stated rate. study_locus settling: error of
// the direction after a step of the contact, over the window. study_locus bias: the direction of
// the simulated cell, without noise, by inversion and by the textbook. study_locus friction: of the
// simulated cell. study_locus cost: one update of the sliding estimate, beside a fit of its window.

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

#include "assembly_cell/locus/half_turn.h"
#include "assembly_cell/locus/harmonic_fit.h"
#include "assembly_cell/locus/sliding_friction.h"
#include "assembly_cell/locus/sliding_locus.h"
#include "support/simulated_reading.h"

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
        // with a known phase of the exciter, arg N determines the direction
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

int alarms(int runs, std::uint64_t seed) {
  std::printf("true,stated,none,segment,ellipse,circle,undecided,refused_over_stated\n");
  struct Truth {
    const char* name;
    double a, b;
    LocusMode mode;
  };
  for (const Truth& truth :
       {Truth{"none", 0, 0, LocusMode::kNone}, Truth{"segment", 1, 0, LocusMode::kSegment},
        Truth{"circle", 1, 1, LocusMode::kCircle}}) {
    for (const double rate : {.005, .01, .05}) {
      std::mt19937_64 random(seed);
      std::uniform_real_distribution<double> any(0.0, M_PI);
      std::array<int, 5> count{};
      Recording r;
      // enough of the refused ones
      const int enough = static_cast<int>(runs * 0.05 / rate);
      for (int run = 0; run < enough; ++run) {
        record(truth.a, truth.b, any(random), 0.3, random, r);
        ++count[static_cast<std::size_t>(decideMode(locusOf(r), rate, 0.0).mode)];
      }
      std::printf("%s,%g", truth.name, rate);
      for (const int c : count) std::printf(",%.5f", static_cast<double>(c) / enough);
      const double refused =
          1.0 - static_cast<double>(count[static_cast<std::size_t>(truth.mode)]) / enough;
      std::printf(",%.3f\n", refused / rate);
    }
  }
  return 0;
}

// the contact turns by 40° at 0; error of the direction by arg N
int settling() {
  std::printf("periods,samples_after_step_over_window,error_over_step\n");
  const double turn = 40 * kDegree;
  for (const std::size_t periods : {1u, 2u, 5u, 10u}) {
    const std::size_t window = 40 * periods;
    SlidingLocus sliding(window);
    for (std::size_t k = 0; k < 4 * window; ++k) {
      const double a = kStep * static_cast<double>(k);
      const Complex z = std::polar(0.3, a) + std::polar(1.0, (k < 2 * window ? 0 : 2 * turn) - a);
      sliding.add(a, z.real(), z.imag());
      if (k + 1 < 2 * window || (k + 1) % (window / 20) != 0 || k >= 3 * window + window / 10)
        continue;
      const double error = std::abs(std::arg(sliding.locus().N * std::polar(1.0, -2 * turn)) / 2);
      std::printf("%zu,%.3f,%.6f\n", periods,
                  static_cast<double>(k + 1 - 2 * window) / static_cast<double>(window),
                  error / turn);
    }
  }
  return 0;
}

// without noise: what inversion and textbook leave of the true direction
int bias() {
  std::printf(
      "contact,law,friction,frequency,tilt_deg,lean,closed,inversion_deg,misfit,without_tilt_deg,"
      "textbook_phase_deg,textbook_shape_deg,half_turn_right\n");
  for (const bool rim : {false, true}) {
    for (const char* law : {"viscous", "rigid"}) {
      for (const double friction : {0.5, 0.2}) {
        for (const double frequency : {450.0, 500.0, 770.0}) {
          for (const double tilt : {1.0, 2.0, 4.0, 8.0}) {
            for (const double lean : {0.2, 2.5, 4.4}) {
              SimulatedReadingOptions o;
              o.overrides = {std::string("contact.law=") + law,
                             "friction.static=" + std::to_string(friction),
                             "friction.sliding=" + std::to_string(friction)};
              o.lean = lean;
              o.tilt = tilt * kDegree;
              o.frequency = frequency;
              o.offset = rim ? Eigen::Vector2d(-0.006 * std::cos(lean + 0.9),
                                               -0.006 * std::sin(lean + 0.9))
                             : Eigen::Vector2d(0.03 * std::cos(lean), 0.03 * std::sin(lean));
              const SimulatedReading r = readSimulated(o);
              if (r.closed.size() != 1) continue;
              const auto error = [&](double alpha, double modulo) {
                return std::remainder(alpha - r.contact, modulo) / kDegree;
              };
              const DirectionEstimate e =
                  contactDirection(r.scenario.mechanism, r.point, r.locus, LocusAxes::kSensor);
              OperatingPoint upright = r.point;
              upright.tilt.setZero();
              upright.sensor_tilt.setZero();
              upright.rolling = false;
              const DirectionEstimate u =
                  contactDirection(r.scenario.mechanism, upright, r.locus, LocusAxes::kSensor);
              const DirectionEstimate h = resolveHalfTurn(
                  r.scenario.mechanism, upright,
                  halfTurnEvidence(r.scenario.mechanism, frequency, r.fit), u, LocusAxes::kSensor);
              std::printf(
                  "%s,%s,%g,%g,%g,%g,1,%.4f,%.5f,%.3f,%.3f,%.3f,%d\n", rim ? "rim" : "plane", law,
                  friction, frequency, tilt, lean, error(e.alpha, M_PI), e.misfit,
                  error(u.alpha, M_PI), error(0.5 * std::arg(-r.locus.N), M_PI),
                  error(r.locus.orientation(), M_PI / 2), std::abs(error(h.alpha, 2 * M_PI)) < 90);
            }
          }
        }
      }
    }
  }
  return 0;
}

int friction() {
  std::printf("true,frequency,amplitude,press,found,sd,across,textbook\n");
  for (const double mu : {0.1, 0.2, 0.35}) {
    for (const double frequency : {500.0, 770.0}) {
      for (const double amplitude : {8.0, 15.0, 30.0}) {
        SimulatedReadingOptions o;
        o.lean = 0.7;
        o.tilt = 0.02;
        o.offset = 0.03 * Eigen::Vector2d(std::cos(o.lean), std::sin(o.lean));
        o.frequency = frequency;
        o.amplitude = amplitude;
        o.press = 8.0;
        o.overrides = {"friction.static=" + std::to_string(mu),
                       "friction.sliding=" + std::to_string(mu)};
        const SimulatedReading r = readSimulated(o);
        const SlidingFriction f = slidingFriction(r.scenario.mechanism, r.point, r.fit);
        std::printf("%g,%g,%g,%.2f,%.4f,%.4f,%.3f,%.3f\n", mu, frequency, amplitude, r.point.press,
                    f.coefficient, f.sd, f.across,
                    slidingFriction(r.locus, amplitude, r.point.press).coefficient);
      }
    }
  }
  return 0;
}

int cost() {
  std::printf("signals,window,update_ns,update_and_result_ns,fit_of_window_ns\n");
  for (const std::size_t window : {200u, 1000u, 5000u}) {
    // short rounds: the least disturbed one counts, whatever else the machine does
    const auto nanoseconds = [](int calls, const auto& call) {
      double best = 1e300;
      for (int round = 0; round < 400; ++round) {
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
    const double update = nanoseconds(2000, add);
    const double both = nanoseconds(2000, [&](int k) {
      add(k);
      sink = sink + sliding.locus().P.real();
    });
    const double fit = nanoseconds(
        1, [&](int) { sink = sink + fitHarmonic(r.angle, r.signals, {false}).phasor[0].real(); });
    std::printf("2,%zu,%.1f,%.1f,%.0f\n", window, update, both, fit);

    // all six, with drift, as locus_estimator streams them
    SlidingFit<6> displacement(window, true);
    const auto add_six = [&](int k) {
      Vector6 d;
      for (int i = 0; i < 6; ++i) d[i] = 1e-6 * (k % (5 + i));
      displacement.add(0.1542 * k, d);
    };
    for (int k = 0; k < static_cast<int>(window); ++k) add_six(k);
    const double update_six = nanoseconds(2000, add_six);
    const double both_six = nanoseconds(1000, [&](int k) {
      add_six(k);
      sink = sink + displacement.fit().phasor[0].real();
    });
    const double fit_six = nanoseconds(
        1, [&](int) { sink = sink + fitHarmonic(r.angle, r.signals).phasor[0].real(); });
    std::printf("6,%zu,%.1f,%.1f,%.0f\n", window, update_six, both_six, fit_six);
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
  if (runs > 0 && study == "alarms") return alarms(runs, seed);
  if (study == "settling") return settling();
  if (study == "bias") return bias();
  if (study == "friction") return friction();
  if (study == "cost") return cost();
  std::fprintf(stderr,
               "usage: study_locus accuracy|modes|alarms [RUNS [SEED]] | settling | bias | "
               "friction | cost\n");
  return 2;
}
