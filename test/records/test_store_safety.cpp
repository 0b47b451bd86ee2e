// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// What is stored is read to the bit; every file, disk or writer that stands against it is named.
#include <gtest/gtest.h>
#include <sched.h>
#include <sqlite3.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <set>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/records/store.h"
#include "temporary_folder.h"
#include "tool_run.h"

namespace assembly_cell {
namespace {

using Record = Run;  // testing::Test::Run hides it
using Access = RunStore::Access;

bool sameBits(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

bool sameNumber(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

Record filledRun() {
  Record run;
  run.serial = std::string("s\0rial", 6);
  run.program = "plate \xc3\xa9 'quoted'; \"--";
  run.program_hash = "crc32:1";
  run.station = "left";
  run.start = 1.7e9 + 1.0 / 3.0;
  run.duration = 0.1;
  run.strategy = "touch";
  run.result = "failed";
  run.failure = "jammed";
  run.text = "line\nline";
  run.versions = {{"package", "1"}, {"commit", ""}};
  run.calibrations = {{"sensor_a", "id"}};
  run.settings = {{"insert.force", "8.0"}};
  run.simulation = {{"seed", "18446744073709551615"}};
  for (int i = 0; i < 300; ++i) {
    const double x = 0.1 * i;
    run.curve.add({x, std::sin(x), -0.0, 5e-324 * i, 1e300 * std::cos(x), std::nan("")});
  }
  run.estimates = {{"hole_y", -5e-324, 0.1}, {"hole_x", 1.0 / 3.0, 0.0}};
  RunVerdict verdict;
  verdict.rule = "peak";
  verdict.kind = "box";
  verdict.passed = false;
  verdict.margin = -1.0 / 3.0;
  verdict.depth = std::nan("");
  verdict.quantity = "axial";
  verdict.text = "above";
  run.verdicts = {verdict, RunVerdict()};
  run.verdicts[1].margin = std::nan("");
  run.events = {{1.0 / 3.0, "retry", "stuck"}, {0.0, "hold", ""}};
  return run;
}

// A run whose content follows from its number.
Record numbered(int number) {
  Record run;
  run.serial = std::to_string(number);
  run.start = number;
  for (int i = 0; i < 200; ++i) run.curve.add({0.02 * i, 1e-4 * i, 1.0 * number, 0.1, 0.01, 1e-3});
  run.estimates = {{"hole_x", 1.0 * number, 1e-5}};
  return run;
}

bool isWhole(const Record& run) {
  const Record expected = numbered(std::stoi(run.serial));
  bool same = run.start == expected.start && run.estimates.size() == 1 &&
              run.estimates[0].value == expected.estimates[0].value;
  for (const CurveChannel& channel : kCurveChannels) {
    same = same && sameBits(run.curve.*channel.values, expected.curve.*channel.values);
  }
  return same;
}

template <class Call>
std::string whyRefused(Call call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string whyNotOpened(const std::string& path, Access access = Access::kRead) {
  return whyRefused([&] { RunStore store(path, access); });
}

// The exit code of `work` in a child.
template <class Work>
int inChild(const Work& work) {
  const pid_t child = fork();
  if (child == 0) {
    try {
      _exit(work());
    } catch (const std::exception& error) {
      std::cerr << error.what() << std::endl;
      _exit(99);
    }
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

void execute(const std::string& path, const std::string& sql) {
  sqlite3* handle = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &handle), SQLITE_OK);
  char* error = nullptr;
  EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), nullptr, nullptr, &error), SQLITE_OK) << error;
  sqlite3_close(handle);
}

constexpr int kSkipped = 77;

// In a child: a file system of so many bytes at `folder`, which only this process sees; false where
// that isn't allowed.
bool mountSmall(const std::string& folder, const char* size) {
  return unshare(CLONE_NEWNS) == 0 &&
         mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
         mount("tmpfs", folder.c_str(), "tmpfs", 0, size) == 0;
}

}  // namespace

TEST(StoreSafety, EveryFieldIsReadToTheBit) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "new/folder/runs.db";
  Record run = filledRun();
  RunStore(path, Access::kWrite).append(run);
  const Record read = RunStore(path, Access::kRead).read(run.id);
  EXPECT_EQ(read.serial, run.serial);
  EXPECT_EQ(read.program, run.program);
  EXPECT_EQ(read.program_hash, run.program_hash);
  EXPECT_EQ(read.station, run.station);
  EXPECT_EQ(read.strategy, run.strategy);
  EXPECT_EQ(read.result, run.result);
  EXPECT_EQ(read.failure, run.failure);
  EXPECT_EQ(read.text, run.text);
  EXPECT_TRUE(sameBits({read.start, read.duration}, {run.start, run.duration}));
  EXPECT_EQ(read.versions, run.versions);
  EXPECT_EQ(read.calibrations, run.calibrations);
  EXPECT_EQ(read.settings, run.settings);
  EXPECT_EQ(read.simulation, run.simulation);
  for (const CurveChannel& channel : kCurveChannels) {
    EXPECT_TRUE(sameBits(read.curve.*channel.values, run.curve.*channel.values)) << channel.name;
  }
  ASSERT_EQ(read.estimates.size(), run.estimates.size());
  for (std::size_t i = 0; i < run.estimates.size(); ++i) {
    const RunEstimate &a = read.estimates[i], &b = run.estimates[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_TRUE(sameBits({a.value, a.sd}, {b.value, b.sd})) << a.name;
  }
  ASSERT_EQ(read.verdicts.size(), run.verdicts.size());
  for (std::size_t i = 0; i < run.verdicts.size(); ++i) {
    const RunVerdict &a = read.verdicts[i], &b = run.verdicts[i];
    EXPECT_EQ(a.rule + a.kind + a.quantity + a.text, b.rule + b.kind + b.quantity + b.text);
    EXPECT_EQ(a.passed, b.passed);
    EXPECT_TRUE(sameNumber(a.margin, b.margin));
    EXPECT_TRUE(sameNumber(a.depth, b.depth));
  }
  ASSERT_EQ(read.events.size(), run.events.size());
  for (std::size_t i = 0; i < run.events.size(); ++i) {
    EXPECT_EQ(read.events[i].time, run.events[i].time);
    EXPECT_EQ(read.events[i].kind + read.events[i].text, run.events[i].kind + run.events[i].text);
  }
}

TEST(StoreSafety, NumbersThatAreNotFiniteAreRefusedAndNothingIsStored) {
  const test::TemporaryFolder folder;
  RunStore store(folder / "runs.db", Access::kWrite);
  const auto refusal = [&](void (*change)(Record&)) {
    Record run = numbered(1);
    change(run);
    return whyRefused([&] { store.append(run); });
  };
  const std::string begin =
      "store '" + folder / "runs.db" + "': the run of part '1' is not stored: ";
  EXPECT_EQ(refusal([](Record& r) { r.curve.lateral[17] = std::nan(""); }),
            begin + "curve.lateral[17]: value nan: give a finite number");
  EXPECT_EQ(refusal([](Record& r) { r.curve.tilt[0] = INFINITY; }),
            begin + "curve.tilt[0]: value inf: give a finite number");
  EXPECT_EQ(refusal([](Record& r) { r.curve.axial.assign(200, std::nan("")); }),
            begin + "curve.axial: is not measured: give the axial force");
  EXPECT_EQ(refusal([](Record& r) {
              r.curve.time = r.curve.depth = std::vector<double>(200, std::nan(""));
            }),
            begin + "curve: neither time nor depth is measured: give one of them");
  EXPECT_EQ(refusal([](Record& r) { r.curve.moment.pop_back(); }),
            begin + "curve.moment: has 199 samples, time has 200: give as many");
  EXPECT_EQ(refusal([](Record& r) { r.estimates[0].value = std::nan(""); }),
            begin + "estimate hole_x: value nan: give a finite number");
  EXPECT_EQ(refusal([](Record& r) { r.start = std::nan(""); }),
            begin + "start: value nan: give a finite number");
  EXPECT_TRUE(store.list({}).empty());
}

TEST(StoreSafety, AnEmptyFileBecomesAStore) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  std::ofstream(path).flush();
  EXPECT_EQ(whyNotOpened(path), "store '" + path + "': has no runs yet: record one first");
  Record run = numbered(1);
  RunStore(path, Access::kWrite).append(run);
  EXPECT_TRUE(isWhole(RunStore(path, Access::kRead).read(run.id)));
}

