// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/report_page.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>

#include "assembly_cell/base/text.h"
#include "assembly_cell/records/band.h"
#include "page/svg_plot.h"
#include "verdict/cells.h"

namespace assembly_cell {
namespace {

// colours of one hue on a light and on a dark ground have a contrast of at least 4.5 to it
constexpr const char* kStyle = R"(<style>
:root { color-scheme: light dark; --ground: #ffffff; --ink: #1c1c1c; --soft: #5f5f5f; --rule: #dddddd;
  --good: #1f6f43; --bad: #b3261e; --band: #2b6cb0; }
@media (prefers-color-scheme: dark) { :root { --ground: #16181b; --ink: #e8e8e8; --soft: #a0a0a0; --rule: #33373c;
  --good: #6fcf97; --bad: #ff8a80; --band: #7fb2e8; } }
body { background: var(--ground); color: var(--ink); font: 15px/1.45 system-ui, sans-serif; margin: 2em auto;
  max-width: 72em; padding: 0 1em; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; width: 100%; font-size: 0.9em; }
th, td { text-align: left; padding: 0.25em 0.6em; border-bottom: 1px solid var(--rule); vertical-align: top; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
.passed { color: var(--good); } .failed { color: var(--bad); font-weight: 600; } .none, p.note { color: var(--soft); }
svg { width: 100%; height: auto; } svg text { fill: var(--soft); font: 12px system-ui, sans-serif; }
svg .grid { stroke: var(--rule); } svg polyline { fill: none; stroke-width: 1.2; }
svg polyline.good { stroke: var(--good); opacity: 0.45; } svg polyline.bad { stroke: var(--bad); stroke-width: 1.6; }
svg polyline.plain { stroke: var(--soft); opacity: 0.6; } svg polyline.limit { stroke: var(--bad); stroke-dasharray: 5 4; }
svg polyline.mean { stroke: var(--band); stroke-width: 2; } svg polygon.band { fill: var(--band); opacity: 0.18; }
svg circle.good { fill: var(--soft); } svg circle.bad { fill: var(--bad); }
</style>
)";

constexpr std::size_t kTrendPoints = 2000;  // drawn, the latest

struct Quality {
  const char* style;
  std::string word;
};

bool hasFailed(const Run& run) {
  return std::any_of(run.verdicts.begin(), run.verdicts.end(),
                     [](const RunVerdict& v) { return !v.passed; });
}

Quality qualityOf(const Run& run) {
  if (run.verdicts.empty()) return {"none", "no rule"};
  return hasFailed(run) ? Quality{"failed", "out"} : Quality{"passed", "in"};
}

std::string dateText(double start) {
  if (!(start > 0.0)) return "–";
  const auto seconds = static_cast<std::time_t>(start);
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char shown[32];
  std::strftime(shown, sizeof shown, "%Y-%m-%d %H:%M:%S", &utc);
  return shown;
}

std::string numberCell(double value, double scale, int digits) {
  return "<td class=\"number\">" +
         (std::isfinite(value) ? text("%.*f", digits, scale * value) : std::string("–")) + "</td>";
}

std::string verdictText(const Run& run) {
  std::string out;
  for (const RunVerdict& v : run.verdicts) {
    if (v.passed && hasFailed(run)) continue;
    out += (out.empty() ? "" : "; ") + v.rule + ": " + v.text;
  }
  return out;
}

double largest(const std::vector<double>& values) {
  PlotRange range;
  for (const double value : values) range.add(value);
  return range.empty() ? std::nan("") : range.high;
}

std::string runTable(const std::vector<Run>& runs) {
  std::string out =
      "<table>\n<tr><th class=\"number\">run</th><th>serial</th><th>program</th><th>start "
      "(UTC)</th>"
      "<th>result</th><th>verdict</th><th class=\"number\">peak [N]</th><th class=\"number\">depth "
      "[mm]</th><th class=\"number\">time [s]</th><th>what decides</th></tr>\n";
  for (const Run& run : runs) {
    const Quality quality = qualityOf(run);
    const auto cell = [&out](const std::string& value) {
      out += "<td>" + escaped(value) + "</td>";
    };
    out += text("<tr><td class=\"number\">%lld</td>", static_cast<long long>(run.id));
    cell(run.serial);
    cell(run.program);
    out += "<td>" + dateText(run.start) + "</td>";
    cell(run.failure.empty() ? run.result : run.result + ": " + run.failure);
    out += text("<td class=\"%s\">%s</td>", quality.style, quality.word.c_str());
    out += numberCell(largest(run.curve.axial), 1.0, 2);
    out += numberCell(run.curve.depth.empty() ? std::nan("") : run.curve.depth.back(), 1e3, 3);
    out += numberCell(run.duration, 1.0, 2);
    cell(verdictText(run));
    out += "</tr>\n";
  }
  return out + "</table>\n";
}

std::vector<double> scaled(std::vector<double> values, double scale) {
  for (double& value : values) value *= scale;
  return values;
}

const char* unitOf(const std::string& quantity) {
  return quantity == "moment" ? "N m" : quantity == "tilt" ? "rad" : "N";
}

// Steps at the bounds of the cells.
void drawBand(SvgPlot& plot, const Band& band, const BandChannel& channel, double scale) {
  std::vector<double> x, low, high;
  for (std::size_t k = 0; k < band.cells(); ++k) {
    for (const std::size_t bound : {k, k + 1}) {
      x.push_back(scale * (band.from + band.step * static_cast<double>(bound)));
      low.push_back(band.lowest(channel, k));
      high.push_back(band.highest(channel, k));
    }
  }
  plot.area("band", x, low, high);
}

std::string curvePlot(const std::vector<const Run*>& runs, const Band* band,
                      const std::string& quantity, bool over_time) {
  PlotRange x, y;
  const double scale = over_time ? 1.0 : 1e3;
  for (const Run* run : runs) {
    const std::vector<double>& path = pathOf(run->curve, over_time);
    const std::vector<double>& values = curveValues(run->curve, quantity);
    for (std::size_t i = 0; i < path.size(); ++i) {
      if (!std::isfinite(path[i]) || !std::isfinite(values[i])) continue;
      x.add(scale * path[i]);
      y.add(values[i]);
    }
  }
  if (x.empty()) return "";
  const BandChannel* channel = nullptr;
  for (std::size_t i = 0; band != nullptr && i < band->channels.size(); ++i) {
    if (band->channels[i].quantity == quantity) channel = &band->channels[i];
  }
  for (std::size_t k = 0; channel != nullptr && k < band->cells(); ++k) {
    y.add(band->lowest(*channel, k));
    y.add(band->highest(*channel, k));
  }
  SvgPlot plot(x, y, over_time ? "time [s]" : "depth [mm]",
               quantity + " [" + unitOf(quantity) + "]");
  if (channel != nullptr) drawBand(plot, *band, *channel, scale);
  for (const bool failed : {false, true}) {
    for (const Run* run : runs) {
      if (hasFailed(*run) != failed) continue;
      const char* style = run->verdicts.empty() ? "plain" : failed ? "bad" : "good";
      plot.line(style, scaled(pathOf(run->curve, over_time), scale),
                curveValues(run->curve, quantity),
                text("run %lld, ", static_cast<long long>(run->id)) + run->serial + ": " +
                    qualityOf(*run).word);
    }
  }
  return plot.finish();
}

std::string curves(const std::string& program, const std::vector<const Run*>& runs,
                   const RunRules& rules) {
  const Band* band = rules.band(program);
  std::string out = "<h2>Curves: " + escaped(program.empty() ? "no program" : program) + "</h2>\n";
  if (band != nullptr) {
    out += text(
        "<p class=\"note\">Band from %zu + %zu good runs, rate of false alarms at most %g, "
        "limit %.3g standard deviations.</p>\n",
        band->learnt, band->calibrated, band->alpha, band->limit);
  } else {
    out += "<p class=\"note\">No band among the rules.</p>\n";
  }
  bool any_depth = false;
  for (const Run* run : runs) any_depth = any_depth || std::isfinite(largest(run->curve.depth));
  const bool over_time = band != nullptr ? band->over_time : !any_depth;
  std::vector<std::string> quantities = {"axial"};
  for (std::size_t i = 0; band != nullptr && i < band->channels.size(); ++i) {
    const std::string& quantity = band->channels[i].quantity;
    if (i == 0) quantities.clear();
    quantities.push_back(quantity);
  }
  for (const std::string& quantity : quantities) out += curvePlot(runs, band, quantity, over_time);
  return out;
}

std::string capabilityText(const Capability& c) {
  std::string out = text("Cpk %.2f (95 %%: %.2f to %.2f)", c.cpk.estimate, c.cpk.low, c.cpk.high);
  if (std::isfinite(c.cp.estimate)) {
    out += text(", Cp %.2f (%.2f to %.2f)", c.cp.estimate, c.cp.low, c.cp.high);
  }
  return out + text(", %zu runs. ", c.n);
}

std::string trendSection(const ReportTrend& trend) {
  std::string out = "<h2>Trend: " + escaped(trend.quantity) + "</h2>\n<p class=\"note\">";
  if (trend.capability) out += capabilityText(*trend.capability);
  if (trend.chart) {
    out += text(
        "Mean %.6g, standard deviation %.3g of the first %zu runs; %zu points of the moving "
        "average are outside of its limits.",
        trend.chart->mean, trend.chart->sd, trend.chart->baseline, trend.chart->outside);
  } else {
    out += "No control chart: " + escaped(trend.chart_reason);
  }
  out += "</p>\n";
  const std::size_t count = trend.points.size();
  const std::size_t first = count > kTrendPoints ? count - kTrendPoints : 0;
  std::vector<double> n, value, chart_n, z, low, high;
  std::vector<std::string> titles;
  PlotRange x, y;
  for (std::size_t i = first; i < count; ++i) {
    const TrendPoint& point = trend.points[i];
    x.add(static_cast<double>(i + 1));
    y.add(point.value);
    n.push_back(static_cast<double>(i + 1));
    value.push_back(point.value);
    titles.push_back(text("run %lld: %.6g", static_cast<long long>(point.id), point.value));
    if (!trend.chart || i < trend.chart->baseline) continue;
    const EwmaPoint& at = trend.chart->points[i - trend.chart->baseline];
    chart_n.push_back(static_cast<double>(i + 1));
    z.push_back(at.z);
    low.push_back(at.low);
    high.push_back(at.high);
    for (const double v : {at.z, at.low, at.high}) y.add(v);
  }
  SvgPlot plot(x, y, "run in the order of time", trend.quantity);
  plot.dots("good", n, value, titles);
  plot.line("limit", chart_n, low, "lower limit");
  plot.line("limit", chart_n, high, "upper limit");
  plot.line("mean", chart_n, z, "exponentially weighted moving average");
  return out + plot.finish();
}

}  // namespace

std::string reportPage(const std::string& title, const std::vector<Run>& runs,
                       const RunRules& rules, const std::vector<ReportTrend>& trends) {
  std::size_t evaluated = 0, failed = 0;
  std::map<std::string, std::vector<const Run*>> programs;
  for (const Run& run : runs) {
    evaluated += run.verdicts.empty() ? 0 : 1;
    failed += hasFailed(run) ? 1 : 0;
    programs[run.program].push_back(&run);
  }
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta "
      "name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\">\n<title>" +
      escaped(title) + "</title>\n" + kStyle + "</head>\n<body>\n<h1>" + escaped(title) +
      "</h1>\n" +
      text("<p id=\"summary\">%zu runs, %zu evaluated, %zu out of their rules.</p>\n", runs.size(),
           evaluated, failed);
  for (const auto& [program, of] : programs) out += curves(program, of, rules);
  for (const ReportTrend& trend : trends) out += trendSection(trend);
  out += "<h2>Runs</h2>\n" + runTable(runs);
  return out + "</body>\n</html>\n";
}

}  // namespace assembly_cell
