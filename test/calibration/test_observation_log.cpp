// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/observations/observation_log.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/sensor/calibration.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

namespace fs = std::filesystem;

const std::string kHeader = "format: test 1\nsensor: \"x\"\nobservations:\n";

std::string contentOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
void writeText(const std::string& path, const std::string& content) {
  std::ofstream(path, std::ios::binary) << content;
}

std::string refusal(const std::string& path, const std::string& header = kHeader) {
  try {
    ObservationLog log(path, header);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}
bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

using Lines = std::vector<std::string>;

// Cut at any place, a third of it and in the middle of a line: what is whole is kept, and how many
// are gone is known.
TEST(ObservationLog, ReportsTheRecordsLostByACut) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  {
    ObservationLog log(path, kHeader);
    for (int k = 0; k < 30; ++k) log.append("- {a: " + std::to_string(k) + "}");
    log.removeLast();
    EXPECT_EQ(log.lost(), 0u);
  }
  const std::string whole = contentOf(path);
  EXPECT_EQ(ObservationLog(path, kHeader).lost(), 0u);
  const std::size_t header = whole.find("- {a: 0}");
  for (std::size_t size = whole.size() / 3; size > header; size -= 17) {
    writeText(path, whole.substr(0, size));
    ObservationLog log(path, kHeader);
    EXPECT_EQ(log.records().size() + log.lost(), 29u) << size;
    for (std::size_t k = 0; k < log.records().size(); ++k) {
      EXPECT_EQ(log.records()[k], "- {a: " + std::to_string(k) + "}");
    }
  }
  // reported again until the file is restored or the measurement continues
  EXPECT_GT(ObservationLog(path, kHeader).lost(), 0u);
  ObservationLog(path, kHeader).append("- {a: again}");
  EXPECT_EQ(ObservationLog(path, kHeader).lost(), 0u);
  // one that was moved away is no loss
  fs::rename(path, path + ".elsewhere");
  EXPECT_EQ(ObservationLog(path, kHeader).lost(), 0u);
  EXPECT_EQ(ObservationLog(path, kHeader).lost(), 0u);
}

TEST(ObservationLog, KeepsWhatWasAppended) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  const Lines lines = {"- {a: 1}", "- {b: \"x  # 3 crc32:00000000\"}", "- {c: [1, 2]}  "};
  {
    ObservationLog log(path, kHeader);
    for (const std::string& line : lines) log.append(line);
    EXPECT_EQ(log.records(), lines);
  }
  ObservationLog log(path, kHeader);
  EXPECT_EQ(log.records(), lines);
  EXPECT_FALSE(log.torn());
  log.append("- {d: 4}");
  EXPECT_EQ(log.records().size(), 4u);

  // seals are comments: the journal is plain YAML
  const YAML::Node root = YAML::LoadFile(path);
  ASSERT_EQ(root["observations"].size(), 4u);
  EXPECT_EQ(root["observations"][1]["b"].as<std::string>(), "x  # 3 crc32:00000000");
  EXPECT_EQ(root["observations"][3]["d"].as<int>(), 4);
}

TEST(ObservationLog, RemovesTheLastRecordAndClears) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  {
    ObservationLog log(path, kHeader);
    EXPECT_THROW(log.removeLast(), InputError);
    for (const char* line : {"- 1", "- 2", "- 3"}) log.append(line);
    log.removeLast();
    log.append("- 4");
    log.removeLast();
  }
  {
    ObservationLog log(path, kHeader);
    EXPECT_EQ(log.records(), (Lines{"- 1", "- 2"}));
    log.clear("other:\n");
    EXPECT_TRUE(log.records().empty());
    log.append("- 5");
  }
  EXPECT_EQ(ObservationLog(path, "other:\n").records(), Lines{"- 5"});
  // what was cleared away is still there
  EXPECT_EQ(ObservationLog(path + ".previous", kHeader).records(), (Lines{"- 1", "- 2"}));
}

TEST(ObservationLog, RefusesRecordsThatAreNoLine) {
  const test::TemporaryFolder folder;
  ObservationLog log(folder / "j.yaml", kHeader);
  EXPECT_THROW(log.append(""), InputError);
  EXPECT_THROW(log.append("- 1\n- 2"), InputError);
  EXPECT_THROW(log.append(std::string("- \0", 3)), InputError);
  EXPECT_TRUE(log.records().empty());
  EXPECT_THROW(ObservationLog(folder / "k.yaml", ""), InputError);
  EXPECT_THROW(ObservationLog(folder / "none/k.yaml", kHeader), InputError);
}

