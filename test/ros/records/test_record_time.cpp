// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <string>
#include <vector>

#include "assembly_cell/AssemblePegActionResult.h"
#include "record_fixture.h"

namespace assembly_cell::ros_bridge::record_time_test {
namespace {

using actionlib::SimpleClientGoalState;

constexpr int kGoals = 20;
constexpr double kAllowed = 5e-3;  // required of a record [s]

class RecordTime : public RecordCell {
 protected:
  RecordTime() : RecordCell("/record_time") {
    const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
    const boost::function<void(const SupervisorStateConstPtr&)> at_state =
        [this](const SupervisorStateConstPtr& state) {
          if (state->goal.empty()) idle_ = ros::WallTime::now().toSec();
        };
    const boost::function<void(const AssemblePegActionResultConstPtr&)> at_result =
        [this](const AssemblePegActionResultConstPtr&) { ended_ = ros::WallTime::now().toSec(); };
    state_sub_ = nh_.subscribe<SupervisorState>("assembly_supervisor/state", 10, at_state,
                                                ros::VoidConstPtr(), hints);
    result_sub_ = nh_.subscribe<AssemblePegActionResult>("assemble/result", 10, at_result,
                                                         ros::VoidConstPtr(), hints);
  }

  // Median of the times from the supervisor's last state of a goal to its result, of goals that
  // insert the peg by a millimetre each. [s]
  double median(const std::string& mode) {
    startSupervisor(mode);
    if (mode != "off") waitForRecorder();
    resetCell();
    EXPECT_EQ(assemble(1e-3).state_, SimpleClientGoalState::SUCCEEDED) << report().reason;
    std::vector<double> times;
    for (int i = 0; i < kGoals; ++i) {
      ended_ = 0.0;
      EXPECT_EQ(assemble(1e-3 * (i + 2)).state_, SimpleClientGoalState::SUCCEEDED)
          << report().reason;
      EXPECT_EQ(report().record != 0, mode != "off");
      EXPECT_TRUE(test::waitFor([this] { return ended_ > 0.0; }));
      times.push_back(ended_ - idle_);
    }
    std::nth_element(times.begin(), times.begin() + kGoals / 2, times.end());
    return times[kGoals / 2];
  }

  std::atomic<double> idle_{0.0}, ended_{0.0};  // received, wall clock [s]
  ros::Subscriber state_sub_, result_sub_;
};

TEST_F(RecordTime, IsAddedToAGoal) {
  startRecorder();
  const double without = median("off"), with = median("required");
  std::printf("record_time: median of %d goals %.2f ms without, %.2f ms with\n", kGoals,
              1e3 * without, 1e3 * with);
  EXPECT_LT(with - without, kAllowed);
}

}  // namespace
}  // namespace assembly_cell::ros_bridge::record_time_test
