// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/guarded_cell.h"

#include <algorithm>
#include <utility>

#include "assembly_cell/cell/carrier_arm.h"

namespace assembly_cell {

namespace {

// A plan that begins in mid-motion passes its speed by up to this factor (planRest).
constexpr double kOvershoot = 1.5;
constexpr double kCreep = 1e-5;  // length of a stop below which the carrier counts as at rest [m]

}  // namespace

GuardedCell::GuardedCell(std::unique_ptr<SimulatedCell> cell, bool follows, CommandGate& gate,
                         std::mutex& mutex, std::function<void(const std::string&)> log)
    : cell_(std::move(cell)),
      braking_(gate.guard().braking),
      sensed_(detectionThreshold(gate.guard().limits)),
      follows_(follows),
      gate_(gate),
      mutex_(mutex),
      log_(std::move(log)) {}

void GuardedCell::replace(std::unique_ptr<SimulatedCell> cell) {
  base_ = time();
  cell_ = std::move(cell);
}

void GuardedCell::begin() {
  const Vector6 load = world().couplingWrench();
  const double height = cell_->carrier().encoders(world()).p.z();
  CommandGate::Commands commands;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    log_(gate_.watch(load, height, time()));
    allowed_ = gate_.guard().allowed;
    watched_ = !gate_.guard().overloaded && !follows_;
    commands = gate_.take();
  }
  apply(commands);
}

void GuardedCell::apply(const CommandGate::Commands& commands) {
  if (commands.stop.hold) cell_->stop();
  if (commands.stop.exciter_off) world().setExciter(ExciterParameters{}, world().time());
  if (commands.carrier) cell_->command(*commands.carrier, speedOf(*commands.carrier));
  if (follows_ && commands.motion) {
    const CellParameters& cell = cell_->parameters();
    world().followRest(restMotionOf(*commands.motion, cell_->carrier().base()),
                       world().time() + cell.block_size * cell.sample_period);
  } else if (follows_ && !world().atRest()) {
    cell_->stop();
  }
  if (commands.exciter) {
    const DriveCommand& exciter = *commands.exciter;
    world().setExciter(exciter.drive,
                       exciter.reference ? *exciter.reference - base_ : world().time());
  }
}

double GuardedCell::speedOf(const Pose& target) {
  const Pose X = inverse(cell_->carrier().encoders(world())) * target;
  Vector6 way;
  way << X.p, vectorFromRotation(X.R).value;
  const Vector6 stop = world().stoppingDisplacement();
  const double moving = stop.head<3>().norm() + braking_.arm * stop.tail<3>().norm();
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::min(world().scenario().mechanism.carrier.max_speed,
                  speedLimit(gate_.guard(), world().couplingWrench(), way)) /
         (moving > kCreep ? kOvershoot : 1.0);
}

StopReason GuardedCell::next(StrainBlock& block, bool accelerations) {
  return cell_->next(block, accelerations, [this](const Vector6& load) { checkLoad(load); });
}

void GuardedCell::checkLoad(const Vector6& load) {
  if (!watched_ || !exceeds(load, sensed_)) return;
  const Vector6 way = world().stoppingDisplacement();
  if (!mustStop(braking_, load, way, allowed_)) return;
  watched_ = false;
  cell_->stop();
  world().setExciter(ExciterParameters{}, world().time());
  const std::lock_guard<std::mutex> lock(mutex_);
  log_(gate_.overload(load, way));
}

}  // namespace assembly_cell
