// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/records/store.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

using Record = Run;  // testing::Test::Run hides it
using Access = RunStore::Access;

Record someRun(const std::string& serial) {
  Record run;
  run.serial = serial;
  run.program = "plate";
  run.start = 1.7e9;
  run.duration = 12.5;
  run.result = "seated";
  run.versions["package"] = "1.0";
  for (int i = 0; i < 50; ++i) run.curve.add({0.02 * i, 1e-4 * i, 5.0 + i, 1.0, 0.1, 1e-3});
  run.estimates = {{"hole_x", 1e-3, 1e-5}};
  RunVerdict inside, broken;
  inside.rule = "peak";
  inside.margin = 0.5;
  inside.depth = 2e-3;
  broken.rule = "band";
  broken.passed = false;
  broken.margin = broken.depth = std::nan("");
  broken.text = "not evaluated";
  run.verdicts = {inside, broken};
  run.events = {{1.5, "retry", "stuck"}};
  return run;
}

template <class Call>
std::string refusalOf(Call call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(RunStoreFile, ARunIsReadAsItWasWritten) {
  test::TemporaryFolder folder;
  Record run = someRun("a");
  {
    RunStore store(folder / "runs.db", Access::kWrite);
    store.append(run);
  }
  const RunStore store(folder / "runs.db", Access::kRead);
  const Record read = store.read(run.id);
  EXPECT_EQ(read.serial, "a");
  EXPECT_EQ(read.versions, run.versions);
  EXPECT_EQ(read.curve.axial, run.curve.axial);
  EXPECT_EQ(read.curve.depth, run.curve.depth);
  ASSERT_EQ(read.verdicts.size(), 2u);
  EXPECT_EQ(read.verdicts[0].margin, 0.5);
  EXPECT_TRUE(std::isnan(read.verdicts[1].margin));
  EXPECT_FALSE(read.verdicts[1].passed);
  EXPECT_EQ(read.events[0].text, "stuck");
  EXPECT_TRUE(store.check().empty());
  const std::vector<TrendPoint> trend = store.trend("peak_force", {});
  ASSERT_EQ(trend.size(), 1u);
  EXPECT_EQ(trend[0].value, 54.0);
}

TEST(RunStoreFile, TwoWritersTakeTurns) {
  test::TemporaryFolder folder;
  RunStore one(folder / "runs.db", Access::kWrite), two(folder / "runs.db", Access::kWrite);
  for (int i = 0; i < 20; ++i) {
    Record a = someRun(""), b = someRun("");
    one.append(a);
    two.append(b);
    EXPECT_EQ(b.id, a.id + 1);
    EXPECT_FALSE(b.serial.empty());
  }
  EXPECT_EQ(one.list({}).size(), 40u);
}

TEST(RunStoreFile, WhatCannotBeStoredOrReadIsRefusedByName) {
  test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  EXPECT_NE(refusalOf([&] { RunStore store(path, Access::kRead); }).find(path), std::string::npos);
  RunStore store(path, Access::kWrite);
  Record run = someRun("a");
  run.curve.axial[3] = std::nan("");
  EXPECT_NE(refusalOf([&] { store.append(run); }).find("curve.axial[3]"), std::string::npos);
  EXPECT_TRUE(store.list({}).empty());
  EXPECT_NE(refusalOf([&] { store.read(7); }).find("7"), std::string::npos);
  const std::string text = folder / "text.db";
  std::ofstream(text) << std::string(5000, 'x');
  EXPECT_NE(refusalOf([&] { RunStore other(text, Access::kWrite); }).find(text), std::string::npos);
}

// A process that stores runs and reports each one is killed at any moment: what it reported is
// there and whole. Repeated to 1000 kills by --gtest_repeat=10.
TEST(RunStoreFile, KeepsEveryReportedRunOfAWriterThatIsKilled) {
  test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  std::mt19937 random(std::random_device{}());
  std::vector<std::int64_t> reported;
  for (int kill = 0; kill < 100; ++kill) {
    int pipe[2];
    ASSERT_EQ(::pipe(pipe), 0);
    const pid_t writer = ::fork();
    ASSERT_GE(writer, 0);
    if (writer == 0) {
      RunStore store(path, Access::kWrite);
      while (true) {
        Record run = someRun("");
        store.append(run);
        if (::write(pipe[1], &run.id, sizeof run.id) != sizeof run.id) ::_exit(1);
      }
    }
    ::close(pipe[1]);
    std::int64_t id = 0;
    // some are killed while they open the store
    if (kill % 4 != 0) {
      ASSERT_EQ(::read(pipe[0], &id, sizeof id), static_cast<ssize_t>(sizeof id));
      reported.push_back(id);
    }
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 10000));
    ::kill(writer, SIGKILL);
    ::waitpid(writer, nullptr, 0);
    while (::read(pipe[0], &id, sizeof id) == static_cast<ssize_t>(sizeof id)) {
      reported.push_back(id);
    }
    ::close(pipe[0]);
  }
  const RunStore store(path, Access::kRead);
  EXPECT_EQ(store.check(), std::vector<std::string>());
  EXPECT_GE(reported.size(), 75u);
  const Record expected = someRun("");
  for (const std::int64_t id : reported) {
    const Record run = store.read(id);
    EXPECT_EQ(run.curve.axial, expected.curve.axial) << id;
    EXPECT_EQ(run.events.size(), expected.events.size()) << id;
  }
}

