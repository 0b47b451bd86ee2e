// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/ros/simulation/simulator_services.h"

#include <memory>
#include <string>
#include <utility>

#include "assembly_cell/base/input_error.h"
#include "assembly_cell/base/text.h"
#include "assembly_cell/dynamics/simulation.h"
#include "assembly_cell/geometry/contact_geometry.h"
#include "assembly_cell/ros/bridge/conversions.h"

namespace assembly_cell::ros_bridge {

namespace {

/// Answers a service with the text that `what` returns, or with that of what it throws.
template <class Response, class What>
bool answer(Response& response, const What& what) {
  try {
    response.message = what();
    response.success = true;
  } catch (const std::exception& error) {
    response.message = error.what();
  }
  return true;
}

constexpr double kFarthest = 0.5;  // of peg and carrier from the hole's mouth [m]
constexpr double kDeepest = 1e-4;  // of a peg in the block: a start that touches may be so [m]

void refuseFar(const char* field, const Pose& X) {
  const double away = X.p.norm();
  if (away <= kFarthest) return;
  throw InputError(text("set_state refused: %s is %.3g m from the hole's mouth: give at most %g m",
                        field, away, kFarthest));
}

// The plant itself finds contacts to a depth of a tenth of the peg's radius.
void refuseDeep(const Scenario& scenario, const Pose& X_HP) {
  const EdgeCircle edge{toThesisAxes(X_HP.p), toThesisAxes(X_HP.R.col(0)),
                        toThesisAxes(X_HP.R.col(1)), tipRadius(scenario.mechanism.peg)};
  if (scenario.contact.law == ContactLaw::kNone) return;
  ContactSet set;
  const ContactSlotMask valid = findContacts(edge, shapesOf(scenario), kAllContactSlots, set);
  double gap = -kDeepest;
  std::string where;
  for (int slot = 0; slot < kContactSlots; ++slot) {
    const ContactPoint& point = set.slots[static_cast<std::size_t>(slot)];
    if ((valid >> slot & 1u) == 0 || point.gap >= gap) continue;
    gap = point.gap;
    const Eigen::Vector3d at = 1e3 * fromThesisAxes(point.p);
    where = text("%.3g mm deep in the block (%s), at x %.1f, y %.1f, z %.1f mm of the hole",
                 -1e3 * gap, toString(point.feature), at.x(), at.y(), at.z());
  }
  if (where.empty()) return;
  throw InputError("set_state refused: peg is " + where +
                   text(": give a pose that is in it by %g mm at most", 1e3 * kDeepest));
}

// Both poses are free, and so is the strain of the coupling between them.
void refuseStrained(const Vector6& load, const GuardLimits& limits) {
  const double force = load.head<3>().norm(), torque = load.tail<3>().norm();
  if (force <= limits.force && torque <= limits.torque) return;
  throw InputError(
      text("set_state refused: between peg and carrier the coupling has a load of %.3g N and %.3g "
           "N m: give poses that strain it less, ~max_force %g N, ~max_torque %g N m",
           force, torque, limits.force, limits.torque));
}

}  // namespace

SimulatorServices::SimulatorServices(const ros::NodeHandle& pnh, const SimulatorSettings& settings,
                                     const SimulatorSetup& setup, SimulatorState& state,
                                     SimulatorLoop& loop)
    : settings_(settings), setup_(setup), state_(state), loop_(loop) {
  ros::NodeHandle nh(pnh);
  nh.setCallbackQueue(&queue_);
  servers_ = {nh.advertiseService("pause", &SimulatorServices::onPause, this),
              nh.advertiseService("step", &SimulatorServices::onStep, this),
              nh.advertiseService("reset", &SimulatorServices::onReset, this),
              nh.advertiseService("set_state", &SimulatorServices::onSetState, this)};
  spinner_.start();
}

std::string SimulatorServices::time() const { return std::to_string(state_.now) + " s"; }

bool SimulatorServices::onPause(std_srvs::SetBool::Request& request,
                                std_srvs::SetBool::Response& response) {
  return answer(response, [&] {
    loop_.pause(request.data);
    return (request.data ? "paused at " : "running at ") + time();
  });
}

bool SimulatorServices::onStep(Step::Request& request, Step::Response& response) {
  return answer(response, [&] {
    loop_.step(request.blocks);
    return "at " + time();
  });
}

// The arm stays where it is, and would take the carrier back there through whatever is between.
void SimulatorServices::refuseBesideAnArm(const char* what) const {
  if (!settings_.follow_motion) return;
  throw InputError(std::string(what) +
                   " refused: an arm carries the carrier (~follow_motion) and continues from where "
                   "it is; take the peg out by the action retreat, or restart the launch file");
}

bool SimulatorServices::onReset(std_srvs::Trigger::Request&,
                                std_srvs::Trigger::Response& response) {
  return answer(response, [this] {
    refuseBesideAnArm("reset");
    loop_.betweenBlocks([this] {
      loop_.restart(std::make_unique<SimulatedCell>(setup_.scenario, setup_.cell, setup_.X_HB));
    });
    return "at the scenario's start, the clock goes on at " + time();
  });
}

bool SimulatorServices::onSetState(SetState::Request& request, SetState::Response& response) {
  return answer(response, [&] {
    refuseBesideAnArm("set_state");
    // the scenario with another start, at rest
    Scenario scenario = setup_.scenario;
    const Pose X_HP = fromPose(request.peg, "peg");
    const Pose X_HC = fromPose(request.carrier, "carrier");
    refuseFar("peg.position", X_HP);
    refuseFar("carrier.position", X_HC);
    scenario.rest = restFromPose(X_HC);
    scenario.initial = InitialState{};
    scenario.initial.position = X_HP.p + scenario.mechanism.peg.half_height * X_HP.R.col(2);
    scenario.initial.euler = eulerFromRotation(X_HP.R);
    scenario.initial.carrier_x = scenario.rest.x;
    scenario.initial.carrier_y = scenario.rest.y;
    scenario.initial.carrier_yaw = scenario.rest.yaw;
    refuseDeep(scenario, X_HP);
    auto cell = std::make_unique<SimulatedCell>(scenario, setup_.cell, setup_.X_HB);
    refuseStrained(cell->world().couplingWrench(), settings_.limits);
    loop_.betweenBlocks([this, &cell] { loop_.restart(std::move(cell)); });
    return "state set at " + time();
  });
}

}  // namespace assembly_cell::ros_bridge