// Schema 1, as it was: the tables without indexes.
TEST(StoreSafety, AnOlderSchemaIsBroughtUpToDateWithItsRuns) {
  for (const Access access : {Access::kRead, Access::kWrite}) {
    const test::TemporaryFolder folder;
    const std::string path = folder / "runs.db";
    Record run = numbered(5);
    RunStore(path, Access::kWrite).append(run);
    execute(path, "DROP INDEX run_start; DROP INDEX run_part; PRAGMA user_version = 1");
    const RunStore store(path, access);
    EXPECT_TRUE(isWhole(store.read(run.id)));
    EXPECT_TRUE(store.check().empty());
    execute(path, "DROP INDEX run_start; DROP INDEX run_part");  // fails where there are none
  }
}

TEST(StoreSafety, WhatIsNoStoreIsRefusedByName) {
  const test::TemporaryFolder folder;
  const auto where = [](const std::string& path) { return "store '" + path + "': "; };
  const std::string missing = folder / "missing.db";
  EXPECT_EQ(whyNotOpened(missing),
            where(missing) + "there is no such file: give one that runs were recorded in");
  const std::string newer = folder / "newer.db";
  RunStore(newer, Access::kWrite);
  execute(newer, "PRAGMA user_version = 99");
  for (const Access access : {Access::kRead, Access::kWrite}) {
    EXPECT_EQ(whyNotOpened(folder.path(), access),
              where(folder.path()) + "is no file: give a file");
    const std::string pipe = folder / "pipe";
    mkfifo(pipe.c_str(), 0600);
    EXPECT_EQ(whyNotOpened(pipe, access), where(pipe) + "is no file: give a file");
    const std::string text = folder / "text.db";
    std::ofstream(text) << std::string(5000, 'x');
    EXPECT_EQ(whyNotOpened(text, access), where(text) + "is no store of runs: give another file");
    const std::string other = folder / "other.db";
    execute(other, "CREATE TABLE IF NOT EXISTS bookmarks(url TEXT)");
    const std::string before = test::textOf(other);
    EXPECT_EQ(whyNotOpened(other, access),
              where(other) + "is a database of another program: give another file");
    EXPECT_EQ(test::textOf(other), before);
    EXPECT_NE(whyNotOpened(newer, access).find(where(newer) + "has schema 99"), std::string::npos);
  }
}

