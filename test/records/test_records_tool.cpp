// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool records, on a small store.
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>

#include "assembly_cell/records/store.h"
#include "temporary_folder.h"
#include "tool_run.h"

namespace assembly_cell {

class RecordsTool : public testing::Test {
 protected:
  RecordsTool() {
    RunStore store(folder_ / "runs.db", RunStore::Access::kWrite);
    for (int i = 1; i <= 3; ++i) {
      assembly_cell::Run run;
      run.serial = "S" + std::to_string(i);
      run.program = "plate";
      run.start = 1764390600.0 + 86400.0 * i;  // 2025-11-29T04:30:00Z and a day each
      run.result = i == 3 ? "failed" : "seated";
      run.failure = i == 3 ? "jammed" : "";
      run.verdicts.resize(1);
      run.verdicts[0].passed = i == 1;
      if (i < 3) run.curve.add({0.0, 0.001, 5.0 * i, 1.0, 0.1, 1e-3});
      if (i < 3) run.curve.add({0.02, 0.002, 4.0 * i, 1.0, 0.1, 1e-3});
      store.append(run);
    }
  }
  test::ToolRun records(const std::string& command) {
    return test::runTool("records " + command + " --store runs.db", folder_.path());
  }
  void expectRefused(const std::string& command, const std::string& why) {
    const test::ToolRun run = records(command);
    EXPECT_EQ(run.code, 2) << command;
    EXPECT_EQ(run.text(), "records: " + why + "\n");
  }

  test::TemporaryFolder folder_;
};

TEST_F(RecordsTool, ListsTheRunsThatAreWanted) {
  const auto rows = [&](const std::string& filter) {
    const std::string text = records("list " + filter).out;
    std::string found;
    for (const char* serial : {"S1", "S2", "S3"}) {
      if (text.find(serial) != std::string::npos) found += serial;
    }
    return found;
  };
  EXPECT_EQ(rows(""), "S1S2S3");
  EXPECT_EQ(rows("--serial S2"), "S2");
  EXPECT_EQ(rows("--result failed"), "S3");
  EXPECT_EQ(rows("--passed"), "S1");
  EXPECT_EQ(rows("--failed --limit 1"), "S3");
  EXPECT_EQ(rows("--from 2025-12-01 --to 2025-12-02"), "S2");
  EXPECT_EQ(rows("--program other"), "");
  EXPECT_NE(records("list").out.find("failed: jammed"), std::string::npos);
}

TEST_F(RecordsTool, ShowsExportsAndChecks) {
  const YAML::Node run = YAML::Load(records("show 2").out);
  EXPECT_EQ(run["serial"].as<std::string>(), "S2");
  EXPECT_EQ(run["curve"]["peak_force"].as<double>(), 10.0);
  EXPECT_EQ(records("export 1").out,
            "time,depth,axial,lateral,moment,tilt\n0.0,0.001,5.0,1.0,0.1,0.001\n"
            "0.02,0.002,4.0,1.0,0.1,0.001\n");
  EXPECT_EQ(records("export --output runs.csv").code, 0);
  EXPECT_NE(test::textOf(folder_ / "runs.csv").find("\n1,1764477000.0,0.0,S1,plate,"),
            std::string::npos);
  const YAML::Node trend = YAML::Load(records("trend peak_force").out);
  EXPECT_EQ(trend["runs"].as<int>(), 2);
  EXPECT_EQ(trend["mean"].as<double>(), 7.5);
  const test::ToolRun check = records("check");
  EXPECT_EQ(check.code, 0);
  EXPECT_EQ(check.text(), "runs.db: ok\n");
}

TEST_F(RecordsTool, DrawsCurves) {
  for (const char* command : {"plot 1 --output p.png", "compare 1 2 --output p.png"}) {
    const test::ToolRun run = records(command);
    EXPECT_EQ(run.code, 0) << run.text();
    EXPECT_EQ(test::textOf(folder_ / "p.png").substr(1, 3), "PNG") << command;
    std::filesystem::remove(folder_ / "p.png");
  }
}

TEST_F(RecordsTool, RefusesInOneLine) {
  expectRefused("show 99", "store 'runs.db': there is no run 99: the last one is 3");
  expectRefused("show x", "argument: value x: give the number of a run, see records list");
  expectRefused("plot 3", "run 3: has no curve: give a run with an insertion");
  expectRefused("compare 1", "argument: value missing: give the numbers of two runs");
  expectRefused("export 1 --limit 3", "--limit: of no use with a run: leave one of them out");
  expectRefused("list --passed --failed", "--failed: value true: leave it or --passed out");
  expectRefused("list --from 2026-02-31",
                "--from: value 2026-02-31: give a date, 2026-11-29, or a time, "
                "2026-11-29T04:30:00 (UTC)");
  expectRefused("trend nothing",
                "store 'runs.db': no run has 'nothing': give one of peak_force, seating_depth, "
                "cycle_time");
}

}  // namespace assembly_cell
