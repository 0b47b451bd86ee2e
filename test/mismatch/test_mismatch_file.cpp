// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
// The reader of mismatch files, what is drawn, and the scenario that it makes.
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "scenarios.h"

namespace assembly_cell {
namespace {

using Eigen::Vector3d;

// every key of the format
const char* const kWhole = R"(
scale:
  coupling.stiffness: {uniform: [0.9, 1.1]}
  coupling.stiffness.each: {uniform: [0.9, 1.1]}
  coupling.damping: {log_uniform: [0.6, 1.7]}
  carrier.stiffness: {uniform: [0.8, 1.2]}
  carrier.stiffness[1]: {normal: 0.01}
  peg.mass: {uniform: [0.95, 1.05]}
  friction: {uniform: [0.5, 1.5]}
add:
  peg.coupling_height: {uniform: [-5.0e-4, 5.0e-4]}
  carrier.damping: {uniform: [-1, 1]}
  hole.radius: 0
exciter:
  amplitude: {uniform: [0.8, 1.2]}
  delay: {uniform: [0, 1.0e-3]}
  ellipticity: {uniform: [0, 0.05]}
  harmonic: 0.02
sensor_a:
  matrix: {normal: 0.01}
  frame: {rotation: {normal: 0.006}, offset: {normal: 2.0e-4}}
  drift: {force: {uniform: [-1, 1]}, torque: {uniform: [-0.01, 0.01]}, walk: 0.02}
  hum: {force: 0.2, frequency: 50}
  latency: {uniform: [0, 1.0e-3]}
sensor_b: {matrix: {normal: 0.01}}
carrier:
  reading_noise: 1.0e-5
  repeatability: 3.0e-5
  compliance: 5.0e-6
  latency: {uniform: [0, 0.25]}
  jitter: 0.01
  lag: {log_uniform: [0.01, 0.1]}
  backlash: {uniform: [2.0e-5, 1.0e-4]}
  frame: {rotation: 0.002, scale: 1.0e-4, offset: 0.01}
hole:
  burr: {friction: 3, depth: {uniform: [0.01, 0.02]}, length: 0.002}
  bore_tilt: {uniform: [0, 0.0035]}
  face_tilt: {uniform: [0, 0.01]}
)";

Truth drawn(const std::string& text, std::uint64_t seed = 1) {
  return drawTruth(parseMismatch(text, "test"), seed);
}

Scenario made(const std::string& text, std::uint64_t seed = 1) {
  return trueScenario(cell(), drawn(text, seed), "test");
}

std::string refusal(const std::function<void()>& what) {
  try {
    what();
  } catch (const InputError& error) {
    return error.what();
  }
  return "not refused";
}

TEST(MismatchFile, EveryKeyIsReadAndReportedByItsName) {
  const Truth truth = drawn(kWhole);
  const YAML::Node file = YAML::Load(kWhole), report = YAML::Load(truthText(truth));
  const std::function<void(const YAML::Node&, const YAML::Node&, const std::string&)> compare =
      [&](const YAML::Node& part, const YAML::Node& report_part, const std::string& path) {
        for (const auto& entry : part) {
          const std::string key = entry.first.as<std::string>();
          ASSERT_TRUE(report_part[key]) << path << key;
          const bool draw = !entry.second.IsMap() || entry.second["uniform"] ||
                            entry.second["normal"] || entry.second["log_uniform"];
          if (!draw) compare(entry.second, report_part[key], path + key + ".");
        }
      };
  compare(file, report, "");
  EXPECT_EQ(report["scale"]["coupling.stiffness"].as<double>(), truth.scale[0].values[0]);
  EXPECT_EQ(report["scale"]["coupling.stiffness.each"].size(), 6u);
  EXPECT_EQ(report["add"]["carrier.damping"].size(), 3u);
  EXPECT_EQ(report["sensor_a"]["matrix"][4][2].as<double>(), truth.cell.sensor_a.matrix(4, 2));
  EXPECT_EQ(report["sensor_a"]["hum"]["frequency"].as<double>(), 50.0);
  EXPECT_EQ(report["carrier"]["latency"].as<double>(), truth.cell.carrier.latency);
  EXPECT_EQ(report["carrier"]["backlash"][2].as<double>(), truth.cell.carrier.backlash.z());
  EXPECT_EQ(report["hole"]["burr"]["depth"].as<double>(), truth.cell.burr.depth);
  EXPECT_EQ(truth.cell.burr.friction, 3.0);
  EXPECT_EQ(report["hole"]["bore_tilt"][1].as<double>(), truth.bore_tilt.y());
}

TEST(MismatchFile, NothingAskedIsNothingDrawn) {
  for (const char* text : {"", "# nothing\n", "{}", "scale: {}\nsensor_a: {}\n"}) {
    EXPECT_EQ(truthText(drawn(text)), "{}") << text;
    const Scenario nominal = cell(), truth = made(text);
    EXPECT_EQ(truth.mechanism.peg.mass, nominal.mechanism.peg.mass);
    EXPECT_EQ(truth.initial.position, nominal.initial.position);
    EXPECT_EQ(truth.imperfections.exciter.gain, 1.0);
  }
}

TEST(MismatchFile, LevelsAreReadAndMakeScenarios) {
  const Scenario nominal = cell();
  for (int level = 1; level <= 3; ++level) {
    const Mismatch mismatch =
        loadMismatch(std::string(ASSEMBLY_CELL_SOURCE_DIR) + "/config/mismatch/level_" +
                     std::to_string(level) + ".yaml");
    for (std::uint64_t seed = 0; seed < 2000; ++seed) {
      const Truth truth = drawTruth(mismatch, seed);
      const Scenario s = trueScenario(nominal, truth, "level");
      // the widest friction that the table has
      EXPECT_GE(s.mechanism.friction.sliding_coefficient, 0.05 - 1e-12);
      EXPECT_LE(s.mechanism.friction.sliding_coefficient, 0.6 + 1e-12);
      EXPECT_LE(truth.bore_tilt.norm(), 0.5 * M_PI / 180 + 1e-5);
    }
  }
}

struct Refused {
  const char* text;
  std::vector<const char*> words;  // key path, value, remedy
};

TEST(MismatchFile, RefusesByKeyValueAndRemedy) {
  const Refused cases[] = {
      {"scales: {}", {"scales", "unknown key"}},
      {"[1, 2]", {"file", "a list of 2", "mapping"}},
      {"exciter: {amplitude: {uniform: [0.8, 1.2]}, gain: 2}", {"exciter.gain", "2", "unknown"}},
      {"exciter: {amplitude: fast}", {"exciter.amplitude", "fast", "normal: SD"}},
      {"exciter: {amplitude: {sd: 1}}", {"exciter.amplitude", "normal: SD"}},
      {"exciter: {amplitude: {normal: 0.1, uniform: [0, 1]}}", {"exciter.amplitude"}},
      {"exciter: {amplitude: [1, 2]}", {"exciter.amplitude", "a list of 2"}},
      {"exciter: {amplitude: {uniform: [1.2, 0.8]}}", {"exciter.amplitude.uniform", "[1.2, 0.8]"}},
      {"exciter: {amplitude: {uniform: [1]}}", {"exciter.amplitude.uniform"}},
      {"exciter: {amplitude: {normal: -0.1}}", {"exciter.amplitude.normal", "-0.1", ">= 0"}},
      {"exciter: {amplitude: .nan}", {"exciter.amplitude", ".nan"}},
      {"exciter: {ellipticity: 1.5}", {"exciter.ellipticity", "1.5", "at most 1"}},
      {"exciter: {delay: {normal: 0.001}}", {"exciter.delay", "{normal: 0.001}", "at least 0"}},
      {"scale: {peg.mas: 1.1}", {"scale.peg.mas", "1.1", "peg.mass"}},
      {"scale: {peg.mass: {norml: 0.1}}", {"scale.peg.mass.norml", "0.1", "{normal: SD}"}},
      {"scale: {peg.mass: {normal: 0.1, mean: 1}}", {"scale.peg.mass", "{normal, mean}"}},
      {"exciter: {delay: 1.0e+9}", {"exciter.delay", "1000000000", "at most 1"}},
      {"scale: {peg: 1.1}", {"scale.peg", "no number"}},
      {"scale: {peg.mass.each: 1.1}", {"scale.peg.mass.each", "leave out .each"}},
      {"scale: {peg.mass: 0}", {"scale.peg.mass", "0", "above 0"}},
      {"scale: {peg.mass: {normal: 0.3}}", {"scale.peg.mass", "{normal: 0.3}", "above 0"}},
      {"scale: {coupling.damping: {log_uniform: [0, 2]}}",
       {"scale.coupling.damping.log_uniform", "[0, 2]", "0 < LOW"}},
      {"scale: {'coupling.stiffness[2]': 1.1}", {"scale.coupling.stiffness[2]", "diagonal"}},
      {"scale: {peg.mass: 1.1, peg.mass: 1.2}", {"scale.peg.mass", "duplicate"}},
      {"add: {clearance: 1.0e-5}", {"add.clearance", "1.0e-5", "name add.hole.radius"}},
      {"scale: {clearance.each: 1.1}", {"scale.clearance.each", "leave out .each"}},
      {"scale: {clearance: 0}", {"scale.clearance: value 0: ", "give at least 0.001"}},
      {"scale: {clearance: 101}", {"scale.clearance", "101", "at most 100"}},
      {"scale: {clearance: {normal: 20}}", {"scale.clearance", "within 5 SD", "at least -100"}},
      {"scale: {clearance: 1.1}\nadd: {hole.radius: 1.0e-5}",
       {"add.hole.radius", "scale.clearance", "leave one of them out"}},
      {"add: {coupling.stiffness: 5}", {"add.coupling.stiffness", "units"}},
      {"sensor_a: {hum: {force: 0.1}}", {"sensor_a.hum.frequency", "missing"}},
      {"sensor_a: {hum: {force: 0.1, frequency: 0}}", {"sensor_a.hum.frequency", "0"}},
      {"sensor_a: {latency: {uniform: [-0.001, 0]}}", {"sensor_a.latency", "[-0.001, 0]"}},
      {"sensor_a: {drift: {walk: -1}}", {"sensor_a.drift.walk", "-1", "at least 0"}},
      {"sensor_a: {frame: 0.1}", {"sensor_a.frame", "0.1", "mapping"}},
      {"sensor_c: {}", {"sensor_c", "unknown key"}},
      {"carrier: {reading_noise: -1.0e-5}", {"carrier.reading_noise", "-1e-05", "at least 0"}},
      {"carrier: {latency: 0.3}", {"carrier.latency", "0.3", "at most 0.25"}},
      {"carrier: {latency: {normal: 0.1}}", {"carrier.latency", "{normal: 0.1}", "at least 0"}},
      {"carrier: {jitter: {uniform: [0, 0.2]}}", {"carrier.jitter", "[0, 0.2]", "at most 0.05"}},
      {"carrier: {lag: -1}", {"carrier.lag", "-1", "at least 0 and at most 0.25"}},
      {"carrier: {backlash: 0.05}", {"carrier.backlash", "0.05", "at most 0.001"}},
      {"carrier: {frame: {scale: 2}}", {"carrier.frame.scale", "2", "at most 0.5"}},
      {"hole: {bore_tilt: 0.5}", {"hole.bore_tilt", "0.5", "at most 0.1"}},
      {"hole: {radius: 0.5}", {"hole.radius", "0.5", "unknown"}},
  };
  for (const Refused& c : cases) {
    const std::string text = refusal([&] { parseMismatch(c.text, "truth.yaml"); });
    EXPECT_EQ(text.rfind("truth.yaml: ", 0), 0u) << text;
    for (const char* word : c.words) {
      EXPECT_NE(text.find(word), std::string::npos) << c.text << "\n  says: " << text;
    }
    EXPECT_EQ(text.find('\n'), std::string::npos);
  }
  EXPECT_NE(refusal([] { loadMismatch("/no/such/file.yaml"); }).find("/no/such/file.yaml"),
            std::string::npos);
}

TEST(MismatchFile, ANumberOutOfRangeIsNoDraw) {
  EXPECT_EQ(refusal([] { parseMismatch("carrier: {latency: -1}", "truth.yaml"); }),
            "truth.yaml: carrier.latency: value -1: give a number of at least 0 and at most 0.25 "
            "[s]");
}

TEST(MismatchFile, NamesWhatAnArmDoesNotHave) {
  EXPECT_EQ(unusedWithArm(parseMismatch("carrier: {repeatability: 1.0e-5}", "truth.yaml")), "");
  EXPECT_EQ(unusedWithArm(parseMismatch("carrier: {reading_noise: 1.0e-5}", "truth.yaml"))
                .rfind("truth.yaml: carrier.reading_noise: has no effect", 0),
            0U);
}

// What only the scenario shows to be impossible.
TEST(MismatchFile, RefusesDrawsThatMakeNoScenario) {
  const Refused cases[] = {
      {"add: {hole.radius: -0.1}", {"add.hole.radius", "-0.1", "hole.radius", "narrower"}},
      {"add: {hole.radius: {normal: 0.01}}", {"add.hole.radius", "within 5 SD", "narrower"}},
      {"add: {friction: {normal: 0.1}}", {"add.friction", "within 5 SD", "friction.s"}},
      {"add: {peg.mass: {uniform: [-5, 0]}}", {"add.peg.mass", "peg.mass", "narrower"}},
      {"add: {friction: -0.5}", {"add.friction", "-0.5", "friction.s"}},
      {"add: {hole.chamfer.angle: 0.7}",
       {"add.hole.chamfer.angle", "0.7", "chamfer.angle would be", "narrower"}},
      {"add: {hole.chamfer.width: 0.07}",
       {"add.hole.chamfer.width", "0.07", "the block's wall is", "narrower"}},
      {"add: {carrier.stiffness: -1.0e6}", {"add.carrier.stiffness", "carrier.stiffness[0]"}},
      {"scale: {friction.static: 0.5}", {"scale.friction.static", "0.5", "friction.sliding"}},
      {"scale: {peg.inertia_axial: 6}", {"scale.peg.inertia_axial", "6", "inertia_transverse"}},
      {"scale: {coupling.stiffness.k26: 100}", {"scale.coupling.stiffness.k26", "100", "definite"}},
  };
  for (const Refused& c : cases) {
    const std::string text = refusal([&] { made(c.text); });
    for (const char* word : c.words) {
      EXPECT_NE(text.find(word), std::string::npos) << c.text << "\n  says: " << text;
    }
  }
}

// ---- what is drawn

// Means and spreads over many seeds against those of the distribution. Five standard errors: one
// test in a million fails by chance, and the seeds are fixed.
TEST(MismatchDraws, FollowTheirDistributions) {
  constexpr int n = 20000;
  struct Case {
    const char* draw;
    double mean, sd;  // of the drawn numbers
  };
  const double log_range = std::log(4.0);
  const double log_mean = (2.0 - 0.5) / log_range;
  const double log_square = (4.0 - 0.25) / (2 * log_range);
  const Case cases[] = {
      {"{normal: 0.01}", 1.0, 0.01},
      {"{uniform: [0.8, 1.1]}", 0.95, 0.3 / std::sqrt(12.0)},
      {"{log_uniform: [0.5, 2]}", log_mean, std::sqrt(log_square - log_mean * log_mean)},
      {"1.25", 1.25, 0.0},
  };
  for (const Case& c : cases) {
    const Mismatch mismatch =
        parseMismatch("scale: {peg.mass: " + std::string(c.draw) + "}", "test");
    double sum = 0.0, squares = 0.0;
    for (std::uint64_t seed = 0; seed < n; ++seed) {
      const double value = drawTruth(mismatch, seed).scale[0].values.at(0);
      sum += value;
      squares += (value - c.mean) * (value - c.mean);
    }
    EXPECT_NEAR(sum / n, c.mean, 5 * c.sd / std::sqrt(n) + 1e-12) << c.draw;
    // a variance has a relative standard error of at most sqrt(2/n)
    EXPECT_NEAR(squares / n, c.sd * c.sd, 5 * c.sd * c.sd * std::sqrt(2.0 / n) + 1e-12) << c.draw;
  }
}

TEST(MismatchDraws, NormalMeansOneForFactorsAndNothingElsewhere) {
  const Mismatch mismatch = parseMismatch(
      "exciter: {amplitude: {normal: 0.01}, harmonic: {normal: 0.01}}\n"
      "add: {peg.coupling_height: {normal: 1.0e-4}}\n",
      "test");
  double gain = 0.0, harmonic = 0.0, height = 0.0;
  constexpr int n = 4000;
  for (std::uint64_t seed = 0; seed < n; ++seed) {
    const Truth truth = drawTruth(mismatch, seed);
    gain += truth.imperfections.exciter.gain / n;
    harmonic += truth.imperfections.exciter.harmonic / n;
    height += truth.add[0].values.at(0) / n;
  }
  const double error = 5 / std::sqrt(n);
  EXPECT_NEAR(gain, 1.0, 0.01 * error);
  EXPECT_NEAR(harmonic, 0.0, 0.01 * error);
  EXPECT_NEAR(height, 0.0, 1e-4 * error);
}

// Magnitudes with a direction: fixed size, mean direction none, each axis a third of the square.
TEST(MismatchDraws, DirectionsAreRandom) {
  const Mismatch mismatch = parseMismatch(
      "sensor_a: {frame: {rotation: 0.01, offset: 0.002}}\nhole: {bore_tilt: 0.003}\n", "test");
  Vector3d sum = Vector3d::Zero(), squares = sum;
  Eigen::Vector2d tilts(0, 0), tilt_squares(0, 0);
  constexpr int n = 5000;
  for (std::uint64_t seed = 0; seed < n; ++seed) {
    const Truth truth = drawTruth(mismatch, seed);
    const Vector3d& rotation = truth.cell.sensor_a.rotation;
    EXPECT_NEAR(rotation.norm(), 0.01, 1e-15);
    EXPECT_NEAR(truth.cell.sensor_a.offset.norm(), 0.002, 1e-15);
    EXPECT_NEAR(truth.bore_tilt.norm(), 0.003, 1e-15);
    sum += rotation / 0.01;
    squares += rotation.cwiseAbs2() / 1e-4;
    tilts += truth.bore_tilt / 0.003;
    tilt_squares += truth.bore_tilt.cwiseAbs2() / 9e-6;
  }
  // an axis of a direction has variance 1/3, its square 1/5 − 1/9; in a plane 1/2 and 1/8
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(sum(i) / n, 0.0, 5 * std::sqrt(1.0 / 3 / n));
    EXPECT_NEAR(squares(i) / n, 1.0 / 3, 5 * std::sqrt(4.0 / 45 / n));
  }
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(tilts(i) / n, 0.0, 5 * std::sqrt(0.5 / n));
    EXPECT_NEAR(tilt_squares(i) / n, 0.5, 5 * std::sqrt(0.125 / n));
  }
}