// One byte of it, which SQLite can't notice.
TEST(StoreSafety, ADamagedCurveIsNamed) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  RunStore store(path, Access::kWrite);
  for (int i = 1; i < 4; ++i) {
    Record run = numbered(i);
    store.append(run);
  }
  execute(path,
          "UPDATE curve SET data = substr(data, 1, 60) || x'00' || substr(data, 62) WHERE run = 2");
  EXPECT_EQ(store.check(), std::vector<std::string>{"run 2: its curve is damaged"});
  EXPECT_EQ(whyRefused([&] { store.read(2); }),
            "store '" + path + "': the curve of run 2 is damaged: restore a copy of the store");
  EXPECT_TRUE(isWhole(store.read(3)));
}

TEST(StoreSafety, AReadOnlyStoreIsReadAndNotWritten) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  Record run = numbered(1);
  RunStore(path, Access::kWrite).append(run);
  ASSERT_EQ(chmod(path.c_str(), 0444), 0);
  ASSERT_EQ(chmod(folder.path().c_str(), 0555), 0);
  const int code = inChild([&] {
    if (geteuid() == 0 && setuid(65534) != 0) return kSkipped;  // root may write everything
    if (!isWhole(RunStore(path, Access::kRead).read(1))) return 1;
    return whyNotOpened(path, Access::kWrite) ==
                   "store '" + path +
                       "': can't be written: Permission denied: give permission to "
                       "write it and its folder, or another store"
               ? 0
               : 2;
  });
  chmod(folder.path().c_str(), 0755);
  if (code == kSkipped) GTEST_SKIP() << "needs a user that may not write everything";
  EXPECT_EQ(code, 0);
}

