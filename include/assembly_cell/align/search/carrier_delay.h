// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "assembly_cell/align/search/step.h"

namespace assembly_cell {

/// How late a carrier follows its commands, as an arm does behind its controller and network. In
/// steps of kStepTime.
struct CarrierDelay {
  static constexpr int kPrompt = 1;  ///< lag of a carrier that follows at once
  static constexpr int kMost = 25;   ///< greatest lag that is allowed for: 0.5 s

  int steps = kPrompt;    ///< largest lag seen in a descent, over a step's travel at full speed
  int answer = 0;         ///< largest time seen from a command until the carrier moves
  int since_command = 0;  ///< time since the last command
  int to_end = 0;         ///< time until the last move has certainly ended, if the pose is noisy

  /// Steps from a command until its effect has begun; 0 for a carrier that follows at once.
  int toEffect() const { return steps > kPrompt ? std::max(steps, answer) + 1 : 0; }
  /// Factor of the speed before a contact and of the gains in contact, 1 for a carrier that follows
  /// at once. With it the overtravel after a contact grows with the square root of the delay.
  double slowing() const { return (kPrompt + 1.0) / (steps + 1.0); }
  /// Factor of the time limits. A move is complete a step after the carrier has answered.
  double longer() const { return (std::max(steps, answer - 1) + 1.0) / (kPrompt + 1.0); }
  /// Delay of an arm whose force reacts to a command after `reaction` [s], half a step later than
  /// its pose. A descent that is slowed by slowing() lags by 2·sqrt(n) - 1 steps at a delay of n.
  static CarrierDelay ofArm(double reaction) {
    CarrierDelay late;
    late.answers(reaction);
    late.measure(2.0 * std::sqrt(std::max(0.0, reaction / kStepTime - 0.5)) - 1.0);
    return late;
  }
  /// Includes a measured time from a command until the carrier moves [s].
  void answers(double time) {
    answer = std::max(answer, static_cast<int>(std::min<double>(time / kStepTime + 0.5, kMost)));
  }
  /// Includes a measured lag of a descent, see `steps`. Above kMost it is that of a carrier which
  /// is too slow, not late.
  void measure(double behind) {
    steps = std::max(steps, static_cast<int>(std::min<double>(behind, kMost)));
  }
};

/// Measures the delay of a carrier behind the commands of a descent: the time since the height that
/// it reports was commanded. Times in [s] of the plant's clock, heights in [m].
class DelayMeter {
 public:
  /// Begins a descent from rest at this height.
  void begin(double height, double time);
  /// Records a command.
  void command(double height, double time);
  /// Records a reported height, whose noise has the standard deviation `noise`.
  void report(double height, double time, double noise);
  /// The delay, once it has been constant for several steps. [s]
  std::optional<double> settled() const;
  /// Time since the first command, as long as the carrier hasn't moved. [s]
  double still() const { return still_; }

 private:
  static constexpr std::size_t kKept = 64, kSteps = 6;
  struct Command {
    double height, time;
  };
  std::array<Command, kKept> commands_{};
  std::size_t count_ = 0;
  std::array<double, kSteps> delays_{};
  std::size_t delay_count_ = 0;
  double still_ = 0.0;
};

}  // namespace assembly_cell
