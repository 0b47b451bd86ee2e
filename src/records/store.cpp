// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/store.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>
#include <variant>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "curve_blob.h"
#include "store_file.h"

namespace assembly_cell {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

using Texts = std::map<std::string, std::string>;
struct Properties {
  const char* kind;
  Texts Run::*texts;
};
constexpr Properties kProperties[] = {{"version", &Run::versions},
                                      {"calibration", &Run::calibrations},
                                      {"setting", &Run::settings},
                                      {"simulation", &Run::simulation}};

[[noreturn]] void refuseRun(const std::string& where, const Run& run, const std::string& what) {
  throw InputError(where + ": the run of part '" + printable(run.serial) +
                   "' is not stored: " + what);
}

void checkNumber(const std::string& where, const Run& run, const std::string& name, double value) {
  if (std::isfinite(value)) return;
  refuseRun(where, run, name + text(": value %g: give a finite number", value));
}

// Each channel is measured in all samples or in none.
void checkCurve(const std::string& where, const Run& run) {
  const Curve& curve = run.curve;
  bool measured[kCurveChannels.size()] = {};
  for (std::size_t k = 0; k < kCurveChannels.size(); ++k) {
    const std::vector<double>& values = curve.*kCurveChannels[k].values;
    const std::string name = std::string("curve.") + kCurveChannels[k].name;
    if (values.size() != curve.size()) {
      refuseRun(where, run,
                name + text(": has %zu samples, time has %zu: give as many", values.size(),
                            curve.size()));
    }
    measured[k] =
        !std::all_of(values.begin(), values.end(), [](double v) { return std::isnan(v); });
    for (std::size_t i = 0; measured[k] && i < values.size(); ++i) {
      checkNumber(where, run, name + "[" + std::to_string(i) + "]", values[i]);
    }
  }
  if (curve.size() == 0) return;
  if (!measured[0] && !measured[1]) {
    refuseRun(where, run, "curve: neither time nor depth is measured: give one of them");
  }
  if (!measured[2]) refuseRun(where, run, "curve.axial: is not measured: give the axial force");
}

void checkRun(const std::string& where, const Run& run) {
  checkNumber(where, run, "start", run.start);
  checkNumber(where, run, "duration", run.duration);
  for (const RunEstimate& e : run.estimates) {
    checkNumber(where, run, "estimate " + e.name, e.value);
    checkNumber(where, run, "sd of estimate " + e.name, e.sd);
  }
  for (const RunVerdict& v : run.verdicts) {
    if (!std::isnan(v.margin)) checkNumber(where, run, "margin of verdict " + v.rule, v.margin);
    if (!std::isnan(v.depth)) checkNumber(where, run, "depth of verdict " + v.rule, v.depth);
  }
  for (const RunEvent& e : run.events) checkNumber(where, run, "time of event " + e.kind, e.time);
  checkCurve(where, run);
}

// NULL of the table is NaN.
double numberOf(const SQLite::Column& column) {
  return column.isNull() ? kNone : column.getDouble();
}

using Value = std::variant<std::int64_t, double, std::string>;

// Values in the order of the statement's question marks.
template <class... Values>
void bindAll(SQLite::Statement& statement, const Values&... values) {
  int i = 0;
  (statement.bind(++i, values), ...);
}

// The condition of a filter on run r and part p, and its values.
struct Condition {
  std::string sql = " WHERE 1";
  std::vector<Value> values;

  explicit Condition(const RunFilter& filter) {
    add("p.serial = ?", filter.serial);
    add("p.program = ?", filter.program);
    add("p.station = ?", filter.station);
    add("r.result = ?", filter.result);
    if (filter.passed)
      sql += *filter.passed ? " AND r.verdicts > 0 AND r.failed = 0" : " AND r.failed > 0";
    if (std::isfinite(filter.from)) add("r.start >= ?", Value(filter.from));
    if (std::isfinite(filter.to)) add("r.start < ?", Value(filter.to));
  }
  void add(const char* condition, const std::string& value) {
    if (!value.empty()) add(condition, Value(value));
  }
  void add(const char* condition, const Value& value) {
    sql += std::string(" AND ") + condition;
    values.push_back(value);
  }
  void bind(SQLite::Statement& statement, int first) const {
    for (const Value& value : values) {
      std::visit([&](const auto& one) { statement.bind(first, one); }, value);
      ++first;
    }
  }
};

// The latest first; of the same start: `then`.
std::string latest(const RunFilter& filter, const char* then) {
  return std::string(" ORDER BY r.start DESC") + then +
         (filter.limit > 0 ? " LIMIT " + std::to_string(filter.limit) : std::string());
}

}  // namespace

