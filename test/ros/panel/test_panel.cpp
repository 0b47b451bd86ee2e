// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <ros/network.h>
#include <signal.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <cmath>
#include <memory>
#include <set>
#include <string>

#include "assembly_cell/AlignPegAction.h"
#include "assembly_cell/AlignmentReport.h"
#include "assembly_cell/AssemblyRecord.h"
#include "assembly_cell/AssemblyVerdict.h"
#include "assembly_cell/RecorderState.h"
#include "assembly_cell/ZeroTo.h"
#include "assembly_cell/ros/bridge/service_call.h"
#include "panel_fixture.h"
#include "parts/colors.h"
#include "parts/force_bars.h"
#include "parts/node_lights.h"
#include "records/curve_plot.h"

namespace assembly_cell::panel::panel_test {
namespace {

using test::Record;

// process of a node of the cell
int pidOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, uri, pid;
  request[0] = ros::this_node::getName();
  request[1] = node;
  EXPECT_TRUE(ros::master::execute("lookupNode", request, response, uri, false)) << node;
  std::string host;
  std::uint32_t port = 0;
  EXPECT_TRUE(ros::network::splitURI(uri, host, port));
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  request.setSize(1);
  EXPECT_TRUE(client.execute("getPid", request, response)) << node;
  return response[2];
}

class Panel : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { screen_ = std::make_unique<Screen>(); }
  static void TearDownTestSuite() { screen_.reset(); }

  static std::unique_ptr<Screen> screen_;
  Screen& s() { return *screen_; }

  void run() {
    ASSERT_TRUE(seen([&] { return s().enabled("run") || s().enabled("pause"); }));
    if (s().enabled("run")) s().click("run");
    ASSERT_TRUE(seen([&] { return s().shows("simulation", "running"); }));
  }
  void pause() {
    ASSERT_TRUE(seen([&] { return s().enabled("run") || s().enabled("pause"); }));
    if (s().enabled("pause")) s().click("pause");
    ASSERT_TRUE(seen([&] { return s().shows("simulation", "paused"); }));
  }
  // the peg back over the hole, the simulation on
  void restart() {
    run();
    s().click("reset");
    ASSERT_TRUE(seen([&] { return s().shows("answer", "reset: done"); })) << s().text("answer");
  }
  // colour of a node's light as drawn
  QColor light(const char* node) {
    auto* lights = s().find<NodeLights>("lights");
    const QPoint place = lights->lightOf(node);
    return place.x() < 0 ? QColor() : lights->grab().toImage().pixelColor(place);
  }
  std::string reason(const std::string& node) {
    for (const NodeView& view : s().link.view().nodes) {
      if (view.node == node) return view.reason;
    }
    return "";
  }
  double simulated() { return s().link.view().simulator.time; }
};

std::unique_ptr<Screen> Panel::screen_;

TEST_F(Panel, ShowsWhatIsThereAndWhatIsNot) {
  for (const char* node : {"peg_hole_simulator", "locus_estimator", "assembly_supervisor"}) {
    EXPECT_TRUE(seen([&] { return light(node) == goodColor(); })) << node << ": " << reason(node);
  }
  EXPECT_EQ(light("twin_force_estimator"), absentColor());
  EXPECT_EQ(reason("twin_force_estimator"), "not there");
  // a cell with one sensor has none of it
  ros::param::set("assembly_supervisor/sensors", "b");
  EXPECT_TRUE(seen([&] { return reason("twin_force_estimator").empty(); }));
  ros::param::del("assembly_supervisor/sensors");
  EXPECT_TRUE(seen([&] { return reason("twin_force_estimator") == "not there"; }));
  EXPECT_TRUE(seen([&] { return s().shows("simulation", "paused"); })) << s().text("simulation");
  EXPECT_TRUE(seen([&] { return s().shows("state", "idle"); })) << s().text("state");
  EXPECT_TRUE(seen([&] { return s().shows("sensor_a_calibration", "sensor_a_design"); }));
  EXPECT_TRUE(s().enabled("start"));
  EXPECT_FALSE(s().enabled("cancel"));
  EXPECT_TRUE(seen([&] { return s().text("true_offset") == "-"; })) << s().text("true_offset");
  EXPECT_FALSE(s().enabled("pause"));
  // no calibration server: reported, no button is enabled
  EXPECT_TRUE(s().shows("calibration_there", "not there"));
  for (const char* name : {"check_plan", "begin", "confirm", "remove_last", "list", "load"}) {
    EXPECT_FALSE(s().enabled(name)) << name;
  }
}

