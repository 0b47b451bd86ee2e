// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool estimate_pose: keys, exit codes, bad input; the contacts file there and back.
#include <gtest/gtest.h>
#include <stdlib.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include "assembly_cell/twin_force/contacts_file.h"
#include "ground_truth.h"
#include "tool_run.h"

namespace assembly_cell {
namespace {

using namespace twin_truth;

using test::ToolRun;

class EstimatePose : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_ / name; }
  std::string write(const std::string& text) const {
    std::ofstream(path("contacts.yaml")) << text;
    return path("contacts.yaml");
  }

  ToolRun run(const std::string& arguments) const {
    return test::runTool("estimate_pose " + arguments);
  }

  void refused(const std::string& arguments, const std::string& part) const {
    const ToolRun r = run(arguments);
    EXPECT_EQ(r.code, 2) << arguments;
    EXPECT_EQ(r.out, "");
    EXPECT_EQ(std::count(r.error.begin(), r.error.end(), '\n'), 1) << r.error;
    EXPECT_NE(r.error.find(part), std::string::npos) << r.error;
  }

  test::TemporaryFolder folder_;
};

Scene scene() {
  Scene s = begin("tool", rotation({0.1, 0.2, -0.3}), {0.01, -0.02, 0.03});
  press(s, {0.03, 0.05, 0.02}, {2, -1, -20}, {rotation({0.1, 0.2, -0.3}), {0.02, -0.01, 0.03}});
  press(s, {-0.02, -0.01, 0.05}, {-15, 3, -12});
  press(s, {0.01, -0.04, 0.03}, {4, 14, -14}, {rotation({-0.4, 0.1, 0.2}), {-0.01, 0.02, 0}});
  return s;
}

const std::vector<std::string> kKeys = {"status",
                                        "position",
                                        "quaternion",
                                        "covariance",
                                        "chi2",
                                        "dof",
                                        "information_eigenvalues",
                                        "weak_direction",
                                        "rejected",
                                        "next_contact"};

TEST_F(EstimatePose, PrintsEveryKey) {
  ContactsFile file;
  file.contacts = measure(scene());
  write(contactsYaml(file));
  for (const char* method : {"", " --method ml", " --method robust", " --method thesis"}) {
    const ToolRun r = run(path("contacts.yaml") + method);
    ASSERT_EQ(r.code, 0) << r.error << r.out;
    const YAML::Node y = YAML::Load(r.out);
    for (const std::string& key : kKeys) EXPECT_TRUE(y[key].IsDefined()) << key;
    EXPECT_EQ(y["status"].as<std::string>(), "OK");
    // the quaternion of the moves is unit to rounding
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(y["position"][i].as<double>(), scene().X_AB.p[i], 1e-12) << method;
    }
    const auto q = y["quaternion"].as<std::vector<double>>();
    const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
    EXPECT_LT((turn.toRotationMatrix() - scene().X_AB.R).cwiseAbs().maxCoeff(), 1e-12);
    EXPECT_EQ(y["covariance"].size(), 36u);
    EXPECT_GT(y["covariance"][0].as<double>(), 0.0);
    EXPECT_EQ(y["dof"].as<int>(), 12);
    EXPECT_EQ(y["rejected"].size(), 0u);
    EXPECT_EQ(y["information_eigenvalues"].size(), 6u);
  }
}

TEST_F(EstimatePose, DegenerateAndRefused) {
  Scene parallel = begin("parallel", Matrix3d::Identity(), {0.01, 0.02, 0});
  press(parallel, {0, 0.03, 0.02}, {0, 0, -20});
  press(parallel, {0, -0.03, 0.02}, {0, 0, -20});
  ContactsFile file;
  file.contacts = measure(parallel);
  ToolRun r = run(write(contactsYaml(file)));
  ASSERT_EQ(r.code, 0) << r.error;
  YAML::Node y = YAML::Load(r.out);
  EXPECT_EQ(y["status"].as<std::string>(), "DEGENERATE");
  EXPECT_TRUE(std::isinf(y["covariance"][14].as<double>()));
  EXPECT_TRUE(std::isfinite(y["covariance"][0].as<double>()));
  EXPECT_EQ(y["null_directions"].size(), 1u);
  EXPECT_TRUE(y["next_contact"].IsMap());
  // a prior of 10 mm and 0.1 rad: weak, with variance 1e-4 along the lines
  file.prior = defaultPrior({});
  y = YAML::Load(run(write(contactsYaml(file))).out);
  EXPECT_EQ(y["status"].as<std::string>(), "WEAK");
  EXPECT_NEAR(y["covariance"][14].as<double>(), 1e-4, 1e-9);
  file.prior.reset();

  const auto fails = [&](const std::string& status, const std::string& options = "") {
    const ToolRun f = run(write(contactsYaml(file)) + options);
    EXPECT_EQ(f.code, 1) << f.out << f.error;
    const YAML::Node z = YAML::Load(f.out);
    EXPECT_EQ(z["status"].as<std::string>(), status);
    for (const std::string& key : kKeys) EXPECT_TRUE(z[key].IsDefined()) << key;
    EXPECT_TRUE(z["position"].IsNull());
    EXPECT_TRUE(z["covariance"].IsNull());
  };
  fails("REFUSE_SINGULAR", " --method thesis");
  file.contacts[0].wrench_a[0] += 5;
  fails("REFUSE_INCONSISTENT");
  file.contacts[0].saturated = true;
  fails("REFUSE");
  file.contacts.resize(1);
  file.contacts[0].saturated = false;
  fails("REFUSE_TOO_FEW");
  file.contacts.clear();
  fails("REFUSE_TOO_FEW");
}

