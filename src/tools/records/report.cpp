// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <utility>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/records/report_page.h"
#include "commands.h"
#include "run_source.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp =
    R"(Usage: records report --html FILE [options]
       records report --html FILE --program P --curves PATH... [options]

One HTML page of runs: a table, curves in their bands, trends. Everything is in the file; it needs no network.

  --html FILE            where it goes
  --rules PATH           a file of rules, or a folder of *.yaml; several times: these are used instead of the
                         verdicts in the store
  --quantity Q           of a trend: peak_force, seating_depth, cycle_time or the name of an estimate; several times (the
                         first three)
  --title TEXT           (Records of assemblies)
)";
constexpr const char* kHelpEnd = R"(  --limit N              the latest N of them (200); 0: all
  --help                 print this

Exit code: 0 ok, 2 bad input.

Example: records report --rules plate.yaml --html plate.html
)";

constexpr std::int64_t kShown = 200;

// Points of runs in the order of time.
std::vector<TrendPoint> pointsOf(const std::vector<Run>& runs, const std::string& quantity) {
  std::vector<TrendPoint> points;
  for (const Run& run : runs) {
    const double value = trendValue(run, quantity);
    if (std::isfinite(value)) points.push_back({run.id, run.start, value});
  }
  return points;
}

ReportTrend trendOf(const std::vector<Run>& runs, const std::string& quantity,
                    const EwmaSettings& settings) {
  ReportTrend trend;
  trend.quantity = quantity;
  trend.points = pointsOf(runs, quantity);
  std::vector<double> values;
  for (const TrendPoint& point : trend.points) values.push_back(point.value);
  try {
    trend.chart = ewmaChart(values, settings);
  } catch (const InputError& error) {
    trend.chart_reason = error.what();
  }
  return trend;
}

}  // namespace

int reportRuns(const std::vector<std::string>& arguments) {
  std::string html, title = "Records of assemblies";
  std::vector<std::string> paths, quantities;
  EwmaSettings settings;
  OptionParser parser(std::string(kHelp) + kSourceHelp + kFilterHelp + kChartHelp + kHelpEnd);
  RunSource source(parser, kShown);
  parser.text("--html", html);
  parser.text("--title", title);
  parser.texts("--rules", paths);
  parser.texts("--quantity", quantities);
  declareChart(parser, settings);
  if (!parser.parse(arguments)) return 0;
  if (html.empty()) throw InputError("--html: missing: give the page's file");
  const RunRules rules(paths);
  std::vector<Run> runs;
  source.each([&](Run& run) {
    if (!paths.empty()) run.verdicts = rules.evaluate(run);
    runs.push_back(std::move(run));
  });
  const bool given = !quantities.empty();
  if (!given) quantities = {"peak_force", "seating_depth", "cycle_time"};
  std::vector<ReportTrend> trends;
  for (const std::string& quantity : quantities) {
    ReportTrend trend = trendOf(runs, quantity, settings);
    if (!trend.points.empty()) {
      trends.push_back(std::move(trend));
    } else if (given) {
      throw InputError("--quantity: value " + quantity + ": no run has it");
    }
  }
  std::reverse(runs.begin(), runs.end());  // latest first
  writeFileAtomically(html, reportPage(title, runs, rules, trends), html);
  const auto failed = std::count_if(runs.begin(), runs.end(), [](const Run& run) {
    return std::any_of(run.verdicts.begin(), run.verdicts.end(),
                       [](const RunVerdict& v) { return !v.passed; });
  });
  std::cout << "page: " << yamlQuoted(html) << "\nruns: " << runs.size()
            << "\nout_of_rules: " << failed << "\n";
  return 0;
}

}  // namespace assembly_cell
