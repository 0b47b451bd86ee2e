// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_settings.h"

#include <ros/console.h>
#include <ros/param.h>

#include <algorithm>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/cell/start.h"
#include "assembly_cell/description/part_pairs.h"
#include "assembly_cell/mismatch/mismatch.h"
#include "assembly_cell/ros/bridge/parameters.h"
#include "assembly_cell/sensor/bridge.h"

namespace assembly_cell::ros_bridge {

namespace {

void checkWorkspace(const SimulatorSettings& s) {
  for (std::size_t i = 0; i < 3; ++i) {
    const double from = s.workspace[2 * i], to = s.workspace[2 * i + 1];
    if (from <= 0.0 && to >= 0.0) continue;
    throw InputError(
        text("parameter ~workspace is %g to %g m along %c: the start, 0, must lie in it", from, to,
             "xyz"[i]));
  }
}

void checkCarrier(const CarrierParameters& carrier, const SimulatorSettings& s) {
  if (carrier.max_speed > s.max_speed) {
    throw InputError(text("scenario: carrier.max_speed: %g m/s, ~max_speed allows %g m/s",
                          carrier.max_speed, s.max_speed));
  }
  if (carrier.max_acceleration > s.max_acceleration) {
    throw InputError(
        text("scenario: carrier.max_acceleration: %g m/s2, ~max_acceleration allows "
             "%g m/s2",
             carrier.max_acceleration, s.max_acceleration));
  }
}

// Parts that can't meet while the carrier keeps to its workspace and to the tilts of an alignment
// are never searched for contact.
void pairParts(const GuardLimits& limits, SimulatorSetup& setup) {
  CarrierTravel travel;
  travel.lateral =
      std::max({-limits.box_min.x(), limits.box_max.x(), -limits.box_min.y(), limits.box_max.y()});
  travel.lowest = -setup.scenario.mechanism.peg.half_height;
  setup.peg_meets_hole = false;
  for (const PartPair& pair : canMeet(setup.description, travel)) {
    if (pair == PartPair{"peg", "hole"}) {
      setup.peg_meets_hole = true;
    } else {
      setup.part_pairs.push_back(pair.first + " and " + pair.second);
    }
  }
  if (!setup.peg_meets_hole) setup.scenario.contact.law = ContactLaw::kNone;
}

}  // namespace

void fields(FieldList& f, SimulatorSettings& s) {
  CellParameters& cell = s.cell;
  GuardLimits& limits = s.limits;
  f.text("scenario", s.scenario,
         "Scenario file; geometry, masses and inertias must be those of the robot description.")
      .required();
  f.text("mismatch", s.mismatch,
         "Mismatch file: how the ground truth differs from the scenario; no other node reads it.");
  f.integer(
      "seed", cell.seed, 0, 2147483647,
      "Seed of the noise of the sensors and of the model errors: the same seed gives the same "
      "samples to the last bit.");
  f.choice("sensors", cell.sensors, sensorChoices(),
           "Force sensors of the cell: both, or b (sensor_b alone, at the wrist).");
  f.integer("bits", cell.bits, 1, 64, "Bits of the converters of both bridges: 10, 16 or 24.");
  f.integer("block_size", cell.block_size, 5, 100, "Samples a block; 10 are 2 ms.");
  f.number("noise", cell.noise, notNegative("V", 10),
           "Noise of every channel, rms; from 1.5 V on a range of 5 V saturates all the time.");
  f.number("accelerometer_noise", cell.accelerometer_noise, notNegative("m/s2", 1e3),
           "Noise of both accelerometers on the peg, rms; sampled only while accelerometers has a "
           "subscriber.");
  f.number("accelerometer_height", cell.accelerometer_height, {-1.0, 1.0, "m"},
           "Height of the accelerometers above the centre of mass of the peg.");
  f.number("nonlinearity", cell.bridge_nonlinearity, {0.0, 1.0},
           "Nonlinearity of the true bridges, 0: linear, 1: as built.");
  f.number("drift", cell.bridge_drift, {-100.0, 100.0, "K/h"},
           "Drift of the temperature of the true bridges, from 20 degrees on.");
  f.text("world", s.world,
         "Simulator backend: exact, mujoco, or a mapping such as {engine: mujoco, facets: 512}.");
  f.flag(
      "publish_truth", s.publish_truth,
      "Publishes the ground truth, which only markers and report read: truth/pose, truth/contacts, "
      "tf of hole_truth and peg_truth.");
  f.flag("lockstep", s.lockstep,
         "After each block waits for the answers of all participants; false with /use_sim_time "
         "true is "
         "refused.")
      .derived("value of /use_sim_time");
  f.number(
      "ack_timeout", s.ack_timeout, {0.1, 3600.0, "s"},
      "Longest wait for the answer of a participant, wall clock; then the node ends and reports "
      "the missing one.");
  f.number("start_timeout", s.start_timeout, {0.1, 3600.0, "s"}, "The same for its first answer.");
  f.flag("paused", s.paused, "Starts paused; ~pause with data: false starts the clock.");
  f.number("real_time_factor", s.real_time_factor, {1e-3, 1e3},
           "Simulated seconds per second of the wall clock; not used in lockstep.");
  f.flag(
      "follow_motion", s.follow_motion,
      "Something else moves the carrier, by carrier_motion; its load then stops nothing here. In "
      "lockstep each block waits for it.");
  f.number("max_offset", s.max_offset, positive("m"),
           "Half edge of the default workspace, from the rest position of the scenario.");
  f.numbers(
       "workspace", s.workspace.data(), 6, finite("m"),
       "Commanded positions from the rest position of the scenario, axes of carrier_base: x from, "
       "to, y from, to, z from, to.")
      .derived("±max_offset");
  f.number("max_rotation", limits.rotation, {0.0, 1.0, "rad"},
           "Largest commanded rotation from the rest pose of the scenario.");
  f.number("max_force", limits.force, positive("N"),
           "Load of the coupling, weight included, that stops the carrier at any sample.");
  f.number("max_torque", limits.torque, positive("N m"), "The same of the torque.");
  f.number("max_amplitude", limits.amplitude, notNegative("N"),
           "Largest amplitude of the exciter.");
  f.number("max_frequency", limits.frequency, notNegative("rad/s"),
           "Largest frequency of the exciter.");
  f.number(
      "lease_time", limits.lease_time, {0.04, 10.0, "s"},
      "Without a heartbeat of the owner for this time the carrier is held and the exciter is off, "
      "cell time.");
  f.number("max_speed", s.max_speed, positive("m/s"),
           "A scenario with a faster carrier is refused; a single move may be slower, see Load.");
  f.number("max_acceleration", s.max_acceleration, positive("m/s2"),
           "The same of its acceleration.");
  f.choice("lease", s.lease, {"auto", "required", "none"},
           "Whether a command needs a lease: auto: while the plant has an owner, required: always, "
           "none: "
           "leases are ignored.");
}

SimulatorSettings readSimulatorSettings(const ros::NodeHandle& pnh) {
  Parameters parameters(pnh);
  SimulatorSettings s;
  bool use_sim_time = false;
  ros::param::get("/use_sim_time", use_sim_time);
  s.lockstep = use_sim_time;
  const double offset = parameters.number("max_offset", positive("m"), s.max_offset);
  s.workspace = {-offset, offset, -offset, offset, -offset, offset};
  parameters.read(fieldsOf(s));
  s.overrides = parameters.texts("overrides", std::vector<std::string>{});
  s.participants = parameters.texts("participants", std::vector<std::string>{});
  parameters.refuseUnknown();
  checkBits(s.cell.bits, "parameter " + pnh.resolveName("bits") + " is ");
  s.cell.world = parseWorld(s.world, pnh.resolveName("world"));
  checkWorkspace(s);
  for (int i = 0; i < 3; ++i) {
    s.limits.box_min(i) = s.workspace[static_cast<std::size_t>(2 * i)];
    s.limits.box_max(i) = s.workspace[static_cast<std::size_t>(2 * i + 1)];
  }
  if (use_sim_time && !s.lockstep) {
    throw InputError("parameter " + pnh.resolveName("lockstep") +
                     " is false while /use_sim_time is true: no node would publish /clock, set "
                     "both or neither");
  }
  return s;
}

SimulatorSetup loadSimulatorSetup(const SimulatorSettings& settings, const std::string& urdf) {
  SimulatorSetup setup;
  setup.scenario = loadScenario(settings.scenario, settings.overrides);
  setup.nominal_height = setup.scenario.rest.z;
  const Mechanism& mechanism = setup.scenario.mechanism;
  checkCarrier(mechanism.carrier, settings);
  setup.braking = {couplingStiffness(mechanism.coupling), mechanism.carrier.max_acceleration,
                   mechanism.peg.coupling_height + mechanism.peg.half_height};
  setup.description = loadCellDescription(urdf);
  checkAgainst(setup.description, mechanism, setup.scenario.name);
  pairParts(settings.limits, setup);
  setup.cell = settings.cell;
  setup.cell.X_AH = setup.description.X_AH;
  setup.cell.hole_block_mass = setup.description.hole_block_mass;
  setup.cell.hole_block_center = setup.description.hole_block_centre;
  if (!settings.mismatch.empty()) {
    const Mismatch mismatch = loadMismatch(settings.mismatch);
    if (settings.follow_motion) {
      refuseCarrierDrive(mismatch);
      const std::string unused = unusedWithArm(mismatch);
      if (!unused.empty()) ROS_WARN("%s", unused.c_str());
    }
    const Truth truth = drawTruth(mismatch, setup.cell.seed);
    setup.scenario = trueScenario(setup.scenario, truth, settings.mismatch);
    setup.cell.truth = truth.cell;
    setup.mismatch = truthText(truth);
  }
  setup.X_HB = carrierBase(setup.scenario);
  return setup;
}

}  // namespace assembly_cell::ros_bridge
