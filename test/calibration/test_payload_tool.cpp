// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool as a person uses it: calibrate payload.
#include <gtest/gtest.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "assembly_cell/base/text.h"
#include "assembly_cell/geometry/spatial.h"
#include "temporary_folder.h"
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
  const std::string path = test::temporaryFile(name);
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
// Their names are those of the bridge's file of parameters.
TEST(PayloadTool, PrintsTheParametersOfTheArmsBridge) {
  const ToolRun o = call({kData + "poses.csv", kData + "wrenches.csv"});
  ASSERT_EQ(o.code, 0) << o.error;
  const YAML::Node y = YAML::Load(o.out);
  const YAML::Node bridge =
      YAML::LoadFile(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/arm/arm_bridge.yaml");
  ASSERT_TRUE(bridge["payload_mass"] && bridge["payload_centre"]);
  EXPECT_EQ(y["payload_mass"].as<double>(), y["mass"].as<double>());
  ASSERT_EQ(y["payload_centre"].size(), bridge["payload_centre"].size());
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(y["payload_centre"][i].as<double>(), y["center_of_mass"][i].as<double>());
  }
  EXPECT_NE(o.out.find("\npayload_mass: "), std::string::npos);
}

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

// ---- recordings that are not what they were read as

constexpr double kMass = 1.2;
const Eigen::Vector3d kCenter(0.01, -0.005, 0.06);

// As the files of a person: unit quaternions and wrenches in the sensor's axes, bias, noise.
struct Files {
  std::vector<Eigen::Quaterniond> q;
  std::vector<Vector6> w;

  explicit Files(std::size_t poses = 24, unsigned seed = 5) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (std::size_t i = 0; i < poses; ++i) {
      q.push_back(Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
                      .normalized());
      const Eigen::Vector3d f = q.back().conjugate() * Eigen::Vector3d(0, 0, -kMass * 9.80665);
      Vector6 one;
      one << f, kCenter.cross(f);
      one += (Vector6() << 3, -2, 5, 0.2, -0.1, 0.05).finished();
      for (int k = 0; k < 6; ++k) one[k] += (k < 3 ? 0.02 : 0.002) * normal(random);
      w.push_back(one);
    }
  }

  ToolRun run(const std::vector<std::string>& more = {}, bool w_first = false) const {
    std::vector<std::string> poses, wrenches;
    for (std::size_t i = 0; i < q.size(); ++i) {
      Eigen::Vector4d c = q[i].coeffs();
      if (w_first) c = Eigen::Vector4d(q[i].w(), q[i].x(), q[i].y(), q[i].z());
      poses.push_back("0,0,0" + row(c));
      wrenches.push_back(row(w[i]).substr(1));
    }
    std::vector<std::string> arguments = {write("jp.csv", poses), write("jw.csv", wrenches)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return call(arguments);
  }

  template <typename Change>
  Files& each(const Change& change) {
    for (std::size_t i = 0; i < w.size(); ++i) change(w[i], i);
    return *this;
  }

 private:
  template <typename Values>
  static std::string row(const Values& values) {
    std::string out;
    for (Eigen::Index k = 0; k < values.size(); ++k) out += "," + text("%.6f", values[k]);
    return out;
  }
};

void expectReason(const ToolRun& o, const std::string& words) {
  EXPECT_EQ(o.code, 1) << o.out;
  const YAML::Node y = YAML::Load(o.out);
  EXPECT_NE(y["status"].as<std::string>(), "ok");
  EXPECT_NE(y["reason"].as<std::string>().find(words), std::string::npos)
      << words << ": " << y["reason"];
  EXPECT_NE(o.error.find(words), std::string::npos) << o.error;
}

TEST(PayloadTool, PlainFilesAreOk) {
  for (const std::size_t poses : {6u, 12u, 24u}) {
    const ToolRun o = Files(poses).run();
    EXPECT_EQ(o.code, 0) << o.error;
    EXPECT_NEAR(YAML::Load(o.out)["mass"].as<double>(), kMass, 0.02);
  }
}

