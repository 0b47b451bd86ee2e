// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/calibration/payload/payload.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iostream>
#include <iterator>
#include <optional>
#include <sstream>

#include "assembly_cell/base/files.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/options.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_text.h"
#include "assembly_cell/calibration/payload/payload_check.h"
#include "assembly_cell/calibration/payload/payload_files.h"
#include "assembly_cell/description/joint_chain.h"
#include "commands.h"
#include "print.h"

namespace assembly_cell {

namespace {

constexpr const char* kHelp =
    R"(Usage: calibrate payload POSES.csv WRENCHES.csv [options]
       calibrate payload RECORDING.csv [options]

Weight, centre of mass and bias from static poses under gravity, with drift, breaks and outliers found by tests.
POSES.csv: x,y,z,qx,qy,qz,qw of the sensor in the base [m, unit quaternion], one row a pose in the order recorded; or by a
header r11,r12 ... r33 (the rotation, row by row); or with --urdf the joints' positions by name, j1,j2 ..., or in their
order. RECORDING.csv: poses and wrenches in one file with a header. Optional
columns order (also: index, time, t; rising) and temperature. WRENCHES.csv: fx,fy,fz,tx,ty,tz [N, N m] about the sensor's origin.
A header row is optional; without one the columns are those above, an eighth of the poses is the order.

