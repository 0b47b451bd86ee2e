// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "assembly_cell/arm/arm_bridge.h"

namespace assembly_cell {

Vector6 weightChange(const Payload& payload, const Eigen::Matrix3d& R_zero,
                     const Eigen::Matrix3d& R) {
  Vector6 change;
  change.head<3>() = R.transpose() * payload.weight - R_zero.transpose() * payload.weight;
  change.tail<3>() = payload.centre.cross(change.head<3>());
  return change;
}

ArmBridge::ArmBridge(const ArmGuard& initial, const CellPlace& place, const Payload& payload,
                     const NodeTime& time, std::uint32_t boot_id)
    : initial_(initial),
      place_(place),
      payload_(payload),
      time_(time),
      arm_(initial),
      boot_id_(boot_id),
      received_{initial.limits.sensors == Sensors::kB, false} {}

ArmBridge::Start ArmBridge::start(std::size_t sensor, StampNs end) {
  if (!time_.started()) {
    // With samples of one of two sensors the watchdog would hold the arm at once.
    received_[sensor] = true;
    if (!arm_.guard.lockstep && !(received_[0] && received_[1])) return Start::kWaiting;
    time_.start(end);
  }
  if (sensor != 1 || time_.at(end) >= block_.end - kStampRounding) return Start::kContinues;
  const ArmMode mode = arm_.mode;
  const std::string text = arm_.text;
  arm_ = initial_;
  if (mode == ArmMode::kStopped) {
    stopForGood(arm_, text);
    arm_.text = text;
  }
  ++boot_id_;
  time_.start(end);
  poses_ = BlockPoses();
  return Start::kRestarted;
}

void ArmBridge::setZero(std::size_t sensor, const Vector6& zero) {
  zeros_[sensor] = zero;
  if (sensor == 1 && arm_.state_known) R_zero_ = poseOfCoordinates(arm_.measured).R;
}

void ArmBridge::addBlock(const SensorBlock& block) {
  ContactSamples samples;
  samples.sensor = static_cast<int>(block.sensor);
  samples.values = block.values;
  samples.count = block.count;
  samples.period = block.period;
  samples.end = time_.at(block.end);
  samples.zero = zeros_[block.sensor];
  samples.saturated = block.saturated;
  if (block.sensor == 1 && !payload_.weight.isZero(0.0)) {
    const Vector6 change = weightChange(payload_, R_zero_, poseOfCoordinates(arm_.measured).R);
    values_.resize(6 * block.count);
    for (std::size_t i = 0; i < values_.size(); ++i) {
      values_[i] = block.values[i] - change(static_cast<Eigen::Index>(i % 6));
    }
    samples.values = values_.data();
    samples.zero += change;
  }
  addSamples(arm_, samples);
  if (block.sensor != 1) return;
  time_.observe(block.end);
  block_ = {samples.end, static_cast<double>(block.count) * block.period};
  poses_.addBlock(block_.end);
}

bool ArmBridge::setState(const Pose& X_base_flange, StampNs stamp,
                         const std::string& beyond_limit) {
  // without samples there is no cell time to compare the stamp with
  const bool ready = arm_.guard.lockstep || knowsWrenches(arm_);
  if (!time_.started() || !ready) return false;
  const double time = time_.at(stamp), now = time_.now();
  checkClock(arm_, time, now);
  const bool starts =
      assembly_cell::setState(arm_, place_.carrierOf(X_base_flange), time, beyond_limit);
  // With the stamps of another clock the pose would be that of another time. A state that is only
  // late has the right stamp.
  const bool late = time <= now && arm_.begun && arm_.reason != ArmReason::kClock;
  if (arm_.clock_error.empty() || late) poses_.addState(time, arm_.measured);
  return starts;
}

std::string ArmBridge::missing() const {
  if (time_.started()) return missingData(arm_, time_.now());
  return std::string("no samples of ") + (received_[1]   ? "sensor_a"
                                          : received_[0] ? "sensor_b"
                                                         : "sensor_a and sensor_b");
}

// Latched messages may be received before the first block and the first state.
GuardVerdict ArmBridge::checkStamp(const Sender& sender) const {
  if (!sender.stamped) {
    return {GuardReason::kStale, "stale: it has no stamp: give header.stamp"};
  }
  if (!time_.started() || !arm_.state_known || sender.stamp < -kStampRounding) {
    return {GuardReason::kEarlierBoot,
            "earlier_boot: it is older than this run of the bridge: send it again"};
  }
  return {};
}

GuardVerdict ArmBridge::move(const std::string& node, StampNs stamp, const Pose& X) {
  const Sender sender{node, time_.at(stamp), stamp != 0, false};
  const GuardVerdict verdict = checkStamp(sender);
  return verdict.good() ? assembly_cell::move(arm_, sender, X, time_.now()) : verdict;
}

GuardVerdict ArmBridge::drive(const std::string& node, StampNs stamp,
                              const ExciterCommand& exciter) {
  const Sender sender{node, time_.at(stamp), stamp != 0, false};
  const GuardVerdict verdict = exciter.amplitude == 0.0 ? GuardVerdict() : checkStamp(sender);
  return verdict.good() ? assembly_cell::drive(arm_, sender, exciter, time_.now()) : verdict;
}

GuardVerdict ArmBridge::renew(const std::string& node, StampNs stamp, std::uint32_t session) {
  if (!arm_.state_known) return {};
  return assembly_cell::renew(arm_, {node, time_.at(stamp), stamp != 0, false}, session,
                              time_.now());
}

}  // namespace assembly_cell
