// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/records/charts.h"
#include "commands.h"
#include "run_source.h"

namespace assembly_cell {
namespace {

constexpr const char* kHelp = R"(Usage: records trend QUANTITY [options]

A quantity over the runs, the earliest first, as YAML: number of runs, mean, standard deviation, extremes, and each
run's number, start (since 1970 [s]) and value. QUANTITY: peak_force [N], seating_depth [m], cycle_time [s], or the
name of an estimate, such as hole_x [m]. Besides a control chart, the moving average of the runs after a baseline within
its limits, and with --spec the capability with its 95 % interval. Formulas: docs/theory/records.md

  --spec LOW,HIGH        limits of the quantity
)";
constexpr const char* kHelpEnd =
    R"(  --limit N              the latest N of them (default 1000); 0: all
  --store FILE           the store (default: ~/.ros/assembly_cell/records.db, or below ROS_HOME)
  --help                 print this

Example: records trend peak_force --program plate
)";

void printChart(const std::vector<TrendPoint>& points, const std::vector<double>& values,
                const EwmaSettings& settings) {
  try {
    const EwmaChart chart = ewmaChart(values, settings);
    const std::string first =
        chart.outside == 0 ? "null" : std::to_string(points[chart.first_outside].id);
    std::cout << "chart: "
              << YamlMapping()
                     .integer("baseline", static_cast<long>(chart.baseline))
                     .number("mean", chart.mean)
                     .number("sd", chart.sd)
                     .integer("outside", static_cast<long>(chart.outside))
                     .add("first_outside", first)
                     .number("now", chart.points.back().z)
                     .number("low", chart.points.back().low)
                     .number("high", chart.points.back().high)
                     .text()
              << "\n";
  } catch (const InputError& error) {
    std::cout << "chart: null  # " << error.what() << "\n";
  }
}

void printCapability(const Capability& c) {
  const auto interval = [](const Interval& i) {
    return YamlMapping()
        .number("estimate", i.estimate)
        .number("low", i.low)
        .number("high", i.high)
        .text();
  };
  std::cout << "capability: {cp: " << interval(c.cp) << ", cpk: " << interval(c.cpk) << "}\n";
}

}  // namespace

int trendOfRuns(const std::vector<std::string>& arguments) {
  std::string quantity;
  OptionParser parser(std::string(kHelp) + kChartHelp + kFilterHelp + kHelpEnd);
  parser.file("quantity", quantity);
  std::array<double, 2> spec = {0.0, 0.0};
  parser.numbers("--spec", spec.data(), spec.size());
  EwmaSettings settings;
  declareChart(parser, settings);
  const FilterOptions options(parser, 1000);
  StoreOption store(parser);
  if (!parser.parse(arguments)) return 0;
  const std::vector<TrendPoint> points = store.open().trend(quantity, options.filter());
  const auto n = static_cast<double>(points.size());
  double sum = 0.0, squares = 0.0, low = INFINITY, high = -INFINITY;
  for (const TrendPoint& point : points) {
    sum += point.value;
    low = std::min(low, point.value);
    high = std::max(high, point.value);
  }
  for (const TrendPoint& point : points) squares += std::pow(point.value - sum / n, 2);
  std::cout << "quantity: " << quantity << "\nruns: " << points.size()
            << "\nmean: " << yamlNumber(sum / n)
            << "\nsd: " << yamlNumber(std::sqrt(squares / (n - 1.0)))
            << "\nmin: " << yamlNumber(low) << "\nmax: " << yamlNumber(high) << "\n";
  std::vector<double> values;
  for (const TrendPoint& point : points) values.push_back(point.value);
  printChart(points, values, settings);
  if (parser.given("--spec")) printCapability(capability(values, spec[0], spec[1]));
  std::cout << "values:" << (points.empty() ? " []\n" : "\n");
  for (const TrendPoint& point : points) {
    std::cout << "  - [" << point.id << ", " << yamlNumber(point.start) << ", "
              << yamlNumber(point.value) << "]\n";
  }
  return 0;
}

}  // namespace assembly_cell
