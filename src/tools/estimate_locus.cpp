// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Locus of a recorded planar motion under a rotating exciter: ellipse, mode, contact direction.

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/locus/harmonic_fit.h"
#include "assembly_cell/scene/csv_text.h"
#include "assembly_cell/scene/input_error.h"
#include "assembly_cell/scene/scenario.h"
#include "assembly_cell/scene/yaml_text.h"

namespace {

using assembly_cell::InputError;
using assembly_cell::Locus;
using assembly_cell::LocusMode;
using assembly_cell::ModeDecision;
using assembly_cell::yamlNumber;

constexpr const char* kHelp =
    R"(Usage: estimate_locus SAMPLES.csv --frequency W [options]

Fits the locus of a planar motion under a rotating exciter, decides its mode and prints the contact's
direction as YAML. SAMPLES.csv: one header row with the columns t, x, y (others are ignored); t in s, rising;
x and y of the peg's centre of mass in m. The window is the whole file, at least one period of the exciter.

  --frequency W         of the exciter [rad/s]; its phase is zero at t = 0
  --direction D         of the exciter: 1 anticlockwise from above (default), -1 clockwise
  --drift               fit a linear drift besides the offset
  --harmonics K         fit multiples of the exciter's frequency up to the K-th, 1 to 4 (default 1)
  --robust              Huber weights against outliers; give --drift and --harmonics too where they occur
  --fit-frequency R     W is not exact: find it within R rad/s on both sides
  --acceleration        x and y are accelerations [m/s2]: P, N and the noise are divided by -W^2 (no integration)
  --false-alarm A       rate at which a true mode is refused (default 0.01)
  --indifference E      a minor axis, or a counter-rotating part, below this ratio counts as none (default 0.05)
  --mechanism FILE      scenario of the mechanism: hypotheses by inverting its linear model with one point held
  --amplitude F         of the exciter [N], for --mechanism (default: exciter.amplitude of the scenario)
  --press N             contact force [N], for --mechanism (default: the peg's weight)
  --help                print this

An undefined result is null: the orientation where there is no movement or a circle, and the hypotheses with it;
with --mechanism, the hypotheses where no direction of a single contact explains the locus within 20 %.
Exit code: 0 ok, 2 bad input.

Example: estimate_locus samples.csv --frequency 770 --mechanism config/scenarios/cell.yaml --amplitude 1 --press 12
)";

constexpr double kMisfitLimit = 0.2;  // of a single contact's model

struct Options {
  std::string samples, mechanism;
  std::optional<double> frequency, amplitude, press, frequency_range;
  int direction = 1;
  assembly_cell::HarmonicOptions fit{false, 1, false};
  bool acceleration = false;
  double false_alarm = 0.01;
  double indifference = 0.05;
  bool help = false;
};

struct Samples {
  std::vector<double> t, signals;  // signals: 6 × n, x and y first
};

Options parseOptions(const std::vector<std::string>& arguments) {
  Options options;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string& name = arguments[i];
    if (name == "--help" || name == "-h") {
      options.help = true;
      return options;
    }
    if (name == "--drift" || name == "--robust" || name == "--acceleration") {
      (name == "--drift"    ? options.fit.drift
       : name == "--robust" ? options.fit.robust
                            : options.acceleration) = true;
      continue;
    }
    if (name.rfind("-", 0) != 0) {
      if (!options.samples.empty()) {
        throw InputError("argument: value " + name + ": give one file of samples, see --help");
      }
      options.samples = name;
      continue;
    }
    constexpr std::array<const char*, 9> kNames = {
        "--frequency", "--direction", "--false-alarm", "--indifference", "--mechanism",
        "--amplitude", "--press",     "--harmonics",   "--fit-frequency"};
    if (std::find(kNames.begin(), kNames.end(), name) == kNames.end()) {
      throw InputError("argument: value " + name + ": unknown option, see --help");
    }
    if (i + 1 == arguments.size()) throw InputError(name + ": value missing: see --help");
    const std::string& text = arguments[++i];
    if (name == "--mechanism") {
      if (text.empty()) throw InputError(name + ": value empty: give a scenario file");
      options.mechanism = text;
      continue;
    }
    const auto number = [&](bool good, double value, const char* remedy) {
      if (!good) throw InputError(name + ": value " + text + ": " + remedy);
      return value;
    };
    double value = std::nan("");
    assembly_cell::parseNumber(text, value);
    if (name == "--frequency") {
      options.frequency = number(value > 0.0, value, "give a positive number of rad/s");
    } else if (name == "--fit-frequency") {
      options.frequency_range = number(value > 0.0, value, "give a positive number of rad/s");
    } else if (name == "--harmonics") {
      number(value == std::floor(value) && value >= 1.0 && value <= 4.0, value,
             "give a whole number from 1 to 4");
      options.fit.harmonics = static_cast<int>(value);
    } else if (name == "--direction") {
      number(value == 1.0 || value == -1.0, value, "give 1 or -1");
      options.direction = value > 0.0 ? 1 : -1;
    } else if (name == "--false-alarm") {
      options.false_alarm = number(value > 0.0 && value < 0.5, value, "give a rate in (0, 0.5)");
    } else if (name == "--indifference") {
      options.indifference = number(value >= 0.0 && value < 1.0, value, "give a ratio in [0, 1)");
    } else if (name == "--amplitude") {
      options.amplitude = number(value > 0.0, value, "give a positive number of N");
    } else {
      options.press = number(value >= 0.0, value, "give a number of N, at least 0");
    }
  }
  if (options.samples.empty()) {
    throw InputError("argument: value missing: give a file of samples, see --help");
  }
  if (!options.frequency) {
    throw InputError("--frequency: value missing: give the exciter's frequency in rad/s");
  }
  if (options.mechanism.empty() && (options.amplitude || options.press)) {
    throw InputError("--mechanism: value missing: --amplitude and --press need it");
  }
  return options;
}

