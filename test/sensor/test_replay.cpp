// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/sensor/devices/replay.h"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/statistics.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

class RecordingFile : public ::testing::Test {
 protected:
  Recording load(const std::string& content, const ReplayFormat& format = {}) {
    std::ofstream(path_) << content;
    return loadRecording(path_, format);
  }

  // what loading says, without the path
  std::string refusal(const std::string& content, const ReplayFormat& format = {}) {
    try {
      load(content, format);
    } catch (const InputError& error) {
      std::string said = error.what();
      EXPECT_EQ(said.find('\n'), std::string::npos);
      const std::size_t place = said.find(path_);
      if (place != std::string::npos) said.erase(place, path_.size());
      return said;
    }
    return "accepted";
  }

  static ReplayFormat bare(SampleQuantity quantity = SampleQuantity::kWrench) {
    ReplayFormat format;
    format.quantity = quantity;
    format.columns = defaultColumns(quantity);
    format.columns.resize(7);
    return format;
  }

  const test::TemporaryFolder folder_;
  const std::string path_ = folder_ / "recording.csv";
};

// The excerpt against numbers read off the original file.
TEST(RealRecording, HasItsFirstRowItsRateAndItsNoise) {
  const Recording r = loadRecording(ASSEMBLY_CELL_SOURCE_DIR "/test/data/drift.csv", {});
  ASSERT_EQ(r.time.size(), 300u);
  Vector6 first;
  first << 5.08412, -4.79076, -8.74935, 0.007775, 0.334287, 0.005922;
  EXPECT_EQ(r.time[0], 0.0952829);
  EXPECT_EQ(r.values[0], first);
  EXPECT_NEAR(r.period, 0.1, 1e-4);
  DifferenceNoise noise;
  for (const Vector6& w : r.values) noise.add(w);
  EXPECT_NEAR(noise.rms()[0], 0.0081, 0.00005);  // an independent script, four digits
  EXPECT_NEAR(noise.rms()[1], 0.0376, 0.00005);
  EXPECT_NEAR(noise.rms()[2], 0.0079, 0.00005);
}

TEST_F(RecordingFile, HeaderCommentsAndBlankLinesPass) {
  const std::string rows = "0,1,2,3,4,5,6\n# a remark\n\n 0.5 ,+1, 2,3,4,5,-6e-1\r\n";
  for (const std::string header : {"", "t,fx,fy,fz,tx,ty,tz\n", "# units\ntime,a,b,c,d,e,f\n"}) {
    const Recording r = load(header + rows, bare());
    ASSERT_EQ(r.values.size(), 2u);
    EXPECT_EQ(r.time[1], 0.5);
    EXPECT_EQ(r.values[1][0], 1.0);
    EXPECT_EQ(r.values[1][5], -0.6);
    EXPECT_EQ(r.period, 0.5);
  }
}

TEST_F(RecordingFile, AHeaderOrdersTheColumns) {
  const Recording r = load("tz,ty,tx,fz,fy,fx,t\n6,5,4,3,2,1,0\n6,5,4,3,2,1,1\n", bare());
  for (int k = 0; k < 6; ++k) EXPECT_EQ(r.values[1][k], k + 1);
}

// No header is passed over while its order is another than that of the page.
TEST_F(RecordingFile, AHeaderIsReadOrRefusedByName) {
  const std::string rows = "0,4,5,6,1,2,3,0,0,0,1\n0.005,4,5,6,1,2,3,0,0,0,1\n";
  for (const std::string header :
       {"t,tx,ty,tz,fx,fy,fz,qx,qy,qz,qw\n", "\xEF\xBB\xBFt,tx,ty,tz,fx,fy,fz,qx,qy,qz,qw\n",
        "time,TX,TY,TZ,FX,FY,FZ,qx,qy,qz,qw\n",
        "\"t\",\"tx\",\"ty\",\"tz\",\"fx\",\"fy\",\"fz\",\"qx\",\"qy\",\"qz\",\"qw\"\n",
        "Time [s],Tx [Nm],Ty [Nm],Tz [Nm],Fx [N],Fy [N],Fz [N],qx,qy,qz,qw\n",
        "timestamp,mx,my,mz,fx,fy,fz,qx,qy,qz,qw\n", "# t,tx,ty,tz,fx,fy,fz,qx,qy,qz,qw\n"}) {
    const Recording r = load(header + rows);
    for (int k = 0; k < 6; ++k) EXPECT_EQ(r.values[1][k], k + 1) << header;
    EXPECT_EQ(r.time[1], 0.005);
  }
  EXPECT_EQ(refusal("t,u,v,w,fx,fy,fz,qx,qy,qz,qw\n" + rows), ":1: column tx is missing: add it");
  EXPECT_EQ(load("t,fx,fy,fz,tx,ty,tz\n0,1,2,3,4,5,6\n0.005,1,2,3,4,5,6\n").values[1][5], 6.0);
  EXPECT_EQ(load("0,1,2,3,4,5,6\n0.005,1,2,3,4,5,6\n").values[1][5], 6.0);
  EXPECT_NE(refusal("0,1,2,3,4,5,6,7\n0.005,1,2,3,4,5,6,7\n").find("8 columns instead of 11"),
            std::string::npos);
}

TEST_F(RecordingFile, MillisecondsAreReadOrNamed) {
  const std::string header = "t,fx,fy,fz,tx,ty,tz\n";
  const Recording whole = load(header + "0,1,2,3,4,5,6\n5,1,2,3,4,5,6\n10,1,2,3,4,5,6\n");
  EXPECT_NEAR(whole.period, 0.005, 1e-12);
  EXPECT_EQ(whole.note, "time in ms, whole numbers 5 apart");
  const std::string decimals = header + "0.0,1,2,3,4,5,6\n5.0,1,2,3,4,5,6\n";
  EXPECT_NE(refusal(decimals).find("0.2 Hz in s or 200 Hz in ms"), std::string::npos);
  ReplayFormat format;
  format.time_unit = TimeUnit::kMilliseconds;
  EXPECT_NEAR(load(decimals, format).period, 0.005, 1e-12);
}

