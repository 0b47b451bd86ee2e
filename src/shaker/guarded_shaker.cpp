// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/shaker/guarded_shaker.h"

#include <cmath>
#include <utility>

#include "assembly_cell/base/fields.h"
#include "assembly_cell/base/text.h"

namespace assembly_cell {

void fields(FieldList& f, ShakerLimits& limits) {
  f.number("timeout", limits.timeout, {0.04, 10.0, "s"},
           "Without carrier_pose for this time it is off.");
  f.number("max_amplitude", limits.max_amplitude, notNegative("N"),
           "Largest amplitude of a command.");
  f.number("max_frequency", limits.max_frequency, notNegative("rad/s"),
           "Largest frequency of a command.");
}

GuardedShaker::GuardedShaker(std::shared_ptr<Shaker> shaker, const ShakerLimits& limits)
    : shaker_(std::move(shaker)), limits_(limits) {}

std::string GuardedShaker::check(const ExciterCommand& command, double stamp, double now) const {
  const double age = now - stamp;
  if (std::abs(age) > limits_.timeout) {
    return text("stale: it is %g s old: send a new command", age);
  }
  if (now - alive_ > limits_.timeout) {
    return text("no carrier_pose for %g s: a shaker without a bridge stays off", limits_.timeout);
  }
  if (!(command.amplitude <= limits_.max_amplitude)) {
    return text("amplitude is %g N: give at most %g (~max_amplitude)", command.amplitude,
                limits_.max_amplitude);
  }
  if (!(command.frequency > 0.0 && command.frequency <= limits_.max_frequency)) {
    return text("frequency is %g rad/s: give more than 0, at most %g (~max_frequency)",
                command.frequency, limits_.max_frequency);
  }
  return shaker_->cannot(command);
}

std::string GuardedShaker::drive(const ExciterCommand& command, double stamp, double now) {
  if (command.amplitude == 0.0) {
    switchOff("", now);
    return {};
  }
  std::string why = check(command, stamp, now);
  if (!why.empty()) {
    ++refused_;
    return why;
  }
  reason_.clear();
  on_ = true;
  shaker_->drive(command, stamp, now);
  return {};
}

void GuardedShaker::switchOff(const std::string& reason, double now) {
  reason_ = reason;
  on_ = false;
  shaker_->drive({}, now, now);
}

bool GuardedShaker::work(double now) {
  const double silence = now - alive_;
  const bool expired = on_ && std::abs(silence) > limits_.timeout;
  if (expired) switchOff(text("no carrier_pose for %g s", silence), now);
  try {
    shaker_->work(now);
  } catch (const std::exception& error) {
    reason_ = error.what();
    throw;
  }
  return expired;
}

}  // namespace assembly_cell