TEST_F(Panel, PausesStepsRunsAndResets) {
  pause();
  const double before = simulated();
  s().find<QSpinBox>("blocks")->setValue(5);
  s().click("step_blocks");
  EXPECT_TRUE(seen([&] { return s().shows("answer", "step: done"); })) << s().text("answer");
  // a block is 0.02 s
  EXPECT_TRUE(seen([&] { return std::abs(simulated() - before - 0.1) < 1e-9; })) << simulated();
  EXPECT_TRUE(s().shows("simulation", "paused"));

  run();
  EXPECT_TRUE(seen([&] { return simulated() > before + 0.2; }));
  EXPECT_FALSE(s().enabled("step_blocks"));
  s().click("reset");
  EXPECT_TRUE(seen([&] { return s().shows("answer", "reset: done"); })) << s().text("answer");
  pause();
}

TEST_F(Panel, StartsAnAlignmentAndShowsItsEstimateBesideTheGroundTruth) {
  ros::NodeHandle nh;
  const Record<AlignmentReport> reports(nh, "report");
  restart();
  s().find<QComboBox>("strategy")->setCurrentText("single_contact");
  std::set<std::string> steps, states;
  bool locus = false;
  s().click("start");
  ASSERT_TRUE(seen([&] {
    steps.insert(s().text("step"));
    states.insert(s().text("state"));
    locus |= s().shows("reading", "locus: ellipse");
    return s().text("outcome") != "-";
  })) << s().text("state");
  EXPECT_TRUE(s().shows("outcome", "success: aligned")) << s().text("outcome");
  EXPECT_EQ(states.count("align"), 1U);
  EXPECT_GT(steps.size(), 3U);
  EXPECT_TRUE(locus);
  EXPECT_TRUE(seen([&] { return s().shows("state", "idle"); })) << s().text("state");
  EXPECT_EQ(s().find<QLabel>("outcome")->palette().color(QPalette::WindowText), goodColor());

  ASSERT_TRUE(reports.last());
  const AlignmentReport report = *reports.last();
  const EstimateView e = s().link.view().estimate;
  ASSERT_TRUE(e.known && e.truth_known);
  EXPECT_EQ(e.offset[0], report.estimated_offset[0]);
  EXPECT_EQ(s().text("offset"), QString::asprintf("%.3f  %.3f", 1e3 * report.estimated_offset[0],
                                                  1e3 * report.estimated_offset[1])
                                    .toStdString());
  EXPECT_GT(s().find<QLabel>("offset_sd")->text().toDouble(), 0.0);
  EXPECT_LT(s().find<QLabel>("offset_sd")->text().toDouble(), 0.1);
  EXPECT_GT(s().find<QLabel>("tilt_sd")->text().toDouble(), 0.0);
  // some millimetres off at the start, found within the clearance
  EXPECT_GT(std::hypot(e.true_offset[0], e.true_offset[1]), 3e-3);
  EXPECT_LT(s().find<QLabel>("offset_error")->text().toDouble(), 0.1);
  EXPECT_LT(s().find<QLabel>("tilt_error")->text().toDouble(), 0.1);
  EXPECT_TRUE(s().shows("contacts", std::to_string(report.contacts) + " in "))
      << s().text("contacts");
  keepPicture(s().widget);
}

TEST_F(Panel, InsertsToADepth) {
  restart();
  s().find<QComboBox>("strategy")->setCurrentText("single_contact");
  QTest::mouseClick(s().find<QCheckBox>("insert"), Qt::LeftButton, {}, QPoint(8, 8));
  ASSERT_TRUE(s().find<QCheckBox>("insert")->isChecked());
  s().find<QDoubleSpinBox>("depth")->setValue(5.0);
  s().click("start");
  bool deep = false;
  ASSERT_TRUE(seen([&] {
    deep |= s().shows("contacts", "mm deep");
    return s().shows("outcome", "success");
  })) << s().text("outcome");
  EXPECT_TRUE(deep);
  EXPECT_NEAR(s().link.view().goal.depth, 5e-3, 1e-3);
  s().find<QCheckBox>("insert")->setChecked(false);
}

