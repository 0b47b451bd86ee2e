// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The tool estimate_locus: result keys, undefined results, bad input.
#include <gtest/gtest.h>
#include <stdlib.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <fstream>
#include <random>
#include <string>

#include "assembly_cell/locus/contact_model.h"
#include "assembly_cell/scene/scenario.h"
#include "tool_run.h"

namespace assembly_cell {
namespace {

const std::string kCell = std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/scenarios/cell.yaml";

using test::ToolRun;

class EstimateLocus : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_ / name; }

  std::string write(const std::string& text) const {
    std::ofstream(path("samples.csv")) << text;
    return path("samples.csv");
  }

  // samples of Z = P e^{ia} + N e^{-ia} with an offset, a = direction · frequency · t
  std::string locus(std::complex<double> P, std::complex<double> N, double sigma,
                    double frequency = 770, int direction = 1) const {
    std::mt19937_64 random(1);
    std::normal_distribution<double> noise(0.0, 1.0);
    std::string text = "t,x,y\n";
    for (int k = 0; k < 1000; ++k) {
      const double t = 0.3 + 2e-4 * k;
      const std::complex<double> turn = std::polar(1.0, direction * frequency * t);
      const std::complex<double> z = P * turn + N * std::conj(turn);
      char line[120];
      std::snprintf(line, sizeof(line), "%.17g,%.17g,%.17g\n", t,
                    z.real() + 1e-3 + sigma * noise(random), z.imag() + sigma * noise(random));
      text += line;
    }
    return write(text);
  }

  ToolRun run(const std::string& arguments) const {
    return test::runTool("estimate_locus " + arguments);
  }

  // bad input: exit 2, nothing on standard output, one line that contains `part`
  void refused(const std::string& arguments, const std::string& part) const {
    const ToolRun r = run(arguments);
    EXPECT_EQ(r.code, 2) << arguments;
    EXPECT_EQ(r.out, "");
    EXPECT_EQ(std::count(r.error.begin(), r.error.end(), '\n'), 1) << r.error;
    EXPECT_NE(r.error.find(part), std::string::npos) << r.error;
  }

  test::TemporaryFolder folder_;
};

TEST_F(EstimateLocus, PrintsEveryKeyOfAnEllipse) {
  const std::complex<double> P = std::polar(3e-6, 0.4), N = std::polar(7e-6, 1.2);
  const ToolRun r = run(locus(P, N, 1e-8) + " --frequency 770");
  ASSERT_EQ(r.code, 0) << r.error;
  const YAML::Node y = YAML::Load(r.out);
  EXPECT_EQ(y["mode"].as<std::string>(), "ellipse");
  // five standard deviations of the fit: sqrt(σ²/n)
  const double tolerance = 5e-8 / std::sqrt(1000.0);
  EXPECT_NEAR(y["P"][0].as<double>(), P.real(), tolerance);
  EXPECT_NEAR(y["P"][1].as<double>(), P.imag(), tolerance);
  EXPECT_NEAR(y["N"][0].as<double>(), N.real(), tolerance);
  EXPECT_NEAR(y["N"][1].as<double>(), N.imag(), tolerance);
  EXPECT_NEAR(y["semi_major"].as<double>(), 10e-6, 2 * tolerance);
  EXPECT_NEAR(y["semi_minor"].as<double>(), -4e-6, 2 * tolerance);
  const double sd = y["orientation_sd"].as<double>();
  EXPECT_NEAR(y["orientation"].as<double>(), 0.8, 5 * sd);
  EXPECT_NEAR(sd, 0.5e-8 / std::sqrt(1000.0) * std::hypot(1 / 3e-6, 1 / 7e-6), 0.1 * sd);
  EXPECT_EQ(y["frequency"].as<double>(), 770.0);
  EXPECT_NEAR(y["noise_sd"].as<double>(), 1e-8, 0.1e-8);
  ASSERT_EQ(y["hypotheses"].size(), 4u);
  double sum = 0.0;
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(y["hypotheses"][k]["direction"].as<double>(),
                y["orientation"].as<double>() + static_cast<double>(k) * M_PI / 2, 1e-12);
    EXPECT_EQ(y["hypotheses"][k]["weight"].as<double>(), 0.25);
  }
  for (const char* mode : {"none", "segment", "ellipse", "circle", "undecided"}) {
    sum += y["probabilities"][mode].as<double>();
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
}

