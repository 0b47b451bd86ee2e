// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool as a person uses it: calibrate payload.
#include <gtest/gtest.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "tool_run.h"

namespace assembly_cell {
namespace {

const std::string kData = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/test/data/ati_payload/";

using test::ToolRun;

ToolRun call(const std::vector<std::string>& arguments) {
  std::string command = "calibrate payload";
  for (const std::string& argument : arguments) command += " '" + argument + "'";
  return test::runTool(command);
}

std::vector<std::string> lines(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> out;
  for (std::string line; std::getline(file, line);) out.push_back(line);
  return out;
}

std::string write(const std::string& name, const std::vector<std::string>& rows) {
  const std::string path = testing::TempDir() + "payload_" + std::to_string(getpid()) + "_" + name;
  std::ofstream file(path);
  for (const std::string& row : rows) file << row << "\n";
  return path;
}

std::vector<double> numbers(const std::string& line) {
  std::vector<double> out;
  std::stringstream stream(line);
  for (std::string cell; std::getline(stream, cell, ',');) out.push_back(std::stod(cell));
  return out;
}

// Limits of the requirement: force 0.045 N, torque 0.0009 N m, weight 11.44 N within 0.05 N.
TEST(PayloadTool, RealRecording) {
  const ToolRun o = call({kData + "poses.csv", kData + "wrenches.csv", "--holdout"});
  ASSERT_EQ(o.code, 0) << o.error;
  const YAML::Node y = YAML::Load(o.out);
  EXPECT_EQ(y["status"].as<std::string>(), "ok");
  EXPECT_EQ(y["axes"].as<std::string>(), "base");
  EXPECT_NEAR(y["weight"].as<double>(), 11.44, 0.05);
  EXPECT_NEAR(y["plain_rms"]["force"].as<double>(), 0.28, 0.005);
  EXPECT_LT(y["held_out_rms"]["force"].as<double>(), 0.045);
  EXPECT_LT(y["held_out_rms"]["torque"].as<double>(), 0.0009);
  EXPECT_LT(y["gravity_direction"][2].as<double>(), -0.9999);
  EXPECT_NE(y["drift"]["fz"]["shape"].as<std::string>(), "none");
  EXPECT_LT(y["drift"]["fz"]["change"][0].as<double>(), -1.5);
  EXPECT_LT(y["drift"]["fz"]["change_sd"][0].as<double>(), 0.05);
  bool middle = false;
  for (const YAML::Node& b : y["breaks"]) middle = middle || b["pose"].as<int>() == 25;
  EXPECT_TRUE(middle);
  EXPECT_EQ(y["held_out"].size(), y["poses"].as<std::size_t>());
}

// Every other pose alone, twice the gap of the requirement's check, predicts the rest.
TEST(PayloadTool, EveryOtherPosePredictsTheRest) {
  const std::vector<std::string> poses = lines(kData + "poses.csv");
  const std::vector<std::string> wrenches = lines(kData + "wrenches.csv");
  ASSERT_EQ(poses.size(), 50u);
  std::vector<std::string> given_poses, given_wrenches, further, ground_truth;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    (i % 2 == 0 ? given_poses : further).push_back(poses[i]);
    (i % 2 == 0 ? given_wrenches : ground_truth).push_back(wrenches[i]);
  }
  const std::string output = write("out.csv", {});
  const ToolRun o = call({write("p.csv", given_poses), write("w.csv", given_wrenches), "--predict",
                          write("n.csv", further), "--output", output});
  ASSERT_EQ(o.code, 0) << o.error;
  const std::vector<std::string> predicted = lines(output);
  ASSERT_EQ(predicted.size(), ground_truth.size());  // no header: as in the wrenches
  double force = 0.0, torque = 0.0;
  for (std::size_t i = 0; i < ground_truth.size(); ++i) {
    const std::vector<double> p = numbers(predicted[i]), t = numbers(ground_truth[i]);
    ASSERT_EQ(p.size(), 6u);
    for (std::size_t k = 0; k < 6; ++k) (k < 3 ? force : torque) += std::pow(p[k] - t[k], 2);
  }
  EXPECT_LT(std::sqrt(force / 75.0), 0.045);
  EXPECT_LT(std::sqrt(torque / 75.0), 0.0013);
  EXPECT_EQ(YAML::Load(o.out)["prediction"].size(), ground_truth.size());
  EXPECT_EQ(YAML::Load(o.out)["prediction"][3]["order"].as<double>(), 3.5);
}

TEST(PayloadTool, HeadersOrderAndTrace) {
  std::vector<std::string> poses = lines(kData + "poses.csv");
  std::vector<std::string> wrenches = lines(kData + "wrenches.csv");
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i] += "," + std::to_string(10 * i);
  const std::vector<std::string> further = {"x,y,z,qx,qy,qz,qw,order", poses[30]};
  poses.insert(poses.begin(), "x,y,z,qx,qy,qz,qw,t");
  wrenches.insert(wrenches.begin(), "fx,fy,fz,tx,ty,tz");
  const std::string output = write("out.csv", {}), trace = write("trace.csv", {});
  const ToolRun o =
      call({write("p.csv", poses), write("w.csv", wrenches), "--axes", "base", "--predict",
            write("n.csv", further), "--output", output, "--trace", trace, "--in-situ"});
  ASSERT_EQ(o.code, 0) << o.error;
  const YAML::Node y = YAML::Load(o.out);
  EXPECT_NEAR(y["weight"].as<double>(), 11.44, 0.05);
  EXPECT_EQ(y["prediction"][0]["order"].as<double>(), 300.0);
  EXPECT_TRUE(y["in_situ"]["reason"].IsDefined());
  const std::vector<std::string> predicted = lines(output);
  ASSERT_EQ(predicted.size(), 2u);
  EXPECT_EQ(predicted[0], "fx,fy,fz,tx,ty,tz");
  EXPECT_EQ(lines(trace).size(), 1 + y["poses"].as<std::size_t>());
}