TEST_F(EstimatePose, FileThereAndBack) {
  std::mt19937_64 random(1);
  ContactsFile file;
  file.contacts = measure(scene(), &random);
  file.contacts[1].move_covariance = noise(1e-3, 1e-2);
  file.contacts[2].tare_age = 3.5;
  file.prior = defaultPrior({rotation({0.1, 0, 0}), {0, 0, 0.01}});
  file.tare_covariance = Matrix12(1e-4 * Matrix12::Identity());
  file.candidates = defaultCandidates(file.contacts);
  const ContactsFile read = parseContacts(contactsYaml(file), "text");
  ASSERT_EQ(read.contacts.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read.contacts[i].wrench_a, file.contacts[i].wrench_a);
    EXPECT_EQ(read.contacts[i].covariance_b, file.contacts[i].covariance_b);
    EXPECT_LT((read.contacts[i].move.R - file.contacts[i].move.R).norm(), 1e-15);
  }
  EXPECT_EQ(*read.contacts[1].move_covariance, *file.contacts[1].move_covariance);
  EXPECT_EQ(read.contacts[2].tare_age, 3.5);
  EXPECT_EQ(*read.tare_covariance, *file.tare_covariance);
  EXPECT_EQ(read.candidates.size(), file.candidates.size());
  const ToolRun r = run(write(contactsYaml(file)));
  ASSERT_EQ(r.code, 0) << r.error;
  EXPECT_EQ(YAML::Load(r.out)["tare"].size(), 12u);
  EXPECT_FALSE(YAML::Load(r.out)["next_contact"]["candidate"].IsNull());
}

TEST_F(EstimatePose, RefusesBadInput) {
  ContactsFile file;
  file.contacts = measure(scene());
  const std::string good = contactsYaml(file);
  const auto replaced = [&](const std::string& from, const std::string& to, std::size_t nth) {
    std::string text = good;
    std::size_t at = text.find(from);
    for (; nth > 0; --nth) at = text.find(from, at + 1);
    return write(text.replace(at, from.size(), to));
  };
  refused("", "give a file of contacts");
  refused("/nowhere.yaml", "/nowhere.yaml");
  refused(std::filesystem::temp_directory_path().string(), "missing or unreadable");
  refused("/dev/zero", "give a YAML file with contacts");
  refused(write(good) + " --method best", "--method: value best");
  refused(write(good) + " --position -1", "--position: value -1");
  refused(write(good) + " --frobnicate", "unknown option");
  refused(write(""), "file: value");
  refused(write("contacts: [1"), "not YAML");
  refused(write("contacts: 3"), "contacts: value 3");
  refused(write("points: []"), "points: value a list of 0: unknown key");
  refused(write("prior: {}"), "contacts: value missing");
  refused(replaced("covariance_b: [0.0025", "covariance_b: [.nan", 2),
          "contacts[2].covariance_b[0]");
  refused(replaced("covariance_b: [0.0025", "covariance_b: [-0.0025", 2),
          "contacts[2].covariance_b: value indefinite");
  refused(replaced("covariance_a: [0.0025000000000000005, 0.0", "covariance_a: [0.0025, 0.001", 0),
          "contacts[0].covariance_a: value asymmetric");
  refused(replaced("wrench_a: [", "wrench_a: [1.0, ", 1),
          "contacts[1].wrench_a: value a list of 7");
  refused(replaced("wrench_b: [", "wrench_b: [x, ", 1), "contacts[1].wrench_b");
  refused(replaced("    move: ", "    mov: ", 0), "contacts[0].mov");
  refused(replaced("quaternion: [", "quaternion: [1.5, 0, 0, 0], junk: [", 0),
          "contacts[0].move.junk");
}

TEST_F(EstimatePose, HelpHasAnExampleThatWorks) {
  const ToolRun r = run("--help");
  EXPECT_EQ(r.code, 0);
  EXPECT_NE(r.out.find("Example: estimate_pose config/contacts/peg_on_rim.yaml"),
            std::string::npos);
  const ToolRun example = run(std::string(ASSEMBLY_CELL_SOURCE_DIR) +
                              "/config/contacts/peg_on_rim.yaml --method robust");
  EXPECT_EQ(example.code, 0) << example.error;
  EXPECT_EQ(YAML::Load(example.out)["status"].as<std::string>(), "OK");
}

}  // namespace
}  // namespace assembly_cell
