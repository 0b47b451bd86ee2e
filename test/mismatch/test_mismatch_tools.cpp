// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// --mismatch of align, simulate and study, as people call them.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>

namespace {

namespace fs = std::filesystem;

const std::string kTools = std::string(ASSEMBLY_CELL_BIN_DIR) + "/";
const std::string kConfig = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/";
const std::string kCell = kConfig + "scenarios/cell.yaml";

class MismatchTools : public testing::Test {
 protected:
  MismatchTools()
      : folder_(fs::temp_directory_path() / ("test_mismatch_tools_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~MismatchTools() override { fs::remove_all(folder_); }

  std::string file(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }

  struct Result {
    int code = -1;
    std::string text, errors;
  };
  Result call(const std::string& command) const {
    const std::string errors = (folder_ / "errors").string();
    FILE* pipe = popen((kTools + command + " 2>" + errors).c_str(), "r");
    Result result;
    std::array<char, 4096> buffer;
    std::size_t n = 0;
    while ((n = fread(buffer.data(), 1, buffer.size(), pipe)) > 0)
      result.text.append(buffer.data(), n);
    const int status = pclose(pipe);
    result.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    std::ifstream in(errors);
    result.errors.assign(std::istreambuf_iterator<char>(in), {});
    return result;
  }

  // all but the lines of the wall clock
  static std::string timeless(const std::string& text) {
    std::istringstream in(text);
    std::string kept;
    for (std::string line; std::getline(in, line);) {
      if (line.find("wall_time") == std::string::npos) kept += line + "\n";
    }
    return kept;
  }

  fs::path folder_;
};

const std::string kAlign = "align " + kCell + " --strategy twin_force --seed 5 --runs 2";

TEST_F(MismatchTools, NothingAskedLeavesAlignAsItWas) {
  const Result plain = call(kAlign),
               empty = call(kAlign + " --mismatch " + file("m.yaml", "# no\n"));
  EXPECT_EQ(plain.code, 0) << plain.errors;
  EXPECT_EQ(timeless(plain.text), timeless(empty.text));
  EXPECT_EQ(plain.text.find("mismatch"), std::string::npos);
}

TEST_F(MismatchTools, AlignReportsTheDraw) {
  const std::string m =
      file("m.yaml",
           "scale: {coupling.damping: {log_uniform: [0.9, 1.1]}}\nhole: {bore_tilt: "
           "{uniform: [0, 0.001]}}\n");
  const Result one = call(kAlign + " --threads 1 --mismatch " + m);
  const Result two = call(kAlign + " --threads 2 --mismatch " + m);
  EXPECT_EQ(timeless(one.text), timeless(two.text));
  const YAML::Node report = YAML::Load(one.text);
  EXPECT_EQ(report["false_successes"].as<int>(), 0);
  EXPECT_EQ(report["false_success_interval"].size(), 2u);
  ASSERT_EQ(report["results"].size(), 2u);
  const auto drawn = [&](std::size_t i) {
    return report["results"][i]["mismatch"]["scale"]["coupling.damping"].as<double>();
  };
  EXPECT_NE(drawn(0), drawn(1));
  EXPECT_GT(drawn(0), 0.9);
  EXPECT_EQ(report["results"][0]["mismatch"]["hole"]["bore_tilt"].size(), 2u);
  // the run of a seed is the same one alone
  const Result second = call("align " + kCell + " --strategy twin_force --seed 6 --mismatch " + m);
  EXPECT_EQ(
      YAML::Load(second.text)["results"][0]["mismatch"]["scale"]["coupling.damping"].as<double>(),
      drawn(1));
}

TEST_F(MismatchTools, ImpossibleDrawsAreRefusedBeforeTheFirstRun) {
  const std::string m = file("m.yaml", "add: {hole.radius: {uniform: [-0.06, 0]}}\n");
  const Result result = call("align " + kCell + " --runs 50 --mismatch " + m);
  EXPECT_EQ(result.code, 2);
  EXPECT_TRUE(result.text.empty());
  EXPECT_NE(result.errors.find("add.hole.radius"), std::string::npos) << result.errors;
  EXPECT_NE(result.errors.find("seed "), std::string::npos) << result.errors;
  EXPECT_EQ(result.errors.find("of 50"), std::string::npos) << "a run was done";
}

TEST_F(MismatchTools, AnArmHasItsOwnLatency) {
  const std::string m = file("m.yaml", "carrier: {lag: {uniform: [0, 0.1]}, backlash: 1.0e-5}\n");
  const Result result =
      call("align " + kCell + " --arm " + kConfig + "arm/emulated.yaml --mismatch " + m);
  EXPECT_EQ(result.code, 2);
  EXPECT_TRUE(result.text.empty());
  EXPECT_NE(result.errors.find("carrier.lag: value {uniform: [0, 0.1]}"), std::string::npos)
      << result.errors;
  EXPECT_NE(result.errors.find("emulate_arm"), std::string::npos) << result.errors;
}

// What is set changes truth and belief; a mismatch multiplies what is set.
TEST_F(MismatchTools, SimulateScalesWhatIsSet) {
  const std::string run = "simulate " + kCell + " --rows 2 --set duration=0.02 ";
  const std::string m = file("m.yaml", "scale: {peg.mass: 2}\n");
  const Result set = call(run +
                          "--set peg.mass=0.79 --set peg.inertia_transverse=5.0e-4 --set "
                          "peg.inertia_axial=2.0e-4");
  const Result drawn = call(run + "--mismatch " + m);
  EXPECT_EQ(set.code, 0) << set.errors;
  EXPECT_EQ(YAML::Load(set.text)["final"]["z"].as<double>(),
            YAML::Load(drawn.text)["final"]["z"].as<double>());
  EXPECT_EQ(YAML::Load(drawn.text)["mismatch"]["scale"]["peg.mass"].as<double>(), 2.0);
  EXPECT_FALSE(YAML::Load(set.text)["mismatch"]);
  const std::string spread = file("s.yaml", "scale: {peg.mass: {uniform: [0.5, 2]}}\n");
  EXPECT_NE(call(run + "--mismatch " + spread + " --seed 1").text,
            call(run + "--mismatch " + spread + " --seed 2").text);
  const Result bad = call(run + "--mismatch " + file("b.yaml", "scale: {peg.mass: heavy}\n"));
  EXPECT_EQ(bad.code, 2);
  EXPECT_NE(bad.errors.find("scale.peg.mass: value heavy"), std::string::npos) << bad.errors;
}

TEST_F(MismatchTools, StudyHasItAsKeyAndAsOption) {
  file("m.yaml", "scale: {peg.mass: {uniform: [0.9, 1.1]}}\n");
  const std::string text =
      "name: drawn\nscenario: " + kCell + "\nset: {duration: 0.01}\nsamples: 3\n";
  const std::string keyed = file("keyed.yaml", text + "mismatch: m.yaml\n");
  const std::string plain = file("plain.yaml", text);
  const auto rows = [&](const std::string& arguments, const std::string& output) {
    const std::string to = (folder_ / output).string();
    const Result result = call("study " + arguments + " --quiet --output " + to);
    EXPECT_EQ(result.code, 0) << result.errors;
    std::ifstream in(to + "/results.csv");
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const std::string by_key = rows(keyed, "a");
  EXPECT_EQ(by_key, rows(plain + " --mismatch " + (folder_ / "m.yaml").string(), "b"));
  EXPECT_NE(by_key.substr(0, by_key.find('\n')).find(",mismatch"), std::string::npos);
  EXPECT_NE(by_key.find("{scale: {peg.mass: "), std::string::npos);
  EXPECT_EQ(rows(plain, "c").find("mismatch"), std::string::npos);
  const Result bad = call("study " + plain + " --mismatch /no/such/file.yaml");
  EXPECT_EQ(bad.code, 2);
  EXPECT_NE(bad.errors.find("/no/such/file.yaml"), std::string::npos) << bad.errors;
}

}  // namespace