TEST_F(RecordingFile, NamedColumnsArePicked) {
  ReplayFormat format;
  format.columns = {"temperature", "fx", "fy", "fz", "t", "tx", "ty", "tz"};
  const Recording r = load("20,1,2,3,0,4,5,6\n21,1,2,3,0.1,4,5,6\n", format);
  for (int k = 0; k < 6; ++k) EXPECT_EQ(r.values[0][k], k + 1);
  format.columns[0] = "fx";
  EXPECT_NE(refusal("1\n", format).find("name each of 't, fx,"), std::string::npos);
}

TEST_F(RecordingFile, BadRowsAreNamedByLine) {
  const std::string ok = "0,1,2,3,4,5,6\n";
  const auto expect = [&](const std::string& rows, const std::string& part) {
    const std::string said = refusal(rows, bare());
    EXPECT_EQ(said.compare(0, part.size(), part), 0) << said;
  };
  expect(ok + "# remark\n1,1,2,3,4,5\n", ":3: 6 columns: give 7 as in the first row");
  expect(ok + "1,1,2,3,4,5,6,7\n", ":2: 8 columns: give 7 as in the first row");
  expect(ok + "1,nan,2,3,4,5,6\n", ":2: column fx is 'nan'");
  expect(ok + "1,1,inf,3,4,5,6\n", ":2: column fy is 'inf'");
  expect(ok + "1,1,2,x,4,5,6\n", ":2: column fz is 'x'");
  expect(ok + "1,1,2,,4,5,6\n", ":2: column fz is ''");
  expect(ok + "1,1,2,3,4,5,6 7\n", ":2: column tz is '6 7'");
  expect(ok + "0,1,2,3,4,5,6\n", ":2: column t is 0.0 after 0.0");
  expect("-1.5,1,2,3,4,5,6\n-1.25,1,2,3,4,5,6\n", ":1: time is -1.5");
  expect("5e9,1,2,3,4,5,6\n5.0000000005e9,1,2,3,4,5,6\n", ":1: time is 5000000000");
  expect(ok + "0.2,1,2,3,4,5,6\n0.1,1,2,3,4,5,6\n", ":3: column t is 0.1 after 0.2");
  expect(ok, "recording '' has 1 rows");
  EXPECT_THROW(loadRecording(path_ + ".none", {}), InputError);
  EXPECT_THROW(loadRecording(fs::path(path_).parent_path().string(), {}), InputError);
}

TEST_F(RecordingFile, CountsBecomeVoltsAndEndCodesAreFlagged) {
  ReplayFormat format = bare(SampleQuantity::kCounts);
  const Recording r = load("0,0,1,-1,32767,-32768,100\n1,0,0,0,0,0,0\n", format);
  const double lsb = 10.0 / 65536.0;
  EXPECT_EQ(r.values[0][1], lsb);
  EXPECT_EQ(r.values[0][2], -lsb);
  EXPECT_EQ(r.values[0][4], -5.0);
  EXPECT_EQ(r.saturated[0], (1 << 3) | (1 << 4));
  EXPECT_EQ(r.saturated[1], 0);
  EXPECT_NE(refusal("0,0,1,-1,32768,0,0\n", format).find("ch4 is 32768"), std::string::npos);
  EXPECT_NE(refusal("0,0.5,1,-1,3,0,0\n", format).find("ch1 is 0.5"), std::string::npos);

  const Recording volts = load("0,4.9,5,-5,0,0,6\n1,0,0,0,0,0,0\n", bare(SampleQuantity::kVolts));
  EXPECT_EQ(volts.values[0][0], 4.9);
  EXPECT_EQ(volts.saturated[0], (1 << 1) | (1 << 2) | (1 << 5));
}

// Every sample once and in order; blocks never span a gap; stamps stay true to half a period.
TEST_F(RecordingFile, BlocksEndAtGaps) {
  Recording recording;
  for (const double t : {0.0, 0.1, 0.2, 0.7, 0.8, 0.9, 1.0, 1.1}) {
    recording.time.push_back(t);
    recording.values.push_back(Vector6::Constant(t));
    recording.saturated.push_back(0);
  }
  recording.period = 0.1;
  Replay replay(recording, 4, false);
  std::vector<std::pair<std::size_t, std::size_t>> seen;
  ReplayBlock block;
  while (replay.next(block)) {
    EXPECT_EQ(block.time, recording.time[block.first]);
    EXPECT_EQ(block.sequence, seen.size());
    seen.emplace_back(block.first, block.size);
  }
  EXPECT_EQ(seen, (std::vector<std::pair<std::size_t, std::size_t>>{{0, 3}, {3, 4}, {7, 1}}));
  EXPECT_FALSE(replay.next(block));
  EXPECT_THROW(Replay(recording, 0, false), InputError);
}

TEST_F(RecordingFile, ALoopGoesOnInTime) {
  Replay replay(
      load("t_s,fx,fy,fz,tx,ty,tz\n1,1,2,3,4,5,6\n2,1,2,3,4,5,6\n3,1,2,3,4,5,6\n", bare()), 1,
      true);
  ReplayBlock block;
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(replay.next(block));
    EXPECT_EQ(block.time, 1.0 + i);
    EXPECT_EQ(block.first, static_cast<std::size_t>(i % 3));
    EXPECT_EQ(block.sequence, static_cast<std::uint32_t>(i));
  }
}

}  // namespace
}  // namespace assembly_cell