std::string defaultRunStore() { return dataFolder("store of runs") + "/records.db"; }

struct RunStore::Database : StoreFile {
  using StoreFile::StoreFile;

  std::int64_t part(const Run& run);
  void insertRows(std::int64_t id, const Run& run);
  Run readRows(std::int64_t id);
  Curve curve(std::int64_t id, std::int64_t samples, const std::string& bytes);
  std::string names();
};

RunStore::RunStore(const std::string& path, Access access)
    : database_(std::make_unique<Database>(path, access)) {}
RunStore::~RunStore() = default;
RunStore::RunStore(RunStore&&) noexcept = default;
RunStore& RunStore::operator=(RunStore&&) noexcept = default;

void RunStore::checkWritable() {
  Database& d = *database_;
  d.checkSame();
  d.checkSpace();
  d.guarded([&] {
    // rolled back at the scope's end
    const SQLite::Transaction lock(d.database(), SQLite::TransactionBehavior::IMMEDIATE);
  });
}

std::int64_t RunStore::Database::part(const Run& run) {
  SQLite::Statement& find = statement(
      "SELECT id FROM part WHERE serial = ? AND program = ? AND program_hash = ? AND station = ?");
  bindAll(find, run.serial, run.program, run.program_hash, run.station);
  const bool found = find.executeStep();
  const std::int64_t id = found ? find.getColumn(0).getInt64() : 0;
  find.reset();
  if (found) return id;
  SQLite::Statement& insert =
      statement("INSERT INTO part(serial, program, program_hash, station) VALUES(?, ?, ?, ?)");
  bindAll(insert, run.serial, run.program, run.program_hash, run.station);
  insert.exec();
  return database().getLastInsertRowid();
}

void RunStore::Database::insertRows(std::int64_t id, const Run& run) {
  for (const Properties& properties : kProperties) {
    for (const auto& [key, value] : run.*properties.texts) {
      SQLite::Statement& s = statement("INSERT INTO property VALUES(?, ?, ?, ?)");
      bindAll(s, id, properties.kind, key, value);
      s.exec();
    }
  }
  std::int64_t position = 0;
  for (const RunEstimate& e : run.estimates) {
    SQLite::Statement& s = statement("INSERT INTO estimate VALUES(?, ?, ?, ?, ?)");
    bindAll(s, id, position++, e.name, e.value, e.sd);
    s.exec();
  }
  position = 0;
  for (const RunVerdict& v : run.verdicts) {
    SQLite::Statement& s = statement("INSERT INTO verdict VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)");
    bindAll(s, id, position++, v.rule, v.kind, v.passed ? 1 : 0, v.margin, v.depth, v.quantity,
            v.text);
    s.exec();
  }
  position = 0;
  for (const RunEvent& e : run.events) {
    SQLite::Statement& s = statement("INSERT INTO event VALUES(?, ?, ?, ?, ?)");
    bindAll(s, id, position++, e.time, e.kind, e.text);
    s.exec();
  }
}

