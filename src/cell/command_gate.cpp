// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/cell/command_gate.h"

#include <utility>

#include "assembly_cell/base/text.h"

namespace assembly_cell {

std::string CommandGate::refuse(const std::string& what, const std::string& node,
                                const GuardVerdict& why) {
  ++refusals_.commands;
  refusals_.node = node;
  refusals_.last = {why.reason, what + " of " + node + " refused: " + why.text};
  return refusals_.last.text;
}

std::string CommandGate::move(const Sender& sender, const Pose& X, double now) {
  const GuardVerdict verdict = checkMove(guard_, sender, X, now);
  if (!verdict.good()) return refuse("carrier_command", sender.node, verdict);
  commands_.carrier = X;
  return {};
}

std::string CommandGate::drive(const Sender& sender, const ExciterCommand& checked,
                               const DriveCommand& command, double now) {
  const GuardVerdict verdict = checkExciter(guard_, sender, checked, now);
  if (!verdict.good()) return refuse("exciter", sender.node, verdict);
  commands_.exciter = command;
  return {};
}

std::string CommandGate::renew(const Sender& sender, std::uint32_t session, double now) {
  const std::uint32_t before = guard_.session;
  GuardAction action;
  const GuardVerdict verdict = renewLease(guard_, sender, session, now, action);
  std::string line;
  // stale leases arrive in bursts; others once a block
  if (!verdict.good() && verdict.reason != GuardReason::kStale) {
    line = "lease of " + sender.node + " refused: " + verdict.text;
    refusals_.node = sender.node;
    refusals_.last = {verdict.reason, line};
  }
  if (guard_.session != before) stop_reason_.clear();
  commands_.stop.hold |= action.hold;
  if (!action.exciter_off) return line;
  commands_.stop.exciter_off = true;
  commands_.exciter.reset();
  return line;
}

CommandGate::Commands CommandGate::take() { return std::exchange(commands_, Commands{}); }

std::string CommandGate::watch(const Vector6& load, double height, double now) {
  const std::string owner = guard_.owner;
  const GuardAction action = assembly_cell::watch(guard_, load, height, now);
  if (action.reason == GuardReason::kNone) return {};
  if (action.reason == GuardReason::kExpired) {
    commands_.carrier.reset();
    stop_reason_ =
        text("expired: no sign of life of %s for %g s", owner.c_str(), guard_.limits.lease_time);
  } else {
    stop_reason_ = text("%s: the exciter ran for %g s and no session owns the plant",
                        toString(action.reason), guard_.limits.lone_exciter);
  }
  commands_.exciter.reset();
  commands_.stop.hold |= action.hold;
  commands_.stop.exciter_off |= action.exciter_off;
  return (action.hold ? "carrier held, exciter off: " : "exciter off: ") + stop_reason_;
}

std::string CommandGate::overload(const Vector6& load, const Vector6& way) {
  commands_.carrier.reset();
  commands_.exciter.reset();
  stop_reason_ = assembly_cell::overload(guard_, load, way).text;
  return "carrier held, exciter off: " + stop_reason_;
}

void CommandGate::onPlantRestart() {
  const std::optional<CarrierPoses> motion = commands_.motion;
  commands_ = Commands{};
  commands_.motion = motion;
  guard_.overloaded = guard_.shaking = false;
}

}  // namespace assembly_cell