std::vector<std::string> cellsOf(const std::string& line) {
  const auto cells = assembly_cell::csvCells(line);
  return {cells.begin(), cells.end()};
}

Samples readSamples(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  if (!file || !std::getline(file, line)) {
    throw InputError(path + ": file missing, unreadable or empty: give a CSV file with t,x,y");
  }
  if (line.rfind("\xEF\xBB\xBF", 0) == 0) line.erase(0, 3);

  // columns by name
  const std::vector<std::string> header = cellsOf(line);
  constexpr std::array<const char*, 3> kColumns = {"t", "x", "y"};
  std::array<std::size_t, 3> column{};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto count = std::count(header.begin(), header.end(), kColumns[c]);
    if (count != 1) {
      throw InputError(path + ":1: column " + kColumns[c] +
                       (count == 0 ? " is missing" : " is there twice") +
                       ": give the header t,x,y");
    }
    column[c] = static_cast<std::size_t>(std::find(header.begin(), header.end(), kColumns[c]) -
                                         header.begin());
  }

  Samples samples;
  for (std::size_t row = 2; std::getline(file, line); ++row) {
    const std::string place = path + ":" + std::to_string(row) + ": column ";
    const std::vector<std::string> cells = cellsOf(line);
    if (cells.size() == 1 && cells[0].empty()) continue;
    std::array<double, 3> values{};
    for (std::size_t c = 0; c < 3; ++c) {
      if (column[c] >= cells.size()) {
        throw InputError(place + kColumns[c] + " is missing: give " +
                         std::to_string(header.size()) + " columns as in the header");
      }
      if (!assembly_cell::parseNumber(cells[column[c]], values[c])) {
        throw InputError(place + kColumns[c] + " is '" + cells[column[c]] +
                         "': give a finite number");
      }
    }
    if (cells.size() > header.size()) {
      throw InputError(place + std::to_string(header.size() + 1) + " is '" + cells[header.size()] +
                       "': give " + std::to_string(header.size()) + " columns as in the header");
    }
    if (!samples.t.empty() && values[0] <= samples.t.back()) {
      throw InputError(place + "t is '" + cells[column[0]] + "': give times that rise");
    }
    samples.t.push_back(values[0]);
    samples.signals.insert(samples.signals.end(), {values[1], values[2], 0.0, 0.0, 0.0, 0.0});
  }
  return samples;
}

struct Hypothesis {
  double direction, weight;
};

std::vector<Hypothesis> hypothesesOf(const Options& options, const Locus& locus) {
  if (options.mechanism.empty()) {
    std::vector<Hypothesis> out;
    for (int k = 0; k < 4; ++k) out.push_back({locus.orientation() + k * M_PI / 2.0, 0.25});
    return out;
  }
  const assembly_cell::Scenario mechanism = assembly_cell::loadScenario(options.mechanism);
  assembly_cell::OperatingPoint point;
  point.frequency = *options.frequency;
  point.direction = options.direction;
  point.amplitude = options.amplitude.value_or(mechanism.exciter.amplitude);
  point.press = options.press.value_or(mechanism.peg.mass * mechanism.gravity);
  if (!(point.amplitude > 0.0)) {
    throw InputError("--amplitude: value missing: the scenario's exciter.amplitude is 0");
  }
  const auto direction = assembly_cell::contactDirection(mechanism, point, locus);
  std::cerr << "estimate_locus: a single contact leaves a misfit of " << direction.misfit
            << " of the locus\n";
  if (!(direction.misfit <= kMisfitLimit)) return {};
  return {{direction.alpha, direction.weight}, {direction.alpha_opposite, 1.0 - direction.weight}};
}

