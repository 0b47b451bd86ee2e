// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Tones in a recorded channel: frequencies, amplitudes and when they step.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "assembly_cell/base/table.h"

namespace assembly_cell {

/// Channels by name, sampled together.
struct ChannelRecording {
  std::string path;
  std::string time_unit;  ///< of the file, and why
  std::vector<double> t;  ///< rising, one rate [s]; from 0 on where t began far from it
  std::vector<std::string> names;
  std::vector<std::vector<double>> values;  ///< values of each channel
};

/// Reads a table with the column t (readTimes()) and the named channels; none: all but t and
/// columns of text. Throws InputError naming file, line and column, also for a sampling rate that
/// changes.
ChannelRecording readChannels(const std::string& path, const std::vector<std::string>& channels,
                              TimeUnit unit = TimeUnit::kFound);

struct Tone {
  double frequency = 0.0, frequency_sd = 0.0;  ///< [Hz]
  std::vector<double> amplitude,
      amplitude_sd;           ///< of each segment between steps, in the channel's unit
  std::vector<double> phase;  ///< phase of the cosine at t = 0 [rad]
};

struct ToneStep {
  double time = 0.0,
         sd = 0.0;  ///< [s]; sd from the increase of the residual, at least the sampling period
  double f = 0.0;   ///< F statistic of the step
};

struct ToneAnalysis {
  std::vector<Tone> tones;      ///< by amplitude, largest first
  std::vector<ToneStep> steps;  ///< in order of time
  double offset = 0.0, offset_sd = 0.0;
  double noise = 0.0;  ///< rms of the residual
};

struct ToneOptions {
  std::size_t max_tones = 12;
  std::size_t max_steps = 4;
  double smallest = 0.003;  ///< minimum amplitude over the largest one
};

/// Peaks of the spectrum above its noise floor, then a least-squares fit of all frequencies,
/// amplitudes and phases; amplitudes and phases may step, all at once, at times found by an F test.
/// Throws InputError for fewer than 64 samples or no tone.
ToneAnalysis findTones(const std::vector<double>& t, const std::vector<double>& values,
                       const ToneOptions& options = {});

/// Origin of a tone relative to the tones of an exciter.
struct ToneOrigin {
  enum class Kind { kExciter, kHarmonic, kIntermodulation, kForeign };
  Kind kind = Kind::kForeign;
  std::vector<int> factors;  ///< integer factors of the exciter's tones, whose sum it is
};
const char* toString(ToneOrigin::Kind kind);  ///< exciter, harmonic, intermodulation, foreign

/// Combination of lowest order (sum of |factors|, at most `order`) within 4 sd of both, or within a
/// tenth of a cycle over the recording. resolution: reciprocal of the recording's duration [Hz].
ToneOrigin originOf(const Tone& tone, const std::vector<Tone>& exciter, double resolution,
                    int order = 5);

}  // namespace assembly_cell
