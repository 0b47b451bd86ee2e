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
  /// So many steps is a carrier behind that follows at once.
  static constexpr int kPrompt = 1;
  static constexpr int kMost = 25;  ///< 0.5 s

  int steps = kPrompt;    ///< largest lag of a descent, over the travel of a step at full speed
  int answer = 0;         ///< largest time from a command until the carrier moves
  int since_command = 0;  ///< steps since the last command
  int to_end = 0;         ///< steps to the certain end of the last move, where the pose is noisy

  /// Steps from a command until its effect has begun; 0 for a carrier that follows at once.
  int toEffect() const { return steps > kPrompt ? std::max(steps, answer) + 1 : 0; }
  /// Factor of the speed before a contact and of the gains in contact, 1 for a carrier that follows
  /// at once. Overtravel after a contact then grows with the square root of the delay.
  double slowing() const { return (kPrompt + 1.0) / (steps + 1.0); }
  /// Factor of the time limits: a move is complete a step after its answer.
  double longer() const { return (std::max(steps, answer - 1) + 1.0) / (kPrompt + 1.0); }
  /// That of an arm which reacts so long after a contact [s], half a step later than it moves. A
  /// descent whose speed falls with its lag by slowing() lags by 2·sqrt(n) - 1 steps after n.
  static CarrierDelay ofArm(double reaction) {
    CarrierDelay late;
    late.answers(reaction);
    late.measure(2.0 * std::sqrt(std::max(0.0, reaction / kStepTime - 0.5)) - 1.0);
    return late;
  }
  /// Takes the time from a command until the carrier moves [s].
  void answers(double time) {
    answer = std::max(answer, static_cast<int>(std::min<double>(time / kStepTime + 0.5, kMost)));
  }
  /// Takes a lag of a descent, see `steps`; more than kMost is that of a carrier that is too slow.
  void measure(double behind) {
    steps = std::max(steps, static_cast<int>(std::min<double>(behind, kMost)));
  }
};

/// Delay of a carrier behind the commands of a descent: how long ago it was sent to where it is.
/// Times in [s] of the plant's clock, heights in [m].
class DelayMeter {
 public:
  /// A descent begins at rest at this height.
  void begin(double height, double time);
  /// The carrier is sent down to this height, at this time.
  void command(double height, double time);
  /// The height that it reports. Noise of a standard deviation `noise` is no motion.
  void report(double height, double time, double noise);
  /// Once it hasn't changed for several steps.
  std::optional<double> settled() const;
  /// The carrier hasn't moved since the first command, so long ago. [s]
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
