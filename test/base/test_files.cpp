// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Files: what is planted under a temporary name is never written through. YAML: how deep it may be.

#include "assembly_cell/base/files.h"

#include <gtest/gtest.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/yaml_section.h"
#include "assembly_cell/base/yaml_text.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

std::string contentOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class Files : public ::testing::Test {
 protected:
  Files() { std::ofstream(folder_ / "precious") << "mine"; }
  std::string at(const std::string& name) const { return (folder_ / name).string(); }

  const test::TemporaryFolder scratch_;
  const fs::path folder_ = scratch_.path();
};

TEST_F(Files, APlantedLinkIsNotWrittenThrough) {
  const std::string pid = std::to_string(getpid());
  for (const std::string target : {"precious", "nowhere"}) {
    fs::create_symlink(at(target), at("in_force.yaml.tmp" + pid));
    writeFileAtomically(at("in_force.yaml"), "new", "test");
    EXPECT_EQ(contentOf(at("in_force.yaml")), "new");
    EXPECT_FALSE(fs::is_symlink(at("in_force.yaml")));

    fs::create_symlink(at(target), at("report.yaml.part" + pid));
    NewFile report(at("report.yaml"), "report", "give another name");
    report.write("whole");
    report.finish();
    EXPECT_EQ(contentOf(at("report.yaml")), "whole");
    EXPECT_FALSE(fs::is_symlink(at("report.yaml")));
  }
  EXPECT_EQ(contentOf(at("precious")), "mine");
  EXPECT_FALSE(fs::exists(at("nowhere")));
}

TEST_F(Files, ALeftoverOfAnEarlierProcessIsReplaced) {
  std::ofstream(at("a.yaml.tmp" + std::to_string(getpid()))) << "half";
  writeFileAtomically(at("a.yaml"), "whole", "test");
  EXPECT_EQ(contentOf(at("a.yaml")), "whole");
}

TEST_F(Files, AFolderUnderTheTemporaryNameIsRefused) {
  fs::create_directory(at("a.yaml.tmp" + std::to_string(getpid())));
  EXPECT_THROW(writeFileAtomically(at("a.yaml"), "x", "test"), InputError);
  EXPECT_FALSE(fs::exists(at("a.yaml")));
}

TEST_F(Files, ALinkAndADeviceStayWhatTheyAre) {
  const auto both = [](const std::string& path, const std::string& text) {
    writeFileAtomically(path, text, "test");
    NewFile file(path, "file", "give another name");
    file.write(text);
    file.finish();
  };
  fs::create_symlink("precious", at("link"));
  fs::create_symlink("link", at("link_to_link"));
  fs::create_symlink(at("later"), at("link_to_nothing"));
  both(at("link_to_link"), "through");
  both(at("link_to_nothing"), "made");
  EXPECT_EQ(contentOf(at("precious")), "through");
  EXPECT_EQ(contentOf(at("later")), "made");
  for (const char* link : {"link", "link_to_link", "link_to_nothing"}) {
    EXPECT_TRUE(fs::is_symlink(at(link))) << link;
  }
  // links to devices: nothing happens to the machine's own where this goes wrong
  fs::create_symlink("/dev/null", at("null"));
  both(at("null"), "gone");
  EXPECT_TRUE(fs::is_character_file(at("null")));
  EXPECT_TRUE(fs::is_symlink(at("null")));
  fs::create_symlink("/dev/full", at("full"));
  EXPECT_THROW(writeFileAtomically(at("full"), "x", "test"), InputError);
  EXPECT_TRUE(fs::is_symlink(at("full")));
  for (const auto& entry : fs::directory_iterator(folder_)) {
    EXPECT_EQ(entry.path().extension(), "") << "left over";
  }
}

TEST_F(Files, WhatStandardOutputGoesToGetsTheFileInItsPlace) {
  ::testing::internal::CaptureStdout();
  std::cout << "before\n";
  // a link: nothing happens to the machine's own /dev/stdout where this goes wrong
  fs::create_symlink("/proc/self/fd/1", at("stdout"));
  writeFileAtomically(at("stdout"), "file\n", "test");
  std::cout << "after\n";
  EXPECT_EQ(::testing::internal::GetCapturedStdout(), "before\nfile\nafter\n");
}