TEST_F(EstimateLocus, ClockwiseExciter) {
  const ToolRun r =
      run(locus(4e-6, 1e-6, 1e-8, 770, -1) + " --frequency 770 --direction -1 --drift");
  ASSERT_EQ(r.code, 0) << r.error;
  const YAML::Node y = YAML::Load(r.out);
  EXPECT_NEAR(y["P"][0].as<double>(), 4e-6, 2e-9);
  EXPECT_NEAR(y["semi_minor"].as<double>(), 3e-6, 4e-9);
}

TEST_F(EstimateLocus, ModesAndUndefinedResults) {
  struct Case {
    double p, n;
    const char* mode;
    bool oriented;
  };
  for (const Case& c : {Case{0, 0, "none", false}, Case{5e-6, 5e-6, "segment", true},
                        Case{5e-6, 0, "circle", false}, Case{0, 5e-6, "ellipse", false}}) {
    const ToolRun r = run(locus(c.p, c.n, 1e-8) + " --frequency 770");
    ASSERT_EQ(r.code, 0) << r.error;
    const YAML::Node y = YAML::Load(r.out);
    EXPECT_EQ(y["mode"].as<std::string>(), c.mode);
    EXPECT_TRUE(y["semi_major"].as<double>() >= 0.0);
    EXPECT_TRUE(std::isfinite(y["semi_minor"].as<double>()));
    if (c.oriented) {
      EXPECT_NEAR(std::remainder(y["orientation"].as<double>(), M_PI), 0.0, 0.01) << c.mode;
      EXPECT_EQ(y["hypotheses"].size(), 4u);
    } else if (c.p > 0 || c.n == 0) {
      for (const char* key : {"orientation", "orientation_sd", "hypotheses"}) {
        EXPECT_TRUE(y[key].IsNull()) << c.mode << " " << key;
      }
    }
  }
}

TEST_F(EstimateLocus, MechanismGivesHypothesesByInversion) {
  const Scenario mechanism = loadScenario(kCell);
  OperatingPoint point;
  point.frequency = 500;
  point.amplitude = 1;
  point.press = 12;
  const ContactResponse response = contactResponse(mechanism.mechanism, point, 2.0);
  const std::string samples = locus(response.P, response.N, 1e-8, 500);
  const std::string mechanism_options = " --frequency 500 --mechanism " + kCell;
  const ToolRun r = run(samples + mechanism_options + " --amplitude 1 --press 12");
  ASSERT_EQ(r.code, 0) << r.error;
  const YAML::Node y = YAML::Load(r.out);
  ASSERT_EQ(y["hypotheses"].size(), 2u);
  // either half turn; noise σ/(2 √n |N|) = 2e-5 rad
  EXPECT_NEAR(std::remainder(y["hypotheses"][0]["direction"].as<double>() - 2.0, M_PI), 0.0, 1e-4);
  EXPECT_NEAR(std::remainder(y["hypotheses"][1]["direction"].as<double>() -
                                 y["hypotheses"][0]["direction"].as<double>() - M_PI,
                             2 * M_PI),
              0.0, 1e-4);
  // another amplitude is no locus of this mechanism
  const ToolRun other = run(samples + mechanism_options + " --amplitude 3 --press 12");
  ASSERT_EQ(other.code, 0) << other.error;
  EXPECT_TRUE(YAML::Load(other.out)["hypotheses"].IsNull());
  // the cell's exciter is off
  refused(samples + mechanism_options, "--amplitude: value missing");
}

// key by key as the architecture has them, and covariances that agree with the scalars
TEST_F(EstimateLocus, Covariances) {
  const ToolRun r = run(locus(4e-6, std::polar(1e-6, 0.9), 1e-7) + " --frequency 770");
  ASSERT_EQ(r.code, 0) << r.error;
  const YAML::Node y = YAML::Load(r.out);
  ASSERT_EQ(y["covariance"].size(), 16u);
  ASSERT_EQ(y["ellipse_covariance"].size(), 16u);
  double trace = 0.0;
  for (std::size_t i = 0; i < 4; ++i) trace += y["covariance"][5 * i].as<double>() / 4;
  EXPECT_NEAR(trace, y["variance"].as<double>(), 1e-6 * trace);
  EXPECT_NEAR(std::sqrt(y["ellipse_covariance"][10].as<double>()), y["orientation_sd"].as<double>(),
              0.05 * y["orientation_sd"].as<double>());
  // a peg at rest has no axes: null, the rest is there
  const ToolRun rest =
      run(write("t,x,y\n0,1,1\n1,1,1\n2,1,1\n3,1,1\n4,1,1\n5,1,1\n6,1,1\n7,1,1\n8,1,1\n") +
          " --frequency 2");
  ASSERT_EQ(rest.code, 0) << rest.error;
  const YAML::Node still = YAML::Load(rest.out);
  EXPECT_EQ(still["mode"].as<std::string>(), "none");
  EXPECT_TRUE(still["hypotheses"].IsNull());
  EXPECT_TRUE(still["ellipse_covariance"][10].IsNull());
  EXPECT_EQ(rest.out.find("nan"), std::string::npos);
}

