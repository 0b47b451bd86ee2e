// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Locus of a recorded planar motion under a rotating exciter: ellipse, mode, contact direction. And
// what a reading would be worth, before it is taken.

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <iterator>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/locus/integrate_twice.h"
#include "assembly_cell/locus/operating_point.h"
#include "assembly_cell/locus/reading.h"
#include "assembly_cell/locus/samples_file.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace {

using namespace assembly_cell;

constexpr const char* kHelp =
    R"(Usage: estimate_locus SAMPLES.csv --frequency W [options]
       estimate_locus RECORDING.bag [options]
       estimate_locus --plan --mechanism FILE --amplitude F [options]

Fits the locus of a planar motion under a rotating exciter, decides its mode and prints the contact's
direction as YAML. SAMPLES.csv: one header row with the columns t, x, y (others are ignored); t rising;
x and y of the peg's centre of mass in m; uncertainty, if there: sd of a sample's x and y, in any unit. Or ax, ay: accelerations in m/s2; or
x, y, z, rx, ry, rz: displacement of the coupling as measured by sensor_b. The window is the whole file, at least one
period of the exciter. RECORDING.bag: displacement_samples or accelerometers, with the exciter's messages.

  --frequency W         of the exciter [rad/s]; its phase is zero at t = 0; default: that of the bag
  --direction D         of the exciter: 1 anticlockwise from above (default), -1 clockwise
  --topic T             of a bag with several
  --time-unit U         of t: s, ms, us or ns (default auto: that of the header, such as t_ms, or s)
  --start S             leave out what is earlier than S after the first sample [s]
  --duration D          of the window [s]
  --drift               fit a linear drift besides the offset
  --harmonics K         fit multiples of the exciter's frequency up to the K-th, 1 to 4 (default 1)
  --robust              Huber weights against outliers; give --drift and --harmonics too where they occur
  --fit-frequency R     W is not exact: find it within R rad/s on both sides
  --acceleration        x and y are accelerations [m/s2]
  --trace FILE          write the displacement in the plane as t,x,y; accelerations integrated twice
  --false-alarm A       rate at which a true mode is refused (default 0.01)
  --indifference E      a minor axis, or a counter-rotating part, below this ratio counts as none (default 0.05)
  --mechanism FILE      scenario of the mechanism: hypotheses by inverting its linear model with one point held
  --amplitude F         of the exciter [N] (default: that of the bag, or exciter.amplitude of the scenario)
  --press N             contact force [N] (default: of a displacement its mean, else the peg's weight)
  --plan                no samples: choose the frequency, or evaluate --frequency, and forecast a reading's worth
  --bits B, --noise V   of the sensor's converter and channels, for --plan (default 16, 0.0005)
  --rate HZ             of the samples, for --plan (default 5000); its window is --duration (default 0.2)
  --direction-limit S   --plan refuses where the direction's sd would be larger [rad] (default 0.1)
  --help                print this

Accelerations are integrated twice in the frequency domain: at the exciter's line, P, N and the noise over -W^2.
An undefined result is null: the orientation where there is no movement or a circle, and the hypotheses with it;
with --mechanism, the hypotheses where no direction of a single contact explains the locus within 20 %.
Exit code: 0 ok, 1 --plan refuses, 2 bad input.

Example: estimate_locus samples.csv --frequency 770 --mechanism config/scenarios/cell.yaml --amplitude 1 --press 12
)";

struct Options {
  std::string samples, mechanism, topic, trace;
  std::optional<double> frequency, amplitude, press, frequency_range, start, duration;
  std::optional<int> direction;
  TimeUnit time_unit = TimeUnit::kFound;
  HarmonicOptions fit{false, 1, false};
  bool acceleration = false, plan = false;
  double false_alarm = 0.01, indifference = 0.05;
  double bits = 16, noise = 0.5e-3, rate = 5000, direction_limit = 0.1;
};

