// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_settings.h"

#include <filesystem>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/base/yaml_section.h"

namespace assembly_cell {
namespace {

const std::vector<std::string> kInterfaces = {"pose", "twist", "joints"};

template <class Settings>
void readFile(const std::string& path, const char* what, yaml::FileKind kind, Settings& settings) {
  yaml::Section in(yaml::loadYaml(yaml::fileText(path, what), path, kind), "", path);
  in.read(fieldsOf(settings));
  in.finish();
  for (const Field& field : fieldsOf(settings)) {
    if (field.path != "interface" && field.path != "state") continue;
    const std::string& value = field.names[static_cast<std::size_t>(field.get())];
    if (value != "joints") {
      in.refuse(in.at(field.path), value, "without ROS only joints are emulated");
    }
  }
}

}  // namespace

void fields(FieldList& f, BridgeSettings& s) {
  ArmLimits& limits = s.limits;
  MotionLimits& motion = limits.motion;
  GuardLimits& guard = limits.guard;
  f.choice("interface", s.interface, kInterfaces,
           "Commands: joints (JointTrajectory on arm/command), pose (PoseStamped on "
           "arm/target_frame), twist (TwistStamped on arm/twist).");
  f.choice("state", s.state, {"joints", "pose"},
           "State: joints (arm/joint_states) or pose of the flange (arm/current_pose).");
  f.choice("sensors", limits.sensors, sensorChoices(),
           "Force sensors of the cell: both, or b (sensor_b alone, at the wrist).");
  f.text("description", s.description, "Parameter with the arm's URDF.");
  f.text("base_frame", s.base_frame,
         "Frame of poses and twists; empty: the root link of the URDF.");
  f.number("rate", s.rate, {20.0, 2000.0, "Hz"}, "Points per second.");
  f.number("smoothing", s.smoothing, {0.0, 0.1, "s"},
           "A point is the mean of those within this time: makes the acceleration continuous.");
  f.number("twist_gain", s.twist_gain, {0.0, 100.0, "1/s"},
           "Gain of the following error in twists.");
  f.choice("lease", s.lease, {"auto", "required", "none"},
           "Who may command: auto, required (only with a lease), none (leases are ignored).");
  f.number("payload_mass", s.payload_mass, {0.0, 100.0, "kg"},
           "Mass below sensor_b, as calibrate payload finds it; 0: its weight isn't compensated.");
  f.numbers("payload_centre", s.payload_centre.data(), s.payload_centre.size(), finite("m"),
            "Centre of mass in sensor_b.");
  f.flag("publish_frames", s.publish_frames,
         "Publishes hole -> carrier_base -> carrier, hole -> base.");
  f.number("max_speed", motion.speed, {5e-3, 0.25, "m/s"},
           "Speed of the carrier, a rotation counted at the peg's edge.");
  f.number("max_acceleration", motion.acceleration, {0.1, 10.0, "m/s2"},
           "Acceleration of the carrier, a rotation counted at the peg's edge.");
  f.numbers("workspace", s.workspace.data(), s.workspace.size(), finite("m"),
            "Min and max of x, y, z in carrier_base.");
  f.number("max_rotation", guard.rotation, {0.0, 1.0, "rad"}, "Rotation from carrier_base.");
  f.number("max_force", guard.force, positive("N"),
           "Contact force at either sensor, zero removed.");
  f.number("max_torque", guard.torque, positive("N m"),
           "Contact torque at either sensor, zero removed.");
  f.number("max_raw_force", limits.raw_force, positive("N"),
           "Force at either sensor with its zero: what the sensor bears.");
  f.number("max_raw_torque", limits.raw_torque, positive("N m"),
           "Torque at either sensor with its zero: what the sensor bears.");
  f.number("max_force_rate", limits.force_rate, positive("N/s"),
           "Rate of the contact force's mean over 20 ms.");
  f.number("saturated_time", limits.saturated_time, {0.0, 0.1, "s"},
           "Longest saturation of a sensor that counts as a knock of stiff parts.");
  f.number("max_following", limits.following, positive("m"),
           "Distance of the arm from the points of the last following_time.");
  f.number("max_following_turn", limits.following_turn, positive("rad"),
           "Rotation of the arm from the points of the last following_time.");
  f.number("following_time", limits.following_time, {1e-3, 0.5, "s"},
           "Latency and lag of the arm.");
  f.number("max_amplitude", guard.amplitude, notNegative("N"), "Amplitude of the exciter.");
  f.number("max_frequency", guard.frequency, notNegative("rad/s"), "Frequency of the exciter.");
  f.number(
      "timeout", limits.timeout, {0.04, 10.0, "s"},
      "The arm is held after this time without wrenches, the arm's state or the owner's lease.");
  f.number("delay", limits.delay, {0.0, 1.0, "s"},
           "Time from a contact to the arm's reaction: bounds the speed of moves near a contact.");
}

void fields(FieldList& f, EmulatedArmSettings& s) {
  EmulatedArmParameters& arm = s.arm;
  f.choice("interface", s.interface, kInterfaces, "As that of arm_bridge.");
  f.text("description", s.description, "Parameter with the arm's URDF.");
  f.number("rate", arm.rate, {125.0, 500.0, "Hz"}, "Rate of the controller.");
  f.number("latency", arm.latency, {0.0, 0.25, "s"}, "Time from a command's stamp to its effect.");
  f.number("jitter", arm.jitter, {0.0, 0.05, "s"}, "Variation of the latency, uniform from 0.");
  f.number("bandwidth", arm.bandwidth, {2.0, 40.0, "Hz"}, "Bandwidth of the joints' positions.");
  f.number("encoder_step", arm.encoder_step, {0.0, 1e-2, "rad"}, "Resolution of the encoders.");
  f.number("repeatability", arm.repeatability, {0.0, 1e-3, "m"},
           "Sd of a move's final position, each axis; not measured by the encoders.");
  f.number("backlash", arm.backlash, {0.0, 1e-3, "m"},
           "Lost motion of the carrier where a move reverses, each axis; not measured by the "
           "encoders.");
  f.numbers("compliance", arm.compliance.data(), 6, finite("m/N, rad/(N m)"),
            "Compliance of the flange.");
  f.number("protective_force", arm.protective_force, positive("N"),
           "Force at the flange that stops the arm until ~unlock.");
  f.number("protective_torque", arm.protective_torque, positive("N m"),
           "Torque at the flange that stops the arm until ~unlock.");
  f.integer("seed", arm.seed, 0, 2147483647, "Seed of jitter and repeatability.");
  f.numbers("home", s.home.data(), s.home.size(), finite("rad"), "Joints near the carrier's start.")
      .derived("zeros, one a joint");
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
  if (settings.smoothing * settings.rate > static_cast<double>(CommandMotion::kMaxSmoothing)) {
    throw InputError(source +
                     text("smoothing: %g s are more than %zu points at the rate: give less",
                          settings.smoothing, CommandMotion::kMaxSmoothing));
  }
  limits.motion.arm = mechanism.peg.coupling_height + mechanism.peg.half_height;
  const Braking braking{couplingStiffness(mechanism.coupling), limits.motion.acceleration,
                        limits.motion.arm};
  ArmGuard arm = armGuard(limits, braking, lease, lockstep);
  setRate(arm, 1.0 / settings.rate, settings.smoothing);
  return arm;
}

Payload payloadOf(const BridgeSettings& settings, const Mechanism& mechanism,
                  const CellPlace& place) {
  // a cell whose gravity is a number says nothing of the arm, whose base counts as upright
  const Eigen::Vector3d up = mechanism.up.z() == 1.0
                                 ? Eigen::Vector3d(place.carrierBase().R.row(2).transpose())
                                 : mechanism.up;
  return {-mechanism.gravity * settings.payload_mass * up,
          Eigen::Vector3d::Map(settings.payload_centre.data())};
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
  readFile(file("bridge"), "parameters of arm_bridge", yaml::FileKind::kArmBridge, setup.bridge);
  const ArmKinematics kinematics(setup.urdf, setup.place.flange, setup.source);
  setup.arm.home.assign(static_cast<std::size_t>(kinematics.joints()), 0.0);
  readFile(file("arm"), "parameters of emulate_arm", yaml::FileKind::kEmulatedArm, setup.arm);
  in.finish();
  return setup;
}

}  // namespace assembly_cell
