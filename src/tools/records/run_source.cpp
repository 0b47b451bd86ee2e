// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "run_source.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <iterator>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/records/import.h"

namespace assembly_cell {
namespace {

constexpr std::size_t kProgress = 1000;  // runs between two lines

bool parseIds(const std::string& text, std::pair<std::int64_t, std::int64_t>& ids) {
  const std::size_t dash = text.find('-');
  long first = 0, last = 0;
  if (!parseInteger(text.substr(0, dash), first)) return false;
  last = first;
  if (dash != std::string::npos && !parseInteger(text.substr(dash + 1), last)) return false;
  ids = {first, last};
  return first > 0 && last >= first;
}

}  // namespace

RunSource::RunSource(OptionParser& parser, std::int64_t limit)
    : parser_(parser), store_(parser), filter_(parser, limit) {
  parser.texts("--curves", curves_);
  parser.value("--runs", "give ids as 7 or 3-9, several with commas", [this](const std::string& v) {
    for (std::size_t at = 0; at <= v.size();) {
      const std::size_t end = std::min(v.find(',', at), v.size());
      ids_.emplace_back();
      if (!parseIds(v.substr(at, end - at), ids_.back())) return false;
      at = end + 1;
    }
    return true;
  });
  parser.choice("--time-unit", unit_, kTimeUnitChoices);
}

std::string RunSource::program() const {
  const std::string program = filter_.filter().program;
  if (program.empty()) throw InputError("--program: missing: give the name of what is assembled");
  return program;
}

std::vector<std::int64_t> RunSource::select(const RunStore& store) const {
  std::vector<std::int64_t> selected;
  for (const RunSummary& row : store.list(filter_.filter())) selected.push_back(row.id);
  std::reverse(selected.begin(), selected.end());
  if (ids_.empty()) return selected;
  std::vector<std::int64_t> chosen;
  const auto isIn = [](std::int64_t id, const std::pair<std::int64_t, std::int64_t>& ids) {
    return id >= ids.first && id <= ids.second;
  };
  for (const auto& ids : ids_) {
    const bool any = std::any_of(selected.begin(), selected.end(),
                                 [&](std::int64_t id) { return isIn(id, ids); });
    if (any) continue;
    throw InputError("--runs: value " + std::to_string(ids.first) +
                     ": no such run in the store, or another option leaves it out");
  }
  std::copy_if(selected.begin(), selected.end(), std::back_inserter(chosen), [&](std::int64_t id) {
    return std::any_of(ids_.begin(), ids_.end(), [&](const auto& ids) { return isIn(id, ids); });
  });
  return chosen;
}

std::size_t RunSource::eachOfStore(const std::function<void(Run&)>& use) {
  parser_.onlyWith("--curves", {"--time-unit"});
  const RunStore store = store_.open();
  const std::vector<std::int64_t> selected = select(store);
  std::size_t count = 0;
  for (const std::int64_t id : selected) {
    Run run = store.read(id);
    use(run);
    if (++count % kProgress == 0) {
      std::cerr << "records: " << count << " of " << selected.size() << " runs\n";
    }
  }
  return count;
}

std::size_t RunSource::eachOfFiles(const std::function<void(Run&)>& use) {
  parser_.notWith("--curves", {"--store", "--runs", "--serial", "--station", "--result", "--passed",
                               "--failed", "--from", "--to", "--limit"});
  std::size_t count = 0;
  for (Run& run : readCurves(curves_, unit_)) {
    run.program = filter_.filter().program;
    run.id = static_cast<std::int64_t>(++count);
    use(run);
  }
  return count;
}

std::size_t RunSource::each(const std::function<void(Run&)>& use) {
  const std::size_t count = curves_.empty() ? eachOfStore(use) : eachOfFiles(use);
  if (count == 0) {
    throw InputError((curves_.empty() ? store_.path() : curves_.front()) +
                     ": no run is left by the options");
  }
  return count;
}

std::vector<Run> readCurves(const std::vector<std::string>& paths, TimeUnit unit) {
  std::vector<Run> all;
  for (const std::string& path : paths) {
    std::error_code error;
    std::vector<Run> runs = std::filesystem::is_directory(path, error) ? readCurveFolder(path, unit)
                                                                       : readCurveFile(path, unit);
    std::move(runs.begin(), runs.end(), std::back_inserter(all));
  }
  return all;
}

double trendValue(const Run& run, const std::string& quantity) {
  if (quantity == "cycle_time") return run.duration;
  if (quantity == "seating_depth") {
    return run.curve.depth.empty() ? std::nan("") : run.curve.depth.back();
  }
  if (quantity == "peak_force") {
    double peak = std::nan("");
    for (const double force : run.curve.axial) {
      if (!(force <= peak) && std::isfinite(force)) peak = force;
    }
    return peak;
  }
  for (const RunEstimate& estimate : run.estimates) {
    if (estimate.name == quantity) return estimate.value;
  }
  return std::nan("");
}

void declareChart(OptionParser& parser, EwmaSettings& settings) {
  parser.number("--lambda", settings.lambda, 1e-6, 1.0);
  parser.number("--width", settings.L, 1e-3, 100.0);
  parser.integer("--baseline", settings.baseline, 2, 1000000000);
}

}  // namespace assembly_cell
