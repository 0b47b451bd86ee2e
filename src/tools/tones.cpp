// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Tones in recorded channels: frequencies, amplitudes, their steps, and which are the exciter's.

#include "assembly_cell/recording/tones.h"

#include <algorithm>
#include <iostream>
#include <sstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: tones RECORDING.csv [options]

Frequencies, amplitudes, and when they step, of the tones in recorded channels, each with its sd, as YAML. RECORDING.csv:
columns t (s, ms, us or ns) and the channels by name, one rate. What a tone is to the exciter:
its own, a harmonic, an intermodulation (factors of its tones by frequency, lowest order up to 5), or foreign.

  --channel NAME        only this channel; may be given several times (default: all)
  --exciter NAME        channel that drives (default: the first); its tones of 1/20 of the largest count
  --tones N             at most in a channel, the largest first (default 12)
  --steps N             at most in a channel (default 4)
  --smallest R          amplitude of a tone, of the channel's largest (default 0.003)
  --time-unit U         of t: s, ms, us or ns (default auto: by the header, by magnitude since 1970, or by spacing)
  --help                print this

Exit code: 0 ok, 2 bad input.

Example: tones forced_1.csv --exciter drive_V
)";

constexpr double kDriven = 0.05;  // of the exciter's largest: what an amplifier adds is less

std::string list(const std::vector<double>& values) {
  std::string out;
  for (const double v : values) out += (out.empty() ? "" : ", ") + yamlNumber(v);
  return "[" + out + "]";
}

double largest(const Tone& tone) {
  return *std::max_element(tone.amplitude.begin(), tone.amplitude.end());
}

void print(std::ostream& out, const std::string& name, const ToneAnalysis& a,
           const std::vector<Tone>& exciter, double resolution) {
  out << "  - channel: " << yamlQuoted(name) << "\n    offset: " << yamlNumber(a.offset)
      << "\n    offset_sd: " << yamlNumber(a.offset_sd) << "\n    noise: " << yamlNumber(a.noise)
      << "\n    steps:" << (a.steps.empty() ? " []" : "") << "\n";
  for (const ToneStep& step : a.steps) {
    out << "      - {time: " << yamlNumber(step.time) << ", sd: " << yamlNumber(step.sd)
        << ", f: " << yamlNumber(step.f) << "}\n";
  }
  out << "    tones:\n";
  for (const Tone& tone : a.tones) {
    const ToneOrigin origin = originOf(tone, exciter, resolution);
    std::string factors;
    for (const int f : origin.factors) factors += (factors.empty() ? "" : ", ") + std::to_string(f);
    out << "      - {frequency: " << yamlNumber(tone.frequency)
        << ", frequency_sd: " << yamlNumber(tone.frequency_sd)
        << ", amplitude: " << list(tone.amplitude) << ", amplitude_sd: " << list(tone.amplitude_sd)
        << ", phase: " << list(tone.phase) << ", origin: " << toString(origin.kind)
        << ", factors: [" << factors << "]}\n";
  }
}

int run(const std::vector<std::string>& arguments) {
  std::string path, exciter;
  std::vector<std::string> channels;
  ToneOptions options;
  TimeUnit unit = TimeUnit::kFound;
  OptionParser parser(kHelp);
  parser.file("recording", path);
  parser.texts("--channel", channels);
  parser.text("--exciter", exciter);
  parser.integer("--tones", options.max_tones, 1, 40);
  parser.integer("--steps", options.max_steps, 0, 20);
  parser.number("--smallest", options.smallest, 0.0, 1.0);
  parser.choice("--time-unit", unit, kTimeUnitChoices);
  if (!parser.parse(arguments)) return 0;
  // the exciter first: the others' tones are found with it
  if (!exciter.empty()) {
    channels.erase(std::remove(channels.begin(), channels.end(), exciter), channels.end());
  }
  ChannelRecording recording = readChannels(path, channels, unit);
  if (!exciter.empty()) {
    const ChannelRecording driven = readChannels(path, {exciter}, unit);
    const auto at = std::find(recording.names.begin(), recording.names.end(), driven.names[0]);
    if (at != recording.names.end()) {
      recording.values.erase(recording.values.begin() + (at - recording.names.begin()));
      recording.names.erase(at);
    }
    recording.names.insert(recording.names.begin(), driven.names[0]);
    recording.values.insert(recording.values.begin(), driven.values[0]);
  }
  const double duration = recording.t.back() - recording.t.front();
  std::vector<Tone> driving;
  std::ostringstream out;  // nothing is printed of what ends in a refusal
  out << "samples: " << recording.t.size() << "\nduration: " << yamlNumber(duration)
      << "\ntime_unit: " << yamlQuoted(recording.time_unit) << "\nchannels:\n";
  for (std::size_t c = 0; c < recording.names.size(); ++c) {
    ToneAnalysis analysis;
    try {
      analysis = findTones(recording.t, recording.values[c], options);
    } catch (const InputError& error) {
      throw InputError(path + ": channel " + recording.names[c] + ": " + error.what());
    }
    for (const Tone& tone : analysis.tones) {
      if (c == 0 && largest(tone) >= kDriven * largest(analysis.tones[0])) driving.push_back(tone);
    }
    if (c == 0) {
      std::sort(driving.begin(), driving.end(),
                [](const Tone& a, const Tone& b) { return a.frequency < b.frequency; });
    }
    print(out, recording.names[c], analysis, driving, 1.0 / duration);
  }
  std::cout << out.str();
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return assembly_cell::runTool("tones", argc, argv, run); }
