// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// Calibration files of ATI: made-up numbers in the form of such a file.
#include "assembly_cell/sensor/ati_calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

// rows of Axis as ATI makes them: UserAxis times scale, without the transform
std::string file() {
  return R"(<?xml version="1.0" encoding="utf-8"?>
<!-- NOTE: To parse this file for your own software, use the "UserAxis" elements -->
<FTSensor  Serial="FT00017" BodyStyle="Mini40" Family="DAQ" NumGages="6" CalFileVersion="1.1">
	<Calibration  PartNumber="SI-40-2" CalDate="3/14/2024" ForceUnits="N" TorqueUnits="N-m" DistUnits="m" OutputMode="Ground Referenced Differential" OutputRange="20" HWTempComp="True" GainMultiplier="1" CableLossDetection="False" OutputBipolar="True">
		<Axis Name="Fx" values=" 99 0 0 0 0 0 " max="40" scale="2.5"/>
		<BasicTransform Dx="0" Dy="0" Dz="0.005" Rx="0" Ry="0" Rz="0"/>
		<UserAxis Name="Fx" values="  0.05 -0.25  1.50 -13.00  0.10 12.75 " max="40"/>
		<UserAxis Name="Fy" values=" -0.75 16.00 -0.20 -7.50 0.30 -7.25 " max="40"/>
		<UserAxis Name="Fz" values=" 20.00 0.30 20.50 -0.10 19.75 0.20 " max="120"/>
		<UserAxis Name="Tx" values=" 0.005 0.10 -0.36 -0.04 0.36 -0.06 " max="2"/>
		<UserAxis Name="Ty" values=" 0.42 -0.007 -0.20 0.09 -0.21 -0.08 " max="2"/>
		<UserAxis Name="Tz" values=" 0.01 -0.22 0.012 -0.215 0.006 -0.221 " max="2"/>
	</Calibration>
</FTSensor>
)";
}

std::string changed(const std::string& from, const std::string& to) {
  std::string text = file();
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

std::string refusal(const std::string& xml) {
  try {
    parseAtiCalibration(xml, "file 'x'");
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(AtiCalibration, ReadsTheRowsForUsers) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "FT00017.cal";
  for (const char* mark : {"", "\xef\xbb\xbf"}) {
    std::ofstream(path) << mark << file();
    const Calibration c = loadCalibration(path);
    EXPECT_EQ(c.serial_number, "FT00017");
    EXPECT_EQ(c.id, "ATI SI-40-2 FT00017");
    EXPECT_EQ(c.date, "3/14/2024");
    // by hand: 1 V at gauges 3 and 6
    Vector6 volts = Vector6::Zero();
    volts[2] = volts[5] = 1.0;
    const Vector6 w = wrenchFromVolts(c, volts);
    Vector6 expected;
    expected << 14.25, -7.45, 20.70, -0.42, -0.28, -0.209;
    EXPECT_LE((w - expected).cwiseAbs().maxCoeff(), 1e-12);
  }
}

TEST(AtiCalibration, ConvertsItsUnits) {
  const Calibration si = parseAtiCalibration(file(), "");
  const Calibration c = parseAtiCalibration(
      changed("ForceUnits=\"N\" TorqueUnits=\"N-m\"", "ForceUnits=\"lbf\" TorqueUnits=\"lbf-in\""),
      "");
  // 1 lbf is 4.4482216152605 N, 1 in is 0.0254 m
  EXPECT_NEAR(c.volts_to_wrench(0, 3), 4.4482216152605 * si.volts_to_wrench(0, 3), 1e-9);
  EXPECT_NEAR(c.volts_to_wrench(4, 0), 0.0254 * 4.4482216152605 * si.volts_to_wrench(4, 0), 1e-12);
}

TEST(AtiCalibration, NamesWhatIsWrong) {
  const std::pair<std::string, std::string> cases[] = {
      {"<a/>", "its root is 'a' instead of FTSensor"},
      {"<FTSensor Serial=\"1\">", "malformed XML"},
      {"<FTSensor Serial=\"1\"/>", "has no Calibration"},
      {changed("UserAxis Name=\"Tz\"", "Axis Name=\"Tz\""), "has no UserAxis Tz"},
      {changed("UserAxis Name=\"Ty\"", "UserAxis Name=\"Tx\""), "UserAxis Tx is there twice"},
      {changed("-0.215 0.006", "0.006"), "UserAxis Tz has 5 values"},
      {changed("-0.215 0.006", "nan 0.006"), "UserAxis Tz: value 4 is 'nan'"},
      {changed("TorqueUnits=\"N-m\"", "TorqueUnits=\"stone\""), "TorqueUnits is 'stone'"},
      {changed("ForceUnits=\"N\"", ""), "ForceUnits is ''"},
      {changed("GainMultiplier=\"1\"", "GainMultiplier=\"2\""), "GainMultiplier is '2'"},
      {changed("Serial=\"FT00017\"", ""), "has no Serial"},
      {changed("-0.25  1.50 -13.00  0.10 12.75", "0 0 0 0 0"), "accepted"},
      {changed("0.05 -0.25  1.50 -13.00  0.10 12.75", "0 0 0 0 0 0"), "singular"},
  };
  for (const auto& [xml, words] : cases) {
    const std::string line = refusal(xml);
    EXPECT_NE(line.find(words), std::string::npos) << line;
    EXPECT_EQ(line.find('\n'), std::string::npos) << line;
  }
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "<a>";
  EXPECT_NE(refusal(deep).find("malformed XML"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
