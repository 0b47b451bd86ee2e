// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool as a person uses it: plan, solve, check, without a master.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>

#include "tool_run.h"

namespace {

using assembly_cell::test::ToolRun;

class Calibrate : public ::testing::Test {
 protected:
  ToolRun run(const std::string& arguments) const {
    return assembly_cell::test::runTool("calibrate " + arguments, folder_);
  }
  static bool has(const ToolRun& result, const std::string& part) {
    return result.text().find(part) != std::string::npos;
  }
  const assembly_cell::test::TemporaryFolder scratch_;
  const std::string folder_ = scratch_.path();
};

// gates that the core's own tests do not reach: hold-out and data for the quadratic model on the
// nonlinear sensor, orientations on the thesis's procedure
TEST_F(Calibrate, GatesSayWhatIsMissing) {
  ASSERT_EQ(run("plan recommended --simulate n.yaml").code, 0);
  const ToolRun nonlinear = run("solve n.yaml");
  EXPECT_EQ(nonlinear.code, 1);
  EXPECT_TRUE(has(nonlinear, "the linear model does not fit the tests")) << nonlinear.text();
  EXPECT_TRUE(has(nonlinear, "for the quadratic model add 28 more reacting tests"));
  EXPECT_TRUE(has(nonlinear, "tests held out miss by"));
  run("plan thesis_shifted --simulate s.yaml");
  const ToolRun thesis = run("solve s.yaml --procedure thesis");
  EXPECT_EQ(thesis.code, 1);
  EXPECT_TRUE(has(thesis, "reacting tests turn about 0 axes")) << thesis.text();
  EXPECT_TRUE(has(thesis, "rank 30 of 36"));
  EXPECT_TRUE(has(thesis, "residual degrees of freedom, below 20"));
}

// A bag of the server's ~observations gives the same result as the file; its last message counts.
TEST_F(Calibrate, ReadsABag) {
  ASSERT_EQ(run("plan recommended --nonlinearity 0 --simulate t.yaml").code, 0);
  const std::string write =
      "cd " + folder_ +
      " && /usr/bin/python3 -c \"import rosbag; from std_msgs.msg import String; b = rosbag.Bag("
      "'t.bag', 'w'); b.write('/calibration_server/observations', String('old')); "
      "b.write('/calibration_server/observations', String(open('t.yaml').read())); b.close()\"";
  ASSERT_EQ(std::system(write.c_str()), 0);
  const ToolRun file = run("solve t.yaml"), bag = run("solve t.bag");
  EXPECT_EQ(bag.code, 0) << bag.text();
  EXPECT_EQ(bag.text(), file.text());
  const ToolRun missing = run("solve none.bag");
  EXPECT_EQ(missing.code, 2);
  EXPECT_TRUE(has(missing, "none.bag: no observations read")) << missing.text();
}

TEST_F(Calibrate, PlansSolvesSavesAndChecks) {
  const ToolRun plan = run("plan recommended --nonlinearity 0 --simulate t.yaml");
  EXPECT_EQ(plan.code, 0) << plan.text();
  EXPECT_TRUE(has(plan, "rank: 72\n")) << plan.text();
  const ToolRun solve = run("solve t.yaml --save store --id first");
  EXPECT_EQ(solve.code, 0) << solve.text();
  EXPECT_TRUE(has(solve, "accepted: true"));
  const ToolRun check = run("check store/sensor_a/first.yaml --observations t.yaml");
  EXPECT_EQ(check.code, 0) << check.text();
  EXPECT_TRUE(has(check, "weights: 6\n")) << check.text();
  EXPECT_TRUE(has(check, "dropped: 0\n")) << check.text();
  // of another sensor, and of sensors without a number
  ASSERT_EQ(std::system(("cd " + folder_ +
                         " && sed 's/simulated-/other-/' t.yaml >other.yaml && "
                         "sed 's/simulated-[ab]//' t.yaml >plain.yaml")
                            .c_str()),
            0);
  const ToolRun other = run("check store/sensor_a/first.yaml --observations other.yaml");
  EXPECT_EQ(other.code, 2);
  EXPECT_TRUE(has(other, "the calibration is of 'simulated-a'")) << other.text();
  ASSERT_EQ(run("solve plain.yaml --save plain --id one").code, 0);
  const ToolRun plain = run("check plain/sensor_b/one.yaml --observations plain.yaml");
  EXPECT_EQ(plain.code, 0) << plain.text();
  // readings that no converter of 5 V gives
  ASSERT_EQ(
      std::system(
          ("cd " + folder_ + " && sed 's/volts: \\[[^,]*,/volts: [12.0,/' t.yaml >v.yaml").c_str()),
      0);
  EXPECT_EQ(run("check v.yaml").code, 1);
  EXPECT_TRUE(has(run("check v.yaml"), "beyond the full scale of 5.0 V"))
      << run("check v.yaml").text();
  const ToolRun nothing = run("check store/sensor_a/first.yaml --observations v.yaml");
  EXPECT_EQ(nothing.code, 1);
  EXPECT_TRUE(has(nothing, "nothing was compared")) << nothing.text();
  // stored ones are never overwritten
  const ToolRun taken = run("solve t.yaml --save store --id first");
  EXPECT_EQ(taken.code, 2);
  EXPECT_TRUE(has(taken, "id 'first' is taken")) << taken.text();
  EXPECT_EQ(run("check t.yaml").code, 0);
  EXPECT_TRUE(has(run("solve t.yaml --id x"), "--id: serves --save"));
  EXPECT_EQ(run("plan recommended --next 2").code, 2);
  const ToolRun next = run("plan next --observations t.yaml --next 2");
  EXPECT_EQ(next.code, 0) << next.text();
  EXPECT_TRUE(has(next, "gain:")) << next.text();
}

TEST_F(Calibrate, RefusesTheThesisWithOne) {
  EXPECT_EQ(run("plan thesis_fixed --simulate t.yaml").code, 1);
  const ToolRun all = run("solve t.yaml");
  EXPECT_EQ(all.code, 1);
  EXPECT_TRUE(has(all, "rank 21 of 36")) << all.text();
  EXPECT_TRUE(has(all, "add ")) << all.text();
  EXPECT_EQ(run("plan thesis_shifted --simulate s.yaml").code, 1);
  EXPECT_TRUE(has(run("solve s.yaml --procedure thesis"), "rank 30 of 36"));
}

TEST_F(Calibrate, BadInputEndsWithTwoAndOneLine) {
  for (const char* arguments :
       {"", "dance", "solve", "solve none.yaml", "plan", "plan nothing", "check none.yaml",
        "solve a b", "plan recommended --bits 12", "plan recommended --bits", "solve x --what"}) {
    EXPECT_EQ(run(arguments).code, 2) << arguments << "\n" << run(arguments).text();
  }
  EXPECT_TRUE(has(run("plan recommended --bits 12"), "--bits: value 12: give 10, 16 or 24"));
  std::ofstream(folder_ + "/head_only.yaml") << "format: assembly_cell observations 1\n";
  EXPECT_EQ(run("solve head_only.yaml").code, 2);
  for (const char* arguments : {"", "solve none.yaml", "solve head_only.yaml"}) {
    const std::string text = run(arguments).text();
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  }
  EXPECT_EQ(run("--help").code, 0);
}

}  // namespace