TEST_F(Panel, DrawsTheCurveInItsBandAndTheVerdictInItsColour) {
  restart();
  s().find<QTabWidget>("tabs")->setCurrentIndex(2);
  EXPECT_TRUE(seen([&] { return s().shows("record_store", "not there"); }));
  ros::NodeHandle nh;
  const ros::Publisher states = nh.advertise<RecorderState>("recorder_state", 1, true);
  const ros::Publisher records = nh.advertise<AssemblyRecord>("run_record", 1);
  const ros::Publisher verdicts = nh.advertise<AssemblyVerdict>("run_verdict", 50);
  const auto connected = [](const ros::Publisher& pub) { return pub.getNumSubscribers() > 0; };
  ASSERT_TRUE(seen([&] { return connected(states) && connected(records) && connected(verdicts); }));
  auto* plot = s().find<CurvePlot>("curve");
  const auto pixels = [&](const QColor& color) {
    const QImage image = plot->grab().toImage();
    return pixelsOf(image, color, 0, image.height());
  };

  RecorderState state;
  state.reason = "records.db: the disk is full";
  states.publish(state);
  EXPECT_TRUE(seen([&] { return s().shows("record_store", "the disk is full"); }));
  state.writable = true;
  state.reason.clear();
  state.serial = "A-117";
  state.program = "gearbox";
  state.band_depth = {0.0, 2e-3, 5e-3};
  state.band_low = {-2.0, -2.0, -2.0};
  state.band_high = {5.0, 8.0, 8.0};
  states.publish(state);
  EXPECT_TRUE(seen([&] { return s().shows("record_store", "runs are stored"); }));
  EXPECT_TRUE(s().shows("next_part", "A-117, program gearbox")) << s().text("next_part");
  EXPECT_TRUE(seen([&] { return pixels(trackColor()) > 1000; }));

  // it grows during the descent
  s().find<QTabWidget>("tabs")->setCurrentIndex(0);
  s().find<QComboBox>("strategy")->setCurrentText("touch");
  s().find<QCheckBox>("insert")->setChecked(true);
  s().find<QDoubleSpinBox>("depth")->setValue(5.0);
  s().click("start");
  s().find<QTabWidget>("tabs")->setCurrentIndex(2);
  std::set<std::size_t> sizes;
  ASSERT_TRUE(seen([&] {
    sizes.insert(s().link.view().record.curve.size());
    return s().shows("outcome", "success");
  })) << s().text("outcome");
  s().find<QCheckBox>("insert")->setChecked(false);
  EXPECT_GT(sizes.size(), 2U);
  EXPECT_GT(pixels(limitColor()), 20);

  AssemblyRecord record;
  for (int i = 0; i < 50; ++i) {
    record.curve_time.push_back(0.02 * i);
    record.curve_depth.push_back(1e-4 * i);
    record.curve_axial.push_back(0.1 * i);
    for (auto* row : {&record.curve_lateral, &record.curve_moment, &record.curve_tilt}) {
      row->push_back(0.0);
    }
  }
  records.publish(record);
  EXPECT_TRUE(seen([&] { return s().link.view().record.curve.size() == 50; }));
  AssemblyVerdict verdict;
  verdict.stored = verdict.passed = true;
  verdict.serial = "A-117";
  verdict.message = "good by 1 rule";
  verdict.verdicts.resize(1);
  verdict.id = 1;
  verdicts.publish(verdict);
  EXPECT_TRUE(seen([&] { return pixels(goodColor()) > 50; }));
  EXPECT_TRUE(s().shows("verdict", "1  A-117  good by 1 rule")) << s().text("verdict");
  verdict.passed = false;
  for (verdict.id = 2; verdict.id < 26; ++verdict.id) verdicts.publish(verdict);
  EXPECT_TRUE(seen([&] { return s().shows("verdict", "25  A-117"); }));
  EXPECT_TRUE(seen([&] { return pixels(faultColor()) > 50; }));
  EXPECT_EQ(s().find<QLabel>("verdict")->palette().color(QPalette::WindowText), faultColor());
  EXPECT_EQ(s().find<QListWidget>("parts")->count(), 20);
  s().find<QTabWidget>("tabs")->setCurrentIndex(0);
}

TEST_F(Panel, CancelsAGoalOfAnotherClient) {
  restart();
  ros::NodeHandle nh;
  ros::Publisher other = nh.advertise<AlignPegActionGoal>("align/goal", 1);
  ASSERT_TRUE(seen([&] { return other.getNumSubscribers() > 0; }));
  AlignPegActionGoal goal;
  goal.goal.strategy = "single_contact";
  goal.goal_id.id = "other";
  other.publish(goal);
  ASSERT_TRUE(seen([&] { return s().text("state") == "align"; })) << s().text("state");
  EXPECT_FALSE(s().enabled("start"));
  s().click("cancel");
  EXPECT_TRUE(seen([&] { return s().shows("outcome", "cancelled"); })) << s().text("outcome");
  EXPECT_TRUE(seen([&] { return s().shows("state", "idle"); })) << s().text("state");
  EXPECT_FALSE(s().enabled("cancel"));
  s().click("retreat");
  EXPECT_TRUE(seen([&] { return s().shows("outcome", "success: free"); })) << s().text("outcome");
}

