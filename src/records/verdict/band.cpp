// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/band.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "verdict/cells.h"

namespace assembly_cell {
namespace {

constexpr double kUnset = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDepthStep = 5e-4, kTimeStep = 0.1;  // default lengths of a cell [m], [s]
constexpr std::size_t kMaxCells = 20000;
// Floors of a standard deviation: a curve that is the same in all runs has none. Of a quantity as a
// fraction of its largest mean; half of it doubles the score of a curve that repeats to 0.1 %.
constexpr double kRelativeFloor = 1e-3, kAbsoluteFloor = 1e-9;
constexpr double kPlaceFloor = 1e-6;  // [m]
constexpr double kLowestLimit = 1.0;  // at least one standard deviation or floor

// Mean and standard deviation of numbers that come one by one (Welford).
struct Moments {
  std::size_t n = 0;
  double mean = 0.0, squares = 0.0;
  void add(double x) {
    ++n;
    const double off = x - mean;
    mean += off / static_cast<double>(n);
    squares += off * (x - mean);
  }
  double sd() const { return n > 1 ? std::sqrt(squares / static_cast<double>(n - 1)) : 0.0; }
};

void take(BandScore& best, double score, double place, double value, const std::string& quantity) {
  if (score > best.score || std::isnan(best.place)) {
    best.score = std::max(best.score, score);
    best.place = place;
    best.value = value;
    best.quantity = quantity;
  }
}

BandScore withoutScore(double place, const std::string& quantity, const std::string& reason) {
  BandScore score;
  score.score = kInfinity;
  score.place = place;
  score.value = kUnset;
  score.quantity = quantity;
  score.reason = reason;
  return score;
}

// Bounds of the path that all curves cover, on whole steps.
void setPath(const std::vector<const Curve*>& curves, const BandSettings& settings, Band& band) {
  double first = -kInfinity, last = kInfinity;
  for (const Curve* curve : curves) {
    const PathEnds ends = pathEnds(pathOf(*curve, band.over_time));
    first = std::max(first, ends.begin);
    last = std::min(last, ends.end);
  }
  const double step = band.step, low = std::ceil(first / step - 1e-6) * step;
  band.from = std::isnan(settings.from) ? low : settings.from;
  const double to = std::isnan(settings.to) ? std::floor(last / step + 1e-6) * step : settings.to;
  const double cells = std::round((to - band.from) / step);
  const std::string path =
      shownPlace(band.over_time, band.from) + " to " + shownPlace(band.over_time, to);
  if (!(cells >= 1.0)) {
    throw InputError("band: from " + path +
                     ": the curves of the good runs have no path in common: leave out those that "
                     "begin late or end early, or give from and to");
  }
  if (cells > static_cast<double>(kMaxCells)) {
    throw InputError(text("band: from %s in %.0f cells: give a step that makes at most %zu",
                          path.c_str(), cells, kMaxCells));
  }
  for (const std::string& quantity : settings.quantities) {
    BandChannel channel;
    channel.quantity = quantity;
    const auto count = static_cast<std::size_t>(cells);
    channel.low.resize(count), channel.low_sd.resize(count);
    channel.high.resize(count), channel.high_sd.resize(count);
    band.channels.push_back(channel);
  }
}

void learnChannel(const std::vector<const Curve*>& curves, Band& band, BandChannel& channel) {
  std::vector<Moments> low(channel.low.size()), high(channel.low.size());
  for (const Curve* curve : curves) {
    const CellValues cells = cellValues(band, *curve, channel.quantity);
    for (std::size_t k = 0; k < low.size(); ++k) {
      if (!cells.has(k)) continue;
      low[k].add(cells.low[k]);
      high[k].add(cells.high[k]);
    }
  }
  double scale = 0.0;
  for (std::size_t k = 0; k < low.size(); ++k) {
    if (low[k].n < 2) {
      throw InputError("band: " + shownPlace(band.over_time, band.from + band.step * double(k)) +
                       ": fewer than two good runs of the learning half have it: give a shorter "
                       "path from and to");
    }
    scale = std::max({scale, std::abs(low[k].mean), std::abs(high[k].mean)});
  }
  const double floor = std::max(kAbsoluteFloor, kRelativeFloor * scale);
  for (std::size_t k = 0; k < low.size(); ++k) {
    channel.low[k] = low[k].mean;
    channel.high[k] = high[k].mean;
    channel.low_sd[k] = std::max(floor, low[k].sd());
    channel.high_sd[k] = std::max(floor, high[k].sd());
  }
}

void learnEnds(const std::vector<const Curve*>& curves, Band& band) {
  Moments begin, end;
  for (const Curve* curve : curves) {
    const PathEnds ends = pathEnds(curve->depth);
    begin.add(ends.begin);
    end.add(ends.end);
  }
  band.begin = {begin.mean, std::max(kPlaceFloor, begin.sd())};
  band.end = {end.mean, std::max(kPlaceFloor, end.sd())};
}

bool isComplete(const Curve& curve, const BandSettings& settings) {
  if (curve.size() < 2 || !isFinite(pathOf(curve, settings.over_time))) return false;
  return std::all_of(settings.quantities.begin(), settings.quantities.end(),
                     [&](const std::string& quantity) {
                       const std::vector<double>& values = curveValues(curve, quantity);
                       return values.size() == curve.size() && isFinite(values);
                     });
}

void checkSettings(const BandSettings& settings, std::size_t runs, std::size_t calibrated) {
  if (!(settings.alpha > 0.0 && settings.alpha < 1.0)) {
    throw InputError(text("alpha: value %g: give a rate between 0 and 1", settings.alpha));
  }
  if (settings.quantities.empty()) throw InputError("quantities: give at least one");
  if (!(settings.step >= 0.0) || std::isinf(settings.step)) {
    throw InputError(text("step: value %g: give a length of a cell above 0", settings.step));
  }
  // the epsilon lets alpha = 0.01 pass with 99 runs
  if (settings.alpha * (static_cast<double>(calibrated) + 1.0) < 1.0 - 1e-9) {
    throw InputError(text(
        "alpha: value %g: %zu good runs (%zu of them to calibrate) support at least %.6g: give "
        "that, or %.0f good runs",
        settings.alpha, runs, calibrated, 1.0 / (static_cast<double>(calibrated) + 1.0),
        2.0 * (std::ceil(1.0 / settings.alpha - 1e-9) - 1.0)));
  }
}

// The ⌈(n + 1)(1 − alpha)⌉-th smallest.
double conformalLimit(std::vector<double> scores, double alpha) {
  const double n = static_cast<double>(scores.size());
  const double rank = std::clamp(std::ceil((n + 1.0) * (1.0 - alpha) - 1e-9), 1.0, n);
  const auto at = scores.begin() + static_cast<std::ptrdiff_t>(rank) - 1;
  std::nth_element(scores.begin(), at, scores.end());
  return *at;
}

}  // namespace

BandSettings::BandSettings() : from(kUnset), to(kUnset) {}

const std::vector<std::string>& curveQuantities() {
  static const std::vector<std::string> names = {"axial", "lateral", "moment", "tilt"};
  return names;
}

const std::vector<double>& curveValues(const Curve& curve, const std::string& quantity) {
  if (quantity == "axial") return curve.axial;
  if (quantity == "lateral") return curve.lateral;
  if (quantity == "moment") return curve.moment;
  if (quantity == "tilt") return curve.tilt;
  throw InputError("quantity: value " + printable(quantity) +
                   ": give axial, lateral, moment or tilt");
}

std::string shownValue(const std::string& quantity, double value) {
  const char* const unit = quantity == "moment" ? "N m" : quantity == "tilt" ? "rad" : "N";
  return text("%.4g %s", value, unit);
}

std::string shownPlace(bool over_time, double place) {
  return over_time ? text("%.4g s", place) : text("%.5g mm", 1e3 * place);
}

BandScore bandScore(const Band& band, const Curve& curve) {
  const std::vector<double>& path = pathOf(curve, band.over_time);
  const char* const name = band.over_time ? "time" : "depth";
  BandScore best;
  best.place = kUnset;
  if (path.empty()) return withoutScore(kUnset, name, "the curve has no samples");
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (std::isfinite(path[i])) continue;
    return withoutScore(kUnset, name, text("%s of sample %zu isn't a number", name, i));
  }
  const PathEnds ends = pathEnds(path);
  if (band.over_time) {
    const double slack = 1e-6 * band.step;
    if (ends.begin > band.from + slack) {
      return withoutScore(ends.begin, name, "the curve begins after the band");
    }
    if (ends.end < band.to() - slack) {
      return withoutScore(ends.end, name, "the curve ends before the band");
    }
  } else {
    take(best, std::abs(ends.begin - band.begin.mean) / band.begin.sd, ends.begin, ends.begin,
         "begin");
    take(best, std::abs(ends.end - band.end.mean) / band.end.sd, ends.end, ends.end, "end");
  }
  for (const BandChannel& channel : band.channels) {
    const std::vector<double>& values = curveValues(curve, channel.quantity);
    for (std::size_t i = 0; i < path.size(); ++i) {
      if (i < values.size() && std::isfinite(values[i])) continue;
      return withoutScore(
          path[i], channel.quantity,
          channel.quantity + " isn't a number at " + shownPlace(band.over_time, path[i]));
    }
    const CellValues cells = cellValues(band, curve, channel.quantity);
    for (std::size_t k = 0; k < channel.low.size(); ++k) {
      if (!cells.has(k)) continue;
      take(best, (cells.high[k] - channel.high[k]) / channel.high_sd[k], cells.high_at[k],
           cells.high[k], channel.quantity);
      take(best, (channel.low[k] - cells.low[k]) / channel.low_sd[k], cells.low_at[k], cells.low[k],
           channel.quantity);
    }
  }
  return best;
}

