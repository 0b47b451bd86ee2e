// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What a study file means: numbered runs, draws, factors, the shares and the journal's records.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/study/run.h"
#include "assembly_cell/study/share.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

const std::string kScenario =
    std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/chapter8_force_two_10N.yaml";

class StudyFile : public testing::Test {
 protected:
  StudyFile() : path_(fs::temp_directory_path() / ("test_study_" + std::to_string(getpid()))) {}
  ~StudyFile() override { fs::remove(path_); }

  // `more` after name, base and a short duration
  Study study(const std::string& more, const std::vector<std::string>& overrides = {}) {
    std::ofstream(path_) << "name: test\nscenario: " << kScenario
                         << "\nset: {duration: 0.004, solver.tolerance: 1.0e-7}\n"
                         << more;
    return loadStudy(path_.string(), overrides);
  }

  // the refusal of a bad file; empty when there is none
  std::string refusal(const std::string& more) {
    try {
      study(more);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  fs::path path_;
};

std::string valueOf(const StudyRun& run, const std::string& key) {
  for (const StudySetting& s : run.settings) {
    if (s.key == key) return s.value;
  }
  return "";
}

std::string cellOf(const Study& study, const StudyRecord& record, const std::string& column) {
  const std::string header = resultsHeader(study);
  const auto names = csvCells(header);
  const auto cells = csvCells(record.row);
  EXPECT_EQ(cells.size(), names.size()) << record.row;
  const auto found = std::find(names.begin(), names.end(), column);
  return std::string(cells.at(static_cast<std::size_t>(found - names.begin())));
}

TEST_F(StudyFile, GridCountsTheFirstAxisSlowestAndSamplesFastest) {
  const Study s = study(
      "samples: 2\naxes:\n"
      "  - {key: exciter.amplitude, values: [1, 3]}\n"
      "  - {key: exciter.frequency, range: {from: 100, to: 10000, count: 3, spacing: log}}\n"
      "  - {name: friction, cases: {low: {friction: {static: 0.1, sliding: 0.1}}, high: "
      "{friction.static: 0.5}}}\n");
  ASSERT_EQ(runCount(s), 2 * 3 * 2 * 2);
  std::set<std::uint64_t> seeds;
  for (std::int64_t run = 0; run < runCount(s); ++run) {
    const StudyRun plan = studyRun(s, {run, {}});
    EXPECT_EQ(plan.labels[0], run < 12 ? "1" : "3");
    EXPECT_EQ(valueOf(plan, "exciter.frequency"),
              (std::vector<std::string>{"100.0", "1000.0", "10000.0"})[run / 4 % 3]);
    EXPECT_EQ(plan.labels[2], run / 2 % 2 == 0 ? "low" : "high");
    seeds.insert(plan.seed);
  }
  EXPECT_EQ(seeds.size(), 24u);
}

TEST_F(StudyFile, DrawsDependOnSeedAxisAndRunAlone) {
  const std::string axes =
      "axes:\n  - {key: exciter.phase, uniform: [-1, 3]}\n"
      "  - {key: exciter.amplitude, normal: [5, 0.5]}\n"
      "  - {key: exciter.frequency, log_uniform: [100, 10000]}\n";
  const Study s = study("samples: 20000\n" + axes);
  double sum = 0, normal = 0, square = 0, log = 0;
  std::vector<double> sorted;
  for (std::int64_t run = 0; run < runCount(s); ++run) {
    const StudyRun plan = studyRun(s, {run, {}});
    const double u = std::stod(plan.labels[0]), n = std::stod(plan.labels[1]);
    ASSERT_TRUE(u >= -1 && u <= 3);
    sorted.push_back(u);
    sum += u;
    normal += n;
    square += (n - 5) * (n - 5);
    log += std::log10(std::stod(plan.labels[2]));
  }
  const double n = 20000;
  // five standard errors each
  EXPECT_NEAR(sum / n, 1.0, 5 * 4 / std::sqrt(12 * n));
  EXPECT_NEAR(normal / n, 5.0, 5 * 0.5 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(square / n), 0.5, 5 * 0.5 / std::sqrt(2 * n));
  EXPECT_NEAR(log / n, 3.0, 5 * 2 / std::sqrt(12 * n));
  // Kolmogorov's distance from the uniform distribution: 1.95/sqrt(n) is passed once in a thousand
  std::sort(sorted.begin(), sorted.end());
  double distance = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    distance =
        std::max(distance, std::abs((sorted[i] + 1) / 4 - (static_cast<double>(i) + 0.5) / n));
  }
  EXPECT_LT(distance, 1.95 / std::sqrt(n));
  // another seed draws other numbers, an axis more leaves the others' numbers alone
  EXPECT_NE(studyRun(study("samples: 9\nseed: 2\n" + axes), {5, {}}).labels[0],
            studyRun(s, {5, {}}).labels[0]);
  EXPECT_EQ(
      studyRun(study("samples: 9\n" + axes + "  - {key: peg.mass, uniform: [0.3, 0.4]}\n"), {5, {}})
          .labels[0],
      studyRun(s, {5, {}}).labels[0]);
}

TEST_F(StudyFile, PairedPointsShareDrawsAndSeeds) {
  const Study s = study(
      "samples: 5\npaired: true\naxes:\n  - {key: exciter.amplitude, values: [1, 3]}\n"
      "  - {key: exciter.phase, uniform: [0, 1]}\n");
  for (std::int64_t k = 0; k < 5; ++k) {
    const StudyRun one = studyRun(s, {k, {}}), other = studyRun(s, {k + 5, {}});
    EXPECT_EQ(one.seed, other.seed);
    EXPECT_EQ(one.labels[1], other.labels[1]);
  }
}

TEST_F(StudyFile, FactorsMultiplyWhatTheScenarioHas) {
  const Study s = study(
      "axes:\n  - {name: stiffness, scale: {'coupling.stiffness.diagonal[1]': 1, "
      "'coupling.damping.diagonal[1]': 0.5}, values: [1, 4]}\n");
  const StudyRun run = studyRun(s, {1, {}});
  EXPECT_EQ(std::stod(valueOf(run, "coupling.stiffness.diagonal[1]")), 4 * 5.0e4);
  EXPECT_EQ(std::stod(valueOf(run, "coupling.damping.diagonal[1]")), 2 * 28.0);
}

// numbers that are written straight into the scenario give what its parser gives
TEST_F(StudyFile, DirectNumbersGiveTheSameRows) {
  Study s = study(
      "samples: 3\nhistory: true\naxes:\n  - {key: exciter.phase, uniform: [-1, 3]}\n"
      "  - {key: exciter.frequency, values: [700, 900]}\n"
      "  - {key: hole.radius, uniform: [0.025, 0.0251]}\n");
  ASSERT_EQ(s.direct.size(), 3u);
  std::vector<StudyRecord> direct;
  StudyRunner fast(s);
  for (std::int64_t run = 0; run < runCount(s); ++run) direct.push_back(fast.run({run, {}}));
  s.direct.clear();
  StudyRunner slow(s);
  for (const StudyRecord& record : direct) {
    const StudyRecord parsed = slow.run({record.run, {}});
    EXPECT_EQ(record.row, parsed.row);
    EXPECT_EQ(record.history, parsed.history);
  }
}

TEST_F(StudyFile, FailedRunsAreRowsWithTheirReason) {
  const Study s = study("axes:\n  - {key: friction.sliding, values: [0.3, 0.5, -1]}\n");
  StudyRunner runner(s);
  EXPECT_EQ(cellOf(s, runner.run({0, {}}), "status"), "ok");
  for (const std::int64_t run : {1, 2}) {
    const StudyRecord record = runner.run({run, {}});
    EXPECT_TRUE(record.failed);
    EXPECT_EQ(cellOf(s, record, "status"), "bad_input");
    EXPECT_NE(cellOf(s, record, "reason").find("friction.sliding"), std::string::npos);
    EXPECT_EQ(cellOf(s, record, "final_x"), "");
  }
  // a named stop: leaning on, the peg's edge meets the plane, which the scenario excludes
  const Study stop = study("", {"scenario=" + std::string(ASSEMBLY_CELL_SOURCE_DIR) +
                                    "/config/scenarios/chapter8_stiffness_two_low.yaml",
                                "set={duration: 0.15, solver.tolerance: 1.0e-7}", "look=0.01"});
  const StudyRecord record = StudyRunner(stop).run({0, {}});
  EXPECT_EQ(cellOf(stop, record, "status"), "edge_plane");
  EXPECT_NEAR(std::stod(cellOf(stop, record, "stopped_at")), 0.099, 0.001);  // dynamics, table 8.2
  EXPECT_TRUE(record.failed);
}

TEST_F(StudyFile, AMappingChangesTheKeysItNames) {
  const Scenario file = study("").bases.front();
  const Study s =
      study("axes: [{name: k, cases: {a: {exciter: {amplitude: 3}}}}]\n",
            {"set={duration: 0.004, friction: {sliding: 0.1}, hole: {radius: 0.0252}}"});
  const Scenario& base = s.bases.front();
  EXPECT_EQ(base.mechanism.hole.radius, 0.0252);
  EXPECT_EQ(base.mechanism.hole.depth, file.mechanism.hole.depth);
  EXPECT_EQ(base.mechanism.friction.static_coefficient, file.mechanism.friction.static_coefficient);
  const StudyRun run = studyRun(s, {0, {}});
  ASSERT_EQ(run.settings.size(), 1u);
  EXPECT_EQ(run.settings[0].key, "exciter.amplitude");
}

TEST_F(StudyFile, RulesEndARun) {
  const std::string cell = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml";
  const std::vector<std::string> base = {
      "scenario=" + cell, "set={duration: 0.8, solver.tolerance: 1.0e-7, solver.max_step: 2.0e-3}",
      "start={height: 0.001}", "move={z: -0.003}", "look=0.01"};
  const auto run = [&](const std::string& more) {
    const Study s = study(more, base);
    const StudyRecord record = StudyRunner(s).run({0, {}});
    return cellOf(s, record, "status") + " " + cellOf(s, record, "time_to_assemble");
  };
  // concentric and upright: in when the edge is 0.5 mm below, half a second at the latest
  const std::string status = run("assembled: {depth: 5.0e-4}\n");
  ASSERT_EQ(status.substr(0, 10), "assembled ");
  EXPECT_LT(std::stod(status.substr(10)), 0.5);
  EXPECT_EQ(run("stop: {evaluations: 100}\n"), "evaluation_limit ");
  EXPECT_EQ(run("").substr(0, 3), "ok ");
  // on the plane beside the hole the contact force passes any limit
  const Study s = study("start: {x: 0.02}\nstop: {force: 1}\n",
                        {base[0], base[1], "move={z: -0.003}", "look=0.01"});
  EXPECT_EQ(cellOf(s, StudyRunner(s).run({0, {}}), "status"), "force_limit");
}

TEST_F(StudyFile, RecordsSurviveAsTextAndDamageIsSeen) {
  StudyRecord record;
  record.run = 12345678901;
  record.failed = true;
  record.objective = 0.1;
  record.row = "1,2,3";
  record.history = "a\nb\n";
  const std::string text = encodeRecord(record);
  StudyRecord back;
  ASSERT_EQ(decodeRecord(text.data(), text.size(), back), text.size());
  EXPECT_EQ(encodeRecord(back), text);
  EXPECT_EQ(back.objective, 0.1);
  EXPECT_EQ(back.history, record.history);
  for (std::size_t size = 0; size < text.size(); ++size) {
    EXPECT_EQ(decodeRecord(text.data(), size, back), 0u);
  }
  for (std::size_t i = 0; i + 1 < text.size(); ++i) {
    std::string bad = text;
    bad[i] = bad[i] == '7' ? '8' : '7';
    EXPECT_EQ(decodeRecord(bad.data(), bad.size(), back), 0u) << i;
  }
}

TEST_F(StudyFile, ShareIntervalIsWilsons) {
  // Newcombe (1998), table I: 81 of 263, 15 of 148, 0 of 20
  EXPECT_NEAR(shareInterval(81, 263).low, 0.2553, 5e-5);
  EXPECT_NEAR(shareInterval(81, 263).high, 0.3662, 5e-5);
  EXPECT_NEAR(shareInterval(15, 148).low, 0.0624, 5e-5);
  EXPECT_NEAR(shareInterval(15, 148).high, 0.1605, 5e-5);
  EXPECT_EQ(shareInterval(0, 20).low, 0.0);
  EXPECT_NEAR(shareInterval(0, 20).high, 0.1611, 5e-5);
}

TEST_F(StudyFile, AlignRunsReportTheEstimatorsError) {
  const std::string cell = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml";
  // no contact within the first millimetre: a failure by name
  const Study s =
      study("job: align\nalign: {strategy: twin_force}\nstart: {offset: 0.3, height: 0.2}\n",
            {"scenario=" + cell, "set={}"});
  const StudyRecord record = StudyRunner(s).run({0, {}});
  EXPECT_TRUE(record.failed);
  EXPECT_EQ(cellOf(s, record, "assembled"), "0");
  EXPECT_NE(cellOf(s, record, "reason"), "");
  EXPECT_EQ(cellOf(s, record, "offset_error"), "");
  EXPECT_NEAR(std::stod(cellOf(s, record, "final_offset")), 0.3, 0.01);
}

TEST_F(StudyFile, BadFilesAreRefusedInOneLine) {
  const struct {
    const char* text;
    const char* named;  // in the refusal
  } bad[] = {
      {"axis: []\n", "axis"},
      {"samples: 0\n", "samples"},
      {"samples: 1.5\n", "samples"},
      {"samples: 1000000000\n", "samples"},
      {"samples: .nan\n", "samples"},
      {"seed: -1\n", "seed"},
      {"job: fly\n", "job"},
      {"axes: 3\n", "axes"},
      {"axes: [{name: k, cases: {a: {gravity: 9, gravity: 8}}}]\n", "cases.a.gravity"},
      {"axes: [{name: k, cases: {a: {peg.mass: 1, peg: {mass: 2}}}}]\n",
       "axes[0].cases.a: value peg.mass: set twice"},
      {"axes: [{key: [gravity, gravity], values: [1]}]\n",
       "axes[0].key: value gravity: named twice"},
      {"axes: [{key: gravity, name: '', values: [1]}]\n", "axes[0].name"},
      {"axes: [{key: gravity, name: ' ', values: [1]}]\n", "axes[0].name"},
      {"axes: [3]\n", "axes[0]"},
      {"axes: [{key: gravity}]\n", "axes[0]"},
      {"axes: [{values: [1]}]\n", "axes[0].name"},
      {"axes: [{key: gravity, values: []}]\n", "axes[0].values"},
      {"axes: [{key: gravity, values: [1], uniform: [0, 1]}]\n", "values and uniform"},
      {"axes: [{key: gravity, uniform: [1, 0]}]\n", "axes[0].uniform"},
      {"axes: [{key: gravity, uniform: [0, 1, 2]}]\n", "axes[0].uniform"},
      {"axes: [{key: gravity, log_uniform: [0, 1]}]\n", "axes[0].log_uniform"},
      {"axes: [{key: gravity, normal: [0, -1]}]\n", "axes[0].normal"},
      {"axes: [{key: gravity, range: {from: 1, to: 2}}]\n", "axes[0].range.count"},
      {"axes: [{key: gravity, range: {from: 0, to: 2, count: 3, spacing: log}}]\n",
       "axes[0].range.from"},
      {"axes: [{key: gravity, range: {from: 1, to: 2, count: 3, step: 1}}]\n",
       "axes[0].range.step"},
      {"axes: [{key: gravitas, values: [1]}]\n", "gravitas"},
      {"axes: [{key: exciter.amplitud, values: [1]}]\n", "amplitud"},
      {"axes: [{key: 'push[7]', values: [1]}]\n", "push[7]"},
      {"axes: [{key: start.w, values: [1]}]\n", "start.w"},
      {"axes: [{key: start.x, values: [high]}]\n", "start.x"},
      {"axes: [{key: scenario, values: [none.yaml]}]\n", "none.yaml"},
      {"axes: [{key: gravity, values: [1]}, {key: gravity, name: b, values: [2]}]\n", "gravity"},
      {"axes: [{key: gravity, values: [1]}, {key: peg.mass, name: gravity, values: [2]}]\n",
       "axes[1].name"},
      {"axes: [{name: k, scale: {friction: 1}, values: [2]}]\n", "axes[0].scale"},
      {"axes: [{name: k, scale: {gravity: 1}, values: [-2]}]\n", "axes[0].values[0]"},
      {"axes: [{name: k, cases: {}}]\n", "axes[0].cases"},
      {"axes: [{name: k, cases: {a: 3}}]\n", "axes[0].cases.a"},
      {"axes: [{name: k, cases: {a: {gravity: 1}, b: {gravitas: 1}}}]\n", "gravitas"},
      {"axes: [{key: gravity, search: [1, 2]}]\n", "search"},
      {"search: {minimise: final_x}\n", "search"},
      {"axes: [{key: gravity, search: [1, 2]}]\nsearch: {minimise: beauty}\n", "beauty"},
      {"axes: [{key: gravity, search: [1, 2]}]\nsearch: {minimise: final_x, otherwise: 0, steps: "
       "[{algorithm: luck, evaluations: 2}]}\n",
       "luck"},
      {"outcomes: [beauty]\n", "outcomes[0]"},
      {"outcomes: [final_x, final_x]\n", "outcomes[1]"},
      {"stop: {force: -1}\n", "stop.force"},
      {"stop: {time: 1}\n", "stop.time"},
      {"look: 0\n", "look"},
      {"move: {z: far}\n", "move.z"},
      {"assembled: {depth: .inf}\n", "assembled.depth"},
      {"job: align\nalign: {press_force: -3}\n", ": align.press_force: value -3"},
      {"align: {press_force: 3}\n", "job: align"},
      {"axes: [{key: cell.noise, values: [0]}]\n", "cell.noise"},
      {"axes: [{key: cell.noise, uniform: [0, 1]}]\n", "job: align"},
      {"job: align\naxes: [{key: cell.bits, values: [12]}]\n",
       "cell.bits: value 12: give 10, 16 or 24"},
      {"job: align\nlook: 0.1\n", "look"},
      {"job: align\naxes: [{key: align.strategy, values: [twin_force, luck]}]\n", "luck"},
      {"job: align\naxes: [{key: align.strategy, uniform: [0, 1]}]\n", "align.strategy"},
      {"axes: [{key: scenario, uniform: [0, 1]}]\n", "axes[0].key"},
      {"axes: [{key: gravity, name: status, values: [1]}]\n", "axes[0].name"},
      {"axes: [{key: gravity, name: final_x, values: [1]}]\n", "axes[0].name"},
      {"start: {height: -0.001}\n", "start.height"},
      {"axes: [{key: gravity, search: [1, 2]}]\nsearch: {minimise: modes}\n", "modes"},
      {"enough: {half_width: 2}\n", "enough.half_width"},
      {"enough: {half_width: 0}\n", "enough.half_width"},
      {"name: again\n", "name"},
      {"set: {gravity: 1}\n", "set"},
      {"axes: [\n", "YAML"},
  };
  for (const auto& b : bad) {
    const std::string what = refusal(b.text);
    EXPECT_NE(what.find(path_.string()), std::string::npos) << b.text << what;
    EXPECT_NE(what.find(b.named), std::string::npos) << b.text << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  }
  try {
    study("job: align\n", {"set.align.press_force=-3"});
    ADD_FAILURE() << "accepted";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find(": set: align.press_force: value -3"), std::string::npos)
        << e.what();
  }
}

}  // namespace
}  // namespace assembly_cell