// false after --help
bool parseOptions(const std::vector<std::string>& arguments, Options& o) {
  OptionParser parser(kHelp);
  parser.file("file of samples", o.samples, false);
  parser.text("--mechanism", o.mechanism);
  parser.text("--topic", o.topic);
  parser.choice("--time-unit", o.time_unit, kTimeUnitChoices);
  parser.text("--trace", o.trace);
  parser.flag("--drift", o.fit.drift);
  parser.flag("--robust", o.fit.robust);
  parser.flag("--acceleration", o.acceleration);
  parser.flag("--plan", o.plan);
  const auto positive = [](double v) { return v > 0.0; };
  const auto not_negative = [](double v) { return v >= 0.0; };
  parser.number("--frequency", o.frequency, positive, "give a positive number of rad/s");
  parser.number("--fit-frequency", o.frequency_range, positive, "give a positive number of rad/s");
  parser.integer("--harmonics", o.fit.harmonics, 1, 4);
  parser.choice("--direction", o.direction, {{"1", 1}, {"-1", -1}});
  parser.number(
      "--false-alarm", o.false_alarm, [](double v) { return v > 0.0 && v < 0.5; },
      "give a rate in (0, 0.5)");
  parser.number(
      "--indifference", o.indifference, [](double v) { return v >= 0.0 && v < 1.0; },
      "give a ratio in [0, 1)");
  parser.number("--amplitude", o.amplitude, positive, "give a positive number of N");
  parser.number("--press", o.press, not_negative, "give a number of N, at least 0");
  parser.number("--start", o.start, not_negative, "give a number of s, at least 0");
  parser.number("--duration", o.duration, positive, "give a positive number of s");
  parser.choice("--bits", o.bits, {{"10", 10}, {"16", 16}, {"24", 24}});
  parser.number("--noise", o.noise, not_negative, "give a number of V, at least 0");
  parser.number("--rate", o.rate, positive, "give a positive number of Hz");
  parser.number("--direction-limit", o.direction_limit, positive, "give a positive number of rad");
  if (!parser.parse(arguments)) return false;
  parser.onlyWith("--plan", {"--bits", "--noise", "--rate", "--direction-limit"});
  if (o.plan) {
    parser.notWith("--plan", {"--topic", "--time-unit", "--start", "--drift", "--harmonics",
                              "--robust", "--fit-frequency", "--acceleration", "--trace",
                              "--false-alarm", "--indifference"});
    if (!o.samples.empty())
      throw InputError("--plan: takes no samples: leave " + o.samples + " out");
    if (o.mechanism.empty()) throw InputError("--mechanism: value missing: --plan needs it");
  } else if (o.samples.empty()) {
    throw InputError("argument: value missing: give a file of samples, see --help");
  }
  return true;
}

// ---- the recording ----

// keeps the window of --start and --duration
void cut(const Options& o, RecordedMotion& motion) {
  if (motion.t.empty() || (!o.start && !o.duration)) return;
  const double from = motion.t.front() + o.start.value_or(0.0);
  const double to = o.duration ? from + *o.duration : motion.t.back() + 1.0;
  if (from > motion.t.back()) {
    throw InputError("--start: value " + yamlNumber(*o.start) + ": the samples end " +
                     yamlNumber(motion.t.back() - motion.t.front()) +
                     " s after the first: give less");
  }
  const auto place = [&](double t) {
    return std::lower_bound(motion.t.begin(), motion.t.end(), t) - motion.t.begin();
  };
  const std::ptrdiff_t first = place(from), last = place(to);
  const auto keep = [&](std::vector<double>& v, std::ptrdiff_t width) {
    if (v.empty()) return;
    v = {v.begin() + width * first, v.begin() + width * last};
  };
  keep(motion.signals, 6);
  keep(motion.sd, 1);
  keep(motion.t, 1);
  if (motion.t.empty()) {
    throw InputError("--duration: value " + yamlNumber(*o.duration) +
                     ": no sample is within it: give more");
  }
}

void writeTrace(const Options& o, const RecordedMotion& motion) {
  const std::size_t n = motion.t.size();
  std::array<std::vector<double>, 2> plane;
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t i = 0; i < 2; ++i) plane[i].push_back(motion.signals[6 * k + i]);
  }
  if (motion.kind == RecordedMotion::Kind::kAcceleration) {
    const double rate = static_cast<double>(n - 1) / (motion.t.back() - motion.t.front());
    for (auto& axis : plane) axis = integrateTwice(axis, rate, 0.5 * *o.frequency);
  }
  std::ofstream file(o.trace);
  file << "t,x,y\n";
  for (std::size_t k = 0; k < n; ++k) {
    file << yamlNumber(motion.t[k]) << "," << yamlNumber(plane[0][k]) << ","
         << yamlNumber(plane[1][k]) << "\n";
  }
  file.flush();
  if (!file) throw InputError("--trace: value " + o.trace + ": can't be written");
}

// ---- the result ----

struct Result : LocusReading {
  LocusCovariance covariance;
  bool oriented = false;
  struct Hypothesis {
    double direction, weight;
  };
  std::vector<Hypothesis> hypotheses;
};

