// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/simulated_plant.h"

#include <cmath>

#include "assembly_cell/align/search/step.h"
#include "assembly_cell/locus/vibration_fit.h"

namespace assembly_cell {
namespace {

// A peg wedged in the hole that creeps takes millions of steps a second: a run may have so many in
// all and so many more for each second of it [1/s], several times what an alignment needs.
constexpr double kMaxSteps = 3e6, kMaxStepsPerSecond = 1e5;

TwinForceSetup twinForceSetup(const Mechanism& nominal, const Pose& X_AH,
                              const CellParameters& parameters) {
  TwinForceSetup setup;
  if (parameters.calibration_a) setup.gain_covariance_a = gainCovariance(*parameters.calibration_a);
  if (parameters.calibration_b) setup.gain_covariance_b = gainCovariance(*parameters.calibration_b);
  setup.mechanism = nominal;
  setup.X_AH = X_AH;
  setup.X_CP.p.z() = -(nominal.peg.half_height + nominal.peg.coupling_height);
  setup.options.prior = nominalPrior({}, kNominalPositionSd, kNominalRotationSd);
  return setup;
}

}  // namespace

SimulatedPlant::SimulatedPlant(const Scenario& scenario, const Mechanism& nominal,
                               const CellParameters& parameters, const Pose& X_AH)
    : nominal_(nominal),
      X_AH_(X_AH),
      cell_(scenario, parameters),
      pipeline_(resolution(bridgeA(parameters.bits, parameters.noise)), parameters.sensors),
      twin_force_(twinForceSetup(nominal, X_AH, parameters)),
      exciter_(scenario.mechanism.exciter) {
  const CellParameters& p = parameters;
  pipeline_.setCalibration(
      0, p.calibration_a ? *p.calibration_a : designCalibration(bridgeA(p.bits, p.noise)));
  pipeline_.setCalibration(
      1, p.calibration_b ? *p.calibration_b : designCalibration(bridgeB(p.bits, p.noise)));
  updateCoupling();
  if (!p.arm) return;
  arm_ = std::make_unique<CarrierArm>(*p.arm, nominal, cell_.reported(), p.seed, p.sensors);
}

// A calibration with a displacement map of its own keeps it.
void SimulatedPlant::updateCoupling() {
  const bool measured = !pipeline_.calibration(1)->volts_to_displacement.isZero(0.0);
  pipeline_.setCoupling(measured ? nullptr : &nominal_.coupling);
}

void SimulatedPlant::setMechanism(const KnownMechanism& identified) {
  nominal_ = identified.mechanism;
  drive_ = identified.drive;
  updateCoupling();
  twin_force_ = TwinForceContacts(twinForceSetup(nominal_, X_AH_, cell_.parameters()));
}

void SimulatedPlant::collect(SampleWindow& window, bool wrench) {
  if (!window.window()) return;
  const std::size_t n = means_.volts_b.size() / 6;
  signals_.resize(6 * n);
  for (std::size_t i = 0; i < n; ++i) {
    const Vector6 volts = Vector6::Map(means_.volts_b.data() + 6 * i);
    Vector6::Map(signals_.data() + 6 * i) =
        wrench ? wrenchFromVolts(*pipeline_.calibration(1), volts) : pipeline_.displacement(volts);
  }
  window.add(signals_.data(), n, cell_.parameters().sample_period, means_.end, exciter_,
             exciter_reference_);
}

void SimulatedPlant::addWrenchesToArm() {
  const std::size_t n = block_.saturated_a.size();
  signals_.resize(6 * n);
  for (std::size_t sensor = firstSensor(cell_.parameters().sensors); sensor < 2; ++sensor) {
    const std::vector<double>& volts = sensor == 0 ? block_.volts_a : block_.volts_b;
    const Calibration& calibration = *pipeline_.calibration(sensor);
    for (std::size_t i = 0; i < n; ++i) {
      Vector6::Map(signals_.data() + 6 * i) =
          wrenchFromVolts(calibration, Vector6::Map(volts.data() + 6 * i));
    }
    ContactSamples samples;
    samples.sensor = static_cast<int>(sensor);
    samples.values = signals_.data();
    samples.count = n;
    samples.period = block_.period;
    samples.end = cell_.world().time();
    samples.saturated = (sensor == 0 ? block_.saturated_a : block_.saturated_b).data();
    arm_->addWrenches(samples);
  }
}

void SimulatedPlant::command(const PlantCommand& command) {
  SimulatorBackend& world = cell_.world();
  if (arm_) {
    const CellParameters& parameters = cell_.parameters();
    const double length = parameters.block_size * parameters.sample_period;
    PlantCommand asked = command;
    if (asked.exciter) asked.exciter = compensated(*asked.exciter, drive_);
    const CarrierPoses poses = arm_->lead(asked, world.time(), length);
    world.followRest(restMotionOf(poses, cell_.carrier().base()), world.time() + length);
  } else if (command.rest) {
    cell_.command(poseFromRest(*command.rest));
  }
  if (command.exciter) {
    exciter_ = *command.exciter;
    exciter_reference_ = world.time();
    world.setExciter(compensated(exciter_, drive_), exciter_reference_);
  }
  // the block before ends where a window may start
  if (command.locus) {
    locus_.begin(*command.locus);
    collect(locus_, false);
  }
  if (command.vibration) {
    vibration_.begin(*command.vibration);
    collect(vibration_, true);
  }
}

void SimulatedPlant::advance(const PlantCommand& command) {
  this->command(command);
  SimulatorBackend& world = cell_.world();
  const double until =
      world.time() + cell_.parameters().block_size * cell_.parameters().sample_period;
  StopReason reason = StopReason::kOk;
  if (arm_) {
    reason = cell_.next(block_);
    if (reason == StopReason::kOk) meansOf(block_, means_);
  } else {
    const double fastest = exciter_.amplitude > 0.0 ? exciter_.frequency : 0.0;
    reason = cell_.average(means_, fastest, locus_.beginsBy(until) || vibration_.beginsBy(until));
  }
  if (reason != StopReason::kOk) {
    throw PlantError(AlignFailure::kStopped, std::string("simulation stopped: ") + toString(reason),
                     toString(reason));
  }
  const auto steps = static_cast<double>(world.steps());
  if (steps > kMaxSteps + kMaxStepsPerSecond * world.time()) {
    throw PlantError(AlignFailure::kStopped, "simulation stopped: too_many_steps",
                     "too_many_steps");
  }
  if (arm_) addWrenchesToArm();
}

PlantBlock SimulatedPlant::next(const PlantCommand& command) {
  return nextStep(command,
                  [this](const PlantCommand& asked, bool /*first*/) { return nextBlock(asked); });
}

PlantBlock SimulatedPlant::nextBlock(const PlantCommand& command) {
  // the arm's bridge takes no command before its first wrenches
  if (arm_ && !arm_->ready()) advance({});
  advance(command);
  PlantBlock out =
      pipeline_.fromStrain(means_.a, means_.b, means_.saturated, cell_.parameters().sample_period);
  out.carrier = restFromPose(arm_ ? arm_->reported() : cell_.reported());
  out.time = cell_.world().time();
  collect(locus_, false);
  collect(vibration_, true);
  if (locus_.endsBy(out.time)) {
    out.locus = readLocus(nominal_, exciter_, locus_.angles(), locus_.signals());
    locus_.cancel();
  }
  if (vibration_.endsBy(out.time)) {
    out.vibration = fitVibration(vibration_.angles(), vibration_.signals());
    vibration_.cancel();
  }
  return out;
}

}  // namespace assembly_cell
