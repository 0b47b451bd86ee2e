// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/report_page.h"

#include <gtest/gtest.h>

#include <cmath>
#include <regex>

namespace assembly_cell {
namespace {

using Record = Run;  // testing::Test::Run hides it

Record runOf(std::int64_t id, double force) {
  Record run;
  run.id = id;
  run.serial = "<script>alert(1)</script>\x01";
  run.program = "plate & peg";
  run.result = "seated";
  run.start = 1.7e9;
  for (int i = 0; i < 100; ++i) {
    run.curve.time.push_back(0.1 * i);
    run.curve.depth.push_back(1e-4 * i);
    run.curve.axial.push_back(i == 50 ? force : 1.0);
  }
  run.curve.lateral = run.curve.moment = run.curve.tilt = run.curve.axial;
  RunVerdict verdict;
  verdict.rule = "band";
  verdict.passed = force < 10.0;
  verdict.text = verdict.passed ? "inside" : "left at 5 mm";
  run.verdicts.push_back(verdict);
  return run;
}

std::size_t count(const std::string& page, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = page.find(what); at != std::string::npos; at = page.find(what, at + 1)) ++n;
  return n;
}

TEST(ReportPage, IsSelfContainedAndHasEveryRunOnce) {
  ReportTrend trend;
  trend.quantity = "peak_force";
  trend.points = {{1, 1.7e9, 5.0}, {2, 1.7e9, 20.0}, {3, 1.7e9, 5.5}};
  trend.chart_reason = "too few";
  const std::string page =
      reportPage("Parts", {runOf(3, 5.5), runOf(2, 20.0), runOf(1, 5.0)}, RunRules(), {trend});
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_FALSE(std::regex_search(page, std::regex("(src|href|url)\\s*[=(]|https?:|@import")));
  EXPECT_EQ(count(page, "<polyline class=\"good\""), 2u);
  EXPECT_EQ(count(page, "<polyline class=\"bad\""), 1u);
  EXPECT_EQ(count(page, "<td class=\"failed\">out</td>"), 1u);
  EXPECT_NE(page.find("3 runs, 3 evaluated, 1 out of their rules"), std::string::npos);
  EXPECT_NE(page.find("plate &amp; peg"), std::string::npos);
  EXPECT_NE(page.find("left at 5 mm"), std::string::npos);
  EXPECT_NE(page.find("prefers-color-scheme: dark"), std::string::npos);
  EXPECT_EQ(count(page, "<svg"), count(page, "</svg>"));
  EXPECT_EQ(page.find("nan"), std::string::npos);
  EXPECT_EQ(page.find('\x01'), std::string::npos);
}

TEST(ReportPage, APeakOfOneSampleIsDrawn) {
  const std::string low = reportPage("Parts", {runOf(1, 1.0)}, RunRules(), {});
  const std::string high = reportPage("Parts", {runOf(1, 9.0)}, RunRules(), {});
  EXPECT_NE(low, high);
}

TEST(ReportPage, CurvesWithoutNumbersAndNoRunsGiveAPage) {
  Record run = runOf(1, 5.0);
  for (double& depth : run.curve.depth) depth = std::nan("");
  for (double& axial : run.curve.axial) axial = std::nan("");
  EXPECT_EQ(reportPage("Parts", {run}, RunRules(), {}).find("nan"), std::string::npos);
  EXPECT_NE(reportPage("Parts", {}, RunRules(), {}).find("0 runs"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
