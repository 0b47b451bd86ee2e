// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <limits>
#include <optional>

#include "assembly_cell/align/plant.h"
#include "assembly_cell/align/search/carrier_delay.h"
#include "assembly_cell/align/search/contact_sensor.h"
#include "assembly_cell/align/search/report_noise.h"
#include "assembly_cell/align/search/scale.h"
#include "assembly_cell/mechanism/mechanism.h"

namespace assembly_cell {

/// Time that a search may take.
struct TimeLimit {
  double seconds = std::numeric_limits<double>::infinity();
  bool for_prompt = false;  ///< a carrier that is late has more, by CarrierDelay::longer()
  double spent = 0.0;       ///< of it, before [s]

  /// `given`, or where it is 0 `otherwise` for a prompt carrier, or where that is 0, too, none. [s]
  static TimeLimit of(double given, double otherwise, double spent = 0.0) {
    if (given > 0.0) return {given, false, spent};
    if (otherwise > 0.0) return {otherwise, true, spent};
    return {};
  }
  double at(const CarrierDelay& delay) const {
    return for_prompt ? seconds * delay.longer() : seconds;
  }
};

/// Limits of whatever moves the carrier.
struct PressLimits {
  double force = 40.0;          ///< abort above this contact force [N]
  double descent = 0.02;        ///< abort without contact after this travel down [m]
  double approach_step = 1e-4;  ///< travel down in one block before contact [m]
  double compliance = 5e-4;     ///< travel per force while pressing: more is no contact [m/N]
  Scale scale;                  ///< of the mechanism
  PegWeight weight;             ///< see ContactSensor
  TimeLimit time;
  double arm_delay = 0.0;  ///< of an arm, where it is given [s]
  ArmResponse arm;         ///< that a descent has to agree with; delay_sd 0: none
};

/// The limits for a mechanism: default ones with its steps, compliance, scale and weight.
PressLimits pressLimits(const Mechanism& mechanism);

/// Blocks that a motion of the carrier or a settling peg may take.
inline constexpr int kMotionBlocks = 200;

/// Metres of travel that count as much as a radian.
inline constexpr double kTurnArm = 0.1;

/// What counts as a peg at rest: a change of force from block to block, so many times in a row.
struct Rest {
  double force = 0.03;  ///< times Scale::still [N]
  int blocks = 3;
};

/// How GuardedCarrier::moveTo() ends.
enum class Move {
  kToTheEnd,
  /// A little early where the reported pose is noisy, which is enough before a tare. A move that
  /// follows waits for the end first: a carrier that gets a far target while it brakes overshoots
  /// (6 mm in 20 mm).
  kNearly,
  /// As kNearly, of a peg that touches nothing on the way: `force_limit` long before the limit,
  /// since the force rises until the carrier stands.
  kFree,
};

/// Moves the carrier of a plant, with the contact force checked in every block. All commands of a
/// search pass through step().
class GuardedCarrier {
 public:
  /// Waits for the first block. Throws PlantError.
  GuardedCarrier(Plant& plant, const PressLimits& limits);

  /// One block with a command. Throws AlignError `force_limit`, with the carrier held, or
  /// `sensor_saturated` once there is a tare, `time_limit`, PlantError when the plant fails.
  /// `force_limit`: below that of the limits [N].
  const PlantBlock& step(const PlantCommand& command,
                         double force_limit = std::numeric_limits<double>::infinity());
  const PlantBlock& wait(int blocks);
  /// The exciter goes out with the next step, unless that command sets it.
  void exciterNext(const ExciterParameters& exciter) { exciter_ = exciter; }
  /// Whether step() checks force, saturation and time; true at first.
  void setGuarded(bool guarded) { checks_.on = guarded; }
  /// Counts from the last block.
  void limitTime(const TimeLimit& limit);

  const PlantBlock& last() const { return sensor_.last(); }
  const ContactSensor& sensor() const { return sensor_; }
  Eigen::Vector3d force() const { return sensor_.force(); }  ///< see ContactSensor
  const PressLimits& limits() const { return limits_; }
  const RestPose& target() const { return target_; }
  /// Of the carrier's pose, on the blocks of all tares so far.
  ReportNoise reportNoise() const { return meter_.noise(); }

  /// Hanging free: waits until still, then takes the mean of `blocks` blocks as zero of force and
  /// deflection. Throws AlignError `not_still`.
  void tare(int blocks = 10, const Rest& rest = {});
  /// The next tare counts as the first one; nothing is checked until then.
  void clearTare() { sensor_.clearTare(); }
  /// Waits until blocks in a row agree; false: they never do. Throws AlignError `sensor_saturated`
  /// where a channel stays at its limit.
  bool settle(const Rest& rest = {});

  /// Moves the rest pose and waits until it is there. Throws AlignError `not_arrived`.
  void moveTo(const RestPose& target, Move move = Move::kToTheEnd);
  /// A step that a block has time for. `alarm`: instead of that of the force limit.
  void nudge(const RestPose& target, const std::optional<ForceAlarm>& alarm = std::nullopt);

  CarrierDelay delay;  ///< of plant and carrier together; PressController measures it

 private:
  Plant& plant_;
  PressLimits limits_;
  ContactSensor sensor_;
  std::optional<ExciterParameters> exciter_;  // of the next step
  RestPose target_;
  ReportNoiseMeter meter_;  // of the blocks of all tares
  struct {
    bool on = true;
    double begin = 0.0;  // of limits_.time, plant clock [s]
    int saturated = 0;   // blocks in a row
  } checks_;             // of each step
};

/// Waits until the last command has had an effect on a carrier that answers late. False: it has.
bool awaitEffect(GuardedCarrier& carrier);

/// One block with the exciter off.
void exciterOff(GuardedCarrier& carrier, int direction = 1);

}  // namespace assembly_cell