TEST(MismatchDraws, OneForAllOrEachOnItsOwn) {
  const Truth one = drawn("scale: {carrier.stiffness: {uniform: [0.5, 1.5]}}");
  EXPECT_EQ(one.scale[0].values.size(), 1u);
  const Truth each = drawn("scale: {carrier.stiffness.each: {uniform: [0.5, 1.5]}}");
  ASSERT_EQ(each.scale[0].values.size(), 3u);
  EXPECT_NE(each.scale[0].values[0], each.scale[0].values[1]);
  // a plain number is the same for all
  const Truth plain = drawn(
      "scale: {carrier.stiffness.each: 1.5}\nsensor_a: {matrix: 0.01, drift: {force: 2}}\n"
      "carrier: {compliance: 1.0e-6}");
  EXPECT_EQ(plain.scale[0].values, (std::vector<double>{1.5, 1.5, 1.5}));
  EXPECT_EQ(plain.cell.sensor_a.matrix, Matrix6::Constant(0.01));
  EXPECT_EQ(plain.cell.sensor_a.drift.head<3>(), Vector3d::Constant(2.0));
  EXPECT_EQ(plain.imperfections.compliance, Vector3d::Constant(1e-6));
  const Truth matrix = drawn("sensor_a: {matrix: {normal: 0.01}}");
  EXPECT_NE(matrix.cell.sensor_a.matrix(0, 0), matrix.cell.sensor_a.matrix(5, 5));
}

