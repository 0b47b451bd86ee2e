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

/// Time limit of a search.
struct TimeLimit {
  double seconds = std::numeric_limits<double>::infinity();
  bool for_prompt = false;  ///< a late carrier has CarrierDelay::longer() times as much
  double spent = 0.0;       ///< part of it that was used up before [s]

  /// The limit `given`; if it is 0, `otherwise`, for a carrier without delay; if both are 0, none.
  /// Times in [s].
  static TimeLimit of(double given, double otherwise, double spent = 0.0) {
    if (given > 0.0) return {given, false, spent};
    if (otherwise > 0.0) return {otherwise, true, spent};
    return {};
  }
  double at(const CarrierDelay& delay) const {
    return for_prompt ? seconds * delay.longer() : seconds;
  }
};

/// Limits of the motions of a search.
struct PressLimits {
  double force = 40.0;          ///< abort above this contact force [N]
  double descent = 0.02;        ///< abort after this travel down without a contact [m]
  double approach_step = 1e-4;  ///< travel down in one block before a contact [m]
  double compliance = 5e-4;     ///< travel per force above which a press has lost its contact [m/N]
  Scale scale;                  ///< of the mechanism
  PegWeight weight;             ///< see ContactSensor
  TimeLimit time;
  double arm_delay = 0.0;  ///< delay of an arm; 0: no arm, or unknown [s]
  ArmResponse arm;  ///< measured response, compared with the first descent's; delay_sd 0: none
};

/// The default limits, with steps, compliance, scale and weight of a mechanism.
PressLimits pressLimits(const Mechanism& mechanism);

/// Blocks that a motion of the carrier or a settling peg may take.
inline constexpr int kMotionBlocks = 200;

/// Metres of travel that a radian counts as, in distances between poses.
inline constexpr double kTurnArm = 0.1;

/// What counts as a peg at rest: the force changes by less than `force` from block to block, for
/// `blocks` blocks in a row.
struct Rest {
  double force = 0.03;  ///< in the default cell; times Scale::still in others [N]
  int blocks = 3;
};

/// How GuardedCarrier::moveTo() ends.
enum class Move {
  kToTheEnd,  ///< at the target
  /// Some blocks before the end is certain, if the reported pose is noisy. That is enough before a
  /// tare. The next move waits for the end first: a carrier that gets a distant target while it
  /// brakes overshoots (6 mm in 20 mm).
  kNearly,
  /// As kNearly, for a peg that should touch nothing on the way. Throws `force_limit` far below the
  /// limit, since the force rises until the carrier has stopped.
  kFree,
};

/// Moves the carrier of a plant and checks the contact force in every block. All commands of a
/// search pass through step().
class GuardedCarrier {
 public:
  /// Waits for the first block. Throws PlantError.
  GuardedCarrier(Plant& plant, const PressLimits& limits);

  /// Sends a command and waits for the next block. Once there is a tare it throws AlignError
  /// `force_limit`, with the carrier stopped, and `sensor_saturated`; always `time_limit`, and
  /// PlantError when the plant fails. `force_limit`: lower than that of the limits [N].
  const PlantBlock& step(const PlantCommand& command,
                         double force_limit = std::numeric_limits<double>::infinity());
  /// step() without a command, `blocks` times.
  const PlantBlock& wait(int blocks);
  /// Sends the exciter's setting with the next step, unless that command sets it.
  void exciterNext(const ExciterParameters& exciter) { exciter_ = exciter; }
  /// Whether step() checks force, saturation and time; true at first.
  void setGuarded(bool guarded) { checks_.on = guarded; }
  /// Sets the time limit, counted from the last block.
  void limitTime(const TimeLimit& limit);

  const PlantBlock& last() const { return sensor_.last(); }
  const ContactSensor& sensor() const { return sensor_; }
  Eigen::Vector3d force() const { return sensor_.force(); }  ///< see ContactSensor
  const PressLimits& limits() const { return limits_; }
  const RestPose& target() const { return target_; }
  /// Noise of the carrier's reported pose, from the blocks of all tares so far.
  ReportNoise reportNoise() const { return meter_.noise(); }

  /// Takes the zero of force and deflection of the free peg: waits until it is at rest, then
  /// averages `blocks` blocks. Throws AlignError `not_still`.
  void tare(int blocks = 10, const Rest& rest = {});
  /// See ContactSensor::clearTare(). Forces are not checked until the next tare.
  void clearTare() { sensor_.clearTare(); }
  /// Waits until the peg is at rest; false if it doesn't come to rest. Throws AlignError
  /// `sensor_saturated` if a channel stays at its limit.
  bool settle(const Rest& rest = {});

  /// Moves the carrier to a rest pose and waits until it is there. Throws AlignError `not_arrived`.
  void moveTo(const RestPose& target, Move move = Move::kToTheEnd);
  /// Moves the carrier by as little as it can move in a block. `alarm`: instead of that of the
  /// force limit.
  void nudge(const RestPose& target, const std::optional<ForceAlarm>& alarm = std::nullopt);

  CarrierDelay delay;  ///< delay of plant and carrier together; PressController measures it

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

/// Waits until the last command has had its effect on a carrier that answers late. False if it has
/// had it already.
bool awaitEffect(GuardedCarrier& carrier);

/// Switches the exciter off and waits for a block.
void exciterOff(GuardedCarrier& carrier, int direction = 1);

}  // namespace assembly_cell
