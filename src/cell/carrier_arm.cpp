// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/carrier_arm.h"

#include <algorithm>
#include <cmath>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {
namespace {

constexpr std::uint32_t kSession = 1;
constexpr char kHolder[] = "strategy";

PlantError stopped(const std::string& why) { return {AlignFailure::kStopped, why}; }

JointVector startJoints(const ArmSetup& setup, const ArmKinematics& kinematics,
                        const Pose& carrier) {
  const std::vector<double>& home = setup.arm.home;
  JointVector q = JointVector::Map(home.data(), static_cast<Eigen::Index>(home.size()));
  const JointSolution solution = kinematics.solve(setup.place.flangeOf(carrier), q);
  if (solution.reached) return q;
  throw InputError(setup.file +
                   text(": the arm gets no nearer to the carrier's place than %g m and %g rad: "
                        "give `home` of its arm near it",
                        solution.distance, solution.turn));
}

EmulatedArmParameters seeded(EmulatedArmParameters parameters, std::uint64_t seed) {
  parameters.seed = seed;
  return parameters;
}

BridgeSettings withSensors(BridgeSettings settings, Sensors sensors) {
  if (sensors == Sensors::kB) settings.limits.sensors = sensors;
  return settings;
}

}  // namespace

RestMotion restMotionOf(const CarrierPoses& poses, const Pose& X_HB) {
  const auto rest = [&](const Pose& pose) { return restVector(restFromPose(X_HB * pose)); };
  const double h = poses.step;
  const Vector6 before = rest(poses.before), at = rest(poses.at), after = rest(poses.after);
  return {at, (after - before) / (2.0 * h), (after - 2.0 * at + before) / (h * h)};
}

CarrierArm::CarrierArm(const ArmSetup& setup, const Mechanism& mechanism, const Pose& carrier,
                       std::uint64_t seed, Sensors sensors)
    : place_(setup.place),
      kinematics_(setup.urdf, setup.place.flange, setup.source),
      bridge_(bridgeGuard(withSensors(setup.bridge, sensors), mechanism, LeaseMode::kAuto, true,
                          setup.file + ": ")),
      sent_(startJoints(setup, kinematics_, carrier)) {
  arm_ = emulatedArm(seeded(setup.arm.arm, seed), place_, kinematics_, sent_, 0.0);
  setState(bridge_, place_.carrierOf(kinematics_.forward(encoders(arm_))), 0.0);
}

// A bridge that isn't led any more ends the run.
void CarrierArm::mustFollow() const {
  if (isHalted(bridge_)) throw stopped("the plant stopped itself: " + bridge_.text);
}

void CarrierArm::take(const PlantCommand& command, double now) {
  const Sender sender{kHolder, now, true, false};
  const auto must = [](const GuardVerdict& verdict) {
    if (!verdict.good()) throw stopped("refused: " + verdict.text);
  };
  must(renew(bridge_, sender, kSession, now));
  if (command.rest) must(move(bridge_, sender, poseFromRest(*command.rest), now));
  if (!command.exciter) return;
  const ExciterParameters& e = *command.exciter;
  must(drive(bridge_, sender, {e.amplitude, e.frequency, e.phase, e.direction}, now));
}

CarrierPoses CarrierArm::lead(const PlantCommand& command, double now, double length) {
  mustFollow();
  if (ready()) take(command, now);
  const double period = bridge_.motion.period;
  const auto count = static_cast<std::size_t>(std::ceil(length / period - 1e-6));
  const auto timeOf = [&](std::size_t i) {
    return now + std::min(static_cast<double>(i + 1) * period, length);
  };
  points_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    tick(bridge_, timeOf(i));
    points_[i] = jointPoint(kinematics_, place_, bridge_.motion, sent_);
    sent_ = points_[i].q;
    if (!points_[i].why.empty()) hold(bridge_, ArmReason::kUnreachable, points_[i].why);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const double time = timeOf(i);
    assembly_cell::command(arm_, points_[i].q, time);
    advance(arm_, kinematics_, time);
    setState(bridge_, place_.carrierOf(kinematics_.forward(encoders(arm_))), time);
  }
  return carrier(arm_, kinematics_);
}

void CarrierArm::addWrenches(const ContactSamples& samples) {
  addSamples(bridge_, samples);
  if (samples.sensor == 1 && samples.count > 0) {
    load(arm_, Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(
                   samples.values, 6, static_cast<Eigen::Index>(samples.count))
                   .rowwise()
                   .mean());
  }
}

}  // namespace assembly_cell
