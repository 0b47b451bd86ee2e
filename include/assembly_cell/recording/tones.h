// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Tones in a recorded channel: frequencies, amplitudes and when they step.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace assembly_cell {

/// Channels by name, sampled together.
struct ChannelRecording {
  std::string path;
  std::vector<double> t;  ///< rising, one rate [s]
  std::vector<std::string> names;
  std::vector<std::vector<double>> values;  ///< of each channel
};

/// A table with the column t (or time) and the named channels; none named: all but t. Throws
/// InputError naming file, line and column, and where the rate changes.
ChannelRecording readChannels(const std::string& path, const std::vector<std::string>& channels);

struct Tone {
  double frequency = 0.0, frequency_sd = 0.0;   ///< [Hz]
  std::vector<double> amplitude, amplitude_sd;  ///< between steps, in the channel's unit
  std::vector<double> phase;                    ///< of the cosine at t = 0 [rad]
};

struct ToneStep {
  double time = 0.0, sd = 0.0;  ///< [s]; sd from the misfit's rise, at least a sample's spacing
  double f = 0.0;               ///< F statistic against no step
};

struct ToneAnalysis {
  std::vector<Tone> tones;      ///< by amplitude, largest first
  std::vector<ToneStep> steps;  ///< in order of time
  double offset = 0.0, offset_sd = 0.0;
  double noise = 0.0;  ///< rms of what is left
};

struct ToneOptions {
  std::size_t most = 12;  ///< tones
  std::size_t most_steps = 4;
  double smallest = 0.003;  ///< amplitude, of the largest
};

/// The peaks of the spectrum that stand above its floor, then all frequencies, amplitudes and
/// phases together by least squares; amplitudes and phases may step, all at once, at times that an
/// F test finds. Throws InputError for fewer than 64 samples or no tone.
ToneAnalysis findTones(const std::vector<double>& t, const std::vector<double>& values,
                       const ToneOptions& options = {});

/// What a tone is to an exciter with these tones.
struct ToneOrigin {
  enum class Kind { kExciter, kHarmonic, kIntermodulation, kForeign };
  Kind kind = Kind::kForeign;
  std::vector<int> factors;  ///< of the exciter's tones, whose sum it is
};
const char* toString(ToneOrigin::Kind kind);  ///< exciter, harmonic, intermodulation, foreign

/// The combination of lowest order (sum of |factors|, at most `order`) within 4 sd of both, or a
/// tenth of a cycle over the recording, whose inverse duration is `resolution` [Hz].
ToneOrigin originOf(const Tone& tone, const std::vector<Tone>& exciter, double resolution,
                    int order = 5);

}  // namespace assembly_cell
