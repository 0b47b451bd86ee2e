// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/mechanism/iso_fit.h"

#include <algorithm>
#include <cctype>
#include <regex>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

// columns: diameter [mm], IT5 to IT11, then by kLetters [µm]
constexpr double kRows[][16] = {
#include "iso_286.inc"
};
using Row = double[16];
constexpr int kGrade5 = 1, kLetter = 8;
const std::string kLetters = "defgkmnp";  // up to g below the nominal diameter, from k on above

constexpr double kMicron = 1e-6;

ToleranceZone shaftZone(const Row& row, const std::string& letter, int grade) {
  const double tolerance = row[kGrade5 + grade - 5];
  if (letter == "js") return {-0.5 * tolerance * kMicron, 0.5 * tolerance * kMicron};
  const std::size_t k = kLetters.find(letter);
  if (k != std::string::npos && letter >= "k") {
    const double low = letter == "k" && grade > 7 ? 0.0 : row[kLetter + k];
    return {low * kMicron, (low + tolerance) * kMicron};
  }
  const double high = k == std::string::npos ? 0.0 : -row[kLetter + k];
  return {(high - tolerance) * kMicron, high * kMicron};
}

}  // namespace

Fit isoFit(const std::string& name, double nominal_diameter) {
  static const std::regex kForm("(D|E|F|G|H|JS)([5-9]|10|11)/(d|e|f|g|h|js|k|m|n|p)([5-9]|10|11)");
  std::smatch part;
  if (!std::regex_match(name, part, kForm)) {
    throw InputError("fit '" + printable(name, 20) +
                     "': give hole and shaft by ISO 286, such as H7/g6: D to H or JS, d to h, js, "
                     "k, m, n or p, each with a grade from 5 to 11");
  }
  const double diameter = 1e3 * nominal_diameter;
  constexpr double kRounding = 1.0 + 1e-9;  // 0.05 m is not over 50 mm
  const Row* row = std::find_if(std::begin(kRows), std::end(kRows), [&](const Row& candidate) {
    return diameter <= candidate[0] * kRounding;
  });
  if (!(diameter > 0.0) || row == std::end(kRows)) {
    throw InputError("fit " + name + " of a diameter of " + text("%g mm", diameter) +
                     ": fits are tabulated above 0, at most 180 mm");
  }
  std::string letter = part[1];
  std::transform(letter.begin(), letter.end(), letter.begin(),
                 [](char c) { return static_cast<char>(std::tolower(c)); });
  const ToleranceZone mirrored = shaftZone(*row, letter, std::stoi(part[2]));
  return {{-mirrored.high, -mirrored.low}, shaftZone(*row, part[3], std::stoi(part[4]))};
}

}  // namespace assembly_cell