// samples that say how uncertain they are: the bad half hardly counts
TEST_F(EstimateLocus, UncertaintyOfSamples) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::string text = "t,x,y,uncertainty\n";
  for (int k = 0; k < 1000; ++k) {
    const double sd = k % 2 ? 1e-8 : 1e-6, a = 770 * 2e-4 * k;
    char row[120];
    std::snprintf(row, sizeof(row), "%.17g,%.17g,%.17g,%g\n", 2e-4 * k,
                  5e-6 * std::cos(a) + sd * noise(random), 3e-6 * std::sin(a) + sd * noise(random),
                  sd);
    text += row;
  }
  const ToolRun r = run(write(text) + " --frequency 770");
  ASSERT_EQ(r.code, 0) << r.error;
  const YAML::Node y = YAML::Load(r.out);
  // 500 good samples
  EXPECT_NEAR(std::sqrt(y["variance"].as<double>()), 1e-8 / std::sqrt(500.0), 0.1e-9);
  EXPECT_NEAR(y["semi_major"].as<double>(), 5e-6, 5 * y["semi_axes_sd"].as<double>());
  refused(write("t,x,y,uncertainy\n0,1,2,1\n") + " --frequency 770", "is it uncertainty?");
  refused(write("t,x,y,uncertainty\n0,1,2,0\n") + " --frequency 770",
          ":2: column uncertainty is 0.0");
}

// accelerations as columns of their own, and their double integral
TEST_F(EstimateLocus, Accelerations) {
  const double w2 = 770.0 * 770.0;
  std::string text = "t,ax,ay\n";
  for (int k = 0; k < 1000; ++k) {
    const double a = 770 * 2e-4 * k;
    char row[120];
    std::snprintf(row, sizeof(row), "%.17g,%.17g,%.17g\n", 2e-4 * k,
                  -w2 * 5e-6 * std::cos(a) + 0.17, -w2 * 3e-6 * std::sin(a));
    text += row;
  }
  const ToolRun r = run(write(text) + " --frequency 770 --trace " + path("trace.csv"));
  ASSERT_EQ(r.code, 0) << r.error;
  const YAML::Node y = YAML::Load(r.out);
  EXPECT_NEAR(y["semi_major"].as<double>(), 5e-6, 1e-12);
  EXPECT_NEAR(y["semi_minor"].as<double>(), 3e-6, 1e-12);
  const ToolRun again = run(path("trace.csv") + " --frequency 770 --start 0.05 --duration 0.1");
  ASSERT_EQ(again.code, 0) << again.error;
  EXPECT_NEAR(YAML::Load(again.out)["semi_major"].as<double>(), 5e-6, 5e-8);
}

// displacements of the coupling through the mechanism: the half turn is resolved, too
TEST_F(EstimateLocus, DisplacementsOfTheCoupling) {
  const Scenario mechanism = loadScenario(kCell);
  OperatingPoint point;
  point.frequency = 770;
  point.amplitude = 1;
  point.press = 12;
  const ContactResponse response = contactResponse(mechanism.mechanism, point, 2.0);
  std::string text = "# frequency=770 amplitude=1 direction=1\nt,x,y,z,rx,ry,rz\n";
  for (int k = 0; k < 1000; ++k) {
    const double t = 2e-4 * k;
    text += std::to_string(t);
    for (int j = 0; j < 6; ++j) {
      const double mean =
          j == 2 ? (12 - mechanism.mechanism.peg.mass * mechanism.mechanism.gravity) / 5e4 : 0.0;
      char cell[40];
      std::snprintf(cell, sizeof(cell), ",%.17g",
                    (response.coupling[j] * std::polar(1.0, 770 * t)).real() + mean);
      text += cell;
    }
    text += "\n";
  }
  const ToolRun r = run(write(text) + " --mechanism " + kCell);
  ASSERT_EQ(r.code, 0) << r.error;
  const YAML::Node y = YAML::Load(r.out);
  ASSERT_EQ(y["hypotheses"].size(), 2u);
  EXPECT_NEAR(y["hypotheses"][0]["direction"].as<double>(), 2.0, 0.01);
  EXPECT_GT(y["hypotheses"][0]["weight"].as<double>(), 0.99);
  EXPECT_EQ(y["frequency"].as<double>(), 770.0);
}