TEST(StoreSafety, AFullDiskIsNamedAndLosesNothing) {
  const test::TemporaryFolder folder;
  const int code = inChild([&] {
    if (!mountSmall(folder.path(), "size=12m")) return kSkipped;
    const std::string path = folder / "runs.db", filler = folder / "filler";
    RunStore store(path, Access::kWrite);
    Record run = numbered(1);
    store.append(run);
    store.checkWritable();
    std::ofstream file(filler);
    while (file << std::string(4096, 'x') << std::flush) continue;
    file.close();
    const std::string begin = "store '" + path + "': its disk is full";
    if (whyRefused([&] { store.checkWritable(); }).rfind(begin, 0) != 0) return 1;
    int stored = 1;
    std::string why;
    for (int i = 2; i < 2000 && why.empty(); ++i) {
      Record next = numbered(i);
      why = whyRefused([&] { store.append(next); });
      if (why.empty()) ++stored;
    }
    if (why.rfind(begin, 0) != 0) return 2;
    std::filesystem::remove(filler);
    Record last = numbered(++stored);
    store.append(last);
    for (int i = 1; i <= stored; ++i) {
      if (!isWhole(store.read(i))) return 3;
    }
    return store.check().empty() && store.list({}).size() == static_cast<std::size_t>(stored) ? 0
                                                                                              : 4;
  });
  if (code == kSkipped) GTEST_SKIP() << "needs a file system of its own";
  EXPECT_EQ(code, 0);
}

TEST(StoreSafety, ALockedStoreIsNamedAfterASecond) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  RunStore store(path, Access::kWrite);
  sqlite3* other = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &other), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(other, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr), SQLITE_OK);
  const std::string locked =
      "store '" + path + "': another program has locked it for 1 s: end that program, or try again";
  Record run = numbered(1);
  EXPECT_EQ(whyRefused([&] { store.checkWritable(); }), locked);
  EXPECT_EQ(whyRefused([&] { store.append(run); }), locked);
  EXPECT_EQ(run.id, 0);
  EXPECT_TRUE(store.list({}).empty());  // readers don't wait
  sqlite3_exec(other, "ROLLBACK", nullptr, nullptr, nullptr);
  sqlite3_close(other);
  store.append(run);
  EXPECT_TRUE(isWhole(store.read(run.id)));
}

TEST(StoreSafety, AFileThatWasRemovedIsNotWritten) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  RunStore store(path, Access::kWrite);
  std::filesystem::rename(path, folder / "away.db");
  const std::string removed = "store '" + path +
                              "': was removed or replaced while it was open: put it back, or start "
                              "this program again";
  Record run = numbered(1);
  EXPECT_EQ(whyRefused([&] { store.append(run); }), removed);
  EXPECT_EQ(whyRefused([&] { store.checkWritable(); }), removed);
  std::filesystem::rename(folder / "away.db", path);
  store.append(run);
  EXPECT_TRUE(isWhole(store.read(run.id)));
}

// Both from no file on, as fast as they can, with ten files: the moment at which one finds the
// store half made by the other is short. In memory: on a busy disk one commit may take longer than
// the second for which the other waits.
TEST(StoreSafety, TwoProcessesWriteAtOnce) {
  constexpr int kFiles = 10, kRuns = 20;
  const char* const set = std::getenv("TMPDIR");
  const std::string before = set != nullptr ? set : "";
  setenv("TMPDIR", "/dev/shm", 1);
  const test::TemporaryFolder folder;
  set != nullptr ? setenv("TMPDIR", before.c_str(), 1) : unsetenv("TMPDIR");
  for (int file = 0; file < kFiles; ++file) {
    const std::string path = folder / ("runs_" + std::to_string(file) + ".db");
    pid_t writers[2];
    for (int w = 0; w < 2; ++w) {
      writers[w] = fork();
      if (writers[w] != 0) continue;
      const std::string why = whyRefused([&] {
        RunStore store(path, Access::kWrite);
        for (int i = 0; i < kRuns; ++i) {
          Record run = numbered(w * kRuns + i);
          store.append(run);
        }
      });
      if (!why.empty()) std::cerr << why << std::endl;
      _exit(why.empty() ? 0 : 1);
    }
    for (const pid_t writer : writers) {
      int status = 0;
      waitpid(writer, &status, 0);
      EXPECT_EQ(status, 0);
    }
    const RunStore store(path, Access::kRead);
    std::set<std::string> serials;
    for (const RunSummary& run : store.list({})) {
      serials.insert(run.serial);
      EXPECT_TRUE(isWhole(store.read(run.id)));
    }
    EXPECT_EQ(serials.size(), 2u * kRuns);
    EXPECT_TRUE(store.check().empty());
  }
}

}  // namespace assembly_cell