void RunStore::append(Run& run) {
  Database& d = *database_;
  checkRun(d.where(), run);
  d.checkSame();
  const Curve& curve = run.curve;
  const std::string bytes = packCurve(curve);
  const double peak =
      curve.size() > 0 ? *std::max_element(curve.axial.begin(), curve.axial.end()) : kNone;
  const auto failed = std::count_if(run.verdicts.begin(), run.verdicts.end(),
                                    [](const RunVerdict& v) { return !v.passed; });
  Run stored = run;
  d.guarded([&] {
    SQLite::Transaction transaction(d.database(), SQLite::TransactionBehavior::IMMEDIATE);
    stored.id = d.database().execAndGet("SELECT ifnull(max(id), 0) + 1 FROM run").getInt64();
    if (stored.serial.empty()) stored.serial = "run-" + std::to_string(stored.id);
    SQLite::Statement& s =
        d.statement("INSERT INTO run VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
    bindAll(s, stored.id, d.part(stored), run.start, run.duration, run.strategy, run.result,
            run.failure, run.text, peak, curve.size() > 0 ? curve.depth.back() : kNone,
            static_cast<std::int64_t>(run.verdicts.size()), static_cast<std::int64_t>(failed));
    s.exec();
    if (curve.size() > 0) {
      SQLite::Statement& c = d.statement("INSERT INTO curve VALUES(?, ?, ?)");
      bindAll(c, stored.id, static_cast<std::int64_t>(curve.size()));
      c.bind(3, bytes.data(), static_cast<int>(bytes.size()));
      c.exec();
    }
    d.insertRows(stored.id, run);
    transaction.commit();
  });
  run.id = stored.id;
  run.serial = stored.serial;
}

Curve RunStore::Database::curve(std::int64_t id, std::int64_t samples, const std::string& bytes) {
  std::optional<Curve> curve =
      samples < 0 ? std::nullopt : unpackCurve(bytes, static_cast<std::size_t>(samples));
  if (curve) return *std::move(curve);
  throw InputError(where() + ": the curve of run " + std::to_string(id) +
                   " is damaged: restore a copy of the store");
}

Run RunStore::Database::readRows(std::int64_t id) {
  Run run;
  run.id = id;
  SQLite::Statement& s = statement(
      "SELECT p.serial, p.program, p.program_hash, p.station, r.start, r.duration, r.strategy, "
      "r.result, r.failure, r.text FROM run r JOIN part p ON p.id = r.part WHERE r.id = ?");
  bindAll(s, id);
  if (!s.executeStep()) {
    const auto last = database().execAndGet("SELECT ifnull(max(id), 0) FROM run").getInt64();
    throw InputError(where() + ": there is no run " + std::to_string(id) + ": " +
                     (last > 0 ? "the last one is " + std::to_string(last) : "it has none yet"));
  }
  std::string* const texts[] = {&run.serial,  &run.program, &run.program_hash, &run.station,
                                nullptr,      nullptr,      &run.strategy,     &run.result,
                                &run.failure, &run.text};
  for (int i = 0; i < 10; ++i) {
    if (texts[i] != nullptr) *texts[i] = s.getColumn(i).getString();
  }
  run.start = s.getColumn(4).getDouble();
  run.duration = s.getColumn(5).getDouble();
  s.reset();

  const auto rows = [&](const char* sql, const auto& row) {
    SQLite::Statement& of_run = statement(sql);
    bindAll(of_run, id);
    while (of_run.executeStep()) row([&](int i) { return of_run.getColumn(i); });
  };
  rows("SELECT kind, key, value FROM property WHERE run = ?", [&](const auto& column) {
    for (const Properties& properties : kProperties) {
      if (column(0).getString() != properties.kind) continue;
      (run.*properties.texts)[column(1).getString()] = column(2).getString();
    }
  });
  rows("SELECT name, value, sd FROM estimate WHERE run = ? ORDER BY position", [&](const auto&
                                                                                       column) {
    run.estimates.push_back({column(0).getString(), column(1).getDouble(), column(2).getDouble()});
  });
  rows(
      "SELECT rule, kind, passed, margin, depth, quantity, text FROM verdict WHERE run = ? "
      "ORDER BY position",
      [&](const auto& column) {
        run.verdicts.push_back({column(0).getString(), column(1).getString(),
                                column(2).getInt() != 0, numberOf(column(3)), numberOf(column(4)),
                                column(5).getString(), column(6).getString()});
      });
  rows(
      "SELECT time, kind, text FROM event WHERE run = ? ORDER BY position",
      [&](const auto& column) {
        run.events.push_back({column(0).getDouble(), column(1).getString(), column(2).getString()});
      });
  rows("SELECT samples, data FROM curve WHERE run = ?", [&](const auto& column) {
    run.curve = curve(id, column(0).getInt64(), column(1).getString());
  });
  return run;
}

Run RunStore::read(std::int64_t id) const {
  Database& d = *database_;
  return d.guarded([&] { return d.readRows(id); });
}

std::vector<RunSummary> RunStore::list(const RunFilter& filter) const {
  Database& d = *database_;
  return d.guarded([&] {
    const Condition condition(filter);
    SQLite::Statement s(
        d.database(),
        "SELECT r.id, p.serial, p.program, p.station, r.strategy, r.result, "
        "r.failure, r.start, r.duration, r.peak_force, r.seating_depth, r.verdicts, "
        "r.failed FROM run r JOIN part p ON p.id = r.part" +
            condition.sql + latest(filter, ", r.id DESC"));
    condition.bind(s, 1);
    std::vector<RunSummary> runs;
    while (s.executeStep()) {
      const auto text = [&](int i) { return s.getColumn(i).getString(); };
      runs.push_back({s.getColumn(0).getInt64(), text(1), text(2), text(3), text(4), text(5),
                      text(6), s.getColumn(7).getDouble(), s.getColumn(8).getDouble(),
                      numberOf(s.getColumn(9)), numberOf(s.getColumn(10)), s.getColumn(11).getInt(),
                      s.getColumn(12).getInt()});
    }
    return runs;
  });
}

std::string RunStore::Database::names() {
  std::string all = "peak_force, seating_depth, cycle_time";
  SQLite::Statement s(database(), "SELECT DISTINCT name FROM estimate ORDER BY name");
  while (s.executeStep()) all += ", " + s.getColumn(0).getString();
  return all;
}

std::vector<TrendPoint> RunStore::trend(const std::string& quantity,
                                        const RunFilter& filter) const {
  static const std::map<std::string, const char*> kColumns = {{"peak_force", "r.peak_force"},
                                                              {"seating_depth", "r.seating_depth"},
                                                              {"cycle_time", "r.duration"}};
  Database& d = *database_;
  return d.guarded([&] {
    const auto column = kColumns.find(quantity);
    const bool estimated = column == kColumns.end();
    Condition condition(filter);
    // CROSS JOIN: in this order, by the start
    std::string sql = std::string("SELECT r.id, r.start, ") +
                      (estimated ? "e.value" : column->second) + " FROM run r";
    if (!filter.serial.empty() || !filter.program.empty() || !filter.station.empty()) {
      sql += " JOIN part p ON p.id = r.part";
    }
    if (estimated) sql += " CROSS JOIN estimate e ON e.run = r.id";
    if (estimated)
      condition.add("e.name = ?", Value(quantity));
    else
      condition.sql += std::string(" AND ") + column->second + " IS NOT NULL";
    SQLite::Statement s(d.database(), sql + condition.sql + latest(filter, ""));
    condition.bind(s, 1);
    std::vector<TrendPoint> points;
    while (s.executeStep()) {
      points.push_back(
          {s.getColumn(0).getInt64(), s.getColumn(1).getDouble(), s.getColumn(2).getDouble()});
    }
    // SQLite would sort a million runs by both for a second; by the start they are
    std::sort(points.begin(), points.end(), [](const TrendPoint& a, const TrendPoint& b) {
      return std::tie(a.start, a.id) < std::tie(b.start, b.id);
    });
    if (!points.empty() || !estimated) return points;
    SQLite::Statement any(d.database(), "SELECT 1 FROM estimate WHERE name = ? LIMIT 1");
    bindAll(any, quantity);
    if (any.executeStep()) return points;
    throw InputError(d.where() + ": no run has '" + printable(quantity) + "': give one of " +
                     d.names());
  });
}

std::vector<std::string> RunStore::check(const std::function<void(double)>& progress) const {
  constexpr double kPages = 0.5;  // of the time, before the curves
  constexpr int kReport = 1000;   // curves between two reports
  Database& d = *database_;
  std::vector<std::string> wrong;
  try {
    SQLite::Statement pages(d.database(), "PRAGMA integrity_check");
    while (pages.executeStep()) {
      if (pages.getColumn(0).getString() != "ok") wrong.push_back(pages.getColumn(0).getString());
    }
    SQLite::Statement keys(d.database(), "PRAGMA foreign_key_check");
    while (keys.executeStep()) {
      wrong.push_back("table " + keys.getColumn(0).getString() + ": a row belongs to no row of " +
                      keys.getColumn(2).getString());
    }
    if (progress) progress(kPages);
    const double all = d.database().execAndGet("SELECT ifnull(max(id), 0) FROM run").getDouble();
    SQLite::Statement curves(d.database(), "SELECT run, samples, data FROM curve ORDER BY run");
    for (int i = 1; curves.executeStep(); ++i) {
      const std::int64_t id = curves.getColumn(0).getInt64();
      try {
        d.curve(id, curves.getColumn(1).getInt64(), curves.getColumn(2).getString());
      } catch (const InputError&) {
        wrong.push_back("run " + std::to_string(id) + ": its curve is damaged");
      }
      if (progress && i % kReport == 0) {
        progress(kPages + (1.0 - kPages) * static_cast<double>(id) / all);
      }
    }
  } catch (const SQLite::Exception& error) {
    wrong.push_back(error.what());
  }
  if (progress) progress(1.0);
  return wrong;
}

}  // namespace assembly_cell
