// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// A file of another kind than wanted is refused as such, in one line, by each reader.

#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <map>
#include <string>

#include "assembly_cell/arm/arm_settings.h"
#include "assembly_cell/arm/cell_place.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/calibration/observations/observation.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/scene/scenario.h"
#include "assembly_cell/sensor/calibration.h"
#include "assembly_cell/study/study.h"
#include "assembly_cell/twin_force/contacts_file.h"
#include "temporary_folder.h"

namespace assembly_cell {
namespace {

const std::string kFolder = ASSEMBLY_CELL_SOURCE_DIR "/";

struct Kind {
  std::string file;
  std::function<void(const std::string&)> read;  // nullptr: only inside another file
};

class WrongFiles : public ::testing::Test {
 protected:
  WrongFiles() {
    std::ofstream(observations_) << "format: assembly_cell observations 1\nobservations:\n";
    // a scenario's mechanism with what identify adds
    const std::string mechanism = R"(gravity: 9.81
peg: {}
hole: {}
carrier: {}
coupling: {}
friction: {}
identification: {format: assembly_cell identified mechanism 1}
)";
    std::ofstream(mechanism_) << mechanism;
  }

  std::string message(const std::function<void(const std::string&)>& read,
                      const std::string& file) const {
    try {
      read(file);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }

  const test::TemporaryFolder folder_;
  const std::string observations_ = folder_.path() + "/tests.yaml";
  const std::string mechanism_ = folder_.path() + "/mechanism.yaml";
  const std::map<std::string, Kind> kinds_ = {
      {"a scenario", {kFolder + "config/scenarios/cell.yaml", [](auto& f) { loadScenario(f); }}},
      {"a mechanism", {mechanism_, [](auto& f) { loadKnownMechanism(f); }}},
      {"a calibration",
       {kFolder + "config/calibration/sensor_b.yaml", [](auto& f) { loadCalibration(f); }}},
      {"a file of observations", {observations_, [](auto& f) { readObservations(f); }}},
      {"a study", {kFolder + "config/studies/sliding.yaml", [](auto& f) { loadStudy(f, {}); }}},
      {"a file of contacts",
       {kFolder + "config/contacts/peg_on_rim.yaml", [](auto& f) { loadContacts(f); }}},
      {"the place of a cell before an arm",
       {kFolder + "config/arm/cell_place.yaml", [](auto& f) { loadCellPlace(f); }}},
      {"an arm with its bridge",
       {kFolder + "config/arm/emulated.yaml", [](auto& f) { loadArmSetup(f); }}},
      {"parameters of arm_bridge", {kFolder + "config/arm/arm_bridge.yaml", nullptr}},
      {"parameters of emulate_arm", {kFolder + "config/arm/emulate_arm.yaml", nullptr}},
      {"a mismatch", {kFolder + "config/mismatch/level_2.yaml", [](auto& f) { loadMismatch(f); }}},
      {"the parameters of a force_sensor_driver", {kFolder + "config/sensor_iio.yaml", nullptr}},
      {"the parameters of a node", {kFolder + "config/supervisor.yaml", nullptr}},
      {"XML", {kFolder + "urdf/cell.urdf", nullptr}}};
};

TEST_F(WrongFiles, AreNamedWithWhatIsWanted) {
  for (const auto& [wanted, reader] : kinds_) {
    if (!reader.read) continue;
    for (const auto& [given, other] : kinds_) {
      const std::string said = message(reader.read, other.file);
      const bool good = given == wanted || (wanted == "a mechanism" && given == "a scenario");
      EXPECT_EQ(said.find("looks like " + given) != std::string::npos, !good) << said;
      if (good) continue;
      EXPECT_NE(said.find("give " + wanted + " here"), std::string::npos) << said;
      EXPECT_NE(said.find(other.file), std::string::npos) << said;
      EXPECT_EQ(said.find('\n'), std::string::npos) << said;
    }
  }
}

// the bridge's and the arm's own parameters stand in files that the arm's file names
TEST_F(WrongFiles, AreNamedInsideAnArmsFile) {
  const std::string arm = folder_.path() + "/arm.yaml", config = kFolder + "config/arm/";
  for (const std::string key : {"bridge", "arm"}) {
    std::ofstream(arm) << "format: 1\nurdf: " << kFolder << "urdf/arm.urdf\nplace: " << config
                       << "cell_place.yaml\nbridge: " << config
                       << (key == "bridge" ? "emulate_arm.yaml" : "arm_bridge.yaml")
                       << "\narm: " << config << "arm_bridge.yaml\n";
    const std::string said = message([](auto& f) { loadArmSetup(f); }, arm);
    const std::string wanted = key == "bridge" ? "arm_bridge" : "emulate_arm";
    EXPECT_NE(said.find("give parameters of " + wanted + " here"), std::string::npos) << said;
  }
}

// wrong content is still refused by its key
TEST_F(WrongFiles, KeysAreNamedWhereTheKindIsRight) {
  const std::string file = folder_.path() + "/cell.yaml";
  std::ifstream in(kFolder + "config/scenarios/cell.yaml");
  std::string text{std::istreambuf_iterator<char>(in), {}};
  text.replace(text.find("\nduration:"), 1, "\nscale: {}\n");
  std::ofstream(file) << text;
  EXPECT_NE(message([](auto& f) { loadScenario(f); }, file).find("scale: value"),
            std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