// A key that is added or taken away changes no other draw, nor does its place in the file.
TEST(MismatchDraws, StreamsAreIndependent) {
  const Truth whole = drawn(kWhole, 77);
  const Truth alone = drawn("sensor_a: {latency: {uniform: [0, 1.0e-3]}}", 77);
  EXPECT_EQ(alone.cell.sensor_a.latency, whole.cell.sensor_a.latency);
  const Truth turned = drawn(
      "hole: {bore_tilt: {uniform: [0, 0.0035]}}\nscale: {friction: {uniform: [0.5, 1.5]}}", 77);
  EXPECT_EQ(turned.bore_tilt, whole.bore_tilt);
  EXPECT_EQ(turned.scale[0].values, whole.scale.back().values);
  // other seeds and other keys draw others
  EXPECT_NE(drawn(kWhole, 78).bore_tilt, whole.bore_tilt);
  EXPECT_NE(whole.cell.sensor_a.matrix, whole.cell.sensor_b.matrix);
}

// ---- the scenario it makes

TEST(TrueScenario, ScalesAndAdds) {
  const Scenario nominal = cell();
  const Mechanism& m = nominal.mechanism;
  Mechanism t = made(
                    "scale: {peg.mass: 1.1, carrier.mass: 0.9, friction: 0.5, gravity: 2}\n"
                    "add: {hole.radius: 1.0e-5, peg.exciter_height: -0.001}")
                    .mechanism;
  EXPECT_DOUBLE_EQ(t.peg.mass, 1.1 * m.peg.mass);
  EXPECT_DOUBLE_EQ(t.peg.inertia_transverse, 1.1 * m.peg.inertia_transverse);
  EXPECT_DOUBLE_EQ(t.peg.inertia_axial, 1.1 * m.peg.inertia_axial);
  EXPECT_DOUBLE_EQ(t.carrier.inertia, 0.9 * m.carrier.inertia);
  EXPECT_DOUBLE_EQ(t.friction.static_coefficient, 0.5 * m.friction.static_coefficient);
  EXPECT_DOUBLE_EQ(t.friction.sliding_coefficient, 0.5 * m.friction.sliding_coefficient);
  EXPECT_DOUBLE_EQ(t.gravity, 2 * m.gravity);
  EXPECT_DOUBLE_EQ(t.hole.radius, m.hole.radius + 1e-5);
  EXPECT_DOUBLE_EQ(t.peg.exciter_height, m.peg.exciter_height - 0.001);

  t = made("scale: {coupling.stiffness: 1.2, 'carrier.stiffness[1]': 0.8}").mechanism;
  EXPECT_TRUE(t.coupling.stiffness.diagonal.isApprox(1.2 * m.coupling.stiffness.diagonal, 1e-15));
  EXPECT_DOUBLE_EQ(t.coupling.stiffness.k26, 1.2 * m.coupling.stiffness.k26);
  EXPECT_EQ(t.carrier.stiffness[0], m.carrier.stiffness[0]);
  EXPECT_DOUBLE_EQ(t.carrier.stiffness[1], 0.8 * m.carrier.stiffness[1]);

  const Truth truth = drawn("scale: {coupling.stiffness.each: {uniform: [0.7, 1.3]}}");
  t = trueScenario(nominal, truth, "test").mechanism;
  const std::vector<double>& f = truth.scale[0].values;
  for (int i = 0; i < 6; ++i) {
    EXPECT_DOUBLE_EQ(t.coupling.stiffness.diagonal[i],
                     f[static_cast<std::size_t>(i)] * m.coupling.stiffness.diagonal[i]);
  }
  EXPECT_DOUBLE_EQ(t.coupling.stiffness.k26, std::sqrt(f[1] * f[5]) * m.coupling.stiffness.k26);
  EXPECT_DOUBLE_EQ(t.coupling.stiffness.k35, std::sqrt(f[2] * f[4]) * m.coupling.stiffness.k35);
}