// Cut off anywhere in the last line: the records before stay, and the journal goes on.
TEST(ObservationLog, CutsOffATornLineAtEveryByte) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  {
    ObservationLog log(path, kHeader);
    log.append("- {first: 1}");
  }
  const std::size_t one = contentOf(path).size();
  {
    ObservationLog log(path, kHeader);
    log.append("- {second: 2}");
  }
  const std::string whole = contentOf(path);
  for (std::size_t size = one; size < whole.size(); ++size) {
    for (const std::string& tail : {std::string(), std::string(17, '\0')}) {
      writeText(path, whole.substr(0, size) + tail);
      {
        ObservationLog log(path, kHeader);
        ASSERT_EQ(log.records(), Lines{"- {first: 1}"}) << size;
        ASSERT_EQ(log.torn(), size > one || !tail.empty());
        log.append("- {third: 3}");
      }
      ASSERT_EQ(ObservationLog(path, kHeader).records(), (Lines{"- {first: 1}", "- {third: 3}"}));
    }
  }
}

// Any changed byte of a complete line is found: nothing acknowledged vanishes silently.
TEST(ObservationLog, RefusesDamageAtEveryByte) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  {
    ObservationLog log(path, kHeader);
    for (const char* line : {"- {first: 1}", "- {second: 2}", "- {third: 3}"}) log.append(line);
  }
  const std::string whole = contentOf(path);
  // a torn line has no end of line
  for (std::size_t place = 0; place + 1 < whole.size(); ++place) {
    for (const char change : {'\x01', '\x20'}) {
      std::string damaged = whole;
      damaged[place] = static_cast<char>(damaged[place] ^ change);
      writeText(path, damaged);
      const std::string why = refusal(path);
      ASSERT_FALSE(why.empty()) << place;
      ASSERT_TRUE(has(why, path) && has(why, "line ")) << why;
      ASSERT_FALSE(has(why, "\n"));
      ASSERT_EQ(contentOf(path), damaged);  // evidence stays
    }
  }
  // lines taken out, twice or in another order
  const std::size_t a = whole.find("- {first"), b = whole.find("- {second"),
                    c = whole.find("- {th");
  const std::string first = whole.substr(a, b - a), second = whole.substr(b, c - b),
                    third = whole.substr(c), head = whole.substr(0, a);
  for (const std::string& content : {head + first + third, head + second + first + third,
                                     head + first + first + second + third, head + third}) {
    writeText(path, content);
    EXPECT_TRUE(has(refusal(path), "damaged or edited")) << content;
  }
}

TEST(ObservationLog, RefusesForeignFiles) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  for (const std::string& content :
       {std::string(), std::string("\n"), std::string("hello"), std::string("a: 1\nb: 2\n"),
        std::string(5000, '\0'), kHeader}) {
    writeText(path, content);
    EXPECT_TRUE(has(refusal(path), "no journal")) << content << refusal(path);
    EXPECT_EQ(contentOf(path), content);
  }
  fs::remove(path);
  fs::create_directory(path);
  EXPECT_FALSE(refusal(path).empty());
}

TEST(ObservationLog, ComparesTheHeader) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  { ObservationLog log(path, "a:\n"); }
  {
    ObservationLog log(path, kHeader);  // nothing in it yet
    log.append("- 1");
  }
  EXPECT_TRUE(has(refusal(path, "a:\n"), "another header (1 records)")) << refusal(path, "a:\n");
  EXPECT_EQ(ObservationLog(path, kHeader).records(), Lines{"- 1"});
}

TEST(ObservationLog, HasOneOwner) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  auto log = std::make_unique<ObservationLog>(path, kHeader);
  EXPECT_TRUE(has(refusal(path), "in use by another process"));
  log->append("- 1");
  log.reset();
  EXPECT_EQ(refusal(path), "");
}

// A disk that is full takes nothing, or the whole line.
TEST(ObservationLog, StaysWholeWhenTheDiskIsFull) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    ObservationLog log(path, kHeader);
    const struct rlimit limit { 4096, 4096 };
    setrlimit(RLIMIT_FSIZE, &limit);
    int refused = 0;
    for (int i = 0; i < 60; ++i) {
      try {
        log.append("- " + std::string(100, 'x'));
      } catch (const InputError&) {
        ++refused;
      }
    }
    _exit(refused > 0 && log.records().size() > 20 ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  ObservationLog log(path, kHeader);
  EXPECT_FALSE(log.torn());
  EXPECT_GT(log.records().size(), 20u);
}