TEST(PayloadTool, BadInputIsNamed) {
  const std::string poses = kData + "poses.csv", wrenches = kData + "wrenches.csv";
  EXPECT_EQ(call({"--help"}).code, 0);
  EXPECT_NE(call({"--help"}).out.find("Example"), std::string::npos);
  const auto refused = [](const std::vector<std::string>& arguments, const std::string& word) {
    const ToolRun o = call(arguments);
    EXPECT_EQ(o.code, 2) << o.out;
    EXPECT_EQ(o.out, "");
    EXPECT_NE(o.error.find(word), std::string::npos) << o.error;
    EXPECT_EQ(std::count(o.error.begin(), o.error.end(), '\n'), 1);
  };
  refused({}, "POSES");
  refused({poses}, "WRENCHES");
  refused({poses, wrenches, "--axis", "base"}, "--axis");
  refused({poses, wrenches, "--axes", "world"}, "world");
  refused({poses, wrenches, "--predict"}, "--predict");
  refused({poses, wrenches, "--output", "x.csv"}, "--predict");
  refused({poses, wrenches, "--in-situ", "--weight", "-3"}, "-3");
  refused({poses, "no_such.csv"}, "no_such.csv");
  refused({poses, write("empty.csv", {})}, "no rows");
  refused({poses, write("short.csv", {"1,2,3,4,5,6"})}, "1 rows");
  refused({poses, write("nan.csv", {"1,2,3,4,5,nan"})}, "tz");
  refused({poses, write("code.csv", {"1,2,-99999,4,5,6"})},
          "code.csv:1: fz is -99999.0: no sensor");
  refused({poses, write("end.csv", {"1,2,3,4,5,2147483647"})}, "tz is 2147483647.0: no sensor");
  refused({poses, write("five.csv", {"fx,fy,fz,tx,ty", "1,2,3,4,5"})}, "tz");
  refused({write("q.csv", {"0,0,0,0,0,0,2"}), wrenches}, "quaternion");
  // too few poses: understood, but not determined
  const ToolRun few = call({write("p1.csv", {"0,0,0,0,0,0,1"}), write("w1.csv", {"1,2,3,4,5,6"})});
  EXPECT_EQ(few.code, 1);
  EXPECT_EQ(YAML::Load(few.out)["status"].as<std::string>(), "refused");
}

}  // namespace
}  // namespace assembly_cell