TEST_F(EstimateLocus, Plan) {
  const std::string base = "--plan --mechanism " + kCell + " --press 12 ";
  const ToolRun chosen = run(base + "--amplitude 1");
  ASSERT_EQ(chosen.code, 0) << chosen.error;
  const YAML::Node y = YAML::Load(chosen.out);
  EXPECT_GT(y["frequency"].as<double>(), 100);
  EXPECT_LT(y["direction_sd"].as<double>(), 0.01);
  EXPECT_TRUE(y["refusal"].IsNull());
  const ToolRun given = run(base + "--amplitude 1 --frequency 770");
  ASSERT_EQ(given.code, 0) << given.error;
  EXPECT_EQ(YAML::Load(given.out)["frequency"].as<double>(), 770);
  const ToolRun weak = run(base + "--amplitude 0.001 --bits 10");
  EXPECT_EQ(weak.code, 1);
  EXPECT_EQ(YAML::Load(weak.out)["refusal"].as<std::string>().rfind("too_uncertain", 0), 0u);
  refused("--plan", "--mechanism: value missing");
  refused("--plan --robust", "--robust: of no use with --plan");
  refused(base, "--amplitude: value missing");
  refused(base + "--amplitude 1 --bits 12", "--bits: value 12");
}

// bags of the displacement and of the accelerometers, phase and settings by the exciter's messages
TEST_F(EstimateLocus, Bags) {
  const std::string python = "PYTHONPATH=" + std::string(ASSEMBLY_CELL_BIN_DIR) +
                             "/../python3/dist-packages:$PYTHONPATH /usr/bin/python3 ";
  if (std::system((python + "-c 'import assembly_cell.msg, rosbag' 2>/dev/null").c_str()) != 0) {
    GTEST_SKIP() << "the messages' Python is not built";
  }
  std::ofstream(path("write.py")) << R"(
import math, rosbag, rospy, sys
from assembly_cell.msg import AccelerometerSamples, DisplacementSamples, Exciter
bag = rosbag.Bag(sys.argv[1], 'w')
e = Exciter(on=True, amplitude=2.0, frequency=770.0, phase=0.6, direction=-1)
e.header.stamp = rospy.Time(100, 0)
bag.write('/exciter', e, e.header.stamp)
for b in range(10):
    d, a = DisplacementSamples(period=2e-4), AccelerometerSamples(period=2e-4)
    d.header.stamp = a.header.stamp = rospy.Time.from_sec(100 + 0.02 * b)
    for k in range(100):
        angle = -(770.0 * (0.02 * b + 2e-4 * k) + 0.6)
        x, y = 5e-6 * math.cos(angle), 3e-6 * math.sin(angle)
        d.displacement += [x, y, 0, 0, 0, 0]
        a.acceleration += [-770.0 ** 2 * x, -770.0 ** 2 * y]
    for _ in range(2):  # latched ones come again
        bag.write('/sensor_b/displacement_samples', d, d.header.stamp)
        bag.write('/accelerometers', a, a.header.stamp)
e.on = False
e.header.stamp = rospy.Time.from_sec(100.16)
bag.write('/exciter', e, e.header.stamp)
bag.close()
)";
  ASSERT_EQ(std::system((python + path("write.py") + " " + path("r.bag")).c_str()), 0);
  for (const char* topic : {"", " --topic accelerometers"}) {
    const ToolRun r = run(path("r.bag") + topic);
    ASSERT_EQ(r.code, 0) << r.error;
    const YAML::Node y = YAML::Load(r.out);
    EXPECT_EQ(y["frequency"].as<double>(), 770);
    EXPECT_EQ(y["samples"].as<int>(), 800);  // until it was switched off
    // turns with the exciter, at its phase
    EXPECT_NEAR(y["P"][0].as<double>(), 4e-6, 1e-9) << topic;
    EXPECT_NEAR(y["P"][1].as<double>(), 0, 1e-9) << topic;
    EXPECT_NEAR(y["N"][0].as<double>(), 1e-6, 1e-9) << topic;
  }
  refused(path("r.bag") + " --topic nowhere", "no samples on nowhere");
  refused(path("none.bag"), "there is no such file");
  refused(write("not a bag") + " --topic x", "is for bags only");
}

