// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The emulators as tools: what they print is what a source needs to reach them.

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <yaml-cpp/yaml.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "assembly_cell/sensor/strain_source.h"

namespace assembly_cell {
namespace {

struct Tool {
  /// `before`: what the shell does first.
  explicit Tool(const std::string& command, const std::string& before = "")
      : pipe(popen((before + ASSEMBLY_CELL_BIN_DIR "/" + command).c_str(), "r")) {}
  ~Tool() {
    if (pipe != nullptr) pclose(pipe);
  }
  std::string line() const {
    std::array<char, 1024> text{};
    return std::fgets(text.data(), static_cast<int>(text.size()), pipe) == nullptr ? ""
                                                                                   : text.data();
  }
  /// Exit code, at its end.
  int end() {
    const int status = pclose(std::exchange(pipe, nullptr));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  FILE* pipe;
};

class EmulateTool : public testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Tools, EmulateTool,
                         testing::Values("emulate_netft --port 0", "emulate_serial",
                                         "emulate_serial --protocol robotiq", "emulate_iio"));

TEST_P(EmulateTool, PrintsWhatReachesIt) {
  Tool tool(std::string(GetParam()) + " --duration 60", "echo $$; exec ");
  const std::string process = tool.line();
  const YAML::Node printed = YAML::Load(tool.line());
  ASSERT_TRUE(printed["source"].IsMap());
  const auto source = makeSource(printed["source"]["type"].as<std::string>());
  source->configure(printed["source"]);
  source->open();
  const auto block = std::make_unique<SourceBlock>();
  const auto limit = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::size_t samples = 0;
  while (samples < 30 && std::chrono::steady_clock::now() < limit) {
    if (source->read(*block, std::chrono::milliseconds(100)) == ReadResult::kSamples) {
      samples += block->count;
    }
  }
  EXPECT_GE(samples, 30u);
  source->close();
  ASSERT_EQ(std::system(("kill " + process).c_str()), 0);
  EXPECT_FALSE(tool.line().empty());
}

TEST_P(EmulateTool, AnswersABadOptionWithOneLineAndCode2) {
  for (const char* bad :
       {"--bogus 1", "stray", "--rate", "--rate fast", "--rate -1", "--duration nan"}) {
    Tool tool(std::string(GetParam()) + " " + bad + " 2>&1");
    EXPECT_FALSE(tool.line().empty()) << bad;
    EXPECT_EQ(tool.line(), "") << bad;
    EXPECT_EQ(tool.end(), 2) << bad;
  }
  Tool help(std::string(GetParam()) + " --help");
  EXPECT_EQ(help.line().rfind("Usage: emulate_", 0), 0u);
}

}  // namespace
}  // namespace assembly_cell