RunVerdict evaluateBand(const Band& band, const Curve& curve) {
  const BandScore found = bandScore(band, curve);
  RunVerdict verdict;
  verdict.rule = band.name;
  verdict.kind = "band";
  verdict.passed = found.score <= band.limit;
  verdict.depth = found.place;
  verdict.quantity = found.quantity;
  if (!found.reason.empty()) {
    verdict.margin = kUnset;
    verdict.text = "not evaluated, counts as outside: " + found.reason;
    return verdict;
  }
  verdict.margin = 1.0 - found.score / band.limit;
  const bool place = found.quantity == "begin" || found.quantity == "end";
  const std::string where = shownPlace(band.over_time, found.place);
  const std::string what =
      place ? "the curve's " + found.quantity + " at " + where
            : found.quantity + " " + shownValue(found.quantity, found.value) + " at " + where;
  verdict.text = what + (verdict.passed ? " is nearest to the limit: " : " is outside: ") +
                 text("%.3g of %.3g sd", found.score, band.limit);
  return verdict;
}

Band learnBand(const std::vector<Curve>& good, const BandSettings& settings) {
  for (const std::string& quantity : settings.quantities) curveValues(Curve(), quantity);
  const std::size_t calibrated = good.size() / 2;
  checkSettings(settings, good.size(), calibrated);
  std::vector<const Curve*> learning;
  std::size_t incomplete = 0;
  for (std::size_t i = 0; i < good.size(); i += 2) {
    if (isComplete(good[i], settings)) {
      learning.push_back(&good[i]);
    } else {
      ++incomplete;
    }
  }
  if (learning.size() < 2) {
    throw InputError(
        text("band: %zu good runs, %zu of the %zu to learn from without %s in all "
             "samples: give at least 4 complete ones",
             good.size(), incomplete, (good.size() + 1) / 2,
             settings.over_time ? "numbers" : "a depth and numbers"));
  }
  Band band;
  band.name = settings.name;
  band.program = settings.program;
  band.over_time = settings.over_time;
  band.alpha = settings.alpha;
  band.step = settings.step > 0.0 ? settings.step : band.over_time ? kTimeStep : kDepthStep;
  band.learnt = learning.size();
  band.calibrated = calibrated;
  setPath(learning, settings, band);
  for (BandChannel& channel : band.channels) learnChannel(learning, band, channel);
  if (!band.over_time) learnEnds(learning, band);
  std::vector<double> scores;
  for (std::size_t i = 1; i < good.size(); i += 2) {
    scores.push_back(bandScore(band, good[i]).score);
  }
  const auto without = static_cast<std::size_t>(
      std::count_if(scores.begin(), scores.end(), [](double s) { return std::isinf(s); }));
  const double limit = conformalLimit(std::move(scores), settings.alpha);
  if (std::isinf(limit)) {
    throw InputError(
        text("band: %zu of the %zu runs to calibrate can't be evaluated (a value that "
             "isn't a number, or not all of the path): more than alpha %g lets pass: "
             "leave them out if they aren't good, or give a shorter path from and to",
             without, calibrated, settings.alpha));
  }
  band.limit = std::max(kLowestLimit, limit);
  return band;
}

}  // namespace assembly_cell