TEST_F(EstimateLocus, RefusesHostileInput) {
  refused(write("t,x,y\n0,1,2\n") + " --frequency 770", "window has 1 samples");
  const std::string good = locus(1e-6, 1e-6, 1e-8);
  refused(good + " --frequency 0", "--frequency: value 0");
  refused(good + " --frequency 15800", "samples a period of the exciter: more than two are needed");
  refused(good + " --frequency 1e300", "samples.csv: ");
  refused(good + " --frequency 770 --start 5", "--start: value 5");
  refused(good + " --frequency 770 --bits 10", "--bits: serves --plan");
  refused(good + " --frequency 770 --duration 1e-3", "samples.csv: ");
  refused(folder_.path() + " --frequency 770", "missing or unreadable");
  std::string huge = "t,x,y\n";
  for (int k = 0; k < 100; ++k) {
    huge += std::to_string(1e-3 * k) + (k % 2 ? ",1e200,1e300\n" : ",-1e200,-1e300\n");
  }
  refused(write(huge) + " --frequency 200", "column x is -1e200: nothing measured is beyond 1e30");
  // uneven times are no trouble: least squares take them as they are
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(1e-5, 4e-4);
  std::string uneven = "t,x,y\n";
  double t = 0.0;
  for (int k = 0; k < 1000; ++k) {
    t += uniform(random);
    char row[120];
    std::snprintf(row, sizeof(row), "%.17g,%.17g,%.17g\n", t, 5e-6 * std::cos(770 * t),
                  3e-6 * std::sin(770 * t));
    uneven += row;
  }
  const ToolRun r = run(write(uneven) + " --frequency 770");
  ASSERT_EQ(r.code, 0) << r.error;
  EXPECT_NEAR(YAML::Load(r.out)["semi_major"].as<double>(), 5e-6, 1e-15);
}

// As spreadsheets and loggers write them: comments and blank lines anywhere, CRLF, a byte order
// mark, blanks round the commas.
TEST_F(EstimateLocus, PassesOverCommentsAndBlankLines) {
  std::ifstream in(locus(5e-6, 2e-6, 1e-8));
  const std::string plain(std::istreambuf_iterator<char>(in), {});
  std::string dressed = "\xEF\xBB\xBF# logger\r\n\r\n  \r\n# of the rig\r\n";
  for (const char c : plain) dressed += c == '\n' ? "\r\n  # row\r\n\r\n" : std::string(1, c);
  const ToolRun clean = run(write(plain) + " --frequency 770");
  const ToolRun commented = run(write(dressed) + " --frequency 770");
  ASSERT_EQ(clean.code, 0) << clean.error;
  EXPECT_EQ(commented.code, 0) << commented.error;
  EXPECT_EQ(commented.out, clean.out);
}

TEST_F(EstimateLocus, RefusesBadInput) {
  const std::string good = locus(1e-6, 1e-6, 1e-8);
  refused("", "give a file of samples");
  refused(good, "--frequency: value missing");
  refused(good + " --frequency -3", "--frequency: value -3");
  refused(good + " --frequency nan", "--frequency: value nan");
  refused(good + " --frequency 770 --frobnicate", "--frobnicate: unknown option");
  refused(good + " --frequency 770 --direction 2", "--direction: value 2");
  refused(good + " --frequency 770 --false-alarm 0.7", "--false-alarm");
  refused(good + " --frequency 770 --mechanism /nowhere.yaml", "/nowhere.yaml");
  refused(good + " --frequency 1e-3", "at least one is needed");
  refused("/nowhere.csv --frequency 770", "/nowhere.csv");
  refused(write("") + " --frequency 770", "samples.csv");
  refused(write("t,x\n0,1\n") + " --frequency 770", "samples.csv:1: column y is missing");
  refused(write("t,x,y,x\n0,1,2,3\n") + " --frequency 770", "column x: there are two such");
  refused(write("t,x,y\n") + " --frequency 770", "no rows of numbers");
  refused(write("t,x,y\n0,1,2\n1e-3,nan,2\n") + " --frequency 770",
          "samples.csv:3: column x is 'nan': give a finite number");
  refused(write("t,x,y\n0,1,2\n1e-3,3,abc\n") + " --frequency 770", ":3: column y is 'abc'");
  refused(write("t,x,y\n0,1,2\n1e-3,3\n") + " --frequency 770", ":3: 2 columns: give 3");
  refused(write("t,x,y\n0,1,2\n1e-3,3,4,5\n") + " --frequency 770", ":3: 4 columns: give 3");
  refused(write("t,x,y\n0,1,2\n0,3,4\n") + " --frequency 770", ":3: column t is 0.0 after 0.0");
}

TEST_F(EstimateLocus, HelpHasAnExample) {
  const ToolRun r = run("--help");
  EXPECT_EQ(r.code, 0);
  EXPECT_NE(r.out.find("Example: estimate_locus samples.csv --frequency"), std::string::npos);
}

}  // namespace
}  // namespace assembly_cell