TEST(PayloadTool, OtherUnitsAreNamed) {
  expectReason(Files().each([](Vector6& w, std::size_t) { w.tail<3>() *= 1e3; }).run(),
               "torques in N mm (then 1.2 kg");
  expectReason(Files().each([](Vector6& w, std::size_t) { w.head<3>() /= 9.80665; }).run(),
               "forces in kgf (then 1.2 kg");
  expectReason(Files().each([](Vector6& w, std::size_t) { w *= 2000.0; }).run(), "raw counts");
  expectReason(Files().each([](Vector6& w, std::size_t) { w = (100.0 * w).array().round(); }).run(),
               "whole numbers");
}

TEST(PayloadTool, FrozenReadingsAreNamedWithTheirRows) {
  expectReason(Files().each([](Vector6& w, std::size_t) { w[1] = 0.0; }).run(), "fy is 0 in all");
  expectReason(Files().each([](Vector6& w, std::size_t) { w[5] = 0.25; }).run(),
               "tz is 0.25 in all");
  expectReason(Files().each([](Vector6& w, std::size_t) { w.tail<3>().setZero(); }).run(),
               "each of tx, ty, tz is 0 in all");
  Files half;
  half.each([&](Vector6& w, std::size_t i) {
    if (i >= 12) w = half.w[12];
  });
  expectReason(half.run(), "rows 13 to 24 ");
  Files two;
  two.w[4] = two.w[9];
  expectReason(two.run(), "rows 5, 10 ");
}

TEST(PayloadTool, ATurnedSensorIsFound) {
  for (const double degrees : {8.0, 20.0, 45.0, 90.0}) {
    const Eigen::AngleAxisd turn(degrees * M_PI / 180.0, Eigen::Vector3d(0.0, 0.6, 0.8));
    const ToolRun o = Files()
                          .each([&](Vector6& w, std::size_t) {
                            w << turn.inverse() * w.head<3>(), turn.inverse() * w.tail<3>();
                          })
                          .run();
    expectReason(o, text("turned by %.1f deg about (0.00, 0.60, 0.80)", degrees));
  }
}

TEST(PayloadTool, OtherConventionsAreNamed) {
  expectReason(Files().run({}, true), "the quaternions w first");
  Files inverse;
  for (Eigen::Quaterniond& q : inverse.q) q = q.conjugate();
  expectReason(inverse.run(), "the inverse of the rotations");
  const Vector6 zero = inverse.w.front();
  expectReason(inverse.each([&](Vector6& w, std::size_t) { w -= zero; }).run(),
               "the inverse of the rotations");
  Files mixed;
  mixed.each([&](Vector6& w, std::size_t i) { w.head<3>() = mixed.q[i] * w.head<3>(); });
  expectReason(mixed.run(), "forces in base axes and torques in sensor axes");
  expectReason(Files().each([](Vector6& w, std::size_t) { w[1] *= -1.0; }).run(),
               "the force's axes (x, -y, z)");
  Files mixed_up;
  std::rotate(mixed_up.w.begin(), mixed_up.w.begin() + 1, mixed_up.w.end());
  expectReason(mixed_up.run(), "each wrench has its pose");
}

TEST(PayloadTool, ALoadOfOppositeSignIsNamedUnlessTheBaseHangs) {
  Files files;
  files.each([](Vector6& w, std::size_t) { w = -w; });
  expectReason(files.run(), "opposite sign");
  EXPECT_EQ(files.run({"--upside-down"}).code, 0);
  expectReason(Files().run({"--upside-down"}), "opposite sign");
}

TEST(PayloadTool, GravityOfAnotherLengthIsRefused) {
  for (const char* g : {"0,0,1", "0,0,0", "0,0,9.5"}) {
    const ToolRun o = call(
        {write("g.csv", {"qx,qy,qz,qw,gx,gy,gz", "0,0,0,1,0,0,9.81", "0,0,0,1," + std::string(g)}),
         write("gw.csv", {"1,2,3,4,5,6", "1,2,3,4,5,6"})});
    EXPECT_EQ(o.code, 2);
    EXPECT_NE(o.error.find("g.csv:3: gx, gy, gz have length"), std::string::npos) << o.error;
  }
}

}  // namespace
}  // namespace assembly_cell
