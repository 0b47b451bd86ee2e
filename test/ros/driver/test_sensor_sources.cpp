// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include <assembly_cell/DisplacementSamples.h>
#include <assembly_cell/StrainSamples.h>
#include <assembly_cell/WrenchSamples.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosbag/bag.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "assembly_cell/mechanism/mechanism.h"
#include "assembly_cell/sensor/calibration.h"
#include "driver_fixture.h"
#include "temporary_folder.h"

namespace assembly_cell::test::sensor_sources_test {
namespace {

const std::string kCalibration = "config/calibration/sensor_a.yaml";

// With the package of the example among those that rospack sees.
std::vector<std::string> withExample() {
  const char* packages = std::getenv("ROS_PACKAGE_PATH");
  return {"ROS_PACKAGE_PATH=" + sourceFile("test/example_source") + ":" +
          (packages == nullptr ? "" : packages)};
}

StrainSamples strainBlock(std::uint32_t sequence, std::size_t samples, double start) {
  StrainSamples block;
  block.header.stamp = ros::Time(start);
  block.header.frame_id = "sensor_a";
  block.period = 2e-4;
  block.sequence = sequence;
  block.temperature = 21.5;
  for (std::size_t k = 0; k < samples; ++k) {
    for (int j = 0; j < 6; ++j)
      block.volts.push_back(0.01 * sequence + 1e-4 * static_cast<double>(k) + 0.1 * j);
  }
  block.saturated.assign(samples, 0);
  return block;
}

class SensorSources : public ::testing::Test {
 protected:
  SensorSources() : diagnoses_(nh_) {}
  ros::NodeHandle nh_;
  Diagnoses diagnoses_;
};

// A class in another library, found by its name, with its own keys.
TEST_F(SensorSources, LoadsAPlugInFromAnotherPackage) {
  Record<WrenchSamples> samples(nh_, "/plugin/wrench_samples");
  Driver driver("plugin",
                {"_source/type:=assembly_cell_example_source/Counting", "_source/rate:=100.0",
                 "_source/first:=7"},
                withExample());
  ASSERT_TRUE(waitFor([&] { return samples.size() > 200; })) << driver.output();
  const auto all = samples.all();
  for (std::size_t i = 1; i < all.size(); ++i) {
    ASSERT_EQ(all[i]->wrench[0], all[i - 1]->wrench[0] + 1.0);
    ASSERT_EQ(all[i]->sequence, all[i - 1]->sequence + 1);
    ASSERT_GT(all[i]->header.stamp, all[i - 1]->header.stamp);
  }
  EXPECT_GE(all[0]->wrench[0], 7.0);
  ASSERT_TRUE(
      diagnoses_.await("plugin/driver: device", [](const auto& s) { return s.level == 0; }));
  const auto status = diagnoses_.latest("plugin/driver: device");
  EXPECT_EQ(status.message, "connected to a counter");
  EXPECT_EQ(status.hardware_id, "counter-1");
}

// A source of wrenches needs no calibration file: the mount's compliance turns them into
// displacements.
TEST_F(SensorSources, WrenchesAndTheMountGiveDisplacements) {
  Record<WrenchSamples> wrenches(nh_, "/mounted/wrench_samples");
  Record<DisplacementSamples> displacements(nh_, "/mounted/displacement_samples");
  const std::string scenario = sourceFile("config/scenarios/cell.yaml");
  Driver driver("mounted",
                {"_source/type:=assembly_cell_example_source/Counting", "_source/rate:=500.0",
                 "_publish_displacement:=true", "_scenario:=" + scenario},
                withExample());
  ASSERT_TRUE(waitFor([&] { return displacements.size() > 20 && wrenches.size() > 40; }))
      << driver.output();
  const Matrix6 stiffness = couplingStiffness(loadMechanism(scenario).coupling);
  int compared = 0;
  for (const auto& d : displacements.all()) {
    for (const auto& w : wrenches.all()) {
      if (w->sequence != d->sequence) continue;
      ASSERT_EQ(w->wrench.size(), d->displacement.size());
      const Vector6 load = Vector6::Map(w->wrench.data());
      const Vector6 back = stiffness * Vector6::Map(d->displacement.data());
      EXPECT_LT((back - load).norm(), 1e-9 * load.norm());
      ++compared;
    }
  }
  EXPECT_GT(compared, 10);
}

// A device above the sensor's origin, whose x points along the sensor's y.
TEST_F(SensorSources, TakesTheWrenchesOfADeviceToItsFrame) {
  Record<WrenchSamples> wrenches(nh_, "/placed/wrench_samples");
  const std::vector<double> quarter_turn = {0.0, 0.0, M_PI / 2.0};
  const std::vector<double> above = {0.0, 0.0, 0.5};
  ros::param::set("/placed/driver/device_rotation", quarter_turn);
  ros::param::set("/placed/driver/device_position", above);
  Driver driver("placed",
                {"_source/type:=assembly_cell_example_source/Counting", "_source/rate:=500.0",
                 "_source/first:=7"},
                withExample());
  ASSERT_TRUE(waitFor([&] { return wrenches.size() > 40; })) << driver.output();
  for (const auto& block : wrenches.all()) {
    const Vector6 w = Vector6::Map(block->wrench.data());
    EXPECT_GE(w[1], 7.0);
    const Vector6 expected = w[1] * (Vector6::Unit(1) - 0.5 * Vector6::Unit(3));
    EXPECT_LT((w - expected).norm(), 1e-12 * w[1]);
  }
  ros::param::del("/placed");
}

TEST_F(SensorSources, RefusesWithOneLine) {
  const std::string plugin = "_source/type:=assembly_cell_example_source/Counting";
  const std::string missing = "_source/type:=assembly_cell_example_source/Missing";
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      // the known types are named, those of other packages too
      {{"_source/type:=telepathy"}, "give one of bag, simulated, replay, netft, serial, iio"},
      {{missing}, "assembly_cell_example_source/Counting"},
      {{plugin, "_source/rat:=5"}, "rat"},
      {{plugin, "_source/rate:=-5.0"}, "rate"},
      {{plugin, "_publish_displacement:=true"}, "set scenario"},
      {{plugin, "_publish_displacement:=true", "_scenario:=/none.yaml"}, "/none.yaml"},
      {{plugin, "_scenario:=" + sourceFile("config/scenarios/cell.yaml")},
       "with publish_displacement false"},
      {{"_source/type:=netft"}, "address"},
      {{"_source/type:=netft", "_source/address:=192.168.1.300"}, "192.168.1.300"},
      {{"_source/type:=bag"}, "file"},
      {{"_source/type:=bag", "_source/file:=/none.bag"}, "/none.bag"},
      {{"_source/type:=bag", "_source/file:=" + sourceFile("package.xml")}, "package.xml"},
      {{"_source/address:=1.2.3.4"}, "/refused/driver/source/type"},
      {{"_source/type:=simulated", "_lockstep:=true"}, "/refused/driver/lockstep"},
      {{"_source/type:=simulated", "_queue_size:=1"}, "/refused/driver/queue_size"},
      {{plugin, "_device_rotation:=180"}, "/refused/driver/device_rotation"},
  };
  for (const auto& [parameters, part] : cases) {
    ros::param::del("/refused");
    Driver driver("refused", parameters, withExample());
    EXPECT_EQ(driver.wait(), 1) << parameters[0];
    EXPECT_TRUE(has(driver.output(), part)) << driver.output();
    EXPECT_EQ(std::count(driver.output().begin(), driver.output().end(), '\n'), 1)
        << driver.output();
  }
  ros::param::del("/refused");
}

// The strain of a bag goes through the driver to the last bit, on its own time base, block by
// block; what was lost when it was recorded shows as a gap.
TEST_F(SensorSources, PlaysTheStrainOfABag) {
  const test::TemporaryFolder folder;
  const std::string file = folder.path() + "/strain.bag";
  std::vector<StrainSamples> blocks;
  {
    rosbag::Bag bag(file, rosbag::bagmode::Write);
    double time = 1.7e9 + 0.123456789;
    for (std::uint32_t sequence : {10u, 11u, 12u, 14u, 15u}) {
      // one block larger than a source's
      const std::size_t samples = sequence == 12 ? 700 : 100;
      if (sequence == 14) time += 100 * 2e-4;  // block 13
      blocks.push_back(strainBlock(sequence, samples, time));
      bag.write("/cell/sensor_a/strain", ros::Time(time + 0.02), blocks.back());
      time += 2e-4 * static_cast<double>(samples);
    }
    StrainSamples broken = strainBlock(16, 100, time);
    broken.volts.pop_back();
    bag.write("/cell/sensor_a/strain", ros::Time(time + 0.02), broken);
  }
  Record<StrainSamples> strain(nh_, "/bag/strain");
  Record<WrenchSamples> wrench(nh_, "/bag/wrench_samples");
  Driver driver("bag", {"_source/type:=bag", "_source/file:=" + file, "_source/rate:=fast",
                        "_calibration_file:=" + sourceFile(kCalibration)});
  // 700 samples make two blocks
  ASSERT_TRUE(waitFor([&] { return strain.size() == 6 && wrench.size() == 6; }))
      << driver.output() << strain.size();
  const Calibration calibration = loadCalibration(sourceFile(kCalibration));
  std::vector<double> volts, expected;
  for (const auto& block : blocks) {
    expected.insert(expected.end(), block.volts.begin(), block.volts.end());
  }
  for (std::size_t i = 0; i < 6; ++i) {
    const auto s = strain.all()[i];
    const auto w = wrench.all()[i];
    volts.insert(volts.end(), s->volts.begin(), s->volts.end());
    EXPECT_EQ(s->temperature, 21.5);
    for (std::size_t k = 0; k < s->saturated.size(); ++k) {
      const Vector6 v = Vector6::Map(&s->volts[6 * k]);
      ASSERT_EQ(Vector6(Vector6::Map(&w->wrench[6 * k])), wrenchFromVolts(calibration, v));
    }
  }
  EXPECT_EQ(volts, expected);
  const std::size_t first[] = {0, 1, 2, 4, 5};  // of each recorded block
  for (std::size_t i = 0; i < 5; ++i) {
    // a double of seconds rounds stamps of the present to some hundred nanoseconds; these are exact
    EXPECT_NEAR((strain.all()[first[i]]->header.stamp - blocks[i].header.stamp).toSec(), 0.0, 1e-9);
  }
  EXPECT_TRUE(diagnoses_.await("bag/driver: device", [](const auto& s) {
    return value(s, "state") == "ended" && number(s, "lost samples") == 100 &&
           number(s, "malformed frames") == 1;
  })) << diagnoses_.latest("bag/driver: device").message;
  EXPECT_TRUE(diagnoses_.await(
      "bag/driver: samples", [](const auto& s) { return s.message == "the recording has ended"; }));
}

// A code for a fault and an end of a device's numbers, as recordings of sensors have them: handed
// on with a mark and reported, so that they are not taken for a load.
TEST_F(SensorSources, MarksWhatNoSensorMeasures) {
  const test::TemporaryFolder folder;
  const std::string file = folder.path() + "/codes.csv";
  {
    std::ofstream rows(file);
    rows << "t,fx,fy,fz,tx,ty,tz\n";
    for (int i = 0; i < 50; ++i) {
      rows << 0.01 * i << ",1,2," << (i == 20 ? "-99999" : "3") << ",0.1,"
           << (i == 30 ? "2147483647" : "0.2") << ",0.3\n";
    }
  }
  Record<WrenchSamples> wrench(nh_, "/codes/wrench_samples");
  // a command line can't give a list
  ros::param::set("/codes/driver/source/columns",
                  std::vector<std::string>{"t", "fx", "fy", "fz", "tx", "ty", "tz"});
  Driver driver("codes", {"_source/type:=replay", "_source/file:=" + file, "_source/rate:=fast",
                          "_source/loop:=false"});
  const auto marks = [&] {
    std::vector<int> all;
    for (const auto& block : wrench.all()) {
      all.insert(all.end(), block->saturated.begin(), block->saturated.end());
    }
    return all;
  };
  ASSERT_TRUE(waitFor([&] { return marks().size() >= 50; })) << driver.output();
  std::vector<int> expected(50, 0);
  expected[20] = 1 << 2;
  expected[30] = 1 << 4;
  EXPECT_EQ(marks(), expected);
  EXPECT_TRUE(diagnoses_.await("codes/driver: samples", [](const auto& s) {
    return value(s, "saturated samples") == "2";
  })) << diagnoses_.latest("codes/driver: samples").message;
}

// A bag keeps its own pace, stamped with the present.
TEST_F(SensorSources, PlaysABagAtItsOwnPace) {
  const test::TemporaryFolder folder;
  const std::string file = folder.path() + "/strain.bag";
  {
    rosbag::Bag bag(file, rosbag::bagmode::Write);
    for (std::uint32_t i = 0; i < 300; ++i) {
      bag.write("/strain", ros::Time(100 + 0.02 * i), strainBlock(i, 100, 100 + 0.02 * i));
    }
  }
  Record<WrenchSamples> wrench(nh_, "/pace/wrench_samples");
  const ros::Time start = ros::Time::now();
  Driver driver("pace", {"_source/type:=bag", "_source/file:=" + file, "_source/topic:=/strain",
                         "_calibration_file:=" + sourceFile(kCalibration)});
  ASSERT_TRUE(waitFor([&] { return wrench.size() > 0; })) << driver.output();
  ASSERT_TRUE(waitFor([&] { return wrench.last()->sequence == 299; }));
  // stamped since the start, the last one no earlier than it came: played at once it would be from
  // a second later
  const ros::Time end = ros::Time::now();
  const auto all = wrench.all();
  EXPECT_GT(all[0]->header.stamp, start);
  EXPECT_LT(all.back()->header.stamp, end);
  for (std::size_t i = 1; i < all.size(); ++i) {
    EXPECT_NEAR((all[i]->header.stamp - all[i - 1]->header.stamp).toSec(), 0.02, 1e-6);
  }
  EXPECT_LT((ros::Time::now() - all.back()->header.stamp).toSec(), kPatience);
}

// A recording is played as it is, also where its sensor was frozen; that is reported.
TEST_F(SensorSources, PlaysFrozenReadingsAndReportsThem) {
  const test::TemporaryFolder folder;
  const std::string file = folder / "frozen.csv";
  {
    std::ofstream out(file);
    out << "t,fx,fy,fz,tx,ty,tz\n";
    for (int i = 0; i < 1000; ++i) out << 0.01 * i << ",1,2,3,0.1,0.2,0.3\n";
  }
  Record<WrenchSamples> wrench(nh_, "/still/wrench_samples");
  Driver driver("still", {"_source/type:=replay", "_source/file:=" + file});
  ASSERT_TRUE(diagnoses_.await("still/driver: samples", [](const auto& s) {
    return s.level == diagnostic_msgs::DiagnosticStatus::ERROR && has(s.message, "frozen readings");
  })) << driver.output();
  const std::size_t before = wrench.size();
  EXPECT_TRUE(waitFor([&] { return wrench.size() > before; }));
}

// The generator of strain needs neither a simulator nor a device.
TEST_F(SensorSources, GeneratesStrain) {
  Record<WrenchSamples> wrench(nh_, "/generated/wrench_samples");
  // a command line can't give a list
  ros::param::set("/generated/driver/source/load", std::vector<double>{1, 2, 10, 0, 0, 0});
  Driver driver("generated", {"_source/type:=simulated", "_source/bridge:=a", "_source/noise:=0.0",
                              "_calibration_file:=" + sourceFile(kCalibration)});
  ASSERT_TRUE(waitFor([&] { return wrench.size() > 5; })) << driver.output();
  // a code of 16 bits through the matrix is some hundredths of a newton
  const auto block = wrench.last();
  EXPECT_NEAR(block->wrench[0], 1.0, 0.1);
  EXPECT_NEAR(block->wrench[1], 2.0, 0.1);
  EXPECT_NEAR(block->wrench[2], 10.0, 0.1);
}

}  // namespace
}  // namespace assembly_cell::test::sensor_sources_test