// A longer peg hangs from the same coupling: its centre of mass goes down along its axis.
// The hole of the true peg: with a peg of another radius the clearance is the drawn one's multiple.
TEST(TrueScenario, ClearanceIsThatOfTheTruePeg) {
  const Mechanism m = cell().mechanism;
  const double drawn_clearance = m.hole.radius - m.peg.radius;
  for (const double factor : {0.3, 1.0, 2.5, -0.1}) {
    const Mechanism t =
        made("scale: {clearance: " + std::to_string(factor) + "}\nadd: {peg.radius: 1.0e-4}")
            .mechanism;
    EXPECT_DOUBLE_EQ(t.peg.radius, m.peg.radius + 1e-4);
    EXPECT_NEAR(t.hole.radius, t.peg.radius + factor * drawn_clearance, 1e-15);
  }
  Scenario none = cell();
  none.mechanism.hole.radius = none.mechanism.peg.radius;
  const std::string text = refusal([&] {
    trueScenario(none, drawTruth(parseMismatch("scale: {clearance: 2}", "test"), 1), "truth.yaml");
  });
  EXPECT_NE(text.find("truth.yaml: scale.clearance: value 2: the scenario draws no clearance"),
            std::string::npos)
      << text;
  Scenario wide = cell();
  wide.mechanism.hole.radius = 0.026;
  const std::string no_hole = refusal([&] {
    trueScenario(wide,
                 drawTruth(parseMismatch("scale: {clearance: {uniform: [-50, 1]}}", "test"), 1),
                 "truth.yaml");
  });
  EXPECT_NE(no_hole.find("the true hole.radius would be -0.02"), std::string::npos) << no_hole;
}

