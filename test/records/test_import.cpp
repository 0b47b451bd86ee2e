// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/records/import.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "assembly_cell/base/input_error.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

using Record = Run;  // testing::Test::Run hides it

class Import : public testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) {
    const std::string path = folder_ / name;
    std::ofstream(path) << text;
    return path;
  }
  std::string zip(const std::string& name, const std::string& text) {
    const std::string path = folder_ / name;
    const gzFile file = gzopen(path.c_str(), "wb");
    gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
    gzclose(file);
    return path;
  }
  static Record readOne(const std::string& path) {
    const std::vector<Record> runs = readCurveFile(path);
    EXPECT_EQ(runs.size(), 1u);
    return runs.front();
  }
  template <class Read>
  static std::string refusalOf(Read read) {
    try {
      read();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  test::TemporaryFolder folder_;
};

TEST_F(Import, DepthAndForceInTheUnitsOfTheHeader) {
  const Record run = readOne(write("part_7.csv", "depth [mm],force [kN]\n0,0.001\n1.5,0.02\n"));
  EXPECT_EQ(run.serial, "part_7");
  EXPECT_EQ(run.curve.depth, (std::vector<double>{0.0, 0.0015}));
  EXPECT_EQ(run.curve.axial, (std::vector<double>{1.0, 20.0}));
  EXPECT_TRUE(std::isnan(run.curve.lateral[0]));
  EXPECT_TRUE(std::isnan(run.curve.tilt[1]));
}

TEST_F(Import, TimeAndWrenchWithoutDepth) {
  const Record run =
      readOne(zip("a.csv.gz", "t,fx,fy,fz,tx,ty,tz\n5,3,4,10,0,0,0\n5.5,0,0,11,6,8,0\n"));
  EXPECT_EQ(run.serial, "a");
  EXPECT_EQ(run.curve.time, (std::vector<double>{0.0, 0.5}));
  EXPECT_EQ(run.curve.lateral, (std::vector<double>{5.0, 0.0}));
  EXPECT_EQ(run.curve.moment, (std::vector<double>{0.0, 10.0}));
  EXPECT_EQ(run.curve.axial[1], 11.0);
  EXPECT_TRUE(std::isnan(run.curve.depth[0]));
  EXPECT_EQ(run.duration, 0.5);
}

TEST_F(Import, ManyCurvesInOneTable) {
  const std::vector<Record> runs =
      readCurveFile(write("b.csv", "run,depth [mm],axial\n7,0,1\n7,1,2\n9,0,3\n9,1,4\n9,2,5\n"));
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0].serial, "b-7");
  EXPECT_EQ(runs[1].serial, "b-9");
  EXPECT_EQ(runs[1].curve.axial, (std::vector<double>{3.0, 4.0, 5.0}));
  EXPECT_EQ(runs[1].curve.depth, (std::vector<double>{0.0, 0.001, 0.002}));
  EXPECT_TRUE(std::isnan(runs[0].curve.time[0]));
  EXPECT_EQ(runs[0].duration, 0.0);
  const std::string short_one = write("c.csv", "run,depth,axial\n1,0,1\n1,1,1\n2,0,1\n");
  EXPECT_EQ(refusalOf([&] { readCurveFile(short_one); }),
            short_one + ": no curve: at least two rows are needed");
}

TEST_F(Import, EmptyCellsAreNotMeasured) {
  const Record run = readOne(write("a.csv", "depth,axial\n0,1\n0.001,\n0.002,3\n"));
  EXPECT_TRUE(std::isnan(run.curve.axial[1]));
}

TEST_F(Import, SnapFitFolderWithItsThreeFilesARun) {
  zip("01_R_Torques.dat.gz", "0 1 0 5 0.1 0 0 \n0.5 0 2 6 0 0 0 \n1.0 0 0 7 0 0 1 \n");
  zip("01_R_CartPos.dat.gz", "0 0 0 0.5 0 0 0\n0.5 0 0 0.4 0 0 0\n1.0 0 0 0.3 0 0 0\n");
  zip("01_R_State.dat.gz", "0.0\n0.5\n");
  write("02_R_Torques.dat", "0\t1\t0\t5\t0\t0\t0\t\n0.5\t0\t2\t6\t0\t0\t0\t\n");
  write("02_R_State.dat", "");
  const std::vector<Record> runs = readCurveFolder(folder_.path());
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0].serial, "01");
  EXPECT_EQ(runs[0].curve.time, (std::vector<double>{-0.5, 0.0, 0.5}));
  EXPECT_EQ(runs[0].curve.axial, (std::vector<double>{5.0, 6.0, 7.0}));
  EXPECT_EQ(runs[0].curve.lateral, (std::vector<double>{1.0, 2.0, 0.0}));
  EXPECT_NEAR(runs[0].curve.depth[2], 0.2, 1e-12);
  EXPECT_EQ(runs[1].curve.time[0], 0.0);
  EXPECT_TRUE(std::isnan(runs[1].curve.depth[0]));
}

TEST_F(Import, WhatIsNoCurveIsRefusedByName) {
  const std::string none = write("a.csv", "x,y\n1,2\n3,4\n");
  EXPECT_EQ(refusalOf([&] { readCurveFile(none); }),
            none + ": no column depth and none t: name one of them in the header");
  const std::string one = write("b.csv", "depth,axial\n1,2\n");
  EXPECT_EQ(refusalOf([&] { readCurveFile(one); }),
            one + ": no curve: at least two rows are needed");
  EXPECT_EQ(refusalOf([&] { readCurveFile(folder_.path()); }),
            folder_.path() + ": a folder: give a file");
  const std::string zipped = zip("c.csv.gz", std::string(100000, '1') + "\n");
  std::filesystem::resize_file(zipped, std::filesystem::file_size(zipped) - 9);
  EXPECT_EQ(refusalOf([&] { gzipText(zipped); }),
            zipped + ": can't be decompressed: the file is broken off or damaged");
  std::filesystem::create_directory(folder_ / "empty");
  EXPECT_NE(refusalOf([&] { readCurveFolder(folder_ / "empty"); }).find("no *.csv"),
            std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
