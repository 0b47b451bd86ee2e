// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Chamfer and compliant mount by hand, and the tool `insertion` from the command line.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/insertion/compliance.h"

namespace assembly_cell {
namespace {

TEST(Chamfer, LeadsInByBothWidthsAndTheClearance) {
  const PegInHole fit{0.025, 0.0251};
  EXPECT_NEAR(captureRange(fit, {}), 1e-4, 1e-17);
  EXPECT_NEAR(captureRange(fit, {5e-4, 3e-4, 0.0}), 9e-4, 1e-17);
  EXPECT_THROW(captureRange(fit, {-1e-4, 0.0, 0.0}), InputError);
  EXPECT_THROW(captureRange(fit, {0.0, 0.025, 0.0}), InputError);
}

// a block on a slope: pushed down by F, held back sideways by 1 N, about to slip
TEST(Chamfer, ForceOfABlockOnASlope) {
  for (const double slope : {0.3, M_PI / 4, 1.2}) {
    for (const double friction : {0.0, 0.1, 0.3, 0.9}) {
      const auto ratio = chamferForceRatio(slope, friction);
      ASSERT_EQ(ratio.has_value(), std::tan(slope) > friction);
      if (!ratio) continue;
      const double normal = *ratio * std::cos(slope) + std::sin(slope);
      const double downhill = *ratio * std::sin(slope) - std::cos(slope);
      EXPECT_NEAR(downhill, friction * normal, 1e-12 * *ratio);
    }
  }
  EXPECT_THROW(chamferForceRatio(M_PI / 2, 0.1), InputError);
}

// the load is what springs at the compliance centre give: energy K_x x_c²/2 + K_theta turn²/2
TEST(CompliantMount, LoadIsTheEnergysSlope) {
  const CompliantMount mount{2e4, 150.0, 0.08};
  const auto energy = [&](double x, double turn) {
    const double centre = x - mount.centre * turn;
    return 0.5 * mount.lateral * centre * centre + 0.5 * mount.angular * turn * turn;
  };
  const double x = 3e-4, turn = -0.01, e = 1e-6;
  const TipLoad load = mountLoad(mount, x, turn);
  EXPECT_NEAR(load.F_x, -(energy(x + e, turn) - energy(x - e, turn)) / (2 * e), 1e-6);
  EXPECT_NEAR(load.M, -(energy(x, turn + e) - energy(x, turn - e)) / (2 * e), 1e-6);
  // a remote centre at the tip: a lateral force turns nothing
  EXPECT_EQ(mountLoad({2e4, 150.0, 0.0}, 1e-3, 0.0).M, 0.0);
}

class InsertionTool : public testing::Test {
 protected:
  struct Result {
    int exit_code = -1;
    std::string text;
  };
  InsertionTool() : file_("/tmp/test_insertion_" + std::to_string(getpid()) + ".yaml") {}
  ~InsertionTool() override { std::filesystem::remove(file_); }

  Result run(const std::string& form, const std::string& parameters,
             const std::string& options = "") const {
    std::ofstream(file_) << parameters;
    Result result;
    FILE* pipe =
        popen((ASSEMBLY_CELL_BIN_DIR "/insertion " + form + " " + file_ + " " + options + " 2>&1")
                  .c_str(),
              "r");
    std::array<char, 256> buffer{};
    while (fgets(buffer.data(), buffer.size(), pipe)) result.text += buffer.data();
    result.exit_code = WEXITSTATUS(pclose(pipe));
    return result;
  }

