// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_settings.h"

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
  f.text("scenario", s.scenario, "File of the scenario.").required();
  f.text("mismatch", s.mismatch, "File of model errors from which the ground truth is drawn.");
  f.integer("seed", cell.seed, 0, 2147483647, "Of noise and model errors.");
  f.integer("bits", cell.bits, 1, 64, "Of the converters: 10, 16 or 24.");
  f.integer("block_size", cell.block_size, 5, 100, "Samples a block.");
  f.number("noise", cell.noise, notNegative("V", 10), "Of every channel, rms.");
  f.number("accelerometer_noise", cell.accelerometer_noise, notNegative("m/s2", 1e3),
           "Of the accelerometers on the peg, rms.");
  f.number("accelerometer_height", cell.accelerometer_height, {-1.0, 1.0, "m"},
           "Of the accelerometers above the peg's centre of mass.");
  f.number("nonlinearity", cell.bridge_nonlinearity, {0.0, 1.0},
           "Of both bridges, 0: linear, 1: as built.");
  f.number("drift", cell.bridge_drift, {-100.0, 100.0, "K/h"}, "Of the bridges' temperature.");
  f.text("world", s.world, "Simulator backend: exact, mujoco, or a mapping.");
  f.flag("publish_truth", s.publish_truth, "Publishes the ground truth.");
  f.flag("lockstep", s.lockstep, "Waits for the participants' acknowledgements of each block.");
  f.number("ack_timeout", s.ack_timeout, {0.1, 3600.0, "s"},
           "Ends the node without an acknowledgement for this time, wall clock.");
  f.number("start_timeout", s.start_timeout, {0.1, 3600.0, "s"},
           "The same before all participants have answered once.");
  f.flag("paused", s.paused, "Starts paused.");
  f.number("real_time_factor", s.real_time_factor, {1e-3, 1e3}, "Simulated per wall time.");
  f.flag("follow_motion", s.follow_motion, "An arm moves the carrier: carrier_motion.");
  f.number("max_offset", s.max_offset, positive("m"), "Half edge of the default workspace.");
  f.numbers("workspace", s.workspace.data(), 6, finite("m"),
            "Of the carrier from its start: x from, to, y from, to, z from, to.");
  f.number("max_rotation", limits.rotation, {0.0, 1.0, "rad"}, "Of the carrier from its start.");
  f.number("max_force", limits.force, positive("N"), "Load of the coupling that stops the plant.");
  f.number("max_torque", limits.torque, positive("N m"), "The same of its torque.");
  f.number("max_amplitude", limits.amplitude, notNegative("N"), "Of the exciter.");
  f.number("max_frequency", limits.frequency, notNegative("rad/s"), "Of the exciter.");
  f.number("lease_time", limits.lease_time, {0.04, 10.0, "s"},
           "Without a sign of life the carrier is held and the exciter is off.");
  f.number("max_speed", s.max_speed, positive("m/s"), "Largest carrier.max_speed of a scenario.");
  f.number("max_acceleration", s.max_acceleration, positive("m/s2"),
           "Largest carrier.max_acceleration of a scenario.");
  f.choice("lease", s.lease, {"auto", "required", "none"},
           "Whether commands need a session: while there is one, always, never.");
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
    const Truth truth = drawTruth(loadMismatch(settings.mismatch), setup.cell.seed);
    setup.scenario = trueScenario(setup.scenario, truth, settings.mismatch);
    setup.cell.truth = truth.cell;
    setup.mismatch = truthText(truth);
  }
  setup.X_HB = carrierBase(setup.scenario);
  return setup;
}

}  // namespace assembly_cell::ros_bridge
