// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// mechanism.yaml there and back, what is refused of it, and the tool that writes it.
#include <gtest/gtest.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/identification/mechanism_record.h"
#include "tool_run.h"

namespace assembly_cell {
namespace {

const std::string kCell = ASSEMBLY_CELL_SOURCE_DIR "/config/scenarios/cell.yaml";

// a finding without a cell: numbers that are all different
Identification finding(const Mechanism& nominal) {
  Identification found;
  found.unknowns = unknownsAsDrawn();
  UnknownMatrix root = 0.1 * UnknownMatrix::Identity();
  for (int i = 0; i < kUnknowns; ++i) {
    found.z[i] = std::sin(1.0 + i);
    for (int k = 0; k < i; ++k) root(i, k) = 0.02 * std::cos(1.0 + i * k);
  }
  found.covariance = root * root.transpose();
  found.model = modelAt(nominal, found.unknowns, found.z);
  found.accepted = true;
  found.verdict = "accepted";
  found.condition = 12.0;
  found.unseen = {kFriction};
  found.correlated = {{1, 2, 0.9}};
  found.notes = {"push: the peg did not slide"};
  return found;
}

class MechanismFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("mechanism_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "mechanism.yaml").string();
    saveMechanism(nominal_, found_, "a test", "2026-01-12", path_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string text() const {
    std::ifstream file(path_);
    std::stringstream all;
    all << file.rdbuf();
    return all.str();
  }
  // the refusal after a change, "" for none
  std::string refusal(const std::string& what, const std::string& with) const {
    std::string changed = text();
    const std::size_t at = changed.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    changed.replace(at, what.size(), with);
    const std::string path = (folder_ / "changed.yaml").string();
    std::ofstream(path) << changed;
    try {
      loadKnownMechanism(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

  const Mechanism nominal_ = loadMechanism(kCell, {"coupling.axes=carrier"});
  const Identification found_ = finding(nominal_);
  std::filesystem::path folder_;
  std::string path_;
};

TEST_F(MechanismFile, ComesBack) {
  const KnownMechanism known = loadKnownMechanism(path_), expected = knownFrom(found_);
  EXPECT_TRUE(known.identified && known.accepted);
  EXPECT_EQ(known.verdict, "accepted");
  EXPECT_EQ(known.unseen, std::vector<std::string>{"friction"});
  EXPECT_LT((known.covariance - expected.covariance).cwiseAbs().maxCoeff(), 1e-12);
  const UnknownVector zero = UnknownVector::Zero();
  const MechanismModel back = modelAt(known.mechanism, known.unknowns, zero);
  EXPECT_LT((unknownsOf(nominal_, found_.unknowns, back) - found_.z).norm(), 1e-9);
  for (std::size_t i = 0; i < kUnknowns; ++i) {
    EXPECT_NEAR(known.unknowns[i].sd, expected.unknowns[i].sd, 1e-12 * expected.unknowns[i].sd);
  }
  EXPECT_EQ(known.drive.gain, found_.model.drive.gain);
  EXPECT_EQ(known.drive.delay, found_.model.drive.delay);
}

TEST_F(MechanismFile, IsAMechanismForWhoKnowsNoIdentification) {
  const Mechanism m = loadMechanism(path_);
  EXPECT_EQ(m.coupling.axes, CouplingAxes::kCarrier);
  EXPECT_EQ(m.coupling.stiffness.diagonal, found_.model.mechanism.coupling.stiffness.diagonal);
  EXPECT_EQ(m.coupling.stiffness.k26, found_.model.mechanism.coupling.stiffness.k26);
  EXPECT_EQ(m.peg.inertia_axial, found_.model.mechanism.peg.inertia_axial);
  EXPECT_EQ(m.friction.static_coefficient, found_.model.mechanism.friction.static_coefficient);
  EXPECT_EQ(m.hole.depth, nominal_.hole.depth);
}

TEST_F(MechanismFile, ScenarioIsAsDrawn) {
  const KnownMechanism known = loadKnownMechanism(kCell);
  EXPECT_FALSE(known.identified);
  EXPECT_EQ(known.mechanism.peg.mass, nominal_.peg.mass);
  EXPECT_EQ(known.covariance, UnknownMatrix(UnknownMatrix::Identity()));
}

TEST_F(MechanismFile, RefusesWhatIsNone) {
  EXPECT_NE(refusal("assembly_cell mechanism 1", "assembly_cell mechanism 9").find("format"),
            std::string::npos);
  EXPECT_NE(refusal("  origin:", "  ogirin:").find("origin"), std::string::npos);
  EXPECT_NE(refusal("\"peg.mass\"", "\"peg.mess\"").find("peg.mess"), std::string::npos);
  EXPECT_NE(refusal("  accepted: true", "  accepted: perhaps").find("accepted"), std::string::npos);
  EXPECT_NE(refusal("  notes:", "  more: 1\n  notes:").find("more"), std::string::npos);
  EXPECT_NE(refusal("    - [1.0, ", "    - [0.5, ").find("correlation"), std::string::npos);
  EXPECT_NE(refusal("    - [1.0, ", "    - [1.0, 0.0, ").find("correlation"), std::string::npos);
  // changed by hand: the mechanism's key and what was identified don't agree
  const std::string by_hand = refusal("  mass: ", "  mass: 1");
  EXPECT_NE(by_hand.find("parameters"), std::string::npos) << by_hand;
  EXPECT_NE(by_hand.find("identify again"), std::string::npos) << by_hand;
}

using test::runTool;
using test::ToolRun;

TEST_F(MechanismFile, ToolWritesWhatAlignTakes) {
  const std::string level = ASSEMBLY_CELL_SOURCE_DIR "/config/mismatch/level_2.yaml";
  const std::string out = (folder_ / "found.yaml").string();
  const std::string readings = (folder_ / "readings.csv").string();
  const ToolRun found = runTool("identify " + kCell + " --mismatch " + level + " --seed 4 --out " +
                                out + " --readings " + readings);
  ASSERT_EQ(found.code, 0) << found.error;
  const YAML::Node result = YAML::Load(found.out.substr(found.out.find("verdict:")));
  EXPECT_TRUE(result["accepted"].as<bool>());
  EXPECT_EQ(result["parameters"].size(), static_cast<std::size_t>(kUnknowns));
  EXPECT_TRUE(result["truth"]["peg.mass"]);
  EXPECT_TRUE(loadKnownMechanism(out).identified);
  EXPECT_GT(std::filesystem::file_size(readings), 1000u);
  // another cell's: refused by name, with nothing pressed
  const ToolRun other =
      runTool("align " + kCell + " --seed 9 --mismatch " + level + " --mechanism " + out);
  EXPECT_EQ(other.code, 1);
  EXPECT_NE(other.out.find("reason: \"wrong_mechanism: "), std::string::npos) << other.out;
  EXPECT_NE(other.out.find("contacts: 0\n"), std::string::npos);
}

TEST_F(MechanismFile, ToolsRefuseBadInput) {
  EXPECT_EQ(runTool("identify --help").code, 0);
  for (const char* bad :
       {"identify", "identify /nowhere.yaml", "identify CELL --runs 0", "identify CELL --bits 11",
        "identify CELL --runs 2 --out x.yaml", "align CELL --mechanism /nowhere.yaml",
        "align CELL --mechanism CELL --identify"}) {
    std::string arguments = bad;
    for (std::size_t at; (at = arguments.find("CELL")) != std::string::npos;) {
      arguments.replace(at, 4, kCell);
    }
    const ToolRun outcome = runTool(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments << "\n" << outcome.error;
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(std::count(outcome.error.begin(), outcome.error.end(), '\n'), 1) << outcome.error;
  }
  // refused by its own data
  std::string refused = text();
  refused.replace(refused.find("accepted: true"), 14, "accepted: false");
  const std::string path = (folder_ / "refused.yaml").string();
  std::ofstream(path) << refused;
  const ToolRun outcome = runTool("align " + kCell + " --mechanism " + path);
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.error.find("--mechanism"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