  std::string file_;
};

TEST_F(InsertionTool, FormsAnswerUnderTheNamesOfTheHelp) {
  const std::string fit = "{peg_radius: 0.025, hole_radius: 0.0251";
  const struct {
    const char* form;
    std::string parameters, key;
    double value;
  } forms[] = {
      {"two_point", fit + ", tilt: 0.01}", "depth",
       (0.0502 - 0.05 * std::cos(0.01)) / std::sin(0.01)},
      {"tilt", fit + ", depth: 0.02}", "tilt", 0.0101284},
      {"wedging", fit + ", friction: 0.2}", "depth", 0.01},
      {"jamming", "{peg_radius: 0.025, depth: 0.04, friction: 0.2, F_x: 1, F_z: 10, M: 0.05}",
       "lambda", 4.0},
      {"diagram", "{peg_radius: 0.025, depth: 0.04, friction: 0.2}", "lambda", 4.0},
      {"chamfer",
       fit + ", hole_chamfer: 5.0e-4, peg_chamfer: 0, slope: 0.7853981633974483, friction: 0.2}",
       "force_ratio", 1.5},
      {"holder", "{K_x: 1.0e4, K_theta: 100, L_g: 0.1, x: 1.0e-3, turn: 0}", "M", 1.0}};
  for (const auto& form : forms) {
    const Result result = run(form.form, form.parameters);
    ASSERT_EQ(result.exit_code, 0) << result.text;
    EXPECT_NEAR(YAML::Load(result.text)[form.key].as<double>(), form.value,
                1e-4 * std::abs(form.value))
        << form.form << "\n"
        << result.text;
  }
  const Result rest = run("rest", fit + ", tilt: 0.005, friction: 0.3, F_x: 0, F_z: 1, M: -1}");
  ASSERT_EQ(rest.exit_code, 0) << rest.text;
  EXPECT_TRUE(YAML::Load(rest.text)["rests"].as<bool>());
  const Result swept = run("two_point", fit + "}", "--sweep tilt=0.001:0.05:50");
  EXPECT_EQ(YAML::Load(swept.text)["depth"].size(), 50u) << swept.text;
}

TEST_F(InsertionTool, AKeyThatIsSweptIsTheOptions) {
  const Result typo = run("two_point", "{peg_radius: 0.025, hole_radius: 0.0251, tilt: 0.01}",
                          "--sweep tlit=0.001:0.05:50");
  EXPECT_EQ(typo.exit_code, 2);
  EXPECT_NE(typo.text.find("insertion: --sweep: value tlit: no parameter"), std::string::npos)
      << typo.text;
}

TEST_F(InsertionTool, RefusesInOneLine) {
  const struct {
    const char *form, *parameters, *named;
  } bad[] = {
      {"two_point", "{peg_radius: 0.026, hole_radius: 0.0251, tilt: 0.01}",
       "peg_radius: value 0.026"},
      {"two_point", "{peg_radius: 0.025, hole_radius: 0.0251}", "tilt: missing"},
      {"two_point", "{peg_radius: 0.025, hole_radius: 0.0251, tilt: 0.01, mu: 0.1}",
       "mu: no parameter"},
      {"jamming", "{peg_radius: 0.025, depth: 0.04, friction: .nan, F_x: 1, F_z: 1, M: 0}",
       "friction"},
      {"two_point", "{peg_radius: 25, hole_radius: 25.1, tilt: 0.01}",
       "peg_radius: value 25.0: give metres, at most 0.06 m"},
      {"tilt", "{peg_radius: 0.025, hole_radius: 0.0251, depth: 20}",
       "depth: value 20.0: give metres, at most 2 m"},
      {"holder", "{K_x: 1, K_theta: 1, L_g: 0.1, x: -1, turn: 0}", "x: value -1.0: give met"},
      {"seating", "{}", "FORM: value seating"}};
  for (const auto& c : bad) {
    const Result result = run(c.form, c.parameters);
    EXPECT_EQ(result.exit_code, 2) << result.text;
    EXPECT_NE(result.text.find(c.named), std::string::npos) << result.text;
    EXPECT_EQ(std::count(result.text.begin(), result.text.end(), '\n'), 1) << result.text;
  }
}

}  // namespace
}  // namespace assembly_cell
