// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "assembly_cell/mismatch/truth.h"
#include "assembly_cell/scene/scenario.h"

namespace assembly_cell {

// A mismatch file, typed: how the ground truth differs from the files of the cell.
// docs/reference/mismatch.md.

/// How a number is drawn.
struct Draw {
  enum class Kind { kNumber, kNormal, kUniform, kLogUniform };
  Kind kind = Kind::kNumber;
  double first = 0.0;   ///< the number, the standard deviation or the lower bound
  double second = 0.0;  ///< the upper bound

  /// Lowest and highest that it reaches; a normal draw 5 standard deviations from its mean.
  std::pair<double, double> reach(double mean) const;
};

/// An entry of `scale` or `add`.
struct ScenarioChange {
  std::string key;   ///< as in the file
  std::string path;  ///< without ".each"
  bool each = false;
  Draw draw;
};

/// Content of a file; what is left out is exact. Names as in the file.
struct Mismatch {
  std::string source;  ///< for refusals
  std::vector<ScenarioChange> scale, add;
  std::map<std::string, Draw> draws;  ///< by their key paths, "sensor_a.drift.force"
};

/// Reads a mismatch file. Throws InputError naming file, key path, value and remedy: unreadable
/// file, unknown or duplicate key, wrong kind, a draw that can be unphysical whatever the scenario.
Mismatch loadMismatch(const std::string& path);
/// Reads a mismatch from text; `source` names it in messages.
Mismatch parseMismatch(const std::string& yaml, const std::string& source);

/// Throws InputError if the file has a key of the carrier's drive (latency, jitter, lag,
/// backlash): where an arm carries the carrier, the arm has them.
void refuseCarrierDrive(const Mismatch& mismatch);

/// A line that names what an arm that carries the carrier doesn't have, which is in the files of
/// all levels: the noise of the reported pose. Empty: nothing.
std::string unusedWithArm(const Mismatch& mismatch);

/// Draws the ground truth of one run. One stream of random numbers for each key path and seed, none
/// of them that of the sensors' noise: a key that is added changes no other draw.
Truth drawTruth(const Mismatch& mismatch, std::uint64_t seed);

/// The nominal scenario as it truly is: scaled, added to, with its imperfections. The peg hangs
/// where its coupling is; with a face tilt the start turns about the peg's bottom centre. Throws
/// InputError where a draw makes the scenario unphysical, or one under `add` could; `source` names
/// the file.
Scenario trueScenario(const Scenario& nominal, const Truth& truth, const std::string& source);

/// Lean of a bore's axis, x and y per unit of height, from its tilt in `hole`, a rotation vector.
Eigen::Vector2d boreLean(const Eigen::Vector2d& tilt);

/// The drawn numbers as YAML on one line, keys as in the file; "{}" for nothing drawn.
std::string truthText(const Truth& truth);

}  // namespace assembly_cell
