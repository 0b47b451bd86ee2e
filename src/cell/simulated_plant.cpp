// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/simulated_plant.h"

#include <cmath>

#include "assembly_cell/align/estimation/contact_window.h"
#include "assembly_cell/align/search/step.h"
#include "assembly_cell/locus/vibration_fit.h"

namespace assembly_cell {
namespace {

// A peg wedged in the hole that creeps takes millions of steps a second: a run may have so many in
// all and so many more for each second of it [1/s], several times what an alignment needs.
constexpr double kMaxSteps = 3e6, kMaxStepsPerSecond = 1e5;
constexpr double kRounding = 0.01;  // of a sample's period, at a window's ends

Calibration believedA(const CellParameters& p) {
  return p.calibration_a ? *p.calibration_a : designCalibration(bridgeA(p.bits, p.noise));
}

Calibration believedB(const CellParameters& p, const CouplingParameters& coupling) {
  if (!p.calibration_b) return designCalibration(bridgeB(p.bits, p.noise), coupling);
  const bool measured = !p.calibration_b->volts_to_displacement.isZero(0.0);
  return measured ? *p.calibration_b : withDisplacement(*p.calibration_b, coupling);
}

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
      calibration_a_(believedA(parameters)),
      calibration_b_(believedB(parameters, nominal.coupling)),
      twin_force_(twinForceSetup(nominal, X_AH, parameters)),
      exciter_(scenario.mechanism.exciter) {
  const Bridge bridge = bridgeA(parameters.bits, parameters.noise);
  const double step = resolution(bridge);
  rounding_a_ = roundingCovariance(calibration_a_.volts_to_wrench, step);
  rounding_b_ = roundingCovariance(calibration_b_.volts_to_wrench, step);
  if (!parameters.arm) return;
  arm_ = std::make_unique<CarrierArm>(*parameters.arm, nominal, cell_.reported(), parameters.seed);
}

void SimulatedPlant::know(const KnownMechanism& known) {
  nominal_ = known.mechanism;
  drive_ = known.drive;
  calibration_b_ = believedB(cell_.parameters(), nominal_.coupling);
  twin_force_ = TwinForceContacts(twinForceSetup(nominal_, X_AH_, cell_.parameters()));
}

void SimulatedPlant::Window::begin(const LocusRequest& wanted) {
  request = wanted;
  angles.clear();
  signals.clear();
}

bool SimulatedPlant::Window::endsBefore(double time) const {
  return request && time >= request->start + request->duration - 1e-9;
}

bool SimulatedPlant::Window::beginsBy(double time) const {
  return request && request->start <= time;
}

void SimulatedPlant::collect(Window& window, bool wrench) {
  const double period = cell_.parameters().sample_period;
  const std::size_t n = means_.volts_b.size() / 6;
  for (std::size_t i = 0; i < n; ++i) {
    const double t = means_.end - static_cast<double>(n - 1 - i) * period;
    const double since = t - window.request->start + kRounding * period;
    if (since < 0.0 || since >= window.request->duration) continue;
    const Vector6 volts = Vector6::Map(means_.volts_b.data() + 6 * i);
    const Vector6 signal = wrench ? wrenchFromVolts(calibration_b_, volts)
                                  : displacementFromVolts(calibration_b_, volts);
    window.angles.push_back(exciter_.direction *
                            (exciter_.frequency * (t - exciter_reference_) + exciter_.phase));
    window.signals.insert(window.signals.end(), signal.data(), signal.data() + 6);
  }
}

void SimulatedPlant::tellArm() {
  const std::size_t n = block_.saturated_a.size();
  for (int sensor = 0; sensor < 2; ++sensor) {
    const std::vector<double>& volts = sensor == 0 ? block_.volts_a : block_.volts_b;
    const Calibration& calibration = sensor == 0 ? calibration_a_ : calibration_b_;
    std::vector<double>& wrenches = felt_[static_cast<std::size_t>(sensor)];
    wrenches.resize(6 * n);
    for (std::size_t i = 0; i < n; ++i) {
      Vector6::Map(wrenches.data() + 6 * i) =
          wrenchFromVolts(calibration, Vector6::Map(volts.data() + 6 * i));
    }
    ContactSamples felt;
    felt.sensor = sensor;
    felt.values = wrenches.data();
    felt.count = n;
    felt.period = block_.period;
    felt.end = cell_.world().time();
    felt.saturated = (sensor == 0 ? block_.saturated_a : block_.saturated_b).data();
    arm_->feel(felt);
  }
}

void SimulatedPlant::advance(const PlantCommand& command) {
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
  if (arm_) tellArm();
}

PlantBlock SimulatedPlant::means() const {
  PlantBlock out;
  const BlockMoments &volts_a = means_.a, &volts_b = means_.b;
  out.wrench_a = wrenchFromVolts(calibration_a_, volts_a.mean);
  out.wrench_b = wrenchFromVolts(calibration_b_, volts_b.mean);
  out.displacement_b = displacementFromVolts(calibration_b_, volts_b.mean);
  const Matrix6& S_a = calibration_a_.volts_to_wrench;
  const Matrix6& S_b = calibration_b_.volts_to_wrench;
  out.covariance_a = S_a * volts_a.covariance * S_a.transpose();
  out.covariance_b = S_b * volts_b.covariance * S_b.transpose();
  out.rounding_a = rounding_a_;
  out.rounding_b = rounding_b_;
  out.samples = volts_b.count;
  out.length = volts_b.count * cell_.parameters().sample_period;
  out.saturated = means_.saturated;
  out.carrier = restFromPose(arm_ ? arm_->reported() : cell_.reported());
  return out;
}

PlantBlock SimulatedPlant::next(const PlantCommand& command) {
  return nextStep(command,
                  [this](const PlantCommand& asked, bool /*first*/) { return nextBlock(asked); });
}

PlantBlock SimulatedPlant::nextBlock(const PlantCommand& command) {
  // a bridge commands nothing before it has felt something
  if (arm_ && !arm_->ready()) advance({});
  advance(command);
  PlantBlock out = means();
  out.time = cell_.world().time();
  if (locus_.request) collect(locus_, false);
  if (vibration_.request) collect(vibration_, true);

  if (locus_.endsBefore(out.time)) {
    out.locus = readLocus(nominal_, exciter_, locus_.angles, locus_.signals);
    locus_.request.reset();
  }
  if (vibration_.endsBefore(out.time)) {
    out.vibration = fitVibration(vibration_.angles, vibration_.signals);
    vibration_.request.reset();
  }
  return out;
}

}  // namespace assembly_cell
