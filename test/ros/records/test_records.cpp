// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>

#include <cmath>
#include <fstream>
#include <mutex>
#include <optional>
#include <random>
#include <string>

#include "assembly_cell/AssemblePegActionResult.h"
#include "assembly_cell/AssemblyRecord.h"
#include "assembly_cell/base/input_error.h"
#include "cell_run.h"
#include "record_fixture.h"
#include "temporary_folder.h"

namespace assembly_cell::ros_bridge::records_test {
namespace {

using actionlib::SimpleClientGoalState;
using test::Child;
using test::has;
using test::waitFor;

constexpr int kKills = 4;  // without the environment variable ASSEMBLY_CELL_KILLS

class Records : public RecordCell {
 protected:
  Records() : RecordCell("/records") {}
};

TEST_F(Records, AreWholeInTheStoreWhenTheResultIsPublished) {
  startRecorder({"_station:=bench", "_simulation_seed:=s1"});
  startSupervisor("required");
  waitForRecorder();
  std::mutex mutex;
  std::optional<assembly_cell::Run> found;
  std::string why;
  const boost::function<void(const AssemblePegActionResultConstPtr&)> at_result =
      [&](const AssemblePegActionResultConstPtr& message) {
        const std::lock_guard<std::mutex> lock(mutex);
        try {
          found = read(message->result.report.record);
        } catch (const InputError& error) {
          why = error.what();
        }
      };
  const ros::Subscriber sub =
      nh_.subscribe<AssemblePegActionResult>("assemble/result", 10, at_result);
  ASSERT_TRUE(waitFor([&] { return sub.getNumPublishers() > 0; }));
  ASSERT_EQ(assemble(0.005, "A-117", "gearbox").state_, SimpleClientGoalState::SUCCEEDED)
      << report().reason;
  ASSERT_TRUE(waitFor([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return found || !why.empty();
  }));
  ASSERT_TRUE(found) << why;
  const assembly_cell::Run& run = *found;
  EXPECT_EQ(run.id, report().record);
  EXPECT_EQ(run.serial, "A-117");
  EXPECT_EQ(run.program, "gearbox");
  EXPECT_EQ(run.program_hash.rfind("crc32:", 0), 0U) << run.program_hash;
  EXPECT_EQ(run.station, "bench");
  EXPECT_EQ(run.strategy, "touch");
  EXPECT_EQ(run.result, "seated");
  EXPECT_EQ(run.failure, "");
  EXPECT_NEAR(run.duration, report().simulated_time, 1e-9);
  EXPECT_NEAR(run.start, ros::WallTime::now().toSec(), 300.0);
  for (const char* name : {"package", "messages"}) EXPECT_EQ(run.versions.count(name), 1U) << name;
  for (const char* name : {"mechanism", "sensor_a", "sensor_b"}) {
    EXPECT_TRUE(has(run.calibrations.at(name), "crc32:")) << name;
  }
  EXPECT_EQ(run.simulation, (std::map<std::string, std::string>{{"seed", "s1"}}));
  EXPECT_EQ(run.settings.at("strategy"), "touch");
  EXPECT_EQ(run.settings.count("press_force"), 0U);  // as by default
  ASSERT_GT(run.curve.size(), 10U);
  EXPECT_NEAR(run.curve.depth.back(), assemble_->getResult()->depth, 1e-4);
  ASSERT_EQ(run.estimates.size(), 5U);
  EXPECT_EQ(run.estimates[0].name, "hole_x");
  EXPECT_EQ(run.estimates[0].value, report().estimated_offset[0]);
  EXPECT_GT(run.estimates[0].sd, 0.0);
  EXPECT_EQ(run.estimates[4].name, "clearance");
  EXPECT_EQ(run.estimates[4].value, report().clearance);
  EXPECT_TRUE(has(report().verdict, "no rules for program gearbox")) << report().verdict;
}

TEST_F(Records, HaveTheSerialNumberOfTheGoalOrOfTheServiceOrARunningOne) {
  startRecorder();
  startSupervisor("required");
  waitForRecorder();
  double depth = 0.002;
  const auto next = [&](const std::string& serial, const std::string& program) {
    EXPECT_EQ(assemble(depth += 5e-4, serial, program).state_, SimpleClientGoalState::SUCCEEDED)
        << report().reason;
    return read(report().record);
  };
  const assembly_cell::Run first = next("", "");
  EXPECT_FALSE(first.serial.empty());
  EXPECT_EQ(first.program, "cell");  // the scenario's
  EXPECT_TRUE(setPart("B-2", "pump").success);
  // a goal that names its own leaves that of the service to the next one
  const assembly_cell::Run named = next("A-1", "valve");
  EXPECT_EQ(named.serial + named.program, "A-1valve");
  const assembly_cell::Run set = next("", "");
  EXPECT_EQ(set.serial + set.program, "B-2pump");
  const assembly_cell::Run running = next("", "");
  EXPECT_FALSE(running.serial.empty());
  EXPECT_NE(running.serial, "B-2");
  EXPECT_NE(running.serial, first.serial);
  EXPECT_EQ(running.program, "pump");
  const SetPart::Response refused = setPart(std::string(300, 'x'), "");
  EXPECT_FALSE(refused.success);
  EXPECT_TRUE(has(refused.message, "serial")) << refused.message;
  EXPECT_TRUE(setPart("", "").success);
  EXPECT_EQ(next("", "").program, "cell");
}

TEST_F(Records, ThatAreRequiredAndCannotBeStoredAreRefusedBeforeAnythingMoves) {
  startSupervisor("required");
  const auto refused = [&](const std::string& why) {
    commands_.clear();
    EXPECT_EQ(assemble(0.002).state_, SimpleClientGoalState::ABORTED);
    EXPECT_TRUE(has(report().reason, "~record is required")) << report().reason;
    EXPECT_TRUE(has(report().reason, why)) << report().reason;
    EXPECT_EQ(commands_.size(), 0U);
  };
  refused("is assembly_recorder running?");
  // a file that is no store, and a folder that nothing can be written to
  std::ofstream(folder_ + "/no_store") << "text\n" << std::string(5000, 'x');
  for (const std::string& store : {folder_ + "/no_store", std::string("/proc/1/records.db")}) {
    start("assembly_recorder", "assembly_recorder", {"_store:=" + store});
    ASSERT_TRUE(waitFor([&] {
      const auto state = recorder_state_.last();
      return state && state->store == store && subscribers("recorder_state") > 1;
    })) << recorder().output();
    EXPECT_FALSE(recorder_state_.last()->writable);
    const std::size_t n = recorder_state_.size();
    ASSERT_TRUE(waitFor([&] { return recorder_state_.size() > n + 1; }));
    refused(store);
  }
  // frozen: its last state is too old
  startRecorder();
  waitForRecorder();
  recorder().signal(SIGSTOP);
  const std::size_t n = recorder_state_.size();
  const ros::WallTime stopped = ros::WallTime::now();
  ASSERT_TRUE(waitFor([&] { return (ros::WallTime::now() - stopped).toSec() > 6.0; }));
  EXPECT_LE(recorder_state_.size(), n + 1);
  refused("no message on recorder_state for");
  recorder().signal(SIGCONT);
}

TEST_F(Records, ThatAreRequiredAndWereNotStoredEndTheGoalAsFailed) {
  startRecorder();
  startSupervisor("required");
  waitForRecorder();
  resetCell();
  send(0.002);
  ASSERT_TRUE(waitFor([&] { return !commands_.all().empty(); }));
  recorder().signal(SIGSTOP);
  EXPECT_EQ(finish().state_, SimpleClientGoalState::ABORTED);
  EXPECT_EQ(report().reason.rfind("not recorded: no answer of assembly_recorder", 0), 0U)
      << report().reason;
  EXPECT_EQ(report().record, 0);
  EXPECT_FALSE(report().success);
  // the peg stays in the hole
  EXPECT_GT(assemble_->getResult()->depth, 0.0015);
  recorder().signal(SIGCONT);
  waitForRecorder();
  EXPECT_EQ(assemble(0.003).state_, SimpleClientGoalState::SUCCEEDED) << report().reason;
}

TEST_F(Records, AreMissingWithAWarningWhereTheyAreBestEffort) {
  startRecorder();
  startSupervisor("best_effort");
  waitForRecorder();
  const auto without = [&](double depth, const std::string& why) {
    EXPECT_EQ(assemble(depth).state_, SimpleClientGoalState::SUCCEEDED) << report().reason;
    EXPECT_EQ(report().record, 0);
    EXPECT_TRUE(waitFor([&] {
      supervisor().running();
      return has(supervisor().output(), why);
    })) << supervisor().output();
  };
  recorder().signal(SIGSTOP);
  without(0.002, "not recorded: no answer of assembly_recorder within");
  recorder().signal(SIGKILL);
  ASSERT_TRUE(waitFor([&] { return !recorder().running(); }));
  without(0.0025, "not recorded: no subscriber of run_record");
  startRecorder();
  waitForRecorder();
  EXPECT_EQ(assemble(0.003).state_, SimpleClientGoalState::SUCCEEDED) << report().reason;
  EXPECT_EQ(read(report().record).result, "seated");
}

TEST_F(Records, AreCancelledByANode) {
  startRecorder();
  startSupervisor("required");
  waitForRecorder();
  resetCell();
  send(0.02);
  ASSERT_TRUE(waitFor([&] { return !commands_.all().empty(); }));
  assemble_->cancelGoal();
  EXPECT_EQ(finish().state_, SimpleClientGoalState::PREEMPTED);
  const assembly_cell::Run run = read(report().record);
  EXPECT_EQ(run.result, "failed");
  EXPECT_EQ(run.failure, "cancelled");
  ASSERT_FALSE(run.events.empty());
  EXPECT_EQ(run.events.back().kind, "cancelled");
  EXPECT_EQ(run.events.back().text, "by " + ros::this_node::getName());
}

TEST_F(Records, ThatAreOffHaveNoTopic) {
  startSupervisor("off");
  EXPECT_EQ(assemble(0.002).state_, SimpleClientGoalState::SUCCEEDED) << report().reason;
  EXPECT_EQ(report().record, 0);
  EXPECT_EQ(publishers("run_record"), 0U);
  EXPECT_EQ(subscribers("run_verdict"), 1U);  // this test
}

TEST_F(Records, HaveOneRecorder) {
  startRecorder();
  Child second({test::executable("assembly_recorder"), "__ns:=" + ns_, "__name:=other",
                "_store:=" + store_});
  EXPECT_EQ(second.wait(), 1) << second.output();
  EXPECT_EQ(second.lines("records of this cell are stored by " + ns_ + "/assembly_recorder already")
                .size(),
            1U)
      << second.output();
}

// Both are killed as a goal ends, at a random time: between its last command and its result.
TEST_F(Records, AreWholeAfterKills) {
  const char* wanted = getenv("ASSEMBLY_CELL_KILLS");
  const int kills = wanted != nullptr ? atoi(wanted) : kKills;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> delay(0.0, 0.01);  // [s]
  test::Record<AssemblePegActionResult> results(nh_, "assemble/result");
  startRecorder();
  startSupervisor("required");
  waitForRecorder();
  double depth = 0.0;
  int stored = 0;
  for (int kill = 0; kill < kills; ++kill) {
    const bool of_supervisor = kill % 2 == 1;
    if (depth == 0.0 || depth > 0.04) {
      resetCell();
      depth = 0.002;
    }
    state_.clear();
    send(depth += 2e-4);
    const auto ends = [&] {
      const auto all = state_.all();
      return all.size() > 1 && all.back()->goal.empty();
    };
    ASSERT_TRUE(waitFor(ends)) << supervisor().output();
    ros::WallDuration(delay(random)).sleep();
    Child& victim = of_supervisor ? supervisor() : recorder();
    victim.signal(SIGKILL);
    ASSERT_TRUE(waitFor([&] { return !victim.running(); }));
    if (!of_supervisor) finish();
    if (of_supervisor) {
      startSupervisor("required");
      depth = 0.0;
    } else {
      startRecorder();
    }
    waitForRecorder();
  }
  for (const auto& message : results.all()) {
    const AlignmentReport& report = message->result.report;
    if (report.record == 0) {
      EXPECT_TRUE(has(report.reason, "not recorded")) << report.reason;
      continue;
    }
    ++stored;
    const assembly_cell::Run run = read(report.record);
    EXPECT_EQ(run.text, report.reason);
    EXPECT_GT(run.curve.size(), 0U);
  }
  EXPECT_EQ(RunStore(store_, RunStore::Access::kRead).check(), std::vector<std::string>());
  RecordProperty("published_and_stored", stored);
}

TEST(RecordsInOneProcess, AreStored) {
  const std::string store = test::temporaryFile("one_process.db");
  const test::CellRun run =
      test::runCell({"nodelets:=true", "twin_force:=false", "records:=" + store}, "touch");
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_TRUE(has(run.output, "record 1: no rules for program cell")) << run.output;
  const assembly_cell::Run stored = RunStore(store, RunStore::Access::kRead).read(1);
  EXPECT_EQ(stored.result, "aligned");
  EXPECT_EQ(stored.simulation.at("world"), "exact");
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::records_test
