// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool `vibration` from the command line: a process with a file, options, outputs and an exit
// code.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace {

namespace fs = std::filesystem;

class Vibration : public testing::Test {
 protected:
  struct Result {
    int exit_code;
    std::string out, err;
    YAML::Node yaml() const { return YAML::Load(out); }
  };

  Vibration()
      : folder_(fs::temp_directory_path() / ("test_vibration_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~Vibration() override { fs::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  static std::string textOf(const std::string& file) {
    std::ifstream stream(file);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  }

  Result run(const std::string& model, const std::string& parameters,
             const std::string& options = "") const {
    std::ofstream(path("p.yaml")) << parameters;
    return call(model + " '" + path("p.yaml") + "' " + options);
  }
  Result call(const std::string& arguments) const {
    const std::string command = "'" ASSEMBLY_CELL_BIN_DIR "/vibration' " + arguments + " > '" +
                                path("out") + "' 2> '" + path("err") + "'";
    const int status = std::system(command.c_str());
    return {WEXITSTATUS(status), textOf(path("out")), textOf(path("err"))};
  }

  fs::path folder_;
};

constexpr const char* kSliding =
    "{K: 1.0e7, I: 877.708, w: 50, h: 25, kx: 1280, l: 12.5, m: 0.766, g: 9806.6, phi: 0.1, theta: "
    "0.02, d: 12.5}";
constexpr const char* kRig = "{x0: 25, M_over_L: 25, f_hz: 4, K: 0.075, g: 9806.6}";

// every model answers under the names of its help, with a number worked out apart from this code
TEST_F(Vibration, ModelsAndNames) {
  struct Case {
    const char *model, *parameters, *key;
    double value, tolerance;
    std::vector<std::string> names;
  };
  const std::string peg = "m: 0.766, r: 25, h: 25, F: 1500, alpha: 0.7, w: 80";
  const std::string transverse = "{model: transverse, " + peg + ", Kx: 1.0e7, Ky: 1.0e7}";
  const Case cases[] = {
      {"inertia", "{m: 0.766, r: 25, h: 25}", "Iy", 1217.24, .005, {"Ix", "Iy", "Iz", "beta"}},
      {"chord_inertia", "{m: 0.766, r: 25, h: 25, d: 24}", "I", 1199.24, .005, {"I"}},
      {"chord_stiffness", "{kx: 2, kz: 3, KY: 5, h: 1, l: 0.5, d: 0}", "K", 17.5, 1e-12, {"K"}},
      {"sdof",
       "{I: 1, K: 1, t: 2, t1: 0, th1: 0, thd1: 0, A: 0, B: 0, C: 1, w: 1}",
       "theta",
       1 - std::cos(2.0),
       1e-12,
       {"theta", "theta_dot"}},
      {"single_contact",
       "{m: 0.766, r: 25, h: 25, K: 1.0e7, F: 1500, w: 0, alpha: 0, t: 0}",
       "theta_x",
       -.0075,
       1e-12,
       {"theta_x", "theta_y", "theta_z"}},
      {"sliding_ratio",
       kSliding,
       "p1",
       .261,
       5e-4,
       {"band", "w_lower", "w_upper", "D", "p1", "p2", "p1_inertia", "p2_inertia"}},
      {"walking_limit", "{mu: 0.2, r: 25, h: 25}", "overlap", 4.174, 5e-4, {"alpha", "overlap"}},
      {"walk",
       "{m: 0.766, g: 9806.6, r: 25, h: 25, K: 1.0e7, F: 1500, w: 60, cos_alpha: 0.96, cycles: 40}",
       "mean_step",
       -.0008,
       5e-5,
       {"t_lift", "duration", "dZ", "outward_step", "mean_step", "tension"}},
      {"tip_bounce",
       "{m: 0.766, g: 9806.6, r: 25, h: 25, l: 12.5, kx: 1280, K_chord: 1.0e7, F: 2500, w: 60, "
       "alpha: "
       "1.0471975511965976, restitution: 0.3}",
       "t_flight",
       .243e-3,
       5e-7,
       {"t_tip", "t_impact", "omega_impact", "impulse", "t_flight", "X_end"}},
      {"free_flight",
       "{m: 0.766, I: 279.27, kx: 1280, Krot: 0, h: 25, l: 12.5, r: 25, J: 6.4, t: 0.001, g: "
       "9806.6}",
       "w_lo",
       0,
       0,
       {"w_hi", "w_lo", "X", "Z", "theta"}},
      {"rig", kRig, "time", 1.564, 5e-4, {"time", "cycles", "never"}},
      {"locus", transverse.c_str(), "a", .899, 5e-4, {"P", "N", "a", "b", "psi"}}};
  for (const Case& c : cases) {
    const Result x = run(c.model, c.parameters);
    ASSERT_EQ(x.exit_code, 0) << c.model << x.err;
    const YAML::Node yaml = x.yaml();
    EXPECT_EQ(yaml.size(), c.names.size()) << c.model;
    for (const std::string& name : c.names) EXPECT_TRUE(yaml[name]) << c.model << " " << name;
    EXPECT_NEAR(yaml[c.key].as<double>(), c.value, c.tolerance) << c.model;
  }
  EXPECT_EQ(run("sliding_ratio", kSliding).yaml()["band"].as<std::string>(), "low");
}

TEST_F(Vibration, LocusModels) {
  const std::string peg = "m: 0.766, r: 25, h: 25, F: 1500, alpha: 0.7, w: 80";
  std::string K6;
  for (int i = 0; i < 36; ++i) K6 += i % 7 == 0 && i > 20 ? "1.0e7, " : "0, ";
  const auto a = [&](const std::string& rest) {
    const Result x = run("locus", "{" + rest + "}");
    EXPECT_EQ(x.exit_code, 0) << x.err;
    return x.yaml()["a"].as<double>();
  };
  const double isotropic = a("model: isotropic, K: 1.0e7, " + peg);
  EXPECT_NEAR(a("model: general, l: 12.5, K6: [" + K6 + "], " + peg), isotropic, 1e-9);
  EXPECT_GT(a("model: vertical, K: 1.0e7, c: 10, " + peg), 0);
  EXPECT_GT(a("model: double, d: 12.5, K: 1.0e7, " + peg), 0);
  EXPECT_GT(a("model: sliding, m: 0.766, k: 300, F: 1500, mu_N: 700, w: 80"), 0);
  EXPECT_TRUE(run("locus", "{model: sliding, m: 0.766, k: 300, F: 1500, mu_N: 700, w: 80}")
                  .yaml()["psi"]
                  .IsNull());
  EXPECT_NE(run("locus", "{model: round}").err.find("model: value round"), std::string::npos);
  EXPECT_NE(run("locus", "{model: double, " + peg + ", d: 1, K: 1, cx: 1}").err.find("cx"),
            std::string::npos);
}

TEST_F(Vibration, UndefinedIsNull) {
  const YAML::Node rig = run("rig", "{x0: 50, M_over_L: 25, f_hz: 4, K: 0.075, g: 9806.6}").yaml();
  EXPECT_TRUE(rig["never"].as<bool>());
  EXPECT_TRUE(rig["time"].IsNull());
  EXPECT_TRUE(rig["cycles"].IsNull());
}

TEST_F(Vibration, SweepsAndCsv) {
  const Result x = run("rig", "{x0: 25, M_over_L: 25, K: 0.075, g: 9806.6}",
                       "--sweep f_hz=0.5,1,4 --output '" + path("rig.csv") + "'");
  ASSERT_EQ(x.exit_code, 0) << x.err;
  EXPECT_EQ(x.yaml()["f_hz"].size(), 3u);
  EXPECT_NEAR(x.yaml()["time"][2].as<double>(), 1.564, 5e-4);
  const std::string csv = textOf(path("rig.csv"));
  EXPECT_EQ(csv.substr(0, csv.find('\n')), "f_hz,time,cycles,never");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 4);
  const Result times =
      run("sdof", "{I: 1, K: 1, t1: 0, th1: 1, thd1: 0, A: 0, B: 0, C: 0, w: 1}", "--times 0:1:3");
  EXPECT_NEAR(times.yaml()["theta"][2].as<double>(), std::cos(1.0), 1e-15);
  const Result walk = run(
      "walk",
      "{m: 0.766, g: 9806.6, r: 25, h: 25, K: 1.0e7, F: 1500, w: 60, cos_alpha: 0.96, cycles: 2}",
      "--times 0,0.1 --output '" + path("walk.csv") + "'");
  EXPECT_EQ(walk.yaml()["theta_Y"].size(), 2u);
  EXPECT_EQ(textOf(path("walk.csv")).substr(0, 25), "t,theta_X,theta_Y,theta_Z");
}

