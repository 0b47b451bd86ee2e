// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/geometry/spatial.h"

namespace assembly_cell {

/// Minimum for a locus: twice the four coefficients of a signal.
inline constexpr std::size_t kMinLocusSamples = 8;

/// Phasors of up to six signals x(t) = Re(U e^{ia(t)}) + offset + drift, a the exciter's angle, by
/// linear least squares on one shared design matrix.
struct HarmonicFit {
  Eigen::Matrix<std::complex<double>, 6, 1> phasor;  ///< U, in the signal's unit
  Vector6 offset = Vector6::Zero();                  ///< at the window's centre
  /// Covariance of one sample's white noise; of a robust fit what a plain one would need for the
  /// same accuracy.
  Matrix6 noise = Matrix6::Zero();
  std::size_t samples = 0;
  double inflation = 1.0;  ///< variance of P, N relative to σ²/n (window not whole periods)
  /// Covariance of the coefficients of cos a and sin a, 2/n each over whole periods, for unit
  /// noise.
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
};

/// Columns of a fit in addition to the exciter's own angle and an offset.
struct HarmonicOptions {
  bool drift = true;    ///< a column that is linear in the angle
  int harmonics = 1;    ///< fitted multiples of the angle, 1 to 4; the first alone is returned
  bool robust = false;  ///< Huber weights by the joint residual of signals 0 and 1 (c = 1.7)
};

/// angle: of the exciting force at each sample, direction·(frequency·t + phase) [rad]; it rises for
/// an anticlockwise exciter and falls for a clockwise one, so P always turns with the exciter.
/// signals: 6 × n, sample after sample. sd: noise of each sample, all signals alike; empty: the
/// same for all. Only its ratios count: the fit's variance is that of a sample of mean weight
/// 1/sd². Throws InputError for fewer than 8 samples, sizes that disagree, non-finite values, an sd
/// that is not positive, a window shorter than one period, or too few samples a period: two or
/// fewer for each harmonic.
HarmonicFit fitHarmonic(const std::vector<double>& angle, const std::vector<double>& signals,
                        const HarmonicOptions& options = {}, const std::vector<double>& sd = {});

/// Frequency of signals 0 and 1 by least squares together with all that `options` fit.
struct FrequencyFit {
  double frequency = 0.0;  ///< [rad/s]
  double sd = 0.0;         ///< Cramér–Rao with the noise that the fit leaves [rad/s]
};
/// t: times of the samples [s], rising. Looks within `range` on both sides of `frequency` [rad/s],
/// then refines by Gauss–Newton. Throws InputError as fitHarmonic, and where the best frequency
/// lies at the end of the range.
FrequencyFit fitFrequency(const std::vector<double>& t, const std::vector<double>& signals,
                          double frequency, double range, const HarmonicOptions& options = {},
                          const std::vector<double>& sd = {});

/// Counter-rotating amplitudes of the planar locus Z = X + iY = P e^{ia} + N e^{−ia}, a the
/// exciter's angle (thesis chapter 9; docs/theory/thesis.md, "Locus").
struct Locus {
  std::complex<double> P, N;  ///< [m]
  double sigma = 0.0;         ///< noise of one axis, one sample [m]
  std::size_t samples = 0;
  double inflation = 1.0;

  double semiMajor() const;      ///< |P| + |N|
  double semiMinor() const;      ///< |P| − |N|, negative: against the exciter
  double orientation() const;    ///< (arg P + arg N)/2 mod π, major axis [rad]; NaN if P or N is 0
  double orientationSd() const;  ///< Cramér–Rao, shape only [rad]; infinite if P or N is 0
  double variance() const;       ///< of Re and Im of P and N each: inflation σ²/n [m²]
};
Locus locusFromPhasors(std::complex<double> x, std::complex<double> y, double sigma,
                       std::size_t samples, double inflation);
/// Of signals 0 and 1.
Locus locusFromFit(const HarmonicFit& fit);

/// Of signals 0 and 1 of a fit: the whole covariance, which `Locus` keeps the mean of.
struct LocusCovariance {
  Eigen::Matrix4d amplitudes;  ///< Re P, Im P, Re N, Im N [m²]; diagonal over whole periods
  /// Semi-major and semi-minor axis [m], orientation [rad], phase (arg P − arg N)/2 of the motion
  /// along the ellipse [rad], to first order; NaN where P or N is 0.
  Eigen::Matrix4d ellipse;
};
LocusCovariance locusCovariance(const HarmonicFit& fit);

/// Sd of an unknown direction mod π, π/√12 [rad]: an orientation with a larger
/// sd is undefined.
constexpr double kUnknownOrientationSd = 0.90689968211710892;

enum class LocusMode { kNone = 0, kSegment = 1, kEllipse = 2, kCircle = 3, kUndecided = 4 };
const char* toString(LocusMode mode);

struct ModeDecision {
  LocusMode mode = LocusMode::kUndecided;
  std::array<double, 5> probabilities{};  ///< in the order of LocusMode, sum 1
};

/// F tests with the given false-alarm rate and an indifference zone `eps` (0: exact tests): a minor
/// axis, or N, below eps of the other counts as none. Probabilities are BIC weights; half of them
/// goes to undecided where tests and BIC disagree. Throws InputError unless 0 < false_alarm < 0.5,
/// 0 ≤ indifference < 1 and there are at least 8 samples.
/// `previous` gives hysteresis: none, segment and circle, once decided, are kept until their own
/// test refuses them at a tenth of the rate, and an ellipse until another passes at ten times the
/// rate (at most 0.5).
ModeDecision decideMode(const Locus& locus, double false_alarm = 0.01, double indifference = 0.05,
                        std::optional<LocusMode> previous = {});

}  // namespace assembly_cell