void print(const Options& options, double frequency_sd, const Locus& locus,
           const ModeDecision& decision, const std::vector<Hypothesis>& hypotheses, bool oriented) {
  const auto line = [](const char* key, const std::string& value) {
    std::cout << key << ": " << value << "\n";
  };
  const auto complex = [](std::complex<double> z) {
    return "[" + yamlNumber(z.real()) + ", " + yamlNumber(z.imag()) + "]";
  };
  line("mode", assembly_cell::toString(decision.mode));
  std::string probabilities;
  for (std::size_t m = 0; m < decision.probabilities.size(); ++m) {
    probabilities += (m == 0 ? "{" : ", ") +
                     std::string(assembly_cell::toString(static_cast<LocusMode>(m))) + ": " +
                     yamlNumber(decision.probabilities[m]);
  }
  line("probabilities", probabilities + "}");
  line("P", complex(locus.P));
  line("N", complex(locus.N));
  line("semi_major", yamlNumber(locus.semiMajor()));
  line("semi_minor", yamlNumber(locus.semiMinor()));
  line("orientation", oriented ? yamlNumber(locus.orientation()) : "null");
  line("orientation_sd", oriented ? yamlNumber(locus.orientationSd()) : "null");
  line("frequency", yamlNumber(*options.frequency));
  if (options.frequency_range) line("frequency_sd", yamlNumber(frequency_sd));
  line("noise_sd", yamlNumber(locus.sigma));
  // of Re and Im of P and N each; all four are independent over whole periods
  line("variance", yamlNumber(locus.variance()));
  line("semi_axes_sd", yamlNumber(std::sqrt(2.0 * locus.variance())));
  if (hypotheses.empty()) {
    line("hypotheses", "null");
    return;
  }
  std::cout << "hypotheses:\n";
  for (const Hypothesis& h : hypotheses) {
    std::cout << "  - {direction: " << yamlNumber(h.direction)
              << ", weight: " << yamlNumber(h.weight) << "}\n";
  }
}

int run(const std::vector<std::string>& arguments) {
  Options options = parseOptions(arguments);
  if (options.help) {
    std::cout << kHelp;
    return 0;
  }
  const Samples samples = readSamples(options.samples);
  double frequency_sd = 0.0;
  assembly_cell::HarmonicFit fit;
  try {
    if (options.frequency_range) {
      const assembly_cell::FrequencyFit found = assembly_cell::fitFrequency(
          samples.t, samples.signals, *options.frequency, *options.frequency_range, options.fit);
      options.frequency = found.frequency;
      frequency_sd = found.sd;
    }
    std::vector<double> angle;
    angle.reserve(samples.t.size());
    for (const double t : samples.t) angle.push_back(options.direction * *options.frequency * t);
    fit = assembly_cell::fitHarmonic(angle, samples.signals, options.fit);
  } catch (const InputError& error) {
    throw InputError(options.samples + ": " + error.what());
  }
  // a steady vibration's displacement is its acceleration over −W²
  const double unit = options.acceleration ? -1.0 / (*options.frequency * *options.frequency) : 1.0;
  const double sigma = std::abs(unit) * std::sqrt(0.5 * (fit.noise(0, 0) + fit.noise(1, 1)));
  const Locus locus = assembly_cell::locusFromPhasors(unit * fit.phasor[0], unit * fit.phasor[1],
                                                      sigma, fit.samples, fit.inflation);
  const ModeDecision decision =
      assembly_cell::decideMode(locus, options.false_alarm, options.indifference);

  // neither no movement nor a circle has a direction
  const bool oriented = decision.mode != LocusMode::kNone && decision.mode != LocusMode::kCircle &&
                        locus.orientationSd() < assembly_cell::kUnknownOrientationSd;
  print(options, frequency_sd, locus, decision,
        oriented ? hypothesesOf(options, locus) : std::vector<Hypothesis>{}, oriented);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run({argv + 1, argv + argc});
  } catch (const InputError& error) {
    std::cerr << "estimate_locus: " << error.what() << "\n";
    return 2;
  }
}