TEST_F(Panel, BarsGrowWithTheForceZeroAndUndoTakeItAway) {
  restart();
  auto* bars = s().find<ForceBars>("sensor_a_bars");
  const auto pixels = [&](const QColor& color) {
    const QImage image = bars->grab().toImage();
    const int row = image.height() / 6;
    return pixelsOf(image, color, 2 * row, 3 * row);
  };
  const auto force = [&] { return s().link.view().sensors[kSensorA].wrench[2]; };
  const auto becomes = [&](double wanted) {
    return seen([&] { return std::abs(force() - wanted) < 0.5; });
  };
  ASSERT_TRUE(seen([&] { return s().link.view().sensors[kSensorA].limit_known; }));
  const double limit = s().link.view().sensors[kSensorA].limit[2];
  EXPECT_GT(limit, 50.0);
  const auto readAs = [&](double share) {
    ZeroTo call;
    call.request.wrench[2] = share * limit;
    EXPECT_TRUE(ros_bridge::callService("/sensor_a/driver/zero_to", call));
    EXPECT_TRUE(call.response.success) << call.response.message;
    EXPECT_TRUE(becomes(share * limit)) << force();
    EXPECT_TRUE(seen([&] { return true; }));
  };
  s().click("sensor_a_zero");
  ASSERT_TRUE(seen([&] { return s().shows("answer", "sensor_a zero: done"); }))
      << s().text("answer");
  ASSERT_TRUE(becomes(0.0)) << force();
  EXPECT_TRUE(seen([&] { return pixels(goodColor()) < 30; }));

  readAs(0.2);
  int fifth = 0;
  EXPECT_TRUE(seen([&] { return (fifth = pixels(goodColor())) > 60; })) << fifth;
  readAs(0.4);
  EXPECT_TRUE(seen([&] { return std::abs(pixels(goodColor()) - 2 * fifth) < fifth / 5; }))
      << pixels(goodColor()) << " after " << fifth;
  readAs(0.7);
  EXPECT_TRUE(seen([&] { return pixels(warningColor()) > 3 * fifth; }));
  EXPECT_EQ(pixels(goodColor()), 0);
  readAs(0.95);
  EXPECT_TRUE(seen([&] { return pixels(faultColor()) > 4 * fifth; }));

  // undo, one change after the other
  for (const double share : {0.7, 0.4, 0.2, 0.0}) {
    s().click("sensor_a_undo");
    EXPECT_TRUE(becomes(share * limit)) << share << ": " << force();
    EXPECT_TRUE(seen([&] { return s().enabled("sensor_a_undo"); }));
  }
  EXPECT_TRUE(s().shows("answer", "sensor_a undo: done")) << s().text("answer");
  EXPECT_TRUE(seen([&] { return pixels(goodColor()) < 30; }));
  pause();
}

TEST_F(Panel, LivesOnWithFrozenAndDeadNodes) {
  run();
  pause();
  const int driver = pidOf("/sensor_a/driver");
  kill(driver, SIGSTOP);
  s().click("sensor_a_zero");
  EXPECT_TRUE(seen([&] { return s().shows("answer", "sensor_a zero: no answer yet"); }));
  EXPECT_FALSE(s().enabled("sensor_a_zero"));
  // the screen is refreshed meanwhile: a light turns red and shows the reason
  EXPECT_TRUE(seen([&] { return light("sensor_a/driver") == faultColor(); }));
  EXPECT_TRUE(seen([&] { return reason("sensor_a/driver").find("frozen") == 0; }))
      << reason("sensor_a/driver");
  EXPECT_TRUE(s().shows("answer", "sensor_a zero: no answer yet")) << s().text("answer");
  // closing a panel doesn't wait for the answer
  {
    Screen other;
    ASSERT_TRUE(seen([&] { return other.enabled("sensor_a_undo"); }));
    QTest::mouseClick(other.find<QPushButton>("sensor_a_undo"), Qt::LeftButton);
    ASSERT_TRUE(seen([&] { return other.shows("answer", "no answer yet"); }));
  }
  kill(driver, SIGCONT);
  run();
  EXPECT_TRUE(seen([&] { return s().enabled("sensor_a_zero"); })) << s().text("answer");
  EXPECT_TRUE(seen([&] { return light("sensor_a/driver") == goodColor(); }))
      << reason("sensor_a/driver");
  pause();

  kill(pidOf("/locus_estimator"), SIGKILL);
  EXPECT_TRUE(seen([&] { return light("locus_estimator") == faultColor(); }));
  EXPECT_TRUE(seen([&] { return reason("locus_estimator").find("gone") == 0; }))
      << reason("locus_estimator");
}

TEST_F(Panel, KeepsItsSettings) {
  s().find<QComboBox>("strategy")->setCurrentText("touch");
  s().find<QCheckBox>("insert")->setChecked(true);
  s().find<QDoubleSpinBox>("depth")->setValue(12.5);
  Screen other;
  other.widget.apply(s().widget.settings());
  EXPECT_EQ(other.find<QComboBox>("strategy")->currentText().toStdString(), "touch");
  EXPECT_TRUE(other.find<QCheckBox>("insert")->isChecked());
  EXPECT_EQ(other.find<QDoubleSpinBox>("depth")->value(), 12.5);
}

}  // namespace
}  // namespace assembly_cell::panel::panel_test
