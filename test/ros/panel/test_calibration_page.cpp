// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <algorithm>
#include <string>
#include <vector>

#include "assembly_cell/ApplyLoad.h"
#include "assembly_cell/PlanCalibration.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "calibration_fixture.h"
#include "panel_fixture.h"

namespace assembly_cell::panel::calibration_page_test {
namespace {

using ros_bridge::callService;

using test::Child;

// applies the requested load on the rig; false if the plan has none with this text
bool applyLoad(const std::vector<LoadStep>& plan, const std::string& request) {
  const auto step = std::find_if(plan.begin(), plan.end(), [&request](const LoadStep& s) {
    return request.compare(0, s.text.size(), s.text) == 0;
  });
  if (step == plan.end()) return false;
  ApplyLoad call;
  call.request.step = *step;
  EXPECT_TRUE(callService("/simulated_calibration_rig/apply", call));
  EXPECT_TRUE(call.response.success) << call.response.message;
  return call.response.success;
}

TEST(CalibrationPage, LeadsFromThePlanToAnActiveCalibration) {
  const test::TemporaryFolder folder;
  Child server({test::executable("calibration_server"), "_store:=" + folder.path()});
  Screen s;
  s.find<QTabWidget>("tabs")->setCurrentIndex(1);
  ASSERT_TRUE(seen([&] { return s.link.view().calibration.there; })) << server.output();

  s.click("check_plan");
  auto* steps = s.find<QListWidget>("steps");
  ASSERT_TRUE(seen([&] { return steps->count() > 30; })) << s.text("plan_report");
  EXPECT_TRUE(s.shows("plan_report", "steps")) << s.text("plan_report");
  PlanCalibration plan;
  ASSERT_TRUE(callService("/calibration_server/plan", plan));
  ASSERT_EQ(static_cast<int>(plan.response.steps.size()), steps->count());
  EXPECT_FALSE(s.enabled("confirm"));
  EXPECT_FALSE(s.enabled("remove_last"));
  // there is no cell
  EXPECT_EQ(s.text("state"), "not there");
  EXPECT_EQ(s.text("true_offset"), "not there");
  for (const char* name : {"start", "cancel", "retreat", "pause", "run", "step_blocks", "reset"}) {
    EXPECT_FALSE(s.enabled(name)) << name;
  }

  s.find<QLineEdit>("id")->setText("by_hand");
  s.click("begin");
  auto* progress = s.find<QProgressBar>("progress");
  const int count = steps->count();
  bool weighed = false;
  for (int done = 0; done < count; ++done) {
    ASSERT_TRUE(seen([&] { return progress->value() == done && s.enabled("confirm"); }))
        << done << ": " << s.text("calibration_state") << s.text("answer");
    const std::string request = s.text("load_to_apply");
    ASSERT_TRUE(applyLoad(plan.response.steps, request)) << request;
    // the list shows the current step
    const std::string row = steps->currentItem()->text().toStdString();
    EXPECT_NE(request.find(row.substr(row.find(' ') + 1)), std::string::npos) << row << request;
    // a mass can be entered for a weight
    const bool hangs = request.find("hang") != std::string::npos;
    EXPECT_EQ(s.find<QDoubleSpinBox>("mass")->isVisible(), hangs) << request;
    EXPECT_EQ(s.find<QDoubleSpinBox>("mass")->value() > 0.0, hangs) << request;
    if (hangs && !weighed) keepPicture(s.widget);
    weighed |= hangs;
    s.click("confirm");
  }
  EXPECT_TRUE(weighed);
  ASSERT_TRUE(seen([&] { return s.link.view().calibration.result_known; }))
      << s.text("calibration_state");
  EXPECT_TRUE(seen([&] { return s.shows("calibration_result", "by_hand"); }))
      << s.text("calibration_result");
  EXPECT_TRUE(seen([&] {
    return s.shows("active_calibration", "sensor_a by_hand, sensor_b by_hand");
  })) << s.text("active_calibration");
  EXPECT_TRUE(seen([&] { return s.shows("sensor_a_calibration", "by_hand"); }))
      << s.text("sensor_a_calibration");

  // a stored calibration can be activated again
  s.click("list");
  auto* stored = s.find<QComboBox>("stored");
  ASSERT_TRUE(seen([&] { return stored->findText("by_hand") >= 0; })) << s.text("answer");
  stored->setCurrentText("by_hand");
  s.click("load");
  EXPECT_TRUE(seen([&] { return s.shows("answer", "load: done"); })) << s.text("answer");
}

TEST(CalibrationPage, RemovesTheLastObservationAndCancels) {
  const test::TemporaryFolder folder;
  Child server({test::executable("calibration_server"), "_store:=" + folder.path()});
  Screen s;
  s.find<QTabWidget>("tabs")->setCurrentIndex(1);
  ASSERT_TRUE(seen([&] { return s.link.view().calibration.there; })) << server.output();
  s.click("begin");
  auto* progress = s.find<QProgressBar>("progress");
  s.click("confirm");
  ASSERT_TRUE(seen([&] { return progress->value() == 1; })) << s.text("answer");
  s.click("cancel_calibration");
  ASSERT_TRUE(seen([&] { return s.shows("calibration_result", "cancelled"); }))
      << s.text("calibration_result");
  EXPECT_TRUE(seen([&] { return s.shows("calibration_state", "1 observations"); }))
      << s.text("calibration_state");
  s.click("remove_last");
  EXPECT_TRUE(seen([&] { return s.shows("calibration_state", "0 observations"); }))
      << s.text("calibration_state");
  // a server that has ended
  server.stop();
  EXPECT_TRUE(
      seen([&] { return !s.enabled("begin") && s.shows("calibration_there", "not there"); }));
}

}  // namespace
}  // namespace assembly_cell::panel::calibration_page_test