TEST(TrueScenario, PegHangsFromItsCoupling) {
  const Scenario nominal = cell(), longer = made("add: {peg.coupling_height: 0.001}");
  const Vector3d axis = rotationFromEuler(nominal.initial.euler).col(2);
  EXPECT_LT((nominal.initial.position - longer.initial.position - 0.001 * axis).norm(), 1e-15);
  EXPECT_EQ(longer.rest.z, nominal.rest.z);
}

// The block turns against everything else: seen from it, start and base turn the other way about
// the peg's bottom centre, and the distance of peg and carrier stays.
TEST(TrueScenario, FaceTilts) {
  const Scenario nominal = cell();
  const Truth truth = drawn("hole: {face_tilt: 0.02}");
  EXPECT_NEAR(truth.face_tilt.norm(), 0.02, 1e-15);
  const Scenario s = trueScenario(nominal, truth, "test");
  const double h = nominal.mechanism.peg.half_height;
  const auto axis = [](const Scenario& of) -> Vector3d {
    return rotationFromEuler(of.initial.euler).col(2);
  };
  const Vector3d bottom = nominal.initial.position - h * axis(nominal);
  EXPECT_LT((s.initial.position - h * axis(s) - bottom).norm(), 1e-15);
  // Rodrigues' formula by hand, for the inverse turn
  const Vector3d n(truth.face_tilt.x() / 0.02, truth.face_tilt.y() / 0.02, 0.0), a = axis(nominal);
  const Vector3d turned =
      a * std::cos(0.02) - n.cross(a) * std::sin(0.02) + n * n.dot(a) * (1 - std::cos(0.02));
  EXPECT_LT((axis(s) - turned).norm(), 1e-14);
  const Vector3d before = poseFromRest(nominal.rest).p - nominal.initial.position;
  const Vector3d after = poseFromRest(s.rest).p - s.initial.position;
  EXPECT_NEAR(after.norm(), before.norm(), 1e-15);
  EXPECT_NEAR(after.dot(axis(s)), before.dot(axis(nominal)), 1e-15);
}

TEST(TrueScenario, BoreLeansByItsTilt) {
  const Truth truth = drawn("hole: {bore_tilt: 0.0087}");
  const Eigen::Vector2d& lean = truth.imperfections.bore_lean;
  const Vector3d axis = Vector3d(lean.x(), lean.y(), 1.0).normalized();
  const Vector3d turn(truth.bore_tilt.x(), truth.bore_tilt.y(), 0.0);
  EXPECT_LT((axis - Eigen::AngleAxisd(0.0087, turn / 0.0087) * Vector3d::UnitZ()).norm(), 1e-15);
}

}  // namespace
}  // namespace assembly_cell
