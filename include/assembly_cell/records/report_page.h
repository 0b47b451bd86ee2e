// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/records/charts.h"
#include "assembly_cell/records/run.h"
#include "assembly_cell/records/store.h"
#include "assembly_cell/records/verdict.h"

namespace assembly_cell {

/// A number of each run, with its chart and capability where they could be computed.
struct ReportTrend {
  std::string quantity;  ///< as RunStore::trend() has it
  std::vector<TrendPoint> points;
  std::optional<EwmaChart> chart;
  std::string chart_reason;  ///< why there is no chart
  std::optional<Capability> capability;
};

/// One self-contained HTML page: a table of the runs, their curves with the bands of the rules, and
/// trends. Inline SVG and CSS, for a light and a dark ground, no script, no network.
std::string reportPage(const std::string& title, const std::vector<Run>& runs,
                       const RunRules& rules, const std::vector<ReportTrend>& trends);

}  // namespace assembly_cell
