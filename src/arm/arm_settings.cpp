// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_settings.h"

#include <filesystem>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {
namespace {

constexpr double kMost = NumberField::kMost, kLeast = NumberField::kLeast;

// What only the node of such a file asks for.
void skip(yaml::Section& in, std::initializer_list<const char*> keys) {
  for (const char* key : keys) in.optional(key);
}

void needJoints(yaml::Section& in) {
  for (const char* key : {"interface", "state"}) {
    const std::string value = in.choice(key, {"joints", "pose", "twist"}, "joints");
    if (value != "joints") in.refuse(in.at(key), value, "without ROS only joints are emulated");
  }
}

BridgeSettings loadBridge(const std::string& path) {
  yaml::Section in(yaml::loadYaml(yaml::fileText(path, "parameters of arm_bridge"), path,
                                  yaml::FileKind::kArmBridge),
                   "", path);
  BridgeSettings settings;
  readFields(in, fieldsOf(settings));
  needJoints(in);
  skip(in, {"description", "base_frame", "twist_gain", "lease", "payload_mass", "payload_centre",
            "publish_frames"});
  in.finish();
  return settings;
}

void loadArm(const std::string& path, ArmSetup& setup) {
  yaml::Section in(yaml::loadYaml(yaml::fileText(path, "parameters of emulate_arm"), path,
                                  yaml::FileKind::kEmulatedArm),
                   "", path);
  readFields(in, fieldsOf(setup.arm));
  needJoints(in);
  skip(in, {"description", "seed"});
  const ArmKinematics kinematics(setup.urdf, setup.place.flange, setup.source);
  const auto joints = static_cast<std::size_t>(kinematics.joints());
  setup.home.assign(joints, 0.0);
  if (in.has("home")) setup.home = in.numbers("home", joints);
  in.finish();
}

}  // namespace

std::vector<NumberField> fieldsOf(BridgeSettings& settings) {
  ArmLimits& limits = settings.limits;
  MotionLimits& motion = limits.motion;
  GuardLimits& guard = limits.guard;
  return {
      {"rate", 20.0, 2000.0, &settings.rate},
      {"smoothing", 0.0, 0.1, &settings.smoothing},
      {"workspace", -kMost, kMost, settings.workspace.data(), settings.workspace.size()},
      {"max_speed", 1e-3, 0.25, &motion.speed},
      {"max_acceleration", 1e-2, 10.0, &motion.acceleration},
      {"max_rotation", 0.0, 1.0, &guard.rotation},
      {"max_force", kLeast, kMost, &guard.force},
      {"max_torque", kLeast, kMost, &guard.torque},
      {"max_amplitude", 0.0, kMost, &guard.amplitude},
      {"max_frequency", 0.0, kMost, &guard.frequency},
      {"max_raw_force", kLeast, kMost, &limits.raw_force},
      {"max_raw_torque", kLeast, kMost, &limits.raw_torque},
      {"max_force_rate", kLeast, kMost, &limits.force_rate},
      {"saturated_time", 0.0, 0.1, &limits.saturated_time},
      {"max_following", kLeast, kMost, &limits.following},
      {"max_following_turn", kLeast, kMost, &limits.following_turn},
      {"following_time", 1e-3, 0.25, &limits.following_time},
      {"timeout", 0.04, 10.0, &limits.timeout},
      {"delay", 0.0, 1.0, &limits.delay},
  };
}

std::vector<NumberField> fieldsOf(EmulatedArmParameters& p) {
  return {
      {"rate", 125.0, 500.0, &p.rate},
      {"latency", 0.0, 0.05, &p.latency},
      {"jitter", 0.0, 0.05, &p.jitter},
      {"bandwidth", 2.0, 40.0, &p.bandwidth},
      {"encoder_step", 0.0, 1e-2, &p.encoder_step},
      {"repeatability", 0.0, 1e-3, &p.repeatability},
      {"compliance", -kMost, kMost, p.compliance.data(), 6},
      {"protective_force", kLeast, kMost, &p.protective_force},
      {"protective_torque", kLeast, kMost, &p.protective_torque},
  };
}

ArmGuard bridgeGuard(const BridgeSettings& settings, const Mechanism& mechanism, LeaseMode lease,
                     bool lockstep, const std::string& source) {
  ArmLimits limits = settings.limits;
  for (int i = 0; i < 3; ++i) {
    const double from = settings.workspace[static_cast<std::size_t>(2 * i)];
    const double to = settings.workspace[static_cast<std::size_t>(2 * i + 1)];
    limits.guard.box_min(i) = from;
    limits.guard.box_max(i) = to;
    if (from < to) continue;
    throw InputError(source + text("workspace is %g to %g m along %c: give the lower end first",
                                   from, to, "xyz"[i]));
  }
  if (settings.smoothing * settings.rate > static_cast<double>(CommandMotion::kLongest)) {
    throw InputError(source +
                     text("smoothing: %g s are more than %zu points at the rate: give less",
                          settings.smoothing, CommandMotion::kLongest));
  }
  limits.motion.arm = mechanism.peg.coupling_height + mechanism.peg.half_height;
  const Braking braking{couplingStiffness(mechanism.coupling), limits.motion.acceleration,
                        limits.motion.arm};
  ArmGuard arm = armGuard(limits, braking, lease, lockstep);
  setRate(arm, 1.0 / settings.rate, settings.smoothing);
  return arm;
}

ArmSetup loadArmSetup(const std::string& path) {
  yaml::Section in(yaml::loadYaml(yaml::fileText(path, "arm"), path, yaml::FileKind::kArm), "",
                   path);
  in.integer("format", 1, 1);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  const auto file = [&](const char* key) {
    return (folder / in.text(key, "give a file, relative to this one")).string();
  };
  ArmSetup setup;
  setup.file = path;
  setup.source = file("urdf");
  setup.urdf = yaml::fileText(setup.source, "URDF of an arm");
  setup.place = loadCellPlace(file("place"));
  setup.bridge = loadBridge(file("bridge"));
  loadArm(file("arm"), setup);
  in.finish();
  return setup;
}

}  // namespace assembly_cell
