// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

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

}  // namespace
}  // namespace assembly_cell
