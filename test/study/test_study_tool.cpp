// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool `study` as people call it: threads, ranks, kills, files and exit codes.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>
#include <vector>

namespace {

namespace fs = std::filesystem;

const std::string kTool = std::string(ASSEMBLY_CELL_BIN_DIR) + "/study";
const std::string kScenarios = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/";

std::string textOf(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::vector<std::string> linesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

class StudyTool : public testing::Test {
 protected:
  StudyTool()
      : folder_(fs::temp_directory_path() / ("test_study_tool_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
    // mpirun: no second machine is asked for, no shared memory between users is needed
    setenv("OMPI_MCA_plm_rsh_agent", "", 1);
    setenv("OMPI_MCA_btl_vader_single_copy_mechanism", "none", 1);
    setenv("OMPI_MCA_rmaps_base_oversubscribe", "1", 1);
    // Open MPI 5 (Debian 13): more ranks than cores; a file limit leaves it no shared memory, only
    // the loopback interface
    setenv("PRTE_MCA_rmaps_default_mapping_policy", ":oversubscribe", 1);
    setenv("OMPI_MCA_btl_tcp_if_include", "lo", 1);
    setenv("OMPI_ALLOW_RUN_AS_ROOT", "1", 1);
    setenv("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1", 1);
  }
  ~StudyTool() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  std::string study(const std::string& text) const {
    std::ofstream(path("study.yaml")) << text;
    return path("study.yaml");
  }

  // a study of short runs: draws, a grid, rows that fail
  std::string usual(int samples) const {
    return study("name: usual\nscenario: " + kScenarios +
                 "chapter8_force_two_10N.yaml\n"
                 "set: {duration: 0.01, solver.tolerance: 1.0e-7}\n"
                 "samples: " +
                 std::to_string(samples) +
                 "\nhistory: true\n"
                 "axes:\n  - {key: exciter.phase, uniform: [-3, 3]}\n"
                 "  - {key: friction.sliding, values: [0.2, 0.3, 0.4]}\n");
  }

  struct Result {
    int exit_code;
    std::string out, err;
  };

  pid_t start(const std::vector<std::string>& words) const {
    const pid_t child = fork();
    if (child == 0) {
      const int out = ::open(path("out").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
      const int err = ::open(path("err").c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
      dup2(out, STDOUT_FILENO);
      dup2(err, STDERR_FILENO);
      std::vector<char*> argv;
      for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
      argv.push_back(nullptr);
      // what OpenMPI's plug-ins leave behind is no finding of a build with sanitizers
      if (words[0] != kTool) setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
      execvp(argv[0], argv.data());
      _exit(127);
    }
    return child;
  }

  Result wait(pid_t child) const {
    int status = 0;
    waitpid(child, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), textOf(path("out")),
            textOf(path("err"))};
  }

  Result run(const std::vector<std::string>& arguments) const {
    std::vector<std::string> words = {kTool};
    words.insert(words.end(), arguments.begin(), arguments.end());
    return wait(start(words));
  }

  fs::path folder_;
};

TEST_F(StudyTool, HelpShowsAnExample) {
  const Result result = run({"--help"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.out.find("Example: study"), std::string::npos);
}

TEST_F(StudyTool, ResultsDoNotDependOnThreadsAndRanks) {
  const std::string file = usual(20);
  const std::string csv = [&] {
    const Result one = run({file, "--threads", "1", "--output", path("one")});
    EXPECT_EQ(one.exit_code, 0) << one.err;
    return textOf(path("one/results.csv"));
  }();
  const std::vector<std::string> lines = linesOf(csv);
  ASSERT_EQ(lines.size(), 61u);
  EXPECT_EQ(lines[0].rfind("run,seed,exciter.phase,friction.sliding,status,reason,stopped_at,", 0),
            0u);
  for (std::size_t i = 1; i < lines.size(); ++i) {
    EXPECT_EQ(lines[i].rfind(std::to_string(i - 1) + ",", 0), 0u);
    const bool bad = lines[i].find(",0.4,") != std::string::npos;
    EXPECT_EQ(lines[i].find(",bad_input,") != std::string::npos, bad) << lines[i];
  }
  for (const char* threads : {"2", "3"}) {
    const Result more = run({file, "--threads", threads, "--output", path(threads)});
    ASSERT_EQ(more.exit_code, 0) << more.err;
    for (const char* name : {"results.csv", "history.csv", "manifest.yaml"}) {
      EXPECT_EQ(textOf(path(threads) + "/" + name), textOf(path("one") + "/" + name)) << name;
    }
  }
  for (const char* ranks : {"1", "2", "3"}) {
    const std::string folder = path("ranks") + ranks;
    const Result more =
        wait(start({"mpirun", "-n", ranks, kTool, file, "--output", folder, "--quiet"}));
    ASSERT_EQ(more.exit_code, 0) << more.err;
    for (const char* name : {"results.csv", "history.csv", "manifest.yaml"}) {
      EXPECT_EQ(textOf(folder + "/" + name), textOf(path("one") + "/" + name)) << name;
    }
  }
}

TEST_F(StudyTool, ManifestSaysWhatMadeTheResults) {
  const Result made = run({usual(2), "--output", path("a")});
  ASSERT_EQ(made.exit_code, 0);
  EXPECT_NE(made.err.find("results go to " + path("a")), std::string::npos) << made.err;
  EXPECT_NE(made.out.find("# 2 of 6 runs ended early"), std::string::npos) << made.out;
  const YAML::Node manifest = YAML::LoadFile(path("a/manifest.yaml"));
  EXPECT_EQ(manifest["study"].as<std::string>(), "usual");
  EXPECT_NE(manifest["program"].as<std::string>().find("assembly_cell "), std::string::npos);
  EXPECT_EQ(manifest["digest"].as<std::string>().size(), 14u);
  EXPECT_EQ(manifest["scenarios"][0]["file"].as<std::string>(), "chapter8_force_two_10N.yaml");
  EXPECT_EQ(manifest["scenarios"][0]["digest"].as<std::string>().size(), 14u);
  EXPECT_EQ(manifest["seed"].as<int>(), 1);
  EXPECT_EQ(manifest["runs"].as<int>(), 6);
  EXPECT_TRUE(manifest["complete"].as<bool>());
  EXPECT_EQ(manifest["statuses"]["bad_input"].as<int>(), 2);
  const std::string header = linesOf(textOf(path("a/results.csv")))[0];
  std::string columns;
  for (const auto& name : manifest["columns"]) {
    columns += (columns.empty() ? "" : ",") + name.as<std::string>();
  }
  EXPECT_EQ(columns, header);
}

TEST_F(StudyTool, KilledAtAnyTimeItGoesOnToTheSameFiles) {
  const std::string file = usual(100);
  ASSERT_EQ(run({file, "--output", path("calm")}).exit_code, 0);
  const std::string calm = textOf(path("calm/results.csv"));
  // killed soon after its start, and when it has got farther; the last start runs to its end
  const std::string journal = path("killed/journal");
  const auto written = [&] { return fs::exists(journal) ? fs::file_size(journal) : 0; };
  int kills = 0;
  for (const std::uintmax_t records : {0, 1, 10, 40, 20}) {
    const std::uintmax_t enough = records > 0 ? written() + 50 * records : 0;
    const pid_t child = start({kTool, file, "--output", path("killed"), "--threads", "2"});
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    for (int i = 0; i < 60000 && written() < enough; ++i) {
      siginfo_t ended{};
      waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT);
      if (ended.si_pid == child) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    kill(child, SIGKILL);
    if (wait(child).exit_code == -SIGKILL) ++kills;
  }
  EXPECT_GT(kills, 0);
  // a record that was cut off, and one that is damaged
  std::ofstream(journal, std::ios::app) << "7 0 0 nan 30 0 crc32:12345678\n7,1,";
  const Result last = run({file, "--output", path("killed")});
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_EQ(textOf(path("killed/results.csv")), calm);
  EXPECT_EQ(textOf(path("killed/history.csv")), textOf(path("calm/history.csv")));
  EXPECT_EQ(textOf(path("killed/manifest.yaml")), textOf(path("calm/manifest.yaml")));
  // done is done: nothing is run again
  const YAML::Node again = YAML::Load(run({file, "--output", path("killed")}).out);
  EXPECT_EQ(again["done_before"].as<int>(), 300);
  EXPECT_EQ(textOf(path("killed/results.csv")), calm);
}

// a run that never comes to its end says so all the same
TEST_F(StudyTool, IsNeverSilentForLong) {
  const std::string file = study("name: long\nscenario: " + kScenarios +
                                 "chapter8_force_two_10N.yaml\nset: {duration: 1.0e5}\n");
  const pid_t child = start({kTool, file, "--output", path("a"), "--threads", "1"});
  const auto begun = std::chrono::steady_clock::now();
  const auto reported = [&] {
    return textOf(path("err")).find("] 0 of 1 runs") != std::string::npos;
  };
  while (!reported() && std::chrono::steady_clock::now() - begun < std::chrono::seconds(60)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_TRUE(reported()) << textOf(path("err"));
  EXPECT_EQ(kill(child, SIGKILL), 0);
  wait(child);
}

TEST_F(StudyTool, InterruptKeepsWhatIsDoneAndSaysHowToGoOn) {
  const std::string file = usual(3000);
  const pid_t child = start({kTool, file, "--output", path("a"), "--threads", "1"});
  for (int i = 0; i < 30000; ++i) {
    if (fs::exists(path("a/journal")) && fs::file_size(path("a/journal")) > 20000) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  kill(child, SIGINT);
  const Result result = wait(child);
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_NE(result.err.find("of 9000 runs; they are kept"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(path("a/results.csv")));
  EXPECT_FALSE(YAML::LoadFile(path("a/manifest.yaml"))["complete"].as<bool>());
  // another study isn't mixed in, --fresh starts again
  const Result other = run({usual(1), "--output", path("a")});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_NE(other.err.find("--fresh"), std::string::npos) << other.err;
  EXPECT_EQ(run({usual(1), "--output", path("a"), "--fresh"}).exit_code, 0);
  EXPECT_EQ(linesOf(textOf(path("a/results.csv"))).size(), 4u);
  // tables of another study don't stay beside one that has begun
  const pid_t begun = start({kTool, usual(3000), "--output", path("a"), "--fresh"});
  for (int i = 0; i < 30000; ++i) {
    if (!fs::exists(path("a/results.csv"))) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  kill(begun, SIGINT);
  EXPECT_EQ(wait(begun).exit_code, 130);
  EXPECT_FALSE(fs::exists(path("a/results.csv")));
}

TEST_F(StudyTool, EnoughEndsAtTheSameRunWithAnyWorkers) {
  const std::string file =
      study("name: enough\nscenario: " + kScenarios +
            "chapter8_force_two_10N.yaml\nset: {duration: 1.0e-4}\n"
            "samples: 5000\nassembled: {offset: 0.043}\n"
            "enough: {half_width: 0.08, least: 20}\n"
            "axes: [{key: 'initial.peg.position[1]', uniform: [0.039, 0.041]}]\n");
  const Result one = run({file, "--threads", "1", "--output", path("one")});
  ASSERT_EQ(one.exit_code, 0) << one.err;
  const YAML::Node summary = YAML::Load(one.out);
  const int runs = summary["runs"].as<int>();
  // half width z sqrt(p (1 - p)/n): at most 150 runs for 0.08
  EXPECT_LT(runs, 160);
  EXPECT_GE(runs, 20);
  const auto interval = summary["assembled"]["interval"];
  EXPECT_LE(interval[1].as<double>() - interval[0].as<double>(), 0.16);
  const Result three = run({file, "--threads", "3", "--output", path("three")});
  ASSERT_EQ(three.exit_code, 0);
  EXPECT_EQ(textOf(path("three/results.csv")), textOf(path("one/results.csv")));
  // runs that others had begun beyond the end don't count
  EXPECT_EQ(YAML::Dump(YAML::Load(three.out)["assembled"]), YAML::Dump(summary["assembled"]));
  EXPECT_EQ(summary["assembled"]["runs"].as<int>(), summary["statuses"]["assembled"].as<int>(0));
}

TEST_F(StudyTool, AFullDiskEndsThreadsAndRanksByName) {
  const std::string file = usual(400);
  // files of at most 32 KiB: writing more fails as on a full disk
  const std::string command = "trap '' XFSZ; ulimit -f 64; exec " + kTool + " " + file +
                              " --quiet --output " + path("full");
  for (const bool ranks : {false, true}) {
    std::vector<std::string> words = {"timeout", "60"};
    if (ranks) words.insert(words.end(), {"mpirun", "-n", "2"});
    words.insert(words.end(), {"sh", "-c", command});
    const Result result = wait(start(words));
    EXPECT_EQ(result.exit_code, 2) << ranks;
    EXPECT_NE(result.err.find("journal"), std::string::npos) << result.err;
    fs::remove_all(path("full"));
  }
}

TEST_F(StudyTool, ALostListIsSaid) {
  const Result result = wait(start({"sh", "-c", kTool + " " + usual(1) + " --list > /dev/full"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("standard output"), std::string::npos) << result.err;
}

TEST_F(StudyTool, SearchFindsAKnownOptimumWithAnyWorkers) {
  // hanging still, the bottom centre lies where it starts: nearest to the axis at x = 3 mm - draw
  const std::string file = study(
      "name: search\nscenario: " + kScenarios +
      "cell.yaml\nset: {duration: 1.0e-3}\nstart: {offset: 0.004, azimuth: 3.14159265358979}\n"
      "axes:\n  - {key: start.x, search: [-0.01, 0.02]}\n"
      "  - {key: start.y, search: [-0.015, 0.01]}\n"
      "search:\n  minimise: final_offset\n  otherwise: 1\n  tolerance: 1.0e-4\n"
      "  steps: [{algorithm: direct, evaluations: 30}, {algorithm: sbplx, evaluations: 120}]\n");
  const Result one = run({file, "--threads", "1", "--output", path("one")});
  ASSERT_EQ(one.exit_code, 0) << one.err;
  const YAML::Node best = YAML::Load(one.out)["optimum"];
  // the tolerance is 1e-4 of the ranges, 3 um
  EXPECT_NEAR(best["start.x"].as<double>(), 0.004, 1e-5);
  EXPECT_NEAR(best["start.y"].as<double>(), 0.0, 1e-5);
  EXPECT_LT(best["final_offset"].as<double>(), 1.5e-5);
  const Result two =
      wait(start({"mpirun", "-n", "2", kTool, file, "--output", path("two"), "--quiet"}));
  ASSERT_EQ(two.exit_code, 0) << two.err;
  EXPECT_EQ(textOf(path("two/results.csv")), textOf(path("one/results.csv")));
  // what the journal holds isn't run again
  const YAML::Node again = YAML::Load(run({file, "--output", path("two")}).out);
  EXPECT_EQ(again["done_before"].as<int>(), again["runs"].as<int>());
}

// where no run has the outcome, `otherwise` alone is compared
TEST_F(StudyTool, ASearchWithoutAValueHasNoOptimum) {
  const std::string file = study("name: search\nscenario: " + kScenarios +
                                 "cell.yaml\nset: {duration: 1.0e-3}\nassembled: {depth: 0.5}\n"
                                 "axes:\n  - {key: start.x, search: [-0.01, 0.02]}\n"
                                 "search:\n  minimise: time_to_assemble\n  otherwise: 10\n"
                                 "  steps: [{algorithm: direct, evaluations: 5}]\n");
  const Result result = run({file, "--quiet", "--output", path("none")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_TRUE(YAML::Load(result.out)["optimum"].IsNull()) << result.out;
  EXPECT_NE(result.err.find("no run has the outcome time_to_assemble"), std::string::npos)
      << result.err;
}

TEST_F(StudyTool, WhatIsNoStudysResultStays) {
  fs::create_directories(path("mine"));
  std::ofstream(path("mine/results.csv")) << "precious";
  const Result result = run({usual(1), "--output", path("mine")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("results.csv"), std::string::npos) << result.err;
  EXPECT_EQ(textOf(path("mine/results.csv")), "precious");
  EXPECT_EQ(run({usual(1), "--quiet", "--fresh", "--output", path("mine")}).exit_code, 0);
}

TEST_F(StudyTool, BadInputExitsWithTwoAndOneLine) {
  const std::string good = usual(1);
  const std::string bad = path("bad.yaml");
  std::ofstream(bad) << "name: bad\nscenario: nowhere.yaml\n";
  const std::vector<std::vector<std::string>> calls = {
      {},
      {path("absent.yaml")},
      {folder_.string()},
      {bad},
      {good, good},
      {good, "--threads", "0"},
      {good, "--threads"},
      {good, "--speed"},
      {good, "--set", "samples=-1"},
      {good, "--set", "nonsense"},
      {good, "--output", good},
      {good, "--output", "/proc/nowhere"},
  };
  for (const auto& call : calls) {
    const Result result = run(call);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_EQ(linesOf(result.err).size(), 1u) << result.err;
    EXPECT_TRUE(result.out.empty());
  }
  const Result ranks = wait(start({"mpirun", "-n", "2", kTool, bad}));
  EXPECT_EQ(ranks.exit_code, 2);
  EXPECT_NE(ranks.err.find("nowhere.yaml"), std::string::npos) << ranks.err;
  // what only rank 0 sees ends the others too
  const Result folder = wait(start({"mpirun", "-n", "2", kTool, good, "--output", good}));
  EXPECT_EQ(folder.exit_code, 2);
  EXPECT_NE(folder.err.find("--output"), std::string::npos) << folder.err;
}

TEST_F(StudyTool, ListShowsTheRunsWithoutDoingThem) {
  const Result result = run({usual(2), "--list", "--output", path("a")});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(linesOf(result.out).size(), 7u);
  EXPECT_EQ(linesOf(result.out)[0], "run,seed,exciter.phase,friction.sliding");
  EXPECT_FALSE(fs::exists(path("a")));
}

// every study of the package is one that the tool takes
TEST_F(StudyTool, StudiesOfThePackageAreGood) {
  int count = 0;
  for (const auto& entry :
       fs::directory_iterator(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/studies")) {
    const Result result = run({entry.path().string(), "--list"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_GE(linesOf(result.out).size(), 2u);
    ++count;
  }
  EXPECT_GE(count, 13);
}

TEST_F(StudyTool, ResultsArePlotted) {
  ASSERT_EQ(run({usual(3), "--output", path("a")}).exit_code, 0);
  const std::string script = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/scripts/plot";
  const Result good = wait(start({script, "study", path("a"), path("a.png")}));
  EXPECT_EQ(good.exit_code, 0) << good.err;
  EXPECT_EQ(textOf(path("a.png")).substr(1, 3), "PNG");
  const Result bad = wait(start({script, "study", path("absent"), path("b.png")}));
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_EQ(linesOf(bad.err).size(), 1u) << bad.err;
}

}  // namespace