  --urdf FILE          the robot: POSES.csv has joint positions [rad], [m]
  --link LINK          of the robot, whose axes are the sensor's; for --urdf
  --axes A             in which the wrenches are given: base, sensor or auto (default: the reading that fits)
  --predict FILE       poses of further readings; without an order column row k lies between poses k and k+1
  --output FILE        where the predicted wrenches go as CSV, axes and header as in WRENCHES.csv (default: only into the YAML)
  --holdout            print the leave-one-out error of every pose besides its rms
  --trace FILE         bias, its sd and the residual at every pose as CSV (scripts/plot payload)
  --in-situ            correction matrix of the sensor, if the data support it
  --gravity G          where it was recorded, for the mass of the weight [m/s2] (default: the length of
                       the columns gx,gy,gz of POSES.csv, else 9.80665)
  --upside-down        the base hangs from a ceiling: its z points along gravity
  --weight W           known weight [N]: fixes the scale of the correction matrix
  --no-drift, --no-breaks, --keep-outliers    leave a part out, to see what it changes
  --help               print this

Exit code: 0 ok, 1 the data do not determine the payload (status refused) or contradict it (status doubtful: the reason is
in the YAML with what was found; nothing is predicted), 2 bad input.

Example: calibrate payload poses.csv wrenches.csv --predict new_poses.csv --output predicted.csv --holdout
)";

struct Options {
  std::string poses, wrenches, predict, output, trace, urdf, link;
  PayloadOptions payload;
  std::optional<double> gravity;
  bool upside_down = false, holdout = false;
};

// false after --help
bool parseOptions(const std::vector<std::string>& arguments, Options& options) {
  PayloadOptions& payload = options.payload;
  OptionParser parser(kHelp);
  parser.file("file POSES.csv", options.poses);
  parser.file("file WRENCHES.csv", options.wrenches, false);
  parser.text("--urdf", options.urdf);
  parser.text("--link", options.link);
  parser.choice(
      "--axes", payload.axes,
      {{"base", WrenchAxes::kBase}, {"sensor", WrenchAxes::kSensor}, {"auto", WrenchAxes::kAuto}});
  parser.text("--predict", options.predict);
  parser.text("--output", options.output);
  parser.text("--trace", options.trace);
  parser.number(
      "--weight", payload.known_weight, [](double v) { return v > 0.0; },
      "give a positive number of N");
  parser.number("--gravity", options.gravity, 9.7, 9.9);
  parser.flag("--upside-down", options.upside_down);
  parser.flag("--holdout", options.holdout);
  parser.flag("--in-situ", payload.in_situ);
  parser.flag("--no-drift", payload.drift, false);
  parser.flag("--no-breaks", payload.breaks, false);
  parser.flag("--keep-outliers", payload.outliers, false);
  if (!parser.parse(arguments)) return false;
  if (options.wrenches.empty()) options.wrenches = options.poses;
  if (options.urdf.empty() != options.link.empty()) {
    throw InputError("--urdf, --link: one of them: give both, the robot and the sensor's link");
  }
  if (!options.output.empty() && options.predict.empty()) {
    throw InputError("--output: nothing to write: give --predict FILE too");
  }
  if (payload.known_weight && !payload.in_situ) {
    throw InputError("--weight: serves the correction matrix: give --in-situ too");
  }
  return true;
}

// ---- YAML

template <typename Items, typename Text>
std::string items(const Items& values, Text text_of) {
  std::string text;
  for (const auto& value : values) text += (text.empty() ? "" : ", ") + text_of(value);
  return "[" + text + "]";
}

std::string rowMajor(const Eigen::MatrixXd& m) {
  std::string data;
  for (Eigen::Index r = 0; r < m.rows(); ++r) {
    for (Eigen::Index c = 0; c < m.cols(); ++c) {
      data += (data.empty() ? "" : ", ") + yamlNumber(m(r, c));
    }
  }
  return "{rows: " + std::to_string(m.rows()) + ", cols: " + std::to_string(m.cols()) +
         ", data: [" + data + "]}";
}

const std::array<const char*, 6> kAxisNames = {"fx", "fy", "fz", "tx", "ty", "tz"};

void printTests(std::ostream& out, const char* name, const std::array<SequenceTest, 6>& tests) {
  const auto column = [&](auto member) {
    return items(tests, [&](const SequenceTest& t) { return yamlNumber(t.*member); });
  };
  out << "  " << name << ": {lag1: " << column(&SequenceTest::lag1)
      << ", lag1_p: " << column(&SequenceTest::lag1_p)
      << ", runs_p: " << column(&SequenceTest::runs_p) << "}\n";
}

std::string number(double value) {
  std::ostringstream text;
  text.precision(3);
  text << value;
  return text.str();
}

constexpr double kGravity = 9.80665;  // standard, for the mass of a weight [m/s²]

// Tilt of the base's z against gravity, up or down, whichever is nearer.
struct BaseTilt {
  double angle, sd;
  Eigen::Vector3d down;
};

BaseTilt tiltOf(const PayloadModel& m) {
  BaseTilt out;
  out.down = m.gravity / m.weight;
  const Eigen::Vector2d level = out.down.head<2>();
  out.angle = std::atan2(level.norm(), std::abs(out.down.z()));
  // uncertainty of the two level components, along the tilt or any direction
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();
  if (level.norm() > 1e-12) along.head<2>() = level.normalized();
  const Eigen::Vector3d across = along - out.down.dot(along) * out.down;
  out.sd = std::sqrt(across.dot(m.gravity_covariance * across)) / m.weight;
  return out;
}

// The result in words.
std::vector<std::string> findings(const PayloadModel& m, const std::vector<std::string>& doubts) {
  // what follows from doubtful readings names no cause
  if (!doubts.empty()) return doubts;
  std::vector<std::string> out;
  const BaseTilt tilt = tiltOf(m);
  if (tilt.angle > 5.0 * tilt.sd && tilt.angle > kLevelBase) {
    out.push_back("the base hangs askew: gravity points along (" + number(tilt.down.x()) + ", " +
                  number(tilt.down.y()) + ", " + number(tilt.down.z()) + ") of its axes, " +
                  number(tilt.angle * 180.0 / M_PI) + " +- " + number(tilt.sd * 180.0 / M_PI) +
                  " deg off its z");
  }
  const std::size_t before = out.size();
  if (!m.structure_tested) {
    out.push_back("too few poses to test for drift and breaks (16 needed): bias taken as constant");
    return out;
  }
  for (const BiasBreak& b : m.breaks) {
    out.push_back("bias breaks before pose " + std::to_string(b.pose) + ": a new recording begins");
  }
  for (std::size_t a = 0; a < 6; ++a) {
    const DriftShape shape = m.group[a / 3].component[a % 3].shape;
    if (shape == DriftShape::kNone) continue;
    std::string text =
        std::string("bias drifts in sensor ") + kAxisNames[a] + " (" + toString(shape) + "):";
    for (std::size_t r = 0; r < m.drift[a].size(); ++r) {
      text += (r == 0 ? " " : ", then ") + number(m.drift[a][r].change) + " +- " +
              number(m.drift[a][r].sd);
    }
    out.push_back(text + (a < 3 ? " N" : " N m"));
  }
  for (std::size_t a = 0; a < 6; ++a) {
    if (!m.group[a / 3].component[a % 3].temperature) continue;
    const auto k = static_cast<Eigen::Index>(a);
    out.push_back(std::string("bias follows temperature in sensor ") + kAxisNames[a] + ": " +
                  number(m.temperature_coefficient[k]) + " +- " + number(m.temperature_sd[k]) +
                  " per K");
  }
  if (!m.rejected.empty()) {
    out.push_back(std::to_string(m.rejected.size()) +
                  " poses do not fit the others and were left out");
  }
  if (out.size() == before) out.push_back("no drift, no break, no outlier");
  return out;
}

// five lines for the person who reads no further
void printSummary(std::ostream& out, const PayloadModel& m, double gravity,
                  const std::vector<std::string>& found) {
  const Eigen::Vector3d c = 1e3 * m.center_of_mass;
  const Eigen::Vector3d sd = 1e3 * m.center_covariance.diagonal().cwiseSqrt();
  out << text("# mass %.4f +- %.4f kg\n", m.weight / gravity, m.weight_sd / gravity)
      << text("# centre of mass (%.2f, %.2f, %.2f) +- (%.2f, %.2f, %.2f) mm in sensor axes\n",
              c.x(), c.y(), c.z(), sd.x(), sd.y(), sd.z())
      << text("# bias (%.3f, %.3f, %.3f) N, (%.4f, %.4f, %.4f) N m\n", m.bias[0], m.bias[1],
              m.bias[2], m.bias[3], m.bias[4], m.bias[5])
      << text("# %zu poses used, %zu left out; held out, one is met to %.3f N, %.4f N m (rms)\n",
              m.used.size(), m.rejected.size(), m.held_out_rms.force, m.held_out_rms.torque)
      << "# " << found.front()
      << (found.size() > 1 ? text("; %zu more under findings", found.size() - 1) : "") << "\n";
}

void printModel(std::ostream& out, const PayloadModel& m, bool holdout, double gravity,
                const std::vector<std::string>& found) {
  out << "axes: " << toString(m.axes) << "\n";
  out << "axes_residual: {base: " << yamlNumber(m.base_residual)
      << ", sensor: " << yamlNumber(m.sensor_residual) << "}\n";
  out << "poses: " << m.used.size() << "\n";
  out << "rejected: " << items(m.rejected, [](std::size_t i) { return std::to_string(i); }) << "\n";
  out << "weight: " << yamlNumber(m.weight) << "\n";
  out << "weight_sd: " << yamlNumber(m.weight_sd) << "\n";
  out << "weight_vector: " << list(m.gravity) << "\n";
  out << "weight_covariance: " << rowMajor(m.gravity_covariance) << "\n";
  out << "gravity_direction: " << list(Eigen::Vector3d(m.gravity / m.weight)) << "\n";
  out << "mass: " << yamlNumber(m.weight / gravity) << "\n";
  out << "mass_sd: " << yamlNumber(m.weight_sd / gravity) << "\n";
  const BaseTilt tilt = tiltOf(m);
  out << "base_tilt: {angle: " << yamlNumber(tilt.angle) << ", sd: " << yamlNumber(tilt.sd)
      << "}\n";
  out << "center_of_mass: " << list(m.center_of_mass) << "\n";
  out << "center_of_mass_sd: " << list(Eigen::Vector3d(m.center_covariance.diagonal().cwiseSqrt()))
      << "\n";
  out << "center_of_mass_covariance: " << rowMajor(m.center_covariance) << "\n";
  out << "bias: " << list(m.bias) << "\n";
  out << "bias_sd: " << list(m.bias_sd) << "\n";
  out << "bias_last: " << list(m.last_bias) << "\n";
  out << "bias_last_sd: " << list(m.last_bias_sd) << "\n";

  bool significant = false;
  for (const BiasGroup& group : m.group) {
    for (const BiasComponent& c : group.component) significant |= c.shape != DriftShape::kNone;
  }
  out << "drift:\n  significant: " << (significant ? "true" : "false") << "\n";
  for (std::size_t a = 0; a < 6; ++a) {
    const BiasComponent& c = m.group[a / 3].component[a % 3];
    out << "  " << kAxisNames[a] << ": {shape: " << toString(c.shape) << ", change: "
        << items(m.drift[a], [](const DriftSize& d) { return yamlNumber(d.change); })
        << ", change_sd: " << items(m.drift[a], [](const DriftSize& d) { return yamlNumber(d.sd); })
        << ", likelihood_ratio: " << yamlNumber(c.drift_gain) << ", noise: " << yamlNumber(c.noise)
        << "}\n";
  }
  if (m.breaks.empty()) {
    out << "breaks: []\n";
  } else {
    out << "breaks:\n";
    for (const BiasBreak& b : m.breaks) {
      out << "  - {pose: " << b.pose << ", order: " << yamlNumber(b.order)
          << ", jump: " << list(b.jump) << ", jump_sd: " << list(b.jump_sd)
          << ", criterion_gain: " << yamlNumber(b.gain) << "}\n";
    }
  }
  if (m.has_temperature) {
    out << "temperature: {mean: " << yamlNumber(m.temperature_mean)
        << ", coefficient: " << list(m.temperature_coefficient)
        << ", sd: " << list(m.temperature_sd) << "}\n";
  } else {
    out << "temperature: null\n";
  }
  for (const auto& [key, rms] : {std::pair{"residual_rms", m.rms},
                                 {"plain_rms", m.plain_rms},
                                 {"held_out_rms", m.held_out_rms}}) {
    out << key << ": {force: " << yamlNumber(rms.force) << ", torque: " << yamlNumber(rms.torque)
        << "}\n";
  }
  if (holdout) {
    out << "held_out:\n";
    for (std::size_t i = 0; i < m.used.size(); ++i) {
      out << "  - {pose: " << m.used[i] << ", error: " << list(m.held_out[i]) << "}\n";
    }
  }
  out << "tests:\n  structure: " << (m.structure_tested ? "true" : "false") << "\n";
  printTests(out, "plain", m.plain_test);
  printTests(out, "final", m.final_test);
  out << "findings:\n";
  for (const std::string& text : found) out << "  - \"" << text << "\"\n";
}

void printPlain(std::ostream& out, const PlainPayload& p, double gravity) {
  out << "plain: {mass: " << yamlNumber(p.gravity.norm() / gravity)
      << ", mass_sd: " << yamlNumber(p.weight_sd / gravity)
      << ", level: " << (p.level ? "true" : "false") << ", level_p: " << yamlNumber(p.level_p)
      << ", weight_vector: " << list(p.gravity) << ",\n  center_of_mass: " << list(p.center_of_mass)
      << ", center_of_mass_sd: " << list(p.center_sd) << ",\n  bias: " << list(p.bias)
      << ", bias_sd: " << list(p.bias_sd) << "}\n";
}

void printInSitu(std::ostream& out, const InSituCorrection& c) {
  out << "in_situ:\n  given: " << (c.given ? "true" : "false") << "\n  reason: \"" << c.reason
      << "\"\n  p: " << yamlNumber(c.p) << "\n  largest_sd: " << yamlNumber(c.largest_sd)
      << "\n  matrix: " << (c.given ? rowMajor(c.matrix) : "null") << "\n";
}

void writeNew(const std::string& path, const std::string& text) {
  NewFile file(path, path, "give a place that can");
  file.write(text);
  file.finish();
}

std::string csvRow(const Vector6& w) {
  std::string text;
  for (int k = 0; k < 6; ++k) text += (k == 0 ? "" : ",") + yamlNumber(w[k]);
  return text;
}

void traceTo(const std::string& path, const PayloadModel& m, const std::vector<StaticPose>& poses) {
  std::string text = "pose,order";
  for (const char* kind : {"bias_", "sd_", "residual_"}) {
    for (const char* axis : kAxisNames) text += std::string(",") + kind + axis;
  }
  text += "\n";
  for (std::size_t i = 0; i < m.used.size(); ++i) {
    const PredictedWrench b = predictBias(m, m.order[i], poses[m.used[i]].temperature);
    text += std::to_string(m.used[i]) + "," + yamlNumber(m.order[i]) + "," + csvRow(b.wrench) +
            "," + csvRow(b.sd) + "," + csvRow(m.residual[i]) + "\n";
  }
  writeNew(path, text);
}

std::optional<JointAngles> jointsOf(const Options& options) {
  if (options.urdf.empty()) return std::nullopt;
  std::ifstream file(options.urdf);
  if (!file) throw InputError(options.urdf + ": file missing or unreadable: give a URDF");
  const std::string urdf{std::istreambuf_iterator<char>(file), {}};
  const JointChain chain = loadJointChain(urdf, options.link, options.urdf);
  JointAngles out;
  for (const JointChain::Joint& joint : chain.joints) out.names.push_back(joint.name);
  out.rotation = [chain](const std::vector<double>& q) { return linkPose(chain, q).R; };
  return out;
}

void predict(const Options& options, const Poses& further, const std::vector<StaticPose>& given,
             bool header, const PayloadModel& model, std::ostream& out) {
  // without an order row k lies between poses k and k + 1
  const double step = (given.back().order - given.front().order) /
                      static_cast<double>(std::max<std::size_t>(given.size() - 1, 1));
  std::string csv = header ? "fx,fy,fz,tx,ty,tz\n" : "";
  out << "prediction:\n";
  for (std::size_t k = 0; k < further.values.size(); ++k) {
    StaticPose pose = further.values[k];
    if (!further.ordered) {
      pose.order =
          k + 1 < given.size()
              ? 0.5 * (given[k].order + given[k + 1].order)
              : given.back().order +
                    (static_cast<double>(k + 1) + 0.5 - static_cast<double>(given.size())) * step;
    }
    const PredictedWrench w = predictWrench(model, pose);
    out << "  - {order: " << yamlNumber(pose.order) << ", wrench: " << list(w.wrench)
        << ", sd: " << list(w.sd) << "}\n";
    csv += csvRow(w.wrench) + "\n";
  }
  if (!options.output.empty()) writeNew(options.output, csv);
}

int run(const Options& options, std::ostream& out) {
  const std::optional<JointAngles> joints = jointsOf(options);
  const JointAngles* angles = joints ? &*joints : nullptr;
  Poses poses = readPoses(options.poses, angles);
  const Wrenches wrenches = readWrenches(options.wrenches);
  if (options.wrenches == options.poses && !wrenches.header) {
    throw InputError(
        "argument: value missing: give a file WRENCHES.csv, or one RECORDING.csv with a header");
  }
  if (poses.values.size() != wrenches.values.size()) {
    throw InputError(options.wrenches + ": " + std::to_string(wrenches.values.size()) +
                     " rows for " + std::to_string(poses.values.size()) + " poses of " +
                     options.poses + ": give one wrench a pose");
  }
  for (std::size_t i = 0; i < wrenches.temperature.size(); ++i) {
    poses.values[i].temperature = wrenches.temperature[i];
  }
  Poses further;
  if (!options.predict.empty()) further = readPoses(options.predict, angles);

  const PayloadModel model = identifyPayload(poses.values, wrenches.values, options.payload);
  const double gravity = options.gravity.value_or(poses.gravity.value_or(kGravity));
  const std::vector<std::string> doubts = checkPayload(poses.values, poses.others, wrenches.values,
                                                       model, {gravity, options.upside_down});
  if (model.refusal) {
    // the cause in place of what follows from it
    const std::string reason = doubts.empty() ? model.refusal.text : doubts.front();
    out << "status: refused\nreason: \"" << reason << "\"\n";
    std::cerr << "calibrate: " << reason << "\n";
    return 1;
  }
  const std::vector<std::string> found = findings(model, doubts);
  printSummary(out, model, gravity, found);
  if (doubts.empty()) {
    // parameters of arm_bridge
    out << "status: ok\npayload_mass: " << yamlNumber(model.weight / gravity)
        << "\npayload_centre: " << list(model.center_of_mass) << "\n";
  } else {
    out << "status: doubtful\nreason: \"" << doubts.front() << "\"\n";
  }
  printModel(out, model, options.holdout, gravity, found);
  printPlain(out,
             plainPayload(poses.values, inSensorAxes(poses.values, wrenches.values, model.axes)),
             gravity);
  if (options.payload.in_situ) printInSitu(out, model.in_situ);
  if (!options.trace.empty()) traceTo(options.trace, model, poses.values);
  if (!doubts.empty()) {
    std::cerr << "calibrate: " << doubts.front() << "\n";
    return 1;
  }
  if (options.predict.empty()) return 0;
  predict(options, further, poses.values, wrenches.header, model, out);
  return 0;
}

}  // namespace

int payload(const std::vector<std::string>& arguments) {
  Options options;
  if (!parseOptions(arguments, options)) return 0;
  // nothing is printed of what ends in a refusal
  std::ostringstream text;
  const int code = run(options, text);
  std::cout << text.str();
  return code;
}

}  // namespace assembly_cell
