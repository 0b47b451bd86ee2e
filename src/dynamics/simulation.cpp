// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/dynamics/simulation.h"

#include <Eigen/LU>
#include <algorithm>

#include "assembly_cell/base/input_error.h"
#include "contact/contact_solver.h"
#include "integration/evaluation.h"
#include "simulation_run.h"

namespace assembly_cell {

const char* toString(StopReason reason) {
  static constexpr const char* kNames[] = {"ok",
                                           "edge_edge",
                                           "edge_plane",
                                           "edge_wall",
                                           "rim_side",
                                           "rim_face",
                                           "edge_cone",
                                           "rim_cone",
                                           "peg_top",
                                           "singular_orientation",
                                           "initial_overlap",
                                           "non_finite",
                                           "step_too_small",
                                           "event_limit"};
  return kNames[static_cast<int>(reason)];
}

Simulation::Simulation(const Scenario& scenario) : run_(std::make_unique<Run>(scenario)) {
  if (stopReason() == StopReason::kInitialOverlap) {
    throw InputError(
        "initial.peg.position: the peg's edge is more than 1e-8 m inside the block, which the "
        "rigid law refuses; raise it or set initial.close: true");
  }
}

Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

double Simulation::time() const { return run_->sampling ? run_->dense->time : run_->context.time; }
const State& Simulation::state() const {
  return run_->sampling ? run_->dense->state : run_->context.state;
}
const Vector9& Simulation::acceleration() const {
  if (!run_->sampling) return run_->context.slope;
  run_->find(Run::Found::kForces);
  return run_->dense->slope;
}
const Scenario& Simulation::scenario() const { return run_->system.scenario; }
StopReason Simulation::stopReason() const {
  return run_->sampling ? StopReason::kOk : run_->context.stop;
}
RunCounts Simulation::counts() const {
  RunCounts counts = run_->context.counts;
  counts.evaluations = run_->now.count;
  return counts;
}

StopReason Simulation::advance(double t_end, std::int64_t attempts) {
  if (run_->sampling && t_end < run_->context.time) run_->returnToSample();
  run_->sampling = false;
  return run_->advance(t_end, attempts);
}

StopReason Simulation::sampleAt(double t, double ahead) {
  Run& r = *run_;
  if (r.system.fixed_step || r.system.method == Method::kHamming) {
    return advance(t);
  }
  r.sampleAt(t, std::max(t, ahead));
  return stopReason();
}

const Commands& Simulation::commands() const { return run_->context.commands; }

Commands& Simulation::changeCommands() {
  run_->returnToSample();
  run_->context.stale = true;
  return run_->context.commands;
}

Eigen::Vector3d Simulation::carrierDeflection() const { return state().carrier_deflection; }

void Simulation::setExciter(const ExciterParameters& exciter, double t_ref) {
  Drive& drive = changeCommands().drive;
  drive.exciter = exciter;
  drive.t_ref = t_ref;
  run_->now.drive_time = -1.0;
}

void Simulation::setFriction(const FrictionParameters& friction) {
  changeCommands();
  run_->system.scenario.mechanism.friction = friction;
}

std::array<ContactReport, kSlots> Simulation::contacts() const {
  const System& s = run_->system;
  const Context& c = run_->sampled();
  const SlotArray& slots = c.slots;
  // all slots are searched, and the internal force of two sticking contacts is computed
  Evaluation e = run_->atPresent(Run::Found::kForces, [](const Evaluation& at) { return at; });
  // the internal forces of resting contacts are not part of an evaluation within a step
  if (run_->sampling && e.active()) recomputeForces(s, slots, Level::kEvents, e);
  if (const ContactSlotMask others = s.admitted & ~e.closed) {
    locate(s, c, others, e, e.open_set);
  }
  ContactSlotMask sticking = 0;
  for (const std::size_t i : Slots(e.active())) {
    if (slots[i].mode == Mode::kStick) sticking |= 1u << i;
  }
  if (__builtin_popcount(sticking) == 2) shareInternalForces(s, sticking, e.loads, e);
  std::array<ContactReport, kSlots> report;
  const ContactSlotMask on_plane = e.face & ~c.face.crossings;
  for (std::size_t i = 0; i < kSlots; ++i) {
    ContactReport& r = report[i];
    r.feature =
        on_plane >> i & 1u ? ContactFeature::kEdgePlane : featureOfSlot(static_cast<int>(i));
    r.valid = (s.admitted & e.valid()) >> i & 1u;
    if (!r.valid) continue;
    const ContactKinematics& at = e.contacts[i];
    const bool carries = slots[i].mode != Mode::kApart && at.normal_force > 0.0;
    const bool sticks = s.discrete_friction
                            ? slots[i].mode == Mode::kStick
                            : at.tangential.norm() <= s.scenario.contact.regularisation_speed;
    if (carries) {
      r.state = sticks ? ContactReport::kStick : ContactReport::kSlip;
      r.force = fromThesisAxes(at.force);
    }
    r.point = fromThesisAxes(e.point(i).p);
    r.normal = fromThesisAxes(e.point(i).normal);
    r.gap = e.point(i).gap;
  }
  return report;
}

Vector6 Simulation::couplingWrench() const {
  return run_->atPresent(Run::Found::kMotion, [this](const Evaluation& e) {
    const FreeMotion& motion = e.motion;
    const Eigen::Vector3d force = motion.FK + motion.FC;
    const Eigen::Vector3d moment =
        e.k.Re.transpose().inverse() *
            Eigen::Vector3d(motion.FKm(2), motion.FKm(1), motion.FKm(0)) +
        motion.FCm;
    // about the rest point, in the carrier's axes
    const Eigen::Vector3d about_rest = moment + motion.deflection.head<3>().cross(force);
    const Eigen::Matrix3d R_CH = carrierPose().R.transpose();
    Vector6 w;
    w << R_CH * fromThesisAxes(force), R_CH * fromThesisAxes(about_rest);
    return w;
  });
}

Vector6 Simulation::holeWrench() const {
  return run_->atPresent(Run::Found::kForces, [](const Evaluation& e) {
    Vector6 w = Vector6::Zero();
    for (const std::size_t i : Slots(e.active())) {
      const Eigen::Vector3d force = -fromThesisAxes(e.contacts[i].force);
      w.head<3>() += force;
      w.tail<3>() += fromThesisAxes(e.point(i).p).cross(force);
    }
    return w;
  });
}

Eigen::Vector2d Simulation::specificForce(double height) const {
  const Kinematics k = kinematics(state());
  const Vector9& rate = acceleration();
  const Eigen::Vector3d turn = k.Re * rate.segment<3>(3) + k.Re_rate * state().v.segment<3>(3);
  const Eigen::Vector3d arm = height * k.a;
  Eigen::Vector3d specific_force =
      rate.head<3>() + turn.cross(arm) + k.omega.cross(k.omega.cross(arm));
  specific_force += scenario().mechanism.gravity * toThesisAxes(scenario().mechanism.up);
  // peg axes: x is the thesis's second, y against its first
  return {k.R1.dot(specific_force), -k.R0.dot(specific_force)};
}

Pose Simulation::pegPose() const {
  const Kinematics k = kinematics(state());
  Pose X;
  X.R.col(0) = fromThesisAxes(k.R1);
  X.R.col(1) = -fromThesisAxes(k.R0);
  X.R.col(2) = fromThesisAxes(k.a);
  X.p = fromThesisAxes(k.x - scenario().mechanism.peg.half_height * k.a);
  return X;
}

Pose Simulation::carrierPose() const {
  const RestPose rest = this->rest();
  const Vector9& q = state().q;
  Pose X;
  X.R = rotationFromEuler({rest.phi, rest.theta, q(8)});
  X.p = Eigen::Vector3d(q(6), q(7), rest.z);
  return X;
}

RestPose Simulation::carrier() const {
  RestPose pose = rest();
  const Vector9& q = state().q;
  pose.x = q(6);
  pose.y = q(7);
  pose.yaw = q(8);
  return pose;
}

double Simulation::energy() const {
  const State now = state();
  return mechanicalEnergy(scenario(), kinematics(now), now, run_->context.commands.restAt(time()));
}

}  // namespace assembly_cell
