// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/align/align.h"
#include "assembly_cell/cell/simulated_cell.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario.h"
#include "assembly_cell/scene/scenario_numbers.h"

namespace assembly_cell {

// A study file, typed: config/studies/*.yaml, docs/how_to/studies.md. A study is a numbered list of
// runs; what a run does depends on the study and its number alone.

constexpr double kStudyNone = std::numeric_limits<double>::quiet_NaN();

/// Start of the peg instead of the scenario's: hanging at rest, see startAt(). The bottom centre is
/// at (x, y) + offset·(cos azimuth, sin azimuth), the tilt likewise.
struct StudyStart {
  bool given = false;
  double x = 0.0, y = 0.0, offset = 0.0, azimuth = 0.0;               ///< [m], [rad]
  double tilt_x = 0.0, tilt_y = 0.0, tilt = 0.0, tilt_azimuth = 0.0;  ///< rotation vector [rad]
  double height = 0.003;  ///< of the lowest edge point over the plane [m]
};

/// Open-loop motion of the rest pose, within the carrier's limits.
struct StudyMove {
  bool given = false;
  double x = 0.0, y = 0.0, z = 0.0;  ///< [m]
  double delay = 0.0;                ///< from the start [s]
};

/// What a run is besides its scenario. All of it can be changed by settings, see setStudyJob().
struct StudyJob {
  enum class Kind { kSimulate, kAlign };
  Kind kind = Kind::kSimulate;
  StudyStart start;
  StudyMove move;
  double look = 2e-3;                    ///< period in which outcomes are evaluated [s]
  double assembled_depth = kStudyNone;   ///< assembled: whole edge deeper than this, and ... [m]
  double assembled_offset = kStudyNone;  ///< ... bottom centre nearer to the axis than this [m]
  bool stop_assembled = true;            ///< ends the run
  double stop_force = std::numeric_limits<double>::infinity();        ///< of a contact [N]
  double stop_evaluations = std::numeric_limits<double>::infinity();  ///< right-hand sides
  AlignParameters align;
  CellParameters cell;
};

/// Its keys in a study file.
void fields(FieldList& f, StudyJob& job);

/// "key.path = value" of a run, the value in YAML syntax.
struct StudySetting {
  std::string key, value;
};

/// One thing that varies from run to run.
struct StudyAxis {
  enum class Kind { kCases, kValues, kUniform, kLogUniform, kNormal, kSearch };
  /// Where a number goes: as it is, or, with a power, as number^power times what the base has.
  struct Target {
    std::string key;
    double power = 0.0;
  };
  std::string name;
  Kind kind = Kind::kCases;
  std::vector<std::string> labels;               ///< kCases
  std::vector<std::vector<StudySetting>> cases;  ///< kCases
  std::vector<double> values;                    ///< kValues
  std::vector<Target> targets;                   ///< all others
  double low = 0.0, high = 0.0;                  ///< bounds; kNormal: mean, standard deviation
  bool logarithmic = false;                      ///< kSearch
  std::uint64_t stream = 0;                      ///< of its random numbers

  bool grid() const { return kind == Kind::kCases || kind == Kind::kValues; }
  std::size_t size() const { return kind == Kind::kCases ? cases.size() : values.size(); }
};

/// When there are enough runs: looked at after each run, in the order of the runs.
struct StudyEnough {
  std::int64_t min_runs = 100;     ///< runs before the interval counts
  double half_width = kStudyNone;  ///< of the 95 % interval of the share of assembled runs
  double failed = kStudyNone;      ///< number of failed runs
};

/// Optimum of an outcome over the axes of kind kSearch; a point's value is the mean over the other
/// axes and the samples.
struct StudySearch {
  struct Step {
    std::string algorithm;  ///< direct, crs2, isres, esch, sbplx, cobyla, bobyqa, nelder_mead
    int evaluations = 0;
  };
  std::string outcome;  ///< empty: no search
  bool maximise = false;
  double otherwise = 0.0;   ///< counts for runs without the outcome
  double tolerance = 1e-3;  ///< a step ends when the point moves by less, of its range
  std::vector<Step> steps;  ///< each from the best point so far
};

struct Study {
  std::string name;
  std::string digest;                  ///< of all that decides what the runs are
  std::vector<std::string> scenarios;  ///< files: the base, then those of an axis
  std::vector<std::string> texts;      ///< their content
  std::vector<std::string> digests;    ///< of the contents
  std::vector<Scenario> bases;         ///< with `set`
  std::vector<StudySetting> set;       ///< of every run
  std::optional<Mismatch> mismatch;    ///< how the ground truth of each run differs
  std::string mismatch_text;           ///< content of its file
  StudyJob job;
  std::uint64_t seed = 1;
  std::int64_t samples = 1;
  bool paired = false;  ///< sample k draws the same numbers and has the same seed at every point
  std::vector<StudyAxis> axes;
  std::vector<std::string> outcomes;  ///< columns
  bool evaluated = false;             ///< each run is assembled or not
  bool history = false;               ///< a second file with a row per look
  StudyEnough enough;
  StudySearch search;
  std::vector<std::string> direct;  ///< keys of the scenario whose numbers need no parser
};

/// Reads a study file; each override is "key.path=value". Throws InputError naming file, key,
/// value and remedy.
Study loadStudy(const std::string& path, const std::vector<std::string>& overrides = {});

/// Runs of one point of the search, or of the whole study without one.
std::int64_t runsPerPoint(const Study& study);
/// Number of all runs; for a search the largest possible one.
std::int64_t runCount(const Study& study);

/// A run to be done: its number, and the point of the search as numbers from 0 to 1.
struct StudyTask {
  std::int64_t run = 0;
  std::vector<double> point;
};

/// What a task comes to.
struct StudyRun {
  std::uint64_t seed = 0;
  std::vector<std::string> labels;  ///< one an axis
  std::vector<StudySetting> settings;
};
StudyRun studyRun(const Study& study, const StudyTask& task);

/// Applies a setting with a key of the job (start.x, move.z, align.press_force, ...); false when
/// the key is none. Throws InputError for a value that is not allowed.
bool setStudyJob(StudyJob& job, const StudySetting& setting);

}  // namespace assembly_cell
