// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Bands that curves of good runs stay in, learnt by split conformal prediction. The rate of false
// alarms is at most alpha for any distribution of exchangeable curves: docs/theory/records.md
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/records/run.h"

namespace assembly_cell {

/// How a band is learnt. The path is divided into cells of one length; NaN as a bound takes what
/// all curves of the learning half cover.
struct BandSettings {
  std::string name = "band";
  std::string program;
  double alpha = 0.01;                              ///< rate of false alarms
  bool over_time = false;                           ///< path: time [s] instead of depth [m]
  std::vector<std::string> quantities = {"axial"};  ///< see curveQuantities()
  double step = 0.0;  ///< length of a cell [m] or [s]; 0: 0.5 mm or 0.1 s
  double from, to;    ///< bounds of the path [m] or [s]
  BandSettings();
};

/// Band of one quantity of a curve: mean and standard deviation of the smallest and of the largest
/// value in each cell, over the learning half.
struct BandChannel {
  std::string quantity;
  std::vector<double> low, low_sd, high, high_sd;
};

/// Where a curve begins or ends: mean and standard deviation over the learning half [m].
struct BandPlace {
  double mean = 0.0, sd = 0.0;
};

/// A curve is in the band when no value in cell k is below low − limit · low_sd or above
/// high + limit · high_sd, and it begins and ends within limit · sd of the mean. A cell has the
/// values from the moment at which its begin is first reached until its end is; the last cell of a
/// band over depth has all later ones.
struct Band {
  std::string name = "band";
  std::string program;
  bool over_time = false;
  double alpha = 0.0;
  double limit = 0.0;                      ///< of the score
  std::size_t learnt = 0, calibrated = 0;  ///< number of good runs of each half
  double from = 0.0, step = 0.0;           ///< of the cells [m] or [s]
  BandPlace begin, end;                    ///< not of a band over time
  std::vector<BandChannel> channels;

  std::size_t cells() const { return channels.empty() ? 0 : channels.front().low.size(); }
  double to() const { return from + step * static_cast<double>(cells()); }
  double lowest(const BandChannel& of, std::size_t cell) const {
    return of.low[cell] - limit * of.low_sd[cell];
  }
  double highest(const BandChannel& of, std::size_t cell) const {
    return of.high[cell] + limit * of.high_sd[cell];
  }
};

/// axial, lateral, moment, tilt.
const std::vector<std::string>& curveQuantities();
/// The values of one of them. Throws InputError for another name.
const std::vector<double>& curveValues(const Curve& curve, const std::string& quantity);
/// "12.3 N", of a quantity.
std::string shownValue(const std::string& quantity, double value);
/// "12.3 mm" or "1.23 s", of a place on the path.
std::string shownPlace(bool over_time, double place);

/// Largest deviation of a curve in standard deviations of the band, at least 0.
struct BandScore {
  double score = 0.0;    ///< infinite: a value isn't a number, or a band over time isn't covered
  double place = 0.0;    ///< of that deviation on the path [m] or [s]; NaN: none
  double value = 0.0;    ///< of the curve there
  std::string quantity;  ///< or begin, end
  std::string reason;    ///< why the score is infinite
};
BandScore bandScore(const Band& band, const Curve& curve);

/// Passed when the score is at most the band's limit. The margin is 1 − score / limit; NaN for an
/// infinite score.
RunVerdict evaluateBand(const Band& band, const Curve& curve);

/// Learns from every second curve, in the order given, and takes the limit from the others: the
/// ⌈(n + 1)(1 − alpha)⌉-th smallest of their n scores. Throws InputError: alpha below 1/(n + 1),
/// with the number of good runs that it takes; curves without a common path; too few without NaN.
Band learnBand(const std::vector<Curve>& good, const BandSettings& settings);

/// The band as a file of rules, see RunRules.
std::string rulesText(const Band& band);

}  // namespace assembly_cell