TEST_F(Files, WhereNothingCanBeWrittenIsKnownBefore) {
  EXPECT_NO_THROW(checkWritable(at("new.yaml"), "test"));
  EXPECT_NO_THROW(checkWritable(at("precious"), "test"));
  EXPECT_NO_THROW(checkWritable("/dev/null", "test"));
  EXPECT_EQ(contentOf(at("precious")), "mine");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 1);
  for (const std::string& path :
       {at("nowhere/new.yaml"), folder_.string(), at("precious/new.yaml")}) {
    try {
      checkWritable(path, "file " + path);
      ADD_FAILURE() << path;
    } catch (const InputError& error) {
      EXPECT_EQ(std::string(error.what()).rfind("file " + path + " can't be written (", 0), 0U)
          << error.what();
    }
  }
}

std::string repeated(const std::string& piece, int times) {
  std::string text;
  for (int k = 0; k < times; ++k) text += piece;
  return text;
}

// how deep yaml-cpp finds it
std::size_t depthOf(const YAML::Node& node) {
  std::size_t deepest = 0;
  if (node.IsSequence()) {
    for (const auto& entry : node) deepest = std::max(deepest, depthOf(entry));
  } else if (node.IsMap()) {
    for (const auto& entry : node) {
      deepest = std::max({deepest, depthOf(entry.first), depthOf(entry.second)});
    }
  } else {
    return 0;
  }
  return deepest + 1;
}

TEST(YamlDepth, IsNeverLessThanWhatAReaderFinds) {
  for (const std::string text :
       {"a: 1", "a: [1, [2, {b: 3}]]", "- - - 1\n    - 2\n  - 3", "a:\n  b:\n  - c:\n      d: 1",
        "a:\n- b\n- - c\n", "? - x\n: - y", "a: 'it''s [[[['\nb: \"\\\"[[[[\"", "# [[[[\na: x#[[\n",
        "{a: [b, c], d: {e: [f]}}", "- a: 1\n  b:\n    - c: 2\n      d: [3]\n- e", "",
        "|\n  text\n", "a: b'c\nd: [1, [2]]", "a:\n  - 'x'\n  - - ? y\n      : [z]"}) {
    EXPECT_GE(yamlDepth(text), depthOf(YAML::Load(text))) << text;
    EXPECT_LE(yamlDepth(text), depthOf(YAML::Load(text)) + 3) << text;
  }
}

TEST(YamlDepth, FilesOfThePackageAreFarFromTheLimit) {
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(ASSEMBLY_CELL_SOURCE_DIR "/config")) {
    if (entry.path().extension() != ".yaml") continue;
    ++files;
    EXPECT_LT(yamlDepth(contentOf(entry.path().string())), 20u) << entry.path();
  }
  EXPECT_GT(files, 10);
}

TEST(YamlDepth, WhatIsTooDeepDoesntReachTheReader) {
  const int many = 20000;
  for (const std::string& text :
       {repeated("[", many), "a: " + repeated("[", many) + repeated("]", many),
        repeated("{a: ", many), repeated("- ", many), repeated("? ", many),
        "a: \"x\"\nb: " + repeated("[{b: ", many)}) {
    EXPECT_GT(yamlDepth(text), kDeepestYaml);
    try {
      yaml::loadYaml(text, "--set");
      ADD_FAILURE() << "accepted";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find("give at most 200"), std::string::npos)
          << error.what();
    }
  }
  std::string stairs;
  for (int k = 0; k < 1000; ++k) stairs += std::string(static_cast<std::size_t>(k), ' ') + "a:\n";
  EXPECT_THROW(yaml::loadYaml(stairs, "file"), InputError);
  EXPECT_NO_THROW(yaml::loadYaml("a: " + repeated("[", 150) + repeated("]", 150), "file"));
}

}  // namespace
}  // namespace assembly_cell