TEST_F(Vibration, Map) {
  const char* parameters =
      "{m: 0.766, r: 25, h: 25, g: 9806.6, K: 1.0e7, kx: 1280, l: 12.5, d: 12.5, phi: 0.1, mu: "
      "0.2}";
  const Result x = run("map", parameters,
                       "--frequency 10:150:8 --force 0,1000 --output '" + path("map.csv") + "'");
  ASSERT_EQ(x.exit_code, 0) << x.err;
  int points = 0;
  for (const auto& count : x.yaml()) points += count.second.as<int>();
  EXPECT_EQ(points, 16);
  const std::string csv = textOf(path("map.csv"));
  EXPECT_EQ(csv.substr(0, csv.find('\n')), "w,F,theta,p1,p2,outcome");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 17);
  // the same as a flag, to standard output
  const Result flag = call("--map '" + path("p.yaml") + "' --frequency 10:150:8 --force 0,1000");
  EXPECT_EQ(flag.out, csv);
}

TEST_F(Vibration, HelpAndRefusals) {
  EXPECT_EQ(call("--help").exit_code, 0);
  EXPECT_NE(call("--help").out.find("Example"), std::string::npos);
  const auto refused = [&](const Result& x, const std::string& what) {
    EXPECT_EQ(x.exit_code, 2) << what;
    EXPECT_NE(x.err.find(what), std::string::npos) << x.err;
    EXPECT_EQ(std::count(x.err.begin(), x.err.end(), '\n'), 1) << x.err;
    EXPECT_TRUE(x.out.empty()) << x.out;
  };
  refused(call(""), "MODEL");
  refused(call("walking"), "walking");
  refused(call("rig"), "PARAMETERS.yaml");
  refused(call("rig /nowhere.yaml"), "/nowhere.yaml");
  refused(call("rig /"), "vibration: /: cannot be read");
  refused(run("inertia", "{m: 1, r: 2}"), "h: missing");
  refused(run("inertia", "{m: 1, r: 2, h: 3, l: 4}"), "l: no parameter");
  refused(run("inertia", "{m: 1, r: 2, h: x}"), "h: value x");
  refused(run("inertia", "{m: 1, r: 2, h: .nan}"), "h: value .nan");
  refused(run("inertia", "{m: 1, r: 2, h: -3}"), "h: value -3.0");
  refused(run("inertia", "{m: 1, r: 2, h: [3]}"), "h: value");
  refused(run("inertia", "m: 1\nm: 2\nr: 1\nh: 1\n"), "m: value 2: duplicate key");
  refused(run("inertia", "[1, 2"), "p.yaml");
  refused(run("inertia", "3"), "mapping");
  refused(run("rig", kRig, "--sweep q=1,2"), "q: no parameter");
  refused(run("rig", kRig, "--sweep f_hz=1:2"), "--sweep");
  refused(run("rig", kRig, "--output '" + path("x.csv") + "'"), "--sweep or --times");
  refused(run("rig", kRig, "--foo"), "--foo");
  refused(run("rig", kRig, "--frequency 1,2"), "map");
  refused(run("rig", kRig, "--sweep f_hz=1,2 --output /nowhere/x.csv"), "/nowhere/x.csv");
}

}  // namespace
