// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>
#include <set>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/table.h"
#include "cells.h"

namespace assembly_cell {

namespace table {

namespace {

using Factors = std::map<std::string, double>;

constexpr double kPound = 4.4482216152605;  // [N], of a pound-force, exact
constexpr double kInch = 0.0254;            // [m]
constexpr double kGravity = 9.80665;        // standard, of a kilogram-force [m/s²]

const std::array<Factors, 5> kFactors = {
    Factors{{"n", 1.0},
            {"newton", 1.0},
            {"newtons", 1.0},
            {"mn", 1e-3},
            {"kn", 1e3},
            {"kgf", kGravity},
            {"lbf", kPound}},
    Factors{{"nm", 1.0},
            {"newtonmeter", 1.0},
            {"newtonmeters", 1.0},
            {"nmm", 1e-3},
            {"mnm", 1e-3},
            {"ncm", 1e-2},
            {"knm", 1e3},
            {"kgfm", kGravity},
            {"lbfin", kPound* kInch},
            {"inlbf", kPound* kInch},
            {"lbfft", 12.0 * kPound* kInch},
            {"ftlbf", 12.0 * kPound* kInch}},
    Factors{{"m", 1.0},
            {"meter", 1.0},
            {"meters", 1.0},
            {"cm", 1e-2},
            {"mm", 1e-3},
            {"um", 1e-6},
            {"\u00b5m", 1e-6},
            {"\u03bcm", 1e-6},
            {"in", kInch}},
    Factors{{"rad", 1.0},
            {"radians", 1.0},
            {"deg", M_PI / 180.0},
            {"degrees", M_PI / 180.0},
            {"\u00b0", M_PI / 180.0}},
    Factors{{"v", 1.0}, {"volt", 1.0}, {"volts", 1.0}, {"mv", 1e-3}, {"uv", 1e-6}}};

const Factors kSeconds = {{"s", 1.0},       {"sec", 1.0},      {"secs", 1.0},     {"second", 1.0},
                          {"seconds", 1.0}, {"ms", 1e-3},      {"msec", 1e-3},    {"us", 1e-6},
                          {"usec", 1e-6},   {"\u00b5s", 1e-6}, {"\u03bcs", 1e-6}, {"ns", 1e-9},
                          {"nsec", 1e-9}};

// of columns that no reader converts
const std::set<std::string> kOthers = {
    "",    "1",    "none",  "n/a", "counts", "count", "codes", "g",    "k",       "degc",  "hz",
    "m/s", "m/s2", "m/s^2", "c",   "%",      "#",     "bool",  "text", "\u00b0c", "rad/s", "kg"};

std::string lowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// "N·m", "N-m" and "N m" are "nm"
std::string plain(const std::string& unit) {
  std::string out = lowerCase(std::string(trimmed(unit, " \t[](){}")));
  for (const std::string mark : {"\u00b7", "\u22c5", "\xB7", "*", "-", " ", "."}) {
    for (std::size_t at = 0; (at = out.find(mark)) != std::string::npos;)
      out.erase(at, mark.size());
  }
  return out;
}

double look(const Factors& factors, const std::string& unit) {
  const auto found = factors.find(plain(unit));
  return found == factors.end() ? 0.0 : found->second;
}

std::vector<std::string> wordsOf(const std::string& name) {
  std::vector<std::string> words(1);
  for (const char c : name) {
    if (c == '.' || c == '_' || c == '/' || c == ' ') {
      words.emplace_back();
    } else {
      words.back() += c;
    }
  }
  words.erase(std::remove(words.begin(), words.end(), ""), words.end());
  return words;
}

// fx of wrench.force.x; empty: no such field
std::string shortName(const std::string& name) {
  static const std::map<std::string, std::string> letters = {
      {"force", "f"},       {"torque", "t"},     {"moment", "t"}, {"position", ""},
      {"orientation", "q"}, {"quaternion", "q"}, {"quat", "q"},   {"translation", ""},
      {"rotation", "q"},    {"rotvec", "r"}};
  std::vector<std::string> words = wordsOf(name);
  if (!words.empty() && words[0] == "field") words.erase(words.begin());
  const std::size_t n = words.size();
  if (n < 2) return {};
  if (words[n - 2] == "header" && words[n - 1] == "stamp") return "stamp";
  const auto letter = letters.find(words[n - 2]);
  const std::string& axis = words[n - 1];
  if (letter == letters.end() || axis.size() != 1 || axis.find_first_of("xyzw") != 0) return {};
  if (axis == "w" && letter->second != "q") return {};
  // words before it could make it another quantity, but for the message's own
  const bool whole = n == 2;
  const bool field =
      !whole && (words[n - 3] == "wrench" || words[n - 3] == "pose" || words[n - 3] == "transform");
  if (!whole && !field) return {};
  // a matrix or Euler angles have rotation_x as well; of messages it is a quaternion
  if (words[n - 2] == "rotation" && !field) return {};
  return letter->second + axis;
}

bool isKnown(const std::string& name) {
  static const std::set<std::string> known = {"t",  "time", "timestamp", "stamp", "fx", "fy", "fz",
                                              "tx", "ty",   "tz",        "mx",    "my", "mz", "x",
                                              "y",  "z",    "rx",        "ry",    "rz"};
  return known.count(name) != 0;
}

}  // namespace

double secondsOf(const std::string& unit) { return look(kSeconds, unit); }

double factorOf(Quantity quantity, const std::string& unit) {
  return look(kFactors[static_cast<std::size_t>(quantity)], unit);
}

bool isUnit(const std::string& cell) {
  const auto has = [&](const Factors& factors) { return look(factors, cell) > 0.0; };
  return has(kSeconds) || std::any_of(kFactors.begin(), kFactors.end(), has) ||
         kOthers.count(plain(cell)) != 0;
}

HeaderCell headerCell(const std::string& cell) {
  HeaderCell out;
  out.name = lowerCase(std::string(trimmed(cell, " \t\r\"'%#")));
  const std::string as_written(trimmed(cell, " \t\r\"'%#"));
  const std::size_t bracket = out.name.find_last_of("[({");
  if (bracket != std::string::npos && bracket > 0 &&
      out.name.find_last_of("])}") == out.name.size() - 1) {
    const std::string name(trimmed(out.name.substr(0, bracket), " \t_"));
    const std::string unit(trimmed(as_written.substr(bracket), " \t[](){}"));
    // force(1) and force(2) are two channels
    if (isKnown(name) || !shortName(name).empty() || (plain(unit) != "1" && isUnit(unit))) {
      out = {name, unit};
    }
  }
  if (const std::string name = shortName(out.name); !name.empty()) {
    out.name = name;
    return out;
  }
  const std::size_t underscore = out.name.rfind('_');
  if (out.unit.empty() && underscore != std::string::npos &&
      isKnown(out.name.substr(0, underscore)) && underscore + 1 < out.name.size() &&
      out.name.substr(underscore + 1) != "1" && isUnit(out.name.substr(underscore + 1))) {
    out.unit = as_written.substr(underscore + 1);
    out.name.erase(underscore);
  }
  return out;
}

}  // namespace table

std::string columnName(const std::string& header) { return table::headerCell(header).name; }

}  // namespace assembly_cell