// contact directions by the mechanism, or the friction of a peg that slides
LocusReading read(const Options& o, const Mechanism& mechanism, bool displacement,
                  const HarmonicFit& fit) {
  MeasuredMotion motion;
  motion.fit = fit;
  motion.plane = !displacement;
  motion.press = o.press;
  if (!displacement && !o.press) motion.press = mechanism.peg.mass * mechanism.gravity;
  ExciterParameters exciter;
  exciter.frequency = *o.frequency;
  exciter.direction = o.direction.value_or(1);
  exciter.amplitude = o.amplitude.value_or(mechanism.exciter.amplitude);
  if (!(exciter.amplitude > 0.0)) {
    throw InputError("--amplitude: value missing: the scenario's exciter.amplitude is 0");
  }
  ReadingLimits limits;
  limits.false_alarm = o.false_alarm;
  limits.indifference = o.indifference;
  return readLocus(mechanism, exciter, motion, limits);
}

Result estimate(const Options& o, RecordedMotion::Kind kind, HarmonicFit fit) {
  Result result;
  std::optional<Mechanism> mechanism;
  if (!o.mechanism.empty()) mechanism = loadMechanism(o.mechanism);
  const bool displacement = kind == RecordedMotion::Kind::kDisplacement;
  if (kind == RecordedMotion::Kind::kAcceleration) {
    // double integration of the exciter's line
    const double w2 = *o.frequency * *o.frequency;
    fit.phasor /= -w2;
    fit.noise /= w2 * w2;
  }
  const Locus plain = locusFromFit(fit);
  if (!std::isfinite(plain.semiMajor()) || !std::isfinite(plain.variance())) {
    throw InputError(o.samples + ": values are too large: give them in SI units");
  }
  if (mechanism) {
    static_cast<LocusReading&>(result) = read(o, *mechanism, displacement, fit);
    std::cerr << "estimate_locus: a single contact leaves a misfit of " << result.misfit
              << " of the locus\n";
  } else {
    result.locus = plain;
    result.mode = decideMode(plain, o.false_alarm, o.indifference);
  }
  const Locus& locus = result.locus;
  if (displacement && mechanism) {
    // both axes alike, as the noise is estimated from that locus
    const std::complex<double> i(0.0, 1.0);
    fit.phasor[0] = locus.P + std::conj(locus.N);
    fit.phasor[1] = -i * (locus.P - std::conj(locus.N));
    fit.noise = locus.sigma * locus.sigma * Matrix6::Identity();
  } else if (displacement) {
    std::cerr << "estimate_locus: without --mechanism the locus is that of the coupling point\n";
  }
  result.covariance = locusCovariance(fit);

  // neither no movement nor a circle has a direction
  const LocusMode mode = result.mode.mode;
  result.oriented = mode != LocusMode::kNone && mode != LocusMode::kCircle &&
                    locus.orientationSd() < kUnknownOrientationSd;
  if (const auto& direction = result.direction) {
    result.hypotheses = {{direction->alpha, direction->weight},
                         {direction->alpha_opposite, 1.0 - direction->weight}};
  } else if (!mechanism && result.oriented) {
    for (int k = 0; k < 4; ++k) {
      result.hypotheses.push_back({locus.orientation() + k * M_PI / 2.0, 0.25});
    }
  }
  if (!mechanism && mode == LocusMode::kCircle && o.amplitude && o.press && *o.press > 0.0) {
    result.friction = slidingFriction(locus, *o.amplitude, *o.press);
  }
  return result;
}

void line(const char* key, const std::string& value) { std::cout << key << ": " << value << "\n"; }

void printMatrix(const char* key, const Eigen::Matrix4d& m) {
  std::string values;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      values += (values.empty() ? "[" : ", ") +
                (std::isfinite(m(i, j)) ? yamlNumber(m(i, j)) : std::string("null"));
    }
  }
  line(key, values + "]");
}

void print(const Options& o, double frequency_sd, const Result& r) {
  const auto complex = [](std::complex<double> z) {
    return "[" + yamlNumber(z.real()) + ", " + yamlNumber(z.imag()) + "]";
  };
  const Locus& locus = r.locus;
  line("mode", toString(r.mode.mode));
  std::string probabilities;
  for (std::size_t m = 0; m < r.mode.probabilities.size(); ++m) {
    probabilities += (m == 0 ? "{" : ", ") + std::string(toString(static_cast<LocusMode>(m))) +
                     ": " + yamlNumber(r.mode.probabilities[m]);
  }
  line("probabilities", probabilities + "}");
  line("P", complex(locus.P));
  line("N", complex(locus.N));
  line("semi_major", yamlNumber(locus.semiMajor()));
  line("semi_minor", yamlNumber(locus.semiMinor()));
  line("orientation", r.oriented ? yamlNumber(locus.orientation()) : "null");
  line("orientation_sd", r.oriented ? yamlNumber(locus.orientationSd()) : "null");
  line("frequency", yamlNumber(*o.frequency));
  if (o.frequency_range) line("frequency_sd", yamlNumber(frequency_sd));
  line("noise_sd", yamlNumber(locus.sigma));
  line("samples", std::to_string(locus.samples));
  // mean of Re and Im of P and N
  line("variance", yamlNumber(locus.variance()));
  line("semi_axes_sd", yamlNumber(std::sqrt(2.0 * locus.variance())));
  printMatrix("covariance", r.covariance.amplitudes);
  printMatrix("ellipse_covariance", r.covariance.ellipse);
  if (r.friction) {
    std::cout << "friction: {coefficient: " << yamlNumber(r.friction->coefficient)
              << ", sd: " << yamlNumber(r.friction->sd) << "}\n";
  } else {
    line("friction", "null");
  }
  line("direction_sd", r.direction ? yamlNumber(r.direction->sd) : "null");
  if (r.hypotheses.empty()) {
    line("hypotheses", "null");
    return;
  }
  std::cout << "hypotheses:\n";
  for (const auto& h : r.hypotheses) {
    std::cout << "  - {direction: " << yamlNumber(h.direction)
              << ", weight: " << yamlNumber(h.weight) << "}\n";
  }
}

