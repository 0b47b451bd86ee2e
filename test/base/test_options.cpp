// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The command line of the tools: what is read, and the one line for what is refused.

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"

namespace assembly_cell {
namespace {

struct Tool {
  std::string file, output;
  std::vector<std::string> overrides;
  std::uint64_t seed = 1;
  long rows = 7;
  std::optional<double> press;
  double noise = 0.5;
  bool quiet = false, drift = true;
  int method = 0;
  std::vector<double> load{0.0, 0.0, 0.0};

  bool parse(const std::vector<std::string>& arguments) {
    OptionParser parser("Usage: tool\n");
    parser.file("scenario file", file);
    parser.text("--output", output);
    parser.texts("--set", overrides);
    parser.integer("--seed", seed, 0, 1L << 62);
    parser.integer("--rows", rows, 2, 100);
    parser.number("--noise", noise, 0.0, 5.0);
    parser.number(
        "--press", press, [](double value) { return value > 0.0; }, "give a positive number of N");
    parser.flag("--quiet", quiet);
    parser.flag("--no-drift", drift, false);
    parser.choice("--method", method, {{"ml", 1}, {"robust", 2}, {"thesis", 3}});
    parser.numbers("--load", load.data(), load.size());
    return parser.parse(arguments);
  }
  std::string refusal(const std::vector<std::string>& arguments) {
    try {
      parse(arguments);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
};

TEST(Options, ThatWouldChangeNothingAreRefused) {
  const auto refusal = [](const std::vector<std::string>& arguments) -> std::string {
    std::string save, id;
    bool plan = false;
    OptionParser parser("Usage: tool\n");
    parser.text("--save", save);
    parser.text("--id", id);
    parser.flag("--plan", plan);
    try {
      parser.parse(arguments);
      parser.onlyWith("--save", {"--id"});
      if (plan) parser.notWith("--plan", {"--save"});
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal({"--id", "a"}), "--id: serves --save: give that too, or leave it out");
  EXPECT_EQ(refusal({"--save", "x", "--plan"}),
            "--save: of no use with --plan: leave one of them out");
  EXPECT_EQ(refusal({"--save", "x", "--id", "a"}), "");
  EXPECT_EQ(refusal({}), "");
}

TEST(Options, AreReadIntoTheirVariables) {
  Tool tool;
  EXPECT_TRUE(tool.parse({"--set",  "a=1",     "cell.yaml",  "--seed",   "4611686018427387904",
                          "--set",  "b=--x",   "--noise",    "+2.5e-1",  "--press",
                          "3",      "--quiet", "--no-drift", "--method", "robust",
                          "--load", "-1,2,.5", "--rows",     "3",        "--rows=5"}));
  EXPECT_EQ(tool.file, "cell.yaml");
  EXPECT_EQ(tool.overrides, (std::vector<std::string>{"a=1", "b=--x"}));
  EXPECT_EQ(tool.seed, std::uint64_t{1} << 62);
  EXPECT_EQ(tool.noise, 0.25);
  EXPECT_EQ(tool.press, 3.0);
  EXPECT_TRUE(tool.quiet);
  EXPECT_FALSE(tool.drift);
  EXPECT_EQ(tool.method, 2);
  EXPECT_EQ(tool.load, (std::vector<double>{-1.0, 2.0, 0.5}));
  EXPECT_EQ(tool.rows, 5) << "the last one holds";
}

TEST(Options, ThatAreAbsentLeaveTheirDefaults) {
  Tool tool;
  EXPECT_TRUE(tool.parse({"cell.yaml"}));
  EXPECT_EQ(tool.rows, 7);
  EXPECT_FALSE(tool.press);
  EXPECT_TRUE(tool.drift);
}

TEST(Options, HelpIsPrintedAndNothingElseDone) {
  for (const char* help : {"--help", "-h"}) {
    testing::internal::CaptureStdout();
    EXPECT_FALSE(Tool().parse({help, "--bogus", "1", "a", "b"}));
    EXPECT_EQ(testing::internal::GetCapturedStdout(), "Usage: tool\n");
  }
}

TEST(Options, ABadOneIsRefusedByNameAndValueWithARemedy) {
  const struct {
    std::vector<std::string> arguments;
    std::string says;
  } cases[] = {
      {{}, "argument: value missing: give a scenario file, see --help"},
      {{""}, "argument: value missing: give a scenario file, see --help"},
      {{"a", "b"}, "argument: value b: give one scenario file, see --help"},
      {{"a", "--bogus"}, "argument: value --bogus: unknown option, see --help"},
      {{"a", "--bogus=1"}, "argument: value --bogus=1: unknown option, see --help"},
      {{"a", "--qui"}, "argument: value --qui: unknown option, see --help"},
      {{"a", "-q"}, "argument: value -q: unknown option, see --help"},
      {{"a", "-"}, "argument: value -: unknown option, see --help"},
      {{"a", "--set"}, "--set: value missing: see --help"},
      {{"a", "--set="}, "--set: value missing: see --help"},
      {{"a", "--set", "--quiet"}, "--set: value missing: see --help"},
      {{"a", "--set", ""}, "--set: value empty: see --help"},
      {{"a", "--quiet=1"}, "--quiet: value given: it takes none"},
      {{"a", "--rows", "1"}, "--rows: value 1: give a whole number from 2 to 100"},
      {{"a", "--rows", "2.5"}, "--rows: value 2.5: give a whole number from 2 to 100"},
      {{"a", "--noise", "-1"}, "--noise: value -1: give a number from 0.0 to 5.0"},
      {{"a", "--noise", "nan"}, "--noise: value nan: give a number from 0.0 to 5.0"},
      {{"a", "--press", "0"}, "--press: value 0: give a positive number of N"},
      {{"a", "--method", "m"}, "--method: value m: give ml, robust or thesis"},
      {{"a", "--load", "1,2"}, "--load: value 1,2: give 3 numbers separated by commas"},
  };
  for (const auto& c : cases) EXPECT_EQ(Tool().refusal(c.arguments), c.says);
}

}  // namespace
}  // namespace assembly_cell
