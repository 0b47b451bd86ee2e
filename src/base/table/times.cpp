// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <array>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "cells.h"

namespace assembly_cell {

namespace {

struct Unit {
  const char* name;
  double seconds;
};

constexpr std::array<Unit, 4> kUnits = {{{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}}};

// What stamps since 1970 are now, 2008 to 2039 [s]. A narrow range: a clock that counts the next
// smaller unit since a start of the computer is in it from its 14th to its 26th day only.
constexpr double kEarliest = 1.2e9, kLatest = 2.2e9;
constexpr double kSlowestStamps = 5.0;  // spacing of stamps since 1970 [s]: beyond it they are none
constexpr double kSlowDecimals = 60.0;  // the same of numbers with decimals [s]

bool sinceEpoch(double value, double seconds) {
  return value * seconds >= kEarliest && value * seconds <= kLatest;
}

// Units, as indices of kUnits, in which times that don't count from 1970 are those of a sensor: at
// 5 Hz to 20 kHz, which leaves two from 50 to 200 apart.
std::vector<std::size_t> bySpacing(double spacing, bool whole) {
  constexpr double kOne = 50.0, kTwo = 200.0;
  if (!whole && spacing < 1.0) return {0};
  if (spacing <= kOne) return whole ? std::vector<std::size_t>{1} : std::vector<std::size_t>{0, 1};
  if (spacing < kTwo) return {1, 2};
  if (spacing <= 1e3 * kOne) return {2};
  if (spacing < 1e3 * kTwo) return {2, 3};
  return {3};
}

struct Choice {
  std::vector<std::size_t> units;
  std::string reason;
};

Choice choose(double last, double spacing, bool whole) {
  const std::string apart =
      text("%s %.6g apart", whole ? "whole numbers" : "numbers with decimals", spacing);
  Choice out{bySpacing(spacing, whole), apart};
  for (std::size_t u = 0; u < kUnits.size(); ++u) {
    if (!sinceEpoch(last, kUnits[u].seconds)) continue;
    const double period = spacing * kUnits[u].seconds;
    if (u == 0 ? !whole && period < kSlowDecimals : period <= 1.0) return {{u}, "since 1970"};
    const bool possible = u == 0 ? period < kSlowDecimals : period <= kSlowestStamps;
    if (possible && std::count(out.units.begin(), out.units.end(), u) == 0) {
      out.units.insert(out.units.begin(), u);
    }
  }
  return out;
}

std::string rateText(double spacing, std::size_t unit) {
  return text("%.6g Hz in %s", 1.0 / (spacing * kUnits[unit].seconds), kUnits[unit].name);
}

std::size_t timeColumn(const Table& table) {
  // the stamp of a message's header is the sensor's; the time of recording stands in for none
  const auto stamp = std::find(table.names.begin(), table.names.end(), "stamp");
  if (table.header && stamp != table.names.end()) {
    const auto c = static_cast<std::size_t>(stamp - table.names.begin());
    bool rises = table.faults[c].empty();
    for (std::size_t i = 1; i < table.rows.size(); ++i) {
      rises = rises && table.rows[i][c] > table.rows[i - 1][c];
    }
    if (rises) return c;
  }
  if (const auto time = table.find({"t", "time"})) return *time;
  if (const auto time = table.find({"timestamp", "stamp", "__time"})) return *time;
  return table.need({"t"});
}

TableTimes inUnit(const Table& table, std::size_t column, double seconds, const Choice& choice) {
  TableTimes out;
  out.column = column;
  const auto unit = std::find_if(kUnits.begin(), kUnits.end(),
                                 [&](const Unit& u) { return u.seconds == seconds; });
  out.unit = unit->name;
  out.reason = choice.reason;
  for (const std::vector<double>& row : table.rows) out.t.push_back(row[column] * seconds);
  for (std::size_t i = 1; i < out.t.size(); ++i) {
    if (out.t[i] > out.t[i - 1]) continue;
    throw InputError(table.place(i) + "column " + table.names[column] +
                     ": too near the row before in " + out.unit + ": give times that rise");
  }
  return out;
}

}  // namespace

const std::vector<std::pair<std::string, TimeUnit>> kTimeUnitChoices = {
    {"auto", TimeUnit::kFound},
    {"s", TimeUnit::kSeconds},
    {"ms", TimeUnit::kMilliseconds},
    {"us", TimeUnit::kMicroseconds},
    {"ns", TimeUnit::kNanoseconds}};

std::vector<std::string> timeUnitNames() {
  std::vector<std::string> names;
  for (const auto& choice : kTimeUnitChoices) names.push_back(choice.first);
  return names;
}

TableTimes readTimes(const Table& table, TimeUnit given) {
  const std::size_t column = timeColumn(table);
  table.checkRising(column);
  if (given != TimeUnit::kFound) {
    return inUnit(table, column, kUnits[static_cast<std::size_t>(given) - 1].seconds,
                  {{}, "as given"});
  }
  const std::string& unit = table.units[column];
  if (!unit.empty()) {
    const double seconds = table::secondsOf(unit);
    if (seconds > 0.0) return inUnit(table, column, seconds, {{}, "by the header"});
    throw InputError(table.path + ":1: column " + table.names[column] + " is in '" +
                     printable(unit) + "': give s, ms, us or ns");
  }
  if (table.rows.size() < 2) return inUnit(table, column, 1.0, {{}, "a single row"});
  std::vector<double> times;
  for (const std::vector<double>& row : table.rows) times.push_back(row[column]);
  const double spacing = medianSpacing(times);
  const Choice choice = choose(times.back(), spacing, table.whole[column]);
  if (choice.units.size() > 1) {
    throw InputError(table.path + ": column " + table.names[column] + ": " + choice.reason +
                     " are " + rateText(spacing, choice.units[0]) + " or " +
                     rateText(spacing, choice.units[1]) + ": name it " + table.names[column] + "_" +
                     kUnits[choice.units[0]].name + " or " + table.names[column] + "_" +
                     kUnits[choice.units[1]].name +
                     " in the header, or set --time-unit (of a replay time_unit)");
  }
  return inUnit(table, column, kUnits[choice.units[0]].seconds, choice);
}

}  // namespace assembly_cell
