// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tools on bad files, as a person meets them: exit code 2 and one line.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>

#include "temporary_folder.h"

namespace {

struct Result {
  int code;
  std::string text;
};

Result run(const std::string& arguments) {
  FILE* pipe = popen((ASSEMBLY_CELL_BIN_DIR "/" + arguments + " 2>&1").c_str(), "r");
  Result result{-1, ""};
  std::array<char, 4096> buffer;
  while (std::size_t n = fread(buffer.data(), 1, buffer.size(), pipe)) {
    result.text.append(buffer.data(), n);
  }
  result.code = WEXITSTATUS(pclose(pipe));
  return result;
}

std::string write(const std::string& name, const std::string& content) {
  const std::string path = assembly_cell::test::temporaryFile(name);
  std::ofstream(path) << content;
  return path;
}

void expectOneLine(const std::string& arguments, const std::string& word) {
  const Result r = run(arguments);
  EXPECT_EQ(r.code, 2) << arguments << "\n" << r.text;
  EXPECT_EQ(std::count(r.text.begin(), r.text.end(), '\n'), 1) << r.text;
  EXPECT_NE(r.text.find(word), std::string::npos) << r.text;
}

TEST(RecordingTools, BadReferenceRunsGetOneLine) {
  std::string rows;
  for (int k = 0; k < 50; ++k) {
    rows += std::to_string(k) + "e-3";
    for (int c = 0; c < 12; ++c) rows += "\t" + std::to_string((k * (c + 3)) % 17);
    rows += "\n";
  }
  const std::string good = write("good.txt", rows), nan = write("nan.txt", rows + "1\tnan\n");
  const std::string slow = write("slow.txt", "0\t" + rows.substr(rows.find('\t') + 1));
  expectOneLine("calibrate reference " + good, "another RUN");
  expectOneLine("calibrate reference " + good + " --holdout " + good, "is a RUN as well");
  expectOneLine("calibrate reference " + good + " --holdout none.txt", "none.txt");
  expectOneLine("calibrate reference " + good + " --holdout " + nan, "nan.txt:51");
  expectOneLine("calibrate reference " + good + " --holdout " +
                    write("five.csv",
                          "t,ch1,ch2,ch3,ch4,ch5,fx,fy,fz,tx,ty,tz\n"
                          "0,1,2,3,4,5,6,7,8,9,10,11\n"),
                "column ch6 is missing");
  expectOneLine("calibrate reference", "RUN");
}

TEST(RecordingTools, BadDeadWeightsGetOneLine) {
  const std::string header = "fx,fy,fz,mx,my,mz,known_fx,known_fy,known_fz,known_mx,known_my";
  expectOneLine("calibrate deadweights " + write("d1.csv", header + "\n1,2,3,4,5,6,7,8,9,1,2\n"),
                "known_tz is missing");
  expectOneLine(
      "calibrate deadweights " + write("d2.csv", header + ",known_mz\n1,2,3,4,5,6,7,8,9,1,2,nan\n"),
      "known_mz is 'nan'");
  expectOneLine(
      "calibrate deadweights " + write("d3.csv", header + ",known_mz\n1,2,3,4,5,6,7,8,9,1,2,\n"),
      "known_mz is empty");
  expectOneLine(
      "calibrate deadweights " + write("d4.csv", header + ",known_mz\n1,2,3,4,5,6,7,8,9,1,2,3\n"),
      "1 rows with known loads");
}

TEST(RecordingTools, BadRecordingsGetOneLine) {
  std::string two_rates = "t,drive\n";
  for (int k = 0; k < 100; ++k) {
    two_rates += std::to_string(k < 50 ? 0.001 * k : 0.05 + 0.002 * (k - 50)) + ",1\n";
  }
  expectOneLine("tones " + write("rates.csv", two_rates), "give one rate");
  expectOneLine("tones " + write("t.csv", "t,a\n0,1\n1,2\n") + " --channel b", "column b");
  expectOneLine("tones " + write("short.csv", "t,a\n0,1\n1,2\n"), "at least 64");
  expectOneLine("contacts " + write("c1.csv",
                                    "t,fx,fy,fz,tx,ty,tz,x,y,z,qx,qy,qz\n"
                                    "0,1,2,3,4,5,6,7,8,9,0,0,0\n"),
                "column qw is missing");
  expectOneLine("contacts " + write("c2.csv", "0,1,2,3,4,5,6,7,8,9,0,0,0,1\n"), "1 samples");
  expectOneLine("contacts " + write("c3.csv", "0,1,2,3,4,5,6,7,8,9,0,0,0,2\n"), "quaternion");
  expectOneLine("contacts none.bag", "none.bag");
}

// A tone of 1 Hz sampled at 10 Hz in seconds, and the same with times in ms as whole numbers.
TEST(RecordingTools, TonesNameTheUnitOfTime) {
  std::string seconds = "t,fz\n", milliseconds = "t_ms,fz\n";
  for (int k = 0; k < 600; ++k) {
    const double value = 2.0 * std::sin(0.2 * M_PI * k) + 0.01 * ((7 * k) % 5 - 2);
    seconds += std::to_string(0.1 * k) + "," + std::to_string(value) + "\n";
    milliseconds += std::to_string(100 * k) + "," + std::to_string(value) + "\n";
  }
  const std::string t = write("seconds.csv", seconds);
  std::string stamps = "t,fz\n";
  for (int k = 0; k < 600; ++k) {
    stamps += std::to_string(1.7e9 + 0.1 * k) + "," +
              std::to_string(2.0 * std::sin(0.2 * M_PI * k) + 0.01 * ((7 * k) % 5 - 2)) + "\n";
  }
  for (const std::string& arguments :
       {t, t + " --time-unit s", write("ms.csv", milliseconds), write("stamps.csv", stamps)}) {
    const Result r = run("tones " + arguments);
    ASSERT_EQ(r.code, 0) << r.text;
    const std::size_t at = r.text.find("frequency: ");
    ASSERT_NE(at, std::string::npos);
    EXPECT_NEAR(std::stod(r.text.substr(at + 11)), 1.0, 0.001) << r.text;
    EXPECT_NE(r.text.find("time_unit: "), std::string::npos);
    EXPECT_NEAR(std::stod(r.text.substr(r.text.find("phase: [") + 8)), -M_PI / 2, 0.01) << r.text;
  }
  expectOneLine("tones " + t + " --time-unit min", "--time-unit");
}

TEST(RecordingTools, PositionsInMillimetresAreNamed) {
  std::string rows;
  for (int k = 0; k < 100; ++k) {
    rows += std::to_string(0.01 * k) + ",1,2,3,0,0,0,512.5,-32.2," + std::to_string(200 + 0.1 * k) +
            ",0,0,0,1\n";
  }
  const std::string header = "t,fx,fy,fz,tx,ty,tz,x,y,z,qx,qy,qz,qw\n";
  expectOneLine("contacts " + write("mm.csv", header + rows), "positions in mm or cm?");
  // near the origin the speed shows it
  std::string near;
  for (int k = 0; k < 100; ++k) {
    near +=
        std::to_string(0.01 * k) + ",1,2,3,0,0,0,1,1," + std::to_string(0.08 * k) + ",0,0,0,1\n";
  }
  expectOneLine("contacts " + write("near.csv", header + near), "positions in mm or cm?");
  const std::string named = "t,fx,fy,fz,tx,ty,tz,x [mm],y [mm],z [mm],qx,qy,qz,qw\n";
  const Result r = run("contacts " + write("named.csv", named + rows));
  EXPECT_EQ(r.text.find("positions in mm or cm?"), std::string::npos) << r.text;
}

TEST(RecordingTools, PayloadReadsMatricesAndJointAngles) {
  // an arm of two joints under a base that hangs askew by 0.2 rad about x
  const std::string urdf = write(
      "arm.urdf",
      "<robot name='arm'><link name='base'/><link name='one'/><link name='two'/><link name='tip'/>"
      "<joint name='a' type='revolute'><parent link='base'/><child link='one'/><axis xyz='0 0 1'/>"
      "<limit lower='-3' upper='3' effort='1' velocity='1'/></joint>"
      "<joint name='b' type='continuous'><parent link='one'/><child link='two'/>"
      "<axis xyz='0 1 0'/></joint>"
      "<joint name='c' type='fixed'><parent link='two'/><child link='tip'/></joint></robot>");
  std::string joints = "a,b\n",
              matrices = "r11,r12,r13,r21,r22,r23,r31,r32,r33,fx,fy,fz,tx,ty,tz\n";
  std::string wrenches = "fx,fy,fz,tx,ty,tz\n";
  for (int k = 0; k < 12; ++k) {
    const double a = 0.5 * (k % 4), b = 0.7 * (k / 4) - 0.6 + 0.1 * (k % 3);
    const double ca = std::cos(a), sa = std::sin(a), cb = std::cos(b), sb = std::sin(b);
    const double R[3][3] = {{ca * cb, -sa, ca * sb}, {sa * cb, ca, sa * sb}, {-sb, 0, cb}};
    const double g[3] = {0.0, 10.0 * std::sin(0.2), -10.0 * std::cos(0.2)};
    double f[3], w[6];
    for (int i = 0; i < 3; ++i) f[i] = R[0][i] * g[0] + R[1][i] * g[1] + R[2][i] * g[2];
    const double jitter = 1e-4 * ((7 * k) % 5 - 2);
    const double values[6] = {1 + f[0] + jitter,     2 + f[1],    3 + f[2],
                              -0.05 * f[1] + jitter, 0.05 * f[0], 0.1};
    std::copy(values, values + 6, w);
    std::string row;
    for (int i = 0; i < 6; ++i) row += (i == 0 ? "" : ",") + std::to_string(w[i]);
    std::string rotation;
    for (const auto& line : R) {
      for (const double r : line) rotation += std::to_string(r) + ",";
    }
    joints += std::to_string(a) + "," + std::to_string(b) + "\n";
    wrenches += row + "\n";
    matrices += rotation + row + "\n";
  }
  const std::string poses = write("joints.csv", joints), readings = write("w.csv", wrenches);
  const Result by_matrix = run("calibrate payload " + write("m.csv", matrices));
  const Result by_joints =
      run("calibrate payload " + poses + " " + readings + " --urdf " + urdf + " --link tip");
  for (const Result& r : {by_matrix, by_joints}) {
    EXPECT_EQ(r.code, 0) << r.text;
    EXPECT_NE(r.text.find("the base hangs askew"), std::string::npos) << r.text;
    EXPECT_NE(r.text.find("11.5"), std::string::npos) << r.text;  // 0.2 rad in degrees
  }
  expectOneLine("calibrate payload " + poses + " " + readings + " --urdf " + urdf, "give both");
  expectOneLine("calibrate payload " + poses + " " + readings + " --urdf " + urdf + " --link hand",
                "link hand");
}

}  // namespace