// ---- before a reading ----

int plan(const Options& o) {
  const Mechanism mechanism = loadMechanism(o.mechanism);
  OperatingPoint point;
  point.direction = o.direction.value_or(1);
  point.amplitude = o.amplitude.value_or(mechanism.exciter.amplitude);
  point.press = o.press.value_or(mechanism.peg.mass * mechanism.gravity);
  if (!(point.amplitude > 0.0)) {
    throw InputError("--amplitude: value missing: the scenario's exciter.amplitude is 0");
  }
  const Bridge bridge = bridgeB(static_cast<int>(o.bits), o.noise);
  const Matrix6 map = designCalibration(bridge, mechanism.coupling).volts_to_displacement;
  const Matrix6 noise = sampleVariance(bridge) * map * map.transpose();
  const double duration = o.duration.value_or(0.2);
  ForecastLimits limits;
  limits.direction_sd = o.direction_limit;
  limits.friction_demand = mechanism.friction.static_coefficient;
  DirectionForecast forecast;
  if (o.frequency) {
    point.frequency = *o.frequency;
    forecast = forecastDirection(mechanism, point, noise, std::floor(o.rate * duration));
  } else {
    forecast = chooseFrequency(mechanism, point, noise, o.rate, duration, limits);
  }
  const std::string refusal = refusalOf(forecast, limits);
  line("frequency", yamlNumber(forecast.frequency));
  line("direction_sd", yamlNumber(forecast.direction_sd));
  line("direction_bias", yamlNumber(forecast.direction_bias));
  line("axes_ratio", yamlNumber(forecast.axes_ratio));
  line("friction_demand", yamlNumber(forecast.friction_demand));
  line("refusal", refusal.empty() ? "null" : yamlQuoted(refusal));
  return refusal.empty() ? 0 : 1;
}

int run(const std::vector<std::string>& arguments) {
  Options o;
  if (!parseOptions(arguments, o)) return 0;
  if (o.plan) return plan(o);
  if (o.frequency_range && !o.frequency) {
    throw InputError("--frequency: value missing: --fit-frequency looks around it");
  }
  RecordedMotion motion = readMotion(o.samples, o.topic, o.time_unit);
  if (o.acceleration && motion.kind == RecordedMotion::Kind::kPlane) {
    motion.kind = RecordedMotion::Kind::kAcceleration;
  }
  if (!o.frequency) o.frequency = motion.frequency;
  if (!o.amplitude) o.amplitude = motion.amplitude;
  if (!o.direction) o.direction = motion.direction;
  if (!o.frequency) {
    throw InputError("--frequency: value missing: give the exciter's frequency in rad/s");
  }
  cut(o, motion);

  double frequency_sd = 0.0;
  HarmonicFit fit;
  try {
    if (o.frequency_range) {
      const FrequencyFit found = fitFrequency(motion.t, motion.signals, *o.frequency,
                                              *o.frequency_range, o.fit, motion.sd);
      o.frequency = found.frequency;
      frequency_sd = found.sd;
    }
    std::vector<double> angle;
    angle.reserve(motion.t.size());
    for (const double t : motion.t) {
      angle.push_back(o.direction.value_or(1) * *o.frequency * t);
    }
    fit = fitHarmonic(angle, motion.signals, o.fit, motion.sd);
    if (!o.trace.empty()) writeTrace(o, motion);
  } catch (const InputError& error) {
    throw InputError(o.samples + ": " + error.what());
  }
  const Result result = estimate(o, motion.kind, fit);
  line("time_unit", yamlQuoted(motion.time_unit));
  print(o, frequency_sd, result);
  return 0;
}

}  // namespace

int main(int argc, char** argv) { return runTool("estimate_locus", argc, argv, run); }
