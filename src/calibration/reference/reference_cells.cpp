// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "reference_cells.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/csv_text.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/median.h"
#include "assembly_cell/base/table.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {

namespace {

// A cell is at most this long [s], or ten samples: loads by hand change little in it (100 N/s is 2
// N, along a line). Half and twice the time: errors of a run left out differ by less than 1 %.
constexpr double kCellTime = 0.02;
constexpr double kGap = 10.0;  // spacings that end a burst; the recordings' gaps are 1000
// an unloaded cell, of the run's largest wrench: 2 % is 4 N of 200; half and twice tare alike
constexpr double kUnloaded = 0.02;

ReferenceCell cellOf(const ReferenceRun& run, std::size_t first, std::size_t end) {
  ReferenceCell cell;
  cell.first = first;
  cell.count = end - first;
  const auto from = static_cast<Eigen::Index>(first), n = static_cast<Eigen::Index>(cell.count);
  const Eigen::Map<const Eigen::VectorXd> t(&run.t[first], n);
  cell.t = t.mean();
  cell.raw = run.raw.middleRows(from, n).colwise().mean().transpose();
  cell.wrench = run.wrench.middleRows(from, n).colwise().mean().transpose();
  const Eigen::VectorXd offset = t.array() - cell.t;
  if (n >= 3) {
    cell.slope = run.wrench.middleRows(from, n).transpose() * offset / offset.squaredNorm();
  }
  return cell;
}

// Mean of the unloaded cells at the start of the run.
void tare(ReferenceCells& run) {
  double force = 0.0, torque = 0.0;
  const Vector6 start = run.cells.front().wrench;
  for (const ReferenceCell& cell : run.cells) {
    force = std::max(force, (cell.wrench - start).head<3>().norm());
    torque = std::max(torque, (cell.wrench - start).tail<3>().norm());
  }
  run.raw_tare = Eigen::VectorXd::Zero(run.cells.front().raw.size());
  double count = 0.0;
  for (const ReferenceCell& cell : run.cells) {
    const Vector6 load = cell.wrench - start;
    if (load.head<3>().norm() > kUnloaded * force || load.tail<3>().norm() > kUnloaded * torque) {
      break;
    }
    run.raw_tare += cell.raw;
    run.wrench_tare += cell.wrench;
    ++count;
  }
  run.raw_tare /= count;
  run.wrench_tare /= count;
  // a reference that was zeroed reads near nothing when it carries nothing
  run.tared = run.wrench_tare.head<3>().norm() <= 2.0 * kUnloaded * std::max(force, 1e-9);
}

}  // namespace

ReferenceRun readReferenceRun(const std::string& path, int channels, TimeUnit unit) {
  std::vector<std::string> names = {"t"};
  for (int k = 1; k <= channels; ++k) names.push_back("ch" + std::to_string(k));
  for (const char* axis : {"fx", "fy", "fz", "tx", "ty", "tz"}) names.push_back(axis);
  Table table = readTable(path, names);
  const TableTimes times = readTimes(table, unit);
  std::vector<std::size_t> raw;
  while (true) {
    const std::string k = std::to_string(raw.size() + 1);
    const auto column = table.find({"ch" + k, "raw" + k, "s" + k});
    if (!column) break;
    raw.push_back(*column);
  }
  if (raw.size() < 6) table.need({"ch" + std::to_string(raw.size() + 1)});
  const std::vector<std::size_t> wrench = wrenchColumns(table);
  ReferenceRun run;
  run.name = path;
  run.t = times.t;
  run.time_unit = times.unit + ", " + times.reason;
  const auto n = static_cast<Eigen::Index>(table.rows.size());
  run.raw.resize(n, static_cast<Eigen::Index>(raw.size()));
  run.wrench.resize(n, 6);
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    for (std::size_t k = 0; k < raw.size(); ++k) {
      run.raw(row, static_cast<Eigen::Index>(k)) = table.rows[i][raw[k]];
    }
    for (std::size_t k = 0; k < 6; ++k) {
      run.wrench(row, static_cast<Eigen::Index>(k)) = table.rows[i][wrench[k]];
    }
  }
  return run;
}

ReferenceCells cellsOf(const ReferenceRun& run) {
  if (run.t.size() < 20) {
    throw InputError(run.name + ": " + std::to_string(run.t.size()) +
                     " samples: give a recording of 20 at least");
  }
  ReferenceCells out;
  out.spacing = medianSpacing(run.t);
  const double longest = std::max(kCellTime, 10.0 * out.spacing);
  std::size_t first = 0;
  for (std::size_t i = 1; i <= run.t.size(); ++i) {
    const bool gap = i == run.t.size() || run.t[i] - run.t[i - 1] > kGap * out.spacing;
    if (!gap && run.t[i] - run.t[first] < longest) continue;
    out.cells.push_back(cellOf(run, first, i));
    out.bursts += gap;
    first = i;
  }
  tare(out);
  return out;
}

Vector6 referenceAt(const ReferenceCells& run, std::size_t nearest, double t) {
  while (nearest > 0 &&
         std::abs(run.cells[nearest - 1].t - t) < std::abs(run.cells[nearest].t - t)) {
    --nearest;
  }
  while (nearest + 1 < run.cells.size() &&
         std::abs(run.cells[nearest + 1].t - t) < std::abs(run.cells[nearest].t - t)) {
    ++nearest;
  }
  const ReferenceCell& cell = run.cells[nearest];
  return cell.wrench + (t - cell.t) * cell.slope - run.wrench_tare;
}

}  // namespace assembly_cell