// As on a full disk: the run is refused, those before it stay, and the next one is stored.
TEST(RunStoreFile, ARunThatDoesntFitIsRefusedAndNothingIsLost) {
  test::TemporaryFolder folder;
  const std::string path = folder / "runs.db";
  Record first = someRun("first");
  RunStore(path, Access::kWrite).append(first);
  const pid_t limited = ::fork();
  ASSERT_GE(limited, 0);
  if (limited == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{8192, 8192};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const std::string refusal = refusalOf([&] {
      RunStore store(path, Access::kWrite);
      Record run = someRun("second");
      store.append(run);
    });
    ::_exit(refusal.find("runs.db") != std::string::npos && refusal.find('\n') == refusal.npos ? 0
                                                                                               : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(limited, &status, 0), limited);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  RunStore store(path, Access::kWrite);
  EXPECT_EQ(store.check(), std::vector<std::string>());
  EXPECT_EQ(store.list({}).size(), 1u);
  Record third = someRun("third");
  store.append(third);
  EXPECT_EQ(store.read(third.id).serial, "third");
}

TEST(RunStoreFile, WhatIsNoStoreIsRefusedInOneLine) {
  test::TemporaryFolder folder;
  const auto refused = [&](const std::string& path, Access access) {
    const std::string refusal = refusalOf([&] { RunStore store(path, access); });
    EXPECT_NE(refusal.find(path), std::string::npos) << refusal;
    EXPECT_EQ(refusal.find('\n'), std::string::npos) << refusal;
    return refusal;
  };
  refused(folder / "missing.db", Access::kRead);
  refused("/proc/runs.db", Access::kWrite);
  std::ofstream(folder / "text.db") << std::string(5000, 'x');
  refused(folder / "text.db", Access::kWrite);
  refused(folder / "text.db", Access::kRead);
  // a newer version: bytes 60 to 63 of the file, SQLite's user_version
  const std::string path = folder / "newer.db";
  Record run = someRun("a");
  RunStore(path, Access::kWrite).append(run);
  {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(63);
    file.put(99);
  }
  EXPECT_NE(refused(path, Access::kWrite).find("99"), std::string::npos);
}

// Bytes in the middle overwritten: reading or check() names the file; nothing else happens.
TEST(RunStoreFile, DamageIsFound) {
  std::mt19937 random(5);
  int found = 0;
  for (int trial = 0; trial < 40; ++trial) {
    test::TemporaryFolder folder;
    const std::string path = folder / "runs.db";
    {
      RunStore store(path, Access::kWrite);
      for (int i = 0; i < 30; ++i) {
        Record run = someRun("part " + std::to_string(i));
        store.append(run);
      }
    }
    const std::size_t size = std::filesystem::file_size(path);
    if (trial % 4 == 0) {
      std::filesystem::resize_file(path, 4096 * (1 + random() % (size / 4096 - 1)));
    } else {
      std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(4096 + random() % (size - 4096 - 600)));
      file << std::string(600, static_cast<char>(random() % 256));
    }
    bool damaged = false;
    const std::string refusal = refusalOf([&] {
      const RunStore store(path, Access::kRead);
      damaged = !store.check().empty();
    });
    EXPECT_EQ(refusal.find('\n'), std::string::npos) << refusal;
    if (damaged || !refusal.empty()) ++found;
  }
  // bytes in free space are no damage; those within a text or a number show only to a person
  EXPECT_GE(found, 20);
}

}  // namespace
}  // namespace assembly_cell
