// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/records/band.h"
#include "assembly_cell/records/verdict.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

using Record = Run;  // testing::Test::Run hides it

class Rules : public testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) {
    const std::string path = folder_ / name;
    std::ofstream(path) << text;
    return path;
  }
  std::string box(const std::string& keys) {
    return write("box.yaml", "rules: 1\nprogram: plate\nboxes:\n  - {name: b, quantity: axial, " +
                                 keys + "}\n");
  }
  static std::string refusalOf(const std::vector<std::string>& paths) {
    try {
      RunRules rules(paths);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  static Record runOf(const std::vector<double>& depth, const std::vector<double>& axial) {
    Record run;
    run.program = "plate";
    run.curve.depth = depth;
    run.curve.axial = axial;
    for (std::size_t i = 0; i < depth.size(); ++i) {
      run.curve.time.push_back(0.1 * static_cast<double>(i));
    }
    const std::vector<double> zero(depth.size(), 0.0);
    run.curve.lateral = run.curve.moment = run.curve.tilt = zero;
    return run;
  }
  RunVerdict evaluate(const std::string& keys, const Record& run) {
    const std::vector<RunVerdict> verdicts = RunRules({box(keys)}).evaluate(run);
    EXPECT_EQ(verdicts.size(), 1u);
    return verdicts.front();
  }

  test::TemporaryFolder folder_;
};

TEST_F(Rules, RangeHoldsOverTheWholeDepthBetweenSamplesToo) {
  const char* const keys = "type: range, depth: [0.01, 0.02], value: [2, 10]";
  const Record good = runOf({0.0, 0.015, 0.03}, {0.0, 9.0, 0.0});
  // 6 N at 10 and at 20 mm
  const RunVerdict verdict = evaluate(keys, good);
  EXPECT_TRUE(verdict.passed) << verdict.text;
  EXPECT_NEAR(verdict.margin, 0.25, 1e-12);
  EXPECT_NEAR(verdict.depth, 0.015, 1e-12);
  const RunVerdict low = evaluate(keys, runOf({0.0, 0.015, 0.03}, {-15.0, 9.0, 0.0}));
  EXPECT_FALSE(low.passed);
  EXPECT_NEAR(low.depth, 0.01, 1e-12);
  EXPECT_EQ(evaluate(keys, runOf({0.0, 0.015}, {5.0, 5.0})).text,
            "not evaluated, counts as outside: the curve ends before 20 mm");
  EXPECT_EQ(evaluate(keys, runOf({0.012, 0.03}, {5.0, 5.0})).text,
            "not evaluated, counts as outside: the curve begins after 10 mm");
}

TEST_F(Rules, MaximumHasOneBoundOrTwo) {
  const Record run = runOf({0.0, 0.01, 0.02}, {1.0, 30.0, 2.0});
  EXPECT_FALSE(evaluate("type: maximum, value: [null, 25]", run).passed);
  EXPECT_TRUE(evaluate("type: maximum, value: [20, null]", run).passed);
  EXPECT_TRUE(evaluate("type: maximum, depth: [0.015, null], value: [1, 3]", run).passed);
  EXPECT_EQ(evaluate("type: maximum, value: [null, 25]", run).text,
            "axial 30 N at 10 mm, wanted at most 25 N");
}

TEST_F(Rules, EndIsWhereTheCurveEnds) {
  const char* const keys = "type: end, depth: [0.019, 0.021], value: [0, 5]";
  EXPECT_TRUE(evaluate(keys, runOf({0.0, 0.02}, {1.0, 2.0})).passed);
  EXPECT_FALSE(evaluate(keys, runOf({0.0, 0.02}, {1.0, 6.0})).passed);
  const RunVerdict chip = evaluate(keys, runOf({0.0, 0.0185}, {1.0, 2.0}));
  EXPECT_FALSE(chip.passed);
  EXPECT_EQ(chip.text, "ends at 18.5 mm, wanted 19 mm to 21 mm");
}

TEST_F(Rules, PassEntersAndLeavesByTheSidesGiven) {
  const std::string box = "type: pass, depth: [0.01, 0.02], value: [2, 10], ";
  const Record through = runOf({0.0, 0.03}, {5.0, 5.0}), above = runOf({0.0, 0.03}, {20.0, 20.0});
  const Record steep = runOf({0.0, 0.015, 0.03}, {0.0, 5.0, 80.0});
  EXPECT_TRUE(evaluate(box + "entry: left, exit: right", through).passed);
  EXPECT_EQ(evaluate(box + "entry: left, exit: top", through).text, "leaves at the right at 30 mm");
  EXPECT_EQ(evaluate(box + "entry: left, exit: right", above).text, "never enters the box");
  EXPECT_TRUE(evaluate(box + "entry: left, exit: top", steep).passed);
  EXPECT_FALSE(evaluate(box + "entry: bottom, exit: right", steep).passed);
  EXPECT_TRUE(evaluate(box + "exit: inside", runOf({0.0, 0.015}, {5.0, 5.0})).passed);
  EXPECT_FALSE(evaluate(box + "exit: right", runOf({0.0, 0.015}, {5.0, 5.0})).passed);
  // out by the top and in again
  const Record twice = runOf({0.0, 0.014, 0.015, 0.016, 0.03}, {5.0, 5.0, 30.0, 5.0, 5.0});
  EXPECT_EQ(evaluate(box + "entry: left, exit: right", twice).text, "leaves at the top at 15 mm");
}

TEST_F(Rules, NaNCountsAsOutside) {
  for (const char* keys :
       {"type: range, depth: [0.0, 0.02], value: [2, 10]", "type: maximum, value: [null, 25]",
        "type: end, depth: [0, 1], value: [0, 9]",
        "type: pass, depth: [0.0, 0.02], value: [2, 10]"}) {
    const RunVerdict verdict = evaluate(keys, runOf({0.0, 0.01, 0.03}, {5.0, std::nan(""), 5.0}));
    EXPECT_FALSE(verdict.passed);
    EXPECT_TRUE(std::isnan(verdict.margin));
    EXPECT_EQ(verdict.text, "not evaluated, counts as outside: axial isn't a number at 10 mm");
  }
}

TEST_F(Rules, ABandIsReadAsItWasWritten) {
  std::vector<Curve> good;
  for (int i = 0; i < 40; ++i) {
    const double level = 5.0 + 0.01 * ((i * 7919) % 100);
    good.push_back(runOf({0.0, 0.01 + 1e-6 * i, 0.02 + 1e-6 * i}, {level, 2 * level, level}).curve);
  }
  BandSettings settings;
  settings.program = "plate";
  settings.alpha = 0.1;
  settings.quantities = {"axial", "lateral"};
  const Band band = learnBand(good, settings);
  const RunRules rules({write("band.yaml", rulesText(band))});
  ASSERT_NE(rules.band("plate"), nullptr);
  EXPECT_EQ(rulesText(*rules.band("plate")), rulesText(band));
  EXPECT_EQ(rules.band("other"), nullptr);
  Record run = runOf({0.0, 0.01, 0.02}, {5.0, 40.0, 5.0});
  ASSERT_EQ(rules.evaluate(run).size(), 1u);
  EXPECT_EQ(rules.evaluate(run)[0].text, evaluateBand(band, run.curve).text);
  EXPECT_FALSE(rules.evaluate(run)[0].passed);
  run.program = "other";
  EXPECT_TRUE(rules.evaluate(run).empty());
}

TEST_F(Rules, TwoBandsForOneProgramAreRefusedWithBothFiles) {
  const std::vector<Curve> good(40, runOf({0.0, 0.01, 0.02}, {1.0, 2.0, 1.0}).curve);
  BandSettings settings;
  settings.program = "plate";
  settings.alpha = 0.1;
  const std::string text = rulesText(learnBand(good, settings));
  const std::string a = write("a.yaml", text), b = write("b.yaml", text);
  const std::string refusal = b + ": band: the second one for program plate, the first is in " + a +
                              ": leave out one of both files";
  EXPECT_EQ(refusalOf({a, b}), refusal);
  EXPECT_EQ(refusalOf({folder_.path()}), refusal);
}

TEST_F(Rules, WhatIsNoRuleIsRefusedByFileAndKey) {
  const auto of = [this](const std::string& keys) {
    const std::string refusal = refusalOf({box(keys)});
    return refusal.substr(std::min(refusal.size(), folder_.path().size() + 11));
  };
  EXPECT_EQ(of("type: range, depth: [0.02, 0.01], value: [1, 2]"),
            "boxes[0].depth: value a list of 2: give [LOW, HIGH], LOW below HIGH");
  EXPECT_EQ(of("type: maximum, value: [null, null]").substr(0, 15), "boxes[0].value:");
  EXPECT_EQ(of("type: window, depth: [0, 1], value: [1, 2]").substr(0, 14), "boxes[0].type:");
  EXPECT_NE(of("type: range, depth: [0, 1], value: [1, 2], colour: red").find("colour"),
            std::string::npos);
  EXPECT_NE(of("type: range, depth: [0, 1], time: [0, 1], value: [1, 2]").find("one of both"),
            std::string::npos);
  EXPECT_NE(refusalOf({write("c.yaml", "rules: 1\nprogram: a\n")}).find("give one of them"),
            std::string::npos);
  EXPECT_NE(refusalOf({write("c.yaml", "peg: {}\ncoupling: {}\ncontact: {}\n")})
                .find("this looks like a scenario"),
            std::string::npos);
  EXPECT_NE(refusalOf({folder_ / "none.yaml"}).find("none.yaml"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