// ---- kill -9 of a writer at random moments ----

// Runs `work` in a child, which reports each finished piece; kills it after about `microseconds`
// from its first report. Returns how many pieces it had reported.
template <class Work>
std::uint32_t killed(const Work& work, long microseconds) {
  int ends[2];
  if (pipe(ends) != 0) return 0;
  const pid_t child = fork();
  if (child == 0) {
    ::close(ends[0]);
    work([&] {
      if (::write(ends[1], "+", 1) != 1) _exit(1);
    });
    _exit(0);
  }
  ::close(ends[1]);
  char report[4096];
  std::uint32_t reported = ::read(ends[0], report, 1) == 1 ? 1 : 0;
  usleep(static_cast<useconds_t>(microseconds));
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status));
  for (ssize_t n; (n = ::read(ends[0], report, sizeof(report))) > 0;) {
    reported += static_cast<std::uint32_t>(n);
  }
  ::close(ends[0]);
  return reported;
}

TEST(Killed, JournalHoldsEveryAcknowledgedRecord) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  std::mt19937 random(7);
  std::uniform_int_distribution<long> pause(0, 2500);
  std::size_t known = 0, torn = 0;
  constexpr int kKills = 300;
  for (int i = 0; i < kKills; ++i) {
    const std::uint32_t acknowledged = killed(
        [&](const auto& done) {
          ObservationLog log(path, kHeader);
          for (std::size_t n = log.records().size();; ++n) {
            log.append("- {n: " + std::to_string(n) + ", fill: " + std::string(n % 900, 'y') + "}");
            done();
          }
        },
        pause(random));
    ObservationLog log(path, kHeader);
    torn += log.torn();
    ASSERT_GE(acknowledged, 1u);
    ASSERT_GE(log.records().size(), known + acknowledged);
    ASSERT_LE(log.records().size(), known + acknowledged + 1);  // one more: not yet acknowledged
    for (std::size_t n = known; n < log.records().size(); ++n) {
      ASSERT_EQ(log.records()[n].rfind("- {n: " + std::to_string(n) + ",", 0), 0u);
    }
    known = log.records().size();
    if (known > 2000) {
      log.clear(kHeader);
      known = 0;
    }
  }
  std::cout << kKills << " kills, " << torn << " torn lines cut off\n";
}

// Removing and clearing under kills: the file is always in a requested state.
TEST(Killed, JournalIsWholeWhileRecordsAreTakenAway) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "j.yaml";
  std::mt19937 random(8);
  std::uniform_int_distribution<long> pause(0, 2500);
  { ObservationLog log(path, kHeader); }
  for (int i = 0; i < 150; ++i) {
    killed(
        [&](const auto& done) {
          ObservationLog log(path, kHeader);
          for (int n = 0;; ++n) {
            log.append("- " + std::to_string(log.records().size()));
            log.append("- " + std::to_string(log.records().size()));
            if (n % 3 != 2) log.removeLast();
            if (n % 16 == 15) log.clear(kHeader);
            done();
          }
        },
        pause(random));
    const ObservationLog log(path, kHeader);
    for (std::size_t n = 0; n < log.records().size(); ++n) {
      ASSERT_EQ(log.records()[n], "- " + std::to_string(n));
    }
  }
}

TEST(Killed, StoredCalibrationIsTheOldOneOrTheNewOne) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "c.yaml";
  const auto calibration = [](int n) {
    Calibration c;
    c.id = "number " + std::to_string(n);
    c.serial_number = "s";
    c.volts_to_wrench = Matrix6::Identity() * (1.0 + n);
    return c;
  };
  saveCalibration(calibration(0), path);
  std::mt19937 random(9);
  std::uniform_int_distribution<long> pause(0, 2500);
  int known = 0;
  for (int i = 0; i < 300; ++i) {
    const std::uint32_t acknowledged = killed(
        [&](const auto& done) {
          for (int n = known + 1;; ++n) {
            saveCalibration(calibration(n), path);
            done();
          }
        },
        pause(random));
    const Calibration c = loadCalibration(path);  // throws for anything but a whole file
    const int found = static_cast<int>(c.volts_to_wrench(0, 0)) - 1;
    ASSERT_EQ(c.id, "number " + std::to_string(found));
    ASSERT_GE(found, known + static_cast<int>(acknowledged));
    ASSERT_LE(found, known + static_cast<int>(acknowledged) + 1);
    known = found;
  }
}

}  // namespace
}  // namespace assembly_cell
